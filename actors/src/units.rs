//! Quantities as people write them in scenarios: `"250ms"`, `"1.5km"`, `"30%"`, `"128kbit/s"`.
//!
//! Each quantity has a `parse_…` and a `print_…` function and a module for serde's `with`, with
//! `option` inside. What is printed parses back to the same value. Numbers are read exactly: a
//! duration that is no whole number of nanoseconds is refused, not rounded.
//!
//! ```
//! use farside::SimDuration;
//! use farside_actors::units;
//! use serde::{Deserialize, Serialize};
//!
//! #[derive(Serialize, Deserialize)]
//! struct Radio {
//!     #[serde(with = "units::duration")]
//!     latency: SimDuration,
//!     #[serde(with = "units::length_m")]
//!     range: f64,
//! }
//!
//! assert_eq!(units::parse_duration("2.6s")?, SimDuration::from_millis(2600));
//! assert_eq!(units::parse_length_m("1.5km")?, 1500.0);
//! let error = units::parse_duration("250 parsecs").unwrap_err();
//! assert!(error.to_string().starts_with("\"250 parsecs\": expected a duration such as \"250ms\""));
//! # Ok::<(), farside_actors::units::UnitError>(())
//! ```

mod with;

use farside::SimDuration;
use thiserror::Error;

pub use with::{data_rate_bit_per_s, data_size_bytes, duration, fraction, length_m, power_w};

/// A text is not the quantity that was expected.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum UnitError {
    /// It is no number followed by a unit at all.
    #[error("{found:?}: expected {expected}")]
    NotAQuantity {
        /// The text.
        found: String,
        /// What was expected, with an example.
        expected: &'static str,
    },
    /// A number without a unit.
    #[error("{found}: expected {expected}; a bare number has no unit")]
    NoUnit {
        /// The number.
        found: String,
        /// What was expected, with an example.
        expected: &'static str,
    },
    /// A number with a unit of something else.
    #[error("{found:?}: expected {expected}; {unit:?} is none of its units {units}")]
    WrongUnit {
        /// The text.
        found: String,
        /// Its unit.
        unit: String,
        /// What was expected, with an example.
        expected: &'static str,
        /// The units there are.
        units: String,
    },
    /// The quantity, in a range that cannot be.
    #[error("{found}: expected {expected}; it must be {bounds}")]
    OutOfRange {
        /// The text.
        found: String,
        /// What was expected, with an example.
        expected: &'static str,
        /// What would be allowed.
        bounds: &'static str,
    },
}

/// A unit: its symbol, and its size in base units as `factor * 10^exponent`.
struct Unit {
    symbol: &'static str,
    factor: u64,
    exponent: i32,
}

const fn unit(symbol: &'static str, factor: u64, exponent: i32) -> Unit {
    Unit {
        symbol,
        factor,
        exponent,
    }
}

/// A quantity: how to ask for it, and its units.
struct Quantity {
    expected: &'static str,
    units: &'static [Unit],
}

const DURATION: Quantity = Quantity {
    expected: "a duration such as \"250ms\" or \"2.6s\"",
    units: &[
        unit("ns", 1, 0),
        unit("us", 1, 3),
        unit("µs", 1, 3),
        unit("ms", 1, 6),
        unit("s", 1, 9),
        unit("min", 60, 9),
        unit("h", 3_600, 9),
        unit("d", 86_400, 9),
    ],
};

const LENGTH: Quantity = Quantity {
    expected: "a length such as \"40m\" or \"1.5km\"",
    units: &[
        unit("mm", 1, -3),
        unit("cm", 1, -2),
        unit("m", 1, 0),
        unit("km", 1, 3),
    ],
};

const FRACTION: Quantity = Quantity {
    expected: "a fraction such as 0.3 or \"30%\"",
    units: &[unit("", 1, 0), unit("%", 1, -2)],
};

const DATA_RATE: Quantity = Quantity {
    expected: "a data rate such as \"128kbit/s\" or \"2Mbit/s\"",
    units: &[
        unit("bit/s", 1, 0),
        unit("kbit/s", 1, 3),
        unit("Mbit/s", 1, 6),
        unit("Gbit/s", 1, 9),
        unit("B/s", 8, 0),
        unit("kB/s", 8, 3),
        unit("MB/s", 8, 6),
    ],
};

