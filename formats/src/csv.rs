//! `path.csv`: one line a position, numbers in the shortest form that reads back to the same bits.
//!
//! The index of a position that was inserted between two others has a fraction: 17.25 is a quarter of
//! the way from position 17 to 18.
//!
//! Two runs of the same job give the same bytes, so the file is compared with `cmp`. It does not
//! describe the job; that is the report's.

use std::io::{self, Write};
use std::path::Path;

use horma_core::{Index, Point, Position, ToolPath, Touch, Waypoint, facing_at};

use crate::decimal::integer;
use crate::error::{Error, Result};
use crate::output;

/// The first line of the file.
pub const HEADER: &str = "index,x,angle,y,contact_x,contact_y,contact_z";

/// Text that is gathered before it is handed on, in bytes.
const CHUNK: usize = 1 << 16;

/// One line of a file that was read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// Index of the position.
    pub index: Index,
    /// Travel along the spindle, mm.
    pub x: f64,
    /// Unwound angle, degrees.
    pub angle: f64,
    /// Tool centre along the attack axis, mm; `None` where nothing was in reach.
    pub height: Option<f64>,
    /// The touched point in part coordinates, mm; paths from elsewhere may lack it.
    pub contact: Option<Point>,
}

impl Row {
    /// What a machine is told of it.
    pub fn position(&self) -> Position {
        Position {
            x: self.x,
            angle: self.angle,
            height: self.height,
        }
    }

    /// The position with where a cutter touches whose rim is so many mm from its axis: where the row says, or
    /// else where the rim comes nearest to the spindle.
    pub fn waypoint(&self, rim: f64) -> Waypoint {
        let touch = |height: f64| {
            let nearest = || facing_at(self.x, height - rim, self.angle);
            Touch {
                height,
                contact: self.contact.unwrap_or_else(nearest),
            }
        };
        Waypoint {
            index: self.index,
            x: self.x,
            angle: self.angle,
            touch: self.height.map(touch),
        }
    }
}

/// Writes `path` to `file`: beside it first, then renamed.
///
/// # Errors
/// [`Error::Io`] if the file cannot be written.
pub fn save(file: &Path, path: &ToolPath) -> Result<()> {
    output::write(file, |out| write(path, out))
}

/// Writes `path` to `out`; y and the contact are empty where nothing is in reach.
///
/// # Errors
/// Those of `out`.
pub fn write(path: &ToolPath, out: &mut impl Write) -> io::Result<()> {
    let mut text = Vec::with_capacity(CHUNK + 256);
    text.extend_from_slice(HEADER.as_bytes());
    text.push(b'\n');
    for Waypoint {
        index,
        x,
        angle,
        touch,
    } in path.waypoints()
    {
        integer(&mut text, index.floor());
        if index.parts() > 0 {
            fraction(&mut text, index);
        }
        number(&mut text, x);
        number(&mut text, angle);
        match touch {
            Some(Touch { height, contact }) => {
                number(&mut text, height);
                contact.iter().for_each(|&c| number(&mut text, c));
            }
            None => text.extend_from_slice(b",,,,"),
        }
        text.push(b'\n');
        if text.len() >= CHUNK {
            out.write_all(&text)?;
            text.clear();
        }
    }
    out.write_all(&text)
}

/// The fraction of an index, which its digits give exactly.
fn fraction(text: &mut Vec<u8>, index: Index) {
    let mut rest = u32::from(index.parts());
    text.push(b'.');
    while rest > 0 {
        rest *= 10;
        text.push(b'0' + (rest / u32::from(Index::PARTS)) as u8);
        rest %= u32::from(Index::PARTS);
    }
}

/// A comma and the shortest text that reads back to `value`, without exponent or negative zero.
fn number(text: &mut Vec<u8>, value: f64) {
    text.push(b',');
    let value = value + 0.0;
    let size = value.abs();
    let whole = size as u64;
    if size < LARGE && whole as f64 == size {
        if value < 0.0 {
            text.push(b'-');
        }
        integer(text, whole);
    } else if (SMALL..LARGE).contains(&size) {
        let mut buffer = zmij::Buffer::new();
        text.extend_from_slice(buffer.format_finite(value).as_bytes());
    } else {
        // The same digits, only slower. Writing into memory cannot fail.
        let _ = write!(text, "{value}");
    }
}

