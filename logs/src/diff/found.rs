//! A difference: which records of the two logs it is of, and where among all differences it stands.

use farside::record::RecordClass;

use super::entry::{Entry, Names};
use super::spill::Fixed;
use crate::parse::Parser;

/// The order in which differences are sorted: time, step, whether an actor is the source, the
/// source, its count, whether it is the fate of a message and no event, place in the log.
pub(super) type Order<'a> = (u64, u32, bool, &'a str, u64, bool, u32);

/// Where a record stands in that order.
pub(super) fn order<'n>(names: &'n Names, entry: &Entry) -> Order<'n> {
    let source = names.name(entry.source);
    (
        entry.time_ns,
        entry.step,
        source != "@control",
        source,
        entry.count,
        !entry.is_event(),
        entry.at,
    )
}

/// A difference, and where it is.
#[derive(Clone, Copy, Debug)]
pub(super) enum Found {
    Changed(Entry, Entry),
    OnlyInA(Entry),
    OnlyInB(Entry),
    Reordered(Entry, Entry),
}

impl Found {
    /// Of differences at the same place one of the lesser rank is told.
    pub(super) fn rank(&self) -> (usize, u32) {
        match self {
            Found::Changed(a, _) => (0, a.at),
            Found::OnlyInA(a) => (1, a.at),
            Found::OnlyInB(b) => (2, b.at),
            Found::Reordered(a, _) => (3, a.topic),
        }
    }

    /// Its record in the first log, and that in the second.
    pub(super) fn both(&self) -> [Option<&Entry>; 2] {
        match self {
            Found::Changed(a, b) | Found::Reordered(a, b) => [Some(a), Some(b)],
            Found::OnlyInA(a) => [Some(a), None],
            Found::OnlyInB(b) => [None, Some(b)],
        }
    }

    /// When it shows: the earlier of its two records.
    pub(super) fn when<'n>(&self, names: &'n Names) -> Order<'n> {
        let of = |entry: Option<&Entry>| entry.map(|entry| order(names, entry));
        let [a, b] = self.both().map(of);
        match (a, b) {
            (Some(a), Some(b)) => a.min(b),
            (one, other) => one
                .or(other)
                .unwrap_or((u64::MAX, 0, false, "", 0, false, 0)),
        }
    }

    /// What it is about.
    pub(super) fn class(&self) -> RecordClass {
        let [a, b] = self.both();
        a.or(b).map_or(RecordClass::Sample, |entry| entry.class)
    }

    /// Whether it is of an event that was planned before the run.
    pub(super) fn is_injected(&self, names: &Names) -> bool {
        let injected =
            |entry: &Entry| is_control(entry.class) && names.name(entry.source) == "@control";
        self.both().into_iter().flatten().all(injected)
    }

    /// Whether both logs have the message, and the sender said the same at the same time: only what became
    /// of it differs.
    pub(super) fn is_sent_alike(&self) -> bool {
        match self {
            Found::Changed(a, b) => {
                let sent = |entry: &Entry| (entry.said.sent_ns, entry.said.body);
                sent(a) == sent(b)
            }
            _ => false,
        }
    }

    /// Whether it has another number in its flow in the other log: to a link that is another message.
    pub(super) fn is_renumbered(&self) -> bool {
        matches!(self, Found::Changed(a, b) if a.has_place && a.ordinal != b.ordinal)
    }
}

/// Two records that are the same one, to be compared by their fields.
#[derive(Clone, Copy)]
pub(super) struct Pair(pub(super) Entry, pub(super) Entry);

impl Fixed for Pair {
    const BYTES: usize = 2 * Entry::BYTES;

    fn put(&self, out: &mut Vec<u8>) {
        self.0.put(out);
        self.1.put(out);
    }

    fn take(parser: &mut Parser<'_>) -> Option<Pair> {
        Some(Pair(Entry::take(parser)?, Entry::take(parser)?))
    }
}

/// Where two records that are the same one are in the two logs.
#[derive(Clone, Copy)]
pub(super) struct Places {
    pub(super) topic: u32,
    pub(super) a: u32,
    pub(super) b: u32,
}

impl Fixed for Places {
    const BYTES: usize = 12;

    fn put(&self, out: &mut Vec<u8>) {
        for number in [self.topic, self.a, self.b] {
            out.extend_from_slice(&number.to_le_bytes());
        }
    }

    fn take(parser: &mut Parser<'_>) -> Option<Places> {
        Some(Places {
            topic: parser.u32()?,
            a: parser.u32()?,
            b: parser.u32()?,
        })
    }
}

/// What is done to actors and links from outside.
pub(super) fn is_control(class: RecordClass) -> bool {
    use RecordClass::{Change, Crash, Restart, Told};
    matches!(class, Crash | Restart | Change | Told)
}
