//! Told actors: control events that hand an actor a message.

use std::path::Path;

use farside::encoding::Schema;
use farside::prelude::*;
use farside::record::RecordClass;
use farside::{BuildError, End, LookupError};
use farside_logs::{DiffOptions, Log, LogOptions, LogWriter, Verifier, VerifyOutcome, diff, info};
use farside_tests::chatter::Chatter;
use proptest::prelude::*;
use serde::{Deserialize, Serialize};

use super::agreed;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Goal {
    east_m: f64,
}

#[derive(Serialize, Deserialize)]
struct Slowdown {
    factor: f64,
}

#[derive(Serialize, Deserialize)]
struct Arrived {
    east_m: f64,
}

/// Passes its goals on to the base, which is far away.
struct Rover;

impl Actor for Rover {
    type Accepts = (Goal, Slowdown);
}

impl Handler<Goal> for Rover {
    fn handle(&mut self, goal: Goal, ctx: &mut Context<'_, Self>) -> Outcome {
        let base = ctx.recipient::<Arrived>("base")?;
        let Goal { east_m } = goal;
        ctx.send(base, Arrived { east_m });
        Ok(())
    }
}

impl Handler<Slowdown> for Rover {
    fn handle(&mut self, slowdown: Slowdown, _ctx: &mut Context<'_, Self>) -> Outcome {
        match slowdown.factor > 0.0 {
            true => Ok(()),
            false => Err(HandlerError::new("a processor that never ends")),
        }
    }
}

struct Base;

impl Actor for Base {
    type Accepts = (Arrived,);
}

