//! Plain solids about the spindle: what a cutter has to keep out of, and what a part is cut from.
//!
//! A wheel's axis is parallel to theirs, so of all its circles only the largest that is over the solid
//! counts, and where that first touches a disc or a rectangle has a closed form. Nothing is discretized
//! here.

use crate::cutter::Cutter;
use crate::error::{Error, Result, bounded};
use crate::tolerance::MAX_COORDINATE;
use crate::vector::{Interval, Point};

/// The same cross-section from one travel to another, around the spindle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solid {
    /// Extent along the spindle, mm; may be infinite.
    pub x: Interval,
    /// Across it.
    pub section: Section,
}

/// A cross-section whose middle is the spindle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Section {
    /// Of a cylinder.
    Disc {
        /// Its radius, mm.
        radius: f64,
    },
    /// Of a block.
    Rectangle {
        /// Along y when the part has not turned, mm.
        height: f64,
        /// Along z, mm.
        width: f64,
    },
}

impl Solid {
    /// Checks the numbers.
    ///
    /// # Errors
    /// [`Error::OutOfBounds`] for a dimension, [`Error::EmptyTravel`] if it ends before it begins.
    pub fn validate(&self) -> Result<()> {
        let dimension = |name, value: f64| {
            let ok = value > 0.0 && value <= MAX_COORDINATE;
            bounded(name, value, ok, "greater than 0 and at most a kilometre")
        };
        match self.section {
            Section::Disc { radius } => dimension("radius", radius)?,
            Section::Rectangle { height, width } => {
                dimension("height", height)?;
                dimension("width", width)?;
            }
        }
        let Interval { low, high } = self.x;
        // Also if one of them is not a number.
        match low < high {
            true => Ok(()),
            false => Err(Error::EmptyTravel {
                from: low,
                to: high,
            }),
        }
    }

    /// How far from the spindle it comes, mm.
    pub fn reach(&self) -> f64 {
        match self.section {
            Section::Disc { radius } => radius,
            Section::Rectangle { height, width } => 0.5 * (height * height + width * width).sqrt(),
        }
    }

    /// How far a point is outside of it, mm, square to its sides; negative inside, and nothing beyond its
    /// ends.
    pub fn outside(&self, [x, y, z]: Point) -> Option<f64> {
        let along = Interval { low: x, high: x };
        self.x.meets(along).then(|| match self.section {
            Section::Disc { radius } => (y * y + z * z).sqrt() - radius,
            Section::Rectangle { height, width } => {
                (y.abs() - 0.5 * height).max(z.abs() - 0.5 * width)
            }
        })
    }

    /// The height at which a wheel's centre first touches it, mm, the wheel being anywhere in `travel`, and
    /// the part turned by the angle of this cosine and sine; `None` where it is out of reach.
    pub fn height(&self, cutter: &Cutter, travel: Interval, (cos, sin): (f64, f64)) -> Option<f64> {
        let over = Interval {
            low: self.x.low - travel.high,
            high: self.x.high - travel.low,
        };
        let m = cutter.largest(over)?;
        match self.section {
            Section::Disc { radius } => Some(radius + m),
            Section::Rectangle { height, width } => {
                rectangle([0.5 * height, 0.5 * width], m, (cos, sin))
            }
        }
    }
}

