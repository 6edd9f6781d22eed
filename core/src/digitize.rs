//! Virtual digitizing: the height of every position of a run.
//!
//! Positions are independent of each other, so they are cut into chunks that threads take in turn.
//! The winners of earlier positions only tell where to look first: a chunk that starts without them
//! finds the same winners.

use std::ops::Range;

use rayon::prelude::*;

use crate::between::{self, Probe};
use crate::bisect::first_without;
use crate::blocks::{
    facet_bundles, facet_leaf, facet_vertices, point_bundles, point_leaf, point_vertices,
};
use crate::contact::{Pose, least_height};
use crate::cutter::Cutter;
use crate::job::{Contact, Job, Local, Method, Window};
use crate::lanes::LANES;
use crate::leaf::{Best, FacetLeaf, Leaf, PointLeaf, Start};
use crate::local::{self, Grids};
use crate::motion::{Motion, Trajectory};
use crate::path::{SubTrajectory, ToolPath, Touch, stitch};
use crate::record::Counters;
use crate::row::{Row, starts};
use crate::simd::{Simd, Token};
use crate::sweep::{self, AllFacets, Sweep};
use crate::tree::Tree;

/// Positions that one thread takes at a time: these many at least, and a few revolutions.
const CHUNK: u64 = 256;

/// Chunks of each thread that are held at a time, to be delivered in order; fewer where positions are
/// inserted, of which a chunk may have a thousand times as many as others.
const ROUND: u64 = 8;
const ROUND_BETWEEN: u64 = 2;

/// Number of positions of each chunk of a run, but for the last: whoever digitizes any whole chunks of it
/// delivers the same ones.
pub(crate) fn chunk(trajectory: &Trajectory) -> u64 {
    let revolutions = 2 * u64::from(trajectory.points_per_revolution);
    CHUNK.max(revolutions).min(4096)
}

/// Rows made ready to be searched.
#[derive(Debug)]
pub struct Digitizer {
    cutter: Cutter,
    /// How far straight moves may stray, mm.
    path_tolerance: Option<f64>,
    simd: Token,
    search: Search,
}

#[derive(Debug)]
enum Search {
    Points(Tree<PointLeaf>),
    Facets(Tree<FacetLeaf>),
    AllPoints(Sweep),
    AllFacets(AllFacets),
    Windows {
        grids: Grids,
        tree: Tree<PointLeaf>,
        window: Window,
    },
}

impl Digitizer {
    /// Makes rows ready; they are in order of their ids. Runs on the current thread pool.
    pub fn new(job: &Job, rows: &[Row], simd: Simd) -> Self {
        let simd = simd.token();
        let search = match (job.method, job.contact) {
            (Method::Exact, Contact::Point) => Search::Points(point_tree(simd, rows)),
            (Method::Exact, Contact::Facet) => Search::Facets(facet_tree(simd, rows)),
            (Method::Brute, Contact::Point) => Search::AllPoints(Sweep::new(rows, &[], false)),
            (Method::Brute, Contact::Facet) => Search::AllFacets(AllFacets::new(rows)),
            (Method::Local(local), _) => Search::Windows {
                grids: Grids::new(rows, local.culling),
                tree: point_tree(simd, rows),
                window: local.window.unwrap_or(Window::EVERYTHING),
            },
        };
        Self {
            cutter: job.cutter,
            path_tolerance: job.motion.path_tolerance,
            simd,
            search,
        }
    }

    /// Makes facets ready for a cutter, each position for itself and by the exact search. Runs on the current
    /// thread pool.
    pub(crate) fn over_facets(cutter: Cutter, rows: &[Row], simd: Simd) -> Self {
        let simd = simd.token();
        Self {
            cutter,
            path_tolerance: None,
            simd,
            search: Search::Facets(facet_tree(simd, rows)),
        }
    }

