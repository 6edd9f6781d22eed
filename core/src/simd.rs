//! Instruction sets: which vectors the searches compute with, and surfaces and hierarchies are made by.
//!
//! Every level computes the same values by the same sequence of + − × ÷ √, lane by lane, so the choice
//! changes the time that a path takes and not one bit of it. The levels come from a crate; this module
//! names them and refuses those that the machine lacks.

use std::fmt;
use std::str::FromStr;

#[cfg(target_arch = "aarch64")]
use fearless_simd::Neon;
#[cfg(target_arch = "x86_64")]
use fearless_simd::{Avx2, Avx512};
use fearless_simd::{Fallback, Level};

use crate::error::{Error, Result};

/// An instruction set to compute with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Simd {
    /// The target's baseline, without vectors of its own.
    Scalar,
    /// x86-64-v3: four doubles at a time.
    Avx2,
    /// x86-64-v4: eight doubles at a time.
    Avx512,
    /// AArch64's two doubles at a time.
    Neon,
}

const NAMES: [(Simd, &str); 4] = [
    (Simd::Scalar, "scalar"),
    (Simd::Avx2, "avx2"),
    (Simd::Avx512, "avx512"),
    (Simd::Neon, "neon"),
];

/// The proof that a level may be used.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Token {
    Scalar(Fallback),
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2),
    #[cfg(target_arch = "x86_64")]
    Avx512(Avx512),
    #[cfg(target_arch = "aarch64")]
    Neon(Neon),
}

/// An instruction set that searches are compiled for.
pub(crate) trait Set: fearless_simd::Simd {
    /// Does a piece of a search: within its caller, so that vectors stay in registers.
    #[inline(always)]
    fn piece<R>(self, run: impl FnOnce() -> R) -> R {
        run()
    }
}

impl Set for Fallback {
    /// Without vectors there are so many instructions to it that it is compiled by itself, or compiling would
    /// take minutes.
    #[inline(never)]
    fn piece<R>(self, run: impl FnOnce() -> R) -> R {
        run()
    }
}

#[cfg(target_arch = "x86_64")]
impl Set for Avx2 {}
#[cfg(target_arch = "x86_64")]
impl Set for Avx512 {}
#[cfg(target_arch = "aarch64")]
impl Set for Neon {}

/// Evaluates `$run`, compiled for each instruction set and run by that of `$token`, with `$simd` as its
/// proof. What `$run` calls has to be `#[inline(always)]`, and closures in it too. So little should be in it:
/// all of it is compiled once for each instruction set and each place where this stands.
macro_rules! with_simd {
    ($token:expr, $simd:ident => $run:expr) => {{
        use fearless_simd::Simd as _;
        match $token {
            $crate::simd::Token::Scalar($simd) => $simd.vectorize(
                #[inline(always)]
                || $run,
            ),
            #[cfg(target_arch = "x86_64")]
            $crate::simd::Token::Avx2($simd) => $simd.vectorize(
                #[inline(always)]
                || $run,
            ),
            #[cfg(target_arch = "x86_64")]
            $crate::simd::Token::Avx512($simd) => $simd.vectorize(
                #[inline(always)]
                || $run,
            ),
            #[cfg(target_arch = "aarch64")]
            $crate::simd::Token::Neon($simd) => $simd.vectorize(
                #[inline(always)]
                || $run,
            ),
        }
    }};
}
pub(crate) use with_simd;

impl Simd {
    /// The best that this machine has.
    pub fn best() -> Self {
        let available = Self::available();
        available.last().copied().unwrap_or(Self::Scalar)
    }

    /// All that this machine has, the slowest first.
    pub fn available() -> Vec<Self> {
        let all = NAMES.iter().map(|&(simd, _)| simd);
        all.filter(|simd| simd.try_token().is_some()).collect()
    }

    /// The token of this level, or of the baseline if this machine lacks it.
    pub(crate) fn token(self) -> Token {
        self.try_token().unwrap_or(Token::Scalar(Fallback::new()))
    }

    fn try_token(self) -> Option<Token> {
        match self {
            Self::Scalar => Some(Token::Scalar(Fallback::new())),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => Level::new().as_avx2().map(Token::Avx2),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => Level::new().as_avx512().map(Token::Avx512),
            #[cfg(target_arch = "aarch64")]
            Self::Neon => Level::new().as_neon().map(Token::Neon),
            _ => None,
        }
    }
}

impl fmt::Display for Simd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = NAMES.iter().find(|(simd, _)| simd == self);
        f.write_str(name.map_or("", |(_, name)| name))
    }
}

impl FromStr for Simd {
    type Err = Error;

    /// # Errors
    /// [`Error::NoSuchSimd`] for a name that is unknown or that this machine lacks.
    fn from_str(name: &str) -> Result<Self> {
        let available = Self::available();
        let found = available.iter().find(|simd| simd.to_string() == name);
        found.copied().ok_or_else(|| Error::NoSuchSimd {
            name: name.to_owned(),
            available: available.iter().map(ToString::to_string).collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_read_back_and_unknown_ones_are_refused() {
        for simd in Simd::available() {
            assert_eq!(simd.to_string().parse(), Ok(simd));
        }
        assert!(Simd::available().contains(&Simd::Scalar));
        let error = "mmx".parse::<Simd>().expect_err("unknown").to_string();
        assert!(error.contains("mmx") && error.contains("scalar"), "{error}");
    }
}
