//! Reading Farside's own logs: what a log says about its run, and its records one after the other.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use farside::record::RecordClass;
use farside::{Carriage, MatchKey};

use crate::LogError;
use crate::channel::{ChannelInfo, Role};
use crate::envelope::{CheckpointRef, KeyRef, RecordRef};
use crate::frames::{HEAD_BYTES, LIMIT_BYTES};
use crate::scan::{Item, Position, ScannedMessage, Scanner};
use crate::source::{Attached, Sum};
use crate::writer::{Attachment, FORMAT_MAJOR, FORMAT_MINOR, SCENARIO_ATTACHMENT};

/// What a log says at its start.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Head {
    pub(crate) format: String,
    pub(crate) code_version: String,
    pub(crate) seed: u64,
    pub(crate) tie_seed: Option<u64>,
    pub(crate) scenario: String,
    pub(crate) scenario_hash: String,
    pub(crate) epoch_ns: u64,
    pub(crate) exclude: Vec<String>,
}

impl Head {
    /// Reads the metadata record `farside`.
    pub(crate) fn read(path: &Path, head: &BTreeMap<String, String>) -> Result<Head, LogError> {
        let text = |key: &str| head.get(key).cloned().unwrap_or_default();
        let missing = |key: &str| LogError::NotFarside {
            path: path.to_owned(),
            missing: format!("its metadata has no {key} that is a number"),
        };
        let number = |key: &str| text(key).parse::<u64>().map_err(|_| missing(key));
        let format = text("format");
        let major = format
            .split('.')
            .next()
            .and_then(|major| major.parse::<u32>().ok());
        if major != Some(FORMAT_MAJOR) {
            return Err(LogError::Format {
                path: path.to_owned(),
                expected: format!(
                    "{FORMAT_MAJOR}.0 and what is compatible, up to {FORMAT_MAJOR}.{FORMAT_MINOR} fully"
                ),
                actual: format,
            });
        }
        Ok(Head {
            format,
            code_version: text("code_version"),
            seed: number("seed")?,
            tie_seed: head.get("tie_seed").and_then(|seed| seed.parse().ok()),
            scenario: text("scenario"),
            scenario_hash: text("scenario_hash"),
            epoch_ns: text("epoch_ns").parse().unwrap_or(0),
            exclude: serde_json::from_str(&text("exclude")).unwrap_or_default(),
        })
    }
}

/// A Farside log: what it says at its start, and a way to its records.
///
/// ```no_run
/// use farside::record::RecordClass;
///
/// let log = farside_logs::Log::open("run.mcap")?;
/// println!("{} with seed {}", log.scenario_name(), log.seed());
/// let mut records = log.records()?;
/// while let Some((record, _channel)) = records.next_ref()? {
///     if record.class == RecordClass::Lost {
///         println!("{} to {}: {}", record.sender, record.receiver, record.reason);
///     }
/// }
/// # Ok::<(), farside_logs::LogError>(())
/// ```
#[derive(Debug)]
pub struct Log {
    path: PathBuf,
    head: Head,
    metadata: BTreeMap<String, BTreeMap<String, String>>,
    attachments: Vec<Attachment>,
}

impl Log {
    /// Reads the start of the log at `path`: metadata and attachments.
    ///
    /// # Errors
    /// If the file cannot be read or is no log of a Farside run.
    pub fn open(path: impl AsRef<Path>) -> Result<Log, LogError> {
        Log::read(path.as_ref(), |_| true)
    }

