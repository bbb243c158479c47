//! What waits in an engine's queue, and what is known of it: the heads of messages, timers and
//! starts.

use std::num::NonZeroU64;
use std::sync::Arc;

use super::erased::Sealed;
use crate::carrier::Carriage;
use crate::ids::{EntityId, KindIndex, MatchKey};
use crate::key::EventKey;
use crate::record::{Record, RecordClass};
use crate::time::{SimDuration, SimTime};
use crate::topology::{Kind, Reason, Topology};

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

/// Something that happened, as it is committed.
#[derive(Clone, Copy)]
pub(crate) struct Happened<'a> {
    pub(crate) class: RecordClass,
    pub(crate) key: EventKey,
    pub(crate) head: &'a Head,
    pub(crate) side: Option<&'a Side>,
    /// The kind of a state sample, which no head has.
    pub(crate) sample: Option<&'a Arc<Kind>>,
    pub(crate) body: &'a [u8],
    pub(crate) sends: u32,
    /// What the digest is extended by; 0 without one.
    pub(crate) hash: u128,
}

impl Happened<'_> {
    /// What observers are shown.
    #[inline]
    pub(crate) fn record<'a>(&'a self, topology: &'a Topology) -> Record<'a> {
        let Happened { class, key, .. } = *self;
        let record = self.head.record(topology, class, key, self.body, self.side);
        Record {
            sends: self.sends,
            kind: self.sample.or(record.kind),
            ..record
        }
    }
}

/// A message still on its way: the key its next event would have had, what is known of it, and its
/// encoded body.
pub(crate) type InFlight = (EventKey, Head, Vec<u8>);

/// What is known of a message besides its content: eighty bytes, so that a head and a message of 24
/// bytes wait in two lines of cache. What may be absent has no room of its own for saying so.
#[derive(Clone, Copy)]
pub(crate) struct Head {
    pub(crate) ordinal: u64,
    cause_time: SimTime,
    cause_count: u64,
    match_key: u64,
    /// The count in the key of the hand-over to a shared link, once it has happened. The rest of
    /// that key follows from the cause.
    pub(crate) handed_over: Option<NonZeroU64>,
    cause_step: u32,
    cause_tie: u32,
    /// [`NOBODY`] for an event without a cause.
    cause_source: EntityId,
    pub(crate) sender: EntityId,
    pub(crate) receiver: EntityId,
    /// [`NOBODY`] within a host.
    pub(super) link: EntityId,
    /// [`NO_KIND`] for events without a message.
    kind: KindIndex,
    /// Of a message, which copy it is; of a start or a timer, the actor's incarnation.
    copy_or_life: u32,
    /// None without a match key; else how many messages with the same one came right before in the
    /// flow, and one.
    turn: u32,
    pub(crate) reason: Reason,
    pub(crate) class: Class,
    pub(crate) has_side: bool,
}

/// No entity has this number: entities are fewer.
const NOBODY: EntityId = EntityId(u32::MAX);

const NO_KIND: KindIndex = KindIndex::MAX;

impl Head {
    /// The head of something that happens to an entity, of itself.
    #[inline(always)]
    pub(crate) fn of_entity(class: Class, entity: EntityId) -> Self {
        Head {
            ordinal: 0,
            cause_time: SimTime::ZERO,
            cause_count: 0,
            match_key: 0,
            handed_over: None,
            cause_step: 0,
            cause_tie: 0,
            cause_source: NOBODY,
            sender: entity,
            receiver: entity,
            link: NOBODY,
            kind: NO_KIND,
            copy_or_life: 0,
            turn: 0,
            reason: Reason::default(),
            class,
            has_side: false,
        }
    }

    /// This head, for something of this kind that the event `cause` caused.
    #[inline(always)]
    pub(crate) fn caused(self, cause: EventKey, kind: KindIndex, ordinal: u64) -> Self {
        Head {
            ordinal,
            cause_time: cause.time,
            cause_count: cause.count,
            cause_step: cause.step,
            cause_tie: cause.tie,
            cause_source: cause.source,
            kind,
            ..self
        }
    }

    /// This head, with the protocol's own identity for the message, which is the `repeat`th with it.
    #[inline(always)]
    pub(crate) fn keyed(self, match_key: MatchKey, repeat: u32) -> Self {
        Head {
            match_key: match_key.bits(),
            turn: repeat.saturating_add(1),
            ..self
        }
    }

