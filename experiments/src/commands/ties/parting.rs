//! Where two runs part whose simultaneous events went in another order, and which two events those were.

mod instants;

use std::collections::BTreeMap;
use std::path::Path;

use farside_logs::{AnyMessages, Value};
use serde::Serialize;

use self::instants::{Event, Instant, Instants};
use super::runs::Runs;
use crate::commands::CommandError;

/// Where two runs part.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Parting {
    /// The tie seeds of the two.
    pub(super) tie_seeds: [Option<u64>; 2],
    /// The first event that differs in more than its place.
    pub(super) event: Option<Differing>,
    /// The first state that an actor recorded otherwise, if that is before.
    pub(super) state: Option<State>,
    /// The two events that went in another order last before that, at the actor that differs first if it has any:
    /// the likeliest to have decided. That these did, and no swap before them, is not proved.
    pub(super) tie: Option<Tie>,
}

/// An event that one run has at an instant, and the other not or otherwise.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(super) struct Differing {
    pub(super) time_ns: u64,
    /// What it is called, as in `fork`.
    pub(super) id: String,
    /// Whose doing it is.
    pub(super) actor: String,
    /// In what it differs: `fate`, `presence`, or the field.
    pub(super) field: String,
    pub(super) a: String,
    pub(super) b: String,
}

/// A state that an actor recorded in one run, and not so in the other.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(super) struct State {
    pub(super) time_ns: u64,
    pub(super) actor: String,
    pub(super) topic: String,
}

/// Two events at one instant that went in one order in one run, and in the other order in the other.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(super) struct Tie {
    pub(super) time_ns: u64,
    /// Which actor they happened to, or which link; none if each happened to another one.
    pub(super) at: Option<String>,
    /// The one that was first in the first run.
    pub(super) first: String,
    /// The one that was first in the second run.
    pub(super) then: String,
}

impl Tie {
    fn new(time_ns: u64, at: Option<&str>, [first, then]: [&str; 2]) -> Self {
        Tie {
            time_ns,
            at: at.map(str::to_owned),
            first: first.to_owned(),
            then: then.to_owned(),
        }
    }
}

/// Runs with both tie seeds once more, and looks where they part.
pub(super) fn find(runs: &Runs<'_>, tie_seeds: [Option<u64>; 2]) -> Result<Parting, CommandError> {
    let temporary = |source| CommandError::Write {
        path: std::env::temp_dir(),
        source,
    };
    let folder = tempfile::tempdir().map_err(temporary)?;
    let paths = ["a.mcap", "b.mcap"].map(|name| folder.path().join(name));
    for (tie_seed, path) in tie_seeds.into_iter().zip(&paths) {
        runs.one(tie_seed, Some(path))?;
    }
    let [a, b] = &paths;
    let mut walked = walk(a, b)?;
    let event = match walked.event.take() {
        Some(parted) => Some(differing(&parted, [a, b])?),
        None => None,
    };
    let parting_ns = event.as_ref().map(|event| event.time_ns);
    let state = walked
        .state
        .filter(|state| parting_ns.is_none_or(|time_ns| state.time_ns < time_ns));
    let actor = match (&state, &event) {
        (Some(state), _) => Some(state.actor.as_str()),
        (None, Some(event)) => Some(event.actor.as_str()),
        (None, None) => None,
    };
    let its = actor.and_then(|actor| walked.ties.get(actor));
    Ok(Parting {
        tie_seeds,
        tie: its.cloned().or(walked.last),
        event,
        state,
    })
}

/// The first event that only one of two logs has so, as both have it.
struct Parted {
    time_ns: u64,
    event: Event,
    /// Whether it is from the second log.
    is_of_b: bool,
    /// The same event of the other log at the same instant.
    beside: Option<Event>,
}

/// What two logs have in another order, up to where they differ.
#[derive(Default)]
struct Walked {
    /// The last pair for each actor or link that they happened to.
    ties: BTreeMap<String, Tie>,
    /// The last pair of all, whomever they happened to.
    last: Option<Tie>,
    state: Option<State>,
    event: Option<Parted>,
}