    /// Reads the start of a log, and those of its attachments that are `wanted` by name.
    pub(crate) fn read(path: &Path, wanted: fn(&str) -> bool) -> Result<Log, LogError> {
        let path = path.to_owned();
        let mut scanner = Scanner::outside_chunks(&path)?;
        let mut metadata = BTreeMap::new();
        let mut attached = Vec::new();
        while let Some(item) = scanner.next()? {
            match item {
                Item::Metadata(name, entries) => {
                    metadata.insert(name, entries);
                }
                Item::Attachment(attachment) if wanted(&attachment.name) => {
                    attached.push(attachment);
                }
                Item::Damage { offset, what, .. } => {
                    return Err(LogError::damaged(&path, offset, what));
                }
                Item::Chunk { .. } | Item::Message(_) | Item::Cut { .. } => break,
                _ => {}
            }
        }
        let Some(head) = metadata.get("farside") else {
            return Err(LogError::NotFarside {
                path,
                missing: "it has no metadata record called farside in front of its messages"
                    .to_owned(),
            });
        };
        let head = Head::read(&path, head)?;
        // Only now: other files' attachments are not held.
        let read = |attached| attachment(&path, &mut scanner, attached);
        let attachments: Result<_, _> = attached.into_iter().map(read).collect();
        let attachments = attachments?;
        Ok(Log {
            path,
            head,
            metadata,
            attachments,
        })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The run's seed.
    pub fn seed(&self) -> u64 {
        self.head.seed
    }

    /// The run's tie seed, if ties were shuffled.
    pub fn tie_seed(&self) -> Option<u64> {
        self.head.tie_seed
    }

    /// The version of the code that ran.
    pub fn code_version(&self) -> &str {
        &self.head.code_version
    }

    /// The scenario's name.
    pub fn scenario_name(&self) -> &str {
        &self.head.scenario
    }

    /// The resolved scenario; none if the log is cut before it.
    pub fn scenario(&self) -> Option<&str> {
        let found = self
            .attachments
            .iter()
            .find(|a| a.name == SCENARIO_ATTACHMENT)?;
        std::str::from_utf8(&found.bytes).ok()
    }

    /// When the run's time zero is by the log's times, in nanoseconds.
    pub fn epoch_ns(&self) -> u64 {
        self.head.epoch_ns
    }

    /// The topics that were not written, as globs.
    pub fn exclude(&self) -> &[String] {
        &self.head.exclude
    }

    /// The metadata records at the start of the log: `farside`, `farside.run`, `farside.host`.
    pub fn metadata(&self) -> &BTreeMap<String, BTreeMap<String, String>> {
        &self.metadata
    }

    /// The attachments at the start of the log, the resolved scenario among them.
    pub fn attachments(&self) -> &[Attachment] {
        &self.attachments
    }

    /// The records, from the first one on.
    pub fn records(&self) -> Result<Records, LogError> {
        self.records_but(|_| false)
    }

    /// The records, but for those of some channels.
    pub(crate) fn records_but(
        &self,
        which: impl Fn(&ChannelInfo) -> bool + Send + 'static,
    ) -> Result<Records, LogError> {
        let mut scanner = Scanner::open(&self.path)?;
        scanner.pass_over(move |channel| channel.role == Role::Other || which(channel));
        Ok(Records {
            scanner,
            epoch_ns: self.head.epoch_ns,
            ending: Ending::default(),
        })
    }

    pub(crate) fn head(&self) -> &Head {
        &self.head
    }
}

/// Reads an attachment whole and compares its checksum.
fn attachment(
    path: &Path,
    scanner: &mut Scanner,
    mut attached: Attached,
) -> Result<Attachment, LogError> {
    if attached.data_bytes > LIMIT_BYTES {
        return Err(LogError::TooLarge {
            path: path.to_owned(),
            what: "attachment",
            offset: attached.content - HEAD_BYTES,
            actual: attached.data_bytes,
            limit: LIMIT_BYTES,
        });
    }
    scanner.sum(&mut attached)?;
    if let Sum::Differs(_) = attached.sum {
        let what = "an attachment whose checksum does not match";
        return Err(LogError::damaged(path, attached.content - HEAD_BYTES, what));
    }
    let bytes = scanner.attachment_data(&attached)?.to_owned();
    Ok(Attachment {
        name: attached.name,
        media_type: attached.media_type,
        bytes,
    })
}

/// How a log ends.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ending {
    /// The metadata record `farside.end`: digest, counts, why the run ended. None if it is missing.
    pub end: Option<BTreeMap<String, String>>,
    /// Where the file is cut, and what is cut; none if it is whole.
    pub cut: Option<(u64, String)>,
}

impl Ending {
    /// What is missing, in words; none for a whole log.
    pub fn missing(&self) -> Option<String> {
        match (&self.cut, &self.end) {
            (Some((offset, what)), _) => Some(format!("cut at byte {offset}: {what}")),
            (None, None) => Some("no farside.end: the run did not end in this log".to_owned()),
            (None, Some(_)) => None,
        }
    }

    pub(crate) fn text(&self, key: &str) -> Option<&str> {
        self.end.as_ref()?.get(key).map(String::as_str)
    }
}

/// What [`Records::step`] came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Step {
    Record,
    Sample,
    Checkpoint,
    End,
}

