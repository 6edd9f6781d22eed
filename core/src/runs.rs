//! Runs: in which order an extent's positions are digitized, and with which rows: those first that need
//! only the extent's own, and what another attempt has left over.

use std::ops::Range;

use crate::bisect::first_without;
use crate::digitize::chunk;
use crate::extent::{Extent, rows_within, seen};
use crate::job::Job;
use crate::motion::Trajectory;
use crate::row::Outline;
use crate::tolerance::REACH_SLACK;

/// Positions that are digitized together, and the rows that this takes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Run {
    /// Index of the first position.
    pub first: u64,
    /// Number of positions.
    pub count: u64,
    /// Ids of the rows they need, in order.
    pub rows: Vec<u32>,
}

/// A second hierarchy pays if this share of the positions need not wait for it.
const WORTH_IT: f64 = 0.25;

/// The longest run of an extent's positions that need only its own rows, then what is before and what
/// is after it; all of it as one run if that would be too short to be worth it.
pub(crate) fn interior_first(
    trajectory: &Trajectory,
    outlines: &[Outline],
    job: &Job,
    extent: &Extent,
) -> Vec<Run> {
    let w = job.cutter.half_width() + REACH_SLACK;
    let (begin, end) = (extent.first, extent.first + extent.count);
    // Positions from which each row of the halo is in reach; travel never decreases.
    let mut edges: Vec<(u64, u64)> = Vec::new();
    for &row in extent.halo.iter().flat_map(|h| &h.rows) {
        let before = (row as usize).checked_sub(1).map(|i| outlines[i]);
        let strip = before.filter(|o| o.joins_next).map(|o| o.x);
        let x = strip.map_or(outlines[row as usize].x, |s| {
            s.hull(outlines[row as usize].x)
        });
        let clear = |i| seen(trajectory, job, i..i + 1).high + w < x.low;
        let from = first_without(begin..end, clear);
        let to = first_without(begin..end, |i| trajectory.travel(i) - w <= x.high);
        edges.push((from, to));
    }
    edges.sort_unstable();
    let (mut interior, mut next) = (begin..begin, begin);
    for (from, to) in edges.into_iter().chain([(end, end)]) {
        if from.saturating_sub(next) > interior.end - interior.start {
            interior = next..from;
        }
        next = next.max(to);
    }
    let run = |positions| run_of(trajectory, outlines, job, positions);
    let inner = run(interior.clone());
    let needs_no_others = inner
        .rows
        .iter()
        .all(|r| extent.own.binary_search(r).is_ok());
    if !needs_no_others || (inner.count as f64) < WORTH_IT * extent.count as f64 {
        return vec![extent.whole()];
    }
    let around = [begin..interior.start, interior.end..end].map(run);
    let around = around.into_iter().filter(|run| run.count > 0);
    std::iter::once(inner).chain(around).collect()
}

/// What is left of runs when only these positions are missing, which ascend. Each begins where a chunk
/// of its run does, so that what is digitized twice comes in the same chunks.
pub(crate) fn remaining(
    trajectory: &Trajectory,
    outlines: &[Outline],
    job: &Job,
    runs: &[Run],
    missing: &[Range<u64>],
) -> Vec<Run> {
    let chunk = chunk(trajectory);
    let mut left = Vec::new();
    for run in runs {
        let mut gaps: Vec<Range<u64>> = Vec::new();
        for gap in missing {
            let (start, end) = (gap.start.max(run.first), gap.end.min(run.first + run.count));
            if start >= end {
                continue;
            }
            let start = run.first + (start - run.first) / chunk * chunk;
            match gaps.last_mut() {
                Some(last) if last.end >= start => last.end = end,
                _ => gaps.push(start..end),
            }
        }
        let part = |gap| run_of(trajectory, outlines, job, gap);
        left.extend(gaps.into_iter().map(part));
    }
    left
}

