//! Replaying some actors of a recorded run: they live, all else comes from the record.
//!
//! A simulation is built as for the run, perhaps with other settings or other code of the actors that live.
//! They have their own timers, random streams and durable memory. Who sends to them, when, and in which order
//! is as recorded, ties included; so is what they are told, and when they crash and restart. What they send,
//! which links they change, the samples that they record and the stops that they ask for end at a comparer,
//! beside what is recorded. Where an output differs, the recorded world goes on as if it had not: the loop is
//! open. Only messages between living actors of one host do arrive as they are sent.
//!
//! Nobody else is built, no link decides, and there is no digest: the work is that of the living actors, and of
//! reading the record. Memory does not grow with the record's length: outputs wait only until their fate is
//! recorded.
//!
//! # A rover replayed, with another speed
//!
//! ```
//! use std::sync::{Arc, Mutex};
//! use farside::prelude::*;
//! use farside::replay::{Recorded, RecordEnd, Replay};
//! use serde::{Deserialize, Serialize};
//!
//! #[derive(Serialize, Deserialize)] struct Drive { metres: f64 }
//! #[derive(Serialize, Deserialize)] struct Arrived { after_s: f64 }
//! #[derive(Serialize, Deserialize)] struct There;
//!
//! struct Rover { base: Address<Base>, speed_m_per_s: f64, leg_s: f64 }
//! impl Actor for Rover { type Accepts = (Drive, There); }
//! impl Handler<Drive> for Rover {
//!     fn handle(&mut self, drive: Drive, ctx: &mut Context<'_, Self>) -> Outcome {
//!         let slip = ctx.random("slip").normal(1.0, 0.1);
//!         self.leg_s = drive.metres / self.speed_m_per_s * slip;
//!         ctx.timer(SimDuration::from_secs_f64(self.leg_s), There);
//!         Ok(())
//!     }
//! }
//! impl Handler<There> for Rover {
//!     fn handle(&mut self, _: There, ctx: &mut Context<'_, Self>) -> Outcome {
//!         ctx.send(self.base, Arrived { after_s: self.leg_s });
//!         Ok(())
//!     }
//! }
//!
//! struct Base { legs: u32 }
//! impl Actor for Base {
//!     type Accepts = (Arrived,);
//!     fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome { self.next(ctx) }
//! }
//! impl Base {
//!     fn next(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
//!         let rover = ctx.lookup::<Rover>("rover_1")?;
//!         ctx.send(rover, Drive { metres: 3.0 });
//!         Ok(())
//!     }
//! }
//! impl Handler<Arrived> for Base {
//!     fn handle(&mut self, _: Arrived, ctx: &mut Context<'_, Self>) -> Outcome {
//!         self.legs += 1;
//!         if self.legs < 3 { self.next(ctx) } else { Ok(()) }
//!     }
//! }
//!
//! fn assemble(speed_m_per_s: f64) -> Simulation {
//!     let mut sim = Simulation::new(7);
//!     let (earth, moon) = (sim.host("earth"), sim.host("moon"));
//!     let base = sim.actor(earth, "base", |_| Base { legs: 0 });
//!     sim.actor(moon, "rover_1", move |_| Rover { base, speed_m_per_s, leg_s: 0.0 });
//!     let way = FixedDelay::new(SimDuration::from_millis(1300));
//!     sim.link(earth, moon, "earth-moon", way.clone());
//!     sim.link(moon, earth, "moon-earth", way);
//!     sim
//! }
//!
//! // Replays a rover on the records of a run while that goes on. From a log it is the same: see `replay` in
//! // the crate `farside-logs`.
//! fn replayed(speed_m_per_s: f64) -> farside::replay::ReplayReport {
//!     let replay = Replay::new(assemble(speed_m_per_s), |name| name == "rover_1").unwrap();
//!     let replay = Arc::new(Mutex::new(replay));
//!     let feeding = replay.clone();
//!     let mut sim = assemble(1.0);
//!     sim.observe(move |record: &farside::record::Record<'_>| {
//!         feeding.lock().unwrap().feed(&Recorded::from(record)).unwrap();
//!     });
//!     let report = sim.run(Executor::Inline).unwrap();
//!     let replay = Arc::into_inner(replay).unwrap().into_inner().unwrap();
//!     replay.finish(RecordEnd::Completed { at: report.end_time })
//! }
//!
//! let same = replayed(1.0);
//! assert_eq!((same.total().same, same.total().differing()), (3, 0));
//!
//! // Twice as fast: it answers sooner, and the recorded base orders the next leg as it did.
//! let faster = replayed(2.0);
//! assert_eq!((faster.total().same, faster.total().changed), (0, 3));
//! let first = faster.first.unwrap();
//! assert_eq!((first.kind.as_str(), first.field), ("Arrived", "sent"));
//! assert_eq!(first.input.unwrap().kind, "Drive");
//! ```

