//! The mission agent: goals come, are planned, are sent one at a time, and are planned anew.

use super::*;
use crate::deliberate::{Begin, Settings, Target, deliberate};
use crate::service::{Contract, Outcome, Present};
use farside_planning::model::{TimelineId, Value};

/// The mission agent's planner, whose deliberation takes three ticks.
struct Agent {
    service: Temporal,
    tick: i64,
    targets: Vec<Target>,
}

impl Agent {
    fn new() -> Agent {
        let service = Temporal::new(mission().model.clone(), TemporalOptions::default());
        let mut agent = Agent {
            service: service.expect("all timelines are states"),
            tick: -1,
            targets: Vec::new(),
        };
        agent.cycle();
        agent
    }

    fn cycle(&mut self) {
        self.tick += 1;
        self.service.advance(self.tick);
        assert_eq!(
            self.service.solve(1, 100_000),
            Outcome::Decided,
            "tick {}",
            self.tick
        );
        self.service.forget(self.tick);
    }

    fn present(&self, timeline: TimelineId) -> Present {
        self.service.present(timeline).expect("it says something")
    }

    fn says(&self, timeline: TimelineId) -> &'static str {
        &mission().model.predicates[self.present(timeline).predicate].name
    }

    /// The ground asks for a goal, by its place along a line.
    fn request(&mut self, number: Value, x_dm: Value) {
        let at = mission();
        let camera = { at.model.symbols.iter() }.position(|at| at == "wide_eye");
        let camera = camera.expect("there is one") as Value;
        self.service.advance(self.tick + 1);
        let inputs = [number, x_dm, 0, 10, -10, camera, 0];
        let inserted =
            self.service
                .insert_goal(at.timelines.ground, at.predicates.request, &inputs);
        inserted.expect("the ground can ask at any time");
        self.targets.push(Target {
            number,
            x_dm,
            y_dm: 0,
            pan_deg: 10,
            tilt_deg: -10,
            camera,
            weight: None,
        });
    }

    fn planning(&self) -> (Contract, [Value; 3]) {
        let present = self.present(mission().timelines.planner);
        assert_eq!(present.predicate, mission().predicates.planning);
        let input = |place: usize| present.parameters[place].expect("inputs are known");
        (present.contract, [input(0), input(1), input(2)])
    }

    /// Deliberation that was asked for is done three ticks later, and its plan is taken.
    fn plan(&mut self) {
        let (contract, [h0, ..]) = self.planning();
        let snapshot = self.service.snapshot();
        (0..3).for_each(|_| self.cycle());
        let begin = Begin {
            x_dm: 0,
            y_dm: 0,
            battery: 90_000,
        };
        let found = deliberate(mission(), &self.targets, &begin, h0, &Settings::default());
        let found = found.expect("the goals are right");
        let plan = found.plan.expect("there are goals");
        self.service
            .commit(&snapshot, plan)
            .expect("nothing has changed");
        self.service.advance(self.tick + 1);
        let outputs = [Some(mission().planned.planned), Some(1)];
        self.service
            .bind(contract, &outputs, true)
            .expect("the planner is at work");
        self.cycle();
        while self.tick < h0 {
            assert_eq!(self.place(), None, "tick {}", self.tick);
            self.cycle();
        }
    }

    /// The goal ends with a status; where the next one is.
    fn goal_ends(&mut self, status: Value) -> Option<Value> {
        let goal = mission().timelines.goal;
        let contract = self.present(goal).contract;
        self.service.advance(self.tick + 1);
        self.service
            .bind(contract, &[Some(status)], true)
            .expect("the goal is active");
        self.cycle();
        self.place()
    }

    fn place(&self) -> Option<Value> {
        self.present(mission().timelines.goal)
            .parameters
            .first()
            .copied()
            .flatten()
    }

    fn name(value: Value) -> &'static str {
        &mission().model.symbols[value as usize]
    }
}

