//! The papers' model, eq. (10) of 2001, `m = n/p + o`: of n rows each of p processors has its share and
//! an overlap. And a projection: what the work and the bytes that were measured give for more workers.
//!
//! All that is projected is straight lines through medians: bytes and the master's CPU time against the
//! number of workers, the workers' CPU time against rows: by the exact search those that they hold
//! together, since each has to go into a hierarchy; by brute force those of one, since each position looks
//! at all of them. Nothing is known here of congestion, of stragglers, or of memory.

use horma_core::Distribution;

use super::summary::Summary;
use crate::args::Search;

/// The overlap that fits one method and distribution best.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fit {
    pub search: Search,
    pub way: Distribution,
    /// Rows of the whole part, n.
    pub rows: f64,
    /// Rows of an extent beyond its share, o.
    pub overlap: f64,
    /// Largest distance of a measured m from the model, rows.
    pub residual: f64,
}

impl Fit {
    /// Rows of each of p extents.
    pub fn rows_of(&self, p: f64) -> f64 {
        // The overlap is with neighbours, and no extent has more than all rows.
        let overlap = if p > 1.0 { self.overlap } else { 0.0 };
        (self.rows / p + overlap).min(self.rows)
    }
}

/// Fits the model to each method and distribution that was run on more than one worker.
pub(super) fn fit(rows: u64, summaries: &[Summary]) -> Vec<Fit> {
    let mut fits: Vec<Fit> = Vec::new();
    for summary in summaries {
        let (search, Some((way, _))) = (summary.search, summary.cluster) else {
            continue;
        };
        if fits.iter().any(|f| f.search == search && f.way == way) {
            continue;
        }
        let alike = summaries.iter().filter(|s| s.is(search, way));
        let measured: Vec<[f64; 2]> = alike
            .map(|s| [s.extents, s.rows])
            .filter(|[p, _]| *p > 1.0)
            .collect();
        if measured.is_empty() {
            continue;
        }
        let rows = rows as f64;
        let beyond = measured.iter().map(|[p, m]| m - rows / p);
        let overlap = (beyond.sum::<f64>() / measured.len() as f64).max(0.0);
        let mut fit = Fit {
            search,
            way,
            rows,
            overlap,
            residual: 0.0,
        };
        let distances = measured.iter().map(|[p, m]| (m - fit.rows_of(*p)).abs());
        fit.residual = distances.fold(0.0, f64::max);
        fits.push(fit);
    }
    fits
}

/// A network, stated and not measured: every machine has a line of its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Network {
    pub gbit: f64,
    pub latency_us: f64,
}

impl Network {
    fn seconds(self, bytes: f64) -> f64 {
        bytes * 8.0 / (self.gbit * 1.0e9)
    }
}

/// Messages that wait for each other: a task and its first positions, the end and its answer; rows of
/// others before.
const LATENCIES: f64 = 4.0;
const HALO_LATENCIES: f64 = 2.0;

/// What is expected of one method and distribution.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Projection {
    pub search: Search,
    pub way: Distribution,
    pub points: Vec<Projected>,
}

/// What is expected of p workers, each on a machine of its own. Times in s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Projected {
    pub workers: u32,
    /// CPU time of the master.
    pub master: f64,
    /// CPU time of the busiest worker.
    pub worker: f64,
    /// On the lines, and waiting for what is on them.
    pub network: f64,
    /// One process's CPU time over the sum of the three.
    pub speedup: f64,
}

/// Most workers of a projection.
const MOST: u32 = 1024;

/// Projects each fit for which at least two numbers of workers were measured.
pub(super) fn project(summaries: &[Summary], fits: &[Fit], network: Network) -> Vec<Projection> {
    let projections = fits.iter().filter_map(|fit| {
        let one = |s: &&Summary| s.search == fit.search && s.cluster.is_none();
        let one = summaries.iter().find(one)?;
        let alike = summaries.iter().filter(|s| s.is(fit.search, fit.way));
        let alike: Vec<&Summary> = alike.collect();
        let against = |x: fn(&Summary) -> f64, y: fn(&Summary) -> f64| {
            let points: Vec<[f64; 2]> = alike.iter().map(|s| [x(s), y(s)]).collect();
            line(&points)
        };
        let workers = |s: &Summary| f64::from(s.workers());
        let master = against(workers, |s| s.own_cpu)?;
        let to_workers = against(workers, |s| s.to_workers)?;
        let between = against(workers, |s| s.between_workers)?;
        let results = against(workers, |s| s.of_results)?;
        let work = match fit.search {
            Search::Exact => against(|s| s.extents * s.rows, |s| s.workers_cpu)?,
            Search::Brute => against(|s| s.rows, |s| s.workers_cpu)?,
        };
        let imbalance = alike.iter().map(|s| s.imbalance).fold(0.0, f64::max);
        let positions = alike.first()?.positions;
        let powers = (0..=MOST.ilog2()).map(|k| 1 << k);
        let points = powers.take_while(|&p| u64::from(p) <= positions).map(|p| {
            let count = f64::from(p);
            let rows = match fit.search {
                Search::Exact => count * fit.rows_of(count),
                Search::Brute => fit.rows_of(count),
            };
            let share = work.at(rows) / count;
            let halo = between.at(count) / count;
            let latencies = LATENCIES + if halo > 0.0 { HALO_LATENCIES } else { 0.0 };
            let on_lines = to_workers.at(count) + results.at(count) + halo;
            let master = master.at(count);
            let worker = share * (1.0 + imbalance);
            let network = network.seconds(on_lines) + latencies * network.latency_us * 1.0e-6;
            Projected {
                workers: p,
                master,
                worker,
                network,
                speedup: one.own_cpu / (master + worker + network),
            }
        });
        Some(Projection {
            search: fit.search,
            way: fit.way,
            points: points.collect(),
        })
    });
    projections.collect()
}

