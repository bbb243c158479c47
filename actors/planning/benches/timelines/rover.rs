//! A rover's executive with what happens to it: the same at each run.
//!
//! Polls are answered at each tick, now and then with an alarm; commands end after a while, mostly
//! well; a goal comes whenever there was none for some ticks.

use std::sync::Arc;

use farside_planning::Ticks;
use farside_planning::language::{Options, read_model, read_problem};
use farside_planning::model::{Model, PredicateId, TimelineId, Value};
use farside_planning::search::{Verdict, executive::Executive};

/// How many operations a cycle may take.
const BUDGET: u64 = 100_000;

/// An executive, and what happens to it.
pub(crate) struct Rover {
    /// The executive.
    pub(crate) executive: Executive,
    timelines: Timelines,
    predicates: Predicates,
    ok: Value,
    failed: Value,
    /// Whether an alarm came at this tick.
    alarm: bool,
    random: u64,
}

struct Timelines {
    goal: TimelineId,
    monitor: TimelineId,
    polls: [TimelineId; 4],
    commands: [TimelineId; 3],
}

struct Predicates {
    no_goal: PredicateId,
    image: PredicateId,
    nominal: PredicateId,
    polls: [PredicateId; 4],
}

/// The model of a rover's executive.
pub(crate) fn model() -> Arc<Model> {
    let text = include_str!("../../models/executive.ddl");
    let model = read_model("executive.ddl", text, &Options::default()).ok();
    Arc::new(model.unwrap_or_else(|findings| panic!("{findings}")))
}

impl Rover {
    /// At tick 0, before the first cycle.
    pub(crate) fn new(seed: u64) -> Rover {
        let model = model();
        let text = include_str!("../../models/executive-problem.ddl");
        let problem = read_problem("executive-problem.ddl", text, &model, &Options::default());
        let problem = problem.ok().unwrap_or_else(|findings| panic!("{findings}"));
        let timeline = |name: &str| {
            let found = model
                .timelines
                .iter()
                .position(|at| at.name.ends_with(name));
            found.unwrap_or_else(|| panic!("there is a timeline {name}"))
        };
        let predicate = |name: &str| {
            let found = model.predicates.iter().position(|at| at.name == name);
            found.unwrap_or_else(|| panic!("there is a predicate {name}"))
        };
        let symbol = |name: &str| {
            let found = model.symbols.iter().position(|at| at == name);
            found.unwrap_or_else(|| panic!("there is a symbol {name}")) as Value
        };
        Rover {
            timelines: Timelines {
                goal: timeline("Goal_SV"),
                monitor: timeline("MotionMonitor_SV"),
                polls: ["Tilt_SV", "Roll_SV", "Temperature_SV", "Power_SV"].map(timeline),
                commands: ["Location_SV", "Camera_SV", "PanTilt_SV"].map(timeline),
            },
            predicates: Predicates {
                no_goal: predicate("NoGoal"),
                image: predicate("ImageAt"),
                nominal: predicate("Nominal"),
                polls: [
                    "TiltMeasure",
                    "RollMeasure",
                    "TempReadCompare",
                    "PowerMeasure",
                ]
                .map(predicate),
            },
            ok: symbol("ok"),
            failed: symbol("failed"),
            alarm: false,
            random: seed,
            executive: Executive::begin(model, &problem).expect("the facts can be"),
        }
    }

    /// What happens until a tick, and the cycle at it.
    pub(crate) fn step(&mut self, tick: Ticks) -> Verdict {
        if tick > 0 {
            self.answer_polls(tick);
            self.answer_commands(tick);
            self.give_goal(tick);
        }
        self.executive.cycle(tick, BUDGET)
    }

    /// Below `limit`: splitmix64.
    fn below(&mut self, limit: u64) -> i64 {
        self.random = self.random.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.random;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((bits ^ (bits >> 31)) % limit) as i64
    }

    fn answer_polls(&mut self, tick: Ticks) {
        self.alarm = false;
        for (place, timeline) in self.timelines.polls.into_iter().enumerate() {
            // Now and then an answer is lost.
            if self.below(50) == 0 {
                continue;
            }
            let rare = self.below(200) == 0;
            let size = self.below(15);
            let (value, alarm) = match (place, rare) {
                (0 | 1, true) => (26 + size, 1),
                (0 | 1, false) => (size - 7, 0),
                (2, true) => (46 + size, 1),
                (2, false) => (20 + size, 0),
                (_, true) => (size, 1),
                (_, false) => (60 + size, 0),
            };
            let Some(token) = self.executive.present(timeline) else {
                continue;
            };
            let at = self.executive.database().token(token);
            if at.is_some_and(|at| at.predicate == self.predicates.polls[place]) {
                self.alarm |= place < 2 && alarm == 1;
                let reported = self.executive.report(token, &[alarm, value, 1], true, tick);
                reported.expect("an answer can be what it is");
            }
        }
    }

    fn answer_commands(&mut self, tick: Ticks) {
        for timeline in self.timelines.commands {
            let due = self.below(6) == 0;
            let failed = self.below(20) == 0;
            let Some(token) = self.executive.present(timeline) else {
                continue;
            };
            let database = self.executive.database();
            let Some(at) = database.token(token) else {
                continue;
            };
            let outputs = at.parameters.len() - database.model().predicates[at.predicate].inputs;
            let open = at
                .parameters
                .last()
                .is_some_and(|&one| database.value(one).is_none());
            if due && outputs == 1 && open && database.start(token).max < tick {
                let status = if failed { self.failed } else { self.ok };
                let reported = self.executive.report(token, &[status], true, tick);
                reported.expect("a command can end");
            }
        }
    }

    fn give_goal(&mut self, tick: Ticks) {
        let wanted = self.below(30) == 0;
        let place = [self.below(100), self.below(100), self.below(90)];
        let says = |timeline, predicate| {
            let token = self.executive.present(timeline);
            let at = token.and_then(|token| self.executive.database().token(token));
            at.is_some_and(|at| at.predicate == predicate)
        };
        // While the rover recovers, or begins to, nobody lets it drive.
        let free = says(self.timelines.goal, self.predicates.no_goal)
            && says(self.timelines.monitor, self.predicates.nominal);
        if wanted && free && !self.alarm {
            let [x, y, pan] = place.map(Some);
            let goal = [x, y, pan, None];
            let (timeline, image) = (self.timelines.goal, self.predicates.image);
            let started = self.executive.start(timeline, image, &goal, tick);
            started.expect("a goal can start");
        }
    }
}
