//! The bytes of a FlatBuffer: tables, vectors and texts, each offset checked.

use crate::value::Unreadable;
use crate::value::{NumberKind, Value};

/// The bytes of a message or a schema.
#[derive(Clone, Copy)]
pub(super) struct Buffer<'a> {
    bytes: &'a [u8],
}

/// A table: where it is, and the list of its fields' offsets.
pub(super) struct Table<'a> {
    buffer: Buffer<'a>,
    at: usize,
    offsets: usize,
    offsets_bytes: usize,
}

impl<'a> Buffer<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Buffer { bytes }
    }

    pub(super) fn bytes(&self, at: usize, count: usize) -> Result<&'a [u8], Unreadable> {
        let end = at.checked_add(count);
        let bytes = end.and_then(|end| self.bytes.get(at..end));
        bytes.ok_or_else(|| {
            let length = self.bytes.len();
            Unreadable::new(format!(
                "{count} bytes at byte {at}, but there are {length}"
            ))
        })
    }

    fn number(&self, at: usize, kind: NumberKind) -> Result<i128, Unreadable> {
        match kind.read(self.bytes(at, kind.bytes())?, false) {
            Value::Int(number) => Ok(number),
            Value::Bool(value) => Ok(value.into()),
            _ => Ok(0),
        }
    }

    /// The place that the offset at a place leads to.
    pub(super) fn follow(&self, at: usize) -> Result<usize, Unreadable> {
        let offset = self.number(at, NumberKind::U32)? as usize;
        Ok(at.saturating_add(offset))
    }

    /// Where the elements of a vector begin, and how many there are.
    pub(super) fn vector(&self, at: usize) -> Result<(usize, usize), Unreadable> {
        let at = self.follow(at)?;
        let count = self.number(at, NumberKind::U32)? as usize;
        Ok((at.saturating_add(4), count))
    }

    pub(super) fn table(&self, at: usize) -> Result<Table<'a>, Unreadable> {
        let back = self.number(at, NumberKind::I32)?;
        let offsets = usize::try_from(at as i128 - back);
        let offsets = offsets.map_err(|_| Unreadable::new("a table that begins nowhere"))?;
        let offsets_bytes = self.number(offsets, NumberKind::U16)? as usize;
        Ok(Table {
            buffer: *self,
            at,
            offsets,
            offsets_bytes,
        })
    }
}

impl<'a> Table<'a> {
    /// Where the field is whose offset is at this place of the list; none if it is absent.
    pub(super) fn place(&self, offset: usize) -> Result<Option<usize>, Unreadable> {
        if offset < 4 || offset.saturating_add(2) > self.offsets_bytes {
            return Ok(None);
        }
        let place = self.offsets.saturating_add(offset);
        let field = self.buffer.number(place, NumberKind::U16)? as usize;
        Ok((field > 0).then(|| self.at.saturating_add(field)))
    }

    /// The place of the field of this number.
    fn field(&self, number: usize) -> Result<Option<usize>, Unreadable> {
        self.place(4 + 2 * number)
    }

    pub(super) fn has(&self, number: usize) -> bool {
        matches!(self.field(number), Ok(Some(_)))
    }

    /// A number; 0 if it is absent.
    pub(super) fn number(&self, number: usize, kind: NumberKind) -> Result<i128, Unreadable> {
        match self.field(number)? {
            Some(at) => self.buffer.number(at, kind),
            None => Ok(0),
        }
    }

    pub(super) fn real(&self, number: usize) -> Result<f64, Unreadable> {
        let Some(at) = self.field(number)? else {
            return Ok(0.0);
        };
        let bytes = self.buffer.bytes(at, 8)?;
        Ok(NumberKind::F64.read(bytes, false).as_f64().unwrap_or(0.0))
    }

    /// A text; the empty one if it is absent.
    pub(super) fn text(&self, number: usize) -> Result<&'a str, Unreadable> {
        let Some(at) = self.field(number)? else {
            return Ok("");
        };
        let (start, length) = self.buffer.vector(at)?;
        let bytes = self.buffer.bytes(start, length)?;
        std::str::from_utf8(bytes).map_err(|_| Unreadable::new("a name that is not UTF-8"))
    }

    pub(super) fn child(&self, number: usize) -> Result<Option<Table<'a>>, Unreadable> {
        let Some(at) = self.field(number)? else {
            return Ok(None);
        };
        let at = self.buffer.follow(at)?;
        self.buffer.table(at).map(Some)
    }

    /// The tables of a vector.
    pub(super) fn tables(
        &self,
        number: usize,
    ) -> Result<impl Iterator<Item = Result<Table<'a>, Unreadable>> + use<'a>, Unreadable> {
        let (start, count) = match self.field(number)? {
            None => (0, 0),
            Some(at) => self.buffer.vector(at)?,
        };
        // That all are there, before anything is made of them.
        self.buffer.bytes(start, count.saturating_mul(4))?;
        let buffer = self.buffer;
        let places = (0..count).map(move |at| start + 4 * at);
        Ok(places.map(move |at| buffer.table(buffer.follow(at)?)))
    }
}
