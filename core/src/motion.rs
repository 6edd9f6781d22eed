//! The motion of cutter and part: where along the spindle, and at which angle, each position is.
//!
//! A position follows from its index alone (eq. numbers do not exist in the papers: the spiral is
//! described in "Definition of the tool motion"). Angles come from the index, whole or a dyadic
//! fraction, and from the `libm` crate, so that a position is the same bits on every machine.

use std::fmt;

use crate::error::{Error, Result, bounded};
use crate::tolerance::MAX_COORDINATE;
use crate::vector::Interval;

/// How travel and rotation go together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MotionKind {
    /// Travel grows with the angle: a spiral of constant step.
    Helix,
    /// Travel stands still for each revolution and then advances by one step.
    Rings,
}

/// The motion that a job asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Helix or rings.
    pub kind: MotionKind,
    /// Travel per revolution, mm.
    pub step: f64,
    /// Positions per revolution.
    pub points_per_revolution: u32,
    /// First travel, mm; by default the part's lower end less the cutter's half width.
    pub from: Option<f64>,
    /// Last travel, mm; by default the part's upper end plus the cutter's half width.
    pub to: Option<f64>,
    /// How far the straight move from one position to the next may stray from the exact heights,
    /// mm along the attack axis, before positions are inserted between them; by default nobody looks.
    pub path_tolerance: Option<f64>,
    /// Travel before the first and after the last, mm, for the cutter to come in from beside the part and
    /// to leave it.
    pub lead: [f64; 2],
}

/// The index of a position: whole for those of the trajectory, and so many [`Index::PARTS`]ths of the
/// way to the next for one between. Shown as in `path.csv`: `17` or `17.25`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Index {
    whole: u64,
    parts: u16,
}

/// The positions of a path: `x = from + step·i/ppr`, `angle = 360·i/ppr`, for as long as `x ≤ to`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trajectory {
    /// Helix or rings.
    pub kind: MotionKind,
    /// First travel, mm.
    pub from: f64,
    /// Travel per revolution, mm.
    pub step: f64,
    /// Positions per revolution.
    pub points_per_revolution: u32,
    /// Number of positions.
    pub positions: u64,
}

impl Index {
    /// Parts of a move: the shortest that positions are inserted into is one of them.
    pub const PARTS: u16 = 1 << 10;

    /// Of a position of the trajectory.
    pub fn whole(whole: u64) -> Self {
        Self { whole, parts: 0 }
    }

    /// Of a position between `whole` and the next, or `None` unless it is after the one and before the
    /// other.
    pub fn between(whole: u64, parts: u16) -> Option<Self> {
        let inside = (1..Self::PARTS).contains(&parts);
        inside.then_some(Self { whole, parts })
    }

    /// The position of the trajectory that it is at, or comes after.
    pub fn floor(self) -> u64 {
        self.whole
    }

    /// How many of the [`Index::PARTS`] parts of the move from there it is at the end of.
    pub fn parts(self) -> u16 {
        self.parts
    }

    /// How much of that move is behind it.
    pub fn share(self) -> f64 {
        f64::from(self.parts) / f64::from(Self::PARTS)
    }
}

impl fmt::Display for Index {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // The digits of so coarse a fraction are exact.
        let share = self.share().to_string();
        write!(f, "{}{}", self.whole, share.trim_start_matches('0'))
    }
}

/// How much of the cutter's half width the default range goes beyond the part's ends: all but a
/// hair, for exactly at the rim rounding would decide what is in reach.
const OVERRUN: f64 = 1.0 - 1.0e-6;

/// Smallest step, mm, and most positions in a revolution: with them, and with travel within bounds,
/// successive positions are told apart and counted in a moment.
const MIN_STEP: f64 = 1.0e-6;
const MAX_POINTS_PER_REVOLUTION: u32 = 1_000_000;

/// Finest path tolerance, mm: a nanometre, as of a chordal one.
const MIN_PATH_TOLERANCE: f64 = 1.0e-6;

/// Most positions of a path: an index has to be exact in a double.
const MAX_POSITIONS: f64 = 1.0e15;

impl Motion {
    /// Over the whole part and no further, with nobody looking at the moves.
    pub const fn new(kind: MotionKind, step: f64, points_per_revolution: u32) -> Self {
        Self {
            kind,
            step,
            points_per_revolution,
            from: None,
            to: None,
            path_tolerance: None,
            lead: [0.0; 2],
        }
    }

