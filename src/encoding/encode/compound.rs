//! The open ends of a value being encoded: messages, sequences and maps.

use std::sync::atomic::Ordering;

use serde::ser::{self, Serialize};

use super::super::error::EncodeError;
use super::super::flat::{Card, Field, FlatSchema, Message, ValueType};
use super::super::wire;
use super::{Fault, NONE, Position, ValueSer, begin, finish, widen};

/// A message whose fields are being written.
pub(super) struct Compound<'a, const NOTING: bool> {
    pub(super) flat: &'a FlatSchema,
    pub(super) out: &'a mut Vec<u8>,
    pub(super) message: &'a Message,
    /// The fields that are still to come.
    pub(super) rest: &'a [Field],
    /// Where the content begins.
    pub(super) start: usize,
    /// Where the content of the oneof around it begins.
    pub(super) outer: usize,
    pub(super) depth: u32,
}

impl<'a, const NOTING: bool> Compound<'a, NOTING> {
    #[inline(always)]
    pub(super) fn close(self) -> Result<(), Fault> {
        finish(self.out, self.start);
        finish(self.out, self.outer);
        Ok(())
    }

    /// The one field of a wrapper or newtype.
    pub(super) fn inner(self) -> ValueSer<'a, NOTING> {
        ValueSer::<NOTING>::inside(self.flat, self.out, &self.message.fields[0], self.depth)
    }

    /// The one field of a wrapper or newtype that is closed later.
    #[inline(always)]
    pub(super) fn reborrow_inner(&mut self) -> ValueSer<'_, NOTING> {
        ValueSer::<NOTING>::inside(self.flat, self.out, &self.message.fields[0], self.depth)
    }

    #[inline(always)]
    fn put<T: ?Sized + Serialize>(&mut self, field: &'a Field, value: &T) -> Result<(), Fault> {
        value.serialize(ValueSer::<NOTING>::inside(
            self.flat, self.out, field, self.depth,
        ))
    }

    #[inline(always)]
    fn named<T: ?Sized + Serialize>(&mut self, key: &'static str, value: &T) -> Result<(), Fault> {
        let field = match self.rest.split_first() {
            Some((field, rest)) if field.key.is(key) => {
                self.rest = rest;
                field
            }
            _ => self.find(key)?,
        };
        self.put(field, value)
    }

    /// Finds a field that is not the next one: those between were skipped.
    #[cold]
    fn find(&mut self, key: &'static str) -> Result<&'a Field, Fault> {
        match self
            .message
            .fields
            .iter()
            .position(|field| field.key.name == key)
        {
            Some(position) => {
                self.rest = &self.message.fields[position + 1..];
                Ok(&self.message.fields[position])
            }
            None => Err(self.unknown(key.to_owned())),
        }
    }

    /// Notes that `Serialize` leaves a field out.
    fn left_out(&self, key: &'static str) {
        if !NOTING {
            return;
        }
        let field = self.message.fields.iter().find(|field| field.key.is(key));
        if let Some(field) = field
            && !field.left_out.load(Ordering::Relaxed)
        {
            field.left_out.store(true, Ordering::Relaxed);
        }
    }

    #[cold]
    fn unknown(&self, field: String) -> Fault {
        Box::new(EncodeError::UnknownField {
            message: self.message.name.clone(),
            field,
        })
    }

    #[inline(always)]
    fn positional<T: ?Sized + Serialize>(&mut self, value: &T) -> Result<(), Fault> {
        let Some((field, rest)) = self.rest.split_first() else {
            return Err(self.unknown(self.message.fields.len().to_string()));
        };
        self.rest = rest;
        self.put(field, value)
    }
}

impl<const NOTING: bool> ser::SerializeStruct for Compound<'_, NOTING> {
    type Ok = ();
    type Error = Fault;

    fn skip_field(&mut self, key: &'static str) -> Result<(), Fault> {
        self.left_out(key);
        Ok(())
    }

    #[inline(always)]
    fn serialize_field<T: ?Sized + Serialize>(
        &mut self,
        key: &'static str,
        value: &T,
    ) -> Result<(), Fault> {
        self.named(key, value)
    }

    #[inline(always)]
    fn end(self) -> Result<(), Fault> {
        self.close()
    }
}

impl<const NOTING: bool> ser::SerializeStructVariant for Compound<'_, NOTING> {
    type Ok = ();
    type Error = Fault;

    fn skip_field(&mut self, key: &'static str) -> Result<(), Fault> {
        self.left_out(key);
        Ok(())
    }

    #[inline(always)]
    fn serialize_field<T: ?Sized + Serialize>(
        &mut self,
        key: &'static str,
        value: &T,
    ) -> Result<(), Fault> {
        self.named(key, value)
    }

    #[inline(always)]
    fn end(self) -> Result<(), Fault> {
        self.close()
    }
}

