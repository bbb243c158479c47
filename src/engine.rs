//! The engine: runs a set of hosts, event by event, in key order. Each executor has one or more.
//!
//! An engine knows nothing of threads. What leaves its hosts for another engine's waits in
//! `outgoing` for the executor to carry over.

mod ahead;
mod cell;
mod erased;
mod event;
mod flows;
mod hash;
mod hops;
mod outbox;
mod parts;
mod remains;
mod store;

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::carrier::{AnyCarrier, SealedChange};
use crate::fault::{Fault, FaultCause, Outcome};
use crate::guard::{dropped, guarded};
use crate::ids::{EntityId, KindIndex};
use crate::key::{Bound, EventKey};
use crate::queue::{BATCH, Entry};
use crate::record::RecordClass;
use crate::time::SimTime;
use crate::topology::Topology;

pub(crate) use cell::{ActorCell, CellState};
pub(crate) use erased::{AnyActor, Core, Factory, Letter, Sealed, Unseal};
pub(crate) use event::{Class, Happened, Head, InFlight, Outbound, Outgoing, Pending, Side};

pub(crate) use hops::{Hop, Hops};
pub(crate) use parts::{FirstSample, Parts, SampleNames};
pub(crate) use remains::Remains;

/// Where an engine commits what happened, in key order.
pub(crate) trait Sink {
    fn commit(&mut self, happened: &Happened<'_>);
    /// A type of samples was used for the first time in one engine, in the event just committed.
    fn first_sample(&mut self, sample: FirstSample);
    /// True once the run must not go on without its driver having a look.
    fn paused(&self) -> bool;
}

/// A link, with its key counter.
pub(crate) struct LinkCell {
    pub(crate) carrier: Box<dyn AnyCarrier>,
    pub(crate) count: u64,
    /// The messages that it may wake, by token.
    pub(crate) parked: BTreeMap<u64, Parked>,
}

/// Where a message waits that its link may wake, and when it is shown at the latest.
#[derive(Clone, Copy)]
pub(crate) struct Parked {
    pub(crate) slot: u32,
    pub(crate) latest: Option<SimTime>,
}

impl LinkCell {
    pub(crate) fn new(carrier: Box<dyn AnyCarrier>) -> Self {
        LinkCell {
            carrier,
            count: 0,
            parked: BTreeMap::new(),
        }
    }
}

/// What a control event does to one entity.
pub(crate) enum Action {
    Crash,
    Restart,
    /// From now on, and at once unless it lies crashed, the actor is built so.
    Rebuild(Factory),
    Change(SealedChange),
    Tell(KindIndex, Sealed),
}

/// Runs the events of a set of hosts.
pub(crate) struct Engine {
    actors: Vec<ActorCell>,
    pub(crate) parts: Parts,
    /// After so many events is fetched what the next ones need.
    until_fetch: usize,
}

impl Engine {
    pub(crate) fn new(
        topology: Arc<Topology>,
        index: u32,
        actors: Vec<ActorCell>,
        links: Vec<LinkCell>,
    ) -> Self {
        let mut engine = Engine {
            actors,
            parts: Parts::new(topology, index, links),
            until_fetch: BATCH,
        };
        for cell in &mut engine.actors {
            let key =
                engine
                    .parts
                    .topology
                    .key(SimTime::ZERO, 0, cell.state.entity, cell.state.count);
            cell.state.count += 1;
            let head = Head::of_entity(Class::Start, cell.state.entity);
            engine.parts.insert(key, head, None);
        }
        engine
    }

    /// Time and step of the next event.
    pub(crate) fn peek(&mut self) -> Option<Bound> {
        self.queue_sent();
        self.parts.queue.peek()
    }

    /// Handles every event up to the one with this key.
    pub(crate) fn run_through(
        &mut self,
        key: EventKey,
        sink: &mut impl Sink,
    ) -> Result<(), Box<Fault>> {
        const ANY: Bound = Bound {
            time: SimTime::MAX,
            step: u32::MAX,
        };
        while self.parts.stop.is_none()
            && self.parts.queue.peek_key().is_some_and(|next| next <= key)
            && let Some(entry) = self.parts.queue.pop_before(ANY)
        {
            self.handle(entry, sink)?;
        }
        Ok(())
    }

