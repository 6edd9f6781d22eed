//! The two servers: master and worker.

use std::net::SocketAddr;
use std::time::Duration;

use horma_core::Simd;
use horma_master::{Clients, Config, Limits};
use horma_proto::Role;
use horma_proto::clock::incarnation;
use horma_worker::Rendezvous;
use tokio::net::TcpListener;
use tokio::runtime::Runtime;
use tokio::sync::watch;
use tokio_util::sync::CancellationToken;

use crate::args::{Joining, Master, Worker};
use crate::cluster::bind;
use crate::error::{Error, Result};
use crate::http::{self, Watched};
use crate::{reach, say, system, tls};

/// How long threads may take to notice that the process ends.
pub(crate) const NOTICE: Duration = Duration::from_secs(2);

/// Serves as a master until it is told to stop.
pub(crate) fn master(args: &Master) -> Result<()> {
    let tls = tls::load_as(&args.tls, Role::Master)?;
    let trusted = tls.is_some() || args.insecure;
    let config = Config {
        connections: args.limits.max_connections as usize,
        heartbeat: Duration::from_secs(args.lease) / 5,
        lease: Duration::from_secs(args.lease),
        patience: Duration::from_secs(args.patience),
        regroup: Duration::from_secs(args.patience),
        memory: system::memory(),
        tls,
        workers_here: false,
        clients: Some(Clients {
            store: args.store.clone(),
            limits: Limits {
                part: args.limits.max_part.saturating_mul(1_000_000),
                queue: args.limits.max_jobs as usize,
                calls: args.limits.max_calls as usize,
                running: args.limits.max_running as usize,
                keep_bytes: args.limits.keep_mb.saturating_mul(1_000_000),
                keep: Duration::from_secs(args.limits.keep_hours.saturating_mul(3600)),
            },
        }),
    };
    let drain = Duration::from_secs(args.drain);
    serve(async {
        let (listener, bound) = listen(&args.bind, trusted).await?;
        let address = reach::of_master(args.advertise.as_deref(), bound);
        let rendezvous = args.rendezvous.as_deref();
        let _published = rendezvous
            .map(|f| reach::publish(f, &address))
            .transpose()?;
        let http = http::listen(args.http.as_deref(), Role::Master, trusted).await?;
        let tls = config.tls.clone();
        let shutdown = CancellationToken::new();
        let (master, window, serving) = horma_master::start(listener, config, shutdown.clone())?;
        if let Some(http) = http {
            let (watched, shutdown) = (Watched::Master(Box::new(window)), shutdown.clone());
            let tls = tls.clone();
            tokio::spawn(async move { http::serve(http, tls.as_ref(), watched, shutdown).await });
        }
        let mut serving = std::pin::pin!(serving);
        tokio::select! {
            served = &mut serving => return served.map_or(Ok(()), |s| Ok(s?)),
            () = system::interrupted() => {}
            never = tls::renew(&args.tls, Role::Master, tls.as_ref()) => match never {},
        }
        unless_again(async {
            master.drain(drain).await;
            shutdown.cancel();
            serving.await.map_or(Ok(()), |s| Ok(s?))
        })
        .await
    })
}

/// Serves as a worker until it is told to stop, or until its master has gone.
pub(crate) fn worker(args: Worker) -> Result<()> {
    let joining = &args.joining;
    let tls = tls::load_as(&joining.tls, Role::Worker)?;
    let trusted = tls.is_some() || joining.insecure;
    serve(async {
        let (listener, bound) = listen(&joining.bind, trusted).await?;
        let http = http::listen(args.http.as_deref(), Role::Worker, trusted).await?;
        let config = horma_worker::Config {
            master: rendezvous(joining),
            id: args.id.unwrap_or_else(|| reach::worker_name(variable)),
            incarnation: incarnation(),
            advertise: joining
                .advertise
                .as_ref()
                .map(|a| reach::advertised(a, bound)),
            tls,
            threads: args.threads.map_or_else(system::cores, usize::from),
            simd: args.simd.unwrap_or_else(Simd::best),
            patience: Duration::from_secs(args.patience),
        };
        let tls = config.tls.clone();
        let leave = CancellationToken::new();
        let (registered, watched) = watch::channel(false);
        if let Some(http) = http {
            let (watched, leave) = (Watched::Worker(watched), leave.clone());
            let tls = tls.clone();
            tokio::spawn(async move { http::serve(http, tls.as_ref(), watched, leave).await });
        }
        let running = horma_worker::run(listener, config, registered, leave.clone());
        let mut running = std::pin::pin!(running);
        tokio::select! {
            ran = &mut running => return Ok(ran?),
            () = system::interrupted() => leave.cancel(),
            never = tls::renew(&args.joining.tls, Role::Worker, tls.as_ref()) => match never {},
        }
        unless_again(async { Ok(running.await?) }).await
    })
}

/// Comes to an end in good order, or at once if that is asked for a second time.
async fn unless_again(ending: impl Future<Output = Result<()>>) -> Result<()> {
    tokio::select! {
        ended = ending => ended,
        () = system::interrupted() => Err(Error::Interrupted),
    }
}

/// How the master is found; one of the two is given.
pub(crate) fn rendezvous(joining: &Joining) -> Rendezvous {
    match (&joining.rendezvous, &joining.master) {
        (Some(file), _) => Rendezvous::File(file.clone()),
        (None, address) => Rendezvous::Address(address.clone().unwrap_or_default()),
    }
}

fn variable(name: &str) -> Option<String> {
    std::env::var(name).ok()
}

/// Serves to the end, and does not wait for threads that are still computing.
fn serve(server: impl Future<Output = Result<()>>) -> Result<()> {
    let runtime = runtime()?;
    let served = runtime.block_on(server);
    runtime.shutdown_timeout(NOTICE);
    served
}

/// Listens, and prints where: with port 0 nobody could know otherwise.
async fn listen(address: &str, trusted: bool) -> Result<(TcpListener, SocketAddr)> {
    let (listener, bound) = bind(address, trusted).await?;
    say(&format!("listening on {bound}"));
    Ok((listener, bound))
}

/// The runtime of everything that talks to others.
pub(crate) fn runtime() -> Result<Runtime> {
    Runtime::new().map_err(|e| Error::Threads(e.to_string()))
}
