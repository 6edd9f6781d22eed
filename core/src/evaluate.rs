//! Surfaces on grids of parameters: points, one isoline at a time.
//!
//! An isoline collapses the net of poles to one curve, once for its u, and that curve is evaluated
//! at every v with basis functions computed once for the grid. Coordinates lie in arrays of their
//! own and the places that weigh the same poles are computed together, so that the inner loops are
//! sums of products over arrays, which a compiler turns into vector instructions. Only + − × ÷ are
//! used, each place sees them in one fixed order, and none are fused: a point is the same bits
//! wherever, beside whichever other points, and on however wide a machine it is computed.
//!
//! Nothing is remembered between grids, and no parameter outside the domain is caught.

use std::ops::Range;

use crate::surface::{Basis, Surface};
use crate::vector::Point;

/// A surface made ready to be evaluated, with its poles a coordinate at a time.
pub struct Net<'a> {
    /// The surface.
    pub surface: &'a Surface,
    /// Coordinates and weights of the poles.
    poles: Coordinates,
}

impl<'a> Net<'a> {
    /// Copies the poles, which is worth it once for several grids.
    pub fn new(surface: &'a Surface) -> Self {
        let coordinate = |k: usize| surface.poles().iter().map(|p| p[k]).collect();
        Self {
            surface,
            poles: Coordinates {
                x: coordinate(0),
                y: coordinate(1),
                z: coordinate(2),
                w: surface.weights().unwrap_or_default().to_vec(),
            },
        }
    }

    /// The points at every pair of parameters, `us.len() × vs.len()`, v running fastest, mm.
    /// Eq. (3) of the 2001 paper.
    pub fn grid(&self, us: &[f64], vs: &[f64]) -> Vec<Point> {
        let isolines = Isolines::new(self, vs);
        let mut line = Isoline::default();
        let mut points = Vec::with_capacity(us.len() * vs.len());
        for &u in us {
            isolines.at(u, &mut line);
            points.extend((0..vs.len()).map(|i| line.points.point(i)));
        }
        points
    }
}

/// A surface made ready for isolines at a fixed set of v.
pub(crate) struct Isolines<'a> {
    net: &'a Net<'a>,
    /// The poles along v that any of them weighs.
    poles: Range<usize>,
    /// Basis functions at each v: all of the first that does not vanish, then all of the second …
    shares: Vec<f64>,
    /// Places that weigh the same poles and follow each other.
    runs: Vec<Run>,
    columns: usize,
}

struct Run {
    first_pole: usize,
    start: usize,
    end: usize,
}

/// Points, or poles and their weights, a coordinate at a time.
#[derive(Default)]
pub(crate) struct Coordinates {
    pub x: Vec<f64>,
    pub y: Vec<f64>,
    pub z: Vec<f64>,
    /// Empty if the surface is not rational.
    w: Vec<f64>,
}

impl Coordinates {
    pub fn point(&self, i: usize) -> Point {
        [self.x[i], self.y[i], self.z[i]]
    }

    /// Every `step`-th point from each of the first `step` on: all that are first in their cells, then
    /// all that are second …
    pub fn deal(&mut self, from: &Self, step: usize) {
        let pairs = [
            (&mut self.x, &from.x),
            (&mut self.y, &from.y),
            (&mut self.z, &from.z),
        ];
        for (to, from) in pairs {
            let n = from.len() / step;
            to.resize(n * step, 0.0);
            if step == 4 {
                deal_four(to, from);
                continue;
            }
            for (b, to) in to.chunks_exact_mut(n).enumerate() {
                for (to, from) in to.iter_mut().zip(from[b..].iter().step_by(step)) {
                    *to = *from;
                }
            }
        }
    }

    fn resize(&mut self, len: usize, rational: bool) {
        for c in [&mut self.x, &mut self.y, &mut self.z] {
            c.resize(len, 0.0);
        }
        self.w.resize(if rational { len } else { 0 }, 0.0);
    }

    fn clear(&mut self, len: usize, rational: bool) {
        for c in [&mut self.x, &mut self.y, &mut self.z] {
            c.clear();
            c.resize(len, 0.0);
        }
        self.w.clear();
        self.w.resize(if rational { len } else { 0 }, 0.0);
    }
}

/// Room for an isoline and for its poles, used again for the next one.
#[derive(Default)]
pub(crate) struct Isoline {
    pub points: Coordinates,
    curve: Coordinates,
}

impl<'a> Isolines<'a> {
    /// Computes the basis functions at every v.
    pub fn new(net: &'a Net<'a>, vs: &[f64]) -> Self {
        let surface = net.surface;
        let order = surface.v().degree + 1;
        let mut shares = vec![0.0; order * vs.len()];
        let mut runs: Vec<Run> = Vec::new();
        for (i, &v) in vs.iter().enumerate() {
            let basis = surface.v().basis(v);
            for (k, &share) in basis.values[..order].iter().enumerate() {
                shares[k * vs.len() + i] = share;
            }
            match runs.last_mut().filter(|r| r.first_pole == basis.first) {
                Some(run) => run.end = i + 1,
                None => runs.push(Run {
                    first_pole: basis.first,
                    start: i,
                    end: i + 1,
                }),
            }
        }
        let first = runs.iter().map(|r| r.first_pole).min().unwrap_or(0);
        let last = runs.iter().map(|r| r.first_pole + order).max().unwrap_or(0);
        Self {
            net,
            poles: first..last,
            shares,
            runs,
            columns: vs.len(),
        }
    }