    /// Handles every event before `bound`, unless the sink or an actor asks for a pause.
    pub(crate) fn run(&mut self, bound: Bound, sink: &mut impl Sink) -> Result<(), Box<Fault>> {
        while !sink.paused() && self.parts.stop.is_none() {
            if self.parts.outbox.is_full() {
                self.queue_fetched();
            }
            let before = self.parts.outbox.before(bound);
            let Some(entry) = self.parts.queue.pop_before(before) else {
                if self.parts.outbox.is_empty() {
                    break;
                }
                self.queue_sent();
                continue;
            };
            self.until_fetch = self.until_fetch.wrapping_sub(1);
            if self.until_fetch == 0 {
                self.fetch_ahead();
            }
            self.handle(entry, sink)?;
        }
        Ok(())
    }

    /// The way of nearly all events: a message or a timer for an actor that is there, of which
    /// nothing more is to be known.
    #[inline(always)]
    fn handle(&mut self, entry: Entry, sink: &mut impl Sink) -> Result<(), Box<Fault>> {
        let head = self.parts.store.take_head(entry.slot);
        let mut letter = self.parts.store.take_letter(entry.slot);
        let local = self.parts.topology.place(head.receiver).local as usize;
        let record = match head.class {
            Class::Message if !head.has_side => RecordClass::Delivered,
            Class::Timer if head.life() == self.actors[local].state.incarnation => {
                RecordClass::Timer
            }
            _ => return self.handle_other(entry.key(), head, letter, entry.slot, sink),
        };
        if self.actors[local].actor.is_none() || self.parts.topology.is_late_step(entry.step()) {
            return self.handle_other(entry.key(), head, letter, entry.slot, sink);
        }
        // The key is made where it goes, each time anew: one that is put in memory in parts, and
        // copied from there as a whole, waits for everything that was written before.
        self.parts.begin(entry.key());
        if let Err(fault) = self.parts.encode(letter.as_ref(), &head) {
            return Err(self.unfinished(entry.key(), &head, &mut letter, fault));
        }
        self.run_handler_of(local, record, entry, &head, &mut letter, sink)
    }

    /// The way of every event, whatever it is.
    #[inline(never)]
    fn handle_other(
        &mut self,
        key: EventKey,
        head: Head,
        mut letter: Option<Sealed>,
        slot: u32,
        sink: &mut impl Sink,
    ) -> Result<(), Box<Fault>> {
        let side = self.parts.store.side(slot, &head);
        self.parts.side = side;
        if head.class == Class::Void {
            return Ok(());
        }
        if self.died_with_its_incarnation(&head) {
            return self.discard(key, head, letter);
        }
        self.parts.begin(key);
        if let Err(fault) = self.parts.encode(letter.as_ref(), &head) {
            return Err(self.unfinished(key, &head, &mut letter, fault));
        }
        if self.parts.topology.is_late_step(key.step) {
            self.parts.hops.keep(Hop { key, head, side });
            if key.step > self.parts.topology.step_limit {
                let fault = self.step_limit_fault(key, &head);
                return Err(self.unfinished(key, &head, &mut letter, fault));
            }
        }
        if head.class == Class::Message && head.has_side {
            self.charge_receiver(head.receiver, side);
        }
        let record = match head.class {
            Class::Void => return Ok(()),
            Class::Start => RecordClass::Start,
            Class::Timer => RecordClass::Timer,
            Class::Message if self.is_crashed(head.receiver) => {
                self.discard(key, head, letter)?;
                let mut head = head;
                head.reason = self.parts.topology.intern("crashed");
                self.commit(RecordClass::Lost, key, &head, sink);
                return Ok(());
            }
            Class::Message => RecordClass::Delivered,
            Class::HandOver | Class::Held => return self.hand_over(key, head, letter, sink),
            Class::Tell => return self.tell(key, &head, letter, sink),
            Class::Charge => {
                let charge = side.and_then(|side| side.carriage);
                let local = self.parts.topology.place(head.receiver).local as usize;
                let charge = charge.unwrap_or_default();
                self.parts.note_charge(key, head.receiver, charge, None);
                self.actors[local].state.rest.charged_j += charge.energy_j;
                let host = self.parts.topology.place(head.receiver).host;
                let energy = self.parts.energy(host);
                energy.transmit_j += charge.energy_j;
                energy.receive_j += charge.receive_j;
                return Ok(());
            }
            Class::LateLoss => {
                self.discard(key, head, letter)?;
                self.commit(RecordClass::Lost, key, &head, sink);
                return Ok(());
            }
        };
        self.run_handler(record, key, &head, letter, sink)
    }

