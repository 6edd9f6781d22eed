//! A snapshot: what a master has to do and who does it, as plain data for those who watch. Made by a
//! pure function from the state and the jobs; it has no positions, and nothing can be done with it.

use std::collections::BTreeMap;
use std::time::Duration;

use horma_core::Traffic;
use horma_proto::metrics::{EXTENTS, JOBS, WORKERS};
use serde::Serialize;

use crate::history::History;
use crate::running::RunningJob;
pub use crate::state::ExtentState;
use crate::state::{Member, State, Step};

/// A master at one moment.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Snapshot {
    /// The version that runs.
    pub version: &'static str,
    /// Jobs that are going on, oldest first.
    pub jobs: Vec<Job>,
    /// Jobs that wait for their turn, in their order.
    pub queued: Vec<Queued>,
    /// The last jobs that are over, newest first.
    pub ended: Vec<Job>,
    /// Everybody who is registered, by name.
    pub workers: Vec<Worker>,
}

/// A job that waits.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Queued {
    /// Its number.
    pub job: u64,
    /// What the client calls it.
    pub name: String,
    /// When it came, ms since 1970.
    pub submitted: u64,
}

/// A job.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Job {
    /// Its number.
    pub job: u64,
    /// What the client calls it; nothing once it is over.
    pub name: String,
    /// How far it has come.
    pub state: JobState,
    /// Why it failed.
    pub reason: Option<String>,
    /// How workers come by their rows: overlap, halo or surface.
    pub distribution: &'static str,
    /// Positions of the job, without inserted ones.
    pub positions: u64,
    /// Of which so many have arrived.
    pub arrived: u64,
    /// Positions that were inserted between those.
    pub inserted: u64,
    /// Time since it was split into extents, s.
    pub seconds: f64,
    /// Positions per second since then.
    pub rate: f64,
    /// Time that the rest takes at that rate, s.
    pub seconds_left: Option<f64>,
    /// Attempts at extents that came to nothing.
    pub lost: usize,
    /// What travelled for what is delivered, and for rows that are placed.
    pub traffic: Traffic,
    /// Its extents, along the spindle.
    pub extents: Vec<Extent>,
}

/// How far a job has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum JobState {
    /// Nobody works on it yet.
    Waiting,
    /// Its extents are being digitized.
    Running,
    /// Its path is whole.
    Done,
    /// It came to nothing.
    Failed,
    /// Nobody wanted it any more.
    Cancelled,
}

/// A run of positions.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Extent {
    /// Its number in the job.
    pub extent: u32,
    /// Travel of its first and its last position, mm.
    pub x: [f64; 2],
    /// Number of its positions.
    pub positions: u64,
    /// How far it has come.
    pub state: ExtentState,
    /// Of which so many have arrived.
    pub arrived: u64,
    /// Who is at it, or completed it.
    pub workers: Vec<String>,
    /// The number of its last attempt.
    pub attempt: u32,
}

/// A worker.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Worker {
    /// Its name.
    pub worker: String,
    /// Where it is reached.
    pub address: String,
    /// Time since it was last heard of, s.
    pub silent: f64,
    /// What it does.
    pub state: WorkerState,
    /// The job and the extent that it is busy with.
    pub task: Option<[u64; 2]>,
    /// Positions that it has brought.
    pub positions: u64,
    /// Positions per second that it was busy.
    pub rate: Option<f64>,
}

/// What a worker does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum WorkerState {
    /// Nothing.
    Idle,
    /// It takes in rows.
    Placing,
    /// It digitizes.
    Digitizing,
}

