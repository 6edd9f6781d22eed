//! Medians of runs, and what follows from them: speed-up, efficiency, the critical path, imbalance.

use horma_core::{Distribution, ExtentRecord};

use super::runs::Run;
use crate::args::Search;

/// A case over all its rounds. Times in s.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Summary {
    pub search: Search,
    pub cluster: Option<(Distribution, u32)>,
    /// Positions of the path.
    pub positions: u64,
    pub wall: Spread,
    /// CPU time of the master, or of the one process.
    pub own_cpu: f64,
    /// CPU time of a worker, on average, and of the busiest.
    pub worker_cpu: [f64; 2],
    /// CPU time of all workers.
    pub workers_cpu: f64,
    /// CPU time of the master and the busiest worker: what enough cores would be bound by.
    pub critical: f64,
    /// The busiest worker's CPU time over the average, less 1.
    pub imbalance: f64,
    /// One process's wall time over this.
    pub speedup: f64,
    /// One process's CPU time over the critical path.
    pub critical_speedup: f64,
    /// Wall time by phase; of what workers do, the sum over all of them divided by their number.
    pub phases: [f64; PHASES.len()],
    /// Rows of an extent, on average, the papers' m; 0 in one process.
    pub rows: f64,
    /// Extents of a run.
    pub extents: f64,
    pub to_workers: f64,
    pub between_workers: f64,
    pub of_results: f64,
}

/// The phases, in order: what the master does, what workers do within the time it waits, and the end.
pub(super) const PHASES: [&str; 8] = [
    "start",
    "discretize",
    "receive",
    "make",
    "halo",
    "build",
    "digitize",
    "stitch",
];

/// A median, and the range about it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Spread {
    pub median: f64,
    pub low: f64,
    pub high: f64,
}

impl Summary {
    /// Number of workers; 1 for one process.
    pub fn workers(&self) -> u32 {
        self.cluster.map_or(1, |(_, workers)| workers)
    }

    pub fn efficiency(&self) -> f64 {
        self.speedup / f64::from(self.workers())
    }

    pub fn critical_efficiency(&self) -> f64 {
        self.critical_speedup / f64::from(self.workers())
    }

    pub fn is(&self, search: Search, way: Distribution) -> bool {
        self.search == search && self.cluster.is_some_and(|(w, _)| w == way)
    }
}

/// Summarizes all runs, case by case in the order of the first round.
pub(super) fn all(runs: &[Run]) -> Vec<Summary> {
    let first = runs.iter().filter(|r| r.round == 1);
    let mut found: Vec<Summary> = Vec::new();
    for case in first.map(|r| r.case) {
        let of_case = |r: &&Run| r.case.search == case.search && r.case.cluster == case.cluster;
        let runs: Vec<&Run> = runs.iter().filter(of_case).collect();
        let one = |s: &&Summary| s.search == case.search && s.cluster.is_none();
        let mut summary = summarize(&runs);
        if let Some(one) = found.iter().find(one) {
            summary.speedup = one.wall.median / summary.wall.median;
            summary.critical_speedup = one.critical / summary.critical;
        }
        found.push(summary);
    }
    found
}

fn summarize(runs: &[&Run]) -> Summary {
    let of = |value: &dyn Fn(&Run) -> f64| spread(runs.iter().map(|r| value(r)).collect()).median;
    let case = runs[0].case;
    let traffic = |r: &Run| r.record.traffic.unwrap_or_default();
    let extents = |r: &Run| r.record.extents.len() as f64;
    let rows = |r: &Run| {
        let rows = r.record.extents.iter().map(|e| f64::from(e.rows));
        rows.sum::<f64>() / extents(r).max(1.0)
    };
    Summary {
        search: case.search,
        cluster: case.cluster,
        positions: runs[0].positions,
        wall: spread(runs.iter().map(|r| r.wall).collect()),
        own_cpu: of(&|r| r.own_cpu),
        worker_cpu: [of(&Run::mean_cpu), of(&Run::most_cpu)],
        workers_cpu: of(&Run::all_cpu),
        critical: of(&|r| r.own_cpu + r.most_cpu()),
        imbalance: of(&|r| {
            if r.mean_cpu() > 0.0 {
                r.most_cpu() / r.mean_cpu() - 1.0
            } else {
                0.0
            }
        }),
        speedup: 1.0,
        critical_speedup: 1.0,
        phases: std::array::from_fn(|k| of(&|r| phase(r, PHASES[k]))),
        rows: of(&rows),
        extents: of(&extents),
        to_workers: of(&|r| traffic(r).bytes_to_workers as f64),
        between_workers: of(&|r| traffic(r).bytes_between_workers as f64),
        of_results: of(&|r| traffic(r).bytes_of_results as f64),
    }
}

/// How long a phase took; of what workers do, on the average of them.
pub(super) fn phase(run: &Run, name: &str) -> f64 {
    let workers = run.worker_cpu.len();
    let by_workers = |seconds: fn(&ExtentRecord) -> f64| {
        sum(run.record.extents.iter().map(seconds)) / workers as f64
    };
    match name {
        "start" => run.start,
        "receive" if workers > 0 => by_workers(|e| e.receive_seconds),
        "make" if workers > 0 => by_workers(|e| e.make_seconds),
        "halo" if workers > 0 => by_workers(|e| e.halo_seconds),
        "build" if workers > 0 => by_workers(|e| e.build_seconds),
        "digitize" if workers > 0 => by_workers(|e| e.digitize_seconds),
        _ => {
            let phases = run.record.phases.iter().filter(|p| p.name == name);
            sum(phases.map(|p| p.seconds))
        }
    }
}

/// That of nothing is 0, where the library has −0.
fn sum(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(0.0, |sum, value| sum + value)
}

fn spread(mut values: Vec<f64>) -> Spread {
    values.sort_by(f64::total_cmp);
    let half = values.len() / 2;
    let median = if values.len() % 2 == 1 {
        values[half]
    } else {
        (values[half - 1] + values[half]) / 2.0
    };
    Spread {
        median,
        low: values[0],
        high: values[values.len() - 1],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_has_its_median_whatever_the_order() {
        let of = |values: &[f64]| {
            let s = spread(values.to_vec());
            [s.low, s.median, s.high]
        };
        assert_eq!(of(&[3.0]), [3.0, 3.0, 3.0]);
        assert_eq!(of(&[9.0, 1.0, 4.0]), [1.0, 4.0, 9.0]);
        assert_eq!(of(&[8.0, 2.0, 4.0, 5.0]), [2.0, 4.5, 8.0]);
    }
}
