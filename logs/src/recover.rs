//! Saving what can be saved of a cut or damaged file.

use std::collections::BTreeMap;
use std::fmt;
use std::io::BufWriter;
use std::path::Path;
use std::sync::Arc;

use serde::Serialize;

use crate::LogError;
use crate::scan::{ChannelInfo, Item, ScannedMessage, Scanner};
use crate::writer::{Compression, mcap_options};

/// What was saved of a damaged file, and what was lost.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RecoverReport {
    /// Messages written.
    pub messages: u64,
    /// Chunks read.
    pub chunks: u64,
    /// Attachments written.
    pub attachments: u64,
    /// Metadata records written.
    pub metadata: u64,
    /// Bytes of the broken file that held nothing that could be read.
    pub bytes_lost: u64,
    /// How many separate losses there were.
    pub losses: u64,
    /// What was lost, in words: the first hundred losses.
    pub lost: Vec<String>,
}

/// Losses that are described; further ones are only counted.
const DESCRIBED: usize = 100;

impl RecoverReport {
    fn lose(&mut self, bytes: u64, what: String) {
        self.bytes_lost += bytes;
        self.losses += 1;
        if self.lost.len() < DESCRIBED && self.lost.last() != Some(&what) {
            self.lost.push(what);
        }
    }
}

impl fmt::Display for RecoverReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "saved {} messages from {} chunks, {} attachments, {} metadata records",
            self.messages, self.chunks, self.attachments, self.metadata
        )?;
        for lost in &self.lost {
            writeln!(f, "  lost: {lost}")?;
        }
        if self.losses > self.lost.len() as u64 {
            writeln!(
                f,
                "  and {} losses more",
                self.losses - self.lost.len() as u64
            )?;
        }
        match self.bytes_lost {
            0 => writeln!(f, "nothing that was in the file is lost"),
            bytes => writeln!(f, "{bytes} bytes held nothing that could be read"),
        }
    }
}

/// Writes every complete chunk and record of `broken` to a new file `out`, which is a whole MCAP
/// file whatever `broken` is.
///
/// ```no_run
/// let report = farside_logs::recover("broken.mcap", "fixed.mcap")?;
/// println!("{} messages saved, {} bytes lost", report.messages, report.bytes_lost);
/// # Ok::<(), farside_logs::LogError>(())
/// ```
///
/// # Errors
/// If `broken` does not even start like an MCAP file, or `out` cannot be written.
pub fn recover(broken: impl AsRef<Path>, out: impl AsRef<Path>) -> Result<RecoverReport, LogError> {
    let (broken, out) = (broken.as_ref(), out.as_ref());
    let mut scanner = Scanner::open(broken)?;
    if let (Ok(from), Ok(to)) = (broken.canonicalize(), out.canonicalize())
        && from == to
    {
        return Err(LogError::SameFile { path: from });
    }
    let mut saved = Saved::create(out)?;
    let mut report = RecoverReport::default();
    loop {
        // Where to look for a chunk, if nothing more can be read from here.
        let behind = match scanner.next() {
            Ok(None) => break,
            Ok(Some(Item::Cut { offset, what })) => Some((offset, what)),
            Ok(Some(item)) => {
                saved.add(item, &mut report)?;
                None
            }
            Err(LogError::TooLarge {
                offset,
                what,
                actual,
                ..
            }) => Some((
                offset,
                format!("a {what} of {actual} bytes, too large to be read"),
            )),
            Err(error) => return Err(error),
        };
        if let Some((offset, what)) = behind {
            let found = scanner.resume(offset + 1)?;
            let end = if found {
                scanner.offset()
            } else {
                scanner.length()
            };
            report.lose(end - offset, format!("{what}, at byte {offset}"));
            if !found {
                break;
            }
        }
    }
    saved.finish()?;
    Ok(report)
}

/// The file that is written.
struct Saved<'a> {
    path: &'a Path,
    /// Made when the first record comes, since the header of the broken file goes into it.
    writer: Option<mcap::Writer<BufWriter<std::fs::File>>>,
    header: (String, String),
    /// For each channel of the broken file, by its serial number: its id in the new file.
    channels: BTreeMap<u32, u16>,
    /// The records of one schema that were refused are all refused.
    refused: BTreeMap<u32, String>,
}