/// The same runs for someone who helps: from behind, and the first, at which another one is, in halves.
pub(crate) fn from_behind(
    trajectory: &Trajectory,
    outlines: &[Outline],
    job: &Job,
    runs: Vec<Run>,
) -> Vec<Run> {
    let chunk = chunk(trajectory);
    let mut runs = runs;
    if let Some(first) = runs.first() {
        let (begin, end) = (first.first, first.first + first.count);
        let middle = begin + first.count / 2 / chunk * chunk;
        let halves = [begin..middle, middle..end];
        let halves = halves.into_iter().filter(|half| !half.is_empty());
        let halves = halves.map(|half| run_of(trajectory, outlines, job, half));
        runs.splice(..1, halves);
    }
    runs.reverse();
    runs
}

/// Positions as a run, with the rows that they need.
fn run_of(trajectory: &Trajectory, outlines: &[Outline], job: &Job, positions: Range<u64>) -> Run {
    let w = job.cutter.half_width() + REACH_SLACK;
    Run {
        first: positions.start,
        count: positions.end - positions.start,
        rows: rows_within(outlines, seen(trajectory, job, positions).widened(w)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::extent::tests::job;
    use crate::motion::MotionKind;
    use proptest::prelude::*;

    const TRAJECTORY: Trajectory = Trajectory {
        kind: MotionKind::Helix,
        from: 0.0,
        step: 3.0,
        points_per_revolution: 40,
        positions: 9000,
    };

    fn run(first: u64, count: u64) -> Run {
        let rows = Vec::new();
        Run { first, count, rows }
    }

    proptest! {
        /// All that is missing is there again, once, in chunks that anybody would deliver.
        #[test]
        fn what_is_left_holds_what_is_missing_in_whole_chunks(
            ends in prop::collection::btree_set(0..9000_u64, 2..6),
            gaps in prop::collection::btree_set(0..9000_u64, 0..12),
            helps in any::<bool>(),
        ) {
            let ends: Vec<u64> = ends.into_iter().collect();
            let runs: Vec<Run> = ends.windows(2).map(|e| run(e[0], e[1] - e[0])).collect();
            let gaps: Vec<u64> = gaps.into_iter().collect();
            let missing: Vec<Range<u64>> = gaps.chunks_exact(2).map(|g| g[0]..g[1]).collect();
            let mut left = remaining(&TRAJECTORY, &[], &job(5.0, None), &runs, &missing);
            if helps {
                left = from_behind(&TRAJECTORY, &[], &job(5.0, None), left);
            }
            let mut times = vec![0; 9000];
            for part in &left {
                let of = runs.iter().find(|r| (r.first..r.first + r.count).contains(&part.first));
                let of = of.expect("of a run");
                prop_assert!(part.count > 0 && part.first + part.count <= of.first + of.count);
                prop_assert_eq!((part.first - of.first) % chunk(&TRAJECTORY), 0);
                (part.first..part.first + part.count).for_each(|i| times[i as usize] += 1);
            }
            prop_assert!(times.iter().all(|&n| n <= 1));
            for i in missing.iter().cloned().flatten().filter(|i| (ends[0]..ends[ends.len() - 1]).contains(i)) {
                prop_assert_eq!(times[i as usize], 1);
            }
        }
    }

    #[test]
    fn who_helps_begins_where_the_other_one_will_be_last() {
        let order = |runs: &[(u64, u64)]| {
            let runs = runs
                .iter()
                .map(|&(first, count)| run(first, count))
                .collect();
            let runs = from_behind(&TRAJECTORY, &[], &job(5.0, None), runs);
            runs.iter().map(|r| (r.first, r.count)).collect::<Vec<_>>()
        };
        let chunk = chunk(&TRAJECTORY);
        let (half, all) = (2 * chunk, 4 * chunk + 7);
        assert_eq!(order(&[(0, all)]), [(half, all - half), (0, half)]);
        let others = [(100, all), (50, 50), (5000, 9)];
        let expected = [(5000, 9), (50, 50), (100 + half, all - half), (100, half)];
        assert_eq!(order(&others), expected);
        assert_eq!(order(&[(0, chunk)]), [(0, chunk)], "a chunk is not cut");
        assert!(order(&[]).is_empty());
    }
}
