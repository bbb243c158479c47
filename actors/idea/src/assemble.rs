//! Puts rovers together: for each the ground's register, a row of agents, the relay and the hardware,
//! each on a host of its own, links between those that talk, and a monitor.

mod goals;
mod minds;

use std::sync::{Arc, Mutex};

use farside::{Address, HostId, SimDuration, Simulation};
use farside_actors::field::Place;
use farside_actors::link::LinkParams;
use farside_actors::processor::Processor;
use farside_actors::rover::{
    RoverConfig, RoverError, RoverSpec, RoverStart, add_hardware, hardware_name,
};
use farside_actors::system::SetupError;
use farside_actors::wiring::{Links, Wire, Wiring};
use farside_planning::Ticks;
use farside_planning::model::{Bound, Model, PredicateId, Timeline};
use nalgebra::Point3;

use crate::agent::{Agent, AgentSetup};
use crate::config::{AgentConfig, IdeaScenario};
use crate::ground::{Ground, GroundSetup};
use crate::monitor::{Monitor, Tally, Watched, WatchedAgent, WatchedRover};
use crate::register::Backoff;
use crate::relay::{RelayActor, RelaySetup, RelayTable};
use crate::runner::{RegisterSetup, RunnerSettings, Side};
pub(crate) use goals::{GoalPlace, Goals, goals};
pub(crate) use minds::{Minds, Role, text_file};

/// The name of the processor that agents plan on, on their hosts.
const PROCESSOR: &str = "planner";

/// The timeline on which an agent is given goals, in the K9's models.
const GOALS: &str = "Goal_SV";

/// The timelines of the K9's system model that are registers to its relay.
pub(crate) const COMMANDED: [&str; 8] = [
    "Location_SV",
    "Camera_SV",
    "PanTilt_SV",
    "Fans_SV",
    "Pitch_SV",
    "Roll_SV",
    "Temperature_SV",
    "Power_SV",
];

/// Those of them that say polls.
pub(crate) const POLLED: [&str; 4] = ["Pitch_SV", "Roll_SV", "Temperature_SV", "Power_SV"];

/// Between rovers at the start \[m\].
const APART_M: f64 = 6.0;

/// The relay's table of the K9.
const TABLE: &str = include_str!("../models/k9-relay.toml");

/// What rovers are put together from.
pub(crate) struct Parts<'a> {
    pub(crate) scenario: &'a IdeaScenario,
    pub(crate) place: &'a Place,
    pub(crate) minds: Minds,
    /// The relay's table, if it is not the K9's.
    pub(crate) table: Option<String>,
    /// By rover.
    pub(crate) goals: Vec<Goals>,
    /// The run's seed.
    pub(crate) seed: u64,
    pub(crate) until: SimDuration,
}

/// Rovers in a simulation.
pub(crate) struct Team {
    pub(crate) watched: Watched,
    pub(crate) tally: Arc<Mutex<Tally>>,
}

/// The names of a rover's hosts, from the ground downwards.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Names {
    /// The agents, from the one that the ground commands to the system agent.
    pub(crate) agents: Vec<String>,
    pub(crate) rover: String,
}

/// The hosts' names of all rovers.
pub(crate) fn names(scenario: &IdeaScenario) -> Vec<Names> {
    let config = &scenario.agents;
    let each = (1..=config.rovers).map(|rover| {
        let suffix = match config.rovers {
            1 => String::new(),
            _ => format!("_{rover:02}"),
        };
        let agents = (0..config.layers).map(|layer| match layer {
            last if last + 1 == config.layers => format!("system{suffix}"),
            0 => format!("mission{suffix}"),
            between => format!("executive_{between}{suffix}"),
        });
        Names {
            agents: agents.collect(),
            rover: format!("k9{suffix}"),
        }
    });
    each.collect()
}

/// Where a rover stands at the start: in a row along the north, facing east.
pub(crate) fn start(number: u32, rovers: u32) -> RoverStart {
    RoverStart {
        east_m: 0.0,
        north_m: APART_M * (f64::from(number) - 0.5 * f64::from(rovers - 1)),
        yaw_rad: 0.0,
    }
}

/// Which key of the scenario a rover that cannot be is of.
fn blame(error: RoverError) -> SetupError {
    match error {
        RoverError::Settings(error) => error,
        RoverError::OutsideTerrain { .. } => SetupError::value("agents.rovers", error),
        RoverError::NotFinite { .. } => SetupError::value("rover", error),
    }
}

