//! Why a job or a master fails.

use std::path::PathBuf;
use std::sync::Arc;

/// Everything that ends a job or a master.
#[derive(Debug, Clone, thiserror::Error)]
pub enum Error {
    /// The job cannot be planned.
    #[error(transparent)]
    Plan(horma_core::Error),
    /// There is nobody to do it.
    #[error("no worker registered within {seconds} s")]
    NoWorkers {
        /// How long the job waited.
        seconds: u64,
    },
    /// Everybody who could have done it is gone.
    #[error("no worker is left: {last}")]
    AllLost {
        /// How the last one was lost.
        last: String,
    },
    /// An extent that nobody can do.
    #[error("extent {extent} failed {attempts} times, the last time because {last}")]
    TooManyAttempts {
        /// The extent.
        extent: u32,
        /// How often it was tried.
        attempts: u32,
        /// How the last attempt ended.
        last: String,
    },
    /// Two workers that found different positions: nobody knows which of them is right.
    #[error("attempts {0} and {1} at extent {extent} brought different positions", attempts.0, attempts.1)]
    Different {
        /// The extent.
        extent: u32,
        /// The two attempts.
        attempts: (u32, u32),
    },
    /// Stitching found that the sub-trajectories do not make a path.
    #[error("the workers' positions do not make a path: {0}")]
    Stitch(horma_core::Error),
    /// The master is stopping.
    #[error("the master was stopped before the job was done")]
    Interrupted,
    /// A thread of the master ended unexpectedly.
    #[error("a thread of the master panicked; please report this with the job")]
    Panicked,
    /// The store cannot be opened.
    #[error("the store {} cannot be used: {reason}", file.display())]
    StoreUnusable {
        /// Its file.
        file: PathBuf,
        /// Why.
        reason: String,
    },
    /// The store was written by another horma.
    #[error(
        "the store has format {found} and this horma wants {ours}; give an empty directory, or run the horma that wrote it"
    )]
    StoreFormat {
        /// The store's.
        found: u64,
        /// This program's.
        ours: u64,
    },
    /// What is in the store is not what was put there.
    #[error("the store is damaged: {0}")]
    StoreDamaged(String),
    /// The store cannot be read or written.
    #[error("the store cannot be read or written: {0}")]
    Store(Arc<redb::Error>),
    /// The server stopped.
    #[error("cannot serve: {0}")]
    Serve(Arc<tonic::transport::Error>),
}

/// The result of a job or of a master's life.
pub type Result<T> = std::result::Result<T, Error>;

/// Everything that the store's library calls an error.
macro_rules! from_store {
    ($($error:ident),*) => {$(
        impl From<redb::$error> for Error {
            fn from(error: redb::$error) -> Self {
                Self::Store(Arc::new(error.into()))
            }
        }
    )*};
}

from_store!(
    DatabaseError,
    TransactionError,
    TableError,
    StorageError,
    CommitError
);

impl From<Error> for horma_proto::Error {
    fn from(error: Error) -> Self {
        match error {
            Error::Plan(e) => Self::Core(e),
            Error::Interrupted => Self::ShuttingDown("the master"),
            other => Self::JobFailed(other.to_string()),
        }
    }
}