    /// Keeps what is known of an event that failed before anybody had its message. That dropping the
    /// message may fail as well changes nothing: the first fault stands.
    #[cold]
    fn unfinished(
        &mut self,
        key: EventKey,
        head: &Head,
        letter: &mut Option<Sealed>,
        fault: Box<Fault>,
    ) -> Box<Fault> {
        self.parts.note_unfinished(key, *head);
        // Taken where it is: on the way of nearly all events nothing is to be moved for this.
        let _ = dropped(letter.take());
        fault
    }

    /// Drops a message or timer that nobody handles.
    fn discard(
        &mut self,
        key: EventKey,
        head: Head,
        letter: Option<Sealed>,
    ) -> Result<(), Box<Fault>> {
        dropped(letter).map_err(|cause| {
            self.parts.note_unfinished(key, head);
            let message = head.message(&self.parts.topology);
            self.parts.fault_at(key, head.receiver, message, *cause)
        })
    }

    /// Charges a host for receiving a message, which its radio does whether or not the actor is
    /// there to take it. Kept out of the way of the many messages that nobody pays for.
    #[inline(never)]
    fn charge_receiver(&mut self, receiver: EntityId, side: Option<Side>) {
        let carriage = side.and_then(|side| side.carriage);
        let charge_j = carriage.map_or(0.0, |carriage| carriage.receive_j);
        if charge_j != 0.0 {
            let host = self.parts.topology.place(receiver).host;
            self.parts.energy(host).receive_j += charge_j;
        }
    }

    fn cell(&self, actor: EntityId) -> &ActorCell {
        &self.actors[self.parts.topology.place(actor).local as usize]
    }

    fn is_crashed(&self, actor: EntityId) -> bool {
        self.cell(actor).actor.is_none()
    }

    /// True for a start or a timer whose actor has crashed or was restarted since.
    fn died_with_its_incarnation(&self, head: &Head) -> bool {
        if !matches!(head.class, Class::Start | Class::Timer) {
            return false;
        }
        let cell = self.cell(head.receiver);
        cell.actor.is_none() || head.life() != cell.state.incarnation
    }

    /// Runs one handler, and commits the event if it did not fail.
    fn run_handler(
        &mut self,
        record: RecordClass,
        key: EventKey,
        head: &Head,
        mut letter: Option<Sealed>,
        sink: &mut impl Sink,
    ) -> Result<(), Box<Fault>> {
        let local = self.parts.topology.place(head.receiver).local as usize;
        self.run_handler_of(local, record, Entry::new(key, 0), head, &mut letter, sink)
    }

    /// [`Engine::run_handler`] of the actor whose place is known. The letter is handed on where it
    /// is: it is as large as a line of cache.
    #[inline(always)]
    fn run_handler_of(
        &mut self,
        local: usize,
        record: RecordClass,
        entry: Entry,
        head: &Head,
        letter: &mut Option<Sealed>,
        sink: &mut impl Sink,
    ) -> Result<(), Box<Fault>> {
        let result = invoke(&mut self.actors[local], &mut self.parts, letter);
        if result.is_err() || self.parts.fault.is_some() {
            return Err(self.handler_fault(entry.key(), head, result));
        }
        self.commit(record, entry.key(), head, sink);
        Ok(())
    }

    #[cold]
    fn handler_fault(
        &mut self,
        key: EventKey,
        head: &Head,
        result: Result<(), Box<FaultCause>>,
    ) -> Box<Fault> {
        let kernels_own = self.parts.fault.take();
        let Some(cause) = result.err().or(kernels_own) else {
            unreachable!("called with a fault at hand");
        };
        let message = head.message(&self.parts.topology);
        self.parts.note_unfinished(key, *head);
        let blamed = self.parts.carrying.unwrap_or(head.receiver);
        self.parts.fault_at(key, blamed, message, *cause)
    }