    /// The same facets under another cutter, each position for itself; `None` if these are not facets to be
    /// searched exactly.
    pub(crate) fn under(self, cutter: Cutter) -> Option<Self> {
        matches!(self.search, Search::Facets(_)).then_some(Self {
            cutter,
            path_tolerance: None,
            ..self
        })
    }

    /// Memory that the rows take beyond themselves, bytes.
    pub fn bytes(&self) -> usize {
        match &self.search {
            Search::Points(tree) => tree.bytes(),
            Search::Facets(tree) => tree.bytes(),
            Search::Windows { tree, .. } => tree.bytes(),
            Search::AllPoints(_) | Search::AllFacets(_) => 0,
        }
    }

    /// Digitizes consecutive positions on the current thread pool, chunk by chunk, in order, each with
    /// what is inserted on the moves that begin there. `deliver` gets each chunk and what it cost; it
    /// returns `false` to stop.
    pub fn run_chunks(
        &self,
        trajectory: &Trajectory,
        positions: Range<u64>,
        mut deliver: impl FnMut(SubTrajectory, Counters) -> bool,
    ) -> Counters {
        let directions = trajectory.directions();
        let threads = rayon::current_num_threads() as u64;
        let chunk = chunk(trajectory);
        let round = match self.path_tolerance {
            None => ROUND,
            Some(_) => ROUND_BETWEEN,
        };
        let mut counters = Counters::default();
        let mut next = positions.start;
        while next < positions.end {
            // A few chunks for each thread at a time keep the results in order and in bounds.
            let end = positions.end.min(next + round * threads * chunk);
            let starts: Vec<u64> = (next..end).step_by(chunk as usize).collect();
            let chunks: Vec<_> = starts
                .into_par_iter()
                .map(|start| self.run(trajectory, &directions, start..end.min(start + chunk)))
                .collect();
            for (chunk, cost) in chunks {
                counters += cost;
                if !deliver(chunk, cost) {
                    return counters;
                }
            }
            next = end;
        }
        counters
    }

    /// Digitizes all positions on the current thread pool: the path, and what it cost.
    ///
    /// # Panics
    /// Never: every position comes once.
    pub fn path(&self, trajectory: &Trajectory) -> (ToolPath, Counters) {
        let mut chunks = Vec::new();
        let counters = self.run_chunks(trajectory, 0..trajectory.positions, |chunk, _| {
            chunks.push(chunk);
            true
        });
        let path = stitch(*trajectory, chunks).expect("every position comes once");
        (path, counters)
    }

    /// Digitizes consecutive positions on this thread, and the moves that begin there.
    fn run(
        &self,
        trajectory: &Trajectory,
        directions: &[(f64, f64)],
        positions: Range<u64>,
    ) -> (SubTrajectory, Counters) {
        let Range { start, end } = positions;
        let poses = poses(trajectory, directions, positions);
        let (mut touches, mut counters) = self.search_all(trajectory, poses);
        let Some(tolerance) = self.path_tolerance else {
            let chunk = SubTrajectory {
                first: start,
                touches,
                between: Vec::new(),
            };
            return (chunk, counters);
        };
        // The last move ends at a position that is another's.
        if end < trajectory.positions {
            let (cos, sin) = directions[(end % directions.len() as u64) as usize];
            let x = trajectory.travel(end);
            let beyond = Probe {
                pose: Pose { x, cos, sin },
                near: [touches.last().copied().flatten(), None],
            };
            touches.extend(self.search_near(&[beyond], &mut counters));
        }
        let search = |probes: &[Probe]| self.search_near(probes, &mut counters);
        let (between, beyond) = between::insert(trajectory, tolerance, start, &touches, search);
        counters.beyond_tolerance += beyond;
        touches.truncate((end - start) as usize);
        let chunk = SubTrajectory {
            first: start,
            touches,
            between,
        };
        (chunk, counters)
    }

