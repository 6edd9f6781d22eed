//! What can be typed.

mod last;

use std::fmt;
use std::path::PathBuf;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{ArgGroup, Args, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;
use horma_core::{Distribution, Simd};
use horma_formats::also;
use horma_formats::job::Overrides;
use horma_formats::part::{UNIT_NAMES, Unit};
use horma_papers::Experiment;

pub(crate) use self::last::{Made, Measure, Sizes};
use crate::progress::Audience;
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

/// What is written beside the rest.
#[derive(Debug, Args)]
pub(crate) struct Also {
    /// Files to write beside the rest, for other programs: the path as path.parquet, path.npy; the surface that it
    /// leaves as machined.ply (with its errors in colour), machined.stl; the designed one as designed.ply (with
    /// the same colours), designed.stl; part, path and machined surface for viewers as scene.glb
    #[arg(
        long,
        value_name = "FILE,...",
        env = "HORMA_ALSO",
        value_delimiter = ',',
        hide_possible_values = true,
        value_parser = PossibleValuesParser::new(also::Also::ALL.map(also::Also::name)),
        help_heading = "Instead of the job file's"
    )]
    pub also: Vec<String>,
}

impl Also {
    /// What takes the place of the job file's list, if anything is asked for.
    pub fn overrides(&self) -> Option<Vec<String>> {
        Some(self.also.clone()).filter(|all| !all.is_empty())
    }
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

/// A job, and what it says differently this time.
#[derive(Debug, Args)]
pub(crate) struct Job {
    /// The job file (TOML)
    #[arg(value_name = "JOB")]
    pub file: PathBuf,
    #[command(flatten)]
    pub how: How,
}

/// How a job is done differently from what its file says.
#[derive(Debug, Args)]
pub(crate) struct How {
    /// Show nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
    /// Tell other programs what happens: JSON on standard output, a line for each event, which names it
    /// (phase, progress, phase_done, warning, note, done, failed, ...)
    #[arg(long, conflicts_with = "quiet")]
    pub json: bool,
    /// Do not hold the path against the designed surface, nor make the machined one; a gouge deeper than the
    /// tolerance then goes unnoticed
    #[arg(long)]
    pub no_verify: bool,
    #[command(flatten)]
    pub also: Also,
    /// What the cutter touches: facet or point
    #[arg(
        long,
        env = "HORMA_CONTACT",
        help_heading = "Instead of the job file's"
    )]
    pub contact: Option<String>,
    /// How the touch is searched: exact, brute or local
    #[arg(long, env = "HORMA_METHOD", help_heading = "Instead of the job file's")]
    pub method: Option<String>,
    /// Rows around the last winner that the local search looks at: fewer than this away
    #[arg(
        long,
        value_name = "ROWS",
        env = "HORMA_DELTA_U",
        help_heading = "Instead of the job file's"
    )]
    pub delta_u: Option<u32>,
    /// Columns around the last winner that the local search looks at
    #[arg(
        long,
        value_name = "COLUMNS",
        env = "HORMA_DELTA_V",
        help_heading = "Instead of the job file's"
    )]
    pub delta_v: Option<u32>,
    /// Leave the local search as the papers have it: where the window has lost the winner the path is
    /// wrong; the report says where and by how much
    #[arg(long, help_heading = "Instead of the job file's")]
    pub no_fallback: bool,
    /// Chordal tolerance of surfaces, mm
    #[arg(
        long,
        value_name = "MM",
        env = "HORMA_TOLERANCE",
        help_heading = "Instead of the job file's"
    )]
    pub tolerance: Option<f64>,
    /// Travel per revolution, mm
    #[arg(
        long,
        value_name = "MM",
        env = "HORMA_STEP",
        help_heading = "Instead of the job file's"
    )]
    pub step: Option<f64>,
    /// Positions per revolution
    #[arg(
        long,
        value_name = "N",
        env = "HORMA_POINTS_PER_REVOLUTION",
        help_heading = "Instead of the job file's"
    )]
    pub points_per_revolution: Option<u32>,
    /// First travel, mm
    #[arg(
        long,
        value_name = "MM",
        env = "HORMA_FROM",
        allow_negative_numbers = true,
        help_heading = "Instead of the job file's"
    )]
    pub from: Option<f64>,
    /// Last travel, mm
    #[arg(
        long,
        value_name = "MM",
        env = "HORMA_TO",
        allow_negative_numbers = true,
        help_heading = "Instead of the job file's"
    )]
    pub to: Option<f64>,
    /// How far a straight move between positions may stray along the attack axis before positions are
    /// inserted, mm
    #[arg(
        long,
        value_name = "MM",
        env = "HORMA_PATH_TOLERANCE",
        help_heading = "Instead of the job file's"
    )]
    pub path_tolerance: Option<f64>,
    /// Whose G-code the program is: linuxcnc, fanuc, siemens, mach, grblhal or beckhoff
    #[arg(
        long,
        env = "HORMA_DIALECT",
        help_heading = "Instead of the job file's"
    )]
    pub dialect: Option<String>,
    /// Most moves in one file of the program; what is more goes on in the next
    #[arg(
        long,
        value_name = "MOVES",
        env = "HORMA_SPLIT",
        help_heading = "Instead of the job file's"
    )]
    pub split: Option<u32>,
    /// Feed at the contact, mm/min
    #[arg(
        long,
        value_name = "MM/MIN",
        env = "HORMA_FEED",
        help_heading = "Instead of the job file's"
    )]
    pub feed: Option<f64>,
    /// Retract above the highest position, mm
    #[arg(
        long,
        value_name = "MM",
        env = "HORMA_CLEARANCE",
        help_heading = "Instead of the job file's"
    )]
    pub clearance: Option<f64>,
    /// How workers come by the part: overlap (the master sends each what it needs), halo (each row is
    /// sent once, workers fetch the rest from each other) or surface (workers make the points)
    #[arg(
        long,
        env = "HORMA_DISTRIBUTION",
        help_heading = "Instead of the job file's"
    )]
    pub distribution: Option<String>,
    /// Into how many extents the job is cut for each worker. More of them are spread more evenly over
    /// unequal workers, and each needs rows of its neighbours again [default: 1]
    #[arg(
        long,
        value_name = "N",
        env = "HORMA_EXTENTS_PER_WORKER",
        help_heading = "Instead of the job file's"
    )]
    pub extents_per_worker: Option<u32>,
}

