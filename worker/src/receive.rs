//! What the master and other workers send, checked as it comes.

use std::time::Instant;

use horma_core::{Job, Row, SurfaceGrid, Trajectory};
use horma_proto::wire::digitize_request::Kind as Request;
use horma_proto::wire::place_request::Kind as Placing;
use horma_proto::wire::task::Supply as Announced;
use horma_proto::wire::{self, DigitizeRequest, PlaceRequest, Run};
use horma_proto::{Error, Messages, Result, TaskId};
use tokio_stream::{Stream, StreamExt};
use tonic::Status;

use crate::halo::Source;

/// What is sent, or what its sender is told.
type Answer<T> = std::result::Result<T, Status>;

/// A task and what its rows come from.
pub(crate) struct Task {
    pub id: TaskId,
    pub job: Job,
    pub trajectory: Trajectory,
    pub runs: Vec<Run>,
    pub supply: Supply,
    pub receive_seconds: f64,
}

/// What a task's rows come from: this is all in which the distributions differ.
pub(crate) enum Supply {
    /// They came with it.
    Rows(Vec<Row>),
    /// They are made here.
    Grids(Vec<SurfaceGrid>),
    /// This worker holds the first, others the rest.
    Held { own: TaskId, halo: Vec<Source> },
}

/// Rows as they arrive: in order of their ids, neighbours of equal length.
#[derive(Default)]
pub(crate) struct Rows {
    messages: Messages,
    rows: Vec<Row>,
}

impl Rows {
    /// Takes the next chunk.
    pub fn push(&mut self, chunk: &wire::Chunk) -> Result<()> {
        self.messages.push(chunk)?;
        while let Some(row) = self.messages.pop::<wire::Row>()? {
            let row = horma_proto::row_from_wire(&row)?;
            if let Some(last) = self.rows.last() {
                if last.id >= row.id {
                    let why = format!("row {} comes out of order", row.id);
                    return Err(Error::Malformed(why));
                }
                last.validate_next(&row).map_err(Error::Core)?;
            }
            self.rows.push(row);
        }
        Ok(())
    }

    /// Number of rows that have come.
    pub fn len(&self) -> u64 {
        self.rows.len() as u64
    }

    /// All rows, if they are as many as were announced.
    pub fn finish(self, expected: u64) -> Result<Vec<Row>> {
        complete("rows", self.len(), expected, &self.messages)?;
        Ok(self.rows)
    }
}

fn complete(what: &'static str, found: u64, expected: u64, rest: &Messages) -> Result<()> {
    if found == expected && rest.is_empty() {
        return Ok(());
    }
    Err(Error::Incomplete {
        what,
        expected,
        found,
    })
}

/// Receives a task and what comes with it.
pub(crate) async fn task(
    mut requests: impl Stream<Item = Answer<DigitizeRequest>> + Unpin,
) -> Answer<Task> {
    let begin = Instant::now();
    let Some(Request::Task(header)) = requests.try_next().await?.and_then(|r| r.kind) else {
        return Err(no_header("task").into());
    };
    let mut task = header_from_wire(horma_proto::open(&header)?)?;
    let (mut rows, mut grids) = (Rows::default(), (Messages::default(), Vec::new()));
    while let Some(request) = requests.try_next().await? {
        match (request.kind, &task.announced) {
            (Some(Request::Rows(chunk)), Announced::Rows(_)) => rows.push(&chunk)?,
            (Some(Request::Rows(chunk)), Announced::Grids(_)) => {
                grids.0.push(&chunk)?;
                while let Some(grid) = grids.0.pop::<wire::SurfaceGrid>()? {
                    grids.1.push(horma_proto::grid_from_wire(grid)?);
                }
            }
            _ => return Err(no_header("task").into()),
        }
    }
    task.task.supply = match task.announced {
        Announced::Rows(announced) => Supply::Rows(rows.finish(u64::from(announced))?),
        Announced::Grids(announced) => {
            let found = grids.1.len() as u64;
            complete("grids", found, u64::from(announced), &grids.0)?;
            Supply::Grids(grids.1)
        }
        Announced::Holdings(holdings) => holdings_from_wire(holdings)?,
    };
    task.task.receive_seconds = begin.elapsed().as_secs_f64();
    Ok(task.task)
}

