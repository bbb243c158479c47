//! What is in a log, at a glance: for Farside's own logs and for any other MCAP file.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

use farside::Counts;
use serde::Serialize;

use crate::LogError;
use crate::channel::ChannelInfo;
use crate::envelope::{RecordRef, seconds};
use crate::fields::{self, Encoded};
use crate::frames::{Care, HEAD_BYTES};
use crate::group;
use crate::log::Head;
use crate::scan::{Item, ScannedMessage, Scanner};
use crate::shown::{Seconds, Shown};
use crate::source::Sum;

/// What a Farside log says about its run.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RunSummary {
    /// The version of the log format, `major.minor`.
    pub format: String,
    /// The version of the code that ran.
    pub code_version: String,
    /// The run's seed.
    pub seed: u64,
    /// The tie seed, if ties were shuffled.
    pub tie_seed: Option<u64>,
    /// The scenario's name.
    pub scenario: String,
    /// The hash of the resolved scenario.
    pub scenario_hash: String,
    /// Topics that were not written, as globs.
    pub exclude: Vec<String>,
    /// The digest; none if the log is cut.
    pub digest: Option<String>,
    /// Why the run ended, in one word; none if the log is cut.
    pub end: Option<String>,
    /// What there is to say about the end beyond that word.
    pub end_detail: String,
    /// The virtual time of the end, in seconds.
    pub end_time_s: Option<f64>,
    /// The same in nanoseconds.
    pub end_time_ns: Option<u64>,
    /// What the run counted.
    pub counts: Option<Counts>,
    /// The checkpoints in the log.
    pub checkpoints: u64,
}

/// One topic of a log.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TopicInfo {
    /// The topic.
    pub topic: String,
    /// The name of its schema; empty if it has none.
    pub schema: String,
    /// The encoding of its messages.
    pub encoding: String,
    /// What the topic is for, in Farside's logs: `message`, `event`, `state`, ...
    pub role: String,
    /// How many channels it has: more than one where several programs publish on it.
    pub channels: u64,
    /// How many messages it has.
    pub messages: u64,
    /// Their size before compression, in bytes.
    pub bytes: u64,
}

/// A control event of a run: a crash, a restart, a link's change, something that an actor is told.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ControlInfo {
    /// When, in seconds of virtual time.
    pub time_s: f64,
    /// What: `crash`, `restart`, `change`, `told`.
    pub class: String,
    /// Whom it happened to: an actor or a link.
    pub to: String,
    /// What it was told, as `Kind {...}` in JSON; empty for crashes and restarts.
    pub body: String,
}

/// One attachment of a log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AttachmentInfo {
    /// Its name.
    pub name: String,
    /// Its media type.
    pub media_type: String,
    /// Its size, in bytes.
    pub bytes: u64,
    /// False if its data does not match its checksum.
    pub intact: bool,
}

/// What is in a log.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LogInfo {
    /// The file.
    pub path: String,
    /// Its size, in bytes.
    pub bytes: u64,
    /// The MCAP profile; empty if none is declared.
    pub profile: String,
    /// The library that wrote it.
    pub library: String,
    /// What a Farside log says about its run; none for other files.
    pub run: Option<RunSummary>,
    /// What is missing or damaged; empty for a whole log.
    pub missing: Vec<String>,
    /// How many messages there are on all topics.
    pub messages: u64,
    /// The earliest time of a message, in seconds.
    pub start_s: Option<f64>,
    /// The latest time of a message, in seconds.
    pub end_s: Option<f64>,
    /// The earliest time of a message, in nanoseconds.
    pub start_ns: Option<u64>,
    /// The latest time of a message, in nanoseconds.
    pub end_ns: Option<u64>,
    /// From the earliest to the latest message, in seconds.
    pub duration_s: f64,
    /// How many chunks there are, by compression.
    pub chunks: BTreeMap<String, u64>,
    /// The first control events, in the order in which they happened, at most 20.
    pub controls: Vec<ControlInfo>,
    /// How many control events there are.
    pub control_events: u64,
    /// The topics, in name order.
    pub topics: Vec<TopicInfo>,
    /// The attachments, in file order.
    pub attachments: Vec<AttachmentInfo>,
    /// The metadata records, by name; of one name there may be several, in file order.
    pub metadata: BTreeMap<String, Vec<BTreeMap<String, String>>>,
    /// How many records there are of kinds that MCAP does not have, by opcode.
    pub strange: BTreeMap<u8, u64>,
}

