//! What an agent, a rover's relay or its hardware did in a run and what it waited for: told from what agents
//! recorded of their timelines, as pictures are.

use std::collections::BTreeSet;

use farside::SimDuration;
use farside_actors::rover::hardware_name;
use farside_actors::system::{Account, Doing, Phase, PictureError, Recording, Setup, outages};

use super::cast;
use super::history::{AgentHistory, History, Lane, Mark, MarkKind, RoverHistory};
use crate::assemble::{COMMANDED, POLLED, names};
use crate::config::IdeaScenario;
use crate::outcomes::GoalOutcome;

/// The timelines of the K9's models that say what an agent is asked for, and what its motion does.
const GOALS: &str = "Goal_SV";
const MOTION: &str = "MotionMonitor_SV";

/// What fans do is no reason to say something of.
const FANS: &str = "Fans_SV";

/// The account of an actor up to a time; none if it is neither an agent nor a rover's.
pub(crate) fn account(
    scenario: &IdeaScenario,
    actor: &str,
    run: &dyn Recording,
    until_ns: Option<u64>,
    setup: &mut Setup<'_>,
) -> Result<Option<Account>, PictureError> {
    let (agents, rovers) = cast(scenario, setup)?;
    let history = History::read(run, agents, rovers)?;
    let until_ns = until_ns.map_or(history.end_ns, |until| until.min(history.end_ns));
    let names = names(scenario);
    let told = |rover: usize, layer: Option<usize>| Told {
        rover: &history.rovers[rover],
        agents: names[rover]
            .agents
            .iter()
            .filter_map(|name| history.agents.iter().find(|agent| agent.name == *name))
            .collect(),
        layer,
        until_ns,
    };
    for (rover, names) in names.iter().enumerate() {
        let layer = names.agents.iter().position(|name| name == actor);
        let is_rovers = names.rover == actor || hardware_name(&names.rover) == actor;
        if layer.is_none() && !is_rovers {
            continue;
        }
        let down = outages(run, actor)?;
        let account = told(rover, layer).account();
        return Ok(Some(account.with_outages(down, until_ns)));
    }
    Ok(None)
}

/// A rover's agents, as far as they are told.
struct Told<'h> {
    rover: &'h RoverHistory,
    /// From the one that the ground commands to the system agent.
    agents: Vec<&'h AgentHistory>,
    /// Which agent it is of; none for the rover itself.
    layer: Option<usize>,
    until_ns: u64,
}

/// What an actor does at an instant.
struct Now {
    doing: Doing,
    text: String,
    waits_for: Vec<String>,
}

impl Now {
    fn active(text: String) -> Self {
        Now {
            doing: Doing::Active,
            text,
            waits_for: Vec::new(),
        }
    }

    fn waiting(text: String, for_whom: &str) -> Self {
        Now {
            doing: Doing::Waiting,
            text,
            waits_for: vec![for_whom.to_owned()],
        }
    }
}

