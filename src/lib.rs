//! The Farside kernel: a deterministic discrete-event simulator for teams of robots on bad links.
//!
//! # A simulation of two
//!
//! A base asks a rover how far it has driven; the rover answers; the link between them takes
//! 1.3 s each way, about the distance to the Moon. First the **messages**: serde types, and nothing
//! else. They are written to logs as protobuf, with a descriptor traced from the type.
//!
//! ```
//! use farside::prelude::*;
//! use serde::{Deserialize, Serialize};
//!
//! #[derive(Serialize, Deserialize)]
//! struct Ask;
//!
//! #[derive(Serialize, Deserialize)]
//! struct Odometry {
//!     distance_m: f64,
//! }
//!
//! // An *actor* is a state and a handler for each message it accepts. Handlers run at one instant
//! // of virtual time and reach the world through their context only.
//! struct Rover {
//!     base: Address<Base>,
//! }
//!
//! impl Actor for Rover {
//!     type Accepts = (Ask,);
//! }
//!
//! impl Handler<Ask> for Rover {
//!     fn handle(&mut self, _ask: Ask, ctx: &mut Context<'_, Self>) -> Outcome {
//!         // 5 cm/s since the start, measured with a noisy wheel. The draw is addressed: nothing
//!         // that another actor does can change it.
//!         let slip = ctx.random("wheel_slip").normal(1.0, 0.01);
//!         let distance_m = 0.05 * slip * ctx.now().as_secs_f64();
//!         ctx.send(self.base, Odometry { distance_m });
//!         Ok(())
//!     }
//! }
//!
//! // The base asks once a minute. A *timer* is a message to oneself.
//! struct Base {
//!     answers: u32,
//! }
//!
//! #[derive(Serialize, Deserialize)]
//! struct Minute;
//!
//! impl Actor for Base {
//!     type Accepts = (Minute, Odometry);
//!
//!     fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
//!         ctx.timer(SimDuration::from_secs(60), Minute);
//!         Ok(())
//!     }
//! }
//!
//! impl Handler<Minute> for Base {
//!     fn handle(&mut self, _minute: Minute, ctx: &mut Context<'_, Self>) -> Outcome {
//!         // Actors find each other by name; `?` turns a wrong name into the run's error.
//!         let rover = ctx.lookup::<Rover>("rover_1")?;
//!         ctx.send(rover, Ask);
//!         ctx.timer(SimDuration::from_secs(60), Minute);
//!         Ok(())
//!     }
//! }
//!
//! impl Handler<Odometry> for Base {
//!     fn handle(&mut self, odometry: Odometry, ctx: &mut Context<'_, Self>) -> Outcome {
//!         assert!(odometry.distance_m > 0.0);
//!         self.answers += 1;
//!         if self.answers == 3 {
//!             ctx.stop("three answers are enough");
//!         }
//!         Ok(())
//!     }
//! }
//!
//! // Assemble: actors live on *hosts*; a message between two hosts needs a *link*.
//! let mut sim = Simulation::new(7);
//! let (earth, moon) = (sim.host("earth"), sim.host("moon"));
//! let base = sim.actor(earth, "base", |_name| Base { answers: 0 });
//! sim.actor(moon, "rover_1", move |_name| Rover { base });
//! let one_way = FixedDelay::new(SimDuration::from_millis(1300));
//! sim.link(earth, moon, "earth-moon", one_way.clone());
//! sim.link(moon, earth, "moon-earth", one_way);
//!
//! // Run. The same seed gives the same digest, on any executor, on any machine.
//! let report = sim.run(Executor::Inline).unwrap();
//! assert_eq!(report.counts.delivered, 6);
//! assert_eq!(report.end.name(), "stopped");
//! // Asked at 60, 120 and 180 s; the third answer is there 2.6 s later. A stop takes one
//! // look-ahead (the least delay of any link) to reach every host.
//! assert_eq!(report.end_time, SimTime::from_nanos(183_900_000_000));
//! ```
//!
//! # Its log
//!
//! The kernel writes no files. The crate `farside-logs` has an observer that writes a run to an MCAP
//! file while it goes on, each message with its fate. It takes one line before the run:
//!
//! ```ignore
//! use farside_logs::{LogOptions, LogWriter};
//!
//! sim.observe(LogWriter::create("run.mcap", LogOptions::default())?);
//! let report = sim.run(Executor::Inline)?;
//! ```
//!
//! The digest is the same with it. (Here these lines are shown and not run, because the kernel knows
//! no crate above it.) `experiments/examples/own_actor.rs` is this tutorial as a whole program that
//! logs, and tests run it; `farside info run.mcap` then says what is in the file.
//!
//! # What to know next
//!
//! - [`SimTime`]: time is an integer count of nanoseconds.
//! - [`key::EventKey`]: events have a total order that only their senders' own counters decide.
//! - [`Context`]: everything a handler can do: keyed messages, timers, durable memory, samples.
//! - [`Carrier`]: a link of your own; it sees size, kind, sender and receiver of each message and
//!   decides when it arrives, how often, or why not.
//! - [`Simulation::crash_at`], [`Simulation::tell_at`] and the other control events, which come
//!   before anything else at their instant.
//! - [`Context::recipient`]: an actor looked up by what it accepts, whatever its type.
//! - [`Context::host_transmit_energy_j`]: what links charged all actors of a host.
//! - [`record::Observer`]: watch a run. What observes changes nothing.
//! - [`Executor`]: inline, or on threads; one result.
//! - [`Fault`]: what went wrong, where, when, with which message.
//! - [`scene::Scene`]: what viewers draw of a run.
//!
//! Small programs that show one thing each are in the folder `examples`.

pub mod actor;
pub mod carrier;
mod charge;
mod commit;
mod digest;
pub mod encoding;
mod engine;
mod executor;
pub mod fault;
mod guard;
pub mod ids;
pub mod key;
pub mod pattern;
mod payload;
mod queue;
pub mod random;
pub mod record;
pub mod replay;
pub mod report;
pub mod ruling;
pub mod scene;
mod schedule;
mod simulation;
pub mod suggest;
pub mod time;
mod topology;

pub use actor::{Accepts, Actor, Address, Context, Handler, Recipient};
pub use carrier::{Carriage, Carrier, FixedDelay, Parcel, Verdicts};
pub use digest::Digest;
pub use executor::Executor;
pub use fault::{BuildError, Fault, FaultCause, HandlerError, LookupError, Outcome};
pub use ids::{EntityId, HostId, LinkId, MatchKey, TimerId};
pub use pattern::{BadPattern, Pattern};
pub use payload::Message;
pub use report::{Counts, End, Report};
pub use simulation::Simulation;
pub use time::{SimDuration, SimTime};
pub use topology::{Entity, EntityRole, Kind, PlannedAction, PlannedEvent, RunInfo};

/// Everything that an actor's author needs.
pub mod prelude {
    pub use crate::{
        Actor, Address, Context, Executor, FixedDelay, Handler, HandlerError, HostId, MatchKey,
        Outcome, Recipient, Report, SimDuration, SimTime, Simulation, TimerId,
    };
}
