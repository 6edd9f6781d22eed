//! Grids for a chordal tolerance: as few points as the surface's curvature allows.
//!
//! The bends of the surface are sampled, and the lines of both directions are balanced against each
//! other so that the estimated points are fewest. The grid is adjusted to what a few samples of each
//! cell show, and then measured, four times denser than itself or more. Where it exceeds the
//! tolerance, lines are added, and only the cells that changed are measured again.
//!
//! Creases are lines: a knot as often as the degree, across which facets would cut a corner off. Other
//! knots are not, since there the surface has a tangent plane and all that a facet sees of it is how
//! fast it bends, which is bounded on both sides. So a surface of many pieces, as interpolation makes
//! them, gets no more lines than a smooth one.
//!
//! What is refused: a tolerance that would take more points than there is room to count. The
//! lines depend on + − × ÷ √ and on maxima alone, and are the same for any number of threads.

mod balance;
mod curvature;
mod measure;
mod near;

use crate::discretize::{Lines, MAX_LINES};
use crate::error::{Error, Result};
use crate::evaluate::Net;
use crate::surface::Surface;
use balance::{Densities, Grid, adjust, balance, grid};
use curvature::{Bends, bends, bends_found};
use measure::{Exceeding, Measured, density, measure, probe};

/// Rounds of adding lines before giving up; none to two are usual.
const ROUNDS: usize = 48;

/// Times that a grid is probed and laid anew before it is measured.
const ADJUSTMENTS: usize = 2;

/// Grids are laid to this part of the tolerance: what probes miss should not take lines of its own.
const GOAL: f64 = 0.98;

/// Most points of one surface's grid.
const MAX_POINTS: usize = 1 << 26;

/// Share of the tolerance that the samples may use up: a peak midway between two of them is up to a
/// sixteenth higher than what is seen.
const SEEN: f64 = 16.0 / 17.0;

/// Points of the grid that is measured when the one asked for has too many.
const TRIAL_POINTS: f64 = (1 << 18) as f64;

/// Finds the lines of a grid whose facets are within `tolerance` (mm) of the surface at every sample.
pub(crate) fn refine(name: &str, surface: &Surface, tolerance: f64) -> Result<Lines> {
    refine_net(name, &Net::new(surface), tolerance)
}

fn refine_net(name: &str, net: &Net, tolerance: f64) -> Result<Lines> {
    let (surface, simd) = (net.surface, net.simd);
    let asked = tolerance;
    let tolerance = SEEN * asked;
    let bends = bends(surface, tolerance);
    let densities = balance(simd, &bends);
    let not_reached = |grid: &Grid, measured: &Measured| Error::ToleranceNotReached {
        name: name.to_owned(),
        rows: grid.us.len(),
        columns: grid.vs.len(),
        deviation: measured.worst(),
        tolerance: asked,
    };
    let [m, n] = densities.lines(&bends);
    if !fits(m, n) {
        let fewer = (TRIAL_POINTS / (m * n)).sqrt();
        let grid = lay(surface, &bends, &densities.scaled(fewer));
        let measured = measure_all(net, &grid, tolerance);
        return Err(not_reached(&grid, &measured));
    }
    let mut grid = lay(surface, &bends, &densities);
    for _ in 0..ADJUSTMENTS {
        let found = probe(net, &grid);
        let cells = bends_found(&bends, [&grid.us, &grid.vs], &found, GOAL * tolerance);
        grid = lay(surface, &cells, &adjust(simd, &cells));
    }
    let mut measured = measure_all(net, &grid, tolerance);
    for _ in 0..ROUNDS {
        if measured.exceeding.is_empty() {
            return Ok(Lines {
                us: grid.us,
                vs: grid.vs,
                deviation: Some(measured.within),
            });
        }
        let changed = split(&mut grid, &measured.exceeding);
        if !fits(grid.us.len() as f64, grid.vs.len() as f64) {
            break;
        }
        // What was measured in cells that are no more stays in the maximum, above what is now there.
        let again = measure_changed(net, &grid, tolerance, changed);
        measured = Measured {
            within: measured.within.max(again.within),
            ..again
        };
    }
    Err(not_reached(&grid, &measured))
}

fn fits(rows: f64, columns: f64) -> bool {
    rows.max(columns) <= MAX_LINES as f64 && rows * columns <= MAX_POINTS as f64
}

fn lay(surface: &Surface, bends: &Bends, densities: &Densities) -> Grid {
    let (u, v) = (surface.u().creases(), surface.v().creases());
    grid(densities, bends, [&u, &v])
}

fn densities_of_samples(net: &Net, grid: &Grid) -> [usize; 2] {
    [
        density(net.surface.u(), &grid.us),
        density(net.surface.v(), &grid.vs),
    ]
}

fn measure_all(net: &Net, grid: &Grid, tolerance: f64) -> Measured {
    let rows: Vec<usize> = (0..grid.us.len() - 1).collect();
    let columns: Vec<usize> = (0..grid.vs.len() - 1).collect();
    let samples = densities_of_samples(net, grid);
    measure(net, grid, samples, tolerance, &rows, &columns)
}

/// Measures the rows and the columns that changed, each cell once.
fn measure_changed(
    net: &Net,
    grid: &Grid,
    tolerance: f64,
    [rows, columns]: [Vec<usize>; 2],
) -> Measured {
    let all: Vec<usize> = (0..grid.vs.len() - 1).collect();
    let samples = densities_of_samples(net, grid);
    let mut measured = measure(net, grid, samples, tolerance, &rows, &all);
    let others = (0..grid.us.len() - 1).filter(|row| rows.binary_search(row).is_err());
    let others: Vec<usize> = others.collect();
    let crossing = measure(net, grid, samples, tolerance, &others, &columns);
    measured.within = measured.within.max(crossing.within);
    measured.exceeding.extend(crossing.exceeding);
    measured
}

/// Adds a line through every cell that exceeds the tolerance, across its worse direction; gives the
/// rows and columns of cells that are new or beside new ones.
fn split(grid: &mut Grid, exceeding: &[Exceeding]) -> [Vec<usize>; 2] {
    let of_rows = |e: &&Exceeding| e.closeness.along_u >= e.closeness.along_v;
    let (rows, columns): (Vec<&Exceeding>, _) = exceeding.iter().partition(of_rows);
    let rows = rows.iter().map(|e| e.row).collect();
    let columns = columns.iter().map(|e| e.column).collect();
    [halve(&mut grid.us, rows), halve(&mut grid.vs, columns)]
}

/// Halves some of the intervals between lines; gives the halves and their neighbours.
fn halve(lines: &mut Vec<f64>, mut intervals: Vec<usize>) -> Vec<usize> {
    intervals.sort_unstable();
    intervals.dedup();
    let mut changed = Vec::new();
    for (added, &i) in intervals.iter().enumerate() {
        let i = i + added;
        let middle = lines[i] + (lines[i + 1] - lines[i]) / 2.0;
        // Doubles between two neighbouring ones there are none.
        if middle > lines[i] && middle < lines[i + 1] {
            lines.insert(i + 1, middle);
        }
        changed.extend(i.saturating_sub(1)..=i + 2);
    }
    changed.sort_unstable();
    changed.dedup();
    changed.retain(|&i| i + 1 < lines.len());
    changed
}

#[cfg(test)]
mod tests;
