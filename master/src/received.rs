//! The positions of an extent as they come, from all who were ever at it.
//!
//! What one worker sends twice is refused. What two send is kept once, and has to be the same to the
//! last bit: a path never depends on who was first. What came from a worker is kept when it is lost, and
//! thrown away when it answered wrongly.

use std::collections::BTreeMap;
use std::ops::Range;

use horma_core::{Counters, SubTrajectory};

/// What has come of an extent so far.
#[derive(Debug, Default)]
pub(crate) struct Received {
    first: u64,
    count: u64,
    so_far: u64,
    /// Runs that do not overlap, by their first position, as they came.
    runs: BTreeMap<u64, Run>,
}

#[derive(Debug)]
struct Run {
    attempt: u32,
    came: SubTrajectory,
    cost: Counters,
}

/// What becomes of positions that come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Taken {
    /// They are kept.
    New,
    /// They are there already, or nobody waits for them any more.
    Again,
    /// Another attempt brought some of them, and not the same.
    Different {
        /// That attempt.
        attempt: u32,
    },
}

impl Received {
    /// Nothing yet of the `count` positions from `first` on.
    pub fn new(first: u64, count: u64) -> Self {
        Self {
            first,
            count,
            ..Self::default()
        }
    }

    /// Takes positions in that an attempt brings, what was inserted on their moves, and what they cost.
    pub fn take(&mut self, attempt: u32, came: SubTrajectory, cost: Counters) -> Taken {
        let (first, end) = (came.first, came.end());
        if first < self.first || end > self.first + self.count {
            // The extent is over, and this was taken away.
            return Taken::Again;
        }
        let overlapping = self.runs.range(..end).next_back();
        if let Some((_, run)) = overlapping.filter(|(_, run)| run.came.end() > first) {
            if run.came == came {
                return Taken::Again;
            }
            let attempt = run.attempt;
            return Taken::Different { attempt };
        }
        if first < end {
            self.so_far += end - first;
            self.runs.insert(
                first,
                Run {
                    attempt,
                    came,
                    cost,
                },
            );
        }
        Taken::New
    }

    /// Throws away what an attempt brought. Returns how many positions that were, and how many inserted.
    pub fn forget(&mut self, attempt: u32) -> (u64, u64) {
        let (mut positions, mut inserted) = (0, 0);
        self.runs.retain(|_, run| {
            let keep = run.attempt != attempt;
            if !keep {
                positions += run.came.touches.len() as u64;
                inserted += run.came.between.len() as u64;
            }
            keep
        });
        self.so_far -= positions;
        (positions, inserted)
    }

    /// Number of positions that have not come yet.
    pub fn left(&self) -> u64 {
        self.count - self.so_far
    }

    /// The positions that have not come yet, ascending.
    pub fn missing(&self) -> Vec<Range<u64>> {
        let mut missing = Vec::new();
        let mut next = self.first;
        for run in self.runs.values() {
            missing.push(next..run.came.first);
            next = run.came.end();
        }
        missing.push(next..self.first + self.count);
        missing.retain(|gap| !gap.is_empty());
        missing
    }

    /// How many positions each attempt brought.
    pub fn shares(&self) -> BTreeMap<u32, u64> {
        let mut shares = BTreeMap::new();
        for run in self.runs.values() {
            *shares.entry(run.attempt).or_default() += run.came.touches.len() as u64;
        }
        shares
    }

    /// What it took to find all of them.
    pub fn cost(&self) -> Counters {
        let mut cost = Counters::default();
        self.runs.values().for_each(|run| cost += run.cost);
        cost
    }

    /// What has come, in order.
    pub fn into_parts(self) -> Vec<SubTrajectory> {
        self.runs.into_values().map(|run| run.came).collect()
    }
}

/// The positions that one attempt has sent: of those it was asked for, each once.
pub(crate) struct Sent {
    /// Those that it has not sent, as ranges by their first.
    left: BTreeMap<u64, u64>,
    so_far: u64,
}

impl Sent {
    /// Nothing yet of these, which do not overlap.
    pub fn nothing_of(asked: impl Iterator<Item = Range<u64>>) -> Self {
        Self {
            left: asked.map(|range| (range.start, range.end)).collect(),
            so_far: 0,
        }
    }

    /// Notes positions as sent, or says why they cannot be right.
    pub fn note(&mut self, positions: Range<u64>) -> Result<(), String> {
        let Range { start, end } = positions;
        if start == end {
            return Ok(());
        }
        let around = self.left.range(..=start).next_back();
        let around = around.map(|(&from, &to)| from..to);
        let Some(around) = around.filter(|around| end <= around.end) else {
            let (count, left) = (end.saturating_sub(start), self.left());
            return Err(format!(
                "it sent {count} positions from {start} on, some of them twice or not asked for, with {left} to come"
            ));
        };
        self.left.remove(&around.start);
        for rest in [around.start..start, end..around.end] {
            if !rest.is_empty() {
                self.left.insert(rest.start, rest.end);
            }
        }
        self.so_far += end - start;
        Ok(())
    }

