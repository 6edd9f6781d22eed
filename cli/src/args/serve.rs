//! What can be typed of masters and workers.

use std::path::PathBuf;

use clap::{ArgGroup, Args};
use horma_core::Simd;

use super::{Tls, Traces};

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
