//! Virtual digitizing: the height of every position of a run.
//!
//! Positions are independent of each other, so they are cut into chunks that threads take in turn.
//! The winners of earlier positions only tell where to look first: a chunk that starts without them
//! finds the same winners.

use std::ops::Range;

use fearless_simd::Simd as Vectors;
use rayon::prelude::*;

use crate::blocks::{Block, facet_blocks, facet_leaf, point_blocks, point_leaf};
use crate::contact::{Pose, least_height, touch_facet};
use crate::cutter::Cutter;
use crate::job::{Contact, Job, Method};
use crate::leaf::{Best, FacetLeaf, Leaf, PointLeaf};
use crate::motion::Trajectory;
use crate::path::Touch;
use crate::record::Counters;
use crate::row::{Facet, Row, facets, starts};
use crate::simd::{Simd, with_simd};
use crate::sweep::Sweep;
use crate::tree::{Start, Tree};
use crate::vector::Point;

/// Positions that one thread takes at a time: these many at least, and a few revolutions.
const CHUNK: u64 = 256;

/// Rows made ready to be searched.
#[derive(Debug)]
pub struct Digitizer {
    cutter: Cutter,
    simd: Simd,
    search: Search,
}

#[derive(Debug)]
enum Search {
    Points(Tree<PointLeaf>),
    Facets(Tree<FacetLeaf>),
    AllPoints(Sweep),
    AllFacets(Vec<(u64, [Point; 3])>),
}

impl Digitizer {
    /// Makes rows ready; they are in order of their ids. Runs on the current thread pool.
    pub fn new(job: &Job, rows: &[Row], simd: Simd) -> Self {
        let search = match (job.method, job.contact) {
            (Method::Exact, Contact::Point) => {
                Search::Points(Tree::new(Vec::new(), point_blocks(rows), |_, b| {
                    point_leaf(rows, b)
                }))
            }
            (Method::Exact, Contact::Facet) => {
                let starts = starts(rows);
                let points = rows.iter().flat_map(|r| r.points.iter().copied()).collect();
                let fill = |points: &[Point], b: &Block| facet_leaf(rows, &starts, points, b);
                Search::Facets(Tree::new(points, facet_blocks(rows), fill))
            }
            (Method::Brute, Contact::Point) => Search::AllPoints(Sweep::new(rows)),
            (Method::Brute, Contact::Facet) => Search::AllFacets(all_facets(rows)),
        };
        Self {
            cutter: job.cutter,
            simd,
            search,
        }
    }

    /// Memory that the rows take beyond themselves, bytes.
    pub fn bytes(&self) -> usize {
        match &self.search {
            Search::Points(tree) => tree.bytes(),
            Search::Facets(tree) => tree.bytes(),
            Search::AllPoints(_) | Search::AllFacets(_) => 0,
        }
    }

    /// Digitizes consecutive positions on the current thread pool, chunk by chunk, in order.
    /// `deliver` gets each chunk's first position and its touches; it returns `false` to stop.
    pub fn run_chunks(
        &self,
        trajectory: &Trajectory,
        positions: Range<u64>,
        mut deliver: impl FnMut(u64, Vec<Option<Touch>>) -> bool,
    ) -> Counters {
        let directions = trajectory.directions();
        let threads = rayon::current_num_threads() as u64;
        let chunk = CHUNK
            .max(2 * u64::from(trajectory.points_per_revolution))
            .min(4096);
        let mut counters = Counters::default();
        let mut next = positions.start;
        while next < positions.end {
            // A few chunks for each thread at a time keep the results in order and in bounds.
            let end = positions.end.min(next + 8 * threads * chunk);
            let starts: Vec<u64> = (next..end).step_by(chunk as usize).collect();
            let chunks: Vec<_> = starts
                .into_par_iter()
                .map(|start| {
                    let run = start..end.min(start + chunk);
                    (start, self.run(trajectory, &directions, run))
                })
                .collect();
            for (start, (touches, cost)) in chunks {
                counters += cost;
                if !deliver(start, touches) {
                    return counters;
                }
            }
            next = end;
        }
        counters
    }

