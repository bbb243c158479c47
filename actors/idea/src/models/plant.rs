//! A plant for the system agent's model: it answers, delays and loses as chance has it, without a
//! simulator. Tests, examples and benches drive a [`PlanService`] with it.
//!
//! What happens is a function of the seed and of what the service decided; two services that decide
//! alike meet the same.

use farside::random::{RandomKey, Stream};
use farside_planning::Ticks;
use farside_planning::model::{PredicateId, TimelineId, Value};

use super::System;
use crate::service::{Contract, NoPlan, Outcome, PlanService, Started};

/// How often things happen, each a probability: of a poll or a command, or in a tick.
#[derive(Clone, Copy, Debug)]
pub struct Chances {
    /// That the answer to a poll is lost.
    pub lost_poll: f64,
    /// That the answer to a poll comes a tick later than the next one, or still later.
    pub late_poll: f64,
    /// That all polls begin to be lost for a while, in a tick.
    pub silence: f64,
    /// That pitch or roll begins to be above its limit for a while, in a tick.
    pub alarm: f64,
    /// That it is above the hard limit then.
    pub hard: f64,
    /// That power begins to be low for a while, in a tick.
    pub low_power: f64,
    /// That the status of a command is lost.
    pub lost_status: f64,
    /// That a command fails.
    pub failed: f64,
    /// That a goal comes, in a tick without one.
    pub goal: f64,
    /// That the goal is taken back, in a tick with one.
    pub cancel: f64,
    /// That an operator lets a safe rover go on, in a tick.
    pub operator: f64,
}

impl Chances {
    /// A calm day: polls are answered, commands are done, goals come.
    pub const CALM: Chances = Chances {
        lost_poll: 0.0,
        late_poll: 0.0,
        silence: 0.0,
        alarm: 0.001,
        hard: 0.0,
        low_power: 0.0,
        lost_status: 0.0,
        failed: 0.01,
        goal: 0.05,
        cancel: 0.0,
        operator: 0.02,
    };
    /// A bad one: everything that can happen happens often.
    pub const WILD: Chances = Chances {
        lost_poll: 0.05,
        late_poll: 0.05,
        silence: 0.003,
        alarm: 0.02,
        hard: 0.03,
        low_power: 0.002,
        lost_status: 0.08,
        failed: 0.1,
        goal: 0.1,
        cancel: 0.01,
        operator: 0.05,
    };
}

/// What something is answered.
#[derive(Clone, Copy, Debug)]
struct Reply {
    outputs: [Option<Value>; 3],
    /// How many outputs it has.
    count: usize,
    /// After how many ticks it comes.
    delay: Ticks,
}

/// An answer that is on its way.
#[derive(Clone, Copy, Debug)]
struct Answer {
    due: Ticks,
    contract: Contract,
    reply: Reply,
}

/// A plant and the service that controls it.
pub struct Plant<S> {
    /// The service.
    pub service: S,
    system: System,
    chances: Chances,
    random: Stream,
    answers: Vec<Answer>,
    /// Until when pitch and roll are above their limits, and by how much \[degrees\].
    tilted: [(Ticks, Value); 2],
    /// Until when no poll is answered.
    silent: Ticks,
    /// Until when power is low.
    low: Ticks,
    /// How many statuses came for contracts that had ended.
    pub stale: u64,
}

impl<S: PlanService> Plant<S> {
    /// Before the first tick.
    pub fn new(service: S, system: &System, chances: Chances, seed: u64) -> Self {
        Plant {
            service,
            system: system.clone(),
            chances,
            random: RandomKey::new(seed).text("k9_plant").stream(),
            answers: Vec::new(),
            tilted: [(0, 0); 2],
            silent: 0,
            low: 0,
            stale: 0,
        }
    }

    /// What happens until a tick, and the cycle at it.
    ///
    /// # Errors
    ///
    /// If the model leaves no legal plan.
    pub fn step(&mut self, tick: Ticks) -> Result<(), NoPlan> {
        self.service.advance(tick);
        if tick > 0 {
            self.happen(tick);
            self.deliver(tick);
            self.ask();
        }
        let outcome = self.service.solve(1, 1_000_000);
        match outcome {
            Outcome::Decided => {}
            Outcome::NoPlan(why) => return Err(why),
            Outcome::OverBudget => panic!("tick {tick}: a million operations are enough"),
        }
        self.answer(tick);
        self.service.forget(tick);
        Ok(())
    }

    /// What a timeline says now.
    pub fn says(&self, timeline: TimelineId) -> Option<PredicateId> {
        self.service.present(timeline).map(|at| at.predicate)
    }

