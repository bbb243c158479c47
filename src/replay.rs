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
mod ending;
mod feeding;
mod report;
mod trail;

use std::collections::VecDeque;
use std::sync::Arc;

use thiserror::Error;

pub use crate::charge::{Charge, ChargeJournal, ChargedMessage};
pub use report::{Difference, KindTally, Output, OutputClass, ReplayReport, Step, Steps, Tally};

use crate::carrier::Carriage;
use crate::engine::{Class, Engine, Factory, Head, Pending, Sealed, Side as Beside};
use crate::fault::{BuildError, Fault};
use crate::ids::{EntityId, MatchKey};
use crate::key::{Bound, EventKey};
use crate::record::{Record, RecordClass};
use crate::simulation::Simulation;
use crate::time::SimTime;
use crate::topology::{RunInfo, Topology};

use charges::{Absent, OnSending};
use compare::Comparer;

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
}
