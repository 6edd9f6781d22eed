//! The clock of this host as messages tell it, and the pauses between tries. Nothing is decided by it
//! that has to be the same elsewhere.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// The time since 1970.
pub fn since_1970() -> Duration {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.unwrap_or_default()
}

/// The same in whole milliseconds.
pub fn unix_ms() -> u64 {
    since_1970().as_millis() as u64
}

/// A number that differs from one start of a process to the next.
pub fn incarnation() -> u64 {
    let nanoseconds = since_1970().as_nanos() as u64;
    nanoseconds.rotate_left(20) ^ u64::from(std::process::id())
}

/// How long to wait before somebody who does not answer is tried again: twice as long each time, up to the
/// longest.
#[derive(Debug)]
pub struct Pause(Duration);

impl Pause {
    const FIRST: Duration = Duration::from_millis(100);
    const LONGEST: Duration = Duration::from_secs(2);

    /// Waits.
    pub async fn wait(&mut self) {
        tokio::time::sleep(self.0).await;
        self.0 = (2 * self.0).min(Self::LONGEST);
    }
}

impl Default for Pause {
    fn default() -> Self {
        Self(Self::FIRST)
    }
}