impl<const NOTING: bool> ser::SerializeTupleStruct for Compound<'_, NOTING> {
    type Ok = ();
    type Error = Fault;

    #[inline(always)]
    fn serialize_field<T: ?Sized + Serialize>(&mut self, value: &T) -> Result<(), Fault> {
        self.positional(value)
    }

    #[inline(always)]
    fn end(self) -> Result<(), Fault> {
        self.close()
    }
}

impl<const NOTING: bool> ser::SerializeTupleVariant for Compound<'_, NOTING> {
    type Ok = ();
    type Error = Fault;

    #[inline(always)]
    fn serialize_field<T: ?Sized + Serialize>(&mut self, value: &T) -> Result<(), Fault> {
        self.positional(value)
    }

    #[inline(always)]
    fn end(self) -> Result<(), Fault> {
        self.close()
    }
}

/// A repeated field whose elements are being written.
pub(super) struct SeqSer<'a, const NOTING: bool> {
    flat: &'a FlatSchema,
    out: &'a mut Vec<u8>,
    field: &'a Field,
    kind: ValueType,
    position: Position,
    /// Where the packed elements begin, and how many bytes are kept for their length.
    packed: usize,
    kept: usize,
    /// The length that is written already; that of elements of fixed width is right.
    least: usize,
    /// Where the content of the wrapper around the field begins.
    wrapper: usize,
    depth: u32,
}

impl<'a, const NOTING: bool> SeqSer<'a, NOTING> {
    #[inline(always)]
    pub(super) fn open(
        value: ValueSer<'a, NOTING>,
        len: Option<usize>,
    ) -> Result<SeqSer<'a, NOTING>, Fault> {
        if value.expect() == Card::Repeated {
            return Ok(SeqSer::<NOTING>::begin(value, len, NONE));
        }
        let wrapper = value.open_wrapper("a sequence")?;
        let start = wrapper.start;
        let inner = wrapper.inner();
        if inner.expect() != Card::Repeated {
            return inner.mismatch("a sequence");
        }
        Ok(SeqSer::<NOTING>::begin(inner, len, start))
    }

    #[inline(always)]
    fn begin(
        value: ValueSer<'a, NOTING>,
        len: Option<usize>,
        wrapper: usize,
    ) -> SeqSer<'a, NOTING> {
        let ValueSer {
            flat,
            out,
            field,
            depth,
            ..
        } = value;
        let (mut packed, mut kept, mut least) = (NONE, 0, 0);
        if field.packed {
            // Elements take at least their width, or one byte: a good guess of the length's size
            // spares moving them later.
            let width = field.kind.width().unwrap_or(1);
            least = len.unwrap_or(0).saturating_mul(width);
            // A caller may claim any length.
            out.reserve(least.min(1 << 16) + 16);
            let before = out.len() + field.tag.len();
            wire::put_varint(out, field.tag, least as u64);
            packed = out.len();
            kept = packed - before;
        }
        let position = if field.packed {
            Position::Packed
        } else {
            Position::Tagged
        };
        let kind = field.kind;
        SeqSer {
            flat,
            out,
            field,
            kind,
            position,
            packed,
            kept,
            least,
            wrapper,
            depth,
        }
    }

    #[inline(always)]
    fn element<T: ?Sized + Serialize>(&mut self, value: &T) -> Result<(), Fault> {
        value.serialize(ValueSer::<NOTING> {
            flat: self.flat,
            out: self.out,
            field: self.field,
            first: self.kind,
            position: self.position,
            depth: self.depth,
        })
    }

    #[inline(always)]
    fn close(self) -> Result<(), Fault> {
        if self.packed != NONE {
            let len = self.out.len() - self.packed;
            if len == 0 {
                self.out
                    .truncate(self.packed - self.kept - self.field.tag.len());
            } else if len < 0x80 && self.kept == 1 {
                self.out[self.packed - 1] = len as u8;
            } else if self.least != len {
                widen(self.out, self.packed, self.kept, len);
            }
        }
        finish(self.out, self.wrapper);
        Ok(())
    }
}

impl<const NOTING: bool> ser::SerializeSeq for SeqSer<'_, NOTING> {
    type Ok = ();
    type Error = Fault;

    #[inline(always)]
    fn serialize_element<T: ?Sized + Serialize>(&mut self, value: &T) -> Result<(), Fault> {
        self.element(value)
    }

    #[inline(always)]
    fn end(self) -> Result<(), Fault> {
        self.close()
    }
}

