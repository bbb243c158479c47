//! The plan runner: wakes at multiples of its agent's latency λ, and turns what has arrived before into
//! what registers say next (section 2 of the IDEA paper).
//!
//! A cycle at kλ reads what was delivered at t < kλ, all of it and nothing else, in an order that does
//! not depend on who was handled first at one instant. What it decides leaves at kλ + c, where c is
//! what its operations take on the host's processor; that, and what happens when c ≥ λ, is the
//! agent's affair.
//!
//! Within a cycle comes first what others said of their ends (statuses), then what must be faulted
//! (agents that are off-line, leases), then goals; timers, safety, commands and defaults are the plan
//! service's, in that order. A status therefore beats a timer or a goal of the same cycle.

mod deliberation;
mod incoming;
mod outgoing;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use farside::{SimDuration, SimTime};
use farside_planning::Ticks;
use farside_planning::model::{Model, TimelineId};
use thiserror::Error;

use crate::deliberator::{GivenUp, SharedDeliberator};
use crate::register::{
    AgentOffline, Backoff, Controlled, RegisterAck, RegisterLoad, RegisterStatus,
};
use crate::service::{Ended, NoPlan, Outcome, PlanService, Started};
use deliberation::Deliberation;
use incoming::Incoming;
use outgoing::Outgoing;

/// How a plan runner works.
#[derive(Clone, Copy, Debug)]
pub struct RunnerSettings {
    /// λ: how long a tick is.
    pub latency: SimDuration,
    /// How many ticks ahead the reactive planner plans; 1 is what registers say next.
    pub horizon: Ticks,
    /// A cycle that takes more operations than this is aborted.
    pub budget: u64,
    /// What a cycle takes beside planning \[operations\].
    pub overhead: u64,
    /// So many cycles in a row may be aborted: with one more the agent is faulty.
    pub aborts: u32,
    /// When what was not acknowledged is said again.
    pub backoff: Backoff,
    /// Whether the past is deleted after each cycle (section 4).
    pub forgets: bool,
}

/// Which side of a register the agent is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// It sets the procedure.
    Controlling,
    /// It carries the procedure out, and sets the status.
    Controlled,
}

/// A register of an agent.
#[derive(Clone, Debug)]
pub struct RegisterSetup {
    /// Its name, the same on both sides.
    pub name: Arc<str>,
    /// The timeline that it is.
    pub timeline: TimelineId,
    /// Which side the agent is.
    pub side: Side,
    /// Who is on the other side, by the agent's numbering of those that it talks to.
    pub peer: usize,
    /// After so long without a word from the other side its contract is faulted; with 0, never.
    pub lease: SimDuration,
    /// Whether it says nothing but polls, again and again: then what it says is not recorded beside
    /// the statuses.
    pub is_polled: bool,
}

/// Why an agent cannot be.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum RunnerError {
    /// Two registers are one timeline, or have one name.
    #[error("register {register}: {what} is another register's already")]
    Twice {
        /// The register.
        register: String,
        /// What two have.
        what: &'static str,
    },
    /// A timeline of the model that a register cannot be.
    #[error("register {register}: {timeline} has no default, so that it could be empty")]
    NoDefault {
        /// The register.
        register: String,
        /// The timeline.
        timeline: String,
    },
    /// λ is zero.
    #[error("the latency is 0")]
    NoLatency,
}

/// What has arrived.
#[derive(Clone, Debug)]
pub enum Arrival {
    /// A register is to say something.
    Load(RegisterLoad),
    /// News of a contract.
    Status(RegisterStatus),
    /// Something was heard.
    Ack(RegisterAck),
    /// Somebody is off-line.
    Offline(AgentOffline),
}

impl Arrival {
    /// In which order a cycle reads what arrived at one instant.
    fn order(&self) -> (u8, &str, u32, u32, u32) {
        match self {
            Arrival::Ack(ack) => (0, &ack.register, ack.epoch, ack.number, 0),
            Arrival::Status(status) => {
                let RegisterStatus { epoch, number, .. } = *status;
                (1, &status.register, epoch, number, status.revision)
            }
            Arrival::Offline(offline) => (2, "", offline.epoch, 0, 0),
            Arrival::Load(load) => (3, &load.register, load.epoch, load.number, 0),
        }
    }
}

