//! How the values of parameters are written in scenarios: one [`Form`] for each kind of value.

use std::fmt;
use std::marker::PhantomData;

use farside::SimDuration;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Error, IntoDeserializer, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::{Burst, Contacts, JitterShape, Preset, QueueLimit, Trace};
use crate::units;

/// How a value is read from a scenario, and written to one.
pub(super) trait Form {
    type Value;

    /// What may be written, for people.
    fn said() -> Said;

    fn read<'de, D: Deserializer<'de>>(from: D) -> Result<Self::Value, D::Error>;

    fn write<S: Serializer>(value: &Self::Value, to: S) -> Result<S::Ok, S::Error>;
}

/// What may be written as the value of a key: its kind, its units, and which of those values.
#[derive(Default)]
pub(super) struct Said {
    pub(super) value: &'static str,
    pub(super) units: Vec<&'static str>,
    pub(super) expected: String,
}

impl Said {
    fn value(value: &'static str) -> Self {
        Said {
            value,
            ..Said::default()
        }
    }

    fn which(self, expected: impl Into<String>) -> Self {
        Said {
            expected: expected.into(),
            ..self
        }
    }
}

/// A type that says of itself what may be written.
pub(super) trait Described {
    fn said() -> Said;
}

macro_rules! described {
    ($($type:ty: $value:literal $(which $expected:expr)?;)*) => {$(
        impl Described for $type {
            fn said() -> Said {
                Said::value($value)$(.which($expected))?
            }
        }
    )*};
}

described! {
    bool: "true or false";
    String: "a text";
    JitterShape: "" which r#"one of uniform, normal, pareto, or { table = [...] }"#;
    Preset: "" which format!("one of {}", Preset::names().collect::<Vec<_>>().join(", "));
    Burst: "a table" which "{ loss, length }, { loss, messages, interval }, { p, r, bad_loss, \
                            good_loss } or { p13, p31, p32, p23, p14 }, each with `slot` if wanted";
    QueueLimit: r#"a number of messages, or a data size such as "64kB""#;
    Trace: "a file's name, a built-in trace's, or a list of milliseconds";
    Contacts: "a list of { start, end, rate, owlt }, or { every, windows = [...] }";
}

/// As the type itself has it.
pub(super) struct Plain<T>(PhantomData<T>);

impl<T: Described + Serialize + for<'de> Deserialize<'de>> Form for Plain<T> {
    type Value = T;

    fn said() -> Said {
        T::said()
    }

    fn read<'de, D: Deserializer<'de>>(from: D) -> Result<T, D::Error> {
        T::deserialize(from)
    }

    fn write<S: Serializer>(value: &T, to: S) -> Result<S::Ok, S::Error> {
        value.serialize(to)
    }
}

/// Quantities with units, by the modules of [`units`].
macro_rules! quantities {
    ($($name:ident: $value:ty = $module:ident;)*) => {$(
        pub(super) struct $name;

        impl Form for $name {
            type Value = $value;

            fn said() -> Said {
                let described = units::described(stringify!($module));
                let (value, units) = described.unwrap_or_default();
                Said { value, units, expected: String::new() }
            }

            fn read<'de, D: Deserializer<'de>>(from: D) -> Result<$value, D::Error> {
                units::$module::deserialize(from)
            }

            fn write<S: Serializer>(value: &$value, to: S) -> Result<S::Ok, S::Error> {
                units::$module::serialize(value, to)
            }
        }
    )*};
}

quantities! {
    Duration: SimDuration = duration;
    Fraction: f64 = fraction;
    AnyRate: u64 = data_rate_bit_per_s;
    DataSize: u64 = data_size_bytes;
    Power: f64 = power_w;
}

/// A data rate, which cannot be zero: that would be an outage.
pub(super) struct DataRate;

impl Form for DataRate {
    type Value = u64;

    fn said() -> Said {
        AnyRate::said().which("more than 0bit/s")
    }

    fn read<'de, D: Deserializer<'de>>(from: D) -> Result<u64, D::Error> {
        match AnyRate::read(from)? {
            0 => Err(D::Error::custom(
                "0bit/s: expected more than that; a link that is out has outage = true",
            )),
            rate => Ok(rate),
        }
    }

    fn write<S: Serializer>(value: &u64, to: S) -> Result<S::Ok, S::Error> {
        AnyRate::write(value, to)
    }
}

/// A length of time that cannot be zero.
pub(super) struct Span;

impl Form for Span {
    type Value = SimDuration;

    fn said() -> Said {
        Duration::said().which("more than 0s")
    }

