//! Links as the kernel sees them: a carrier is shown each message that one host sends to another,
//! and decides its fate. What makes a radio a radio lives elsewhere; here is the contract.

mod redrawn;
mod ruled;

use std::any::Any;
use std::cell::Cell;
use std::fmt;

use serde::{Deserialize, Serialize};

use crate::encoding::{EncodeError, Schema};
use crate::ids::{EntityId, HostId, KindIndex, MatchKey};
use crate::payload::{Encode, Message};
use crate::random::RandomKey;
use crate::ruling::MessageNumber;
use crate::time::{SimDuration, SimTime};
use crate::topology::{Kind, Topology};

pub use redrawn::DrawsOf;

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

    /// The highest bit rate that this link will ever have \[bit/s\]; none, the default, if messages
    /// of any size take no longer than short ones, or if nothing can be said. Read once, before the
    /// start, for protocols that have to reckon with it; it decides nothing in the kernel.
    fn rate_bit_per_s(&self) -> Option<u64> {
        None
    }

    /// Decides the fate of `parcel`: at least one verdict, one for each copy. A copy that was held
    /// ([`Verdicts::hold`], [`Verdicts::park`]) is shown again, with its token, and gets one verdict
    /// more, besides those about copies that [`Verdicts::park_another`] makes.
    fn carry(&mut self, parcel: &Parcel<'_>, verdicts: &mut Verdicts);

    /// Takes a change from a control event.
    fn change(&mut self, change: Self::Change, now: SimTime);
}

/// A message as a link sees it: its size and kind, who sent it and who is to get it. Its content
/// is not the link's business.
pub struct Parcel<'a> {
    pub(crate) topology: &'a Topology,
    pub(crate) now: SimTime,
    pub(crate) sent: SimTime,
    pub(crate) link: EntityId,
    pub(crate) sender: EntityId,
    pub(crate) receiver: EntityId,
    pub(crate) kind: &'a Kind,
    pub(crate) kind_index: KindIndex,
    pub(crate) ordinal: u64,
    pub(crate) repeat: u32,
    pub(crate) copy: u32,
    pub(crate) token: Option<u64>,
    pub(crate) match_key: Option<MatchKey>,
    pub(crate) letter: &'a dyn Encode,
    pub(crate) size: Cell<Option<u64>>,
}

impl Parcel<'_> {
    /// The present instant: when the message reached the link.
    pub fn now(&self) -> SimTime {
        self.now
    }

    /// The name of the actor that sent it.
    pub fn sender(&self) -> &str {
        self.topology.name(self.sender)
    }

    /// The name of the actor it is for.
    pub fn receiver(&self) -> &str {
        self.topology.name(self.receiver)
    }

    /// The name of the sender's host.
    pub fn sender_host(&self) -> &str {
        self.topology.host_name(self.sender)
    }

    /// The name of the receiver's host.
    pub fn receiver_host(&self) -> &str {
        self.topology.host_name(self.receiver)
    }

    /// The sender's host and the receiver's.
    pub fn hosts(&self) -> (HostId, HostId) {
        let host = |entity| HostId::new(self.topology.owner, self.topology.place(entity).host);
        (host(self.sender), host(self.receiver))
    }

    /// The message's kind: its serde name.
    pub fn kind(&self) -> &str {
        self.kind.name()
    }

    /// How many messages of this kind this sender sent this receiver before.
    pub fn ordinal(&self) -> u64 {
        self.ordinal
    }

    /// When the message was sent; before [`Parcel::now`] only if it was held.
    pub fn sent(&self) -> SimTime {
        self.sent
    }

    /// What [`Verdicts::hold`] or [`Verdicts::park`] was given, if the link held this copy and now
    /// sees it again.
    pub fn token(&self) -> Option<u64> {
        self.token
    }

    /// Which copy this is: 0 unless the link made several and held this one.
    pub fn copy(&self) -> u32 {
        self.copy
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
        let _ = self.letter.encode(self.kind.schema(), &mut scratch);
        let size = scratch.len() as u64;
        self.size.set(Some(size));
        size
    }

    /// Whether a copy of the message is to arrive whatever chance does, see
    /// [`Ruling::Deliver`](crate::ruling::Ruling::Deliver). A link that is about to lose it by chance asks this
    /// first, and gives it the delay that it would have had; else the kernel delivers it after the loss.
    #[inline]
    pub fn is_spared(&self, copy: u32) -> bool {
        match &self.topology.rulings {
            None => false,
            Some(rulings) => ruled::spares(rulings, self, copy),
        }
    }

    /// The address of this link's draws for this message: (run seed, link, purpose, message
    /// identity, attempt, copy). The identity is the match key where the protocol gave one, so
    /// that matching messages of two runs meet the same luck.
    #[inline]
    pub fn random(&self, purpose: u64, attempt: u32, copy: u32) -> RandomKey {
        let number = match self.match_key {
            Some(key) => MessageNumber::Key {
                key,
                repeat: self.repeat,
            },
            None => MessageNumber::Ordinal(self.ordinal),
        };
        let (identity, turn) = redrawn::identity(number);
        RandomKey::of([
            self.topology.seed,
            identity,
            turn,
            self.topology.name_hash(self.link),
            purpose,
            self.topology.name_hash(self.sender),
            self.topology.name_hash(self.receiver),
            self.kind.hash(),
            u64::from(attempt) << 32 | u64::from(copy),
        ])
    }
}

