//! A serde `Serializer` that writes protobuf in one pass, straight into the caller's buffer.
//!
//! The flat schema is walked beside the value: each call of `Serialize` finds its field by
//! position, so that nothing is looked up and nothing is allocated. A nested message gets one byte
//! for its length, which is widened once the length is known to need more.

use serde::ser::{self, Serialize};

use super::error::EncodeError;
use super::flat::{Card, Field, FlatSchema, Key, MAX_DEPTH, Message, Shape, ValueType};
use super::wire::{self, Tag};

mod compound;

use compound::{Compound, MapSer, SeqSer, TupleSer};

/// Boxed, so that the `Result` of every call fits a register.
type Fault = Box<EncodeError>;

impl ser::Error for Fault {
    fn custom<T: std::fmt::Display>(message: T) -> Self {
        Box::new(EncodeError::Custom(message.to_string()))
    }
}

/// Appends `value` to `out`; on an error `out` is left as it was.
pub(super) fn encode<T: Serialize + ?Sized>(
    flat: &FlatSchema,
    value: &T,
    out: &mut Vec<u8>,
) -> Result<(), EncodeError> {
    encode_as::<T, false>(flat, value, out)
}

/// As [`encode`], and notes in the schema which fields `Serialize` leaves out.
pub(super) fn encode_noting<T: Serialize + ?Sized>(
    flat: &FlatSchema,
    value: &T,
    out: &mut Vec<u8>,
) -> Result<(), EncodeError> {
    encode_as::<T, true>(flat, value, out)
}

/// Both ways are code of their own: a type's `Serialize` that has one caller is inlined there, and
/// small messages are written without a call.
#[inline]
fn encode_as<T: Serialize + ?Sized, const NOTING: bool>(
    flat: &FlatSchema,
    value: &T,
    out: &mut Vec<u8>,
) -> Result<(), EncodeError> {
    let start = out.len();
    let mut writer = Writer {
        flat,
        out,
        depth: 0,
    };
    let root = ValueSer::<NOTING> {
        to: &mut writer,
        field: &flat.root,
    };
    match value.serialize(root) {
        Ok(()) => Ok(()),
        Err(fault) => {
            out.truncate(start);
            Err(*fault)
        }
    }
}

/// Stands for "nothing is open here" among offsets.
const NONE: usize = usize::MAX;

/// Where values are written, and by which schema.
struct Writer<'s> {
    flat: &'s FlatSchema,
    out: &'s mut Vec<u8>,
    /// How many messages are open around the value in hand.
    depth: u32,
}

/// Writes one value of one field: two words, which pass in registers. What goes before the value
/// is the field's: a tag, or nothing at the root and for one of many in a packed field.
struct ValueSer<'w, 's, const NOTING: bool> {
    to: &'w mut Writer<'s>,
    field: &'s Field,
}

impl<'w, 's, const NOTING: bool> ValueSer<'w, 's, NOTING> {
    /// A value of a field of a message that is open, as one of so many.
    #[inline(always)]
    fn inside(to: &'w mut Writer<'s>, field: &'s Field, depth: u32) -> Self {
        to.depth = depth;
        ValueSer { to, field }
    }

    #[inline(always)]
    fn is(&self, kind: ValueType) -> bool {
        self.field.first == kind
    }

    /// The cardinality that must come first.
    #[inline(always)]
    fn expect(&self) -> Card {
        if self.field.first == ValueType::Pending {
            self.field.card
        } else {
            Card::Single
        }
    }