const DATA_SIZE: Quantity = Quantity {
    expected: "a data size such as \"1500B\" or \"64kB\"",
    units: &[
        unit("B", 1, 0),
        unit("kB", 1, 3),
        unit("MB", 1, 6),
        unit("GB", 1, 9),
        unit("KiB", 1 << 10, 0),
        unit("MiB", 1 << 20, 0),
        unit("GiB", 1 << 30, 0),
    ],
};

const POWER: Quantity = Quantity {
    expected: "a power such as \"100mW\" or \"12W\"",
    units: &[
        unit("uW", 1, -6),
        unit("mW", 1, -3),
        unit("W", 1, 0),
        unit("kW", 1, 3),
    ],
};

const RATE: Quantity = Quantity {
    expected: "a rate such as \"500k/s\" or \"2M/s\"",
    units: &[
        unit("/s", 1, 0),
        unit("k/s", 1, 3),
        unit("M/s", 1, 6),
        unit("G/s", 1, 9),
    ],
};

impl Quantity {
    /// The number's text and the unit. Whitespace between them is fine.
    fn split<'a>(&self, text: &'a str) -> Result<(&'a str, &'static Unit), UnitError> {
        let trimmed = text.trim();
        let end = trimmed.find(|c: char| !c.is_ascii_digit() && c != '.');
        let (number, symbol) = trimmed.split_at(end.unwrap_or(trimmed.len()));
        let symbol = symbol.trim_start();
        let digits = number.bytes().filter(u8::is_ascii_digit).count();
        let points = number.len() - digits;
        if digits == 0 || points > 1 {
            return Err(UnitError::NotAQuantity {
                found: text.to_owned(),
                expected: self.expected,
            });
        }
        if let Some(unit) = self.units.iter().find(|unit| unit.symbol == symbol) {
            return Ok((number, unit));
        }
        if symbol.is_empty() {
            return Err(self.no_unit(trimmed));
        }
        let symbols: Vec<&str> = self.units.iter().map(|unit| unit.symbol).collect();
        Err(UnitError::WrongUnit {
            found: text.to_owned(),
            unit: symbol.to_owned(),
            expected: self.expected,
            units: symbols.join(", "),
        })
    }

    fn no_unit(&self, number: impl ToString) -> UnitError {
        UnitError::NoUnit {
            found: number.to_string(),
            expected: self.expected,
        }
    }

    fn out_of_range(&self, found: impl ToString, bounds: &'static str) -> UnitError {
        UnitError::OutOfRange {
            found: found.to_string(),
            expected: self.expected,
            bounds,
        }
    }

    /// The quantity as an exact whole number of base units; `finest` says what such a number is.
    fn whole(&self, text: &str, finest: &'static str) -> Result<u64, UnitError> {
        let (number, unit) = self.split(text)?;
        let (whole, fraction) = number.split_once('.').unwrap_or((number, ""));
        let fraction = fraction.trim_end_matches('0');
        let too_big = || self.out_of_range(text, "smaller");
        // The number is `digits * 10^shift`; every whole-number quantity has exponents >= 0.
        let mut value: u128 = 0;
        for digit in whole.bytes().chain(fraction.bytes()) {
            value = value
                .checked_mul(10)
                .and_then(|v| v.checked_add(u128::from(digit - b'0')))
                .ok_or_else(too_big)?;
        }
        value = value
            .checked_mul(u128::from(unit.factor))
            .ok_or_else(too_big)?;
        let shift = unit.exponent - i32::try_from(fraction.len()).unwrap_or(i32::MAX);
        let power = 10u128.checked_pow(shift.unsigned_abs());
        let value = match power {
            Some(power) if shift >= 0 => value.checked_mul(power).ok_or_else(too_big)?,
            Some(power) if value.is_multiple_of(power) => value / power,
            Some(_) => return Err(self.out_of_range(text, finest)),
            None if value == 0 => 0,
            None => return Err(self.out_of_range(text, finest)),
        };
        u64::try_from(value).map_err(|_| too_big())
    }

    /// The quantity as the `f64` nearest to what was written, in base units.
    fn nearest(&self, text: &str) -> Result<f64, UnitError> {
        let (number, unit) = self.split(text)?;
        // Shifting the decimal point in the text rounds once; multiplying would round twice.
        let value = format!("{number}e{}", unit.exponent).parse::<f64>();
        match value {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(self.out_of_range(text, "smaller")),
        }
    }
}

