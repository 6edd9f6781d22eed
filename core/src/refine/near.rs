//! One cell looked at closely: the exact deviation of its samples, and which way they deviate.
//!
//! Everything is computed anew from the cell's parameters, so that the answer does not depend on
//! why it was asked for. It is slow, and meant for the few cells that bounds do not settle.

use super::balance::Grid;
use super::measure::{over_triangle, part, to_chord, to_triangle};
use crate::evaluate::Net;
use crate::vector::Point;

/// Deviations of a cell, mm.
#[derive(Clone, Copy, Default)]
pub(super) struct Closeness {
    /// Of its samples from the facets; no more than what was known, if that is all there is to say.
    pub deviation: f64,
    /// Of chords along u from the surface.
    pub along_u: f64,
    /// Of chords along v.
    pub along_v: f64,
}

/// The deviation of a cell, unless it is no more than `known`; if it exceeds the tolerance, those of its
/// chords as well.
pub(super) fn look(
    net: &Net,
    grid: &Grid,
    [along, across]: [usize; 2],
    [row, column]: [usize; 2],
    [known, tolerance]: [f64; 2],
) -> Closeness {
    let ts = |lines: &[f64], i: usize, n: usize| -> Vec<f64> {
        (0..=n).map(|k| part(lines, i, k, n)).collect()
    };
    let points = net.grid(&ts(&grid.us, row, along), &ts(&grid.vs, column, across));
    let at = |a: usize, b: usize| points[a * (across + 1) + b];
    let own = facets(at(0, 0), at(0, across), at(along, 0), at(along, across));
    let mut around = None;
    let mut found = Closeness::default();
    // Samples on the far edges are those of the next cells, where there are any.
    let last_a = along - usize::from(row + 2 < grid.us.len());
    let last_b = across - usize::from(column + 2 < grid.vs.len());
    for a in 0..=last_a {
        for b in 0..=last_b {
            let p = at(a, b);
            let side = usize::from(a * across <= b * along);
            let (mut deviation, over) = to_triangle(p, own[side]);
            let enough = known.max(found.deviation);
            if !over && deviation > enough {
                let around = around.get_or_insert_with(|| neighbours(net, grid, row, column));
                deviation = to_nearest(p, around, deviation, enough);
            }
            found.deviation = found.deviation.max(deviation);
        }
    }
    if found.deviation > tolerance {
        for (a, b) in (0..=along).flat_map(|a| (0..=across).map(move |b| (a, b))) {
            let p = at(a, b);
            found.along_u = found.along_u.max(to_chord(p, at(0, b), at(along, b)));
            found.along_v = found.along_v.max(to_chord(p, at(a, 0), at(a, across)));
        }
    }
    found
}

/// Distance to the nearest facet, or to any that is no further than `enough`.
fn to_nearest(p: Point, facets: &[[Point; 3]], known: f64, enough: f64) -> f64 {
    // Mostly it is the one that the sample lies over, which costs least to find.
    let over = facets.iter().filter_map(|&f| over_triangle(p, f));
    let least = over.fold(known, f64::min);
    if least <= enough {
        return least;
    }
    let all = facets.iter().map(|&f| to_triangle(p, f).0);
    all.fold(least, f64::min)
}

/// The facets of a cell from its corners, u growing first: as in `row::facets`.
fn facets(a: Point, b: Point, c: Point, d: Point) -> [[Point; 3]; 2] {
    [[a, c, d], [a, d, b]]
}

/// The facets of a cell and of those around it.
fn neighbours(net: &Net, grid: &Grid, row: usize, column: usize) -> Vec<[Point; 3]> {
    let lines = |lines: &[f64], i: usize| {
        let last = (i + 2).min(lines.len() - 1);
        lines[i.saturating_sub(1)..=last].to_vec()
    };
    let (us, vs) = (lines(&grid.us, row), lines(&grid.vs, column));
    let points = net.grid(&us, &vs);
    let n = vs.len();
    let cells = (0..us.len() - 1).flat_map(|i| (0..n - 1).map(move |j| i * n + j));
    cells
        .flat_map(|k| facets(points[k], points[k + 1], points[k + n], points[k + n + 1]))
        .collect()
}
