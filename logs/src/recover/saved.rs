//! The file that recovery writes.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufWriter, Write};
use std::path::Path;

use mcap::records::{AttachmentHeader, MessageHeader, Metadata};
use tempfile::NamedTempFile;

use super::tally::Tally;
use super::{FirstDeclared, RecoverReport};
use crate::LogError;
use crate::parse::{ChannelRecord, SchemaRecord};
use crate::salvage::{Counted, Part};
use crate::source::{Attached, Source, Sum};

/// A schema or a channel, owned.
#[derive(Clone, PartialEq)]
pub(super) enum Declaration {
    Schema {
        name: String,
        encoding: String,
        data: Vec<u8>,
    },
    Channel {
        schema_id: u16,
        topic: String,
        encoding: String,
        metadata: BTreeMap<String, String>,
    },
}

impl Declaration {
    pub(super) fn schema(record: &SchemaRecord<'_>) -> Self {
        Declaration::Schema {
            name: record.name.to_owned(),
            encoding: record.encoding.to_owned(),
            data: record.data.to_owned(),
        }
    }

    pub(super) fn channel(record: &ChannelRecord<'_>) -> Self {
        Declaration::Channel {
            schema_id: record.schema_id,
            topic: record.topic.to_owned(),
            encoding: record.encoding.to_owned(),
            metadata: record.metadata.clone(),
        }
    }
}

type McapWriter = mcap::Writer<BufWriter<NamedTempFile>>;

/// The file that is written, beside where it is to be.
pub(super) struct Saved<'a> {
    path: &'a Path,
    /// The broken file again, for the data of its attachments.
    source: Source,
    /// Made when the first record comes, since the header of the broken file goes into it.
    writer: Option<McapWriter>,
    file: Option<NamedTempFile>,
    header: Option<(String, String)>,
    known: FirstDeclared,
    /// What is declared at this point of the broken file, by its ids.
    schemas: BTreeMap<u16, Declaration>,
    channels: BTreeMap<u16, (Declaration, Result<u16, String>)>,
    /// Ids of channels of the new file.
    taken: BTreeSet<u16>,
    /// The end of the data was found.
    ended: bool,
    tally: Tally,
    report: RecoverReport,
}

