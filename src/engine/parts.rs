//! What a handler changes while its actor is borrowed: the queue, the payloads, the links, and
//! what the event in hand has done so far.

mod carrying;
mod sampling;

use std::any::TypeId;
use std::cell::Cell;
use std::ops::Range;
use std::sync::Arc;

use super::outbox::{Outbox, Unqueued};
use super::store::Store;
use super::{
    CellState, Class, Head, Hops, LinkCell, Outbound, Outgoing, Pending, Remains, Sealed, Side,
    Sink,
};
use crate::carrier::{Carriage, SealedChange, Verdicts};
use crate::charge::{Charge, ChargedMessage};
use crate::encoding::EncodeError;
use crate::fault::{Fault, FaultCause};
use crate::guard::guarded;
use crate::ids::{EntityId, HostIndex, KindIndex, TimerId};
use crate::key::EventKey;
use crate::queue::{Entry, Queue};
use crate::time::{SimDuration, SimTime};
use crate::topology::{Kind, Topology};

use sampling::SampleType;
pub(crate) use sampling::{FirstSample, SampleNames};

/// What happened in the event in hand besides the event: committed right after it.
pub(crate) enum Effect {
    Lost {
        head: Head,
        body: Range<usize>,
        side: Option<Box<Side>>,
    },
    Sample {
        entity: EntityId,
        kind: Arc<Kind>,
        body: Range<usize>,
    },
    /// A type of samples was used for the first time.
    FirstSample(Box<FirstSample>),
}

/// What links have charged the actors of one host, in joules.
#[derive(Clone, Copy, Default)]
pub(crate) struct HostEnergy {
    pub(crate) transmit_j: f64,
    pub(crate) receive_j: f64,
}

/// The mutable part of an engine, apart from its actors.
pub(crate) struct Parts {
    pub(crate) topology: Arc<Topology>,
    /// As the topology says.
    recording: bool,
    /// By entity, whose messages alone are encoded; all, if it is none.
    encoded: Option<Box<[bool]>>,
    index: u32,
    links: Vec<LinkCell>,
    pub(crate) queue: Queue,
    pub(super) store: Store,
    pub(super) outbox: Outbox,
    pub(crate) outgoing: Vec<Outgoing>,
    /// The key of the event in hand.
    key: EventKey,
    /// The encoded message in hand.
    pub(crate) body: Vec<u8>,
    /// What the event in hand has besides, if its head says that it has anything.
    pub(crate) side: Option<Side>,
    pub(crate) effects: Vec<Effect>,
    effect_bytes: Vec<u8>,
    verdicts: Verdicts,
    /// The types of samples met so far.
    sample_types: Vec<SampleType>,
    /// By host, as far as hosts of this engine were charged anything.
    energies: Vec<HostEnergy>,
    /// Somebody asked what was charged.
    pub(crate) energy_read: Cell<bool>,
    pub(crate) sends: u32,
    /// Boxed: it is looked at after every event, and nearly always empty.
    pub(crate) fault: Option<Box<FaultCause>>,
    /// The link that was deciding a fate when a handler failed.
    pub(crate) carrying: Option<EntityId>,
    /// The first request to stop: at which event, by whom, why.
    pub(crate) stop: Option<(EventKey, EntityId, String)>,
    /// The event whose handler failed, so that its message can be counted as in flight.
    pub(crate) unfinished: Option<(EventKey, Head)>,
    /// The last hops that are allowed at an instant.
    pub(crate) hops: Hops,
    /// The last kind looked up: handlers tend to send one kind at a time.
    last_kind: Option<(TypeId, KindIndex)>,
}

