//! What has happened lately: events in words for those who watch, and the last jobs that are
//! over. It forgets what is old, and nothing depends on it.

use std::collections::VecDeque;

use horma_proto::clock::unix_ms;
use horma_proto::metrics::ATTEMPTS_LOST;
use serde::Serialize;

use crate::snapshot::Job;
use crate::state::{Command, Event, Fault};

/// Events that are remembered.
const HAPPENINGS: usize = 200;

/// Jobs that are remembered after they are over.
const ENDED: usize = 20;

/// An event in words.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Happening {
    /// Counted from 1 since the master started.
    pub id: u64,
    /// When, ms since 1970.
    pub at: u64,
    /// Whether something went wrong.
    pub bad: bool,
    /// What.
    pub text: String,
}

/// All that is remembered.
#[derive(Debug, Default)]
pub(crate) struct History {
    happenings: VecDeque<Happening>,
    last: u64,
    ended: VecDeque<Job>,
}

impl History {
    /// Writes down an event.
    pub fn happened(&mut self, event: &Event) {
        if let Event::Failed { fault, .. } = event {
            let reason = match fault {
                Fault::Lost(_) => "lost",
                Fault::Wrong(_) => "wrong",
                Fault::Halo { .. } => "halo",
                Fault::Different { .. } => "different",
            };
            ATTEMPTS_LOST.add(reason, 1);
        }
        if let Some((bad, text)) = event_in_words(event) {
            self.remember(bad, text);
        }
    }

    /// Writes down what was decided on it.
    pub fn decided(&mut self, commands: &[Command]) {
        for (bad, text) in commands.iter().filter_map(command_in_words) {
            self.remember(bad, text);
        }
    }

    fn remember(&mut self, bad: bool, text: String) {
        self.last += 1;
        if self.happenings.len() == HAPPENINGS {
            self.happenings.pop_front();
        }
        self.happenings.push_back(Happening {
            id: self.last,
            at: unix_ms(),
            bad,
            text,
        });
    }

    /// Writes down that a job is over.
    pub fn end(&mut self, job: Job) {
        self.ended.push_front(job);
        self.ended.truncate(ENDED);
    }

    /// What came after that event; all of it if that was before this master's start.
    pub fn since(&self, id: u64) -> impl Iterator<Item = &Happening> {
        let id = if id > self.last { 0 } else { id };
        self.happenings.iter().filter(move |h| h.id > id)
    }

    /// Jobs that are over, newest first.
    pub fn ended(&self) -> impl Iterator<Item = &Job> {
        self.ended.iter()
    }
}

/// An event in words; true where something went wrong.
fn event_in_words(event: &Event) -> Option<(bool, String)> {
    match event {
        Event::Heartbeat { .. } | Event::Tick | Event::Progress { .. } => None,
        Event::Left { worker } => Some((false, format!("worker {worker} leaves"))),
        Event::Drain => Some((false, "the master is about to stop".to_owned())),
        Event::Registered { worker, .. } => Some((false, format!("worker {worker} registered"))),
        Event::Submitted { job, extents, .. } => {
            Some((false, format!("job {job} begins, in {extents} extents")))
        }
        Event::Cancelled { job } => Some((true, format!("job {job} is no longer wanted"))),
        Event::Placed { worker, task } => {
            Some((false, format!("{task}: worker {worker} holds the rows")))
        }
        Event::Delivered { worker, task, .. } => {
            Some((false, format!("{task}: delivered by worker {worker}")))
        }
        Event::Failed {
            worker,
            task,
            fault,
            ..
        } => Some((true, format!("{task}: failed on worker {worker}, {fault}"))),
    }
}

/// A decision in words; true where something went wrong.
fn command_in_words(command: &Command) -> Option<(bool, String)> {
    match command {
        Command::Keep { .. } => None,
        Command::Place { worker, task } => {
            Some((false, format!("{task}: its rows go to worker {worker}")))
        }
        Command::Start {
            worker,
            task,
            helps: Some(why),
            ..
        } => Some((false, format!("{task}: worker {worker} helps, {why}"))),
        Command::Start { worker, task, .. } => {
            Some((false, format!("{task}: given to worker {worker}")))
        }
        Command::Abort { task, reason } => Some((true, format!("{task}: given up, {reason}"))),
        Command::Complete { job } => Some((false, format!("job {job} is digitized"))),
        Command::Fail { job, error } => Some((true, format!("job {job} failed: {error}"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn registered(n: usize) -> Event {
        Event::Registered {
            worker: format!("w{n}"),
            incarnation: 1,
        }
    }

    #[test]
    fn the_last_events_are_remembered_and_counted() {
        let mut history = History::default();
        let many = HAPPENINGS + 10;
        for n in 1..=many {
            history.happened(&registered(n));
            history.happened(&Event::Tick);
        }
        let all: Vec<_> = history.since(0).collect();
        assert_eq!(all.len(), HAPPENINGS);
        assert_eq!(all[0].id, 11);
        let last: Vec<_> = history.since(many as u64 - 1).collect();
        assert_eq!(last.len(), 1);
        assert_eq!(last[0].text, format!("worker w{many} registered"));
        assert!(!last[0].bad);
    }

    #[test]
    fn what_was_decided_follows_what_happened() {
        let mut history = History::default();
        let reason = "worker a started anew".to_owned();
        let task = horma_proto::TaskId {
            job: 1,
            extent: 2,
            attempt: 3,
        };
        history.happened(&registered(1));
        history.decided(&[Command::Abort { task, reason }]);
        let texts: Vec<_> = history.since(0).map(|h| (h.bad, h.text.as_str())).collect();
        let given_up = "job 1, extent 2, attempt 3: given up, worker a started anew";
        assert_eq!(texts, [(false, "worker w1 registered"), (true, given_up)]);
    }
}
