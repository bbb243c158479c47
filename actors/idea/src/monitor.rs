//! The monitor: keeps what agents, relays and rovers recorded, for the results, and ends the run when
//! all goals are settled. It sees committed records only, and never an actor.

mod driving;
mod load;

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use farside::record::{Flow, Observer, ObserverError, Record, RecordClass, Wants};
use farside::{RunInfo, SimDuration, SimTime};

use crate::records::{AgentCycle, AgentFaulty, GoalEnded, GoalGivenUp, TimelineSays};
pub(crate) use driving::Driving;
pub(crate) use load::{Bin, Cause, Load};

/// What is watched.
#[derive(Clone, Debug)]
pub(crate) struct Watched {
    /// All agents.
    pub(crate) agents: Vec<WatchedAgent>,
    /// All rovers.
    pub(crate) rovers: Vec<WatchedRover>,
    /// How many goals there are, over all rovers.
    pub(crate) goals: usize,
    /// Whether the run ends when all of them are settled.
    pub(crate) ends: bool,
    /// How long a bin of the series is.
    pub(crate) bin: SimDuration,
}

/// An agent.
#[derive(Clone, Debug)]
pub(crate) struct WatchedAgent {
    /// Its actor.
    pub(crate) name: String,
    pub(crate) latency: SimDuration,
    /// The register on which it is given goals for a rover.
    pub(crate) goals: String,
    /// Whether it gives commands to a rover.
    pub(crate) commands: bool,
}

/// A rover.
#[derive(Clone, Debug)]
pub(crate) struct WatchedRover {
    /// Its relay's actor.
    pub(crate) relay: String,
    /// Its hardware's actor.
    pub(crate) hardware: String,
    /// After so long without a word from it the rover must stand still.
    pub(crate) lease: SimDuration,
}

/// What is known of a run.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    /// By agent.
    pub(crate) agents: Vec<AgentTally>,
    /// By rover: for how long it drove after its lease had ended.
    pub(crate) driving: Vec<Driving>,
    /// Goals that a system agent reported as done, and how often.
    pub(crate) done: BTreeMap<String, u32>,
    /// Goals that were given up.
    pub(crate) given_up: u32,
    /// When the last of them was done for the first time.
    pub(crate) last_done: Option<SimTime>,
}

/// What is known of an agent.
#[derive(Debug, Default)]
pub(crate) struct AgentTally {
    pub(crate) cycles: u64,
    pub(crate) aborted: u64,
    pub(crate) decisions: u64,
    pub(crate) backtracks: u64,
    pub(crate) stale: u64,
    pub(crate) operations: u64,
    pub(crate) deliberation: u64,
    pub(crate) tokens: u32,
    pub(crate) max_response_ns: u64,
    pub(crate) max_cost_ns: u64,
    pub(crate) max_operations: u64,
    pub(crate) busy_ns: u64,
    pub(crate) faulty: u32,
    pub(crate) alarms: u32,
    pub(crate) recoveries: u32,
    pub(crate) load: Load,
}

/// What an actor of the run is.
#[derive(Clone, Copy)]
enum Role {
    Other,
    Agent(usize),
    /// Its relay or its hardware.
    Rover(usize),
}

/// Watches a run.
pub(crate) struct Monitor {
    watched: Watched,
    tally: Arc<Mutex<Tally>>,
    roles: Vec<Role>,
}

impl Monitor {
    /// A monitor, and what it will write to.
    pub(crate) fn new(watched: Watched) -> (Monitor, Arc<Mutex<Tally>>) {
        let agents = watched.agents.iter().map(|_| AgentTally {
            load: Load::new(watched.bin),
            ..AgentTally::default()
        });
        let tally = Arc::new(Mutex::new(Tally {
            agents: agents.collect(),
            driving: watched
                .rovers
                .iter()
                .map(|rover| Driving::new(rover.lease))
                .collect(),
            ..Tally::default()
        }));
        let monitor = Monitor {
            watched,
            tally: tally.clone(),
            roles: Vec::new(),
        };
        (monitor, tally)
    }

    fn role(&self, name: &str) -> Role {
        let agent = self.watched.agents.iter().position(|one| one.name == name);
        let mut rovers = self.watched.rovers.iter();
        let rover = rovers.position(|one| one.relay == name || one.hardware == name);
        match (agent, rover) {
            (Some(agent), _) => Role::Agent(agent),
            (None, Some(rover)) => Role::Rover(rover),
            (None, None) => Role::Other,
        }
    }