mod charges;
mod compare;
mod report;
mod trail;

use std::collections::VecDeque;
use std::sync::Arc;

use thiserror::Error;

pub use charges::{Charge, ChargeJournal, ChargedMessage};
pub use report::{Difference, KindTally, Output, OutputClass, ReplayReport, Step, Steps, Tally};

use crate::carrier::Carriage;
use crate::engine::{
    Action, Class, Engine, Factory, Head, Pending, Remains, Sealed, Side as Beside,
};
use crate::fault::{BuildError, Fault};
use crate::guard::guarded;
use crate::ids::{EntityId, KindIndex, MatchKey};
use crate::key::{Bound, EventKey};
use crate::record::{Record, RecordClass};
use crate::schedule::stop_of;
use crate::simulation::Simulation;
use crate::time::SimTime;
use crate::topology::{RunInfo, Topology};

use charges::{Absent, OnSending};
use compare::{Comparer, FlowKey, Seen, Side};

/// A record of the run that is replayed, with the numbers that entities have in [`Replay::info`].
#[derive(Clone, Copy, Debug)]
pub struct Recorded<'a> {
    /// What the record is about.
    pub class: RecordClass,
    /// The key of the event. Of a state sample only the time counts.
    pub key: EventKey,
    /// The key of the event that caused this one, where one did.
    pub cause: Option<EventKey>,
    /// Who sent the message; for other events, who they happen to, or who asked for the stop.
    pub sender: EntityId,
    /// Who the message is for; for other events, who they happen to.
    pub receiver: EntityId,
    /// The link that carried it; none within a host.
    pub link: Option<EntityId>,
    /// The type of the body; empty where there is none.
    pub kind: &'a str,
    /// The message's place in the flow.
    pub ordinal: u64,
    /// Which copy of the message this is.
    pub copy: u32,
    /// The protocol's own identity for the message, if it gave one.
    pub match_key: Option<MatchKey>,
    /// When the message was sent.
    pub sent: SimTime,
    /// Why the message was lost; empty otherwise.
    pub reason: &'a str,
    /// The encoded message; of a stop, why.
    pub body: &'a [u8],
    /// How the link carried the message, where the link says.
    pub carriage: Option<Carriage>,
}

impl<'a> From<&Record<'a>> for Recorded<'a> {
    fn from(record: &Record<'a>) -> Self {
        Recorded {
            class: record.class,
            key: record.key,
            cause: record.cause,
            sender: record.sender,
            receiver: record.receiver,
            link: record.link,
            kind: record.kind.map_or("", |kind| kind.name()),
            ordinal: record.ordinal,
            copy: record.copy,
            match_key: record.match_key,
            sent: record.sent,
            reason: record.reason,
            body: record.body,
            carriage: record.carriage.copied(),
        }
    }
}

/// How a record ends.
#[derive(Clone, Debug, PartialEq)]
pub enum RecordEnd {
    /// Nothing was left to happen after what happened at this time.
    Completed {
        /// The time of the last event.
        at: SimTime,
    },
    /// The run was stopped.
    Stopped {
        /// When.
        at: SimTime,
    },
    /// A fault.
    Fault {
        /// The time of the event that failed.
        at: SimTime,
        /// What the fault says.
        text: String,
        /// The key of the last event before it, of whomever, as far as it is known.
        last: Option<EventKey>,
    },
    /// Somewhere: the run may have gone on.
    Cut {
        /// The time of the last record.
        at: SimTime,
        /// Its key, as far as it is known.
        last: Option<EventKey>,
    },
}

