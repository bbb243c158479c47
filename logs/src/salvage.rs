//! Finding every whole record of a damaged file: where lengths cannot be trusted, in chunks that
//! are cut, were never closed or do not match their checksums, behind holes.
//!
//! A record is believed if its content is what its opcode says and another record, or the end,
//! follows it. Where that is not so, the next place is looked for from which a record reads well.
//! What is inside an attachment is never taken for a part of the file.

mod chunk;
mod judge;

use std::collections::{BTreeMap, BTreeSet};

use mcap::MAGIC;
use mcap::records::{MessageHeader, op};

use crate::LogError;
use crate::frames::{HEAD_BYTES, LIMIT_BYTES, describe, record_head};
use crate::parse::{
    ChannelRecord, MESSAGE_HEADER_BYTES, Parser, SchemaRecord, message_header, metadata,
};
use crate::scan::most_unpacked;
use crate::source::{Attached, Source, what_it_is};

/// Bytes in which records are looked for: a file, or an opened chunk.
pub(crate) trait Bytes {
    fn length(&self) -> u64;
    fn at(&mut self, offset: u64, bytes: u64) -> Result<&[u8], LogError>;
    /// The head of an attachment; none where there can be none.
    fn attachment(&mut self, content: u64, length: u64) -> Result<Option<Attached>, LogError>;
    /// Hashes an attachment's data and compares its checksum.
    fn sum(&mut self, attached: &mut Attached) -> Result<(), LogError>;
}

impl Bytes for Source {
    fn length(&self) -> u64 {
        self.length()
    }

    fn at(&mut self, offset: u64, bytes: u64) -> Result<&[u8], LogError> {
        self.at(offset, bytes)
    }

    fn attachment(&mut self, content: u64, length: u64) -> Result<Option<Attached>, LogError> {
        self.attachment(content, length)
    }

    fn sum(&mut self, attached: &mut Attached) -> Result<(), LogError> {
        self.sum(attached)
    }
}

/// The records of an opened chunk.
struct Opened<'a>(&'a [u8]);

impl Bytes for Opened<'_> {
    fn length(&self) -> u64 {
        self.0.len() as u64
    }

    fn at(&mut self, offset: u64, bytes: u64) -> Result<&[u8], LogError> {
        let from = (offset as usize).min(self.0.len());
        let bytes = (bytes as usize).min(self.0.len() - from);
        Ok(&self.0[from..from + bytes])
    }

    fn attachment(&mut self, _content: u64, _length: u64) -> Result<Option<Attached>, LogError> {
        Ok(None)
    }

    fn sum(&mut self, _attached: &mut Attached) -> Result<(), LogError> {
        Ok(())
    }
}

/// Something that was found.
pub(crate) enum Part<'a> {
    Header {
        profile: &'a str,
        library: &'a str,
    },
    Chunk,
    Schema {
        record: SchemaRecord<'a>,
        in_summary: bool,
        sure: bool,
    },
    Channel {
        record: ChannelRecord<'a>,
        in_summary: bool,
        sure: bool,
    },
    Message {
        head: MessageHeader,
        data: &'a [u8],
        /// No checksum was found not to match it.
        sure: bool,
    },
    Metadata(String, BTreeMap<String, String>),
    Attachment(Attached),
    /// A record of a kind that only its writer knows.
    Private {
        opcode: u8,
        data: &'a [u8],
    },
    /// So many messages of a channel are in the chunk in front of this, by its index.
    Index {
        channel: u16,
        messages: u64,
    },
    /// What is data ends here.
    DataEnd,
    /// So many bytes that cannot be used.
    Lost {
        bytes: u64,
        what: String,
        /// There may have been messages in them.
        messages: bool,
    },
    /// Something that is not as it should be, of which all is used.
    Note(String),
}

/// A message in an index: its log time, its offset.
const INDEX_ENTRY_BYTES: u64 = 16;

/// Where the bytes are that are walked through, for words.
#[derive(Clone, Copy)]
enum WalkedPart {
    File,
    /// In the chunk that starts at this byte of the file.
    Chunk(u64),
}

