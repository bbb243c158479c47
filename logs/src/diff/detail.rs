//! The details of one difference: its first field, and the chain of its causes.

use std::sync::Arc;

use farside::MatchKey;
use farside::record::RecordClass;
use farside::ruling::{MessageId, MessageNumber};
use mcap::records::MessageHeader;

use super::behaviour::Changes;
use super::chain::{self, Step};
use super::entry::{Entry, Mode, Names};
use super::index::Index;
use super::{Carried, Cause, FirstDifference};
use crate::LogError;
use crate::channel::ChannelInfo;
use crate::envelope::{RecordRef, seconds};
use crate::fields::{self, Encoded, FieldDiff, Rules, bodies, protobuf};
use crate::log::LoggedKey;
use crate::scan::ScannedMessage;
use crate::shown::Seconds;
use crate::value::Unreadable;
use crate::value::Value;

/// Causes that are listed; beyond them only the last one is.
const CAUSES_LISTED: usize = 50;

/// A message that is kept while others are read.
pub(super) struct Held {
    channel: Arc<ChannelInfo>,
    head: MessageHeader,
    data: Vec<u8>,
}

impl Held {
    /// Fetches the message of an entry.
    pub(super) fn fetch(index: &mut Index<'_>, entry: &Entry) -> Result<Held, LogError> {
        let message = index.scanner.message_at(entry.position, entry.channel)?;
        Ok(Held {
            channel: message.channel.clone(),
            head: message.head,
            data: message.data.to_owned(),
        })
    }

    pub(super) fn bytes(&self) -> usize {
        self.data.len()
    }

    /// The first field in which it differs from the message of an entry by more than the tolerance.
    pub(super) fn against(
        &self,
        index: &mut Index<'_>,
        entry: &Entry,
        mode: Mode,
        (others, rules): ([&[Arc<ChannelInfo>]; 2], &Rules),
        changes: Option<&mut Changes>,
    ) -> Result<Option<FieldDiff>, LogError> {
        let message = index.scanner.message_at(entry.position, entry.channel)?;
        let held = ScannedMessage {
            channel: &self.channel,
            head: self.head,
            data: &self.data,
            position: message.position,
        };
        let found = match mode {
            Mode::Any => any(&held, &message, others, rules),
            Mode::Farside => farside(&held, &message, rules),
        };
        if let (Some(_), Some(changes)) = (&found, changes) {
            count_changes((&held, &message), others, mode, rules, changes);
        }
        Ok(found)
    }
}

/// Counts all fields in which two messages differ, as far as they can be read.
fn count_changes(
    (a, b): (&ScannedMessage<'_>, &ScannedMessage<'_>),
    others: [&[Arc<ChannelInfo>]; 2],
    mode: Mode,
    rules: &Rules,
    changes: &mut Changes,
) {
    let times = |x: u64, y: u64| {
        let y = i128::from(y) - i128::from(rules.offset_ns);
        i128::from(x).abs_diff(y) as f64 / 1e9
    };
    let mut late = |field: &str, x, y| {
        if log_times(field, x, y, rules).is_some() {
            changes.add(field.to_owned(), Some(times(x, y)));
        }
    };
    let records = (RecordRef::read(a.data), RecordRef::read(b.data));
    if let (Mode::Farside, (Some(x), Some(y))) = (mode, &records) {
        late("log_time", x.key.time_ns, y.key.time_ns);
        late("sent", x.sent_ns, y.sent_ns);
        let texts = [
            ("fate", x.class.name(), y.class.name()),
            ("link", x.link, y.link),
            ("reason", x.reason, y.reason),
        ];
        for (field, _, _) in texts.iter().filter(|(_, x, y)| x != y) {
            changes.add((*field).to_owned(), None);
        }
        let x = Encoded::body(x.body, fields::schema(a.channel));
        let y = Encoded::body(y.body, fields::schema(b.channel));
        if let (Ok(x), Ok(y)) = (x.value(), y.value()) {
            fields::each("body", (&x, &y), rules, changes);
        }
        return;
    }
    late("log_time", a.head.log_time, b.head.log_time);
    late("publish_time", a.head.publish_time, b.head.publish_time);
    match values(a, b, others) {
        Ok([x, y]) => fields::each("", (&x, &y), rules, changes),
        Err(_) if a.data != b.data => changes.add("data".to_owned(), None),
        Err(_) => {}
    }
}

