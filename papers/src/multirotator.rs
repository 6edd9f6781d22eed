//! The MultiRotator: one point after the other turned by a whole number of equal steps, with the sine and the
//! cosine of each angle made from those of the one before (FPGA paper, eqs. 3–7).
//!
//! Here is the arithmetic, in doubles and in fixed point; [`Datapath`] is the circuit that does the same with
//! registers and adders, bit for bit.

mod chapter;
mod datapath;

pub(crate) use chapter::CIRCUITS;
pub use chapter::chapter;
pub use datapath::{Adders, Datapath, Digits, cycles, resources};

use crate::fixed::{Format, Rounding};

/// Cosine and sine of a step in degrees, the same bits on every machine.
pub fn cos_sin(degrees: f64) -> [f64; 2] {
    let radians = degrees.to_radians();
    [libm::cos(radians), libm::sin(radians)]
}

/// The recurrence in doubles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Recurrence {
    step: [f64; 2],
    /// Cosine and sine of the angle so far.
    pub turned: [f64; 2],
}

impl Recurrence {
    /// After one step of so many degrees.
    pub fn new(degrees: f64) -> Self {
        let step = cos_sin(degrees);
        Self { step, turned: step }
    }

    /// Eq. (7): the angle becomes one step more.
    pub fn advance(&mut self) {
        let ([c, s], [cd, sd]) = (self.turned, self.step);
        self.turned = [c * cd - s * sd, s * cd + c * sd];
    }

    /// Eq. (4): a point turned by the angle so far.
    pub fn rotate(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [c, s] = self.turned;
        [x * c - y * s, y * c + x * s]
    }
}

/// The same in fixed point: each sum of two products is exact and rounded once, to the last place of the
/// word, which is "the maximum precision allowed by the binary representation".
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MultiRotator {
    format: Format,
    rounding: Rounding,
    step: [i64; 2],
    turned: [i64; 2],
    /// How far the words of the step are from its cosine and sine.
    inexact: f64,
}

impl MultiRotator {
    /// After one step of so many degrees. Sines and cosines have this format; coordinates are words of as
    /// many bits, and what these are worth is the caller's business.
    pub fn new(format: Format, rounding: Rounding, degrees: f64) -> Self {
        let exact = cos_sin(degrees);
        let step = exact.map(|value| format.word(value));
        let [c, s] = [0, 1].map(|k| format.value(step[k]) - exact[k]);
        Self {
            format,
            rounding,
            step,
            turned: step,
            inexact: libm::hypot(c, s),
        }
    }

    /// Words of sine and cosine.
    pub fn format(&self) -> Format {
        self.format
    }

    /// What becomes of what is behind their last place.
    pub fn rounding(&self) -> Rounding {
        self.rounding
    }

    /// Cosine and sine of a step.
    pub fn step(&self) -> [i64; 2] {
        self.step
    }

    /// Cosine and sine of the angle so far.
    pub fn turned(&self) -> [i64; 2] {
        self.turned
    }

    /// Eq. (7).
    pub fn advance(&mut self) {
        self.turned = self.rotate(self.step);
    }

    /// Eq. (4). What is turned may be longer than a coordinate by √2, for which there is a bit more.
    pub fn rotate(&self, [x, y]: [i64; 2]) -> [i64; 2] {
        let [c, s] = self.turned.map(i128::from);
        let (x, y) = (i128::from(x), i128::from(y));
        [x * c - y * s, y * c + x * s].map(|sum| self.rounding.shift(sum, self.format.fraction()))
    }

    /// How far cosine and sine after so many steps can be from the angle's, as the distance of two points of
    /// the plane.
    ///
    /// Let w be what is held, z the exact angle on the unit circle, d the step's words and e the exact step.
    /// Then `w·d − z·e = (w − z)·d + z·(d − e)`, and rounding moves each coordinate by at most its share of
    /// the last place. So `E₁ = |d − e|` and `Eᵢ₊₁ ≤ Eᵢ·(1 + |d − e|) + |d − e| + √2·ρ`: linear in the number
    /// of steps, as figure 7 has it.
    pub fn bound(&self, steps: u32) -> f64 {
        let rounded = self.rounded(self.format.ulp());
        let later = |bound, _| bound * (1.0 + self.inexact) + self.inexact + rounded;
        (1..steps).fold(self.inexact, later)
    }

    /// How far a point at such a distance from the axis can be from where it should be after so many steps:
    /// its coordinates' last place is worth `ulp`, and they may have been rounded to it.
    pub fn point_bound(&self, radius: f64, ulp: f64, steps: u32) -> f64 {
        let angle = self.bound(steps);
        let taken = std::f64::consts::FRAC_1_SQRT_2 * ulp;
        radius * angle + taken * (1.0 + angle) + self.rounded(ulp)
    }

    fn rounded(&self, ulp: f64) -> f64 {
        std::f64::consts::SQRT_2 * self.rounding.error() * ulp
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_recurrence_is_the_angle_sum() {
        let mut turned = Recurrence::new(4.0);
        for _ in 1..60 {
            turned.advance();
        }
        let [x, y] = turned.rotate([3.0, -2.0]);
        let [c, s] = cos_sin(240.0);
        assert!((x - (3.0 * c + 2.0 * s)).abs() < 1.0e-13, "{x}");
        assert!((y - (3.0 * s - 2.0 * c)).abs() < 1.0e-13, "{y}");
    }

    /// The greatest distance from the exact angle, of sine and cosine and of a point, as shares of the bounds.
    fn used(format: Format, rounding: Rounding, degrees: f64, radius: f64) -> [f64; 2] {
        let coordinates = Format::new(format.bits(), format.bits() - 9).expect("valid");
        let mut rotator = MultiRotator::new(format, rounding, degrees);
        let mut used = [0.0_f64; 2];
        for i in 1..=720 {
            let exact = cos_sin(degrees * f64::from(i));
            let [c, s] = rotator.turned().map(|w| format.value(w));
            let off = libm::hypot(c - exact[0], s - exact[1]);
            used[0] = used[0].max(off / rotator.bound(i));
            let point = rotator.rotate([coordinates.word(radius), 0]);
            let [x, y] = point.map(|w| coordinates.value(w));
            let off = libm::hypot(x - radius * exact[0], y - radius * exact[1]);
            used[1] = used[1].max(off / rotator.point_bound(radius, coordinates.ulp(), i));
            rotator.advance();
        }
        used
    }

    #[test]
    fn fixed_point_is_within_its_bound_of_the_exact_angle_and_not_far_within() {
        let mut random = fastrand::Rng::with_seed(6);
        for (bits, fraction) in [(16, 15), (16, 12), (21, 20), (21, 11), (32, 31), (32, 24)] {
            let format = Format::new(bits, fraction).expect("valid");
            for rounding in [Rounding::Truncate, Rounding::Nearest] {
                let mut most = [0.0_f64; 2];
                for _ in 0..50 {
                    let degrees = 0.3 + 20.0 * random.f64();
                    let used = used(format, rounding, degrees, 10.0 + 110.0 * random.f64());
                    assert!(
                        used.iter().all(|&u| u <= 1.0),
                        "{format:?} {rounding:?} {degrees} {used:?}"
                    );
                    most = [most[0].max(used[0]), most[1].max(used[1])];
                }
                assert!(
                    most.iter().all(|&u| u > 0.3),
                    "{format:?} {rounding:?}: {most:?}"
                );
            }
        }
    }
}
