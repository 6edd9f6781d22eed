//! Fixed-point numbers: two's complement words with so many bits after the point.
//!
//! Words are held in an `i64` and never wider than [`Format::MOST_BITS`], so that no sum of a few of them
//! overflows it; products are exact in an `i128`. How many bits a register has is the datapaths' business:
//! they [`wrap`] what they hold.

use crate::error::{Error, Result};

/// How a real number becomes a word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Format {
    bits: u32,
    fraction: u32,
}

/// What becomes of the bits behind the last one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rounding {
    /// They are dropped: towards minus infinity.
    Truncate,
    /// To the nearest word, halves upwards.
    Nearest,
}

impl Format {
    /// Longest word.
    pub const MOST_BITS: u32 = 48;

    /// Words of `bits`, the sign included, of which `fraction` come after the point.
    ///
    /// # Errors
    /// [`Error::Format`] for words shorter than 4 bits or longer than [`Format::MOST_BITS`], or without
    /// room for a sign.
    pub const fn new(bits: u32, fraction: u32) -> Result<Self> {
        if bits < 4 || bits > Self::MOST_BITS || fraction >= bits {
            return Err(Error::Format { bits, fraction });
        }
        Ok(Self { bits, fraction })
    }

    /// Bits of a word.
    pub const fn bits(self) -> u32 {
        self.bits
    }

    /// Bits after the point.
    pub const fn fraction(self) -> u32 {
        self.fraction
    }

    /// What the last bit is worth.
    pub fn ulp(self) -> f64 {
        libm::ldexp(1.0, -(self.fraction as i32))
    }

    /// The greatest word; the least is one less than its negative.
    pub const fn greatest(self) -> i64 {
        (1 << (self.bits - 1)) - 1
    }

    /// The nearest word; what is beyond the greatest or the least becomes that.
    pub fn word(self, value: f64) -> i64 {
        // A conversion saturates too.
        let word = libm::rint(libm::ldexp(value, self.fraction as i32)) as i64;
        word.clamp(-self.greatest() - 1, self.greatest())
    }

    /// What a word is worth; exact.
    pub fn value(self, word: i64) -> f64 {
        libm::ldexp(word as f64, -(self.fraction as i32))
    }
}

impl Rounding {
    /// `value / 2^by` as a whole number.
    pub const fn shift(self, value: i128, by: u32) -> i64 {
        let half = match self {
            Self::Nearest if by > 0 => 1 << (by - 1),
            _ => 0,
        };
        ((value + half) >> by) as i64
    }

    /// How far that is from the quotient at most, in units of the last place.
    pub const fn error(self) -> f64 {
        match self {
            Self::Truncate => 1.0,
            Self::Nearest => 0.5,
        }
    }

    /// As people say it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Truncate => "truncated",
            Self::Nearest => "rounded",
        }
    }
}

/// What a register of so many bits holds of a number: its last bits, the first of them as the sign.
#[inline(always)]
pub const fn wrap(value: i64, bits: u32) -> i64 {
    let above = 64 - bits;
    (value << above) >> above
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_is_the_nearest_one() {
        let format = Format::new(16, 15).expect("valid");
        assert_eq!(format.word(0.5), 16384);
        assert_eq!(format.word(1.0), 32767);
        assert_eq!(format.word(-1.0), -32768);
        assert_eq!(format.word(-7.0), -32768);
        assert_eq!(format.word(0.6 * format.ulp()), 1);
        assert_eq!(format.value(-32768), -1.0);
        assert!(Format::new(16, 16).is_err() && Format::new(49, 3).is_err());
    }

    #[test]
    fn quotients_are_rounded_as_said() {
        for (value, truncated, nearest) in
            [(7, 1, 2), (5, 1, 1), (6, 1, 2), (-6, -2, -1), (-7, -2, -2)]
        {
            assert_eq!(Rounding::Truncate.shift(value, 2), truncated, "{value}");
            assert_eq!(Rounding::Nearest.shift(value, 2), nearest, "{value}");
        }
        assert_eq!(Rounding::Nearest.shift(5, 0), 5);
    }

    #[test]
    fn a_register_keeps_its_last_bits() {
        assert_eq!(wrap(7, 4), 7);
        assert_eq!(wrap(8, 4), -8);
        assert_eq!(wrap(-9, 4), 7);
    }
}
