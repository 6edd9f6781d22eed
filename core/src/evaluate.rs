//! Surfaces on grids of parameters: points, one isoline at a time.
//!
//! An isoline collapses the net of poles to one curve, once for its u, and that curve is evaluated
//! at every v with basis functions computed once for the grid, four places at a time that weigh the
//! same poles. Only + − × ÷ are used, each place sees them in one fixed order, and none are fused: a
//! point is the same bits wherever, beside whichever other points, and on however wide a machine it is
//! computed.
//!
//! Nothing is remembered between grids, and no parameter outside the domain is caught.

use std::ops::Range;

use fearless_simd::{Simd, f64x4, prelude::*};

use crate::simd::{Simd as Level, Token, with_simd};
use crate::slices::{Axes, FOUR};
use crate::surface::{Basis, Surface};
use crate::vector::Point;

/// A surface made ready to be evaluated.
pub struct Net<'a> {
    /// The surface.
    pub surface: &'a Surface,
    /// Its poles with a 1 each, for what weighs them.
    poles: Vec<[f64; FOUR]>,
    /// What it is evaluated by.
    pub(crate) simd: Token,
}

impl<'a> Net<'a> {
    /// Copies the poles, which is worth it once for several grids.
    pub fn new(surface: &'a Surface) -> Self {
        Self::by(Level::best().token(), surface)
    }

    /// The same, to be evaluated by a level that is told.
    pub(crate) fn by(simd: Token, surface: &'a Surface) -> Self {
        let poles = surface.poles().iter().map(|&[x, y, z]| [x, y, z, 1.0]);
        Self {
            surface,
            poles: poles.collect(),
            simd,
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
            points.extend((0..vs.len()).map(|i| line.point(i)));
        }
        points
    }
}

/// A surface made ready for isolines at a fixed set of v.
pub(crate) struct Isolines<'a> {
    net: &'a Net<'a>,
    /// The poles along v that any of them weighs.
    poles: Range<usize>,
    fours: Vec<Places>,
    /// For each four, the basis functions at its places: all of the first that does not vanish, then all
    /// of the second …
    shares: Vec<[f64; FOUR]>,
    columns: usize,
}

/// Up to four places that weigh the same poles and follow each other.
struct Places {
    start: usize,
    first_pole: usize,
}

/// Points of an isoline, a coordinate at a time, and room for its poles; used again for the next one.
#[derive(Default)]
pub(crate) struct Isoline {
    /// The isocurve's poles times their weights, and these.
    curve: Vec<[f64; FOUR]>,
    /// Coordinates of the points, and what they are to be divided by. Longer than there are points, so that the last
    /// four of them are whole.
    at: [Vec<f64>; FOUR],
}

impl Isoline {
    pub fn point(&self, i: usize) -> Point {
        [self.at[0][i], self.at[1][i], self.at[2][i]]
    }

    /// The points of a range, a coordinate at a time.
    pub fn within(&self, range: Range<usize>) -> Axes<'_> {
        [0, 1, 2].map(|k| &self.at[k][range.clone()])
    }
}

impl<'a> Isolines<'a> {
    /// Computes the basis functions at every v.
    pub fn new(net: &'a Net<'a>, vs: &[f64]) -> Self {
        let order = net.surface.v().degree + 1;
        let mut fours: Vec<Places> = Vec::with_capacity(vs.len());
        let mut shares = Vec::with_capacity(order * vs.len());
        for (i, &v) in vs.iter().enumerate() {
            let Basis { first, values } = net.surface.v().basis(v);
            let follows = |p: &&Places| p.first_pole == first && i < p.start + FOUR;
            let start = fours.last().filter(follows).map(|p| p.start);
            let start = start.unwrap_or_else(|| {
                fours.push(Places {
                    start: i,
                    first_pole: first,
                });
                shares.resize(order * fours.len(), [0.0; FOUR]);
                i
            });
            let own = &mut shares[order * (fours.len() - 1)..];
            for (own, share) in own.iter_mut().zip(values) {
                own[i - start] = share;
            }
        }
        let first = fours.iter().map(|p| p.first_pole).min().unwrap_or(0);
        let last = fours.iter().map(|p| p.first_pole + order).max();
        Self {
            net,
            poles: first..last.unwrap_or(0),
            fours,
            shares,
            columns: vs.len(),
        }
    }

    /// The points at `u` and every v.
    pub fn at(&self, u: f64, line: &mut Isoline) {
        let basis = self.net.surface.u().basis(u);
        for c in &mut line.at {
            c.resize(self.columns + FOUR - 1, 1.0);
        }
        with_simd!(self.net.simd, simd => self.fill(simd, &basis, line));
    }

    #[inline(always)]
    fn fill<S: Simd>(&self, simd: S, basis: &Basis, line: &mut Isoline) {
        self.collapse(simd, basis, &mut line.curve);
        let (curve, at) = (&line.curve[..], &mut line.at);
        if self.net.surface.weights().is_none() {
            return self.evaluate::<_, 3>(simd, curve, at);
        }
        self.evaluate::<_, 4>(simd, curve, at);
        let [points @ .., w] = at;
        for c in points {
            for (c, w) in c.iter_mut().zip(w.iter()) {
                *c /= w;
            }
        }
    }

    /// The isocurve's poles.
    #[inline(always)]
    fn collapse<S: Simd>(&self, simd: S, basis: &Basis, curve: &mut Vec<[f64; FOUR]>) {
        let Net { surface, poles, .. } = self.net;
        let (n, degree) = (surface.v().count(), surface.u().degree);
        curve.clear();
        for j in self.poles.clone() {
            let mut sum = f64x4::splat(simd, 0.0);
            for i in 0..=degree {
                let k = (basis.first + i) * n + j;
                let share = match surface.weights() {
                    Some(weights) => weights[k] * basis.values[i],
                    None => basis.values[i],
                };
                sum += f64x4::from_slice(simd, &poles[k]) * share;
            }
            curve.push(*sum);
        }
    }

    /// The first coordinates of the curve at every v.
    #[inline(always)]
    fn evaluate<S: Simd, const SOME: usize>(
        &self,
        simd: S,
        curve: &[[f64; FOUR]],
        at: &mut [Vec<f64>; FOUR],
    ) {
        // The usual degrees are unrolled.
        match self.net.surface.v().degree {
            1 => self.sum::<S, SOME>(simd, 2, curve, at),
            2 => self.sum::<S, SOME>(simd, 3, curve, at),
            3 => self.sum::<S, SOME>(simd, 4, curve, at),
            5 => self.sum::<S, SOME>(simd, 6, curve, at),
            degree => self.sum::<S, SOME>(simd, degree + 1, curve, at),
        }
    }

    #[inline(always)]
    fn sum<S: Simd, const SOME: usize>(
        &self,
        simd: S,
        order: usize,
        curve: &[[f64; FOUR]],
        at: &mut [Vec<f64>; FOUR],
    ) {
        for (places, shares) in self.fours.iter().zip(self.shares.chunks_exact(order)) {
            let poles = &curve[places.first_pole - self.poles.start..][..order];
            let mut sums = [f64x4::splat(simd, 0.0); SOME];
            for k in 0..order {
                let share = f64x4::from_slice(simd, &shares[k]);
                for c in 0..SOME {
                    sums[c] += share * poles[k][c];
                }
            }
            // Of less than four places the rest is put right when it is the next ones' turn.
            for c in 0..SOME {
                sums[c].store_slice(&mut at[c][places.start..places.start + FOUR]);
            }
        }
    }
}
