//! The cutters: wheels whose axis is parallel to the spindle.
//!
//! A wheel is the body of revolution of a concave profile `m(d)`, the radius at axial distance `d`
//! from its centre; it is convex, which carries the search and the contact with a facet. Eq. (4) of
//! the 2001 paper is the torus. This module knows shapes only; heights are in `contact`.

use crate::error::{Error, Result, bounded};
use crate::vector::Interval;

/// A wheel. Lengths in mm; construct with the functions, which check the dimensions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cutter {
    /// `m(d) = R + √(r² − d²)`; a ball is a torus with `R = 0`.
    Torus {
        /// R: from the axis to the tube's centre.
        major_radius: f64,
        /// r: radius of the tube, and half the width.
        minor_radius: f64,
    },
    /// `m(d) = R + d·tan φ` over the width; a cylinder is a cone with `φ = 0`.
    Cone {
        /// Radius in the middle of the width.
        radius: f64,
        /// Full width.
        width: f64,
        /// φ, degrees; positive if the radius grows along +X.
        half_angle: f64,
        /// tan φ.
        slope: f64,
    },
}

/// Largest dimension of a cutter, mm.
const MAX_DIMENSION: f64 = 1.0e4;

fn dimension(quantity: &'static str, value: f64) -> Result<()> {
    let ok = value > 0.0 && value <= MAX_DIMENSION;
    bounded(quantity, value, ok, "greater than 0 and at most 10000 mm")
}

impl Cutter {
    /// A torus of major radius R ≥ 0 and minor radius r > 0.
    ///
    /// # Errors
    /// [`Error::OutOfBounds`] if a radius is negative, not finite or beyond 10 m.
    pub fn torus(major_radius: f64, minor_radius: f64) -> Result<Self> {
        let ok = (0.0..=MAX_DIMENSION).contains(&major_radius);
        bounded(
            "major_radius",
            major_radius,
            ok,
            "at least 0 and at most 10000 mm",
        )?;
        dimension("minor_radius", minor_radius)?;
        Ok(Self::Torus {
            major_radius,
            minor_radius,
        })
    }

    /// A ball.
    ///
    /// # Errors
    /// [`Error::OutOfBounds`] if the radius is not positive and finite.
    pub fn ball(radius: f64) -> Result<Self> {
        dimension("radius", radius)?;
        Self::torus(0.0, radius)
    }

    /// A cylinder.
    ///
    /// # Errors
    /// [`Error::OutOfBounds`] if a dimension is not positive and finite.
    pub fn cylinder(radius: f64, width: f64) -> Result<Self> {
        dimension("radius", radius)?;
        Self::cone(radius, width, 0.0)
    }

    /// A cone, `radius` in the middle of its width, `half_angle` in degrees between side and axis.
    ///
    /// # Errors
    /// [`Error::OutOfBounds`] for a dimension, [`Error::ConeTooSteep`] if the small end would have
    /// a negative radius.
    pub fn cone(radius: f64, width: f64, half_angle: f64) -> Result<Self> {
        dimension("radius", radius)?;
        dimension("width", width)?;
        let ok = half_angle.abs() < 90.0;
        bounded(
            "half_angle",
            half_angle,
            ok,
            "between -90 and 90 degrees, both excluded",
        )?;
        let slope = libm::tan(half_angle.to_radians());
        if slope.abs() * width / 2.0 > radius {
            return Err(Error::ConeTooSteep {
                half_angle,
                radius,
                width,
                limit: libm::atan(radius / (width / 2.0)).to_degrees(),
            });
        }
        Ok(Self::Cone {
            radius,
            width,
            half_angle,
            slope,
        })
    }

    /// A wheel that keeps this one `by` away from whatever it does not enter itself, mm. Of a torus that is
    /// exactly what is no further than that from it; of a cone, the least cone that holds it.
    ///
    /// # Errors
    /// [`Error::OutOfBounds`] if it is larger than wheels may be.
    pub fn grown(&self, by: f64) -> Result<Self> {
        match *self {
            Self::Torus {
                major_radius,
                minor_radius,
            } => Self::torus(major_radius, minor_radius + by),
            Self::Cone {
                radius,
                width,
                half_angle,
                slope,
            } => {
                // The side moves by that much along its normal, and both ends along the axis.
                let radius = radius + by * (1.0 + slope * slope).sqrt();
                Self::cone(radius, width + 2.0 * by, half_angle)
            }
        }
    }

    /// w: half the width along the spindle, mm.
    pub fn half_width(&self) -> f64 {
        match *self {
            Self::Torus { minor_radius, .. } => minor_radius,
            Self::Cone { width, .. } => width / 2.0,
        }
    }