/// Looks at everything.
pub(crate) fn snapshot(
    state: &State,
    jobs: &BTreeMap<u64, RunningJob>,
    addresses: &BTreeMap<String, String>,
    history: &History,
    now: Duration,
) -> Snapshot {
    let worker = |member: Member<'_>| Worker {
        worker: member.name.to_owned(),
        address: addresses.get(member.name).cloned().unwrap_or_default(),
        silent: member.silent.as_secs_f64(),
        state: match member.task {
            None => WorkerState::Idle,
            Some((_, Step::Place)) => WorkerState::Placing,
            Some((_, Step::Digitize)) => WorkerState::Digitizing,
        },
        task: member.task.map(|(t, _)| [t.job, u64::from(t.extent)]),
        positions: member.positions,
        rate: member
            .cost
            .filter(|&cost| cost > 0.0)
            .map(|cost| 1.0 / cost),
    };
    Snapshot {
        version: horma_proto::VERSION,
        jobs: jobs
            .iter()
            .map(|(&id, job)| going_on(state, id, job))
            .collect(),
        queued: Vec::new(),
        ended: history.ended().cloned().collect(),
        workers: state.members(now).map(worker).collect(),
    }
}

/// A job of the state's.
fn going_on(state: &State, id: u64, job: &RunningJob) -> Job {
    let mut seen = whole(id, job, JobState::Waiting);
    for (extent, (state, attempt)) in seen.extents.iter_mut().zip(state.extents(id)) {
        (extent.state, extent.attempt) = (state, attempt);
    }
    let busy = state
        .members(Duration::ZERO)
        .filter_map(|m| Some((m.task?.0, m.name)));
    for (task, name) in busy.filter(|(task, _)| task.job == id) {
        seen.extents[task.extent as usize]
            .workers
            .push(name.to_owned());
        seen.state = JobState::Running;
    }
    if seen.arrived > 0 {
        seen.state = JobState::Running;
    }
    seen
}

/// A job that is over, by what has become of it.
pub(crate) fn ended(id: u64, job: &RunningJob, state: JobState, reason: Option<String>) -> Job {
    Job {
        reason,
        seconds_left: None,
        ..whole(id, job, state)
    }
}

/// What a job itself knows: an extent whose positions are here is done.
fn whole(id: u64, job: &RunningJob, state: JobState) -> Job {
    let positions = job.plan.trajectory.positions;
    let [arrived, inserted] = job.so_far();
    let seconds = job.begin.elapsed().as_secs_f64();
    let rate = arrived.saturating_sub(job.resumed) as f64 / seconds;
    let left = positions.saturating_sub(arrived);
    let extents = (0u32..).zip(&job.extents);
    let extents = extents.map(|(number, extent)| {
        let kept = job.kept.get(&number).map(|(_, record)| record);
        let last = extent.first + extent.count.saturating_sub(1);
        Extent {
            extent: number,
            x: [extent.first, last].map(|i| job.plan.trajectory.travel(i)),
            positions: extent.count,
            state: kept.map_or(ExtentState::Waiting, |_| ExtentState::Done),
            arrived: extent.count.saturating_sub(job.left(number)),
            workers: kept
                .map(|record| record.worker.clone())
                .into_iter()
                .collect(),
            attempt: kept.map_or(0, |record| record.attempt),
        }
    });
    Job {
        job: id,
        name: String::new(),
        state,
        reason: None,
        distribution: job.plan.sharing.distribution.name(),
        positions,
        arrived,
        inserted,
        seconds,
        rate,
        seconds_left: (rate > 0.0).then(|| left as f64 / rate),
        lost: job.lost.len(),
        traffic: job.traffic(),
        extents: extents.collect(),
    }
}

impl Snapshot {
    /// Sets the gauges that `/metrics` has of a master.
    pub fn set_gauges(&self) {
        JOBS.set("queued", self.queued.len() as f64);
        JOBS.set("running", self.jobs.len() as f64);
        let extents = || self.jobs.iter().flat_map(|job| &job.extents);
        for (label, state) in [
            ("waiting", ExtentState::Waiting),
            ("placing", ExtentState::Placing),
            ("placed", ExtentState::Placed),
            ("running", ExtentState::Running),
            ("done", ExtentState::Done),
        ] {
            let count = extents().filter(|extent| extent.state == state).count();
            EXTENTS.set(label, count as f64);
        }
        for (label, state) in [
            ("idle", WorkerState::Idle),
            ("placing", WorkerState::Placing),
            ("digitizing", WorkerState::Digitizing),
        ] {
            let workers = self.workers.iter();
            let count = workers.filter(|worker| worker.state == state).count();
            WORKERS.set(label, count as f64);
        }
    }
}
