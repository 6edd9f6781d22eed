//! A path as a machine runs it: where each axis is at each position, touch or none.
//!
//! Where the cutter touches nothing it has to be somewhere all the same. This module decides where, and
//! how long the way from one position to the next is at the contact; how fast is `feed`'s.

use crate::path::{ToolPath, Touch};

/// An axis of the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MachineAxis {
    /// Along the spindle, mm.
    Travel,
    /// Towards the spindle, mm.
    Attack,
    /// The turn of the part, degrees.
    Rotation,
}

impl MachineAxis {
    /// All of them, in the order of [`Station::axes`].
    pub const ALL: [Self; 3] = [Self::Travel, Self::Attack, Self::Rotation];

    /// Its name in jobs and reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Travel => "travel",
            Self::Attack => "attack",
            Self::Rotation => "rotation",
        }
    }
}

/// Where the machine is at a position, and how far from the spindle axis it cuts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Station {
    /// Travel and tool centre along the attack axis, mm; unwound angle, degrees.
    pub axes: [f64; 3],
    /// Distance of the contact from the spindle axis, mm.
    pub reach: f64,
}

impl Station {
    /// Length of the cutter's way over the part from here to `next`, mm: travel, attack, and the arc at
    /// the contact.
    pub fn cut(&self, next: &Self) -> f64 {
        let [dx, dy, degrees] = self.to(next);
        let arc = 0.5 * (self.reach + next.reach) * degrees.to_radians();
        (dx * dx + dy * dy + arc * arc).sqrt()
    }

    /// How far each axis goes from here to `next`.
    pub fn to(&self, next: &Self) -> [f64; 3] {
        std::array::from_fn(|a| next.axes[a] - self.axes[a])
    }
}

/// A station for each position of a path, in order, or `None` if nothing is touched at all.
///
/// Where the cutter touches nothing it goes as high as the higher of the nearest contacts before and
/// after; at the ends of the path there is only one.
pub fn course(path: &ToolPath) -> Option<Vec<Station>> {
    let touches: Vec<_> = path.waypoints().map(|w| w.touch).collect();
    let held = bridged(&touches)?;
    let stations = path.waypoints().zip(held).map(|(w, held)| Station {
        axes: [w.x, held.height, w.angle],
        reach: held.reach,
    });
    Some(stations.collect())
}

/// What is kept of a contact while there is none.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Held {
    height: f64,
    reach: f64,
}

fn bridged(touches: &[Option<Touch>]) -> Option<Vec<Held>> {
    let held = |t: &Option<Touch>| {
        t.map(|t| Held {
            height: t.height,
            reach: (t.contact[1] * t.contact[1] + t.contact[2] * t.contact[2]).sqrt(),
        })
    };
    let mut before = None;
    let mut places: Vec<Option<Held>> = Vec::with_capacity(touches.len());
    for touch in touches {
        before = held(touch).or(before);
        places.push(before);
    }
    let mut after = None;
    for (place, touch) in places.iter_mut().zip(touches).rev() {
        after = held(touch).or(after);
        *place = match (*place, after) {
            (Some(a), Some(b)) if a.height < b.height => after,
            (None, b) => b,
            (a, _) => a,
        };
    }
    let all: Option<Vec<Held>> = places.into_iter().collect();
    all.filter(|s| !s.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::{MotionKind, Trajectory};

    /// Stations of these heights, touching at 10 mm from the spindle axis.
    fn stations(heights: &[Option<f64>]) -> Option<Vec<Station>> {
        let touch = |h: &Option<f64>| {
            h.map(|height| Touch {
                height,
                contact: [0.0, 6.0, 8.0],
            })
        };
        course(&ToolPath {
            trajectory: Trajectory {
                kind: MotionKind::Helix,
                from: -1.0,
                step: 4.0,
                points_per_revolution: 4,
                positions: heights.len() as u64,
            },
            touches: heights.iter().map(touch).collect(),
            between: Vec::new(),
        })
    }

    #[test]
    fn gaps_are_bridged_at_the_higher_side() {
        let gaps = [3.0, 7.0, 5.0].map(Some);
        let [a, b, c] = gaps;
        let found = stations(&[None, a, None, None, b, None, c, None]).expect("contact");
        let heights: Vec<f64> = found.iter().map(|s| s.axes[1]).collect();
        assert_eq!(heights, [3.0, 3.0, 7.0, 7.0, 7.0, 7.0, 5.0, 5.0]);
        assert_eq!(found[2].axes, [1.0, 7.0, 180.0]);
        assert!(found.iter().all(|s| s.reach == 10.0));
    }

    #[test]
    fn without_any_contact_there_is_no_course() {
        assert_eq!(stations(&[None, None]), None);
        assert_eq!(stations(&[]), None);
    }

    #[test]
    fn the_way_over_the_part_counts_the_arc_at_the_contact() {
        let [a, b] = [0.0, 90.0].map(|angle| Station {
            axes: [angle / 90.0, 0.0, angle],
            reach: 10.0,
        });
        let arc = 5.0 * std::f64::consts::PI;
        assert!((a.cut(&b) - (arc * arc + 1.0).sqrt()).abs() < 1e-12);
    }
}
