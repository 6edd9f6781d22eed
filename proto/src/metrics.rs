//! What the processes of a cluster count for those who watch it: every series there is, with its labels
//! and whose it is. Counting goes through the `metrics` facade, at the place where something happens;
//! where nobody installed a recorder it costs next to nothing. How figures leave a process is decided
//! elsewhere.

use metrics::{
    Label, counter, describe_counter, describe_gauge, describe_histogram, gauge, histogram,
};

use crate::VERSION;
use crate::tls::Role;

/// How a figure behaves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// It grows until the process ends.
    Counter,
    /// It rises and falls.
    Gauge,
    /// How many there were of each size, and their sum.
    Histogram,
}

/// A figure, or several that differ by a label.
#[derive(Debug, Clone, Copy)]
pub struct Metric {
    /// Its name, with the unit as Prometheus wants it.
    pub name: &'static str,
    /// How it behaves.
    pub kind: Kind,
    /// What is counted.
    pub help: &'static str,
    /// The label and its values, if there is one.
    pub label: Option<(&'static str, &'static [&'static str])>,
    /// The processes that have it.
    pub roles: &'static [Role],
}

const BOTH: &[Role] = &[Role::Master, Role::Worker];
const MASTER: &[Role] = &[Role::Master];
const WORKER: &[Role] = &[Role::Worker];

/// The version that runs.
pub const BUILD: Metric = metric(
    Kind::Gauge,
    "horma_build_info",
    "always 1; its label is the version that runs",
    Some(("version", &[VERSION])),
    BOTH,
);
/// Memory of the process.
pub const MEMORY: Metric = metric(
    Kind::Gauge,
    "process_resident_memory_bytes",
    "memory that the process holds",
    None,
    BOTH,
);
/// What a server refused.
pub const REFUSED: Metric = metric(
    Kind::Counter,
    "horma_refused_total",
    "connections that were refused, and calls by what was wrong with them",
    Some((
        "reason",
        &[
            "connection",
            "forbidden",
            "malformed",
            "oversized",
            "damaged",
            "other",
        ],
    )),
    BOTH,
);
/// Bytes that travelled; each is counted by one process only.
pub const TRAFFIC: Metric = metric(
    Kind::Counter,
    "horma_traffic_bytes_total",
    "bytes of tasks, rows and surfaces to workers, of positions back, and of rows that came from another worker",
    Some(("kind", &["to_workers", "results", "between_workers"])),
    BOTH,
);
/// Jobs that are not over.
pub const JOBS: Metric = metric(
    Kind::Gauge,
    "horma_jobs",
    "jobs that are not over: those that wait for their turn or are being planned, and those that workers are at",
    Some(("state", &["queued", "running"])),
    MASTER,
);
/// Jobs that are over.
pub const JOBS_ENDED: Metric = metric(
    Kind::Counter,
    "horma_jobs_ended_total",
    "jobs that are over, by how they ended",
    Some(("outcome", &["done", "failed", "cancelled"])),
    MASTER,
);
/// Extents of the jobs that are going on.
pub const EXTENTS: Metric = metric(
    Kind::Gauge,
    "horma_extents",
    "extents of the jobs that are going on; those placed wait with their rows at a worker",
    Some((
        "state",
        &["waiting", "placing", "placed", "running", "done"],
    )),
    MASTER,
);
/// Members.
pub const WORKERS: Metric = metric(
    Kind::Gauge,
    "horma_workers",
    "workers that are registered, by what they do",
    Some(("state", &["idle", "placing", "digitizing"])),
    MASTER,
);
/// Positions as they come in.
pub const POSITIONS: Metric = metric(
    Kind::Counter,
    "horma_positions_total",
    "positions that came in, without inserted ones; what two workers bring counts twice",
    None,
    MASTER,
);
/// Positions as they are made.
pub const DIGITIZED: Metric = metric(
    Kind::Counter,
    "horma_digitized_positions_total",
    "positions that this worker digitized, without inserted ones",
    None,
    WORKER,
);
/// Attempts that came to nothing.
pub const ATTEMPTS_LOST: Metric = metric(
    Kind::Counter,
    "horma_attempts_lost_total",
    "attempts at an extent that came to nothing: the worker was lost, it answered wrongly, it could not get rows from another, or two brought different positions",
    Some(("reason", &["lost", "wrong", "halo", "different"])),
    MASTER,
);
/// Where a master's time goes.
pub const JOB_SECONDS: Metric = metric(
    Kind::Histogram,
    "horma_job_phase_seconds",
    "wall time of the phases of jobs",
    Some(("phase", &["discretize", "digitize", "stitch"])),
    MASTER,
);
/// Whether a worker is a member.
pub const REGISTERED: Metric = metric(
    Kind::Gauge,
    "horma_registered",
    "1 while the master knows this worker",
    None,
    WORKER,
);
/// Tasks under way.
pub const TASKS: Metric = metric(Kind::Gauge, "horma_tasks", "tasks under way", None, WORKER);
/// Where a worker's time goes.
pub const TASK_SECONDS: Metric = metric(
    Kind::Histogram,
    "horma_task_phase_seconds",
    "wall time of the phases of finished tasks; halo is waiting for rows of other workers with nothing else to do",
    Some(("phase", &["receive", "make", "halo", "build", "digitize"])),
    WORKER,
);
/// Work of the searches.
pub const EVALUATIONS: Metric = metric(
    Kind::Counter,
    "horma_evaluations_total",
    "candidates whose height was computed",
    None,
    WORKER,
);
/// Work of the searches.
pub const NODES: Metric = metric(
    Kind::Counter,
    "horma_nodes_total",
    "nodes of the hierarchy whose children were bounded",
    None,
    WORKER,
);
/// Rows that a worker holds.
pub const ROWS_HELD: Metric = metric(
    Kind::Gauge,
    "horma_rows_held",
    "rows that are held for the length of a job",
    None,
    WORKER,
);

/// All of them.
pub const ALL: &[Metric] = &[
    BUILD,
    MEMORY,
    REFUSED,
    TRAFFIC,
    JOBS,
    JOBS_ENDED,
    EXTENTS,
    WORKERS,
    POSITIONS,
    DIGITIZED,
    ATTEMPTS_LOST,
    JOB_SECONDS,
    REGISTERED,
    TASKS,
    TASK_SECONDS,
    EVALUATIONS,
    NODES,
    ROWS_HELD,
];

const fn metric(
    kind: Kind,
    name: &'static str,
    help: &'static str,
    label: Option<(&'static str, &'static [&'static str])>,
    roles: &'static [Role],
) -> Metric {
    Metric {
        name,
        kind,
        help,
        label,
        roles,
    }
}

/// Tells the recorder what a process of that role has, each figure at zero: what has not happened yet
/// is no gap.
pub fn announce(role: Role) {
    for metric in ALL.iter().filter(|m| m.roles.contains(&role)) {
        match metric.kind {
            Kind::Counter => describe_counter!(metric.name, metric.help),
            Kind::Gauge => describe_gauge!(metric.name, metric.help),
            Kind::Histogram => describe_histogram!(metric.name, metric.help),
        }
        let values = metric.label.map_or(&[""][..], |(_, values)| values);
        for value in values {
            match metric.kind {
                Kind::Counter => metric.add(value, 0),
                Kind::Gauge => metric.set(value, 0.0),
                Kind::Histogram => metric.open(value),
            }
        }
    }
    BUILD.set(VERSION, 1.0);
}

impl Metric {
    /// Adds to a counter; `value` is the label's, or nothing.
    pub fn add(&self, value: &'static str, n: u64) {
        counter!(self.name, self.labels(value)).increment(n);
    }

    /// Sets a gauge.
    pub fn set(&self, value: &'static str, to: f64) {
        gauge!(self.name, self.labels(value)).set(to);
    }

    /// Raises a gauge, or lowers it.
    pub fn change(&self, value: &'static str, by: f64) {
        gauge!(self.name, self.labels(value)).increment(by);
    }

    /// Writes down one more of a histogram.
    pub fn record(&self, value: &'static str, what: f64) {
        histogram!(self.name, self.labels(value)).record(what);
    }

    /// A histogram of nothing yet.
    fn open(&self, value: &'static str) {
        let _ = histogram!(self.name, self.labels(value));
    }

    fn labels(&self, value: &'static str) -> Vec<Label> {
        let label = self
            .label
            .map(|(key, _)| Label::from_static_parts(key, value));
        label.into_iter().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_follow_the_conventions_of_prometheus() {
        for metric in ALL {
            let Metric {
                name, kind, help, ..
            } = metric;
            assert_eq!(name.ends_with("_total"), *kind == Kind::Counter, "{name}");
            let plain = |c: char| c.is_ascii_lowercase() || c == '_';
            assert!(name.chars().all(plain), "{name}");
            assert!(!help.is_empty() && !help.ends_with('.'), "{name}: {help}");
            let same = ALL.iter().filter(|other| other.name == *name);
            assert_eq!(same.count(), 1, "{name}");
        }
    }
}
