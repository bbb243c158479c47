//! A plan runner without actors: what it takes, refuses, faults and says again.

use std::sync::Arc;

use farside_planning::language::{Options, read_model};

use super::*;
use crate::register::{ContractEnd, Controlling, RegisterValue};
use crate::service::temporal::{Temporal, TemporalOptions};

/// An agent that hands goals on: from `Up_SV` to `Down_SV`, and statuses back.
const TEXT: &str = "
(Define_Model agent :profile executive)
(Define_Object_Class Agent :state_variables ((Goal Up_SV) (Executable Down_SV)))
(Define_Type Status (ok failed TIMEOUT PREEMPTED FAULT))
(Define_Type Place [0 9])
(Define_Predicate Idle ())
(Define_Predicate Go ((Place ?x) -> (Status ?status)))
(Define_Member_Values (Agent Up_SV) (Idle Go) :default (Idle ()))
(Define_Member_Values (Agent Down_SV) (Idle Go) :default (Idle ()))
(Define_Compatibility
 (SINGLE ((Agent Up_SV) ((Go (?x -> ?status)))))
 :duration_bounds [1 1000]
 :compatibility_spec (starts (SINGLE ((Agent Down_SV) ((Go (?x -> ?s)))))))
(Define_Compatibility
 (SINGLE ((Agent Down_SV) ((Go (?x -> ?status)))))
 :duration_bounds [1 100]
 :compatibility_spec
 (OR
  (ends :condition (SINGLE ((Agent Up_SV) ((Go (?x -> ?status))))))
  (ends_during :condition (SINGLE ((Agent Up_SV) ((Idle ())))))))
(Define_Compatibility
 (SINGLE ((Agent Down_SV) ((Go (9 -> ?status)))))
 :compatibility_spec (starts :condition (SINGLE ((Agent Up_SV) ((Idle ()))))))
";

const ABOVE: usize = 0;
const BELOW: usize = 1;
const BACKOFF: Backoff = Backoff {
    first: SimDuration::from_secs(4),
    most: SimDuration::from_secs(30),
};

struct Bench {
    runner: Runner,
    memory: Vec<Controlled>,
    tick: u64,
    above: Controlling,
}

impl Bench {
    fn new(budget: u64, lease: SimDuration) -> Self {
        Bench::begun_at(0, budget, lease)
    }

    fn begun_at(tick: u64, budget: u64, lease: SimDuration) -> Self {
        let model = read_model("agent.ddl", TEXT, &Options::default()).ok();
        let model = Arc::new(model.unwrap_or_else(|findings| panic!("{findings}")));
        let timeline = |name: &str| {
            let found = model.timelines.iter().position(|one| one.name == name);
            found.expect("it is declared")
        };
        let register = |name: &str, at: &str, side, peer| RegisterSetup {
            name: name.into(),
            timeline: timeline(at),
            side,
            peer,
            lease,
            is_polled: false,
        };
        let registers = [
            register("up", "Up_SV", Side::Controlled, ABOVE),
            register("down", "Down_SV", Side::Controlling, BELOW),
        ];
        let settings = RunnerSettings {
            latency: SimDuration::from_millis(500),
            horizon: 1,
            budget,
            overhead: 0,
            aborts: 2,
            backoff: BACKOFF,
            forgets: true,
        };
        let service = Temporal::new(model, TemporalOptions::default()).expect("it fits");
        let begun = SimTime::ZERO + settings.latency * tick;
        let runner = Runner::new(settings, Box::new(service), &registers, 1, begun);
        let runner = runner.expect("they are right");
        Bench {
            memory: runner.memory(),
            runner,
            tick,
            above: Controlling::new("up".into(), 1, BACKOFF),
        }
    }

    fn now(&self) -> SimTime {
        SimTime::ZERO + SimDuration::from_millis(500) * self.tick
    }

    /// A cycle, at the next tick.
    fn cycle(&mut self) -> Cycle {
        let cycle = self.runner.cycle(self.tick, self.now(), &mut self.memory);
        self.tick += 1;
        cycle
    }

    /// Something arrives shortly before the next tick.
    fn arrive(&mut self, peer: usize, what: Arrival) {
        let at = SimTime::from_nanos(self.now().as_nanos() - 1000);
        self.runner.arrive(at, peer, what);
    }

    /// A goal from above, and the load that goes down for it.
    fn goal(&mut self, x: i64) -> RegisterLoad {
        let inputs = vec![RegisterValue::Number(x)];
        let load = self.above.load("Go".into(), inputs, self.now());
        self.arrive(ABOVE, Arrival::Load(load));
        let cycle = self.cycle();
        let mut loads = cycle.out.into_iter().filter_map(|out| match out {
            Out::Load(BELOW, load, 0) => Some(load),
            _ => None,
        });
        loads.next().expect("it is handed on")
    }

