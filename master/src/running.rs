//! A job that is going on: what it consists of, what has come of it, and what it took.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use horma_core::{
    Counters, Distribution, Extent, ExtentRecord, Handout, LostAttempt, Record, SecondAttempt,
    Share, Stock, SubTrajectory, Traffic, WorkerRecord,
};
use horma_proto::{TaskId, Tls};
use tokio::sync::oneshot;
use tracing::Span;

use crate::Progress;
use crate::dispatch::{Attempt, Coming, needed};
use crate::error::Result;
use crate::journal::{Journal, Kept, Resumed};
use crate::place::{Placed, Placing};
use crate::state::{Fault, Held};

/// Who waits for a job.
pub(crate) type Reply = oneshot::Sender<Result<(Vec<SubTrajectory>, Record)>>;

pub(crate) struct RunningJob {
    pub begin: Instant,
    /// Positions that were in the journal already.
    pub resumed: u64,
    pub plan: Arc<Handout>,
    pub extents: Vec<Extent>,
    /// What has come of each.
    coming: Vec<Arc<Coming>>,
    /// Rows that went with tasks, by extent.
    rows_sent: BTreeMap<u32, u64>,
    /// How many extents need each row.
    users: Vec<u32>,
    pub progress: Progress,
    /// Positions that have arrived.
    arrived: Arc<AtomicU64>,
    /// Inserted positions that have arrived.
    pub inserted: Arc<AtomicU64>,
    /// What was delivered and kept, by extent.
    pub kept: BTreeMap<u32, Kept>,
    /// Where that is written down, if it is.
    journal: Option<Journal>,
    /// How much of it was in the journal already.
    from_journal: u32,
    /// What placing rows has taken so far, by extent.
    pub placed: BTreeMap<u32, Placed>,
    pub lost: Vec<LostAttempt>,
    second: Vec<SecondAttempt>,
    /// Calls under way.
    pub calls: BTreeMap<TaskId, Call>,
    /// Who made each attempt at each extent.
    made_by: BTreeMap<(u32, u32), String>,
    workers: BTreeMap<String, String>,
    /// What is done for it is a child of this.
    pub span: Span,
    pub reply: Reply,
}

/// A call under way: it ends when it is told why, or when this is dropped.
pub(crate) struct Call {
    pub worker: String,
    pub cut_off: oneshot::Sender<String>,
    came: Arc<AtomicU64>,
}

impl Call {
    /// Positions that have come by it.
    pub fn came(&self) -> u64 {
        self.came.load(Ordering::Relaxed)
    }
}

impl RunningJob {
    /// Splits a plan for so many workers into extents, some of which may be there already.
    pub fn new(
        plan: Arc<Handout>,
        workers: u32,
        resumed: Option<Resumed>,
        progress: Progress,
        span: Span,
        reply: Reply,
    ) -> Self {
        let extents = plan.split(workers);
        let mut users = vec![0; plan.outlines.len()];
        for &row in extents.iter().flat_map(|e| &e.rows) {
            users[row as usize] += 1;
        }
        let (journal, kept) = resumed.map_or((None, BTreeMap::new()), |resumed| {
            (Some(resumed.journal), resumed.kept)
        });
        let runs = || kept.values().flat_map(|(runs, _)| runs.iter());
        let arrived: usize = runs().map(|run| run.touches.len()).sum();
        let inserted: usize = runs().map(|run| run.between.len()).sum();
        // Of what is there already nothing is to come.
        let coming = |extent: &Extent| match kept.get(&extent.id) {
            Some(_) => Arc::default(),
            None => Arc::new(Coming::of(extent)),
        };
        Self {
            begin: Instant::now(),
            resumed: arrived as u64,
            coming: extents.iter().map(coming).collect(),
            plan,
            extents,
            rows_sent: BTreeMap::new(),
            users,
            progress,
            arrived: Arc::new(AtomicU64::new(arrived as u64)),
            inserted: Arc::new(AtomicU64::new(inserted as u64)),
            from_journal: kept.len() as u32,
            kept,
            journal,
            placed: BTreeMap::new(),
            lost: Vec::new(),
            second: Vec::new(),
            made_by: BTreeMap::new(),
            calls: BTreeMap::new(),
            workers: BTreeMap::new(),
            span,
            reply,
        }
    }