impl LogInfo {
    /// Notes what is beside the messages.
    fn add_other(&mut self, item: Item<'_>) {
        match item {
            Item::Attachment(attached) => {
                let intact = !matches!(attached.sum, Sum::Differs(_));
                if !intact {
                    let (name, offset) = (&attached.name, attached.content - HEAD_BYTES);
                    let what = "does not match its checksum";
                    self.miss(format!("attachment {name} at byte {offset} {what}"));
                }
                self.attachments.push(AttachmentInfo {
                    name: attached.name,
                    media_type: attached.media_type,
                    bytes: attached.data_bytes,
                    intact,
                });
            }
            Item::Metadata(name, entries) => {
                self.metadata.entry(name).or_default().push(entries);
            }
            Item::Strange(opcode) => *self.strange.entry(opcode).or_default() += 1,
            Item::Damage { offset, what, .. } => {
                self.miss(format!("damaged at byte {offset}: {what}"));
            }
            Item::Cut { offset, what } => {
                self.missing.push(format!("cut at byte {offset}: {what}"));
            }
            Item::WrongSum(what) => self.missing.push(what),
            Item::Behind { offset, bytes } => {
                let what = "behind the end of the log, which were not read";
                self.missing
                    .push(format!("{bytes} bytes from byte {offset} on, {what}"));
            }
            Item::Header { .. } | Item::Chunk { .. } | Item::Message(_) => {}
        }
    }

    fn miss(&mut self, what: String) {
        if self.missing.len() < MISSING_LIMIT && !self.missing.contains(&what) {
            self.missing.push(what);
        }
    }

    fn add_message(
        &mut self,
        times: &mut Option<(u64, u64)>,
        message: &ScannedMessage<'_>,
        at: usize,
    ) {
        let time = message.head.log_time;
        *times = Some(times.map_or((time, time), |(a, b)| (a.min(time), b.max(time))));
        self.messages += 1;
        self.topics[at].messages += 1;
        self.topics[at].bytes += message.data.len() as u64;
    }

    /// Takes note of an event that the run's scenario planned, not an actor.
    fn add_control(&mut self, message: &ScannedMessage<'_>) {
        let Some(record) = RecordRef::read(message.data) else {
            return;
        };
        if record.key.source != CONTROL {
            return;
        }
        self.control_events += 1;
        if self.controls.len() < CONTROLS_LIMIT {
            self.controls.push(ControlInfo {
                time_s: seconds(record.key.time_ns),
                class: record.class.name().to_owned(),
                to: record.receiver.to_owned(),
                body: body(&record, message.channel),
            });
        }
    }

    fn finish(&mut self, times: Option<(u64, u64)>, path: &Path) -> Result<(), LogError> {
        let Some(head) = self
            .metadata
            .get("farside")
            .and_then(|records| records.last())
        else {
            self.set_times(times, 0);
            return Ok(());
        };
        let head = Head::read(path, head)?;
        self.set_times(times, head.epoch_ns);
        let end = self.metadata.get("farside.end");
        let end = end.and_then(|records| records.last());
        let text = |key: &str| end.and_then(|end| end.get(key)).cloned();
        if end.is_none() && self.missing.is_empty() {
            self.missing
                .push("no farside.end: the run did not end in this log".to_owned());
        }
        let end_time_ns = text("end_time_ns").and_then(|ns| ns.parse().ok());
        let checkpoints = self
            .topics
            .iter()
            .filter(|topic| topic.role == "checkpoint");
        self.run = Some(RunSummary {
            digest: text("digest"),
            end: text("end"),
            end_detail: text("end_detail").unwrap_or_default(),
            end_time_s: end_time_ns.map(seconds),
            end_time_ns,
            counts: text("counts").and_then(|counts| serde_json::from_str(&counts).ok()),
            checkpoints: checkpoints.map(|topic| topic.messages).sum(),
            format: head.format,
            code_version: head.code_version,
            seed: head.seed,
            tie_seed: head.tie_seed,
            scenario: head.scenario,
            scenario_hash: head.scenario_hash,
            exclude: head.exclude,
        });
        Ok(())
    }

    fn set_times(&mut self, times: Option<(u64, u64)>, epoch_ns: u64) {
        if let Some((first, last)) = times {
            let [first_ns, last_ns] = [first, last].map(|ns| ns.saturating_sub(epoch_ns));
            (self.start_ns, self.end_ns) = (Some(first_ns), Some(last_ns));
            (self.start_s, self.end_s) = (Some(seconds(first_ns)), Some(seconds(last_ns)));
            self.duration_s = seconds(last - first);
        }
    }
}

