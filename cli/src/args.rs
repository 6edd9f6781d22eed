//! What can be typed.

mod bench;
mod job;
mod last;
mod serve;

use std::path::PathBuf;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, Parser, Subcommand};
use clap_complete::Shell;
use horma_core::Simd;
use horma_formats::part::{UNIT_NAMES, Unit};
use horma_papers::Experiment;

pub(crate) use self::bench::{Bench, BenchKernel, BenchMotion, BenchScaling, Search};
pub(crate) use self::job::{Also, How, Job};
pub(crate) use self::last::{Made, Measure, Sizes};
pub(crate) use self::serve::{Joining, Master, Worker};
use crate::traces::{self, Collector};

const AFTER_HELP: &str = "\
Start with:
  horma init demo                       a sample last, its holders and a job
  horma run demo/job.toml -o out        digitize it in this process
  horma view out                        look at it: the part, its path, errors, axes, figures
  horma run demo/job.toml -o out -w 2   the same on two worker processes: the same bytes

Across machines, each with its certificate:
  horma certs certs                     a test authority, and certificates for every role
  horma master --bind 10.0.0.1:7171 --tls-ca ca.pem --tls-cert master.pem --tls-key master.key
  horma worker --master 10.0.0.1:7171 --bind 0.0.0.0:0 --tls-ca ca.pem ...     on every other
  horma submit job.toml --master 10.0.0.1:7171 -o out --tls-ca ca.pem ...

A master that serves, and forgets nothing when it is killed:
  horma master --store jobs             keeps queue, finished extents and results in jobs/
  horma submit job.toml --detach        prints the job's number; HORMA_MASTER says where
  horma status                          how far everything is
  horma fetch 1 job.toml -o out --wait  the same files as `horma run`

Lengths are in mm, angles in degrees. Flags go over HORMA_* variables, these over the job file.

Exit codes: 0 done, 2 the input is wrong, 3 the job cannot be done, 4 the cluster failed,
130 interrupted.";

/// Tool paths for shoe lasts and other free-form parts turned on copying lathes.
///
/// For each position of a spiral around the part, horma finds where the cutter first touches it: the
/// exact tool centre, never deeper. It runs in one process or on a cluster of workers, with the same
/// result to the last bit.
#[derive(Debug, Parser)]
#[command(name = "horma", version, after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub command: Command,
    /// What to log to standard error: error, warn, info, debug, or a tracing filter
    #[arg(
        long,
        global = true,
        value_name = "FILTER",
        env = "HORMA_LOG",
        default_value = "error"
    )]
    pub log: String,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Compute the tool path of a job, here or on local workers
    Run(Run),
    /// Send a job to a running master, and fetch its path
    Submit(Submit),
    /// Tell how far the jobs of a master are
    Status(Status),
    /// End a job of a master
    Cancel(Cancel),
    /// Fetch the path of a job that was sent to a master before
    ///
    /// Given the job file as well, with what was said differently then, it does all that `horma run`
    /// does with a path; without, it writes path.csv and report.json. The master drops the result once
    /// it is written, unless it is to keep it.
    Fetch(Fetch),
    /// Hold a path against the designed surface: gouges, excess, scallops
    Verify(Verify),
    /// Show the surface that a path from anywhere leaves: a mesh with its errors in colour, a map of them, and the
    /// report and page that a run has
    ///
    /// Rays go out from the spindle; on each the machined surface is where it first meets a cutter, the
    /// designed one where it last meets a facet within 0.01 mm of the design. Their difference is told along
    /// the designed surface's normal. What lies in an undercut is not seen, nor a cross-section that does not
    /// hold the spindle, and nothing is refused: `horma verify` tells by its exit code whether a path is good.
    #[command(after_help = "\
Example:
  horma machined target/last/path.csv job.toml -o target/machined

Writes machined.ply (mm, part coordinates, a deviation and a colour at each corner), machined.svg, report.json and
report.html; `horma view target/machined` opens it.")]
    Machined(Machined),
    /// Measure a shoe last: bottom length, centre line, ball girth, cone heel line, and what else there is
    ///
    /// Landmarks are found on the last, or taken from the job. Given a path as well, the last is
    /// measured as that path leaves it, too.
    #[command(after_help = "\
Examples:
  horma measure job.toml                       the job's last
  horma measure job.toml --size 39 --side left the same in another size, for the other foot
  horma measure job.toml --path out/path.csv   as designed and as machined
  horma measure last.stl                       a file alone: toe at the greatest x, up along z

