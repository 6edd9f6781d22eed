//! The record of a run: how a path came about. It is filled by whoever runs the pipeline, travels
//! from a master to its client, and ends up in the report as it is.

use serde::{Deserialize, Serialize};

use crate::job::Window;

/// What happened during a run.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Record {
    /// How long each phase took, in order.
    pub phases: Vec<Phase>,
    /// What became of each body, in file order.
    pub bodies: Vec<BodyRecord>,
    /// What the searches cost together.
    pub counters: Counters,
    /// The windows of the local search.
    pub window: Option<Window>,
    /// What the distribution cost in rows and bytes; nothing if it was one process.
    pub traffic: Option<Traffic>,
    /// Who took part; nobody if it was one process.
    pub workers: Vec<WorkerRecord>,
    /// Each extent as it was delivered, in order.
    pub extents: Vec<ExtentRecord>,
    /// How many of these had been delivered before the master was last started.
    pub extents_from_journal: u32,
    /// Attempts that came to nothing and were made again.
    pub lost: Vec<LostAttempt>,
    /// Attempts by idle workers at what others were at or were to do later.
    pub second: Vec<SecondAttempt>,
}

/// How long a phase took.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Phase {
    /// Its name, as the progress shows it.
    pub name: String,
    /// Wall time, s.
    pub seconds: f64,
}

/// What became of one body.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BodyRecord {
    /// File, and name or number within it.
    pub name: String,
    /// Number of rows.
    pub rows: u32,
    /// Points on each row of a grid; nothing for a mesh.
    pub columns: Option<u32>,
    /// Number of points.
    pub points: u64,
    /// Number of facets.
    pub facets: u64,
    /// Extent along the spindle, mm.
    pub x: [f64; 2],
    /// Largest distance from the surface to its facets that sampling found, with `rounding`, mm; nothing
    /// if the grid's size was given or the body is a mesh.
    pub deviation: Option<f64>,
    /// How far its points may be from where they were, as their coordinates are rounded, mm.
    pub rounding: f64,
}

/// What a search cost.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Counters {
    /// Candidates, points or facets, whose height was computed.
    pub evaluations: u64,
    /// Nodes of the hierarchy whose children's bounds were computed.
    pub nodes: u64,
    /// Positions at which the local search had lost the winner.
    pub lost: u64,
    /// By how much its height was too low there, at most, mm.
    pub largest_loss: f64,
    /// Straight moves that stray farther than the path tolerance and are too short to insert into:
    /// there the height jumps.
    pub beyond_tolerance: u64,
}

impl Counters {
    /// Counts a position at which the local search was too low.
    pub(crate) fn lose(&mut self, by: f64) {
        self.lost += 1;
        self.largest_loss = self.largest_loss.max(by);
    }
}

impl std::ops::AddAssign for Counters {
    // They may have come from anywhere.
    fn add_assign(&mut self, other: Self) {
        self.evaluations = self.evaluations.saturating_add(other.evaluations);
        self.nodes = self.nodes.saturating_add(other.nodes);
        self.lost = self.lost.saturating_add(other.lost);
        self.largest_loss = self.largest_loss.max(other.largest_loss);
        self.beyond_tolerance = self.beyond_tolerance.saturating_add(other.beyond_tolerance);
    }
}

/// What travelled for the extents as they were delivered, by kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Traffic {
    /// Rows that any extent needs, each counted once.
    pub rows_needed: u64,
    /// Rows that the master sent.
    pub rows_sent: u64,
    /// Bytes of tasks with their rows or surfaces, from the master to workers.
    pub bytes_to_workers: u64,
    /// Bytes of rows from worker to worker.
    pub bytes_between_workers: u64,
    /// Bytes of positions, from workers to the master.
    pub bytes_of_results: u64,
}

/// Someone who took part.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct WorkerRecord {
    /// Name.
    pub worker: String,
    /// Address at which the master reached it.
    pub address: String,
}

/// How an extent was digitized. Seconds are those of the attempt that completed it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ExtentRecord {
    /// Number in the job.
    pub extent: u32,
    /// The attempt that completed it, from 1.
    pub attempt: u32,
    /// By whom.
    pub worker: String,
    /// Who brought how many of its positions, by attempt.
    pub shares: Vec<Share>,
    /// First position.
    pub first: u64,
    /// Number of positions.
    pub positions: u64,
    /// Rows it needs, those of others included.
    pub rows: u32,
    /// Of these, how many other extents need too.
    pub overlap_rows: u32,
    /// Of these, how many other extents own; fetched from their workers if that is the distribution.
    pub halo_rows: u32,
    /// Rows that the master sent for it, each as often as it was sent.
    pub rows_sent: u64,
    /// Bytes from the master to all who tried it.
    pub bytes_sent: u64,
    /// Bytes of rows from other workers, for the attempt that completed it.
    pub bytes_fetched: u64,
    /// Bytes to the master from all who tried it.
    pub bytes_received: u64,
    /// Wall time of sending its own rows ahead of all tasks, s.
    pub place_seconds: f64,
    /// Wall time from sending the task to its last position, s.
    pub seconds: f64,
    /// Of which the worker received what came with the task, s.
    pub receive_seconds: f64,
    /// Of which it made rows from surfaces, s.
    pub make_seconds: f64,
    /// Of which it waited for rows of others with nothing else to do, s.
    pub halo_seconds: f64,
    /// Of which it built its hierarchies, s.
    pub build_seconds: f64,
    /// Of which it digitized, s.
    pub digitize_seconds: f64,
    /// What its searches cost.
    pub counters: Counters,
}

/// What one attempt brought of an extent.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Share {
    /// The attempt, from 1.
    pub attempt: u32,
    /// By whom.
    pub worker: String,
    /// Number of positions; what two brought counts for the first.
    pub positions: u64,
}

/// An attempt by an idle worker at an extent that was another's.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SecondAttempt {
    /// The extent.
    pub extent: u32,
    /// The attempt, from 2.
    pub attempt: u32,
    /// By whom.
    pub worker: String,
    /// Positions that were missing when it began.
    pub positions: u64,
    /// Rows that the master sent with it.
    pub rows_sent: u64,
    /// Why.
    pub reason: String,
}

/// An attempt that came to nothing.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct LostAttempt {
    /// The extent.
    pub extent: u32,
    /// The attempt, from 1.
    pub attempt: u32,
    /// By whom.
    pub worker: String,
    /// Positions that had arrived: kept, unless the answer was wrong.
    pub positions_received: u64,
    /// Positions of the extent.
    pub positions: u64,
    /// Why.
    pub reason: String,
}