impl Parts {
    pub(crate) fn new(topology: Arc<Topology>, index: u32, links: Vec<LinkCell>) -> Self {
        Parts {
            key: topology.key(SimTime::ZERO, 0, EntityId::CONTROL, 0),
            recording: topology.recording(),
            encoded: None,
            topology,
            index,
            links,
            queue: Queue::default(),
            store: Store::default(),
            outbox: Outbox::default(),
            outgoing: Vec::new(),
            body: Vec::new(),
            side: None,
            effects: Vec::new(),
            effect_bytes: Vec::new(),
            verdicts: Verdicts::default(),
            sample_types: Vec::new(),
            energies: Vec::new(),
            energy_read: Cell::new(false),
            sends: 0,
            fault: None,
            carrying: None,
            stop: None,
            unfinished: None,
            hops: Hops::default(),
            last_kind: None,
        }
    }

    #[inline(always)]
    pub(crate) fn insert(&mut self, key: EventKey, head: Head, letter: Option<Sealed>) -> u32 {
        let slot = self.store.insert(head, letter);
        self.queue.push(Entry::new(key, slot));
        slot
    }

    pub(crate) fn insert_pending(&mut self, key: EventKey, pending: Pending) {
        let slot = self.insert(key, pending.head, pending.letter);
        if let Some(side) = pending.side {
            self.store.set_side(slot, side);
        }
    }

    pub(crate) fn take(&mut self, slot: u32) -> Pending {
        let (head, letter) = self.store.take(slot);
        let side = self.store.side(slot, &head);
        Pending { head, letter, side }
    }

    /// The key of the event in hand.
    #[inline(always)]
    pub(crate) fn key(&self) -> EventKey {
        self.key
    }

    /// Gets ready for the event `key`.
    #[inline(always)]
    pub(crate) fn begin(&mut self, key: EventKey) {
        self.key = key;
        self.sends = 0;
        self.carrying = None;
        self.body.clear();
    }

    /// Encodes the messages of these entities only, and no timers: nobody looks at others.
    pub(crate) fn encode_only(&mut self, of_entity: Box<[bool]>) {
        self.encoded = Some(of_entity);
    }

    /// Encodes the message of the event in hand, if anyone will look at it.
    #[inline(always)]
    pub(crate) fn encode(
        &mut self,
        letter: Option<&Sealed>,
        head: &Head,
    ) -> Result<(), Box<Fault>> {
        if !self.recording {
            return Ok(());
        }
        if let Some(encoded) = &self.encoded
            && (head.class == Class::Timer || !encoded[head.sender.index()])
        {
            return Ok(());
        }
        if let (Some(letter), Some(kind)) = (letter, head.kind()) {
            let kind = self.topology.kind(kind);
            let body = &mut self.body;
            let encoded = guarded(|| letter.0.encode(kind.schema(), body));
            if !matches!(encoded, Ok(Ok(()))) {
                let kind = kind.name().to_owned();
                return Err(self.encoding_fault(self.key, head, kind, encoded));
            }
        }
        Ok(())
    }

    #[cold]
    fn encoding_fault(
        &mut self,
        key: EventKey,
        head: &Head,
        kind: String,
        encoded: Result<Result<(), EncodeError>, Box<FaultCause>>,
    ) -> Box<Fault> {
        let (message, cause) = match encoded {
            Err(cause) => (Some(kind), *cause),
            Ok(encoded) => {
                let error = encoded.err().map_or_else(String::new, |e| e.to_string());
                (None, FaultCause::Encoding { kind, error })
            }
        };
        // What was written before it went wrong is no message.
        self.body.clear();
        // Nobody sends what an actor is told but the simulation.
        let blamed = match key.source {
            EntityId::CONTROL => head.receiver,
            source => source,
        };
        self.fault_at(key, blamed, message, cause)
    }

    #[inline]
    pub(crate) fn kind_of(&mut self, type_id: TypeId) -> Option<KindIndex> {
        match self.last_kind {
            Some((last, kind)) if last == type_id => Some(kind),
            _ => {
                let kind = *self.topology.kind_of_type.get(&type_id)?;
                self.last_kind = Some((type_id, kind));
                Some(kind)
            }
        }
    }