How measures and landmarks are defined says docs/lasts.md.")]
    Measure(Measure),
    /// Look at what a run has written: tells where its report.html is, and opens it in a browser
    ///
    /// The page needs no network and can be sent to others as it is: the part with its path and the wheel
    /// in three dimensions, gouges and excess, the attack axis over time, all figures.
    View(View),
    /// Serve as a master: workers register, clients submit jobs
    Master(Master),
    /// Serve as a worker of a master
    Worker(Worker),
    /// Tell whether this host is fit for a worker: addresses, limits, certificates, the way to the master
    /// and the way back
    ///
    /// Takes what `horma worker` takes, and listens as it would. Every check is one line: ok, warning or
    /// failed, and what to do. It computes nothing and joins nothing. Run it where a worker does not
    /// register, or registers and gets no work.
    #[command(after_help = "\
Examples:
  horma doctor                                           this host alone
  horma doctor --master 10.0.0.1:7171 --bind 0.0.0.0:0 --tls-ca ca.pem ...    and the way both ways

Exit codes: 0 no check failed, 2 something here is wrong, 4 master and worker do not reach each other.")]
    Doctor(Joining),
    /// Make a test authority, and certificates of it for a master, workers and clients
    ///
    /// For tests and small private networks: one certificate serves all workers, the authority's key
    /// lies beside them unencrypted, and nothing can be revoked. Where there is an authority already,
    /// have it sign certificates with these DNS names instead: master.horma.internal,
    /// worker.horma.internal, client.horma.internal. Each name is a role; a certificate may have
    /// several.
    Certs(Certs),
    /// Write a sample job with a shoe last and its holders
    Init {
        /// Where to write; created if missing
        directory: PathBuf,
    },
    /// Tell what is in part files
    Inspect {
        /// STEP, IGES, STL, OBJ, PLY or 3MF files
        #[arg(required = true)]
        files: Vec<PathBuf>,
        /// The unit of length of files that state none: mm, cm, m, um, inch, ft or mil; default mm.
        /// In a job: units in its section part
        #[arg(long, value_name = "UNIT", value_parser = unit)]
        units: Option<Unit>,
        /// Also write a page that shows all of them in three dimensions, open edges marked; it works from
        /// disk, in any browser
        #[arg(long, value_name = "PAGE")]
        html: Option<PathBuf>,
    },
    /// Measure on this machine what the searches cost, and what clusters gain
    #[command(subcommand)]
    Bench(Bench),
    /// Reproduce the papers: their hardware models and experiments, beside what is printed in them
    ///
    /// Every figure that the papers print stands beside the one found, with a verdict; where the papers are
    /// wrong the figures say so. All of it takes a minute at most and needs no file.
    #[command(after_help = "\
Examples:
  horma papers -o papers                 everything
  horma papers cordic precision -o papers

