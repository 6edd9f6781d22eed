//! A run on worker processes of this host: a master in this process, and workers started from this
//! very binary, each on a port of the system's choice. They join as remote ones would.

use std::net::SocketAddr;
use std::process::Stdio;
use std::time::Duration;

use horma_core::{Job, Part, Sharing, Simd};
use horma_master::{Config, Master, Outcome, Progress};
use tokio::net::TcpListener;
use tokio::process::{Child, Command};
use tokio::sync::watch;
use tokio::task::JoinSet;
use tokio_util::sync::{CancellationToken, DropGuard};

use crate::error::{Error, Result};
use crate::system;

/// Local workers start in a fraction of this.
const START: Duration = Duration::from_secs(30);

/// A local worker that is gone does not come back; one whose connection broke does, at once.
const REGROUP: Duration = Duration::from_secs(3);

/// Without a master, a local worker is an orphan.
const WORKER_PATIENCE: &str = "5";

/// Digitizes a part on `workers` processes of `threads` threads each. Dropping the future stops
/// them.
pub(crate) async fn run(
    part: Part,
    job: Job,
    sharing: Sharing,
    workers: u32,
    threads: usize,
    simd: Simd,
    progress: Progress,
) -> Result<Outcome> {
    let local = start(workers, threads, simd).await?;
    Ok(local.master.run(part, job, sharing, 1, progress).await?)
}

/// A master in this process and its worker processes, until it is dropped.
pub(crate) struct Local {
    pub master: Master,
    /// Process numbers of the workers.
    pub workers: Vec<u32>,
    _children: JoinSet<String>,
    _stopped: DropGuard,
}

/// Starts a master, and `workers` processes of `threads` threads each that register with it.
pub(crate) async fn start(workers: u32, threads: usize, simd: Simd) -> Result<Local> {
    let (listener, address) = bind("127.0.0.1:0", false).await?;
    let config = Config {
        connections: 1000,
        heartbeat: Duration::from_millis(500),
        lease: Duration::from_secs(10),
        patience: START,
        regroup: REGROUP,
        memory: system::memory(),
        // Master and workers talk within this machine.
        tls: None,
        workers_here: true,
        clients: None,
    };
    let shutdown = CancellationToken::new();
    let stopped = shutdown.clone().drop_guard();
    let (master, _, _serving) = horma_master::start(listener, config, shutdown)?;
    // Each child belongs to a task that waits for its end; dropping the set kills them all.
    let mut children = JoinSet::new();
    let mut numbers = Vec::new();
    for i in 1..=workers {
        let mut child = spawn(&format!("local-{i}"), &address.to_string(), threads, simd)?;
        numbers.extend(child.id());
        children.spawn(async move {
            match child.wait().await {
                Ok(status) => status.to_string(),
                Err(error) => error.to_string(),
            }
        });
    }
    everybody_there(&mut children, master.workers()).await?;
    Ok(Local {
        master,
        workers: numbers,
        _children: children,
        _stopped: stopped,
    })
}

/// Waits until every child that lives has registered.
async fn everybody_there(
    children: &mut JoinSet<String>,
    mut registered: watch::Receiver<usize>,
) -> Result<()> {
    let deadline = tokio::time::Instant::now() + START;
    loop {
        let living = children.len();
        tokio::select! {
            _ = registered.wait_for(|&n| n >= living) => return Ok(()),
            // Whether anybody came in time is for the run to say.
            () = tokio::time::sleep_until(deadline) => return Ok(()),
            Some(ended) = children.join_next() => if children.is_empty() {
                let status = ended.unwrap_or_else(|e| e.to_string());
                return Err(Error::WorkersEnded { status });
            },
        }
    }
}

fn spawn(id: &str, master: &str, threads: usize, simd: Simd) -> Result<Child> {
    let failed = |program: std::path::PathBuf, source| Error::Spawn { program, source };
    let program = std::env::current_exe().map_err(|e| failed("horma".into(), e))?;
    let mut command = Command::new(&program);
    command
        .args(["worker", "--master", master, "--id", id])
        .args(["--bind", "127.0.0.1:0", "--patience", WORKER_PATIENCE])
        .args(["--threads", &threads.to_string()])
        .args(["--simd", &simd.to_string()])
        .env_remove("HORMA_ADVERTISE")
        .env_remove("HORMA_HTTP")
        .env_remove("HORMA_RENDEZVOUS")
        .env_remove("HORMA_TLS_CA")
        .env_remove("HORMA_TLS_CERT")
        .env_remove("HORMA_TLS_KEY")
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .kill_on_drop(true);
    // An interrupt typed at the terminal is for this process alone; it ends its workers.
    #[cfg(unix)]
    command.process_group(0);
    command.spawn().map_err(|e| failed(program, e))
}

/// Listens on an address; beyond this machine only if what comes from there can be trusted.
pub(crate) async fn bind(address: &str, trusted: bool) -> Result<(TcpListener, SocketAddr)> {
    let failed = |source| Error::Bind {
        address: address.to_owned(),
        source,
    };
    let listener = TcpListener::bind(address).await.map_err(failed)?;
    let bound = listener.local_addr().map_err(failed)?;
    if !bound.ip().is_loopback() && !trusted {
        return Err(Error::Exposed {
            address: bound.to_string(),
        });
    }
    Ok((listener, bound))
}