impl WalkedPart {
    fn byte(self, offset: u64) -> String {
        match self {
            WalkedPart::File => format!("at byte {offset}"),
            WalkedPart::Chunk(chunk) => format!("in the chunk at byte {chunk}"),
        }
    }
}

type Each<'e> = dyn FnMut(Part<'_>) -> Result<(), LogError> + 'e;

/// What the summary of a file says of its parts.
#[derive(Clone, Default)]
pub(crate) struct Hints {
    /// Where attachments start and end.
    attachments: Vec<(u64, u64)>,
    /// Where chunks, attachments, metadata records and the summary start.
    starts: BTreeSet<u64>,
    pub(crate) counted: Option<Counted>,
}

/// How many messages there were, by the statistics of a file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Counted {
    pub(crate) by_channel: BTreeMap<u16, u64>,
    /// When the first one was logged, and the last.
    pub(crate) times_ns: (u64, u64),
}

/// Walks through a damaged file.
pub(crate) struct Salvage<'e> {
    each: &'e mut Each<'e>,
    hints: Hints,
    /// The channels that messages may be on; any, while they are not known.
    channels: Option<BTreeSet<u16>>,
    in_summary: bool,
    /// Something is lost already.
    damaged: bool,
    unpacked: u64,
    most_unpacked: u64,
    /// What is read now is in a chunk whose checksum does not match.
    unsure: bool,
    /// Up to here, records stand in a chunk that is cut.
    unsure_until: u64,
}

impl<'e> Salvage<'e> {
    /// Calls `each` with every part of the file that is found. `channels` are those that messages
    /// may be on; any, if they are not known.
    pub(crate) fn walk(
        source: &mut Source,
        hints: Hints,
        channels: Option<BTreeSet<u16>>,
        each: &'e mut Each<'e>,
    ) -> Result<(), LogError> {
        let mut salvage = Salvage {
            each,
            hints,
            channels,
            in_summary: false,
            damaged: false,
            unpacked: 0,
            most_unpacked: most_unpacked(source.length()),
            unsure: false,
            unsure_until: 0,
        };
        let mut at = MAGIC.len() as u64;
        while let Some(next) = salvage.step(source, at, WalkedPart::File)? {
            at = next;
        }
        Ok(())
    }

    fn lose(&mut self, bytes: u64, what: String) -> Result<(), LogError> {
        self.damaged = true;
        let messages = true;
        (self.each)(Part::Lost {
            bytes,
            what,
            messages,
        })
    }

    /// As [`Salvage::lose`], where no message can have been.
    fn lose_other(&mut self, bytes: u64, what: String) -> Result<(), LogError> {
        self.damaged = true;
        let messages = false;
        (self.each)(Part::Lost {
            bytes,
            what,
            messages,
        })
    }

    /// Handles what is at this place; gives the place to go on at, or none at the end.
    fn step(
        &mut self,
        bytes: &mut impl Bytes,
        at: u64,
        place: WalkedPart,
    ) -> Result<Option<u64>, LogError> {
        let left = bytes.length().saturating_sub(at);
        if left == 0 {
            if let WalkedPart::File = place {
                (self.each)(Part::Note("the file ends without a footer".to_owned()))?;
            }
            return Ok(None);
        }
        let Some((opcode, length)) = record_head(bytes.at(at, HEAD_BYTES)?) else {
            let byte = place.byte(at);
            self.lose(left, format!("{left} bytes of a record's head, {byte}"))?;
            return Ok(None);
        };
        let whole = self.is_whole(bytes, at)?;
        if let Some(end) = whole
            && self.may_follow(bytes, opcode, end)?
        {
            self.take(bytes, at, place, self.is_sure(at, place))?;
            if opcode == op::FOOTER {
                self.behind(bytes, end)?;
                return Ok(None);
            }
            return Ok(Some(end));
        }
        match (opcode, place) {
            (op::CHUNK, WalkedPart::File) => {
                if let Some(next) = self.broken_chunk(bytes, at, length)? {
                    return Ok(Some(next));
                }
            }
            (op::ATTACHMENT, WalkedPart::File) => {
                if let Some(next) = self.broken_attachment(bytes, at, length)? {
                    return Ok(Some(next));
                }
            }
            _ => {}
        }
        self.broken(bytes, at, whole, place).map(Some)
    }

