//! What the living actors were last in, to say what led to an output.

use std::collections::VecDeque;

use crate::engine::Happened;
use crate::ids::{EntityId, KindIndex};
use crate::key::EventKey;
use crate::record::RecordClass;
use crate::time::SimTime;
use crate::topology::Topology;

use super::report::Step;

/// An event of an actor.
#[derive(Clone, Copy)]
pub(super) struct Event {
    class: RecordClass,
    time: SimTime,
    actor: EntityId,
    sender: EntityId,
    kind: Option<KindIndex>,
    ordinal: u64,
}

impl Event {
    pub(super) fn told(&self, topology: &Topology) -> Step {
        let kind = self.kind.map(|kind| topology.kind(kind).name());
        Step {
            class: self.class,
            time: self.time,
            actor: topology.name(self.actor).to_owned(),
            sender: topology.name(self.sender).to_owned(),
            kind: kind.unwrap_or_default().to_owned(),
            ordinal: self.ordinal,
        }
    }
}

/// An event, and the input that led to it: itself, unless it is a timer.
#[derive(Clone, Copy)]
pub(super) struct Led {
    pub(super) event: Event,
    pub(super) input: Option<Event>,
}

/// The last events of the living actors, in key order.
#[derive(Default)]
pub(super) struct Trail(VecDeque<(EventKey, Led)>);

/// So many are kept.
const KEPT: usize = 1 << 13;

impl Trail {
    pub(super) fn push(&mut self, happened: &Happened<'_>) {
        let head = happened.head;
        let event = Event {
            class: happened.class,
            time: happened.key.time,
            actor: head.receiver,
            sender: head.sender,
            kind: head.kind(),
            ordinal: head.ordinal,
        };
        let input = match happened.class {
            RecordClass::Timer => {
                let set = head.cause().and_then(|cause| self.find(cause));
                set.and_then(|set| set.input)
            }
            _ => Some(event),
        };
        if self.0.len() == KEPT {
            self.0.pop_front();
        }
        self.0.push_back((happened.key, Led { event, input }));
    }

    /// The event with this key, if it is one of the last.
    pub(super) fn find(&self, key: EventKey) -> Option<Led> {
        let at = self.0.binary_search_by_key(&key, |(key, _)| *key).ok()?;
        Some(self.0[at].1)
    }
}