impl Parts<'_> {
    fn backoff(&self) -> Backoff {
        Backoff {
            first: self.scenario.agents.repeat_after,
            most: self.scenario.agents.repeat_at_most,
        }
    }

    fn config(&self, role: Role) -> &AgentConfig {
        match role {
            Role::System => &self.scenario.system_agent,
            Role::Mission | Role::Between => &self.scenario.mission_agent,
        }
    }

    fn runner(&self, role: Role) -> RunnerSettings {
        let config = self.config(role);
        RunnerSettings {
            latency: config.latency,
            horizon: config.horizon.into(),
            budget: config.budget,
            overhead: config.overhead,
            aborts: config.aborts,
            backoff: self.backoff(),
            forgets: config.deletes,
        }
    }

    /// What an agent of a row is.
    fn role(&self, layer: usize) -> Role {
        Role::of(layer, self.scenario.agents.layers as usize)
    }

    /// The registers of an agent, and the actors on their other sides.
    fn registers(
        &self,
        layer: usize,
        names: &Names,
    ) -> Result<(Vec<RegisterSetup>, Vec<String>), SetupError> {
        let role = self.role(layer);
        let (model, config) = (self.minds.model(role), self.config(role));
        let timeline = |name: &str| {
            let found = model.timelines.iter().position(|one| one.name == name);
            found.ok_or_else(|| {
                let key = format!("{}.model", role.table());
                SetupError::value(
                    &key,
                    format!("no timeline {name}, which has to be a register"),
                )
            })
        };
        let above = match layer.checked_sub(1) {
            Some(above) => names.agents[above].clone(),
            None => ground_name(names),
        };
        let below = match names.agents.get(layer + 1) {
            Some(below) => below.clone(),
            None => names.rover.clone(),
        };
        let mut registers = vec![RegisterSetup {
            name: register_name(&above, &names.agents[layer]).into(),
            timeline: timeline(role.incoming())?,
            side: Side::Controlled,
            peer: 0,
            lease: config.lease,
            is_polled: false,
        }];
        let outgoing: &[&str] = match role {
            Role::System => &COMMANDED,
            Role::Mission => &[GOALS],
            Role::Between => &["Below_SV"],
        };
        for name in outgoing {
            registers.push(RegisterSetup {
                name: match role {
                    Role::System => (*name).into(),
                    _ => register_name(&names.agents[layer], &below).into(),
                },
                timeline: timeline(name)?,
                side: Side::Controlling,
                peer: 1,
                lease: config.lease,
                is_polled: POLLED.contains(name),
            });
        }
        Ok((registers, vec![above, below]))
    }
}

/// The actor that is the ground of a rover: one for each, on one host.
fn ground_name(names: &Names) -> String {
    match names.rover.strip_prefix("k9") {
        Some("") | None => "ground".to_owned(),
        Some(suffix) => format!("ground{suffix}"),
    }
}

/// The name of the register on which one gives goals to another.
fn register_name(above: &str, below: &str) -> String {
    format!("{above}>{below}")
}

/// Declares hosts, actors and links.
pub(crate) fn assemble(
    sim: &mut Simulation,
    parts: &Parts<'_>,
    wire: &mut Wire<'_>,
) -> Result<Team, SetupError> {
    let all = names(parts.scenario);
    let ground = sim.host("ground");
    let mut wiring = Wiring::default();
    let mut hosts = Vec::new();
    for (number, names) in (0..).zip(&all) {
        let row: Vec<HostId> = names.agents.iter().map(|name| sim.host(name)).collect();
        let rover = sim.host(&names.rover);
        let mut above = (ground, "ground");
        for (host, name) in row.iter().zip(&names.agents) {
            wiring.both_ways(above, (*host, name));
            above = (*host, name);
        }
        wiring.both_ways(above, (rover, &names.rover));
        for (layer, name) in names.agents.iter().enumerate() {
            let config = parts.config(parts.role(layer));
            wiring.processor(name, PROCESSOR, config.processor);
        }
        let at = start(number, parts.scenario.agents.rovers);
        let height_m = parts.place.field.ground_m(at.east_m, at.north_m);
        let antenna_m = height_m + parts.scenario.rover.mast_m;
        for name in names.agents.iter().chain([&names.rover]) {
            wiring.place(name, Point3::new(at.east_m, at.north_m, antenna_m));
        }
        hosts.push((row, rover));
    }
    wiring.terrain(Arc::new(parts.place.field.terrain().clone()));
    let links = wire(sim, &wiring)?;
    check_polls(parts, &links, &all)?;
    let mut watched = Watched {
        agents: Vec::new(),
        rovers: Vec::new(),
        goals: parts.goals.iter().map(|goals| goals.wanted).sum(),
        ends: parts.scenario.agents.stop_when_done,
        bin: bin(parts),
    };
    for ((number, names), (row, rover)) in (0..).zip(&all).zip(&hosts) {
        let goals = &parts.goals[number as usize];
        add_ground(sim, ground, parts, names, goals);
        for (layer, name) in names.agents.iter().enumerate() {
            let role = parts.role(layer);
            let (registers, peers) = parts.registers(layer, names)?;
            watched.agents.push(WatchedAgent {
                name: name.clone(),
                latency: parts.config(role).latency,
                goals: registers[0].name.to_string(),
                commands: role == Role::System,
            });
            let mut setup = AgentSetup {
                runner: parts.runner(role),
                registers,
                peers,
                mind: parts.minds.of(role, goals),
                processor: Processor::new(parts.config(role).processor),
                restart_after: parts.config(role).restart_after,
            };
            setup
                .check()
                .map_err(|error| SetupError::value(role.table(), error))?;
            let host = row[layer];
            links.processor(sim, &format!("{name}/{PROCESSOR}"), |sim, processor| {
                setup.processor = processor;
                let setup = Arc::new(setup);
                sim.actor(host, name, move |_| Agent::new(setup.clone()))
            });
        }
        add_rover(sim, *rover, parts, names, number)?;
        let lease = parts.scenario.relay.lease.max(parts.scenario.rover.lease);
        watched.rovers.push(WatchedRover {
            relay: names.rover.clone(),
            hardware: hardware_name(&names.rover),
            lease,
        });
    }
    let (monitor, tally) = Monitor::new(watched.clone());
    sim.observe(monitor);
    Ok(Team { watched, tally })
}

