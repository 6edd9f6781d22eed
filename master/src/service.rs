//! What workers and clients see of the master.

use std::sync::Arc;
use std::time::Duration;

use horma_proto::clock::unix_ms;
use horma_proto::wire::master_server::Master as Api;
use horma_proto::wire::path_reply::Kind as Reply;
use horma_proto::wire::submit_request::Kind as Request;
use horma_proto::wire::{
    self, CancelReply, CancelRequest, DialBackReply, DialBackRequest, DiscardReply, DiscardRequest,
    HeartbeatReply, HeartbeatRequest, LeaveReply, LeaveRequest, PathReply, PathRequest,
    RegisterReply, RegisterRequest, StatusReply, StatusRequest, SubmitReply, SubmitRequest,
};
use horma_proto::{Error, Guard, Role, Tls, VERSION, trace, transport};
use tokio::sync::{OwnedSemaphorePermit, mpsc, oneshot};
use tokio::time::timeout;
use tokio_stream::wrappers::ReceiverStream;
use tokio_util::sync::CancellationToken;
use tonic::{Request as Call, Response, Status, Streaming};
use tracing::{debug, info_span};

use crate::desk::{Desk, View};
use crate::driver::{Going, Message};
use crate::store::{Gone, Stage};
use crate::submission::{Arriving, check_version, out_of_order};
use crate::{Master, result};

/// Replies that may wait for a client.
const WAITING_REPLIES: usize = 16;

/// How often a client that waits hears of the master, at least.
const AGAIN: Duration = Duration::from_secs(2);

/// Jobs in one answer.
const STATUSES: usize = 1000;

/// How long a client may take to send the next piece of its part, or to take one of its path.
const CLIENT_PATIENCE: Duration = Duration::from_secs(30);

pub(crate) struct Service {
    pub master: Master,
    /// Who may call what.
    pub guard: Guard,
    /// What this master proves itself by to workers.
    pub tls: Option<Tls>,
    /// How often a worker is to say that it is alive.
    pub heartbeat: Duration,
    /// The jobs of clients, if there may be any.
    pub desk: Option<Arc<Desk>>,
    /// Ends what would go on for long.
    pub shutdown: CancellationToken,
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

    /// The desk, for a client's call, which is open for as long as the second is held.
    fn desk<T>(&self, call: &Call<T>) -> Result<(&Arc<Desk>, OwnedSemaphorePermit), Status> {
        self.guard.admit(call, Role::Client)?;
        let none = || Status::unimplemented("this master serves no clients");
        let desk = self.desk.as_ref().ok_or_else(none)?;
        Ok((desk, desk.call()?))
    }
}

#[tonic::async_trait]
impl Api for Service {
    type FetchStream = ReceiverStream<Result<PathReply, Status>>;

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
        check_version(&version)?;
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

    async fn dial_back(
        &self,
        call: Call<DialBackRequest>,
    ) -> Result<Response<DialBackReply>, Status> {
        self.guard.admit(&call, Role::Worker)?;
        let DialBackRequest { address, word } = call.into_inner();
        let malformed = |_| Error::Malformed("the word to be said is not of 16 bytes".to_owned());
        let word = word[..].try_into().map_err(malformed)?;
        let trouble = if address.is_empty() {
            String::new()
        } else {
            let reached = transport::reach(&address, Role::Worker, self.tls.as_ref(), word).await;
            reached.err().unwrap_or_default()
        };
        Ok(Response::new(DialBackReply {
            version: VERSION.to_owned(),
            unix_ms: unix_ms(),
            trouble,
        }))
    }

    async fn leave(&self, call: Call<LeaveRequest>) -> Result<Response<LeaveReply>, Status> {
        self.guard.admit(&call, Role::Worker)?;
        let LeaveRequest {
            worker,
            incarnation,
        } = call.into_inner();
        let leave = |reply| Message::Leave {
            worker,
            incarnation,
            reply,
        };
        self.ask(leave).await?;
        Ok(Response::new(LeaveReply {}))
    }

