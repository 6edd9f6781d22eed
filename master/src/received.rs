//! The positions of an extent as they come: runs in any order, every position once.

use std::collections::BTreeMap;

use horma_core::SubTrajectory;

/// What has come of an extent so far.
pub(crate) struct Received {
    first: u64,
    count: u64,
    so_far: u64,
    /// Runs that do not touch each other, by their first position.
    runs: BTreeMap<u64, SubTrajectory>,
}

impl Received {
    /// Nothing yet of the `count` positions from `first` on.
    pub fn new(first: u64, count: u64) -> Self {
        Self {
            first,
            count,
            so_far: 0,
            runs: BTreeMap::new(),
        }
    }

    /// Takes positions in, and what was inserted on their moves, or says why they cannot be right.
    pub fn take(&mut self, come: SubTrajectory) -> Result<(), String> {
        let (first, count) = (come.first, come.touches.len() as u64);
        let (begin, end) = (self.first, self.first + self.count);
        if first < begin || first > end || count > end - first {
            return Err(format!(
                "it sent {count} positions from {first} on, but its extent has {begin} to {}",
                end - 1
            ));
        }
        if count == 0 {
            return Ok(());
        }
        let before = self.runs.range(..=first).next_back();
        let before = before.map_or(begin, |(_, run)| run.end());
        let after = self.runs.range(first..).next().map_or(end, |(&i, _)| i);
        if first < before || first + count > after {
            return Err(format!(
                "it sent {count} positions from {first} on, some of them twice"
            ));
        }
        self.so_far += count;
        // Most follow what came last.
        match self.runs.range_mut(..=first).next_back() {
            Some((_, run)) if run.end() == first => {
                run.touches.extend(come.touches);
                run.between.extend(come.between);
            }
            _ => {
                self.runs.insert(first, come);
            }
        }
        Ok(())
    }

    /// Number of positions that have come.
    pub fn so_far(&self) -> u64 {
        self.so_far
    }

    /// Number of positions that have not come yet.
    pub fn left(&self) -> u64 {
        self.count - self.so_far
    }

    /// Number of positions that have come with them, inserted.
    pub fn inserted(&self) -> u64 {
        let runs = self.runs.values();
        runs.map(|run| run.between.len() as u64).sum()
    }

    /// What has come, in order.
    pub fn into_parts(self) -> Vec<SubTrajectory> {
        self.runs.into_values().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use horma_core::Touch;
    use proptest::prelude::*;

    fn touch(index: u64) -> Option<Touch> {
        Some(Touch {
            height: index as f64,
            contact: [0.0; 3],
        })
    }

    proptest! {
        /// Against a list of what has come: whatever fits is taken, whatever does not is refused and
        /// changes nothing.
        #[test]
        fn every_position_is_taken_once_in_any_order(
            chunks in prop::collection::vec((0..40_u64, 0..12_u64), 0..40)
        ) {
            let (first, count) = (5, 30);
            let mut received = Received::new(first, count);
            let mut came = vec![false; 64];
            for (from, n) in chunks {
                let range = from..from + n;
                let inside = from >= first && range.end <= first + count;
                let twice = range.clone().any(|i| came[i as usize]);
                let taken = received.take(SubTrajectory {
                    first: from,
                    touches: range.clone().map(touch).collect(),
                    between: Vec::new(),
                });
                prop_assert_eq!(taken.is_ok(), inside && !twice);
                if taken.is_ok() {
                    range.for_each(|i| came[i as usize] = true);
                }
                let so_far = came.iter().filter(|c| **c).count() as u64;
                prop_assert_eq!((received.so_far(), received.left()), (so_far, count - so_far));
            }
            let parts = received.into_parts();
            let got = parts.iter().flat_map(|p| (p.first..).zip(p.touches.clone()));
            let wanted = (0..).zip(&came).filter(|(_, c)| **c).map(|(i, _)| (i, touch(i)));
            prop_assert!(got.eq(wanted));
        }
    }
}
