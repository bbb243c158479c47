//! One record of a log, in few bytes: who it is, what it says as a hash, when it was and where in
//! the file. Its body stays in the file.

use farside::record::RecordClass;
use hashbrown::HashMap;
use rustc_hash::FxBuildHasher;
use xxhash_rust::xxh3::xxh3_64;

use super::spill::{BUCKETS, Fixed};
use crate::envelope::{CLASSES, KeyRef, RecordRef};
use crate::parse::Parser;
use crate::scan::{Position, ScannedMessage};
use crate::topics::Topics;

/// How records are told apart.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Mode {
    /// By sender, receiver, kind and match key or ordinal.
    Farside,
    /// By topic, and on a topic by what they say, when they were, and their place.
    Any,
}

/// Names of sources and topics, numbered: both logs share the numbers.
#[derive(Default)]
pub(super) struct Names {
    numbers: HashMap<String, u32, FxBuildHasher>,
    names: Vec<String>,
}

impl Names {
    pub(super) fn number(&mut self, name: &str) -> u32 {
        if let Some(number) = self.numbers.get(name) {
            return *number;
        }
        let number = self.names.len() as u32;
        self.numbers.insert(name.to_owned(), number);
        self.names.push(name.to_owned());
        number
    }

    /// The number of a name that is likely the same as the one of this number.
    fn number_near(&mut self, likely: u32, name: &str) -> u32 {
        match self.names.get(likely as usize) {
            Some(known) if known == name => likely,
            _ => self.number(name),
        }
    }

    pub(super) fn name(&self, number: u32) -> &str {
        self.names.get(number as usize).map_or("", String::as_str)
    }
}

/// Who says what to whom, by numbers of names; of other files' messages nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Said {
    pub(super) sender: u32,
    /// For events that are no messages, whom they happen to.
    pub(super) receiver: u32,
    /// Number of the empty name within a host.
    pub(super) link: u32,
    pub(super) sent_ns: u64,
    /// Hash of the body.
    pub(super) body: u64,
}

/// One record, in 120 bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Entry {
    /// Hash of the identity, without the place in the flow; in other files than Farside's, of the message
    /// without its times.
    pub(super) identity: u64,
    /// The place in the flow, or among records of one identity.
    pub(super) ordinal: u64,
    /// Hash of everything that is compared.
    pub(super) content: u64,
    pub(super) time_ns: u64,
    pub(super) count: u64,
    pub(super) position: Position,
    /// Its place among the log's records.
    pub(super) at: u32,
    pub(super) step: u32,
    pub(super) tie: u32,
    pub(super) source: u32,
    pub(super) topic: u32,
    /// The serial number of the channel.
    pub(super) channel: u32,
    /// The number that the publisher gave the message.
    pub(super) sequence: u32,
    /// What the record is about; a sample, if it is none of Farside's.
    pub(super) class: RecordClass,
    /// Only its place tells it from others of its identity, and that may be another in the other log.
    pub(super) has_place: bool,
    pub(super) said: Said,
}

impl Entry {
    /// What it is paired by: who says it, and of what has but a place what is said and when.
    pub(super) fn said_key(&self) -> u64 {
        match self.has_place {
            false => self.identity,
            true => mixed([self.identity, self.said.sent_ns, self.said.body]),
        }
    }

    /// The same for a place in its flow.
    pub(super) fn place_key(&self, place: u64) -> u64 {
        mixed([self.identity, place, 0])
    }

    /// False for the loss of a message and for one in flight: no event has their key.
    pub(super) fn is_event(&self) -> bool {
        let none = [
            RecordClass::Lost,
            RecordClass::InFlight,
            RecordClass::Sample,
        ];
        !none.contains(&self.class)
    }

    /// Whether both are the same record, and say the same.
    pub(super) fn agrees(&self, other: &Entry) -> bool {
        (self.topic, self.identity, self.ordinal, self.content)
            == (other.topic, other.identity, other.ordinal, other.content)
    }

    /// The bucket in which it meets all that it may be paired with.
    pub(super) fn bucket(&self, mode: Mode) -> usize {
        match mode {
            Mode::Farside => bucket_of(self.said_key()),
            Mode::Any => self.topic as usize % BUCKETS,
        }
    }