impl Parcel<'_> {
    /// The address of a draw of the link itself, whatever message asks: (run seed, link, purpose,
    /// number), where the number may be that of a slot of time. All messages that meet this slot
    /// then meet the same channel.
    pub fn random_at(&self, purpose: u64, number: u64) -> RandomKey {
        let link = self.topology.name_hash(self.link);
        redrawn::at(self.topology.seed, link, purpose, number)
    }
}

/// How a link carried one copy of a message: the parts of its delay, and what it cost. Logs show
/// it beside the fate.
///
/// ```
/// use farside::carrier::Carriage;
/// use farside::SimDuration;
/// let carriage = Carriage {
///     serialization: SimDuration::from_millis(2),
///     propagation: SimDuration::from_millis(10),
///     jitter_ns: -1_500_000,
///     ..Carriage::default()
/// };
/// assert_eq!(carriage.total(), SimDuration::from_micros(10_500));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Carriage {
    /// Waiting for the transmitter, for a contact, or for the channel to be free.
    pub queue: SimDuration,
    /// Putting the bits of the transmission that got through on the air.
    pub serialization: SimDuration,
    /// On the way.
    pub propagation: SimDuration,
    /// What chance added to the propagation, or took from it, in nanoseconds.
    pub jitter_ns: i64,
    /// From the first transmission to the one that got through: failed ones, and the waits for
    /// answers that never came.
    pub retries: SimDuration,
    /// How often it was transmitted, or its fragments were, all together; 0 if it never left.
    pub attempts: u32,
    /// How many fragments it was sent in; 0 if it went as a whole.
    pub fragments: u32,
    /// What the transmissions took from the sender, in joules. It is charged by
    /// [`Verdicts::charge`]; this says so in the log.
    pub energy_j: f64,
    /// What receiving takes from the receiver's host when the message arrives, in joules, charged
    /// then. See [`crate::Context::host_receive_energy_j`].
    pub receive_j: f64,
}

impl Carriage {
    /// The whole delay, from the send to the fate. What jitter takes away is no more than the rest.
    pub fn total(&self) -> SimDuration {
        let rest = self.queue + self.serialization + self.propagation + self.retries;
        let jitter = SimDuration::from_nanos(self.jitter_ns.unsigned_abs());
        if self.jitter_ns < 0 {
            rest - jitter
        } else {
            rest + jitter
        }
    }
}