/// A record that cannot be replayed.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ReplayError {
    /// Records must come in the order of their keys.
    #[error("a record at {time} comes after one at {last}: expected records in order")]
    Order {
        /// The time of the record.
        time: SimTime,
        /// That of the record before.
        last: SimTime,
    },
    /// An entity that the simulation does not have.
    #[error("a record names entity number {found}; the simulation has {count}")]
    UnknownEntity {
        /// The number.
        found: usize,
        /// How many there are.
        count: usize,
    },
    /// The receiver does not take messages of this kind.
    #[error("{actor} was sent {kind:?}, which it does not accept; it accepts {}", .accepts.join(", "))]
    NotAccepted {
        /// The receiver.
        actor: String,
        /// The kind in the record.
        kind: String,
        /// What it accepts.
        accepts: Vec<String>,
    },
    /// A message that cannot be read as its kind.
    #[error(
        "{kind} for {actor} at {time} cannot be read as what this program has under that name: {error}"
    )]
    Body {
        /// The receiver.
        actor: String,
        /// The kind.
        kind: String,
        /// When it arrived.
        time: SimTime,
        /// Why not.
        error: String,
    },
}

/// A replay under way: see the [module](self).
pub struct Replay {
    topology: Arc<Topology>,
    engine: Engine,
    /// By host.
    live_hosts: Vec<bool>,
    /// Constructors that actors have from some control events on, in order.
    rebuilds: VecDeque<(EventKey, EntityId, Factory)>,
    comparer: Comparer,
    on_sending: OnSending,
    /// Charges of a living host were recorded, and nobody has said when they were made.
    charged: bool,
    /// Charges are told ([`Replay::charge`]).
    charges_told: bool,
    /// By link, whether it charged nothing for what it carried last.
    free: Vec<bool>,
    inputs: u64,
    last: EventKey,
    /// Stops asked for, the first of each actor.
    stops: Vec<(EventKey, EntityId, String)>,
    recorded_stop: Option<(EventKey, EntityId, String)>,
    /// The first message to a living actor that was in flight when the record ended.
    in_flight: Option<(EventKey, Head, Sealed)>,
    fault: Option<Box<Fault>>,
}

impl Replay {
    /// A replay of the actors whose names `live` picks. `sim` is built as for the run; what it has of
    /// observers, rulings and control events is dropped, since all that comes from the record.
    ///
    /// # Errors
    /// When the simulation could not start.
    pub fn new(sim: Simulation, live: impl Fn(&str) -> bool) -> Result<Replay, BuildError> {
        let on_sending = OnSending::default();
        let stage = sim.into_stage(live, || Box::new(Absent(on_sending.clone())))?;
        let topology = stage.topology;
        let mut live_hosts = vec![false; topology.host_names.len()];
        for (entity, place) in topology.places.iter().enumerate() {
            if stage.live[entity] {
                live_hosts[place.host as usize] = true;
            }
        }
        Ok(Replay {
            last: topology.key(SimTime::ZERO, 0, EntityId::CONTROL, 0),
            comparer: Comparer::new(topology.clone(), stage.live),
            engine: stage.engine,
            live_hosts,
            rebuilds: stage.rebuilds.into(),
            on_sending,
            charged: false,
            charges_told: false,
            free: vec![false; topology.info.entities.len()],
            inputs: 0,
            stops: Vec::new(),
            recorded_stop: None,
            in_flight: None,
            fault: stage.fault,
            topology,
        })
    }

    /// Who takes part, and which kinds of messages there are.
    pub fn info(&self) -> &Arc<RunInfo> {
        &self.topology.info
    }