    /// This head, for the start or a timer of an actor in this incarnation.
    #[inline(always)]
    pub(crate) fn in_life(self, incarnation: u32) -> Self {
        Head {
            copy_or_life: incarnation,
            ..self
        }
    }

    /// This head, of what a link carries.
    pub(crate) fn through(self, link: EntityId) -> Self {
        Head { link, ..self }
    }

    /// This head, with a kind.
    pub(crate) fn of_kind(self, kind: Option<KindIndex>) -> Self {
        Head {
            kind: kind.unwrap_or(NO_KIND),
            ..self
        }
    }

    /// This head, of another copy.
    #[inline(always)]
    pub(crate) fn as_copy(self, copy: u32) -> Self {
        Head {
            copy_or_life: copy,
            ..self
        }
    }

    /// The link that carries it; none within a host.
    #[inline(always)]
    pub(crate) fn link(&self) -> Option<EntityId> {
        (self.link != NOBODY).then_some(self.link)
    }

    #[inline(always)]
    pub(crate) fn kind(&self) -> Option<KindIndex> {
        (self.kind != NO_KIND).then_some(self.kind)
    }

    /// The event in whose handler the message was sent.
    #[inline(always)]
    pub(crate) fn cause(&self) -> Option<EventKey> {
        (self.cause_source != NOBODY).then_some(EventKey {
            time: self.cause_time,
            step: self.cause_step,
            tie: self.cause_tie,
            source: self.cause_source,
            count: self.cause_count,
        })
    }

    /// The protocol's own identity for the message, if it gave one.
    #[inline(always)]
    pub(crate) fn match_key(&self) -> Option<MatchKey> {
        (self.turn > 0).then_some(MatchKey::from_bits(self.match_key))
    }

    /// How many messages with the same match key came right before in the flow.
    #[inline(always)]
    pub(crate) fn repeat(&self) -> u32 {
        self.turn.saturating_sub(1)
    }

    /// Which copy of a message it is; 0 for what is none.
    #[inline(always)]
    pub(crate) fn copy(&self) -> u32 {
        if matches!(self.class, Class::Start | Class::Timer) {
            0
        } else {
            self.copy_or_life
        }
    }

    /// The incarnation of the actor that starts or has set the timer.
    #[inline(always)]
    pub(crate) fn life(&self) -> u32 {
        self.copy_or_life
    }

    /// This head, for a message that the run's end leaves on its way.
    pub(crate) fn left_over(self) -> Self {
        Head {
            reason: Reason::default(),
            has_side: false,
            ..self
        }
    }

    /// When the message was sent, or the timer set; `key` is that of its event.
    #[inline(always)]
    pub(crate) fn sent(&self, key: EventKey) -> SimTime {
        if self.cause_source == NOBODY {
            key.time
        } else {
            self.cause_time
        }
    }

    /// The message being handled and who sent it, as faults name them.
    pub(crate) fn message(&self, topology: &Topology) -> Option<String> {
        let kind = topology.kind(self.kind()?).name();
        Some(format!("{kind} from {}", topology.name(self.sender)))
    }

    /// The event that scheduled the next hop: the cause, the hand-over to a shared link, or the
    /// link's last look at a message that it held.
    #[inline]
    pub(crate) fn scheduled_by(
        &self,
        topology: &Topology,
        side: Option<&Side>,
    ) -> Option<EventKey> {
        if let Some(held) = side.and_then(|side| side.scheduled_by) {
            return Some(held);
        }
        let (cause, Some(count)) = (self.cause()?, self.handed_over) else {
            return self.cause();
        };
        Some(topology.key(cause.time, cause.step + 1, self.sender, count.get()))
    }

    /// What observers are shown.
    #[inline(always)]
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
            cause: self.cause(),
            scheduled_by: self.scheduled_by(topology, side),
            sender: self.sender,
            receiver: self.receiver,
            link: self.link(),
            kind: self.kind().map(|kind| topology.kind(kind)),
            ordinal: self.ordinal,
            copy: self.copy(),
            match_key: self.match_key(),
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
    /// The number in the receiver's address.
    pub(crate) declared: u32,
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