impl Told<'_> {
    fn account(&self) -> Account {
        let mut account = Account::default();
        let instants: Vec<u64> = self.instants().into_iter().collect();
        for (at, from_ns) in instants.iter().enumerate() {
            let until_ns = instants.get(at + 1).map_or(self.until_ns, |next| *next);
            let Now {
                doing,
                text,
                waits_for,
            } = self.now(*from_ns);
            account.push(Phase {
                from_ns: *from_ns,
                until_ns,
                doing,
                text,
                waits_for,
            });
        }
        for phase in &mut account.phases {
            self.remark(phase);
        }
        account
    }

    /// When something that is told may change.
    fn instants(&self) -> BTreeSet<u64> {
        let lanes = self.agents.iter().flat_map(|agent| &agent.lanes);
        let said = lanes.flat_map(|lane| &lane.said);
        let said = said.flat_map(|said| [Some(said.from_ns), said.to_ns]);
        let settled = self
            .rover
            .outcomes
            .iter()
            .map(|(time_ns, ..)| Some(*time_ns));
        let ends = self.ends().map(|mark| Some(mark.time_ns));
        let instants = said.chain(settled).chain(ends).flatten();
        let mut instants: BTreeSet<u64> = instants
            .filter(|time_ns| *time_ns < self.until_ns)
            .collect();
        instants.insert(0);
        instants
    }

    /// Marks that say what an actor is from then on: stopped, or faulty.
    fn ends(&self) -> impl Iterator<Item = &Mark> {
        let marks = self.rover.marks.iter();
        marks.filter(|mark| matches!(mark.kind, MarkKind::Stopped | MarkKind::Faulty))
    }

    fn now(&self, time_ns: u64) -> Now {
        match self.layer {
            Some(layer) if layer + 1 < self.agents.len() => self.of_mission(layer, time_ns),
            Some(layer) => self.of_system(layer, time_ns),
            None => self.of_rover(time_ns),
        }
    }

    /// Whether nothing more will be asked of the rover: all its goals are done, or nobody tries them any more.
    fn is_over(&self, time_ns: u64) -> bool {
        let goals = 0..self.rover.goals.len();
        let mut outcomes = goals.map(|goal| self.rover.outcome(goal, time_ns));
        outcomes.all(|outcome| {
            let outcome = outcome.map(|(_, outcome)| outcome);
            matches!(
                outcome,
                Some(GoalOutcome::Done | GoalOutcome::GivenUp | GoalOutcome::TakenBack)
            )
        })
    }

    /// Since when an agent is faulty, and why.
    fn faulty(&self, agent: &AgentHistory, time_ns: u64) -> Option<&Mark> {
        let begins = format!("{} is faulty", agent.name);
        self.ends().find(|mark| {
            mark.kind == MarkKind::Faulty && mark.text == begins && mark.time_ns <= time_ns
        })
    }

    fn idle(&self, text: String, for_whom: &str, time_ns: u64) -> Now {
        match self.is_over(time_ns) {
            true => Now {
                doing: Doing::Done,
                text: "has no goal left".to_owned(),
                waits_for: Vec::new(),
            },
            false => Now::waiting(text, for_whom),
        }
    }

    /// An agent that hands goals on.
    fn of_mission(&self, layer: usize, time_ns: u64) -> Now {
        let agent = self.agents[layer];
        if let Some(mark) = self.faulty(agent, time_ns) {
            return broken(mark);
        }
        if let Some(goal) = says(agent, GOALS, time_ns) {
            let below = &self.agents[layer + 1].name;
            let text = format!("has asked {below} for {goal}, and waits for its status");
            return Now::waiting(text, below);
        }
        let others = agent.lanes.iter().filter(|lane| lane.name != GOALS);
        let mut others = others.filter_map(|lane| loud(lane, time_ns));
        match others.next() {
            // The planner's own number of a request says nothing.
            Some(said) if said.starts_with("Planning") => Now::active("deliberates".to_owned()),
            Some(said) => Now::active(format!("answers {said}")),
            None => self.idle(
                "waits until there is a goal that can be begun".to_owned(),
                self.above(layer),
                time_ns,
            ),
        }
    }

    /// The agent that commands the rover.
    fn of_system(&self, layer: usize, time_ns: u64) -> Now {
        let agent = self.agents[layer];
        if let Some(mark) = self.faulty(agent, time_ns) {
            return broken(mark);
        }
        let goal = says(agent, GOALS, time_ns);
        let trouble = says(agent, MOTION, time_ns).filter(|said| said != "Nominal");
        let commands = commands(agent, time_ns);
        let mut text = match (&goal, &trouble) {
            (_, Some(trouble)) => format!("recovers from an alarm, {trouble}"),
            (Some(goal), None) => format!("carries out {goal}"),
            (None, None) if commands.is_empty() => {
                let above = self.above(layer);
                return self.idle(format!("waits for a goal of {above}"), above, time_ns);
            }
            (None, None) => "commands".to_owned(),
        };
        if commands.is_empty() {
            text.push_str(": nothing is commanded yet");
            return Now {
                doing: Doing::Waiting,
                text,
                waits_for: vec![self.rover.name.clone()],
            };
        }
        Now::active(format!("{text}: {}", commands.join(", ")))
    }

    /// The relay and the hardware of the rover.
    fn of_rover(&self, time_ns: u64) -> Now {
        let Some(system) = self.agents.last() else {
            return Now::active("is up".to_owned());
        };
        let commands = commands(system, time_ns);
        let stopped = self
            .rover
            .marks
            .iter()
            .rev()
            .find(|mark| mark.kind == MarkKind::Stopped && mark.time_ns <= time_ns);
        // Until the agent asks for something else, the relay keeps the rover stopped.
        let since_ns = commands_since(system, time_ns);
        match stopped.filter(|mark| since_ns.is_none_or(|since_ns| since_ns <= mark.time_ns)) {
            Some(mark) => Now::waiting(
                format!("stands: {}; waits for {}", mark.says, system.name),
                &system.name,
            ),
            None if commands.is_empty() => {
                let text = format!("stands, waits for a command of {}", system.name);
                self.idle(text, &system.name, time_ns)
            }
            None => Now::active(format!("does {}", commands.join(", "))),
        }
    }

    /// Whom goals come from.
    fn above(&self, layer: usize) -> &str {
        match layer.checked_sub(1) {
            Some(above) => &self.agents[above].name,
            None => "ground",
        }
    }

    /// What happened in a phase, and how late answers were.
    fn remark(&self, phase: &mut Phase) {
        let within = |time_ns: u64| (phase.from_ns..phase.until_ns).contains(&time_ns);
        let mut remarks = Vec::new();
        for mark in self.rover.marks.iter().filter(|mark| within(mark.time_ns)) {
            let at = SimDuration::from_nanos(mark.time_ns);
            let is_told = phase.text.contains(&mark.says);
            if !is_told {
                remarks.push(format!("{} at {at}", mark.says));
            }
        }
        if let Some(layer) = self.layer {
            let agent = self.agents[layer];
            let cycles = agent.cycles.iter().filter(|(time_ns, _)| within(*time_ns));
            let latest = cycles
                .map(|(_, cycle)| cycle.response_ns)
                .max()
                .unwrap_or(0);
            if latest > agent.latency_ns {
                let (late, latency) = [latest, agent.latency_ns]
                    .map(SimDuration::from_nanos)
                    .into();
                remarks.push(format!("an answer took {late}, at a latency of {latency}"));
            }
        }
        for remark in remarks {
            phase.text.push_str("; ");
            phase.text.push_str(&remark);
        }
    }
}

