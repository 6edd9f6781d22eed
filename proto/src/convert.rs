//! Wire ↔ core. Going out cannot fail; coming in, everything is checked by the core's own
//! constructors.

mod job;
mod part;

use horma_core::Coordinates;

use crate::error::Error;

pub use job::{counters_from_wire, counters_to_wire, job_from_wire, job_to_wire};
pub use job::{sharing_from_wire, sharing_to_wire, trajectory_from_wire, trajectory_to_wire};
pub use part::{body_from_wire, body_to_wire, grid_from_wire, grid_to_wire};
pub use part::{row_from_wire, row_to_wire};

fn missing(message: &'static str, field: &'static str) -> Error {
    Error::Missing { message, field }
}

fn coordinates_from_wire(packed21: bool) -> Coordinates {
    if packed21 {
        Coordinates::Packed21
    } else {
        Coordinates::Double
    }
}