/// From here to [`LARGE`] zmij writes no exponent.
const SMALL: f64 = 1.0e-4;
/// 2⁵³: whole numbers below it have no shorter text than their digits, and above it none has a
/// fraction.
const LARGE: f64 = 9_007_199_254_740_992.0;

/// Reads a path: one that [`save`] wrote, or one from elsewhere in the same form.
///
/// # Errors
/// [`Error::Io`] if it cannot be read, and those of [`parse`].
pub fn read(file: &Path) -> Result<Vec<Row>> {
    let text = std::fs::read_to_string(file).map_err(|source| Error::io(file, source))?;
    parse(&text, file)
}

/// Parses the text of the path at `file`.
///
/// # Errors
/// [`Error::BadCsvLine`] for the first line that is not what [`write()`] writes.
pub fn parse(text: &str, file: &Path) -> Result<Vec<Row>> {
    let bad = |line: usize, expected, found: &str| Error::BadCsvLine {
        path: file.to_owned(),
        line,
        expected,
        found: found.to_owned(),
    };
    let mut lines = (1..).zip(text.lines());
    match lines.next() {
        Some((_, HEADER)) => {}
        first => return Err(bad(1, HEADER, first.map_or("", |(_, l)| l))),
    }
    let mut rows = Vec::new();
    for (number, line) in lines {
        let row = row(line).ok_or_else(|| bad(number, SHAPE, line))?;
        if !follows(row.index, rows.last()) {
            return Err(bad(number, "an index that follows the line before", line));
        }
        rows.push(row);
    }
    Ok(rows)
}

/// Whether an index comes after that of the row before: the next whole one, or one between.
fn follows(index: Index, before: Option<&Row>) -> bool {
    let Some(before) = before.map(|b| b.index) else {
        return index == Index::whole(0);
    };
    if index.parts() == 0 {
        index.floor() == before.floor() + 1
    } else {
        index.floor() == before.floor() && index > before
    }
}

/// The index that a text stands for.
fn index_of(text: &str) -> Option<Index> {
    let (whole, parts) = match text.split_once('.') {
        None => return text.parse().ok().map(Index::whole),
        Some((whole, digits)) if digits.bytes().all(|b| b.is_ascii_digit()) => {
            let share: f64 = format!("0.{digits}").parse().ok()?;
            (whole.parse().ok()?, share * f64::from(Index::PARTS))
        }
        Some(_) => return None,
    };
    let exact = parts.fract() == 0.0;
    exact.then(|| Index::between(whole, parts as u16))?
}

/// What a line is, for the message.
const SHAPE: &str = "an index, whole or with a fraction of 1024ths, and six numbers, of which y may be empty and the \
    last three too, but only together";

fn row(line: &str) -> Option<Row> {
    let (index, rest) = line.split_once(',')?;
    let mut fields = [""; 6];
    let mut found = rest.split(',');
    for field in &mut fields {
        *field = found.next()?;
    }
    if found.next().is_some() {
        return None;
    }
    let value = |text: &str| text.parse::<f64>().ok().filter(|n| n.is_finite());
    let [x, angle, y, contact @ ..] = fields;
    let height = if y.is_empty() { None } else { Some(value(y)?) };
    let contact = if contact == [""; 3] {
        None
    } else {
        let [x, y, z] = contact.map(value);
        height?;
        Some([x?, y?, z?])
    };
    Some(Row {
        index: index_of(index)?,
        x: value(x)?,
        angle: value(angle)?,
        height,
        contact,
    })
}

#[cfg(test)]
mod tests {
    use horma_core::{Inserted, MotionKind, Trajectory};

    use super::*;

    fn path() -> ToolPath {
        ToolPath {
            trajectory: Trajectory {
                kind: MotionKind::Helix,
                from: -0.2,
                step: 0.4,
                points_per_revolution: 4,
                positions: 4,
            },
            touches: vec![
                Some(Touch {
                    height: 78.5,
                    contact: [-0.0, 1.0 / 3.0, 1e-7],
                }),
                None,
                Some(Touch {
                    height: 0.1 + 0.2,
                    contact: [1e16, -2.0, -0.0],
                }),
                None,
            ],
            between: Vec::new(),
        }
    }

