//! A run on a master elsewhere: the part goes out, the path comes back, now or later.

use std::hash::{BuildHasher, RandomState};

use horma_core::{Job, Part, Record, Sharing, Trajectory, stitch};
use horma_master::{Outcome, Progress};
use horma_proto::trace::calling;
use horma_proto::wire::path_reply::Kind as Reply;
use horma_proto::wire::submit_request::Kind as Request;
use horma_proto::wire::{
    CancelRequest, DiscardRequest, PathHeader, PathReply, PathRequest, SubmitHeader, SubmitRequest,
};
use horma_proto::{Chunks, VERSION};
use tokio::time::Instant;
use tonic::Streaming;

use crate::client::{Failure, Remote, short};
use crate::error::Result;

/// Sends a job and its part; returns the job's number. However often it is sent, it is one job.
pub(crate) async fn send(
    remote: &Remote,
    part: &Part,
    job: Job,
    sharing: Sharing,
    name: &str,
) -> Result<u64> {
    let header = SubmitHeader {
        version: VERSION.to_owned(),
        job: Some(horma_proto::job_to_wire(&job)),
        sharing: Some(horma_proto::sharing_to_wire(sharing)),
        key: key().into(),
        name: name.to_owned(),
    };
    let sending = remote.call(async |mut client, _| {
        let requests = requests(&header, part.clone());
        let reply = client.submit(calling(tokio_stream::iter(requests))).await?;
        Ok(reply.into_inner().job)
    });
    sending.await
}

/// Fetches the path of a job, when it is over if that is to be waited for.
pub(crate) async fn fetch(
    remote: &Remote,
    job: u64,
    wait: bool,
    progress: &Progress,
) -> Result<Outcome> {
    let fetching = remote.call(async |mut client, heard| {
        let replies = client.fetch(PathRequest { job, wait }).await?;
        receive(replies.into_inner(), progress, heard).await
    });
    fetching.await
}

/// Tells the master that its result is here.
pub(crate) async fn discard(remote: &Remote, job: u64) -> Result<()> {
    let discarding = remote.call(async |mut client, _| {
        client.discard(short(DiscardRequest { job })).await?;
        Ok(())
    });
    discarding.await
}

/// Ends a job.
pub(crate) async fn cancel(remote: &Remote, job: u64) -> Result<()> {
    let cancelling = remote.call(async |mut client, _| {
        client.cancel(short(CancelRequest { job })).await?;
        Ok(())
    });
    cancelling.await
}

async fn receive(
    mut replies: Streaming<PathReply>,
    progress: &Progress,
    heard: &mut Instant,
) -> std::result::Result<Outcome, Failure> {
    let bad = |error: &dyn std::fmt::Display| Failure::BadReply(error.to_string());
    let mut trajectory: Option<Trajectory> = None;
    let mut parts = Vec::new();
    while let Some(reply) = replies.message().await? {
        *heard = Instant::now();
        match reply.kind {
            Some(Reply::Progress(p)) => progress(phase(&p.phase), p.done, p.total),
            Some(Reply::Path(header)) => {
                progress("receive", 0, 0);
                let header: PathHeader = horma_proto::open(&header).map_err(|e| bad(&e))?;
                let found = horma_proto::trajectory_from_wire(header.trajectory.as_ref());
                trajectory = Some(found.map_err(|e| bad(&e))?);
            }
            Some(Reply::Positions(positions)) => {
                let count = trajectory.map_or(0, |t| t.positions);
                let run = horma_proto::unpack_positions(&positions, count);
                parts.push(run.map_err(|e| bad(&e))?);
            }
            Some(Reply::Record(json)) => {
                let record: Record = serde_json::from_slice(&json).map_err(|e| bad(&e))?;
                let trajectory = trajectory.ok_or(bad(&"it has no header"))?;
                let path = stitch(trajectory, parts).map_err(|e| bad(&e))?;
                return Ok((path, record));
            }
            None => return Err(bad(&"an empty reply")),
        }
    }
    Err(bad(&"it ends early"))
}

/// The job and its part, packed as they are sent.
fn requests(
    header: &SubmitHeader,
    part: Part,
) -> impl Iterator<Item = SubmitRequest> + Send + 'static {
    let bodies = part.bodies.into_iter();
    let bodies = Chunks::of(bodies.map(|b| horma_proto::body_to_wire(&b)));
    let kinds = std::iter::once(Request::Header(horma_proto::seal(header)))
        .chain(bodies.map(Request::Bodies));
    kinds.map(|kind| SubmitRequest { kind: Some(kind) })
}

/// A key that no other submission has: the standard library's hashers start from random numbers.
fn key() -> Vec<u8> {
    let half = || {
        RandomState::new()
            .hash_one(std::process::id())
            .to_le_bytes()
    };
    [half(), half()].concat()
}

/// The names of a master's phases; what a later one may call its own is shown as this.
fn phase(name: &str) -> &'static str {
    let known = ["wait", "discretize", "digitize", "stitch"];
    known.into_iter().find(|k| *k == name).unwrap_or("work")
}
