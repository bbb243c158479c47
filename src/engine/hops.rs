//! The last hops that a run allows at one instant, kept so that a fault can say what led to one more.

use super::{Class, Head, Side};
use crate::ids::EntityId;
use crate::key::EventKey;
use crate::topology::Topology;

/// An event at an instant of very many steps.
#[derive(Clone, Copy)]
pub(crate) struct Hop {
    pub(crate) key: EventKey,
    pub(crate) head: Head,
    pub(crate) side: Option<Side>,
}

impl Hop {
    /// As faults tell it.
    pub(crate) fn told(&self, topology: &Topology) -> String {
        let kind = self.head.kind();
        let kind = kind.map_or("start", |kind| topology.kind(kind).name());
        let (from, to) = (self.head.sender, self.head.handled_by());
        format!("{} -> {} ({kind})", topology.name(from), topology.name(to))
    }

    /// The event that put it on its way.
    pub(crate) fn scheduled_by(&self, topology: &Topology) -> Option<EventKey> {
        self.head.scheduled_by(topology, self.side.as_ref())
    }
}

impl Head {
    /// Who handles the event: the link that a message reaches, or comes back to, or else the receiver.
    pub(super) fn handled_by(&self) -> EntityId {
        match self.class {
            Class::HandOver | Class::Held => self.link().unwrap_or(self.receiver),
            _ => self.receiver,
        }
    }
}

/// The late hops of one engine at one instant, in key order. They are few instants that have any.
#[derive(Default)]
pub(crate) struct Hops(Vec<Hop>);

impl Hops {
    pub(super) fn keep(&mut self, hop: Hop) {
        if self
            .0
            .last()
            .is_some_and(|last| last.key.time != hop.key.time)
        {
            self.0.clear();
        }
        self.0.push(hop);
    }

    /// The hop with this key, if it was a late one.
    pub(crate) fn find(&self, key: EventKey) -> Option<Hop> {
        let at = self.0.binary_search_by_key(&key, |hop| hop.key).ok()?;
        Some(self.0[at])
    }
}