    /// The key of its event.
    pub(super) fn key<'a>(&self, names: &'a Names) -> KeyRef<'a> {
        KeyRef {
            time_ns: self.time_ns,
            step: self.step,
            tie: self.tie,
            source: names.name(self.source),
            count: self.count,
        }
    }
}

/// The bucket of a key.
pub(super) fn bucket_of(key: u64) -> usize {
    (key >> 32) as usize % BUCKETS
}

/// One hash of several numbers.
fn mixed(numbers: [u64; 3]) -> u64 {
    let mut bytes = [0; 24];
    for (part, number) in bytes.chunks_exact_mut(8).zip(numbers) {
        part.copy_from_slice(&number.to_le_bytes());
    }
    xxh3_64(&bytes)
}

impl Fixed for Entry {
    const BYTES: usize = 8 * 8 + 11 * 4 + 2;

    fn put(&self, out: &mut Vec<u8>) {
        let long = [
            self.identity,
            self.ordinal,
            self.content,
            self.time_ns,
            self.count,
            self.position.frame,
            self.said.sent_ns,
            self.said.body,
        ];
        let short = [
            self.position.inner,
            self.at,
            self.step,
            self.tie,
            self.source,
            self.topic,
            self.channel,
            self.sequence,
            self.said.sender,
            self.said.receiver,
            self.said.link,
        ];
        for number in long {
            out.extend_from_slice(&number.to_le_bytes());
        }
        for number in short {
            out.extend_from_slice(&number.to_le_bytes());
        }
        out.push(self.class as u8);
        out.push(u8::from(self.has_place));
    }

    fn take(parser: &mut Parser<'_>) -> Option<Entry> {
        let [
            identity,
            ordinal,
            content,
            time_ns,
            count,
            frame,
            sent_ns,
            body,
        ] = [(); 8].map(|()| parser.u64().unwrap_or_default());
        let [inner, at, step, tie, source, topic, channel, sequence] =
            [(); 8].map(|()| parser.u32().unwrap_or_default());
        let [sender, receiver, link] = [(); 3].map(|()| parser.u32().unwrap_or_default());
        Some(Entry {
            identity,
            ordinal,
            content,
            time_ns,
            count,
            position: Position { frame, inner },
            at,
            step,
            tie,
            source,
            topic,
            channel,
            sequence,
            class: *CLASSES.get(usize::from(parser.u8()?))?,
            has_place: parser.u8()? != 0,
            said: Said {
                sender,
                receiver,
                link,
                sent_ns,
                body,
            },
        })
    }
}

/// What is the same for all messages of a channel.
#[derive(Clone, Copy)]
pub(super) struct ChannelEntry {
    pub(super) topic: u32,
    pub(super) ignored: bool,
    pub(super) compared: bool,
}

/// Makes entries of a log's messages.
pub(super) struct Builder<'a> {
    pub(super) mode: Mode,
    ignore: &'a Topics,
    channels: Vec<Option<ChannelEntry>>,
    /// Topics in the order in which they have their first message.
    pub(super) topics: Vec<u32>,
    /// How many records there were on a topic, or of an identity that has no ordinal of its own.
    places: HashMap<u64, u64, FxBuildHasher>,
    scratch: Vec<u8>,
    /// Of the last entry: the next is often of the same.
    last: [u32; 4],
    /// The flow of the last entry's record and its ordinal there, if it has a match key.
    pub(super) keyed: Option<(u64, u64)>,
}

impl<'a> Builder<'a> {
    pub(super) fn new(mode: Mode, ignore: &'a Topics) -> Self {
        Builder {
            mode,
            ignore,
            channels: Vec::new(),
            topics: Vec::new(),
            places: HashMap::default(),
            scratch: Vec::new(),
            last: [0; 4],
            keyed: None,
        }
    }

    /// Whether a topic is not compared.
    pub(super) fn leaves_out(&self, topic: &str) -> bool {
        self.ignore.matches(topic)
    }

