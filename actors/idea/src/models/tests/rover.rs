//! A rover whose polls and statuses a test gives tick by tick.

use super::*;
use crate::service::{Outcome, Present};
use farside_planning::model::{TimelineId, Value};

/// No case takes longer.
const MOST_TICKS: i64 = 5_000;

/// The system agent's planner, and what its polls are answered.
pub(super) struct Rover {
    pub(super) service: Box<dyn PlanService>,
    pub(super) system: System,
    pub(super) tick: i64,
    /// \[degrees\]; none, if the answer is lost.
    pub(super) pitch: Option<Value>,
    /// \[degrees\]; none, if the answer is lost.
    pub(super) roll: Option<Value>,
    /// \[degrees Celsius\]
    pub(super) temperature: Option<Value>,
    /// \[percent\]
    pub(super) power: Option<Value>,
}

impl Rover {
    /// After the first cycle.
    pub(super) fn new(system: &Planned) -> Rover {
        let mut rover = Rover {
            service: system.service(),
            system: system.system.clone(),
            tick: -1,
            pitch: Some(0),
            roll: Some(0),
            temperature: Some(20),
            power: Some(80),
        };
        rover.cycle();
        rover
    }

    pub(super) fn cycle(&mut self) {
        self.tick += 1;
        assert!(self.tick < MOST_TICKS, "it does not come to an end");
        self.service.advance(self.tick);
        let at = self.system.timelines;
        let polls = [
            (at.pitch, self.pitch),
            (at.roll, self.roll),
            (at.temperature, self.temperature),
            (at.power, self.power),
        ];
        for (timeline, value) in polls {
            let poll = self.service.present(timeline);
            let poll = poll.filter(|at| at.start < self.tick && at.parameters.len() >= 3);
            if let (Some(poll), Some(value)) = (poll, value) {
                let outputs = [None, Some(value), Some(1)];
                // It may have been posted already.
                let _ = self.service.bind(poll.contract, &outputs, true);
            }
        }
        let outcome = self.service.solve(1, 100_000);
        assert_eq!(outcome, Outcome::Decided, "tick {}", self.tick);
        self.service.forget(self.tick);
    }

    pub(super) fn cycles(&mut self, count: usize) {
        (0..count).for_each(|_| self.cycle());
    }

    pub(super) fn present(&self, timeline: TimelineId) -> Present {
        self.service.present(timeline).expect("it says something")
    }

    /// The present command of a timeline ends with a status, in the next cycle.
    pub(super) fn status(&mut self, timeline: TimelineId, status: Value) {
        let contract = self.present(timeline).contract;
        self.service.advance(self.tick + 1);
        let bound = self.service.bind(contract, &[Some(status)], true);
        bound.expect("the command is active");
    }

    /// The present command of the wheels is done, or has failed, and so it is decided.
    pub(super) fn wheels(&mut self, status: Value) {
        self.status(self.system.timelines.location, status);
        self.cycle();
    }

    pub(super) fn ok(&mut self) {
        self.wheels(self.system.statuses.ok);
    }

    pub(super) fn goal(&mut self) {
        self.service.advance(self.tick + 1);
        let (at, says) = (self.system.timelines.goal, self.system.predicates.image_at);
        let camera = self
            .system
            .model
            .symbols
            .iter()
            .position(|at| at == "hawk_eye");
        let camera = camera.expect("there is one") as Value;
        let inserted = self
            .service
            .insert_goal(at, says, &[100, -50, 30, -10, camera]);
        inserted.expect("there is no other");
    }

    /// What a timeline says, with its inputs.
    pub(super) fn says(&self, timeline: TimelineId) -> String {
        let present = self.present(timeline);
        let model = &self.system.model;
        let predicate = &model.predicates[present.predicate];
        let inputs = predicate.parameters.iter().zip(&present.parameters);
        let inputs = inputs.take(predicate.inputs);
        inputs.fold(predicate.name.clone(), |text, (parameter, value)| {
            let value = value.map_or("?".to_owned(), |value| model.show(parameter.of, value));
            text + " " + &value
        })
    }

    pub(super) fn monitor(&self) -> String {
        self.says(self.system.timelines.monitor)
    }

    /// The status of the goal that ended in this cycle.
    pub(super) fn goal_status(&self) -> Option<Value> {
        let mut ended = self.service.ended().iter();
        let goal = ended.find(|at| at.predicate == self.system.predicates.image_at)?;
        goal.parameters.last().copied().flatten()
    }
}