/// Where a disc of radius `m` first touches a turned rectangle of these half sides: on a side, if that is
/// where the normals meet, else at a corner.
fn rectangle([a, b]: [f64; 2], m: f64, (cos, sin): (f64, f64)) -> Option<f64> {
    // Each side by its normal, its distance from the middle and half its length.
    let sides = [
        ([cos, sin], a, b),
        ([-cos, -sin], a, b),
        ([-sin, cos], b, a),
        ([sin, -cos], b, a),
    ];
    let sides = sides.into_iter().filter_map(|([ny, nz], away, half)| {
        let height = (away + m) / ny;
        (ny > 0.0 && (nz * height).abs() <= half).then_some(height)
    });
    let corners = [(a, b), (a, -b), (-a, b), (-a, -b)];
    let corners = corners.into_iter().filter_map(|(y, z)| {
        let [y, z] = [y * cos - z * sin, y * sin + z * cos];
        (z.abs() <= m).then(|| y + (m * m - z * z).sqrt())
    });
    sides.chain(corners).reduce(f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::digitize::Digitizer;
    use crate::discretize::discretize;
    use crate::job::{Contact, Coordinates, Discretization, Job, Method};
    use crate::motion::{Motion, MotionKind};
    use crate::part::{Body, Mesh, Part, Shape};
    use crate::simd::Simd;

    fn at(x: f64) -> Interval {
        Interval { low: x, high: x }
    }

    const X: Interval = Interval {
        low: -10.0,
        high: 20.0,
    };

    /// A box as a mesh.
    fn block([y, z]: [f64; 2]) -> Part {
        let corner = |i: u32| {
            let side = |bit: u32, half: f64| if i >> bit & 1 == 0 { -half } else { half };
            let x = if i & 1 == 0 { X.low } else { X.high };
            [x, side(1, y), side(2, z)]
        };
        let quads = [
            [0, 2, 6, 4],
            [1, 3, 7, 5],
            [0, 1, 5, 4],
            [2, 3, 7, 6],
            [0, 1, 3, 2],
            [4, 5, 7, 6],
        ];
        let triangles = quads.into_iter();
        let triangles = triangles.flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]);
        let mesh = Mesh::new("box", (0..8).map(corner).collect(), triangles.collect());
        Part {
            bodies: vec![Body {
                name: "box".to_owned(),
                shape: Shape::Mesh(mesh.expect("valid")),
            }],
        }
    }

    #[test]
    fn a_block_is_touched_where_it_is_digitized() {
        for (sides, cutter) in [
            ([35.0, 50.0], Cutter::torus(40.0, 8.0)),
            ([35.0, 20.0], Cutter::ball(12.0)),
            ([5.0, 60.0], Cutter::cone(30.0, 16.0, -40.0)),
        ] {
            let cutter = cutter.expect("valid");
            let solid = Solid {
                x: X,
                section: Section::Rectangle {
                    height: 2.0 * sides[0],
                    width: 2.0 * sides[1],
                },
            };
            let motion = Motion {
                from: Some(-25.0),
                to: Some(35.0),
                ..Motion::new(MotionKind::Helix, 1.7, 97)
            };
            let job = Job {
                discretization: Discretization::Tolerance(0.01),
                cutter,
                motion,
                coordinates: Coordinates::Double,
                contact: Contact::Facet,
                method: Method::Exact,
            };
            let model = discretize(&block(sides), job.discretization).expect("a mesh");
            let trajectory = motion.over(X, 0.0).expect("valid");
            let digitizer = Digitizer::new(&job, &model.rows, Simd::best());
            let (mut i, mut reached) = (0, 0);
            digitizer.run_chunks(&trajectory, 0..trajectory.positions, |run, _| {
                for touch in run.touches {
                    let direction = trajectory.direction_at(i, 0.0);
                    let found = solid.height(&cutter, at(trajectory.travel(i)), direction);
                    let expected = touch.map(|t| t.height);
                    assert_eq!(found.is_some(), expected.is_some(), "position {i}");
                    let off = found.unwrap_or_default() - expected.unwrap_or_default();
                    assert!(off.abs() < 1.0e-7, "position {i}: {found:?} {expected:?}");
                    reached += u32::from(found.is_some());
                    i += 1;
                }
                true
            });
            assert!(reached > 1000 && u64::from(reached) < i, "{reached} of {i}");
        }
    }

    #[test]
    fn a_cylinder_is_touched_by_the_largest_circle_over_it() {
        let solid = Solid {
            x: X,
            section: Section::Disc { radius: 30.0 },
        };
        let torus = Cutter::torus(40.0, 8.0).expect("valid");
        let height = |x: f64| solid.height(&torus, at(x), (1.0, 0.0));
        assert_eq!([height(-10.0), height(0.0)], [Some(78.0); 2]);
        assert_eq!(
            [height(-18.0), height(28.0), height(-18.001)],
            [Some(70.0), Some(70.0), None]
        );
        let moving = Interval {
            low: -30.0,
            high: -12.0,
        };
        let found = solid.height(&torus, moving, (1.0, 0.0));
        assert_eq!(found, Some(30.0 + 40.0 + 60.0_f64.sqrt()));
        let cone = Cutter::cone(30.0, 16.0, 45.0).expect("valid");
        let found = solid.height(&cone, at(22.0), (0.0, 1.0)).expect("reach");
        assert!((found - 58.0).abs() < 1e-9, "{found}");
    }

    #[test]
    fn points_outside_are_told_square_to_the_sides() {
        let section = Section::Rectangle {
            height: 20.0,
            width: 40.0,
        };
        let solid = Solid { x: X, section };
        assert_eq!(solid.outside([0.0, 12.0, 5.0]), Some(2.0));
        assert_eq!(solid.outside([0.0, 3.0, -19.0]), Some(-1.0));
        assert_eq!(solid.outside([21.0, 12.0, 5.0]), None);
        assert!((solid.reach() - 500.0_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let solid = |x, section| Solid { x, section }.validate();
        let disc = |radius| Section::Disc { radius };
        assert!(solid(X, disc(1.0)).is_ok());
        for radius in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(
                solid(X, disc(radius)),
                Err(Error::OutOfBounds { .. })
            ));
        }
        for x in [at(3.0), Interval::EMPTY, at(f64::NAN)] {
            let refused = solid(x, disc(1.0));
            assert!(matches!(refused, Err(Error::EmptyTravel { .. })));
        }
    }
}