    /// What is touched at consecutive positions.
    fn search_all(
        &self,
        trajectory: &Trajectory,
        poses: impl Iterator<Item = Pose>,
    ) -> (Vec<Option<Touch>>, Counters) {
        let (cutter, simd) = (&self.cutter, self.simd);
        let revolution = trajectory.points_per_revolution as usize;
        match &self.search {
            Search::Points(tree) => exact(simd, cutter, tree, revolution, poses),
            Search::Facets(tree) => exact(simd, cutter, tree, revolution, poses),
            Search::AllPoints(sweep) => sweep::run(simd, cutter, sweep, poses),
            Search::AllFacets(facets) => facets.run(cutter, poses),
            Search::Windows {
                grids,
                tree,
                window,
            } => local::run(simd, cutter, grids, tree, *window, poses),
        }
    }

    /// What is touched between positions. Windows follow a winner from position to position, so that
    /// the hierarchy, which they fall back on anyway, does it for them.
    fn search_near(&self, probes: &[Probe], counters: &mut Counters) -> Vec<Option<Touch>> {
        let (cutter, simd) = (&self.cutter, self.simd);
        let poses = probes.iter().map(|p| p.pose);
        let (touches, cost) = match &self.search {
            Search::Points(tree) | Search::Windows { tree, .. } => near(simd, cutter, tree, probes),
            Search::Facets(tree) => near(simd, cutter, tree, probes),
            Search::AllPoints(sweep) => sweep::run(simd, cutter, sweep, poses),
            Search::AllFacets(facets) => facets.run(cutter, poses),
        };
        *counters += cost;
        touches
    }
}

/// The papers' search without a fallback: one chain of windows from the first position to the last.
#[derive(Debug)]
pub struct Heuristic {
    grids: Grids,
    cutter: Cutter,
    simd: Token,
    poses: Vec<Pose>,
    exact: Vec<Option<Touch>>,
}

impl Heuristic {
    /// Makes rows ready, and finds the exact path to hold the chains against. Runs on the current
    /// thread pool.
    pub fn new(job: &Job, local: Local, rows: &[Row], trajectory: &Trajectory, simd: Simd) -> Self {
        // The chain is held against positions alone.
        let motion = Motion {
            path_tolerance: None,
            ..job.motion
        };
        let exact_job = Job {
            method: Method::Exact,
            motion,
            ..*job
        };
        let positions = 0..trajectory.positions;
        let mut exact = Vec::new();
        Digitizer::new(&exact_job, rows, simd).run_chunks(
            trajectory,
            positions.clone(),
            |chunk, _| {
                exact.extend(chunk.touches);
                true
            },
        );
        Self {
            grids: Grids::new(rows, local.culling),
            cutter: job.cutter,
            simd: simd.token(),
            poses: poses(trajectory, &trajectory.directions(), positions).collect(),
            exact,
        }
    }

    /// The path by windows alone, and at how many positions it is wrong.
    pub fn run(&self, window: Window) -> (Vec<Option<Touch>>, Counters) {
        self.chain(window, u64::MAX)
    }

    /// The smallest window that never loses the winner on this part: about square at first, then each
    /// side is made smaller as far as it goes.
    pub fn smallest_window(&self) -> Window {
        let holds = |delta_u, delta_v| {
            let window = Window { delta_u, delta_v };
            self.chain(window, 0).1.lost == 0
        };
        let mut side = 1;
        while side < Window::EVERYTHING.delta_u && !holds(side, side) {
            side *= 2;
        }
        let delta_u = smallest(side, |delta_u| holds(delta_u, side));
        let delta_v = smallest(side, |delta_v| holds(delta_u, delta_v));
        Window { delta_u, delta_v }
    }

    /// Stops once more than `allowed` positions are wrong.
    fn chain(&self, window: Window, allowed: u64) -> (Vec<Option<Touch>>, Counters) {
        let (poses, exact) = (&self.poses, &self.exact);
        let (cutter, grids) = (&self.cutter, &self.grids);
        local::chain(self.simd, cutter, grids, window, poses, exact, allowed)
    }
}

