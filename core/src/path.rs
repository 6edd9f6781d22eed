//! The tool path, and stitching it together from sub-trajectories.

use crate::error::{Error, Result};
use crate::motion::{Index, Trajectory};
use crate::vector::{Interval, Point};
use crate::verify::Position;

/// Where the cutter touches the part at one position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// Tool centre along the attack axis, mm.
    pub height: f64,
    /// The touched point in part coordinates, mm.
    pub contact: Point,
}

/// A position inserted between two of the trajectory's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inserted {
    /// Where: never whole.
    pub index: Index,
    /// Where the cutter touches, or `None` where nothing is in its reach.
    pub touch: Option<Touch>,
}

/// A tool path: for each position of the trajectory where the cutter touches, or `None` where
/// nothing is in its reach, and what was inserted between.
#[derive(Debug, Clone, PartialEq)]
pub struct ToolPath {
    /// Travel and angle of each position.
    pub trajectory: Trajectory,
    /// One for each position, in order.
    pub touches: Vec<Option<Touch>>,
    /// Positions between those, in order.
    pub between: Vec<Inserted>,
}

/// One position of a path, the trajectory's or inserted, with all that is known of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Waypoint {
    /// Its name.
    pub index: Index,
    /// Travel along the spindle, mm.
    pub x: f64,
    /// Unwound angle, degrees.
    pub angle: f64,
    /// Where the cutter touches, or `None` where nothing is in its reach.
    pub touch: Option<Touch>,
}

impl ToolPath {
    /// All positions, in the order in which a machine takes them.
    pub fn waypoints(&self) -> impl ExactSizeIterator<Item = Waypoint> + '_ {
        let whole = (0..).zip(&self.touches);
        let mut whole = whole.map(|(i, &touch)| (Index::whole(i), touch)).peekable();
        let mut between = self.between.iter().map(|b| (b.index, b.touch)).peekable();
        // As many as there are, so that it is known how many they are.
        (0..self.touches.len() + self.between.len()).map(move |_| {
            let inserted = match (whole.peek(), between.peek()) {
                (Some(w), Some(b)) => b.0 < w.0,
                (w, _) => w.is_none(),
            };
            let next = if inserted {
                between.next()
            } else {
                whole.next()
            };
            let (index, touch) = next.expect("one of them is left");
            Waypoint {
                index,
                x: self.trajectory.travel_at(index.floor(), index.share()),
                angle: self.trajectory.angle_at(index.floor(), index.share()),
                touch,
            }
        })
    }

    /// The same with, of each position, the travel of all that lies on the moves to it and from it, and
    /// the cosine and sine of its angle.
    pub(crate) fn along(&self) -> impl Iterator<Item = (Waypoint, Interval, (f64, f64))> + '_ {
        let before = std::iter::once(None).chain(self.waypoints().map(Some));
        let after = self.waypoints().skip(1).map(Some).chain([None]);
        let all = self.waypoints().zip(before).zip(after);
        all.map(|((waypoint, before), after)| {
            let (index, x) = (waypoint.index, waypoint.x);
            let travel = Interval {
                low: before.map_or(x, |w| w.x),
                high: after.map_or(x, |w| w.x),
            };
            let direction = self.trajectory.direction_at(index.floor(), index.share());
            (waypoint, travel, direction)
        })
    }

    /// The same positions with other touches, one for each in the order of [`ToolPath::waypoints`].
    pub(crate) fn with(&self, all: Vec<Option<Touch>>) -> Self {
        let mut path = Self {
            trajectory: self.trajectory,
            touches: Vec::with_capacity(self.touches.len()),
            between: Vec::with_capacity(self.between.len()),
        };
        for (waypoint, touch) in self.waypoints().zip(all) {
            let index = waypoint.index;
            match index.parts() {
                0 => path.touches.push(touch),
                _ => path.between.push(Inserted { index, touch }),
            }
        }
        path
    }

    /// The same path by the numbers a machine is given, for [`crate::verify()`].
    pub fn positions(&self) -> Vec<Position> {
        let position = |w: Waypoint| Position {
            x: w.x,
            angle: w.angle,
            height: w.touch.map(|t| t.height),
        };
        self.waypoints().map(position).collect()
    }
}