/// Reads a duration: `"250ms"`, `"2.6s"`, `"5us"`, `"3min"`, `"1h"`.
///
/// ```
/// use farside::SimDuration;
/// use farside_actors::units::parse_duration;
/// assert_eq!(parse_duration("0.5ms"), Ok(SimDuration::from_micros(500)));
/// assert!(parse_duration("5").unwrap_err().to_string().contains("no unit"));
/// ```
///
/// # Errors
/// When it is none, has no unit or another quantity's, or is no whole number of nanoseconds.
pub fn parse_duration(text: &str) -> Result<SimDuration, UnitError> {
    let nanos = DURATION.whole(text, "a whole number of nanoseconds")?;
    Ok(SimDuration::from_nanos(nanos))
}

/// Writes a duration so that it parses back to the same one.
///
/// ```
/// use farside_actors::units::{parse_duration, print_duration};
/// assert_eq!(print_duration(parse_duration("0.25s")?), "250ms");
/// # Ok::<(), farside_actors::units::UnitError>(())
/// ```
pub fn print_duration(duration: SimDuration) -> String {
    duration.to_string()
}

/// Reads a length in metres: `"40m"`, `"1.5km"`, `"30cm"`.
///
/// ```
/// assert_eq!(farside_actors::units::parse_length_m("30cm"), Ok(0.3));
/// ```
///
/// # Errors
/// When it is none, or has no unit or another quantity's.
pub fn parse_length_m(text: &str) -> Result<f64, UnitError> {
    LENGTH.nearest(text)
}

/// Writes a length in metres so that it parses back to the same one.
///
/// ```
/// assert_eq!(farside_actors::units::print_length_m(1500.0), "1500m");
/// ```
pub fn print_length_m(length_m: f64) -> String {
    format!("{length_m}m")
}

/// Reads a fraction: `"30%"` or `"0.3"`.
///
/// ```
/// use farside_actors::units::parse_fraction;
/// assert_eq!(parse_fraction("30%"), Ok(0.3));
/// assert!(parse_fraction("150%").is_err());
/// ```
///
/// # Errors
/// When it is none, or does not lie from 0 to 1.
pub fn parse_fraction(text: &str) -> Result<f64, UnitError> {
    check_fraction(FRACTION.nearest(text)?)
}

/// A number as a fraction.
///
/// # Errors
/// When it does not lie from 0 to 1.
fn check_fraction(value: f64) -> Result<f64, UnitError> {
    if (0.0..=1.0).contains(&value) {
        Ok(value)
    } else {
        Err(FRACTION.out_of_range(value, "from 0 to 1"))
    }
}

/// Reads a data rate in bit/s: `"128kbit/s"`, `"2Mbit/s"`, `"16kB/s"`.
///
/// ```
/// assert_eq!(farside_actors::units::parse_data_rate("16kB/s"), Ok(128_000));
/// ```
///
/// # Errors
/// When it is none, has no unit or another quantity's, or is no whole number of bit/s.
pub fn parse_data_rate(text: &str) -> Result<u64, UnitError> {
    DATA_RATE.whole(text, "a whole number of bit/s")
}

/// Writes a data rate so that it parses back to the same one.
///
/// ```
/// assert_eq!(farside_actors::units::print_data_rate(128_000), "128kbit/s");
/// ```
pub fn print_data_rate(bit_per_s: u64) -> String {
    print_whole(bit_per_s, &["bit/s", "kbit/s", "Mbit/s", "Gbit/s"])
}

/// Reads a data size in bytes: `"1500B"`, `"64kB"`, `"1MiB"`.
///
/// ```
/// assert_eq!(farside_actors::units::parse_data_size("1.5kB"), Ok(1500));
/// ```
///
/// # Errors
/// When it is none, has no unit or another quantity's, or is no whole number of bytes.
pub fn parse_data_size(text: &str) -> Result<u64, UnitError> {
    DATA_SIZE.whole(text, "a whole number of bytes")
}

/// Writes a data size so that it parses back to the same one.
///
/// ```
/// assert_eq!(farside_actors::units::print_data_size(64_000), "64kB");
/// ```
pub fn print_data_size(bytes: u64) -> String {
    print_whole(bytes, &["B", "kB", "MB", "GB"])
}

/// Reads a power in watts: `"12W"`, `"100mW"`.
///
/// ```
/// assert_eq!(farside_actors::units::parse_power_w("100mW"), Ok(0.1));
/// ```
///
/// # Errors
/// When it is none, or has no unit or another quantity's.
pub fn parse_power_w(text: &str) -> Result<f64, UnitError> {
    POWER.nearest(text)
}