/// The smallest number from 1 up to `enough` that holds, if all above it do.
fn smallest(enough: u32, holds: impl Fn(u32) -> bool) -> u32 {
    first_without(1..u64::from(enough), |n| !holds(n as u32)) as u32
}

fn poses(
    trajectory: &Trajectory,
    directions: &[(f64, f64)],
    positions: Range<u64>,
) -> impl Iterator<Item = Pose> {
    positions.map(move |index| {
        let revolution = u64::from(trajectory.points_per_revolution);
        let (cos, sin) = directions[(index % revolution) as usize];
        let x = trajectory.travel(index);
        Pose { x, cos, sin }
    })
}

fn point_tree(simd: Token, rows: &[Row]) -> Tree<PointLeaf> {
    Tree::new(
        simd,
        Vec::new(),
        point_bundles(rows),
        |_, block| point_leaf(rows, block),
        |block, take| point_vertices(rows, block, take),
    )
}

fn facet_tree(simd: Token, rows: &[Row]) -> Tree<FacetLeaf> {
    let starts = starts(rows);
    let mut points = Vec::with_capacity(rows.iter().map(|row| row.points.len()).sum());
    for row in rows {
        points.extend_from_slice(&row.points);
    }
    Tree::new(
        simd,
        points,
        facet_bundles(rows),
        |points, block| facet_leaf(rows, &starts, points, block),
        |block, take| facet_vertices(rows, block, take),
    )
}

fn exact<L: Leaf>(
    simd: Token,
    cutter: &Cutter,
    tree: &Tree<L>,
    revolution: usize,
    poses: impl Iterator<Item = Pose>,
) -> (Vec<Option<Touch>>, Counters) {
    let mut counters = Counters::default();
    let mut touches: Vec<Option<Touch>> = Vec::with_capacity(poses.size_hint().0);
    let mut poses = poses.peekable();
    let mut place = [0.0; 2];
    let mut starts = Vec::with_capacity(LANES);
    while poses.peek().is_some() {
        let next = touches.len();
        let touched = |i: Option<usize>| i.and_then(|i| touches.get(i).copied().flatten());
        starts.clear();
        for (i, pose) in (next..next + LANES).zip(poses.by_ref()) {
            let mut floor = f64::NEG_INFINITY;
            for earlier in [next.checked_sub(1), i.checked_sub(revolution)] {
                if let Some(touch) = touched(earlier) {
                    floor = floor.max(least_height(cutter, &pose, touch.contact));
                }
            }
            starts.push(Start { pose, floor, place });
        }
        let found = tree.search(simd, cutter, &starts, &mut counters);
        for (start, best) in starts.iter().zip(found) {
            let touch = best.touch();
            if let Some(touch) = touch {
                let [d, _, z] = start.pose.face(touch.contact);
                place = [d, z];
            }
            touches.push(touch);
        }
    }
    (touches, counters)
}

/// The same for probes, each with what is touched beside it.
fn near<L: Leaf>(
    simd: Token,
    cutter: &Cutter,
    tree: &Tree<L>,
    probes: &[Probe],
) -> (Vec<Option<Touch>>, Counters) {
    let mut counters = Counters::default();
    let mut touches: Vec<Option<Touch>> = Vec::with_capacity(probes.len());
    let mut place = [0.0; 2];
    let mut starts = Vec::with_capacity(LANES);
    for eight in probes.chunks(LANES) {
        starts.clear();
        for &Probe { pose, near } in eight {
            let mut floor = f64::NEG_INFINITY;
            for touch in near.iter().flatten() {
                floor = floor.max(least_height(cutter, &pose, touch.contact));
                let [d, _, z] = pose.face(touch.contact);
                place = [d, z];
            }
            starts.push(Start { pose, floor, place });
        }
        let found = tree.search(simd, cutter, &starts, &mut counters);
        touches.extend(found.iter().take(eight.len()).map(Best::touch));
    }
    (touches, counters)
}
