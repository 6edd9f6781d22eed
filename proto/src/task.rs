//! Which attempt at which extent of which job: named in every message about work.

use crate::error::{Error, Result};
use crate::wire;

/// One attempt at one extent of one job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TaskId {
    /// The job.
    pub job: u64,
    /// The extent.
    pub extent: u32,
    /// Counted from 1.
    pub attempt: u32,
}

impl std::fmt::Display for TaskId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            job,
            extent,
            attempt,
        } = self;
        write!(f, "job {job}, extent {extent}, attempt {attempt}")
    }
}

impl From<TaskId> for wire::TaskId {
    fn from(id: TaskId) -> Self {
        let TaskId {
            job,
            extent,
            attempt,
        } = id;
        Self {
            job,
            extent,
            attempt,
        }
    }
}

impl TryFrom<Option<wire::TaskId>> for TaskId {
    type Error = Error;

    fn try_from(id: Option<wire::TaskId>) -> Result<Self> {
        let wire::TaskId {
            job,
            extent,
            attempt,
        } = id.ok_or(Error::Missing {
            message: "task",
            field: "its id",
        })?;
        Ok(Self {
            job,
            extent,
            attempt,
        })
    }
}
