//! What the decoder hands to visitors: members, elements, entries and variants.

use std::sync::atomic::Ordering;

use serde::de::{self, DeserializeSeed, IntoDeserializer, Visitor};

use super::super::flat::{Card, Shape};
use super::super::wire::{Payload, Wire, take_payload};
use super::reader::Reader;
use super::{DecodeError, Fault, Source, ValueDe, read_struct};

fn read_name<'b, S: DeserializeSeed<'b>>(name: &'static str, seed: S) -> Result<S::Value, Fault> {
    seed.deserialize(IntoDeserializer::<Fault>::into_deserializer(name))
}

/// The members of a struct or tuple.
pub(super) struct Members<'r, 'p, 'b> {
    reader: &'r mut Reader<'p, 'b>,
    next: usize,
}

impl<'r, 'p, 'b> Members<'r, 'p, 'b> {
    pub(super) fn new(reader: &'r mut Reader<'p, 'b>) -> Members<'r, 'p, 'b> {
        Members { reader, next: 0 }
    }

    /// The name of the next field that is given.
    fn next_name(&mut self) -> Result<Option<&'static str>, Fault> {
        let message = self.reader.message;
        while let Some(field) = message.fields.get(self.next) {
            // Absence of one value is left to serde's default until the type turns out to have
            // none. Absence of an option or collection says that it is empty.
            let given = field.required.load(Ordering::Relaxed)
                || !message.withheld.load(Ordering::Relaxed)
                    && (field.card != Card::Single || self.reader.has(self.next)?);
            if given {
                return Ok(Some(field.key.name));
            }
            self.next += 1;
        }
        Ok(None)
    }
}

impl<'b> de::MapAccess<'b> for Members<'_, '_, 'b> {
    type Error = Fault;

    fn next_key_seed<K: DeserializeSeed<'b>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, Fault> {
        match self.next_name()? {
            Some(name) => read_name(name, seed).map(Some),
            None => Ok(None),
        }
    }

    fn next_value_seed<S: DeserializeSeed<'b>>(&mut self, seed: S) -> Result<S::Value, Fault> {
        self.next += 1;
        seed.deserialize(ValueDe::member(self.reader, self.next - 1))
    }
}

impl<'b> de::SeqAccess<'b> for Members<'_, '_, 'b> {
    type Error = Fault;

    fn next_element_seed<S: DeserializeSeed<'b>>(
        &mut self,
        seed: S,
    ) -> Result<Option<S::Value>, Fault> {
        if self.next == self.reader.message.fields.len() {
            return Ok(None);
        }
        self.next += 1;
        seed.deserialize(ValueDe::member(self.reader, self.next - 1))
            .map(Some)
    }
}

/// The elements of a repeated field, packed or not.
pub(super) struct Elements<'r, 'p, 'b> {
    reader: &'r mut Reader<'p, 'b>,
    index: usize,
    packed: &'b [u8],
}

impl<'r, 'p, 'b> Elements<'r, 'p, 'b> {
    pub(super) fn new(reader: &'r mut Reader<'p, 'b>, index: usize) -> Elements<'r, 'p, 'b> {
        Elements {
            reader,
            index,
            packed: &[],
        }
    }

    #[inline(always)]
    fn next(&mut self) -> Result<Option<Payload<'b>>, Fault> {
        let field = &self.reader.message.fields[self.index];
        while self.packed.is_empty() {
            let Some(payload) = self.reader.take(self.index)? else {
                return Ok(None);
            };
            // Writers may choose to pack or not, and readers must take both.
            if !field.packed || payload.wire != Wire::Bytes {
                return Ok(Some(payload));
            }
            self.packed = payload.bytes;
        }
        let mut pos = 0;
        match take_payload(self.packed, &mut pos, field.kind.wire()) {
            Ok(payload) => {
                self.packed = &self.packed[pos..];
                Ok(Some(payload))
            }
            Err(reason) => {
                let expected = "whole elements";
                ValueDe::malformed(field, expected, format!("{reason:?}"))
            }
        }
    }
}

impl<'b> de::SeqAccess<'b> for Elements<'_, '_, 'b> {
    type Error = Fault;

    fn next_element_seed<S: DeserializeSeed<'b>>(
        &mut self,
        seed: S,
    ) -> Result<Option<S::Value>, Fault> {
        let Some(payload) = self.next()? else {
            return Ok(None);
        };
        let (flat, depth) = (self.reader.flat, self.reader.depth);
        let field = &self.reader.message.fields[self.index];
        seed.deserialize(ValueDe {
            flat,
            field,
            source: Source::Payload(payload),
            depth,
        })
        .map(Some)
    }

    fn size_hint(&self) -> Option<usize> {
        // A hint must not exceed what the bytes can hold: visitors allocate by it.
        let field = &self.reader.message.fields[self.index];
        let width = field.kind.width()?;
        Some((self.packed.len() + self.reader.left()) / width)
    }
}

