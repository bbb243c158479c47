//! An IDEA agent as an actor: a clock of latency λ, a [plan runner](crate::runner), a processor on
//! which its cycles take time, and messages to those on the other side of its registers.
//!
//! Decisions of the cycle at kλ leave at kλ + c, where c is what the cycle took on the processor. With
//! c ≥ λ they are not sent: at tick k + 1 the agent is *faulty*. It says so on every register and takes
//! no part any more, until it is restarted. So it is when the model allows nothing, or too many cycles
//! in a row were aborted. Peers that do not hear it act by their leases.

mod saying;

use std::sync::{Arc, PoisonError};

use farside::prelude::*;
use farside_actors::processor::{Processor, ProcessorChange};
use serde::{Deserialize, Serialize};

use crate::deliberator::SharedDeliberator;
use crate::records::{AgentCycle, AgentFaulty, AgentRemark, GoalGivenUp};
use crate::register::{AgentOffline, Controlled, RegisterAck, RegisterLoad, RegisterStatus};
use crate::runner::{
    Arrival, Cycle, Out, RegisterSetup, Runner, RunnerError, RunnerSettings, Verdict,
};
use crate::service::PlanService;
use saying::Saying;

/// What plans for an agent: made anew for each of its lives.
pub struct Mind {
    /// What it plans with.
    pub service: Box<dyn PlanService>,
    /// Who plans further ahead, if somebody does. The one of the first life is that of all others.
    pub deliberator: Option<SharedDeliberator>,
}

/// An agent that is to be.
#[derive(Clone)]
pub struct AgentSetup {
    /// How its plan runner works.
    pub runner: RunnerSettings,
    /// Its registers.
    pub registers: Vec<RegisterSetup>,
    /// The names of the actors on their other sides.
    pub peers: Vec<String>,
    /// What plans for it.
    pub mind: Arc<dyn Fn() -> Mind + Send + Sync>,
    /// What its cycles take time on.
    pub processor: Processor,
    /// After so long it begins a new life when it was faulty; with 0, never.
    pub restart_after: SimDuration,
}

impl AgentSetup {
    /// Whether its registers can be those of its model.
    ///
    /// # Errors
    ///
    /// If they share names or timelines, or a timeline cannot be a register.
    pub fn check(&self) -> Result<(), RunnerError> {
        let mind = (self.mind)();
        Runner::new(self.runner, mind.service, &self.registers, 1, SimTime::ZERO).map(drop)
    }
}

/// An IDEA agent.
pub struct Agent {
    setup: Arc<AgentSetup>,
    /// None while it is off-line.
    runner: Option<Runner>,
    peers: Vec<Peer>,
    /// What leaves when the cycle's time is over.
    leaving: Vec<Out>,
    /// Why it is faulty at the next tick.
    overdue: Option<String>,
    saying: Saying,
}

/// Somebody on the other side of registers.
struct Peer {
    loads: Recipient<RegisterLoad>,
    statuses: Recipient<RegisterStatus>,
    acks: Recipient<RegisterAck>,
    offline: Recipient<AgentOffline>,
}

/// What outlives a crash.
#[derive(Default)]
struct Memory {
    lives: u32,
    registers: Vec<Controlled>,
    deliberator: Option<SharedDeliberator>,
}

/// Timer: the clock ticks. It carries what the cycle before took, so that two runs whose cycles take
/// other numbers of operations differ in their digest, whether or not that takes time.
#[derive(Serialize, Deserialize)]
#[doc(hidden)]
pub struct AgentTick {
    tick: u64,
    spent_operations: u64,
}

/// Timer: what was decided leaves.
#[derive(Serialize, Deserialize)]
#[doc(hidden)]
pub struct DecisionsLeave;

/// Timer: a faulty agent begins a new life.
#[derive(Serialize, Deserialize)]
#[doc(hidden)]
pub struct AgentRestarts;

impl Agent {
    /// An agent. Its setup is to be [checked](AgentSetup::check) before: what is wrong with it ends
    /// the run.
    pub fn new(setup: Arc<AgentSetup>) -> Self {
        Agent {
            setup,
            runner: None,
            peers: Vec::new(),
            leaving: Vec::new(),
            overdue: None,
            saying: Saying::default(),
        }
    }

