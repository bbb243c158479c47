//! MCAP's records as bytes: one is appended, or those of a chunk are gone through. Of records that
//! this crate made; `frames.rs` and `parse.rs` read those of others.

use std::io::Cursor;

use binrw::BinWrite;

use crate::frames::{HEAD_BYTES, record_head};

/// Appends a record: one of `mcap`'s, and behind it what `rest` appends.
pub(super) fn put_record<R>(
    out: &mut Vec<u8>,
    opcode: u8,
    record: &R,
    rest: impl FnOnce(&mut Vec<u8>),
) where
    R: for<'a> BinWrite<Args<'a> = ()>,
{
    // By itself: a list inside a record is written by seeking to the end of the buffer.
    let mut content = Cursor::new(Vec::new());
    // Only a writer fails, and memory is none that does.
    let written = record.write_le(&mut content);
    debug_assert!(written.is_ok(), "{written:?}");
    let mut content = content.into_inner();
    rest(&mut content);
    out.push(opcode);
    out.extend_from_slice(&(content.len() as u64).to_le_bytes());
    out.extend_from_slice(&content);
}

/// A record of a chunk.
pub(super) struct ChunkRecord<'a> {
    pub(super) opcode: u8,
    /// Where in the chunk it starts.
    pub(super) offset: u64,
    /// All of it, its head included.
    pub(super) bytes: &'a [u8],
}

impl ChunkRecord<'_> {
    /// The channel and the time of a message.
    pub(super) fn channel_and_log_time(&self) -> (u16, u64) {
        let word = |at: usize| {
            let bytes = self.bytes.get(at..).and_then(<[u8]>::first_chunk::<8>);
            bytes.map_or(0, |bytes| u64::from_le_bytes(*bytes))
        };
        (word(9) as u16, word(15))
    }
}

/// The records of a chunk.
pub(super) fn records(chunk: &[u8]) -> impl Iterator<Item = ChunkRecord<'_>> {
    let mut offset = 0;
    std::iter::from_fn(move || {
        let rest = &chunk[offset..];
        let (opcode, length) = record_head(rest)?;
        let bytes = &rest[..(HEAD_BYTES + length) as usize];
        let record = ChunkRecord {
            opcode,
            offset: offset as u64,
            bytes,
        };
        offset += bytes.len();
        Some(record)
    })
}
