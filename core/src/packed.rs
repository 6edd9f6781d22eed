//! Points in 64 bits: three fixed-point coordinates of 21 bits each, as the coprocessor paper packs them.
//!
//! A third of the bytes of three doubles, for a third of their range: what is beyond is refused, and never cut.

use crate::error::{Result, bounded};
use crate::vector::Point;

/// Bits of a coordinate, the sign included.
const BITS: u32 = 21;

/// Three words of 21 bits side by side, the first in the last bits. Of each only its last 21 bits count.
pub const fn pack_words(words: [i32; 3]) -> u64 {
    const MASK: u64 = (1 << BITS) - 1;
    let [x, y, z] = words;
    (x as u64 & MASK) | (y as u64 & MASK) << BITS | (z as u64 & MASK) << (2 * BITS)
}

/// The three words again. The bit that is left over does not count.
pub const fn unpack_words(packed: u64) -> [i32; 3] {
    const fn word(bits: u64) -> i32 {
        // The sign is where an `i32` has it, and comes down with the rest.
        ((bits << (32 - BITS)) as u32 as i32) >> (32 - BITS)
    }
    [
        word(packed),
        word(packed >> BITS),
        word(packed >> (2 * BITS)),
    ]
}

/// What a word of a coordinate is worth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Packing {
    fraction: u32,
}

impl Packing {
    /// That of points of parts, mm: 11 bits after the point, for half a metre on either side of the origin.
    pub const POINTS: Self = Self { fraction: 11 };

    /// So many bits after the point. With 11, coordinates go to half a metre on either side, and what is packed
    /// is within 2⁻¹² mm.
    ///
    /// # Errors
    /// [`crate::Error::OutOfBounds`] if no bit is left for the sign.
    pub fn new(fraction: u32) -> Result<Self> {
        let ok = fraction < BITS;
        bounded(
            "bits after the point",
            f64::from(fraction),
            ok,
            "at most 20",
        )?;
        Ok(Self { fraction })
    }

    /// The nearest point that there is a word for.
    ///
    /// # Errors
    /// [`crate::Error::OutOfBounds`] for a coordinate that 21 bits do not hold.
    pub fn pack(self, point: Point) -> Result<u64> {
        let words = point.map(|c| libm::rint(libm::ldexp(c, self.fraction as i32)));
        for (word, coordinate) in words.into_iter().zip(point) {
            let end = f64::from(1 << (BITS - 1));
            let ok = (-end..end).contains(&word);
            bounded("a coordinate", coordinate, ok, "within what 21 bits hold")?;
        }
        Ok(pack_words(words.map(|word| word as i32)))
    }

    /// The point of a word; exact.
    pub fn unpack(self, packed: u64) -> Point {
        unpack_words(packed).map(|word| libm::ldexp(f64::from(word), -(self.fraction as i32)))
    }

    /// The nearest point that [`Packing::unpack`] can give, if a word holds it.
    pub fn round(self, point: Point) -> Point {
        let fraction = self.fraction as i32;
        // There is but one zero.
        point.map(|c| libm::ldexp(libm::rint(libm::ldexp(c, fraction)), -fraction) + 0.0)
    }

    /// The word of a point that is one of these to the last bit, and nothing otherwise.
    pub fn pack_exactly(self, point: Point) -> Option<u64> {
        let packed = self.pack(point).ok()?;
        let same = self.unpack(packed).map(f64::to_bits) == point.map(f64::to_bits);
        same.then_some(packed)
    }

    /// The greatest coordinate that there is a word for, mm.
    pub fn limit(self) -> f64 {
        libm::ldexp(f64::from((1 << (BITS - 1)) - 1), -(self.fraction as i32))
    }

    /// How far a coordinate can be from what it was, mm.
    pub fn error(self) -> f64 {
        libm::ldexp(0.5, -(self.fraction as i32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;
    use proptest::prelude::*;

    const LEAST: i32 = -(1 << 20);
    const GREATEST: i32 = (1 << 20) - 1;

    proptest! {
        #[test]
        fn words_come_back(words in proptest::array::uniform3(LEAST..=GREATEST), above in 0..=1_u64) {
            prop_assert_eq!(unpack_words(pack_words(words) | above << 63), words);
        }

        #[test]
        fn a_point_comes_back_within_the_error(point in proptest::array::uniform3(-511.9..511.9), fraction in 0_u32..=11) {
            let packing = Packing::new(fraction).expect("valid");
            let back = packing.unpack(packing.pack(point).expect("in range"));
            prop_assert_eq!(packing.round(point).map(f64::to_bits), back.map(f64::to_bits));
            prop_assert_eq!(packing.pack_exactly(back), packing.pack(point).ok());
            prop_assert_eq!(packing.pack_exactly(point).is_some(), back == point);
            for k in 0..3 {
                prop_assert!((back[k] - point[k]).abs() <= packing.error());
            }
        }
    }

    #[test]
    fn the_ends_are_held_and_nothing_beyond_them() {
        let packing = Packing::new(11).expect("valid");
        let ends = [-512.0, 512.0 - 1.0 / 2048.0, 0.0];
        assert_eq!(packing.unpack(packing.pack(ends).expect("in range")), ends);
        assert_eq!(packing.error(), 1.0 / 4096.0);
        assert_eq!(packing.limit(), ends[1]);
        assert_eq!(packing.pack_exactly([0.0, -0.0, 0.0]), None);
        assert!(
            packing
                .round([-1.0e-9; 3])
                .iter()
                .all(|c| c.is_sign_positive())
        );
        for beyond in [512.0, -512.1, f64::NAN, f64::INFINITY] {
            let packed = packing.pack([0.0, beyond, 0.0]);
            assert!(matches!(packed, Err(Error::OutOfBounds { .. })), "{beyond}");
        }
        assert!(Packing::new(21).is_err());
    }
}