impl fmt::Display for Carriage {
    /// The parts that are not zero, as in `queue 2ms, propagation 10ms, 1 attempt`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parts = [
            ("queue", self.queue),
            ("serialization", self.serialization),
            ("propagation", self.propagation),
            ("retries", self.retries),
        ];
        for (name, part) in parts.iter().filter(|(_, part)| !part.is_zero()) {
            write!(f, "{name} {part}, ")?;
        }
        if self.jitter_ns != 0 {
            let sign = if self.jitter_ns < 0 { "-" } else { "" };
            let size = SimDuration::from_nanos(self.jitter_ns.unsigned_abs());
            write!(f, "jitter {sign}{size}, ")?;
        }
        if self.fragments != 0 {
            write!(f, "{} fragments, ", self.fragments)?;
        }
        let plural = if self.attempts == 1 { "" } else { "s" };
        write!(f, "{} attempt{plural}", self.attempts)?;
        if self.energy_j != 0.0 {
            write!(f, ", {} J", self.energy_j)?;
        }
        if self.receive_j != 0.0 {
            write!(f, ", {} J to receive", self.receive_j)?;
        }
        Ok(())
    }
}

/// The fates that a link gives to the copies of one message, in copy order.
#[derive(Debug, Default)]
pub struct Verdicts {
    pub(crate) list: Vec<Verdict>,
    /// Copies that are parked, by token, and how far from now they are shown at the latest.
    pub(crate) wakes: Vec<(u64, SimDuration)>,
    pub(crate) charge_j: f64,
    pub(crate) charge_receiver_j: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Verdict {
    Deliver {
        after: SimDuration,
        carriage: Option<Carriage>,
    },
    Lose {
        after: SimDuration,
        reason: &'static str,
        carriage: Option<Carriage>,
    },
    Hold {
        after: SimDuration,
        token: u64,
    },
    Park {
        latest: Option<SimDuration>,
        token: u64,
        copy: Option<u32>,
    },
}

impl Verdicts {
    /// One copy arrives after `delay`.
    #[inline]
    pub fn deliver(&mut self, delay: SimDuration) {
        self.list.push(Verdict::Deliver {
            after: delay,
            carriage: None,
        });
    }

    /// One copy arrives `delay` from now, carried so: from the sending to then, it takes
    /// [`Carriage::total`].
    #[inline]
    pub fn deliver_as(&mut self, delay: SimDuration, carriage: Carriage) {
        self.list.push(Verdict::Deliver {
            after: delay,
            carriage: Some(carriage),
        });
    }

    /// One copy is lost `delay` from now, after it was carried so.
    pub fn lose_as(&mut self, delay: SimDuration, reason: &'static str, carriage: Carriage) {
        self.list.push(Verdict::Lose {
            after: delay,
            reason,
            carriage: Some(carriage),
        });
    }

    /// One copy waits at the link: `delay` from now the link is shown it again, with `token`.
    pub fn hold(&mut self, delay: SimDuration, token: u64) {
        self.list.push(Verdict::Hold {
            after: delay,
            token,
        });
    }

    /// One copy waits at the link until [`Verdicts::wake`] is called with `token`, which may happen
    /// while the link decides about any other message, or until `latest` from now. Then the link is
    /// shown it again, with `token`. For lines: who is first wakes the next, and nobody has to look
    /// again and again whether it is their turn.
    ///
    /// ```
    /// use std::collections::VecDeque;
    /// use farside::carrier::{Carrier, NoChange, Parcel, Verdicts};
    /// use farside::prelude::*;
    /// use serde::{Deserialize, Serialize};
    ///
    /// /// Carries one message at a time, each in a second.
    /// #[derive(Default)]
    /// struct OneByOne {
    ///     line: VecDeque<u64>,
    ///     free: SimTime,
    ///     known: u64,
    /// }
    ///
    /// impl Carrier for OneByOne {
    ///     type Change = NoChange;
    ///
    ///     fn min_delay(&self) -> SimDuration {
    ///         SimDuration::from_secs(1)
    ///     }
    ///
    ///     fn carry(&mut self, parcel: &Parcel<'_>, verdicts: &mut Verdicts) {
    ///         let now = parcel.now();
    ///         if parcel.token().is_none() {
    ///             let turn = self.line.is_empty().then(|| self.free.since(now));
    ///             verdicts.park(turn, self.known);
    ///             self.line.push_back(self.known);
    ///             self.known += 1;
    ///             return;
    ///         }
    ///         verdicts.deliver(self.min_delay());
    ///         self.free = now + self.min_delay();
    ///         self.line.pop_front();
    ///         if let Some(next) = self.line.front() {
    ///             verdicts.wake(self.min_delay(), *next);
    ///         }
    ///     }
    ///
    ///     fn change(&mut self, _change: NoChange, _now: SimTime) {}
    /// }
    ///
    /// #[derive(Serialize, Deserialize)]
    /// struct Ping;
    ///
    /// struct Sink;
    /// impl Actor for Sink {
    ///     type Accepts = (Ping,);
    /// }
    /// impl Handler<Ping> for Sink {
    ///     fn handle(&mut self, _ping: Ping, _ctx: &mut Context<'_, Self>) -> Outcome {
    ///         Ok(())
    ///     }
    /// }
    ///
    /// struct Source(Address<Sink>);
    /// impl Actor for Source {
    ///     type Accepts = ();
    ///     fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
    ///         for _ in 0..3 {
    ///             ctx.send(self.0, Ping);
    ///         }
    ///         Ok(())
    ///     }
    /// }
    ///
    /// let mut sim = Simulation::new(1);
    /// let (a, b) = (sim.host("a"), sim.host("b"));
    /// let sink = sim.actor(b, "sink", |_| Sink);
    /// sim.actor(a, "source", move |_| Source(sink));
    /// sim.link(a, b, "a-b", OneByOne::default());
    /// let report = sim.run(Executor::Inline).unwrap();
    /// assert_eq!((report.counts.delivered, report.end_time), (3, SimTime::from_secs(3)));
    /// ```
    ///
    /// A copy that is never woken is in flight when the run ends. Two copies that are parked at one
    /// time have different tokens: a link that mixes them up is at fault.
    pub fn park(&mut self, latest: Option<SimDuration>, token: u64) {
        let copy = None;
        self.list.push(Verdict::Park {
            latest,
            token,
            copy,
        });
    }

