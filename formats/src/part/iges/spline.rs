//! Surfaces of an IGES file as B-splines: entities 128 and 114 of the standard (IGES 5.3, 4.24 and 4.15).

use horma_core::{Direction, Point, Surface, length, sub};

use super::super::matrix::{Matrix, apply};
use super::file::Parameters;
use crate::error::Result;

/// Parameters are one if they are no further apart than this, as a share of the domain.
pub(super) const SAME_PARAMETER: f64 = 1.0e-9;

/// Neighbouring patches of a parametric spline surface may be this far apart, mm.
const GAP: f64 = 1.0e-3;

/// A surface as it is in a file, before it has a place.
pub(super) struct Spline {
    u: Direction,
    v: Direction,
    /// v running fastest.
    poles: Vec<Point>,
    weights: Option<Vec<f64>>,
    /// Whether only a part of the domain counts.
    pub(super) cut: bool,
}

impl Spline {
    /// The surface where `matrix` puts it, mm.
    pub(super) fn placed(&self, name: &str, matrix: &Matrix, scale: f64) -> Result<Surface> {
        let poles = self.poles.iter().map(|&p| apply(matrix, p, scale));
        Ok(Surface::new(
            name,
            self.u.clone(),
            self.v.clone(),
            poles.collect(),
            self.weights.clone(),
        )?)
    }

    /// Ends of the domain, in u and in v.
    pub(super) fn domain(&self) -> [(f64, f64); 2] {
        [self.u.domain(), self.v.domain()]
    }
}

/// A rational B-spline surface, 128.
pub(super) fn rational(p: &mut Parameters) -> Result<Spline> {
    let last = [p.count()?, p.count()?];
    let degrees = [p.count()?, p.count()?];
    p.skip(2); // whether it is closed follows from its poles
    let polynomial = p.count()? == 1;
    p.skip(2); // whether it is periodic does not change it
    // Every number below is bounded by the number of parameters.
    if last.iter().chain(&degrees).any(|&n| n > p.left()) || degrees.contains(&0) {
        return Err(p.wrong("its degrees and numbers of poles make no sense"));
    }
    let [rows, columns] = last.map(|n| n + 1);
    let knots = [rows + degrees[0] + 1, columns + degrees[1] + 1];
    let knots = [p.numbers(knots[0])?, p.numbers(knots[1])?];
    let count = rows.saturating_mul(columns);
    if last[0] < degrees[0] || last[1] < degrees[1] {
        return Err(p.wrong("it has fewer poles than its degree needs"));
    }
    let weights = p.numbers(count)?;
    let numbers = p.numbers(count.saturating_mul(3))?;
    let (points, _) = numbers.as_chunks::<3>();
    let [u, v] = direction_pair(degrees, knots);
    let mut cut = false;
    if p.left() >= 4 {
        let asked = p.numbers(4)?;
        for (asked, (low, high)) in asked.chunks(2).zip([u.domain(), v.domain()]) {
            let slack = (high - low).abs() * SAME_PARAMETER;
            let said = asked[0] < asked[1];
            cut |= said && (asked[0] > low + slack || asked[1] < high - slack);
        }
    }
    // In the file u runs fastest.
    let order = || (0..rows).flat_map(|i| (0..columns).map(move |j| j * rows + i));
    Ok(Spline {
        u,
        v,
        poles: order().map(|k| points[k]).collect(),
        weights: (!polynomial).then(|| order().map(|k| weights[k]).collect()),
        cut,
    })
}

fn direction_pair(degrees: [usize; 2], knots: [Vec<f64>; 2]) -> [Direction; 2] {
    let [p, q] = degrees;
    let [u, v] = knots;
    [
        Direction {
            degree: p,
            knots: u,
        },
        Direction {
            degree: q,
            knots: v,
        },
    ]
}

/// Coefficients of a bicubic patch, in one coordinate.
const PATCH: usize = 16;

/// A parametric spline surface, 114: bicubic patches in monomials, which become one B-spline whose knots
/// are as often as its degree. `scale` is for how far its patches may gape.
pub(super) fn parametric(p: &mut Parameters, scale: f64) -> Result<Spline> {
    p.skip(2); // what it was made from, and how
    let counts = [p.count()?, p.count()?];
    if counts.iter().any(|&n| n == 0 || n > p.left()) {
        return Err(p.wrong("its numbers of patches make no sense"));
    }
    let breaks = [p.numbers(counts[0] + 1)?, p.numbers(counts[1] + 1)?];
    if breaks.iter().any(|b| b.windows(2).any(|w| w[0] >= w[1])) {
        return Err(p.wrong("its break points do not rise"));
    }
    let [m, n] = counts;
    let size = 3 * PATCH;
    // Behind each row of patches there is one that means nothing; some writers leave it out.
    let padded = p.left() / size / m > n;
    let [rows, columns] = counts.map(|n| 3 * n + 1);
    let needed = m.saturating_mul(n).saturating_mul(size);
    if needed > p.left() {
        let left = p.left();
        return Err(p.wrong(format!(
            "{needed} coefficients should follow, but there are {left}"
        )));
    }
    let mut poles: Vec<Option<Point>> = vec![None; rows * columns];
    for i in 0..m {
        for j in 0..n {
            let widths = [
                breaks[0][i + 1] - breaks[0][i],
                breaks[1][j + 1] - breaks[1][j],
            ];
            let coefficients = p.numbers(size)?;
            let axis = |c: usize| bezier(&coefficients[c * PATCH..(c + 1) * PATCH], widths);
            let [x, y, z] = [axis(0), axis(1), axis(2)];
            for a in 0..4 {
                for b in 0..4 {
                    let pole = [x[a][b], y[a][b], z[a][b]];
                    let place = &mut poles[(3 * i + a) * columns + 3 * j + b];
                    let known = *place.get_or_insert(pole);
                    if length(sub(known, pole)) * scale > GAP {
                        return Err(p.wrong(format!(
                            "patch {} × {} does not meet the one before it",
                            i + 1,
                            j + 1
                        )));
                    }
                }
            }
        }
        if padded {
            p.skip(size);
        }
    }
    let knots = breaks.map(|breaks| {
        let thrice = breaks.iter().flat_map(|&b| [b; 3]);
        let ends = (breaks[0], breaks[breaks.len() - 1]);
        [ends.0].into_iter().chain(thrice).chain([ends.1]).collect()
    });
    let [u, v] = direction_pair([3, 3], knots);
    Ok(Spline {
        u,
        v,
        poles: poles.into_iter().flatten().collect(),
        weights: None,
        cut: false,
    })
}

/// Poles of a patch from its coefficients, of s⁰t⁰, s¹t⁰ … s³t³, over its widths in s and in t.
fn bezier(coefficients: &[f64], widths: [f64; 2]) -> [[f64; 4]; 4] {
    let [h, k] = widths;
    let mut poles = [[0.0; 4]; 4];
    for (t, powers) in coefficients.chunks_exact(4).enumerate() {
        let along = cubic([powers[0], powers[1], powers[2], powers[3]], h);
        for (s, value) in along.into_iter().enumerate() {
            poles[s][t] = value;
        }
    }
    poles.map(|powers| cubic(powers, k))
}

/// Poles of a cubic from its coefficients, over `[0, h]`.
fn cubic([a, b, c, d]: [f64; 4], h: f64) -> [f64; 4] {
    let (b, c, d) = (b * h, c * h * h, d * h * h * h);
    [a, a + b / 3.0, a + b * (2.0 / 3.0) + c / 3.0, a + b + c + d]
}
