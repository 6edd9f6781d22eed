//! Upper bounds: how high the cutter can be touched anywhere within a patch of the part.
//!
//! F is concave, so its tangent plane at any place within the reach lies above it everywhere. Taken
//! near the patch, where the cutter is tangent to it, the bound's slack is of second order in the
//! patch's size. Out of reach a cylinder around the cutter bounds it, to first order. Bounds decide
//! only what is skipped: they need to be safe, not the same everywhere.

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

use crate::contact::Pose;
use crate::cutter::Cutter;
use crate::tolerance::{BOUND_SLACK, REACH_SLACK};
use crate::vector::{Interval, Point, add_scaled, dot, length, sub};

/// A box, turned any way, that holds a part of the part.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Patch {
    center: Point,
    /// Half-axes of the box.
    axes: [Point; 3],
    /// Distance from the centre to a corner.
    radius: f64,
    /// Extent along the spindle.
    x: Interval,
}

impl Patch {
    pub const EMPTY: Self = Self {
        center: [0.0; 3],
        axes: [[0.0; 3]; 3],
        radius: 0.0,
        x: Interval::EMPTY,
    };

    /// A snug box around points: its axes are the principal axes of the points.
    pub fn around(points: impl Iterator<Item = Point> + Clone) -> Self {
        let mut count = 0.0;
        let mut first = Vector3::zeros();
        for p in points.clone() {
            count += 1.0;
            first += Vector3::from(p);
        }
        let mean = first / count;
        let mut spread = Matrix3::zeros();
        for p in points.clone() {
            let r = Vector3::from(p) - mean;
            spread += r * r.transpose();
        }
        let frame = SymmetricEigen::new(spread).eigenvectors;
        let frame = [0, 1, 2].map(|i| Point::from(frame.column(i).into_owned()));
        Self::framed(mean.into(), frame, points)
    }

    /// The upright box around points.
    pub fn upright(points: impl Iterator<Item = Point>) -> Self {
        Self::framed(
            [0.0; 3],
            [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            points,
        )
    }

    fn framed(origin: Point, frame: [Point; 3], points: impl Iterator<Item = Point>) -> Self {
        let mut ranges = [Interval::EMPTY; 3];
        let mut x = Interval::EMPTY;
        for p in points {
            let r = sub(p, origin);
            for (range, &axis) in ranges.iter_mut().zip(&frame) {
                let along = dot(r, axis);
                *range = range.hull(Interval {
                    low: along,
                    high: along,
                });
            }
            x = x.hull(Interval {
                low: p[0],
                high: p[0],
            });
        }
        let mut center = origin;
        let mut axes = frame;
        let mut square = 0.0;
        for (range, axis) in ranges.iter().zip(&mut axes) {
            center = add_scaled(center, (range.low + range.high) / 2.0, *axis);
            let half = (range.high - range.low) / 2.0;
            *axis = axis.map(|c| c * half);
            square += half * half;
        }
        Self {
            center,
            axes,
            radius: square.sqrt(),
            x,
        }
    }

    /// An upper bound of F over the patch, or `None` if nothing of it can be in reach.
    #[inline]
    pub fn bound(&self, cutter: &Cutter, pose: &Pose) -> Option<f64> {
        let w = cutter.half_width();
        let reach = w + REACH_SLACK;
        if self.x.high < pose.x - reach || self.x.low > pose.x + reach {
            return None;
        }
        let [d, y, z] = pose.face(self.center);
        let around = cutter.max_radius() + self.radius;
        let slack = BOUND_SLACK * (around + length(self.center) + pose.x.abs() + w);
        if z.abs() > around + slack {
            return None;
        }
        let circle = y + ((around - z) * (around + z)).max(0.0).sqrt();

        let tangent = Tangent::near(cutter, d, z);
        // The tangent plane's gradient, turned back into the part's frame.
        let Tangent { by_d, by_z, .. } = tangent;
        let gradient = [by_d, pose.cos + pose.sin * by_z, pose.cos * by_z - pose.sin];
        let over_box: f64 = self.axes.iter().map(|&a| dot(gradient, a).abs()).sum();
        let plane = tangent.over([d, y, z]) + over_box;
        // Steep planes magnify rounding; where they matter, the circle bounds better.
        let steep = BOUND_SLACK * (tangent.rounding([d, y, z]) + over_box);
        Some((plane + steep).min(circle) + slack)
    }
}

/// An upper bound of F over a facet, or `None` if nothing of it can be in reach: its tangent plane at
/// the facet's middle is highest at a corner.
#[inline(always)]
pub(crate) fn facet_bound(cutter: &Cutter, pose: &Pose, corners: [Point; 3]) -> Option<f64> {
    let w = cutter.half_width();
    let seen = corners.map(|p| pose.face(p));
    let [a, b, c] = seen;
    if a[0].min(b[0]).min(c[0]) > w || a[0].max(b[0]).max(c[0]) < -w {
        return None;
    }
    let middle = |axis: usize| (a[axis] + b[axis] + c[axis]) / 3.0;
    let tangent = Tangent::near(cutter, middle(0), middle(2));
    let size = cutter.max_radius() + pose.x.abs() + w;
    let slack = BOUND_SLACK * (size + length(a) + length(b) + length(c));
    let over = seen.map(|p| tangent.over(p) + BOUND_SLACK * tangent.rounding(p));
    Some(over[0].max(over[1]).max(over[2]) + slack)
}

/// The tangent plane of G(d, z) = √(m(d)² − z²).
struct Tangent {
    d: f64,
    z: f64,
    rise: f64,
    by_d: f64,
    by_z: f64,
}

impl Tangent {
    /// At the place nearest to `(d, z)` that is well within the reach, where the slopes are finite.
    #[inline(always)]
    fn near(cutter: &Cutter, d: f64, z: f64) -> Self {
        let w = cutter.half_width();
        let (d, m, growth) = match *cutter {
            Cutter::Torus {
                major_radius,
                minor_radius,
            } => {
                let d = d.clamp(-0.98 * w, 0.98 * w);
                let root = ((minor_radius - d) * (minor_radius + d)).sqrt();
                (d, major_radius + root, -d / root)
            }
            Cutter::Cone { radius, slope, .. } => {
                let d = d.clamp(-0.98 * w, 0.98 * w);
                (d, radius + d * slope, slope)
            }
        };
        let z = z.clamp(-0.98 * m, 0.98 * m);
        let rise = ((m - z) * (m + z)).sqrt();
        Self {
            d,
            z,
            rise,
            by_d: m * growth / rise,
            by_z: -z / rise,
        }
    }

