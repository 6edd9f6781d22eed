//! Everything that can be wrong with a file.

use std::path::PathBuf;

/// What is wrong with a file that was read or written.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The operating system refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
}

/// The result of reading or writing.
pub type Result<T> = std::result::Result<T, Error>;
