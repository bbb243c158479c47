//! A mission agent's plan runner with its planner, without actors: whatever comes when, the system
//! agent is given one goal at a time, none twice, and none that was taken back.

mod crashes;

use std::sync::{Arc, Mutex};

use farside::{SimDuration, SimTime};

use super::*;
use crate::deliberator::SharedDeliberator;
use crate::models;
use crate::register::{
    Backoff, ContractEnd, Controlled, Controlling, Heard, RegisterLoad, RegisterStatus,
    RegisterValue, Taken,
};
use crate::runner::{Arrival, Cycle, Out, RegisterSetup, Runner, RunnerSettings, Side};
use crate::service::temporal::{Temporal, TemporalOptions};

const GROUND: usize = 0;
const SYSTEM: usize = 1;
const BACKOFF: Backoff = Backoff {
    first: SimDuration::from_secs(1000),
    most: SimDuration::from_secs(1000),
};
const ATTEMPTS: u32 = 3;

struct Bench {
    runner: Runner,
    memory: Vec<Controlled>,
    planner: SharedDeliberator,
    life: u32,
    tick: u64,
    /// What the ground says, later and later.
    ground: Controlling,
    /// How many operations of deliberation there is time for in a tick.
    pace: Option<u64>,
    /// What the system agent was told last, and where all its goals were.
    told: Option<RegisterLoad>,
    places: Vec<i64>,
}

fn runner(life: u32, planner: &SharedDeliberator, backoff: Backoff) -> Runner {
    let mission = models::mission();
    let register = |name: &str, timeline, side, peer| RegisterSetup {
        name: name.into(),
        timeline,
        side,
        peer,
        lease: SimDuration::ZERO,
        is_polled: false,
    };
    let at = mission.timelines;
    let registers = [
        register("ground", at.ground, Side::Controlled, GROUND),
        register("goal", at.goal, Side::Controlling, SYSTEM),
    ];
    let settings = RunnerSettings {
        latency: SimDuration::from_millis(500),
        horizon: 1,
        budget: 100_000,
        overhead: 0,
        aborts: 0,
        backoff,
        forgets: true,
    };
    let service = Temporal::new(mission.model.clone(), TemporalOptions::default());
    let service = Box::new(service.expect("all timelines are states"));
    let runner = Runner::new(settings, service, &registers, life, SimTime::ZERO);
    let runner = runner.expect("they are right");
    runner.with_deliberator(planner.clone())
}

/// The inputs of a request for a goal.
fn request(goal: i64) -> Vec<RegisterValue> {
    let numbers = [goal, 100 * goal, 0, 10, -10].map(RegisterValue::Number);
    let camera = RegisterValue::Symbol("wide_eye".into());
    let rest = [camera, RegisterValue::Number(0)];
    numbers.into_iter().chain(rest).collect()
}

impl Bench {
    fn new() -> Bench {
        let mission = models::mission().clone();
        let planner = MissionPlanner::new(mission, Settings::default(), ATTEMPTS, [0, 0]);
        let planner: SharedDeliberator = Arc::new(Mutex::new(planner));
        let runner = runner(1, &planner, BACKOFF);
        let mut bench = Bench {
            memory: runner.memory(),
            runner,
            planner,
            life: 1,
            tick: 0,
            ground: Controlling::new("ground".into(), 1, BACKOFF),
            pace: None,
            told: None,
            places: Vec::new(),
        };
        bench.cycle();
        bench
    }

    fn now(&self) -> SimTime {
        SimTime::ZERO + SimDuration::from_millis(500) * self.tick
    }

    /// A cycle, and the deliberation behind it.
    fn cycle(&mut self) -> Cycle {
        let cycle = self.runner.cycle(self.tick, self.now(), &mut self.memory);
        self.runner.deliberate(self.pace);
        for out in &cycle.out {
            if let Out::Load(SYSTEM, load, 0) = out {
                self.told = Some(load.clone());
                if let Some(place) = self.doing() {
                    self.places.push(place);
                }
            }
        }
        self.tick += 1;
        cycle
    }

    fn cycles(&mut self, count: u64) {
        (0..count).for_each(|_| drop(self.cycle()));
    }