impl<'a> Saved<'a> {
    pub(super) fn create(
        broken: &Path,
        path: &'a Path,
        known: FirstDeclared,
        counted: Option<Counted>,
    ) -> Result<Self, LogError> {
        let folder = path.parent().filter(|folder| *folder != Path::new(""));
        let folder = folder.unwrap_or(Path::new("."));
        let mut builder = tempfile::Builder::new();
        builder.prefix(".recover-").suffix(".part");
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // As other new files: the system takes away what the user's mask says.
            builder.permissions(std::fs::Permissions::from_mode(0o666));
        }
        let file = builder.tempfile_in(folder);
        let file = file.map_err(|error| LogError::io(path, "create", error))?;
        Ok(Saved {
            path,
            source: Source::open(broken)?,
            writer: None,
            file: Some(file),
            header: None,
            known,
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
            taken: BTreeSet::new(),
            ended: false,
            tally: Tally::new(counted),
            report: RecoverReport::default(),
        })
    }

    fn writer(&mut self) -> Result<&mut McapWriter, LogError> {
        if let (None, Some(file)) = (&self.writer, self.file.take()) {
            let (profile, library) = self.header.clone().unwrap_or_default();
            let library = if library.is_empty() {
                "unknown".to_owned()
            } else {
                library
            };
            let recovered = match library.ends_with("(recovered)") {
                true => library,
                false => format!("{library} (recovered)"),
            };
            let writer = mcap::WriteOptions::new()
                // Its default follows the machine, and changes the bytes.
                .compression_threads(0)
                .profile(profile)
                .library(recovered)
                .create(BufWriter::new(file))
                .map_err(|error| LogError::mcap(self.path, error))?;
            self.writer = Some(writer);
        }
        match &mut self.writer {
            Some(writer) => Ok(writer),
            None => Err(LogError::Unfinished {
                path: self.path.to_owned(),
            }),
        }
    }

    pub(super) fn add(&mut self, part: Part<'_>) -> Result<(), LogError> {
        let path = self.path;
        let refused = |error| LogError::mcap(path, error);
        match part {
            Part::Header { profile, library } => {
                let header = (profile.to_owned(), library.to_owned());
                self.header.get_or_insert(header);
            }
            Part::Chunk => {
                self.report.chunks += 1;
                self.tally.chunk();
            }
            Part::Index { channel, messages } => self.tally.index(channel, messages),
            Part::DataEnd => self.ended = true,
            Part::Schema {
                record,
                in_summary,
                sure,
            } => {
                let declared = Declaration::schema(&record);
                let declared =
                    FirstDeclared::surest(&self.known.schemas, record.id, declared, sure);
                if !(in_summary && self.schemas.contains_key(&record.id)) {
                    self.schemas.insert(record.id, declared);
                }
            }
            Part::Channel {
                record,
                in_summary,
                sure,
            } => {
                let declared = Declaration::channel(&record);
                let declared =
                    FirstDeclared::surest(&self.known.channels, record.id, declared, sure);
                self.channel(record.id, declared, in_summary)?;
            }
            Part::Message { head, data, sure } => self.message(head, data, sure)?,
            Part::Metadata(name, metadata) => {
                let metadata = Metadata { name, metadata };
                self.writer()?.write_metadata(&metadata).map_err(refused)?;
                self.report.metadata += 1;
            }
            Part::Attachment(attached) => self.attachment(&attached)?,
            Part::Private { opcode, data } => {
                let options = Default::default();
                let written = self.writer()?.write_private_record(opcode, data, options);
                written.map_err(refused)?;
                let what = "kept as they are, whatever they mean";
                self.report
                    .note(format!("private records of opcode 0x{opcode:02x}: {what}"));
            }
            Part::Lost {
                bytes,
                what,
                messages,
            } => {
                if messages {
                    self.tally.lost();
                }
                self.report.lose(bytes, what);
            }
            Part::Note(what) => self.report.note(what),
        }
        Ok(())
    }

    /// Declares a channel under the id that it has in the broken file, or under a free one.
    fn channel(
        &mut self,
        id: u16,
        declared: Declaration,
        in_summary: bool,
    ) -> Result<(), LogError> {
        let known = self.channels.get(&id).map(|(known, _)| known);
        if known.is_some_and(|known| in_summary || *known == declared) {
            return Ok(());
        }
        let written = self.declare(id, &declared)?;
        if let (Err(reason), Declaration::Channel { topic, .. }) = (&written, &declared) {
            self.report
                .lose(0, format!("channel {topic} and its messages: {reason}"));
        }
        self.channels.insert(id, (declared, written));
        Ok(())
    }

    /// Writes a channel and its schema; the inner error is why the new file cannot have it.
    fn declare(
        &mut self,
        id: u16,
        declared: &Declaration,
    ) -> Result<Result<u16, String>, LogError> {
        let Declaration::Channel {
            schema_id,
            topic,
            encoding,
            metadata,
        } = declared
        else {
            return Ok(Err("it is no channel".to_owned()));
        };
        let known = || self.known.schemas.get(schema_id).map(|(known, _)| known);
        let schema = self.schemas.get(schema_id).or_else(known).cloned();
        if schema.is_none() && *schema_id != 0 {
            let what = format!("the schema of {topic}, which is nowhere in the file");
            self.report.lose(0, what);
        }
        let free = (1..=u16::MAX).find(|id| !self.taken.contains(id));
        let new = Some(id).filter(|id| !self.taken.contains(id)).or(free);
        let Some(new) = new else {
            return Ok(Err("no channel is left for it".to_owned()));
        };
        let path = self.path;
        let writer = self.writer()?;
        let schema = match &schema {
            Some(Declaration::Schema {
                name,
                encoding,
                data,
            }) => writer.add_schema(name, encoding, data),
            _ => Ok(0),
        };
        let added = schema
            .and_then(|schema| writer.add_channel_with_id(new, schema, topic, encoding, metadata));
        match added {
            Ok(id) => {
                self.taken.insert(id);
                self.report.channels += 1;
                Ok(Ok(id))
            }
            Err(error @ mcap::McapError::Io(_)) => Err(LogError::mcap(path, error)),
            Err(error) => Ok(Err(error.to_string())),
        }
    }

    fn message(&mut self, head: MessageHeader, data: &[u8], sure: bool) -> Result<(), LogError> {
        let id = head.channel_id;
        if !self.channels.contains_key(&id)
            && let Some((declared, _)) = self.known.channels.get(&id).cloned()
        {
            self.channel(id, declared, true)?;
        }
        let channel = match self.channels.get(&id) {
            Some((_, Ok(channel))) => *channel,
            Some((_, Err(_))) => {
                self.tally.lost();
                self.report.bytes_lost += data.len() as u64;
                return Ok(());
            }
            None => {
                let what = format!("messages on channel {id}, which is not declared anywhere");
                self.tally.lost();
                self.report.lose(data.len() as u64, what);
                return Ok(());
            }
        };
        let header = MessageHeader {
            channel_id: channel,
            ..head
        };
        let path = self.path;
        let written = self.writer()?.write_to_known_channel(&header, data);
        written.map_err(|error| LogError::mcap(path, error))?;
        self.report.messages += 1;
        self.tally.saved(id, head.log_time);
        self.report.unchecked += u64::from(!sure);
        Ok(())
    }

    /// Copies an attachment, a part of it at a time.
    fn attachment(&mut self, attached: &Attached) -> Result<(), LogError> {
        let path = self.path;
        let refused = |error| LogError::mcap(path, error);
        let header = AttachmentHeader {
            log_time: attached.log_time,
            create_time: attached.create_time,
            name: attached.name.clone(),
            media_type: attached.media_type.clone(),
        };
        let (from, bytes) = (attached.data, attached.data_bytes);
        self.writer()?
            .start_attachment(bytes, header)
            .map_err(refused)?;
        let (source, writer) = (&mut self.source, &mut self.writer);
        source.each(from, from + bytes, |part| match writer {
            Some(writer) => writer.put_attachment_bytes(part).map_err(refused),
            None => Ok(()),
        })?;
        self.writer()?.finish_attachment().map_err(refused)?;
        self.report.attachments += 1;
        if let Sum::Differs(_) = attached.sum {
            let name = &attached.name;
            let what = format!("attachment {name} does not match its checksum: saved as it is");
            self.report.lose(0, what);
        }
        Ok(())
    }

    /// Ends the file and gives it its name.
    pub(super) fn finish(mut self) -> Result<RecoverReport, LogError> {
        let path = self.path;
        let io = |error| LogError::io(path, "write", error);
        let finished = self.writer()?.finish();
        finished.map_err(|error| LogError::mcap(path, error))?;
        if let Some(writer) = self.writer {
            let buffered = writer.into_inner();
            let mut file = buffered
                .into_inner()
                .map_err(|error| io(error.into_error()))?;
            file.flush().map_err(io)?;
            file.as_file().sync_all().map_err(io)?;
            file.persist(path).map_err(|error| io(error.error))?;
        }
        self.report.cut = !self.ended;
        let topic = |channel| match self.known.channels.get(&channel) {
            Some((Declaration::Channel { topic, .. }, _)) => Some(topic.clone()),
            _ => None,
        };
        self.report.lost_messages = self.tally.finish(self.report.cut, topic);
        Ok(self.report)
    }
}
