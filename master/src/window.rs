//! What others look through: the jobs that workers are at, those that wait at the desk, and what has
//! happened.

use std::sync::Arc;

use crate::desk::Desk;
use crate::error::Result;
use crate::history::Happening;
use crate::run::Master;
use crate::snapshot::{Queued, Snapshot};

/// A window into a master.
#[derive(Clone)]
pub struct Window {
    pub(crate) master: Master,
    pub(crate) desk: Option<Arc<Desk>>,
}

impl Window {
    /// Whether the master takes in what comes: not when it is about to stop.
    pub fn is_open(&self) -> bool {
        !self.master.draining.is_cancelled()
    }

    /// What goes on, and what has happened since the event of that number.
    ///
    /// # Errors
    /// [`crate::Error::Interrupted`] if the master has stopped.
    pub async fn look(&self, since: u64) -> Result<(Snapshot, Vec<Happening>)> {
        let (mut seen, happened) = self.master.look(since).await?;
        for (job, entry) in self.desk.iter().flat_map(|desk| desk.open_jobs()) {
            match seen.jobs.iter_mut().find(|going| going.job == job) {
                Some(going) => going.name = entry.name,
                None => seen.queued.push(Queued {
                    job,
                    name: entry.name,
                    submitted: entry.submitted.as_millis() as u64,
                }),
            }
        }
        Ok((seen, happened))
    }
}
