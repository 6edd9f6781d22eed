//! Membership: register with the master, then say now and then that this worker is alive.

use std::time::Duration;

use horma_proto::VERSION;
use horma_proto::wire::master_client::MasterClient;
use horma_proto::wire::{HeartbeatRequest, RegisterRequest};
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;
use tonic::transport::{Channel, Endpoint};
use tonic::{Code, Status};
use tracing::{info, warn};

use crate::Config;
use crate::error::{Error, Result};
use crate::store::Store;

/// Pause before the master is tried again; it doubles up to the longest.
const FIRST_PAUSE: Duration = Duration::from_millis(100);
const LONGEST_PAUSE: Duration = Duration::from_secs(2);

/// Longest time for one call.
const DEADLINE: Duration = Duration::from_secs(5);

/// Keeps this worker a member until `shutdown`, or until the master has been silent for longer than
/// the worker's patience: then there is no more work, which is no error if there ever was a master.
pub(crate) async fn keep(
    config: &Config,
    address: &str,
    store: &Store,
    shutdown: &CancellationToken,
) -> Result<()> {
    let member = async {
        let mut client = connect(&config.master)?;
        let mut heard: Option<Instant> = None;
        let begin = Instant::now();
        let mut pause = FIRST_PAUSE;
        loop {
            let silence = match register(&mut client, config, address).await {
                Ok((interval, master)) => {
                    info!(master = config.master, "registered");
                    store.keep_master(master);
                    pause = FIRST_PAUSE;
                    let silence = heartbeats(&mut client, config, store, interval).await;
                    heard = Some(Instant::now());
                    silence
                }
                Err(status) if is_final(&status) => {
                    return Err(Error::Refused {
                        address: config.master.clone(),
                        reason: status.message().to_owned(),
                    });
                }
                Err(status) => status,
            };
            if silence.code() == Code::NotFound {
                continue;
            }
            warn!(
                master = config.master,
                reason = silence.message(),
                "no answer"
            );
            if heard.unwrap_or(begin).elapsed() >= config.patience {
                return match heard {
                    Some(_) => Ok(()),
                    None => Err(Error::NoMaster {
                        address: config.master.clone(),
                        waited: config.patience,
                        reason: silence.message().to_owned(),
                    }),
                };
            }
            tokio::time::sleep(pause).await;
            pause = (2 * pause).min(LONGEST_PAUSE);
        }
    };
    tokio::select! {
        outcome = member => outcome,
        () = shutdown.cancelled() => Ok(()),
    }
}

fn connect(master: &str) -> Result<MasterClient<Channel>> {
    let endpoint = Endpoint::from_shared(format!("http://{master}"));
    let endpoint = endpoint.map_err(|_| Error::Address {
        address: master.to_owned(),
    })?;
    let channel = endpoint
        .connect_timeout(DEADLINE)
        .timeout(DEADLINE)
        .tcp_nodelay(true)
        .connect_lazy();
    Ok(MasterClient::new(channel))
}

/// Registers; returns how often the master wants to hear, and which start of it this is.
async fn register(
    client: &mut MasterClient<Channel>,
    config: &Config,
    address: &str,
) -> std::result::Result<(Duration, u64), Status> {
    let request = RegisterRequest {
        version: VERSION.to_owned(),
        worker: config.id.clone(),
        incarnation: config.incarnation,
        address: address.to_owned(),
    };
    let reply = client.register(request).await?.into_inner();
    let interval = Duration::from_millis(u64::from(reply.heartbeat_ms.max(10)));
    Ok((interval, reply.master))
}

/// Sends heartbeats until one fails; drops the rows of jobs that are over.
async fn heartbeats(
    client: &mut MasterClient<Channel>,
    config: &Config,
    store: &Store,
    interval: Duration,
) -> Status {
    loop {
        tokio::time::sleep(interval).await;
        let request = HeartbeatRequest {
            worker: config.id.clone(),
            incarnation: config.incarnation,
        };
        match client.heartbeat(request).await {
            Ok(reply) => {
                let reply = reply.into_inner();
                store.keep_jobs(&reply.jobs, reply.next_job);
            }
            Err(status) => return status,
        }
    }
}

/// Whether the master said no, rather than nothing.
fn is_final(status: &Status) -> bool {
    matches!(
        status.code(),
        Code::FailedPrecondition | Code::PermissionDenied | Code::InvalidArgument
    )
}
