//! The open ends of a value being encoded: messages, sequences and maps.

use std::sync::atomic::Ordering;

use serde::ser::{self, Serialize};

use super::super::error::EncodeError;
use super::super::flat::{Card, Field, Message, ValueType};
use super::super::wire;
use super::{Fault, NONE, ValueSer, Writer, begin, finish, widen};

/// A message whose fields are being written.
pub(super) struct Compound<'w, 's, const NOTING: bool> {
    pub(super) to: &'w mut Writer<'s>,
    pub(super) message: &'s Message,
    /// The fields that are still to come.
    pub(super) rest: &'s [Field],
    /// Where the content begins.
    pub(super) start: usize,
    /// Where the content of the oneof around it begins.
    pub(super) outer: usize,
    pub(super) depth: u32,
}

impl<'w, 's, const NOTING: bool> Compound<'w, 's, NOTING> {
    #[inline(always)]
    pub(super) fn close(self) -> Result<(), Fault> {
        finish(self.to.out, self.start);
        finish(self.to.out, self.outer);
        Ok(())
    }

    /// The one field of a wrapper or newtype.
    pub(super) fn inner(self) -> ValueSer<'w, 's, NOTING> {
        ValueSer::<NOTING>::inside(self.to, &self.message.fields[0], self.depth)
    }

    /// The one field of a wrapper or newtype that is closed later.
    #[inline(always)]
    pub(super) fn reborrow_inner(&mut self) -> ValueSer<'_, 's, NOTING> {
        ValueSer::<NOTING>::inside(self.to, &self.message.fields[0], self.depth)
    }

    #[inline(always)]
    fn put<T: ?Sized + Serialize>(&mut self, field: &'s Field, value: &T) -> Result<(), Fault> {
        value.serialize(ValueSer::<NOTING>::inside(self.to, field, self.depth))
    }

    #[inline(always)]
    fn named<T: ?Sized + Serialize>(&mut self, key: &'static str, value: &T) -> Result<(), Fault> {
        let field = match self.rest.split_first() {
            Some((field, rest)) if field.key.is(key) => {
                self.rest = rest;
                field
            }
            _ => {
                let at = find(self.message, key)?;
                self.rest = &self.message.fields[at + 1..];
                &self.message.fields[at]
            }
        };
        self.put(field, value)
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

    #[inline(always)]
    fn positional<T: ?Sized + Serialize>(&mut self, value: &T) -> Result<(), Fault> {
        let Some((field, rest)) = self.rest.split_first() else {
            return Err(unknown(self.message, self.message.fields.len().to_string()));
        };
        self.rest = rest;
        self.put(field, value)
    }
}

// What is not inlined takes no reference to a `Compound`, which so stays in registers.

/// Finds a field that is not the next one: those between were skipped.
#[cold]
fn find(message: &Message, key: &'static str) -> Result<usize, Fault> {
    let found = message
        .fields
        .iter()
        .position(|field| field.key.name == key);
    found.ok_or_else(|| unknown(message, key.to_owned()))
}

#[cold]
fn unknown(message: &Message, field: String) -> Fault {
    Box::new(EncodeError::UnknownField {
        message: message.name.clone(),
        field,
    })
}

impl<const NOTING: bool> ser::SerializeStruct for Compound<'_, '_, NOTING> {
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

impl<const NOTING: bool> ser::SerializeStructVariant for Compound<'_, '_, NOTING> {
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

impl<const NOTING: bool> ser::SerializeTupleStruct for Compound<'_, '_, NOTING> {
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

impl<const NOTING: bool> ser::SerializeTupleVariant for Compound<'_, '_, NOTING> {
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

/// The field for each element, if this field is a sequence.
#[inline(always)]
fn repeated(field: &Field) -> Option<&Field> {
    match field.card {
        Card::Repeated => field.element.as_deref(),
        _ => None,
    }
}

/// A repeated field whose elements are being written.
pub(super) struct SeqSer<'w, 's, const NOTING: bool> {
    to: &'w mut Writer<'s>,
    field: &'s Field,
    /// How each element is written.
    element: &'s Field,
    /// Where the packed elements begin, and how many bytes are kept for their length.
    packed: usize,
    kept: usize,
    /// The length that is written already; that of elements of fixed width is right.
    least: usize,
    /// Where the content of the wrapper around the field begins.
    wrapper: usize,
    depth: u32,
}

impl<'w, 's, const NOTING: bool> SeqSer<'w, 's, NOTING> {
    #[inline(always)]
    pub(super) fn open(
        value: ValueSer<'w, 's, NOTING>,
        len: Option<usize>,
    ) -> Result<SeqSer<'w, 's, NOTING>, Fault> {
        if let Some(element) = repeated(value.field) {
            return Ok(SeqSer::<NOTING>::begin(value, element, len, NONE));
        }
        let wrapper = value.open_wrapper("a sequence")?;
        let start = wrapper.start;
        let inner = wrapper.inner();
        let Some(element) = repeated(inner.field) else {
            return inner.mismatch("a sequence");
        };
        Ok(SeqSer::<NOTING>::begin(inner, element, len, start))
    }