    fn read<'de, D: Deserializer<'de>>(from: D) -> Result<SimDuration, D::Error> {
        let span = Duration::read(from)?;
        if span.is_zero() {
            return Err(D::Error::custom("0s: expected more than that"));
        }
        Ok(span)
    }

    fn write<S: Serializer>(value: &SimDuration, to: S) -> Result<S::Ok, S::Error> {
        Duration::write(value, to)
    }
}

/// A number of retries. Each may be simulated, so there is a limit.
pub(super) struct Retries;

/// The most retries of one message.
const MAX_RETRIES: u32 = 1000;

impl Form for Retries {
    type Value = u32;

    fn said() -> Said {
        Said::value("a whole number").which(format!("0 to {MAX_RETRIES}"))
    }

    fn read<'de, D: Deserializer<'de>>(from: D) -> Result<u32, D::Error> {
        let retries = u32::deserialize(from)?;
        if retries > MAX_RETRIES {
            return Err(D::Error::custom(format!(
                "{retries}: expected at most {MAX_RETRIES}"
            )));
        }
        Ok(retries)
    }

    fn write<S: Serializer>(value: &u32, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_u32(*value)
    }
}

/// A number of messages under way at once.
pub(super) struct WindowSize;

/// The largest window: more sequence numbers than any protocol has.
const MAX_WINDOW: u32 = 1 << 24;

impl Form for WindowSize {
    type Value = u32;

    fn said() -> Said {
        Said::value("a whole number").which(format!("1 to {MAX_WINDOW}"))
    }

    fn read<'de, D: Deserializer<'de>>(from: D) -> Result<u32, D::Error> {
        let window = u32::deserialize(from)?;
        match window {
            1..=MAX_WINDOW => Ok(window),
            _ => Err(D::Error::custom(format!(
                "{window}: expected 1 to {MAX_WINDOW}; 1 is stop and wait"
            ))),
        }
    }

    fn write<S: Serializer>(value: &u32, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_u32(*value)
    }
}

/// A number of bytes that cannot be zero.
pub(super) struct SomeBytes;

impl Form for SomeBytes {
    type Value = u64;

    fn said() -> Said {
        DataSize::said().which("more than 0B")
    }

    fn read<'de, D: Deserializer<'de>>(from: D) -> Result<u64, D::Error> {
        match DataSize::read(from)? {
            0 => Err(D::Error::custom("0B: expected more than that")),
            bytes => Ok(bytes),
        }
    }

    fn write<S: Serializer>(value: &u64, to: S) -> Result<S::Ok, S::Error> {
        DataSize::write(value, to)
    }
}

/// How one turns off what a default or a preset turned on.
const OFF: &str = "off";

/// Another form, or `"off"`.
pub(super) struct OrOff<F>(PhantomData<F>);

impl<F: Form> Form for OrOff<F> {
    type Value = Option<F::Value>;

    fn said() -> Said {
        let inner = F::said();
        let expected = match inner.expected.as_str() {
            "" => "or \"off\"".to_owned(),
            expected => format!("{expected}; or \"off\""),
        };
        inner.which(expected)
    }

    fn read<'de, D: Deserializer<'de>>(from: D) -> Result<Self::Value, D::Error> {
        from.deserialize_any(OrOffVisitor::<F>(PhantomData))
    }

    fn write<S: Serializer>(value: &Self::Value, to: S) -> Result<S::Ok, S::Error> {
        match value {
            Some(value) => F::write(value, to),
            None => to.serialize_str(OFF),
        }
    }
}

struct OrOffVisitor<F>(PhantomData<F>);

impl<'de, F: Form> Visitor<'de> for OrOffVisitor<F> {
    type Value = Option<F::Value>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value, or \"off\"")
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Self::Value, E> {
        if text == OFF {
            return Ok(None);
        }
        F::read(text.into_deserializer()).map(Some)
    }

    fn visit_bool<E: Error>(self, value: bool) -> Result<Self::Value, E> {
        F::read(value.into_deserializer()).map(Some)
    }

    fn visit_i64<E: Error>(self, number: i64) -> Result<Self::Value, E> {
        F::read(number.into_deserializer()).map(Some)
    }

    fn visit_u64<E: Error>(self, number: u64) -> Result<Self::Value, E> {
        F::read(number.into_deserializer()).map(Some)
    }

    fn visit_f64<E: Error>(self, number: f64) -> Result<Self::Value, E> {
        F::read(number.into_deserializer()).map(Some)
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
        F::read(MapAccessDeserializer::new(map)).map(Some)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Self::Value, A::Error> {
        F::read(SeqAccessDeserializer::new(seq)).map(Some)
    }
}