/// Reads the records of a log one after the other, holding one chunk at a time.
///
/// As an iterator it yields owned records; [`Records::next_ref`] copies nothing.
pub struct Records {
    scanner: Scanner,
    epoch_ns: u64,
    ending: Ending,
}

impl Records {
    /// Goes to the next message of the log.
    pub(crate) fn step(&mut self) -> Result<Step, LogError> {
        loop {
            match self.scanner.next()? {
                None => return Ok(Step::End),
                Some(Item::Message(message)) => match message.channel.role {
                    Role::Record => return Ok(Step::Record),
                    Role::Checkpoint => return Ok(Step::Checkpoint),
                    Role::Sample => return Ok(Step::Sample),
                    Role::Other => {}
                },
                Some(Item::Metadata(name, entries)) if name == "farside.end" => {
                    self.ending.end = Some(entries);
                }
                Some(Item::Cut { offset, what }) => self.ending.cut = Some((offset, what)),
                Some(Item::Damage { offset, what, .. }) => {
                    return Err(LogError::damaged(self.scanner.path(), offset, what));
                }
                Some(_) => {}
            }
        }
    }

    pub(crate) fn message(&self) -> Result<ScannedMessage<'_>, LogError> {
        let gone = || LogError::damaged(self.scanner.path(), self.scanner.offset(), "no message");
        self.scanner.current().ok_or_else(gone)
    }

    /// Passes over records by what they say; see [`Records::passed`].
    pub(crate) fn pass_over(&mut self, which: impl Fn(&[u8]) -> bool + Send + 'static) {
        self.scanner.pass_over_records(which);
    }

    /// When the last record is that was passed over, where, and on which channel.
    pub(crate) fn passed(&self) -> Option<(u64, Position, u32)> {
        let (head, position, serial) = self.scanner.passed()?;
        Some((head.log_time, position, serial))
    }

    /// A message that was read before, with the serial number of its channel.
    pub(crate) fn message_at(
        &mut self,
        position: Position,
        serial: u32,
    ) -> Result<ScannedMessage<'_>, LogError> {
        self.scanner.message_at(position, serial)
    }

    /// The record that [`Records::step`] came to.
    pub(crate) fn record(&self) -> Result<(RecordRef<'_>, ScannedMessage<'_>), LogError> {
        let message = self.message()?;
        let record = RecordRef::read(message.data);
        let record = record.ok_or_else(|| self.malformed(&message))?;
        Ok((record, message))
    }

    /// The checkpoint that [`Records::step`] came to.
    pub(crate) fn checkpoint(&self) -> Result<CheckpointRef<'_>, LogError> {
        let message = self.message()?;
        CheckpointRef::read(message.data).ok_or_else(|| self.malformed(&message))
    }

    fn malformed(&self, message: &ScannedMessage<'_>) -> LogError {
        let what = format!("a message on {} that is malformed", message.channel.topic);
        LogError::damaged(self.scanner.path(), message.position.frame, what)
    }

    /// The next record and its channel; none at the end of the log. State samples come as records
    /// of class [`RecordClass::Sample`] with sender, kind, time and body.
    pub fn next_ref(&mut self) -> Result<Option<(RecordRef<'_>, &ChannelInfo)>, LogError> {
        loop {
            match self.step()? {
                Step::End => return Ok(None),
                Step::Checkpoint => {}
                Step::Sample => return Ok(Some(self.sample()?)),
                Step::Record => {
                    let (record, message) = self.record()?;
                    return Ok(Some((record, message.channel)));
                }
            }
        }
    }

    /// The state sample that [`Records::step`] came to, as a record.
    pub(crate) fn sample(&self) -> Result<(RecordRef<'_>, &ChannelInfo), LogError> {
        let message = self.message()?;
        let sender = message.channel.sampled();
        let time_ns = message.head.log_time.saturating_sub(self.epoch_ns);
        let record = RecordRef {
            class: RecordClass::Sample,
            key: KeyRef {
                time_ns,
                source: sender,
                ..KeyRef::default()
            },
            cause: None,
            sender,
            receiver: sender,
            link: "",
            kind: message
                .channel
                .metadata
                .get("kind")
                .map_or("", String::as_str),
            ordinal: u64::from(message.head.sequence),
            copy: 0,
            match_key: None,
            sent_ns: time_ns,
            reason: "",
            body: message.data,
            note: "",
            carriage: None,
        };
        Ok((record, message.channel))
    }

    /// How the log ends: complete once the last record was read.
    pub fn ending(&self) -> &Ending {
        &self.ending
    }
}