    #[inline(always)]
    fn begin(
        value: ValueSer<'w, 's, NOTING>,
        element: &'s Field,
        len: Option<usize>,
        wrapper: usize,
    ) -> SeqSer<'w, 's, NOTING> {
        let ValueSer { to, field } = value;
        let (out, depth) = (&mut *to.out, to.depth);
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
        SeqSer {
            to,
            field,
            element,
            packed,
            kept,
            least,
            wrapper,
            depth,
        }
    }

    #[inline(always)]
    fn element<T: ?Sized + Serialize>(&mut self, value: &T) -> Result<(), Fault> {
        value.serialize(ValueSer::<NOTING>::inside(
            self.to,
            self.element,
            self.depth,
        ))
    }

    #[inline(always)]
    fn close(self) -> Result<(), Fault> {
        if self.packed != NONE {
            let out = &mut *self.to.out;
            let len = out.len() - self.packed;
            if len == 0 {
                out.truncate(self.packed - self.kept - self.field.tag.len());
            } else if len < 0x80 && self.kept == 1 {
                out[self.packed - 1] = len as u8;
            } else if self.least != len {
                widen(out, self.packed, self.kept, len);
            }
        }
        finish(self.to.out, self.wrapper);
        Ok(())
    }
}

impl<const NOTING: bool> ser::SerializeSeq for SeqSer<'_, '_, NOTING> {
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
pub(super) enum TupleSer<'w, 's, const NOTING: bool> {
    Alike(SeqSer<'w, 's, NOTING>),
    Mixed(Compound<'w, 's, NOTING>),
}

impl<const NOTING: bool> ser::SerializeTuple for TupleSer<'_, '_, NOTING> {
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
pub(super) struct MapSer<'w, 's, const NOTING: bool> {
    to: &'w mut Writer<'s>,
    field: &'s Field,
    entry: &'s Message,
    /// Where the entries are, to sort them by encoded key at the end.
    spans: Vec<EntrySpan>,
    /// Where the open entry begins: at its tag, and at its key.
    tag: usize,
    key: usize,
    key_end: usize,
    wrapper: usize,
    depth: u32,
}

impl<'w, 's, const NOTING: bool> MapSer<'w, 's, NOTING> {
    #[inline(always)]
    pub(super) fn open(value: ValueSer<'w, 's, NOTING>) -> Result<MapSer<'w, 's, NOTING>, Fault> {
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
        let ValueSer { to, field } = value;
        let (entry, depth) = (&to.flat.messages[entry], to.depth);
        let (spans, tag, key, key_end) = (Vec::new(), NONE, NONE, NONE);
        Ok(MapSer {
            to,
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
        let out = &*self.to.out;
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
        self.to.out[begin..].copy_from_slice(&sorted);
    }
}

impl<const NOTING: bool> ser::SerializeMap for MapSer<'_, '_, NOTING> {
    type Ok = ();
    type Error = Fault;

    #[inline(always)]
    fn serialize_key<T: ?Sized + Serialize>(&mut self, key: &T) -> Result<(), Fault> {
        self.tag = self.to.out.len();
        self.key = begin(self.to.out, self.field.tag);
        let field = &self.entry.fields[0];
        key.serialize(ValueSer::<NOTING>::inside(self.to, field, self.depth + 1))?;
        self.key_end = self.to.out.len();
        Ok(())
    }

    #[inline(always)]
    fn serialize_value<T: ?Sized + Serialize>(&mut self, value: &T) -> Result<(), Fault> {
        let field = &self.entry.fields[1];
        value.serialize(ValueSer::<NOTING>::inside(self.to, field, self.depth + 1))?;
        let before = self.to.out.len();
        finish(self.to.out, self.key);
        let moved = self.to.out.len() - before;
        self.spans.push(EntrySpan {
            tag: self.tag,
            key: self.key + moved,
            key_end: self.key_end + moved,
            end: self.to.out.len(),
        });
        Ok(())
    }

    #[inline(always)]
    fn end(mut self) -> Result<(), Fault> {
        self.sort();
        finish(self.to.out, self.wrapper);
        Ok(())
    }
}
