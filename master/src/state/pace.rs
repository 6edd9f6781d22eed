//! How fast workers are: measured by the positions that come, and used to share and to tell who is late.

use std::collections::BTreeMap;
use std::time::Duration;

use super::Worker;

/// Who has less to do than for so long is not worth helping.
const WORTH_IT: Duration = Duration::from_secs(1);

/// Who has sent nothing for so long since it was given its task is late, however much there is to do.
const SILENT: Duration = Duration::from_secs(10);

/// A worker's pace.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Pace {
    /// When it was given its task.
    since: Duration,
    /// When its first positions were there, and how many.
    began: Option<(Duration, u64)>,
    /// How many there were when it was last looked at, and when that was.
    came: u64,
    last: Duration,
    /// How many of the extent were missing then.
    left: u64,
    /// Positions of all its tasks, and how long they took.
    positions: u64,
    busy: Duration,
}

impl Pace {
    /// It is given a task.
    pub fn begin(&mut self, now: Duration) {
        let Self {
            positions, busy, ..
        } = *self;
        *self = Self {
            since: now,
            last: now,
            positions,
            busy,
            ..Self::default()
        };
    }

    /// So many positions of the task have come by now, and so many of its extent are missing.
    pub fn note(&mut self, now: Duration, came: u64, left: u64) {
        self.positions += came.saturating_sub(self.came);
        self.busy += now.saturating_sub(self.last);
        if came > 0 {
            self.began.get_or_insert((now, came));
        }
        (self.came, self.left, self.last) = (came, left, now);
    }

    /// How long it will take for what is missing, at the pace of its task so far, if it is worth
    /// helping it: for whoever helps has to get ready as well.
    pub fn late(&self, now: Duration) -> Option<f64> {
        let elapsed = now.saturating_sub(self.since);
        let Some((began, first)) = self.began else {
            return (elapsed >= SILENT).then_some(f64::INFINITY);
        };
        let ready = began.saturating_sub(self.since);
        // Getting ready is over, once more has come than was there at first.
        let (time, came) = match self.came.saturating_sub(first) {
            0 => (elapsed, self.came),
            since_then => (now.saturating_sub(began), since_then),
        };
        let expected = time.as_secs_f64() * self.left as f64 / came as f64;
        (expected >= WORTH_IT.max(2 * ready).as_secs_f64()).then_some(expected)
    }

    /// Positions of all its tasks.
    pub fn positions(&self) -> u64 {
        self.positions
    }

    /// Seconds that a position takes, once there is something to tell it from.
    pub fn cost(&self) -> Option<f64> {
        (self.positions > 0).then(|| self.busy.as_secs_f64() / self.positions as f64)
    }
}

/// Seconds that a position takes each worker; a new one counts as an average one.
pub(super) fn costs(workers: &BTreeMap<String, Worker>) -> BTreeMap<String, f64> {
    let known: Vec<f64> = workers.values().filter_map(|w| w.pace.cost()).collect();
    let average = if known.is_empty() {
        1.0
    } else {
        known.iter().sum::<f64>() / known.len() as f64
    };
    let cost = |(name, worker): (&String, &Worker)| {
        let cost = worker.pace.cost().unwrap_or(average);
        (name.clone(), cost)
    };
    workers.iter().map(cost).collect()
}