/// A run of consecutive positions, digitized, with what was inserted on the moves that begin there.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SubTrajectory {
    /// Index of the first position.
    pub first: u64,
    /// One for each position from there on.
    pub touches: Vec<Option<Touch>>,
    /// Positions between those, and between the last and the one after it; in order.
    pub between: Vec<Inserted>,
}

impl SubTrajectory {
    /// Index of the position that comes after it.
    pub fn end(&self) -> u64 {
        self.first + self.touches.len() as u64
    }

    /// Checks that what was inserted lies on its own moves, of a trajectory of so many positions, in
    /// order and once.
    ///
    /// # Errors
    /// [`Error::Misplaced`]
    pub fn validate(&self, positions: u64) -> Result<()> {
        // From the last position of all there is no move.
        let moves = self.first..self.end().min(positions.saturating_sub(1));
        let mut last = Index::whole(self.first);
        for inserted in &self.between {
            let index = inserted.index;
            if !moves.contains(&index.floor()) || index <= last || index.parts() == 0 {
                return Err(Error::Misplaced { index, last, moves });
            }
            last = index;
        }
        Ok(())
    }
}

/// Joins sub-trajectories, in any order, into a path.
///
/// # Errors
/// [`Error::Gap`] or [`Error::Duplicate`] unless every position comes exactly once, and
/// [`Error::BeyondTheEnd`] if there is one that the trajectory does not have; those of
/// [`SubTrajectory::validate`].
pub fn stitch(trajectory: Trajectory, mut parts: Vec<SubTrajectory>) -> Result<ToolPath> {
    parts.sort_by_key(|p| (p.first, p.touches.len()));
    let mut touches = Vec::with_capacity(parts.iter().map(|p| p.touches.len()).sum());
    let mut between = Vec::with_capacity(parts.iter().map(|p| p.between.len()).sum());
    for part in parts {
        let next = touches.len() as u64;
        let end = part.end();
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
        part.validate(trajectory.positions)?;
        touches.extend(part.touches);
        between.extend(part.between);
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
        between,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::MotionKind;

    const TRAJECTORY: Trajectory = Trajectory {
        kind: MotionKind::Helix,
        from: 0.0,
        step: 1.0,
        points_per_revolution: 4,
        positions: 10,
    };

    fn check(parts: &[(u64, usize)]) -> Result<usize> {
        let parts = parts.iter().map(|&(first, count)| SubTrajectory {
            first,
            touches: vec![None; count],
            between: Vec::new(),
        });
        stitch(TRAJECTORY, parts.collect()).map(|p| p.touches.len())
    }

    /// A run of positions with some inserted, each as the whole index and parts.
    fn run(first: u64, count: usize, between: &[(u64, u16)]) -> SubTrajectory {
        let inserted = |&(whole, parts)| Inserted {
            index: Index::between(whole, parts).expect("between"),
            touch: None,
        };
        SubTrajectory {
            first,
            touches: vec![None; count],
            between: between.iter().map(inserted).collect(),
        }
    }

    #[test]
    fn what_was_inserted_comes_in_its_place() {
        let parts = vec![
            run(4, 6, &[(4, 1), (8, 512)]),
            run(0, 4, &[(0, 512), (0, 768), (3, 256)]),
        ];
        let path = stitch(TRAJECTORY, parts).expect("whole");
        let names: Vec<String> = path.waypoints().map(|w| w.index.to_string()).collect();
        let expected = "0 0.5 0.75 1 2 3 3.25 4 4.0009765625 5 6 7 8 8.5 9";
        assert_eq!(names.join(" "), expected);
        let positions = path.positions();
        assert!(positions.is_sorted_by(|a, b| a.x < b.x && a.angle < b.angle));
        assert_eq!((positions[2].x, positions[2].angle), (0.1875, 67.5));
    }

    #[test]
    fn what_was_inserted_must_lie_on_its_own_moves_in_order_and_once() {
        for between in [
            &[(4, 1), (4, 1)][..],
            &[(4, 2), (4, 1)],
            &[(5, 1), (4, 1)],
            &[(3, 1023)],
            &[(10, 1)],
            &[(9, 1)],
        ] {
            let parts = vec![run(0, 4, &[]), run(4, 6, between)];
            let stitched = stitch(TRAJECTORY, parts);
            assert!(
                matches!(stitched, Err(Error::Misplaced { .. })),
                "{between:?}"
            );
        }
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
