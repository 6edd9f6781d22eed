//! Why a worker stops.

use std::time::Duration;

/// Everything that ends a worker but a request to stop.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The master's address cannot be one.
    #[error("{address:?} is not an address of the form host:port")]
    Address {
        /// As given.
        address: String,
    },
    /// The master never answered.
    #[error("no master answered at {address} within {} s ({reason}); is it running, and reachable from here", waited.as_secs())]
    NoMaster {
        /// Where it was looked for.
        address: String,
        /// For how long.
        waited: Duration,
        /// The last error.
        reason: String,
    },
    /// The master is gone, and was not done.
    #[error("the master at {address} did not come back within {} s while {jobs} of its jobs were under way; start it again on its store, and the workers", waited.as_secs())]
    MasterGone {
        /// Where it was.
        address: String,
        /// For how long it was looked for.
        waited: Duration,
        /// How many jobs were going on.
        jobs: usize,
    },
    /// The master does not want this worker.
    #[error("the master at {address} refuses this worker: {reason}")]
    Refused {
        /// Where it is.
        address: String,
        /// Its words.
        reason: String,
    },
    /// The master and this worker do not trust each other.
    #[error("the master at {address} and this worker do not trust each other: {reason}")]
    Untrusted {
        /// Where it is.
        address: String,
        /// Who does not trust whom, and why.
        reason: String,
    },
    /// The listener is gone.
    #[error("the listening socket has no address: {0}")]
    Listener(std::io::Error),
    /// No threads.
    #[error("cannot start threads: {0}")]
    Threads(rayon::ThreadPoolBuildError),
    /// The server stopped.
    #[error("cannot serve: {0}")]
    Serve(tonic::transport::Error),
}

/// The result of a worker's life.
pub type Result<T> = std::result::Result<T, Error>;
