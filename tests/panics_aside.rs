//! Panics of users' code where no handler runs: as a simulation that cannot start is dropped, as actors are
//! built otherwise from an instant on, as types are tried before a run, and in replays.

use std::sync::{Arc, Mutex};

use farside::prelude::*;
use farside::record::Record;
use farside::replay::{Recorded, Replay, ReplayError};
use farside::{BuildError, Carrier, Message, Parcel, Verdicts};
use farside_tests::executors::agreed;
use serde::{Deserialize, Deserializer, Serialize};

/// Panics when it is dropped, if it is armed.
struct Bomb(bool);

impl Drop for Bomb {
    fn drop(&mut self) {
        if std::mem::take(&mut self.0) && !std::thread::panicking() {
            panic!("the bomb went off");
        }
    }
}

/// A message that cannot be read if its number is the unlucky one, nor dropped if it is the touchy one.
#[derive(Serialize)]
struct Ping {
    number: u32,
}

const UNLUCKY: u32 = 1_000_003;
const TOUCHY: u32 = 1_000_007;

impl<'de> Deserialize<'de> for Ping {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(rename = "Ping")]
        struct Plain {
            number: u32,
        }
        let Plain { number } = Plain::deserialize(from)?;
        assert_ne!(number, UNLUCKY, "not to be read");
        Ok(Ping { number })
    }
}

impl Drop for Ping {
    fn drop(&mut self) {
        drop(Bomb(self.number == TOUCHY));
    }
}

struct Base {
    number: u32,
}

impl Actor for Base {
    type Accepts = ();

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        let rover = ctx.lookup::<Rover>("rover")?;
        let number = self.number;
        ctx.send(rover, Ping { number });
        Ok(())
    }
}

struct Rover;

impl Actor for Rover {
    type Accepts = (Ping,);
}

