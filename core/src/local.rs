//! The papers' heuristic: Algorithm 2 of the 2001 paper, windows around the last winners.
//!
//! On each surface only the points less than δu rows and δv columns from its last winner are looked at,
//! wrapping round in v; once a surface comes within the cutter's width the search starts with all its
//! points. The winner may leave the window unnoticed, so that the method is not exact by itself: it is
//! held against the hierarchy, or against a path that is known. Nothing is bounded here.

use std::ops::Range;

use fearless_simd::Simd as Vectors;

use crate::blocks::runs;
use crate::contact::Pose;
use crate::cutter::Cutter;
use crate::job::{Culling, Window};
use crate::leaf::{Best, PointLeaf, Start};
use crate::path::Touch;
use crate::record::Counters;
use crate::row::{Row, RowKind, row_and_place};
use crate::simd::{Token, with_simd};
use crate::sweep::Sweep;
use crate::tree::Tree;
use crate::vector::{Interval, Point, cross, dot, length, sub};

/// The grids of the surfaces that rows belong to.
#[derive(Debug)]
pub(crate) struct Grids {
    sweep: Sweep,
    grids: Vec<Grid>,
}

/// One grid: a run of rows, one after the other among all points.
#[derive(Debug)]
struct Grid {
    first_row: u32,
    start: usize,
    rows: usize,
    columns: usize,
    /// Whether its rows go all the way round.
    closed: bool,
    /// Extent along the spindle, mm.
    x: Interval,
}

/// The last winner of each grid, as row and column.
type Winners = Vec<Option<(usize, usize)>>;

impl Grids {
    /// Of rows in order of their ids; slabs have no parameters and are left out.
    pub fn new(rows: &[Row], culling: Culling) -> Self {
        let mut start = 0;
        let mut grids = Vec::new();
        let mut normals = Vec::new();
        for (_, run) in runs(rows) {
            let columns = run[0].points.len();
            let points: usize = run.iter().map(|r| r.points.len()).sum();
            if columns > 0 && matches!(run[0].kind, RowKind::Isoline { .. }) {
                grids.push(Grid {
                    first_row: run[0].id,
                    start,
                    rows: run.len(),
                    columns,
                    closed: goes_round(run),
                    x: Interval::of(run.iter().flat_map(|r| &r.points).map(|p| p[0])),
                });
            }
            if culling.back_faces {
                normals.extend(outward_normals(run));
            }
            start += points;
        }
        let sweep = Sweep::new(rows, &normals, culling.beyond_reach);
        Self { sweep, grids }
    }

    /// No winner yet on any grid.
    fn start(&self) -> Winners {
        vec![None; self.grids.len()]
    }

    /// The highest point in the windows, which then move to what was found. Returns how many points
    /// were evaluated.
    fn search(
        &self,
        simd: Token,
        cutter: &Cutter,
        pose: &Pose,
        window: Window,
        winners: &mut Winners,
        best: &mut Best,
    ) -> u64 {
        with_simd!(simd, simd => self.search_by(simd, cutter, pose, window, winners, best))
    }

    #[inline(always)]
    fn search_by<S: Vectors>(
        &self,
        simd: S,
        cutter: &Cutter,
        pose: &Pose,
        window: Window,
        winners: &mut Winners,
        best: &mut Best,
    ) -> u64 {
        let mut evaluated = 0;
        for (grid, winner) in self.grids.iter().zip(winners) {
            let reach = Interval::of([pose.x]).widened(cutter.half_width());
            if !grid.x.meets(reach) {
                // Nothing to touch; once there is, all of it is searched again.
                *winner = None;
                continue;
            }
            let mut own = Best::above(f64::NEG_INFINITY);
            match *winner {
                None => {
                    let all = grid.start..grid.start + grid.rows * grid.columns;
                    evaluated += self.sweep.search_by(simd, cutter, pose, all, &mut own);
                }
                Some((row, column)) => {
                    let rows = around(row, window.delta_u, grid.rows);
                    let [left, right] = grid.columns_around(column, window.delta_v);
                    for row in rows {
                        let start = grid.start + row * grid.columns;
                        for part in [&left, &right] {
                            let part = start + part.start..start + part.end;
                            evaluated += self.sweep.search_by(simd, cutter, pose, part, &mut own);
                        }
                    }
                }
            }
            if let Some(touch) = own.touch() {
                best.raise(touch, own.id);
                *winner = Some(grid.place(own.id));
            } else {
                *winner = None;
            }
        }
        evaluated
    }

    /// Moves the window of the grid that holds a point to it.
    fn move_to(&self, winners: &mut Winners, id: u64) {
        let (row, _) = row_and_place(id);
        for (grid, winner) in self.grids.iter().zip(winners) {
            if (grid.first_row..grid.first_row + grid.rows as u32).contains(&row) {
                *winner = Some(grid.place(id));
            }
        }
    }
}

/// The highest points for each of some poses, by windows that fall back on the hierarchy where they have
/// lost the winner: it finds a point above theirs.
pub(crate) fn run(
    simd: Token,
    cutter: &Cutter,
    grids: &Grids,
    tree: &Tree<PointLeaf>,
    window: Window,
    poses: impl Iterator<Item = Pose>,
) -> (Vec<Option<Touch>>, Counters) {
    let mut counters = Counters::default();
    let mut touches = Vec::with_capacity(poses.size_hint().0);
    let mut winners = grids.start();
    let mut place = [0.0; 2];
    for pose in poses {
        let mut best = Best::above(f64::NEG_INFINITY);
        counters.evaluations += grids.search(simd, cutter, &pose, window, &mut winners, &mut best);
        if best.id != Best::NOBODY {
            let [d, _, z] = pose.face(best.contact);
            place = [d, z];
        }
        // Looked for from the winner's own height on: an equal one may come first in number.
        let start = Start {
            pose,
            floor: best.height,
            place,
        };
        let [exact, ..] = tree.search(simd, cutter, &[start], &mut counters);
        if exact.height > best.height {
            // Where the windows found nothing there is nothing to be too low.
            let found = best.id != Best::NOBODY;
            counters.lose(if found {
                exact.height - best.height
            } else {
                0.0
            });
            grids.move_to(&mut winners, exact.id);
        }
        touches.push(exact.touch());
    }
    (touches, counters)
}

