//! What a message holds by field number, and what the values of one field come to: a message in parts, the entries
//! of a map, a list that may be packed.

use std::borrow::Cow;
use std::collections::BTreeMap;

use prost_types::field_descriptor_proto::Type;

use super::content;
use super::scalar::Scalar;
use crate::schema::{FieldType, MessageType};
use crate::wire::{Fields, Value};

/// What a message holds, by field number.
pub(super) type Held<'a> = BTreeMap<u32, Vec<Value<'a>>>;

/// Takes a message apart. Of a oneof, only what was set last is held.
pub(super) fn held<'a>(bytes: &'a [u8], of: &MessageType) -> Option<Held<'a>> {
    let mut held: Held<'a> = BTreeMap::new();
    let mut set: BTreeMap<i32, u32> = BTreeMap::new();
    for field in Fields::new(bytes) {
        let (number, value) = field.ok()?;
        if let Some(oneof) = of.fields.get(&number).and_then(|field| field.oneof)
            && let Some(before) = set.insert(oneof, number)
            && before != number
        {
            held.remove(&before);
        }
        held.entry(number).or_default().push(value);
    }
    Some(held)
}

/// A message that is there several times is one: its parts one behind the other.
pub(super) fn merged<'a>(values: &[Value<'a>]) -> Cow<'a, [u8]> {
    match values {
        [] => Cow::Borrowed(&[]),
        [value] => Cow::Borrowed(content(value)),
        values => Cow::Owned(values.iter().flat_map(content).copied().collect()),
    }
}

/// The entries of a map, by key as shown: the values of each.
pub(super) fn entries<'a>(
    values: &[Value<'a>],
    entry: &MessageType,
) -> Option<BTreeMap<String, Vec<Value<'a>>>> {
    let kind = entry.fields.get(&1).map(|field| field.kind);
    let mut entries = BTreeMap::new();
    for value in values {
        let mut held = held(content(value), entry)?;
        let key = held.remove(&1).and_then(|keys| keys.last().copied());
        let kind = kind.unwrap_or(FieldType::Scalar(Type::Bytes));
        let key = Scalar::read(kind, key).whole();
        entries.insert(key, held.remove(&2).unwrap_or_default());
    }
    Some(entries)
}

/// The elements of a list, packed or not.
pub(super) fn elements<'a>(kind: FieldType, values: &[Value<'a>]) -> Option<Vec<Value<'a>>> {
    let FieldType::Scalar(kind) = kind else {
        return Some(values.to_vec());
    };
    if matches!(kind, Type::String | Type::Bytes) {
        return Some(values.to_vec());
    }
    let mut elements = Vec::new();
    for value in values {
        match value {
            Value::Bytes(packed) => unpack(kind, packed, &mut elements)?,
            value => elements.push(*value),
        }
    }
    Some(elements)
}

fn unpack<'a>(kind: Type, mut packed: &'a [u8], out: &mut Vec<Value<'a>>) -> Option<()> {
    while !packed.is_empty() {
        let value = match kind {
            Type::Double | Type::Fixed64 | Type::Sfixed64 => {
                let (bytes, rest) = packed.split_first_chunk::<8>()?;
                packed = rest;
                Value::Fixed64(u64::from_le_bytes(*bytes))
            }
            Type::Float | Type::Fixed32 | Type::Sfixed32 => {
                let (bytes, rest) = packed.split_first_chunk::<4>()?;
                packed = rest;
                Value::Fixed32(u32::from_le_bytes(*bytes))
            }
            _ => {
                let mut fields = Fields::new(packed);
                let value = fields.varint()?;
                packed = fields.rest();
                Value::Varint(value)
            }
        };
        out.push(value);
    }
    Some(())
}
