//! Samples of the designed surface: where a path is verified.
//!
//! They lie at irregular offsets, so that no grid that was digitized hides its gaps between them,
//! and are the same for the same part and spacing: the irregularity is that of the golden ratio, not
//! of chance. This module knows neither cutters nor paths.

use rayon::prelude::*;

use crate::error::{Error, Result, bounded};
use crate::part::{Mesh, Part, Shape};
use crate::surface::{Direction, Surface};
use crate::vector::{Point, add_scaled, cross, length, sub};

/// Samples that the default spacing aims at: half a millimetre on a shoe last 245 mm long.
const DEFAULT_SAMPLES: f64 = 240_000.0;

/// Most samples of a part.
const MAX_SAMPLES: f64 = 5.0e7;

/// Lines in either direction along which a surface is measured, if its pieces are no more.
const MEASURED: usize = 128;

/// How far a sample strays from its even place, of the spacing, both ways together.
const STRAY: f64 = 0.5;

/// Fractional parts of multiples of this spread most evenly; the pair does the same in the plane
/// (the plastic number's powers).
const GOLDEN: f64 = 0.618_033_988_749_894_9;
const PLASTIC: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2];

/// Points on a part.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Samples {
    /// In part coordinates, mm, body after body and row after row.
    pub points: Vec<Point>,
    /// Where each body's points end.
    pub ends: Vec<usize>,
    /// About how far neighbours are apart, mm.
    pub spacing: f64,
}

/// Samples every body about every `spacing` mm in both directions, its boundary, its creases and
/// a mesh's vertices included; by default as many samples as [`DEFAULT_SAMPLES`] says.
///
/// # Errors
/// [`Error::OutOfBounds`] for a spacing that is not positive, [`Error::TooManySamples`].
pub(super) fn sample(part: &Part, spacing: Option<f64>) -> Result<Samples> {
    let nets: Vec<Net> = part.bodies.iter().map(|b| Net::new(&b.shape)).collect();
    let area: f64 = nets.iter().map(Net::area).sum();
    let spacing = match spacing {
        Some(s) => {
            let ok = s > 0.0 && s.is_finite();
            bounded("spacing", s, ok, "greater than 0 mm and finite")?;
            s
        }
        None if area > 0.0 => (area / DEFAULT_SAMPLES).sqrt(),
        None => 1.0,
    };
    let expected = nets.iter().map(|n| n.expected(spacing)).sum();
    if expected > MAX_SAMPLES {
        return Err(Error::TooManySamples {
            samples: expected,
            spacing,
            limit: MAX_SAMPLES,
        });
    }
    let mut points = Vec::with_capacity(expected as usize);
    let mut ends = Vec::with_capacity(nets.len());
    for net in &nets {
        match net {
            Net::Surface(net) => points.extend(net.sample(spacing)),
            Net::Mesh(mesh, _) => sample_mesh(mesh, spacing, &mut points),
        }
        ends.push(points.len());
    }
    Ok(Samples {
        points,
        ends,
        spacing,
    })
}

/// A body, measured.
enum Net<'a> {
    Surface(SurfaceNet<'a>),
    Mesh(&'a Mesh, f64),
}

impl<'a> Net<'a> {
    fn new(shape: &'a Shape) -> Self {
        match shape {
            Shape::Surface(surface) => Self::Surface(SurfaceNet::new(surface)),
            Shape::Mesh(mesh) => Self::Mesh(mesh, areas(mesh).sum()),
        }
    }

    /// About its area, mm², counted as often as rows of even spacing pass over it.
    fn area(&self) -> f64 {
        match self {
            Self::Surface(net) => net.area,
            Self::Mesh(_, area) => *area,
        }
    }

    /// About how many samples it takes.
    fn expected(&self, spacing: f64) -> f64 {
        let inside = self.area() / (spacing * spacing);
        match self {
            Self::Surface(net) => {
                let rows = net.u.total() / spacing + net.u.forced.len() as f64;
                inside + (net.widest / spacing) * net.u.forced.len() as f64 + rows * 8.0
            }
            Self::Mesh(mesh, _) => inside + mesh.vertices().len() as f64,
        }
    }
}

/// A surface with what its parameters mean in millimetres.
struct SurfaceNet<'a> {
    surface: &'a Surface,
    /// Along u; each interval as long as the longest isoline makes it.
    u: Scale,
    vs: Vec<f64>,
    forced_v: Vec<f64>,
    area: f64,
    /// Length of the longest row, mm.
    widest: f64,
}

impl<'a> SurfaceNet<'a> {
    fn new(surface: &'a Surface) -> Self {
        let (us, vs) = (measured(surface.u()), measured(surface.v()));
        let points = surface.grid(&us, &vs);
        let rows: Vec<&[Point]> = points.chunks_exact(vs.len()).collect();
        let steps: Vec<f64> = rows
            .windows(2)
            .map(|w| {
                let pairs = w[0].iter().zip(w[1]);
                pairs.map(|(a, b)| length(sub(*b, *a))).fold(0.0, f64::max)
            })
            .collect();
        let girths: Vec<f64> = rows.iter().map(|r| chords(r).sum()).collect();
        let between = girths.windows(2).map(|g| 0.5 * (g[0] + g[1]));
        Self {
            surface,
            area: steps.iter().zip(between).map(|(s, g)| s * g).sum(),
            widest: girths.iter().copied().fold(0.0, f64::max),
            u: Scale::new(us, steps, creases(surface.u())),
            vs,
            forced_v: creases(surface.v()),
        }
    }