Writes papers.md, papers.html (one file, diagrams and all) and the diagrams of papers.md, papers/*.svg.")]
    Papers(Papers),
    /// Print shell completions
    Completions {
        /// bash, zsh, fish, elvish or powershell
        shell: Shell,
    },
    /// Write manual pages: horma.1, and one for each command
    #[command(after_help = "\
Example:
  horma man ~/.local/share/man/man1         then `man horma`, `man horma-run`")]
    Man {
        /// Where to write; created if missing
        directory: PathBuf,
    },
}

impl Command {
    /// Whose spans are to be sent, and to which collector.
    pub fn traces(&self) -> Option<(&'static str, &Collector)> {
        let (service, traces) = match self {
            Self::Run(run) => ("horma-run", &run.traces),
            Self::Submit(submit) => ("horma-submit", &submit.traces),
            Self::Master(master) => ("horma-master", &master.traces),
            Self::Worker(worker) => (traces::WORKER, &worker.traces),
            _ => return None,
        };
        Some((service, traces.otlp.as_ref()?))
    }
}

/// Where it is told what was done for a job, when and by whom.
#[derive(Debug, Args)]
pub(crate) struct Traces {
    /// Collector of OpenTelemetry traces, http://HOST:PORT, to which this process sends over OTLP what it
    /// does for each job; give it to all processes that take part. OTEL_EXPORTER_OTLP_ENDPOINT is not
    /// looked at [default: nowhere]
    #[arg(long, value_name = "URL", env = "HORMA_OTLP")]
    pub otlp: Option<Collector>,
}

#[derive(Debug, Args)]
pub(crate) struct Run {
    #[command(flatten)]
    pub job: Job,
    /// Directory for path.csv, the program (path.ngc), report.json, report.html, machined.svg and preview.png
    #[arg(short, long, value_name = "DIR", required_unless_present = "dry_run")]
    pub output: Option<PathBuf>,
    /// Tell what would be done, and write nothing: positions, grids, memory, what each worker would get,
    /// and how long digitizing would take, by a few positions that are tried
    #[arg(long, conflicts_with_all = ["sizes", "sides", "watch"])]
    pub dry_run: bool,
    /// Run it again whenever the job file or a part file changes, until interrupted
    #[arg(long)]
    pub watch: bool,
    #[command(flatten)]
    pub sizes: Sizes,
    /// Worker processes on this machine; 0 computes in this process
    #[arg(short, long, value_name = "N", env = "HORMA_WORKERS")]
    pub workers: Option<u32>,
    /// Threads in this process [default: all cores], or in each local worker [default: 1]
    #[arg(long, value_name = "N", env = "HORMA_THREADS", value_parser = clap::value_parser!(u16).range(1..))]
    pub threads: Option<u16>,
    /// Instruction set: scalar, avx2, avx512 or neon; the path does not depend on it [default: the
    /// best there is]
    #[arg(long, value_name = "SET", env = "HORMA_SIMD")]
    pub simd: Option<Simd>,
    #[command(flatten)]
    pub traces: Traces,
}

#[derive(Debug, Args)]
pub(crate) struct Verify {
    /// The path: the columns of a path.csv; the contact may be empty
    #[arg(value_name = "PATH.csv")]
    pub path: PathBuf,
    /// The job file (TOML): its part, cutter and step
    #[arg(value_name = "JOB")]
    pub job: PathBuf,
    /// Deepest gouge allowed, normal to the surface, mm [default: the job's chordal tolerance]; on
    /// straight moves the job's path tolerance comes on top, if it has one
    #[arg(long, value_name = "MM")]
    pub tolerance: Option<f64>,
    /// Distance between samples of the surface, mm [default: such that there are about 240000]
    #[arg(long, value_name = "MM")]
    pub spacing: Option<f64>,
    #[command(flatten)]
    pub made: Made,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Threads [default: all cores]
    #[arg(long, value_name = "N", env = "HORMA_THREADS", value_parser = clap::value_parser!(u16).range(1..))]
    pub threads: Option<u16>,
}

#[derive(Debug, Args)]
pub(crate) struct Machined {
    /// The path: the columns of a path.csv; the contact may be empty
    #[arg(value_name = "PATH.csv")]
    pub path: PathBuf,
    /// The job file (TOML): its part, discretization and cutter
    #[arg(value_name = "JOB")]
    pub job: PathBuf,
    /// Directory for machined.ply, machined.svg, report.json and report.html; created if missing
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Do not tell how the path compares with the designed surface beside the rays
    #[arg(long)]
    pub no_verify: bool,
    #[command(flatten)]
    pub also: Also,
    /// Distance between rays along the spindle, mm
    #[arg(long, value_name = "MM", default_value_t = 0.5)]
    pub spacing: f64,
    /// Rays around the spindle
    #[arg(long, value_name = "N", default_value_t = 720, value_parser = clap::value_parser!(u32).range(3..=36000))]
    pub columns: u32,
    #[command(flatten)]
    pub made: Made,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Threads [default: all cores]
    #[arg(long, value_name = "N", env = "HORMA_THREADS", value_parser = clap::value_parser!(u16).range(1..))]
    pub threads: Option<u16>,
}

#[derive(Debug, Args)]
pub(crate) struct View {
    /// The directory that was given to `horma run -o` or `horma machined -o`
    #[arg(value_name = "DIR")]
    pub directory: PathBuf,
    /// The browser's program [default: whatever the system opens pages with]
    #[arg(long, value_name = "PROGRAM", env = "BROWSER")]
    pub browser: Option<String>,
}

#[derive(Debug, Args)]
pub(crate) struct Submit {
    #[command(flatten)]
    pub job: Job,
    /// Directory for path.csv, the program (path.ngc), report.json, report.html, machined.svg and preview.png
    #[arg(short, long, value_name = "DIR", required_unless_present = "detach")]
    pub output: Option<PathBuf>,
    /// Print the job's number and do not wait: `horma status` and `horma fetch` take it, also after
    /// the master was started anew on the same store
    #[arg(short, long, conflicts_with = "output")]
    pub detach: bool,
    #[command(flatten)]
    pub remote: Remote,
    #[command(flatten)]
    pub traces: Traces,
}

/// A master elsewhere.
#[derive(Debug, Args)]
pub(crate) struct Remote {
    /// Where the master listens
    #[arg(long, value_name = "HOST:PORT", env = "HORMA_MASTER")]
    pub master: String,
    /// How long to look for the master when it has gone in the middle, seconds
    #[arg(long, value_name = "S", env = "HORMA_PATIENCE", default_value_t = 60)]
    pub patience: u64,
    #[command(flatten)]
    pub tls: Tls,
}

#[derive(Debug, Args)]
pub(crate) struct Status {
    /// The job's number [default: all jobs]
    #[arg(value_name = "ID")]
    pub id: Option<u64>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub remote: Remote,
}

#[derive(Debug, Args)]
pub(crate) struct Cancel {
    /// The job's number
    #[arg(value_name = "ID")]
    pub id: u64,
    #[command(flatten)]
    pub remote: Remote,
}

#[derive(Debug, Args)]
pub(crate) struct Fetch {
    /// The job's number
    #[arg(value_name = "ID")]
    pub id: u64,
    /// The job file (TOML): with it also the program, report.html, preview.png and the verification
    #[arg(value_name = "JOB")]
    pub file: Option<PathBuf>,
    /// Directory for the results
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Wait until the job is over
    #[arg(short, long)]
    pub wait: bool,
    /// Leave the result with the master
    #[arg(long)]
    pub keep: bool,
    #[command(flatten)]
    pub remote: Remote,
    #[command(flatten)]
    pub how: How,
}

/// What proves who is who. With it all traffic is encrypted, and both ends of every connection show a
/// certificate of the same authority.
#[derive(Debug, Args)]
pub(crate) struct Tls {
    /// Certificate of the authority whose certificates count, PEM
    #[arg(long, value_name = "FILE", env = "HORMA_TLS_CA", requires_all = ["tls_cert", "tls_key"], help_heading = "Encrypted, both ends authenticated")]
    pub tls_ca: Option<PathBuf>,
    /// This process's certificate, with those in between if there are any, PEM; its DNS names tell its
    /// roles
    #[arg(long, value_name = "FILE", env = "HORMA_TLS_CERT", requires_all = ["tls_ca", "tls_key"], help_heading = "Encrypted, both ends authenticated")]
    pub tls_cert: Option<PathBuf>,
    /// The certificate's private key, PEM
    #[arg(long, value_name = "FILE", env = "HORMA_TLS_KEY", requires_all = ["tls_ca", "tls_cert"], help_heading = "Encrypted, both ends authenticated")]
    pub tls_key: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(crate) struct Certs {
    /// Where to write; created if missing. What is there already is never written over
    #[arg(value_name = "DIR")]
    pub directory: PathBuf,
    /// Days until the certificates expire
    #[arg(long, value_name = "N", default_value_t = 365, value_parser = clap::value_parser!(u32).range(1..=36500))]
    pub days: u32,
    /// Host name or address for the certificates of master and workers to name as well, for other
    /// programs; horma itself goes by roles. May be repeated
    #[arg(long, value_name = "NAME")]
    pub name: Vec<String>,
}

#[derive(Debug, Args)]
pub(crate) struct Papers {
    /// What to reproduce [default: everything]
    #[arg(value_name = "NAME", value_parser = one_of(Experiment::ALL, Experiment::name))]
    pub names: Vec<Experiment>,
    /// Directory for papers.md, papers.html and papers/; created if missing. What else is in it stays
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Show nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
}

/// One of `all`, by its name.
fn one_of<T: Copy + Send + Sync + 'static, const N: usize>(
    all: [T; N],
    name: fn(T) -> &'static str,
) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(all.map(name)).try_map(move |typed| {
        let found = all.into_iter().find(|one| name(*one) == typed);
        found.ok_or("not one of them")
    })
}

fn unit(text: &str) -> Result<Unit, String> {
    Unit::named(text).ok_or_else(|| format!("known: {UNIT_NAMES}"))
}
