//! The relay as an actor, on the rover's host: registers on one side, the hardware on the other.
//!
//! It has no clock of its own: a goal becomes a command, and an answer a status, in the instant in
//! which it comes. What it has taken and said is durable. After a restart it stops the rover and says
//! `FAULT` of what went on; so it does when the agent that controls it was not heard of within its
//! lease, or says that it is off-line.

use std::sync::Arc;

use farside::prelude::*;
use farside_actors::rover::{
    Command, CommandReport, RoverCommand, RoverQuery, RoverState, hardware_name,
};
use serde::{Deserialize, Serialize};

use super::{Relay, RelayAct, RelayTable};
use crate::register::{
    AgentOffline, Backoff, Controlled, RegisterAck, RegisterLoad, RegisterStatus, Taken,
};

/// A relay that is to be.
#[derive(Clone)]
pub struct RelaySetup {
    /// What its goals mean.
    pub table: Arc<RelayTable>,
    /// By register of the table: its name on both sides.
    pub registers: Vec<Arc<str>>,
    /// The actor that controls it.
    pub agent: String,
    /// The rover whose hardware it commands.
    pub rover: String,
    /// When what was not acknowledged is said again.
    pub backoff: Backoff,
    /// After so long without a word from the agent it stops the rover; with 0, never.
    pub lease: SimDuration,
}

/// A relay between an agent's registers and a rover's hardware.
pub struct RelayActor {
    setup: Arc<RelaySetup>,
    relay: Relay,
    to: Option<Peers>,
    /// When the agent was last heard of.
    heard: SimTime,
    /// Whether the lease has ended since.
    is_abandoned: bool,
    /// When something is to be looked after by itself.
    wakes: Option<(SimTime, TimerId)>,
}

#[derive(Clone, Copy)]
struct Peers {
    statuses: Recipient<RegisterStatus>,
    acks: Recipient<RegisterAck>,
    commands: Recipient<RoverCommand>,
    queries: Recipient<RoverQuery>,
}

/// What outlives a crash.
#[derive(Default)]
struct Memory(Vec<Controlled>);

/// Timer: something is to be said again, or the lease may have ended.
#[derive(Serialize, Deserialize)]
#[doc(hidden)]
pub struct RelayWakes;

/// A sample: a relay has stopped its rover by itself.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RelayStopped {
    /// Why.
    pub reason: String,
}

impl RelayActor {
    /// A relay.
    pub fn new(setup: Arc<RelaySetup>) -> Self {
        RelayActor {
            relay: Relay::new(setup.table.clone()),
            setup,
            to: None,
            heard: SimTime::ZERO,
            is_abandoned: false,
            wakes: None,
        }
    }

    fn peers(&self) -> Result<Peers, HandlerError> {
        let message = "a relay was not started";
        self.to.ok_or_else(|| HandlerError::new(message.to_owned()))
    }

    /// The register of a name, by its place.
    fn place(&self, register: &str) -> Option<usize> {
        self.setup
            .registers
            .iter()
            .position(|name| **name == *register)
    }

    /// Sends what the relay wants sent.
    fn act(&mut self, acts: Vec<RelayAct>, ctx: &mut Context<'_, Self>) -> Outcome {
        let to = self.peers()?;
        let now = ctx.now();
        for act in acts {
            match act {
                RelayAct::Command(command) => ctx.send(to.commands, command),
                RelayAct::Query(query) => ctx.send(to.queries, query),
                RelayAct::Status {
                    register,
                    contract,
                    outputs,
                    end,
                } => {
                    let controlled = &mut ctx.durable::<Memory>().0[register];
                    if controlled.contract() != contract {
                        continue;
                    }
                    if let Some(status) = controlled.say(outputs, end, now) {
                        self.say(register, status, 0, ctx)?;
                    }
                }
            }
        }
        self.set_timer(ctx);
        Ok(())
    }

    fn say(
        &self,
        register: usize,
        status: RegisterStatus,
        before: u32,
        ctx: &mut Context<'_, Self>,
    ) -> Outcome {
        let key = crate::agent::key(status.number, register as u32, status.epoch, before);
        ctx.send_keyed(self.peers()?.statuses, key, status);
        Ok(())
    }

    /// The agent was heard of.
    fn hear(&mut self, ctx: &Context<'_, Self>) {
        self.heard = ctx.now();
        self.is_abandoned = false;
    }

    /// The rover stops, since nobody controls it.
    fn abandon(&mut self, reason: &str, ctx: &mut Context<'_, Self>) -> Outcome {
        self.is_abandoned = true;
        let reason = reason.to_owned();
        ctx.sample(&RelayStopped { reason });
        let mut acts = Vec::new();
        self.relay.abandon(&mut acts);
        self.act(acts, ctx)
    }

    /// When the lease ends, if it can.
    fn lease_ends(&self) -> Option<SimTime> {
        let lease = self.setup.lease;
        (!lease.is_zero() && !self.is_abandoned).then(|| self.heard + lease)
    }

    /// Sees to it that the relay wakes when something is due. A timer that comes too early is set anew,
    /// so that not every message sets one.
    fn set_timer(&mut self, ctx: &mut Context<'_, Self>) {
        let registers = ctx.durable::<Memory>().0.iter();
        let due = registers
            .filter_map(Controlled::due)
            .chain(self.lease_ends())
            .min();
        let Some(due) = due else {
            return;
        };
        if let Some((wakes, timer)) = self.wakes {
            if wakes <= due {
                return;
            }
            ctx.cancel(timer);
        }
        let timer = ctx.timer(due.since(ctx.now()), RelayWakes);
        self.wakes = Some((due, timer));
    }
}

