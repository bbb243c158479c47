//! One value of a protobuf message, read as its schema says.

use std::fmt;

use prost_types::field_descriptor_proto::Type;

use super::content;
use crate::fields::{FieldDiff, raw};
use crate::schema::FieldType;
use crate::shown::hex;
use crate::shown::{SHOWN, apart, shorten};
use crate::wire::{Value, signed};

/// A value as its schema says, and bytes on the wire where the schema says something else.
#[derive(PartialEq)]
pub(super) enum Scalar<'a> {
    Absent,
    Double(f64),
    Float(f32),
    Int(i128),
    Bool(bool),
    Text(&'a str),
    Bytes(&'a [u8]),
    Wire(WireBits<'a>),
}

/// A value of which only the bytes are known.
#[derive(PartialEq)]
pub(super) struct WireBits<'a>(pub(super) Value<'a>);

impl<'a> Scalar<'a> {
    /// Reads a value, or what stands for it where there is none.
    pub(super) fn read(kind: FieldType, value: Option<Value<'a>>) -> Scalar<'a> {
        let FieldType::Scalar(kind) = kind else {
            return value.map_or(Scalar::Absent, |value| Scalar::Wire(WireBits(value)));
        };
        let zero = match kind {
            Type::Double | Type::Fixed64 | Type::Sfixed64 => Value::Fixed64(0),
            Type::Float | Type::Fixed32 | Type::Sfixed32 => Value::Fixed32(0),
            Type::String | Type::Bytes | Type::Message | Type::Group => Value::Bytes(&[]),
            _ => Value::Varint(0),
        };
        let value = value.unwrap_or(zero);
        match (kind, value) {
            (Type::Double, Value::Fixed64(bits)) => Scalar::Double(f64::from_bits(bits)),
            (Type::Float, Value::Fixed32(bits)) => Scalar::Float(f32::from_bits(bits)),
            (Type::Fixed64, Value::Fixed64(n)) => Scalar::Int(n.into()),
            (Type::Sfixed64, Value::Fixed64(n)) => Scalar::Int((n as i64).into()),
            (Type::Fixed32, Value::Fixed32(n)) => Scalar::Int(n.into()),
            (Type::Sfixed32, Value::Fixed32(n)) => Scalar::Int((n as i32).into()),
            (Type::Uint64, Value::Varint(n)) => Scalar::Int(n.into()),
            (Type::Int64, Value::Varint(n)) => Scalar::Int((n as i64).into()),
            (Type::Uint32, Value::Varint(n)) => Scalar::Int((n as u32).into()),
            (Type::Int32 | Type::Enum, Value::Varint(n)) => Scalar::Int((n as i32).into()),
            (Type::Sint64, Value::Varint(n)) => Scalar::Int(signed(n).into()),
            (Type::Sint32, Value::Varint(n)) => Scalar::Int((signed(n) as i32).into()),
            (Type::Bool, Value::Varint(n)) => Scalar::Bool(n != 0),
            (Type::String, Value::Bytes(bytes)) => {
                std::str::from_utf8(bytes).map_or(Scalar::Bytes(bytes), Scalar::Text)
            }
            (Type::Bytes, Value::Bytes(bytes)) => Scalar::Bytes(bytes),
            (_, value) => Scalar::Wire(WireBits(value)),
        }
    }

    /// The two values, so that the difference shows.
    pub(super) fn differs(&self, path: &dyn fmt::Display, other: &Scalar<'_>) -> FieldDiff {
        let path = path.to_string();
        match (self, other) {
            (Scalar::Text(a), Scalar::Text(b)) => {
                let (a, b) = apart(a, b);
                FieldDiff::new(path, a, b)
            }
            (Scalar::Bytes(a), Scalar::Bytes(b)) => raw(path, a, b),
            (Scalar::Wire(WireBits(a)), Scalar::Wire(WireBits(b)))
                if std::mem::discriminant(a) == std::mem::discriminant(b)
                    && matches!(a, Value::Bytes(_) | Value::Group(_)) =>
            {
                raw(path, content(a), content(b))
            }
            (a, b) => {
                let (x, y) = (a.show(), b.show());
                if x == y {
                    let (x, y) = (a.bits(), b.bits());
                    return FieldDiff::new(path, x, y);
                }
                FieldDiff::new(path, x, y)
            }
        }
    }

    pub(super) fn show(&self) -> String {
        match self {
            Scalar::Text(text) => shorten(text),
            Scalar::Bytes(bytes) if bytes.len() > SHOWN / 2 => {
                format!("{} bytes: {}...", bytes.len(), hex(&bytes[..SHOWN / 2]))
            }
            Scalar::Wire(WireBits(Value::Bytes(bytes) | Value::Group(bytes)))
                if bytes.len() > SHOWN / 2 =>
            {
                format!("{} bytes: {}...", bytes.len(), hex(&bytes[..SHOWN / 2]))
            }
            scalar => scalar.whole(),
        }
    }

    /// All of the value: two that are shown alike are the same, but for kinds of no number.
    pub(super) fn whole(&self) -> String {
        match self {
            Scalar::Absent => "absent".to_owned(),
            Scalar::Double(value) => as_written(value, &format!("{value:?}")),
            Scalar::Float(value) => as_written(value, &format!("{value:?}")),
            Scalar::Int(value) => value.to_string(),
            Scalar::Bool(value) => value.to_string(),
            Scalar::Text(value) => (*value).to_owned(),
            Scalar::Bytes(value) => hex(value),
            Scalar::Wire(WireBits(value)) => match value {
                Value::Varint(value) => value.to_string(),
                Value::Fixed32(bits) => format!("0x{bits:08x}"),
                Value::Fixed64(bits) => format!("0x{bits:016x}"),
                Value::Bytes(bytes) => format!("bytes {}", hex(bytes)),
                Value::Group(bytes) => format!("group {}", hex(bytes)),
            },
        }
    }

    fn bits(&self) -> String {
        match self {
            Scalar::Double(value) => format!("{value} (0x{:016x})", value.to_bits()),
            Scalar::Float(value) => format!("{value} (0x{:08x})", value.to_bits()),
            Scalar::Wire(_) => format!("{} (of another wire type)", self.whole()),
            Scalar::Bytes(_) => format!("{} (bytes)", self.show()),
            other => format!("{} (as declared)", other.show()),
        }
    }
}

/// A number as JSON writes it: the fewest digits that give it back, with an exponent where there
/// would be many zeros.
fn as_written(number: &impl fmt::Display, exact: &str) -> String {
    match exact.contains('e') {
        true => exact.to_owned(),
        false => number.to_string(),
    }
}
