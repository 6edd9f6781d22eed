//! Taking turns: what is to be compared is measured alternately, so that a machine that is busy for
//! a while is busy for both.

use std::hint::black_box;
use std::ops::Range;
use std::time::{Duration, Instant};

use horma_core::{Counters, Digitizer, MotionKind, SubTrajectory, Touch, Trajectory};

/// How much to measure.
#[derive(Debug, Clone, Copy)]
pub(super) struct Effort {
    /// Numbers of points, over all surfaces.
    pub densities: &'static [f64],
    /// Positions of a path that are measured; of a longer path, runs all along it.
    pub positions: u64,
    /// Turns that everything gets at least.
    pub turns: usize,
    /// Time that something takes in all before it gets no more turns.
    pub patience: Duration,
    /// Time that one turn of brute force may take; a few positions are measured in any case.
    pub brute: Duration,
}

impl Effort {
    /// A few minutes.
    pub const FULL: Self = Self {
        densities: &[
            1.0e4, 1.9e4, 3.16e4, 1.0e5, 3.16e5, 1.0e6, 1.8e6, 3.16e6, 1.0e7,
        ],
        positions: 300_000,
        turns: 3,
        patience: Duration::from_millis(1000),
        brute: Duration::from_millis(150),
    };
    /// A few seconds.
    pub const QUICK: Self = Self {
        densities: &[1.0e4, 3.16e4, 1.0e5],
        positions: 8_000,
        turns: 2,
        patience: Duration::from_millis(100),
        brute: Duration::from_millis(20),
    };
}

/// Something to measure: it does its work once and returns how long that took, s.
pub(super) type Task<'a> = Box<dyn FnMut() -> f64 + 'a>;

/// Gives every task its turn, again and again; what is slow gets `least` turns only, while the rest
/// goes on. Returns the shortest time of each, s.
pub(super) fn shortest(effort: &Effort, least: usize, mut tasks: Vec<Task>) -> Vec<f64> {
    let patience = effort.patience.as_secs_f64();
    let mut best = vec![f64::INFINITY; tasks.len()];
    let mut spent = vec![0.0; tasks.len()];
    let mut turn = 0;
    while turn < least || spent.iter().any(|&s| s < patience) {
        for ((task, best), spent) in tasks.iter_mut().zip(&mut best).zip(&mut spent) {
            if turn < least || *spent < patience {
                let time = task();
                *best = best.min(time);
                *spent += time;
            }
        }
        turn += 1;
    }
    best
}

/// Positions to digitize by some way of searching.
#[derive(Debug, Clone)]
pub(super) struct Walk<'a> {
    pub digitizer: &'a Digitizer,
    pub trajectory: Trajectory,
    /// Consecutive positions, one run after the other.
    pub runs: Vec<Range<u64>>,
}

impl<'a> Walk<'a> {
    /// Along the whole trajectory: all of it if that is not more than asked for, else in runs of two
    /// revolutions or more, evenly spread, so that the search profits from neighbours as ever.
    pub fn along(digitizer: &'a Digitizer, trajectory: Trajectory, most: u64) -> Self {
        Self {
            digitizer,
            trajectory,
            runs: runs(&trajectory, most),
        }
    }

    /// A few single positions: brute force costs the same wherever it starts.
    pub fn scattered(digitizer: &'a Digitizer, along: &Trajectory, count: u64) -> Self {
        // Few angles, for they are computed at every call; and no divisor of what a part repeats.
        const ANGLES: u32 = 7;
        let from = along.travel(0);
        let span = along.travel(along.positions.saturating_sub(1)) - from;
        let trajectory = Trajectory {
            kind: MotionKind::Helix,
            from: from + span / (2 * count.max(1)) as f64,
            step: span * f64::from(ANGLES) / count.max(1) as f64,
            points_per_revolution: ANGLES,
            positions: count,
        };
        Self {
            digitizer,
            trajectory,
            runs: std::iter::once(0..count).collect(),
        }
    }

