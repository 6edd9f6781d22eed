//! Paths by the coprocessor on the sample last: how far they are from those in doubles, and how much of the
//! part the tool can reach.

use std::cmp::Ordering;

use horma_core::{
    Contact, Coordinates, Cutter, Digitizer, Discretization, Job, Method, Motion, MotionKind,
    Packing, Plan, Point, Row, Simd, Trajectory, pack_words, unpack_words,
};
use horma_formats::sample::{self, LastStyle};

use crate::error::Result;
use crate::subject::MEMORY;

use super::transform::{Transform, Unit, coordinates};

/// The papers' grid for each surface, their torus, and 100 positions to a millimetre.
const GRID: Discretization = Discretization::Grid {
    rows: 130,
    columns: 120,
};
const MAJOR_RADIUS: f64 = 40.0;
const MINOR_RADIUS: f64 = 8.0;
const STEP: f64 = 2.0;
const POINTS_PER_REVOLUTION: u32 = 200;

/// The sample last and its holders, as the coprocessor and as horma have it.
#[derive(Debug)]
pub struct Sample {
    job: Job,
    rows: Vec<Row>,
    /// All points, mm.
    pub points: Vec<Point>,
    /// The same, packed, in the order of their x.
    packed: Vec<u64>,
    /// The rows as they travel to workers if their coordinates are packed.
    sent: Vec<Row>,
    /// All positions.
    pub trajectory: Trajectory,
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
    /// Points in the tool's influence area at each position.
    pub areas: Vec<usize>,
}

impl Sample {
    /// The sample.
    ///
    /// # Errors
    /// None, for the sample as it is.
    pub fn new() -> Result<Self> {
        let part = sample::last(&LastStyle::WOMEN)?;
        let job = Job {
            discretization: GRID,
            cutter: Cutter::torus(MAJOR_RADIUS, MINOR_RADIUS)?,
            motion: Motion {
                kind: MotionKind::Helix,
                step: STEP,
                points_per_revolution: POINTS_PER_REVOLUTION,
                from: None,
                to: None,
                path_tolerance: None,
                lead: [0.0; 2],
            },
            coordinates: Coordinates::Double,
            contact: Contact::Point,
            method: Method::Exact,
        };
        let plan = |coordinates| Plan::new(&part, Job { coordinates, ..job }, MEMORY);
        let Plan {
            model, trajectory, ..
        } = plan(Coordinates::Double)?;
        let rows = model.rows.iter();
        let points: Vec<Point> = rows.flat_map(|r| r.points.iter().copied()).collect();
        let packing = Packing::new(coordinates().fraction())?;
        let packed = points.iter().map(|&p| packing.pack(p));
        let mut packed: Vec<u64> = packed.collect::<horma_core::Result<_>>()?;
        packed.sort_by_key(|&p| unpack_words(p)[0]);
        Ok(Self {
            job,
            rows: model.rows,
            points,
            packed,
            sent: plan(Coordinates::Packed21)?.model.rows,
            trajectory,
        })
    }

    /// Heights in doubles, by horma's own search.
    pub fn exact(&self) -> Vec<Option<f64>> {
        self.heights(&self.rows)
    }

    /// How far the heights of that search over packed rows are from those, mm, at most.
    pub fn sent(&self) -> f64 {
        let pairs = self.heights(&self.sent).into_iter().zip(self.exact());
        let off = pairs.filter_map(|(sent, exact)| Some((sent? - exact?).abs()));
        off.fold(0.0, f64::max)
    }

    fn heights(&self, rows: &[Row]) -> Vec<Option<f64>> {
        let digitizer = Digitizer::new(&self.job, rows, Simd::best());
        let (path, _) = digitizer.path(&self.trajectory);
        path.touches.iter().map(|t| t.map(|t| t.height)).collect()
    }

    /// What the unit does at a position.
    pub fn transform(&self, position: u64) -> Transform {
        let (travel, degrees) = (self.trajectory.travel(position), self.turned(position));
        Transform::new(travel, degrees, self.job.cutter.half_width())
    }

    fn turned(&self, position: u64) -> f64 {
        let revolution = u64::from(POINTS_PER_REVOLUTION);
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
            areas: Vec::new(),
        };
        for (position, exact) in (0..).zip(self.exact()) {
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
        for position in [0, 777, 20_000, sample.trajectory.positions - 1] {
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
