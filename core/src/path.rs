//! The tool path, and stitching it together from sub-trajectories.

use crate::error::{Error, Result};
use crate::motion::Trajectory;
use crate::vector::Point;

/// Where the cutter touches the part at one position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// Tool centre along the attack axis, mm.
    pub height: f64,
    /// The touched point in part coordinates, mm.
    pub contact: Point,
}

/// A tool path: for each position of the trajectory where the cutter touches, or `None` where
/// nothing is in its reach.
#[derive(Debug, Clone, PartialEq)]
pub struct ToolPath {
    /// Travel and angle of each position.
    pub trajectory: Trajectory,
    /// One for each position, in order.
    pub touches: Vec<Option<Touch>>,
}

/// A run of consecutive positions, digitized.
#[derive(Debug, Clone, PartialEq)]
pub struct SubTrajectory {
    /// Index of the first position.
    pub first: u64,
    /// One for each position from there on.
    pub touches: Vec<Option<Touch>>,
}

/// Joins sub-trajectories, in any order, into a path.
///
/// # Errors
/// [`Error::Gap`] or [`Error::Duplicate`] unless every position comes exactly once.
pub fn stitch(trajectory: Trajectory, mut parts: Vec<SubTrajectory>) -> Result<ToolPath> {
    parts.retain(|p| !p.touches.is_empty());
    parts.sort_by_key(|p| p.first);
    let mut touches = Vec::with_capacity(usize::try_from(trajectory.positions).unwrap_or(0));
    for part in parts {
        let next = touches.len() as u64;
        let end = part.first + part.touches.len() as u64;
        if part.first > next {
            return Err(Error::Gap {
                first: next,
                last: part.first - 1,
            });
        }
        let known = next.max(trajectory.positions.min(end));
        if part.first < next || end > known {
            return Err(Error::Duplicate {
                first: part.first.min(known),
                last: end.min(next.max(part.first + 1)) - 1,
            });
        }
        touches.extend(part.touches);
    }
    let next = touches.len() as u64;
    if next < trajectory.positions {
        return Err(Error::Gap {
            first: next,
            last: trajectory.positions - 1,
        });
    }
    Ok(ToolPath {
        trajectory,
        touches,
    })
}
