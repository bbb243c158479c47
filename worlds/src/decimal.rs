//! Decimal numbers as people and other programs write them, read exactly: `0.1` seconds are
//! 100,000,000 nanoseconds, not what the nearest binary fraction rounds to.
//!
//! Contact plans, link traces and the quantities of scenarios are all read by this one reader.

use std::str::FromStr;

use thiserror::Error;

/// Why a text is no number of the kind that was expected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum NumberError {
    /// No decimal number at all.
    #[error("no decimal number")]
    NotANumber,
    /// Below zero.
    #[error("below zero")]
    Negative,
    /// It has more decimal places than the base unit can hold.
    #[error("more decimal places than there can be")]
    TooFine,
    /// It does not fit 64 bits.
    #[error("too large")]
    TooLarge,
}

/// The most significant digits that are read: their product with a factor of 64 bits is checked,
/// but they alone have to fit 128 bits.
const MAX_DIGITS: usize = 38;

/// A decimal number: `digits` * 10^`exponent`, without zeros at the end of the digits.
///
/// ```
/// use farside_worlds::decimal::Decimal;
/// let hours: Decimal = "1.5".parse()?;
/// assert_eq!(hours.whole(3_600, 9), Ok(5_400_000_000_000));
/// assert_eq!(hours.nearest(3_600, 0), Some(5400.0));
/// assert!("1.5.0".parse::<Decimal>().is_err());
/// # Ok::<(), farside_worlds::decimal::NumberError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Decimal {
    is_negative: bool,
    digits: u128,
    /// In [-2^62, 2^62]; 0 where there are no digits.
    exponent: i64,
}

impl FromStr for Decimal {
    type Err = NumberError;

    /// Reads `[-]digits[.digits][e[+-]digits]`; one side of the point may be empty.
    ///
    /// # Errors
    /// [`NumberError::NotANumber`]; or when the number has more than 38 digits that count,
    /// [`NumberError::TooFine`] if some stand behind the point, else [`NumberError::TooLarge`].
    fn from_str(text: &str) -> Result<Self, NumberError> {
        let (is_negative, text) = match text.strip_prefix('-') {
            Some(rest) => (true, rest),
            None => (false, text),
        };
        let (mantissa, exponent) = match text.find(['e', 'E']) {
            Some(at) => (&text[..at], exponent(&text[at + 1..])?),
            None => (text, 0),
        };
        let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
        let count = whole.len() + fraction.len();
        let digits = || whole.bytes().chain(fraction.bytes());
        if count == 0 || !digits().all(|digit| digit.is_ascii_digit()) {
            return Err(NumberError::NotANumber);
        }
        let is_zero = |digit: &u8| *digit == b'0';
        let leading = digits().take_while(is_zero).count();
        if leading == count {
            return Ok(Decimal {
                is_negative,
                digits: 0,
                exponent: 0,
            });
        }
        let trailing = digits().rev().take_while(is_zero).count();
        // Texts are shorter than 2^61 bytes, and the exponent is clamped to as much.
        let exponent = exponent + trailing as i64 - fraction.len() as i64;
        if count - leading - trailing > MAX_DIGITS {
            return Err(match exponent < 0 {
                true => NumberError::TooFine,
                false => NumberError::TooLarge,
            });
        }
        let digits = digits()
            .take(count - trailing)
            .fold(0, |value, digit| value * 10 + u128::from(digit - b'0'));
        Ok(Decimal {
            is_negative,
            digits,
            exponent,
        })
    }
}

/// The exponent's value, clamped: beyond 18 digits only its sign matters.
fn exponent(text: &str) -> Result<i64, NumberError> {
    const MOST: i64 = 1 << 61;
    let digits = text.strip_prefix(['+', '-']).unwrap_or(text);
    if digits.is_empty() || !digits.bytes().all(|digit| digit.is_ascii_digit()) {
        return Err(NumberError::NotANumber);
    }
    let magnitude = digits.bytes().fold(0i64, |value, digit| {
        let digit = i64::from(digit - b'0');
        value.saturating_mul(10).saturating_add(digit).min(MOST)
    });
    Ok(if text.starts_with('-') {
        -magnitude
    } else {
        magnitude
    })
}