    /// Keeps the first fault of the event in hand.
    pub(crate) fn raise(&mut self, cause: FaultCause) {
        self.fault.get_or_insert_with(|| Box::new(cause));
    }

    /// Notes a message of a kind that its receiver does not list.
    #[cold]
    pub(crate) fn not_listed(&mut self, receiver: EntityId, kind: &str) {
        let receiver = self.topology.name(receiver).to_owned();
        let kind = kind.to_owned();
        self.raise(FaultCause::NotListed { receiver, kind });
    }

    pub(crate) fn fault_at(
        &self,
        key: EventKey,
        entity: EntityId,
        message: Option<String>,
        cause: FaultCause,
    ) -> Box<Fault> {
        let actor = self.topology.name(entity).to_owned();
        Box::new(Fault {
            key,
            time: key.time,
            actor,
            message,
            cause,
        })
    }

    pub(crate) fn note_unfinished(&mut self, key: EventKey, head: Head) {
        self.unfinished = Some((key, head));
    }

    /// True for a message that goes by the [`Outbox`]: within a host, where very much waits. Once that
    /// is so it stays so: a flow's later messages are never numbered before its earlier ones.
    #[inline(always)]
    pub(crate) fn goes_by_outbox(&self, me: EntityId, declared: u32) -> bool {
        self.store.is_large() && (self.topology.has_one_host || self.is_near(me, declared))
    }

    #[inline(never)]
    fn is_near(&self, me: EntityId, declared: u32) -> bool {
        let receiver = self.topology.declared[declared as usize];
        self.topology.place(me).host == self.topology.place(receiver).host
    }

    #[inline]
    pub(crate) fn send(&mut self, state: &mut CellState, me: EntityId, outbound: Outbound) {
        if self.fault.is_some() {
            return;
        }
        let Outbound {
            declared,
            kind,
            letter,
            match_key,
            delay,
        } = outbound;
        let receiver = self.topology.declared[declared as usize];
        let ordinal = state.next_in_flow(declared, kind);
        let repeat = match_key.map_or(0, |key| state.repeats(receiver, kind, key));
        // Called on each way by itself: what one way puts in memory the other keeps in registers.
        let head = |parts: &Parts| {
            let mut head = Head::of_entity(Class::Message, me).caused(parts.key, kind, ordinal);
            head.receiver = receiver;
            match match_key {
                Some(match_key) => head.keyed(match_key, repeat),
                None => head,
            }
        };
        self.sends += 1;
        let (from, to) = (self.topology.place(me), self.topology.place(receiver));
        if from.host == to.host {
            let key = self.later_key(me, &mut state.count, delay);
            self.insert(key, head(self), Some(letter));
        } else if delay.is_zero() {
            let (mut head, mut letter) = (head(self), Some(letter));
            self.send_away(state, (from.host, to.host), &mut head, &mut letter);
        } else {
            let receiver = self.topology.name(receiver).to_owned();
            self.raise(FaultCause::DelayedAcrossHosts { receiver });
        }
    }

    /// [`Parts::send`] for a message that [`Parts::goes_by_outbox`].
    #[inline]
    pub(crate) fn send_by_outbox(
        &mut self,
        state: &mut CellState,
        me: EntityId,
        outbound: Outbound,
    ) {
        if self.fault.is_some() {
            return;
        }
        let Outbound {
            declared,
            kind,
            letter,
            match_key,
            delay,
        } = outbound;
        self.sends += 1;
        let key = self.later_key(me, &mut state.count, delay);
        let mut head = Head::of_entity(Class::Message, me).caused(self.key, kind, 0);
        if let Some(match_key) = match_key {
            let receiver = self.topology.declared[declared as usize];
            head = head.keyed(match_key, state.repeats(receiver, kind, match_key));
        }
        let slot = self.store.insert(head, Some(letter));
        let entry = Entry::new(key, slot);
        self.outbox.push(Unqueued {
            entry,
            sender: self.topology.place(me).local,
            declared,
            kind,
        });
    }