    /// For each extent the others whose rows it needs, if rows are to be placed.
    pub fn halos(&self) -> Option<Vec<Vec<u32>>> {
        let halo = |extent: &Extent| extent.halo.iter().map(|h| h.extent).collect();
        match self.plan.sharing.distribution {
            Distribution::Overlap | Distribution::Surface => None,
            Distribution::Halo => Some(self.extents.iter().map(halo).collect()),
        }
    }

    /// Writes down a call that begins; it ends early when it is told why, by what this returns.
    pub fn call(&mut self, task: TaskId, worker: &str, address: &str) -> oneshot::Receiver<String> {
        let (sender, cut_off) = oneshot::channel();
        let call = Call {
            worker: worker.to_owned(),
            cut_off: sender,
            came: Arc::default(),
        };
        self.calls.insert(task, call);
        self.workers.insert(worker.to_owned(), address.to_owned());
        self.made_by
            .insert((task.extent, task.attempt), worker.to_owned());
        cut_off
    }

    /// How far the calls are: by whom, for what, how many positions have come by it, and how many of its
    /// extent are missing.
    pub fn progress(&self) -> Vec<(String, TaskId, u64, u64)> {
        let far = |(&task, call): (&TaskId, &Call)| {
            (
                call.worker.clone(),
                task,
                call.came(),
                self.left(task.extent),
            )
        };
        self.calls.iter().map(far).collect()
    }

    /// How many positions of an extent have not come.
    pub fn left(&self, extent: u32) -> u64 {
        self.coming[extent as usize].received().left()
    }

    /// What placing an extent's own rows takes.
    pub fn placing(&self, task: TaskId, address: &str, master: u64, tls: Option<Tls>) -> Placing {
        Placing {
            master,
            task,
            address: address.to_owned(),
            tls,
            plan: self.plan.clone(),
            rows: self.extents[task.extent as usize].own.clone(),
        }
    }

    /// What an attempt at an extent takes, which is to bring what is missing; if it helps someone, why.
    pub fn attempt(
        &mut self,
        task: TaskId,
        worker: &str,
        address: &str,
        holders: Vec<(Held, String)>,
        helps: Option<String>,
        tls: Option<Tls>,
    ) -> Attempt {
        let extent = self.extents[task.extent as usize].clone();
        let coming = self.coming[task.extent as usize].clone();
        let missing = coming.received().missing();
        let runs = self.plan.runs_left(&extent, &missing, helps.is_some());
        let rows = match (&self.plan.stock, &holders[..]) {
            (Stock::Rows(_), []) => needed(&runs),
            (Stock::Rows(_), _) | (Stock::Grids(_), _) => Vec::new(),
        };
        *self.rows_sent.entry(task.extent).or_default() += rows.len() as u64;
        if let Some(reason) = helps {
            self.second.push(SecondAttempt {
                extent: task.extent,
                attempt: task.attempt,
                worker: worker.to_owned(),
                positions: missing.iter().map(|gap| gap.end - gap.start).sum(),
                rows_sent: rows.len() as u64,
                reason,
            });
        }
        let came = self.calls.get(&task).map(|call| call.came.clone());
        let shared = |row: &&u32| self.users[**row as usize] > 1;
        Attempt {
            task,
            worker: worker.to_owned(),
            address: address.to_owned(),
            plan: self.plan.clone(),
            overlap_rows: extent.rows.iter().filter(shared).count() as u32,
            extent,
            runs,
            rows,
            holders,
            coming,
            came: came.unwrap_or_default(),
            arrived: self.arrived.clone(),
            inserted: self.inserted.clone(),
            progress: self.progress.clone(),
            tls,
        }
    }

