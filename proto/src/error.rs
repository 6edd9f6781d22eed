//! What the wire refuses, and how it is told to the other end.

use tonic::{Code, Status};

use crate::task::TaskId;

/// Everything that can be wrong with a message, and everything a service refuses.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// A value that the mathematics refuses.
    #[error(transparent)]
    Core(#[from] horma_core::Error),
    /// A field that must be there.
    #[error("a {message} message arrived without {field}")]
    Missing {
        /// The message.
        message: &'static str,
        /// The field, or what it stands for.
        field: &'static str,
    },
    /// Packed numbers of the wrong length.
    #[error("{what} take {bytes} bytes, which is not a multiple of {size}")]
    Ragged {
        /// What is packed.
        what: &'static str,
        /// Bytes that came.
        bytes: usize,
        /// Bytes of one.
        size: usize,
    },
    /// A chunk that is not what was sent.
    #[error("a chunk arrived with checksum {found:08x} instead of {expected:08x}")]
    Checksum {
        /// As computed on arrival.
        found: u32,
        /// As sent with it.
        expected: u32,
    },
    /// Bytes that are no message.
    #[error("malformed message: {0}")]
    Malformed(String),
    /// A message larger than the limit.
    #[error("a message of {bytes} bytes is more than the {limit} that are accepted")]
    TooLarge {
        /// Its size.
        bytes: usize,
        /// The limit.
        limit: usize,
    },
    /// A stream that ends before it is complete, or goes on after it.
    #[error("{what}: expected {expected}, got {found}")]
    Incomplete {
        /// What was streamed.
        what: &'static str,
        /// How many were announced.
        expected: u64,
        /// How many came.
        found: u64,
    },
    /// The other end runs another version of horma.
    #[error(
        "this is horma {ours} and the other end is horma {theirs}; run the same version everywhere"
    )]
    Version {
        /// This end's.
        ours: &'static str,
        /// The other end's.
        theirs: String,
    },
    /// A worker that the master does not know (any more).
    #[error("worker {worker} is not registered")]
    UnknownWorker {
        /// Its name.
        worker: String,
    },
    /// Rows that this worker does not hold (any more).
    #[error("the rows of {id} are not here")]
    NotHeld {
        /// By which they were asked for.
        id: TaskId,
    },
    /// The job failed on the cluster.
    #[error("{0}")]
    JobFailed(String),
    /// The other end is stopping.
    #[error("{0} is shutting down")]
    ShuttingDown(&'static str),
}

/// The result of reading a message.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// The status code that tells the other end what kind of error this is. Only UNAVAILABLE,
    /// NOT_FOUND and DATA_LOSS are worth another try, the latter with another worker.
    fn code(&self) -> Code {
        match self {
            Self::Core(error) if error.is_impossible() => Code::ResourceExhausted,
            Self::Core(_) | Self::Missing { .. } | Self::Ragged { .. } | Self::Malformed(_) => {
                Code::InvalidArgument
            }
            Self::Checksum { .. } | Self::Incomplete { .. } => Code::DataLoss,
            Self::TooLarge { .. } => Code::OutOfRange,
            Self::Version { .. } => Code::FailedPrecondition,
            Self::UnknownWorker { .. } | Self::NotHeld { .. } => Code::NotFound,
            Self::JobFailed(_) => Code::Aborted,
            Self::ShuttingDown(_) => Code::Unavailable,
        }
    }
}

impl From<Error> for Status {
    fn from(error: Error) -> Self {
        Self::new(error.code(), error.to_string())
    }
}