/// Goes through both logs, up to where something but the order differs.
fn walk(a: &Path, b: &Path) -> Result<Walked, CommandError> {
    let (mut a, mut b) = (Instants::open(a)?, Instants::open(b)?);
    let mut walked = Walked::default();
    while let Some(time_ns) = [a.next_ns(), b.next_ns()].into_iter().flatten().min() {
        if walked.state.is_some() || walked.event.is_some() {
            break;
        }
        let (one, other) = (a.take(time_ns)?, b.take(time_ns)?);
        walked.compare(time_ns, one, other);
    }
    Ok(walked)
}

impl Walked {
    fn compare(&mut self, time_ns: u64, mut a: Instant, mut b: Instant) {
        let (ours, theirs) = (a.by_place(), b.by_place());
        for (at, first) in &ours {
            let Some(second) = theirs.get(at) else {
                continue;
            };
            if let Some(pair) = swapped(first, second) {
                let tie = Tie::new(time_ns, Some(*at), pair);
                self.ties.insert((*at).to_owned(), tie);
            }
        }
        if let Some(pair) = swapped(&a.ids(), &b.ids()) {
            self.last = Some(Tie::new(time_ns, None, pair));
        }
        let state = a.other_state(&mut b);
        self.state = state.map(|(actor, topic)| State {
            time_ns,
            actor,
            topic,
        });
        self.event = parted(time_ns, &a.events, &b.events);
    }
}

/// The first event of an instant that only one of two logs has so.
fn parted(time_ns: u64, a: &[Event], b: &[Event]) -> Option<Parted> {
    // Of what is there several times alike, as many have to be there.
    let mut left: BTreeMap<&Event, usize> = BTreeMap::new();
    for event in b {
        *left.entry(event).or_default() += 1;
    }
    let only_in_a = a.iter().find(|event| match left.get_mut(event) {
        Some(count) if *count > 0 => {
            *count -= 1;
            false
        }
        _ => true,
    });
    let only_in_b = || {
        b.iter()
            .find(|event| left.get(event).is_some_and(|count| *count > 0))
    };
    let (event, is_of_b) = match only_in_a {
        Some(event) => (event, false),
        None => (only_in_b()?, true),
    };
    let others = if is_of_b { a } else { b };
    let beside = others.iter().find(|other| other.is_called_as(event));
    Some(Parted {
        time_ns,
        event: event.clone(),
        is_of_b,
        beside: beside.cloned(),
    })
}

/// In what an event differs, and how either run has it.
fn differing(parted: &Parted, logs: [&Path; 2]) -> Result<Differing, CommandError> {
    let Parted { time_ns, event, .. } = parted;
    let other_log = logs[usize::from(!parted.is_of_b)];
    let (field, one, other) = match &parted.beside {
        Some(beside) => {
            let own_log = logs[usize::from(parted.is_of_b)];
            let (one, other) = (fields(own_log, event)?, fields(other_log, beside)?);
            let names = one.keys().chain(other.keys());
            let differs = |name: &&String| one.get(*name) != other.get(*name);
            let name = names.clone().find(differs).cloned().unwrap_or_default();
            let value = |of: &BTreeMap<String, String>| {
                of.get(&name)
                    .map_or_else(|| "missing".to_owned(), String::clone)
            };
            let (one, other) = (value(&one), value(&other));
            (name, one, other)
        }
        None => match found(other_log, event)? {
            Some(other) => ("fate".to_owned(), event.fate(), other.fate()),
            None => ("presence".to_owned(), event.fate(), "missing".to_owned()),
        },
    };
    let (a, b) = match parted.is_of_b {
        false => (one, other),
        true => (other, one),
    };
    Ok(Differing {
        time_ns: *time_ns,
        id: event.id.clone(),
        actor: event.actor.clone(),
        field,
        a,
        b,
    })
}

/// The event of the same name in another log, whenever it is.
fn found(log: &Path, event: &Event) -> Result<Option<Event>, CommandError> {
    let mut instants = Instants::open(log)?;
    while let Some(time_ns) = instants.next_ns() {
        let mut events = instants.take(time_ns)?.events.into_iter();
        if let Some(found) = events.find(|other| other.is_called_as(event)) {
            return Ok(Some(found));
        }
    }
    Ok(None)
}

