//! What the master's brain is told, and what it tells the driver to do.

use std::collections::BTreeSet;

use horma_proto::TaskId;

use super::{Held, Step};
use crate::error::Error;

/// What happens to a master.
#[derive(Debug, Clone)]
pub(crate) enum Event {
    /// A worker registered, perhaps again.
    Registered { worker: String, incarnation: u64 },
    /// A worker said that it is alive.
    Heartbeat { worker: String },
    /// A worker is about to stop.
    Left { worker: String },
    /// The master is about to stop: what runs may end, and nothing begins.
    Drain,
    /// Time went by.
    Tick,
    /// A job was split into so many extents, of which some are done already. If their rows are to be
    /// placed, each has a list of those others whose rows it needs.
    Submitted {
        job: u64,
        extents: u32,
        halos: Option<Vec<Vec<u32>>>,
        done: BTreeSet<u32>,
    },
    /// Nobody wants the job any more.
    Cancelled { job: u64 },
    /// A worker holds an extent's rows.
    Placed { worker: String, task: TaskId },
    /// So many positions of a task have come, and so many of its extent are missing.
    Progress {
        worker: String,
        task: TaskId,
        came: u64,
        left: u64,
    },
    /// A worker did all of a task, or all that nobody else had done of it. So many positions of its
    /// extent are missing all the same: others were to bring them, and failed.
    Delivered {
        worker: String,
        task: TaskId,
        left: u64,
    },
    /// A worker did not deliver a task, or did not take its rows.
    Failed {
        worker: String,
        task: TaskId,
        step: Step,
        fault: Fault,
    },
}

/// Why a task was not delivered.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Fault {
    /// The worker is gone, or cannot be reached.
    Lost(String),
    /// The worker's answer cannot be right.
    Wrong(String),
    /// The worker could not get rows from the one that holds them: the fault of that one, or of the
    /// way there.
    Halo { source: TaskId, reason: String },
    /// An earlier attempt at the same extent brought other positions.
    Different { attempt: u32 },
}

impl std::fmt::Display for Fault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Lost(reason) => write!(f, "lost: {reason}"),
            Self::Wrong(reason) => write!(f, "wrong: {reason}"),
            Self::Halo { source, reason } => write!(f, "halo of {source} lost: {reason}"),
            Self::Different { attempt } => write!(f, "different from attempt {attempt}"),
        }
    }
}

/// What the driver is to do.
#[derive(Debug, Clone)]
pub(crate) enum Command {
    /// Bring an extent's own rows to this worker.
    Place { worker: String, task: TaskId },
    /// Bring this task to this worker. Unless rows travel with it, the worker holds the first of
    /// these, and gets the others from those who do. If it helps someone, this says why.
    Start {
        worker: String,
        task: TaskId,
        rows: Vec<Held>,
        helps: Option<String>,
    },
    /// Nobody waits for this task any more.
    Abort { task: TaskId, reason: String },
    /// The extent's positions are all there, by this task at last: keep them.
    Keep { task: TaskId },
    /// All extents of the job are kept.
    Complete { job: u64 },
    /// The job cannot be done.
    Fail { job: u64, error: Error },
}
