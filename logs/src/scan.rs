//! Everything in an MCAP file, in file order, with chunks opened and damage reported: the one
//! reader that information, comparison and recovery are built on.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use mcap::records::{MessageHeader, op};
use prost::Message;
use prost_reflect::prost_types::FileDescriptorSet;
use prost_reflect::{DescriptorPool, MessageDescriptor};

use crate::LogError;
use crate::frames::{Frame, Frames, LIMIT_BYTES, describe};
use crate::parse::{
    AttachmentRecord, ChannelRecord, ChunkRecord, MESSAGE_HEADER_BYTES, Parser, SchemaRecord,
    message_header, metadata,
};

/// A schema of a log.
#[derive(Debug, Default)]
pub struct SchemaInfo {
    /// Its name.
    pub name: String,
    /// How it is written: `protobuf`, `jsonschema`, `ros2msg`, ...
    pub encoding: String,
    /// The schema itself.
    pub data: Vec<u8>,
    descriptor: OnceLock<Option<MessageDescriptor>>,
}

impl SchemaInfo {
    /// The descriptor of the messages, if the schema is a protobuf one that makes sense.
    pub fn descriptor(&self) -> Option<&MessageDescriptor> {
        let decode = || {
            if self.encoding != "protobuf" {
                return None;
            }
            let set = FileDescriptorSet::decode(self.data.as_slice()).ok()?;
            // prost-reflect 0.16 panics on a syntax that it does not know, such as `editions`.
            let is_known =
                |syntax: Option<&str>| matches!(syntax, None | Some("proto2" | "proto3"));
            if !set.file.iter().all(|file| is_known(file.syntax.as_deref())) {
                return None;
            }
            let pool = DescriptorPool::from_file_descriptor_set(set).ok()?;
            pool.get_message_by_name(&self.name)
        };
        self.descriptor.get_or_init(decode).as_ref()
    }
}

/// A channel of a log.
#[derive(Debug)]
pub struct ChannelInfo {
    /// Numbers the channels of a log in the order in which they are declared.
    pub(crate) serial: u32,
    /// Its topic.
    pub topic: String,
    /// The encoding of its messages.
    pub encoding: String,
    /// Its schema, if it has one.
    pub schema: Option<Arc<SchemaInfo>>,
    /// What else it says: `role` and `kind` in Farside's logs.
    pub metadata: BTreeMap<String, String>,
    pub(crate) schema_id: u16,
}

impl ChannelInfo {
    /// What the channel is for, in Farside's logs.
    pub fn role(&self) -> &str {
        self.metadata.get("role").map_or("", String::as_str)
    }

