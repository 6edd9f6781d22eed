//! A run on worker processes of this host: a master in this process, and workers started from this
//! very binary, each on a port of the system's choice. They join as remote ones would.

use std::net::SocketAddr;
use std::process::Stdio;
use std::sync::Arc;
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

/// How long workers may take to come to an end in good order.
const LEAVE: Duration = Duration::from_secs(5);

/// Without a master, a local worker is an orphan.
const WORKER_PATIENCE: &str = "5";

/// Worker processes to start.
pub(crate) struct Workers<'a> {
    pub number: u32,
    /// Of each.
    pub threads: usize,
    pub simd: Simd,
    /// Where they send their spans, if that is wanted.
    pub otlp: Option<&'a str>,
}

/// Digitizes a part on worker processes, for one job after the other. Dropping the future stops them.
pub(crate) async fn run(
    part: Arc<Part>,
    jobs: Vec<Job>,
    sharing: Sharing,
    workers: Workers<'_>,
    progress: Progress,
) -> Result<Vec<Outcome>> {
    let local = start(&workers).await?;
    let outcomes = local.run_all(part, jobs, sharing, &progress).await;
    if workers.otlp.is_some() {
        local.end().await;
    }
    outcomes
}

/// A master in this process and its worker processes, until it is dropped.
pub(crate) struct Local {
    pub master: Master,
    /// Process numbers of the workers.
    pub workers: Vec<u32>,
    children: JoinSet<String>,
    leave: CancellationToken,
    _stopped: DropGuard,
}

impl Local {
    /// Digitizes a part for one job after the other.
    pub async fn run_all(
        &self,
        part: Arc<Part>,
        jobs: Vec<Job>,
        sharing: Sharing,
        progress: &Progress,
    ) -> Result<Vec<Outcome>> {
        let mut outcomes = Vec::with_capacity(jobs.len());
        for job in jobs {
            let (part, progress) = (part.clone(), progress.clone());
            outcomes.push(self.master.run(part, job, sharing, 1, progress).await?);
        }
        Ok(outcomes)
    }

    /// Has the workers come to an end in good order: what they hold is not the master's alone when they
    /// have spans to send.
    async fn end(mut self) {
        self.leave.cancel();
        let all = async { while self.children.join_next().await.is_some() {} };
        // Whoever takes longer is killed.
        let _ = tokio::time::timeout(LEAVE, all).await;
    }
}

/// Starts a master, and workers that register with it.
pub(crate) async fn start(workers: &Workers<'_>) -> Result<Local> {
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
    let leave = CancellationToken::new();
    for i in 1..=workers.number {
        let mut child = spawn(&format!("local-{i}"), &address.to_string(), workers)?;
        numbers.extend(child.id());
        let leave = leave.clone();
        children.spawn(async move {
            let ended = tokio::select! {
                ended = child.wait() => ended,
                () = leave.cancelled() => {
                    system::ask_to_stop(&mut child);
                    child.wait().await
                }
            };
            match ended {
                Ok(status) => status.to_string(),
                Err(error) => error.to_string(),
            }
        });
    }
    everybody_there(&mut children, master.workers()).await?;
    Ok(Local {
        master,
        workers: numbers,
        children,
        leave,
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

fn spawn(id: &str, master: &str, workers: &Workers<'_>) -> Result<Child> {
    let failed = |program: std::path::PathBuf, source| Error::Spawn { program, source };
    let program = std::env::current_exe().map_err(|e| failed("horma".into(), e))?;
    let mut command = Command::new(&program);
    command
        .args(["worker", "--master", master, "--id", id])
        .args(["--bind", "127.0.0.1:0", "--patience", WORKER_PATIENCE])
        .args(["--threads", &workers.threads.to_string()])
        .args(["--simd", &workers.simd.to_string()])
        .env_remove("HORMA_ADVERTISE")
        .env_remove("HORMA_HTTP")
        .env_remove("HORMA_OTLP")
        .env_remove("HORMA_RENDEZVOUS")
        .env_remove("HORMA_TLS_CA")
        .env_remove("HORMA_TLS_CERT")
        .env_remove("HORMA_TLS_KEY")
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .kill_on_drop(true);
    if let Some(collector) = workers.otlp {
        command.args(["--otlp", collector]);
    }
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