/// Whether polls can be answered in time: the way to the relay and back, at its least, has to be shorter
/// than the longest that a poll lasts.
fn check_polls(parts: &Parts<'_>, links: &Links, names: &[Names]) -> Result<(), SetupError> {
    let model = parts.minds.model(Role::System);
    let latency = parts.scenario.system_agent.latency;
    let is_polled = |timeline: &&Timeline| POLLED.contains(&timeline.name.as_str());
    for timeline in model.timelines.iter().filter(is_polled) {
        let predicates = timeline.predicates.iter();
        let polls = predicates.filter(|at| has_outputs(model, **at));
        let longest = polls.filter_map(|at| longest_ticks(model, *at)).min();
        let Some(ticks) = longest.and_then(|ticks| u64::try_from(ticks).ok()) else {
            continue;
        };
        let lasts = latency * ticks;
        for names in names {
            let agent = &names.agents[names.agents.len() - 1];
            let ways = [(agent, &names.rover), (&names.rover, agent)];
            let least = ways.map(|(from, to)| links.nominal(from, to).map(LinkParams::min_delay));
            let least = least
                .into_iter()
                .flatten()
                .fold(SimDuration::ZERO, |sum, one| sum + one);
            if least >= lasts {
                let message = format!(
                    "{least} to {} and back, at least: no poll of {} could be answered, since it lasts \
                     {lasts} at most",
                    names.rover, timeline.name
                );
                return Err(SetupError::value("links", message));
            }
        }
    }
    Ok(())
}

fn has_outputs(model: &Model, predicate: PredicateId) -> bool {
    let predicate = &model.predicates[predicate];
    predicate.inputs < predicate.parameters.len()
}

/// How long a token of a predicate lasts at most \[ticks\], as far as its rules say it as a number.
fn longest_ticks(model: &Model, predicate: PredicateId) -> Option<Ticks> {
    let rules = model
        .rules
        .iter()
        .filter(|rule| rule.master.predicate == predicate);
    let most = rules.filter_map(|rule| match rule.duration {
        Some([_, Bound::Value(most)]) => Some(most),
        _ => None,
    });
    most.min()
}

/// How long a bin of the series is: some hundreds of them in a run, and of whole seconds.
fn bin(parts: &Parts<'_>) -> SimDuration {
    const BINS: u64 = 240;
    let latency = parts.scenario.system_agent.latency;
    let wanted_s = (parts.until.as_nanos() / BINS)
        .div_ceil(1_000_000_000)
        .max(1);
    SimDuration::from_secs(wanted_s).max(latency)
}

fn add_ground(sim: &mut Simulation, host: HostId, parts: &Parts<'_>, names: &Names, goals: &Goals) {
    let name = ground_name(names);
    let setup = Arc::new(GroundSetup {
        register: register_name(&name, &names.agents[0]).into(),
        agent: names.agents[0].clone(),
        backoff: parts.backoff(),
        orders: goals.orders.clone(),
        nothing: goals.nothing.clone(),
    });
    sim.actor(host, &name, move |_| Ground::new(setup.clone()));
}

/// The relay and the hardware of a rover.
fn add_rover(
    sim: &mut Simulation,
    host: HostId,
    parts: &Parts<'_>,
    names: &Names,
    number: u32,
) -> Result<(), SetupError> {
    let model = parts.minds.model(Role::System).clone();
    let text = parts.table.as_deref().unwrap_or(TABLE);
    let table = RelayTable::new(text, model, &COMMANDED);
    let table = table.map_err(|error| SetupError::value("relay.table", error))?;
    let fits = table.check_rover(&parts.scenario.rover);
    fits.map_err(|error| SetupError::value("relay.table", error))?;
    let setup = Arc::new(RelaySetup {
        table: Arc::new(table),
        registers: COMMANDED.iter().map(|name| (*name).into()).collect(),
        agent: names.agents[names.agents.len() - 1].clone(),
        rover: names.rover.clone(),
        backoff: parts.backoff(),
        lease: parts.scenario.relay.lease,
    });
    let relay: Address<RelayActor> =
        sim.actor(host, &names.rover, move |_| RelayActor::new(setup.clone()));
    let config: RoverConfig = parts.scenario.rover.clone();
    let spec = RoverSpec {
        number,
        name: names.rover.clone(),
        config,
        site: parts.place.site(),
        start: start(number, parts.scenario.agents.rovers),
        seed: parts.seed,
        until: parts.until,
    };
    add_hardware(sim, host, spec, relay).map_err(blame)?;
    Ok(())
}
