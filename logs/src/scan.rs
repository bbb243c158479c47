//! Everything in an MCAP file, in file order, with chunks opened and damage reported: the one
//! reader that information, comparison and recovery are built on.

mod declared;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use mcap::records::{MessageHeader, op};

use crate::LogError;
use crate::channel::ChannelInfo;
use crate::frames::{Care, Frame, Frames, HEAD_BYTES, LIMIT_BYTES, describe, record_head};
use crate::parse::{ChunkRecord, MESSAGE_HEADER_BYTES, Parser, message_header, metadata};
use crate::source::Attached;

use declared::{Declared, Summary};

/// Where a message is in a file: its frame, and its place in the opened chunk.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Position {
    pub(crate) frame: u64,
    pub(crate) inner: u32,
}

/// A message where it was read.
pub(crate) struct ScannedMessage<'a> {
    pub(crate) channel: &'a Arc<ChannelInfo>,
    pub(crate) head: MessageHeader,
    pub(crate) data: &'a [u8],
    pub(crate) position: Position,
}

/// Something in the file.
pub(crate) enum Item<'a> {
    Header {
        profile: &'a str,
        library: &'a str,
    },
    Chunk {
        compression: &'a str,
    },
    Message(ScannedMessage<'a>),
    Attachment(Attached),
    Metadata(String, BTreeMap<String, String>),
    /// A record of a kind that MCAP does not have, or not yet.
    Strange(u8),
    /// So many bytes behind the end of the file, from this byte on.
    Behind {
        offset: u64,
        bytes: u64,
    },
    /// A checksum that does not match.
    WrongSum(String),
    /// Something that cannot be read; what comes behind it can.
    Damage {
        offset: u64,
        what: String,
    },
    /// Nothing behind this byte can be read.
    Cut {
        offset: u64,
        what: String,
    },
}

/// What to yield once the borrow of the buffers is settled.
enum Found {
    Message(MessageHeader, Position),
    Other,
    /// A message on a channel that is not declared, as behind damage: what follows it can be read.
    Stray(String),
}

/// Reads a file from its start to its end.
pub(crate) struct Scanner {
    frames: Frames,
    declared: Declared,
    /// How many bytes chunks unpacked to, and how many they may.
    unpacked: u64,
    most_unpacked: u64,
    /// What is to be yielded before the file goes on.
    pending: Vec<Item<'static>>,
    /// The open chunk: where its frame starts, its records, and the place of the next one.
    chunk_frame: u64,
    chunk: Vec<u8>,
    next_inner: usize,
    data_ended: bool,
    over: bool,
    /// The message that was yielded last.
    last: Option<(MessageHeader, Position, Within)>,
    /// Chunks are not opened.
    leaves_chunks: bool,
    /// Which messages of chunks are passed over by what they say, and the last of those.
    passes: Option<Passes>,
    passed: Option<(MessageHeader, Position)>,
}

/// Whether a message is passed over, by its first bytes.
type Passes = Box<dyn Fn(&[u8]) -> bool + Send>;

/// Which buffer holds a message.
#[derive(Clone, Copy, PartialEq)]
enum Within {
    Chunk,
    Frame,
}

/// What all chunks of a file together may unpack to: what is more is no log, but made to keep its
/// readers busy.
pub(crate) fn most_unpacked(file_bytes: u64) -> u64 {
    file_bytes.saturating_mul(200).saturating_add(512 << 20)
}

impl Scanner {
    pub(crate) fn open(path: &Path) -> Result<Self, LogError> {
        Scanner::careful(path, Care::Little)
    }

    /// A scanner that looks at more than it needs.
    pub(crate) fn careful(path: &Path, care: Care) -> Result<Self, LogError> {
        let frames = Frames::open(path, care)?;
        Ok(Scanner {
            most_unpacked: most_unpacked(frames.length()),
            frames,
            declared: Declared::default(),
            unpacked: 0,
            pending: Vec::new(),
            chunk_frame: 0,
            chunk: Vec::new(),
            next_inner: 0,
            data_ended: false,
            over: false,
            last: None,
            leaves_chunks: false,
            passes: None,
            passed: None,
        })
    }

    /// A scanner for what stands between chunks: these are passed over unopened.
    pub(crate) fn outside_chunks(path: &Path) -> Result<Self, LogError> {
        let mut scanner = Scanner::open(path)?;
        scanner.leaves_chunks = true;
        Ok(scanner)
    }