    fn hand_over(
        &mut self,
        key: EventKey,
        head: Head,
        letter: Option<Sealed>,
        sink: &mut impl Sink,
    ) -> Result<(), Box<Fault>> {
        let (Some(link), Some(letter)) = (head.link(), letter) else {
            unreachable!("a message is handed over with its letter, to a link");
        };
        let held = self.parts.side.filter(|_| head.class == Class::Held);
        let parts = &mut self.parts;
        let carried = guarded(|| parts.carry_on(link, head, letter, held));
        let result = carried.and_then(|charge_j| match self.parts.fault.take() {
            Some(cause) => Err(cause),
            None => Ok(charge_j),
        });
        if let Err(cause) = result {
            self.parts.note_unfinished(key, head);
            let message = format!("a message from {}", self.parts.topology.name(head.sender));
            return Err(self.parts.fault_at(key, link, Some(message), *cause));
        }
        self.commit(RecordClass::HandOver, key, &head, sink);
        Ok(())
    }

    /// Gives a link the change that an actor asked for.
    fn tell(
        &mut self,
        key: EventKey,
        head: &Head,
        letter: Option<Sealed>,
        sink: &mut impl Sink,
    ) -> Result<(), Box<Fault>> {
        let change = letter.and_then(|mut letter| letter.0.take_change());
        let (link, parts) = (head.receiver, &mut self.parts);
        if let Some(change) = change {
            guarded(|| parts.tell(link, change, key.time))
                .map_err(|cause| self.parts.fault_at(key, link, None, *cause))?;
        }
        self.commit(RecordClass::Change, key, head, sink);
        Ok(())
    }

    /// Applies a control event to one of this engine's entities.
    pub(crate) fn control(
        &mut self,
        key: EventKey,
        entity: EntityId,
        action: Action,
        sink: &mut impl Sink,
    ) -> Result<(), Box<Fault>> {
        let mut head = Head::of_entity(Class::Tell, entity);
        head.sender = EntityId::CONTROL;
        let local = self.parts.topology.place(entity).local as usize;
        self.parts.begin(key);
        match action {
            Action::Crash => {
                dropped(self.actors[local].actor.take())
                    .map_err(|cause| self.parts.fault_at(key, entity, None, *cause))?;
                self.commit(RecordClass::Crash, key, &head, sink);
                Ok(())
            }
            Action::Restart => self.restart(key, entity, &head, sink),
            Action::Rebuild(factory) => {
                let cell = &mut self.actors[local];
                let old = std::mem::replace(&mut cell.state.rest.factory, factory);
                dropped(old).map_err(|cause| self.parts.fault_at(key, entity, None, *cause))?;
                match self.actors[local].actor.is_some() {
                    true => self.restart(key, entity, &head, sink),
                    false => Ok(()),
                }
            }
            Action::Change(change) => {
                let links = &self.parts.topology.links;
                head = head.of_kind(links.get(entity).map(|link| link.change_kind));
                let parts = &mut self.parts;
                guarded(|| parts.apply_change(local, key, head.kind(), change))
                    .and_then(|applied| applied)
                    .map_err(|cause| self.parts.fault_at(key, entity, None, *cause))?;
                self.commit(RecordClass::Change, key, &head, sink);
                Ok(())
            }
            Action::Tell(kind, letter) => self.tell_actor(key, head, kind, letter, sink),
        }
    }

    /// From its next restart on, the actor is built so.
    pub(crate) fn exchange_constructor(&mut self, actor: EntityId, factory: Factory) {
        let local = self.parts.topology.place(actor).local as usize;
        let old = std::mem::replace(&mut self.actors[local].state.rest.factory, factory);
        // What a run would make of a panic here is not what is replayed.
        let _ = dropped(old);
    }

