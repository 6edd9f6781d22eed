//! A master elsewhere: how it is called, for how long it is looked for, and what its answers mean.

use std::cell::Cell;
use std::time::Duration;

use horma_proto::clock::Pause;
use horma_proto::transport::{self, Trouble, WANTS_TLS};
use horma_proto::wire::StatusRequest;
use horma_proto::wire::master_client::MasterClient;
use horma_proto::{Answer, MAX_MESSAGE, Role, Tls};
use tokio::time::Instant;
use tonic::Status;
use tonic::transport::Channel;

use crate::error::{Error, Result};
use crate::{args, tls};

/// Longest time for a call that has a short answer.
const DEADLINE: Duration = Duration::from_secs(30);

pub(crate) type Client = MasterClient<Channel>;

/// Where a master is, and how it is spoken to.
pub(crate) struct Remote {
    pub address: String,
    tls: Option<Tls>,
    patience: Duration,
    /// When it was last heard of, by any call.
    heard: Cell<Option<Instant>>,
}

impl Remote {
    /// What was typed.
    pub fn of(args: &args::Remote) -> Result<Self> {
        Ok(Self {
            address: args.master.clone(),
            tls: tls::load(&args.tls)?,
            patience: Duration::from_secs(args.patience),
            heard: Cell::new(None),
        })
    }

    /// Makes a call, and again for as long as the patience lasts when the master has gone after it was
    /// there. The call notes when it has heard of the master.
    pub async fn call<T>(
        &self,
        mut call: impl AsyncFnMut(Client, &mut Instant) -> std::result::Result<T, Failure>,
    ) -> Result<T> {
        let mut pause = Pause::default();
        loop {
            let outcome = match self.connect().await {
                Ok(mut client) => {
                    let before = match self.heard.get() {
                        Some(at) => at,
                        None => self.greet(&mut client).await?,
                    };
                    self.heard.set(Some(before));
                    let mut latest = before;
                    let outcome = call(client, &mut latest).await;
                    if latest > before {
                        self.heard.set(Some(latest));
                        pause = Pause::default();
                    }
                    outcome.map_err(|failure| self.meaning(failure))
                }
                Err(error) => Err(error),
            };
            match (outcome, self.heard.get()) {
                (Err(Error::NoMaster { .. }), Some(at)) if at.elapsed() < self.patience => {}
                (outcome, _) => return outcome,
            }
            pause.wait().await;
        }
    }

    async fn connect(&self) -> Result<Client> {
        let bad_address = |_| Error::Address {
            address: self.address.clone(),
        };
        let endpoint = transport::endpoint(&self.address).map_err(bad_address)?;
        let connected = transport::connect(&endpoint, Role::Master, self.tls.as_ref()).await;
        let channel = connected.map_err(|e| silence(&self.address, &e))?;
        Ok(MasterClient::new(channel)
            .max_decoding_message_size(MAX_MESSAGE)
            .max_encoding_message_size(MAX_MESSAGE))
    }

    /// Makes sure that it is a master that took the connection: there is no job 0. Returns when it was.
    async fn greet(&self, client: &mut Client) -> Result<Instant> {
        let nobody = StatusRequest {
            job: Some(0),
            after: 0,
        };
        match client.status(short(nobody)).await {
            Err(status) if Answer::of(&status) != Answer::Stranger => {
                Err(self.meaning(status.into()))
            }
            Ok(_) | Err(_) => Ok(Instant::now()),
        }
    }

    fn meaning(&self, failure: Failure) -> Error {
        let address = self.address.clone();
        match failure {
            Failure::Status(status) => wants_tls(refusal(&address, &status), self.tls.as_ref()),
            Failure::BadReply(reason) => Error::BadReply { address, reason },
        }
    }
}

/// How a call came to nothing.
pub(crate) enum Failure {
    Status(Status),
    /// The answer cannot be right.
    BadReply(String),
}

impl From<Status> for Failure {
    fn from(status: Status) -> Self {
        Self::Status(status)
    }
}

/// A request that is answered at once.
pub(crate) fn short<T>(message: T) -> tonic::Request<T> {
    let mut request = tonic::Request::new(message);
    request.set_timeout(DEADLINE);
    request
}

/// What the master's status means for the user.
fn refusal(address: &str, status: &Status) -> Error {
    let (to, reason) = (address, status.message().to_owned());
    let address = to.to_owned();
    match Answer::of(status) {
        Answer::Wrong => Error::Refused { address, reason },
        Answer::Impossible => Error::Impossible { address, reason },
        Answer::Failed => Error::JobFailed { address, reason },
        Answer::Forbidden => Error::Untrusted { address, reason },
        Answer::Stranger => Error::NoSuchJob { address, reason },
        Answer::Silence => silence(to, status),
    }
}

/// A plain connection that gave no first answer may have been made to a port with TLS.
fn wants_tls(error: Error, tls: Option<&Tls>) -> Error {
    match error {
        Error::NoMaster { address, reason } if tls.is_none() => Error::NoMaster {
            address,
            reason: format!("{reason}; {WANTS_TLS}"),
        },
        other => other,
    }
}

/// What it means that there is no answer.
fn silence(address: &str, error: &(dyn std::error::Error + 'static)) -> Error {
    let address = address.to_owned();
    match Trouble::of(error, Role::Master) {
        Trouble::Untrusted(reason) => Error::Untrusted { address, reason },
        Trouble::Unreachable(reason) | Trouble::Broken(reason) => {
            Error::NoMaster { address, reason }
        }
    }
}
