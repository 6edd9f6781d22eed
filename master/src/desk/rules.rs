//! Which job begins next, and which results and jobs go: plain functions over what the desk knows.

use std::time::Duration;

use crate::Limits;

/// Jobs that are over and still known: the oldest are forgotten beyond that.
const REMEMBERED: usize = 10_000;

/// What is being done for a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Work {
    Nothing,
    /// One at a time, so that jobs begin in their order.
    Planning,
    Digitizing,
}

/// The first job that waits, if it may begin beside those under way: jobs that are not over, each with
/// the memory it takes and what is being done for it. None overtakes another, so none waits for ever.
pub(super) fn next(open: &[(u64, u64, Work)], at_once: usize, memory: u64) -> Option<u64> {
    let (waiting, busy): (Vec<_>, Vec<_>) = open.iter().partition(|job| job.2 == Work::Nothing);
    let &&(next, needed, _) = waiting.first()?;
    let taken = busy
        .iter()
        .fold(0, |sum: u64, job| sum.saturating_add(job.1));
    let planning = busy.iter().any(|job| job.2 == Work::Planning);
    let fits = busy.is_empty() || taken.saturating_add(needed) <= memory;
    (fits && !planning && busy.len() < at_once).then_some(next)
}

/// What is not kept any longer.
#[derive(Debug, PartialEq, Eq, Default)]
pub(super) struct Expired {
    /// Jobs whose results go.
    pub dropped: Vec<u64>,
    /// Jobs that are forgotten altogether.
    pub forgotten: Vec<u64>,
}

/// Results go when they are too old, and the oldest when all take too much; jobs go when they ended long
/// ago, and the oldest when there are too many. Of each: when it ended, its number, its result's bytes.
pub(super) fn expired(
    mut ended: Vec<(Duration, u64, u64)>,
    limits: &Limits,
    now: Duration,
) -> Expired {
    // The newest first.
    ended.sort_unstable_by(|a, b| b.cmp(a));
    let mut all = Expired::default();
    let mut kept = 0u64;
    for (i, &(at, job, bytes)) in ended.iter().enumerate() {
        let age = now.saturating_sub(at);
        kept = kept.saturating_add(bytes);
        if i >= REMEMBERED || (bytes == 0 && age > limits.keep) {
            all.forgotten.push(job);
        } else if bytes > 0 && (age > limits.keep || kept > limits.keep_bytes) {
            all.dropped.push(job);
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use Work::{Digitizing, Nothing, Planning};

    #[test]
    fn jobs_begin_in_order_as_far_as_memory_goes() {
        let check = |open: &[(u64, u64, Work)], expected| {
            assert_eq!(next(open, 3, 100), expected, "{open:?}");
        };
        check(&[], None);
        check(&[(1, 500, Nothing)], Some(1));
        check(&[(1, 50, Planning), (2, 1, Nothing)], None);
        check(&[(1, 50, Digitizing), (2, 50, Nothing)], Some(2));
        check(&[(1, 50, Digitizing), (2, 51, Nothing)], None);
        // The big one is not overtaken for ever.
        let big = [(1, 50, Digitizing), (2, 51, Nothing), (3, 1, Nothing)];
        check(&big, None);
        let three = [1, 2, 3].map(|job| (job, 1, Digitizing));
        check(&[&three[..], &[(4, 1, Nothing)]].concat(), None);
        check(&[(1, u64::MAX, Digitizing), (2, u64::MAX, Nothing)], None);
    }

    #[test]
    fn results_are_dropped_by_age_and_by_size_and_jobs_forgotten_later() {
        let limits = Limits {
            part: 0,
            queue: 1,
            calls: 1,
            running: 1,
            keep_bytes: 100,
            keep: Duration::from_secs(10),
        };
        let at = Duration::from_secs;
        let check = |ended: &[(u64, u64)], dropped: &[u64], forgotten: &[u64]| {
            let numbered = (1..).zip(ended);
            let ended = numbered.map(|(job, &(seconds, bytes))| (at(seconds), job, bytes));
            let all = expired(ended.collect(), &limits, at(100));
            assert_eq!((&all.dropped[..], &all.forgotten[..]), (dropped, forgotten));
        };
        check(&[(95, 50), (96, 50)], &[], &[]);
        check(&[(89, 1), (95, 1)], &[1], &[]);
        check(&[(89, 0), (95, 0)], &[], &[1]);
        check(&[(95, 40), (97, 30), (96, 40)], &[1], &[]);
        check(&[(95, 101)], &[1], &[]);
        let many = vec![(95, 0); REMEMBERED + 1];
        check(&many, &[], &[1]);
    }
}