    /// Begins a life: the registers say their defaults from the next tick on.
    fn begin(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        let mut memory = std::mem::take(ctx.durable::<Memory>());
        memory.lives += 1;
        self.overdue = None;
        self.leaving.clear();
        let now = ctx.now();
        let mind = (self.setup.mind)();
        let (settings, registers) = (self.setup.runner, &self.setup.registers);
        let runner = Runner::new(settings, mind.service, registers, memory.lives, now);
        let mut runner = runner.map_err(|error| HandlerError::new(error.to_string()))?;
        match &memory.deliberator {
            Some(known) => known
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .restarted(),
            None => memory.deliberator = mind.deliberator,
        }
        if let Some(deliberator) = &memory.deliberator {
            runner = runner.with_deliberator(deliberator.clone());
        }
        if memory.registers.is_empty() {
            memory.registers = runner.memory();
        } else {
            let out = runner.restarted(&mut memory.registers, now);
            self.send(ctx, out);
        }
        *ctx.durable::<Memory>() = memory;
        self.saying = Saying::new(runner.model(), registers);
        self.runner = Some(runner);
        let latency_ns = self.setup.runner.latency.as_nanos();
        let tick = now.as_nanos().div_ceil(latency_ns);
        self.set_clock(ctx, tick, 0);
        Ok(())
    }

    fn set_clock(&self, ctx: &mut Context<'_, Self>, tick: u64, spent_operations: u64) {
        let at = SimTime::ZERO + self.setup.runner.latency * tick;
        let clock = AgentTick {
            tick,
            spent_operations,
        };
        ctx.timer(at.since(ctx.now()), clock);
    }

    /// Keeps what was delivered for the next cycle that begins later.
    fn arrive(&mut self, register: &str, what: Arrival, ctx: &Context<'_, Self>) {
        let registers = &self.setup.registers;
        let peer = registers.iter().find(|one| &*one.name == register);
        let peer = peer.map_or(usize::MAX, |one| one.peer);
        if let Some(runner) = &mut self.runner {
            runner.arrive(ctx.now(), peer, what);
        }
    }

    fn send(&self, ctx: &mut Context<'_, Self>, out: Vec<Out>) {
        let place = |register: &str| {
            let registers = &self.setup.registers;
            registers
                .iter()
                .position(|one| &*one.name == register)
                .unwrap_or(0) as u32
        };
        for out in out {
            let peer = &self.peers[out.peer()];
            match out {
                Out::Load(_, load, before) => {
                    let key = key(load.number, place(&load.register), load.epoch, before);
                    ctx.send_keyed(peer.loads, key, load);
                }
                Out::Status(_, status, before) => {
                    let key = key(status.number, place(&status.register), status.epoch, before);
                    ctx.send_keyed(peer.statuses, key, status);
                }
                Out::Ack(_, ack) => ctx.send(peer.acks, ack),
            }
        }
    }

    /// Takes no part any more.
    fn go_offline(&mut self, tick: u64, reason: String, ctx: &mut Context<'_, Self>) {
        self.runner = None;
        self.leaving.clear();
        self.overdue = None;
        let epoch = ctx.durable::<Memory>().lives;
        for peer in &self.peers {
            let offline = AgentOffline {
                agent: ctx.name().into(),
                epoch,
                tick,
                reason: reason.clone(),
            };
            ctx.send(peer.offline, offline);
        }
        ctx.sample(&AgentFaulty { tick, reason });
        if !self.setup.restart_after.is_zero() {
            ctx.timer(self.setup.restart_after, AgentRestarts);
        }
    }

    /// What follows from a cycle that took so long on the processor.
    fn conclude(&mut self, mut cycle: Cycle, ctx: &mut Context<'_, Self>) {
        let latency = self.setup.runner.latency;
        let cost = self.setup.processor.time_for(ctx.now(), cycle.operations);
        let leaves = ctx.now() + cost;
        let is_late = cost >= latency;
        let rest = latency.saturating_sub(cost);
        let idle = self.setup.processor.operations_in(leaves, rest);
        let Some(runner) = &mut self.runner else {
            return;
        };
        let deliberation = if is_late { 0 } else { runner.deliberate(idle) };
        let response = cycle.stimulus.filter(|_| !is_late);
        let response_ns = response.map_or(0, |stimulus| leaves.since(stimulus).as_nanos());
        if ctx.samples_wanted() {
            ctx.sample(&AgentCycle {
                tick: cycle.tick,
                operations: cycle.operations,
                cost_ns: cost.as_nanos(),
                decisions: cycle.decisions as u32,
                backtracks: cycle.backtracks as u32,
                tokens: cycle.tokens as u32,
                goals: cycle.goals,
                stale: cycle.stale,
                response_ns,
                deliberation,
                aborted: cycle.verdict == Verdict::Aborted,
            });
            self.saying.record(&cycle, ctx);
        }
        let (tick, spent) = (cycle.tick, cycle.operations);
        for text in cycle.faults.drain(..).chain(cycle.remarks.drain(..)) {
            ctx.sample(&AgentRemark { tick, text });
        }
        for given_up in cycle.given_up.drain(..) {
            let (goal, reason) = (given_up.goal, given_up.reason);
            ctx.sample(&GoalGivenUp { goal, reason });
        }
        if let Verdict::NoPlan(why) = cycle.verdict {
            return self.go_offline(tick, format!("the model allows nothing: {why}"), ctx);
        }
        if runner.is_overrun() {
            let budget = self.setup.runner.budget;
            let reason = format!("too many cycles in a row took more than {budget} operations");
            return self.go_offline(tick, reason, ctx);
        }
        if is_late {
            let operations = cycle.operations;
            self.overdue = Some(format!(
                "{operations} operations took {cost}, which is not less than its latency of {latency}"
            ));
        } else if cost.is_zero() {
            self.send(ctx, cycle.out);
        } else {
            self.leaving = cycle.out;
            ctx.timer(cost, DecisionsLeave);
        }
        self.set_clock(ctx, tick + 1, spent);
    }
}

