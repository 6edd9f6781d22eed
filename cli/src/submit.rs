//! A run on a master elsewhere: the part goes out, the path comes back.

use horma_core::{Job, Part, Record, Sharing, Trajectory, stitch};
use horma_master::{Outcome, Progress};
use horma_proto::transport::{self, Trouble, WANTS_TLS};
use horma_proto::wire::master_client::MasterClient;
use horma_proto::wire::submit_reply::Kind as Reply;
use horma_proto::wire::submit_request::Kind as Request;
use horma_proto::wire::{SubmitHeader, SubmitRequest};
use horma_proto::{Answer, Chunks, MAX_MESSAGE, Role, Tls, VERSION};
use tonic::Status;

use crate::error::{Error, Result};

/// Has a part digitized by the master at `address`.
pub(crate) async fn run(
    part: Part,
    job: Job,
    sharing: Sharing,
    address: &str,
    tls: Option<&Tls>,
    progress: Progress,
) -> Result<Outcome> {
    let bad_address = |_| Error::Address {
        address: address.to_owned(),
    };
    let endpoint = transport::endpoint(address).map_err(bad_address)?;
    let connected = transport::connect(&endpoint, Role::Master, tls).await;
    let channel = connected.map_err(|e| silence(address, &e))?;
    let mut client = MasterClient::new(channel)
        .max_decoding_message_size(MAX_MESSAGE)
        .max_encoding_message_size(MAX_MESSAGE);

    progress("send", 0, 0);
    let failed = |status: Status| refusal(address, &status);
    let replies = client.submit(tokio_stream::iter(requests(part, job, sharing)));
    let mut replies = replies
        .await
        .map_err(|s| wants_tls(failed(s), tls))?
        .into_inner();
    let bad = |reason: String| Error::BadReply {
        address: address.to_owned(),
        reason,
    };
    let mut trajectory: Option<Trajectory> = None;
    let mut parts = Vec::new();
    while let Some(reply) = replies.message().await.map_err(failed)? {
        match reply.kind {
            Some(Reply::Progress(p)) => progress(phase(&p.phase), p.done, p.total),
            Some(Reply::Path(header)) => {
                progress("receive", 0, 0);
                let header = horma_proto::trajectory_from_wire(header.trajectory.as_ref());
                trajectory = Some(header.map_err(|e| bad(e.to_string()))?);
            }
            Some(Reply::Positions(positions)) => {
                let count = trajectory.map_or(0, |t| t.positions);
                let run = horma_proto::unpack_positions(&positions, count);
                parts.push(run.map_err(|e| bad(e.to_string()))?);
            }
            Some(Reply::Record(json)) => {
                let record: Record =
                    serde_json::from_slice(&json).map_err(|e| bad(e.to_string()))?;
                let trajectory = trajectory.ok_or(bad("it has no header".to_owned()))?;
                let path = stitch(trajectory, parts).map_err(|e| bad(e.to_string()))?;
                return Ok((path, record));
            }
            None => return Err(bad("an empty reply".to_owned())),
        }
    }
    Err(bad("it ends early".to_owned()))
}

/// The job and its part, packed as they are sent.
fn requests(
    part: Part,
    job: Job,
    sharing: Sharing,
) -> impl Iterator<Item = SubmitRequest> + Send + 'static {
    let header = SubmitHeader {
        version: VERSION.to_owned(),
        job: Some(horma_proto::job_to_wire(&job)),
        sharing: Some(horma_proto::sharing_to_wire(sharing)),
    };
    let bodies = part.bodies.into_iter();
    let bodies = Chunks::of(bodies.map(|b| horma_proto::body_to_wire(&b)));
    let kinds = std::iter::once(Request::Header(header)).chain(bodies.map(Request::Bodies));
    kinds.map(|kind| SubmitRequest { kind: Some(kind) })
}

/// The names of a master's phases; what a later one may call its own is shown as this.
fn phase(name: &str) -> &'static str {
    let known = ["discretize", "digitize", "stitch"];
    known.into_iter().find(|k| *k == name).unwrap_or("work")
}

/// What the master's status means for the user.
fn refusal(address: &str, status: &Status) -> Error {
    let (to, reason) = (address.to_owned(), status.message().to_owned());
    match Answer::of(status) {
        Answer::Wrong => Error::Refused {
            address: to,
            reason,
        },
        Answer::Impossible => Error::Impossible {
            address: to,
            reason,
        },
        Answer::Failed => Error::JobFailed {
            address: to,
            reason,
        },
        Answer::Forbidden => Error::Untrusted {
            address: to,
            reason,
        },
        Answer::Stranger | Answer::Silence => silence(address, status),
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
