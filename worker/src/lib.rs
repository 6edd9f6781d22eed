//! One digitizing worker: it makes itself known to the master, and digitizes what it is sent.
//!
//! `work` digitizes a task, whatever its rows come from; `receive` takes in what is sent, `store` holds
//! rows for the length of a job, `halo` gets those that other workers hold. What a worker holds, the
//! master has too, so it may be killed at any time. It never decides what to compute, opens no
//! file but the one that tells where the master is, and never talks to a client.

mod error;

mod membership;
mod rendezvous;
mod service;

mod receive;

mod halo;
mod store;

mod work;

#[cfg(any(test, fuzzing))]
pub mod decoders;

use std::sync::Arc;
use std::time::Duration;

use horma_core::Simd;
use horma_proto::wire::worker_server::WorkerServer;
use horma_proto::{Guard, MAX_MESSAGE, Tls, transport};
use tokio::net::TcpListener;
use tokio::sync::watch;
use tokio_util::sync::CancellationToken;
use tracing::info;

pub use error::{Error, Result};
pub use rendezvous::{Rendezvous, reachable};

/// What a worker has to know.
#[derive(Debug, Clone)]
pub struct Config {
    /// How to find the master.
    pub master: Rendezvous,
    /// Name of this worker, the same after a restart.
    pub id: String,
    /// A number that differs from one start to the next.
    pub incarnation: u64,
    /// `host:port` at which the master reaches this worker; by default the listener's port at the
    /// address that the way to the master leaves from.
    pub advertise: Option<String>,
    /// What proves who is who; without it traffic is plain and anybody may call.
    pub tls: Option<Tls>,
    /// Threads to digitize with.
    pub threads: usize,
    /// Instruction set to digitize with.
    pub simd: Simd,
    /// How long to look for the master, at first and again when it has gone.
    pub patience: Duration,
}

/// Connections at once, of the master and of other workers; more wait until others are closed.
const CONNECTIONS: usize = 1000;

/// How long open tasks may take to notice a shutdown.
const DRAIN: Duration = Duration::from_secs(5);

/// Serves on `listener` until it is told to leave, or until the master has been gone for too long. What
/// it is at when it leaves is given back: what has come of it is the master's already. Whether it is a
/// member of the master is told to `registered` as it changes.
///
/// # Errors
/// [`Error::NoMaster`] if the master never answered, [`Error::Refused`] if it did not want this
/// worker, and errors of the operating system.
pub async fn run(
    listener: TcpListener,
    config: Config,
    registered: watch::Sender<bool>,
    leave: CancellationToken,
) -> Result<()> {
    let shutdown = CancellationToken::new();
    let bound = listener.local_addr().map_err(Error::Listener)?;
    info!(worker = config.id, %bound, "listening");
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(config.threads)
        .build()
        .map_err(Error::Threads)?;
    let store = Arc::new(store::Store::default());
    let means = work::Means {
        pool: Arc::new(pool),
        simd: config.simd,
        store: store.clone(),
        tls: config.tls.clone(),
        shutdown: shutdown.clone(),
    };
    let guard = Guard::of(config.tls.as_ref());
    let service = WorkerServer::new(service::Service { means, guard })
        .max_decoding_message_size(MAX_MESSAGE)
        .max_encoding_message_size(MAX_MESSAGE);
    let (tls, stopped) = (config.tls.clone(), shutdown.clone().cancelled_owned());
    let stopping = leave.clone().cancelled_owned();
    let serving = tokio::spawn(async move {
        transport::serve(
            service,
            listener,
            CONNECTIONS,
            tls.as_ref(),
            stopping,
            stopped,
        )
        .await
    });
    let outcome = membership::keep(&config, bound, &store, &registered, &leave).await;
    // Membership is what a worker lives for: without it there is nobody to serve.
    shutdown.cancel();
    // A task that does not notice is abandoned: the master gives its extent to another.
    if let Ok(Ok(served)) = tokio::time::timeout(DRAIN, serving).await {
        served.map_err(Error::Serve)?;
    }
    outcome
}