impl Handler<Arrived> for Base {
    fn handle(&mut self, _arrived: Arrived, _ctx: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

/// Handles a message that it does not list.
struct Forgetful;

impl Actor for Forgetful {
    type Accepts = ();
}

impl Handler<Goal> for Forgetful {
    fn handle(&mut self, _goal: Goal, _ctx: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

fn noon() -> SimTime {
    SimTime::from_secs(43_200)
}

/// A rover that is told to go east at noon, crashes at one, is told in vain at two, is back at
/// three and told once more at four.
fn told(second_goal_m: f64) -> Simulation {
    let hours = |hours: u64| noon() + SimDuration::from_secs(3_600 * hours);
    let mut sim = Simulation::new(5);
    let (mars, earth) = (sim.host("mars"), sim.host("earth"));
    let rover = sim.actor(mars, "rover_01", |_| Rover);
    sim.actor(earth, "base", |_| Base);
    sim.heavy(earth);
    sim.link(
        mars,
        earth,
        "mars-earth",
        FixedDelay::new(SimDuration::from_secs(600)),
    );
    sim.tell_at(noon(), rover, Goal { east_m: 1.0 });
    sim.tell_at(noon(), rover, Slowdown { factor: 50.0 });
    sim.crash_at(hours(1), rover);
    sim.tell_at(hours(2), rover, Goal { east_m: 2.0 });
    sim.restart_at(hours(3), rover);
    let goal = Goal {
        east_m: second_goal_m,
    };
    sim.tell_named_at(hours(4), "rover_01", goal)
        .expect("there is a rover");
    sim
}

fn log_to(path: &Path, second_goal_m: f64) -> Report {
    let mut sim = told(second_goal_m);
    let writer = LogWriter::create(path, LogOptions::default()).expect("the log can be created");
    sim.observe(writer);
    sim.run(Executor::Inline).expect("the model can start")
}

#[test]
fn a_told_message_is_recorded_and_part_of_the_digest() {
    let report = agreed(|| told(3.0));
    // Two starts, four tells, a crash, a restart, two arrivals: what the crashed rover was told it
    // passed on to nobody.
    assert_eq!((report.counts.events, report.counts.delivered), (10, 2));
    assert_ne!(report.digest, agreed(|| told(4.0)).digest);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("told.mcap");
    assert_eq!(log_to(&path, 3.0), report, "watched or not");
    let schema = Schema::of::<Goal>().expect("it can be described");
    let mut seen = Vec::new();
    let mut records = Log::open(&path)
        .and_then(|log| log.records())
        .expect("it is a log");
    while let Some((record, channel)) = records.next_ref().expect("it is whole") {
        if record.class != RecordClass::Told {
            continue;
        }
        assert!(channel.topic.starts_with("/event/told/"));
        let ends = (record.sender, record.receiver, record.key.source);
        assert_eq!(ends, ("@control", "rover_01", "@control"));
        if record.kind == "Goal" {
            let goal: Goal = schema.decode(record.body).expect("it is a goal");
            seen.push((
                record.key.time_ns / 3_600_000_000_000,
                record.ordinal,
                goal.east_m,
            ));
        }
    }
    assert_eq!(seen, [(12, 0, 1.0), (14, 1, 2.0), (16, 2, 3.0)]);
}

#[test]
fn info_verify_and_diff_know_what_was_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let (a, b) = (folder.path().join("a.mcap"), folder.path().join("b.mcap"));
    log_to(&a, 3.0);
    log_to(&b, 4.0);
    let topics = info(&a).expect("it is a log").topics;
    let topics = topics
        .iter()
        .filter(|topic| topic.topic.starts_with("/event/told/"));
    let topics: Vec<_> = topics
        .map(|topic| (topic.schema.as_str(), topic.messages))
        .collect();
    let expected = [("farside.record.Goal", 3), ("farside.record.Slowdown", 1)];
    assert_eq!(topics, expected);

    let verify = |second_goal_m| {
        let verifier = Verifier::open(&a).expect("it is a log");
        let handle = verifier.handle();
        let mut sim = told(second_goal_m);
        sim.observe(verifier);
        sim.run(Executor::Inline).expect("the model can start");
        handle.outcome().expect("the run is over")
    };
    assert!(matches!(verify(3.0), VerifyOutcome::Same { .. }));
    let VerifyOutcome::Different { first, .. } = verify(4.0) else {
        panic!("another goal is another run");
    };
    assert!(
        format!("{first:?}").contains("/event/told/goal"),
        "{first:?}"
    );

    let report = diff(&a, &b, &DiffOptions::default()).expect("they can be compared");
    let first = report.first.expect("they differ");
    let found = (first.topic.as_str(), first.field.as_str(), first.time_s);
    assert_eq!(found, ("/event/told/goal", "body.east_m", 57_600.0));
    assert_eq!((first.a.as_str(), first.b.as_str()), ("3", "4"));
}

#[test]
fn who_cannot_be_told_is_named_with_what_can() {
    let mut sim = told(3.0);
    let unknown = sim.tell_named_at(noon(), "rover_10", Goal { east_m: 1.0 });
    assert_eq!(
        unknown.unwrap_err().to_string(),
        "no actor is called \"rover_10\"; did you mean \"rover_01\"?"
    );
    let refused = sim.tell_named_at(noon(), "rover_01", Arrived { east_m: 1.0 });
    let BuildError::Lookup(LookupError::NotAccepted { accepts, .. }) = refused.unwrap_err() else {
        panic!("the rover accepts no arrivals");
    };
    assert!(
        accepts[0].ends_with("Goal") && accepts[1].ends_with("Slowdown"),
        "{accepts:?}"
    );
    // Handled and not listed: found before the start.
    let host = sim.host("mars");
    let forgetful = sim.actor(host, "forgetful", |_| Forgetful);
    sim.tell_at(noon(), forgetful, Goal { east_m: 1.0 });
    let error = sim.run(Executor::Inline).unwrap_err().to_string();
    assert!(
        error.starts_with("forgetful is a ") && error.ends_with("it accepts no messages"),
        "{error}"
    );
}

#[test]
fn a_handler_that_fails_when_told_ends_the_run_there() {
    let report = agreed(|| {
        let mut sim = told(3.0);
        let wrong = Slowdown { factor: 0.0 };
        sim.tell_named_at(noon(), "rover_01", wrong)
            .expect("there is a rover");
        sim
    });
    let End::Fault(fault) = report.end else {
        panic!("{:?}", report.end);
    };
    assert_eq!((fault.time, fault.actor.as_str()), (noon(), "rover_01"));
    assert_eq!(fault.message.as_deref(), Some("Slowdown from @control"));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    /// Any schedule of tells, crashes and restarts gives one result on both executors.
    #[test]
    fn any_schedule_of_tells_has_one_result(
        seed in any::<u64>(),
        tells in prop::collection::vec((any::<u8>(), 0u64..60, 0u8..4), 1..20),
        controls in prop::collection::vec((any::<u8>(), 0u64..60, any::<bool>()), 0..20),
        shared in any::<bool>(),
        min_delay_ns in 0u64..6,
    ) {
        let model = Chatter {
            seed,
            tie_seed: None,
            hosts: vec![2, 1, 2, 1],
            min_delay_ns,
            jitter_ns: 3,
            loss_16: 2,
            copies_16: 2,
            holds_16: 2,
            shared,
            controls,
            hosts_energy: true,
            tells,
            stop_after: 0,
            fail_after: 0,
            until_ns: 60,
        };
        agreed(|| model.build());
    }
}
