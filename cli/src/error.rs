//! Why a command ends, and its exit code.

use std::path::PathBuf;

/// Everything that ends a command early.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Error {
    #[error(transparent)]
    Formats(#[from] horma_formats::Error),
    #[error(transparent)]
    Core(#[from] horma_core::Error),
    #[error(transparent)]
    Papers(horma_papers::Error),
    #[error(transparent)]
    Master(#[from] horma_master::Error),
    #[error(transparent)]
    Worker(#[from] horma_worker::Error),
    #[error("cannot listen on {address}: {source}; choose another port, or 0 for any free one")]
    Bind {
        address: String,
        source: std::io::Error,
    },
    #[error(
        "{address} is reachable from other machines, and traffic is neither encrypted nor authenticated; give --tls-ca, --tls-cert and --tls-key (`horma certs` makes some), or add --insecure if you trust that network"
    )]
    Exposed { address: String },
    #[error("{flag} {}: {reason}", file.display())]
    Tls {
        flag: &'static str,
        file: PathBuf,
        reason: String,
    },
    #[error("{} is there already; give an empty directory, or move it away", file.display())]
    CertExists { file: PathBuf },
    #[error("{} cannot be written: {source}", file.display())]
    CertWrite {
        file: PathBuf,
        source: std::io::Error,
    },
    #[error("--name {name:?} cannot go into a certificate: {reason}")]
    CertName { name: String, reason: String },
    #[error("cannot make certificates: {0}")]
    Certs(#[from] rcgen::Error),
    #[error("the master at {address} and this command do not trust each other: {reason}")]
    Untrusted { address: String, reason: String },
    #[error("cannot start a worker from {}: {source}", program.display())]
    Spawn {
        program: PathBuf,
        source: std::io::Error,
    },
    #[error("every local worker ended before it registered, the last one with {status}")]
    WorkersEnded { status: String },
    #[error("no master answers at {address} ({reason}); is it running, and reachable from here")]
    NoMaster { address: String, reason: String },
    #[error("{address:?} is not an address of the form host:port")]
    Address { address: String },
    #[error("the master at {address} refused the job: {reason}")]
    Refused { address: String, reason: String },
    #[error("{reason} (said the master at {address})")]
    NoSuchJob { address: String, reason: String },
    #[error("the master at {address} cannot do the job: {reason}")]
    Impossible { address: String, reason: String },
    #[error("the master at {address} could not do the job: {reason}")]
    JobFailed { address: String, reason: String },
    #[error("the master at {address} sent a path that cannot be right: {reason}")]
    BadReply { address: String, reason: String },
    #[error(
        "{what} gave another path than {than}: position {position} of those measured differs; please report this with the job"
    )]
    Differs {
        what: String,
        than: &'static str,
        position: usize,
    },
    #[error("the path gouges the part by {depth:.4} mm, more than the tolerance of {tolerance} mm, at [{:.3}, {:.3}, {:.3}] of the part (position {position}: travel {x:.3}, angle {angle:.2}°); digitize facets (contact = \"facet\") to a finer tolerance, or skip the verification with --no-verify", point[0], point[1], point[2])]
    Gouge {
        depth: f64,
        tolerance: f64,
        point: [f64; 3],
        position: u64,
        x: f64,
        angle: f64,
    },
    #[error("a straight move gouges the part by {depth:.4} mm, more than the {limit} mm of chordal and path tolerance together, at [{:.3}, {:.3}, {:.3}] of the part (after position {position}: travel {x:.3}, angle {angle:.2}°); ask for more points_per_revolution or a finer path_tolerance, or skip the verification with --no-verify", point[0], point[1], point[2])]
    MotionGouge {
        depth: f64,
        limit: f64,
        point: [f64; 3],
        position: u64,
        x: f64,
        angle: f64,
    },
    #[error("the roughing leaves {left:.4} mm instead of {allowance} at [{:.3}, {:.3}, {:.3}] of the part; digitize facets (contact = \"facet\") to a finer tolerance, or skip the verification with --no-verify", point[0], point[1], point[2])]
    RoughTooDeep {
        left: f64,
        allowance: f64,
        point: [f64; 3],
    },
    #[error("a straight move of the roughing gouges the part by {depth:.4} mm at [{:.3}, {:.3}, {:.3}] of the part (travel {x:.3}, angle {angle:.2}°); give [roughing] more points_per_revolution, a path_tolerance or a larger allowance, or skip the verification with --no-verify", point[0], point[1], point[2])]
    RoughGouge {
        depth: f64,
        point: [f64; 3],
        x: f64,
        angle: f64,
    },
    #[error(
        "a job with [roughing] is two jobs for a master, and {command} knows of one; use `horma submit JOB -o DIR`, which waits for both"
    )]
    OneJob { command: &'static str },
    #[error(
        "without its fallback, or without delta_u and delta_v, the local search goes over the whole path in one process; use `horma run` without workers"
    )]
    OneProcess,
    #[error("cannot export traces: {0}")]
    Traces(String),
    #[error("cannot count what goes on: {0}")]
    Metrics(String),
    #[error("{failed} of {checks} checks failed")]
    Unfit {
        failed: usize,
        checks: usize,
        /// Whether what is wrong is here.
        here: bool,
    },
    #[error("{}: there is no such page; name a directory that `horma run JOB -o DIR` has written", path.display())]
    NothingToView { path: PathBuf },
    #[error("no browser opens {} ({reason}); name one with --browser, or open the page by hand", path.display())]
    NoBrowser { path: PathBuf, reason: String },
    #[error(
        "a size, a side or a path belongs to a job; name a job file, as in `horma measure job.toml`"
    )]
    MeasureNeedsJob,
    #[error("{name}: {source}; none of the others is written either")]
    OfSize { name: String, source: Box<Self> },
    #[error("cannot watch the job's files: {0}")]
    Watch(String),
    #[error("{}: the manual cannot be written: {source}", directory.display())]
    Manual {
        directory: PathBuf,
        source: std::io::Error,
    },
    #[error("cannot start threads: {0}")]
    Threads(String),
    #[error("interrupted")]
    Interrupted,
}

