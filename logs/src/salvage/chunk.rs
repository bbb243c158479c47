//! Chunks: opened as far as they go.

use std::io::Read;

use super::{Bytes, Opened, Part, Salvage, WalkedPart};
use crate::LogError;
use crate::frames::{HEAD_BYTES, LIMIT_BYTES};
use crate::parse::{ChunkRecord, Parser, most};

/// Where a chunk's data is, and what its head says of it.
struct Head {
    size: u64,
    sum: u32,
    compression: String,
    data: u64,
    data_bytes: u64,
}

fn head(bytes: &mut impl Bytes, content: u64) -> Result<Option<Head>, LogError> {
    let bytes = bytes.at(content, 64)?;
    let mut parser = Parser::new(bytes);
    let mut read = || {
        parser.u64()?;
        parser.u64()?;
        let (size, sum) = (parser.u64()?, parser.u32()?);
        let compression = parser.text()?.to_owned();
        Some((size, sum, compression, parser.u64()?))
    };
    let Some((size, sum, compression, data_bytes)) = read() else {
        return Ok(None);
    };
    let data = content + (bytes.len() - parser.rest().len()) as u64;
    let known = matches!(compression.as_str(), "" | "lz4" | "zstd");
    Ok(known.then_some(Head {
        size,
        sum,
        compression,
        data,
        data_bytes,
    }))
}

impl Salvage<'_> {
    /// A chunk whose record is whole.
    pub(super) fn chunk(
        &mut self,
        bytes: &mut impl Bytes,
        at: u64,
        content: u64,
        length: u64,
    ) -> Result<(), LogError> {
        match head(bytes, content)? {
            Some(head) => self.opened(bytes, at, &head),
            None => self.lose(
                length,
                format!("the chunk at byte {at}: its head makes no sense"),
            ),
        }
    }

    /// A chunk whose record has a wrong length, is cut or was never closed. Gives the place to go
    /// on at; none if its head makes no sense.
    pub(super) fn broken_chunk(
        &mut self,
        bytes: &mut impl Bytes,
        at: u64,
        length: u64,
    ) -> Result<Option<u64>, LogError> {
        let content = at + HEAD_BYTES;
        let Some(mut head) = head(bytes, content)? else {
            return Ok(None);
        };
        let there = bytes.length();
        let opcode = mcap::records::op::CHUNK;
        // The two lengths contradict each other: one of them leads to a record.
        let by_data = head.data.checked_add(head.data_bytes);
        let by_record = content.checked_add(length);
        for end in [by_data, by_record].into_iter().flatten() {
            if end >= head.data && end < there && self.may_follow(bytes, opcode, end)? {
                head.data_bytes = end - head.data;
                let what = format!("the chunk at byte {at} has another length than it says");
                (self.each)(Part::Note(what))?;
                self.opened(bytes, at, &head)?;
                return Ok(Some(end));
            }
        }
        if head.compression.is_empty() {
            // Its records stand in the file as if there were no chunk.
            let closed = head.data_bytes != u64::MAX && head.data_bytes != 0;
            let word = if closed { "cut" } else { "never closed" };
            (self.each)(Part::Chunk)?;
            (self.each)(Part::Note(format!("the chunk at byte {at} is {word}")))?;
            if closed && head.sum != 0 {
                self.unsure_until = by_data.unwrap_or(there).min(there);
            }
            return Ok(Some(head.data));
        }
        let next = self.search(bytes, head.data)?.unwrap_or(there);
        head.data_bytes = next - head.data;
        let lost = next - at;
        self.lose(
            lost,
            format!("the chunk at byte {at} is cut: what is left of it is unchecked"),
        )?;
        self.opened_as(bytes, at, &head, true)?;
        Ok(Some(next))
    }

    fn opened(&mut self, bytes: &mut impl Bytes, at: u64, head: &Head) -> Result<(), LogError> {
        self.opened_as(bytes, at, head, false)
    }

    fn opened_as(
        &mut self,
        bytes: &mut impl Bytes,
        at: u64,
        head: &Head,
        cut: bool,
    ) -> Result<(), LogError> {
        let left = self.most_unpacked - self.unpacked;
        let limit = LIMIT_BYTES.min(left).min(most(head.data_bytes));
        if (head.size > limit && !cut) || head.data_bytes > LIMIT_BYTES {
            let (size, packed) = (head.size, head.data_bytes);
            let what = format!(
                "the chunk at byte {at}: {packed} bytes that unpack to {size}, more than the \
                 {limit} allowed"
            );
            return self.lose(packed, what);
        }
        let data = bytes.at(head.data, head.data_bytes)?;
        let record = ChunkRecord {
            size: head.size,
            sum: head.sum,
            compression: &head.compression,
            data,
        };
        let mut records = Vec::new();
        let fault = unpack(&record, limit, &mut records);
        self.unpacked += records.len() as u64;
        (self.each)(Part::Chunk)?;
        if let Some(fault) = fault.as_ref().filter(|_| !cut) {
            let what = format!("the chunk at byte {at} {fault}: what is left of it is unchecked");
            self.lose(head.size.saturating_sub(records.len() as u64), what)?;
        }
        self.unsure = fault.is_some() || cut || self.in_summary;
        let mut opened = Opened(&records);
        let mut next = Some(0);
        while let Some(at_record) = next {
            next = self.step(&mut opened, at_record, WalkedPart::Chunk(at))?;
        }
        self.unsure = false;
        Ok(())
    }
}

/// Unpacks a chunk as far as it goes; what is wrong with it.
fn unpack(chunk: &ChunkRecord<'_>, limit: u64, out: &mut Vec<u8>) -> Option<String> {
    let read = |reader: &mut dyn Read, out: &mut Vec<u8>| {
        let done = reader.take(limit).read_to_end(out);
        done.err().map(|error| format!("does not unpack ({error})"))
    };
    let fault = match chunk.compression {
        "" => {
            out.extend_from_slice(chunk.data);
            None
        }
        "zstd" => match zstd::stream::read::Decoder::with_buffer(chunk.data) {
            Ok(decoder) => read(&mut decoder.single_frame(), out),
            Err(error) => Some(format!("does not unpack ({error})")),
        },
        _ => read(&mut lz4_flex::frame::FrameDecoder::new(chunk.data), out),
    };
    if fault.is_some() {
        return fault;
    }
    if out.len() as u64 != chunk.size {
        return Some(format!(
            "has {} bytes and declares {}",
            out.len(),
            chunk.size
        ));
    }
    let matches = chunk.sum == 0 || crc32fast::hash(out) == chunk.sum;
    (!matches).then(|| "does not match its checksum".to_owned())
}
