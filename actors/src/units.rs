//! Quantities as people write them in scenarios: `"250ms"`, `"3h8min"`, `"1.5km"`, `"30%"`,
//! `"128kbit/s"`, `"-40degC"`.
//!
//! Each quantity has a `parse_…` and a `print_…` function and a module for serde's `with`, with
//! `option` inside. What is printed parses back to the same value. Numbers are read exactly: a
//! duration that is no whole number of nanoseconds is refused, not rounded, and what becomes an
//! `f64` is rounded once, to the nearest one.
//!
//! Every number has a unit, spelt as here; `kB` is 1,000 bytes and `KiB` 1,024, a `sol` is the mean
//! solar day of Mars.
//!
//! | quantity | value | units |
//! |---|---|---|
//! | duration | nanoseconds | `ns`, `us` (`µs`), `ms`, `s`, `min`, `h`, `d`, `sol` = 88,775.244 s |
//! | length | m | `mm`, `cm`, `m`, `km` |
//! | speed, acceleration | m/s, m/s² | `mm/s`, `cm/s`, `m/s`, `km/s`; `mm/s2`, `cm/s2`, `m/s2` |
//! | angle | rad | `deg`, `rad` |
//! | energy | J | `uJ`, `mJ`, `J`, `kJ`, `MJ`, `Wh` = 3,600 J, `kWh` |
//! | power | W | `uW`, `mW`, `W`, `kW` |
//! | temperature | K | `K`, `degC` (`°C`) |
//! | data size | bytes, or bits | `bit`, `kbit`, `Mbit`, `Gbit`, `B`, `kB`, ..., `KiB`, ... |
//! | data rate | bit/s | `bit/s`, `kbit/s`, `Mbit/s`, `Gbit/s`, `B/s`, `kB/s`, `MB/s` |
//! | rate | 1/s | `/s`, `k/s`, `M/s`, `G/s` |
//! | fraction | 1 | none, `%` |
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
//! assert_eq!(units::parse_duration("3h8min")?, SimDuration::from_secs(188 * 60));
//! assert_eq!(units::parse_length_m("1.5km")?, 1500.0);
//! let error = units::parse_duration("250 parsecs").unwrap_err();
//! let expected = "\"250 parsecs\": expected a duration such as \"250ms\"";
//! assert!(error.to_string().starts_with(expected));
//! # Ok::<(), farside_actors::units::UnitError>(())
//! ```

mod quantity;
mod with;

use std::f64::consts::PI;

use farside::SimDuration;
use thiserror::Error;

use quantity::{
    ACCELERATION, ANGLE, DATA_BITS, DATA_BYTES, DATA_RATE, DURATION, ENERGY, FRACTION, LENGTH,
    POWER, RATE, SPEED, TEMPERATURE,
};
pub use with::{
    acceleration_m_per_s2, angle_rad, data_rate_bit_per_s, data_size_bits, data_size_bytes,
    duration, energy_j, fraction, length_m, power_w, signed_energy_j, signed_length_m,
    speed_m_per_s, temperature_k,
};

