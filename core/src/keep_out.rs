//! Keep-outs: what holds the part, which the cutter must not enter.
//!
//! A chuck, a tailstock or a holder is a cylinder about the spindle. Where the wheel would enter one, the
//! position is raised until it just does not, on the moves to and from that position as well; what the
//! part has there is left uncut. This is done to a whole path and by its own numbers, so that it does not
//! matter who digitized what.

use serde::{Deserialize, Serialize};

use crate::cutter::Cutter;
use crate::error::{Result, bounded};
use crate::path::{ToolPath, Touch};
use crate::solid::{Section, Solid};
use crate::tolerance::MAX_COORDINATE;
use crate::vector::{Interval, facing};

/// A solid cylinder about the spindle, in part coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KeepOut {
    /// Its extent along the spindle, mm.
    pub x: Interval,
    /// Its radius, mm.
    pub radius: f64,
    /// How far the cutter stays away from it, mm, along the spindle and square to it.
    pub margin: f64,
}

/// What a keep-out did to a path.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Raised {
    /// Positions at which it keeps the cutter away from where it would have been.
    pub positions: u64,
    /// Travel of the first and the last of them, mm.
    pub travel: Option<[f64; 2]>,
    /// How many of them touched the part, which is left uncut there.
    pub uncut: u64,
    /// The most by which one of these was raised, mm.
    pub most: f64,
}

impl KeepOut {
    /// Checks the numbers.
    ///
    /// # Errors
    /// Those of [`Solid::validate`]; [`crate::Error::OutOfBounds`] for the margin.
    pub fn validate(&self) -> Result<()> {
        let ok = (0.0..=MAX_COORDINATE).contains(&self.margin);
        bounded("margin", self.margin, ok, "from 0 to a kilometre")?;
        self.solid().validate()
    }

    /// What the cutter must not enter, margin included.
    pub fn solid(&self) -> Solid {
        Solid {
            x: self.x.widened(self.margin),
            section: Section::Disc {
                radius: self.radius + self.margin,
            },
        }
    }
}

/// The path that keeps out of all of these, and what each of them did. A raised position touches the
/// keep-out that is highest.
pub fn keep_out(path: ToolPath, cutter: &Cutter, keep_outs: &[KeepOut]) -> (ToolPath, Vec<Raised>) {
    if keep_outs.is_empty() {
        return (path, Vec::new());
    }
    let mut raised = vec![Raised::default(); keep_outs.len()];
    let solids: Vec<Solid> = keep_outs.iter().map(KeepOut::solid).collect();
    let touches = path.along().map(|(waypoint, travel, direction)| {
        let part = waypoint.touch;
        let mut touch = part;
        for (solid, raised) in solids.iter().zip(&mut raised) {
            let Some(height) = solid.height(cutter, travel, direction) else {
                continue;
            };
            if part.is_some_and(|t| t.height >= height) {
                continue;
            }
            raised.add(waypoint.x, part.map(|t| height - t.height));
            if touch.is_none_or(|t| t.height < height) {
                let radius = solid.reach();
                let x = waypoint.x.clamp(solid.x.low, solid.x.high);
                let contact = facing(x, radius, direction);
                touch = Some(Touch { height, contact });
            }
        }
        touch
    });
    let touches = touches.collect();
    (path.with(touches), raised)
}

