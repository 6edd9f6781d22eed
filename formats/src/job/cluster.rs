//! The section on where a job is computed.

use horma_core::{Distribution, Sharing};

use super::raw::RawJob;
use super::source::Source;
use super::{Cluster, DEFAULT_EXTENTS_PER_WORKER, MAX_EXTENTS_PER_WORKER, MAX_WORKERS};
use crate::error::Result;

const DISTRIBUTIONS: [(&str, Distribution); 3] = {
    let [a, b, c] = Distribution::ALL;
    [(a.name(), a), (b.name(), b), (c.name(), c)]
};

impl Source<'_> {
    pub(super) fn cluster(&self, raw: &RawJob) -> Result<Cluster> {
        let raw = &raw.cluster;
        let workers = raw.workers.as_ref();
        let workers = workers.map_or(Ok(0), |w| self.count(w, "workers"))?;
        if workers > MAX_WORKERS {
            let what = format!("workers is {workers}, but must be at most {MAX_WORKERS}");
            return Err(self.wrong(raw.workers.as_ref().map(|w| &w.at), what));
        }
        let extents = raw.extents_per_worker.as_ref();
        let default = Ok(DEFAULT_EXTENTS_PER_WORKER);
        let extents_per_worker =
            extents.map_or(default, |e| self.count(e, "extents_per_worker"))?;
        if !(1..=MAX_EXTENTS_PER_WORKER).contains(&extents_per_worker) {
            let what = format!(
                "extents_per_worker is {extents_per_worker}, but must be 1 to {MAX_EXTENTS_PER_WORKER}"
            );
            return Err(self.wrong(extents.map(|e| &e.at), what));
        }
        let distribution = self.choose(
            raw.distribution.as_ref(),
            "distribution",
            Distribution::Overlap,
            &DISTRIBUTIONS,
        )?;
        Ok(Cluster {
            workers,
            sharing: Sharing {
                distribution,
                extents_per_worker,
            },
        })
    }
}