    /// True for an actor that lives.
    pub fn is_live(&self, entity: EntityId) -> bool {
        self.comparer.is_live(entity)
    }

    /// True for an actor on a host on which one lives: records of which it is sender or receiver are to be
    /// fed, and stops; others change nothing.
    pub fn is_near(&self, entity: EntityId) -> bool {
        let place = self.topology.places[entity.index()];
        self.live_hosts.get(place.host as usize) == Some(&true)
    }

    /// The kinds of messages that a living actor accepts, by name.
    pub fn accepts(&self, actor: EntityId) -> Vec<&str> {
        let accepted = self.accepted(actor);
        let kinds = accepted.filter_map(|accepted| {
            let kind = self.topology.kind_of_type.get(&accepted.kind.type_id)?;
            Some(self.topology.kind(*kind).name())
        });
        kinds.collect()
    }

    fn accepted(&self, actor: EntityId) -> impl Iterator<Item = &crate::topology::Accepted> {
        let declared = self.topology.address_numbers[actor.index()];
        let actor_type = declared.map(|declared| {
            let at = self.topology.type_of_actor[declared as usize];
            &self.topology.actor_types[at as usize]
        });
        actor_type.into_iter().flat_map(|found| &found.accepts)
    }

    /// Outputs that are not in the record, by what they are, whose and which kind: they are not compared.
    pub fn leave_out(&mut self, which: impl Fn(OutputClass, &str, &str) -> bool + Send + 'static) {
        self.comparer.leave_out(which);
    }

    /// From now on charges are told as they were made, before the record of the event in which they were.
    pub fn charges_are_told(&mut self) {
        self.charges_told = true;
    }

    /// Tells what a link charged. Not told, what living actors ask of it is not known, and if a record says
    /// that there was any, the report says so ([`ReplayReport::needs_charges`]).
    pub fn charge(&mut self, charge: &Charge) {
        if !self.is_near(charge.actor) {
            return;
        }
        match charge.message {
            Some(message) if self.is_live(charge.actor) => {
                self.on_sending
                    .add(charge.actor, message, charge.transmit_j);
            }
            _ => self.insert_charge(
                charge.key,
                charge.actor,
                charge.transmit_j,
                charge.receive_j,
            ),
        }
    }

    fn insert_charge(&mut self, key: EventKey, actor: EntityId, energy_j: f64, receive_j: f64) {
        let carriage = Carriage {
            energy_j,
            receive_j,
            ..Carriage::default()
        };
        self.insert(
            key,
            Head::of_entity(Class::Charge, actor),
            None,
            Some(carriage),
        );
    }

    fn insert(
        &mut self,
        key: EventKey,
        mut head: Head,
        letter: Option<Sealed>,
        carriage: Option<Carriage>,
    ) {
        head.has_side = carriage.is_some();
        let side = carriage.map(|carriage| Beside {
            carriage: Some(carriage),
            ..Beside::default()
        });
        let pending = Pending { head, letter, side };
        self.engine.parts.insert_pending(key, pending);
    }

    /// Runs the living actors up to `bound`.
    fn advance(&mut self, bound: Bound) {
        while self.fault.is_none() {
            match self.engine.run(bound, &mut self.comparer) {
                Err(fault) => self.fault = Some(fault),
                Ok(()) if !self.take_stop() => break,
                Ok(()) => {}
            }
        }
    }

    /// Runs the living actors up to the event with this key.
    fn advance_through(&mut self, key: EventKey) {
        while self.fault.is_none() {
            match self.engine.run_through(key, &mut self.comparer) {
                Err(fault) => self.fault = Some(fault),
                Ok(()) if !self.take_stop() => break,
                Ok(()) => {}
            }
        }
    }

    /// Keeps the first stop that an actor asked for.
    fn take_stop(&mut self) -> bool {
        let Some(stop) = self.engine.parts.stop.take() else {
            return false;
        };
        if !self.stops.iter().any(|(_, by, _)| *by == stop.1) {
            self.stops.push(stop);
        }
        true
    }