    /// The field for what an option holds, if one must come now.
    #[inline(always)]
    fn optional(&self) -> Option<&'s Field> {
        match self.field.card {
            Card::Optional => self.field.element.as_deref(),
            _ => None,
        }
    }

    #[cold]
    #[inline(never)]
    fn mismatch<T>(&self, actual: impl std::fmt::Display) -> Result<T, Fault> {
        Err(Box::new(EncodeError::Mismatch {
            place: self.field.place.clone(),
            expected: self.to.flat.describe(self.field, self.expect()),
            actual: actual.to_string(),
        }))
    }

    #[inline(always)]
    fn varint(self, kind: ValueType, value: u64) -> Result<(), Fault> {
        if !self.is(kind) {
            return self.mismatch(format_args!("{kind:?}"));
        }
        wire::put_varint(self.to.out, self.field.tag, value);
        Ok(())
    }

    #[inline(always)]
    fn bytes(self, kind: ValueType, bytes: &[u8]) -> Result<(), Fault> {
        if !self.is(kind) {
            return self.mismatch(format_args!("{kind:?}"));
        }
        wire::put_bytes(self.to.out, self.field.tag, bytes);
        Ok(())
    }

    /// Writes a variant of a plain enum.
    #[inline]
    fn number(self, index: u32, variant: &'static str) -> Result<(), Fault> {
        let ValueType::Enum(id) = self.field.first else {
            return self.mismatch("a unit variant");
        };
        let enumeration = &self.to.flat.enums[id];
        match position(&enumeration.values, |value| &value.key, index, variant) {
            Some(number) => self.varint(ValueType::Enum(id), number as u64),
            None => Err(unknown_variant(&enumeration.name, variant)),
        }
    }

    /// The message that a value of this field is, if one must come now.
    #[inline(always)]
    fn message(&self) -> Option<&'s Message> {
        match self.field.first {
            ValueType::Message(id) => Some(&self.to.flat.messages[id]),
            _ => None,
        }
    }

    /// Opens the message that this value is.
    #[inline(always)]
    fn open(self, shape: Shape) -> Result<Compound<'w, 's, NOTING>, Fault> {
        let message = match self.message() {
            Some(message) if message.shape == shape => message,
            _ => return self.mismatch(shape),
        };
        let depth = self.to.depth;
        if depth >= MAX_DEPTH {
            return Err(too_deep());
        }
        // The root has neither tag nor length.
        let start = if self.field.tag.len() == 0 {
            NONE
        } else {
            begin(self.to.out, self.field.tag)
        };
        Ok(Compound {
            to: self.to,
            message,
            rest: &message.fields,
            start,
            outer: NONE,
            depth: depth + 1,
        })
    }

    /// Opens the helper that stands around an option or collection here.
    fn open_wrapper(self, actual: &'static str) -> Result<Compound<'w, 's, NOTING>, Fault> {
        match self.message() {
            Some(message) if message.shape == Shape::Wrapper => self.open(Shape::Wrapper),
            _ => self.mismatch(actual),
        }
    }

    /// Opens the oneof message of a data enum; its one field is the variant's.
    #[inline]
    fn open_variant(
        self,
        index: u32,
        variant: &'static str,
    ) -> Result<(Compound<'w, 's, NOTING>, &'s Field), Fault> {
        let oneof = self.open(Shape::Oneof)?;
        let fields = &oneof.message.fields;
        let found = position(fields, |field| &field.key, index, variant);
        let Some(found) = found else {
            return Err(unknown_variant(&oneof.message.name, variant));
        };
        Ok((oneof, &fields[found]))
    }

    /// Opens a variant's own content within the oneof.
    #[inline]
    fn open_content(
        self,
        index: u32,
        variant: &'static str,
        shape: Shape,
    ) -> Result<Compound<'w, 's, NOTING>, Fault> {
        let (oneof, field) = self.open_variant(index, variant)?;
        let Compound {
            to, start, depth, ..
        } = oneof;
        let mut content = ValueSer::<NOTING>::inside(to, field, depth).open(shape)?;
        content.outer = start;
        Ok(content)
    }
}

/// The position of a variant. `Serialize` counts variants that `Deserialize` skips, and
/// `Deserialize` lists aliases: the name decides, the index is where to look first.
#[inline(always)]
fn position<T>(
    all: &[T],
    key: impl Fn(&T) -> &Key,
    index: u32,
    variant: &'static str,
) -> Option<usize> {
    let index = index as usize;
    match all.get(index) {
        Some(one) if key(one).is(variant) => Some(index),
        _ => all.iter().position(|one| key(one).name == variant),
    }
}

#[cold]
fn too_deep() -> Fault {
    Box::new(EncodeError::TooDeep { limit: MAX_DEPTH })
}

#[cold]
fn unknown_variant(name: &str, variant: &str) -> Fault {
    Box::new(EncodeError::UnknownVariant {
        name: name.to_owned(),
        variant: variant.to_owned(),
    })
}

/// Writes a tag and keeps one byte for a length; the answer goes to [`finish`].
#[inline(always)]
fn begin(out: &mut Vec<u8>, tag: Tag) -> usize {
    wire::put_varint(out, tag, 0);
    out.len()
}

/// Writes the length of what follows `start`.
#[inline(always)]
fn finish(out: &mut Vec<u8>, start: usize) {
    if start == NONE {
        return;
    }
    let len = out.len() - start;
    if len < 0x80 {
        out[start - 1] = len as u8;
    } else {
        widen(out, start, 1, len);
    }
}

