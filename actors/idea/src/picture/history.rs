//! What a recorded run says of agents and rovers: what timelines said, what cycles cost, where rovers
//! were, which alarms and faults there were, and what became of goals.

use farside::encoding::{DecodeError, Schema, SchemaError};
use farside::record::RecordClass;
use farside_actors::figure::ground::Moment;
use farside_actors::rover::{FaultBegins, RoverPose, hardware_name};
use farside_actors::system::{PictureError, Recorded, Recording};

use crate::assemble::GoalPlace;
use crate::monitor::Cause;
use crate::outcomes::{GoalBook, GoalOutcome};
use crate::records::{AgentCycle, AgentFaulty, GoalEnded, GoalGivenUp, TimelineSays};
use crate::relay::RelayStopped;

/// What is known of a run, each part in order of time.
pub(super) struct History {
    pub(super) scenario: String,
    pub(super) seed: u64,
    pub(super) end_ns: u64,
    pub(super) agents: Vec<AgentHistory>,
    pub(super) rovers: Vec<RoverHistory>,
}

/// An agent.
pub(super) struct AgentHistory {
    pub(super) name: String,
    /// The place of its rover.
    pub(super) rover: usize,
    pub(super) latency_ns: u64,
    /// Whether it commands the rover.
    pub(super) is_system: bool,
    pub(super) lanes: Vec<Lane>,
    pub(super) cycles: Vec<(u64, AgentCycle)>,
    /// When something made a cycle dear, and what.
    pub(super) causes: Vec<(u64, Cause)>,
}

/// A timeline.
pub(super) struct Lane {
    pub(super) name: String,
    /// What it says when nothing is asked of it.
    pub(super) quiet: Vec<String>,
    /// What else it can say.
    pub(super) predicates: Vec<String>,
    /// Whether it is a poll, of which agents record nothing.
    pub(super) is_polled: bool,
    pub(super) said: Vec<Said>,
}

/// Something that a timeline said.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Said {
    pub(super) from_ns: u64,
    /// None while it is said.
    pub(super) to_ns: Option<u64>,
    pub(super) says: String,
    /// What came of it, if that is known.
    pub(super) outputs: Vec<String>,
}

impl Said {
    /// What is said without its inputs.
    pub(super) fn predicate(&self) -> &str {
        self.says.split('(').next().unwrap_or_default()
    }
}

/// What is marked in pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum MarkKind {
    /// Something is wrong with the motion.
    Alarm,
    /// A fault of the hardware begins.
    Fault,
    /// A goal is given up.
    GivenUp,
    /// The relay stops the rover by itself.
    Stopped,
    /// An agent takes no part any more.
    Faulty,
}

impl MarkKind {
    /// All kinds.
    pub(super) const ALL: [MarkKind; 5] = [
        MarkKind::Alarm,
        MarkKind::Fault,
        MarkKind::GivenUp,
        MarkKind::Stopped,
        MarkKind::Faulty,
    ];

    /// In words.
    pub(super) fn name(self) -> &'static str {
        match self {
            MarkKind::Alarm => "alarm",
            MarkKind::Fault => "fault of the hardware",
            MarkKind::GivenUp => "goal given up",
            MarkKind::Stopped => "relay stops the rover",
            MarkKind::Faulty => "agent is faulty",
        }
    }

    /// Several of them in words.
    pub(super) fn plural(self) -> &'static str {
        match self {
            MarkKind::Alarm => "alarms",
            MarkKind::Fault => "faults of the hardware",
            MarkKind::GivenUp => "goals given up",
            MarkKind::Stopped => "stops by the relay",
            MarkKind::Faulty => "faulty agents",
        }
    }

    /// Its class in the style.
    pub(super) fn class(self) -> &'static str {
        match self {
            MarkKind::Alarm => "alarm",
            MarkKind::Fault => "broken",
            MarkKind::GivenUp => "given-up",
            MarkKind::Stopped => "stopped",
            MarkKind::Faulty => "faulty",
        }
    }
}

/// Something that happened at an instant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Mark {
    pub(super) time_ns: u64,
    pub(super) kind: MarkKind,
    /// In two or three words.
    pub(super) text: String,
    /// In full.
    pub(super) says: String,
}

/// A rover.
pub(super) struct RoverHistory {
    pub(super) name: String,
    pub(super) moments: Vec<Moment>,
    pub(super) marks: Vec<Mark>,
    pub(super) goals: Vec<GoalPlace>,
    /// When a goal's outcome changed: its place, and to what.
    pub(super) outcomes: Vec<(u64, usize, GoalOutcome)>,
    book: GoalBook,
}

impl AgentHistory {
    /// An agent that has said nothing yet.
    pub(super) fn new(name: String, rover: usize, latency_ns: u64, is_system: bool) -> Self {
        AgentHistory {
            name,
            rover,
            latency_ns,
            is_system,
            lanes: Vec::new(),
            cycles: Vec::new(),
            causes: Vec::new(),
        }
    }

