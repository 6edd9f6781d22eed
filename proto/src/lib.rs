//! The cluster's wire protocol.
//!
//! `cluster.proto` is the contract; [`wire`] is what is generated from it, `convert` takes it to
//! and from the core's valid types, `chunk` cuts what is large. Whatever arrives is checked here:
//! past this crate a value is as valid as one made in this process. [`transport`] says how a connection
//! is made and [`tls`] who may speak on it; this crate opens none of its own accord and reads no file.

mod chunk;
mod convert;
mod error;
mod span;
mod task;

mod accept;
pub mod clock;
mod limit;
pub mod metrics;
mod refused;
pub mod tls;
pub mod trace;
pub mod transport;

/// The generated types and services. They stay at the edges: everything else uses the core's types.
#[allow(missing_docs, unused_qualifications, clippy::all, clippy::pedantic)]
#[allow(clippy::needless_pass_by_value, clippy::semicolon_if_nothing_returned)]
pub mod wire {
    tonic::include_proto!("horma.cluster.v1");
    pub(crate) const DESCRIPTORS: &[u8] = tonic::include_file_descriptor_set!("descriptors");
}

pub use chunk::{CHUNK_BYTES, Chunks, Messages, chunk, open, seal};
pub use chunk::{checksum, pack_positions, position_chunks, unpack_positions};
pub use convert::{body_from_wire, body_to_wire, job_from_wire, job_to_wire};
pub use convert::{counters_from_wire, counters_to_wire};
pub use convert::{grid_from_wire, grid_to_wire, sharing_from_wire, sharing_to_wire};
pub use convert::{row_from_wire, row_to_wire, trajectory_from_wire, trajectory_to_wire};
pub use error::{Answer, Error, Result};
pub use span::{in_spans, spanned, spans_of};
pub use task::TaskId;
pub use tls::{Guard, Role, Tls};

/// The version that both ends of a connection must share.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Greatest size of any single message, bytes: a chunk and what surrounds it.
pub const MAX_MESSAGE: usize = 4 * CHUNK_BYTES;