/// Makes room for a longer (or shorter) length than the `kept` bytes before `start`, and writes it.
#[inline(never)]
fn widen(out: &mut Vec<u8>, start: usize, kept: usize, len: usize) {
    let needed = wire::varint_len(len as u64);
    let end = start + len;
    let moved = start - kept + needed;
    if moved > start {
        out.resize(end + (moved - start), 0);
    }
    out.copy_within(start..end, moved);
    out.truncate(moved + len);
    let mut rest = len;
    for (at, byte) in out[start - kept..moved].iter_mut().enumerate() {
        let more = if at + 1 < needed { 0x80 } else { 0 };
        *byte = (rest & 0x7f) as u8 | more;
        rest >>= 7;
    }
}

/// The bits of the one NaN that is ever written, or of `value`.
#[inline(always)]
fn canonical64(value: f64) -> u64 {
    if value.is_nan() {
        0x7ff8_0000_0000_0000
    } else {
        value.to_bits()
    }
}

#[inline(always)]
fn canonical32(value: f32) -> u32 {
    if value.is_nan() {
        0x7fc0_0000
    } else {
        value.to_bits()
    }
}

impl<'w, 's, const NOTING: bool> ser::Serializer for ValueSer<'w, 's, NOTING> {
    type Ok = ();
    type Error = Fault;
    type SerializeSeq = SeqSer<'w, 's, NOTING>;
    type SerializeTuple = TupleSer<'w, 's, NOTING>;
    type SerializeTupleStruct = Compound<'w, 's, NOTING>;
    type SerializeTupleVariant = Compound<'w, 's, NOTING>;
    type SerializeMap = MapSer<'w, 's, NOTING>;
    type SerializeStruct = Compound<'w, 's, NOTING>;
    type SerializeStructVariant = Compound<'w, 's, NOTING>;

    fn is_human_readable(&self) -> bool {
        false
    }

    #[inline(always)]
    fn serialize_bool(self, v: bool) -> Result<(), Fault> {
        self.varint(ValueType::Bool, u64::from(v))
    }

    #[inline(always)]
    fn serialize_i8(self, v: i8) -> Result<(), Fault> {
        self.varint(ValueType::I32, i64::from(v) as u64)
    }

    #[inline(always)]
    fn serialize_i16(self, v: i16) -> Result<(), Fault> {
        self.varint(ValueType::I32, i64::from(v) as u64)
    }

    #[inline(always)]
    fn serialize_i32(self, v: i32) -> Result<(), Fault> {
        self.varint(ValueType::I32, i64::from(v) as u64)
    }

    #[inline(always)]
    fn serialize_i64(self, v: i64) -> Result<(), Fault> {
        self.varint(ValueType::I64, v as u64)
    }

    fn serialize_i128(self, v: i128) -> Result<(), Fault> {
        self.bytes(ValueType::I128, &v.to_le_bytes())
    }

    #[inline(always)]
    fn serialize_u8(self, v: u8) -> Result<(), Fault> {
        self.varint(ValueType::U32, u64::from(v))
    }

    #[inline(always)]
    fn serialize_u16(self, v: u16) -> Result<(), Fault> {
        self.varint(ValueType::U32, u64::from(v))
    }

    #[inline(always)]
    fn serialize_u32(self, v: u32) -> Result<(), Fault> {
        self.varint(ValueType::U32, u64::from(v))
    }

    #[inline(always)]
    fn serialize_u64(self, v: u64) -> Result<(), Fault> {
        self.varint(ValueType::U64, v)
    }

    fn serialize_u128(self, v: u128) -> Result<(), Fault> {
        self.bytes(ValueType::U128, &v.to_le_bytes())
    }

    #[inline(always)]
    fn serialize_f32(self, v: f32) -> Result<(), Fault> {
        if !self.is(ValueType::F32) {
            return self.mismatch("f32");
        }
        wire::put_fixed32(self.to.out, self.field.tag, canonical32(v));
        Ok(())
    }

    #[inline(always)]
    fn serialize_f64(self, v: f64) -> Result<(), Fault> {
        if !self.is(ValueType::F64) {
            return self.mismatch("f64");
        }
        wire::put_fixed64(self.to.out, self.field.tag, canonical64(v));
        Ok(())
    }

    fn serialize_char(self, v: char) -> Result<(), Fault> {
        self.bytes(ValueType::Char, v.encode_utf8(&mut [0; 4]).as_bytes())
    }

    #[inline(always)]
    fn serialize_str(self, v: &str) -> Result<(), Fault> {
        self.bytes(ValueType::Str, v.as_bytes())
    }

    #[inline(always)]
    fn serialize_bytes(self, v: &[u8]) -> Result<(), Fault> {
        self.bytes(ValueType::Bytes, v)
    }