    /// Takes the next record, in the order of the run.
    ///
    /// # Errors
    /// When it cannot be replayed.
    pub fn feed(&mut self, record: &Recorded<'_>) -> Result<(), ReplayError> {
        let count = self.topology.info.entities.len();
        let link = record.link.unwrap_or(record.sender);
        let entities = [record.sender, record.receiver, record.key.source, link];
        if let Some(found) = entities.iter().find(|entity| entity.index() >= count) {
            let found = found.index();
            return Err(ReplayError::UnknownEntity { found, count });
        }
        if record.class == RecordClass::Sample {
            self.meet(OutputClass::Sample, record);
            return Ok(());
        }
        if record.class == RecordClass::InFlight {
            return self.feed_in_flight(record);
        }
        if record.key < self.last {
            let (time, last) = (record.key.time, self.last.time);
            return Err(ReplayError::Order { time, last });
        }
        self.last = record.key;
        self.advance(Bound {
            time: record.key.time,
            step: record.key.step,
        });
        if self.fault.is_some() {
            return Ok(());
        }
        self.note_charges(record);
        if self.is_live(record.receiver) {
            self.happen(record)?;
        }
        match record.class {
            RecordClass::Stop => {
                let why = String::from_utf8_lossy(record.body).into_owned();
                self.recorded_stop = Some((record.key, record.sender, why));
            }
            RecordClass::Delivered | RecordClass::Lost if record.copy == 0 => {
                self.meet(OutputClass::Message, record);
            }
            RecordClass::Change => self.meet(OutputClass::Change, record),
            _ => {}
        }
        Ok(())
    }

    fn feed_in_flight(&mut self, record: &Recorded<'_>) -> Result<(), ReplayError> {
        let is_own = self.is_live(record.sender) && record.link.is_none();
        // What it cost is not recorded: nothing, if its link took nothing for the one before.
        let is_free = record.link.is_none_or(|link| self.free[link.index()]);
        self.charged |= !is_free && self.is_near(record.sender);
        let is_first = |(first, ..): &(EventKey, Head, Sealed)| record.key < *first;
        if self.is_live(record.receiver)
            && !is_own
            && self.in_flight.as_ref().is_none_or(is_first)
            && let Ok((head, letter)) = self.message(record)
        {
            self.in_flight = Some((record.key, head, letter));
        }
        if record.copy == 0 {
            self.meet(OutputClass::Message, record);
        }
        Ok(())
    }

    /// An output as it is recorded.
    fn meet(&mut self, class: OutputClass, record: &Recorded<'_>) {
        if !self.is_live(record.sender) {
            return;
        }
        let key = FlowKey {
            class,
            actor: record.sender,
            receiver: record.receiver,
            kind: self.comparer.kind_named(record.kind),
        };
        let seen = Seen {
            ordinal: record.ordinal,
            time: record.sent,
            cause: record.cause.unwrap_or(record.key),
            match_key: record.match_key,
            body: record.body,
        };
        self.comparer.meet(Side::Recorded, key, seen);
    }

    /// What a link charged for a message that came to a living host, or went from there.
    fn note_charges(&mut self, record: &Recorded<'_>) {
        let Some(carriage) = record.carriage else {
            // A link that does not say how it carried may have charged all the same.
            self.charged |= record.link.is_some() && self.is_near(record.sender);
            return;
        };
        if let Some(link) = record.link {
            self.free[link.index()] = carriage.energy_j == 0.0;
        }
        let reached = match record.class {
            RecordClass::Delivered => true,
            RecordClass::Lost => record.reason == "crashed",
            _ => false,
        };
        // A message that arrives takes its own charge with it.
        let takes_it = self.is_live(record.receiver) && record.class == RecordClass::Delivered;
        if reached && !takes_it && carriage.receive_j != 0.0 && self.is_near(record.receiver) {
            self.insert_charge(record.key, record.receiver, 0.0, carriage.receive_j);
        }
        self.charged |= carriage.energy_j != 0.0 && self.is_near(record.sender)
            || carriage.receive_j != 0.0 && self.is_near(record.receiver);
    }

