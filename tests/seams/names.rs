//! Names and types: two types of one serde name are a fault that names both, whoever watches.

use farside::prelude::*;
use farside::{BuildError, End, FaultCause};
use farside_logs::{LogOptions, LogWriter, info};
use serde::{Deserialize, Serialize};

use super::agreed;

mod battery {
    use serde::{Deserialize, Serialize};

    #[derive(Serialize, Deserialize)]
    pub(super) struct State {
        pub(super) charge_j: f64,
    }
}

mod wheels {
    use serde::{Deserialize, Serialize};

    #[derive(Serialize, Deserialize)]
    pub(super) struct State {
        pub(super) slip: f64,
    }
}

#[derive(Serialize, Deserialize)]
struct Tick;

/// Shows its battery each second; from `slips_at` on, its wheels too.
struct Rover {
    slips_at: Option<u64>,
}

impl Actor for Rover {
    type Accepts = (Tick,);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.timer(SimDuration::from_secs(1), Tick);
        Ok(())
    }
}

impl Handler<Tick> for Rover {
    fn handle(&mut self, _tick: Tick, ctx: &mut Context<'_, Self>) -> Outcome {
        match self.slips_at {
            Some(at) if ctx.now() == SimTime::from_secs(at) => {
                ctx.sample(&wheels::State { slip: 0.1 });
            }
            Some(_) => {}
            None => ctx.sample(&battery::State { charge_j: 5.0 }),
        }
        ctx.timer(SimDuration::from_secs(1), Tick);
        Ok(())
    }
}

/// Two rovers that show different states by one name, on hosts that may be engines of their own.
fn two_states(
    heavy: bool,
    first_slips_at: Option<u64>,
    second_slips_at: Option<u64>,
) -> Simulation {
    let mut sim = Simulation::new(3);
    for (name, slips_at) in [("rover_1", first_slips_at), ("rover_2", second_slips_at)] {
        let host = sim.host(name);
        sim.actor(host, name, move |_| Rover { slips_at });
        let uplink = FixedDelay::new(SimDuration::from_secs(10));
        sim.uplink(host, &format!("{name}-all"), uplink);
        if heavy {
            sim.heavy(host);
        }
    }
    sim.stop_at(SimTime::from_secs(30), "half a minute");
    sim
}

fn fault_of(report: Report) -> Box<farside::Fault> {
    match report.end {
        End::Fault(fault) => fault,
        end => panic!("{end:?}"),
    }
}

#[test]
fn two_types_of_samples_with_one_name_end_the_run_and_are_both_named() {
    // Within one window of engines or far apart, and whoever is first.
    for (first, second, at, by) in [
        (None, Some(7), 7, "rover_2"),
        (None, Some(1), 1, "rover_2"),
        (Some(25), None, 25, "rover_1"),
        (Some(1), None, 1, "rover_2"),
    ] {
        let light = agreed(|| two_states(false, first, second));
        let heavy = agreed(|| two_states(true, first, second));
        assert_eq!(light, heavy, "{first:?} {second:?}");
        let fault = fault_of(light);
        assert_eq!(
            (fault.time, fault.actor.as_str()),
            (SimTime::from_secs(at), by)
        );
        let FaultCause::SampleNames {
            name,
            first,
            second,
        } = &fault.cause
        else {
            panic!("{fault}");
        };
        assert_eq!(name, "State");
        let mut types = [first.as_str(), second.as_str()].map(|name| name.rsplit("::").nth(1));
        types.sort();
        assert_eq!(types, [Some("battery"), Some("wheels")], "{fault}");
        assert!(
            fault.to_string().contains("names::battery::State"),
            "{fault}"
        );
    }
    let fine = agreed(|| two_states(true, None, None));
    assert_eq!(fine.end.name(), "stopped");
}

#[test]
fn what_was_logged_until_then_can_be_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.mcap");
    let unwatched = agreed(|| two_states(false, None, Some(7)));
    for (executor, heavy) in [
        (Executor::Inline, false),
        (Executor::Kameo { threads: 2 }, true),
    ] {
        let mut sim = two_states(heavy, None, Some(7));
        let options = LogOptions::default();
        sim.observe(LogWriter::create(&path, options).expect("the log can be created"));
        let watched = sim.run(executor).expect("the model can start");
        assert_eq!(watched, unwatched);
        let log = info(&path).expect("it is a log");
        assert_eq!(log.missing, [""; 0]);
        let run = log.run.expect("of a run");
        assert_eq!(run.end.as_deref(), Some("fault"));
        assert!(
            run.end_detail.contains("wheels::State"),
            "{}",
            run.end_detail
        );
        let states = log.topics.iter().filter(|topic| topic.role == "state");
        let states: Vec<_> = states.map(|t| (t.topic.as_str(), t.messages)).collect();
        // Once a second; the seventh of them sorts before the fault.
        assert_eq!(states, [("/state/rover_1/state", 7)]);
    }
}

struct Deaf;

impl Actor for Deaf {
    type Accepts = (battery::State, wheels::State);
}

impl Handler<battery::State> for Deaf {
    fn handle(&mut self, _state: battery::State, _ctx: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

impl Handler<wheels::State> for Deaf {
    fn handle(&mut self, _state: wheels::State, _ctx: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

#[test]
fn two_types_of_messages_with_one_name_keep_a_run_from_starting() {
    let mut sim = Simulation::new(1);
    let host = sim.host("host");
    sim.actor(host, "deaf", |_| Deaf);
    let error = sim.run(Executor::Inline).unwrap_err();
    let BuildError::DuplicateKind {
        name,
        first,
        second,
    } = &error
    else {
        panic!("{error}");
    };
    assert_eq!(name, "State");
    assert!(
        first.ends_with("battery::State") && second.ends_with("wheels::State"),
        "{error}"
    );
}
