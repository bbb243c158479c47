//! The envelope around each record: how a committed record becomes the bytes of a log message,
//! and how those bytes become a record again.
//!
//! Everything about a flow that does not change from message to message (names, kind, fate) is
//! encoded once and copied.

use std::sync::Arc;

use farside::carrier::Carriage;
use farside::key::EventKey;
use farside::record::{Record, RecordClass};
use farside::{Kind, RunInfo, SimDuration};
use rustc_hash::FxBuildHasher;

use crate::topics::{Topics, topic_before_1_3, topic_of};
use crate::wire::{
    Fields, put_bytes, put_double, put_number, put_signed, put_text, put_varint, signed, varint_len,
};

/// Nanoseconds as seconds.
pub(crate) fn seconds(ns: u64) -> f64 {
    ns as f64 / 1e9
}

/// Field numbers of `farside.record.<Kind>` and `farside.log.Event`.
pub(crate) mod field {
    pub(crate) const SENDER: u32 = 1;
    pub(crate) const RECEIVER: u32 = 2;
    pub(crate) const LINK: u32 = 3;
    pub(crate) const KIND: u32 = 4;
    pub(crate) const FATE: u32 = 5;
    pub(crate) const REASON: u32 = 6;
    pub(crate) const ORDINAL: u32 = 7;
    pub(crate) const COPY: u32 = 8;
    pub(crate) const TIME_NS: u32 = 9;
    pub(crate) const STEP: u32 = 10;
    pub(crate) const SOURCE: u32 = 11;
    pub(crate) const COUNT: u32 = 12;
    pub(crate) const SENT_NS: u32 = 13;
    pub(crate) const CAUSE: u32 = 14;
    pub(crate) const BODY: u32 = 15;
    pub(crate) const MATCH_KEY: u32 = 16;
    pub(crate) const TIE: u32 = 17;
    pub(crate) const NOTE: u32 = 18;
    pub(crate) const CARRIAGE: u32 = 19;
}

/// What is the same for all records of one class, sender, receiver, link and kind.
pub(crate) struct Flow {
    pub(crate) class: RecordClass,
    pub(crate) sender: String,
    pub(crate) receiver: String,
    pub(crate) kind: Option<Arc<Kind>>,
    pub(crate) topic: String,
    /// The topic is filtered: its records are not in the log.
    pub(crate) excluded: bool,
    /// The channel that the records are written to, once it is declared.
    pub(crate) channel: Option<u16>,
    prefix: Vec<u8>,
}

#[derive(PartialEq, Eq, Hash)]
struct FlowKey {
    class: u8,
    sender: u32,
    receiver: u32,
    link: u32,
    kind: usize,
}

/// Encodes the records of one run.
pub(crate) struct Encoder {
    run: Arc<RunInfo>,
    exclude: Topics,
    /// Whether the globs of `exclude` are of a log before format 1.3.
    is_before_1_3: bool,
    known: hashbrown::HashMap<FlowKey, usize, FxBuildHasher>,
    pub(crate) flows: Vec<Flow>,
}

impl Encoder {
    /// True for topics that are not written.
    pub(crate) fn excludes(&self, topic: &str) -> bool {
        self.exclude.matches(topic)
    }

    pub(crate) fn new(run: Arc<RunInfo>, exclude: Topics) -> Self {
        Encoder {
            run,
            exclude,
            is_before_1_3: false,
            known: hashbrown::HashMap::default(),
            flows: Vec::new(),
        }
    }

    /// Reads what is excluded as a log of this format does.
    pub(crate) fn of_format(self, format: &str) -> Self {
        let minor = format
            .split_once('.')
            .and_then(|(_, minor)| minor.parse().ok());
        Encoder {
            is_before_1_3: minor.is_some_and(|minor: u32| minor < 3),
            ..self
        }
    }

