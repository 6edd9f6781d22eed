//! The part as it is seen: which of its points is in front at each sample, and how bright it is.

use horma_core::{Interval, Point, cross, dot, sub, unit};

use super::{Colour, SAMPLES, SIZE, Sheet, View};

/// Colour of the part: beech.
const BEECH: [f32; 3] = [222.0, 184.0, 135.0];
/// Towards the light, in the picture's axes: right, up, and out of it.
const LIGHT: Point = [-0.38, 0.62, 0.69];
/// A line is hidden only by what lies this much nearer, mm: the chords of a path dip into the part.
const SUNK: f64 = 0.35;
/// Cosine between a corner's normal and the facet's below which there is a crease between them, and
/// the corner is lit as the facet is.
const CREASE: f64 = 0.85;
/// Levels of brightness from nothing to the part's own colour; what shines is brighter.
const LEVELS: f64 = 215.0;
/// A triangle of a smaller area, in samples, covers none.
const TINY: f64 = 1.0e-6;

/// Greatest depth, counted from the farthest point, of which the depth is 1.
const DEPTHS: u32 = (1 << 23) - 1;
/// Parts of a depth, and of a level, that are counted across a triangle.
const FINER_DEPTH: f64 = 256.0;
const FINER_LEVEL: f64 = 65536.0;

/// The samples of the rectangle of whole pixels that the part covers.
pub(super) struct Canvas {
    /// Pixels from the left and from the top of the picture.
    origin: [usize; 2],
    /// Samples.
    size: [usize; 2],
    /// Towards the viewer, mm: the farthest point.
    far: f64,
    /// Depths to the millimetre.
    scale: f64,
    /// The depth that is seen and, in eight bits below it, the brightness there, in parts of [`LEVELS`]: of two
    /// such numbers the greater one is in front. Zero where there is nothing.
    samples: Vec<i32>,
}

/// Column, row, depth and light of a triangle's corner.
type Corner = [f64; 4];

impl Canvas {
    pub fn new(view: &View, sheets: &[Sheet]) -> Self {
        let project = |sheet: &Sheet| sheet.points.iter().map(|&p| view.project(p)).collect();
        let seen: Vec<Vec<Point>> = sheets.iter().map(project).collect();
        let mut canvas = Self::around(&seen);
        let lamp = Lamp::new();
        for (sheet, seen) in sheets.iter().zip(&seen) {
            let light = |normal: Point| lamp.light(view.turn(normal));
            let smooth: Vec<f64> = sheet.normals.iter().map(|&n| light(n)).collect();
            for corners in &sheet.triangles {
                let [a, b, c] = corners.map(|k| sheet.points[k as usize]);
                // A triangle without an area covers no sample, and one that is not finite none either.
                let Some(flat) = unit(cross(sub(b, a), sub(c, a))) else {
                    continue;
                };
                let corner = |k: u32| {
                    let k = k as usize;
                    let light = match sheet.normals.get(k) {
                        Some(&normal) if dot(normal, flat) > CREASE => smooth[k],
                        _ => light(flat),
                    };
                    let [x, y, near] = seen[k];
                    [x, y, canvas.depth(near), LEVELS * light + 0.5]
                };
                canvas.fill(corners.map(corner));
            }
        }
        canvas
    }

    /// Room for all points of the picture.
    fn around(points: &[Vec<Point>]) -> Self {
        let pixels = |k: usize, end: u32| {
            let all = points.iter().flatten().map(|p| p[k] / SAMPLES as f64);
            let Interval { low, high } = Interval::of(all.filter(|c| c.is_finite()));
            // Without any point the interval is infinite, and empty once it is cut to the picture.
            let end = high.clamp(0.0, f64::from(end)).ceil() as usize;
            ((low.max(0.0) as usize).min(end), end)
        };
        let (columns, rows) = (pixels(0, SIZE.0), pixels(1, SIZE.1));
        let size = [columns, rows].map(|(first, end)| (end - first) * SAMPLES);
        let near = points.iter().flatten().map(|p| p[2]);
        let near = Interval::of(near.filter(|c| c.is_finite()));
        // Of what is flat towards the viewer all depths are 1.
        let scale = f64::from(DEPTHS - 1) / (near.high - near.low).max(f64::MIN_POSITIVE);
        Self {
            origin: [columns.0, rows.0],
            size,
            far: near.low,
            scale: if scale.is_finite() { scale } else { 0.0 },
            samples: vec![0; size[0] * size[1]],
        }
    }

    /// The depth of what is so near to the viewer, mm.
    fn depth(&self, near: f64) -> f64 {
        1.0 + (near - self.far) * self.scale
    }