    /// What an agent recorded.
    fn agent(
        &self,
        at: usize,
        record: &Record<'_>,
    ) -> Result<Flow, farside::encoding::DecodeError> {
        let Some(kind) = record.kind else {
            return Ok(Flow::Continue);
        };
        let mut tally = self.tally.lock().unwrap_or_else(PoisonError::into_inner);
        let watched = &self.watched.agents[at];
        match kind.name() {
            "AgentCycle" => {
                let cycle: AgentCycle = kind.schema().decode(record.body)?;
                tally.agents[at].count(&cycle, record.time(), watched);
            }
            "AgentFaulty" => {
                let _: AgentFaulty = kind.schema().decode(record.body)?;
                tally.agents[at].faulty += 1;
            }
            "TimelineSays" => {
                let says: TimelineSays = kind.schema().decode(record.body)?;
                tally.agents[at].hear(&says, record.time());
            }
            "GoalGivenUp" => {
                let _: GoalGivenUp = kind.schema().decode(record.body)?;
                tally.given_up += 1;
                return Ok(self.end(&tally));
            }
            "GoalEnded" => {
                let ended: GoalEnded = kind.schema().decode(record.body)?;
                return Ok(self.goal(&mut tally, at, &ended, record.time()));
            }
            _ => {}
        }
        Ok(Flow::Continue)
    }

    /// A goal of somebody has ended.
    fn goal(&self, tally: &mut Tally, at: usize, ended: &GoalEnded, now: SimTime) -> Flow {
        let watched = &self.watched.agents[at];
        let is_done = ended.outputs.first().is_some_and(|status| status == "ok");
        if !watched.commands || !is_done || ended.register != watched.goals {
            return Flow::Continue;
        }
        let times = tally
            .done
            .entry(format!("{}: {}", watched.name, ended.goal))
            .or_default();
        *times += 1;
        if *times == 1 {
            tally.last_done = Some(now);
        }
        self.end(tally)
    }

    /// Ends the run when all goals are settled.
    fn end(&self, tally: &Tally) -> Flow {
        let given_up = tally.given_up as usize;
        if !self.watched.ends || tally.done.len() + given_up < self.watched.goals {
            return Flow::Continue;
        }
        Flow::Stop(match given_up {
            0 => "all goals are achieved".to_owned(),
            _ => format!("all goals are achieved but {given_up}, which were given up"),
        })
    }

    fn rover(&self, at: usize, record: &Record<'_>) {
        let mut tally = self.tally.lock().unwrap_or_else(PoisonError::into_inner);
        tally.driving[at].record(record);
    }
}

impl AgentTally {
    fn count(&mut self, cycle: &AgentCycle, at: SimTime, watched: &WatchedAgent) {
        self.cycles += 1;
        self.aborted += u64::from(cycle.aborted);
        self.decisions += u64::from(cycle.decisions);
        self.backtracks += u64::from(cycle.backtracks);
        self.stale += u64::from(cycle.stale);
        self.operations += cycle.operations;
        self.deliberation += cycle.deliberation;
        self.tokens = self.tokens.max(cycle.tokens);
        self.max_response_ns = self.max_response_ns.max(cycle.response_ns);
        self.max_operations = self.max_operations.max(cycle.operations);
        self.max_cost_ns = self.max_cost_ns.max(cycle.cost_ns);
        self.busy_ns += cycle.cost_ns.min(watched.latency.as_nanos());
        self.load.cycle(cycle, at, watched.latency);
    }

    /// What a timeline of the K9's models says.
    fn hear(&mut self, says: &TimelineSays, at: SimTime) {
        self.alarms += u32::from(says.is_alarm());
        // A rover is nominal at the start, and again when it has resumed.
        let is_nominal = says.timeline == "MotionMonitor_SV" && says.says == "Nominal";
        self.recoveries += u32::from(is_nominal && at > SimTime::ZERO);
        match Cause::of(says) {
            Cause::None => {}
            cause => self.load.cause(cause, at),
        }
    }
}

impl Observer for Monitor {
    fn wants(&self) -> Wants {
        Wants {
            bodies: true,
            samples: true,
            checkpoints: false,
        }
    }

    fn begin(&mut self, run: &Arc<RunInfo>) -> Result<(), ObserverError> {
        self.roles = run
            .entities
            .iter()
            .map(|one| self.role(&one.name))
            .collect();
        Ok(())
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        // What is told comes from outside; a message counts where it arrives.
        let who = match record.class {
            RecordClass::Sample => record.sender,
            _ => record.receiver,
        };
        match (record.class, self.roles[who.index()]) {
            (RecordClass::Sample, Role::Agent(at)) => {
                let failed =
                    |error: farside::encoding::DecodeError| ObserverError(error.to_string());
                return self.agent(at, record).map_err(failed);
            }
            (_, Role::Rover(rover)) => self.rover(rover, record),
            _ => {}
        }
        Ok(Flow::Continue)
    }
}