    fn sample(&self, spacing: f64) -> Vec<Point> {
        let rows: Vec<(usize, f64)> = self
            .u
            .places(spacing, 0.0)
            .into_iter()
            .enumerate()
            .collect();
        let sampled: Vec<Vec<Point>> = rows
            .into_par_iter()
            .map(|(row, u)| {
                let isoline = self.surface.grid(&[u], &self.vs);
                let lengths = chords(&isoline).collect();
                let v = Scale::new(self.vs.clone(), lengths, self.forced_v.clone());
                // Each row begins its own run of offsets.
                let phase = (row as f64 * PLASTIC[0]).fract();
                self.surface.grid(&[u], &v.places(spacing, phase))
            })
            .collect();
        sampled.concat()
    }
}

/// Lines of a direction along which the surface is measured.
fn measured(direction: &Direction) -> Vec<f64> {
    let breaks = direction.breaks();
    let density = (MEASURED / (breaks.len() - 1)).max(1);
    let mut lines = vec![breaks[0]];
    for piece in breaks.windows(2) {
        let inner =
            (1..density).map(|i| piece[0] + (piece[1] - piece[0]) * (i as f64 / density as f64));
        lines.extend(inner.chain([piece[1]]));
    }
    lines
}

/// The ends of a direction, and the knots at which the surface may have an edge.
fn creases(direction: &Direction) -> Vec<f64> {
    let (low, high) = direction.domain();
    let sharp = |k: &f64| {
        let times = direction.knots.iter().filter(|&other| other == k).count();
        times >= direction.degree
    };
    let breaks = direction.breaks();
    let inner = &breaks[1..breaks.len() - 1];
    let mut all = vec![low];
    all.extend(inner.iter().copied().filter(sharp));
    all.push(high);
    all
}

fn chords(points: &[Point]) -> impl Iterator<Item = f64> {
    points.windows(2).map(|w| length(sub(w[1], w[0])))
}

/// Parameters with the length from the first to each of them, mm.
struct Scale {
    parameters: Vec<f64>,
    lengths: Vec<f64>,
    /// Parameters that are sampled in any case, both ends among them.
    forced: Vec<f64>,
}

impl Scale {
    fn new(parameters: Vec<f64>, steps: Vec<f64>, forced: Vec<f64>) -> Self {
        let mut lengths = Vec::with_capacity(parameters.len());
        let mut total = 0.0;
        lengths.push(total);
        for step in steps {
            total += step;
            lengths.push(total);
        }
        Self {
            parameters,
            lengths,
            forced,
        }
    }

    fn total(&self) -> f64 {
        self.lengths[self.lengths.len() - 1]
    }

    /// Parameters about every `spacing`, at offsets that start at `phase`, and the forced ones.
    fn places(&self, spacing: f64, phase: f64) -> Vec<f64> {
        let count = (self.total() / spacing).ceil();
        let step = self.total() / count;
        let mut places = self.forced.clone();
        let mut at = 0;
        for k in 0..count as usize {
            let offset = (phase + k as f64 * GOLDEN).fract() - 0.5;
            let target = step * (k as f64 + 0.5 + STRAY * offset);
            while at + 2 < self.lengths.len() && self.lengths[at + 1] < target {
                at += 1;
            }
            let (low, high) = (self.parameters[at], self.parameters[at + 1]);
            let share = (target - self.lengths[at]) / (self.lengths[at + 1] - self.lengths[at]);
            places.push((low + (high - low) * share).clamp(low, high));
        }
        places.sort_unstable_by(f64::total_cmp);
        places.dedup();
        places
    }
}

/// The area of each triangle, mm².
fn areas(mesh: &Mesh) -> impl Iterator<Item = f64> {
    mesh.triangles().iter().map(|t| {
        let [a, b, c] = t.map(|v| mesh.vertices()[v as usize]);
        0.5 * length(cross(sub(b, a), sub(c, a)))
    })
}

/// The vertices that triangles use, and points over the triangles, as many as their areas ask for:
/// what is too small for a point of its own shares one with the triangles after it.
fn sample_mesh(mesh: &Mesh, spacing: f64, points: &mut Vec<Point>) {
    let mut seen = vec![false; mesh.vertices().len()];
    let mut due = 0.5;
    let mut drawn = 0.0;
    for (triangle, area) in mesh.triangles().iter().zip(areas(mesh)) {
        let corners = triangle.map(|v| mesh.vertices()[v as usize]);
        for (v, corner) in triangle.iter().zip(corners) {
            if !std::mem::replace(&mut seen[*v as usize], true) {
                points.push(corner);
            }
        }
        due += area / (spacing * spacing);
        let [a, b, c] = corners;
        while due >= 1.0 {
            due -= 1.0;
            drawn += 1.0;
            let [s, t] = PLASTIC.map(|p| (drawn * p).fract());
            let (s, t) = if s + t > 1.0 {
                (1.0 - s, 1.0 - t)
            } else {
                (s, t)
            };
            points.push(add_scaled(add_scaled(a, s, sub(b, a)), t, sub(c, a)));
        }
    }
}
