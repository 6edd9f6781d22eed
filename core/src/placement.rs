//! Placement: from file coordinates to the part frame, whose X axis is the spindle.
//!
//! Rotations are built from + − × ÷ √ alone, so that a placed part is the same bits everywhere.

use nalgebra::{Matrix3, Vector3};

use crate::error::{Error, Result};
use crate::part::{Part, Shape};
use crate::vector::{Point, cross, length, sub, unit};

/// The spindle axis in file coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Axis {
    /// Through `point`, which becomes the origin, along `direction`, which becomes +X; mm.
    Through {
        /// A point of the axis.
        point: Point,
        /// Its direction, of any length.
        direction: Point,
    },
    /// Through the centroid of the part's surface, along the direction in which it extends most.
    Principal,
}

impl Default for Axis {
    fn default() -> Self {
        Self::Through {
            point: [0.0; 3],
            direction: [1.0, 0.0, 0.0],
        }
    }
}

/// Places the part in the frame of the spindle: `axis` becomes X by the shortest turn, so that an
/// axis along X leaves Y and Z alone.
///
/// # Errors
/// [`Error::NoDirection`] if the direction has no length or is not finite, [`Error::EmptyPart`] if
/// the principal axis of nothing is asked for, [`Error::TooFar`] if the origin is so far from the part
/// that its coordinates would be.
pub fn place(part: Part, axis: Axis) -> Result<Part> {
    let (point, direction) = match axis {
        Axis::Through { point, direction } => (point, direction),
        Axis::Principal => principal_axis(&part)?,
    };
    let x = unit(direction).ok_or(Error::NoDirection { direction })?;
    if let Some(value) = point.into_iter().find(|c| !c.is_finite()) {
        return Err(Error::OutOfBounds {
            quantity: "axis.point",
            value,
            bound: "finite",
        });
    }
    let turn = turn_to_x(Vector3::from(x));
    let placed = part.map_points(|p| (turn * Vector3::from(sub(p, point))).into());
    placed.check_points()?;
    Ok(placed)
}

/// The rotation by the smallest angle that takes the unit vector `a` to X.
fn turn_to_x(a: Vector3<f64>) -> Matrix3<f64> {
    let across = a.y * a.y + a.z * a.z;
    if a.x < 0.0 && across == 0.0 {
        // Straight back: any half turn across X will do; the one about Z keeps Z up.
        return Matrix3::from_diagonal(&Vector3::new(-1.0, -1.0, 1.0));
    }
    let k = a.cross(&Vector3::x()).cross_matrix();
    // 1 / (1 + a.x), without cancellation on either side.
    let share = if a.x < 0.0 {
        (1.0 - a.x) / across
    } else {
        1.0 / (1.0 + a.x)
    };
    Matrix3::identity() + k + k * k * share
}

/// Area-weighted centroid and direction of greatest extent. Surfaces are taken by their nets of
/// poles, which follow them closely enough for a default.
fn principal_axis(part: &Part) -> Result<(Point, Point)> {
    part.validate()?;
    let mut area = 0.0;
    let mut first = Vector3::zeros();
    let mut second = Matrix3::zeros();
    let mut add = |a: Point, b: Point, c: Point| {
        let weight = length(cross(sub(b, a), sub(c, a)));
        let [a, b, c] = [a, b, c].map(Vector3::from);
        let sum = a + b + c;
        area += weight;
        first += weight / 3.0 * sum;
        // The exact second moment of a triangle.
        let corners = a * a.transpose() + b * b.transpose() + c * c.transpose();
        second += weight / 12.0 * (corners + sum * sum.transpose());
    };
    for body in &part.bodies {
        match &body.shape {
            Shape::Mesh(mesh) => {
                for t in mesh.triangles() {
                    let [a, b, c] = t.map(|v| mesh.vertices()[v as usize]);
                    add(a, b, c);
                }
            }
            Shape::Surface(surface) => {
                let n = surface.v().count();
                let rows: Vec<&[Point]> = surface.poles().chunks_exact(n).collect();
                for pair in rows.windows(2) {
                    for j in 1..n {
                        let [a, b] = [pair[0][j - 1], pair[0][j]];
                        let [c, d] = [pair[1][j - 1], pair[1][j]];
                        add(a, b, d);
                        add(a, d, c);
                    }
                }
            }
        }
    }
    if area <= 0.0 {
        return Err(Error::EmptyPart);
    }
    let centroid = first / area;
    let spread = second / area - centroid * centroid.transpose();
    // Squaring a symmetric matrix again and again leaves the projector on its greatest direction.
    let mut power = spread / spread.norm();
    for _ in 0..48 {
        power *= power;
        power /= power.norm();
    }
    let greatest = (0..3)
        .map(|i| power.column(i).into_owned())
        .reduce(|a, b| {
            if b.norm_squared() > a.norm_squared() {
                b
            } else {
                a
            }
        })
        .unwrap_or_else(Vector3::x);
    let along = greatest.iamax();
    let direction = greatest * greatest[along].signum();
    Ok((centroid.into(), direction.into()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::part::{Body, Mesh};

    fn part(vertices: &[Point]) -> Part {
        let triangles = vec![[0, 1, 2], [0, 2, 3]];
        Part {
            bodies: vec![Body {
                name: "quad".to_owned(),
                shape: Shape::Mesh(Mesh::new("quad", vertices.to_vec(), triangles).expect("valid")),
            }],
        }
    }

    fn vertices(part: &Part) -> Vec<Point> {
        match &part.bodies[0].shape {
            Shape::Mesh(m) => m.vertices().to_vec(),
            Shape::Surface(_) => unreachable!("the test part is a mesh"),
        }
    }

    const QUAD: [Point; 4] = [
        [1.0, 2.0, 0.0],
        [1.0, 12.0, 0.0],
        [4.0, 12.0, 0.0],
        [4.0, 2.0, 0.0],
    ];

    #[test]
    fn an_axis_along_x_only_moves_the_origin() {
        let axis = Axis::Through {
            point: [0.0, 2.0, 14.0],
            direction: [3.0, 0.0, 0.0],
        };
        let placed = place(part(&QUAD), axis).expect("valid");
        assert_eq!(vertices(&placed)[1], [1.0, 10.0, -14.0]);
    }

    #[test]
    fn any_direction_becomes_x_without_distortion() {
        for direction in [
            [0.0, 1.0, 0.0],
            [-1.0, 0.0, 0.0],
            [-1.0, 1e-9, 0.0],
            [-1.0, 1.5e-6, 0.5e-6],
            [1.0, -2.0, 3.0],
        ] {
            let axis = Axis::Through {
                point: [0.0; 3],
                direction,
            };
            let placed = vertices(&place(part(&QUAD), axis).expect("valid"));
            for (p, q) in placed.iter().zip(&QUAD) {
                assert!((length(*p) - length(*q)).abs() < 1e-9);
                let along = crate::vector::dot(*q, unit(direction).expect("length"));
                assert!((p[0] - along).abs() < 1e-9, "{direction:?}");
            }
        }
        let axis = Axis::Through {
            point: [0.0; 3],
            direction: [0.0; 3],
        };
        assert!(place(part(&QUAD), axis).is_err());
    }

    #[test]
    fn the_principal_axis_is_the_longest() {
        let placed = vertices(&place(part(&QUAD), Axis::Principal).expect("valid"));
        let xs: Vec<f64> = placed.iter().map(|p| p[0]).collect();
        assert!(
            (xs[0] + 5.0).abs() < 1e-9 && (xs[1] - 5.0).abs() < 1e-9,
            "{xs:?}"
        );
    }
}
