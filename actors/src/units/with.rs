//! The modules for serde's `#[serde(with = "…")]`, one for each quantity. Parsing is next door.

use std::fmt;
use std::marker::PhantomData;

use farside::SimDuration;
use serde::de::{Error, Visitor};
use serde::{Deserializer, Serializer};

use super::{
    ACCELERATION, ANGLE, DATA_BITS, DATA_BYTES, DATA_RATE, DURATION, ENERGY, FRACTION, LENGTH,
    POWER, SPEED, TEMPERATURE, UnitError, check_fraction, parse_acceleration_m_per_s2,
    parse_angle_rad, parse_data_bits, parse_data_rate, parse_data_size, parse_duration,
    parse_energy_j, parse_fraction, parse_length_m, parse_power_w, parse_signed_energy_j,
    parse_signed_length_m, parse_speed_m_per_s, parse_temperature_k, print_acceleration_m_per_s2,
    print_angle_rad, print_data_bits, print_data_rate, print_data_size, print_energy_j,
    print_length_m, print_power_w, print_speed_m_per_s, print_temperature_k,
};

/// How one quantity is read, from a text or from a bare number.
trait Readable {
    type Value;
    const EXPECTED: &'static str;
    fn text(text: &str) -> Result<Self::Value, UnitError>;
    fn number(number: f64) -> Result<Self::Value, UnitError>;
}

struct Reader<Q>(PhantomData<Q>);

impl<Q: Readable> Visitor<'_> for Reader<Q> {
    type Value = Q::Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(Q::EXPECTED)
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Q::Value, E> {
        Q::text(text).map_err(E::custom)
    }

    fn visit_f64<E: Error>(self, number: f64) -> Result<Q::Value, E> {
        Q::number(number).map_err(E::custom)
    }

    fn visit_i64<E: Error>(self, number: i64) -> Result<Q::Value, E> {
        self.visit_f64(number as f64)
    }

    fn visit_u64<E: Error>(self, number: u64) -> Result<Q::Value, E> {
        self.visit_f64(number as f64)
    }
}

/// Reads the field of an `Option`: absent is up to `#[serde(default)]`, present is a value.
struct Present<Q>(PhantomData<Q>);

impl<'de, Q: Readable> Visitor<'de> for Present<Q> {
    type Value = Option<Q::Value>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(Q::EXPECTED)
    }

    fn visit_none<E: Error>(self) -> Result<Self::Value, E> {
        Ok(None)
    }

    fn visit_unit<E: Error>(self) -> Result<Self::Value, E> {
        Ok(None)
    }

    fn visit_some<D: Deserializer<'de>>(self, inner: D) -> Result<Self::Value, D::Error> {
        inner.deserialize_any(Reader::<Q>(PhantomData)).map(Some)
    }
}