    /// It says nothing any more.
    fn falls_silent(&mut self, time_ns: u64) {
        let last = self
            .lanes
            .iter_mut()
            .filter_map(|lane| lane.said.last_mut());
        for said in last.filter(|said| said.to_ns.is_none()) {
            said.to_ns = Some(time_ns);
        }
    }

    fn hear(&mut self, time_ns: u64, says: TimelineSays) {
        let cause = Cause::of(&says);
        if cause != Cause::None {
            self.causes.push((time_ns, cause));
        }
        let mut lanes = self.lanes.iter_mut();
        let Some(lane) = lanes.find(|lane| lane.name == says.timeline) else {
            return;
        };
        if let Some(last) = lane.said.last_mut().filter(|last| last.to_ns.is_none()) {
            last.to_ns = Some(time_ns);
            last.outputs = says.before;
        }
        lane.said.push(Said {
            from_ns: time_ns,
            to_ns: None,
            says: says.says,
            outputs: Vec::new(),
        });
    }

    /// Why the cycle of a time was dear.
    pub(super) fn cause(&self, time_ns: u64, cycle: &AgentCycle) -> Cause {
        let first = self.causes.partition_point(|(at_ns, _)| *at_ns < time_ns);
        let now = self.causes[first..].iter();
        let now = now.take_while(|(at_ns, _)| *at_ns == time_ns);
        let told = now.map(|(_, cause)| *cause).max().unwrap_or(Cause::None);
        told.max(if cycle.goals > 0 {
            Cause::Goal
        } else {
            Cause::None
        })
    }
}

impl RoverHistory {
    /// A rover of which nothing is known yet but its goals.
    pub(super) fn new(name: String, goals: Vec<GoalPlace>) -> Self {
        RoverHistory {
            name,
            moments: Vec::new(),
            marks: Vec::new(),
            book: GoalBook::new(goals.clone()),
            goals,
            outcomes: Vec::new(),
        }
    }

    fn mark(&mut self, time_ns: u64, kind: MarkKind, text: String, says: String) {
        self.marks.push(Mark {
            time_ns,
            kind,
            text,
            says,
        });
    }

    fn settled(&mut self, time_ns: u64, goal: Option<usize>) {
        if let Some(goal) = goal {
            let outcome = self.book.outcomes()[goal];
            self.outcomes.push((time_ns, goal, outcome));
        }
    }

    /// What had become of a goal by a time, and when.
    pub(super) fn outcome(&self, goal: usize, at_ns: u64) -> Option<(u64, GoalOutcome)> {
        let known = self.outcomes.iter().rev();
        let mut known = known.filter(|(time_ns, of, _)| *of == goal && *time_ns <= at_ns);
        known
            .next()
            .map(|(time_ns, _, outcome)| (*time_ns, *outcome))
    }

    /// Where it was at a time: between two moments on the straight line.
    pub(super) fn place_m(&self, time_ns: u64) -> Option<[f64; 2]> {
        let before = Moment::until(&self.moments, time_ns);
        let next = self.moments.get(before.len());
        match (before.last(), next) {
            (Some(last), Some(next)) => {
                let span_ns = (next.time_ns - last.time_ns) as f64;
                let share = (time_ns - last.time_ns) as f64 / span_ns;
                let [[x, y], [x2, y2]] = [last.true_m, next.true_m];
                Some([x + share * (x2 - x), y + share * (y2 - y)])
            }
            (one, other) => one.or(other).map(|moment| moment.true_m),
        }
    }
}

/// The schemas of what is read.
struct Schemas {
    says: Schema,
    cycle: Schema,
    ended: Schema,
    given_up: Schema,
    faulty: Schema,
    stopped: Schema,
    pose: Schema,
    fault: Schema,
}

impl Schemas {
    fn new() -> Result<Schemas, SchemaError> {
        Ok(Schemas {
            says: Schema::of::<TimelineSays>()?,
            cycle: Schema::of::<AgentCycle>()?,
            ended: Schema::of::<GoalEnded>()?,
            given_up: Schema::of::<GoalGivenUp>()?,
            faulty: Schema::of::<AgentFaulty>()?,
            stopped: Schema::of::<RelayStopped>()?,
            pose: Schema::of::<RoverPose>()?,
            fault: Schema::of::<FaultBegins>()?,
        })
    }
}

/// What an actor of the run is.
enum Actor {
    Agent(usize),
    Relay(usize),
    Hardware(usize),
}

impl History {
    /// Reads it from a recorded run of these agents and rovers.
    pub(super) fn read(
        run: &dyn Recording,
        agents: Vec<AgentHistory>,
        rovers: Vec<RoverHistory>,
    ) -> Result<History, PictureError> {
        let schemas = Schemas::new().map_err(|error| {
            PictureError::NotDrawn(format!("its samples cannot be read: {error}"))
        })?;
        let mut history = History {
            scenario: run.scenario().to_owned(),
            seed: run.seeds().run,
            end_ns: 0,
            agents,
            rovers,
        };
        let hardware: Vec<String> = history
            .rovers
            .iter()
            .map(|rover| hardware_name(&rover.name))
            .collect();
        let ending = run.for_each(&mut |record| {
            history.end_ns = history.end_ns.max(record.time_ns);
            let Some(actor) = history.actor(&hardware, record.actor) else {
                return Ok(());
            };
            let read = match actor {
                Actor::Agent(agent) => history.of_agent(agent, record, &schemas),
                Actor::Relay(rover) => history.of_relay(rover, record, &schemas),
                Actor::Hardware(rover) => history.of_hardware(rover, record, &schemas),
            };
            read.map_err(|error| {
                let (actor, kind) = (record.actor, record.kind);
                PictureError::Unreadable(format!("a {kind} of {actor} cannot be read: {error}"))
            })
        })?;
        history.end_ns = ending.time_ns.unwrap_or(history.end_ns);
        Ok(history)
    }