impl Decimal {
    /// The number times `factor` times 10^`places`, which must be whole.
    ///
    /// ```
    /// use farside_worlds::decimal::{Decimal, NumberError};
    /// let number: Decimal = "0.05".parse()?;
    /// assert_eq!(number.whole(60, 0), Ok(3));
    /// assert_eq!(number.whole(1, 1), Err(NumberError::TooFine));
    /// # Ok::<(), NumberError>(())
    /// ```
    ///
    /// # Errors
    /// All but [`NumberError::NotANumber`]. `-0` is zero.
    pub fn whole(self, factor: u64, places: i32) -> Result<u64, NumberError> {
        if self.digits == 0 {
            return Ok(0);
        }
        if self.is_negative {
            return Err(NumberError::Negative);
        }
        let shift = self.exponent + i64::from(places);
        let power = u32::try_from(shift.unsigned_abs()).ok();
        let power = power.and_then(|power| 10u128.checked_pow(power));
        let (mut digits, mut factor) = (self.digits, u128::from(factor));
        match power {
            Some(power) if shift >= 0 => factor = checked_product(factor, power)?,
            Some(power) => {
                // Divides first by what the digits have in common with the power, then the rest by
                // the factor: their product need not fit.
                let common = greatest_common_divisor(digits, power);
                digits /= common;
                let rest = power / common;
                if !factor.is_multiple_of(rest) {
                    return Err(NumberError::TooFine);
                }
                factor /= rest;
            }
            None if shift >= 0 => return Err(NumberError::TooLarge),
            None => return Err(NumberError::TooFine),
        }
        let value = checked_product(digits, factor)?;
        u64::try_from(value).map_err(|_| NumberError::TooLarge)
    }

    /// The `f64` nearest to the number times `factor` times 10^`places`; `None` if it has too many
    /// digits for an exact product, or lies beyond the largest `f64`.
    pub fn nearest(self, factor: u64, places: i32) -> Option<f64> {
        let product = self.digits.checked_mul(u128::from(factor))?;
        self.in_text(product, self.exponent + i64::from(places))
    }

    /// The `f64` nearest to the number plus `offset` / 10^`places`; `None` if the two lie too far
    /// apart for an exact sum in 128 bits.
    ///
    /// ```
    /// use farside_worlds::decimal::Decimal;
    /// let celsius: Decimal = "-40".parse()?;
    /// assert_eq!(celsius.nearest_sum(27_315, 2), Some(233.15));
    /// assert_ne!(-40.0 + 273.15, 233.15); // Two roundings.
    /// # Ok::<(), farside_worlds::decimal::NumberError>(())
    /// ```
    pub fn nearest_sum(self, offset: u32, places: u32) -> Option<f64> {
        let finest = self.exponent.min(-i64::from(places));
        let raised = |value: u128, from: i64| {
            let power = 10u128.checked_pow(u32::try_from(from - finest).ok()?)?;
            i128::try_from(value.checked_mul(power)?).ok()
        };
        let own = raised(self.digits, self.exponent)?;
        let offset = raised(u128::from(offset), -i64::from(places))?;
        let sum = offset.checked_add(if self.is_negative { -own } else { own })?;
        let positive = Decimal {
            is_negative: sum < 0,
            ..self
        };
        positive.in_text(sum.unsigned_abs(), finest)
    }

    /// Lets the standard library round `digits` * 10^`exponent`, with this number's sign.
    fn in_text(self, digits: u128, exponent: i64) -> Option<f64> {
        let sign = if self.is_negative { "-" } else { "" };
        let value: f64 = format!("{sign}{digits}e{exponent}").parse().ok()?;
        value.is_finite().then_some(value)
    }
}

fn checked_product(a: u128, b: u128) -> Result<u128, NumberError> {
    a.checked_mul(b).ok_or(NumberError::TooLarge)
}

fn greatest_common_divisor(mut a: u128, mut b: u128) -> u128 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}

/// The number in `text` times 10^`places`, which must be whole.
///
/// ```
/// use farside_worlds::decimal::scaled;
/// assert_eq!(scaled("1.28", 9), Ok(1_280_000_000));
/// ```
///
/// # Errors
/// Those of [`NumberError`].
pub fn scaled(text: &str, places: i32) -> Result<u64, NumberError> {
    text.parse::<Decimal>()?.whole(1, places)
}