/// Reads the whole of a log, and says what is in it. A cut or damaged file is read as far as it
/// can be.
///
/// # Errors
/// If the file cannot be read, is no MCAP file, or is a Farside log of a format not known here.
pub fn info(path: impl AsRef<Path>) -> Result<LogInfo, LogError> {
    let path = path.as_ref();
    let mut scanner = Scanner::careful(path, Care::Everything)?;
    let mut info = LogInfo {
        path: path.display().to_string(),
        bytes: scanner.length(),
        ..LogInfo::default()
    };
    let mut times = None;
    let mut index = TopicIndex::new();
    // Which topic a channel counts for, and whether control events are on it, by the channel's
    // serial number.
    let mut topic_of: Vec<Option<(usize, bool)>> = Vec::new();
    while let Some(item) = scanner.next()? {
        match item {
            Item::Header { profile, library } => {
                info.profile = profile.to_owned();
                info.library = library.to_owned();
            }
            Item::Chunk { compression } => {
                let name = if compression.is_empty() {
                    "none"
                } else {
                    compression
                };
                *info.chunks.entry(name.to_owned()).or_default() += 1;
            }
            Item::Message(message) => {
                let serial = message.channel.serial as usize;
                if topic_of.len() <= serial {
                    topic_of.resize(serial + 1, None);
                }
                let (at, is_control) = *topic_of[serial].get_or_insert_with(|| {
                    let is_control = is_control(&message.channel.topic);
                    (
                        topic(&mut info.topics, &mut index, message.channel),
                        is_control,
                    )
                });
                info.add_message(&mut times, &message, at);
                if is_control {
                    info.add_control(&message);
                }
            }
            item => info.add_other(item),
        }
    }
    // Topics without messages: their channels are declared all the same.
    for channel in scanner.channels() {
        let at = topic(&mut info.topics, &mut index, channel);
        info.topics[at].channels += 1;
    }
    info.finish(times, path)?;
    info.topics.sort_by(|a, b| a.topic.cmp(&b.topic));
    Ok(info)
}

/// How many control events are named.
const CONTROLS_LIMIT: usize = 20;

/// The source of control events.
const CONTROL: &str = "@control";

/// Whether control events may be on a topic.
fn is_control(topic: &str) -> bool {
    let classes = ["told", "crash", "restart", "change"];
    let event = topic.strip_prefix("/event/");
    let class = event.and_then(|rest| rest.split('/').next());
    class.is_some_and(|class| classes.contains(&class))
}

/// What an event said, in JSON, as far as the log's schemas tell.
fn body(record: &RecordRef<'_>, channel: &ChannelInfo) -> String {
    let decoded = Encoded::body(record.body, fields::schema(channel)).shown();
    match (record.kind, decoded) {
        ("", _) => String::new(),
        (kind, Some(text)) => format!("{kind} {text}"),
        (kind, None) => kind.to_owned(),
    }
}

/// How many damaged parts are named.
const MISSING_LIMIT: usize = 20;

/// Topics by name, schema and role.
type TopicIndex = BTreeMap<(String, String, String), usize>;

fn topic(topics: &mut Vec<TopicInfo>, index: &mut TopicIndex, channel: &ChannelInfo) -> usize {
    let schema = channel.schema.as_ref().map_or("", |schema| &schema.name);
    let key = (
        channel.topic.clone(),
        schema.to_owned(),
        channel.role().to_owned(),
    );
    if let Some(at) = index.get(&key) {
        return *at;
    }
    index.insert(key, topics.len());
    topics.push(TopicInfo {
        topic: channel.topic.clone(),
        schema: schema.to_owned(),
        encoding: channel.encoding.clone(),
        role: channel.role().to_owned(),
        channels: 0,
        messages: 0,
        bytes: 0,
    });
    topics.len() - 1
}

/// The alternate form, `{:#}`, lists every topic; else topics of numbered actors share a row.
impl fmt::Display for LogInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let path = Shown(&self.path);
        writeln!(f, "{:<12} {path} ({} bytes)", "file", self.bytes)?;
        writeln!(f, "{:<12} {}", "written by", Shown(&self.library))?;
        if let Some(run) = &self.run {
            write_run(f, run)?;
        }
        for missing in &self.missing {
            writeln!(f, "{:<12} {}", "MISSING", Shown(missing))?;
        }
        if let (Some(start), Some(end)) = (self.start_ns, self.end_ns) {
            let long = Seconds(end - start);
            let (start, end) = (Seconds(start), Seconds(end));
            writeln!(f, "{:<12} {start} s to {end} s, {long} s long", "times")?;
        }
        for control in &self.controls {
            let ControlInfo {
                time_s,
                class,
                to,
                body,
            } = control;
            let colon = if body.is_empty() { "" } else { ": " };
            writeln!(
                f,
                "{:<12} {time_s:.3} s: {class} {to}{colon}{body}",
                "control"
            )?;
        }
        match self
            .control_events
            .saturating_sub(self.controls.len() as u64)
        {
            0 => {}
            more => writeln!(f, "{:<12} and {more} more", "control")?,
        }
        let chunks: Vec<_> = self
            .chunks
            .iter()
            .map(|(name, n)| format!("{n} {}", Shown(name)))
            .collect();
        writeln!(f, "{:<12} {}", "chunks", chunks.join(", "))?;
        writeln!(
            f,
            "{:<12} {} on {} topics",
            "messages",
            self.messages,
            self.topics.len()
        )?;
        self.write_topics(f)?;
        for (opcode, n) in &self.strange {
            writeln!(f, "{:<12} {n} records of opcode 0x{opcode:02x}", "unknown")?;
        }
        // Farside's own are told above.
        let foreign = |name: &&String| !(name.starts_with("farside") && self.run.is_some());
        for (name, records) in self.metadata.iter().filter(|(name, _)| foreign(name)) {
            for entries in records {
                let (name, n) = (Shown(name), entries.len());
                writeln!(f, "{:<12} {name} ({n} entries)", "metadata")?;
            }
        }
        for attachment in &self.attachments {
            let (name, media_type) = (Shown(&attachment.name), Shown(&attachment.media_type));
            let bytes = attachment.bytes;
            writeln!(
                f,
                "{:<12} {name} ({media_type}, {bytes} bytes)",
                "attachment"
            )?;
        }
        Ok(())
    }
}