    async fn submit(
        &self,
        call: Call<Streaming<SubmitRequest>>,
    ) -> Result<Response<SubmitReply>, Status> {
        let (desk, _open) = self.desk(&call)?;
        let span = trace::child_of(
            trace::caller(&call),
            info_span!("take in", otel.kind = "server"),
        );
        let job = trace::within(span, submit(desk, call.into_inner())).await?;
        Ok(Response::new(SubmitReply { job }))
    }

    async fn status(&self, call: Call<StatusRequest>) -> Result<Response<StatusReply>, Status> {
        let (desk, _open) = self.desk(&call)?;
        let StatusRequest { job, after } = call.into_inner();
        let (jobs, more) = match job {
            Some(job) => (vec![(job, desk.watch(job)?.borrow().clone())], false),
            None => {
                let mut jobs = desk.status(after, STATUSES + 1);
                let more = jobs.len() > STATUSES;
                jobs.truncate(STATUSES);
                (jobs, more)
            }
        };
        let jobs = jobs.into_iter().map(|(job, view)| status(job, view));
        let jobs = jobs.collect();
        Ok(Response::new(StatusReply { jobs, more }))
    }

    async fn cancel(&self, call: Call<CancelRequest>) -> Result<Response<CancelReply>, Status> {
        let (desk, _open) = self.desk(&call)?;
        desk.cancel(call.get_ref().job).await?;
        Ok(Response::new(CancelReply {}))
    }

    async fn discard(&self, call: Call<DiscardRequest>) -> Result<Response<DiscardReply>, Status> {
        let (desk, _open) = self.desk(&call)?;
        desk.discard(call.get_ref().job).await?;
        Ok(Response::new(DiscardReply {}))
    }

    async fn fetch(&self, call: Call<PathRequest>) -> Result<Response<Self::FetchStream>, Status> {
        let (desk, open) = self.desk(&call)?;
        let desk = desk.clone();
        let PathRequest { job, wait } = call.into_inner();
        // At once, so that an unknown job is not the end of a stream.
        drop(desk.watch(job)?);
        let (replies, stream) = mpsc::channel(WAITING_REPLIES);
        let shutdown = self.shutdown.clone();
        tokio::spawn(async move {
            let _open = open;
            let sent = tokio::select! {
                sent = fetch(&desk, job, wait, &replies) => sent,
                () = shutdown.cancelled() => Err(Error::ShuttingDown("the master").into()),
                // The client hung up.
                () = replies.closed() => return,
            };
            if let Err(status) = sent {
                debug!(job, %status, "not fetched");
                let _ = replies.send(Err(status)).await;
            }
        });
        Ok(Response::new(ReceiverStream::new(stream)))
    }
}

/// Receives a job and its part, and has it queued.
async fn submit(desk: &Arc<Desk>, mut requests: Streaming<SubmitRequest>) -> Result<u64, Status> {
    let most = desk.limits.part;
    let mut arriving = Arriving::default();
    let mut bytes = 0;
    let (mut place, mut part) = (None, None);
    loop {
        let seconds = CLIENT_PATIENCE.as_secs();
        let next = timeout(CLIENT_PATIENCE, requests.message()).await;
        let next = next.map_err(|_| Error::TooSlow { seconds })??;
        match next.map(|request| request.kind) {
            None => break,
            Some(Some(Request::Header(header))) => {
                let key = arriving.header(&header)?;
                // Its answer was lost on the way.
                if let Some(job) = desk.find(key) {
                    return Ok(job);
                }
                place = Some(desk.place()?);
                part = Some(desk.part().await?);
            }
            Some(Some(Request::Bodies(chunk))) => {
                bytes += chunk.data.len() as u64;
                if bytes > most {
                    let mb = most / 1_000_000;
                    return Err(Error::Limit(format!(
                        "the part takes more than the {mb} MB that this master takes (--max-part)"
                    ))
                    .into());
                }
                arriving.bodies(&chunk)?;
            }
            Some(None) => return Err(out_of_order().into()),
        }
    }
    let submission = arriving.end()?;
    let place = place.ok_or_else(out_of_order)?;
    let job = desk.submit(submission, place).await?;
    drop(part);
    Ok(job)
}

