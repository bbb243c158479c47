//! A mission agent between a ground and a system agent, on links that lose, repeat and reorder; both
//! agents crash at any time.

use std::collections::BTreeMap;

use farside::random::{RandomKey, Stream};
use proptest::prelude::*;

use super::*;

const AGAIN: Backoff = Backoff {
    first: SimDuration::from_secs(2),
    most: SimDuration::from_secs(16),
};
/// By then all goals are settled.
const LAST_TICK: u64 = 60_000;

/// When agents crash, and how bad the links are.
#[derive(Clone, Debug)]
struct Weather {
    seed: u64,
    loss: f64,
    goals: i64,
    /// How likely it is that the system agent fails in what it does.
    failing: f64,
    mission: Vec<Crash>,
    /// The system agent's, by tick.
    system: Vec<u64>,
}

/// A crash of the mission agent.
#[derive(Clone, Debug)]
struct Crash {
    tick: u64,
    /// Whether what it decided in this tick has not left yet.
    is_before_sending: bool,
    /// For how many ticks it does not come again.
    lasts: u64,
}

fn weathers() -> impl Strategy<Value = Weather> {
    let crash = (0_u64..1500, any::<bool>(), 0_u64..60).prop_map(|(tick, before, lasts)| Crash {
        tick,
        is_before_sending: before,
        lasts,
    });
    (
        any::<u64>(),
        0.0..0.9,
        1_i64..5,
        prop_oneof![Just(0.0), Just(0.3)],
        proptest::collection::vec(crash, 0..12),
        proptest::collection::vec(0_u64..1500, 0..6),
    )
        .prop_map(|(seed, loss, goals, failing, mission, system)| Weather {
            seed,
            loss,
            goals,
            failing,
            mission,
            system,
        })
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Whom {
    Ground,
    Mission(usize),
    System,
}

/// All three, the links between them, and what was seen to happen.
struct World {
    weather: Weather,
    random: Stream,
    tick: u64,
    sent: usize,
    /// By tick of arrival, then in the order of sending.
    under_way: BTreeMap<(u64, usize), (Whom, Arrival)>,
    planner: SharedDeliberator,
    memory: Vec<Controlled>,
    /// None while it does not live, until a tick.
    mission: Option<Runner>,
    life: u32,
    rises: u64,
    ground: Controlling,
    asked: i64,
    is_waiting: bool,
    system: Controlled,
    /// What the system agent is at: the contract, where its goal is, and when it is over.
    running: Option<(ContractKey, i64, u64)>,
    begun: Vec<ContractKey>,
    done: Vec<i64>,
    given_up: Vec<GivenUp>,
}

impl World {
    fn new(weather: Weather) -> World {
        let mission = models::mission().clone();
        let planner = MissionPlanner::new(mission, Settings::default(), ATTEMPTS, [0, 0]);
        let planner: SharedDeliberator = Arc::new(Mutex::new(planner));
        let runner = runner(1, &planner, AGAIN);
        World {
            random: RandomKey::new(weather.seed).text("weather").stream(),
            weather,
            tick: 0,
            sent: 0,
            under_way: BTreeMap::new(),
            memory: runner.memory(),
            planner,
            mission: Some(runner),
            life: 1,
            rises: 0,
            ground: Controlling::new("ground".into(), 1, AGAIN),
            asked: 0,
            is_waiting: false,
            system: Controlled::new("goal".into(), AGAIN),
            running: None,
            begun: Vec::new(),
            done: Vec::new(),
            given_up: Vec::new(),
        }
    }

    fn now(&self) -> SimTime {
        SimTime::ZERO + SimDuration::from_millis(500) * self.tick
    }

    fn send(&mut self, to: Whom, what: Arrival) {
        let times = match self.random.chance(0.2) {
            true => 2,
            false => 1,
        };
        for _ in 0..times {
            if self.random.chance(self.weather.loss) {
                continue;
            }
            let arrives = self.tick + 1 + self.random.below(12);
            self.sent += 1;
            self.under_way
                .insert((arrives, self.sent), (to, what.clone()));
        }
    }

    fn step(&mut self) {
        self.deliver();
        self.ground_asks();
        self.mission_cycles();
        self.system_works();
        self.tick += 1;
    }

    fn deliver(&mut self) {
        while let Some(entry) = self.under_way.first_entry() {
            if entry.key().0 > self.tick {
                break;
            }
            let (to, what) = entry.remove();
            match to {
                Whom::Ground => self.ground_hears(what),
                Whom::System => self.system_hears(what),
                Whom::Mission(from) => {
                    let at = SimTime::from_nanos(self.now().as_nanos().saturating_sub(1000));
                    if let Some(runner) = &mut self.mission {
                        runner.arrive(at, from, what);
                    }
                }
            }
        }
    }

    fn ground_asks(&mut self) {
        let now = self.now();
        if !self.is_waiting && self.asked < self.weather.goals {
            self.asked += 1;
            self.is_waiting = true;
            let load = self.ground.load("Request".into(), request(self.asked), now);
            self.send(Whom::Mission(GROUND), Arrival::Load(load));
        }
        if let Some((load, _)) = self.ground.repeat(now) {
            self.send(Whom::Mission(GROUND), Arrival::Load(load));
        }
    }

    fn ground_hears(&mut self, what: Arrival) {
        match what {
            Arrival::Ack(ack) => self.ground.acknowledged(&ack),
            Arrival::Status(status) => {
                if let Heard::News { .. } = self.ground.status(&status) {
                    self.is_waiting = false;
                }
                self.send(
                    Whom::Mission(GROUND),
                    Arrival::Ack(Controlling::ack(&status)),
                );
            }
            other => panic!("nobody tells the ground {other:?}"),
        }
    }

    fn mission_cycles(&mut self) {
        let mut crashes = self.weather.mission.iter();
        let crash = crashes.rfind(|crash| crash.tick == self.tick).cloned();
        if self.mission.is_none() && self.tick >= self.rises {
            self.rise();
        }
        let now = self.now();
        let mut out = Vec::new();
        if let Some(runner) = &mut self.mission {
            let cycle = runner.cycle(self.tick, now, &mut self.memory);
            runner.deliberate(None);
            assert_eq!(cycle.verdict, crate::runner::Verdict::Decided);
            self.given_up.extend(cycle.given_up);
            out = cycle.out;
        }
        if !crash.as_ref().is_some_and(|crash| crash.is_before_sending) {
            self.leave(out);
        }
        if let Some(crash) = crash {
            self.mission = None;
            self.rises = self.rises.max(self.tick + 1 + crash.lasts);
        }
    }

    /// What the mission agent says.
    fn leave(&mut self, out: Vec<Out>) {
        for out in out {
            let to = match out.peer() {
                GROUND => Whom::Ground,
                _ => Whom::System,
            };
            let what = match out {
                Out::Load(_, load, _) => Arrival::Load(load),
                Out::Status(_, status, _) => Arrival::Status(status),
                Out::Ack(_, ack) => Arrival::Ack(ack),
            };
            self.send(to, what);
        }
    }

    /// The mission agent begins a new life.
    fn rise(&mut self) {
        self.life += 1;
        self.planner.lock().expect("nobody panics").restarted();
        let runner = runner(self.life, &self.planner, AGAIN);
        let now = self.now();
        let said = runner.restarted(&mut self.memory, now);
        self.leave(said);
        self.mission = Some(runner);
    }

    fn system_hears(&mut self, what: Arrival) {
        let now = self.now();
        let answer = match what {
            Arrival::Load(load) => match self.system.take(&load, now) {
                Taken::Yes => {
                    let contract = self.system.contract();
                    self.running = None;
                    if &*load.procedure == "ImageAt" {
                        let Some(&RegisterValue::Number(x)) = load.inputs.first() else {
                            panic!("{load:?}");
                        };
                        let until = self.tick + 5 + self.random.below(30);
                        self.begun.push(contract);
                        self.running = Some((contract, x, until));
                    }
                    Some(Arrival::Ack(self.system.ack()))
                }
                Taken::Before(Some(status)) => Some(Arrival::Status(status)),
                Taken::Before(None) => Some(Arrival::Ack(self.system.ack())),
                Taken::Old | Taken::Early => None,
            },
            Arrival::Ack(ack) => {
                self.system.acknowledged(&ack);
                None
            }
            Arrival::Status(question) => self.system.asked(&question).map(Arrival::Status),
            other @ Arrival::Offline(_) => panic!("nobody says {other:?}"),
        };
        answer
            .into_iter()
            .for_each(|what| self.send(Whom::Mission(SYSTEM), what));
    }

    fn system_works(&mut self) {
        let now = self.now();
        let mut said = Vec::new();
        if self.weather.system.contains(&self.tick) {
            self.running = None;
            said.extend(self.system.restarted(now));
        }
        if let Some((_, place, _)) = self.running.take_if(|(.., until)| *until <= self.tick) {
            let status = match self.random.chance(self.weather.failing) {
                true => "failed",
                false => {
                    self.done.push(place);
                    "ok"
                }
            };
            let outputs = vec![Some(RegisterValue::Symbol(status.into()))];
            said.extend(self.system.say(outputs, ContractEnd::Ended, now));
        }
        said.extend(self.system.repeat(now).map(|(status, _)| status));
        said.into_iter()
            .for_each(|status| self.send(Whom::Mission(SYSTEM), Arrival::Status(status)));
    }

    /// What must hold at any time.
    fn check(&self) {
        let begun = &self.begun;
        assert!(
            begun.is_sorted_by(|a, b| a < b),
            "each once, in order: {begun:?}"
        );
        let mut ends = self.done.clone();
        ends.extend(self.given_up.iter().map(|given_up| 100 * given_up.goal));
        ends.sort_unstable();
        assert!(ends.is_sorted_by(|a, b| a < b), "none twice: {ends:?}");
    }

    fn is_settled(&self) -> bool {
        (self.done.len() + self.given_up.len()) as i64 == self.weather.goals
    }
}

/// Whatever crashes when, and whatever the links lose, all goals are done or given up with a reason, and
/// none twice.
fn all_are_settled(weather: &Weather) {
    let mut world = World::new(weather.clone());
    while world.tick < LAST_TICK && !world.is_settled() {
        world.step();
        world.check();
    }
    let (done, given_up) = (&world.done, &world.given_up);
    assert!(world.is_settled(), "done: {done:?}, given up: {given_up:?}");
    assert!(given_up.iter().all(|one| one.reason.contains("attempts")));
    // And nothing more is begun.
    let begun = world.begun.len();
    (0..2000).for_each(|_| world.step());
    world.check();
    assert_eq!(world.begun.len(), begun);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn all_goals_are_settled_whoever_crashes(weather in weathers()) {
        all_are_settled(&weather);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    #[test]
    #[ignore = "takes half a minute"]
    fn all_goals_are_settled_in_many_weathers(weather in weathers()) {
        all_are_settled(&weather);
    }
}