/// By what a message is known again in another run: its contract, its register, its sender's life,
/// and how often it was sent before.
pub(crate) fn key(number: u32, register: u32, epoch: u32, before: u32) -> MatchKey {
    MatchKey::new(
        number,
        register << 24 | (epoch & 0xff) << 16 | before & 0xffff,
    )
}

impl Actor for Agent {
    type Accepts = (
        RegisterLoad,
        RegisterStatus,
        RegisterAck,
        AgentOffline,
        ProcessorChange,
        AgentTick,
        DecisionsLeave,
        AgentRestarts,
    );

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        self.peers = Vec::with_capacity(self.setup.peers.len());
        for name in &self.setup.peers {
            self.peers.push(Peer {
                loads: ctx.recipient(name)?,
                statuses: ctx.recipient(name)?,
                acks: ctx.recipient(name)?,
                offline: ctx.recipient(name)?,
            });
        }
        self.begin(ctx)
    }
}

impl Handler<AgentTick> for Agent {
    fn handle(&mut self, clock: AgentTick, ctx: &mut Context<'_, Self>) -> Outcome {
        if let Some(reason) = self.overdue.take() {
            self.go_offline(clock.tick, reason, ctx);
            return Ok(());
        }
        let Some(runner) = &mut self.runner else {
            return Ok(());
        };
        let now = ctx.now();
        let memory = &mut ctx.durable::<Memory>().registers;
        let cycle = runner.cycle(clock.tick, now, memory);
        self.conclude(cycle, ctx);
        Ok(())
    }
}

impl Handler<DecisionsLeave> for Agent {
    fn handle(&mut self, _: DecisionsLeave, ctx: &mut Context<'_, Self>) -> Outcome {
        let leaving = std::mem::take(&mut self.leaving);
        self.send(ctx, leaving);
        Ok(())
    }
}

impl Handler<AgentRestarts> for Agent {
    fn handle(&mut self, _: AgentRestarts, ctx: &mut Context<'_, Self>) -> Outcome {
        self.begin(ctx)
    }
}

impl Handler<RegisterLoad> for Agent {
    fn handle(&mut self, load: RegisterLoad, ctx: &mut Context<'_, Self>) -> Outcome {
        let register = load.register.clone();
        self.arrive(&register, Arrival::Load(load), ctx);
        Ok(())
    }
}

impl Handler<RegisterStatus> for Agent {
    fn handle(&mut self, status: RegisterStatus, ctx: &mut Context<'_, Self>) -> Outcome {
        let register = status.register.clone();
        self.arrive(&register, Arrival::Status(status), ctx);
        Ok(())
    }
}

impl Handler<RegisterAck> for Agent {
    fn handle(&mut self, ack: RegisterAck, ctx: &mut Context<'_, Self>) -> Outcome {
        let register = ack.register.clone();
        self.arrive(&register, Arrival::Ack(ack), ctx);
        Ok(())
    }
}

impl Handler<AgentOffline> for Agent {
    fn handle(&mut self, offline: AgentOffline, ctx: &mut Context<'_, Self>) -> Outcome {
        let peer = self
            .setup
            .peers
            .iter()
            .position(|name| **name == *offline.agent);
        if let (Some(runner), Some(peer)) = (&mut self.runner, peer) {
            runner.arrive(ctx.now(), peer, Arrival::Offline(offline));
        }
        Ok(())
    }
}

/// The processor knew it from the start: this is for the log.
impl Handler<ProcessorChange> for Agent {
    fn handle(&mut self, _: ProcessorChange, _: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}