    /// Passes over messages of records, but for what was in flight, by what they say, as far as they are in chunks.
    pub(crate) fn pass_over_records(&mut self, which: impl Fn(&[u8]) -> bool + Send + 'static) {
        self.passes = Some(Box::new(which));
    }

    /// Where the last record is that was passed over by what it says, and with which channel.
    pub(crate) fn passed(&self) -> Option<(MessageHeader, Position, u32)> {
        let (head, position) = self.passed?;
        Some((head, position, self.channel(head.channel_id)?.serial))
    }

    /// Passes over the messages of these channels, which are asked for as they are declared.
    pub(crate) fn pass_over(&mut self, which: impl Fn(&ChannelInfo) -> bool + Send + 'static) {
        self.declared.passed_over = Some(Box::new(which));
    }

    /// All channels that the file has declared so far, in the order of their serial numbers.
    pub(crate) fn channels(&self) -> &[Arc<ChannelInfo>] {
        &self.declared.all
    }

    /// Hashes an attachment's data and compares its checksum.
    pub(crate) fn sum(&mut self, attached: &mut Attached) -> Result<(), LogError> {
        self.frames.sum(attached)
    }

    /// The data of an attachment.
    pub(crate) fn attachment_data(&mut self, attached: &Attached) -> Result<&[u8], LogError> {
        self.frames.attachment_data(attached)
    }

    pub(crate) fn length(&self) -> u64 {
        self.frames.length()
    }

    pub(crate) fn path(&self) -> &Path {
        self.frames.path()
    }