    /// Tells whoever waits how far it is.
    pub fn tell_progress(&self) {
        let arrived = self.arrived.load(Ordering::Relaxed);
        (self.progress)("digitize", arrived, self.plan.trajectory.positions);
    }

    /// Writes down an attempt that came to nothing.
    pub fn lose(&mut self, worker: &str, task: TaskId, fault: &Fault, positions_received: u64) {
        self.lost.push(LostAttempt {
            extent: task.extent,
            attempt: task.attempt,
            worker: worker.to_owned(),
            positions_received,
            positions: self.extents[task.extent as usize].count,
            reason: fault.to_string(),
        });
    }

    /// Keeps an extent of which nothing is missing, with the record of the attempt that completed it, and
    /// has it written down.
    pub fn keep(&mut self, extent: u32, mut record: ExtentRecord) {
        let coming = &self.coming[extent as usize];
        let received = std::mem::take(&mut *coming.received());
        let share = |(attempt, positions)| Share {
            attempt,
            worker: self.made_by[&(extent, attempt)].clone(),
            positions,
        };
        record.shares = received.shares().into_iter().map(share).collect();
        record.counters = received.cost();
        (record.rows_sent, record.bytes_sent) = self.sent(extent);
        record.bytes_received = coming.bytes.load(Ordering::Relaxed);
        record.place_seconds = self
            .placed
            .get(&extent)
            .map_or(0.0, |placed| placed.seconds);
        let kept = (Arc::new(received.into_parts()), record);
        if let Some(journal) = &self.journal {
            journal.keep(extent, kept.clone());
        }
        self.kept.insert(extent, kept);
    }

    /// Rows and bytes that have been sent for an extent, placed before tasks or with them.
    fn sent(&self, extent: u32) -> (u64, u64) {
        let placed = self.placed.get(&extent).copied().unwrap_or_default();
        let rows = self.rows_sent.get(&extent).copied().unwrap_or_default();
        let bytes = self.coming[extent as usize].sent.load(Ordering::Relaxed);
        (placed.rows + rows, placed.bytes + bytes)
    }

    /// Positions that have arrived, and those inserted between them.
    pub fn so_far(&self) -> [u64; 2] {
        [&self.arrived, &self.inserted].map(|n| n.load(Ordering::Relaxed))
    }

    /// What has travelled so far. What workers got from each other is known once an extent is kept.
    pub fn traffic(&self) -> Traffic {
        let mut traffic = Traffic {
            rows_needed: self.users.iter().filter(|&&n| n > 0).count() as u64,
            ..Traffic::default()
        };
        for (extent, coming) in (0..).zip(&self.coming) {
            if let Some((_, record)) = self.kept.get(&extent) {
                traffic.rows_sent += record.rows_sent;
                traffic.bytes_to_workers += record.bytes_sent;
                traffic.bytes_between_workers += record.bytes_fetched;
                traffic.bytes_of_results += record.bytes_received;
            } else {
                let (rows, bytes) = self.sent(extent);
                traffic.rows_sent += rows;
                traffic.bytes_to_workers += bytes;
                traffic.bytes_of_results += coming.bytes.load(Ordering::Relaxed);
            }
        }
        traffic
    }

    /// Hands over what was kept.
    pub fn complete(self) {
        let mut counters = Counters::default();
        let traffic = self.traffic();
        let (mut parts, mut extents) = (Vec::new(), Vec::new());
        for (positions, record) in self.kept.into_values() {
            counters += record.counters;
            parts.extend(Arc::unwrap_or_clone(positions));
            extents.push(record);
        }
        let worker = |(worker, address)| WorkerRecord { worker, address };
        let record = Record {
            counters,
            traffic: Some(traffic),
            workers: self.workers.into_iter().map(worker).collect(),
            extents,
            extents_from_journal: self.from_journal,
            lost: self.lost,
            second: self.second,
            ..Record::default()
        };
        let _ = self.reply.send(Ok((parts, record)));
    }
}