    /// What comes from below of a load.
    fn status(&mut self, load: &RegisterLoad, outputs: Vec<Option<RegisterValue>>) -> Cycle {
        self.arrive(
            BELOW,
            Arrival::Status(RegisterStatus {
                register: "down".into(),
                epoch: load.epoch,
                number: load.number,
                revision: 0,
                outputs,
                end: ContractEnd::Ended,
            }),
        );
        self.cycle()
    }
}

fn symbol(name: &str) -> Option<RegisterValue> {
    Some(RegisterValue::Symbol(name.into()))
}

/// What a cycle says to those above.
fn answers(cycle: &Cycle) -> Vec<&RegisterStatus> {
    let said = cycle.out.iter().filter_map(|out| match out {
        Out::Status(ABOVE, status, _) => Some(status),
        _ => None,
    });
    said.collect()
}

const FOR_EVER: SimDuration = SimDuration::ZERO;

#[test]
fn a_goal_goes_down_and_its_status_comes_back() {
    let mut bench = Bench::new(10_000, FOR_EVER);
    bench.cycle();
    let load = bench.goal(3);
    assert_eq!(
        (&*load.procedure, &load.inputs[..]),
        ("Go", &[RegisterValue::Number(3)][..])
    );
    let cycle = bench.status(&load, vec![symbol("ok")]);
    assert_eq!(answers(&cycle)[0].outputs, [symbol("ok")]);
    assert_eq!((cycle.stale, cycle.faults.len()), (0, 0));
}

#[test]
fn what_means_nothing_is_refused_with_the_reason() {
    let mut bench = Bench::new(10_000, FOR_EVER);
    bench.cycle();
    for (procedure, inputs, reason) in [
        ("Fly", vec![], "Up_SV does not say Fly"),
        ("Go", vec![], "Go: expected 1 inputs, found 0"),
        (
            "Go",
            vec![RegisterValue::Number(10)],
            "Go: ?x: expected a Place, found 10",
        ),
        (
            "Go",
            vec![RegisterValue::Truth(true)],
            "Go: ?x: expected a Place, found true",
        ),
    ] {
        let load = bench.above.load(procedure.into(), inputs, bench.now());
        bench.arrive(ABOVE, Arrival::Load(load));
        let cycle = bench.cycle();
        let end = &answers(&cycle)[0].end;
        let ContractEnd::Refused { reason: said } = end else {
            panic!("{procedure}: {end:?}");
        };
        assert!(
            said.replace("?x", "x").contains(&reason.replace("?x", "x")),
            "{said}"
        );
        // What it said goes on.
        assert!(cycle.begun.is_empty());
    }
    let elsewhere = RegisterLoad {
        register: "sideways".into(),
        ..bench.above.load("Go".into(), vec![], bench.now())
    };
    bench.arrive(ABOVE, Arrival::Load(elsewhere));
    assert!(bench.cycle().faults[0].contains("sideways, which is no register of mine"));
}

#[test]
fn a_status_of_the_wrong_type_faults_its_contract() {
    for outputs in [
        vec![symbol("splendid")],
        vec![Some(RegisterValue::Number(1))],
        vec![None; 3],
    ] {
        let mut bench = Bench::new(10_000, FOR_EVER);
        bench.cycle();
        let load = bench.goal(3);
        let cycle = bench.status(&load, outputs);
        assert_eq!(cycle.faults.len(), 1, "{:?}", cycle.faults);
        assert_eq!(answers(&cycle)[0].outputs, [symbol("FAULT")]);
    }
}

#[test]
fn a_status_of_a_contract_that_is_over_is_stale() {
    let mut bench = Bench::new(10_000, FOR_EVER);
    bench.cycle();
    let first = bench.goal(3);
    let second = bench.goal(4);
    let cycle = bench.status(&first, vec![symbol("ok")]);
    assert_eq!((cycle.stale, answers(&cycle).len()), (1, 0));
    let cycle = bench.status(&second, vec![symbol("failed")]);
    assert_eq!(answers(&cycle)[0].outputs, [symbol("failed")]);
    // Once more: nothing new, but acknowledged.
    let cycle = bench.status(&second, vec![symbol("ok")]);
    assert!(answers(&cycle).is_empty());
    assert!(
        cycle
            .out
            .iter()
            .any(|out| matches!(out, Out::Ack(BELOW, _)))
    );
}