    fn fill(&mut self, corners: [Corner; 3]) {
        let [left, top] = self.origin.map(|pixels| (pixels * SAMPLES) as f64);
        let [a, b, c] = corners.map(|[x, y, depth, light]| [x - left, y - top, depth, light]);
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
        if area.abs() < TINY || !area.is_finite() {
            return;
        }
        let samples = |low: f64, high: f64, count: usize| {
            // Middles of samples above the lower end and up to the upper one, so that neighbours
            // share none. The casts cut off what is below 0.
            (low + 0.5) as usize..((high + 0.5) as usize).min(count)
        };
        let Interval { low, high } = Interval::of([a[1], b[1], c[1]]);
        let depth = Plane::new([a, b, c], 2, area, FINER_DEPTH);
        let light = Plane::new([a, b, c], 3, area, FINER_LEVEL);
        let edges = [[a, b], [b, c], [c, a]].map(|[p, q]| {
            let slope = (q[0] - p[0]) / (q[1] - p[1]);
            (p, q, slope)
        });
        for row in samples(low, high, self.size[1]) {
            let y = row as f64 + 0.5;
            let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
            for (p, q, slope) in &edges {
                if (p[1] < y) != (q[1] < y) {
                    let x = p[0] + (y - p[1]) * slope;
                    low = if x < low { x } else { low };
                    high = if x > high { x } else { high };
                }
            }
            let columns = samples(low, high, self.size[0]);
            if columns.is_empty() {
                continue;
            }
            let ends = [columns.start as f64 + 0.5, columns.end as f64 - 0.5];
            let between = columns.len() - 1;
            let (mut depth, deeper) = depth.steps(ends.map(|x| [x, y]), between);
            let (mut level, lighter) = light.steps(ends.map(|x| [x, y]), between);
            let start = row * self.size[0];
            for sample in &mut self.samples[start + columns.start..start + columns.end] {
                // The level goes where the parts of the depth are.
                let here = depth & !0xff | level >> 16;
                *sample = if here > *sample { here } else { *sample };
                depth = depth.wrapping_add(deeper);
                level = level.wrapping_add(lighter);
            }
        }
    }

    /// Puts the part before what is in the picture: each pixel is the mean of its samples.
    pub fn show(&self, picture: &mut [Colour]) {
        let wide = self.size[0];
        let lines = picture.chunks_exact_mut(SIZE.0 as usize);
        let lines = lines.skip(self.origin[1]).take(self.size[1] / SAMPLES);
        for (row, line) in lines.enumerate() {
            let pixels = &mut line[self.origin[0]..self.origin[0] + wide / SAMPLES];
            for (column, pixel) in pixels.iter_mut().enumerate() {
                let first = row * SAMPLES * wide + column * SAMPLES;
                let mut sum = [0.0; 3];
                let mut bare = 0;
                for k in 0..SAMPLES * SAMPLES {
                    let sample = self.samples[first + k / SAMPLES * wide + k % SAMPLES];
                    if sample == 0 {
                        bare += 1;
                    } else {
                        let light = f32::from(sample as u8) / LEVELS as f32;
                        sum = std::array::from_fn(|k| sum[k] + (BEECH[k] * light).min(255.0));
                    }
                }
                if bare < SAMPLES * SAMPLES {
                    let behind = pixel.map(|c| f32::from(c) * bare as f32);
                    let mean = |k: usize| (sum[k] + behind[k]) / (SAMPLES * SAMPLES) as f32;
                    *pixel = std::array::from_fn(|k| (mean(k) + 0.5) as u8);
                }
            }
        }
    }

    /// Whether the part is in front of a projected point.
    pub fn hides(&self, p: Point) -> bool {
        let place = |k: usize| {
            let c = p[k] - (self.origin[k] * SAMPLES) as f64;
            (c >= 0.0 && c < self.size[k] as f64).then_some(c as usize)
        };
        let sample = place(1).zip(place(0));
        let seen = sample.map_or(0, |(y, x)| self.samples[y * self.size[0] + x] >> 8);
        seen > 0 && f64::from(seen) > self.depth(p[2] + SUNK)
    }
}

/// How a number at the corners of a triangle grows across it.
struct Plane {
    corner: Corner,
    at_corner: f64,
    /// To the right and down.
    growth: [f64; 2],
    /// No sample lies beyond the corners.
    within: Interval,
}

impl Plane {
    /// That of the `k`-th number, counted in `parts`.
    fn new([a, b, c]: [Corner; 3], k: usize, area: f64, parts: f64) -> Self {
        let values = [a[k], b[k], c[k]].map(|value| value * parts);
        let (p, q) = (values[1] - values[0], values[2] - values[0]);
        Self {
            corner: a,
            at_corner: values[0],
            growth: [
                (p * (c[1] - a[1]) - q * (b[1] - a[1])) / area,
                (q * (b[0] - a[0]) - p * (c[0] - a[0])) / area,
            ],
            within: Interval::of(values),
        }
    }

    /// The number at the first of two places, and what it grows by to each of the next ones up to the second.
    fn steps(&self, ends: [[f64; 2]; 2], between: usize) -> (i32, i32) {
        let [first, last] = ends.map(|[x, y]| {
            let (across, down) = (x - self.corner[0], y - self.corner[1]);
            let at = self.at_corner + across * self.growth[0] + down * self.growth[1];
            at.max(self.within.low).min(self.within.high) as i32
        });
        (first, (last - first) / (between as i32).max(1))
    }
}

/// The light on the part.
struct Lamp {
    towards: Point,
    /// Between the light and the viewer: a normal that points there mirrors one into the other.
    halfway: Point,
}

impl Lamp {
    fn new() -> Self {
        let towards = unit(LIGHT).unwrap_or(LIGHT);
        let halfway = [towards[0], towards[1], towards[2] + 1.0];
        Self {
            towards,
            halfway: unit(halfway).unwrap_or(towards),
        }
    }

    /// Brightness where the surface has this normal, as seen. Both its sides are lit, since it may
    /// be turned inside out.
    fn light(&self, normal: Point) -> f64 {
        let normal = if normal[2] < 0.0 {
            normal.map(|c| -c)
        } else {
            normal
        };
        let diffuse = dot(normal, self.towards).max(0.0);
        let gloss = dot(normal, self.halfway).max(0.0).powi(24);
        0.42 + 0.08 * normal[1] + 0.57 * diffuse + 0.1 * gloss
    }
}