/// The highest points for each of some poses by windows alone, held against the exact ones; it stops once
/// more than `allowed` are wrong.
pub(crate) fn chain(
    simd: Token,
    cutter: &Cutter,
    grids: &Grids,
    window: Window,
    poses: &[Pose],
    exact: &[Option<Touch>],
    allowed: u64,
) -> (Vec<Option<Touch>>, Counters) {
    let mut counters = Counters::default();
    let mut touches = Vec::with_capacity(poses.len());
    let mut winners = grids.start();
    for (pose, exact) in poses.iter().zip(exact) {
        let mut best = Best::above(f64::NEG_INFINITY);
        counters.evaluations += grids.search(simd, cutter, pose, window, &mut winners, &mut best);
        let touch = best.touch();
        match (touch, exact) {
            (Some(found), Some(exact)) if found.height < exact.height => {
                counters.lose(exact.height - found.height);
            }
            (None, Some(_)) => counters.lose(0.0),
            _ => {}
        }
        touches.push(touch);
        if counters.lost > allowed {
            break;
        }
    }
    (touches, counters)
}

impl Grid {
    /// Row and column of a point.
    fn place(&self, id: u64) -> (usize, usize) {
        let (row, column) = row_and_place(id);
        ((row - self.first_row) as usize, column)
    }

    /// The columns less than `delta` from a column: one range, or two where they wrap round.
    fn columns_around(&self, column: usize, delta: u32) -> [Range<usize>; 2] {
        let reach = delta as usize - 1;
        let period = self.columns;
        if !self.closed {
            return [around(column, delta, period), 0..0];
        }
        if 2 * reach + 1 >= period {
            return [0..period, 0..0];
        }
        if column < reach {
            [0..column + reach + 1, period + column - reach..period]
        } else if column + reach >= period {
            [column - reach..period, 0..column + reach + 1 - period]
        } else {
            [column - reach..column + reach + 1, 0..0]
        }
    }
}

/// Whether the ends of the rows are no further apart than two columns are on average: real surfaces meet
/// themselves at a seam that has a gap of its own.
fn goes_round(run: &[Row]) -> bool {
    let apart = |a: Point, b: Point| length(sub(b, a));
    let (mut gap, mut spacing) = (0.0, 0.0);
    for Row { points, .. } in run {
        let around: f64 = points.windows(2).map(|pair| apart(pair[0], pair[1])).sum();
        spacing += around / points.len() as f64;
        gap += apart(points[points.len() - 1], points[0]);
    }
    run[0].points.len() > 3 && gap <= spacing
}

/// The indices below `count` that are less than `delta` from `index`.
fn around(index: usize, delta: u32, count: usize) -> Range<usize> {
    let reach = delta as usize - 1;
    index.saturating_sub(reach)..(index + reach + 1).min(count)
}

/// A normal at each point of a grid, away from the spindle on the whole; none where it has no length.
fn outward_normals(run: &[Row]) -> Vec<Point> {
    let last = run.len() - 1;
    let normals = run.iter().enumerate().flat_map(|(i, row)| {
        let (before, after) = (
            &run[i.saturating_sub(1)].points,
            &run[(i + 1).min(last)].points,
        );
        let columns = row.points.len();
        (0..columns).map(move |j| {
            let (left, right) = (j.saturating_sub(1), (j + 1).min(columns - 1));
            let along = sub(
                after[j.min(after.len() - 1)],
                before[j.min(before.len() - 1)],
            );
            cross(along, sub(row.points[right], row.points[left]))
        })
    });
    let mut normals: Vec<Point> = normals.collect();
    let points = run.iter().flat_map(|r| &r.points);
    let outward: f64 = normals
        .iter()
        .zip(points)
        .map(|(&n, &[_, y, z])| dot(n, [0.0, y, z]))
        .sum();
    if outward < 0.0 {
        for n in &mut normals {
            *n = n.map(|c| -c);
        }
    }
    normals
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(columns: usize, closed: bool) -> Grid {
        Grid {
            first_row: 0,
            start: 0,
            rows: 5,
            columns,
            closed,
            x: Interval::EMPTY,
        }
    }

    #[test]
    fn windows_are_strict_and_wrap_round_closed_grids() {
        let columns = |closed, column, delta| {
            let [a, b] = grid(11, closed).columns_around(column, delta);
            a.chain(b).collect::<Vec<_>>()
        };
        assert_eq!(columns(false, 5, 2), [4, 5, 6]);
        assert_eq!(columns(false, 0, 3), [0, 1, 2]);
        assert_eq!(columns(false, 10, 2), [9, 10]);
        assert_eq!(columns(true, 0, 3), [0, 1, 2, 9, 10]);
        assert_eq!(columns(true, 10, 2), [9, 10, 0]);
        assert_eq!(columns(true, 5, 2), [4, 5, 6]);
        assert_eq!(columns(true, 3, 50).len(), 11);
        assert_eq!(around(3, 1, 5), 3..4);
    }
}