macro_rules! quantity {
    (
        $(#[$doc:meta])* $module:ident: $value:ty, $name:ident,
        expected $expected:expr, text $text:expr, number $number:expr,
        write |$v:ident, $s:ident| $write:expr
    ) => {
        pub(super) struct $name;

        impl Readable for $name {
            type Value = $value;
            const EXPECTED: &'static str = $expected;
            fn text(text: &str) -> Result<$value, UnitError> {
                $text(text)
            }
            fn number(number: f64) -> Result<$value, UnitError> {
                $number(number)
            }
        }

        $(#[$doc])*
        pub mod $module {
            use super::*;

            /// Writes the quantity.
            ///
            /// # Errors
            /// When the serializer fails.
            pub fn serialize<S: Serializer>($v: &$value, $s: S) -> Result<S::Ok, S::Error> {
                $write
            }

            /// Reads the quantity.
            ///
            /// # Errors
            /// When it is none, with what was found and what was expected.
            pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<$value, D::Error> {
                from.deserialize_any(Reader::<$name>(PhantomData))
            }

            /// The same for an `Option`; add `#[serde(default)]` so that the key may be absent.
            pub mod option {
                use super::*;

                /// Writes the quantity, or nothing.
                ///
                /// # Errors
                /// When the serializer fails.
                pub fn serialize<S: Serializer>(
                    value: &Option<$value>,
                    $s: S,
                ) -> Result<S::Ok, S::Error> {
                    match value {
                        Some($v) => $write,
                        None => $s.serialize_none(),
                    }
                }

                /// Reads the quantity.
                ///
                /// # Errors
                /// When it is none, with what was found and what was expected.
                pub fn deserialize<'de, D: Deserializer<'de>>(
                    from: D,
                ) -> Result<Option<$value>, D::Error> {
                    from.deserialize_option(Present::<$name>(PhantomData))
                }
            }
        }
    };
}

quantity! {
    /// Durations: `"250ms"` and a [`SimDuration`]. Bare numbers are refused.
    duration: SimDuration, Duration,
    expected DURATION.expected,
    text parse_duration,
    number |number: f64| Err(DURATION.no_unit(number)),
    write |value, to| to.collect_str(value)
}

quantity! {
    /// Lengths: `"1.5km"` and metres. Bare numbers are refused.
    length_m: f64, LengthM,
    expected LENGTH.expected,
    text parse_length_m,
    number |number: f64| Err(LENGTH.no_unit(number)),
    write |value, to| to.collect_str(&print_length_m(*value))
}

quantity! {
    /// Lengths that may be negative, as coordinates: `"-30cm"` and metres. Bare numbers are refused.
    signed_length_m: f64, SignedLengthM,
    expected LENGTH.expected,
    text parse_signed_length_m,
    number |number: f64| Err(LENGTH.no_unit(number)),
    write |value, to| to.collect_str(&print_length_m(*value))
}

quantity! {
    /// Speeds: `"4m/s"` and metres in a second. Bare numbers are refused.
    speed_m_per_s: f64, SpeedMPerS,
    expected SPEED.expected,
    text parse_speed_m_per_s,
    number |number: f64| Err(SPEED.no_unit(number)),
    write |value, to| to.collect_str(&print_speed_m_per_s(*value))
}

quantity! {
    /// Accelerations: `"1m/s2"` and metres in a second, gained in each second. Bare numbers are
    /// refused.
    acceleration_m_per_s2: f64, AccelerationMPerS2,
    expected ACCELERATION.expected,
    text parse_acceleration_m_per_s2,
    number |number: f64| Err(ACCELERATION.no_unit(number)),
    write |value, to| to.collect_str(&print_acceleration_m_per_s2(*value))
}

quantity! {
    /// Fractions from 0 to 1: `0.3`, `"0.3"` or `"30%"`; written as a number.
    fraction: f64, Fraction,
    expected FRACTION.expected,
    text parse_fraction,
    number check_fraction,
    write |value, to| to.serialize_f64(*value)
}

quantity! {
    /// Powers: `"12W"` and watts. Bare numbers are refused.
    power_w: f64, PowerW,
    expected POWER.expected,
    text parse_power_w,
    number |number: f64| Err(POWER.no_unit(number)),
    write |value, to| to.collect_str(&print_power_w(*value))
}

quantity! {
    /// Data rates: `"128kbit/s"` and bit/s. Bare numbers are refused.
    data_rate_bit_per_s: u64, DataRate,
    expected DATA_RATE.expected,
    text parse_data_rate,
    number |number: f64| Err(DATA_RATE.no_unit(number)),
    write |value, to| to.collect_str(&print_data_rate(*value))
}

quantity! {
    /// Data sizes: `"64kB"` and bytes. Bare numbers are refused.
    data_size_bytes: u64, DataSize,
    expected DATA_BYTES.expected,
    text parse_data_size,
    number |number: f64| Err(DATA_BYTES.no_unit(number)),
    write |value, to| to.collect_str(&print_data_size(*value))
}

quantity! {
    /// Data sizes: `"3Mbit"` and bits. Bare numbers are refused.
    data_size_bits: u64, DataBits,
    expected DATA_BITS.expected,
    text parse_data_bits,
    number |number: f64| Err(DATA_BITS.no_unit(number)),
    write |value, to| to.collect_str(&print_data_bits(*value))
}

quantity! {
    /// Energies: `"1.2kWh"` and joules, not negative. Bare numbers are refused.
    energy_j: f64, EnergyJ,
    expected ENERGY.expected,
    text parse_energy_j,
    number |number: f64| Err(ENERGY.no_unit(number)),
    write |value, to| to.collect_str(&print_energy_j(*value))
}

quantity! {
    /// Energies that may be negative: `"-5J"` and joules. Bare numbers are refused.
    signed_energy_j: f64, SignedEnergyJ,
    expected ENERGY.expected,
    text parse_signed_energy_j,
    number |number: f64| Err(ENERGY.no_unit(number)),
    write |value, to| to.collect_str(&print_energy_j(*value))
}

quantity! {
    /// Angles: `"30deg"` and radians. Bare numbers are refused.
    angle_rad: f64, AngleRad,
    expected ANGLE.expected,
    text parse_angle_rad,
    number |number: f64| Err(ANGLE.no_unit(number)),
    write |value, to| to.collect_str(&print_angle_rad(*value))
}

quantity! {
    /// Temperatures: `"-40degC"` and kelvins. Bare numbers are refused.
    temperature_k: f64, TemperatureK,
    expected TEMPERATURE.expected,
    text parse_temperature_k,
    number |number: f64| Err(TEMPERATURE.no_unit(number)),
    write |value, to| to.collect_str(&print_temperature_k(*value))
}

#[cfg(test)]
mod tests {
    use farside::SimDuration;
    use serde::{Deserialize, Serialize};

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct All {
        #[serde(with = "super::duration")]
        latency: SimDuration,
        #[serde(with = "super::length_m")]
        range: f64,
        #[serde(with = "super::fraction")]
        loss: f64,
        #[serde(default, with = "super::duration::option")]
        at: Option<SimDuration>,
        #[serde(default, with = "super::data_rate_bit_per_s::option")]
        rate: Option<u64>,
        #[serde(default, with = "super::data_size_bits::option")]
        picture: Option<u64>,
        #[serde(default, with = "super::energy_j::option")]
        battery: Option<f64>,
        #[serde(default, with = "super::signed_energy_j::option")]
        balance: Option<f64>,
        #[serde(default, with = "super::angle_rad::option")]
        slope: Option<f64>,
        #[serde(default, with = "super::temperature_k::option")]
        coldest: Option<f64>,
    }

    #[test]
    fn toml_carries_every_quantity_there_and_back() {
        let text = "latency = \"2.6s\"\nrange = \"40m\"\nloss = \"2%\"\nrate = \"128kbit/s\"\n\
            picture = \"3Mbit\"\nbattery = \"1.2kWh\"\nbalance = \"-5J\"\nslope = \"90deg\"\n\
            coldest = \"-40degC\"\n";
        let all: All = toml::from_str(text).unwrap();
        assert_eq!(
            (all.picture, all.battery),
            (Some(3_000_000), Some(4_320_000.0))
        );
        assert_eq!((all.balance, all.coldest), (Some(-5.0), Some(233.15)));
        assert_eq!(all.slope, Some(std::f64::consts::FRAC_PI_2));
        assert_eq!((all.loss, all.at, all.rate), (0.02, None, Some(128_000)));
        let again: All = toml::from_str(&toml::to_string(&all).unwrap()).unwrap();
        assert_eq!(again, all);
    }

    #[test]
    fn a_bare_number_is_refused_where_it_stands() {
        let text = "latency = 5\nrange = \"40m\"\nloss = 0\n";
        let error = toml::from_str::<All>(text).unwrap_err();
        assert_eq!(error.span(), Some(10..11));
        assert_eq!(
            error.message(),
            "5: expected a duration such as \"250ms\" or \"3h8min\"; a bare number has no unit"
        );
    }
}