fn farside(
    message_a: &ScannedMessage<'_>,
    message_b: &ScannedMessage<'_>,
    rules: &Rules,
) -> Option<FieldDiff> {
    let (Some(a), Some(b)) = (
        RecordRef::read(message_a.data),
        RecordRef::read(message_b.data),
    ) else {
        return Some(fields::raw("record", message_a.data, message_b.data));
    };
    let text = [
        ("fate", a.class.name(), b.class.name()),
        ("link", a.link, b.link),
        ("reason", a.reason, b.reason),
        ("note", a.note, b.note),
    ];
    let differ = |(field, a, b): &(&str, &str, &str)| a != b && rules.enter_root(field).is_some();
    let text = text.into_iter().find(differ);
    let body_a = (a.body, fields::schema(message_a.channel));
    let body_b = (b.body, fields::schema(message_b.channel));
    text.map(|(field, a, b)| FieldDiff::texts(field, a, b))
        .or_else(|| bodies(body_a, body_b, rules))
        .or_else(|| log_times("sent", a.sent_ns, b.sent_ns, rules))
        .or_else(|| log_times("log_time", a.key.time_ns, b.key.time_ns, rules))
}

/// The messages of both logs as values, if they can be read; else why not.
pub(super) fn values<'a>(
    a: &'a ScannedMessage<'_>,
    b: &'a ScannedMessage<'_>,
    others: [&'a [Arc<ChannelInfo>]; 2],
) -> Result<[Value<'a>; 2], Unreadable> {
    let value = |message: &'a ScannedMessage<'_>, others| {
        fields::value(message.channel, message.data, others)
    };
    Ok([value(a, others[0])?, value(b, others[1])?])
}

fn any(
    a: &ScannedMessage<'_>,
    b: &ScannedMessage<'_>,
    others: [&[Arc<ChannelInfo>]; 2],
    rules: &Rules,
) -> Option<FieldDiff> {
    let (x, y) = (a.channel.encoding.as_str(), b.channel.encoding.as_str());
    let data = match (x, y) {
        (x, y) if x != y => Some(FieldDiff::texts("encoding", x, y)),
        ("protobuf", _) => {
            let x = Encoded::new(a.data, fields::schema(a.channel)).among(others[0]);
            let y = Encoded::new(b.data, fields::schema(b.channel)).among(others[1]);
            protobuf("", &x, &y, rules)
        }
        _ if a.data == b.data && same_schema(a.channel, b.channel) => None,
        _ => match values(a, b, others) {
            Ok([x, y]) => fields::first(&x, &y, rules),
            Err(_) if a.data == b.data => None,
            Err(why) => Some(fields::raw("data", a.data, b.data).because(why.to_string())),
        },
    };
    let (one, other) = (&a.head, &b.head);
    data.or_else(|| log_times("log_time", one.log_time, other.log_time, rules))
        .or_else(|| log_times("publish_time", one.publish_time, other.publish_time, rules))
}

fn same_schema(a: &ChannelInfo, b: &ChannelInfo) -> bool {
    match (&a.schema, &b.schema) {
        (Some(x), Some(y)) => x.encoding == y.encoding && x.name == y.name && x.data == y.data,
        (x, y) => x.is_none() && y.is_none(),
    }
}

/// Two times of messages, if they differ by more than they may.
fn log_times(field: &str, a_ns: u64, b_ns: u64, rules: &Rules) -> Option<FieldDiff> {
    let bound = rules.enter_root(field)?;
    let same = rules.log_times_agree(a_ns, b_ns, bound);
    let exact = |ns| format!("{} s", Seconds(ns));
    (!same).then(|| FieldDiff::new(field, exact(a_ns), exact(b_ns)))
}

