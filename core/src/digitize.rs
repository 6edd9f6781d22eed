//! Virtual digitizing: the height of every position of a run.
//!
//! Positions are independent of each other, so they are cut into chunks that threads take in turn.
//! The winner of the last position only tells where to look first: a chunk that starts without it finds
//! the same winners.

use std::ops::Range;

use rayon::prelude::*;

use crate::contact::Pose;
use crate::cutter::Cutter;
use crate::job::{Contact, Job, Method};
use crate::motion::Trajectory;
use crate::path::Touch;
use crate::record::Counters;
use crate::row::Row;
use crate::tree::{
    Candidate, FacetCandidate, PointCandidate, Tree, Winner, facet_candidates, point_candidates,
};

/// Positions that one thread takes at a time.
const CHUNK: u64 = 256;

/// Rows made ready to be searched.
#[derive(Debug)]
pub struct Digitizer {
    cutter: Cutter,
    method: Method,
    candidates: Candidates,
}

#[derive(Debug)]
enum Candidates {
    Points(Tree<PointCandidate>),
    Facets(Tree<FacetCandidate>),
}

impl Digitizer {
    /// Makes rows ready; they are in order of their ids. Runs on the current thread pool.
    pub fn new(job: &Job, rows: &[Row]) -> Self {
        Self {
            cutter: job.cutter,
            method: job.method,
            candidates: match job.contact {
                Contact::Point => Candidates::Points(Tree::new(point_candidates(rows))),
                Contact::Facet => Candidates::Facets(Tree::new(facet_candidates(rows))),
            },
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
        let mut counters = Counters::default();
        let mut next = positions.start;
        while next < positions.end {
            // A few chunks for each thread at a time keep the results in order and in bounds.
            let end = positions.end.min(next + 4 * threads * CHUNK);
            let starts: Vec<u64> = (next..end).step_by(CHUNK as usize).collect();
            let chunks: Vec<_> = starts
                .into_par_iter()
                .map(|start| {
                    let run = start..end.min(start + CHUNK);
                    let done = match &self.candidates {
                        Candidates::Points(tree) => self.run(tree, trajectory, &directions, run),
                        Candidates::Facets(tree) => self.run(tree, trajectory, &directions, run),
                    };
                    (start, done)
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
    fn run<C: Candidate>(
        &self,
        tree: &Tree<C>,
        trajectory: &Trajectory,
        directions: &[(f64, f64)],
        positions: Range<u64>,
    ) -> (Vec<Option<Touch>>, Counters) {
        let revolution = u64::from(trajectory.points_per_revolution);
        let mut counters = Counters::default();
        let mut last: Option<Winner> = None;
        let touch = |index: u64| {
            let (cos, sin) = directions[(index % revolution) as usize];
            let x = trajectory.travel(index);
            let pose = Pose { x, cos, sin };
            let mut best = None;
            let cost = match self.method {
                Method::Brute => tree.try_all(&self.cutter, &pose, &mut best),
                Method::Exact => {
                    if let Some(last) = last {
                        tree.try_place(last.place, &self.cutter, &pose, &mut best);
                        counters.evaluations += 1;
                    }
                    tree.search(&self.cutter, &pose, &mut best)
                }
            };
            counters += cost;
            last = best;
            best.map(|winner| winner.touch)
        };
        (positions.map(touch).collect(), counters)
    }
}