    fn says_the_same(&self, other: &ChannelRecord<'_>) -> bool {
        self.schema_id == other.schema_id
            && self.topic == other.topic
            && self.encoding == other.encoding
            && self.metadata == other.metadata
    }
}

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
    Attachment(AttachmentRecord<'a>),
    Metadata(String, BTreeMap<String, String>),
    /// Something that cannot be read; what comes behind it can.
    Damage {
        offset: u64,
        bytes: u64,
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
    /// A message of so many bytes on a channel that is not declared, as behind damage: what
    /// follows it can be read.
    Stray(u64, String),
}

/// Reads a file from its start to its end.
pub(crate) struct Scanner {
    path: PathBuf,
    frames: Frames,
    schemas: BTreeMap<u16, Arc<SchemaInfo>>,
    channels: Vec<Option<Arc<ChannelInfo>>>,
    serials: u32,
    /// The open chunk: where its frame starts, its records, and the place of the next one.
    chunk_frame: u64,
    chunk: Vec<u8>,
    next_inner: usize,
    data_ended: bool,
    over: bool,
    /// The message that was yielded last.
    last: Option<(MessageHeader, Position, Within)>,
}

/// Which buffer holds a message.
#[derive(Clone, Copy, PartialEq)]
enum Within {
    Chunk,
    Frame,
}

impl Scanner {
    pub(crate) fn open(path: &Path) -> Result<Self, LogError> {
        Ok(Scanner {
            path: path.to_owned(),
            frames: Frames::open(path)?,
            schemas: BTreeMap::new(),
            channels: Vec::new(),
            serials: 0,
            chunk_frame: 0,
            chunk: Vec::new(),
            next_inner: 0,
            data_ended: false,
            over: false,
            last: None,
        })
    }

    pub(crate) fn length(&self) -> u64 {
        self.frames.length()
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// The next thing in the file; `None` once it is over.
    pub(crate) fn next(&mut self) -> Result<Option<Item<'_>>, LogError> {
        loop {
            if self.next_inner < self.chunk.len() {
                match self.inner() {
                    Ok(Found::Other) => continue,
                    Ok(Found::Message(head, position)) => {
                        self.last = Some((head, position, Within::Chunk));
                        return Ok(self.current().map(Item::Message));
                    }
                    Ok(Found::Stray(bytes, what)) => {
                        let offset = self.chunk_frame;
                        return Ok(Some(Item::Damage {
                            offset,
                            bytes,
                            what,
                        }));
                    }
                    Err(what) => {
                        let bytes = (self.chunk.len() - self.next_inner) as u64;
                        self.next_inner = self.chunk.len();
                        let offset = self.chunk_frame;
                        return Ok(Some(Item::Damage {
                            offset,
                            bytes,
                            what,
                        }));
                    }
                }
            }
            if self.over {
                return Ok(None);
            }
            match self.frames.next()? {
                Frame::End => {
                    self.over = true;
                    return Ok(None);
                }
                Frame::Cut { offset, what } => {
                    self.over = true;
                    return Ok(Some(Item::Cut { offset, what }));
                }
                // What follows the data repeats it.
                Frame::Record { .. } if self.data_ended => {}
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
                    Err(Some(what)) => {
                        let bytes = self.frames.offset() - offset;
                        return Ok(Some(Item::Damage {
                            offset,
                            bytes,
                            what,
                        }));
                    }
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

    /// Goes on behind damage at `from`, at the next thing that looks like a chunk; false if there
    /// is none.
    pub(crate) fn resume(&mut self, from: u64) -> Result<bool, LogError> {
        match self.frames.find_chunk(from)? {
            Some(offset) => {
                self.frames.seek(offset)?;
                self.over = false;
                self.data_ended = false;
                Ok(true)
            }
            None => Ok(false),
        }
    }

    /// Where the next frame starts.
    pub(crate) fn offset(&self) -> u64 {
        self.frames.offset()
    }

    /// Opens the frame at `position` again, and gives the message there. For a scanner that has
    /// read the file once, and so knows its channels.
    pub(crate) fn message_at(
        &mut self,
        position: Position,
    ) -> Result<ScannedMessage<'_>, LogError> {
        const GONE: &str = "the file changed while it was read";
        if self.chunk_frame != position.frame || self.chunk.is_empty() {
            self.frames.seek(position.frame)?;
            let Frame::Record { opcode, offset } = self.frames.next()? else {
                return Err(LogError::damaged(&self.path, position.frame, GONE));
            };
            if opcode == op::CHUNK {
                let opened = self.open_chunk(offset);
                opened.map_err(|what| LogError::damaged(&self.path, offset, what))?;
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
        let found = match self.inner() {
            Ok(Found::Message(head, position)) => Some((head, position)),
            _ => None,
        };
        let message = found.and_then(|(head, position)| self.message(head, position));
        message.ok_or_else(|| LogError::damaged(&self.path, position.frame, GONE))
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
                let declared = declare(
                    opcode,
                    self.frames.content(),
                    &mut self.schemas,
                    &mut self.channels,
                    &mut self.serials,
                );
                declared.ok_or_else(malformed)?;
                Ok(Some(Found::Other))
            }
            op::MESSAGE => {
                let head = message_header(self.frames.content()).ok_or_else(malformed)?;
                self.check_channel(head.channel_id).map_err(Some)?;
                let position = Position {
                    frame: offset,
                    inner: 0,
                };
                Ok(Some(Found::Message(head, position)))
            }
            op::ATTACHMENT => match AttachmentRecord::parse(self.frames.content()) {
                Ok(_) => Ok(None),
                Err(what) => Err(Some(what.to_owned())),
            },
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
            _ => Ok(Some(Found::Other)),
        }
    }

    /// Yields a record that [`Scanner::top`] has found to be in order.
    fn item(&self, opcode: u8) -> Item<'_> {
        let content = self.frames.content();
        let mut parser = Parser::new(content);
        let lost = |what: &str| Item::Damage {
            offset: self.frames.offset(),
            bytes: 0,
            what: what.to_owned(),
        };
        match opcode {
            op::CHUNK => Item::Chunk {
                compression: ChunkRecord::parse(content).map_or("", |chunk| chunk.compression),
            },
            op::ATTACHMENT => match AttachmentRecord::parse(content) {
                Ok(attachment) => Item::Attachment(attachment),
                Err(what) => lost(what),
            },
            op::METADATA => match metadata(content) {
                Some((name, entries)) => Item::Metadata(name, entries),
                None => lost("a metadata record that is malformed"),
            },
            _ => Item::Header {
                profile: parser.text().unwrap_or_default(),
                library: parser.text().unwrap_or_default(),
            },
        }
    }

    fn open_chunk(&mut self, offset: u64) -> Result<(), String> {
        self.chunk_frame = offset;
        self.next_inner = 0;
        let opened = match ChunkRecord::parse(self.frames.content()) {
            None => Err("a chunk that is malformed".to_owned()),
            Some(chunk) => chunk.decompress(LIMIT_BYTES, &mut self.chunk),
        };
        if opened.is_err() {
            self.chunk.clear();
        }
        opened
    }

    /// Handles the next record of the open chunk.
    fn inner(&mut self) -> Result<Found, String> {
        let start = self.next_inner;
        let mut parser = Parser::new(&self.chunk[start..]);
        let mut head = || Some((parser.u8()?, parser.u64()?));
        let (opcode, length) = head().ok_or("a chunk that ends within a record")?;
        let content = parser
            .bytes(length)
            .ok_or("a chunk that ends within a record")?;
        self.next_inner = start + 9 + content.len();
        let malformed = || format!("a {} in a chunk that is malformed", describe(opcode));
        match opcode {
            op::MESSAGE => {
                let head = message_header(content).ok_or_else(malformed)?;
                if let Err(what) = self.check_channel(head.channel_id) {
                    return Ok(Found::Stray(content.len() as u64, what));
                }
                let inner = u32::try_from(start).map_err(|_| malformed())?;
                let position = Position {
                    frame: self.chunk_frame,
                    inner,
                };
                Ok(Found::Message(head, position))
            }
            op::SCHEMA | op::CHANNEL => {
                let declared = declare(
                    opcode,
                    content,
                    &mut self.schemas,
                    &mut self.channels,
                    &mut self.serials,
                );
                declared.ok_or_else(malformed)?;
                Ok(Found::Other)
            }
            0 => Err("opcode 0 in a chunk".to_owned()),
            _ => Ok(Found::Other),
        }
    }

    fn channel(&self, id: u16) -> Option<&Arc<ChannelInfo>> {
        self.channels.get(usize::from(id)).and_then(Option::as_ref)
    }

    fn check_channel(&self, id: u16) -> Result<(), String> {
        match self.channel(id) {
            Some(_) => Ok(()),
            None => Err(format!("a message on channel {id}, which is not declared")),
        }
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

fn declare(
    opcode: u8,
    content: &[u8],
    schemas: &mut BTreeMap<u16, Arc<SchemaInfo>>,
    channels: &mut Vec<Option<Arc<ChannelInfo>>>,
    serials: &mut u32,
) -> Option<()> {
    if opcode == op::SCHEMA {
        let schema = SchemaRecord::parse(content)?;
        let same = |known: &Arc<SchemaInfo>| {
            known.name == schema.name
                && known.encoding == schema.encoding
                && known.data == schema.data
        };
        if !schemas.get(&schema.id).is_some_and(same) {
            let info = SchemaInfo {
                name: schema.name.to_owned(),
                encoding: schema.encoding.to_owned(),
                data: schema.data.to_owned(),
                descriptor: OnceLock::new(),
            };
            schemas.insert(schema.id, Arc::new(info));
        }
        return Some(());
    }
    let channel = ChannelRecord::parse(content)?;
    let at = usize::from(channel.id);
    if channels.len() <= at {
        channels.resize(at + 1, None);
    }
    if !channels[at]
        .as_ref()
        .is_some_and(|known| known.says_the_same(&channel))
    {
        *serials += 1;
        channels[at] = Some(Arc::new(ChannelInfo {
            serial: *serials - 1,
            topic: channel.topic.to_owned(),
            encoding: channel.encoding.to_owned(),
            schema: schemas.get(&channel.schema_id).cloned(),
            metadata: channel.metadata,
            schema_id: channel.schema_id,
        }));
    }
    Some(())
}
