//! The fields of one message on the wire, in the order of the flat schema.

use super::super::error::DecodeError;
use super::super::flat::{FlatSchema, Message};
use super::super::wire::{Malformed, Payload, take_field};
use super::Fault;

/// An open message: hands out the occurrences of each field, fields in ascending order.
pub(super) struct Reader<'p, 'b> {
    pub(super) flat: &'p FlatSchema,
    pub(super) message: &'p Message,
    pub(super) depth: u32,
    bytes: &'b [u8],
    /// The offset of the next occurrence, while the bytes are in the flat schema's order.
    pos: usize,
    /// Otherwise: all occurrences as (field, offset), sorted, and how many were taken.
    sorted: Option<(Vec<(usize, usize)>, usize)>,
}

impl<'p, 'b> Reader<'p, 'b> {
    /// Checks that the bytes are fields, and whether they are in order.
    pub(super) fn new(
        flat: &'p FlatSchema,
        message: &'p Message,
        bytes: &'b [u8],
        depth: u32,
    ) -> Result<Reader<'p, 'b>, Fault> {
        let mut reader = Reader {
            flat,
            message,
            depth,
            bytes,
            pos: 0,
            sorted: None,
        };
        let (mut last, mut in_order) = (0, true);
        while let Some((index, _, _)) = reader.advance()? {
            in_order &= last <= index;
            last = index;
        }
        reader.pos = 0;
        if !in_order {
            let mut all = Vec::new();
            while let Some((index, at, _)) = reader.advance()? {
                all.push((index, at));
            }
            all.sort_unstable();
            reader.sorted = Some((all, 0));
        }
        Ok(reader)
    }

    /// The next known field in the order of the bytes: its index, offset and value.
    fn advance(&mut self) -> Result<Option<(usize, usize, Payload<'b>)>, Fault> {
        while self.pos < self.bytes.len() {
            let at = self.pos;
            let (number, payload) = match take_field(self.bytes, &mut self.pos) {
                Ok(field) => field,
                Err(reason) => return Err(self.malformed(at, reason)),
            };
            let index = number as usize - 1;
            if index < self.message.fields.len() {
                return Ok(Some((index, at, payload)));
            }
        }
        Ok(None)
    }

    #[cold]
    fn malformed(&self, position: usize, reason: Malformed) -> Fault {
        let message = self.message.name.clone();
        let reason = match reason {
            Malformed::Cut => "the bytes end inside a field".to_owned(),
            Malformed::Varint => "a varint does not end".to_owned(),
            Malformed::Tag(tag) => format!("{tag} is no tag of a field"),
        };
        DecodeError::Malformed {
            message,
            position,
            reason,
        }
        .into()
    }

    /// Is there another occurrence of this field? Fields must be asked for in ascending order.
    pub(super) fn has(&mut self, index: usize) -> Result<bool, Fault> {
        let (pos, sorted) = (self.pos, self.sorted.as_ref().map(|(_, taken)| *taken));
        let found = self.take(index)?.is_some();
        self.pos = pos;
        if let (Some((_, taken)), Some(before)) = (&mut self.sorted, sorted) {
            *taken = before;
        }
        Ok(found)
    }

    /// Takes the next occurrence of this field.
    pub(super) fn take(&mut self, index: usize) -> Result<Option<Payload<'b>>, Fault> {
        if let Some((all, taken)) = &mut self.sorted {
            // Fields that nobody asked for are left behind.
            while all.get(*taken).is_some_and(|(found, _)| *found < index) {
                *taken += 1;
            }
            let Some(&(_, at)) = all.get(*taken).filter(|(found, _)| *found == index) else {
                return Ok(None);
            };
            *taken += 1;
            self.pos = at;
            return Ok(self.advance()?.map(|(_, _, payload)| payload));
        }
        loop {
            let before = self.pos;
            match self.advance()? {
                Some((found, _, payload)) if found == index => return Ok(Some(payload)),
                Some((found, _, _)) if found < index => {}
                _ => {
                    self.pos = before;
                    return Ok(None);
                }
            }
        }
    }

    /// Takes all occurrences of this field, of which the last counts.
    pub(super) fn take_last(&mut self, index: usize) -> Result<Option<Payload<'b>>, Fault> {
        let mut last = None;
        while let Some(payload) = self.take(index)? {
            last = Some(payload);
        }
        Ok(last)
    }

    /// Takes the last known field of all, in the order of the bytes.
    pub(super) fn take_any(&mut self) -> Result<Option<(usize, Payload<'b>)>, Fault> {
        self.pos = 0;
        let mut last = None;
        while let Some((index, _, payload)) = self.advance()? {
            last = Some((index, payload));
        }
        Ok(last)
    }

    /// How many bytes are left at most.
    pub(super) fn left(&self) -> usize {
        self.bytes.len() - self.pos
    }
}