impl How {
    /// To whom it is told how the job goes on.
    pub fn audience(&self) -> Audience {
        if self.json {
            Audience::Programs
        } else {
            Audience::unless(self.quiet)
        }
    }

    /// What goes over the job file.
    pub fn overrides(&self, workers: Option<u32>) -> Overrides {
        Overrides {
            workers,
            distribution: self.distribution.clone(),
            extents_per_worker: self.extents_per_worker,
            contact: self.contact.clone(),
            method: self.method.clone(),
            delta_u: self.delta_u,
            delta_v: self.delta_v,
            fallback: self.no_fallback.then_some(false),
            tolerance: self.tolerance,
            step: self.step,
            points_per_revolution: self.points_per_revolution,
            from: self.from,
            to: self.to,
            path_tolerance: self.path_tolerance,
            dialect: self.dialect.clone(),
            split: self.split,
            feed: self.feed,
            clearance: self.clearance,
            also: self.also.overrides(),
            size: None,
            side: None,
        }
    }
}

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

Of a job, its part, cutter and motion are taken; the grid, the contact and the method are what is
varied.")]
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
    /// Travel per revolution, mm [default: the job's]
    #[arg(long, value_name = "MM")]
    pub step: Option<f64>,
    /// Positions per revolution [default: the job's]
    #[arg(long, value_name = "N")]
    pub points_per_revolution: Option<u32>,
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

fn unit(text: &str) -> Result<Unit, String> {
    Unit::named(text).ok_or_else(|| format!("known: {UNIT_NAMES}"))
}

fn positive(text: &str) -> Result<f64, String> {
    let number = text.parse().map_err(|_| "not a number".to_owned())?;
    if number > 0.0 && f64::is_finite(number) {
        Ok(number)
    } else {
        Err(format!("{number} is not above 0"))
    }
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
    /// Show no progress, only the table
    #[arg(short, long)]
    pub quiet: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Master {
    /// Where to listen; port 0 takes any free one. The address is printed once it is bound
    #[arg(
        long,
        value_name = "HOST:PORT",
        env = "HORMA_BIND",
        default_value = "127.0.0.1:7171"
    )]
    pub bind: String,
    /// Where to serve metrics, health and a status page over HTTP, for whoever may look: a
    /// port of this machine, or HOST:PORT; port 0 takes any free one. Beyond this machine the rule of
    /// --bind holds: certificates, or --insecure [default: nowhere]
    #[arg(long, value_name = "[HOST:]PORT", env = "HORMA_HTTP")]
    pub http: Option<String>,
    /// Address that the rendezvous file tells; without a port, the port that is bound [default: the
    /// bound address, or this host's name if that is every interface]
    #[arg(long, value_name = "HOST[:PORT]", env = "HORMA_ADVERTISE")]
    pub advertise: Option<String>,
    /// File to write that address into, whole, once it is bound; taken away in the end. Workers find
    /// the master by it, and again when it comes back elsewhere
    #[arg(long, value_name = "FILE", env = "HORMA_RENDEZVOUS")]
    pub rendezvous: Option<PathBuf>,
    /// Allow a bind beyond this machine although traffic is neither encrypted nor authenticated
    #[arg(long, conflicts_with = "tls_ca")]
    pub insecure: bool,
    #[command(flatten)]
    pub tls: Tls,
    /// After how long a silence a worker counts as lost, seconds
    #[arg(long, value_name = "S", env = "HORMA_LEASE", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..))]
    pub lease: u64,
    /// How long a job waits for workers when there is none, seconds
    #[arg(long, value_name = "S", env = "HORMA_PATIENCE", default_value_t = 60)]
    pub patience: u64,
    /// Directory of what must survive this process: queue, finished extents and results. A master that
    /// is started on it again goes on where the last one was killed [default: all in memory, and lost]
    #[arg(long, value_name = "DIR", env = "HORMA_STORE")]
    pub store: Option<PathBuf>,
    /// How long it waits, when it is told to stop, for what workers are at; what is not done by then is
    /// left to the store. A second signal ends it at once
    #[arg(long, value_name = "S", env = "HORMA_DRAIN", default_value_t = 5)]
    pub drain: u64,
    #[command(flatten)]
    pub traces: Traces,
    #[command(flatten)]
    pub limits: Limits,
}