impl Raised {
    fn add(&mut self, x: f64, over_part: Option<f64>) {
        let [first, _] = *self.travel.get_or_insert([x, x]);
        self.travel = Some([first, x]);
        self.positions += 1;
        if let Some(by) = over_part {
            self.uncut += 1;
            self.most = self.most.max(by);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::{Index, MotionKind, Trajectory};
    use crate::path::Inserted;

    /// A path at a height of 50, but for a gap at the beginning.
    fn path(kind: MotionKind) -> ToolPath {
        let touch = |i: u64| {
            (i >= 3).then_some(Touch {
                height: 50.0,
                contact: [0.0, 40.0, 0.0],
            })
        };
        ToolPath {
            trajectory: Trajectory {
                kind,
                from: -12.0,
                step: 4.0,
                points_per_revolution: 8,
                positions: 100,
            },
            touches: (0..100).map(touch).collect(),
            between: vec![Inserted {
                index: Index::between(20, 256).expect("between"),
                touch: touch(20),
            }],
        }
    }

    const CHUCK: KeepOut = KeepOut {
        x: Interval {
            low: -40.0,
            high: -5.0,
        },
        radius: 44.0,
        margin: 1.0,
    };

    #[test]
    fn exactly_what_is_in_its_reach_is_raised() {
        let ball = Cutter::ball(8.0).expect("valid");
        for kind in [MotionKind::Helix, MotionKind::Rings] {
            let path = path(kind);
            let (kept, raised) = keep_out(path.clone(), &ball, &[CHUCK]);
            let before: Vec<_> = path.waypoints().collect();
            let after: Vec<_> = kept.waypoints().collect();
            let mut count = 0;
            for (i, (b, a)) in before.iter().zip(&after).enumerate() {
                assert_eq!((a.index, a.x, a.angle), (b.index, b.x, b.angle));
                // The rim is x − 8, and the margin ends at −4: least over the moves on either side.
                let nearest = before[i.saturating_sub(1)].x - -4.0;
                let least = (nearest <= 8.0).then(|| {
                    let d = nearest.max(0.0);
                    45.0 + (64.0 - d * d).sqrt()
                });
                let height = |t: Option<Touch>| t.map(|t| t.height);
                let expected = match (height(b.touch), least) {
                    (Some(part), Some(least)) => Some(part.max(least)),
                    (part, least) => part.or(least),
                };
                assert_eq!(height(a.touch), expected, "{kind:?} {i}");
                if height(a.touch) == height(b.touch) {
                    assert_eq!(a.touch, b.touch);
                    continue;
                }
                count += 1;
                let [x, y, z] = a.touch.expect("raised").contact;
                assert!(x <= -4.0 && (y.hypot(z) - 45.0).abs() < 1e-12);
            }
            let [raised] = raised[..] else { panic!() };
            assert_eq!((raised.positions, raised.uncut), (count, count - 3));
            assert_eq!(raised.most, 3.0);
            assert_eq!(raised.travel.map(|t| t[0]), Some(-12.0));
        }
    }

    #[test]
    fn no_move_enters_one() {
        let cutter = Cutter::torus(10.0, 4.0).expect("valid");
        for kind in [MotionKind::Helix, MotionKind::Rings] {
            let (kept, _) = keep_out(path(kind), &cutter, &[CHUCK]);
            let course = crate::course::course(&kept).expect("contact");
            for ends in course.windows(2) {
                for share in 0..=50 {
                    let share = f64::from(share) / 50.0;
                    let on = |axis: usize| {
                        ends[0].axes[axis] + share * (ends[1].axes[axis] - ends[0].axes[axis])
                    };
                    let at = Interval {
                        low: on(0),
                        high: on(0),
                    };
                    let least = CHUCK.solid().height(&cutter, at, (1.0, 0.0));
                    assert!(least.is_none_or(|l| on(1) >= l - 1e-9), "{kind:?} {ends:?}");
                }
            }
        }
    }

    #[test]
    fn without_any_the_path_is_the_same() {
        let path = path(MotionKind::Helix);
        let far = KeepOut {
            x: Interval {
                low: 500.0,
                high: 600.0,
            },
            ..CHUCK
        };
        let ball = Cutter::ball(8.0).expect("valid");
        assert_eq!(keep_out(path.clone(), &ball, &[]), (path.clone(), vec![]));
        let (same, raised) = keep_out(path.clone(), &ball, &[far]);
        assert_eq!((same, raised), (path, vec![Raised::default()]));
    }

    #[test]
    fn what_cannot_be_is_refused() {
        assert_eq!(CHUCK.validate(), Ok(()));
        for margin in [-1.0, f64::NAN] {
            assert!(KeepOut { margin, ..CHUCK }.validate().is_err());
        }
        let radius = -44.0;
        assert!(KeepOut { radius, ..CHUCK }.validate().is_err());
    }
}
