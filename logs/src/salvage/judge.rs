//! Whether bytes are a record, and where the next one starts.

use std::collections::BTreeMap;

use mcap::MAGIC;
use mcap::records::op;

use super::{Bytes, Counted, Hints, Salvage};
use crate::LogError;
use crate::frames::{HEAD_BYTES, LIMIT_BYTES, record_head};
use crate::parse::{
    ChannelRecord, MESSAGE_HEADER_BYTES, Parser, SchemaRecord, message_header, metadata,
};
use crate::source::Source;

/// How much is searched through at a time, in bytes.
const WINDOW_BYTES: u64 = 1 << 20;

impl Hints {
    /// Reads the summary at the end of a file, if it is whole.
    pub(crate) fn read(source: &mut Source) -> Result<Hints, LogError> {
        let mut hints = Hints::default();
        let length = source.length();
        let footer = length.saturating_sub(8 + 20 + HEAD_BYTES);
        let bytes = source.at(footer, 37)?;
        let whole = record_head(bytes) == Some((op::FOOTER, 20)) && bytes.ends_with(MAGIC);
        let mut parser = Parser::new(bytes.get(9..).unwrap_or_default());
        let start = parser
            .u64()
            .filter(|start| whole && *start > 8 && *start < footer);
        let Some(start) = start else {
            return Ok(hints);
        };
        hints.starts.insert(start);
        let sum = parser.u64().and(parser.u32());
        let trusted = match sum {
            // It ends with the footer's own beginning.
            Some(sum) if sum != 0 => checksum(source, start, footer + HEAD_BYTES + 16)? == sum,
            _ => true,
        };
        let mut at = start;
        while at < footer {
            let Some((opcode, bytes)) = record_head(source.at(at, HEAD_BYTES)?) else {
                break;
            };
            if bytes > footer - at {
                break;
            }
            if opcode == op::STATISTICS && trusted && bytes <= STATISTICS_BYTES {
                hints.counted = counted(source.at(at + HEAD_BYTES, bytes)?);
            }
            let mut parser = Parser::new(source.at(at + HEAD_BYTES, bytes.min(64))?);
            let (first, second) = (parser.u64(), parser.u64());
            match (opcode, first, second) {
                (op::ATTACHMENT_INDEX, Some(offset), Some(size)) => {
                    hints.starts.insert(offset);
                    hints
                        .attachments
                        .push((offset, offset.saturating_add(size).min(length)));
                }
                (op::METADATA_INDEX, Some(offset), _) => drop(hints.starts.insert(offset)),
                // The two times come first.
                (op::CHUNK_INDEX, ..) => hints.starts.extend(parser.u64()),
                _ => {}
            }
            at += HEAD_BYTES + bytes;
        }
        hints.starts.retain(|at| *at >= 8 && *at < length);
        Ok(hints)
    }
}

/// As long as statistics can be: one entry for each channel that MCAP can number.
const STATISTICS_BYTES: u64 = 46 + 10 * (1 << 16);

/// What statistics say of messages.
fn counted(statistics: &[u8]) -> Option<Counted> {
    let mut parser = Parser::new(statistics);
    // How many there are of everything.
    parser.bytes(26)?;
    let times_ns = (parser.u64()?, parser.u64()?);
    let entries = parser.u32()?;
    let mut by_channel = BTreeMap::new();
    for _ in 0..entries / 10 {
        by_channel.insert(parser.u16()?, parser.u64()?);
    }
    Some(Counted {
        by_channel,
        times_ns,
    })
}

fn checksum(source: &mut Source, from: u64, to: u64) -> Result<u32, LogError> {
    let mut sum = crc32fast::Hasher::new();
    source.each(from, to, |part| {
        sum.update(part);
        Ok(())
    })?;
    Ok(sum.finalize())
}