    /// Sends a message to another host. The letter is taken, unless there is no way.
    fn send_away(
        &mut self,
        state: &mut CellState,
        (from, to): (HostIndex, HostIndex),
        head: &mut Head,
        letter: &mut Option<Sealed>,
    ) {
        let me = head.sender;
        let Some(link) = self.topology.link(from, to) else {
            let kind = head
                .kind()
                .map(|kind| self.topology.kind(kind).name().to_owned());
            return self.raise(FaultCause::NoRoute {
                from: self.topology.host_name(me).to_owned(),
                to: self.topology.host_name(head.receiver).to_owned(),
                receiver: self.topology.name(head.receiver).to_owned(),
                kind: kind.unwrap_or_default(),
            });
        };
        head.link = link;
        if self.topology.links.is_shared(link) {
            let key = self.later_key(me, &mut state.count, SimDuration::ZERO);
            let engine = self.topology.place(link).engine;
            head.class = Class::HandOver;
            self.schedule(engine, key, *head, letter.take());
            return;
        }
        let charge_j = self.carry(link, head, letter, None);
        if charge_j != 0.0 {
            state.rest.charged_j += charge_j;
            self.energy(from).transmit_j += charge_j;
            let charge = Carriage {
                energy_j: charge_j,
                ..Carriage::default()
            };
            self.note_charge(self.key, me, charge, Some(head));
        }
    }

    /// What links have charged this host, to be charged more. It outlives crashes, as spent energy
    /// does.
    #[inline(never)]
    pub(crate) fn energy(&mut self, host: HostIndex) -> &mut HostEnergy {
        let at = host as usize;
        if self.energies.len() <= at {
            self.energies.resize(at + 1, HostEnergy::default());
        }
        &mut self.energies[at]
    }

    /// Notes a charge where somebody keeps a journal of them; `head` is that of the message as whose
    /// sending it was made.
    #[cold]
    pub(crate) fn note_charge(
        &self,
        key: EventKey,
        actor: EntityId,
        charge: Carriage,
        head: Option<&Head>,
    ) {
        let Some(journal) = &self.topology.charges else {
            return;
        };
        journal.note(Charge {
            key,
            actor,
            transmit_j: charge.energy_j,
            receive_j: charge.receive_j,
            message: head.and_then(|head| {
                Some(ChargedMessage {
                    receiver: head.receiver,
                    kind: head.kind()?,
                    ordinal: head.ordinal,
                })
            }),
        });
    }

    /// What links have charged this host so far.
    pub(crate) fn energy_so_far(&self, host: HostIndex) -> HostEnergy {
        self.energy_read.set(true);
        self.energies
            .get(host as usize)
            .copied()
            .unwrap_or_default()
    }

    /// The key that `source` gives an event `delay` from now.
    #[inline(always)]
    fn later_key(&self, source: EntityId, count: &mut u64, delay: SimDuration) -> EventKey {
        let own = *count;
        *count += 1;
        if delay.is_zero() {
            self.topology
                .key(self.key.time, self.key.step + 1, source, own)
        } else {
            self.topology.key(self.key.time + delay, 0, source, own)
        }
    }

    #[inline(always)]
    fn schedule(&mut self, engine: u32, key: EventKey, head: Head, letter: Option<Sealed>) {
        if engine == self.index {
            self.insert(key, head, letter);
        } else {
            self.outgoing.push(Outgoing {
                engine,
                key,
                pending: Pending {
                    head,
                    letter,
                    side: None,
                },
            });
        }
    }

    /// Schedules an event that has a side, if it has.
    #[inline(always)]
    fn schedule_with(&mut self, engine: u32, key: EventKey, mut pending: Pending) {
        pending.head.has_side = pending.side.is_some();
        if engine == self.index {
            self.insert_pending(key, pending);
        } else {
            self.outgoing.push(Outgoing {
                engine,
                key,
                pending,
            });
        }
    }