impl Actor for RelayActor {
    type Accepts = (
        RegisterLoad,
        RegisterStatus,
        RegisterAck,
        AgentOffline,
        CommandReport,
        RoverState,
        RelayWakes,
    );

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        let (agent, hardware) = (&self.setup.agent, hardware_name(&self.setup.rover));
        self.to = Some(Peers {
            statuses: ctx.recipient(agent)?,
            acks: ctx.recipient(agent)?,
            commands: ctx.recipient(&hardware)?,
            queries: ctx.recipient(&hardware)?,
        });
        self.heard = ctx.now();
        let memory = &mut ctx.durable::<Memory>().0;
        if memory.is_empty() {
            let backoff = self.setup.backoff;
            let names = self.setup.registers.iter();
            memory.extend(names.map(|name| Controlled::new(name.clone(), backoff)));
        } else {
            let (id, command) = (0, Command::Stop { part: None });
            ctx.send(self.peers()?.commands, RoverCommand { id, command });
            let now = ctx.now();
            let memory = ctx.durable::<Memory>().0.iter_mut();
            let said: Vec<_> = memory.map(|register| register.restarted(now)).collect();
            for (register, status) in said.into_iter().enumerate() {
                if let Some(status) = status {
                    self.say(register, status, 0, ctx)?;
                }
            }
        }
        self.set_timer(ctx);
        Ok(())
    }
}

impl Handler<RegisterLoad> for RelayActor {
    fn handle(&mut self, load: RegisterLoad, ctx: &mut Context<'_, Self>) -> Outcome {
        self.hear(ctx);
        let Some(register) = self.place(&load.register) else {
            return Ok(());
        };
        let now = ctx.now();
        let controlled = &mut ctx.durable::<Memory>().0[register];
        match controlled.take(&load, now) {
            Taken::Yes => {
                let (contract, ack) = (controlled.contract(), controlled.ack());
                let mut acts = Vec::new();
                let (procedure, inputs) = (&load.procedure, &load.inputs);
                self.relay
                    .load(now, register, contract, procedure, inputs, &mut acts);
                // A poll's answer follows at once, and acknowledges its load.
                if !self.relay.is_polled(register) {
                    ctx.send(self.peers()?.acks, ack);
                }
                self.act(acts, ctx)
            }
            Taken::Before(Some(status)) => self.say(register, status, 1, ctx),
            Taken::Before(None) => {
                let ack = controlled.ack();
                ctx.send(self.peers()?.acks, ack);
                Ok(())
            }
            Taken::Old | Taken::Early => Ok(()),
        }
    }
}

impl Handler<RegisterAck> for RelayActor {
    fn handle(&mut self, ack: RegisterAck, ctx: &mut Context<'_, Self>) -> Outcome {
        self.hear(ctx);
        if let Some(register) = self.place(&ack.register) {
            ctx.durable::<Memory>().0[register].acknowledged(&ack);
        }
        self.set_timer(ctx);
        Ok(())
    }
}

/// Relays control nobody: this is a question of a new life of the agent.
impl Handler<RegisterStatus> for RelayActor {
    fn handle(&mut self, question: RegisterStatus, ctx: &mut Context<'_, Self>) -> Outcome {
        self.hear(ctx);
        self.set_timer(ctx);
        let Some(register) = self.place(&question.register) else {
            return Ok(());
        };
        match ctx.durable::<Memory>().0[register].asked(&question) {
            Some(answer) => self.say(register, answer, 0, ctx),
            None => Ok(()),
        }
    }
}

impl Handler<AgentOffline> for RelayActor {
    fn handle(&mut self, offline: AgentOffline, ctx: &mut Context<'_, Self>) -> Outcome {
        if self.is_abandoned {
            return Ok(());
        }
        self.abandon(
            &format!("{} is off-line: {}", offline.agent, offline.reason),
            ctx,
        )
    }
}

impl Handler<CommandReport> for RelayActor {
    fn handle(&mut self, report: CommandReport, ctx: &mut Context<'_, Self>) -> Outcome {
        let mut acts = Vec::new();
        self.relay.report(&report, &mut acts);
        self.act(acts, ctx)
    }
}

impl Handler<RoverState> for RelayActor {
    fn handle(&mut self, state: RoverState, ctx: &mut Context<'_, Self>) -> Outcome {
        let mut acts = Vec::new();
        self.relay.state(&state, &mut acts);
        self.act(acts, ctx)
    }
}

impl Handler<RelayWakes> for RelayActor {
    fn handle(&mut self, _: RelayWakes, ctx: &mut Context<'_, Self>) -> Outcome {
        self.wakes = None;
        let now = ctx.now();
        if self.lease_ends().is_some_and(|ends| ends <= now) {
            let lease = self.setup.lease;
            let reason = format!("{} was not heard of for {lease}", self.setup.agent);
            self.abandon(&reason, ctx)?;
        }
        for register in 0..self.setup.registers.len() {
            if let Some((status, before)) = ctx.durable::<Memory>().0[register].repeat(now) {
                self.say(register, status, before, ctx)?;
            }
        }
        self.set_timer(ctx);
        Ok(())
    }
}