    /// Builds an actor anew, in a new incarnation.
    fn restart(
        &mut self,
        key: EventKey,
        entity: EntityId,
        head: &Head,
        sink: &mut impl Sink,
    ) -> Result<(), Box<Fault>> {
        let local = self.parts.topology.place(entity).local as usize;
        let cell = &mut self.actors[local];
        cell.state.incarnation += 1;
        cell.state.clear_streams();
        let (topology, factory) = (&self.parts.topology, &cell.state.rest.factory);
        let old = dropped(cell.actor.take());
        let built = old.and_then(|()| guarded(|| factory(topology.name(entity))));
        cell.actor = Some(built.map_err(|cause| self.parts.fault_at(key, entity, None, *cause))?);
        self.run_handler(RecordClass::Restart, key, head, None, sink)
    }

    /// Hands an actor a message from a control event. A crashed actor is told in vain.
    fn tell_actor(
        &mut self,
        key: EventKey,
        head: Head,
        kind: KindIndex,
        letter: Sealed,
        sink: &mut impl Sink,
    ) -> Result<(), Box<Fault>> {
        let local = self.parts.topology.place(head.receiver).local as usize;
        let state = &mut self.actors[local].state;
        // The flow from `@control`, to which no actor sends anything.
        let ordinal = state.next_of_entity(EntityId::CONTROL, kind);
        let mut head = head.of_kind(Some(kind));
        head.ordinal = ordinal;
        self.parts.begin(key);
        if let Err(fault) = self.parts.encode(Some(&letter), &head) {
            // Nobody sent it: it has no fate.
            let _ = dropped(letter);
            return Err(fault);
        }
        if self.is_crashed(head.receiver) {
            self.discard(key, head, Some(letter))?;
            self.commit(RecordClass::Told, key, &head, sink);
            return Ok(());
        }
        self.run_handler(RecordClass::Told, key, &head, Some(letter), sink)
    }

    /// Commits the event just handled, then what happened in it.
    #[inline(always)]
    fn commit(&mut self, class: RecordClass, key: EventKey, head: &Head, sink: &mut impl Sink) {
        let parts = &mut self.parts;
        let side = if head.has_side {
            parts.side.as_ref()
        } else {
            None
        };
        sink.commit(&Happened {
            class,
            key,
            head,
            side,
            sample: None,
            body: &parts.body,
            sends: parts.sends,
            hash: head.hash_if_wanted(&parts.topology, class, key, &parts.body),
        });
        if !parts.effects.is_empty() {
            parts.commit_effects(head, sink);
        }
    }

    /// Takes apart what is left once the run is over; see [`Remains`].
    pub(crate) fn dissolve(&mut self, until: Option<EventKey>, remains: &mut Remains) {
        self.queue_sent();
        self.parts.take_in_flight(until, remains);
        for ActorCell { actor, state } in std::mem::take(&mut self.actors) {
            let (entity, rest) = (state.entity, *state.rest);
            remains.drop_of(&self.parts.topology, entity, actor);
            for kept in rest.durable {
                remains.drop_of(&self.parts.topology, entity, kept);
            }
            remains.drop_of(&self.parts.topology, entity, rest.factory);
        }
        self.parts.drop_carriers(remains);
    }

    /// The fault of one hop too many, of which the executor tells what led to it.
    #[cold]
    fn step_limit_fault(&self, key: EventKey, head: &Head) -> Box<Fault> {
        let cause = FaultCause::StepLimit {
            limit: self.parts.topology.step_limit,
            chain: Vec::new(),
        };
        self.parts.fault_at(key, head.handled_by(), None, cause)
    }
}

#[inline(always)]
fn invoke(
    cell: &mut ActorCell,
    parts: &mut Parts,
    letter: &mut Option<Sealed>,
) -> Result<(), Box<FaultCause>> {
    let Some(actor) = cell.actor.as_deref_mut() else {
        unreachable!("handlers run on living actors only");
    };
    let mut core = Core {
        parts,
        state: &mut cell.state,
    };
    let outcome: Result<Outcome, _> = guarded(|| {
        let Some(sealed) = letter else {
            return actor.started(&mut core);
        };
        let outcome = sealed.0.deliver(actor, &mut core);
        *letter = None;
        outcome
    });
    outcome?.map_err(|error| Box::new(FaultCause::Error(error.to_string())))
}
