//! Drawing: triangles through a depth buffer, lines over them, on the CPU alone.
//!
//! The view is orthographic, from the side, above and ahead. Nothing here knows what the triangles
//! and the lines stand for.

use horma_core::{Interval, Point, cross, dot, length, sub, unit};
use tiny_skia::{LineCap, LineJoin, Paint, PathBuilder, Pixmap, Stroke, Transform};

/// Size of the picture, pixels.
pub const SIZE: (u32, u32) = (1600, 1000);

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

/// Colour of the part: beech.
const BEECH: [f64; 3] = [222.0, 184.0, 135.0];
/// Background, at the top and at the bottom.
const BACKGROUND: [[f64; 3]; 2] = [[250.0, 251.0, 252.0], [226.0, 230.0, 234.0]];
/// Towards the viewer, in the part's axes; z is up.
const VIEWER: Point = [0.42, -0.78, 0.46];
/// Towards the light, in the picture's axes: right, up, and out of it.
const LIGHT: Point = [-0.38, 0.62, 0.69];
/// Samples along each side of a pixel.
const SAMPLES: usize = 2;
/// Part of the picture's width and height that is left free around the part.
const MARGIN: f64 = 0.05;
/// A piece of a line this many times longer than the mean one is a jump, as where a cutter bridges a
/// hollow and its contact changes sides: it is not drawn.
const JUMP: f64 = 8.0;
/// A line is hidden only by what lies this much nearer, mm: the chords of a path dip into the part.
const SUNK: f64 = 0.35;