/// What a log says of an event, field by field, but for its place in the order of events.
fn fields(log: &Path, event: &Event) -> Result<BTreeMap<String, String>, CommandError> {
    let mut messages = AnyMessages::open(log, &[])?;
    while let Some(message) = messages.next()? {
        if message.topic() != event.topic {
            continue;
        }
        let Ok(value) = message.value() else {
            continue;
        };
        let is = |name: &str, number: u64| value.at(name) == Some(Value::Int(number.into()));
        let (number, of) = event.number;
        let is_it = is("time_ns", event.time_ns)
            && is(number, of)
            && is("copy", event.copy.into())
            && value.at("receiver") == Some(Value::from(event.receiver.as_str()));
        if !is_it {
            continue;
        }
        let mut fields = BTreeMap::new();
        value.flatten(&mut |name, value| {
            let is_said = ["body", "fate", "reason", "sent_ns", "note"];
            if is_said
                .iter()
                .any(|said| name.split('.').next() == Some(said))
            {
                fields.insert(name.to_owned(), value.to_string());
            }
        });
        return Ok(fields);
    }
    Ok(BTreeMap::new())
}

/// The first event of one order that is behind a later one in the other order, and that one.
fn swapped<'a>(a: &[&'a str], b: &[&'a str]) -> Option<[&'a str; 2]> {
    if a == b {
        return None;
    }
    let places: BTreeMap<&str, usize> = b.iter().enumerate().map(|(at, id)| (*id, at)).collect();
    let both = a.iter().filter_map(|id| Some((*places.get(id)?, *id)));
    let both: Vec<(usize, &str)> = both.collect();
    // From behind: whichever of those that follow is first in the other order.
    let mut least = *both.last()?;
    let mut found = None;
    for (place, id) in both.iter().rev() {
        match least.0 < *place {
            true => found = Some([*id, least.1]),
            false => least = (*place, *id),
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pair_that_both_have_in_another_order_is_found() {
        let pair = |a: &'static str, b: &'static str| {
            let (a, b): (Vec<&str>, Vec<&str>) = (a.split(' ').collect(), b.split(' ').collect());
            swapped(&a, &b).map(|pair| pair.join(" "))
        };
        assert_eq!(pair("a b c", "a c b"), Some("b c".to_owned()));
        assert_eq!(pair("a b c", "c a b"), Some("a c".to_owned()));
        assert_eq!(pair("a b c", "a b c"), None);
        // What only one of them has is no tie.
        assert_eq!(pair("a x b", "y a b"), None);
        assert_eq!(pair("x b a", "a y b"), Some("b a".to_owned()));
    }

    #[test]
    fn events_at_an_instant_may_come_in_another_order_but_as_often() {
        let event = |id: &str, body: &str| Event {
            id: id.to_owned(),
            body: body.as_bytes().to_vec(),
            ..Event::default()
        };
        let [a, b, c] = [event("a", "1"), event("b", "1"), event("b", "2")];
        assert!(parted(5, &[a.clone(), b.clone()], &[b.clone(), a.clone()]).is_none());
        let other = parted(5, &[a.clone(), b.clone()], &[c.clone(), a.clone()]).unwrap();
        assert_eq!((other.event.id.as_str(), other.is_of_b), ("b", false));
        assert_eq!(other.beside, Some(c));
        let less = parted(5, std::slice::from_ref(&a), &[a.clone(), a.clone()]).unwrap();
        assert!(less.is_of_b);
    }

    #[test]
    fn states_at_an_instant_may_come_in_another_order() {
        let instant = |bodies: &[&[u8]]| {
            let mut instant = Instant::default();
            let bodies = bodies.iter().map(|body| body.to_vec()).collect();
            let of = ("r".to_owned(), "/state/r/pose".to_owned());
            instant.states.insert(of, bodies);
            instant
        };
        let mut walked = Walked::default();
        walked.compare(5, instant(&[b"1", b"2"]), instant(&[b"2", b"1"]));
        assert_eq!(walked.state, None);
        walked.compare(6, instant(&[b"1", b"2"]), instant(&[b"2"]));
        assert_eq!(walked.state.as_ref().unwrap().time_ns, 6);
        walked.compare(7, Instant::default(), instant(&[b"2"]));
        assert_eq!(walked.state.unwrap().actor, "r");
    }
}