    pub(super) fn channel(
        &mut self,
        message: &ScannedMessage<'_>,
        names: &mut Names,
    ) -> ChannelEntry {
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
            topic: names.number(topic),
            ignored: self.ignore.matches(topic),
            compared,
        };
        self.channels[serial] = Some(entry);
        self.topics.push(entry.topic);
        entry
    }

    /// The entry of a message; `None` if that is malformed.
    pub(super) fn entry(
        &mut self,
        message: &ScannedMessage<'_>,
        at: u32,
        names: &mut Names,
    ) -> Option<Entry> {
        let topic = self.channel(message, names).topic;
        match self.mode {
            Mode::Any => Some(self.any(message, topic, at)),
            Mode::Farside => {
                let record = RecordRef::read(message.data)?;
                Some(self.farside(&record, message, topic, at, names))
            }
        }
    }

    /// Counts a record that is not made an entry of, if a place depends on how many there were;
    /// says whether.
    pub(super) fn pass(&mut self, record: &RecordRef<'_>) -> bool {
        self.note_key(record);
        let counts = !has_own_place(record);
        if counts {
            self.identity(record);
        }
        counts
    }

    /// Counts a message on a topic that is not made an entry of.
    pub(super) fn pass_topic(&mut self, topic: u32) {
        self.place(u64::from(topic));
    }

    fn place(&mut self, identity: u64) -> u64 {
        let place = self.places.entry(identity).or_default();
        *place += 1;
        *place - 1
    }

    fn any(&mut self, message: &ScannedMessage<'_>, topic: u32, at: u32) -> Entry {
        let ordinal = self.place(u64::from(topic));
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
            at,
            step: 0,
            tie: 0,
            source: topic,
            topic,
            channel: message.channel.serial,
            sequence: message.head.sequence,
            class: RecordClass::Sample,
            has_place: false,
            said: Said::default(),
        }
    }

    fn farside(
        &mut self,
        record: &RecordRef<'_>,
        message: &ScannedMessage<'_>,
        topic: u32,
        at: u32,
        names: &mut Names,
    ) -> Entry {
        let (identity, ordinal) = self.identity(record);
        self.note_key(record);
        let key = &record.key;
        let body = xxh3_64(record.body);
        let texts = [record.sender, record.receiver, record.link, key.source];
        for (last, text) in self.last.iter_mut().zip(texts) {
            *last = names.number_near(*last, text);
        }
        let [sender, receiver, link, source] = self.last;
        let content = {
            let out = &mut self.scratch;
            out.clear();
            for text in [record.class.name(), record.link, record.reason, record.note] {
                out.extend_from_slice(text.as_bytes());
                out.push(0);
            }
            out.extend_from_slice(&key.time_ns.to_le_bytes());
            out.extend_from_slice(&record.sent_ns.to_le_bytes());
            out.extend_from_slice(&body.to_le_bytes());
            xxh3_64(out)
        };
        Entry {
            identity,
            ordinal,
            content,
            time_ns: key.time_ns,
            count: key.count,
            position: message.position,
            at,
            step: key.step,
            tie: key.tie,
            source,
            topic,
            channel: message.channel.serial,
            sequence: 0,
            class: record.class,
            has_place: record.match_key.is_none() && has_own_place(record),
            said: Said {
                sender,
                receiver,
                link,
                sent_ns: record.sent_ns,
                body,
            },
        }
    }

    /// Notes a match key's flow.
    fn note_key(&mut self, record: &RecordRef<'_>) {
        self.keyed = None;
        if record.match_key.is_some() {
            self.put_flow(record);
            self.keyed = Some((xxh3_64(&self.scratch), record.ordinal));
        }
    }

    /// Whose record it is, of whatever ordinal or match key.
    fn put_flow(&mut self, record: &RecordRef<'_>) {
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
    }

    /// Who a record is, and its place among those who are the same.
    pub(super) fn identity(&mut self, record: &RecordRef<'_>) -> (u64, u64) {
        self.put_flow(record);
        let out = &mut self.scratch;
        match record.match_key {
            // The n-th repeat of a key: by their order in the flow.
            Some(key) => {
                out.push(1);
                out.extend_from_slice(&key.to_le_bytes());
                (xxh3_64(out), record.ordinal)
            }
            None if has_own_place(record) => {
                out.push(2);
                (xxh3_64(out), record.ordinal)
            }
            None => {
                let identity = xxh3_64(out);
                (identity, self.place(identity))
            }
        }
    }
}

/// Whether a record says which of its flow it is.
fn has_own_place(record: &RecordRef<'_>) -> bool {
    record.match_key.is_some()
        || record.class.is_fate()
        || matches!(record.class, RecordClass::Timer | RecordClass::HandOver)
}
