//! Decimal text of numbers, quicker than by `format!`.

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

/// Appends `value` divided by ten to the power of `decimals`, 18 at most: without trailing zeros, and with
/// a point after a whole number only if that is asked for.
pub(crate) fn scaled(text: &mut Vec<u8>, value: i64, decimals: usize, point: bool) {
    if value < 0 {
        text.push(b'-');
    }
    let power = 10_u64.pow(decimals as u32);
    let (whole, mut rest) = (value.unsigned_abs() / power, value.unsigned_abs() % power);
    integer(text, whole);
    if rest > 0 || point {
        text.push(b'.');
    }
    if rest > 0 {
        let start = text.len();
        text.resize(start + decimals, b'0');
        for digit in text[start..].iter_mut().rev() {
            *digit = b'0' + (rest % 10) as u8;
            rest /= 10;
        }
        while text.pop_if(|last| *last == b'0').is_some() {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(write: impl FnOnce(&mut Vec<u8>)) -> String {
        let mut text = Vec::new();
        write(&mut text);
        String::from_utf8(text).expect("ASCII")
    }

    #[test]
    fn integers_are_whole() {
        for value in [0, 9, 10, 55_089, u64::MAX] {
            assert_eq!(text(|t| integer(t, value)), value.to_string());
        }
    }

    #[test]
    fn scaled_numbers_have_no_more_than_they_need() {
        for (value, decimals, expected) in [
            (0, 4, "0"),
            (5, 0, "5"),
            (-5, 4, "-0.0005"),
            (501_200, 4, "50.12"),
            (-1_230_000, 4, "-123"),
            (i64::MIN, 18, "-9.223372036854775808"),
        ] {
            assert_eq!(text(|t| scaled(t, value, decimals, false)), expected);
        }
        assert_eq!(text(|t| scaled(t, -1000, 3, true)), "-1.");
        assert_eq!(text(|t| scaled(t, 1500, 3, true)), "1.5");
    }

    #[test]
    fn scaled_numbers_read_back() {
        let mut bits = 1_u64;
        for i in 0..20_000_u32 {
            bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let (value, decimals) = ((bits >> 14) as i64 - (1 << 49), i % 14);
            let read: f64 = text(|t| scaled(t, value, decimals as usize, i % 2 == 0))
                .parse()
                .expect("a number");
            assert_eq!(read, value as f64 / 10_f64.powi(decimals as i32));
        }
    }
}
