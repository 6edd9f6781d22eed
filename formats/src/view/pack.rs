//! Numbers inside a page: JSON for few, base 64 of little-endian bytes for many.

use std::io::{self, Write};

use base64::display::Base64Display;
use base64::engine::general_purpose::STANDARD;
use horma_core::Point;
use serde::Serialize;

/// Coordinates are counted in so many parts of the box that all lie in.
const PARTS: f64 = 65535.0;

/// The box that points lie in; a single point if there are none.
pub(super) fn bounds(points: impl Iterator<Item = Point>) -> (Point, Point) {
    let first = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    let (low, high) = points.fold(first, |(low, high), p| {
        (
            std::array::from_fn(|k| low[k].min(p[k])),
            std::array::from_fn(|k| high[k].max(p[k])),
        )
    });
    if low[0] <= high[0] {
        (low, high)
    } else {
        ([0.0; 3], [0.0; 3])
    }
}

/// A point of the box in 6 bytes: 4 µm are told apart on a last.
pub(super) fn place(p: Point, low: Point, high: Point) -> [u8; 6] {
    let mut bytes = [0; 6];
    for k in 0..3 {
        bytes[2 * k..][..2].copy_from_slice(&part(p[k], low[k], high[k]));
    }
    bytes
}

/// A number between two others, as parts of what is between them.
pub(super) fn part(value: f64, low: f64, high: f64) -> [u8; 2] {
    let size = high - low;
    let share = if size > 0.0 {
        (value - low) / size
    } else {
        0.0
    };
    ((share * PARTS + 0.5) as u16).to_le_bytes()
}

/// An element with `value` as JSON, in which nothing can end the element.
pub(super) fn json(out: &mut impl Write, id: &str, value: &impl Serialize) -> io::Result<()> {
    let text = serde_json::to_string(value)?.replace('<', "\\u003c");
    writeln!(
        out,
        "<script type=\"application/json\" id=\"{id}\">{text}</script>"
    )
}

/// An element with the bytes of many numbers.
pub(super) fn block<const N: usize>(
    out: &mut impl Write,
    id: &str,
    numbers: impl Iterator<Item = [u8; N]>,
) -> io::Result<()> {
    write!(out, "<script type=\"text/plain\" id=\"{id}\">")?;
    // Encoded all at once, which takes a tenth of the time that a few bytes after the other take.
    let mut bytes = Vec::with_capacity(N * numbers.size_hint().0);
    for number in numbers {
        bytes.extend_from_slice(&number);
    }
    write!(out, "{}", Base64Display::new(&bytes, &STANDARD))?;
    writeln!(out, "</script>")
}