#[test]
fn goals_are_planned_and_sent_one_at_a_time() {
    let at = mission();
    let mut agent = Agent::new();
    // A life begins with a plan for what is known: here, nothing.
    agent.cycle();
    let (contract, _) = agent.planning();
    agent.service.advance(agent.tick + 1);
    let nothing = [Some(at.planned.nothing_to_do), Some(0)];
    agent
        .service
        .bind(contract, &nothing, true)
        .expect("it is active");
    agent.cycle();
    assert_eq!(agent.says(at.timelines.planner), "Resting");
    agent.request(1, 300);
    agent.cycle();
    let (first, [h0, h1, problem]) = agent.planning();
    assert_eq!((h0, h1), (agent.tick + 20, agent.tick + 20_020));
    assert_eq!(Agent::name(problem), "requested");
    // Another one, before the plan is there: it begins anew.
    agent.request(2, 100);
    agent.cycle();
    let (second, _) = agent.planning();
    assert_ne!(first, second);
    agent.plan();
    assert_eq!(agent.says(at.timelines.planner), "Resting");
    assert_eq!(agent.says(at.timelines.goal), "ImageAt");
    assert_eq!(agent.place(), Some(100));
    // Nobody counts its time here.
    (0..10_000).for_each(|_| agent.cycle());
    assert_eq!(agent.place(), Some(100));
    assert_eq!(agent.goal_ends(at.statuses.ok), Some(300));
    assert_eq!(agent.says(at.timelines.planner), "Resting");
    assert_eq!(agent.goal_ends(at.statuses.ok), None);
    assert_eq!(agent.says(at.timelines.goal), "NoGoal");
}

#[test]
fn after_a_goal_that_failed_comes_the_next_best_and_all_is_planned_anew() {
    let at = mission();
    for status in [at.statuses.failed, at.statuses.timeout] {
        let mut agent = Agent::new();
        for (number, x_dm) in [(1, 300), (2, 100), (3, -150)] {
            agent.request(number, x_dm);
            agent.cycle();
        }
        agent.plan();
        assert_eq!(agent.place(), Some(-150));
        assert_eq!(agent.goal_ends(status), Some(100));
        let (_, [_, _, problem]) = agent.planning();
        assert_eq!(Agent::name(problem), "failed_goal");
    }
}

#[test]
fn a_plan_that_comes_too_late_is_made_anew() {
    let at = mission();
    let mut agent = Agent::new();
    agent.request(1, 300);
    agent.cycle();
    let (contract, _) = agent.planning();
    agent.service.advance(agent.tick + 1);
    agent
        .service
        .bind(contract, &[Some(at.planned.stale), None], true)
        .expect("it is active");
    agent.cycle();
    let (_, [h0, _, problem]) = agent.planning();
    assert_eq!((h0, Agent::name(problem)), (agent.tick + 200, "stale_plan"));
    (0..600).for_each(|_| agent.cycle());
    let (_, [_, _, problem]) = agent.planning();
    assert_eq!(Agent::name(problem), "late_plan");
    // With a request in the cycle in which it is stale, too.
    let (contract, _) = agent.planning();
    agent.request(2, 10);
    agent
        .service
        .bind(contract, &[Some(at.planned.stale), None], true)
        .expect("it is active");
    agent.cycle();
    assert_ne!(agent.planning().0, contract);
}

/// A goal that is taken back ends, if it is the one that is being done, and no other does.
#[test]
fn a_recall_ends_its_goal_and_is_planned_for() {
    let at = mission();
    for (recalled, is_ended) in [(1, true), (2, false)] {
        let mut agent = Agent::new();
        agent.cycle();
        agent.request(1, 300);
        agent.cycle();
        agent.plan();
        (0..40).for_each(|_| agent.cycle());
        assert_eq!(agent.place(), Some(300));
        let camera = agent.targets[0].camera;
        agent.service.advance(agent.tick + 1);
        let inputs = [recalled, 300 * recalled, 0, 10, -10, camera];
        let ground = at.timelines.ground;
        let inserted = agent
            .service
            .insert_goal(ground, at.predicates.recall, &inputs);
        inserted.expect("the ground can recall at any time");
        agent.cycle();
        assert_eq!(Agent::name(agent.planning().1[2]), "recalled");
        let goal = agent.says(at.timelines.goal);
        assert_eq!(goal, if is_ended { "NoGoal" } else { "ImageAt" });
    }
}