impl Handler<Ping> for Rover {
    fn handle(&mut self, _ping: Ping, _ctx: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

struct Wire(#[expect(dead_code, reason = "there to be dropped")] Bomb);

impl Carrier for Wire {
    type Change = farside::carrier::NoChange;

    fn min_delay(&self) -> SimDuration {
        SimDuration::from_millis(5)
    }

    fn carry(&mut self, _parcel: &Parcel<'_>, verdicts: &mut Verdicts) {
        verdicts.deliver(SimDuration::from_millis(5));
    }

    fn change(&mut self, _change: farside::carrier::NoChange, _now: SimTime) {}
}

/// What of a simulation blows up when it is dropped.
#[derive(Clone, Copy, Default)]
struct Armed {
    constructor: bool,
    link: bool,
    told: bool,
}

/// A base that sends a number to a rover.
fn assemble(sim: &mut Simulation, heavy: bool, number: u32, armed: Armed) -> Address<Rover> {
    let hosts = ["base", "rover"].map(|name| sim.host(name));
    for host in hosts.into_iter().filter(|_| heavy) {
        sim.heavy(host);
    }
    sim.actor(hosts[0], "base", move |_| Base { number });
    let own = Bomb(armed.constructor);
    let rover = sim.actor(hosts[1], "rover", move |_| {
        let _ = &own;
        Rover
    });
    let wire = Wire(Bomb(armed.link));
    sim.link(hosts[0], hosts[1], "base-rover", wire);
    if armed.told {
        let number = TOUCHY;
        sim.tell_at(SimTime::from_secs(90), rover, Ping { number });
    }
    rover
}

const ALL: [Armed; 3] = [
    Armed {
        constructor: true,
        link: false,
        told: false,
    },
    Armed {
        constructor: false,
        link: true,
        told: false,
    },
    Armed {
        constructor: false,
        link: false,
        told: true,
    },
];

#[test]
fn what_cannot_start_is_dropped_and_says_why_it_cannot() {
    for armed in ALL {
        let error = agreed(|heavy| {
            let mut sim = Simulation::new(1);
            assemble(&mut sim, heavy, 1, armed);
            let host = sim.host("base");
            sim.actor(host, "rover", |_| Rover);
            sim
        });
        let error = error.expect_err("a name twice");
        assert!(matches!(error, BuildError::DuplicateName { .. }), "{error}");
    }
}

/// A rover that is built otherwise from 5 s on.
fn rebuilt(heavy: bool) -> Simulation {
    let mut sim = Simulation::new(1);
    assemble(&mut sim, heavy, 1, ALL[0]);
    let mut other = sim.twin();
    assemble(&mut other, heavy, 1, Armed::default());
    let names = sim.rebuild_at(SimTime::from_secs(5), other, |name| name == "rover");
    assert_eq!(names.expect("the same team"), ["rover"]);
    sim
}

#[test]
fn a_constructor_that_is_replaced_is_dropped_under_guard() {
    let report = agreed(rebuilt).expect("it can start");
    let fault = report.fault().expect("a fault");
    assert_eq!(
        (fault.actor.as_str(), fault.time),
        ("rover", SimTime::from_secs(5))
    );
    let told = fault.to_string();
    assert!(
        told.contains("panicked while it was dropped: the bomb went off"),
        "{told}"
    );
}

/// What a replay beside the run of `recorded` says of each record.
fn replayed(
    recorded: Simulation,
    replay: Simulation,
) -> (Vec<String>, farside::replay::ReplayReport) {
    let replay = Replay::new(replay, |name| name == "rover").expect("it can start");
    let replay = Arc::new(Mutex::new((replay, Vec::new())));
    let feeding = replay.clone();
    let mut sim = recorded;
    sim.observe(move |record: &Record<'_>| {
        let mut held = feeding.lock().unwrap();
        if let Err(error) = held.0.feed(&Recorded::from(record)) {
            assert!(matches!(error, ReplayError::Body { .. }), "{error}");
            held.1.push(error.to_string());
        }
    });
    let report = sim.run(Executor::Inline).expect("it can start");
    let (replay, errors) = Arc::into_inner(replay).unwrap().into_inner().unwrap();
    let end = farside::replay::RecordEnd::Completed {
        at: report.end_time,
    };
    (errors, replay.finish(end))
}

#[test]
fn what_a_replay_has_no_use_for_is_dropped_without_a_word() {
    let plain = || {
        let mut sim = Simulation::new(1);
        assemble(&mut sim, false, 1, Armed::default());
        sim
    };
    for armed in &ALL[1..] {
        let mut sim = Simulation::new(1);
        assemble(&mut sim, false, 1, *armed);
        let (errors, report) = replayed(plain(), sim);
        assert_eq!((errors, report.total().differing()), (Vec::new(), 0));
    }
    // Built otherwise in the middle: what the run that is replayed had of that is its own affair.
    let mut recorded = Simulation::new(1);
    assemble(&mut recorded, false, 1, Armed::default());
    let mut other = recorded.twin();
    assemble(&mut other, false, 1, Armed::default());
    let names = recorded.rebuild_at(SimTime::from_secs(5), other, |name| name == "rover");
    assert_eq!(names.expect("the same team"), ["rover"]);
    let (errors, report) = replayed(recorded, rebuilt(false));
    assert_eq!((errors, report.total().differing()), (Vec::new(), 0));
}

#[test]
fn a_recorded_message_that_panics_as_it_is_read_is_named() {
    let build = || {
        let mut sim = Simulation::new(1);
        assemble(&mut sim, false, UNLUCKY, Armed::default());
        sim
    };
    let (errors, _) = replayed(build(), build());
    assert_eq!(errors.len(), 1, "{errors:?}");
    assert!(
        errors[0].contains("rover")
            && errors[0].contains("panicked: ")
            && errors[0].contains("not to be read"),
        "{errors:?}"
    );
}

/// Some of its values cannot be read, and one of them is what it takes where the field is missing.
struct Picky {
    number: u32,
}

fn seven() -> u32 {
    7
}

impl Serialize for Picky {
    fn serialize<S: serde::Serializer>(&self, out: S) -> Result<S::Ok, S::Error> {
        use serde::ser::SerializeStruct;
        let mut picky = out.serialize_struct("Picky", 1)?;
        // Odd: what it writes it does not read.
        picky.serialize_field("number", &(self.number | 1))?;
        picky.end()
    }
}

impl<'de> Deserialize<'de> for Picky {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(rename = "Picky")]
        struct Plain {
            #[serde(default = "seven")]
            number: u32,
        }
        let Plain { number } = Plain::deserialize(from)?;
        assert_eq!(number % 2, 0, "not to be read");
        Ok(Picky { number })
    }
}

/// What it takes where the field is missing cannot be dropped.
#[derive(Serialize, Deserialize)]
struct Touchy {
    #[serde(default = "seven")]
    number: u32,
}

impl Drop for Touchy {
    fn drop(&mut self) {
        drop(Bomb(self.number == 7));
    }
}

struct Mute<T>(std::marker::PhantomData<fn() -> T>);

impl<T: Message> Actor for Mute<T> {
    type Accepts = (T,);
}

impl<T: Message> Handler<T> for Mute<T> {
    fn handle(&mut self, _message: T, _ctx: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

fn heard<T: Message>() -> Result<Report, BuildError> {
    agreed(|heavy| {
        let mut sim = Simulation::new(1);
        let host = sim.host("a");
        if heavy {
            sim.heavy(host);
        }
        sim.actor(host, "a", |_| Mute::<T>(std::marker::PhantomData));
        sim
    })
}

/// Values that are tried before a run are none that a run has: that one panics is no fault.
#[test]
fn a_type_is_tried_under_guard() {
    for report in [heard::<Picky>(), heard::<Touchy>()] {
        let report = report.expect("it can start");
        assert_eq!(report.end.name(), "completed");
    }
}