/// The entries of a map.
pub(super) struct Entries<'r, 'p, 'b> {
    reader: &'r mut Reader<'p, 'b>,
    index: usize,
    entry: Option<Reader<'p, 'b>>,
}

impl<'r, 'p, 'b> Entries<'r, 'p, 'b> {
    pub(super) fn new(reader: &'r mut Reader<'p, 'b>, index: usize) -> Entries<'r, 'p, 'b> {
        Entries {
            reader,
            index,
            entry: None,
        }
    }

    fn open(&mut self, payload: Payload<'b>) -> Result<&mut Reader<'p, 'b>, Fault> {
        let (flat, depth) = (self.reader.flat, self.reader.depth);
        let field = &self.reader.message.fields[self.index];
        let value = ValueDe {
            flat,
            field,
            source: Source::Payload(payload),
            depth,
        };
        Ok(self.entry.insert(value.open(Shape::Entry)?))
    }
}

impl<'b> de::MapAccess<'b> for Entries<'_, '_, 'b> {
    type Error = Fault;

    fn next_key_seed<K: DeserializeSeed<'b>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, Fault> {
        let Some(payload) = self.reader.take(self.index)? else {
            return Ok(None);
        };
        let entry = self.open(payload)?;
        seed.deserialize(ValueDe::member(entry, 0)).map(Some)
    }

    fn next_value_seed<S: DeserializeSeed<'b>>(&mut self, seed: S) -> Result<S::Value, Fault> {
        match &mut self.entry {
            Some(entry) => seed.deserialize(ValueDe::member(entry, 1)),
            None => Err(Fault::Custom(
                "a map's value was asked for before its key".to_owned(),
            )),
        }
    }
}

/// A variant of a plain enum.
pub(super) struct Number {
    pub(super) name: &'static str,
}

impl<'b> de::EnumAccess<'b> for Number {
    type Error = Fault;
    type Variant = Number;

    fn variant_seed<S: DeserializeSeed<'b>>(self, seed: S) -> Result<(S::Value, Number), Fault> {
        Ok((read_name(self.name, seed)?, self))
    }
}

impl Number {
    fn mismatch<T>(self, actual: &str) -> Result<T, Fault> {
        let place = self.name.to_owned();
        let expected = "a unit variant".to_owned();
        Err(DecodeError::Mismatch {
            place,
            expected,
            actual: actual.to_owned(),
        }
        .into())
    }
}

impl<'b> de::VariantAccess<'b> for Number {
    type Error = Fault;

    fn unit_variant(self) -> Result<(), Fault> {
        Ok(())
    }

    fn newtype_variant_seed<S: DeserializeSeed<'b>>(self, _seed: S) -> Result<S::Value, Fault> {
        self.mismatch("a newtype variant")
    }

    fn tuple_variant<V: Visitor<'b>>(self, _len: usize, _visitor: V) -> Result<V::Value, Fault> {
        self.mismatch("a tuple variant")
    }

    fn struct_variant<V: Visitor<'b>>(
        self,
        _fields: &'static [&'static str],
        _visitor: V,
    ) -> Result<V::Value, Fault> {
        self.mismatch("a struct variant")
    }
}

/// A variant of an enum with data.
pub(super) struct OneVariant<'p, 'b> {
    pub(super) reader: Reader<'p, 'b>,
    pub(super) index: usize,
    pub(super) payload: Payload<'b>,
}

impl<'p, 'b> OneVariant<'p, 'b> {
    fn value(&self) -> ValueDe<'_, 'p, 'b> {
        let (flat, depth) = (self.reader.flat, self.reader.depth);
        let field = &self.reader.message.fields[self.index];
        ValueDe {
            flat,
            field,
            source: Source::Payload(self.payload),
            depth,
        }
    }
}

impl<'p, 'b> de::EnumAccess<'b> for OneVariant<'p, 'b> {
    type Error = Fault;
    type Variant = OneVariant<'p, 'b>;

    fn variant_seed<S: DeserializeSeed<'b>>(
        self,
        seed: S,
    ) -> Result<(S::Value, OneVariant<'p, 'b>), Fault> {
        let name = self.reader.message.fields[self.index].key.name;
        Ok((read_name(name, seed)?, self))
    }
}

impl<'b> de::VariantAccess<'b> for OneVariant<'_, 'b> {
    type Error = Fault;

    fn unit_variant(self) -> Result<(), Fault> {
        self.value().open(Shape::Unit).map(drop)
    }

    fn newtype_variant_seed<S: DeserializeSeed<'b>>(self, seed: S) -> Result<S::Value, Fault> {
        seed.deserialize(self.value())
    }

    fn tuple_variant<V: Visitor<'b>>(self, _len: usize, visitor: V) -> Result<V::Value, Fault> {
        visitor.visit_seq(Members::new(&mut self.value().open(Shape::Tuple)?))
    }

    fn struct_variant<V: Visitor<'b>>(
        self,
        _fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Fault> {
        read_struct(self.value().open(Shape::Struct)?, visitor)
    }
}