/// What the module of that name reads, and in which units: `duration`, `length_m`. None if there is
/// no such module.
///
/// ```
/// let (expected, units) = farside_actors::units::described("power_w").unwrap();
/// assert_eq!(expected, "a power such as \"100mW\" or \"12W\"");
/// assert_eq!(units, ["uW", "mW", "W", "kW"]);
/// ```
pub fn described(module: &str) -> Option<(&'static str, Vec<&'static str>)> {
    let quantity = match module {
        "duration" => &DURATION,
        "length_m" | "signed_length_m" => &LENGTH,
        "speed_m_per_s" => &SPEED,
        "acceleration_m_per_s2" => &ACCELERATION,
        "angle_rad" => &ANGLE,
        "fraction" => &FRACTION,
        "data_rate_bit_per_s" => &DATA_RATE,
        "data_size_bytes" => &DATA_BYTES,
        "data_size_bits" => &DATA_BITS,
        "energy_j" | "signed_energy_j" => &ENERGY,
        "power_w" => &POWER,
        "temperature_k" => &TEMPERATURE,
        "rate_per_s" => &RATE,
        _ => return None,
    };
    let units = quantity.units.iter().map(|unit| unit.symbol);
    let expected = match module {
        "fraction" => "a fraction from 0 to 1, such as 0.3 or \"30%\"",
        _ => quantity.expected,
    };
    Some((expected, units.filter(|unit| !unit.is_empty()).collect()))
}

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
    #[error(
        "{found:?}: expected {expected}; {unit:?} is none of its units {units}{}",
        nearest.map_or_else(String::new, |unit| format!("; did you mean {unit:?}?"))
    )]
    WrongUnit {
        /// The text.
        found: String,
        /// Its unit.
        unit: String,
        /// What was expected, with an example.
        expected: &'static str,
        /// The units there are.
        units: String,
        /// The one that comes closest in spelling, if any comes near.
        nearest: Option<&'static str>,
    },
    /// Parts of a compound that do not go from larger to smaller units.
    #[error(
        "{found:?}: expected {expected}; its units must go from larger to smaller ones, each once, \
         but {unit} comes after {before}"
    )]
    Order {
        /// The text.
        found: String,
        /// What was expected, with an example.
        expected: &'static str,
        /// The unit that comes too late.
        unit: &'static str,
        /// The unit in front of it.
        before: &'static str,
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

/// Reads a duration: `"250ms"`, `"2.6s"`, `"1.5sol"`, or in several units, from the largest to the
/// smallest: `"3h8min"`, `"1d 2h 0.5s"`. Only the last number may have a fraction.
///
/// A sol is the mean solar day of Mars, 24 h 39 min 35.244 s (Allison and McEwen, *A
/// post-Pathfinder evaluation of areocentric solar coordinates*, 2000).
///
/// ```
/// use farside::SimDuration;
/// use farside_actors::units::parse_duration;
/// assert_eq!(parse_duration("0.5ms"), Ok(SimDuration::from_micros(500)));
/// assert_eq!(parse_duration("1sol"), parse_duration("24h39min35.244s"));
/// assert!(parse_duration("8min3h").unwrap_err().to_string().contains("h comes after min"));
/// assert!(parse_duration("5").unwrap_err().to_string().contains("no unit"));
/// ```
///
/// # Errors
/// When it is none, has no unit or another quantity's, is no whole number of nanoseconds, or has
/// units in another order.
pub fn parse_duration(text: &str) -> Result<SimDuration, UnitError> {
    let nanos = DURATION.whole_of_parts(text, "a whole number of nanoseconds")?;
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

/// Reads a length in metres that may be negative, as a coordinate.
///
/// ```
/// assert_eq!(farside_actors::units::parse_signed_length_m("-30cm"), Ok(-0.3));
/// ```
///
/// # Errors
/// When it is none, or has no unit or another quantity's.
pub fn parse_signed_length_m(text: &str) -> Result<f64, UnitError> {
    LENGTH.nearest_signed(text)
}

/// Writes a length in metres so that it parses back to the same one.
///
/// ```
/// assert_eq!(farside_actors::units::print_length_m(1500.0), "1500m");
/// ```
pub fn print_length_m(length_m: f64) -> String {
    format!("{length_m}m")
}

/// Reads a speed in metres in a second: `"4m/s"`, `"20cm/s"`.
///
/// ```
/// assert_eq!(farside_actors::units::parse_speed_m_per_s("20cm/s"), Ok(0.2));
/// ```
///
/// # Errors
/// When it is none, or has no unit or another quantity's.
pub fn parse_speed_m_per_s(text: &str) -> Result<f64, UnitError> {
    SPEED.nearest(text)
}

/// Writes a speed so that it parses back to the same one.
///
/// ```
/// assert_eq!(farside_actors::units::print_speed_m_per_s(0.2), "0.2m/s");
/// ```
pub fn print_speed_m_per_s(speed: f64) -> String {
    format!("{speed}m/s")
}

/// Reads an acceleration in metres in a second, gained in each second: `"1m/s2"`, `"20cm/s2"`.
///
/// ```
/// assert_eq!(farside_actors::units::parse_acceleration_m_per_s2("20cm/s2"), Ok(0.2));
/// ```
///
/// # Errors
/// When it is none, or has no unit or another quantity's.
pub fn parse_acceleration_m_per_s2(text: &str) -> Result<f64, UnitError> {
    ACCELERATION.nearest(text)
}

/// Writes an acceleration so that it parses back to the same one.
///
/// ```
/// assert_eq!(farside_actors::units::print_acceleration_m_per_s2(0.2), "0.2m/s2");
/// ```
pub fn print_acceleration_m_per_s2(acceleration: f64) -> String {
    format!("{acceleration}m/s2")
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

/// Reads a data size in bytes: `"1500B"`, `"64kB"`, `"1MiB"`, `"12kbit"`.
///
/// ```
/// use farside_actors::units::parse_data_size;
/// assert_eq!(parse_data_size("1.5kB"), Ok(1500));
/// assert_eq!(parse_data_size("12kbit"), Ok(1500));
/// assert!(parse_data_size("12bit").unwrap_err().to_string().contains("whole number of bytes"));
/// ```
///
/// # Errors
/// When it is none, has no unit or another quantity's, or is no whole number of bytes.
pub fn parse_data_size(text: &str) -> Result<u64, UnitError> {
    DATA_BYTES.whole(text, "a whole number of bytes")
}

/// Writes a data size in bytes so that it parses back to the same one.
///
/// ```
/// assert_eq!(farside_actors::units::print_data_size(64_000), "64kB");
/// ```
pub fn print_data_size(bytes: u64) -> String {
    print_whole(bytes, &["B", "kB", "MB", "GB"])
}

/// Reads a data size in bits: `"12bit"`, `"3Mbit"`, `"64kB"`.
///
/// ```
/// use farside_actors::units::parse_data_bits;
/// assert_eq!(parse_data_bits("1.5Mbit"), Ok(1_500_000));
/// assert_eq!(parse_data_bits("1KiB"), Ok(8192));
/// ```
///
/// # Errors
/// When it is none, has no unit or another quantity's, or is no whole number of bits.
pub fn parse_data_bits(text: &str) -> Result<u64, UnitError> {
    DATA_BITS.whole(text, "a whole number of bits")
}

/// Writes a data size in bits so that it parses back to the same one.
///
/// ```
/// assert_eq!(farside_actors::units::print_data_bits(1_500_000), "1500kbit");
/// ```
pub fn print_data_bits(bits: u64) -> String {
    print_whole(bits, &["bit", "kbit", "Mbit", "Gbit"])
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

/// Reads an energy in joules that is not negative: `"5J"`, `"1.2kWh"`, `"250mJ"`.
///
/// ```
/// use farside_actors::units::parse_energy_j;
/// assert_eq!(parse_energy_j("1.5Wh"), Ok(5400.0));
/// assert!(parse_energy_j("-1J").unwrap_err().to_string().contains("not negative"));
/// ```
///
/// # Errors
/// When it is none, has no unit or another quantity's, or is negative.
pub fn parse_energy_j(text: &str) -> Result<f64, UnitError> {
    ENERGY.nearest(text)
}

/// Reads an energy in joules that may be negative, as what a battery takes up or gives.
///
/// ```
/// assert_eq!(farside_actors::units::parse_signed_energy_j("-0.07Wh"), Ok(-252.0));
/// ```
///
/// # Errors
/// When it is none, or has no unit or another quantity's.
pub fn parse_signed_energy_j(text: &str) -> Result<f64, UnitError> {
    ENERGY.nearest_signed(text)
}

/// Writes an energy so that it parses back to the same one.
///
/// ```
/// assert_eq!(farside_actors::units::print_energy_j(5400.0), "5400J");
/// ```
pub fn print_energy_j(energy_j: f64) -> String {
    format!("{energy_j}J")
}

/// Reads an angle in radians, which may be negative: `"30deg"`, `"-0.5rad"`. Degrees are right to
/// the last digit but one, since their size is no decimal number.
///
/// ```
/// use std::f64::consts::PI;
/// assert_eq!(farside_actors::units::parse_angle_rad("-180deg"), Ok(-PI));
/// ```
///
/// # Errors
/// When it is none, or has no unit or another quantity's.
pub fn parse_angle_rad(text: &str) -> Result<f64, UnitError> {
    let (number, unit) = ANGLE.signed(text)?;
    let angle = ANGLE.finite(text, number.nearest(1, 0))?;
    match unit.symbol {
        "deg" => ANGLE.finite(text, Some(angle / 180.0 * PI)),
        _ => Ok(angle),
    }
}

/// Writes an angle so that it parses back to the same one.
///
/// ```
/// assert_eq!(farside_actors::units::print_angle_rad(-0.5), "-0.5rad");
/// ```
pub fn print_angle_rad(angle_rad: f64) -> String {
    format!("{angle_rad}rad")
}

/// Reads a temperature in kelvins: `"-40degC"`, `"233.15K"`.
///
/// ```
/// use farside_actors::units::parse_temperature_k;
/// assert_eq!(parse_temperature_k("-40degC"), Ok(233.15));
/// assert!(parse_temperature_k("-300degC").unwrap_err().to_string().contains("absolute zero"));
/// ```
///
/// # Errors
/// When it is none, has no unit or another quantity's, or lies below absolute zero.
pub fn parse_temperature_k(text: &str) -> Result<f64, UnitError> {
    let (number, unit) = TEMPERATURE.signed(text)?;
    let temperature_k = match unit.symbol {
        "K" => number.nearest(1, 0),
        _ => number.nearest_sum(ZERO_DEG_C_IN_CENTIKELVIN, 2),
    };
    let temperature_k = TEMPERATURE.finite(text, temperature_k)?;
    if temperature_k < 0.0 {
        return Err(TEMPERATURE.out_of_range(text, "at least absolute zero, -273.15degC"));
    }
    Ok(temperature_k)
}

/// 0 °C is 273.15 K.
const ZERO_DEG_C_IN_CENTIKELVIN: u32 = 27_315;

/// Writes a temperature so that it parses back to the same one.
///
/// ```
/// assert_eq!(farside_actors::units::print_temperature_k(233.15), "233.15K");
/// ```
pub fn print_temperature_k(temperature_k: f64) -> String {
    format!("{temperature_k}K")
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
mod tests;