    /// Where the goal is that the system agent was told to do.
    fn doing(&self) -> Option<i64> {
        let told = self.told.as_ref()?;
        match (&*told.procedure, told.inputs.first()) {
            ("ImageAt", Some(RegisterValue::Number(x))) => Some(*x),
            _ => None,
        }
    }

    fn arrive(&mut self, peer: usize, what: Arrival) {
        let at = SimTime::from_nanos(self.now().as_nanos().saturating_sub(1000));
        self.runner.arrive(at, peer, what);
    }

    /// The ground asks for a goal, or takes it back.
    fn ground(&mut self, procedure: &str, goal: i64) {
        let mut inputs = request(goal);
        if procedure == "Recall" {
            inputs.pop();
        }
        let load = self.ground.load(procedure.into(), inputs, self.now());
        self.arrive(GROUND, Arrival::Load(load));
    }

    /// Goals are asked for, one a tick.
    fn request(&mut self, goals: std::ops::RangeInclusive<i64>) {
        for goal in goals {
            self.ground("Request", goal);
            self.cycle();
        }
    }

    /// What has become of a contract of the system agent's.
    fn status(&mut self, contract: ContractKey, status: &str) {
        let (epoch, number) = contract;
        let status = RegisterStatus {
            register: "goal".into(),
            epoch,
            number,
            revision: 0,
            outputs: vec![Some(RegisterValue::Symbol(status.into()))],
            end: ContractEnd::Ended,
        };
        self.arrive(SYSTEM, Arrival::Status(status));
    }

    /// The contract of the system agent that is loaded.
    fn contract(&self) -> ContractKey {
        let told = self.told.as_ref().expect("it was told something");
        (told.epoch, told.number)
    }

    /// Until the system agent is told to do something; whether it was within so many ticks.
    fn until_told(&mut self, ticks: u64) -> bool {
        (0..ticks).any(|_| {
            self.cycle();
            self.doing().is_some()
        })
    }

    /// Whatever it is told is done, each time with the next of these statuses, until nothing comes for
    /// longer than a plan may take.
    fn go_on(&mut self, statuses: &[&str]) {
        let mut statuses = statuses.iter().chain(std::iter::repeat(&"ok"));
        while self.doing().is_some() || self.until_told(500) {
            let (contract, times) = (self.contract(), self.places.len());
            self.cycles(5);
            assert_eq!(self.places.len(), times, "one goal at a time");
            self.status(contract, statuses.next().expect("it has no end"));
            self.cycle();
            assert_ne!(self.contract(), contract);
        }
    }

    fn crash(&mut self) {
        self.life += 1;
        self.planner.lock().expect("nobody panics").restarted();
        self.runner = runner(self.life, &self.planner, BACKOFF);
        self.told = None;
    }
}

#[test]
fn each_goal_is_sent_once_and_one_at_a_time() {
    for pace in [None, Some(100)] {
        let mut bench = Bench::new();
        bench.pace = pace;
        bench.request(1..=4);
        // One that is asked for while another one is being done.
        assert!(bench.until_told(600));
        bench.ground("Request", 5);
        bench.go_on(&[]);
        bench.places.sort_unstable();
        assert_eq!(bench.places, [100, 200, 300, 400, 500]);
    }
}

/// A plan is there when the time has passed that deliberation takes.
#[test]
fn nothing_is_sent_before_deliberation_is_done() {
    let mut bench = Bench::new();
    bench.pace = Some(0);
    bench.request(1..=1);
    assert!(!bench.until_told(100));
    bench.pace = None;
    assert!(bench.until_told(100));
}

/// Its last goal was done when the agent crashed: there is nothing to wait for.
#[test]
fn a_new_life_that_had_nothing_under_way_goes_on_at_once() {
    let mut bench = Bench::new();
    bench.request(1..=1);
    bench.go_on(&[]);
    bench.crash();
    bench.request(2..=2);
    assert!(bench.until_told(100));
    assert_eq!(bench.places, [100, 200]);
}

