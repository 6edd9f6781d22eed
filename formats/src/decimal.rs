//! Decimal text of numbers, quicker than by `format!` and the same to the last digit.

use std::io::Write as _;

/// Powers of ten that a double holds exactly, as far as they are needed.
const POWERS: [u64; 13] = {
    let mut powers = [1; 13];
    let mut i = 1;
    while i < powers.len() {
        powers[i] = powers[i - 1] * 10;
        i += 1;
    }
    powers
};

/// Above this a scaled value is left to the standard library.
const LARGE: f64 = 1.0e11;

/// A scaled value nearer to a half than this may round either way once its own error is counted:
/// [`LARGE`] times the relative error of a product is a tenth of it.
const DOUBT: f64 = 1.0e-4;

/// Appends an integer.
pub(crate) fn integer(text: &mut Vec<u8>, mut value: u64) {
    let mut digits = [0; 20];
    let mut start = digits.len();
    loop {
        start -= 1;
        digits[start] = b'0' + (value % 10) as u8;
        value /= 10;
        if value == 0 {
            break;
        }
    }
    text.extend_from_slice(&digits[start..]);
}

/// Appends `value` rounded to so many decimals, without exponent, trailing zeros or a negative zero.
pub(crate) fn fixed(text: &mut Vec<u8>, value: f64, decimals: usize) {
    let scaled = match POWERS.get(decimals) {
        Some(&power) => value.abs() * power as f64,
        None => f64::INFINITY,
    };
    let whole = scaled as u64;
    let rest = scaled - whole as f64;
    // Holds for no NaN either.
    if scaled < LARGE && (rest - 0.5).abs() > DOUBT {
        let rounded = whole + u64::from(rest > 0.5);
        if value < 0.0 && rounded > 0 {
            text.push(b'-');
        }
        scaled_down(text, rounded, decimals);
    } else {
        by_format(text, value, decimals);
    }
}

/// `value` divided by ten to the power of `decimals`.
fn scaled_down(text: &mut Vec<u8>, value: u64, decimals: usize) {
    let power = POWERS[decimals];
    integer(text, value / power);
    let mut rest = value % power;
    if rest == 0 {
        return;
    }
    text.push(b'.');
    let start = text.len();
    text.resize(start + decimals, b'0');
    for digit in text[start..].iter_mut().rev() {
        *digit = b'0' + (rest % 10) as u8;
        rest /= 10;
    }
    trim(text);
}

fn by_format(text: &mut Vec<u8>, value: f64, decimals: usize) {
    let start = text.len();
    // Writing into memory cannot fail.
    let _ = write!(text, "{value:.decimals$}");
    if decimals > 0 {
        trim(text);
        text.pop_if(|last| *last == b'.');
    }
    if &text[start..] == b"-0" {
        text.truncate(start);
        text.push(b'0');
    }
}

fn trim(text: &mut Vec<u8>) {
    while text.pop_if(|last| *last == b'0').is_some() {}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn same(value: f64, decimals: usize) {
        let (mut quick, mut plain) = (Vec::new(), Vec::new());
        fixed(&mut quick, value, decimals);
        by_format(&mut plain, value, decimals);
        let text = |bytes| String::from_utf8(bytes).expect("ASCII");
        assert_eq!(text(quick), text(plain), "{value:e} to {decimals}");
    }

    #[test]
    fn numbers_are_rounded_as_the_standard_library_rounds_them() {
        let mut bits = 1u64;
        for i in 0..20_000 {
            bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let decimals = i % 14;
            same(f64::from_bits(bits), decimals);
            let near = (bits >> 40) as f64;
            same(near * 1e-4, decimals);
            // Halves, and what is next to them.
            let half = (near + 0.5) / 10f64.powi(decimals as i32);
            for near in [half, -half, half.next_up(), half.next_down()] {
                same(near, decimals);
            }
        }
        for value in [0.0, -0.0, -1e-9, 1e-5, 0.5, 1e10, 99999.99995, 1e300] {
            (0..14).for_each(|d| same(value, d));
        }
    }

    #[test]
    fn integers_are_whole() {
        for value in [0, 9, 10, 55_089, u64::MAX] {
            let mut text = Vec::new();
            integer(&mut text, value);
            assert_eq!(text, value.to_string().into_bytes());
        }
    }
}