impl LogInfo {
    fn write_topics(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let alone = f.alternate() || self.topics.len() <= group::UNGROUPED;
        let groups = group::groups(&self.topics, alone, |topic| &topic.topic);
        let sum = |topics: &[&TopicInfo], of: fn(&TopicInfo) -> u64| -> u64 {
            topics.iter().map(|topic| of(topic)).sum()
        };
        let mut rows: Vec<_> = groups
            .iter()
            .map(|(name, topics)| {
                let bytes = sum(topics, |topic| topic.bytes);
                (bytes, sum(topics, |topic| topic.messages), topics, name)
            })
            .collect();
        if !alone {
            // The largest first; groups come in name order, and a stable sort keeps it.
            rows.sort_by_key(|row| std::cmp::Reverse(row.0));
        }
        writeln!(f, "{:>11}  {:>12}    topic", "messages", "bytes")?;
        let shown = if alone { rows.len() } else { group::UNGROUPED };
        for (bytes, messages, topics, name) in rows.iter().take(shown) {
            write!(f, "{messages:>11}  {bytes:>12}    {}", Shown(name))?;
            match topics.as_slice() {
                [topic] if topic.schema.is_empty() => writeln!(f)?,
                [topic] => writeln!(f, "  {}", Shown(&topic.schema))?,
                topics => writeln!(f, "  ({} topics)", topics.len())?,
            }
        }
        match rows.len().saturating_sub(shown) {
            _ if alone => Ok(()),
            0 => writeln!(f, "{:29}(--topics lists every topic)", ""),
            more => writeln!(f, "{:29}and {more} more (--topics lists all)", ""),
        }
    }
}

fn write_run(f: &mut fmt::Formatter<'_>, run: &RunSummary) -> fmt::Result {
    writeln!(f, "{:<12} {}", "format", run.format)?;
    writeln!(
        f,
        "{:<12} {} ({})",
        "scenario", run.scenario, run.scenario_hash
    )?;
    writeln!(f, "{:<12} {}", "code", Shown(&run.code_version))?;
    writeln!(f, "{:<12} {}", "seed", run.seed)?;
    if let Some(tie_seed) = run.tie_seed {
        writeln!(f, "{:<12} {tie_seed}", "tie seed")?;
    }
    if !run.exclude.is_empty() {
        writeln!(
            f,
            "{:<12} {}",
            "not written",
            Shown(&run.exclude.join(", "))
        )?;
    }
    if let Some(digest) = &run.digest {
        writeln!(f, "{:<12} {digest}", "digest")?;
    }
    if let Some(end) = &run.end {
        let colon = if run.end_detail.is_empty() { "" } else { ": " };
        let at = Seconds(run.end_time_ns.unwrap_or_default());
        let (end, detail) = (Shown(end), Shown(&run.end_detail));
        writeln!(f, "{:<12} {end} at {at} s{colon}{detail}", "end")?;
    }
    if let Some(counts) = &run.counts {
        let farside::Counts {
            sent,
            delivered,
            lost,
            duplicated,
            in_flight,
            events,
            ..
        } = counts;
        writeln!(
            f,
            "{:<12} {events} events; {sent} messages sent, {delivered} delivered, {lost} lost, \
             {duplicated} duplicated, {in_flight} in flight",
            "counts"
        )?;
        for (reason, n) in &counts.lost_by_reason {
            writeln!(f, "  {n:>9}  lost: {}", Shown(reason))?;
        }
    }
    Ok(())
}