impl From<horma_papers::Error> for Error {
    fn from(error: horma_papers::Error) -> Self {
        match error {
            horma_papers::Error::Core(error) => Self::Core(error),
            horma_papers::Error::Formats(error) => Self::Formats(error),
            error @ horma_papers::Error::Format { .. } => Self::Papers(error),
        }
    }
}

pub(crate) type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// 2: the input is wrong; 3: the job cannot be done; 4: the cluster failed; 130: interrupted.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::OfSize { source, .. } => source.exit_code(),
            Self::Core(e) => of_core(e),
            Self::Formats(e) if e.is_impossible() => 3,
            Self::Papers(_)
            | Self::Impossible { .. }
            | Self::Differs { .. }
            | Self::Gouge { .. }
            | Self::MotionGouge { .. }
            | Self::RoughTooDeep { .. }
            | Self::RoughGouge { .. }
            | Self::NoBrowser { .. } => 3,
            Self::Master(horma_master::Error::Plan(e)) => of_core(e),
            Self::Master(
                horma_master::Error::StoreUnusable { .. } | horma_master::Error::StoreFormat { .. },
            ) => 2,
            Self::Formats(_)
            | Self::Bind { .. }
            | Self::Exposed { .. }
            | Self::Tls { .. }
            | Self::CertExists { .. }
            | Self::CertWrite { .. }
            | Self::CertName { .. }
            | Self::Untrusted { .. }
            | Self::Address { .. }
            | Self::Refused { .. }
            | Self::NoSuchJob { .. }
            | Self::OneProcess
            | Self::OneJob { .. }
            | Self::NothingToView { .. }
            | Self::MeasureNeedsJob
            | Self::Traces(_)
            | Self::Manual { .. }
            | Self::Unfit { here: true, .. }
            | Self::Worker(
                horma_worker::Error::Address { .. }
                | horma_worker::Error::Untrusted { .. }
                | horma_worker::Error::Refused { .. },
            ) => 2,
            Self::Master(_)
            | Self::Worker(_)
            | Self::Spawn { .. }
            | Self::WorkersEnded { .. }
            | Self::NoMaster { .. }
            | Self::JobFailed { .. }
            | Self::BadReply { .. }
            | Self::Certs(_)
            | Self::Metrics(_)
            | Self::Watch(_)
            | Self::Unfit { here: false, .. }
            | Self::Threads(_) => 4,
            Self::Interrupted => 130,
        }
    }
}

/// The mathematics refuses either what it was given or what it would take.
fn of_core(error: &horma_core::Error) -> u8 {
    if error.is_impossible() { 3 } else { 2 }
}
