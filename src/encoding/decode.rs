//! A serde `Deserializer` that reads protobuf by the flat schema.
//!
//! The bytes may be anyone's: fields in any order, unknown, repeated or absent. Nothing is
//! allocated for a length that the bytes do not have.

use std::fmt;
use std::sync::atomic::Ordering;

use serde::de::{self, DeserializeOwned, Visitor};

use super::error::DecodeError;
use super::flat::{Card, Field, FlatSchema, MAX_DEPTH, Message, Shape, ValueType};
use super::wire::{Payload, Wire};

mod access;
mod reader;

use access::{Elements, Entries, Members, Number, OneVariant};
use reader::Reader;

/// Why reading stopped.
#[derive(Debug)]
pub(super) enum Fault {
    Error(Box<DecodeError>),
    /// The type's own `Deserialize` refused.
    Custom(String),
    /// A struct does without none of its fields, and this one is absent.
    Missing(&'static str),
    /// A required field was found out: start over.
    Again,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Fault::Error(error) => error.fmt(f),
            Fault::Custom(reason) => f.write_str(reason),
            Fault::Missing(field) => write!(f, "missing field `{field}`"),
            Fault::Again => f.write_str("a required field is absent"),
        }
    }
}

impl std::error::Error for Fault {}

impl de::Error for Fault {
    fn custom<T: fmt::Display>(message: T) -> Self {
        Fault::Custom(message.to_string())
    }

    fn missing_field(field: &'static str) -> Self {
        Fault::Missing(field)
    }
}

impl From<DecodeError> for Fault {
    fn from(error: DecodeError) -> Self {
        Fault::Error(Box::new(error))
    }
}

/// Reads a value of the root type.
pub(super) fn decode<T: DeserializeOwned>(
    flat: &FlatSchema,
    bytes: &[u8],
) -> Result<T, DecodeError> {
    // Each new start knows one more required field, and they are remembered from then on.
    let fields: usize = flat
        .messages
        .iter()
        .map(|message| message.fields.len())
        .sum();
    for _ in 0..=fields {
        let payload = Payload {
            bytes,
            ..Payload::zero(ValueType::Message(0).wire())
        };
        let root = ValueDe {
            flat,
            field: &flat.root,
            source: Source::Payload(payload),
            depth: 0,
        };
        match T::deserialize(root) {
            Ok(value) => return Ok(value),
            Err(Fault::Again) => {}
            Err(fault) => return Err(refused(flat, fault)),
        }
    }
    Err(refused(flat, Fault::Again))
}

#[cold]
fn refused(flat: &FlatSchema, fault: Fault) -> DecodeError {
    match fault {
        Fault::Error(error) => *error,
        fault => DecodeError::Custom {
            message: flat.messages[0].name.clone(),
            reason: fault.to_string(),
        },
    }
}

/// Where a value comes from.
enum Source<'r, 'p, 'b> {
    /// A field of an open message, with all its occurrences.
    Field(&'r mut Reader<'p, 'b>, usize),
    /// One occurrence, already read.
    Payload(Payload<'b>),
}

/// Reads one value of one field.
struct ValueDe<'r, 'p, 'b> {
    flat: &'p FlatSchema,
    field: &'p Field,
    source: Source<'r, 'p, 'b>,
    depth: u32,
}

impl<'r, 'p, 'b> ValueDe<'r, 'p, 'b> {
    /// What is still to come, as for the encoder.
    fn expect(&self) -> Card {
        match self.source {
            Source::Field(..) => self.field.card,
            Source::Payload(_) => Card::Single,
        }
    }

    fn mismatch<T>(&self, actual: &str) -> Result<T, Fault> {
        Err(self.mismatched(actual))
    }

    #[cold]
    #[inline(never)]
    fn mismatched(&self, actual: &str) -> Fault {
        DecodeError::Mismatch {
            place: self.field.place.clone(),
            expected: self.flat.describe(self.field, self.expect()),
            actual: actual.to_owned(),
        }
        .into()
    }

