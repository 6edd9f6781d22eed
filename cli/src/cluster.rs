//! A run on worker processes of this host: a master in this process, and workers started from this
//! very binary, each on a port of the system's choice. They join as remote ones would.

use std::process::Stdio;
use std::time::Duration;

use horma_core::{Job, Part};
use horma_master::{Config, Outcome, Progress};
use tokio::net::TcpListener;
use tokio::process::{Child, Command};
use tokio_util::sync::CancellationToken;

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
    workers: u32,
    threads: usize,
    progress: Progress,
) -> Result<Outcome> {
    let listener = bind("127.0.0.1:0").await?;
    let address = listener.local_addr().map_err(|source| Error::Bind {
        address: "127.0.0.1:0".to_owned(),
        source,
    })?;
    let config = Config {
        heartbeat: Duration::from_millis(500),
        lease: Duration::from_secs(10),
        patience: START,
        regroup: REGROUP,
        max_part: 0,
        memory: system::memory(),
    };
    let shutdown = CancellationToken::new();
    let _stopped = shutdown.clone().drop_guard();
    let (master, _serving) = horma_master::start(listener, config, shutdown);
    let mut children = (1..=workers)
        .map(|i| spawn(&format!("local-{i}"), &address.to_string(), threads))
        .collect::<Result<Vec<_>>>()?;

    let mut registered = master.workers();
    tokio::select! {
        // Whether they all came is for the run to say.
        _ = tokio::time::timeout(START, registered.wait_for(|&n| n >= workers as usize)) => {}
        error = first_end(&mut children) => return Err(error),
    }
    let outcome = master.run(part, job, workers as usize, progress).await?;
    for (_, child) in &mut children {
        // It holds nothing: there is no kinder way to end it, and it may have ended already.
        let _ = child.kill().await;
    }
    Ok(outcome)
}

fn spawn(id: &str, master: &str, threads: usize) -> Result<(String, Child)> {
    let failed = |program: std::path::PathBuf, source| Error::Spawn { program, source };
    let program = std::env::current_exe().map_err(|e| failed("horma".into(), e))?;
    let mut command = Command::new(&program);
    command
        .args(["worker", "--master", master, "--id", id])
        .args(["--bind", "127.0.0.1:0", "--patience", WORKER_PATIENCE])
        .args(["--threads", &threads.to_string()])
        .env_remove("HORMA_ADVERTISE")
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .kill_on_drop(true);
    // An interrupt typed at the terminal is for this process alone; it ends its workers.
    #[cfg(unix)]
    command.process_group(0);
    let child = command.spawn().map_err(|e| failed(program, e))?;
    Ok((id.to_owned(), child))
}

/// Waits for the first worker that ends.
async fn first_end(children: &mut [(String, Child)]) -> Error {
    let ends = children.iter_mut().map(|(id, child)| {
        Box::pin(async move {
            match child.wait().await {
                Ok(status) => Error::WorkerEnded {
                    id: id.clone(),
                    status,
                },
                Err(source) => Error::Spawn {
                    program: id.as_str().into(),
                    source,
                },
            }
        })
    });
    let mut ends: Vec<_> = ends.collect();
    std::future::poll_fn(|context| {
        let ended = ends
            .iter_mut()
            .find_map(|end| match end.as_mut().poll(context) {
                std::task::Poll::Ready(error) => Some(error),
                std::task::Poll::Pending => None,
            });
        ended.map_or(std::task::Poll::Pending, std::task::Poll::Ready)
    })
    .await
}

/// Listens on an address.
pub(crate) async fn bind(address: &str) -> Result<TcpListener> {
    TcpListener::bind(address)
        .await
        .map_err(|source| Error::Bind {
            address: address.to_owned(),
            source,
        })
}
