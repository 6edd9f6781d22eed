//! Lines over the part.
//!
//! All of a line is gathered as coverage of pixels before any colour is mixed, so that its pieces do
//! not show where they meet.

use horma_core::{Point, length, sub};

use super::{Canvas, Colour, Polyline, SAMPLES, SIZE, View};

/// A piece of a line this many times longer than the mean one is a jump, as where a cutter bridges a
/// hollow and its contact changes sides: it is not drawn.
const JUMP: f64 = 8.0;

/// Draws the pieces of a line that the part does not hide.
pub(super) fn draw(picture: &mut [Colour], view: &View, canvas: &Canvas, line: &Polyline) {
    let pieces = line.points.windows(2).filter_map(|w| w[0].zip(w[1]));
    let lengths = pieces.map(|(a, b)| length(sub(b, a)));
    let (sum, count) = lengths
        .filter(|l| l.is_finite())
        .fold((0.0, 0), |(sum, count), l| (sum + l, count + 1));
    let longest = JUMP * sum / f64::from(count);

    let mut coverage = vec![0; picture.len()];
    let mut previous: Option<(Point, Point)> = None;
    for &point in line.points {
        let point = point.map(|p| (p, view.project(p)));
        if let (Some((from, a)), Some((to, b))) = (previous, point) {
            // A comparison that holds for what is finite only.
            let near = length(sub(to, from)) <= longest;
            let middle = std::array::from_fn(|k| 0.5 * (a[k] + b[k]));
            if near && !canvas.hides(middle) && !canvas.hides(b) {
                let pixel = |p: Point| [p[0], p[1]].map(|c| c as f32 / SAMPLES as f32);
                cover(&mut coverage, pixel(a), pixel(b), line.width);
            }
        }
        previous = point;
    }
    for (pixel, &share) in picture.iter_mut().zip(&coverage) {
        if share > 0 {
            mix(pixel, line.colour, share);
        }
    }
}

/// Raises the coverage of each pixel to what a piece with round ends covers of it, in 255ths.
fn cover(coverage: &mut [u8], a: [f32; 2], b: [f32; 2], width: f32) {
    // A pixel counts as a disc of diameter 1: it is covered in part as far as half of it away.
    let reach = 0.5 * width + 0.5;
    let most = width.min(1.0);
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let square = dx * dx + dy * dy;
    let per_square = if square > 0.0 { square.recip() } else { 0.0 };
    // How far to the left and to the right of its middle the piece reaches in each row.
    let half = reach * square.sqrt() / dy.abs();
    let slope = dx / dy;
    let steep = slope.is_finite() && half.is_finite();
    let range = |k: usize| (a[k].min(b[k]) - reach, a[k].max(b[k]) + reach);
    // Pixels whose middles lie between; the casts cut off what is below 0.
    let pixels = |(low, high): (f32, f32), end: u32| {
        (low + 0.5) as usize..((high + 0.5) as usize).min(end as usize)
    };
    let (left, right) = range(0);
    for row in pixels(range(1), SIZE.1) {
        let y = row as f32 + 0.5 - a[1];
        let span = if steep {
            let middle = a[0] + y * slope;
            (left.max(middle - half), right.min(middle + half))
        } else {
            (left, right)
        };
        let columns = pixels(span, SIZE.0);
        if columns.is_empty() {
            continue;
        }
        let first = columns.start as f32 + 0.5 - a[0];
        let start = row * SIZE.0 as usize;
        let line = &mut coverage[start + columns.start..start + columns.end];
        for (i, share) in line.iter_mut().enumerate() {
            let x = first + i as f32;
            let t = ((x * dx + y * dy) * per_square).clamp(0.0, 1.0);
            let (ex, ey) = (x - t * dx, y - t * dy);
            let covered = (reach - (ex * ex + ey * ey).sqrt()).clamp(0.0, most);
            *share = (*share).max((covered * 255.0) as u8);
        }
    }
}

/// Moves `pixel` towards `colour` by `share` 255ths.
fn mix(pixel: &mut Colour, colour: Colour, share: u8) {
    let share = u32::from(share);
    for (old, new) in pixel.iter_mut().zip(colour) {
        let mixed = u32::from(*old) * (255 - share) + u32::from(new) * share;
        *old = ((mixed + 127) / 255) as u8;
    }
}