    /// Digitizes consecutive positions on this thread.
    fn run(
        &self,
        trajectory: &Trajectory,
        directions: &[(f64, f64)],
        positions: Range<u64>,
    ) -> (Vec<Option<Touch>>, Counters) {
        let poses = positions.map(|index| {
            let revolution = u64::from(trajectory.points_per_revolution);
            let (cos, sin) = directions[(index % revolution) as usize];
            let x = trajectory.travel(index);
            Pose { x, cos, sin }
        });
        let revolution = trajectory.points_per_revolution as usize;
        match &self.search {
            Search::Points(tree) => {
                with_simd!(self.simd, simd => exact(simd, &self.cutter, tree, revolution, poses))
            }
            Search::Facets(tree) => {
                with_simd!(self.simd, simd => exact(simd, &self.cutter, tree, revolution, poses))
            }
            Search::AllPoints(sweep) => {
                with_simd!(self.simd, simd => brute(simd, &self.cutter, sweep, poses))
            }
            Search::AllFacets(facets) => brute_facets(&self.cutter, facets, poses),
        }
    }
}

#[inline(always)]
fn exact<S: Vectors, L: Leaf>(
    simd: S,
    cutter: &Cutter,
    tree: &Tree<L>,
    revolution: usize,
    poses: impl Iterator<Item = Pose>,
) -> (Vec<Option<Touch>>, Counters) {
    let mut counters = Counters::default();
    let mut touches: Vec<Option<Touch>> = Vec::with_capacity(poses.size_hint().0);
    let mut place = [0.0; 2];
    for (i, pose) in poses.enumerate() {
        let mut floor = f64::NEG_INFINITY;
        for back in [1, revolution] {
            let earlier = i.checked_sub(back).and_then(|i| touches[i]);
            if let Some(touch) = earlier {
                floor = floor.max(least_height(cutter, &pose, touch.contact));
            }
        }
        let touch = tree.search(simd, cutter, &pose, &Start { floor, place }, &mut counters);
        if let Some(touch) = touch {
            let [d, _, z] = pose.face(touch.contact);
            place = [d, z];
        }
        touches.push(touch);
    }
    (touches, counters)
}

#[inline(always)]
fn brute<S: Vectors>(
    simd: S,
    cutter: &Cutter,
    sweep: &Sweep,
    poses: impl Iterator<Item = Pose>,
) -> (Vec<Option<Touch>>, Counters) {
    // A loop and no closure: only what is written here is compiled for the instruction set.
    let mut counters = Counters::default();
    let mut touches = Vec::with_capacity(poses.size_hint().0);
    for pose in poses {
        let mut best = Best::above(f64::NEG_INFINITY);
        counters.evaluations += sweep.search(simd, cutter, &pose, &mut best);
        touches.push(best.touch());
    }
    (touches, counters)
}

fn all_facets(rows: &[Row]) -> Vec<(u64, [Point; 3])> {
    let points: Vec<Point> = rows.iter().flat_map(|r| r.points.iter().copied()).collect();
    let facet = |f: Facet| {
        let id = u64::from(rows[f.row].id) << 32 | f.number as u64;
        (id, f.corners.map(|c| points[c as usize]))
    };
    facets(rows).map(facet).collect()
}

fn brute_facets(
    cutter: &Cutter,
    facets: &[(u64, [Point; 3])],
    poses: impl Iterator<Item = Pose>,
) -> (Vec<Option<Touch>>, Counters) {
    let mut counters = Counters::default();
    let touch = |pose: Pose| {
        let mut best = Best::above(f64::NEG_INFINITY);
        for &(id, corners) in facets {
            if let Some(touch) = touch_facet(cutter, &pose, corners) {
                best.raise(touch, id);
            }
        }
        counters.evaluations += facets.len() as u64;
        best.touch()
    };
    (poses.map(touch).collect(), counters)
}