    /// The same for one copy more, which has the number `copy` from now on: what a sender keeps of a
    /// message that has arrived, until it knows.
    pub fn park_another(&mut self, latest: Option<SimDuration>, token: u64, copy: u32) {
        let copy = Some(copy);
        self.list.push(Verdict::Park {
            latest,
            token,
            copy,
        });
    }

    /// Shows the link a copy that it parked, `delay` from now, unless that comes sooner anyway.
    /// Without a copy parked under `token` nothing happens.
    pub fn wake(&mut self, delay: SimDuration, token: u64) {
        self.wakes.push((token, delay));
    }

    /// Charges the receiver's host, in joules, one [`Carrier::min_delay`] from now: for what it
    /// receives and sends besides the delivery of a message, which [`Carriage::receive_j`] charges.
    pub fn charge_receiver(&mut self, energy_j: f64) {
        self.charge_receiver_j += energy_j;
    }

    /// Charges the sending actor for the transmission, in joules. A shared link's charges reach it
    /// one [`Carrier::min_delay`] later. See [`crate::Context::transmit_energy_j`].
    pub fn charge(&mut self, energy_j: f64) {
        self.charge_j += energy_j;
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
            carriage: None,
        });
    }
}

/// A carrier whose type the engine does not know.
pub(crate) trait AnyCarrier: Send {
    fn carry(&mut self, parcel: &Parcel<'_>, verdicts: &mut Verdicts);
    fn change(&mut self, change: Box<dyn Any + Send>, now: SimTime);
}

impl<C: Carrier> AnyCarrier for C {
    fn carry(&mut self, parcel: &Parcel<'_>, verdicts: &mut Verdicts) {
        Carrier::carry(self, parcel, verdicts);
    }

    fn change(&mut self, change: Box<dyn Any + Send>, now: SimTime) {
        let change = change.downcast().expect("changes are typed by their link");
        Carrier::change(self, *change, now);
    }
}

type EncodeChange = fn(&(dyn Any + Send), &Schema, &mut Vec<u8>) -> Result<(), EncodeError>;

/// A change on its way to its link: the value, and how to write it down.
pub(crate) struct SealedChange {
    pub(crate) value: Box<dyn Any + Send>,
    pub(crate) encode: EncodeChange,
}

impl SealedChange {
    pub(crate) fn new<M: Message>(change: M) -> Self {
        SealedChange {
            value: Box::new(change),
            encode: |value, schema, out| {
                let value = value.downcast_ref::<M>().expect("encoded as it was sealed");
                schema.encode(value, out)
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