/// What is to be sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Out {
    /// To the peer: a load, and how often it was sent before.
    Load(usize, RegisterLoad, u32),
    /// To the peer: a status, and how often it was sent before.
    Status(usize, RegisterStatus, u32),
    /// To the peer: an acknowledgement.
    Ack(usize, RegisterAck),
}

/// How a cycle ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Every register says something.
    Decided,
    /// It would have taken too many operations. Nothing was decided; what it was told still stands.
    Aborted,
    /// The model allows nothing.
    NoPlan(NoPlan),
}

/// What came of a cycle.
#[derive(Clone, Debug)]
pub struct Cycle {
    /// k.
    pub tick: u64,
    /// How it ended.
    pub verdict: Verdict,
    /// What it took.
    pub operations: u64,
    /// Decisions of the planner, and those taken back.
    pub decisions: u64,
    /// Decisions that were taken back.
    pub backtracks: u64,
    /// Tokens that are kept.
    pub tokens: u64,
    /// Goals that were taken.
    pub goals: u32,
    /// Statuses for contracts that were over.
    pub stale: u32,
    /// What arrived and meant nothing to the model, and contracts that were faulted.
    pub faults: Vec<String>,
    /// When the first of the news arrived that the cycle has answered, if there was any.
    pub stimulus: Option<SimTime>,
    /// What is to be sent at kλ + c.
    pub out: Vec<Out>,
    /// Tokens that have begun.
    pub begun: Vec<Started>,
    /// Tokens that have ended.
    pub ended: Vec<Ended>,
    /// Contracts of others that have ended: which register, and how.
    pub answered: Vec<(Arc<str>, Ended)>,
    /// Goals that deliberation has given up.
    pub given_up: Vec<GivenUp>,
    /// What deliberation has to say to people.
    pub remarks: Vec<String>,
}

/// A plan runner, with the plan database that it runs.
pub struct Runner {
    settings: RunnerSettings,
    service: Box<dyn PlanService>,
    outgoing: Vec<Outgoing>,
    incoming: Vec<Incoming>,
    deliberation: Option<Deliberation>,
    /// What was delivered, and by whom; read in the next cycle that starts later.
    arrivals: Vec<(SimTime, usize, Arrival)>,
    /// By peer: when it was last heard of, and when something was last sent to it.
    heard: Vec<SimTime>,
    told: Vec<SimTime>,
    aborted_in_a_row: u32,
}

impl Runner {
    /// A plan runner in its life `epoch`, from 1, which begins at `now`, with registers to so many
    /// peers.
    ///
    /// # Errors
    ///
    /// If registers share a name or a timeline, or a timeline cannot be a register.
    pub fn new(
        settings: RunnerSettings,
        service: Box<dyn PlanService>,
        registers: &[RegisterSetup],
        epoch: u32,
        now: SimTime,
    ) -> Result<Self, RunnerError> {
        check(&settings, service.model(), registers)?;
        let peers = registers.iter().map(|one| one.peer + 1).max().unwrap_or(0);
        let mut runner = Runner {
            settings,
            service,
            outgoing: Vec::new(),
            incoming: Vec::new(),
            deliberation: None,
            arrivals: Vec::new(),
            heard: vec![now; peers],
            told: vec![now; peers],
            aborted_in_a_row: 0,
        };
        for setup in registers {
            match setup.side {
                Side::Controlling => {
                    let out = Outgoing::new(setup.clone(), epoch, settings.backoff);
                    runner.outgoing.push(out);
                }
                Side::Controlled => runner.incoming.push(Incoming::new(setup.clone())),
            }
        }
        Ok(runner)
    }

    /// With a deliberative planner beside the cycles. What it has to know of a former life is asked for.
    #[must_use]
    pub fn with_deliberator(mut self, deliberator: SharedDeliberator) -> Self {
        let deliberation = Deliberation::new(deliberator);
        if let Some((timeline, contract)) = deliberation.unresolved() {
            let mut registers = self.outgoing.iter_mut();
            if let Some(one) = registers.find(|one| one.setup.timeline == timeline) {
                one.controlling.ask(contract);
            }
        }
        self.deliberation = Some(deliberation);
        self
    }

    /// What a register's controlled side keeps, for an agent that was never alive before.
    pub fn memory(&self) -> Vec<Controlled> {
        let each = self.incoming.iter();
        each.map(|one| Controlled::new(one.setup.name.clone(), self.settings.backoff))
            .collect()
    }