    /// The same positions, searched in another way.
    pub fn by<'b>(&self, digitizer: &'b Digitizer) -> Walk<'b> {
        Walk {
            digitizer,
            trajectory: self.trajectory,
            runs: self.runs.clone(),
        }
    }

    pub fn positions(&self) -> u64 {
        self.runs.iter().map(|r| r.end - r.start).sum()
    }

    /// Wall time, s.
    pub fn time(&self) -> f64 {
        let begin = Instant::now();
        for run in &self.runs {
            let deliver = |run, _| {
                black_box::<SubTrajectory>(run);
                true
            };
            self.digitizer
                .run_chunks(&self.trajectory, run.clone(), deliver);
        }
        begin.elapsed().as_secs_f64()
    }

    /// What it finds, and what that cost.
    pub fn touches(&self) -> (Vec<Option<Touch>>, Counters) {
        let mut all = Vec::new();
        let mut counters = Counters::default();
        for run in &self.runs {
            let deliver = |run: SubTrajectory, _| {
                all.extend(run.touches);
                true
            };
            counters += self
                .digitizer
                .run_chunks(&self.trajectory, run.clone(), deliver);
        }
        (all, counters)
    }
}

fn runs(trajectory: &Trajectory, most: u64) -> Vec<Range<u64>> {
    let total = trajectory.positions;
    let length = 1024.max(2 * u64::from(trajectory.points_per_revolution));
    let count = (most / length).max(3);
    if total <= most.max(count * length) {
        return std::iter::once(0..total).collect();
    }
    // In the middle of equal shares: a part's ends, where most of it is out of reach, count no more than they are.
    let start = |k| total / count * k + (total / count - length) / 2;
    (0..count).map(|k| start(k)..start(k) + length).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(positions: u64, points_per_revolution: u32, most: u64) -> Vec<Range<u64>> {
        let trajectory = Trajectory {
            kind: MotionKind::Helix,
            from: -3.0,
            step: 2.0,
            points_per_revolution,
            positions,
        };
        let runs = runs(&trajectory, most);
        let beyond = positions - runs[runs.len() - 1].end;
        assert!(
            beyond.abs_diff(runs[0].start) <= runs.len() as u64 + 1,
            "{runs:?}"
        );
        assert!(runs.windows(2).all(|w| w[0].end <= w[1].start), "{runs:?}");
        assert!(runs.iter().all(|r| r.end <= positions), "{runs:?}");
        runs
    }

    #[test]
    fn a_path_is_measured_whole_or_in_runs_all_along_it() {
        for whole in [0, 2_000, 50_000, 100_000] {
            let runs = check(whole, 360, 100_000);
            assert!(runs.len() == 1 && runs[0] == (0..whole), "{runs:?}");
        }
        let runs = check(10_000_000, 360, 100_000);
        assert_eq!(runs.len(), 97);
        assert!(runs.iter().all(|r| r.end - r.start == 1024), "{runs:?}");
        let long = check(100_000_000, 1_000_000, 100_000);
        assert_eq!(long.len(), 3);
        for (run, share) in long.iter().zip([1_u64, 3, 5]) {
            assert_eq!(run.end - run.start, 2_000_000);
            let middle = run.start + 1_000_000;
            assert!(middle.abs_diff(100_000_000 / 6 * share) < 10, "{long:?}");
        }
    }

    #[test]
    fn every_task_gets_its_turns_and_the_shortest_counts() {
        let calls = std::cell::Cell::new(0);
        let effort = Effort {
            patience: Duration::ZERO,
            ..Effort::QUICK
        };
        let falling = || {
            calls.set(calls.get() + 1);
            5.0 - f64::from(calls.get())
        };
        let times = shortest(&effort, 2, vec![Box::new(falling), Box::new(|| 7.0)]);
        assert_eq!((calls.get(), times), (2, vec![3.0, 7.0]));
    }
}