    /// What happens to a living actor.
    fn happen(&mut self, record: &Recorded<'_>) -> Result<(), ReplayError> {
        let (class, key, actor) = (record.class, record.key, record.receiver);
        if matches!(
            class,
            RecordClass::Start
                | RecordClass::Delivered
                | RecordClass::Timer
                | RecordClass::Restart
                | RecordClass::Told
        ) {
            self.comparer.step(Side::Recorded, key.time);
        }
        self.exchange_constructors(key);
        match class {
            // It is sent again.
            RecordClass::Delivered if self.is_live(record.sender) && record.link.is_none() => {}
            RecordClass::Delivered => {
                let (head, letter) = self.message(record)?;
                let carriage = record.carriage.filter(|carriage| carriage.receive_j != 0.0);
                self.inputs += 1;
                self.insert(key, head, Some(letter), carriage);
            }
            RecordClass::Crash => self.control(key, actor, Action::Crash),
            RecordClass::Restart => self.control(key, actor, Action::Restart),
            RecordClass::Told => {
                let (head, letter) = self.message(record)?;
                let kind = head.kind().unwrap_or_default();
                self.control(key, actor, Action::Tell(kind, letter));
            }
            _ => {}
        }
        Ok(())
    }

    fn control(&mut self, key: EventKey, actor: EntityId, action: Action) {
        self.inputs += 1;
        if let Err(fault) = self.engine.control(key, actor, action, &mut self.comparer) {
            self.fault = Some(fault);
        }
        self.take_stop();
    }

    /// Gives actors the constructors that they have from events up to this one on.
    fn exchange_constructors(&mut self, key: EventKey) {
        while let Some((from, ..)) = self.rebuilds.front()
            && *from <= key
            && let Some((_, actor, factory)) = self.rebuilds.pop_front()
        {
            self.engine.exchange_constructor(actor, factory);
        }
    }

    /// A recorded message, for its receiver.
    fn message(&self, record: &Recorded<'_>) -> Result<(Head, Sealed), ReplayError> {
        let actor = || self.topology.name(record.receiver).to_owned();
        let found = self.accepted(record.receiver).find_map(|accepted| {
            let kind = self.topology.kind_of_type.get(&accepted.kind.type_id)?;
            let is_it = self.topology.kind(*kind).name() == record.kind;
            is_it.then_some((*kind, accepted.unseal))
        });
        let Some((kind, unseal)) = found else {
            let accepts = self.accepts(record.receiver).into_iter();
            return Err(ReplayError::NotAccepted {
                actor: actor(),
                kind: record.kind.to_owned(),
                accepts: accepts.map(str::to_owned).collect(),
            });
        };
        let schema = self.topology.kind(kind).schema();
        let read = guarded(|| unseal(schema, record.body));
        let error = match read {
            Ok(Ok(letter)) => return Ok((self.head(record, kind), letter)),
            Ok(Err(error)) => error.to_string(),
            Err(cause) => cause.to_string(),
        };
        Err(ReplayError::Body {
            actor: actor(),
            kind: record.kind.to_owned(),
            time: record.key.time,
            error,
        })
    }

    fn head(&self, record: &Recorded<'_>, kind: KindIndex) -> Head {
        let mut head = Head::of_entity(Class::Message, record.sender);
        head.receiver = record.receiver;
        if let Some(link) = record.link {
            head = head.through(link);
        }
        head = match record.cause {
            Some(cause) => head.caused(cause, kind, record.ordinal),
            None => head.of_kind(Some(kind)),
        };
        head.ordinal = record.ordinal;
        match record.match_key {
            Some(key) => head.keyed(key, 0).as_copy(record.copy),
            None => head.as_copy(record.copy),
        }
    }