    /// The model.
    pub fn model(&self) -> &Arc<Model> {
        self.service.model()
    }

    /// Keeps what was delivered at an instant.
    pub fn arrive(&mut self, at: SimTime, peer: usize, what: Arrival) {
        if let Some(heard) = self.heard.get_mut(peer) {
            *heard = at;
        }
        self.arrivals.push((at, peer, what));
    }

    /// What is said of each contract after a restart: that it is faulted, or once more how it ended.
    pub fn restarted(&self, memory: &mut [Controlled], now: SimTime) -> Vec<Out> {
        let each = self.incoming.iter().zip(memory);
        each.filter_map(|(one, controlled)| {
            let status = controlled.restarted(now)?;
            Some(Out::Status(one.setup.peer, status, 0))
        })
        .collect()
    }

    /// What was delivered before an instant, in the order of its times, and of registers and numbers
    /// at one time.
    fn read(&mut self, now: SimTime) -> Vec<(SimTime, usize, Arrival)> {
        let (mut read, left) = std::mem::take(&mut self.arrivals)
            .into_iter()
            .partition::<Vec<_>, _>(|(at, ..)| *at < now);
        self.arrivals = left;
        read.sort_by(|a, b| (a.0, a.1, a.2.order()).cmp(&(b.0, b.1, b.2.order())));
        read
    }

    /// The cycle at kλ, which is `now`. `memory` is what [`Runner::memory`] gave, kept over restarts.
    pub fn cycle(&mut self, tick: u64, now: SimTime, memory: &mut [Controlled]) -> Cycle {
        let before = self.service.counters();
        let mut cycle = Cycle::new(tick);
        let mut news = None;
        self.service
            .advance(Ticks::try_from(tick).unwrap_or(Ticks::MAX));
        self.finish_deliberation(&mut cycle);
        for (at, peer, arrival) in self.read(now) {
            if self.post(peer, arrival, memory, now, &mut cycle) {
                news = news.or(Some(at));
            }
        }
        self.end_leases(now, &mut cycle);
        self.insert_goals(memory, now, &mut cycle);
        cycle.verdict = match self
            .service
            .solve(self.settings.horizon, self.settings.budget)
        {
            Outcome::Decided => Verdict::Decided,
            Outcome::OverBudget => Verdict::Aborted,
            Outcome::NoPlan(why) => Verdict::NoPlan(why),
        };
        if cycle.verdict == Verdict::Decided {
            self.aborted_in_a_row = 0;
            cycle.begun.extend_from_slice(self.service.started());
            cycle.ended.extend_from_slice(self.service.ended());
            self.answer(memory, now, &mut cycle);
            self.load(now, &mut cycle);
            let is_answer = |out: &Out| !matches!(out, Out::Ack(..));
            cycle.stimulus = news.filter(|_| cycle.out.iter().any(is_answer));
            self.begin_deliberation(&mut cycle);
            if self.settings.forgets {
                self.service.forget(self.service.now());
            }
        } else {
            self.aborted_in_a_row += 1;
        }
        self.acknowledge(&mut cycle);
        self.say_again(memory, now, &mut cycle);
        let after = self.service.counters();
        cycle.operations = after.operations - before.operations + self.settings.overhead;
        cycle.decisions = after.decisions - before.decisions;
        cycle.backtracks = after.backtracks - before.backtracks;
        cycle.tokens = after.tokens;
        cycle
    }

    /// Whether too many cycles in a row were aborted.
    pub fn is_overrun(&self) -> bool {
        self.aborted_in_a_row > self.settings.aborts
    }

    /// Posts what has arrived; whether it is news.
    fn post(
        &mut self,
        peer: usize,
        arrival: Arrival,
        memory: &mut [Controlled],
        now: SimTime,
        cycle: &mut Cycle,
    ) -> bool {
        match arrival {
            Arrival::Ack(ack) => {
                self.outgoing
                    .iter_mut()
                    .for_each(|one| one.acknowledged(peer, &ack));
                for (one, controlled) in self.incoming.iter().zip(memory) {
                    if one.setup.peer == peer && one.setup.name == ack.register {
                        controlled.acknowledged(&ack);
                    }
                }
                false
            }
            Arrival::Status(status) => {
                !self.answer_question(peer, &status, memory, cycle)
                    && self.post_status(peer, &status, cycle)
            }
            Arrival::Load(load) => self.take(peer, load, memory, now, cycle),
            Arrival::Offline(offline) => {
                let why = format!("is off-line: {}", offline.reason);
                self.fault_peer(peer, &why, cycle);
                true
            }
        }
    }