/// It is the next goal's turn, and the one that failed is tried again, so often.
#[test]
fn a_goal_that_fails_is_tried_again_and_given_up_in_the_end() {
    let mut bench = Bench::new();
    bench.request(1..=1);
    bench.go_on(&["failed", "TIMEOUT"]);
    assert_eq!(bench.places, [100; 3]);
    let mut bench = Bench::new();
    bench.request(1..=1);
    let mut given_up = Vec::new();
    for _ in 0..ATTEMPTS {
        assert!(bench.doing().is_some() || bench.until_told(500));
        bench.status(bench.contract(), "failed");
        given_up.extend(bench.cycle().given_up);
    }
    assert_eq!(given_up.len(), 1);
    assert_eq!(given_up[0].goal, 1);
    bench.go_on(&[]);
    assert_eq!(bench.places, [100; 3]);
}

/// The ground asks twice for the same goal, since it has crashed meanwhile.
#[test]
fn a_goal_that_is_asked_for_twice_is_one() {
    let mut bench = Bench::new();
    bench.request(1..=2);
    bench.request(1..=2);
    bench.go_on(&[]);
    bench.request(1..=2);
    bench.go_on(&[]);
    assert_eq!(bench.places, [100, 200]);
}

/// Whenever it comes: before there is a plan, while one is being made, between plan and goal, while it
/// is done, and in the cycle of each of these.
#[test]
fn a_recall_wins_over_everything_that_is_planned() {
    for pace in [None, Some(100)] {
        for after in 0..90 {
            for goal in 1..=3 {
                let mut bench = Bench::new();
                bench.pace = pace;
                bench.request(1..=3);
                for _ in 0..after {
                    bench.cycle();
                    if bench.doing().is_some() && bench.tick.is_multiple_of(30) {
                        bench.status(bench.contract(), "ok");
                    }
                }
                let times = bench.places.len();
                bench.ground("Recall", goal);
                bench.cycle();
                assert_ne!(bench.doing(), Some(100 * goal), "{pace:?}, {after}");
                bench.go_on(&[]);
                let later = &bench.places[times..];
                let what = format!("{pace:?}: {goal} at {after}: {:?}", bench.places);
                assert!(!later.contains(&(100 * goal)), "{what}");
                let mut all = bench.places.clone();
                all.sort_unstable();
                all.dedup();
                assert_eq!(all.len(), bench.places.len(), "{what}");
                assert!(all.len() >= 2, "{what}");
            }
        }
    }
}

/// The agent crashes while a goal is done. It sends nothing until it knows what became of it; what
/// others of its contracts came to, it may hear at any time.
#[test]
fn a_new_life_asks_what_became_of_the_last_goal() {
    for (status, places) in [
        ("ok", vec![100, 200, 300]),
        ("failed", vec![100, 200, 300, 200]),
    ] {
        let mut bench = Bench::new();
        bench.request(1..=3);
        assert!(bench.until_told(600));
        let first = bench.contract();
        bench.status(first, "ok");
        assert!(bench.until_told(600));
        let last = bench.contract();
        assert_eq!(bench.places, [100, 200]);
        bench.crash();
        assert!(!bench.until_told(400));
        bench.crash();
        assert!(!bench.until_told(400));
        // An answer that was under way, and one of the life between.
        bench.status(first, "failed");
        bench.status((2, 1), "failed");
        assert!(!bench.until_told(500));
        bench.status(last, status);
        bench.go_on(&[]);
        let found = &bench.places;
        let mut sorted = [found.clone(), places.clone()];
        sorted.iter_mut().for_each(|all| all.sort_unstable());
        assert_eq!(sorted[0], sorted[1], "{status}: {found:?}");
    }
}

/// Its load was lost, and the agent crashed before it could say it again: the goal is sent anew, and is
/// not given up for that.
#[test]
fn a_goal_that_never_began_was_not_tried() {
    let mut bench = Bench::new();
    bench.request(1..=1);
    for _ in 0..=ATTEMPTS {
        assert!(bench.until_told(600));
        let (epoch, number) = bench.contract();
        bench.crash();
        assert!(!bench.until_told(30));
        let answer = RegisterStatus {
            register: "goal".into(),
            epoch,
            number,
            revision: 0,
            outputs: Vec::new(),
            end: ContractEnd::Refused {
                reason: "it never came".to_owned(),
            },
        };
        bench.arrive(SYSTEM, Arrival::Status(answer));
        assert!(bench.cycle().given_up.is_empty());
    }
    bench.go_on(&[]);
    assert_eq!(bench.places.len() as u32, ATTEMPTS + 2);
}
