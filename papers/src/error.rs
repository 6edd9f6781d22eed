//! What can go wrong.

/// Everything that ends an experiment.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A word that there cannot be.
    #[error(
        "a word of {bits} bits, {fraction} of them after the point; at least 4 and at most 48 bits, and one before the point"
    )]
    Format {
        /// Bits of the word.
        bits: u32,
        /// Bits after the point.
        fraction: u32,
    },
    /// The mathematics refused something.
    #[error(transparent)]
    Core(#[from] horma_core::Error),
    /// A file could not be read or written.
    #[error(transparent)]
    Formats(#[from] horma_formats::Error),
}

/// A value, or why there is none.
pub type Result<T> = std::result::Result<T, Error>;
