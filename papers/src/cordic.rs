//! CORDIC in rotation mode, circular: a point turned by shifts and additions alone (FPGA paper, after Valls,
//! Kuhlmann and Parhi, and Andraka).
//!
//! For coordinates of M bits there are M + 1 iterations over words of M + 2 + ⌈log₂ M⌉ bits, and angles of
//! M + 1. Quarter turns come first, and are exact; the gain is taken back at the end. Here is the arithmetic;
//! [`Serial`] and [`Parallel`] are circuits that do the same, bit for bit.

mod chapter;
mod circuits;

pub use chapter::chapter;
pub use circuits::{Parallel, Serial, resources};

use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_4, SQRT_2};

use crate::error::Result;
use crate::fixed::{Format, Rounding};

/// CORDIC for coordinates of so many bits.
#[derive(Debug, Clone, PartialEq)]
pub struct Cordic {
    bits: u32,
    /// atan 2⁻ⁱ for each iteration.
    angles: Vec<i64>,
    /// Angles: radians from −2 to 2.
    angle_format: Format,
    /// What the gain is multiplied with to make 1.
    inverse_gain: i64,
}

/// An angle as quarter turns, and what is left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Angle {
    /// Quarter turns.
    pub quarters: u8,
    /// The rest, radians as a word.
    pub rest: i64,
}

impl Cordic {
    /// For coordinates of so many bits.
    ///
    /// # Errors
    /// [`crate::Error::Format`] for fewer than 4 bits or more than there is room for.
    pub fn new(bits: u32) -> Result<Self> {
        let angle_format = Format::new(bits + 1, bits.saturating_sub(1))?;
        for width in [bits, bits + 2 + guard(bits)] {
            Format::new(width, 0)?;
        }
        let angle = |i: u32| angle_format.word(libm::atan(libm::ldexp(1.0, -(i as i32))));
        let mut cordic = Self {
            bits,
            angles: (0..=bits).map(angle).collect(),
            angle_format,
            inverse_gain: 0,
        };
        let inverse = libm::ldexp(1.0 / cordic.gain_after(0), cordic.width() as i32);
        cordic.inverse_gain = libm::rint(inverse) as i64;
        Ok(cordic)
    }

    /// M, bits of a coordinate.
    pub fn bits(&self) -> u32 {
        self.bits
    }

    /// Bits of the words that are shifted and added.
    pub fn width(&self) -> u32 {
        self.bits + 2 + guard(self.bits)
    }

    /// M + 1.
    pub fn iterations(&self) -> u32 {
        self.bits + 1
    }

    /// The angle of so many degrees.
    pub fn angle(&self, degrees: f64) -> Angle {
        let quarters = libm::rint(degrees / 90.0);
        let rest = degrees - 90.0 * quarters;
        Angle {
            quarters: quarters.rem_euclid(4.0) as u8,
            rest: self.angle_format.word(rest.to_radians()),
        }
    }

    /// A point turned by an angle.
    pub fn rotate(&self, point: [i64; 2], angle: Angle) -> [i64; 2] {
        let [mut x, mut y] = self.enter(point, angle.quarters);
        let mut left = angle.rest;
        for (i, step) in self.angles.iter().enumerate() {
            let (dx, dy) = (y >> i, x >> i);
            if left >= 0 {
                (x, y, left) = (x - dx, y + dy, left - step);
            } else {
                (x, y, left) = (x + dx, y - dy, left + step);
            }
        }
        [x, y].map(|word| self.leave(word))
    }

    /// Quarter turns, and the guard bits behind the last place.
    fn enter(&self, [x, y]: [i64; 2], quarters: u8) -> [i64; 2] {
        let turned = match quarters & 3 {
            0 => [x, y],
            1 => [-y, x],
            2 => [-x, -y],
            _ => [y, -x],
        };
        turned.map(|word| word << guard(self.bits))
    }

    /// The gain taken back, and the guard bits.
    fn leave(&self, word: i64) -> i64 {
        let product = i128::from(word) * i128::from(self.inverse_gain);
        Rounding::Nearest.shift(product, self.width() + guard(self.bits))
    }