    /// Takes the one value of a field of the given kind; protobuf lets the last one win.
    #[inline(always)]
    fn payload(self, kind: ValueType) -> Result<Payload<'b>, Fault> {
        if self.field.kind != kind || self.expect() != Card::Single {
            return self.other_kind(kind);
        }
        let payload = match self.source {
            Source::Payload(payload) => payload,
            Source::Field(reader, index) => reader
                .take_last(index)?
                .unwrap_or(Payload::zero(kind.wire())),
        };
        if payload.wire != kind.wire() {
            return Self::other_wire(self.field, payload.wire);
        }
        Ok(payload)
    }

    #[cold]
    #[inline(never)]
    fn other_wire<T>(field: &Field, wire: Wire) -> Result<T, Fault> {
        Self::malformed(
            field,
            &format!("{:?}", field.kind.wire()),
            format!("{wire:?}"),
        )
    }

    #[cold]
    #[inline(never)]
    fn other_kind<T>(&self, kind: ValueType) -> Result<T, Fault> {
        self.mismatch(&format!("{kind:?}").to_lowercase())
    }

    #[cold]
    #[inline(never)]
    fn malformed<T>(field: &Field, expected: &str, actual: String) -> Result<T, Fault> {
        let (place, expected) = (field.place.clone(), expected.to_owned());
        Err(DecodeError::WireType {
            place,
            expected,
            actual,
        }
        .into())
    }

    fn signed(self, kind: ValueType) -> Result<i64, Fault> {
        Ok(self.payload(kind)?.bits as i64)
    }

    fn text(self, kind: ValueType) -> Result<&'b str, Fault> {
        let field = self.field;
        let bytes = self.payload(kind)?.bytes;
        match std::str::from_utf8(bytes) {
            Ok(text) => Ok(text),
            Err(error) => Self::malformed(field, "UTF-8", error.to_string()),
        }
    }

    fn wide(self, kind: ValueType) -> Result<[u8; 16], Fault> {
        let field = self.field;
        let bytes = self.payload(kind)?.bytes;
        match (bytes.try_into(), bytes.len()) {
            (Ok(bytes), _) => Ok(bytes),
            (Err(_), 0) => Ok([0; 16]),
            (Err(_), len) => Self::malformed(field, "16 bytes", format!("{len} bytes")),
        }
    }

    /// The message that this value is, if one must come now.
    fn message(&self) -> Option<&'p Message> {
        match self.field.kind {
            ValueType::Message(id) if self.expect() == Card::Single => {
                Some(&self.flat.messages[id])
            }
            _ => None,
        }
    }

    fn is_shape(&self, shape: Shape) -> bool {
        self.message().is_some_and(|message| message.shape == shape)
    }

    /// Opens the message that this value is.
    fn open(self, shape: Shape) -> Result<Reader<'p, 'b>, Fault> {
        let Some(message) = self.message().filter(|message| message.shape == shape) else {
            return self.mismatch(&shape.to_string());
        };
        if self.depth >= MAX_DEPTH {
            return Err(DecodeError::TooDeep { limit: MAX_DEPTH }.into());
        }
        let (flat, depth) = (self.flat, self.depth + 1);
        let kind = self.field.kind;
        let payload = self.payload(kind)?;
        Reader::new(flat, message, payload.bytes, depth)
    }

    /// Reads the one field of a wrapper or newtype.
    fn inner<'s>(reader: &'s mut Reader<'p, 'b>) -> ValueDe<'s, 'p, 'b> {
        ValueDe::member(reader, 0)
    }

    /// Reads a field of an open message.
    fn member<'s>(reader: &'s mut Reader<'p, 'b>, index: usize) -> ValueDe<'s, 'p, 'b> {
        let (flat, depth) = (reader.flat, reader.depth);
        let field = &reader.message.fields[index];
        ValueDe {
            flat,
            field,
            source: Source::Field(reader, index),
            depth,
        }
    }

    fn elements<V: Visitor<'b>>(self, visitor: V) -> Result<V::Value, Fault> {
        if self.expect() == Card::Repeated
            && let Source::Field(reader, index) = self.source
        {
            return visitor.visit_seq(Elements::new(reader, index));
        }
        if !self.is_shape(Shape::Wrapper) {
            return self.mismatch("a sequence");
        }
        let mut reader = self.open(Shape::Wrapper)?;
        if reader.message.fields[0].card != Card::Repeated {
            return ValueDe::inner(&mut reader).mismatch("a sequence");
        }
        visitor.visit_seq(Elements::new(&mut reader, 0))
    }
}