    /// The index in [`Encoder::flows`] of the flow that `record` belongs to.
    pub(crate) fn flow(&mut self, record: &Record<'_>) -> usize {
        let key = FlowKey {
            class: record.class as u8,
            sender: record.sender.index() as u32,
            receiver: record.receiver.index() as u32,
            link: record.link.map_or(u32::MAX, |link| link.index() as u32),
            kind: record.kind.map_or(0, |kind| Arc::as_ptr(kind) as usize),
        };
        if let Some(flow) = self.known.get(&key) {
            return *flow;
        }
        let flow = self.new_flow(record);
        self.flows.push(flow);
        self.known.insert(key, self.flows.len() - 1);
        self.flows.len() - 1
    }

    fn new_flow(&self, record: &Record<'_>) -> Flow {
        let sender = self.run.name(record.sender);
        let receiver = self.run.name(record.receiver);
        let kind = record.kind.map_or("", |kind| kind.name());
        let topic = topic_of(record.class, sender, receiver, kind);
        let mut prefix = Vec::new();
        put_text(&mut prefix, field::SENDER, sender);
        put_text(&mut prefix, field::RECEIVER, receiver);
        if let Some(link) = record.link {
            put_text(&mut prefix, field::LINK, self.run.name(link));
        }
        put_text(&mut prefix, field::KIND, kind);
        put_text(&mut prefix, field::FATE, record.class.name());
        Flow {
            class: record.class,
            sender: sender.to_owned(),
            receiver: receiver.to_owned(),
            kind: record.kind.cloned(),
            excluded: match self.is_before_1_3 {
                true => {
                    let topic = topic_before_1_3(record.class, sender, receiver, kind);
                    self.exclude.matches(&topic)
                }
                false => self.exclude.matches(&topic),
            },
            topic,
            channel: None,
            prefix,
        }
    }

    /// Appends the envelope of `record`, which belongs to `flow`.
    pub(crate) fn encode(&self, flow: usize, record: &Record<'_>, out: &mut Vec<u8>) {
        out.extend_from_slice(&self.flows[flow].prefix);
        put_text(out, field::REASON, record.reason);
        put_number(out, field::ORDINAL, record.ordinal);
        put_number(out, field::COPY, u64::from(record.copy));
        put_number(out, field::TIME_NS, record.key.time.as_nanos());
        put_number(out, field::STEP, u64::from(record.key.step));
        put_text(out, field::SOURCE, self.run.name(record.key.source));
        put_number(out, field::COUNT, record.key.count);
        put_number(out, field::SENT_NS, record.sent.as_nanos());
        if let Some(cause) = &record.cause {
            put_key(out, field::CAUSE, cause, self.run.name(cause.source));
        }
        if let Some(key) = record.match_key {
            // Written even if it is zero: a field with presence.
            put_varint(out, u64::from(field::MATCH_KEY) << 3);
            put_varint(out, key.bits());
        }
        put_number(out, field::TIE, u64::from(record.key.tie));
        if let Some(carriage) = record.carriage {
            put_carriage(out, carriage);
        }
        if record.kind.is_some() {
            put_bytes(out, field::BODY, record.body);
        } else if !record.body.is_empty() {
            put_bytes(out, field::NOTE, record.body);
        }
    }

    /// The name of the key's source.
    pub(crate) fn name(&self, key: &EventKey) -> &str {
        self.run.name(key.source)
    }
}

/// Appends an `EventKey` as a message field.
pub(crate) fn put_key(out: &mut Vec<u8>, number: u32, key: &EventKey, source: &str) {
    let numbers = [
        (1, key.time.as_nanos()),
        (2, u64::from(key.step)),
        (4, key.count),
        (5, u64::from(key.tie)),
    ];
    let mut length = 1 + varint_len(source.len() as u64) + source.len();
    for (_, value) in numbers {
        length += if value == 0 { 0 } else { 1 + varint_len(value) };
    }
    put_varint(out, u64::from(number) << 3 | 2);
    put_varint(out, length as u64);
    put_bytes(out, 3, source.as_bytes());
    for (field, value) in numbers {
        put_number(out, field, value);
    }
}

