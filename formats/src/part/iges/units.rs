//! The unit of length of an IGES file: from flag, name and scale of its global section.

use super::super::{Reading, Unit, Warning};
use super::file::{File, integer, real};
use crate::error::{Error, Result};

/// What the flags from 1 on mean; flag 3 says that the name counts.
const FLAGS: [Option<&str>; 11] = [
    Some("inch"),
    Some("mm"),
    None,
    Some("ft"),
    Some("mile"),
    Some("m"),
    Some("km"),
    Some("mil"),
    Some("um"),
    Some("cm"),
    Some("microinch"),
];

/// Numbers that the standard gives the parameters of the global section.
const SCALE: usize = 13;
const FLAG: usize = 14;
const NAME: usize = 15;

/// What the numbers of a file are.
pub(super) struct Length {
    pub(super) unit: Unit,
    /// Whether the file says so.
    pub(super) stated: bool,
    /// Millimetres in one.
    pub(super) factor: f64,
    pub(super) warnings: Vec<Warning>,
}

/// Reads the unit of length of a file.
pub(super) fn of(name: &str, file: &File, reading: &Reading) -> Result<Length> {
    let refused = |reason: String| {
        Err(Error::Units {
            name: name.to_owned(),
            reason,
        })
    };
    let flag = file.global(FLAG);
    let called = String::from_utf8_lossy(file.global(NAME)).trim().to_owned();
    let named = Unit::named(&called);
    let unit = match integer(flag) {
        None if flag.is_empty() => named,
        Some(3) if named.is_none() => {
            return refused(format!(
                "its unit of length is called '{called}', which is not known"
            ));
        }
        Some(3) => named,
        number => {
            let number = number.and_then(|n| usize::try_from(n).ok()?.checked_sub(1));
            let Some(unit) = number.and_then(|n| Unit::named((*FLAGS.get(n)?)?)) else {
                let flag = String::from_utf8_lossy(flag);
                return refused(format!(
                    "its flag for the unit of length is '{flag}', not 1 to 11"
                ));
            };
            if named.is_some_and(|named| named != unit) {
                let by_flag = &unit.name;
                return refused(format!(
                    "its flag says that its unit of length is the {by_flag}, but its name {called}"
                ));
            }
            Some(unit)
        }
    };
    let scale = real(file.global(SCALE)).filter(|&s| s > 0.0);
    let scale = match scale {
        Some(scale) => scale,
        None if real(file.global(SCALE)) == Some(0.0) => 1.0,
        None => return refused("its scale is not a positive number".to_owned()),
    };
    let mut warnings = Vec::new();
    let stated = unit.is_some();
    // What the standard says of files that say nothing.
    let inch = || Unit::named("inch").unwrap_or_default();
    let taken = unit.or_else(|| reading.unit.clone()).unwrap_or_else(inch);
    if !stated && reading.unit.is_none() {
        warnings.push(Warning::NoUnit {
            name: name.to_owned(),
            unit: taken.name.clone(),
        });
    }
    let factor = taken.millimetres / scale;
    if factor != 1.0 {
        let unit = match scale {
            1.0 => taken.name.clone(),
            scale => format!("{} at a scale of {scale}", taken.name),
        };
        warnings.push(Warning::Converted {
            name: name.to_owned(),
            unit,
            factor,
        });
    }
    Ok(Length {
        unit: taken,
        stated,
        factor,
        warnings,
    })
}
