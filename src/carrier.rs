//! Links as the kernel sees them: a carrier is shown each message that one host sends to another,
//! and decides its fate. What makes a radio a radio lives elsewhere; here is the contract.

use std::any::Any;
use std::cell::Cell;

use serde::{Deserialize, Serialize};

use crate::encoding::Schema;
use crate::key::EntityId;
use crate::message::{MatchKey, Message, Sealed};
use crate::plan::{Kind, Plan};
use crate::random::RandomKey;
use crate::time::{SimDuration, SimTime};

/// A link: decides when each message arrives, how often, or why it does not.
///
/// A carrier draws only through [`Parcel::random`], by the message's identity, so that what
/// happens to one message does not change what happens to the next.
pub trait Carrier: Send + 'static {
    /// What a control event may tell this link: new parameters, an outage.
    type Change: Message;

    /// The least delay that this link will ever give, changes included. It bounds how far hosts
    /// may run ahead of each other; delivering sooner is a fault. Read once, before the start.
    fn min_delay(&self) -> SimDuration;

    /// Decides the fate of `parcel`: at least one verdict, one for each copy.
    fn carry(&mut self, parcel: &Parcel<'_>, verdicts: &mut Verdicts);

    /// Takes a change from a control event.
    fn change(&mut self, change: Self::Change, now: SimTime);
}

/// A message as a link sees it: its size and kind, who sent it and who is to get it. Its content
/// is not the link's business.
pub struct Parcel<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) now: SimTime,
    pub(crate) link: EntityId,
    pub(crate) sender: EntityId,
    pub(crate) receiver: EntityId,
    pub(crate) kind: &'a Kind,
    pub(crate) ordinal: u64,
    pub(crate) repeat: u32,
    pub(crate) match_key: Option<MatchKey>,
    pub(crate) letter: &'a Sealed,
    pub(crate) size: Cell<Option<u64>>,
}

impl Parcel<'_> {
    /// The present instant: when the message reached the link.
    pub fn now(&self) -> SimTime {
        self.now
    }

    /// The name of the actor that sent it.
    pub fn sender(&self) -> &str {
        self.plan.name(self.sender)
    }

    /// The name of the actor it is for.
    pub fn receiver(&self) -> &str {
        self.plan.name(self.receiver)
    }

    /// The name of the sender's host.
    pub fn sender_host(&self) -> &str {
        self.plan.host_name(self.sender)
    }

    /// The name of the receiver's host.
    pub fn receiver_host(&self) -> &str {
        self.plan.host_name(self.receiver)
    }

    /// The message's kind: its serde name.
    pub fn kind(&self) -> &str {
        self.kind.name()
    }

    /// How many messages of this kind this sender sent this receiver before.
    pub fn ordinal(&self) -> u64 {
        self.ordinal
    }

    /// The protocol's own identity for the message, if it gave one.
    pub fn match_key(&self) -> Option<MatchKey> {
        self.match_key
    }

    /// The size of the encoded message in bytes, headers not included. Costs an encoding the
    /// first time it is asked for.
    pub fn size_bytes(&self) -> u64 {
        if let Some(size) = self.size.get() {
            return size;
        }
        let mut scratch = Vec::new();
        // A message that cannot be encoded ends the run where it is recorded; here it is empty.
        let _ = self.letter.0.encode(self.kind.schema(), &mut scratch);
        let size = scratch.len() as u64;
        self.size.set(Some(size));
        size
    }

    /// The address of this link's draws for this message: (run seed, link, purpose, message
    /// identity, attempt, copy). The identity is the match key where the protocol gave one, so
    /// that matching messages of two runs meet the same luck.
    pub fn random(&self, purpose: u64, attempt: u32, copy: u32) -> RandomKey {
        let identity = match self.match_key {
            Some(key) => RandomKey::new(self.plan.seed).number(key.bits()).number(
                // Keeps a keyed message apart from an unkeyed one with an equal ordinal.
                u64::from(self.repeat) | 1 << 63,
            ),
            None => RandomKey::new(self.plan.seed)
                .number(self.ordinal)
                .number(0),
        };
        identity
            .number(self.plan.name_hash(self.link))
            .number(purpose)
            .number(self.plan.name_hash(self.sender))
            .number(self.plan.name_hash(self.receiver))
            .number(self.kind.hash())
            .number(u64::from(attempt) << 32 | u64::from(copy))
    }
}

