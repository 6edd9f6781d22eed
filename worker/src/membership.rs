//! Membership: register with the master, then say now and then that this worker is alive.

use std::net::SocketAddr;
use std::time::Duration;

use horma_proto::clock::Pause;
use horma_proto::metrics::REGISTERED;
use horma_proto::transport::{self, Trouble, WANTS_TLS};
use horma_proto::wire::master_client::MasterClient;
use horma_proto::wire::{HeartbeatRequest, LeaveRequest, RegisterRequest};
use horma_proto::{Answer, Role, VERSION};
use tokio::sync::watch;
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;
use tonic::Status;
use tonic::transport::Channel;
use tracing::{debug, info, warn};

use crate::Config;
use crate::error::{Error, Result};
use crate::rendezvous::reachable;
use crate::store::Store;

/// Longest time for one call.
const DEADLINE: Duration = Duration::from_secs(5);

/// Keeps this worker a member until it is told to leave, or until the master has been silent for longer than
/// the worker's patience: then there is no more work, which is no error if there ever was a master and
/// nothing was going on there.
pub(crate) async fn keep(
    config: &Config,
    bound: SocketAddr,
    store: &Store,
    registered: &watch::Sender<bool>,
    leaving: &CancellationToken,
) -> Result<()> {
    let member = async {
        let mut heard: Option<Instant> = None;
        let mut going = Vec::new();
        let begin = Instant::now();
        let mut pause = Pause::default();
        loop {
            let reason = match config.master.look().await {
                Err(unknown) => unknown,
                Ok(master) => {
                    let mut client = connect(config, &master)?;
                    let address = config.advertise.clone();
                    let address = address.unwrap_or_else(|| reachable(bound, &master).to_string());
                    let silence = match register(&mut client, config, &address).await {
                        Ok((interval, incarnation)) => {
                            store.keep_master(incarnation);
                            member(registered, true);
                            info!(master, address, "registered");
                            pause = Pause::default();
                            let silence =
                                heartbeats(&mut client, config, store, interval, &mut going).await;
                            member(registered, false);
                            heard = Some(Instant::now());
                            silence
                        }
                        Err(status) => status,
                    };
                    match silent(config, &master, &silence, heard.is_some())? {
                        None => continue,
                        Some(reason) => reason,
                    }
                }
            };
            warn!(master = %config.master, reason, "no answer");
            if heard.unwrap_or(begin).elapsed() >= config.patience {
                return match heard {
                    Some(_) if going.is_empty() => Ok(()),
                    Some(_) => Err(Error::MasterGone {
                        address: config.master.to_string(),
                        waited: config.patience,
                        jobs: going.len(),
                    }),
                    None => Err(Error::NoMaster {
                        address: config.master.to_string(),
                        waited: config.patience,
                        reason,
                    }),
                };
            }
            pause.wait().await;
        }
    };
    tokio::select! {
        outcome = member => outcome,
        () = leaving.cancelled() => {
            if let Err(reason) = leave(config).await {
                warn!(master = %config.master, reason, "left without a word");
            }
            Ok(())
        }
    }
}

/// Tells those who watch whether this worker is a member.
fn member(registered: &watch::Sender<bool>, is: bool) {
    registered.send_replace(is);
    REGISTERED.set("", f64::from(u8::from(is)));
}

/// Tells the master that this worker is about to stop, so that what it has goes to others at once.
async fn leave(config: &Config) -> std::result::Result<(), String> {
    let master = config.master.look().await?;
    let mut client = connect(config, &master).map_err(|e| e.to_string())?;
    let request = LeaveRequest {
        worker: config.id.clone(),
        incarnation: config.incarnation,
    };
    let left = client.leave(request).await;
    left.map(drop).map_err(|status| status.message().to_owned())
}

fn connect(config: &Config, master: &str) -> Result<MasterClient<Channel>> {
    let endpoint = transport::endpoint(master).map_err(|_| Error::Address {
        address: master.to_owned(),
    })?;
    let endpoint = endpoint.timeout(DEADLINE);
    let channel = transport::connect_lazily(&endpoint, Role::Master, config.tls.as_ref());
    Ok(MasterClient::new(channel))
}

/// Why the master says nothing; nothing if it only wants to be told again who this is, and an error if
/// it never will say anything else.
fn silent(config: &Config, master: &str, status: &Status, heard: bool) -> Result<Option<String>> {
    let address = master.to_owned();
    let reason = status.message().to_owned();
    match Answer::of(status) {
        Answer::Stranger => return Ok(None),
        Answer::Silence => {}
        Answer::Forbidden => return Err(Error::Untrusted { address, reason }),
        Answer::Wrong | Answer::Impossible | Answer::Failed => {
            return Err(Error::Refused { address, reason });
        }
    }
    match Trouble::of(status, Role::Master) {
        Trouble::Broken(reason) if config.tls.is_none() && !heard => {
            Ok(Some(format!("{reason}; {WANTS_TLS}")))
        }
        Trouble::Broken(reason) | Trouble::Unreachable(reason) => Ok(Some(reason)),
        Trouble::Untrusted(reason) => Err(Error::Untrusted { address, reason }),
    }
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

/// Sends heartbeats until one fails; drops the rows of jobs that are over, and notes which go on.
async fn heartbeats(
    client: &mut MasterClient<Channel>,
    config: &Config,
    store: &Store,
    interval: Duration,
    going: &mut Vec<u64>,
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
                if *going != reply.jobs {
                    debug!(jobs = ?reply.jobs, "going on");
                    *going = reply.jobs;
                }
            }
            Err(status) => return status,
        }
    }
}