/// Reads a struct, and learns which fields it cannot do without.
fn read_struct<'b, V: Visitor<'b>>(
    mut reader: Reader<'_, 'b>,
    visitor: V,
) -> Result<V::Value, Fault> {
    let message = reader.message;
    let read = visitor.visit_map(Members::new(&mut reader));
    read.map_err(|fault| learn_required(message, fault))
}

/// A field that a struct cannot do without is required from now on.
#[cold]
fn learn_required(message: &Message, fault: Fault) -> Fault {
    let Fault::Missing(name) = fault else {
        return fault;
    };
    match message.fields.iter().find(|field| field.key.name == name) {
        Some(field) => {
            // Another thread may have been faster.
            field.required.store(true, Ordering::Relaxed);
            Fault::Again
        }
        None => Fault::Missing(name),
    }
}

/// One scalar method: the hint, its kind, and how to visit the value.
macro_rules! scalars {
    ($($method:ident, $visit:ident, |$this:ident| $value:expr;)*) => {$(
        fn $method<V: Visitor<'b>>(self, visitor: V) -> Result<V::Value, Fault> {
            let $this = self;
            visitor.$visit($value)
        }
    )*};
}

impl<'b> de::Deserializer<'b> for ValueDe<'_, '_, 'b> {
    type Error = Fault;

    fn is_human_readable(&self) -> bool {
        false
    }

    // Narrow integers are visited wide: serde checks their range.
    scalars! {
        deserialize_bool, visit_bool, |this| this.payload(ValueType::Bool)?.bits != 0;
        deserialize_i8, visit_i64, |this| this.signed(ValueType::I32)?;
        deserialize_i16, visit_i64, |this| this.signed(ValueType::I32)?;
        deserialize_i32, visit_i64, |this| this.signed(ValueType::I32)?;
        deserialize_i64, visit_i64, |this| this.signed(ValueType::I64)?;
        deserialize_i128, visit_i128, |this| i128::from_le_bytes(this.wide(ValueType::I128)?);
        deserialize_u8, visit_u64, |this| this.payload(ValueType::U32)?.bits;
        deserialize_u16, visit_u64, |this| this.payload(ValueType::U32)?.bits;
        deserialize_u32, visit_u64, |this| this.payload(ValueType::U32)?.bits;
        deserialize_u64, visit_u64, |this| this.payload(ValueType::U64)?.bits;
        deserialize_u128, visit_u128, |this| u128::from_le_bytes(this.wide(ValueType::U128)?);
        deserialize_f32, visit_f32, |this| f32::from_bits(this.payload(ValueType::F32)?.bits as u32);
        deserialize_f64, visit_f64, |this| f64::from_bits(this.payload(ValueType::F64)?.bits);
        deserialize_str, visit_borrowed_str, |this| this.text(ValueType::Str)?;
        deserialize_string, visit_borrowed_str, |this| this.text(ValueType::Str)?;
        deserialize_bytes, visit_borrowed_bytes, |this| this.payload(ValueType::Bytes)?.bytes;
        deserialize_byte_buf, visit_borrowed_bytes, |this| this.payload(ValueType::Bytes)?.bytes;
    }

    fn deserialize_char<V: Visitor<'b>>(self, visitor: V) -> Result<V::Value, Fault> {
        let field = self.field;
        let text = self.text(ValueType::Char)?;
        let mut chars = text.chars();
        match (chars.next(), chars.next()) {
            (None, _) => visitor.visit_char('\0'),
            (Some(one), None) => visitor.visit_char(one),
            _ => Self::malformed(field, "one character", format!("{text:?}")),
        }
    }

    fn deserialize_any<V: Visitor<'b>>(self, _visitor: V) -> Result<V::Value, Fault> {
        self.mismatch("anything")
    }

    fn deserialize_identifier<V: Visitor<'b>>(self, _visitor: V) -> Result<V::Value, Fault> {
        self.mismatch("a name")
    }

    fn deserialize_ignored_any<V: Visitor<'b>>(self, visitor: V) -> Result<V::Value, Fault> {
        visitor.visit_unit()
    }

    fn deserialize_option<V: Visitor<'b>>(self, visitor: V) -> Result<V::Value, Fault> {
        let (flat, field, depth) = (self.flat, self.field, self.depth);
        if self.expect() == Card::Optional
            && let Source::Field(reader, index) = self.source
        {
            return match reader.take_last(index)? {
                None => visitor.visit_none(),
                Some(payload) => {
                    let source = Source::Payload(payload);
                    visitor.visit_some(ValueDe {
                        flat,
                        field,
                        source,
                        depth,
                    })
                }
            };
        }
        if !self.is_shape(Shape::Wrapper) {
            return self.mismatch("an option");
        }
        let mut reader = self.open(Shape::Wrapper)?;
        let inner = ValueDe::inner(&mut reader);
        if inner.expect() != Card::Optional {
            return inner.mismatch("an option");
        }
        inner.deserialize_option(visitor)
    }

    fn deserialize_unit<V: Visitor<'b>>(self, visitor: V) -> Result<V::Value, Fault> {
        self.open(Shape::Unit)?;
        visitor.visit_unit()
    }

    fn deserialize_unit_struct<V: Visitor<'b>>(
        self,
        _name: &'static str,
        visitor: V,
    ) -> Result<V::Value, Fault> {
        self.deserialize_unit(visitor)
    }

    fn deserialize_newtype_struct<V: Visitor<'b>>(
        self,
        _name: &'static str,
        visitor: V,
    ) -> Result<V::Value, Fault> {
        if self.is_shape(Shape::Newtype) {
            let mut reader = self.open(Shape::Newtype)?;
            return visitor.visit_newtype_struct(ValueDe::inner(&mut reader));
        }
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_seq<V: Visitor<'b>>(self, visitor: V) -> Result<V::Value, Fault> {
        self.elements(visitor)
    }

    fn deserialize_tuple<V: Visitor<'b>>(self, _len: usize, visitor: V) -> Result<V::Value, Fault> {
        if self.is_shape(Shape::Tuple) {
            let mut reader = self.open(Shape::Tuple)?;
            return visitor.visit_seq(Members::new(&mut reader));
        }
        self.elements(visitor)
    }

    fn deserialize_tuple_struct<V: Visitor<'b>>(
        self,
        _name: &'static str,
        _len: usize,
        visitor: V,
    ) -> Result<V::Value, Fault> {
        visitor.visit_seq(Members::new(&mut self.open(Shape::Tuple)?))
    }

    fn deserialize_map<V: Visitor<'b>>(self, visitor: V) -> Result<V::Value, Fault> {
        if self.expect() == Card::Map
            && let Source::Field(reader, index) = self.source
        {
            return visitor.visit_map(Entries::new(reader, index));
        }
        if !self.is_shape(Shape::Wrapper) {
            return self.mismatch("a map");
        }
        let mut reader = self.open(Shape::Wrapper)?;
        if reader.message.fields[0].card != Card::Map {
            return ValueDe::inner(&mut reader).mismatch("a map");
        }
        visitor.visit_map(Entries::new(&mut reader, 0))
    }

    fn deserialize_struct<V: Visitor<'b>>(
        self,
        _name: &'static str,
        _fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Fault> {
        read_struct(self.open(Shape::Struct)?, visitor)
    }

    fn deserialize_enum<V: Visitor<'b>>(
        self,
        name: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Fault> {
        if let ValueType::Enum(id) = self.field.kind {
            let enumeration = &self.flat.enums[id];
            let number = self.payload(ValueType::Enum(id))?.bits;
            let value = usize::try_from(number)
                .ok()
                .and_then(|at| enumeration.values.get(at));
            let Some(value) = value else {
                let (name, last) = (enumeration.name.clone(), enumeration.values.len() - 1);
                return Err(DecodeError::UnknownVariant { name, number, last }.into());
            };
            return visitor.visit_enum(Number {
                name: value.key.name,
            });
        }
        if self.is_shape(Shape::Wrapper) {
            let mut reader = self.open(Shape::Wrapper)?;
            let inner = ValueDe::inner(&mut reader);
            return match inner.field.kind {
                ValueType::Enum(_) => inner.deserialize_enum(name, variants, visitor),
                _ => inner.mismatch("an enum"),
            };
        }
        let mut reader = self.open(Shape::Oneof)?;
        match reader.take_any()? {
            Some((index, payload)) => visitor.visit_enum(OneVariant {
                reader,
                index,
                payload,
            }),
            None => Err(DecodeError::NoVariant {
                name: reader.message.name.clone(),
            }
            .into()),
        }
    }
}