    /// What the rounding of [`Tangent::over`] is proportional to.
    #[inline(always)]
    fn rounding(&self, [d, _, z]: Point) -> f64 {
        self.by_d.abs() * (d.abs() + self.d.abs()) + self.by_z.abs() * (z.abs() + self.z.abs())
    }

    /// F's upper bound at a point seen from the cutter.
    #[inline(always)]
    fn over(&self, [d, y, z]: Point) -> f64 {
        y + self.rise + self.by_d * (d - self.d) + self.by_z * (z - self.z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::{touch_facet, touch_point};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn nothing_in_a_patch_is_touched_above_its_bound(
            points in prop::collection::vec(prop::array::uniform3(-30.0..30.0_f64), 1..20),
            x in -40.0..40.0_f64,
            degrees in 0..360_i32,
            which in 0..4_usize,
            shrink in prop_oneof![Just(1.0), Just(0.1), Just(0.0)],
        ) {
            let cutter = [
                Cutter::torus(40.0, 8.0),
                Cutter::ball(5.0),
                Cutter::cylinder(10.0, 6.0),
                Cutter::cone(10.0, 20.0, 45.0),
            ][which].clone().expect("valid");
            let pose = Pose {
                x,
                cos: libm::cos(f64::from(degrees).to_radians()),
                sin: libm::sin(f64::from(degrees).to_radians()),
            };
            let points: Vec<Point> = points
                .iter()
                .map(|p| add_scaled(points[0], shrink, sub(*p, points[0])))
                .collect();
            let all = points.iter().copied();
            for patch in [Patch::around(all.clone()), Patch::upright(all)] {
                let bound = patch.bound(&cutter, &pose);
                for &p in &points {
                    if let Some(touch) = touch_point(&cutter, &pose, p) {
                        prop_assert!(bound.is_some_and(|b| b >= touch.height));
                    }
                }
            }
            for corners in points.windows(3) {
                let corners = [corners[0], corners[1], corners[2]];
                if let Some(touch) = touch_facet(&cutter, &pose, corners) {
                    let bound = facet_bound(&cutter, &pose, corners);
                    prop_assert!(bound.is_some_and(|b| b >= touch.height));
                }
            }
        }
    }
}