/// Writes a power in watts so that it parses back to the same one.
///
/// ```
/// assert_eq!(farside_actors::units::print_power_w(0.1), "0.1W");
/// ```
pub fn print_power_w(power_w: f64) -> String {
    format!("{power_w}W")
}

/// Reads how often something happens in a second: `"500k/s"`, `"2M/s"`, `"1.5G/s"`.
///
/// ```
/// assert_eq!(farside_actors::units::parse_rate("1.5k/s"), Ok(1500));
/// ```
///
/// # Errors
/// When it is none, has no unit or another quantity's, or is no whole number each second.
pub fn parse_rate(text: &str) -> Result<u64, UnitError> {
    RATE.whole(text, "a whole number each second")
}

/// Writes how often something happens in a second so that it parses back to the same rate.
///
/// ```
/// assert_eq!(farside_actors::units::print_rate(2_000_000), "2M/s");
/// ```
pub fn print_rate(per_s: u64) -> String {
    print_whole(per_s, &["/s", "k/s", "M/s", "G/s"])
}

/// The number in the largest of these units, each 1000 of the one before, that leaves it whole.
fn print_whole(mut value: u64, symbols: &[&str]) -> String {
    let mut symbol = 0;
    while value != 0 && value.is_multiple_of(1000) && symbol + 1 < symbols.len() {
        value /= 1000;
        symbol += 1;
    }
    format!("{value}{}", symbols[symbol])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn durations_are_exact() {
        let nanos = |text| parse_duration(text).map(SimDuration::as_nanos);
        assert_eq!(nanos("250ms"), Ok(250_000_000));
        assert_eq!(nanos("2.6s"), Ok(2_600_000_000));
        assert_eq!(nanos("5us"), Ok(5_000));
        assert_eq!(nanos("5 µs"), Ok(5_000));
        assert_eq!(nanos("3min"), Ok(180_000_000_000));
        assert_eq!(nanos("1h"), Ok(3_600_000_000_000));
        assert_eq!(nanos("0.0000000010s"), Ok(1));
        assert_eq!(nanos(".5s"), Ok(500_000_000));
        assert_eq!(nanos("0s"), Ok(0));
    }

    #[test]
    fn each_mistake_is_called_by_its_name() {
        let says = |text: &str| parse_duration(text).unwrap_err().to_string();
        assert_eq!(
            says("5"),
            "5: expected a duration such as \"250ms\" or \"2.6s\"; a bare number has no unit"
        );
        assert!(says("40m").contains("\"m\" is none of its units ns, us"));
        assert_eq!(
            says("soon"),
            "\"soon\": expected a duration such as \"250ms\" or \"2.6s\""
        );
        assert!(says("0.5ns").contains("a whole number of nanoseconds"));
        assert!(says("99999999999999h").contains("smaller"));
        for rubbish in ["", ".", "-5ms", "1.2.3s", "NaN", "1e3s", "\u{0}", "s"] {
            assert!(parse_duration(rubbish).is_err(), "{rubbish}");
        }
        assert!(
            parse_fraction("1.5")
                .unwrap_err()
                .to_string()
                .contains("from 0 to 1")
        );
        assert!(parse_data_size("1.5B").is_err());
    }

    proptest! {
        #[test]
        fn what_is_printed_parses_back(nanos: u64, rate: u64, length_m in 0.0..1e9f64) {
            let duration = SimDuration::from_nanos(nanos);
            prop_assert_eq!(parse_duration(&print_duration(duration)), Ok(duration));
            prop_assert_eq!(parse_data_rate(&print_data_rate(rate)), Ok(rate));
            prop_assert_eq!(parse_data_size(&print_data_size(rate)), Ok(rate));
            prop_assert_eq!(parse_length_m(&print_length_m(length_m)), Ok(length_m));
            prop_assert_eq!(parse_power_w(&print_power_w(length_m)), Ok(length_m));
        }

        #[test]
        fn no_text_panics(text in ".*", number in "[0-9]{0,60}\\.?[0-9]{0,60}", unit in "(s|ns|h|m|%|GiB)") {
            for text in [text, format!("{number}{unit}")] {
                let _ = parse_duration(&text);
                let _ = parse_length_m(&text);
                let _ = parse_power_w(&text);
                let _ = parse_fraction(&text);
                let _ = parse_data_rate(&text);
                let _ = parse_data_size(&text);
            }
        }
    }
}
