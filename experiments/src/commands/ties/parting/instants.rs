//! A log, an instant at a time: what happens to whom, in which order.

use std::collections::BTreeMap;
use std::path::Path;

use farside::record::RecordClass;
use farside::ruling::{MessageId, MessageNumber};
use farside_logs::{Log, LoggedRecord, Records};

use crate::commands::CommandError;

/// Something that happens.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Event {
    /// What it is called: a message as other commands call it.
    pub(super) id: String,
    /// Its class, and why it was lost.
    pub(super) class: &'static str,
    pub(super) reason: String,
    pub(super) body: Vec<u8>,
    pub(super) sent_ns: u64,
    pub(super) time_ns: u64,
    /// Whose doing it is: who sent the message, or whom the event happens to.
    pub(super) actor: String,
    pub(super) receiver: String,
    /// To which actor it happens, or to which link; none if that is nobody.
    pub(super) place: Option<String>,
    pub(super) topic: String,
    /// Its number among its like, and the field of records that holds it.
    pub(super) number: (&'static str, u64),
    pub(super) copy: u32,
}

impl Event {
    fn new(record: LoggedRecord) -> Self {
        let place = match record.class {
            // A shared link decides here.
            RecordClass::HandOver => record.link.clone(),
            RecordClass::Delivered | RecordClass::Timer | RecordClass::Told => {
                Some(record.receiver.clone())
            }
            _ => None,
        };
        Event {
            id: called(&record),
            class: record.class.name(),
            reason: record.reason,
            body: record.body,
            sent_ns: record.sent_ns,
            time_ns: record.key.time_ns,
            actor: record.sender,
            receiver: record.receiver,
            place,
            topic: record.topic,
            number: match record.match_key {
                Some(key) => ("match_key", key.bits()),
                None => ("ordinal", record.ordinal),
            },
            copy: record.copy,
        }
    }

    /// Whether it is the same one, whatever it says.
    pub(super) fn is_called_as(&self, other: &Event) -> bool {
        let is_timer = |event: &Event| event.class == RecordClass::Timer.name();
        self.id == other.id && is_timer(self) == is_timer(other)
    }

    /// What became of it when.
    pub(super) fn fate(&self) -> String {
        let at = format!("{} at {:.6} s", self.class, self.time_ns as f64 / 1e9);
        match self.reason.as_str() {
            "" => at,
            reason => format!("{at}, {reason}"),
        }
    }
}

fn called(record: &LoggedRecord) -> String {
    let (kind, ordinal) = (&record.kind, record.ordinal);
    match record.class {
        RecordClass::Timer => format!("timer {kind} {ordinal} of {}", record.receiver),
        RecordClass::Told => format!("{kind} {ordinal} that {} is told", record.receiver),
        RecordClass::Delivered
        | RecordClass::Lost
        | RecordClass::InFlight
        | RecordClass::HandOver => {
            let number = match record.match_key {
                Some(key) => MessageNumber::Key { key, repeat: 0 },
                None => MessageNumber::Ordinal(ordinal),
            };
            let id = MessageId {
                sender: record.sender.clone(),
                receiver: record.receiver.clone(),
                kind: kind.clone(),
                number,
                copy: record.copy,
            };
            id.to_string()
        }
        class => {
            let what = format!("{} of {} {}", class.name(), record.receiver, record.note);
            what.trim_end().to_owned()
        }
    }
}

/// What happens at an instant in a log.
#[derive(Default)]
pub(super) struct Instant {
    pub(super) events: Vec<Event>,
    /// By actor and topic, what it recorded.
    pub(super) states: BTreeMap<(String, String), Vec<Vec<u8>>>,
}

impl Instant {
    fn add(&mut self, record: LoggedRecord) {
        if record.class == RecordClass::Sample {
            let of = (record.sender, record.topic);
            self.states.entry(of).or_default().push(record.body);
        } else {
            self.events.push(Event::new(record));
        }
    }

    /// What happens, in order.
    pub(super) fn ids(&self) -> Vec<&str> {
        self.events.iter().map(|event| event.id.as_str()).collect()
    }

    /// What happens to whom, in order.
    pub(super) fn by_place(&self) -> BTreeMap<&str, Vec<&str>> {
        let mut places: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
        for event in &self.events {
            if let Some(place) = &event.place {
                places.entry(place).or_default().push(&event.id);
            }
        }
        places
    }

    /// The first state of which one of the two has something else, whatever the order.
    pub(super) fn other_state(&mut self, other: &mut Instant) -> Option<(String, String)> {
        let states = self.states.values_mut().chain(other.states.values_mut());
        states.for_each(|bodies| bodies.sort_unstable());
        let all = self.states.keys().chain(other.states.keys());
        let differs = |of: &&(String, String)| self.states.get(*of) != other.states.get(*of);
        all.filter(differs).min().cloned()
    }
}

/// A log, an instant at a time.
pub(super) struct Instants {
    records: Records,
    /// The first record of the next instant.
    ahead: Option<LoggedRecord>,
}

impl Instants {
    pub(super) fn open(path: &Path) -> Result<Self, CommandError> {
        let mut records = Log::open(path)?.records()?;
        let ahead = records.next().transpose()?;
        Ok(Instants { records, ahead })
    }

    pub(super) fn next_ns(&self) -> Option<u64> {
        self.ahead.as_ref().map(|record| record.key.time_ns)
    }

    /// What happens at this instant, if it is the next.
    pub(super) fn take(&mut self, time_ns: u64) -> Result<Instant, CommandError> {
        let mut instant = Instant::default();
        while let Some(record) = self.ahead.take() {
            if record.key.time_ns > time_ns {
                self.ahead = Some(record);
                break;
            }
            instant.add(record);
            self.ahead = self.records.next().transpose()?;
        }
        Ok(instant)
    }
}
