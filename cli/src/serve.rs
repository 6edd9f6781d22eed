//! The two servers: master and worker.

use std::time::Duration;

use horma_core::Simd;
use horma_master::Config;
use horma_proto::Role;
use tokio::net::TcpListener;
use tokio::runtime::Runtime;
use tokio::sync::watch;
use tokio_util::sync::CancellationToken;

use crate::args::{Master, Worker};
use crate::cluster::bind;
use crate::error::{Error, Result};
use crate::http::{self, Watched};
use crate::{say, system, tls};

/// How long threads may take to notice that the process ends.
pub(crate) const NOTICE: Duration = Duration::from_secs(2);

/// Serves as a master until it is told to stop.
pub(crate) fn master(args: &Master) -> Result<()> {
    let tls = tls::load_as(&args.tls, Role::Master)?;
    let trusted = tls.is_some() || args.insecure;
    let config = Config {
        heartbeat: Duration::from_secs(args.lease) / 5,
        lease: Duration::from_secs(args.lease),
        patience: Duration::from_secs(args.patience),
        regroup: Duration::from_secs(args.patience),
        max_part: args.max_part.saturating_mul(1_000_000),
        memory: system::memory(),
        tls,
        workers_here: false,
    };
    serve(async {
        let listener = listen(&args.bind, trusted).await?;
        let http = http::listen(args.http.as_deref(), Role::Master, trusted).await?;
        let tls = config.tls.clone();
        let shutdown = CancellationToken::new();
        let (master, serving) = horma_master::start(listener, config, shutdown.clone());
        if let Some(http) = http {
            let (watched, shutdown) = (Watched::Master(master), shutdown.clone());
            tokio::spawn(async move { http::serve(http, tls.as_ref(), watched, shutdown).await });
        }
        let mut serving = std::pin::pin!(serving);
        tokio::select! {
            served = &mut serving => return served.map_or(Ok(()), |s| Ok(s?)),
            () = system::interrupted() => shutdown.cancel(),
        }
        serving.await.map_or(Ok(()), |s| Ok(s?))
    })
}

/// Serves as a worker until it is told to stop, or until its master has gone.
pub(crate) fn worker(args: Worker) -> Result<()> {
    let tls = tls::load_as(&args.tls, Role::Worker)?;
    let trusted = tls.is_some() || args.insecure;
    let config = horma_worker::Config {
        master: args.master,
        id: args.id.unwrap_or_else(system::process_name),
        incarnation: system::incarnation(),
        advertise: args.advertise,
        tls,
        threads: args.threads.map_or_else(system::cores, usize::from),
        simd: args.simd.unwrap_or_else(Simd::best),
        patience: Duration::from_secs(args.patience),
    };
    serve(async {
        let listener = listen(&args.bind, trusted).await?;
        let http = http::listen(args.http.as_deref(), Role::Worker, trusted).await?;
        let tls = config.tls.clone();
        let shutdown = CancellationToken::new();
        let (registered, watched) = watch::channel(false);
        if let Some(http) = http {
            let (watched, shutdown) = (Watched::Worker(watched), shutdown.clone());
            tokio::spawn(async move { http::serve(http, tls.as_ref(), watched, shutdown).await });
        }
        let stopping = shutdown.clone();
        tokio::spawn(async move {
            system::interrupted().await;
            stopping.cancel();
        });
        Ok(horma_worker::run(listener, config, registered, shutdown).await?)
    })
}

/// Serves to the end, and does not wait for threads that are still computing.
fn serve(server: impl Future<Output = Result<()>>) -> Result<()> {
    let runtime = runtime()?;
    let served = runtime.block_on(server);
    runtime.shutdown_timeout(NOTICE);
    served
}

/// Listens, and prints where: with port 0 nobody could know otherwise.
async fn listen(address: &str, trusted: bool) -> Result<TcpListener> {
    let (listener, bound) = bind(address, trusted).await?;
    say(&format!("listening on {bound}"));
    Ok(listener)
}

/// The runtime of everything that talks to others.
pub(crate) fn runtime() -> Result<Runtime> {
    Runtime::new().map_err(|e| Error::Threads(e.to_string()))
}
