//! Registers whose procedures the agent sets: what others say of them, and what they are to say next.

use super::{Cycle, Out, RegisterSetup, Runner};
use crate::register::{Backoff, ContractEnd, Controlling, Heard, RegisterAck, RegisterStatus};
use crate::service::{Contract, Refusal};
use crate::wording;
use farside::SimTime;

/// A register whose procedure the agent sets.
pub(super) struct Outgoing {
    pub(super) setup: RegisterSetup,
    pub(super) controlling: Controlling,
    /// The token that it says, once one was loaded.
    contract: Option<Contract>,
    /// A status that was heard in this cycle, and is not acknowledged yet.
    unanswered: Option<RegisterAck>,
}

impl Outgoing {
    pub(super) fn new(setup: RegisterSetup, epoch: u32, backoff: Backoff) -> Self {
        let controlling = Controlling::new(setup.name.clone(), epoch, backoff);
        Outgoing {
            setup,
            controlling,
            contract: None,
            unanswered: None,
        }
    }

    pub(super) fn acknowledged(&mut self, peer: usize, ack: &RegisterAck) {
        if self.setup.peer == peer && self.setup.name == ack.register {
            self.controlling.acknowledged(ack);
        }
    }
}

impl Runner {
    /// Posts a status; whether it is news.
    pub(super) fn post_status(
        &mut self,
        peer: usize,
        status: &RegisterStatus,
        cycle: &mut Cycle,
    ) -> bool {
        let mine = |one: &Outgoing| one.setup.peer == peer && one.setup.name == status.register;
        let Some(at) = self.outgoing.iter().position(mine) else {
            let register = &status.register;
            cycle.faults.push(format!(
                "a status for {register}, which is no register of mine"
            ));
            return false;
        };
        let one = &mut self.outgoing[at];
        let heard = one.controlling.status(status);
        one.unanswered = Some(Controlling::ack(status));
        match heard {
            Heard::Stale => {
                cycle.stale += 1;
                false
            }
            Heard::Answer { outputs, end } => {
                let (timeline, contract) = (one.setup.timeline, (status.epoch, status.number));
                self.hear_late(timeline, contract, &outputs, &end);
                true
            }
            Heard::Again => false,
            Heard::News { outputs, end } => match end {
                ContractEnd::Open | ContractEnd::Ended => {
                    let ends = end == ContractEnd::Ended;
                    self.bind(at, &outputs, ends, cycle);
                    true
                }
                ContractEnd::Fault => {
                    self.fault(at, "could not go on", cycle);
                    true
                }
                ContractEnd::Refused { reason } => {
                    self.fault(at, &format!("refused: {reason}"), cycle);
                    true
                }
            },
        }
    }

    /// Binds the outputs of a register's contract.
    fn bind(
        &mut self,
        at: usize,
        outputs: &[Option<crate::register::RegisterValue>],
        ends: bool,
        cycle: &mut Cycle,
    ) {
        let one = &self.outgoing[at];
        let Some(contract) = one.contract else {
            return;
        };
        let present = self.service.present(one.setup.timeline);
        let Some(present) = present.filter(|present| present.contract == contract) else {
            // A timer or a rule has ended it here.
            cycle.stale += 1;
            return;
        };
        let model = self.service.model().clone();
        let why = match wording::outputs(&model, present.predicate, outputs) {
            Ok(values) => match self.service.bind(contract, &values, ends) {
                Ok(()) => return,
                Err(Refusal::Dead { .. }) => {
                    cycle.stale += 1;
                    return;
                }
                Err(refusal) => refusal.to_string(),
            },
            Err(error) => error.to_string(),
        };
        self.fault(at, &why, cycle);
    }

    /// The contract of a register is faulted: its outputs say `FAULT`, where their types have it.
    /// Others end by their timers.
    pub(super) fn fault(&mut self, at: usize, why: &str, cycle: &mut Cycle) {
        let one = &self.outgoing[at];
        let Some(contract) = one.contract else {
            return;
        };
        let present = self.service.present(one.setup.timeline);
        let Some(present) = present.filter(|present| present.contract == contract) else {
            return;
        };
        let model = self.service.model().clone();
        let outputs = wording::named_outputs(&model, present.predicate, "FAULT");
        if outputs.iter().all(Option::is_none) {
            return;
        }
        if self.service.bind(contract, &outputs, true).is_ok() {
            let name = &self.outgoing[at].setup.name;
            let procedure = &model.predicates[present.predicate].name;
            cycle.faults.push(format!("{name}: {procedure} {why}"));
        }
    }

    /// Loads what has begun into registers.
    pub(super) fn load(&mut self, now: SimTime, cycle: &mut Cycle) {
        let model = self.service.model().clone();
        for at in 0..self.outgoing.len() {
            let one = &mut self.outgoing[at];
            // Of several that began within the cycle the last one is what it says now.
            let mine = |token: &&crate::service::Started| {
                usize::from(token.contract.timeline) == one.setup.timeline
            };
            let Some(token) = cycle.begun.iter().rev().find(mine) else {
                continue;
            };
            let predicate = &model.predicates[token.predicate];
            let inputs = token.parameters.iter().enumerate().take(predicate.inputs);
            let inputs = inputs
                .filter_map(|(place, value)| {
                    Some(wording::encode(&model, token.predicate, place, (*value)?))
                })
                .collect();
            one.contract = Some(token.contract);
            // A new procedure acknowledges the end of the one before.
            one.unanswered = None;
            let load = one
                .controlling
                .load(predicate.name.as_str().into(), inputs, now);
            let (peer, timeline) = (one.setup.peer, one.setup.timeline);
            self.tell_loaded(timeline, &load);
            cycle.out.push(Out::Load(peer, load, 0));
        }
    }

    /// Acknowledges statuses that no new procedure acknowledges.
    pub(super) fn acknowledge(&mut self, cycle: &mut Cycle) {
        for one in &mut self.outgoing {
            if let Some(ack) = one.unanswered.take() {
                cycle.out.push(Out::Ack(one.setup.peer, ack));
            }
        }
    }
}
