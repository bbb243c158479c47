//! What waits in an engine's queue, and what is known of it: the heads of messages, timers and
//! starts.

use std::num::NonZeroU64;

use super::erased::Sealed;
use crate::carrier::Carriage;
use crate::ids::{EntityId, KindIndex, MatchKey};
use crate::key::EventKey;
use crate::record::{Record, RecordClass};
use crate::time::{SimDuration, SimTime};
use crate::topology::{Reason, Topology};

/// What an event does when its time comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Class {
    Start,
    Message,
    Timer,
    /// A message reaches a shared link.
    HandOver,
    /// A message comes back to the link that holds it.
    Held,
    /// A message is lost on its way.
    LateLoss,
    /// An actor changes a link; in a control event, an actor is told something.
    Tell,
    /// A link charges an actor for what it transmitted, or its host for what it received.
    Charge,
    /// A cancelled timer.
    Void,
}

/// An event yet to happen.
pub(crate) struct Pending {
    pub(crate) class: Class,
    pub(crate) head: Head,
    pub(crate) letter: Option<Sealed>,
    pub(crate) side: Option<Side>,
}

/// What only some events have: kept apart, so that the others need not carry it about.
#[derive(Clone, Copy, Default)]
pub(crate) struct Side {
    pub(crate) carriage: Option<Carriage>,
    /// The event that put this one on its way, where neither the cause nor a hand-over did.
    pub(crate) scheduled_by: Option<EventKey>,
    /// What a link that holds the message knows it by.
    pub(crate) token: u64,
    /// Whether the link may wake it.
    pub(crate) parked: bool,
}

/// A message still on its way: the key its next event would have had, what is known of it, and its
/// encoded body.
pub(crate) type InFlight = (EventKey, Head, Vec<u8>);

/// What is known of a message besides its content.
#[derive(Clone, Copy)]
pub(crate) struct Head {
    pub(crate) sender: EntityId,
    pub(crate) receiver: EntityId,
    pub(crate) link: Option<EntityId>,
    pub(crate) kind: Option<KindIndex>,
    pub(crate) ordinal: u64,
    /// How many messages with the same match key came right before in the flow.
    pub(crate) repeat: u32,
    pub(crate) copy: u32,
    pub(crate) match_key: Option<MatchKey>,
    /// The event in whose handler the message was sent.
    pub(crate) cause: Option<EventKey>,
    /// The count in the key of the hand-over to a shared link, once it has happened. The rest of
    /// that key follows from `cause`.
    pub(crate) handed_over: Option<NonZeroU64>,
    pub(crate) incarnation: u32,
    pub(crate) reason: Reason,
    pub(crate) has_side: bool,
}

impl Head {
    pub(crate) fn of_entity(entity: EntityId) -> Self {
        Head {
            sender: entity,
            receiver: entity,
            link: None,
            kind: None,
            ordinal: 0,
            repeat: 0,
            copy: 0,
            match_key: None,
            cause: None,
            handed_over: None,
            incarnation: 0,
            reason: Reason::default(),
            has_side: false,
        }
    }

    /// When the message was sent, or the timer set; `key` is that of its event.
    pub(crate) fn sent(&self, key: EventKey) -> SimTime {
        self.cause.map_or(key.time, |cause| cause.time)
    }

    /// The message being handled and who sent it, as faults name them.
    pub(crate) fn message(&self, topology: &Topology) -> Option<String> {
        let kind = topology.kind(self.kind?).name();
        Some(format!("{kind} from {}", topology.name(self.sender)))
    }

    /// The event that scheduled the next hop: the cause, the hand-over to a shared link, or the
    /// link's last look at a message that it held.
    pub(crate) fn scheduled_by(
        &self,
        topology: &Topology,
        side: Option<&Side>,
    ) -> Option<EventKey> {
        if let Some(held) = side.and_then(|side| side.scheduled_by) {
            return Some(held);
        }
        let (cause, Some(count)) = (self.cause?, self.handed_over) else {
            return self.cause;
        };
        Some(topology.key(cause.time, cause.step + 1, self.sender, count.get()))
    }

    pub(crate) fn record<'a>(
        &self,
        topology: &'a Topology,
        class: RecordClass,
        key: EventKey,
        body: &'a [u8],
        side: Option<&'a Side>,
    ) -> Record<'a> {
        Record {
            class,
            key,
            cause: self.cause,
            scheduled_by: self.scheduled_by(topology, side),
            sender: self.sender,
            receiver: self.receiver,
            link: self.link,
            kind: self.kind.map(|kind| topology.kind(kind)),
            ordinal: self.ordinal,
            copy: self.copy,
            match_key: self.match_key,
            sent: self.sent(key),
            reason: topology.reason(self.reason),
            body,
            sends: 0,
            carriage: side.and_then(|side| side.carriage.as_ref()),
        }
    }
}

/// A message as a handler sends it.
pub(crate) struct Outbound {
    pub(crate) receiver: EntityId,
    pub(crate) kind: KindIndex,
    pub(crate) letter: Sealed,
    pub(crate) match_key: Option<MatchKey>,
    pub(crate) delay: SimDuration,
}

/// An event for another engine.
pub(crate) struct Outgoing {
    pub(crate) engine: u32,
    pub(crate) key: EventKey,
    pub(crate) pending: Pending,
}