/// `value` / 10^`places` in decimal notation that [`scaled`] reads back to `value`; at most 19
/// places.
///
/// ```
/// use farside_worlds::decimal::unscaled;
/// assert_eq!(unscaled(1_280_000_000, 9), "1.28");
/// ```
pub fn unscaled(value: u64, places: u32) -> String {
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
        assert_eq!(scaled(".5", 1), Ok(5));
        assert_eq!(scaled("5.", 1), Ok(50));
    }

    #[test]
    fn each_mistake_is_told_apart() {
        use NumberError::{Negative, NotANumber, TooFine, TooLarge};
        for rubbish in [
            "", ".", "-", "--1", "+1", "1e", "1e+", "e5", "1.2.3", "0x10", "inf", "NaN", "1 ",
        ] {
            assert_eq!(scaled(rubbish, 9), Err(NotANumber), "{rubbish}");
        }
        assert_eq!(scaled("-1", 0), Err(Negative));
        assert_eq!(scaled("-1e999", 0), Err(Negative));
        assert_eq!(scaled("0.0000000001", 9), Err(TooFine));
        assert_eq!(scaled("1e-99999999999999999999999", 9), Err(TooFine));
        assert_eq!(scaled("18446744073.709551616", 9), Err(TooLarge));
        assert_eq!(scaled("1e99999999999999999999999", 9), Err(TooLarge));
        assert_eq!(scaled(&"7".repeat(50), 0), Err(TooLarge));
        assert_eq!(scaled(&format!("0.{}", "7".repeat(50)), 0), Err(TooFine));
    }

    /// A product that would not fit 128 bits, of which the quotient does.
    #[test]
    fn factors_are_exact() {
        let a_byte_in_gibibytes: Decimal = "0.000000000931322574615478515625".parse().unwrap();
        assert_eq!(a_byte_in_gibibytes.whole(1 << 30, 0), Ok(1));
        let digits = "0.00000000000000000000000000000000000001".parse::<Decimal>();
        assert_eq!(digits.unwrap().whole(10_u64.pow(19), 19), Ok(1));
    }

    #[test]
    fn floats_are_rounded_once() {
        let nearest = |text: &str, factor, places| {
            let number: Decimal = text.parse().unwrap();
            number.nearest(factor, places)
        };
        assert_eq!(nearest("0.3", 3_600, 0), Some(1080.0));
        assert_ne!(0.07 * 3_600.0, 252.0); // Two roundings.
        assert_eq!(nearest("0.07", 3_600, 0), Some(252.0));
        assert_eq!(nearest("-1", 1, 400), None);
        assert_eq!(nearest("-2.5", 1, -1), Some(-0.25));
        let sum = |text: &str| text.parse::<Decimal>().unwrap().nearest_sum(27_315, 2);
        assert_eq!(sum("-273.15"), Some(0.0));
        assert_eq!(sum("-300"), Some(-26.85));
        assert_eq!(sum("1e-30"), Some(273.15));
        assert_eq!(sum("1e-60"), None);
    }

    proptest! {
        #[test]
        fn what_is_written_reads_back(value: u64, places in 0u32..=19) {
            prop_assert_eq!(scaled(&unscaled(value, places), places as i32), Ok(value));
        }

        /// Whole numbers alone: the oracle divides where the reader shifts a point.
        #[test]
        fn products_are_those_of_whole_numbers(
            number in 0u64..1 << 40,
            point in 0u32..12,
            factor in 0u64..1 << 40,
        ) {
            let text = unscaled(number, point);
            let product = u128::from(number) * u128::from(factor);
            let expected = match product % 10u128.pow(point) {
                0 => u64::try_from(product / 10u128.pow(point)).map_err(|_| NumberError::TooLarge),
                _ => Err(NumberError::TooFine),
            };
            prop_assert_eq!(text.parse::<Decimal>().unwrap().whole(factor, 0), expected);
        }

        #[test]
        fn a_float_is_read_as_the_standard_library_does(value: f64) {
            let decimal = format!("{value:e}").parse::<Decimal>();
            let nearest = decimal.ok().and_then(|decimal| decimal.nearest(1, 0));
            prop_assert_eq!(nearest, value.is_finite().then_some(value));
        }

        #[test]
        fn no_text_panics(
            text in ".*",
            number in "-?[0-9]{0,40}\\.?[0-9]{0,40}(e[-+]?[0-9]{0,20})?",
            factor: u64,
            places in -40..40i32,
        ) {
            for text in [text, number] {
                if let Ok(decimal) = text.parse::<Decimal>() {
                    let _ = decimal.whole(factor, places);
                    let _ = decimal.nearest(factor, places);
                    let _ = decimal.nearest_sum(27_315, 2);
                }
            }
        }
    }
}
