//! What the wire refuses, and how it is told to the other end.

use tonic::{Code, Status};

use crate::task::TaskId;
use crate::tls::Role;

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
    /// A caller without a certificate where one is demanded.
    #[error("this call needs a certificate, and there is none")]
    Unproven,
    /// A caller with another role than the call is for.
    #[error("this call is for a {role}, and the caller's certificate names {found}")]
    Forbidden {
        /// The role that it is for.
        role: Role,
        /// What the caller's certificate names, in words.
        found: String,
    },
    /// A worker that is not believed any more.
    #[error("worker {worker} has answered wrongly before; restart it")]
    Distrusted {
        /// Its name.
        worker: String,
    },
    /// A caller that keeps an open call waiting.
    #[error("nothing came for {seconds} s")]
    TooSlow {
        /// How long it was waited for.
        seconds: u64,
    },
    /// Rows that this worker does not hold (any more).
    #[error("the rows of {id} are not here")]
    NotHeld {
        /// By which they were asked for.
        id: TaskId,
    },
    /// Beyond a limit of the server, now or ever.
    #[error("{0}")]
    Limit(String),
    /// A job that the master does not know (any more), or whose result it does not have (any more).
    #[error("{0}")]
    NoSuchJob(String),
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
            Self::Limit(_) => Code::ResourceExhausted,
            Self::Core(_) | Self::Missing { .. } | Self::Ragged { .. } | Self::Malformed(_) => {
                Code::InvalidArgument
            }
            Self::Checksum { .. } | Self::Incomplete { .. } => Code::DataLoss,
            Self::TooLarge { .. } => Code::OutOfRange,
            Self::Version { .. } | Self::Distrusted { .. } => Code::FailedPrecondition,
            Self::Unproven => Code::Unauthenticated,
            Self::Forbidden { .. } => Code::PermissionDenied,
            Self::TooSlow { .. } => Code::DeadlineExceeded,
            Self::UnknownWorker { .. } | Self::NotHeld { .. } | Self::NoSuchJob(_) => {
                Code::NotFound
            }
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

/// What a status says to the end that gets it: every code has one meaning.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    /// What was sent cannot be right.
    Wrong,
    /// What was asked cannot be done.
    Impossible,
    /// It was tried and failed, or the two ends do not fit together.
    Failed,
    /// The one who asked may not.
    Forbidden,
    /// The one who asked is not known.
    Stranger,
    /// No answer at all: a partition may show as almost any code.
    Silence,
}

impl Answer {
    /// The meaning of this status.
    pub fn of(status: &Status) -> Self {
        match status.code() {
            Code::InvalidArgument | Code::OutOfRange | Code::DataLoss | Code::Unimplemented => {
                Self::Wrong
            }
            Code::ResourceExhausted => Self::Impossible,
            Code::Aborted | Code::FailedPrecondition => Self::Failed,
            Code::PermissionDenied | Code::Unauthenticated => Self::Forbidden,
            Code::NotFound => Self::Stranger,
            Code::Ok
            | Code::Cancelled
            | Code::Unknown
            | Code::DeadlineExceeded
            | Code::AlreadyExists
            | Code::Internal
            | Code::Unavailable => Self::Silence,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_means_the_same_at_both_ends() {
        let worker = || "w".to_owned();
        let cases = [
            (Error::Malformed("x".to_owned()), Answer::Wrong),
            (Error::TooLarge { bytes: 2, limit: 1 }, Answer::Wrong),
            (
                Error::Checksum {
                    found: 1,
                    expected: 2,
                },
                Answer::Wrong,
            ),
            (Error::JobFailed("x".to_owned()), Answer::Failed),
            (Error::Distrusted { worker: worker() }, Answer::Failed),
            (Error::Unproven, Answer::Forbidden),
            (
                Error::Forbidden {
                    role: Role::Worker,
                    found: "no role".to_owned(),
                },
                Answer::Forbidden,
            ),
            (Error::UnknownWorker { worker: worker() }, Answer::Stranger),
            (Error::ShuttingDown("the master"), Answer::Silence),
            (Error::TooSlow { seconds: 30 }, Answer::Silence),
        ];
        for (error, expected) in cases {
            let status = Status::from(error.clone());
            assert_eq!(Answer::of(&status), expected, "{error}");
            assert_eq!(status.message(), error.to_string());
        }
    }
}