fn broken(mark: &Mark) -> Now {
    Now {
        doing: Doing::Down,
        text: mark.says.clone(),
        waits_for: Vec::new(),
    }
}

/// What a timeline says at a time, if that is not what it says when nothing is asked of it.
fn loud(lane: &Lane, time_ns: u64) -> Option<String> {
    let at = lane.said.partition_point(|said| said.from_ns <= time_ns);
    let said = &lane.said[at.checked_sub(1)?];
    let is_over = said.to_ns.is_some_and(|to_ns| to_ns <= time_ns);
    let is_quiet = lane.quiet.iter().any(|quiet| quiet == said.predicate());
    (!is_over && !is_quiet).then(|| said.says.clone())
}

fn says(agent: &AgentHistory, timeline: &str, time_ns: u64) -> Option<String> {
    let mut lanes = agent.lanes.iter();
    let lane = lanes.find(|lane| lane.name == timeline)?;
    loud(lane, time_ns)
}

/// The timelines whose commands are told.
fn commanded(agent: &AgentHistory) -> impl Iterator<Item = &Lane> {
    agent.lanes.iter().filter(|lane| {
        let name = lane.name.as_str();
        COMMANDED.contains(&name) && !POLLED.contains(&name) && name != FANS
    })
}

/// What the rover is asked for at a time.
fn commands(agent: &AgentHistory, time_ns: u64) -> Vec<String> {
    let lanes = commanded(agent).filter_map(|lane| loud(lane, time_ns));
    lanes.collect()
}

/// Since when it has been asked for the last of that.
fn commands_since(agent: &AgentHistory, time_ns: u64) -> Option<u64> {
    let lanes = commanded(agent).filter(|lane| loud(lane, time_ns).is_some());
    let begun = lanes.filter_map(|lane| {
        let at = lane.said.partition_point(|said| said.from_ns <= time_ns);
        at.checked_sub(1).map(|at| lane.said[at].from_ns)
    });
    begun.max()
}
