//! Whom the differences of two logs touched first: of each actor the first thing that reached it otherwise,
//! and the first that it said or did otherwise. So much is kept, whatever the number of differences.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use farside::record::RecordClass;

use super::entry::{Entry, Names};
use super::found::Found;

/// When a log ends.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct End {
    pub(super) time_ns: u64,
    /// The run went on: the file is cut.
    pub(super) is_cut: bool,
}

/// Where in a run something is, as far as two logs can be compared.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moment {
    pub(super) time_ns: u64,
    step: u32,
    source: u32,
    count: u64,
    rank: (usize, u32),
}

impl Moment {
    /// Where its record is.
    fn of(entry: &Entry, found: &Found) -> Moment {
        Moment {
            time_ns: entry.time_ns,
            step: entry.step,
            source: entry.source,
            count: entry.count,
            rank: found.rank(),
        }
    }

    /// When its message was sent.
    fn sent(entry: &Entry, found: &Found) -> Moment {
        Moment {
            time_ns: entry.said.sent_ns,
            step: 0,
            source: entry.said.sender,
            ..Moment::of(entry, found)
        }
    }

    /// As keys of events are ordered.
    fn order<'n>(&self, names: &'n Names) -> (u64, u32, bool, &'n str, u64, (usize, u32)) {
        let source = names.name(self.source);
        let is_actor = source != "@control";
        (
            self.time_ns,
            self.step,
            is_actor,
            source,
            self.count,
            self.rank,
        )
    }

    pub(super) fn cmp(&self, other: &Moment, names: &Names) -> Ordering {
        // Names are looked up only where times do not decide.
        let times = (self.time_ns, self.step).cmp(&(other.time_ns, other.step));
        times.then_with(|| self.order(names).cmp(&other.order(names)))
    }
}

/// The earliest difference of its kind.
pub(super) type Earliest = Option<(Moment, Found)>;

/// What first touched an actor, or a link.
#[derive(Clone, Debug, Default)]
pub(super) struct Touched {
    /// What reached it otherwise: a message, a crash; of a link, that it was changed.
    pub(super) input: Earliest,
    /// What it said or did otherwise; of a link, what it was given to carry otherwise.
    pub(super) output: Earliest,
}

/// The first that touched each actor and each link, by the numbers of their names.
pub(super) struct Reach {
    pub(super) actors: BTreeMap<u32, Touched>,
    pub(super) links: BTreeMap<u32, Touched>,
    pub(super) ends: [End; 2],
    /// That the run was stopped otherwise.
    pub(super) stop: Earliest,
    /// When what was planned differs first, and how often it does then.
    pub(super) injected: Option<(u64, u64)>,
}

impl Reach {
    pub(super) fn new(ends: [End; 2]) -> Reach {
        Reach {
            actors: BTreeMap::new(),
            links: BTreeMap::new(),
            ends,
            stop: None,
            injected: None,
        }
    }

    /// Whether only one log has the record, since the other had ended by then.
    pub(super) fn is_beyond_end(&self, found: &Found) -> bool {
        let (entry, end) = match found {
            Found::OnlyInA(entry) => (entry, self.ends[1]),
            Found::OnlyInB(entry) => (entry, self.ends[0]),
            Found::Changed(..) | Found::Reordered(..) => return false,
        };
        // A log that is whole has all that was sent before its end, if only as under way.
        let time_ns = match entry.class.is_fate() && !end.is_cut {
            true => entry.said.sent_ns,
            false => entry.time_ns,
        };
        // At the very end it may be behind the last event.
        time_ns >= end.time_ns
    }

    /// Adds a difference.
    pub(super) fn add(&mut self, found: &Found, names: &Names) {
        if matches!(found, Found::Reordered(..)) || self.is_beyond_end(found) {
            return;
        }
        let both = found.both();
        let Some(one) = both[0].or(both[1]) else {
            return;
        };
        if found.is_injected(names) {
            let time_ns = found.when(names).0;
            match &mut self.injected {
                Some((known, count)) if *known == time_ns => *count += 1,
                Some((known, _)) if *known < time_ns => {}
                first => *first = Some((time_ns, 1)),
            }
        }
        let earlier = both[1].filter(|b| {
            let of = |entry: &Entry| Moment::of(entry, found);
            of(b).cmp(&of(one), names) == Ordering::Less
        });
        let moment = Moment::of(earlier.unwrap_or(one), found);
        use RecordClass::{Change, Crash, Delivered, HandOver, InFlight, Lost, Restart};
        use RecordClass::{Sample, Start, Stop, Timer, Told};
        match one.class {
            Delivered | Lost | InFlight => self.message(found, names),
            Timer => {
                let actor = self.actors.entry(one.said.receiver).or_default();
                note(&mut actor.output, moment, found, names);
            }
            Start | Crash | Restart | Told => {
                let actor = self.actors.entry(one.said.receiver).or_default();
                note(&mut actor.input, moment, found, names);
            }
            Change => {
                let link = self.links.entry(one.said.receiver).or_default();
                note(&mut link.input, moment, found, names);
                let source = names.name(one.source);
                // An actor that changes a link does something.
                if source != "@control" {
                    let actor = self.actors.entry(one.source).or_default();
                    note(&mut actor.output, moment, found, names);
                }
            }
            Stop => note(&mut self.stop, moment, found, names),
            // What links do by themselves; samples are not compared.
            HandOver | Sample => {}
        }
    }

    /// Adds what became otherwise of a message.
    fn message(&mut self, found: &Found, names: &Names) {
        let both = found.both();
        let entries = || both.into_iter().flatten();
        if !found.is_sent_alike() {
            let sent = entries().min_by_key(|entry| entry.said.sent_ns);
            if let Some(entry) = sent {
                let moment = Moment::sent(entry, found);
                let sender = self.actors.entry(entry.said.sender).or_default();
                note(&mut sender.output, moment, found, names);
                if !names.name(entry.said.link).is_empty() {
                    let link = self.links.entry(entry.said.link).or_default();
                    note(&mut link.output, moment, found, names);
                }
            }
        }
        let delivered = |entry: &&Entry| entry.class == RecordClass::Delivered;
        let [a, b] = both.map(|entry| entry.filter(delivered));
        let received = match (a, b) {
            // The same at the same time, by another link perhaps: nothing else for the receiver.
            (Some(a), Some(b)) if found.is_sent_alike() && a.time_ns == b.time_ns => None,
            (Some(a), Some(b)) => {
                let of = |entry: &Entry| Moment::of(entry, found);
                Some(match of(b).cmp(&of(a), names) {
                    Ordering::Less => b,
                    _ => a,
                })
            }
            // In the other log it may still be under way.
            (Some(a), None) => Some(a).filter(|a| a.time_ns < self.ends[1].time_ns),
            (None, Some(b)) => Some(b).filter(|b| b.time_ns < self.ends[0].time_ns),
            (None, None) => None,
        };
        if let Some(entry) = received {
            let receiver = self.actors.entry(entry.said.receiver).or_default();
            note(&mut receiver.input, Moment::of(entry, found), found, names);
        }
    }
}

/// Keeps the earlier one.
fn note(earliest: &mut Earliest, moment: Moment, found: &Found, names: &Names) {
    let is_earlier = match earliest {
        Some((known, _)) => moment.cmp(known, names) == Ordering::Less,
        None => true,
    };
    if is_earlier {
        *earliest = Some((moment, *found));
    }
}