/// A straight line.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Line {
    intercept: f64,
    slope: f64,
}

impl Line {
    fn at(self, x: f64) -> f64 {
        self.intercept + self.slope * x
    }
}

/// The line of least squares among those that are nowhere negative for positive x; nothing if all
/// points have one x.
fn line(points: &[[f64; 2]]) -> Option<Line> {
    let count = points.len() as f64;
    let mean = |k: usize| points.iter().map(|p| p[k]).sum::<f64>() / count;
    let [x, y] = [mean(0), mean(1)];
    let spread: f64 = points.iter().map(|p| (p[0] - x).powi(2)).sum();
    if points.is_empty() || spread <= 0.0 {
        return None;
    }
    let slope = points.iter().map(|p| (p[0] - x) * (p[1] - y)).sum::<f64>() / spread;
    let intercept = y - slope * x;
    Some(if slope < 0.0 {
        Line {
            intercept: y,
            slope: 0.0,
        }
    } else if intercept < 0.0 {
        let squares: f64 = points.iter().map(|p| p[0] * p[0]).sum();
        let slope = points.iter().map(|p| p[0] * p[1]).sum::<f64>() / squares;
        Line {
            intercept: 0.0,
            slope,
        }
    } else {
        Line { intercept, slope }
    })
}

#[cfg(test)]
mod tests {
    use super::super::summary::{PHASES, Spread};
    use super::*;

    /// A cluster whose work and bytes follow the model exactly: 100 rows, an overlap of 10.
    fn measured(way: Distribution, workers: u32) -> Summary {
        let p = f64::from(workers);
        let rows = if workers == 1 {
            100.0
        } else {
            100.0 / p + 10.0
        };
        Summary {
            search: Search::Exact,
            cluster: Some((way, workers)),
            positions: 300,
            wall: Spread {
                median: 1.0,
                low: 1.0,
                high: 1.0,
            },
            own_cpu: 0.5,
            worker_cpu: [0.0; 2],
            workers_cpu: 8.0 + 0.01 * p * rows,
            critical: 0.0,
            imbalance: 0.0,
            speedup: 1.0,
            critical_speedup: 1.0,
            phases: [0.0; PHASES.len()],
            rows,
            extents: p,
            to_workers: 1.0e9,
            between_workers: 0.0,
            of_results: 0.0,
        }
    }

    #[test]
    fn a_model_is_found_again_and_projected() {
        let mut summaries: Vec<_> = [1, 2, 4, 8]
            .map(|p| measured(Distribution::Overlap, p))
            .into();
        summaries.push(Summary {
            cluster: None,
            own_cpu: 9.0,
            ..measured(Distribution::Overlap, 1)
        });
        let fits = fit(100, &summaries);
        let [found] = fits[..] else {
            panic!("{fits:?}")
        };
        assert!((found.overlap - 10.0).abs() < 1e-9 && found.residual < 1e-9);
        assert_eq!(
            [1.0, 2.0, 1000.0].map(|p| found.rows_of(p)),
            [100.0, 60.0, 10.1]
        );

        let network = Network {
            gbit: 8.0,
            latency_us: 1.0,
        };
        let projections = project(&summaries, &fits, network);
        let points = &projections[0].points;
        let workers: Vec<u32> = points.iter().map(|p| p.workers).collect();
        assert_eq!(
            workers,
            [1, 2, 4, 8, 16, 32, 64, 128, 256],
            "no more than positions"
        );
        let sixteen = points[4];
        assert!(
            (sixteen.worker - (0.5 + 0.01 * 16.25)).abs() < 1e-9,
            "{sixteen:?}"
        );
        assert!((sixteen.network - 1.000004).abs() < 1e-9, "{sixteen:?}");
        assert!((sixteen.speedup * (0.5 + 0.6625 + 1.000004) - 9.0).abs() < 1e-9);
    }

    #[test]
    fn one_number_of_workers_gives_no_projection() {
        let summaries = [measured(Distribution::Halo, 4)];
        let fits = fit(100, &summaries);
        let network = Network {
            gbit: 1.0,
            latency_us: 1.0,
        };
        assert_eq!(fits.len(), 1);
        assert!(project(&summaries, &fits, network).is_empty());
        assert!(fit(100, &[measured(Distribution::Halo, 1)]).is_empty());
    }

    #[test]
    fn no_line_goes_below_zero() {
        let at = |points: &[[f64; 2]]| line(points).map(|l| [l.intercept, l.slope]);
        assert_eq!(at(&[[1.0, 3.0], [2.0, 5.0]]), Some([1.0, 2.0]));
        assert_eq!(at(&[[1.0, 5.0], [2.0, 3.0]]), Some([4.0, 0.0]));
        assert_eq!(at(&[[1.0, 0.0], [2.0, 5.0]]), Some([0.0, 2.0]));
        assert_eq!(at(&[[2.0, 1.0], [2.0, 3.0]]), None);
        assert_eq!(at(&[]), None);
    }
}