    /// Checks what can be checked without a part.
    ///
    /// # Errors
    /// [`Error::OutOfBounds`] for a step or a number of points that cannot be,
    /// [`Error::EmptyTravel`] if the travel ends before it begins.
    pub fn validate(&self) -> Result<()> {
        bounded(
            "step",
            self.step,
            (MIN_STEP..=MAX_COORDINATE).contains(&self.step),
            "at least 0.000001 mm and at most a kilometre",
        )?;
        bounded(
            "points_per_revolution",
            f64::from(self.points_per_revolution),
            (1..=MAX_POINTS_PER_REVOLUTION).contains(&self.points_per_revolution),
            "from 1 to 1000000",
        )?;
        for (name, value) in [("from", self.from), ("to", self.to)] {
            if let Some(value) = value {
                let ok = value.abs() <= MAX_COORDINATE;
                bounded(name, value, ok, "within a kilometre of the origin")?;
            }
        }
        for (name, value) in ["lead_in", "lead_out"].into_iter().zip(self.lead) {
            let ok = (0.0..=MAX_COORDINATE).contains(&value);
            bounded(name, value, ok, "from 0 to a kilometre")?;
        }
        if let Some(tolerance) = self.path_tolerance {
            bounded(
                "path_tolerance",
                tolerance,
                (MIN_PATH_TOLERANCE..=MAX_COORDINATE).contains(&tolerance),
                "at least 0.000001 mm and at most a kilometre",
            )?;
        }
        match (self.from, self.to) {
            (Some(from), Some(to)) if from > to => Err(Error::EmptyTravel { from, to }),
            _ => Ok(()),
        }
    }

    /// The positions of this motion over a part that extends over `part` along the spindle, for a
    /// cutter of the given half width. The default range is the part's, widened by the half width:
    /// there the cutter's flank just leaves the part's ends, so that they are finished.
    ///
    /// # Errors
    /// Those of [`Motion::validate`], and [`Error::TooManyPositions`].
    pub fn over(&self, part: Interval, half_width: f64) -> Result<Trajectory> {
        self.validate()?;
        let range = part.widened(OVERRUN * half_width);
        let from = self.from.unwrap_or(range.low);
        let to = self.to.unwrap_or(range.high);
        if from > to {
            return Err(Error::EmptyTravel { from, to });
        }
        let (from, to) = (from - self.lead[0], to + self.lead[1]);
        let mut trajectory = Trajectory {
            kind: self.kind,
            from,
            step: self.step,
            points_per_revolution: self.points_per_revolution,
            positions: 0,
        };
        let ppr = f64::from(self.points_per_revolution);
        let revolutions = (to - from) / self.step;
        let guess = match self.kind {
            MotionKind::Helix => revolutions * ppr,
            MotionKind::Rings => (revolutions.floor() + 1.0) * ppr,
        };
        if guess > MAX_POSITIONS {
            return Err(Error::TooManyPositions {
                positions: guess,
                limit: MAX_POSITIONS,
            });
        }
        // The quotient above is rounded; `x ≤ to` itself decides the last position.
        let mut count = guess as u64;
        while count > 0 && trajectory.travel(count - 1) > to {
            count -= 1;
        }
        while trajectory.travel(count) <= to {
            count += 1;
        }
        trajectory.positions = count;
        Ok(trajectory)
    }
}

impl Trajectory {
    /// Travel of position `index` along the spindle, mm. It never decreases with the index.
    #[inline]
    pub fn travel(&self, index: u64) -> f64 {
        self.travel_at(index, 0.0)
    }

    /// Travel with `share` of the move from position `index` to the next behind it, mm; between rings
    /// it goes from the one to the next on the last move of each. It never decreases with the share.
    #[inline]
    pub fn travel_at(&self, index: u64, share: f64) -> f64 {
        let ppr = u64::from(self.points_per_revolution);
        let ring = |steps: u64| self.from + self.step * steps as f64;
        match self.kind {
            MotionKind::Helix => self.from + self.step * (index as f64 + share) / ppr as f64,
            MotionKind::Rings if share > 0.0 && (index + 1).is_multiple_of(ppr) => {
                let (here, next) = (ring(index / ppr), ring(index / ppr + 1));
                here + (next - here) * share
            }
            MotionKind::Rings => ring(index / ppr),
        }
    }

    /// Angle of position `index`, degrees, counted on from 0 without wrapping.
    #[inline]
    pub fn angle(&self, index: u64) -> f64 {
        self.angle_at(index, 0.0)
    }

    /// Angle with `share` of the move from position `index` to the next behind it, degrees.
    #[inline]
    pub fn angle_at(&self, index: u64, share: f64) -> f64 {
        360.0 * (index as f64 + share) / f64::from(self.points_per_revolution)
    }

    /// `(cos θ, sin θ)` of that angle, from its exact fraction of a revolution.
    pub fn direction_at(&self, index: u64, share: f64) -> (f64, f64) {
        let place = (index % u64::from(self.points_per_revolution)) as f64 + share;
        let angle = 2.0 * std::f64::consts::PI * (place / f64::from(self.points_per_revolution));
        (libm::cos(angle), libm::sin(angle))
    }

    /// `(cos θ, sin θ)` of each of the angles of one revolution, in order; no more of them than there
    /// are positions.
    pub fn directions(&self) -> Vec<(f64, f64)> {
        let needed = u64::from(self.points_per_revolution).min(self.positions);
        (0..needed).map(|i| self.direction_at(i, 0.0)).collect()
    }