    pub(crate) fn set_timer(
        &mut self,
        state: &mut CellState,
        me: EntityId,
        kind: KindIndex,
        letter: Sealed,
        delay: SimDuration,
    ) -> TimerId {
        let ordinal = state.next_timer(kind);
        let head = Head::of_entity(Class::Timer, me).caused(self.key, kind, ordinal);
        let head = head.in_life(state.incarnation);
        let key = self.later_key(me, &mut state.count, delay);
        let slot = self.insert(key, head, Some(letter));
        // The ordinal tells a reused slot from this timer's.
        TimerId {
            owner: self.topology.owner,
            slot,
            kind,
            ordinal,
        }
    }

    pub(crate) fn cancel_timer(&mut self, me: EntityId, timer: TimerId) -> bool {
        let cancelled = self.store.cancel(timer.slot, |head| {
            head.receiver == me && head.kind() == Some(timer.kind) && head.ordinal == timer.ordinal
        });
        if cancelled {
            self.shed_voids();
        }
        cancelled
    }

    /// Forgets what is in the queue without effect, once it is worth it.
    fn shed_voids(&mut self) {
        if !self.store.is_mostly_void() {
            return;
        }
        let store = &mut self.store;
        self.queue.retain(|entry| {
            let void = store.is_void(entry.slot);
            if void {
                store.take(entry.slot);
            }
            !void
        });
    }

    pub(crate) fn apply_change(
        &mut self,
        local: usize,
        key: EventKey,
        kind: Option<KindIndex>,
        change: SealedChange,
    ) -> Result<(), Box<FaultCause>> {
        if let (Some(kind), true) = (kind, self.recording) {
            let kind = self.topology.kind(kind);
            let encoded = (change.encode)(&*change.value, kind.schema(), &mut self.body);
            encoded.map_err(|error| FaultCause::Encoding {
                kind: kind.name().to_owned(),
                error: error.to_string(),
            })?;
        }
        self.links[local].carrier.change(change.value, key.time);
        Ok(())
    }

    /// Takes every message still on its way, with the key its next event would have had.
    pub(super) fn take_in_flight(&mut self, until: Option<EventKey>, remains: &mut Remains) {
        let topology = self.topology.clone();
        if let Some((key, head)) = self.unfinished.take()
            && head.in_flight(&topology, self.side.as_ref(), until)
        {
            let body = std::mem::take(&mut self.body);
            let side = self.side.as_ref().filter(|_| head.has_side);
            let key = head.key_in_flight(&topology, key, side);
            remains.in_flight.push((key, head.left_over(), body));
        }
        for entry in self.queue.drain_sorted() {
            let pending = self.take(entry.slot);
            remains.take(&topology, entry.key(), pending, until);
        }
        for cell in &mut self.links {
            // Those with a latest instant were in the queue.
            let parked = std::mem::take(&mut cell.parked).into_values();
            for parked in parked.filter(|parked| parked.latest.is_none()) {
                let (head, letter) = self.store.take(parked.slot);
                let side = self.store.side(parked.slot, &head);
                let pending = Pending { head, letter, side };
                remains.take(&topology, self.key, pending, until);
            }
        }
        for Outgoing { key, pending, .. } in std::mem::take(&mut self.outgoing) {
            remains.take(&topology, key, pending, until);
        }
    }

    /// Drops the links, once the run is over.
    pub(super) fn drop_carriers(&mut self, remains: &mut Remains) {
        let links = self.topology.links.iter();
        let mut entities: Vec<_> = links.map(|(link, _)| link).collect();
        entities.retain(|link| self.topology.place(*link).engine == self.index);
        entities.sort_unstable_by_key(|link| self.topology.place(*link).local);
        for (link, cell) in entities.into_iter().zip(std::mem::take(&mut self.links)) {
            remains.drop_of(&self.topology, link, cell.carrier);
        }
    }
}