    /// Number of positions that it has sent.
    pub fn so_far(&self) -> u64 {
        self.so_far
    }

    /// Number of positions that it has not sent yet.
    pub fn left(&self) -> u64 {
        self.left.iter().map(|(from, to)| to - from).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use horma_core::Touch;
    use proptest::prelude::*;

    fn run(positions: Range<u64>, height: f64) -> SubTrajectory {
        let touch = |i: u64| {
            Some(Touch {
                height: height + i as f64,
                contact: [0.0; 3],
            })
        };
        SubTrajectory {
            first: positions.start,
            touches: positions.map(touch).collect(),
            between: Vec::new(),
        }
    }

    const COST: Counters = Counters {
        evaluations: 1,
        nodes: 0,
        lost: 0,
        largest_loss: 0.0,
        beyond_tolerance: 2,
    };

    proptest! {
        /// Against a list of who brought what: each position counts once, for whoever was first, and
        /// what is missing is what nobody brought whose word counts.
        #[test]
        fn every_position_is_kept_once_whoever_brings_it(
            chunks in prop::collection::vec((1..4_u32, 0..10_u64), 0..40),
            liar in 1..5_u32,
        ) {
            let mut received = Received::new(5, 27);
            let mut by = [0_u32; 10];
            for (attempt, chunk) in chunks {
                let positions = 5 + 3 * chunk..(8 + 3 * chunk).min(32);
                let taken = received.take(attempt, run(positions, 0.0), COST);
                let new = chunk < 9 && by[chunk as usize] == 0;
                prop_assert_eq!(taken == Taken::New, new || chunk == 9);
                if new {
                    by[chunk as usize] = attempt;
                }
            }
            let lied = by.iter().filter(|&&b| b == liar).count() as u64;
            prop_assert_eq!(received.forget(liar), (3 * lied, 0));
            let has = |i: u64| {
                let by = by[(i - 5) as usize / 3];
                by != 0 && by != liar
            };
            let missing: Vec<u64> = received.missing().into_iter().flatten().collect();
            prop_assert_eq!(&missing, &(5..32).filter(|&i| !has(i)).collect::<Vec<_>>());
            prop_assert_eq!(received.left(), missing.len() as u64);
            let positions: u64 = received.shares().values().sum();
            prop_assert_eq!(positions + received.left(), 27);
            prop_assert_eq!(received.cost().beyond_tolerance, 2 * positions / 3);
            let parts = received.into_parts();
            let got = parts.iter().flat_map(|p| p.first..p.end());
            prop_assert!(got.eq((5..32).filter(|&i| has(i))));
        }

        /// Against a list of what was sent: whatever fits is noted, whatever does not is refused and
        /// changes nothing.
        #[test]
        fn an_attempt_sends_what_it_was_asked_for_once(
            chunks in prop::collection::vec((0..40_u64, 0..12_u64), 0..40)
        ) {
            let mut sent = Sent::nothing_of([5..20, 25..35].into_iter());
            let mut left: Vec<bool> = (0..64).map(|i| (5..20).contains(&i) || (25..35).contains(&i)).collect();
            for (from, n) in chunks {
                let mut range = from..from + n;
                let fits = range.clone().all(|i| left[i as usize]);
                prop_assert_eq!(sent.note(range.clone()).is_ok(), fits);
                if fits {
                    range.by_ref().for_each(|i| left[i as usize] = false);
                }
                let to_come = left.iter().filter(|l| **l).count() as u64;
                prop_assert_eq!((sent.so_far(), sent.left()), (25 - to_come, to_come));
            }
        }
    }

    #[test]
    fn what_two_bring_has_to_be_the_same() {
        let mut received = Received::new(0, 20);
        assert_eq!(received.take(1, run(5..10, 0.0), COST), Taken::New);
        assert_eq!(received.take(2, run(5..10, 0.0), COST), Taken::Again);
        let different = Taken::Different { attempt: 1 };
        for other in [
            run(5..10, 1.0),
            run(5..9, 0.0),
            run(0..6, 0.0),
            run(9..20, 0.0),
        ] {
            assert_eq!(received.take(2, other, COST), different);
        }
        assert_eq!(received.left(), 15);
        assert_eq!(
            received.cost(),
            COST,
            "what comes again costs nothing again"
        );
    }
}