/// Describes a record as a difference, and traces back what caused it.
pub(super) fn describe(
    index: &mut Index<'_>,
    entry: &Entry,
    mode: Mode,
    names: &mut Names,
    diff: FieldDiff,
) -> Result<FirstDifference, LogError> {
    let message = index.scanner.message_at(entry.position, entry.channel)?;
    let mut first = FirstDifference {
        time_s: seconds(entry.time_ns),
        time_ns: entry.time_ns,
        topic: message.channel.topic.clone(),
        ordinal: entry.ordinal,
        field: diff.field,
        a: diff.a,
        b: diff.b,
        ..FirstDifference::default()
    };
    let Some(record) = RecordRef::read(message.data).filter(|_| mode == Mode::Farside) else {
        return Ok(first);
    };
    first.sender = record.sender.to_owned();
    first.receiver = record.receiver.to_owned();
    first.ordinal = record.ordinal;
    first.match_key = record
        .match_key
        .map(|bits| MatchKey::from_bits(bits).to_string());
    first.link = record.link.to_owned();
    first.reason = record.reason.to_owned();
    let carriage = record.carriage.map(|carriage| carriage.to_string());
    first.carriage = carriage.unwrap_or_default();
    first.carried_a = (!record.link.is_empty()).then(|| Carried {
        id: message_id(&record).to_string(),
        sent_ns: record.sent_ns,
        at_ns: record.key.time_ns,
        fate: record.class.name().to_owned(),
        reason: record.reason.to_owned(),
        carriage: first.carriage.clone(),
    });
    let cause = record.cause.map(|key| LoggedKey::of(&key));
    trace(index, names, cause, &mut first)?;
    Ok(first)
}

/// What the message of a record is called in its own log.
pub(super) fn message_id(record: &RecordRef<'_>) -> MessageId {
    MessageId {
        sender: record.sender.to_owned(),
        receiver: record.receiver.to_owned(),
        kind: record.kind.to_owned(),
        number: MessageNumber::Ordinal(record.ordinal),
        copy: record.copy,
    }
}

/// Whether a cause is the same timer as the one that it led to: in a chain they say nothing new.
fn is_same_timer(later: &Cause, cause: &Cause) -> bool {
    let is_timer = |cause: &Cause| cause.fate == RecordClass::Timer.name();
    is_timer(later) && is_timer(cause) && later.topic == cause.topic
}

/// Follows the causes back to a start.
fn trace(
    index: &mut Index<'_>,
    names: &mut Names,
    next: Option<LoggedKey>,
    first: &mut FirstDifference,
) -> Result<(), LogError> {
    let mut omitted = 0;
    let mut origin: Option<Cause> = None;
    chain::walk(index, names, next, |step| {
        let cause = match step {
            Step::Event(record, channel) => Cause {
                time_s: seconds(record.key.time_ns),
                time_ns: record.key.time_ns,
                topic: channel.topic.clone(),
                sender: record.sender.to_owned(),
                receiver: record.receiver.to_owned(),
                ordinal: record.ordinal,
                fate: record.class.name().to_owned(),
                ..Cause::default()
            },
            Step::Unknown(key) => {
                let unknown = Cause {
                    time_s: seconds(key.time_ns),
                    time_ns: key.time_ns,
                    sender: key.source,
                    fate: "not in the log".to_owned(),
                    ..Cause::default()
                };
                omitted += origin.replace(unknown).map_or(0, |left| 1 + left.repeats);
                return;
            }
        };
        let last = origin.as_mut().or(first.causes.last_mut());
        if let Some(last) = last.filter(|last| is_same_timer(last, &cause)) {
            last.repeats += 1;
            last.since_ns = cause.time_ns;
        } else if first.causes.len() < CAUSES_LISTED {
            first.causes.push(cause);
        } else {
            omitted += origin.replace(cause).map_or(0, |left| 1 + left.repeats);
        }
    })?;
    first.causes.extend(origin);
    first.causes_omitted = omitted;
    Ok(())
}