/// A tuple: repeated where all its elements have one type, a message otherwise.
pub(super) enum TupleSer<'a, const NOTING: bool> {
    Alike(SeqSer<'a, NOTING>),
    Mixed(Compound<'a, NOTING>),
}

impl<const NOTING: bool> ser::SerializeTuple for TupleSer<'_, NOTING> {
    type Ok = ();
    type Error = Fault;

    #[inline(always)]
    fn serialize_element<T: ?Sized + Serialize>(&mut self, value: &T) -> Result<(), Fault> {
        match self {
            TupleSer::Alike(seq) => seq.element(value),
            TupleSer::Mixed(message) => message.positional(value),
        }
    }

    #[inline(always)]
    fn end(self) -> Result<(), Fault> {
        match self {
            TupleSer::Alike(seq) => seq.close(),
            TupleSer::Mixed(message) => message.close(),
        }
    }
}

/// Where one entry of a map lies in the buffer.
#[derive(Clone, Copy)]
struct EntrySpan {
    tag: usize,
    key: usize,
    key_end: usize,
    end: usize,
}

/// A map whose entries are being written.
pub(super) struct MapSer<'a, const NOTING: bool> {
    flat: &'a FlatSchema,
    out: &'a mut Vec<u8>,
    field: &'a Field,
    entry: &'a Message,
    /// Where the entries are, to sort them by encoded key at the end.
    spans: Vec<EntrySpan>,
    /// Where the open entry begins: at its tag, and at its key.
    tag: usize,
    key: usize,
    key_end: usize,
    wrapper: usize,
    depth: u32,
}

impl<'a, const NOTING: bool> MapSer<'a, NOTING> {
    #[inline(always)]
    pub(super) fn open(value: ValueSer<'a, NOTING>) -> Result<MapSer<'a, NOTING>, Fault> {
        let (value, wrapper) = if value.expect() == Card::Map {
            (value, NONE)
        } else {
            let wrapper = value.open_wrapper("a map")?;
            let start = wrapper.start;
            (wrapper.inner(), start)
        };
        let ValueType::Message(entry) = value.field.kind else {
            return value.mismatch("a map");
        };
        if value.expect() != Card::Map {
            return value.mismatch("a map");
        }
        let ValueSer {
            flat,
            out,
            field,
            depth,
            ..
        } = value;
        let entry = &flat.messages[entry];
        let (spans, tag, key, key_end) = (Vec::new(), NONE, NONE, NONE);
        Ok(MapSer {
            flat,
            out,
            field,
            entry,
            spans,
            tag,
            key,
            key_end,
            wrapper,
            depth,
        })
    }

    fn sort(&mut self) {
        let out = &*self.out;
        let key = |span: &EntrySpan| &out[span.key..span.key_end];
        if self.spans.is_sorted_by(|a, b| key(a) <= key(b)) {
            return;
        }
        let begin = self.spans[0].tag;
        self.spans.sort_by(|a, b| key(a).cmp(key(b)));
        let mut sorted = Vec::with_capacity(out.len() - begin);
        for span in &self.spans {
            sorted.extend_from_slice(&out[span.tag..span.end]);
        }
        self.out[begin..].copy_from_slice(&sorted);
    }
}

impl<const NOTING: bool> ser::SerializeMap for MapSer<'_, NOTING> {
    type Ok = ();
    type Error = Fault;

    #[inline(always)]
    fn serialize_key<T: ?Sized + Serialize>(&mut self, key: &T) -> Result<(), Fault> {
        self.tag = self.out.len();
        self.key = begin(self.out, self.field.tag);
        let field = &self.entry.fields[0];
        key.serialize(ValueSer::<NOTING>::inside(
            self.flat,
            self.out,
            field,
            self.depth + 1,
        ))?;
        self.key_end = self.out.len();
        Ok(())
    }

    #[inline(always)]
    fn serialize_value<T: ?Sized + Serialize>(&mut self, value: &T) -> Result<(), Fault> {
        let field = &self.entry.fields[1];
        value.serialize(ValueSer::<NOTING>::inside(
            self.flat,
            self.out,
            field,
            self.depth + 1,
        ))?;
        let before = self.out.len();
        finish(self.out, self.key);
        let moved = self.out.len() - before;
        self.spans.push(EntrySpan {
            tag: self.tag,
            key: self.key + moved,
            key_end: self.key_end + moved,
            end: self.out.len(),
        });
        Ok(())
    }

    #[inline(always)]
    fn end(mut self) -> Result<(), Fault> {
        self.sort();
        finish(self.out, self.wrapper);
        Ok(())
    }
}