    /// How much longer a point becomes in all iterations from `first` on.
    fn gain_after(&self, first: u32) -> f64 {
        let factor = |i: u32| libm::sqrt(1.0 + libm::ldexp(1.0, -2 * i as i32));
        (first..=self.bits).map(factor).product()
    }

    /// How far the angle by which a point is turned can be from the one asked for, radians.
    ///
    /// What is left of the angle is at most the greater of the iteration's step and what was left beyond it
    /// before. To what is left at the end comes what rounding the angle took, and each step.
    pub fn angle_bound(&self) -> f64 {
        let ulp = self.angle_format.ulp();
        let widest = self.angle_format.word(FRAC_PI_4) + 1;
        let left = self
            .angles
            .iter()
            .fold(widest, |left, &step| step.max(left - step));
        let rounded = (0..).zip(&self.angles).map(|(i, &step)| {
            let exact = libm::atan(libm::ldexp(1.0, -i));
            (self.angle_format.value(step) - exact).abs()
        });
        self.angle_format.value(left) + ulp / 2.0 + rounded.sum::<f64>()
    }

    /// How far a point at such a distance from the axis can be from where it should be; its coordinates' last
    /// place is worth `ulp`, and they may have been rounded to it.
    ///
    /// Each shift drops less than the last guard bit of both coordinates, which later iterations lengthen and
    /// the inverse gain shortens. Then comes what rounding took from the inverse gain, and from the result.
    pub fn point_bound(&self, radius: f64, ulp: f64) -> f64 {
        let guarded = libm::ldexp(ulp, -(guard(self.bits) as i32));
        let gain = self.gain_after(0);
        let inverse = libm::ldexp(self.inverse_gain as f64, -(self.width() as i32));
        // The first iteration shifts by nothing and drops nothing.
        let dropped: f64 = (1..=self.bits).map(|i| self.gain_after(i + 1)).sum();
        let taken = FRAC_1_SQRT_2 * ulp;
        let longest = radius + taken;
        taken
            + longest * self.angle_bound()
            + dropped * SQRT_2 * guarded * inverse
            + longest * (gain * inverse - 1.0).abs()
            + FRAC_1_SQRT_2 * ulp
    }
}

/// ⌈log₂ M⌉ bits behind the last place, for what shifts drop.
const fn guard(bits: u32) -> u32 {
    bits.next_power_of_two().trailing_zeros()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::multirotator::cos_sin;

    #[test]
    fn words_and_iterations_are_the_papers() {
        for (bits, width) in [(16, 22), (21, 28), (32, 39)] {
            let cordic = Cordic::new(bits).expect("valid");
            assert_eq!((cordic.width(), cordic.iterations()), (width, bits + 1));
        }
        assert!(Cordic::new(3).is_err() && Cordic::new(44).is_err());
    }

    #[test]
    fn every_point_is_within_the_bound_of_where_it_should_be_and_some_not_far_within() {
        let mut random = fastrand::Rng::with_seed(7);
        for bits in [16, 21, 32] {
            let cordic = Cordic::new(bits).expect("valid");
            let format = Format::new(bits, bits - 9).expect("valid");
            let mut most = 0.0_f64;
            for _ in 0..200_000 {
                let degrees = 1440.0 * (random.f64() - 0.5);
                let (radius, place) = (120.0 * random.f64(), 360.0 * random.f64());
                let [px, py] = cos_sin(place).map(|k| radius * k);
                let [c, s] = cos_sin(degrees);
                let words = [format.word(px), format.word(py)];
                let [x, y] = cordic
                    .rotate(words, cordic.angle(degrees))
                    .map(|w| format.value(w));
                let off = libm::hypot(x - (px * c - py * s), y - (py * c + px * s));
                let bound = cordic.point_bound(radius, format.ulp());
                assert!(
                    off <= bound,
                    "{bits} {degrees} {radius} {place}: {off} {bound}"
                );
                most = most.max(off / bound);
            }
            assert!(most > 0.3, "{bits}: {most}");
        }
    }
}