    fn happen(&mut self, tick: Ticks) {
        let chances = self.chances;
        for place in 0..2 {
            if self.random.chance(chances.alarm) {
                let hard = self.random.chance(chances.hard);
                let degrees = if hard { 50 } else { 30 } + self.random.below(10) as Value;
                let sign = if self.random.chance(0.5) { -1 } else { 1 };
                let until = tick + 1 + self.random.below(30) as Ticks;
                self.tilted[place] = (until, sign * degrees);
            }
        }
        if self.random.chance(chances.silence) {
            self.silent = tick + self.random.below(20) as Ticks;
        }
        if self.random.chance(chances.low_power) {
            self.low = tick + self.random.below(300) as Ticks;
        }
    }

    /// Statuses whose time has come.
    fn deliver(&mut self, tick: Ticks) {
        let mut place = 0;
        while let Some(&answer) = self.answers.get(place) {
            if answer.due > tick {
                place += 1;
                continue;
            }
            self.answers.remove(place);
            let outputs = &answer.reply.outputs[..answer.reply.count];
            if self.service.bind(answer.contract, outputs, true).is_err() {
                self.stale += 1;
            }
        }
    }

    /// What the mission agent and the operator ask for.
    fn ask(&mut self) {
        let System {
            timelines,
            predicates,
            ..
        } = self.system;
        let wanted = self.random.chance(self.chances.goal);
        let taken_back = self.random.chance(self.chances.cancel);
        let operator = self.random.chance(self.chances.operator);
        let goal = self.service.present(timelines.goal);
        let is_free = goal
            .as_ref()
            .is_some_and(|at| at.predicate == predicates.no_goal);
        if is_free && wanted {
            let place = [self.random.below(500), self.random.below(500)].map(|at| at as Value);
            let pan = self.random.below(90) as Value;
            let camera = self.camera();
            let inputs = [place[0], place[1], pan, -10, camera];
            let inserted = self
                .service
                .insert_goal(timelines.goal, predicates.image_at, &inputs);
            inserted.expect("a goal can come at any time");
        } else if !is_free
            && taken_back
            && let Some(goal) = goal
        {
            // Nothing is lost if it ends just now.
            let _ = self.service.cancel(goal.contract);
        }
        if operator && self.says(timelines.monitor) == Some(predicates.safe) {
            let let_go = self
                .service
                .insert_goal(timelines.monitor, predicates.nominal, &[]);
            let_go.expect("an operator can let it go");
        }
    }

    /// A camera of the model.
    fn camera(&self) -> Value {
        let symbols = &self.system.model.symbols;
        let camera = symbols.iter().position(|at| at == "wide_eye");
        camera.unwrap_or_default() as Value
    }

    /// Answers what has begun.
    fn answer(&mut self, tick: Ticks) {
        let started: Vec<Started> = self.service.started().to_vec();
        for token in started {
            let reply = match self.kind_of_poll(token.predicate) {
                Some(kind) => self.poll(tick, kind),
                None => self.command(token.predicate),
            };
            if let Some(reply) = reply {
                self.answers.push(Answer {
                    due: tick + reply.delay,
                    contract: token.contract,
                    reply,
                });
            }
        }
    }

    /// Which poll a predicate is, if it is one.
    fn kind_of_poll(&self, predicate: PredicateId) -> Option<usize> {
        let at = self.system.predicates;
        let kinds = [
            at.pitch_measure,
            at.roll_measure,
            at.temperature_measure,
            at.power_measure,
        ];
        kinds.iter().position(|&one| one == predicate)
    }

    /// What a poll is answered; nothing, if the answer is lost.
    fn poll(&mut self, tick: Ticks, kind: usize) -> Option<Reply> {
        let is_lost = self.random.chance(self.chances.lost_poll) || tick < self.silent;
        let is_late = self.random.chance(self.chances.late_poll);
        let late = 2 + self.random.below(3) as Ticks;
        let small = self.random.below(21) as Value - 10;
        let value = match kind {
            0 | 1 if tick < self.tilted[kind].0 => self.tilted[kind].1,
            0 | 1 => small,
            2 => 40 + small,
            _ if tick < self.low => 10,
            _ => 70 + small,
        };
        (!is_lost).then_some(Reply {
            outputs: [None, Some(value), Some(1)],
            count: 3,
            delay: if is_late { late } else { 1 },
        })
    }

    /// What a command is answered; nothing, if it needs no answer or that is lost.
    fn command(&mut self, predicate: PredicateId) -> Option<Reply> {
        let (at, statuses) = (self.system.predicates, self.system.statuses);
        let mean = match predicate {
            one if one == at.stop => 2,
            one if one == at.drive_to => 60,
            one if one == at.back_up || one == at.turn_in_place => 8,
            one if one == at.point || one == at.take_image => 4,
            _ => return None,
        };
        let is_lost = self.random.chance(self.chances.lost_status);
        let is_failed = self.random.chance(self.chances.failed);
        let delay = 1 + self.random.below(2 * mean) as Ticks;
        let status = if is_failed {
            statuses.failed
        } else {
            statuses.ok
        };
        (!is_lost).then_some(Reply {
            outputs: [Some(status), None, None],
            count: 1,
            delay,
        })
    }
}