    /// The points at `u` and every v.
    pub fn at(&self, u: f64, line: &mut Isoline) {
        let surface = self.net.surface;
        self.collapse(&surface.u().basis(u), &mut line.curve);
        let rational = surface.weights().is_some();
        line.points.resize(self.columns, rational);
        let (curve, points) = (&line.curve, &mut line.points);
        match surface.v().degree {
            1 => self.evaluate::<2>(curve, points),
            2 => self.evaluate::<3>(curve, points),
            3 => self.evaluate::<4>(curve, points),
            5 => self.evaluate::<6>(curve, points),
            _ => self.evaluate_any(curve, points),
        }
        let Coordinates { x, y, z, w } = points;
        for c in [x, y, z] {
            for (c, w) in c.iter_mut().zip(w.iter()) {
                *c /= w;
            }
        }
    }

    /// The isocurve's homogeneous poles.
    fn collapse(&self, basis: &Basis, curve: &mut Coordinates) {
        let Net { surface, poles } = self.net;
        let n = surface.v().count();
        let rational = surface.weights().is_some();
        curve.clear(self.poles.len(), rational);
        for i in 0..=surface.u().degree {
            let share = basis.values[i];
            let row = (basis.first + i) * n;
            let from = row + self.poles.start..row + self.poles.end;
            let pairs = [
                (&mut curve.x, &poles.x),
                (&mut curve.y, &poles.y),
                (&mut curve.z, &poles.z),
            ];
            if !rational {
                for (sums, values) in pairs {
                    add(sums, share, &values[from.clone()]);
                }
                continue;
            }
            let weights = &poles.w[from.clone()];
            for (sums, values) in pairs {
                add_weighted(sums, share, weights, &values[from.clone()]);
            }
            add(&mut curve.w, share, weights);
        }
    }

    /// The curve at every v, for the usual degrees: sums stay in registers.
    fn evaluate<const ORDER: usize>(&self, curve: &Coordinates, points: &mut Coordinates) {
        let Coordinates { x, y, z, w } = points;
        let pairs = [(&curve.x, x), (&curve.y, y), (&curve.z, z), (&curve.w, w)];
        let rational = !curve.w.is_empty();
        let mut pairs = pairs.map(|(c, p)| (&c[..], &mut p[..]));
        let pairs = if rational {
            &mut pairs[..]
        } else {
            &mut pairs[..3]
        };
        for run in &self.runs {
            let len = run.end - run.start;
            let mut share: [&[f64]; ORDER] = [&[]; ORDER];
            for (k, share) in share.iter_mut().enumerate() {
                *share = &self.shares[k * self.columns + run.start..][..len];
            }
            let first = run.first_pole - self.poles.start;
            for (curve, points) in pairs.iter_mut() {
                let mut pole = [0.0; ORDER];
                pole.copy_from_slice(&curve[first..first + ORDER]);
                for (i, point) in points[run.start..][..len].iter_mut().enumerate() {
                    let mut sum = 0.0;
                    for k in 0..ORDER {
                        sum += share[k][i] * pole[k];
                    }
                    *point = sum;
                }
            }
        }
    }

    /// The curve at every v, for any degree: the same sums in the same order.
    fn evaluate_any(&self, curve: &Coordinates, points: &mut Coordinates) {
        let pairs = [
            (&curve.x, &mut points.x),
            (&curve.y, &mut points.y),
            (&curve.z, &mut points.z),
            (&curve.w, &mut points.w),
        ];
        for (curve, points) in pairs.into_iter().filter(|(c, _)| !c.is_empty()) {
            points.fill(0.0);
            for run in &self.runs {
                for k in 0..=self.net.surface.v().degree {
                    let shares = &self.shares[k * self.columns..];
                    let points = &mut points[run.start..run.end];
                    add(
                        points,
                        curve[run.first_pole - self.poles.start + k],
                        &shares[run.start..run.end],
                    );
                }
            }
        }
    }
}

/// The usual step, in one pass.
fn deal_four(to: &mut [f64], from: &[f64]) {
    let n = from.len() / 4;
    let (a, rest) = to.split_at_mut(n);
    let (b, rest) = rest.split_at_mut(n);
    let (c, d) = rest.split_at_mut(n);
    let d = &mut d[..n];
    for (i, from) in from.chunks_exact(4).enumerate() {
        (a[i], b[i], c[i], d[i]) = (from[0], from[1], from[2], from[3]);
    }
}

fn add(sums: &mut [f64], share: f64, values: &[f64]) {
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum += share * value;
    }
}

fn add_weighted(sums: &mut [f64], share: f64, weights: &[f64], values: &[f64]) {
    for ((sum, weight), value) in sums.iter_mut().zip(weights).zip(values) {
        *sum += weight * share * value;
    }
}
