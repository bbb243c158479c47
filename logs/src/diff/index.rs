//! A compact index of one log: for each record who it is, what it says as a hash, when it was and
//! where in the file. Bodies stay in the file.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use farside::record::RecordClass;
use xxhash_rust::xxh3::xxh3_64;

use crate::LogError;
use crate::envelope::{KeyRef, RecordRef};
use crate::frames::Care;
use crate::log::Log;
use crate::scan::{ChannelInfo, Item, Position, ScannedMessage, Scanner};
use crate::source::Attached;
use crate::topics::Topics;
use crate::writer::SCENARIO_ATTACHMENT;

/// Names of sources and topics, numbered: both logs share the numbers.
#[derive(Default)]
pub(super) struct Names {
    numbers: BTreeMap<String, u32>,
    pub(super) names: Vec<String>,
}

impl Names {
    fn number(&mut self, name: &str) -> u32 {
        if let Some(number) = self.numbers.get(name) {
            return *number;
        }
        let number = self.names.len() as u32;
        self.numbers.insert(name.to_owned(), number);
        self.names.push(name.to_owned());
        number
    }

    pub(super) fn name(&self, number: u32) -> &str {
        self.names.get(number as usize).map_or("", String::as_str)
    }
}

/// One record, in 88 bytes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    /// Hash of the identity, without the place in the flow where a match key stands for it; in
    /// other files than Farside's, of the message without its times.
    pub(super) identity: u64,
    /// The place among records of one identity.
    pub(super) ordinal: u64,
    /// Hash of everything that is compared.
    pub(super) content: u64,
    pub(super) time_ns: u64,
    pub(super) count: u64,
    pub(super) position: Position,
    pub(super) step: u32,
    pub(super) tie: u32,
    pub(super) source: u32,
    pub(super) topic: u32,
    /// The serial number of the channel.
    pub(super) channel: u32,
    /// The number that the publisher gave the message.
    pub(super) sequence: u32,
    /// False for the loss of a message and for one in flight: no event has their key.
    pub(super) event: bool,
    pub(super) ignored: bool,
}

/// The records of a log, in log order, and the open file to fetch them from.
pub(super) struct Index {
    pub(super) scanner: Scanner,
    pub(super) entries: Vec<Entry>,
    pub(super) end: Option<BTreeMap<String, String>>,
    pub(super) cut: Option<(u64, String)>,
    /// What wrote the file: profile and library.
    pub(super) header: (String, String),
    pub(super) metadata: Vec<(String, BTreeMap<String, String>)>,
    pub(super) attachments: Vec<Attached>,
    /// The channels of each topic, whether they have messages or not.
    pub(super) channels: BTreeMap<u32, Vec<Arc<ChannelInfo>>>,
    /// How many messages were left out, by what their channels are for.
    pub(super) left_out: BTreeMap<String, u64>,
    /// What else there is that is not compared.
    pub(super) others: Vec<String>,
}

/// How records are told apart.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Mode {
    /// By sender, receiver, kind and match key or ordinal.
    Farside,
    /// By topic, and on a topic by what they say, when they were, and their place.
    Any,
}

/// What a Farside log says at its start; none for any other file.
pub(super) fn start(path: &Path) -> Result<Option<Log>, LogError> {
    match Log::read(path, |name| name == SCENARIO_ATTACHMENT) {
        Ok(log) => Ok(Some(log)),
        Err(LogError::NotFarside { .. } | LogError::Damaged { .. }) => Ok(None),
        Err(error) => Err(error),
    }
}

