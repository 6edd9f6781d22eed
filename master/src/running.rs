//! A job that is going on: what it consists of, what has come of it, and what it took.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use horma_core::{
    Counters, Distribution, Extent, ExtentRecord, Handout, LostAttempt, Record, SubTrajectory,
    Traffic, WorkerRecord,
};
use horma_proto::{TaskId, Tls};
use tokio::sync::oneshot;

use crate::Progress;
use crate::dispatch::Attempt;
use crate::error::Result;
use crate::place::{Placed, Placing};
use crate::state::{Fault, Held};

/// Who waits for a job.
type Reply = oneshot::Sender<Result<(Vec<SubTrajectory>, Record)>>;

pub(crate) struct RunningJob {
    pub begin: Instant,
    pub plan: Arc<Handout>,
    pub extents: Vec<Extent>,
    /// How many extents need each row.
    users: Vec<u32>,
    pub progress: Progress,
    /// Positions that have arrived.
    arrived: Arc<AtomicU64>,
    /// Inserted positions that have arrived.
    pub inserted: Arc<AtomicU64>,
    /// What was delivered and kept, by extent.
    pub kept: BTreeMap<u32, (Vec<SubTrajectory>, ExtentRecord)>,
    /// What placing rows has taken so far, by extent.
    pub placed: BTreeMap<u32, Placed>,
    pub lost: Vec<LostAttempt>,
    /// Calls under way: each ends when it is told why, or when the job is dropped.
    pub calls: BTreeMap<TaskId, oneshot::Sender<String>>,
    workers: BTreeMap<String, String>,
    pub reply: Reply,
}

impl RunningJob {
    /// Splits a plan into at most `parts` extents.
    pub fn new(plan: Arc<Handout>, parts: u32, progress: Progress, reply: Reply) -> Self {
        let extents = plan.split(parts);
        let mut users = vec![0; plan.outlines.len()];
        for &row in extents.iter().flat_map(|e| &e.rows) {
            users[row as usize] += 1;
        }
        Self {
            begin: Instant::now(),
            plan,
            extents,
            users,
            progress,
            arrived: Arc::default(),
            inserted: Arc::default(),
            kept: BTreeMap::new(),
            placed: BTreeMap::new(),
            lost: Vec::new(),
            calls: BTreeMap::new(),
            workers: BTreeMap::new(),
            reply,
        }
    }

    /// For each extent the others whose rows it needs, if rows are to be placed.
    pub fn halos(&self) -> Option<Vec<Vec<u32>>> {
        let halo = |extent: &Extent| extent.halo.iter().map(|h| h.extent).collect();
        match self.plan.distribution {
            Distribution::Overlap | Distribution::Surface => None,
            Distribution::Halo => Some(self.extents.iter().map(halo).collect()),
        }
    }

    /// Writes down a call that begins; it ends early when it is told why, by what this returns.
    pub fn call(&mut self, task: TaskId, worker: &str, address: &str) -> oneshot::Receiver<String> {
        let (call, cut_off) = oneshot::channel();
        self.calls.insert(task, call);
        self.workers.insert(worker.to_owned(), address.to_owned());
        cut_off
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

    /// What an attempt at an extent takes.
    pub fn attempt(
        &self,
        task: TaskId,
        worker: &str,
        address: &str,
        holders: Vec<(Held, String)>,
        tls: Option<Tls>,
    ) -> Attempt {
        let extent = self.extents[task.extent as usize].clone();
        let shared = |row: &&u32| self.users[**row as usize] > 1;
        Attempt {
            task,
            worker: worker.to_owned(),
            address: address.to_owned(),
            plan: self.plan.clone(),
            overlap_rows: extent.rows.iter().filter(shared).count() as u32,
            extent,
            holders,
            arrived: self.arrived.clone(),
            inserted: self.inserted.clone(),
            progress: self.progress.clone(),
            tls,
        }
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

    /// Positions that have arrived, and those inserted between them.
    pub fn so_far(&self) -> [u64; 2] {
        [&self.arrived, &self.inserted].map(|n| n.load(Ordering::Relaxed))
    }

    /// What has travelled for what is kept, and for rows that are placed.
    pub fn traffic(&self) -> Traffic {
        let mut traffic = Traffic {
            rows_needed: self.users.iter().filter(|&&n| n > 0).count() as u64,
            ..Traffic::default()
        };
        for (_, record) in self.kept.values() {
            traffic.rows_sent += record.rows_sent;
            traffic.bytes_to_workers += record.bytes_sent;
            traffic.bytes_between_workers += record.bytes_fetched;
            traffic.bytes_of_results += record.bytes_received;
        }
        for placed in self.placed.values() {
            traffic.rows_sent += placed.rows;
            traffic.bytes_to_workers += placed.bytes;
        }
        traffic
    }

    /// Hands over what was kept.
    pub fn complete(self) {
        let traffic = self.traffic();
        let mut counters = Counters::default();
        let (mut parts, mut extents) = (Vec::new(), Vec::new());
        for (extent, (positions, mut record)) in self.kept {
            let placed = self.placed.get(&extent).copied().unwrap_or_default();
            record.rows_sent += placed.rows;
            record.bytes_sent += placed.bytes;
            record.place_seconds = placed.seconds;
            counters += record.counters;
            parts.extend(positions);
            extents.push(record);
        }
        let worker = |(worker, address)| WorkerRecord { worker, address };
        let record = Record {
            counters,
            traffic: Some(traffic),
            workers: self.workers.into_iter().map(worker).collect(),
            extents,
            lost: self.lost,
            ..Record::default()
        };
        let _ = self.reply.send(Ok((parts, record)));
    }
}
