//! Registers whose procedures others set: what they are told to say, and what is said of it.

use farside::SimTime;

use super::{Cycle, Out, RegisterSetup, Runner};
use crate::register::{ContractEnd, Controlled, RegisterLoad, RegisterStatus, Taken};
use crate::service::Contract;
use crate::wording;

/// A register whose procedure somebody else sets. What outlives a crash of it is [`Controlled`].
pub(super) struct Incoming {
    pub(super) setup: RegisterSetup,
    /// The token that it says, if somebody has asked for it.
    contract: Option<Contract>,
    /// A procedure that was taken in this cycle.
    taken: Option<RegisterLoad>,
}

impl Incoming {
    pub(super) fn new(setup: RegisterSetup) -> Self {
        Incoming {
            setup,
            contract: None,
            taken: None,
        }
    }
}

impl Runner {
    /// Takes a load, if it is the next one; whether it is news.
    pub(super) fn take(
        &mut self,
        peer: usize,
        load: RegisterLoad,
        memory: &mut [Controlled],
        now: SimTime,
        cycle: &mut Cycle,
    ) -> bool {
        let mine = |one: &Incoming| one.setup.peer == peer && one.setup.name == load.register;
        let Some(at) = self.incoming.iter().position(mine) else {
            let register = &load.register;
            cycle.faults.push(format!(
                "a load for {register}, which is no register of mine"
            ));
            return false;
        };
        let controlled = &mut memory[at];
        match controlled.take(&load, now) {
            Taken::Yes => {
                self.incoming[at].taken = Some(load);
                cycle.goals += 1;
                true
            }
            Taken::Before(said) => {
                cycle.out.push(match said {
                    Some(status) => Out::Status(peer, status, 1),
                    None => Out::Ack(peer, controlled.ack()),
                });
                false
            }
            Taken::Old | Taken::Early => false,
        }
    }

    /// Answers what a new life of who controls a register asks; whether a status is such a question.
    pub(super) fn answer_question(
        &self,
        peer: usize,
        question: &RegisterStatus,
        memory: &[Controlled],
        cycle: &mut Cycle,
    ) -> bool {
        let mine = |one: &Incoming| one.setup.peer == peer && one.setup.name == question.register;
        let Some(at) = self.incoming.iter().position(mine) else {
            return false;
        };
        let answer = memory[at].asked(question);
        cycle
            .out
            .extend(answer.map(|answer| Out::Status(peer, answer, 0)));
        true
    }

    /// Puts what was taken on its timeline.
    pub(super) fn insert_goals(
        &mut self,
        memory: &mut [Controlled],
        now: SimTime,
        cycle: &mut Cycle,
    ) {
        for (at, controlled) in memory.iter_mut().enumerate().take(self.incoming.len()) {
            let Some(load) = self.incoming[at].taken.take() else {
                continue;
            };
            let (peer, ack) = (self.incoming[at].setup.peer, controlled.ack());
            self.incoming[at].contract = None;
            match self.insert(at, &load) {
                Ok(contract) => {
                    self.incoming[at].contract = contract;
                    cycle.out.push(Out::Ack(peer, ack));
                }
                Err(reason) => {
                    let register = &load.register;
                    cycle
                        .faults
                        .push(format!("{register}: {}: {reason}", load.procedure));
                    let end = ContractEnd::Refused { reason };
                    let status = controlled.say(Vec::new(), end, now);
                    cycle
                        .out
                        .extend(status.map(|status| Out::Status(peer, status, 0)));
                }
            }
        }
    }

    /// Puts a procedure on a register's timeline; its contract, if that is known already.
    fn insert(&mut self, at: usize, load: &RegisterLoad) -> Result<Option<Contract>, String> {
        let timeline = self.incoming[at].setup.timeline;
        let model = self.service.model().clone();
        let predicate = wording::procedure(&model, timeline, &load.procedure);
        let predicate = predicate.map_err(|error| error.to_string())?;
        let inputs = wording::inputs(&model, predicate, &load.inputs);
        let inputs = inputs.map_err(|error| error.to_string())?;
        // Where nothing was asked for it says its default: if that is what is asked for, it goes on.
        let is_default = model.timelines[timeline].default.as_ref();
        let is_default = is_default.is_some_and(|default| default.predicate == predicate);
        let present = self.service.present(timeline).filter(|present| {
            let known = present.parameters.iter().take(inputs.len());
            is_default
                && present.predicate == predicate
                && known.eq(inputs
                    .iter()
                    .map(|value| Some(*value))
                    .collect::<Vec<_>>()
                    .iter())
        });
        if let Some(present) = present {
            return Ok(Some(present.contract));
        }
        let inserted = self.service.insert_goal(timeline, predicate, &inputs);
        inserted.map_err(|refusal| refusal.to_string())?;
        self.tell_asked(predicate, &inputs);
        Ok(None)
    }

    /// Whoever wanted what a register says is gone: it says its default, if it may.
    pub(super) fn take_back(&mut self, at: usize, why: &str, cycle: &mut Cycle) {
        let one = &mut self.incoming[at];
        let Some(contract) = one.contract else {
            return;
        };
        let model = self.service.model().clone();
        let default = model.timelines[one.setup.timeline].default.as_ref();
        let present = self.service.present(one.setup.timeline);
        let Some(present) = present.filter(|present| present.contract == contract) else {
            return;
        };
        if default.is_some_and(|default| default.predicate == present.predicate) {
            return;
        }
        if self.service.cancel(contract).is_ok() {
            let name = &self.incoming[at].setup.name;
            let procedure = &model.predicates[present.predicate].name;
            cycle.faults.push(format!(
                "{name}: {procedure} taken back: who wanted it {why}"
            ));
        }
    }

    /// Says of contracts what has become of them.
    pub(super) fn answer(&mut self, memory: &mut [Controlled], now: SimTime, cycle: &mut Cycle) {
        let model = self.service.model().clone();
        for (at, one) in self.incoming.iter_mut().enumerate() {
            let timeline = one.setup.timeline;
            let is_open = memory[at].is_open();
            if is_open && one.contract.is_none() {
                // The token that begins with this cycle is the one that was asked for.
                let mine = |contract: Contract| usize::from(contract.timeline) == timeline;
                let begun = cycle
                    .begun
                    .iter()
                    .map(|token| token.contract)
                    .find(|at| mine(*at));
                one.contract = begun;
            }
            let Some(contract) = one.contract.filter(|_| is_open) else {
                continue;
            };
            let Some(ended) = cycle.ended.iter().find(|token| token.contract == contract) else {
                continue;
            };
            let inputs = model.predicates[ended.predicate].inputs;
            let outputs = ended.parameters.iter().enumerate().skip(inputs);
            let outputs = outputs
                .map(|(place, value)| {
                    value.map(|value| wording::encode(&model, ended.predicate, place, value))
                })
                .collect();
            cycle.answered.push((one.setup.name.clone(), ended.clone()));
            let status = memory[at].say(outputs, ContractEnd::Ended, now);
            cycle
                .out
                .extend(status.map(|status| Out::Status(one.setup.peer, status, 0)));
        }
    }
}
