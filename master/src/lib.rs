//! The master: it splits a job into extents, schedules them on workers, and stitches the path.
//!
//! `service` is what workers and clients see. `desk` has the jobs of clients, with what must not be
//! forgotten in the `store`; `run` takes one job from its plan to its path. `state` decides and touches
//! nothing; `driver` owns it, feeds it events and carries out its commands; `place` brings rows to the
//! worker that holds them, `dispatch` one task to one worker and its positions back. The master digitizes
//! nothing itself, and the store is the only file it knows.

mod error;

mod service;
mod submission;

mod desk;
mod journal;
mod result;
mod store;

mod run;

mod driver;
mod running;
mod state;

mod history;
mod page;
pub mod snapshot;
mod window;

mod dispatch;
mod place;
mod received;

#[cfg(any(test, fuzzing))]
pub mod decoders;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use horma_core::{Record, ToolPath};
use horma_proto::wire::master_server::MasterServer;
use horma_proto::{Guard, MAX_MESSAGE, Tls, transport};
use tokio::net::TcpListener;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

use desk::Desk;
use store::Store;

pub use error::{Error, Result};
pub use history::Happening;
pub use page::page;
pub use run::Master;
pub use window::Window;

/// What a master has to know.
#[derive(Debug, Clone)]
pub struct Config {
    /// What proves who is who; without it traffic is plain and anybody may call.
    pub tls: Option<Tls>,
    /// Connections at once; more wait until others are closed.
    pub connections: usize,
    /// How often a worker is to say that it is alive.
    pub heartbeat: Duration,
    /// After how long a silence a worker counts as lost.
    pub lease: Duration,
    /// How long a job waits for its first workers.
    pub patience: Duration,
    /// How long it waits for one to come back when all are lost.
    pub regroup: Duration,
    /// Memory that jobs may take together, bytes.
    pub memory: u64,
    /// Whether workers share that memory.
    pub workers_here: bool,
    /// What clients may do; nothing if there is nothing here.
    pub clients: Option<Clients>,
}

/// What a master that serves clients has to know.
#[derive(Debug, Clone)]
pub struct Clients {
    /// Directory of what must survive the master; without it all is in memory.
    pub store: Option<PathBuf>,
    /// How much of everything there may be.
    pub limits: Limits,
}

/// How much a master that serves clients takes upon itself.
#[derive(Debug, Clone)]
pub struct Limits {
    /// Largest part that a client may send, bytes on the wire.
    pub part: u64,
    /// Jobs that are not over.
    pub queue: usize,
    /// Calls of clients that are open at once.
    pub calls: usize,
    /// Jobs at once at the workers.
    pub running: usize,
    /// Results that are kept, bytes.
    pub keep_bytes: u64,
    /// How long they are kept.
    pub keep: Duration,
}

/// A path and how it came about.
pub type Outcome = (ToolPath, Record);

/// Tells how far a run is: the phase, how much of it is done, and of how much.
pub type Progress = Arc<dyn Fn(&'static str, u64, u64) + Send + Sync>;

/// How long open calls may take to notice a shutdown.
const DRAIN: Duration = Duration::from_secs(5);

/// Has work done that blocks or computes, on a thread for such.
pub(crate) async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T> + Send + 'static,
) -> Result<T> {
    let done = tokio::task::spawn_blocking(work).await;
    done.map_err(|_| Error::Panicked)?
}

/// Starts a master on `listener`. It serves workers and clients until `shutdown`; the handle runs
/// jobs from within this process, and through the window others look.
///
/// # Errors
/// Those of opening the store.
pub fn start(
    listener: TcpListener,
    config: Config,
    shutdown: CancellationToken,
) -> Result<(Master, Window, JoinHandle<Result<()>>)> {
    let connections = config.connections;
    let (tls, clients, heartbeat) = (config.tls.clone(), config.clients.clone(), config.heartbeat);
    let store = clients
        .as_ref()
        .map(|clients| Store::open(clients.store.as_deref()))
        .transpose()?;
    let master = Master::start(config, shutdown.clone());
    let desk = match (store, clients) {
        (Some(store), Some(Clients { limits, .. })) => {
            let desk = Desk::open(store, master.clone(), limits, shutdown.clone())?;
            tokio::spawn(desk.clone().serve());
            Some(desk)
        }
        _ => None,
    };
    let window = Window {
        master: master.clone(),
        desk: desk.clone(),
    };
    let service = service::Service {
        guard: Guard::of(tls.as_ref()),
        tls: tls.clone(),
        heartbeat,
        master: master.clone(),
        desk,
        shutdown: shutdown.clone(),
    };
    let service = MasterServer::new(service)
        .max_decoding_message_size(MAX_MESSAGE)
        .max_encoding_message_size(MAX_MESSAGE);
    let failed = |e| Error::Serve(Arc::new(e));
    let stopping = master.draining.clone().cancelled_owned();
    let serving = tokio::spawn(async move {
        let server = transport::serve(
            service,
            listener,
            connections,
            tls.as_ref(),
            stopping,
            shutdown.cancelled(),
        );
        let mut server = std::pin::pin!(server);
        tokio::select! {
            served = &mut server => return served.map_err(failed),
            () = shutdown.cancelled() => {}
        }
        // Calls that do not notice are cut off.
        match tokio::time::timeout(DRAIN, server).await {
            Ok(served) => served.map_err(failed),
            Err(_) => Ok(()),
        }
    });
    Ok((master, window, serving))
}