    /// What came of it, once the record is over.
    pub fn finish(mut self, end: RecordEnd) -> ReplayReport {
        match &end {
            RecordEnd::Completed { at } => self.advance(Bound {
                time: *at,
                step: u32::MAX,
            }),
            RecordEnd::Stopped { at } => self.advance(Bound::at(*at)),
            RecordEnd::Fault { at, text, last } => {
                self.advance_through(last.unwrap_or(self.last));
                self.run_into(*at, text);
            }
            RecordEnd::Cut { at, last } => {
                self.advance(Bound::at(*at));
                self.advance_through(last.unwrap_or(self.last));
            }
        }
        let (RecordEnd::Completed { at }
        | RecordEnd::Stopped { at }
        | RecordEnd::Fault { at, .. }
        | RecordEnd::Cut { at, .. }) = &end;
        if *at > self.last.time {
            self.last = self.topology.key(*at, 0, EntityId::CONTROL, 0);
        }
        let until = match &self.fault {
            Some(fault) => fault.time,
            None => self.last.time,
        };
        self.meet_in_flight();
        let is_over = !matches!(end, RecordEnd::Cut { .. });
        let (kinds, first) = self.comparer.close(is_over, self.last.time);
        let mut ended = Ended { kinds, first };
        self.compare_stops(&mut ended, is_over);
        let fault = self.compare_fault(&mut ended, &end);
        let asked = self.engine.parts.energy_read.get();
        ReplayReport {
            inputs: self.inputs,
            steps: self.comparer.steps,
            kinds: ended.kinds,
            first: ended.first.map(|(_, first)| first),
            needs_charges: asked && self.charged && !self.charges_told,
            fault,
            until,
        }
    }

    /// The living actor in whose event the run failed, if it was one's. What a control event does is recorded
    /// once it is done: one that failed is not.
    fn failed(&self, at: SimTime, text: &str) -> Option<EntityId> {
        let is_control =
            text.contains(" from @control: ") || !text.contains(" handling ") && at > SimTime::ZERO;
        if is_control {
            return None;
        }
        let mut actors = self.topology.declared.iter().copied();
        actors.find(|actor| {
            let name = self.topology.name(*actor);
            self.is_live(*actor) && text.starts_with(&format!("{name} at "))
        })
    }

    /// Goes on into the event in which the run failed, if it was one of a living actor.
    fn run_into(&mut self, at: SimTime, text: &str) {
        if self.failed(at, text).is_none() {
            return;
        }
        if let Some((key, head, letter)) = self.in_flight.take_if(|(key, ..)| key.time == at) {
            self.insert(key, head, Some(letter), None);
        }
        self.advance(Bound {
            time: at,
            step: u32::MAX,
        });
    }

    /// Meets what living actors have sent and is still on its way.
    fn meet_in_flight(&mut self) {
        let until = self.fault.as_ref().map(|fault| fault.key);
        let mut remains = Remains::default();
        self.engine.dissolve(until, &mut remains);
        for (key, head, body) in remains.in_flight {
            let is_own = head.link().is_none() || head.class == Class::HandOver;
            if !self.is_live(head.sender) || !is_own {
                continue;
            }
            let flow = FlowKey {
                class: OutputClass::Message,
                actor: head.sender,
                receiver: head.receiver,
                kind: head.kind().unwrap_or_default(),
            };
            let seen = Seen {
                ordinal: head.ordinal,
                time: head.sent(key),
                cause: head.cause().unwrap_or(key),
                match_key: head.match_key(),
                body: &body,
            };
            self.comparer.meet(Side::Replayed, flow, seen);
        }
    }

