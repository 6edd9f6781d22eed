//! Bisection of whole numbers.

use std::ops::Range;

/// The first of a range for which `holds` no longer does, or its end; once it does not, it never does again.
pub(crate) fn first_without(range: Range<u64>, mut holds: impl FnMut(u64) -> bool) -> u64 {
    let Range {
        start: mut low,
        end: mut high,
    } = range;
    while low < high {
        let middle = low + (high - low) / 2;
        if holds(middle) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_border_is_found_wherever_it_is() {
        for border in 3..=9 {
            assert_eq!(first_without(3..9, |i| i < border), border);
        }
        assert_eq!(first_without(5..5, |_| true), 5);
    }
}