/// Appends how a link carried a message, as a message field.
fn put_carriage(out: &mut Vec<u8>, carriage: &Carriage) {
    // Nine fields of at most eleven bytes: the length always fits one byte.
    let at = out.len();
    put_varint(out, u64::from(field::CARRIAGE) << 3 | 2);
    let length_at = out.len();
    out.push(0);
    put_number(out, 1, carriage.queue.as_nanos());
    put_number(out, 2, carriage.serialization.as_nanos());
    put_number(out, 3, carriage.propagation.as_nanos());
    put_signed(out, 4, carriage.jitter_ns);
    put_number(out, 5, carriage.retries.as_nanos());
    put_number(out, 6, u64::from(carriage.attempts));
    put_double(out, 7, carriage.energy_j);
    put_double(out, 8, carriage.receive_j);
    put_number(out, 9, u64::from(carriage.fragments));
    let length = out.len() - length_at - 1;
    debug_assert!(length < 0x80 && at < length_at);
    out[length_at] = length as u8;
}

fn read_carriage(message: &[u8]) -> Option<Carriage> {
    let mut carriage = Carriage::default();
    for read in Fields::new(message) {
        let (number, value) = read.ok()?;
        let nanos = || value.number().map(SimDuration::from_nanos);
        match number {
            1 => carriage.queue = nanos()?,
            2 => carriage.serialization = nanos()?,
            3 => carriage.propagation = nanos()?,
            4 => carriage.jitter_ns = signed(value.number()?),
            5 => carriage.retries = nanos()?,
            6 => carriage.attempts = u32::try_from(value.number()?).ok()?,
            7 => carriage.energy_j = value.double()?,
            8 => carriage.receive_j = value.double()?,
            9 => carriage.fragments = u32::try_from(value.number()?).ok()?,
            _ => {}
        }
    }
    Some(carriage)
}

/// An event's key as a log holds it: its source by name.
///
/// Keys of two logs compare as keys of one run do, whatever other entities the runs have.
///
/// ```
/// use farside_logs::KeyRef;
/// let start = KeyRef { time_ns: 5, step: 0, tie: 0, source: "rover_1", count: 3 };
/// let control = KeyRef { source: "@control", ..start };
/// assert!(control < start);
/// assert!(KeyRef { source: "4th_rover", ..start } > control);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct KeyRef<'a> {
    /// When the event happens, in nanoseconds since the start.
    pub time_ns: u64,
    /// Zero-delay hops since the last positive delay.
    pub step: u32,
    /// The hash by which a tie seed orders sources; 0 without one.
    pub tie: u32,
    /// Who caused the event.
    pub source: &'a str,
    /// The source's own counter.
    pub count: u64,
}

impl KeyRef<'_> {
    fn order(&self) -> (u64, u32, u32, bool, &str, u64) {
        // `@control` comes first, also before names that begin with a digit.
        let actor = self.source != "@control";
        (
            self.time_ns,
            self.step,
            self.tie,
            actor,
            self.source,
            self.count,
        )
    }
}

impl PartialOrd for KeyRef<'_> {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for KeyRef<'_> {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.order().cmp(&other.order())
    }
}

/// One record of a log, borrowed from the chunk it was read from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordRef<'a> {
    /// What the record is about.
    pub class: RecordClass,
    /// The key of the event.
    pub key: KeyRef<'a>,
    /// The key of the event that caused this one.
    pub cause: Option<KeyRef<'a>>,
    /// Who sent the message; for other events, who they happen to, or `@control`.
    pub sender: &'a str,
    /// Who the message is for; for other events, who they happen to.
    pub receiver: &'a str,
    /// The link that carried it; empty within a host.
    pub link: &'a str,
    /// The type of the body; empty where there is none.
    pub kind: &'a str,
    /// The message's place in the flow (sender, receiver, kind).
    pub ordinal: u64,
    /// Which copy of the message this is.
    pub copy: u32,
    /// The bits of the protocol's own identity for the message, if it gave one.
    pub match_key: Option<u64>,
    /// When the message was sent, in nanoseconds since the start.
    pub sent_ns: u64,
    /// Why the message was lost; empty otherwise.
    pub reason: &'a str,
    /// The encoded message.
    pub body: &'a [u8],
    /// What there is to say about an event without a body: why the run was stopped.
    pub note: &'a str,
    /// How the link carried it, where the link says.
    pub carriage: Option<Carriage>,
}

