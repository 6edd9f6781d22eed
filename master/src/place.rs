//! Placing: an extent's own rows to the worker that is to hold them.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use horma_core::Handout;
use horma_proto::metrics::TRAFFIC;
use horma_proto::trace::calling;
use horma_proto::wire::place_request::Kind as Request;
use horma_proto::wire::{self, PlaceRequest};
use horma_proto::{Chunks, TaskId, Tls};
use prost::Message;
use tokio::sync::oneshot;

use crate::dispatch::{connect, fault, rows_to_wire};
use crate::state::Fault;

/// A worker that has not taken in rows after this, and after as long as they take at the least rate,
/// does not.
const DEADLINE: Duration = Duration::from_secs(60);
const LEAST_ROWS_A_SECOND: f64 = 100.0;

/// All that placing an extent's rows needs.
pub(crate) struct Placing {
    /// This start of the master.
    pub master: u64,
    pub task: TaskId,
    pub address: String,
    pub tls: Option<Tls>,
    pub plan: Arc<Handout>,
    /// Ids of the rows.
    pub rows: Vec<u32>,
}

/// What placing took.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Placed {
    pub rows: u64,
    pub bytes: u64,
    pub seconds: f64,
}

impl std::ops::AddAssign for Placed {
    fn add_assign(&mut self, other: Self) {
        self.rows += other.rows;
        self.bytes += other.bytes;
        self.seconds += other.seconds;
    }
}

/// Sends the rows; `cut_off` ends that early and says why.
pub(crate) async fn place(
    placing: Placing,
    cut_off: oneshot::Receiver<String>,
) -> Result<Placed, Fault> {
    let begin = Instant::now();
    let rows = placing.rows.len() as u64;
    let sent = Arc::new(AtomicU64::new(0));
    let deadline = DEADLINE + Duration::from_secs_f64(rows as f64 / LEAST_ROWS_A_SECOND);
    let call = async {
        let mut client = connect(&placing.address, placing.tls.as_ref()).await?;
        let mut request = calling(requests(&placing, sent.clone()));
        request.set_timeout(deadline);
        let placed = client.place(request).await;
        placed.map(drop).map_err(|status| fault(&status))
    };
    tokio::select! {
        placed = tokio::time::timeout(deadline, call) => {
            let late = || Fault::Lost(format!("it did not take its rows within {} s", deadline.as_secs()));
            placed.unwrap_or_else(|_| Err(late()))?;
        }
        reason = cut_off => {
            return Err(Fault::Lost(reason.unwrap_or("the job is over".to_owned())));
        }
    }
    Ok(Placed {
        rows,
        bytes: sent.load(Ordering::Relaxed),
        seconds: begin.elapsed().as_secs_f64(),
    })
}

/// The rows, packed as they are sent.
fn requests(
    placing: &Placing,
    sent: Arc<AtomicU64>,
) -> impl tokio_stream::Stream<Item = PlaceRequest> + Send + 'static {
    let placement = wire::Placement {
        id: Some(placing.task.into()),
        rows: placing.rows.len() as u32,
        master: placing.master,
    };
    let rows = rows_to_wire(placing.plan.clone(), placing.rows.clone());
    let chunks = Chunks::of(rows).map(Request::Rows);
    let requests = std::iter::once(Request::Placement(placement)).chain(chunks);
    tokio_stream::iter(requests.map(move |kind| {
        let request = PlaceRequest { kind: Some(kind) };
        let bytes = request.encoded_len() as u64;
        sent.fetch_add(bytes, Ordering::Relaxed);
        TRAFFIC.add("to_workers", bytes);
        request
    }))
}