/// How much a master takes upon itself.
#[derive(Debug, Args)]
#[command(next_help_heading = "Limits, beyond which it refuses and says so")]
pub(crate) struct Limits {
    /// Largest part that a client may send, MB
    #[arg(
        long,
        value_name = "MB",
        env = "HORMA_MAX_PART",
        default_value_t = 1024
    )]
    pub max_part: u64,
    /// Jobs that wait or are under way
    #[arg(long, value_name = "N", env = "HORMA_MAX_JOBS", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..))]
    pub max_jobs: u32,
    /// Connections of workers and clients at once; beyond that they wait until others are closed
    #[arg(long, value_name = "N", env = "HORMA_MAX_CONNECTIONS", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..))]
    pub max_connections: u32,
    /// Calls of clients that are open at once; who waits for a job has one open
    #[arg(long, value_name = "N", env = "HORMA_MAX_CALLS", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..))]
    pub max_calls: u32,
    /// Jobs under way at once; fewer if they do not fit into memory together
    #[arg(long, value_name = "N", env = "HORMA_MAX_RUNNING", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..))]
    pub max_running: u32,
    /// Results that are kept until they are fetched, MB; beyond that the oldest are dropped
    #[arg(long, value_name = "MB", env = "HORMA_KEEP_MB", default_value_t = 1024)]
    pub keep_mb: u64,
    /// How long they are kept, hours
    #[arg(long, value_name = "H", env = "HORMA_KEEP_HOURS", default_value_t = 24)]
    pub keep_hours: u64,
}

#[derive(Debug, Args)]
#[command(group(ArgGroup::new("way").args(["master", "rendezvous"]).required(true)))]
pub(crate) struct Worker {
    #[command(flatten)]
    pub joining: Joining,
    /// Where to serve metrics and health over HTTP, for whoever may look: a
    /// port of this machine, or HOST:PORT; port 0 takes any free one. Beyond this machine the rule of
    /// --bind holds: certificates, or --insecure [default: nowhere]
    #[arg(long, value_name = "[HOST:]PORT", env = "HORMA_HTTP")]
    pub http: Option<String>,
    /// Name of this worker, the same after a restart [default: its place in the job under Slurm, else
    /// host name and process number]
    #[arg(long, env = "HORMA_WORKER_ID")]
    pub id: Option<String>,
    /// Threads to digitize with [default: all cores]
    #[arg(long, value_name = "N", env = "HORMA_THREADS", value_parser = clap::value_parser!(u16).range(1..))]
    pub threads: Option<u16>,
    /// Instruction set: scalar, avx2, avx512 or neon; the path does not depend on it [default: the
    /// best there is]
    #[arg(long, value_name = "SET", env = "HORMA_SIMD")]
    pub simd: Option<Simd>,
    /// How long to look for a master that is not there, or not there any more, seconds. After that the
    /// worker ends: with exit code 0 if nothing was going on, else with 4. To be left by
    /// a master is the end of the work and exit code 0; never to find one is 4
    #[arg(long, value_name = "S", env = "HORMA_PATIENCE", default_value_t = 60)]
    pub patience: u64,
    #[command(flatten)]
    pub traces: Traces,
}

/// Where a worker listens and how it finds its master.
#[derive(Debug, Args)]
pub(crate) struct Joining {
    /// Where the master listens
    #[arg(
        long,
        value_name = "HOST:PORT",
        env = "HORMA_MASTER",
        conflicts_with = "rendezvous"
    )]
    pub master: Option<String>,
    /// File into which the master writes its address; waited for, and read again whenever the master
    /// does not answer
    #[arg(long, value_name = "FILE", env = "HORMA_RENDEZVOUS")]
    pub rendezvous: Option<PathBuf>,
    /// Where to listen; port 0 takes any free one
    #[arg(
        long,
        value_name = "HOST:PORT",
        env = "HORMA_BIND",
        default_value = "127.0.0.1:0"
    )]
    pub bind: String,
    /// Address at which others reach this worker; without a port, the port that is bound [default: the
    /// one that leads to the master]
    #[arg(long, value_name = "HOST[:PORT]", env = "HORMA_ADVERTISE")]
    pub advertise: Option<String>,
    /// Allow a bind beyond this machine although traffic is neither encrypted nor authenticated
    #[arg(long, conflicts_with = "tls_ca")]
    pub insecure: bool,
    #[command(flatten)]
    pub tls: Tls,
}