    /// The next thing in the file; `None` once it is over.
    pub(crate) fn next(&mut self) -> Result<Option<Item<'_>>, LogError> {
        loop {
            if self.next_inner < self.chunk.len() {
                match self.inner::<false>() {
                    Ok(Found::Other) => continue,
                    Ok(Found::Message(head, position)) => {
                        self.last = Some((head, position, Within::Chunk));
                        return Ok(self.current().map(Item::Message));
                    }
                    Ok(Found::Stray(what)) => {
                        return Ok(Some(damage(self.chunk_frame, what)));
                    }
                    Err(what) => {
                        self.next_inner = self.chunk.len();
                        return Ok(Some(damage(self.chunk_frame, what)));
                    }
                }
            }
            if let Some(item) = self.pending.pop() {
                return Ok(Some(item));
            }
            if self.over {
                return Ok(None);
            }
            let frame = self.frames.next()?;
            let wrong = self.frames.wrong_sums().into_iter().map(Item::WrongSum);
            self.pending.extend(wrong);
            match frame {
                Frame::End { offset, behind } => {
                    self.over = true;
                    if behind > 0 {
                        let bytes = behind;
                        self.pending.insert(0, Item::Behind { offset, bytes });
                    }
                }
                Frame::Cut { offset, what } => {
                    self.over = true;
                    self.pending.insert(0, Item::Cut { offset, what });
                }
                Frame::Attachment { offset, attached } => {
                    return Ok(Some(match attached {
                        Some(attached) if !self.data_ended => Item::Attachment(attached),
                        Some(_) => damage(offset, "an attachment behind the end of the data"),
                        None => damage(offset, "an attachment that is malformed"),
                    }));
                }
                Frame::Record { opcode, offset } if self.data_ended => match opcode {
                    // What follows the data repeats it, and may be all that is left of it.
                    op::SCHEMA | op::CHANNEL => {
                        let content = self.frames.content();
                        self.declared.declare(opcode, content, Summary::Yes);
                    }
                    op::MESSAGE | op::CHUNK | op::METADATA => {
                        let what = format!("a {} behind the end of the data", describe(opcode));
                        return Ok(Some(damage(offset, what)));
                    }
                    _ => {}
                },
                Frame::Record {
                    opcode: op::DATA_END,
                    ..
                } => self.data_ended = true,
                Frame::Record { opcode, offset } => match self.top(opcode, offset) {
                    Ok(Some(Found::Other | Found::Stray(..))) | Err(None) => {}
                    Ok(Some(Found::Message(head, position))) => {
                        self.last = Some((head, position, Within::Frame));
                        return Ok(self.current().map(Item::Message));
                    }
                    Ok(None) => return Ok(Some(self.item(opcode))),
                    Err(Some(what)) => return Ok(Some(damage(offset, what))),
                },
            }
        }
    }

    /// The message that [`Scanner::next`] yielded last.
    pub(crate) fn current(&self) -> Option<ScannedMessage<'_>> {
        let (head, position, within) = self.last?;
        match within {
            Within::Chunk => self.message(head, position),
            Within::Frame => {
                let data = self.frames.content().get(MESSAGE_HEADER_BYTES..)?;
                self.with_channel(head, data, position)
            }
        }
    }

    /// Where the next frame starts.
    pub(crate) fn offset(&self) -> u64 {
        self.frames.offset()
    }

    /// Goes back to a frame that was read before. For a scanner that has read the file once, and so
    /// knows its channels.
    pub(crate) fn rewind(&mut self, frame: u64) {
        self.frames.seek(frame);
        // What is opened again does not count again.
        self.unpacked = 0;
        self.pending.clear();
        self.chunk.clear();
        self.next_inner = 0;
        self.data_ended = false;
        self.over = false;
        self.last = None;
    }

    /// Opens the frame at `position` again, and gives the message there, which is on the channel
    /// with this serial number. For a scanner that has read the file once, and so knows its
    /// channels.
    pub(crate) fn message_at(
        &mut self,
        position: Position,
        serial: u32,
    ) -> Result<ScannedMessage<'_>, LogError> {
        const GONE: &str = "the file changed while it was read";
        if self.chunk_frame != position.frame || self.chunk.is_empty() {
            self.frames.seek(position.frame);
            // A chunk that is opened again does not count again.
            self.unpacked = 0;
            let Frame::Record { opcode, offset } = self.frames.next()? else {
                return Err(LogError::damaged(self.path(), position.frame, GONE));
            };
            if opcode == op::CHUNK {
                let opened = self.open_chunk(offset);
                opened.map_err(|what| LogError::damaged(self.path(), offset, what))?;
            } else {
                // A message outside chunks is handled as a chunk of its own.
                self.chunk_frame = offset;
                self.chunk.clear();
                self.chunk.push(opcode);
                let length = self.frames.content().len() as u64;
                self.chunk.extend_from_slice(&length.to_le_bytes());
                self.chunk.extend_from_slice(self.frames.content());
            }
        }
        self.next_inner = (position.inner as usize).min(self.chunk.len());
        let found = match self.inner::<true>() {
            Ok(Found::Message(head, position)) => Some((head, position)),
            _ => None,
        };
        let message = found.and_then(|(head, position)| self.message(head, position));
        let gone = || LogError::damaged(self.path(), position.frame, GONE);
        // A later channel may have taken the id.
        let channel = self.declared.all.get(serial as usize);
        let channel = channel.ok_or_else(gone)?;
        let message = message.ok_or_else(gone)?;
        Ok(ScannedMessage { channel, ..message })
    }

    /// Handles a record outside chunks: `Ok(None)` if [`Scanner::item`] is to yield it.
    fn top(&mut self, opcode: u8, offset: u64) -> Result<Option<Found>, Option<String>> {
        let malformed = || Some(format!("a {} that is malformed", describe(opcode)));
        match opcode {
            op::CHUNK => {
                self.open_chunk(offset).map_err(Some)?;
                Ok(None)
            }
            op::SCHEMA | op::CHANNEL => {
                let content = self.frames.content();
                let declared = self.declared.declare(opcode, content, Summary::No);
                declared.ok_or_else(malformed)?;
                Ok(Some(Found::Other))
            }
            op::MESSAGE => {
                let head = message_header(self.frames.content()).ok_or_else(malformed)?;
                let slot = self.declared.slot(head.channel_id);
                let slot = slot.ok_or_else(|| Some(undeclared(head.channel_id)))?;
                if slot.is_passed_over {
                    return Ok(Some(Found::Other));
                }
                let position = Position {
                    frame: offset,
                    inner: 0,
                };
                Ok(Some(Found::Message(head, position)))
            }
            op::METADATA => match metadata(self.frames.content()) {
                Some(_) => Ok(None),
                None => Err(malformed()),
            },
            op::HEADER => {
                let mut parser = Parser::new(self.frames.content());
                let read = parser.text().and_then(|_| parser.text());
                read.ok_or_else(malformed)?;
                Ok(None)
            }
            0x10.. => Ok(None),
            _ => Ok(Some(Found::Other)),
        }
    }

    /// Yields a record that [`Scanner::top`] has found to be in order.
    fn item(&self, opcode: u8) -> Item<'_> {
        let content = self.frames.content();
        let mut parser = Parser::new(content);
        match opcode {
            op::CHUNK => Item::Chunk {
                compression: ChunkRecord::parse(content).map_or("", |chunk| chunk.compression),
            },
            op::METADATA => match metadata(content) {
                Some((name, entries)) => Item::Metadata(name, entries),
                None => damage(self.frames.offset(), "a metadata record that is malformed"),
            },
            0x10.. => Item::Strange(opcode),
            _ => Item::Header {
                profile: parser.text().unwrap_or_default(),
                library: parser.text().unwrap_or_default(),
            },
        }
    }

    fn open_chunk(&mut self, offset: u64) -> Result<(), String> {
        self.chunk_frame = offset;
        self.next_inner = 0;
        if self.leaves_chunks {
            return Ok(());
        }
        let opened = match ChunkRecord::parse(self.frames.content()) {
            None => Err("a chunk that is malformed".to_owned()),
            Some(chunk) => {
                let left = self.most_unpacked - self.unpacked;
                chunk.decompress(LIMIT_BYTES.min(left), &mut self.chunk)
            }
        };
        self.unpacked += self.chunk.len() as u64;
        if opened.is_err() {
            self.chunk.clear();
        }
        opened
    }

    /// Handles the next record of the open chunk. If it is asked for by its place, it is not passed over.
    #[inline]
    fn inner<const BY_PLACE: bool>(&mut self) -> Result<Found, String> {
        const CUT: &str = "a chunk that ends within a record";
        let start = self.next_inner;
        let rest = &self.chunk[start..];
        let (opcode, length) = record_head(rest).ok_or(CUT)?;
        let length = usize::try_from(length).map_err(|_| CUT)?;
        let content = rest[HEAD_BYTES as usize..].get(..length).ok_or(CUT)?;
        self.next_inner = start + HEAD_BYTES as usize + length;
        let malformed = || format!("a {} in a chunk that is malformed", describe(opcode));
        match opcode {
            op::MESSAGE => {
                let head = message_header(content).ok_or_else(malformed)?;
                let is_looked_at = match self.declared.slot(head.channel_id) {
                    Some(slot) if slot.is_passed_over && !BY_PLACE => return Ok(Found::Other),
                    Some(slot) => slot.is_looked_at && !BY_PLACE,
                    None => return Ok(Found::Stray(undeclared(head.channel_id))),
                };
                let inner = u32::try_from(start).map_err(|_| malformed())?;
                let position = Position {
                    frame: self.chunk_frame,
                    inner,
                };
                if let Some(passes) = &self.passes
                    && is_looked_at
                    && passes(&content[MESSAGE_HEADER_BYTES..])
                {
                    self.passed = Some((head, position));
                    return Ok(Found::Other);
                }
                Ok(Found::Message(head, position))
            }
            op::SCHEMA | op::CHANNEL => {
                let declared = self.declared.declare(opcode, content, Summary::No);
                declared.ok_or_else(malformed)?;
                Ok(Found::Other)
            }
            0 => Err("opcode 0 in a chunk".to_owned()),
            _ => Ok(Found::Other),
        }
    }

    fn channel(&self, id: u16) -> Option<&Arc<ChannelInfo>> {
        self.declared.channel(id)
    }

    /// The message that [`Scanner::inner`] has just found; it ends where the next record starts.
    fn message(&self, head: MessageHeader, position: Position) -> Option<ScannedMessage<'_>> {
        let start = position.inner as usize + 9 + MESSAGE_HEADER_BYTES;
        self.with_channel(head, self.chunk.get(start..self.next_inner)?, position)
    }

    fn with_channel<'a>(
        &'a self,
        head: MessageHeader,
        data: &'a [u8],
        position: Position,
    ) -> Option<ScannedMessage<'a>> {
        let channel = self.channel(head.channel_id)?;
        Some(ScannedMessage {
            channel,
            head,
            data,
            position,
        })
    }
}

#[cold]
fn undeclared(id: u16) -> String {
    format!("a message on channel {id}, which is not declared")
}

/// What is at `offset` cannot be used.
fn damage(offset: u64, what: impl Into<String>) -> Item<'static> {
    let what = what.into();
    Item::Damage { offset, what }
}