impl Iterator for Records {
    type Item = Result<LoggedRecord, LogError>;

    fn next(&mut self) -> Option<Self::Item> {
        let next = self.next_ref();
        next.map(|found| found.map(|(record, channel)| LoggedRecord::of(&record, channel)))
            .transpose()
    }
}

/// An event's key as a log holds it, owned. See [`KeyRef`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LoggedKey {
    /// When the event happens, in nanoseconds since the start.
    pub time_ns: u64,
    /// Zero-delay hops since the last positive delay.
    pub step: u32,
    /// The hash by which a tie seed orders sources; 0 without one.
    pub tie: u32,
    /// Who caused the event.
    pub source: String,
    /// The source's own counter.
    pub count: u64,
}

impl LoggedKey {
    /// The key, to be compared with others.
    pub(crate) fn to_ref(&self) -> KeyRef<'_> {
        KeyRef {
            time_ns: self.time_ns,
            step: self.step,
            tie: self.tie,
            source: &self.source,
            count: self.count,
        }
    }

    pub(crate) fn of(key: &KeyRef<'_>) -> Self {
        LoggedKey {
            time_ns: key.time_ns,
            step: key.step,
            tie: key.tie,
            source: key.source.to_owned(),
            count: key.count,
        }
    }
}

/// One record of a log, owned. See [`RecordRef`].
#[derive(Clone, Debug, PartialEq)]
pub struct LoggedRecord {
    /// What the record is about.
    pub class: RecordClass,
    /// The topic it was written to.
    pub topic: String,
    /// The key of the event.
    pub key: LoggedKey,
    /// The key of the event that caused this one.
    pub cause: Option<LoggedKey>,
    /// Who sent the message; for other events, who they happen to, or `@control`.
    pub sender: String,
    /// Who the message is for; for other events, who they happen to.
    pub receiver: String,
    /// The link that carried it; none within a host.
    pub link: Option<String>,
    /// The type of the body; empty where there is none.
    pub kind: String,
    /// The message's place in the flow (sender, receiver, kind).
    pub ordinal: u64,
    /// Which copy of the message this is.
    pub copy: u32,
    /// The protocol's own identity for the message, if it gave one.
    pub match_key: Option<MatchKey>,
    /// When the message was sent, in nanoseconds since the start.
    pub sent_ns: u64,
    /// Why the message was lost; empty otherwise.
    pub reason: String,
    /// The encoded message.
    pub body: Vec<u8>,
    /// What there is to say about an event without a body.
    pub note: String,
    /// How the link carried it, where the link says.
    pub carriage: Option<Carriage>,
}

impl LoggedRecord {
    /// The record without its body, for those who want to know what happened and not what was said.
    ///
    /// ```no_run
    /// let mut records = farside_logs::Log::open("run.mcap")?.records()?;
    /// while let Some((record, channel)) = records.next_ref()? {
    ///     let kept = farside_logs::LoggedRecord::bodiless(&record, channel);
    ///     assert!(kept.body.is_empty());
    /// }
    /// # Ok::<(), farside_logs::LogError>(())
    /// ```
    pub fn bodiless(record: &RecordRef<'_>, channel: &ChannelInfo) -> Self {
        let record = RecordRef {
            body: &[],
            ..*record
        };
        LoggedRecord::of(&record, channel)
    }

    fn of(record: &RecordRef<'_>, channel: &ChannelInfo) -> Self {
        LoggedRecord {
            class: record.class,
            topic: channel.topic.clone(),
            key: LoggedKey::of(&record.key),
            cause: record.cause.as_ref().map(LoggedKey::of),
            sender: record.sender.to_owned(),
            receiver: record.receiver.to_owned(),
            link: Some(record.link)
                .filter(|link| !link.is_empty())
                .map(str::to_owned),
            kind: record.kind.to_owned(),
            ordinal: record.ordinal,
            copy: record.copy,
            match_key: record.match_key.map(MatchKey::from_bits),
            sent_ns: record.sent_ns,
            reason: record.reason.to_owned(),
            body: record.body.to_owned(),
            note: record.note.to_owned(),
            carriage: record.carriage,
        }
    }
}