    fn serialize_none(self) -> Result<(), Fault> {
        if self.optional().is_some() {
            return Ok(());
        }
        let wrapper = self.open_wrapper("an option")?;
        if wrapper.message.fields[0].card != Card::Optional {
            return wrapper.inner().mismatch("an option");
        }
        wrapper.close()
    }

    #[inline(always)]
    fn serialize_some<T: ?Sized + Serialize>(self, value: &T) -> Result<(), Fault> {
        if let Some(field) = self.optional() {
            return value.serialize(ValueSer::<NOTING> { to: self.to, field });
        }
        let mut wrapper = self.open_wrapper("an option")?;
        let inner = wrapper.reborrow_inner();
        let Some(field) = inner.optional() else {
            return inner.mismatch("an option");
        };
        value.serialize(ValueSer::<NOTING> {
            to: inner.to,
            field,
        })?;
        wrapper.close()
    }

    fn serialize_unit(self) -> Result<(), Fault> {
        self.open(Shape::Unit)?.close()
    }

    fn serialize_unit_struct(self, _name: &'static str) -> Result<(), Fault> {
        self.open(Shape::Unit)?.close()
    }

    #[inline(always)]
    fn serialize_unit_variant(
        self,
        _name: &'static str,
        index: u32,
        variant: &'static str,
    ) -> Result<(), Fault> {
        if self
            .message()
            .is_some_and(|message| message.shape == Shape::Wrapper)
        {
            // A plain enum at the root: a message must stand around it.
            let mut wrapper = self.open(Shape::Wrapper)?;
            wrapper.reborrow_inner().number(index, variant)?;
            return wrapper.close();
        }
        if let ValueType::Enum(_) = self.field.kind {
            return self.number(index, variant);
        }
        self.open_content(index, variant, Shape::Unit)?.close()
    }

    #[inline(always)]
    fn serialize_newtype_struct<T: ?Sized + Serialize>(
        self,
        _name: &'static str,
        value: &T,
    ) -> Result<(), Fault> {
        if self
            .message()
            .is_some_and(|message| message.shape == Shape::Newtype)
        {
            let mut newtype = self.open(Shape::Newtype)?;
            value.serialize(newtype.reborrow_inner())?;
            return newtype.close();
        }
        // Other newtype structs are what they hold.
        value.serialize(self)
    }

    #[inline(always)]
    fn serialize_newtype_variant<T: ?Sized + Serialize>(
        self,
        _name: &'static str,
        index: u32,
        variant: &'static str,
        value: &T,
    ) -> Result<(), Fault> {
        let (oneof, field) = self.open_variant(index, variant)?;
        value.serialize(ValueSer::<NOTING>::inside(
            &mut *oneof.to,
            field,
            oneof.depth,
        ))?;
        oneof.close()
    }

    #[inline(always)]
    fn serialize_seq(self, len: Option<usize>) -> Result<SeqSer<'w, 's, NOTING>, Fault> {
        SeqSer::<NOTING>::open(self, len)
    }

    #[inline(always)]
    fn serialize_tuple(self, len: usize) -> Result<TupleSer<'w, 's, NOTING>, Fault> {
        match self.message() {
            Some(message) if message.shape == Shape::Tuple => {
                Ok(TupleSer::Mixed(self.open(Shape::Tuple)?))
            }
            _ => Ok(TupleSer::Alike(SeqSer::<NOTING>::open(self, Some(len))?)),
        }
    }

    #[inline]
    fn serialize_tuple_struct(
        self,
        _name: &'static str,
        _len: usize,
    ) -> Result<Compound<'w, 's, NOTING>, Fault> {
        self.open(Shape::Tuple)
    }

    #[inline]
    fn serialize_tuple_variant(
        self,
        _name: &'static str,
        index: u32,
        variant: &'static str,
        _len: usize,
    ) -> Result<Compound<'w, 's, NOTING>, Fault> {
        self.open_content(index, variant, Shape::Tuple)
    }

    #[inline]
    fn serialize_map(self, _len: Option<usize>) -> Result<MapSer<'w, 's, NOTING>, Fault> {
        MapSer::<NOTING>::open(self)
    }

    #[inline(always)]
    fn serialize_struct(
        self,
        _name: &'static str,
        _len: usize,
    ) -> Result<Compound<'w, 's, NOTING>, Fault> {
        self.open(Shape::Struct)
    }

    #[inline(always)]
    fn serialize_struct_variant(
        self,
        _name: &'static str,
        index: u32,
        variant: &'static str,
        _len: usize,
    ) -> Result<Compound<'w, 's, NOTING>, Fault> {
        self.open_content(index, variant, Shape::Struct)
    }
}
