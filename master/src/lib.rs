//! The master: it splits a job into extents, schedules them on workers, and stitches the path.
//!
//! `state` decides and touches nothing; `driver` owns it, feeds it events and carries out its
//! commands; `place` brings rows to the worker that holds them, `dispatch` one task to one worker and
//! its positions back; `service` is what workers and clients see. The master digitizes nothing itself and
//! reads no file.

mod error;

mod service;

mod driver;
mod running;
mod state;

mod dispatch;
mod place;
mod received;

use std::sync::Arc;
use std::time::Duration;

use horma_core::{Handout, Job, Part, Record, Sharing, ToolPath};
use horma_proto::wire::master_server::MasterServer;
use horma_proto::{Guard, MAX_MESSAGE, Tls, transport};
use tokio::net::TcpListener;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

pub use driver::Master;
pub use error::{Error, Result};

/// What a master has to know.
#[derive(Debug, Clone)]
pub struct Config {
    /// What proves who is who; without it traffic is plain and anybody may call.
    pub tls: Option<Tls>,
    /// How often a worker is to say that it is alive.
    pub heartbeat: Duration,
    /// After how long a silence a worker counts as lost.
    pub lease: Duration,
    /// How long a job waits for its first workers.
    pub patience: Duration,
    /// How long it waits for one to come back when all are lost.
    pub regroup: Duration,
    /// Largest part that a client may send, bytes on the wire.
    pub max_part: u64,
    /// Memory that one job may take, bytes.
    pub memory: u64,
    /// Whether workers share that memory.
    pub workers_here: bool,
}

/// A path and how it came about.
pub type Outcome = (ToolPath, Record);

/// Tells how far a run is: the phase, how much of it is done, and of how much.
pub type Progress = Arc<dyn Fn(&'static str, u64, u64) + Send + Sync>;

/// How long open calls may take to notice a shutdown.
const DRAIN: Duration = Duration::from_secs(5);

/// Starts a master on `listener`. It serves workers and clients until `shutdown`; the handle runs
/// jobs from within this process.
pub fn start(
    listener: TcpListener,
    config: Config,
    shutdown: CancellationToken,
) -> (Master, JoinHandle<Result<()>>) {
    let tls = config.tls.clone();
    let service = service::Service {
        max_part: config.max_part,
        heartbeat: config.heartbeat,
        guard: Guard::of(tls.as_ref()),
        master: Master::start(config, shutdown.clone()),
    };
    let master = service.master.clone();
    let service = MasterServer::new(service)
        .max_decoding_message_size(MAX_MESSAGE)
        .max_encoding_message_size(MAX_MESSAGE);
    let failed = |e| Error::Serve(Arc::new(e));
    let serving = tokio::spawn(async move {
        let server = transport::serve(service, listener, tls.as_ref(), shutdown.cancelled());
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
    (master, serving)
}

/// Plans a job on a thread of its own: discretizing a part is work.
pub(crate) async fn plan(
    part: Part,
    job: Job,
    sharing: Sharing,
    config: &Config,
) -> Result<Handout> {
    let (memory, here) = (config.memory, config.workers_here);
    let plan = move || Handout::new(&part, job, sharing, memory, here);
    let planned = tokio::task::spawn_blocking(plan).await;
    planned
        .map_err(|_| Error::Interrupted)?
        .map_err(Error::Plan)
}