/// Receives the rows that this worker is to hold: whose job it is, by which attempt, and the rows.
pub(crate) async fn placement(
    mut requests: impl Stream<Item = Answer<PlaceRequest>> + Unpin,
) -> Answer<(u64, TaskId, Vec<Row>)> {
    let Some(Placing::Placement(header)) = requests.try_next().await?.and_then(|r| r.kind) else {
        return Err(no_header("placement").into());
    };
    let id = header.id.try_into()?;
    let mut rows = Rows::default();
    while let Some(request) = requests.try_next().await? {
        match request.kind {
            Some(Placing::Rows(chunk)) => rows.push(&chunk)?,
            _ => return Err(no_header("placement").into()),
        }
    }
    Ok((header.master, id, rows.finish(u64::from(header.rows))?))
}

fn no_header(what: &str) -> Error {
    Error::Malformed(format!("a {what} begins with its header, once"))
}

fn missing(field: &'static str) -> Error {
    Error::Missing {
        message: "task",
        field,
    }
}

struct Header {
    task: Task,
    announced: Announced,
}

fn header_from_wire(header: wire::Task) -> Result<Header> {
    let job = header.job.ok_or(missing("a job"))?;
    let trajectory = horma_proto::trajectory_from_wire(header.trajectory.as_ref())?;
    check_runs(&header.runs, trajectory.positions)?;
    let task = Task {
        id: header.id.try_into()?,
        job: horma_proto::job_from_wire(&job)?,
        trajectory,
        runs: header.runs,
        supply: Supply::Rows(Vec::new()),
        receive_seconds: 0.0,
    };
    Ok(Header {
        task,
        announced: header.supply.ok_or(missing("its rows"))?,
    })
}

/// The runs of a task must be of the trajectory's positions, and have none of them twice.
fn check_runs(runs: &[Run], positions: u64) -> Result<()> {
    let mut order: Vec<&Run> = runs.iter().collect();
    order.sort_unstable_by_key(|run| run.first);
    let mut next = 0;
    for run in order {
        let end = run.first.checked_add(run.count);
        let end = end.filter(|&end| next <= run.first && run.first < end && end <= positions);
        let Some(end) = end else {
            let Run { first, count, .. } = run;
            let why =
                format!("a run of {count} positions from {first} on, of {positions}, after {next}");
            return Err(Error::Malformed(why));
        };
        next = end;
    }
    Ok(())
}

fn holdings_from_wire(holdings: wire::Holdings) -> Result<Supply> {
    let source = |source: wire::Source| {
        Ok(Source {
            id: source.id.try_into()?,
            worker: source.worker,
            address: source.address,
            rows: source.rows,
        })
    };
    Ok(Supply::Held {
        own: holdings.own.try_into()?,
        halo: holdings
            .halo
            .into_iter()
            .map(source)
            .collect::<Result<_>>()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_have_each_position_once() {
        let run = |(first, count)| Run {
            first,
            count,
            rows: Vec::new(),
        };
        let check = |runs: &[(u64, u64)]| {
            let runs: Vec<Run> = runs.iter().copied().map(run).collect();
            check_runs(&runs, 20).is_ok()
        };
        assert!(check(&[(0, 20)]));
        assert!(check(&[(13, 4), (10, 3), (17, 3)]));
        assert!(check(&[(10, 5), (2, 6)]));
        for bad in [
            &[(10, 11)][..],
            &[(10, 0)],
            &[(20, 1)],
            &[(10, 5), (14, 6)],
            &[(10, 5), (10, 5)],
            &[(10, 10), (20, u64::MAX)],
        ] {
            assert!(!check(bad), "{bad:?}");
        }
    }
}