impl Salvage<'_> {
    /// Where the record at this place ends, if its content is what its opcode says.
    pub(super) fn is_whole(
        &self,
        bytes: &mut impl Bytes,
        at: u64,
    ) -> Result<Option<u64>, LogError> {
        let Some((opcode, length)) = record_head(bytes.at(at, HEAD_BYTES)?) else {
            return Ok(None);
        };
        let content = at + HEAD_BYTES;
        let Some(end) = content
            .checked_add(length)
            .filter(|end| *end <= bytes.length())
        else {
            return Ok(None);
        };
        let whole = match opcode {
            0 => false,
            op::FOOTER => length == 20,
            op::DATA_END => length == 4,
            op::MESSAGE => length >= MESSAGE_HEADER_BYTES as u64,
            op::ATTACHMENT => {
                let attached = bytes.attachment(content, length)?;
                attached.and_then(|attached| attached.end()) == Some(end)
            }
            op::CHUNK => chunk_bytes(bytes.at(content, length.min(64))?) == Some(length),
            op::SUMMARY_OFFSET => length == 17,
            op::MESSAGE_INDEX
            | op::CHUNK_INDEX
            | op::ATTACHMENT_INDEX
            | op::STATISTICS
            | op::METADATA_INDEX
                if length <= LIMIT_BYTES =>
            {
                is_index(opcode, bytes.at(content, length)?)
            }
            op::HEADER | op::SCHEMA | op::CHANNEL | op::METADATA if length <= LIMIT_BYTES => {
                let content = bytes.at(content, length)?;
                let mut parser = Parser::new(content);
                match opcode {
                    op::HEADER => parser.text().and_then(|_| parser.text()).is_some(),
                    op::SCHEMA => SchemaRecord::parse(content).is_some(),
                    op::CHANNEL => ChannelRecord::parse(content).is_some(),
                    _ => metadata(content).is_some(),
                }
            }
            op::HEADER | op::SCHEMA | op::CHANNEL | op::METADATA => false,
            _ => true,
        };
        Ok(whole.then_some(end))
    }

    /// Whether a record, or the end, seems to be where a record of this opcode ends.
    pub(super) fn may_follow(
        &self,
        bytes: &mut impl Bytes,
        opcode: u8,
        at: u64,
    ) -> Result<bool, LogError> {
        let left = bytes.length() - at;
        if opcode == op::FOOTER {
            let magic = bytes.at(at, 8)?;
            return Ok(MAGIC.starts_with(magic));
        }
        if left == 0 {
            return Ok(true);
        }
        let head = record_head(bytes.at(at, HEAD_BYTES)?);
        Ok(head.is_some_and(|(opcode, length)| {
            let known = (1..0x10).contains(&opcode) || opcode >= 0x80;
            known && length <= left - HEAD_BYTES
        }))
    }

    /// The first place from `from` on at which a record reads well.
    pub(super) fn search(
        &self,
        bytes: &mut impl Bytes,
        from: u64,
    ) -> Result<Option<u64>, LogError> {
        let mut at = from;
        while at + HEAD_BYTES <= bytes.length() {
            let left = bytes.length() - at;
            let window = bytes.at(at, WINDOW_BYTES + HEAD_BYTES)?;
            let starts = window.windows(HEAD_BYTES as usize);
            let likely = starts.map(|head| {
                // A length has zeros at its end, or it would not fit.
                (1..0x10).contains(&head[0])
                    && head[7..] == [0, 0]
                    && record_head(head).is_some_and(|(_, length)| length < left)
            });
            let candidates: Vec<u64> = likely
                .enumerate()
                .filter(|(_, likely)| *likely)
                .map(|(offset, _)| at + offset as u64)
                .collect();
            let searched = window.len() as u64 - (HEAD_BYTES - 1);
            for candidate in candidates {
                if !self.is_hidden(candidate) && self.reads_well(bytes, candidate)? {
                    return Ok(Some(candidate));
                }
            }
            at += searched;
        }
        Ok(None)
    }

    /// True for what is inside an attachment.
    fn is_hidden(&self, at: u64) -> bool {
        let mut known = self.hints.attachments.iter();
        known.any(|(start, end)| (*start + 1..*end).contains(&at))
    }

    /// Whether a record is here, behind bytes that are none.
    fn reads_well(&self, bytes: &mut impl Bytes, at: u64) -> Result<bool, LogError> {
        let Some((opcode, length)) = record_head(bytes.at(at, HEAD_BYTES)?) else {
            return Ok(false);
        };
        let Some(end) = self.is_whole(bytes, at)? else {
            return Ok(false);
        };
        // The structure of these is proof enough, unless they are empty.
        let structured = matches!(
            opcode,
            op::SCHEMA | op::CHANNEL | op::ATTACHMENT | op::CHUNK
        );
        if structured {
            return Ok(true);
        }
        if opcode == op::MESSAGE {
            let head = bytes.at(at + HEAD_BYTES, MESSAGE_HEADER_BYTES as u64)?;
            let head = message_header(head);
            let known = self.channels.as_ref();
            let on = head.is_some_and(|head| {
                known.is_none_or(|channels| channels.contains(&head.channel_id))
            });
            if !on {
                return Ok(false);
            }
        }
        // Of the others, an empty one proves nothing.
        Ok(length > 0 && self.may_follow(bytes, opcode, end)?)
    }
}

/// Whether the parts of an index, or of the statistics, fill their record.
fn is_index(opcode: u8, content: &[u8]) -> bool {
    // The bytes in front of the first part that has a length of its own, how many such parts there
    // are, and the bytes between and behind them.
    let (before, parts, behind) = match opcode {
        op::MESSAGE_INDEX => (2, 1, [0, 0]),
        op::STATISTICS => (42, 1, [0, 0]),
        op::METADATA_INDEX => (16, 1, [0, 0]),
        op::ATTACHMENT_INDEX => (40, 2, [0, 0]),
        _ => (32, 2, [8, 16]),
    };
    let mut parser = Parser::new(content);
    let mut read = || {
        parser.bytes(before)?;
        for bytes in &behind[..parts] {
            let length = parser.u32()?;
            parser.bytes(u64::from(length))?;
            parser.bytes(*bytes)?;
        }
        Some(())
    };
    read().is_some() && parser.rest().is_empty()
}

/// How many bytes a chunk's record has by what its content says: head, name of the compression,
/// data.
fn chunk_bytes(content: &[u8]) -> Option<u64> {
    let mut parser = Parser::new(content.get(28..)?);
    let name = parser.text()?;
    let data = parser.u64()?;
    let known = matches!(name, "" | "lz4" | "zstd");
    data.checked_add(28 + 4 + name.len() as u64 + 8)
        .filter(|_| known)
}