    fn actor(&self, hardware: &[String], name: &str) -> Option<Actor> {
        let agent = self.agents.iter().position(|agent| agent.name == name);
        let relay = self.rovers.iter().position(|rover| rover.name == name);
        let metal = hardware.iter().position(|hardware| hardware == name);
        agent
            .map(Actor::Agent)
            .or(relay.map(Actor::Relay))
            .or(metal.map(Actor::Hardware))
    }

    fn of_agent(
        &mut self,
        at: usize,
        record: &Recorded<'_>,
        schemas: &Schemas,
    ) -> Result<(), DecodeError> {
        let time_ns = record.time_ns;
        let agent = &mut self.agents[at];
        let rover = &mut self.rovers[agent.rover];
        match (record.class, record.kind) {
            (RecordClass::Crash, _) => agent.falls_silent(time_ns),
            (RecordClass::Sample, "AgentCycle") => {
                let cycle: AgentCycle = schemas.cycle.decode(record.body)?;
                agent.cycles.push((time_ns, cycle));
            }
            (RecordClass::Sample, "TimelineSays") => {
                let says: TimelineSays = schemas.says.decode(record.body)?;
                if agent.is_system && says.is_alarm() {
                    let text = spoken(&says.says);
                    let full = format!("{text} of {}", agent.name);
                    rover.mark(time_ns, MarkKind::Alarm, text, full);
                }
                agent.hear(time_ns, says);
            }
            (RecordClass::Sample, "GoalEnded") => {
                let ended: GoalEnded = schemas.ended.decode(record.body)?;
                let goal = rover.book.ended(&ended, agent.is_system);
                rover.settled(time_ns, goal);
            }
            (RecordClass::Sample, "GoalGivenUp") => {
                let given_up: GoalGivenUp = schemas.given_up.decode(record.body)?;
                let GoalGivenUp { goal, reason } = given_up;
                let text = format!("goal {goal} given up");
                let says = format!("{text}: {reason}");
                rover.mark(time_ns, MarkKind::GivenUp, text, says);
                let goal = rover.book.given_up(goal);
                rover.settled(time_ns, goal);
            }
            (RecordClass::Sample, "AgentFaulty") => {
                let faulty: AgentFaulty = schemas.faulty.decode(record.body)?;
                agent.falls_silent(time_ns);
                let text = format!("{} is faulty", agent.name);
                let says = format!("{text}: {}", faulty.reason);
                rover.mark(time_ns, MarkKind::Faulty, text, says);
            }
            _ => {}
        }
        Ok(())
    }

    fn of_relay(
        &mut self,
        at: usize,
        record: &Recorded<'_>,
        schemas: &Schemas,
    ) -> Result<(), DecodeError> {
        if let (RecordClass::Sample, "RelayStopped") = (record.class, record.kind) {
            let stopped: RelayStopped = schemas.stopped.decode(record.body)?;
            let rover = &mut self.rovers[at];
            let text = format!("{} stopped", rover.name);
            let says = format!("the relay stops {}: {}", rover.name, stopped.reason);
            rover.mark(record.time_ns, MarkKind::Stopped, text, says);
        }
        Ok(())
    }

    fn of_hardware(
        &mut self,
        at: usize,
        record: &Recorded<'_>,
        schemas: &Schemas,
    ) -> Result<(), DecodeError> {
        let (rover, time_ns) = (&mut self.rovers[at], record.time_ns);
        match (record.class, record.kind) {
            (RecordClass::Sample, "RoverPose") => {
                let pose: RoverPose = schemas.pose.decode(record.body)?;
                rover.moments.push(Moment::new(time_ns, &pose));
            }
            (RecordClass::Told, "FaultBegins") => {
                let fault: FaultBegins = schemas.fault.decode(record.body)?;
                let text = fault.kind.name().replace('-', " ");
                let says = match fault.part.as_str() {
                    "" => text.clone(),
                    part => format!("{text}: {part}"),
                };
                rover.mark(time_ns, MarkKind::Fault, text, says);
            }
            _ => {}
        }
        Ok(())
    }
}

/// `RollAlarm` as people say it: `roll alarm`.
fn spoken(predicate: &str) -> String {
    let mut text = String::new();
    for letter in predicate.chars() {
        if letter.is_ascii_uppercase() && !text.is_empty() {
            text.push(' ');
        }
        text.push(letter.to_ascii_lowercase());
    }
    text
}
