//! What can be typed of benches.

use std::fmt;
use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};
use horma_core::Distribution;
use horma_formats::job::Overrides;

use super::one_of;

#[derive(Debug, Subcommand)]
pub(crate) enum Bench {
    /// Measure the searches: cost per position, and ratios from one run
    ///
    /// Exact against brute force and facets against points from ten thousand to ten million points,
    /// instruction sets, threads, numbers of positions and two wheels. What is compared is measured in
    /// turn, and the shortest of the repetitions counts. On the way it checks that instruction sets,
    /// threads and brute force give the same path to the last bit. Close other programs first; the
    /// full bench takes a few minutes.
    #[command(after_help = "\
Examples:
  horma bench kernel -o bench --quick     the sample last, in a few seconds
  horma bench kernel job.toml -o bench    your part, cutter and motion
  horma bench kernel job.toml -o bench --step 0.25 --points-per-revolution 3600

Of a job, its part, cutter and motion are taken; the grid, the contact and the method are what is
varied. Positions that are close to each other share most of their search: one of a finer path costs
less, the more so the denser the grid is.")]
    Kernel(BenchKernel),
    /// Measure clusters of this machine's processes against one process: speed-up, bytes, the papers' model
    ///
    /// Every number of workers, distribution and method takes its turn in every round, beside the same
    /// job in this process on one thread; medians count, with their spread. Every path has to be the
    /// one process's, to the last bit. CPU time is the operating system's count for each process. Where
    /// there are fewer cores than workers, wall time says little: the CPU critical path, the master's
    /// time and the busiest worker's, is what as many cores would be bound by.
    #[command(after_help = "\
Examples:
  horma bench scaling -o scaling          the sample last
  horma bench scaling job.toml -o scaling --step 0.25 --points-per-revolution 3600

By the exact search a last takes a fraction of a second, and starting processes outweighs the gain: ask
for a smaller step and more points per revolution. Brute force takes hundreds of times as long for a
position, so it digitizes few of them, see --thin; it is compared with brute force alone.")]
    Scaling(BenchScaling),
}

#[derive(Debug, Args)]
pub(crate) struct BenchKernel {
    /// The job file (TOML) [default: the sample that `horma init` writes]
    #[arg(value_name = "JOB")]
    pub job: Option<PathBuf>,
    /// Directory for kernel.txt, kernel.json and kernel.svg
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Up to a hundred thousand points only, and fewer repetitions
    #[arg(long)]
    pub quick: bool,
    #[command(flatten)]
    pub motion: BenchMotion,
    /// Show no progress, only the table
    #[arg(short, long)]
    pub quiet: bool,
}

/// What of the job's motion is varied.
#[derive(Debug, Default, Args)]
pub(crate) struct BenchMotion {
    /// Travel per revolution, mm [default: the job's]
    #[arg(long, value_name = "MM")]
    pub step: Option<f64>,
    /// Positions per revolution [default: the job's]
    #[arg(long, value_name = "N")]
    pub points_per_revolution: Option<u32>,
}

impl BenchMotion {
    /// The job file with this motion.
    pub fn overrides(&self) -> Overrides {
        Overrides {
            step: self.step,
            points_per_revolution: self.points_per_revolution,
            ..Overrides::default()
        }
    }
}

#[derive(Debug, Args)]
pub(crate) struct BenchScaling {
    /// The job file (TOML) [default: the sample that `horma init` writes]
    #[arg(value_name = "JOB")]
    pub job: Option<PathBuf>,
    /// Directory for scaling.md, scaling.csv and the diagrams
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Numbers of worker processes, one thread each
    #[arg(long, value_name = "N,...", value_delimiter = ',', default_value = "1,2,4,8", value_parser = clap::value_parser!(u32).range(1..=256))]
    pub workers: Vec<u32>,
    /// How workers come by the part; a mesh has no surface
    #[arg(long, value_name = "D,...", value_delimiter = ',', value_parser = one_of(Distribution::ALL, Distribution::name), default_values_t = Distribution::ALL)]
    pub distribution: Vec<Distribution>,
    /// How the touch is searched
    #[arg(long, value_name = "M,...", value_delimiter = ',', default_values_t = Search::ALL)]
    pub method: Vec<Search>,
    /// How often everything takes its turn
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=100))]
    pub rounds: u32,
    /// By brute force, digitize only every Nth position of a revolution
    #[arg(long, value_name = "N", default_value_t = 30, value_parser = clap::value_parser!(u32).range(1..))]
    pub thin: u32,
    /// Chordal tolerance of surfaces, mm [default: the job's]
    #[arg(long, value_name = "MM")]
    pub tolerance: Option<f64>,
    #[command(flatten)]
    pub motion: BenchMotion,
    /// Of the network to project on: what every machine's line carries
    #[arg(long, value_name = "GBIT/S", default_value_t = 10.0, value_parser = positive)]
    pub network_gbit: f64,
    /// Of the network to project on: one way
    #[arg(long, value_name = "US", default_value_t = 50.0, value_parser = positive)]
    pub latency_us: f64,
    /// Show no progress, only the tables
    #[arg(short, long)]
    pub quiet: bool,
}

/// A method whose cost does not depend on where a worker's positions begin, as it is typed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Search {
    Exact,
    Brute,
}

impl Search {
    const ALL: [Self; 2] = [Self::Exact, Self::Brute];
}

impl fmt::Display for Search {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Exact => "exact",
            Self::Brute => "brute",
        })
    }
}

fn positive(text: &str) -> Result<f64, String> {
    let number = text.parse().map_err(|_| "not a number".to_owned())?;
    if number > 0.0 && f64::is_finite(number) {
        Ok(number)
    } else {
        Err(format!("{number} is not above 0"))
    }
}