    fn is_sure(&self, at: u64, place: WalkedPart) -> bool {
        match place {
            WalkedPart::File => at >= self.unsure_until,
            WalkedPart::Chunk(_) => !self.unsure,
        }
    }

    /// A record that is not whole, or that nothing follows. Gives the place to go on at.
    fn broken(
        &mut self,
        bytes: &mut impl Bytes,
        at: u64,
        whole: Option<u64>,
        place: WalkedPart,
    ) -> Result<u64, LogError> {
        let found = self.search(bytes, at + 1)?;
        let next = found.unwrap_or(bytes.length());
        if let Some(end) = whole.filter(|end| *end <= next) {
            // It is whole, and what follows it is not. If that does not even begin or end like a
            // record, the length of this one may be wrong.
            let follows = record_head(bytes.at(end, HEAD_BYTES)?);
            let likely = follows.is_none_or(|(opcode, length)| {
                (1..0x10).contains(&opcode) || length.checked_add(HEAD_BYTES) == Some(next - end)
            });
            let sure = self.is_sure(at, place) && (likely || found.is_none());
            self.take(bytes, at, place, sure)?;
            return Ok(end);
        }
        let what = match record_head(bytes.at(at, HEAD_BYTES)?) {
            Some((opcode, length)) if (1..0x10).contains(&opcode) => {
                format!("a {} of {length} bytes that is not whole", describe(opcode))
            }
            _ => "bytes that are no record".to_owned(),
        };
        let (lost, byte) = (next - at, place.byte(at));
        self.lose(lost, format!("{what}, {byte}: {lost} bytes"))?;
        Ok(next)
    }

    /// An attachment whose record's length is wrong or that is cut. Gives the place to go on at;
    /// none if its head makes no sense either.
    fn broken_attachment(
        &mut self,
        bytes: &mut impl Bytes,
        at: u64,
        length: u64,
    ) -> Result<Option<u64>, LogError> {
        let content = at + HEAD_BYTES;
        let attached = bytes.attachment(content, bytes.length() - content)?;
        let Some(mut attached) = attached else {
            return Ok(self.known_end(at));
        };
        if let Some(end) = attached.end().filter(|end| *end <= bytes.length())
            && self.may_follow(bytes, op::ATTACHMENT, end)?
        {
            bytes.sum(&mut attached)?;
            let name = attached.name.clone();
            let what = format!("the record of attachment {name} has another length than it says");
            (self.each)(Part::Note(what))?;
            (self.each)(Part::Attachment(attached))?;
            return Ok(Some(end));
        }
        let next = self.known_end(at);
        let next = next.or_else(|| self.hints.starts.range(at + 1..).next().copied());
        let next = next.unwrap_or(bytes.length());
        let name = &attached.name;
        let what = format!("attachment {name} of {length} bytes at byte {at}, which is not whole");
        self.lose_other(next - at, what)?;
        Ok(Some(next))
    }

    /// Where the attachment that starts here ends, by the summary.
    fn known_end(&self, at: u64) -> Option<u64> {
        let known = self
            .hints
            .attachments
            .iter()
            .find(|(start, _)| *start == at);
        known.map(|(_, end)| *end)
    }

    /// Compares the checksum of all data, which ends here, unless damage was found before.
    fn check_data(&mut self, bytes: &mut impl Bytes, end: u64) -> Result<(), LogError> {
        let declared = bytes.at(end + HEAD_BYTES, 4)?;
        let declared = declared.try_into().map(u32::from_le_bytes).unwrap_or(0);
        if declared == 0 || self.damaged || self.channels.is_none() {
            return Ok(());
        }
        let mut sum = crc32fast::Hasher::new();
        let mut at = 0;
        while at < end {
            let part = bytes.at(at, (end - at).min(1 << 20))?;
            if part.is_empty() {
                break;
            }
            sum.update(part);
            at += part.len() as u64;
        }
        if sum.finalize() == declared {
            return Ok(());
        }
        let what = "the checksum of the data does not match: something in it was changed";
        self.lose_other(0, what.to_owned())
    }

