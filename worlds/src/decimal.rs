//! Decimal numbers as other programs write them, read exactly: `0.1` seconds are 100,000,000
//! nanoseconds, not what the nearest binary fraction rounds to.

/// Why a text is no number of the kind that was expected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NumberError {
    /// No decimal number at all.
    NotANumber,
    /// Below zero.
    Negative,
    /// It has more decimal places than the base unit can hold.
    TooFine,
    /// It does not fit 64 bits.
    TooLarge,
}

/// The number in `text` times 10^`places`, which must be whole: `digits[.digits][e[+-]digits]`.
pub(super) fn scaled(text: &str, places: u32) -> Result<u64, NumberError> {
    if let Some(rest) = text.strip_prefix('-') {
        // `-0` is zero, and `-x` is no number.
        return match scaled(rest, places) {
            Ok(0) => Ok(0),
            Err(NumberError::NotANumber) => Err(NumberError::NotANumber),
            _ => Err(NumberError::Negative),
        };
    }
    let (mantissa, exponent) = match text.find(['e', 'E']) {
        Some(at) => (&text[..at], exponent(&text[at + 1..])?),
        None => (text, 0),
    };
    let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let digits = || whole.bytes().chain(fraction.bytes());
    if whole.is_empty() || !digits().all(|digit| digit.is_ascii_digit()) {
        return Err(NumberError::NotANumber);
    }
    // The number is its digits, without the zeros at the end, times ten to `shift`.
    let zeros = digits().rev().take_while(|digit| *digit == b'0').count();
    let count = whole.len() + fraction.len();
    let leading = digits().take_while(|digit| *digit == b'0').count();
    if leading == count {
        return Ok(0);
    }
    let shift = i128::from(exponent) + i128::from(places) + zeros as i128 - fraction.len() as i128;
    if shift < 0 {
        return Err(NumberError::TooFine);
    }
    // 2^64 has 20 digits.
    if (count - leading - zeros) as i128 + shift > 20 {
        return Err(NumberError::TooLarge);
    }
    let value = digits()
        .take(count - zeros)
        .fold(0u128, |value, digit| value * 10 + u128::from(digit - b'0'));
    // Both are at most 20, so this fits 128 bits.
    let value = value * 10u128.pow(shift as u32);
    u64::try_from(value).map_err(|_| NumberError::TooLarge)
}

/// The exponent's value. Beyond 18 digits only its sign matters.
fn exponent(text: &str) -> Result<i64, NumberError> {
    let digits = text.strip_prefix(['+', '-']).unwrap_or(text);
    if digits.is_empty() || !digits.bytes().all(|digit| digit.is_ascii_digit()) {
        return Err(NumberError::NotANumber);
    }
    let magnitude = digits.bytes().fold(0i64, |value, digit| {
        value
            .saturating_mul(10)
            .saturating_add(i64::from(digit - b'0'))
    });
    Ok(if text.starts_with('-') {
        -magnitude
    } else {
        magnitude
    })
}

/// `value` / 10^`places` in decimal notation that [`scaled`] reads back to `value`.
pub(super) fn unscaled(value: u64, places: u32) -> String {
    let unit = 10u64.pow(places);
    let (whole, rest) = (value / unit, value % unit);
    if rest == 0 {
        return whole.to_string();
    }
    let digits = places as usize;
    let text = format!("{whole}.{rest:0digits$}");
    text.trim_end_matches('0').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn numbers_are_exact() {
        assert_eq!(scaled("0.1", 9), Ok(100_000_000));
        assert_eq!(scaled("1.282", 9), Ok(1_282_000_000));
        assert_eq!(scaled("0.000000001000", 9), Ok(1));
        assert_eq!(scaled("18446744073.709551615", 9), Ok(u64::MAX));
        assert_eq!(scaled("1e9", 0), Ok(1_000_000_000));
        assert_eq!(scaled("1.5E+3", 0), Ok(1500));
        assert_eq!(scaled("2500e-2", 0), Ok(25));
        assert_eq!(scaled("0e999999999999999999999", 9), Ok(0));
        assert_eq!(scaled(&format!("{}7", "0".repeat(500)), 0), Ok(7));
        assert_eq!(scaled("-0.0", 9), Ok(0));
    }

    #[test]
    fn each_mistake_is_told_apart() {
        use NumberError::{Negative, NotANumber, TooFine, TooLarge};
        for rubbish in [
            "", ".", ".5", "-", "1e", "1e+", "e5", "1.2.3", "0x10", "inf", "NaN", "1 ",
        ] {
            assert_eq!(scaled(rubbish, 9), Err(NotANumber), "{rubbish}");
        }
        assert_eq!(scaled("-1", 0), Err(Negative));
        assert_eq!(scaled("-1e999", 0), Err(Negative));
        assert_eq!(scaled("0.0000000001", 9), Err(TooFine));
        assert_eq!(scaled("1e-99999999999999999999999", 9), Err(TooFine));
        assert_eq!(scaled("18446744073.709551616", 9), Err(TooLarge));
        assert_eq!(scaled("1e99999999999999999999999", 9), Err(TooLarge));
    }

    proptest! {
        #[test]
        fn what_is_written_reads_back(value: u64, places in 0u32..=19) {
            prop_assert_eq!(scaled(&unscaled(value, places), places), Ok(value));
        }

        #[test]
        fn no_text_panics(text in ".*", number in "-?[0-9]{0,40}\\.?[0-9]{0,40}(e[-+]?[0-9]{0,20})?") {
            let _ = scaled(&text, 9);
            let _ = scaled(&number, 9);
        }
    }
}