/// The part's triangles with the lines over them, as a PNG file of [`SIZE`]. Lines are drawn in
/// order and are hidden where the part is in front of them. What is not finite is left out.
pub fn png(triangles: &[[Point; 3]], lines: &[Polyline]) -> Vec<u8> {
    let view = View::new(triangles, lines);
    let canvas = Canvas::new(&view, triangles);
    let mut picture = canvas.resolve();
    for line in lines {
        stroke(&mut picture, &view, &canvas, line);
    }
    let png = picture.encode_png();
    png.expect("a picture of this size can be encoded in memory")
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
    fn new(triangles: &[[Point; 3]], lines: &[Polyline]) -> Self {
        let z = [0.0, 0.0, 1.0];
        let out = unit(VIEWER).expect("the viewer is somewhere");
        let right = unit(cross(z, out)).expect("the viewer is not above");
        let up = cross(out, right);
        let path = lines.iter().flat_map(|l| l.points.iter().flatten());
        let points = || triangles.iter().flatten().chain(path.clone());
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
}

/// The samples: how far towards the viewer the part lies there, and how bright it is.
struct Canvas {
    width: usize,
    height: usize,
    depth: Vec<f32>,
    light: Vec<f32>,
}

impl Canvas {
    fn new(view: &View, triangles: &[[Point; 3]]) -> Self {
        let (width, height) = (SIZE.0 as usize * SAMPLES, SIZE.1 as usize * SAMPLES);
        let mut canvas = Self {
            width,
            height,
            depth: vec![f32::NEG_INFINITY; width * height],
            light: vec![0.0; width * height],
        };
        for &[a, b, c] in triangles {
            // A triangle without an area covers no sample, and one that is not finite none either.
            if let Some(normal) = unit(cross(sub(b, a), sub(c, a))) {
                let corners = [a, b, c].map(|p| view.project(p));
                canvas.fill(corners, shade(view, normal) as f32);
            }
        }
        canvas
    }

    fn fill(&mut self, [a, b, c]: [Point; 3], light: f32) {
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
        if area == 0.0 || !area.is_finite() {
            return;
        }
        let range = |k: usize, count: usize| {
            let i = Interval::of([a[k], b[k], c[k]]);
            let first = (i.low - 0.5).ceil().max(0.0) as usize;
            let end = (i.high + 0.5).ceil().clamp(0.0, count as f64) as usize;
            first..end
        };
        let share = |p: Point, q: Point, x: f64, y: f64| {
            ((q[0] - p[0]) * (y - p[1]) - (x - p[0]) * (q[1] - p[1])) / area
        };
        for row in range(1, self.height) {
            for column in range(0, self.width) {
                let (x, y) = (column as f64 + 0.5, row as f64 + 0.5);
                let (u, v, w) = (share(b, c, x, y), share(c, a, x, y), share(a, b, x, y));
                if u < 0.0 || v < 0.0 || w < 0.0 {
                    continue;
                }
                let depth = (u * a[2] + v * b[2] + w * c[2]) as f32;
                let sample = row * self.width + column;
                if depth > self.depth[sample] {
                    self.depth[sample] = depth;
                    self.light[sample] = light;
                }
            }
        }
    }

    /// The picture: each pixel the mean of its samples.
    fn resolve(&self) -> Pixmap {
        let mut picture = Pixmap::new(SIZE.0, SIZE.1).expect("the size is not zero");
        let columns = SIZE.0 as usize;
        for (i, pixel) in picture.pixels_mut().iter_mut().enumerate() {
            let (row, column) = (i / columns, i % columns);
            let t = row as f64 / f64::from(SIZE.1);
            let behind: [f64; 3] =
                std::array::from_fn(|k| BACKGROUND[0][k] * (1.0 - t) + BACKGROUND[1][k] * t);
            let mut sum = [0.0; 3];
            for k in 0..SAMPLES * SAMPLES {
                let (y, x) = (row * SAMPLES + k / SAMPLES, column * SAMPLES + k % SAMPLES);
                let sample = y * self.width + x;
                let light = f64::from(self.light[sample]);
                let colour = match self.depth[sample] {
                    f32::NEG_INFINITY => behind,
                    _ => BEECH.map(|c| c * light),
                };
                sum = std::array::from_fn(|k| sum[k] + colour[k].min(255.0));
            }
            let [r, g, b] = sum.map(|s| (s / (SAMPLES * SAMPLES) as f64).round() as u8);
            *pixel = tiny_skia::ColorU8::from_rgba(r, g, b, 255).premultiply();
        }
        picture
    }

    /// Whether the part is in front of a projected point.
    fn hides(&self, p: Point) -> bool {
        let inside = |c: f64, count: usize| c >= 0.0 && c < count as f64;
        inside(p[0], self.width)
            && inside(p[1], self.height)
            && f64::from(self.depth[p[1] as usize * self.width + p[0] as usize]) > p[2] + SUNK
    }
}

/// Brightness of a facet. Both its sides are lit, since a mesh may be turned inside out.
fn shade(view: &View, normal: Point) -> f64 {
    let seen = [view.right, view.up, view.out].map(|axis| dot(normal, axis));
    let seen = if seen[2] < 0.0 {
        seen.map(|c| -c)
    } else {
        seen
    };
    let light = unit(LIGHT).unwrap_or(LIGHT);
    let diffuse = dot(seen, light).max(0.0);
    let halfway = unit([light[0], light[1], light[2] + 1.0]).unwrap_or(light);
    let gloss = dot(seen, halfway).max(0.0).powi(24);
    0.42 + 0.08 * seen[1] + 0.57 * diffuse + 0.1 * gloss
}

/// Draws the pieces of a line that the part does not hide.
fn stroke(picture: &mut Pixmap, view: &View, canvas: &Canvas, line: &Polyline) {
    let pieces = line.points.windows(2).filter_map(|w| w[0].zip(w[1]));
    let lengths: Vec<f64> = pieces
        .map(|(a, b)| length(sub(b, a)))
        .filter(|l| l.is_finite())
        .collect();
    let longest = JUMP * lengths.iter().sum::<f64>() / lengths.len() as f64;
    let mut path = PathBuilder::new();
    let mut previous: Option<Point> = None;
    let mut drawing = false;
    for &point in line.points {
        let visible = previous.zip(point).and_then(|(a, b)| {
            // A comparison that holds for what is finite only.
            let near = length(sub(b, a)) <= longest;
            let [a, b] = [a, b].map(|p| view.project(p));
            let middle = std::array::from_fn(|k| 0.5 * (a[k] + b[k]));
            (near && !canvas.hides(middle) && !canvas.hides(b)).then_some((a, b))
        });
        if let Some((a, b)) = visible {
            let pixel = |c: f64| c as f32 / SAMPLES as f32;
            if !drawing {
                path.move_to(pixel(a[0]), pixel(a[1]));
            }
            path.line_to(pixel(b[0]), pixel(b[1]));
        }
        drawing = visible.is_some();
        previous = point;
    }
    let mut paint = Paint::default();
    let [r, g, b] = line.colour;
    paint.set_color_rgba8(r, g, b, 255);
    let style = Stroke {
        width: line.width,
        line_cap: LineCap::Round,
        line_join: LineJoin::Round,
        ..Stroke::default()
    };
    if let Some(path) = path.finish() {
        picture.stroke_path(&path, &paint, &style, Transform::identity(), None);
    }
}

#[cfg(test)]
mod tests;