    /// Somebody takes no part any more: what it was to do is faulted, what it wanted is taken back.
    fn fault_peer(&mut self, peer: usize, why: &str, cycle: &mut Cycle) {
        for at in 0..self.outgoing.len() {
            if self.outgoing[at].setup.peer == peer {
                self.fault(at, why, cycle);
            }
        }
        for at in 0..self.incoming.len() {
            if self.incoming[at].setup.peer == peer {
                self.take_back(at, why, cycle);
            }
        }
    }

    /// Leases that have ended.
    fn end_leases(&mut self, now: SimTime, cycle: &mut Cycle) {
        let why = "was not heard of within its lease";
        for at in 0..self.outgoing.len() {
            let setup = &self.outgoing[at].setup;
            if is_over(setup, &self.heard, now) {
                self.fault(at, why, cycle);
            }
        }
        for at in 0..self.incoming.len() {
            let setup = &self.incoming[at].setup;
            if is_over(setup, &self.heard, now) {
                self.take_back(at, why, cycle);
            }
        }
    }

    /// What was not acknowledged is said again, and where there is a lease, something is said before
    /// it ends.
    fn say_again(&mut self, memory: &mut [Controlled], now: SimTime, cycle: &mut Cycle) {
        for out in &cycle.out {
            self.told[out.peer()] = now;
        }
        for one in &mut self.outgoing {
            let (peer, lease) = (one.setup.peer, one.setup.lease);
            let third = SimDuration::from_nanos(lease.as_nanos() / 3);
            let is_silent = !lease.is_zero() && now.since(self.told[peer]) >= third;
            let again = match one.controlling.repeat(now) {
                None if is_silent => one.controlling.say_again(),
                due => due,
            };
            if let Some((load, before)) = again {
                self.told[peer] = now;
                cycle.out.push(Out::Load(peer, load, before));
            }
            if let Some((question, before)) = one.controlling.repeat_question(now) {
                self.told[peer] = now;
                cycle.out.push(Out::Status(peer, question, before));
            }
        }
        for (one, controlled) in self.incoming.iter().zip(memory) {
            if let Some((status, before)) = controlled.repeat(now) {
                cycle.out.push(Out::Status(one.setup.peer, status, before));
            }
        }
    }
}

/// Whether a register's lease has ended.
fn is_over(setup: &RegisterSetup, heard: &[SimTime], now: SimTime) -> bool {
    !setup.lease.is_zero() && now.since(heard[setup.peer]) > setup.lease
}

impl Out {
    /// Whom it is for.
    pub fn peer(&self) -> usize {
        match self {
            Out::Load(peer, ..) | Out::Status(peer, ..) | Out::Ack(peer, _) => *peer,
        }
    }
}

impl Cycle {
    fn new(tick: u64) -> Self {
        Cycle {
            tick,
            verdict: Verdict::Decided,
            operations: 0,
            decisions: 0,
            backtracks: 0,
            tokens: 0,
            goals: 0,
            stale: 0,
            faults: Vec::new(),
            stimulus: None,
            out: Vec::new(),
            begun: Vec::new(),
            ended: Vec::new(),
            answered: Vec::new(),
            given_up: Vec::new(),
            remarks: Vec::new(),
        }
    }
}

fn check(
    settings: &RunnerSettings,
    model: &Model,
    registers: &[RegisterSetup],
) -> Result<(), RunnerError> {
    if settings.latency.is_zero() {
        return Err(RunnerError::NoLatency);
    }
    for (at, setup) in registers.iter().enumerate() {
        let register = setup.name.to_string();
        let before = &registers[..at];
        if before.iter().any(|one| one.name == setup.name) {
            let what = "its name";
            return Err(RunnerError::Twice { register, what });
        }
        if before.iter().any(|one| one.timeline == setup.timeline) {
            let what = "its timeline";
            return Err(RunnerError::Twice { register, what });
        }
        let timeline = &model.timelines[setup.timeline];
        if timeline.default.is_none() && setup.side == Side::Controlled {
            let timeline = timeline.name.clone();
            return Err(RunnerError::NoDefault { register, timeline });
        }
    }
    Ok(())
}
