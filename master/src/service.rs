//! What workers and clients see of the master.

use std::sync::Arc;
use std::time::Duration;

use horma_core::{Job, Part, Sharing};
use horma_proto::wire::master_server::Master as Api;
use horma_proto::wire::submit_reply::Kind as Reply;
use horma_proto::wire::submit_request::Kind as Request;
use horma_proto::wire::{
    self, HeartbeatReply, HeartbeatRequest, RegisterReply, RegisterRequest, SubmitReply,
    SubmitRequest,
};
use horma_proto::{Error, Guard, Messages, Role, VERSION};
use tokio::sync::{mpsc, oneshot};
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request as Call, Response, Status, Streaming};
use tracing::info;

use crate::driver::{Going, Master, Message};
use crate::{Outcome, Progress};

/// Replies that may wait for a client.
const WAITING_REPLIES: usize = 16;

/// How long a client may take to send the next piece of its part.
const CLIENT_PATIENCE: Duration = Duration::from_secs(30);

pub(crate) struct Service {
    pub master: Master,
    /// Who may call what.
    pub guard: Guard,
    /// How often a worker is to say that it is alive.
    pub heartbeat: Duration,
    /// Largest part that a client may send, bytes on the wire.
    pub max_part: u64,
}

impl Service {
    async fn ask<T>(
        &self,
        message: impl FnOnce(oneshot::Sender<T>) -> Message,
    ) -> Result<T, Status> {
        let (reply, answer) = oneshot::channel();
        let stopping = Error::ShuttingDown("the master");
        if self.master.tell(message(reply)).await.is_err() {
            return Err(stopping.into());
        }
        answer.await.map_err(|_| stopping.into())
    }
}

#[tonic::async_trait]
impl Api for Service {
    type SubmitStream = ReceiverStream<Result<SubmitReply, Status>>;

    async fn register(
        &self,
        call: Call<RegisterRequest>,
    ) -> Result<Response<RegisterReply>, Status> {
        self.guard.admit(&call, Role::Worker)?;
        let RegisterRequest {
            version,
            worker,
            incarnation,
            address,
        } = call.into_inner();
        check_version(version)?;
        let name = worker.clone();
        let register = |reply| Message::Register {
            worker,
            incarnation,
            address,
            reply,
        };
        if !self.ask(register).await? {
            return Err(Error::Distrusted { worker: name }.into());
        }
        Ok(Response::new(RegisterReply {
            heartbeat_ms: self.heartbeat.as_millis() as u32,
            master: self.master.incarnation,
        }))
    }

    async fn heartbeat(
        &self,
        call: Call<HeartbeatRequest>,
    ) -> Result<Response<HeartbeatReply>, Status> {
        self.guard.admit(&call, Role::Worker)?;
        let HeartbeatRequest {
            worker,
            incarnation,
        } = call.into_inner();
        let name = worker.clone();
        let heartbeat = |reply| Message::Heartbeat {
            worker,
            incarnation,
            reply,
        };
        match self.ask(heartbeat).await? {
            Some(Going { jobs, next_job }) => Ok(Response::new(HeartbeatReply { jobs, next_job })),
            None => Err(Error::UnknownWorker { worker: name }.into()),
        }
    }

    async fn submit(
        &self,
        call: Call<Streaming<SubmitRequest>>,
    ) -> Result<Response<Self::SubmitStream>, Status> {
        self.guard.admit(&call, Role::Client)?;
        let submitted = receive(call.into_inner(), self.max_part).await?;
        let (part, job, sharing) = submitted;
        info!(bodies = part.bodies.len(), "submitted");
        let (replies, stream) = mpsc::channel(WAITING_REPLIES);
        let master = self.master.clone();
        tokio::spawn(async move {
            let telling = replies.clone();
            // Progress that the client is too slow for is dropped: newer follows.
            let progress: Progress = Arc::new(move |phase, done, total| {
                let phase = phase.to_owned();
                let progress = Reply::Progress(wire::Progress { phase, done, total });
                let _ = telling.try_send(Ok(reply(progress)));
            });
            let run = master.run(part, job, sharing, 1, progress);
            let outcome = tokio::select! {
                outcome = run => outcome,
                // The client hung up: dropping the run cancels it.
                () = replies.closed() => return,
            };
            match outcome {
                Ok(outcome) => send(&replies, outcome).await,
                // The client may have hung up just now.
                Err(error) => drop(replies.send(Err(Error::from(error).into())).await),
            }
        });
        Ok(Response::new(ReceiverStream::new(stream)))
    }
}

fn check_version(theirs: String) -> Result<(), Error> {
    if theirs == VERSION {
        Ok(())
    } else {
        let ours = VERSION;
        Err(Error::Version { ours, theirs })
    }
}

/// Receives a job and its part.
async fn receive(
    mut requests: Streaming<SubmitRequest>,
    max_part: u64,
) -> Result<(Part, Job, Sharing), Status> {
    let mut job = None;
    let mut part = Part::default();
    let mut messages = Messages::default();
    let mut bytes = 0;
    loop {
        let next = tokio::time::timeout(CLIENT_PATIENCE, requests.message());
        let next = next.await.map_err(|_| {
            let seconds = CLIENT_PATIENCE.as_secs();
            Error::TooSlow { seconds }
        })?;
        match (next?.map(|r| r.kind), &job) {
            (None, _) => break,
            (Some(Some(Request::Header(header))), None) => {
                check_version(header.version)?;
                let sharing = horma_proto::sharing_from_wire(header.sharing.as_ref())?;
                let header = header.job.ok_or(Error::Missing {
                    message: "submission",
                    field: "a job",
                })?;
                job = Some((horma_proto::job_from_wire(&header)?, sharing));
            }
            (Some(Some(Request::Bodies(chunk))), Some(_)) => {
                bytes += chunk.data.len() as u64;
                if bytes > max_part {
                    return Err(Error::TooLarge {
                        bytes: bytes as usize,
                        limit: max_part as usize,
                    }
                    .into());
                }
                messages.push(&chunk)?;
                while let Some(body) = messages.pop::<wire::Body>()? {
                    part.bodies.push(horma_proto::body_from_wire(body)?);
                }
            }
            _ => {
                let why = "a submission begins with its header, once".to_owned();
                return Err(Error::Malformed(why).into());
            }
        }
    }
    let missing = |field| Error::Missing {
        message: "submission",
        field,
    };
    if !messages.is_empty() {
        return Err(missing("the end of its last body").into());
    }
    let (job, sharing) = job.ok_or(missing("a header"))?;
    Ok((part, job, sharing))
}

/// Sends a path and its record; stops if the client hangs up.
async fn send(replies: &mpsc::Sender<Result<SubmitReply, Status>>, (path, record): Outcome) {
    let header = wire::PathHeader {
        trajectory: Some(horma_proto::trajectory_to_wire(&path.trajectory)),
    };
    let positions = horma_proto::position_chunks(0, &path.touches, &path.between);
    let positions = positions.map(Reply::Positions);
    let record = serde_json::to_vec(&record).map(|json| Reply::Record(json.into()));
    let kinds = std::iter::once(Reply::Path(header)).chain(positions);
    let all = kinds
        .map(Ok)
        .chain([record.map_err(|e| Status::internal(e.to_string()))]);
    for kind in all {
        if replies.send(kind.map(reply)).await.is_err() {
            return;
        }
    }
}

fn reply(kind: Reply) -> SubmitReply {
    SubmitReply { kind: Some(kind) }
}