#[test]
fn cycles_beyond_the_budget_are_aborted_and_too_many_in_a_row_are_a_fault() {
    let mut bench = Bench::new(1, FOR_EVER);
    for aborted in 1..=3 {
        let cycle = bench.cycle();
        assert_eq!(cycle.verdict, Verdict::Aborted);
        assert!(cycle.begun.is_empty());
        assert_eq!(bench.runner.is_overrun(), aborted > 2);
    }
}

#[test]
fn who_is_not_heard_of_within_its_lease_is_faulted_and_taken_back() {
    let lease = SimDuration::from_secs(3);
    let mut bench = Bench::new(10_000, lease);
    bench.cycle();
    bench.goal(3);
    let mut said = Vec::new();
    for _ in 0..12 {
        let cycle = bench.cycle();
        said.extend(cycle.faults.clone());
        if !answers(&cycle).is_empty() {
            break;
        }
    }
    assert!(
        said[0].contains("down: Go was not heard of within its lease"),
        "{said:?}"
    );
    // While it waits, it says something itself at least every third of the lease.
    let mut bench = Bench::new(10_000, lease);
    bench.cycle();
    let load = bench.goal(3);
    let mut silent = 0;
    for _ in 0..40 {
        bench.arrive(
            BELOW,
            Arrival::Ack(Controlled::new("down".into(), BACKOFF).ack()),
        );
        let ack = RegisterAck {
            number: load.number,
            ..Controlled::new("up".into(), BACKOFF).ack()
        };
        bench.arrive(ABOVE, Arrival::Ack(ack));
        let cycle = bench.cycle();
        assert!(cycle.faults.is_empty(), "{:?}", cycle.faults);
        silent = match cycle.out.iter().any(|out| out.peer() == BELOW) {
            true => 0,
            false => silent + 1,
        };
        assert!(silent < 3, "silent for {silent} ticks");
    }
}

/// Those below are heard of, and who wanted it is not.
#[test]
fn what_somebody_wanted_who_is_not_heard_of_is_taken_back() {
    let mut bench = Bench::new(10_000, SimDuration::from_secs(3));
    bench.cycle();
    let load = bench.goal(3);
    let mut cycles = 0;
    let cycle = loop {
        let ack = RegisterAck {
            number: load.number,
            ..Controlled::new("down".into(), BACKOFF).ack()
        };
        bench.arrive(BELOW, Arrival::Ack(ack));
        let cycle = bench.cycle();
        cycles += 1;
        if !cycle.faults.is_empty() {
            break cycle;
        }
        assert!(cycles < 12);
    };
    assert_eq!(
        cycle.faults,
        ["up: Go taken back: who wanted it was not heard of within its lease"]
    );
    assert_eq!(answers(&cycle)[0].outputs, [symbol("PREEMPTED")]);
}

#[test]
fn leases_begin_with_a_life() {
    let mut bench = Bench::begun_at(1_000, 10_000, SimDuration::from_secs(3));
    bench.cycle();
    bench.goal(3);
    assert_eq!(bench.cycle().faults, [""; 0]);
}

/// A load is acknowledged as often as it comes, and begins once; what came of it is said until who
/// wanted it has heard it.
#[test]
fn each_repetition_of_a_load_is_answered() {
    let mut bench = Bench::new(10_000, FOR_EVER);
    bench.cycle();
    let go = vec![RegisterValue::Number(3)];
    let load = bench.above.load("Go".into(), go, bench.now());
    let acks = |cycle: &Cycle| {
        let is_ack = |out: &&Out| matches!(out, Out::Ack(ABOVE, ack) if ack.number == 1);
        cycle.out.iter().filter(is_ack).count()
    };
    bench.arrive(ABOVE, Arrival::Load(load.clone()));
    let begun = bench.cycle();
    assert_eq!((acks(&begun), begun.goals), (1, 1));
    bench.arrive(ABOVE, Arrival::Load(load.clone()));
    let again = bench.cycle();
    assert_eq!((acks(&again), again.goals, again.begun.len()), (1, 0, 0));
    bench.arrive(BELOW, Arrival::Load(load.clone()));
    let strange = bench.cycle();
    assert!(strange.faults[0].contains("no register of mine"));
    assert_eq!(acks(&strange), 0);
    let mut down = begun.out.iter().filter_map(|out| match out {
        Out::Load(BELOW, load, 0) => Some(load),
        _ => None,
    });
    let down = down.next().expect("it is handed on").clone();
    let ended = bench.status(&down, vec![symbol("ok")]);
    let status = answers(&ended)[0].clone();
    bench.arrive(ABOVE, Arrival::Load(load));
    assert_eq!(answers(&bench.cycle()), [&status]);
    let said = |bench: &mut Bench, cycles: usize| {
        (0..cycles)
            .map(|_| answers(&bench.cycle()).len())
            .sum::<usize>()
    };
    // After 4 s, and after another 8 s.
    assert_eq!(said(&mut bench, 8), 1);
    let ack = Controlling::ack(&status);
    bench.arrive(BELOW, Arrival::Ack(ack.clone()));
    assert_eq!(said(&mut bench, 20), 1);
    bench.arrive(ABOVE, Arrival::Ack(ack));
    assert_eq!(said(&mut bench, 100), 0);
}