    /// The same with positions inserted.
    fn finer() -> ToolPath {
        let inserted = |(whole, parts, height)| Inserted {
            index: Index::between(whole, parts).expect("between"),
            touch: Some(Touch {
                height,
                contact: [1.0, 2.0, 3.0],
            }),
        };
        ToolPath {
            between: [(0, 1, 70.0), (0, 512, 60.0), (2, 256, 50.0)]
                .map(inserted)
                .to_vec(),
            ..path()
        }
    }

    #[test]
    fn inserted_positions_have_an_index_with_a_fraction() {
        let expected = "\
index,x,angle,y,contact_x,contact_y,contact_z
0,-0.2,0,78.5,0,0.3333333333333333,0.0000001
0.0009765625,-0.19990234375000002,0.087890625,70,1,2,3
0.5,-0.15000000000000002,45,60,1,2,3
1,-0.1,90,,,,
2,0,180,0.30000000000000004,10000000000000000,-2,0
2.25,0.024999999999999994,202.5,50,1,2,3
3,0.10000000000000003,270,,,,
";
        assert_eq!(text(&finer()), expected);
        assert_eq!(index_of("17.25"), Index::between(17, 256));
        for bad in [
            "1.",
            "1.0",
            ".5",
            "1.3",
            "1.5e0",
            "1.00048828125",
            "-1.5",
            "1.-5",
        ] {
            assert_eq!(index_of(bad), None, "{bad}");
        }
    }

    fn text(path: &ToolPath) -> String {
        let mut out = Vec::new();
        write(path, &mut out).expect("memory");
        String::from_utf8(out).expect("ASCII")
    }

    #[test]
    fn numbers_are_the_shortest_that_round_trip() {
        let expected = "\
index,x,angle,y,contact_x,contact_y,contact_z
0,-0.2,0,78.5,0,0.3333333333333333,0.0000001
1,-0.1,90,,,,
2,0,180,0.30000000000000004,10000000000000000,-2,0
3,0.10000000000000003,270,,,,
";
        assert_eq!(text(&path()), expected);
    }

    #[test]
    fn numbers_are_as_short_as_the_standard_library_writes_them() {
        let mut bits = 1u64;
        for _ in 0..10_000 {
            bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let near = (bits >> 44) as f64 - 5e5;
            for value in [f64::from_bits(bits), bits as f64 * 1e-17, near, near / 1e3] {
                if value.is_finite() {
                    let mut text = Vec::new();
                    number(&mut text, value);
                    let text = String::from_utf8(text).expect("ASCII");
                    assert_eq!(text[1..].parse(), Ok(value));
                    assert_eq!(text.len(), format!(",{value}").len());
                }
            }
        }
    }

    #[test]
    fn what_is_written_reads_back() {
        let dir = tempfile::tempdir().expect("scratch");
        let file = dir.path().join("path.csv");
        for path in [path(), finer()] {
            save(&file, &path).expect("writable");
            let rows = read(&file).expect("own format");
            let row = |w: Waypoint| Row {
                index: w.index,
                x: w.x,
                angle: w.angle,
                height: w.touch.map(|t| t.height),
                contact: w.touch.map(|t| t.contact),
            };
            assert_eq!(rows, path.waypoints().map(row).collect::<Vec<_>>());
        }
    }

    #[test]
    fn a_bad_line_is_named() {
        let dir = tempfile::tempdir().expect("scratch");
        let file = dir.path().join("path.csv");
        let good = text(&path());
        for (bad, line) in [
            (good.replacen("contact_z", "contact", 1), ":1:"),
            (good.replacen("78.5", "", 1), ":2:"),
            (good.replacen("78.5", "NaN", 1), ":2:"),
            (good.replacen("1,-0.1", "3,-0.1", 1), ":3:"),
            (good.replacen("1,-0.1", "1.5,-0.1", 1), ":3:"),
            (good.replacen("0,-0.2", "0.5,-0.2", 1), ":2:"),
            (good.replacen(",,,,", ",,,", 1), ":3:"),
            (good.replacen(",,,,", ",,,,,", 1), ":3:"),
            (good.replacen("180", "18O", 1), ":4:"),
            (String::new(), ":1:"),
        ] {
            std::fs::write(&file, bad).expect("writable");
            let message = read(&file).expect_err("bad line").to_string();
            assert!(message.contains(line), "{message}");
        }
    }
}