impl<'a> Saved<'a> {
    fn create(path: &'a Path) -> Result<Self, LogError> {
        Ok(Saved {
            path,
            writer: None,
            header: (String::new(), String::new()),
            channels: BTreeMap::new(),
            refused: BTreeMap::new(),
        })
    }

    fn writer(&mut self) -> Result<&mut mcap::Writer<BufWriter<std::fs::File>>, LogError> {
        if self.writer.is_none() {
            let file = std::fs::File::create(self.path)
                .map_err(|error| LogError::io(self.path, "create", error))?;
            let (profile, library) = std::mem::take(&mut self.header);
            let library = if library.is_empty() {
                "unknown".to_owned()
            } else {
                library
            };
            let recovered = match library.ends_with("(recovered)") {
                true => library,
                false => format!("{library} (recovered)"),
            };
            let writer = mcap_options(Compression::Zstd)
                .disable_seeking(false)
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

    fn add(&mut self, item: Item<'_>, report: &mut RecoverReport) -> Result<(), LogError> {
        let path = self.path;
        let refused = |error| LogError::mcap(path, error);
        match item {
            Item::Header { profile, library } => {
                self.header = (profile.to_owned(), library.to_owned());
            }
            Item::Chunk { .. } => report.chunks += 1,
            Item::Message(message) => self.message(&message, report)?,
            Item::Attachment(attachment) => {
                let attachment = mcap::Attachment {
                    log_time: attachment.log_time,
                    create_time: attachment.create_time,
                    name: attachment.name.to_owned(),
                    media_type: attachment.media_type.to_owned(),
                    data: attachment.data.into(),
                };
                self.writer()?.attach(&attachment).map_err(refused)?;
                report.attachments += 1;
            }
            Item::Metadata(name, metadata) => {
                let metadata = mcap::records::Metadata { name, metadata };
                self.writer()?.write_metadata(&metadata).map_err(refused)?;
                report.metadata += 1;
            }
            Item::Damage {
                offset,
                bytes,
                what,
            } => {
                report.lose(bytes, format!("{what}, at byte {offset}"));
            }
            Item::Cut { .. } => {}
        }
        Ok(())
    }

    fn message(
        &mut self,
        message: &ScannedMessage<'_>,
        report: &mut RecoverReport,
    ) -> Result<(), LogError> {
        let serial = message.channel.serial;
        let channel = match self.channels.get(&serial) {
            Some(channel) => *channel,
            None => {
                if self.refused.contains_key(&serial) {
                    report.bytes_lost += message.data.len() as u64;
                    return Ok(());
                }
                match self.declare(message.channel)? {
                    Ok(channel) => channel,
                    Err(reason) => {
                        let topic = &message.channel.topic;
                        let bytes = message.data.len() as u64;
                        report.lose(bytes, format!("all messages on {topic}: {reason}"));
                        self.refused.insert(serial, reason);
                        return Ok(());
                    }
                }
            }
        };
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            ..message.head
        };
        let path = self.path;
        let written = self.writer()?.write_to_known_channel(&header, message.data);
        written.map_err(|error| LogError::mcap(path, error))?;
        report.messages += 1;
        Ok(())
    }

    /// Declares a channel; the inner error is why the new file cannot have it.
    fn declare(&mut self, channel: &Arc<ChannelInfo>) -> Result<Result<u16, String>, LogError> {
        let path = self.path;
        let writer = self.writer()?;
        let schema = match &channel.schema {
            None => Ok(0),
            Some(schema) => writer.add_schema(&schema.name, &schema.encoding, &schema.data),
        };
        let added = schema.and_then(|schema| {
            writer.add_channel(schema, &channel.topic, &channel.encoding, &channel.metadata)
        });
        match added {
            Ok(id) => {
                self.channels.insert(channel.serial, id);
                Ok(Ok(id))
            }
            Err(error @ mcap::McapError::Io(_)) => Err(LogError::mcap(path, error)),
            Err(error) => Ok(Err(error.to_string())),
        }
    }

    fn finish(mut self) -> Result<(), LogError> {
        let path = self.path;
        let io = |error| LogError::io(path, "write", error);
        self.writer()?
            .finish()
            .map_err(|error| LogError::mcap(path, error))?;
        let Some(writer) = self.writer else {
            return Ok(());
        };
        let buffered = writer.into_inner();
        let file = buffered
            .into_inner()
            .map_err(|error| io(error.into_error()))?;
        file.sync_all().map_err(io)
    }
}
