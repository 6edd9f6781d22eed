//! The check before a measurement: a faster way to search is worth nothing if it finds another path.

use horma_core::Touch;

use crate::error::{Error, Result};

/// Checks that two ways to search found the same positions, to the last bit.
pub(super) fn same(
    found: &[Option<Touch>],
    reference: &[Option<Touch>],
    what: &str,
    than: &'static str,
) -> Result<()> {
    let bits = |touch: &Option<Touch>| {
        touch.map(|t| {
            let [x, y, z] = t.contact;
            [t.height, x, y, z].map(f64::to_bits)
        })
    };
    let pairs = found.iter().zip(reference);
    let differs = |(a, b): (&Option<Touch>, &Option<Touch>)| bits(a) != bits(b);
    match pairs.map(differs).position(|d| d) {
        None => Ok(()),
        Some(position) => Err(Error::Differs {
            what: what.to_owned(),
            than,
            position,
        }),
    }
}
