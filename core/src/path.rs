//! The tool path, and stitching it together from sub-trajectories.

use crate::error::{Error, Result};
use crate::motion::Trajectory;
use crate::vector::Point;
use crate::verify::Position;

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

impl ToolPath {
    /// The same path by the numbers a machine is given, for [`crate::verify()`].
    pub fn positions(&self) -> Vec<Position> {
        let position = |(index, touch): (u64, &Option<Touch>)| Position {
            x: self.trajectory.travel(index),
            angle: self.trajectory.angle(index),
            height: touch.map(|t| t.height),
        };
        (0..).zip(&self.touches).map(position).collect()
    }
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
/// [`Error::Gap`] or [`Error::Duplicate`] unless every position comes exactly once, and
/// [`Error::BeyondTheEnd`] if there is one that the trajectory does not have.
pub fn stitch(trajectory: Trajectory, mut parts: Vec<SubTrajectory>) -> Result<ToolPath> {
    parts.sort_by_key(|p| (p.first, p.touches.len()));
    let mut touches = Vec::with_capacity(parts.iter().map(|p| p.touches.len()).sum());
    for part in parts {
        let next = touches.len() as u64;
        let end = part.first + part.touches.len() as u64;
        if end > trajectory.positions {
            return Err(Error::BeyondTheEnd {
                position: end - 1,
                positions: trajectory.positions,
            });
        }
        if part.first > next {
            return Err(Error::Gap {
                first: next,
                last: part.first - 1,
            });
        }
        if part.first < next && !part.touches.is_empty() {
            return Err(Error::Duplicate {
                first: part.first,
                last: next.min(end) - 1,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::MotionKind;

    fn check(parts: &[(u64, usize)]) -> Result<usize> {
        let trajectory = Trajectory {
            kind: MotionKind::Helix,
            from: 0.0,
            step: 1.0,
            points_per_revolution: 4,
            positions: 10,
        };
        let parts = parts.iter().map(|&(first, count)| SubTrajectory {
            first,
            touches: vec![None; count],
        });
        stitch(trajectory, parts.collect()).map(|p| p.touches.len())
    }

    #[test]
    fn order_does_not_matter_and_empty_parts_do_no_harm() {
        assert_eq!(check(&[(6, 4), (0, 3), (3, 0), (3, 3)]), Ok(10));
    }

    #[test]
    fn every_position_must_come_exactly_once() {
        assert_eq!(
            check(&[(0, 3), (5, 5)]),
            Err(Error::Gap { first: 3, last: 4 })
        );
        assert_eq!(check(&[(0, 9)]), Err(Error::Gap { first: 9, last: 9 }));
        let twice = Error::Duplicate { first: 3, last: 4 };
        assert_eq!(check(&[(0, 5), (3, 7)]), Err(twice));
        let beyond = Error::BeyondTheEnd {
            position: 10,
            positions: 10,
        };
        assert_eq!(check(&[(0, 5), (5, 6)]), Err(beyond));
    }
}
