//! What can be seen of the state from outside: a look, never a handle.

use std::time::Duration;

use horma_proto::TaskId;
use serde::Serialize;

use super::{Extent, Rows, State, Status, Step};

/// How far an extent has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ExtentState {
    /// Nobody has it.
    Waiting,
    /// A worker takes in its rows.
    Placing,
    /// A worker holds its rows.
    Placed,
    /// A worker digitizes it.
    Running,
    /// Its positions are here.
    Done,
}

/// A worker as the state has it.
pub(crate) struct Member<'a> {
    pub name: &'a str,
    pub silent: Duration,
    pub task: Option<(TaskId, Step)>,
    /// Positions that it has brought.
    pub positions: u64,
    /// Seconds that each took.
    pub cost: Option<f64>,
}

impl State {
    /// Everybody who is registered.
    pub fn members(&self, now: Duration) -> impl Iterator<Item = Member<'_>> {
        self.workers.iter().map(move |(name, worker)| Member {
            name,
            silent: now.saturating_sub(worker.seen),
            task: worker.task,
            positions: worker.pace.positions(),
            cost: worker.pace.cost(),
        })
    }

    /// The extents of a job that is going on, in order: how far each has come and in which attempt.
    pub fn extents(&self, job: u64) -> impl Iterator<Item = (ExtentState, u32)> {
        let extents = self.jobs.get(&job).into_iter().flatten();
        extents.map(|extent| (extent.seen(), extent.attempts))
    }
}

impl Extent {
    fn seen(&self) -> ExtentState {
        match (self.status, &self.rows) {
            (Status::Done, _) => ExtentState::Done,
            (Status::Running, _) => ExtentState::Running,
            (Status::Waiting, Rows::OnTheWay) => ExtentState::Placing,
            (Status::Waiting, Rows::Held(_)) => ExtentState::Placed,
            (Status::Waiting, Rows::WithTask | Rows::Nowhere) => ExtentState::Waiting,
        }
    }
}