pub(crate) const CLASSES: [RecordClass; 12] = [
    RecordClass::Start,
    RecordClass::Delivered,
    RecordClass::Lost,
    RecordClass::InFlight,
    RecordClass::Timer,
    RecordClass::HandOver,
    RecordClass::Crash,
    RecordClass::Restart,
    RecordClass::Change,
    RecordClass::Stop,
    RecordClass::Sample,
    RecordClass::Told,
];

impl<'a> RecordRef<'a> {
    /// Reads an envelope; `None` if the bytes are none.
    pub(crate) fn read(envelope: &'a [u8]) -> Option<Self> {
        let mut record = RecordRef {
            class: RecordClass::Sample,
            key: KeyRef::default(),
            cause: None,
            sender: "",
            receiver: "",
            link: "",
            kind: "",
            ordinal: 0,
            copy: 0,
            match_key: None,
            sent_ns: 0,
            reason: "",
            body: &[],
            note: "",
            carriage: None,
        };
        let mut fate = "";
        for read in Fields::new(envelope) {
            let (number, value) = read.ok()?;
            match number {
                field::SENDER => record.sender = value.text()?,
                field::RECEIVER => record.receiver = value.text()?,
                field::LINK => record.link = value.text()?,
                field::KIND => record.kind = value.text()?,
                field::FATE => fate = value.text()?,
                field::REASON => record.reason = value.text()?,
                field::ORDINAL => record.ordinal = value.number()?,
                field::COPY => record.copy = u32::try_from(value.number()?).ok()?,
                field::TIME_NS => record.key.time_ns = value.number()?,
                field::STEP => record.key.step = u32::try_from(value.number()?).ok()?,
                field::SOURCE => record.key.source = value.text()?,
                field::COUNT => record.key.count = value.number()?,
                field::SENT_NS => record.sent_ns = value.number()?,
                field::CAUSE => record.cause = Some(read_key(value.bytes()?)?),
                field::BODY => record.body = value.bytes()?,
                field::MATCH_KEY => record.match_key = Some(value.number()?),
                field::TIE => record.key.tie = u32::try_from(value.number()?).ok()?,
                field::NOTE => record.note = value.text()?,
                field::CARRIAGE => record.carriage = Some(read_carriage(value.bytes()?)?),
                // A later minor version may have more fields.
                _ => {}
            }
        }
        record.class = CLASSES.into_iter().find(|class| class.name() == fate)?;
        Some(record)
    }

    /// The topic that the record is written to.
    pub fn topic(&self) -> String {
        topic_of(self.class, self.sender, self.receiver, self.kind)
    }
}

pub(crate) fn read_key(message: &[u8]) -> Option<KeyRef<'_>> {
    let mut key = KeyRef::default();
    for read in Fields::new(message) {
        let (number, value) = read.ok()?;
        match number {
            1 => key.time_ns = value.number()?,
            2 => key.step = u32::try_from(value.number()?).ok()?,
            3 => key.source = value.text()?,
            4 => key.count = value.number()?,
            5 => key.tie = u32::try_from(value.number()?).ok()?,
            _ => {}
        }
    }
    Some(key)
}

/// A checkpoint as a log holds it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CheckpointRef<'a> {
    pub(crate) digest: &'a str,
    pub(crate) time_ns: u64,
    pub(crate) records: u64,
    pub(crate) hashes: &'a [u8],
}

impl<'a> CheckpointRef<'a> {
    pub(crate) fn read(message: &'a [u8]) -> Option<Self> {
        let mut checkpoint = CheckpointRef {
            digest: "",
            time_ns: 0,
            records: 0,
            hashes: &[],
        };
        for read in Fields::new(message) {
            let (number, value) = read.ok()?;
            match number {
                1 => checkpoint.digest = value.text()?,
                2 => checkpoint.time_ns = read_key(value.bytes()?)?.time_ns,
                3 => checkpoint.records = value.number()?,
                4 => checkpoint.hashes = value.bytes()?,
                _ => {}
            }
        }
        Some(checkpoint)
    }

    pub(crate) fn hash(&self, at: usize) -> Option<u32> {
        let bytes = self.hashes.get(at * 4..at * 4 + 4)?;
        Some(u32::from_le_bytes(bytes.try_into().ok()?))
    }
}