impl Index {
    pub(super) fn build(
        path: &Path,
        mode: Mode,
        ignore: &Topics,
        names: &mut Names,
    ) -> Result<Index, LogError> {
        let mut scanner = Scanner::careful(path, Care::Attachments)?;
        let mut builder = Builder {
            mode,
            ignore,
            names,
            channels: Vec::new(),
            places: BTreeMap::new(),
            scratch: Vec::new(),
            entries: Vec::new(),
            left_out: BTreeMap::new(),
        };
        let mut beside = Beside::default();
        while let Some(item) = scanner.next()? {
            match item {
                Item::Message(message) => {
                    if !builder.add(&message) {
                        let topic = &message.channel.topic;
                        let what = format!("a message on {topic} that is malformed");
                        return Err(LogError::damaged(path, message.position.frame, what));
                    }
                }
                Item::Damage { offset, what, .. } => {
                    return Err(LogError::damaged(path, offset, what));
                }
                item => beside.add(item),
            }
        }
        let (entries, left_out) = (builder.entries, builder.left_out);
        let mut channels: BTreeMap<u32, Vec<Arc<ChannelInfo>>> = BTreeMap::new();
        for channel in scanner.channels() {
            let topic = names.number(&channel.topic);
            if !ignore.matches(&channel.topic) {
                channels.entry(topic).or_default().push(channel.clone());
            }
        }
        let ends = |(name, _): &&(String, _)| mode == Mode::Farside && name == "farside.end";
        let end = beside.metadata.iter().rfind(ends);
        Ok(Index {
            end: end.map(|(_, entries)| entries.clone()),
            scanner,
            entries,
            cut: beside.cut,
            header: beside.header,
            metadata: beside.metadata,
            attachments: beside.attachments,
            channels,
            left_out,
            others: beside.others,
        })
    }

    /// The order of the run's events: the entry of the event with this key.
    pub(super) fn event(&self, key: &KeyRef<'_>, names: &Names) -> Option<usize> {
        let key_of = |entry: &Entry| KeyRef {
            time_ns: entry.time_ns,
            step: entry.step,
            tie: entry.tie,
            source: names.name(entry.source),
            count: entry.count,
        };
        let from = self.entries.partition_point(|entry| key_of(entry) < *key);
        let same = self.entries[from..]
            .iter()
            .take_while(|entry| key_of(entry) == *key);
        same.enumerate()
            .find(|(_, entry)| entry.event)
            .map(|(at, _)| from + at)
    }
}

/// What a file holds beside its messages.
#[derive(Default)]
struct Beside {
    header: (String, String),
    metadata: Vec<(String, BTreeMap<String, String>)>,
    attachments: Vec<Attached>,
    cut: Option<(u64, String)>,
    others: Vec<String>,
}

impl Beside {
    fn add(&mut self, item: Item<'_>) {
        match item {
            Item::Header { profile, library } => {
                self.header = (profile.to_owned(), library.to_owned());
            }
            Item::Metadata(name, entries) => self.metadata.push((name, entries)),
            Item::Attachment(attached) => self.attachments.push(attached),
            Item::Cut { offset, what } => self.cut = Some((offset, what)),
            Item::Strange(opcode) => {
                let what = format!("records of opcode 0x{opcode:02x}, which MCAP does not have");
                if !self.others.contains(&what) {
                    self.others.push(what);
                }
            }
            Item::Behind { offset, bytes } => {
                let what = format!("{bytes} bytes behind its end, from byte {offset} on");
                self.others.push(what);
            }
            _ => {}
        }
    }
}

/// What is the same for all messages of a channel.
#[derive(Clone, Copy)]
struct ChannelEntry {
    topic: u32,
    ignored: bool,
    compared: bool,
}

struct Builder<'a> {
    mode: Mode,
    ignore: &'a Topics,
    names: &'a mut Names,
    channels: Vec<Option<ChannelEntry>>,
    /// How many records there were on a topic, or of an identity that has no ordinal of its own.
    places: BTreeMap<u64, u64>,
    scratch: Vec<u8>,
    entries: Vec<Entry>,
    left_out: BTreeMap<String, u64>,
}

