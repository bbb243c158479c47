//! A protobuf message as a value: fields by their names, in the order of their numbers.

use std::borrow::Cow;
use std::sync::Arc;

use prost_types::field_descriptor_proto::Type;

use super::scalar::{Scalar, WireBits};
use super::{Side, any, content, elements, entries, held, merged, side};
use crate::channel::ChannelInfo;
use crate::schema::{Field, FieldType, MessageType, Types};
use crate::value::{DEPTH, Unreadable, VALUES};
use crate::value::{NumberKind, Numbers, Value};
use crate::wire;

/// What a message says. What is absent is left out, where that is something else than zero; fields that the
/// schema does not know are called by their numbers.
pub(super) fn message<'a>(
    bytes: &'a [u8],
    of: Side<'a>,
    others: &'a [Arc<ChannelInfo>],
) -> Result<Value<'a>, Unreadable> {
    let mut reader = Reader { others, values: 0 };
    reader.message(Cow::Borrowed(bytes), of, 0)
}

struct Reader<'a> {
    others: &'a [Arc<ChannelInfo>],
    values: usize,
}

impl<'a> Reader<'a> {
    fn count(&mut self) -> Result<(), Unreadable> {
        self.values += 1;
        match self.values > VALUES {
            true => Err(Unreadable::new(format!(
                "a message of more than {VALUES} values"
            ))),
            false => Ok(()),
        }
    }

    fn message(
        &mut self,
        bytes: Cow<'a, [u8]>,
        of: Side<'a>,
        depth: usize,
    ) -> Result<Value<'a>, Unreadable> {
        self.count()?;
        if depth > DEPTH {
            return Err(Unreadable::new("messages nested too deep"));
        }
        let Some(at) = of.message else {
            return Ok(Value::Bytes(bytes));
        };
        match bytes {
            Cow::Borrowed(bytes) => self.fields(bytes, of.types, at, depth),
            // A message in several parts lies nowhere in the file as a whole: what it says is copied.
            Cow::Owned(bytes) => {
                let mut inner = Reader {
                    others: self.others,
                    values: self.values,
                };
                let value = inner.fields(&bytes, of.types, at, depth)?;
                self.values = inner.values;
                Ok(owned(value))
            }
        }
    }

    fn fields<'b>(
        &mut self,
        bytes: &'b [u8],
        types: &'b Types,
        at: usize,
        depth: usize,
    ) -> Result<Value<'b>, Unreadable>
    where
        'a: 'b,
    {
        let of = types.message(at);
        let mut reader: Reader<'b> = Reader {
            others: self.others,
            values: self.values,
        };
        let value = reader.declared(bytes, types, of, depth);
        self.values = reader.values;
        value
    }

    fn declared(
        &mut self,
        bytes: &'a [u8],
        types: &'a Types,
        of: &'a MessageType,
        depth: usize,
    ) -> Result<Value<'a>, Unreadable> {
        let wrong = || Unreadable::new("bytes that are no protobuf message");
        if let Some(any::Packed { url, bytes, side }) = any::packed(bytes, of, (types, self.others))
        {
            let inner = self.message(bytes, side, depth + 1)?;
            let mut fields = vec![(Cow::Borrowed("@type"), Value::from(url))];
            match inner {
                Value::Object(inner) => fields.extend(inner),
                other => fields.push((Cow::Borrowed("value"), other)),
            }
            return Ok(Value::Object(fields));
        }
        let mut held = held(bytes, of).ok_or_else(wrong)?;
        let mut fields = Vec::with_capacity(of.fields.len().min(held.len() + 16));
        for field in of.fields.values() {
            let values = held.remove(&field.number);
            let absent_counts = field.presence || field.repeated;
            if values.is_none() && absent_counts {
                continue;
            }
            let value = self.field(field, values.unwrap_or_default(), types, depth)?;
            fields.push((Cow::Borrowed(field.name.as_str()), value));
        }
        for (number, values) in held {
            let value = values.last().copied().map_or(Value::Null, wire_value);
            self.count()?;
            fields.push((Cow::Owned(number.to_string()), value));
        }
        Ok(Value::Object(fields))
    }

    fn field(
        &mut self,
        field: &'a Field,
        values: Vec<wire::Value<'a>>,
        types: &'a Types,
        depth: usize,
    ) -> Result<Value<'a>, Unreadable> {
        self.count()?;
        if let FieldType::Message(Some(at)) = field.kind
            && field.repeated
            && types.message(at).map_entry
        {
            return self.map(types.message(at), &values, types, depth);
        }
        match (field.kind, field.repeated) {
            (FieldType::Message(message), false) => {
                self.message(merged(&values), side(types, message), depth + 1)
            }
            (FieldType::Message(message), true) => {
                let each = values.into_iter().map(|value| {
                    let bytes = Cow::Borrowed(content(&value));
                    self.message(bytes, side(types, message), depth + 1)
                });
                Ok(Value::List(each.collect::<Result<_, _>>()?))
            }
            (kind, false) => Ok(scalar(field, kind, values.last().copied(), types)),
            (kind, true) => self.list(field, kind, &values, types),
        }
    }

    fn list(
        &mut self,
        field: &'a Field,
        kind: FieldType,
        values: &[wire::Value<'a>],
        types: &'a Types,
    ) -> Result<Value<'a>, Unreadable> {
        if let [wire::Value::Bytes(packed)] = values
            && let Some(kind) = fixed(kind)
            && packed.len() % kind.bytes() == 0
        {
            return Ok(Value::Numbers(Numbers::new(kind, false, packed)));
        }
        let elements = elements(kind, values);
        let elements = elements.ok_or_else(|| Unreadable::new("a list that is malformed"))?;
        let mut list = Vec::with_capacity(elements.len());
        for value in elements {
            self.count()?;
            list.push(scalar(field, kind, Some(value), types));
        }
        Ok(Value::List(list))
    }

    fn map(
        &mut self,
        entry: &'a MessageType,
        values: &[wire::Value<'a>],
        types: &'a Types,
        depth: usize,
    ) -> Result<Value<'a>, Unreadable> {
        let found = entries(values, entry);
        let found = found.ok_or_else(|| Unreadable::new("a map that is malformed"))?;
        let mut fields = Vec::with_capacity(found.len());
        for (key, values) in found {
            self.count()?;
            let value = match entry.value_of_entry() {
                Some(field) => self.field(field, values, types, depth + 1)?,
                None => Value::Null,
            };
            fields.push((Cow::Owned(key), value));
        }
        Ok(Value::Object(fields))
    }
}

