//! Drawing: triangles through a depth buffer, lines over them, on the CPU alone.
//!
//! The view is orthographic, from the side, above and ahead. Nothing here knows what the triangles
//! and the lines stand for.

mod canvas;
mod pen;

use horma_core::{Interval, Point, cross, dot, unit};

use self::canvas::Canvas;
use super::sheet::Sheet;
use crate::raster;

/// Size of the picture, pixels.
pub const SIZE: (u32, u32) = (1200, 750);

/// A red, green and blue.
pub type Colour = [u8; 3];

/// A line over the part; it is interrupted at each `None`.
#[derive(Debug, Clone, Copy)]
pub struct Polyline<'a> {
    /// Its points, mm.
    pub points: &'a [Option<Point>],
    /// Its colour.
    pub colour: Colour,
    /// Its width, pixels.
    pub width: f32,
}

/// Background, at the top and at the bottom.
const BACKGROUND: [[f64; 3]; 2] = [[250.0, 251.0, 252.0], [226.0, 230.0, 234.0]];
/// Towards the viewer, in the part's axes; z is up.
const VIEWER: Point = [0.42, -0.78, 0.46];
/// Samples along each side of a pixel.
const SAMPLES: usize = 2;
/// Part of the picture's width and height that is left free around the part.
const MARGIN: f64 = 0.05;

/// The part's sheets with the lines over them, as a PNG file of [`SIZE`]. Lines are drawn in
/// order and are hidden where the part is in front of them. What is not finite is left out.
pub fn png(sheets: &[Sheet], lines: &[Polyline]) -> Vec<u8> {
    let view = View::new(sheets, lines);
    let canvas = Canvas::new(&view, sheets);
    let mut picture = background();
    canvas.show(&mut picture);
    for line in lines {
        pen::draw(&mut picture, &view, &canvas, line);
    }
    raster::png(&picture, SIZE).expect("a picture of this size can be encoded in memory")
}

/// Light above, darker below.
fn background() -> Vec<Colour> {
    let (columns, rows) = (SIZE.0 as usize, SIZE.1 as usize);
    let mut picture = Vec::with_capacity(columns * rows);
    for row in 0..rows {
        let t = row as f64 / rows as f64;
        let level = |k: usize| BACKGROUND[0][k] * (1.0 - t) + BACKGROUND[1][k] * t;
        let colour = std::array::from_fn(|k| level(k).round() as u8);
        picture.resize(picture.len() + columns, colour);
    }
    picture
}

/// From the part to the samples of the picture.
struct View {
    right: Point,
    up: Point,
    out: Point,
    scale: f64,
    /// What is added once it is scaled: samples.
    shift: [f64; 2],
}

impl View {
    /// The view in which everything fits.
    fn new(sheets: &[Sheet], lines: &[Polyline]) -> Self {
        let z = [0.0, 0.0, 1.0];
        let out = unit(VIEWER).expect("the viewer is somewhere");
        let right = unit(cross(z, out)).expect("the viewer is not above");
        let up = cross(out, right);
        let path = lines.iter().flat_map(|l| l.points.iter().flatten());
        let points = || sheets.iter().flat_map(|s| &s.points).chain(path.clone());
        let finite = || points().filter(|p| p.iter().all(|c| c.is_finite()));
        let extent = |axis: Point| Interval::of(finite().map(|&p| dot(p, axis)));
        let extents = [extent(right), extent(up)];
        let size = [SIZE.0, SIZE.1].map(|s| f64::from(s) * SAMPLES as f64);
        let fits = |k: usize| {
            let length = extents[k].high - extents[k].low;
            size[k] * (1.0 - 2.0 * MARGIN) / length.max(1.0e-6)
        };
        let scale = fits(0).min(fits(1));
        let shift = |k: usize| 0.5 * size[k] - 0.5 * scale * (extents[k].low + extents[k].high);
        Self {
            right,
            up,
            out,
            scale,
            shift: [shift(0), shift(1)],
        }
    }

    /// Sample from the left and from the top, and depth towards the viewer in mm.
    fn project(&self, p: Point) -> Point {
        let height = f64::from(SIZE.1) * SAMPLES as f64;
        let x = dot(p, self.right) * self.scale + self.shift[0];
        let y = dot(p, self.up) * self.scale + self.shift[1];
        [x, height - y, dot(p, self.out)]
    }

    /// A direction of the part as it is seen: right, up, and out of the picture.
    fn turn(&self, direction: Point) -> Point {
        [self.right, self.up, self.out].map(|axis| dot(direction, axis))
    }
}

#[cfg(test)]
mod tests;