/// Whichever of two that come at one instant is handled first; what comes with a tick waits.
#[test]
fn a_cycle_reads_what_came_before_it_in_the_order_of_numbers() {
    for is_swapped in [false, true] {
        let mut bench = Bench::new(10_000, FOR_EVER);
        bench.cycle();
        let mut loads = [3, 4].map(|x| {
            let go = vec![RegisterValue::Number(x)];
            bench.above.load("Go".into(), go, bench.now())
        });
        if is_swapped {
            loads.reverse();
        }
        for load in loads {
            bench.arrive(ABOVE, Arrival::Load(load));
        }
        let go = vec![RegisterValue::Number(5)];
        let third = bench.above.load("Go".into(), go, bench.now());
        let now = bench.now();
        bench.runner.arrive(now, ABOVE, Arrival::Load(third));
        assert_eq!(bench.cycle().goals, 2, "{is_swapped}");
        assert_eq!(bench.cycle().goals, 1, "{is_swapped}");
    }
}

/// What is asked for is what it says by itself: that goes on.
#[test]
fn a_default_that_is_asked_for_goes_on() {
    let mut bench = Bench::new(10_000, FOR_EVER);
    bench.cycle();
    let load = bench.above.load("Idle".into(), Vec::new(), bench.now());
    bench.arrive(ABOVE, Arrival::Load(load));
    let cycle = bench.cycle();
    assert_eq!(
        (cycle.goals, cycle.begun.len(), cycle.ended.len()),
        (1, 0, 0)
    );
    assert!(matches!(cycle.out[..], [Out::Ack(ABOVE, _)]));
}

#[test]
fn only_aborts_in_a_row_are_a_fault() {
    let mut bench = Bench::new(10_000, FOR_EVER);
    bench.cycle();
    for _ in 0..3 {
        for budget in [1, 1, 10_000] {
            bench.runner.settings.budget = budget;
            // What it is told has to be decided.
            let go = vec![RegisterValue::Number(3)];
            let load = bench.above.load("Go".into(), go, bench.now());
            bench.arrive(ABOVE, Arrival::Load(load));
            let is_aborted = bench.cycle().verdict == Verdict::Aborted;
            assert_eq!(is_aborted, budget == 1);
            assert!(!bench.runner.is_overrun());
        }
    }
}

#[test]
fn an_agent_that_is_off_line_loses_its_contracts() {
    for (peer, is_above) in [(ABOVE, true), (BELOW, false)] {
        let mut bench = Bench::new(10_000, FOR_EVER);
        bench.cycle();
        bench.goal(3);
        bench.arrive(
            peer,
            Arrival::Offline(AgentOffline {
                agent: "it".into(),
                epoch: 1,
                tick: 7,
                reason: "it was late".to_owned(),
            }),
        );
        let cycle = bench.cycle();
        assert!(
            cycle.faults[0].contains("it was late"),
            "{:?}",
            cycle.faults
        );
        let outputs = &answers(&cycle)[0].outputs;
        assert_eq!(
            outputs[..],
            [symbol(if is_above { "PREEMPTED" } else { "FAULT" })]
        );
    }
}

#[test]
fn where_the_model_allows_nothing_the_compatibility_is_named() {
    let mut bench = Bench::new(10_000, FOR_EVER);
    bench.cycle();
    let load = bench
        .above
        .load("Go".into(), vec![RegisterValue::Number(9)], bench.now());
    bench.arrive(ABOVE, Arrival::Load(load));
    let cycle = bench.cycle();
    let Verdict::NoPlan(why) = &cycle.verdict else {
        panic!("{:?}", cycle.verdict);
    };
    assert!(
        why.compatibility.contains("agent.ddl:") && why.compatibility.contains("Go"),
        "{why}"
    );
    assert!(cycle.begun.is_empty() && answers(&cycle).is_empty());
}