impl Builder<'_> {
    fn channel(&mut self, message: &ScannedMessage<'_>) -> ChannelEntry {
        let serial = message.channel.serial as usize;
        if self.channels.len() <= serial {
            self.channels.resize(serial + 1, None);
        }
        if let Some(known) = self.channels[serial] {
            return known;
        }
        let topic = &message.channel.topic;
        let compared = match self.mode {
            Mode::Farside => matches!(message.channel.role(), "message" | "event"),
            Mode::Any => true,
        };
        let entry = ChannelEntry {
            topic: self.names.number(topic),
            ignored: self.ignore.matches(topic),
            compared,
        };
        self.channels[serial] = Some(entry);
        entry
    }

    /// Adds a message; false if it is malformed.
    fn add(&mut self, message: &ScannedMessage<'_>) -> bool {
        let channel = self.channel(message);
        if !channel.compared {
            let role = message.channel.role();
            match self.left_out.get_mut(role) {
                Some(count) => *count += 1,
                None => drop(self.left_out.insert(role.to_owned(), 1)),
            }
            return true;
        }
        let entry = match self.mode {
            Mode::Farside => match RecordRef::read(message.data) {
                Some(record) => self.farside(&record, message, channel),
                None => return false,
            },
            Mode::Any => self.any(message, channel),
        };
        self.entries.push(entry);
        true
    }

    fn place(&mut self, identity: u64) -> u64 {
        let place = self.places.entry(identity).or_default();
        *place += 1;
        *place - 1
    }

    fn any(&mut self, message: &ScannedMessage<'_>, channel: ChannelEntry) -> Entry {
        let ordinal = self.place(u64::from(channel.topic));
        let identity = xxh3_64(message.data);
        let mut content = [0; 24];
        content[..8].copy_from_slice(&message.head.log_time.to_le_bytes());
        content[8..16].copy_from_slice(&message.head.publish_time.to_le_bytes());
        content[16..].copy_from_slice(&identity.to_le_bytes());
        Entry {
            identity,
            ordinal,
            content: xxh3_64(&content),
            time_ns: message.head.log_time,
            count: ordinal,
            position: message.position,
            step: 0,
            tie: 0,
            source: channel.topic,
            topic: channel.topic,
            channel: message.channel.serial,
            sequence: message.head.sequence,
            event: false,
            ignored: channel.ignored,
        }
    }

    fn farside(
        &mut self,
        record: &RecordRef<'_>,
        message: &ScannedMessage<'_>,
        channel: ChannelEntry,
    ) -> Entry {
        let (identity, ordinal) = self.identity(record);
        let key = &record.key;
        let content = {
            let out = &mut self.scratch;
            out.clear();
            for text in [record.class.name(), record.link, record.reason, record.note] {
                out.extend_from_slice(text.as_bytes());
                out.push(0);
            }
            out.extend_from_slice(&key.time_ns.to_le_bytes());
            out.extend_from_slice(&record.sent_ns.to_le_bytes());
            out.extend_from_slice(record.body);
            xxh3_64(out)
        };
        Entry {
            identity,
            ordinal,
            content,
            time_ns: key.time_ns,
            count: key.count,
            position: message.position,
            step: key.step,
            tie: key.tie,
            source: self.names.number(key.source),
            topic: channel.topic,
            channel: message.channel.serial,
            sequence: 0,
            event: !matches!(record.class, RecordClass::Lost | RecordClass::InFlight),
            ignored: channel.ignored,
        }
    }

    /// Who a record is, and its place among those who are the same.
    fn identity(&mut self, record: &RecordRef<'_>) -> (u64, u64) {
        let out = &mut self.scratch;
        out.clear();
        for text in [record.sender, record.receiver, record.kind] {
            out.extend_from_slice(text.as_bytes());
            out.push(0);
        }
        // Whatever becomes of a message, it is the same message.
        let class = if record.class.is_fate() {
            RecordClass::Delivered
        } else {
            record.class
        };
        out.push(class as u8);
        out.extend_from_slice(&record.copy.to_le_bytes());
        let counted = class == RecordClass::Delivered
            || matches!(class, RecordClass::Timer | RecordClass::HandOver);
        match record.match_key {
            // The n-th repeat of a key: by their order in the flow.
            Some(key) => {
                out.push(1);
                out.extend_from_slice(&key.to_le_bytes());
                (xxh3_64(out), record.ordinal)
            }
            None if counted => {
                out.push(2);
                out.extend_from_slice(&record.ordinal.to_le_bytes());
                (xxh3_64(out), record.ordinal)
            }
            None => {
                let identity = xxh3_64(out);
                (identity, self.place(identity))
            }
        }
    }
}