/// The fates that a link gives to the copies of one message, in copy order.
#[derive(Debug, Default)]
pub struct Verdicts {
    pub(crate) list: Vec<Verdict>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    Deliver {
        after: SimDuration,
    },
    Lose {
        after: SimDuration,
        reason: &'static str,
    },
}

impl Verdicts {
    /// One copy arrives after `delay`.
    pub fn deliver(&mut self, delay: SimDuration) {
        self.list.push(Verdict::Deliver { after: delay });
    }

    /// One copy is lost, now, for `reason` (`snake_case`: `loss`, `queue_full`, `outage`, ...).
    pub fn lose(&mut self, reason: &'static str) {
        self.lose_after(SimDuration::ZERO, reason);
    }

    /// One copy is lost on its way, `delay` from now: a corrupt frame is noticed where it ends.
    pub fn lose_after(&mut self, delay: SimDuration, reason: &'static str) {
        self.list.push(Verdict::Lose {
            after: delay,
            reason,
        });
    }
}

/// A carrier whose type the engine does not know.
pub(crate) trait AnyCarrier: Send {
    fn min_delay(&self) -> SimDuration;
    fn carry(&mut self, parcel: &Parcel<'_>, verdicts: &mut Verdicts);
    fn change(&mut self, change: Box<dyn Any + Send>, now: SimTime);
}

impl<C: Carrier> AnyCarrier for C {
    fn min_delay(&self) -> SimDuration {
        Carrier::min_delay(self)
    }

    fn carry(&mut self, parcel: &Parcel<'_>, verdicts: &mut Verdicts) {
        Carrier::carry(self, parcel, verdicts);
    }

    fn change(&mut self, change: Box<dyn Any + Send>, now: SimTime) {
        let change = change.downcast().expect("changes are typed by their link");
        Carrier::change(self, *change, now);
    }
}

/// A change on its way to its link: the value, and how to write it down.
pub(crate) struct SealedChange {
    pub(crate) value: Box<dyn Any + Send>,
    pub(crate) encode: fn(&(dyn Any + Send), &Schema, &mut Vec<u8>),
}

impl SealedChange {
    pub(crate) fn new<M: Message>(change: M) -> Self {
        SealedChange {
            value: Box::new(change),
            encode: |value, schema, out| {
                let value = value.downcast_ref::<M>().expect("encoded as it was sealed");
                // The schema was traced from this very type; what it cannot hold is left out of
                // the record, and the change still happens.
                let _ = schema.encode(value, out);
            },
        }
    }
}

/// The plainest link: every message arrives after the same delay.
///
/// ```
/// use farside::{carrier::FixedDelay, time::SimDuration};
/// let wire = FixedDelay::new(SimDuration::from_millis(5));
/// assert_eq!(wire.delay(), SimDuration::from_millis(5));
/// ```
#[derive(Clone, Debug)]
pub struct FixedDelay {
    delay: SimDuration,
}

impl FixedDelay {
    /// A link with this one-way delay.
    pub fn new(delay: SimDuration) -> Self {
        FixedDelay { delay }
    }

    /// The one-way delay.
    pub fn delay(&self) -> SimDuration {
        self.delay
    }
}

/// The change of a link that has nothing to change.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct NoChange;

impl Carrier for FixedDelay {
    type Change = NoChange;

    fn min_delay(&self) -> SimDuration {
        self.delay
    }

    fn carry(&mut self, _parcel: &Parcel<'_>, verdicts: &mut Verdicts) {
        verdicts.deliver(self.delay);
    }

    fn change(&mut self, _change: NoChange, _now: SimTime) {}
}