    /// Largest radius of the profile, mm.
    pub fn max_radius(&self) -> f64 {
        match *self {
            Self::Torus {
                major_radius,
                minor_radius,
            } => major_radius + minor_radius,
            Self::Cone {
                radius,
                width,
                slope,
                ..
            } => radius + slope.abs() * width / 2.0,
        }
    }

    /// How much the height over a wheel's axis bends down everywhere, and at least, along the axis and across it,
    /// 1/mm: along any way over the profile it lies below its tangent by half of these times the squares of the
    /// way's parts.
    pub fn least_bends(&self) -> [f64; 2] {
        match *self {
            // Along a way (x, y), G = √(m² − z²) bends by (m|m″|/G)·x² + (m′z·x − m·y)²/G³, with
            // m|m″| = (1 + R/√(r² − d²))·(1 + m′²). Of a ball, without R, that is (x² + y²)/G and
            // (m′m·x − z·y)²/G³ more. What R adds is at least R/(r·G)·x², and G is at most R + r.
            Self::Torus { minor_radius, .. } => [1.0 / minor_radius, 1.0 / self.max_radius()],
            // Level along its rulings.
            Self::Cone { .. } => [0.0; 2],
        }
    }

    /// The largest radius at axial distances in `over`, mm, or `None` if they are all beyond the width.
    pub fn largest(&self, over: Interval) -> Option<f64> {
        let w = self.half_width();
        let (low, high) = (over.low.max(-w), over.high.min(w));
        if low > high {
            return None;
        }
        self.profile(match *self {
            Self::Torus { .. } => 0.0_f64.clamp(low, high),
            Self::Cone { slope, .. } if slope > 0.0 => high,
            Self::Cone { .. } => low,
        })
    }

    /// `m(d)`, the radius at axial distance `d` from the centre, or `None` beyond the width.
    #[inline(always)]
    pub fn profile(&self, d: f64) -> Option<f64> {
        match *self {
            Self::Torus {
                major_radius,
                minor_radius,
            } => {
                let q = minor_radius * minor_radius - d * d;
                (q >= 0.0).then_some(major_radius + q.sqrt())
            }
            Self::Cone {
                radius,
                width,
                slope,
                ..
            } => (d.abs() <= width / 2.0).then_some(radius + d * slope),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dimensions_are_checked() {
        assert!(Cutter::torus(40.0, 8.0).is_ok());
        assert!(Cutter::torus(-1.0, 8.0).is_err());
        assert!(Cutter::torus(40.0, 0.0).is_err());
        assert!(Cutter::ball(f64::NAN).is_err());
        assert!(Cutter::cylinder(10.0, f64::INFINITY).is_err());
        assert!(matches!(
            Cutter::cone(10.0, 30.0, 45.0),
            Err(Error::ConeTooSteep { .. })
        ));
    }

    #[test]
    fn a_grown_wheel_holds_all_that_is_so_near() {
        for cutter in [
            Cutter::torus(40.0, 8.0),
            Cutter::ball(6.0),
            Cutter::cylinder(15.0, 6.0),
            Cutter::cone(15.0, 20.0, 50.0),
            Cutter::cone(10.0, 20.0, -45.0),
        ] {
            let (cutter, by) = (cutter.expect("valid"), 1.5);
            let grown = cutter.grown(by).expect("valid");
            let w = cutter.half_width();
            let (mut nearest, steps) = (f64::INFINITY, 400);
            for i in 0..=steps {
                let d = w * (f64::from(2 * i) / f64::from(steps) - 1.0);
                let m = cutter.profile(d).expect("inside");
                // All around a point of the rim.
                for j in 0..360 {
                    let (sin, cos) = f64::from(j).to_radians().sin_cos();
                    let (d, m) = (d + 0.999_999 * by * sin, m + 0.999_999 * by * cos);
                    let over = grown.profile(d).expect("inside") - m;
                    assert!(over > -1e-9, "{cutter:?} at {d}: {over}");
                    nearest = nearest.min(over);
                }
            }
            assert!(nearest < 1e-3, "{cutter:?}: {nearest}");
        }
    }

    #[test]
    fn profiles_are_the_papers() {
        let torus = Cutter::torus(40.0, 8.0).expect("valid");
        assert_eq!(torus.profile(0.0), Some(48.0));
        assert_eq!(torus.profile(8.0), Some(40.0));
        assert_eq!(torus.profile(8.1), None);
        let cone = Cutter::cone(10.0, 20.0, 45.0).expect("valid");
        assert!((cone.profile(-10.0).expect("inside")).abs() < 1e-12);
    }
}