    /// Compares the stops that living actors asked for with the recorded one.
    fn compare_stops(&mut self, ended: &mut Ended, is_over: bool) {
        let topology = self.topology.clone();
        let look_ahead = topology.info.look_ahead;
        let recorded = self.recorded_stop.take();
        let recorded = recorded.filter(|(_, by, _)| self.is_live(*by));
        let output = |time: SimTime, why: &str| Output {
            time,
            ordinal: 0,
            match_key: None,
            body: Some(why.as_bytes().to_vec()),
        };
        let mut expected = recorded.map(|(key, by, why)| {
            let bound = Bound {
                time: key.time,
                step: key.step,
            };
            (bound, by, output(key.time, &why))
        });
        for (key, by, why) in std::mem::take(&mut self.stops) {
            let at = stop_of(key, look_ahead);
            if self.comparer.leaves_out(OutputClass::Stop, by, "") {
                continue;
            }
            let own = expected.take_if(|(_, who, _)| *who == by);
            let actual = output(at.time, &why);
            // A stop that would have taken effect after the end is no difference.
            let reached = Bound {
                time: self.last.time,
                step: self.last.step,
            };
            if own.is_none() && (at >= reached || !is_over) {
                continue;
            }
            let field = match &own {
                None => "presence",
                Some((bound, _, expected)) if *bound == at && *expected == actual => "",
                Some((bound, ..)) if *bound != at => "sent",
                Some(_) => "body",
            };
            let expected = own.map(|(.., output)| output);
            ended.add(
                &topology,
                OutputClass::Stop,
                by,
                key,
                field,
                [expected, Some(actual)],
            );
        }
        if let Some((bound, by, expected)) = expected {
            let key = topology.key(bound.time, bound.step, EntityId::CONTROL, 0);
            let pair = [Some(expected), None];
            ended.add(&topology, OutputClass::Stop, by, key, "presence", pair);
        }
    }

    /// Compares the fault in which the replay ended with the recorded one, and says what it was.
    fn compare_fault(&mut self, ended: &mut Ended, end: &RecordEnd) -> Option<String> {
        let topology = self.topology.clone();
        let output = |time: SimTime, text: &str| Output {
            time,
            ordinal: 0,
            match_key: None,
            body: Some(text.as_bytes().to_vec()),
        };
        let recorded = match end {
            RecordEnd::Fault { at, text, .. } => {
                let whose = self.failed(*at, text);
                whose.map(|whose| (*at, whose, text.as_str()))
            }
            _ => None,
        };
        let fault = self.fault.take();
        let actual = fault.as_ref().map(|fault| fault.to_string());
        let expected = recorded.map(|(at, _, text)| output(at, text));
        let whose = match (&fault, recorded) {
            (Some(fault), _) => topology.info.entity(&fault.actor),
            (None, recorded) => recorded.map(|(_, whose, _)| whose),
        };
        if let Some(whose) = whose {
            let time = fault.as_ref().map(|fault| fault.time);
            let own = actual.as_deref().zip(time);
            let own = own.map(|(text, time)| output(time, text));
            let field = match (&expected, &own) {
                (expected, own) if expected == own => "",
                (Some(_), Some(_)) => "body",
                _ => "presence",
            };
            let key = fault.map_or(self.last, |fault| fault.key);
            ended.add(
                &topology,
                OutputClass::Fault,
                whose,
                key,
                field,
                [expected, own],
            );
        }
        actual
    }
}

/// What is compared once all is over.
struct Ended {
    kinds: Vec<KindTally>,
    first: Option<((EventKey, u64), Difference)>,
}

impl Ended {
    /// Adds an output that has no flow; `field` is what differs, or empty.
    fn add(
        &mut self,
        topology: &Topology,
        class: OutputClass,
        actor: EntityId,
        key: EventKey,
        field: &'static str,
        [expected, actual]: [Option<Output>; 2],
    ) {
        let mut tally = Tally::default();
        let counted = match (&expected, &actual) {
            _ if field.is_empty() => &mut tally.same,
            (Some(_), Some(_)) => &mut tally.changed,
            (Some(_), None) => &mut tally.missing,
            _ => &mut tally.extra,
        };
        *counted += 1;
        self.kinds.push(KindTally {
            actor: topology.name(actor).to_owned(),
            class,
            kind: String::new(),
            tally,
            left_out: false,
        });
        let order = (key, u64::MAX);
        let is_first = self.first.as_ref().is_none_or(|(first, _)| order < *first);
        if !field.is_empty() && is_first {
            let difference = Difference {
                class,
                actor: topology.name(actor).to_owned(),
                receiver: String::new(),
                kind: String::new(),
                field,
                expected,
                actual,
                event: None,
                input: None,
            };
            self.first = Some((order, difference));
        }
    }
}