/// The kinds of numbers that all have one size, which are read where they are.
fn fixed(kind: FieldType) -> Option<NumberKind> {
    Some(match kind {
        FieldType::Scalar(Type::Double) => NumberKind::F64,
        FieldType::Scalar(Type::Float) => NumberKind::F32,
        FieldType::Scalar(Type::Fixed64) => NumberKind::U64,
        FieldType::Scalar(Type::Sfixed64) => NumberKind::I64,
        FieldType::Scalar(Type::Fixed32) => NumberKind::U32,
        FieldType::Scalar(Type::Sfixed32) => NumberKind::I32,
        _ => return None,
    })
}

fn scalar<'a>(
    field: &Field,
    kind: FieldType,
    value: Option<wire::Value<'a>>,
    types: &'a Types,
) -> Value<'a> {
    match Scalar::read(kind, value) {
        Scalar::Absent => Value::Null,
        Scalar::Double(number) => Value::Float(number),
        Scalar::Float(number) => Value::Single(number),
        Scalar::Bool(value) => Value::Bool(value),
        Scalar::Text(text) => Value::from(text),
        Scalar::Bytes(bytes) => Value::Bytes(Cow::Borrowed(bytes)),
        Scalar::Wire(WireBits(value)) => wire_value(value),
        Scalar::Int(number) => match types.name_of(field, number) {
            Some(name) => Value::Enum {
                number,
                name: Cow::Borrowed(name),
            },
            None => Value::Int(number),
        },
    }
}

/// A value of which only the bytes are known.
fn wire_value(value: wire::Value<'_>) -> Value<'_> {
    match value {
        wire::Value::Varint(number) | wire::Value::Fixed64(number) => Value::Int(number.into()),
        wire::Value::Fixed32(number) => Value::Int(number.into()),
        wire::Value::Bytes(bytes) | wire::Value::Group(bytes) => Value::Bytes(Cow::Borrowed(bytes)),
    }
}

/// The value, borrowing nothing.
fn owned<'a>(value: Value<'_>) -> Value<'a> {
    match value {
        Value::Null => Value::Null,
        Value::Bool(value) => Value::Bool(value),
        Value::Int(number) => Value::Int(number),
        Value::Float(number) => Value::Float(number),
        Value::Single(number) => Value::Single(number),
        // A message of this encoding has none.
        Value::Decimal(text) => Value::Text(Cow::Owned(text.to_owned())),
        Value::Text(text) => Value::Text(Cow::Owned(text.into_owned())),
        Value::Bytes(bytes) => Value::Bytes(Cow::Owned(bytes.into_owned())),
        Value::Enum { number, name } => Value::Enum {
            number,
            name: Cow::Owned(name.into_owned()),
        },
        Value::Numbers(numbers) => Value::List(numbers.iter().collect()),
        Value::List(values) => Value::List(values.into_iter().map(owned).collect()),
        Value::Object(fields) => {
            let fields = fields.into_iter();
            let owned =
                |(name, value): (Cow<'_, str>, _)| (Cow::Owned(name.into_owned()), owned(value));
            Value::Object(fields.map(owned).collect())
        }
    }
}
