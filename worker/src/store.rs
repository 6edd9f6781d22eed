//! The rows that this worker holds for others and for itself, until the master names their job no more.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use horma_core::Row;
use horma_proto::TaskId;
use horma_proto::metrics::ROWS_HELD;
use tracing::debug;

/// What is held, by job and extent.
#[derive(Debug, Default)]
pub(crate) struct Store {
    held: Mutex<BTreeMap<(u64, u32), Held>>,
}

#[derive(Debug)]
struct Held {
    /// The start of the master whose job it is.
    master: u64,
    attempt: u32,
    rows: Arc<Vec<Row>>,
}

impl Store {
    /// Holds rows from now on, in the place of those of an earlier attempt.
    pub fn put(&self, master: u64, id: TaskId, rows: Vec<Row>) {
        let mut held = self.lock();
        let newer = |h: &Held| h.master == master && h.attempt > id.attempt;
        if held.get(&(id.job, id.extent)).is_some_and(newer) {
            return;
        }
        let new = Held {
            master,
            attempt: id.attempt,
            rows: Arc::new(rows),
        };
        held.insert((id.job, id.extent), new);
        count(&held);
    }

    /// The rows that were placed by this very attempt, in order of their ids.
    pub fn get(&self, id: TaskId) -> Option<Arc<Vec<Row>>> {
        let held = self.lock();
        let held = held.get(&(id.job, id.extent));
        held.filter(|h| h.attempt == id.attempt)
            .map(|h| h.rows.clone())
    }

    /// Drops what another start of a master placed.
    pub fn keep_master(&self, master: u64) {
        self.retain(|_, held| held.master == master);
    }

    /// Drops the rows of jobs below `next_job` that are not going on.
    pub fn keep_jobs(&self, jobs: &[u64], next_job: u64) {
        self.retain(|(job, extent), _| {
            let keep = *job >= next_job || jobs.contains(job);
            if !keep {
                debug!(job, extent, "rows dropped");
            }
            keep
        });
    }

    fn retain(&self, keep: impl Fn(&(u64, u32), &Held) -> bool) {
        let mut all = self.lock();
        all.retain(|place, held| keep(place, held));
        count(&all);
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<(u64, u32), Held>> {
        // Every change is a single call: there is no half of one to be seen.
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Tells those who watch how many rows there are.
fn count(held: &BTreeMap<(u64, u32), Held>) {
    let rows = held.values().map(|held| held.rows.len()).sum::<usize>();
    ROWS_HELD.set("", rows as f64);
}

#[cfg(test)]
mod tests {
    use horma_core::RowKind;

    use super::*;

    fn id(job: u64, extent: u32, attempt: u32) -> TaskId {
        TaskId {
            job,
            extent,
            attempt,
        }
    }

    fn row(id: u32) -> Row {
        Row {
            id,
            points: Vec::new(),
            kind: RowKind::Isoline { joins_next: false },
        }
    }

    fn first(store: &Store, id: TaskId) -> Option<u32> {
        store.get(id).map(|rows| rows[0].id)
    }

    #[test]
    fn only_the_attempt_that_placed_rows_gets_them() {
        let store = Store::default();
        store.put(1, id(1, 0, 2), vec![row(5)]);
        assert_eq!(first(&store, id(1, 0, 2)), Some(5));
        for other in [id(1, 0, 1), id(1, 0, 3), id(1, 1, 2), id(2, 0, 2)] {
            assert_eq!(first(&store, other), None, "{other}");
        }
        // What comes late does not take the place of what is current.
        store.put(1, id(1, 0, 1), vec![row(6)]);
        assert_eq!(first(&store, id(1, 0, 2)), Some(5));
        store.put(2, id(1, 0, 1), vec![row(7)]);
        assert_eq!(
            first(&store, id(1, 0, 1)),
            Some(7),
            "another master counts anew"
        );
    }

    #[test]
    fn rows_are_dropped_with_their_job_and_their_master() {
        let store = Store::default();
        for job in 1..=4 {
            store.put(job % 2, id(job, 0, 1), vec![row(0)]);
        }
        let held = || (1..=4).filter(|&job| store.get(id(job, 0, 1)).is_some());
        // A reply that is older than job 4 says nothing of it.
        store.keep_jobs(&[2], 4);
        assert_eq!(held().collect::<Vec<_>>(), [2, 4]);
        store.put(1, id(3, 0, 1), vec![row(0)]);
        store.keep_master(1);
        assert_eq!(held().collect::<Vec<_>>(), [3]);
    }
}
