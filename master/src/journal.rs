//! The journal of a job: its finished extents, written down as they are kept, so that a master that is
//! started again has only the others digitized. An extent counts only for a plan that is the same.

use std::collections::BTreeMap;
use std::sync::Arc;

use bytes::Bytes;
use horma_core::{Extent, ExtentRecord, Handout, Stock, SubTrajectory};
use horma_proto::{VERSION, wire};
use prost::Message;
use tokio::task::spawn_blocking;
use tracing::{info, warn};

use crate::blocking;
use crate::error::{Error, Result};
use crate::store::{Pieces, Stage, Store};

/// A finished extent.
pub(crate) type Kept = (Arc<Vec<SubTrajectory>>, ExtentRecord);

/// Where one job's finished extents are written down.
#[derive(Clone)]
pub(crate) struct Journal {
    pub store: Arc<Store>,
    pub job: u64,
}

/// What there was of a job before this start of the master.
pub(crate) struct Resumed {
    pub journal: Journal,
    pub kept: BTreeMap<u32, Kept>,
    /// How it is split, as the store has it.
    pub stage: Stage,
}

impl Journal {
    /// Finds what there is of a job that is to be split for so many workers; what was split otherwise is
    /// dropped.
    pub async fn resume(self, plan: Arc<Handout>, workers: u32) -> Result<Resumed> {
        blocking(move || self.find(&plan, workers)).await
    }

    fn find(self, plan: &Handout, workers: u32) -> Result<Resumed> {
        let job = self.job;
        let extents = plan.split(workers);
        let digest = digest(plan, &extents);
        if self.store.begin(job, workers, digest)? {
            warn!(job, "planned otherwise than before: its journal is dropped");
        }
        let mut kept = BTreeMap::new();
        for (number, pieces) in self.store.journal(job)? {
            let extent = extents.get(number as usize);
            let extent = extent.ok_or_else(|| Error::StoreDamaged(no_extent(job, number)))?;
            kept.insert(number, from_pieces(&pieces, plan, extent)?);
        }
        if !kept.is_empty() {
            info!(job, extents = kept.len(), "resumed from the journal");
        }
        Ok(Resumed {
            journal: self,
            kept,
            stage: Stage::Running { workers, digest },
        })
    }

    /// Writes down an extent, beside whatever goes on. Without it the job is as good; it only cannot be
    /// resumed from there.
    pub fn keep(&self, extent: u32, (positions, record): Kept) {
        let Self { store, job } = self.clone();
        spawn_blocking(move || {
            let pieces = to_pieces(&positions, &record);
            match pieces.and_then(|pieces| store.keep(job, extent, &pieces)) {
                Ok(true) => info!(job, extent, "journalled"),
                // It was the last one, and the job is over.
                Ok(false) => {}
                Err(error) => warn!(job, extent, %error, "not journalled"),
            }
        });
    }
}

/// The record, and then the positions as they travel.
pub(crate) fn to_pieces(positions: &[SubTrajectory], record: &ExtentRecord) -> Result<Pieces> {
    let record = serde_json::to_vec(record).map_err(|e| Error::StoreDamaged(e.to_string()))?;
    let runs = positions.iter().flat_map(|run| {
        let chunks = horma_proto::position_chunks(run.first, &run.touches, &run.between);
        chunks.map(|positions| Bytes::from(positions.encode_to_vec()))
    });
    Ok(std::iter::once(record.into()).chain(runs).collect())
}

pub(crate) fn from_pieces(pieces: &[Bytes], plan: &Handout, extent: &Extent) -> Result<Kept> {
    let damaged = Error::StoreDamaged;
    let (record, runs) = pieces
        .split_first()
        .ok_or(damaged("an extent without its record".to_owned()))?;
    let record = serde_json::from_slice(record).map_err(|e| damaged(e.to_string()))?;
    let mut positions = Vec::new();
    let mut next = extent.first;
    for run in runs {
        let run = wire::Positions::decode(run.clone()).map_err(|e| damaged(e.to_string()))?;
        let run = horma_proto::unpack_positions(&run, plan.trajectory.positions);
        let run = run.map_err(|e| damaged(e.to_string()))?;
        if run.first != next {
            let found = run.first;
            return Err(damaged(format!("position {found} instead of {next}")));
        }
        next = run.end();
        positions.push(run);
    }
    let end = extent.first + extent.count;
    if next != end {
        return Err(damaged(format!("an extent to {end} that ends at {next}")));
    }
    Ok((Arc::new(positions), record))
}

fn no_extent(job: u64, extent: u32) -> String {
    format!("the journal of job {job} has extent {extent}, which the job has not")
}

/// A checksum of all that decides what an extent is: the version, the positions, the rows and who has
/// which.
fn digest(plan: &Handout, extents: &[Extent]) -> u32 {
    let mut sum = crc32c::crc32c(VERSION.as_bytes());
    let mut add = |bytes: &[u8]| sum = crc32c::crc32c_append(sum, bytes);
    add(&horma_proto::job_to_wire(&plan.job).encode_to_vec());
    add(&horma_proto::trajectory_to_wire(&plan.trajectory).encode_to_vec());
    match &plan.stock {
        Stock::Rows(rows) => rows
            .iter()
            .for_each(|row| add(&horma_proto::row_to_wire(row).encode_to_vec())),
        Stock::Grids(grids) => grids
            .iter()
            .for_each(|grid| add(&horma_proto::grid_to_wire(grid).encode_to_vec())),
    }
    for extent in extents {
        add(&extent.first.to_le_bytes());
        add(&extent.count.to_le_bytes());
        extent.rows.iter().for_each(|row| add(&row.to_le_bytes()));
        extent.own.iter().for_each(|row| add(&row.to_le_bytes()));
    }
    sum
}