    /// The smallest interval that holds the travel of positions `first .. first + count`.
    pub fn travel_of(&self, first: u64, count: u64) -> Interval {
        if count == 0 {
            return Interval::EMPTY;
        }
        Interval {
            low: self.travel(first),
            high: self.travel(first + count - 1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motion(kind: MotionKind) -> Motion {
        Motion {
            from: Some(0.0),
            to: Some(4.0),
            ..Motion::new(kind, 2.0, 4)
        }
    }

    const PART: Interval = Interval {
        low: 0.0,
        high: 10.0,
    };

    #[test]
    fn leads_lie_beside_the_travel() {
        let lead = [1.0, 2.0];
        let given = Motion {
            lead,
            ..motion(MotionKind::Helix)
        };
        let t = given.over(PART, 1.0).expect("valid");
        assert_eq!((t.from, t.travel(t.positions - 1)), (-1.0, 6.0));
        let whole = Motion {
            from: None,
            to: None,
            ..given
        };
        let t = whole.over(PART, 1.0).expect("valid");
        assert!((t.from + 2.0).abs() < 1e-5, "{t:?}");
        let backwards = Motion {
            from: Some(5.0),
            ..given
        };
        assert!(backwards.over(PART, 1.0).is_err());
        for lead in [[-1.0, 0.0], [0.0, f64::NAN]] {
            assert!(Motion { lead, ..given }.validate().is_err());
        }
    }

    #[test]
    fn a_helix_advances_with_the_angle_and_includes_its_end() {
        let t = motion(MotionKind::Helix).over(PART, 1.0).expect("valid");
        assert_eq!(t.positions, 9);
        assert_eq!((t.travel(8), t.angle(8)), (4.0, 720.0));
    }

    #[test]
    fn rings_stand_still_for_a_revolution() {
        let t = motion(MotionKind::Rings).over(PART, 1.0).expect("valid");
        assert_eq!(t.positions, 12);
        assert_eq!(
            t.travel_of(4, 4),
            Interval {
                low: 2.0,
                high: 2.0
            }
        );
    }

    #[test]
    fn between_two_positions_everything_goes_straight() {
        let helix = motion(MotionKind::Helix).over(PART, 1.0).expect("valid");
        assert_eq!(
            (helix.travel_at(3, 0.25), helix.angle_at(3, 0.25)),
            (1.625, 292.5)
        );
        let rings = motion(MotionKind::Rings).over(PART, 1.0).expect("valid");
        assert_eq!(rings.travel_at(2, 0.5), 0.0);
        assert_eq!(rings.travel_at(3, 0.5), 1.0, "on to the next ring");
        for t in [helix, rings] {
            let whole = t.directions();
            for i in 0..t.positions {
                let bits = |(c, s): (f64, f64)| (c.to_bits(), s.to_bits());
                assert_eq!(bits(t.direction_at(i, 0.0)), bits(whole[i as usize % 4]));
                let steps: Vec<f64> = (0..=1024)
                    .map(|k| t.travel_at(i, f64::from(k) / 1024.0))
                    .collect();
                assert!(steps.is_sorted() && steps[1023] <= t.travel(i + 1));
            }
        }
    }

    #[test]
    fn an_index_shows_its_fraction() {
        let text = |whole, parts| Index::between(whole, parts).map(|i| i.to_string());
        assert_eq!(Index::whole(17).to_string(), "17");
        assert_eq!(text(17, 256).as_deref(), Some("17.25"));
        assert_eq!(text(0, 1).as_deref(), Some("0.0009765625"));
        assert_eq!([text(1, 0), text(1, 1024)], [None, None]);
        assert!(Index::whole(17) < Index::between(17, 1).expect("inside"));
    }

    #[test]
    fn the_default_range_is_the_parts_widened_by_the_cutter() {
        let m = Motion {
            from: None,
            to: None,
            ..motion(MotionKind::Helix)
        };
        let t = m.over(PART, 1.0).expect("valid");
        let range = t.travel_of(0, t.positions);
        assert!((range.low + 1.0).abs() < 1e-5 && (range.high - 11.0).abs() < 0.5);
    }

    #[test]
    fn impossible_motions_are_refused() {
        let m = motion(MotionKind::Helix);
        for bad in [
            Motion { step: 0.0, ..m },
            Motion {
                points_per_revolution: 0,
                ..m
            },
            Motion {
                from: Some(f64::NAN),
                ..m
            },
            Motion {
                from: Some(9.0),
                ..m
            },
            Motion { step: 1e-300, ..m },
            Motion {
                points_per_revolution: u32::MAX,
                ..m
            },
            Motion {
                to: Some(1e300),
                ..m
            },
            Motion {
                path_tolerance: Some(0.0),
                ..m
            },
            Motion {
                path_tolerance: Some(f64::INFINITY),
                ..m
            },
        ] {
            assert!(bad.over(PART, 1.0).is_err(), "{bad:?}");
        }
    }
}
