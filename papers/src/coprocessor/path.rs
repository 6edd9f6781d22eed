//! Paths by the coprocessor on the sample last: how far they are from those in doubles, and how much of the
//! part the tool can reach.

use std::cmp::Ordering;

use horma_core::{Method, Packing, Point, Trajectory, pack_words, unpack_words};

use crate::error::Result;
use crate::subject::{Subject, Turning};

use super::transform::{Transform, Unit, coordinates};

/// The papers' grid for each surface, their torus, and 100 positions to a millimetre.
const GRID: [u32; 2] = [130, 120];
const MAJOR_RADIUS: f64 = 40.0;
const MINOR_RADIUS: f64 = 8.0;
const TURNING: Turning = Turning {
    points_per_revolution: 200,
    step: 2.0,
};

/// The sample last and its holders, as the coprocessor and as horma have it.
#[derive(Debug)]
pub struct Sample {
    subject: Subject,
    /// The same as it travels to workers if its coordinates are packed.
    sent: Subject,
    /// All points, mm.
    pub points: Vec<Point>,
    /// The same, packed, in the order of their x.
    packed: Vec<u64>,
}

/// How the coprocessor's path compares with the one in doubles; mm.
#[derive(Debug, Clone, PartialEq)]
pub struct Compared {
    /// Positions at which both touch.
    pub both: u64,
    /// Positions at which one touches alone.
    pub one: u64,
    /// Positions at which the two are equal to the last bit of the coordinate.
    pub same: u64,
    /// How far apart they are at most.
    pub largest: f64,
    /// On average.
    pub mean: f64,
    /// How far heights of the exact search over packed points are from those in doubles at most.
    pub sent: f64,
    /// Points in the tool's influence area at each position.
    pub areas: Vec<usize>,
}

impl Sample {
    /// The sample.
    ///
    /// # Errors
    /// None, for the sample as it is.
    pub fn new() -> Result<Self> {
        let subject = Subject::new(GRID, TURNING, [MAJOR_RADIUS, MINOR_RADIUS])?;
        let rows = subject.plan.model.rows.iter();
        let points: Vec<Point> = rows.flat_map(|r| r.points.iter().copied()).collect();
        let packing = Packing::new(coordinates().fraction())?;
        let packed = points.iter().map(|&p| packing.pack(p));
        let mut packed: Vec<u64> = packed.collect::<horma_core::Result<_>>()?;
        packed.sort_by_key(|&p| unpack_words(p)[0]);
        Ok(Self {
            sent: subject.packed()?,
            subject,
            points,
            packed,
        })
    }

    /// All positions.
    pub fn trajectory(&self) -> Trajectory {
        self.subject.plan.trajectory
    }

    /// Heights in doubles, by horma's own search.
    pub fn exact(&self) -> Vec<Option<f64>> {
        heights(&self.subject)
    }

    /// What the unit does at a position.
    pub fn transform(&self, position: u64) -> Transform {
        let (travel, degrees) = (self.trajectory().travel(position), self.turned(position));
        Transform::new(travel, degrees, self.subject.plan.job.cutter.half_width())
    }

    fn turned(&self, position: u64) -> f64 {
        let revolution = u64::from(TURNING.points_per_revolution);
        360.0 * (position % revolution) as f64 / revolution as f64
    }

    /// The points in the influence area, which are all that the unit stores.
    fn area(&self, transform: &Transform) -> &[u64] {
        let up_to = |end: Ordering| {
            self.packed
                .partition_point(|&p| transform.place(unpack_words(p)) <= end)
        };
        &self.packed[up_to(Ordering::Less)..up_to(Ordering::Equal)]
    }

    /// The height at a position by the coprocessor: points of 21 bits, and the host's distances of these in
    /// doubles, eq. (1). Also how many points are in the influence area.
    pub fn height(&self, position: u64) -> (Option<f64>, usize) {
        let transform = self.transform(position);
        let area = self.area(&transform);
        let heights = area.iter().filter_map(|&packed| {
            // Packed once more, as the unit stores it.
            let seen = unpack_words(pack_words(transform.apply(unpack_words(packed))));
            distance(seen.map(|word| coordinates().value(i64::from(word))))
        });
        (heights.reduce(f64::max), area.len())
    }

    /// The path by the coprocessor against the one in doubles.
    pub fn compare(&self) -> Compared {
        let mut compared = Compared {
            both: 0,
            one: 0,
            same: 0,
            largest: 0.0,
            mean: 0.0,
            sent: 0.0,
            areas: Vec::new(),
        };
        let pairs = self.exact().into_iter().zip(heights(&self.sent));
        for (position, (exact, sent)) in (0..).zip(pairs) {
            if let Some((exact, sent)) = exact.zip(sent) {
                compared.sent = compared.sent.max((sent - exact).abs());
            }
            let (height, area) = self.height(position);
            compared.areas.push(area);
            match (height, exact) {
                (Some(height), Some(exact)) => {
                    let off = (height - exact).abs();
                    compared.both += 1;
                    compared.same += u64::from(off <= coordinates().ulp() / 2.0);
                    compared.largest = compared.largest.max(off);
                    compared.mean += off;
                }
                (None, None) => {}
                _ => compared.one += 1,
            }
        }
        compared.mean /= compared.both as f64;
        compared
    }

    /// Cycles of the unit for all points at a position, and what it stores.
    pub fn clocked(&self, position: u64) -> (u64, Vec<u64>) {
        let (mut unit, mut stored) = (Unit::default(), Vec::new());
        unit.run(&self.transform(position), &self.packed, &mut stored);
        (unit.cycles, stored)
    }
}

/// Heights by horma's exact search.
fn heights(subject: &Subject) -> Vec<Option<f64>> {
    let (path, _) = subject.path(Method::Exact);
    path.touches.iter().map(|t| t.map(|t| t.height)).collect()
}

/// Eq. (1) as a height: where the tool's centre stands when it touches a point seen from it.
fn distance([x, y, z]: Point) -> Option<f64> {
    let across = MINOR_RADIUS * MINOR_RADIUS - x * x;
    if across < 0.0 {
        return None;
    }
    let radius = MAJOR_RADIUS + across.sqrt();
    let along = radius * radius - z * z;
    (along >= 0.0).then(|| y + along.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_stores_the_influence_area_and_no_more() {
        let sample = Sample::new().expect("the sample");
        for position in [0, 777, 20_000, sample.trajectory().positions - 1] {
            let transform = sample.transform(position);
            let (cycles, stored) = sample.clocked(position);
            assert_eq!(cycles, sample.points.len() as u64 + 4);
            let area = sample.area(&transform).iter();
            let expected: Vec<u64> = area
                .map(|&p| pack_words(transform.apply(unpack_words(p))))
                .collect();
            assert_eq!(stored, expected);
        }
    }

    #[test]
    fn paths_are_far_closer_to_doubles_than_a_tenth_of_a_millimetre() {
        let compared = Sample::new().expect("the sample").compare();
        assert!(compared.largest < 0.1, "{}", compared.largest);
        assert!(
            compared.both > 30_000 && compared.one < 20,
            "{} {}",
            compared.both,
            compared.one
        );
    }
}