    /// What comes behind the footer.
    fn behind(&mut self, bytes: &mut impl Bytes, end: u64) -> Result<(), LogError> {
        let length = bytes.length();
        if bytes.at(end, 8)? != MAGIC {
            return (self.each)(Part::Note("the closing magic bytes are missing".to_owned()));
        }
        let from = end + 8;
        if from == length {
            return Ok(());
        }
        let first = bytes.at(from, 512)?;
        let what = match first.starts_with(MAGIC) {
            true => "another MCAP file".to_owned(),
            false => format!("something that {}", what_it_is(first)),
        };
        let lost = length - from;
        self.lose_other(
            lost,
            format!("{lost} bytes behind the end, from byte {from} on: {what}"),
        )
    }

    /// Hands a record on that is whole.
    fn take(
        &mut self,
        bytes: &mut impl Bytes,
        at: u64,
        place: WalkedPart,
        sure: bool,
    ) -> Result<(), LogError> {
        let Some((opcode, length)) = record_head(bytes.at(at, HEAD_BYTES)?) else {
            return Ok(());
        };
        let content = at + HEAD_BYTES;
        if self.in_summary && matches!(opcode, op::ATTACHMENT | op::METADATA) {
            let (what, byte) = (describe(opcode), place.byte(at));
            self.lose_other(
                0,
                format!("{what} behind the end of the data, {byte}: it is doubtful"),
            )?;
        }
        // Nor does any message belong there, and no checksum of the data covers it.
        let sure = sure && !(self.in_summary && opcode == op::MESSAGE);
        match opcode {
            op::ATTACHMENT => {
                if let Some(mut attached) = bytes.attachment(content, length)? {
                    bytes.sum(&mut attached)?;
                    return (self.each)(Part::Attachment(attached));
                }
                let what = format!("an attachment {}", place.byte(at));
                return self.lose_other(length, what);
            }
            op::CHUNK => return self.chunk(bytes, at, content, length),
            op::DATA_END => {
                self.in_summary = true;
                self.check_data(bytes, at)?;
                return (self.each)(Part::DataEnd);
            }
            _ if length > LIMIT_BYTES => {
                let byte = place.byte(at);
                let what = format!(
                    "a {} of {length} bytes, {byte}: too large",
                    describe(opcode)
                );
                return self.lose(length, what);
            }
            _ => {}
        }
        let in_summary = self.in_summary;
        let content = bytes.at(content, length)?;
        let mut parser = Parser::new(content);
        let part = match opcode {
            op::HEADER => Part::Header {
                profile: parser.text().unwrap_or_default(),
                library: parser.text().unwrap_or_default(),
            },
            op::SCHEMA => match SchemaRecord::parse(content) {
                Some(record) => Part::Schema {
                    record,
                    in_summary,
                    sure,
                },
                None => return Ok(()),
            },
            op::CHANNEL => match ChannelRecord::parse(content) {
                Some(record) => Part::Channel {
                    record,
                    in_summary,
                    sure,
                },
                None => return Ok(()),
            },
            op::MESSAGE => match message_header(content) {
                Some(head) => Part::Message {
                    head,
                    data: &content[MESSAGE_HEADER_BYTES..],
                    sure,
                },
                None => return Ok(()),
            },
            op::METADATA => match metadata(content) {
                Some((name, entries)) => Part::Metadata(name, entries),
                None => return Ok(()),
            },
            0x80.. => Part::Private {
                opcode,
                data: content,
            },
            op::MESSAGE_INDEX if !in_summary => match (parser.u16(), parser.u32()) {
                (Some(channel), Some(bytes)) => Part::Index {
                    channel,
                    messages: u64::from(bytes) / INDEX_ENTRY_BYTES,
                },
                _ => return Ok(()),
            },
            0x10.. => Part::Lost {
                messages: false,
                bytes: length,
                what: format!(
                    "a record of opcode 0x{opcode:02x}, which MCAP does not have, {}",
                    place.byte(at)
                ),
            },
            // Indices, statistics, the ends of data and file: they are written anew.
            _ => return Ok(()),
        };
        (self.each)(part)
    }
}