/// Sends progress until a job is over, if that is waited for, and then its result.
async fn fetch(
    desk: &Desk,
    job: u64,
    wait: bool,
    replies: &mpsc::Sender<Result<PathReply, Status>>,
) -> Result<(), Status> {
    let mut watched = desk.watch(job)?;
    let pieces = loop {
        let View { entry, progress } = watched.borrow_and_update().clone();
        match entry.stage {
            Stage::Queued | Stage::Running { .. } if !wait => {
                let why = format!("job {job} is not over; wait for it with --wait");
                return Err(Status::failed_precondition(why));
            }
            Stage::Queued | Stage::Running { .. } => {
                let progress = Reply::Progress(progress_to_wire(progress));
                let kind = Some(progress);
                send(replies, PathReply { kind }).await?;
                // Said again when nothing changes: who waits is to know that the master is there.
                if let Ok(Err(_)) = timeout(AGAIN, watched.changed()).await {
                    return Err(Error::ShuttingDown("the master").into());
                }
            }
            Stage::Done { pieces, .. } => break pieces,
            Stage::Gone { why, .. } => return Err(Error::NoSuchJob(gone(job, why)).into()),
            Stage::Failed { code, reason, .. } => return Err(Status::new(code.into(), reason)),
            Stage::Cancelled { .. } => {
                return Err(Error::JobFailed(format!("job {job} was cancelled")).into());
            }
        }
    };
    for piece in 0..pieces {
        let piece = desk.result(job, piece).await.map_err(Error::from)?;
        let dropped = || Error::NoSuchJob(gone(job, Gone::Dropped));
        let reply = result::from_piece(piece.ok_or_else(dropped)?);
        send(replies, reply.map_err(Error::from)?).await?;
    }
    Ok(())
}

async fn send(
    replies: &mpsc::Sender<Result<PathReply, Status>>,
    reply: PathReply,
) -> Result<(), Status> {
    let sent = timeout(CLIENT_PATIENCE, replies.send(Ok(reply))).await;
    match sent {
        Ok(Ok(())) => Ok(()),
        Ok(Err(_)) | Err(_) => {
            let seconds = CLIENT_PATIENCE.as_secs();
            Err(Error::TooSlow { seconds }.into())
        }
    }
}

fn gone(job: u64, why: Gone) -> String {
    let why = match why {
        Gone::Fetched => "has been fetched",
        Gone::Dropped => "was dropped, since nobody fetched it in time or there was no room for it",
    };
    format!("the result of job {job} {why}; submit the job again")
}

fn progress_to_wire((phase, done, total): (&str, u64, u64)) -> wire::Progress {
    let phase = phase.to_owned();
    wire::Progress { phase, done, total }
}

fn status(job: u64, View { entry, progress }: View) -> wire::JobStatus {
    let stage = match &entry.stage {
        Stage::Queued => wire::Stage::Queued,
        Stage::Running { .. } => wire::Stage::Running,
        Stage::Done { .. } => wire::Stage::Done,
        Stage::Gone { why, .. } => match why {
            Gone::Fetched => wire::Stage::Fetched,
            Gone::Dropped => wire::Stage::Dropped,
        },
        Stage::Failed { .. } => wire::Stage::Failed,
        Stage::Cancelled { .. } => wire::Stage::Cancelled,
    };
    let running = stage == wire::Stage::Running;
    wire::JobStatus {
        job,
        name: entry.name,
        stage: stage.into(),
        submitted_ms: entry.submitted.as_millis() as u64,
        ended_ms: entry.stage.ended().map_or(0, |at| at.as_millis() as u64),
        progress: running.then(|| progress_to_wire(progress)),
        reason: match entry.stage {
            Stage::Failed { reason, .. } => reason,
            _ => String::new(),
        },
    }
}
