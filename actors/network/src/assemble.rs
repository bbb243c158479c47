//! Assembling the network-guided system: hosts, actors, links, missions, the monitor.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use farside::carrier::Carrier;
use farside::prelude::*;
use farside::suggest;
use farside_actors::processor::{Processor, Speed};
use farside_actors::wiring::{Links, Wire, Wiring};
use farside_worlds::{HeightField, NodeId, Roadmap, SensorError, SensorNetwork, VertexId};
use nalgebra::Point3;

use super::config::{ConfigError, Motion, NetworkConfig, Policy, WorldConfig};
use super::error::NetworkError;
use super::failover;
use super::gaps::{self, Refused};
use super::ids;
use super::metrics::NetworkMetrics;
use super::monitor::{Monitor, Score};
use super::motion::EdgeTimes;
use super::node::Node;
use super::rover::Rover;
use super::shared::Shared;
use super::timing::Timing;
use crate::baseline::Schedule;
use crate::ids::RoverId;
use crate::mapf::{Mission, Problem, Rules};
use crate::max_plus::lng::LocalGraph;
use crate::max_plus::payoff::Payoffs;
use crate::max_plus::processor::PLANNER;

/// An assembled system: its actors by name, and its score.
pub struct Network {
    site: Arc<Shared>,
    score: Arc<Mutex<Score>>,
}

/// What the system is put together from, besides its rovers.
#[derive(Clone)]
pub struct Parts<'a> {
    /// Of it only the endpoints and what becomes of coverage gaps are read: `roadmap` and `sensors`
    /// are what else it describes.
    pub world: &'a WorldConfig,
    /// Where rovers drive.
    pub roadmap: Arc<Roadmap>,
    /// The nodes, and which vertices are whose.
    pub sensors: Arc<SensorNetwork>,
    /// How the system works.
    pub config: &'a NetworkConfig,
    /// The ground that radios look over, if it is known.
    pub terrain: Option<Arc<HeightField>>,
    /// The names of the rovers that take part; all if it is empty.
    pub only: &'a [String],
}

impl<'a> Parts<'a> {
    /// With nodes as `world` places them for a seed, and nothing known of the ground.
    ///
    /// # Errors
    /// When nodes cannot be placed so that they cover the roadmap.
    pub fn placed(
        world: &'a WorldConfig,
        roadmap: Arc<Roadmap>,
        config: &'a NetworkConfig,
        seed: u64,
    ) -> Result<Self, SensorError> {
        let sensors = Arc::new(world.place(&roadmap, seed)?);
        Ok(Parts {
            world,
            roadmap,
            sensors,
            config,
            terrain: None,
            only: &[],
        })
    }
}

/// Who drives from where to where.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Missions {
    /// Rovers queue at their entries, and leave the map at their goals: each one's entry and goal.
    Queued(Vec<(VertexId, VertexId)>),
    /// Rovers stand on the map from the start, and stay at their goals: each one's start and goal,
    /// no two starts and no two goals alike.
    Standing(Vec<(VertexId, VertexId)>),
}

impl Missions {
    fn all(&self) -> &[(VertexId, VertexId)] {
        match self {
            Missions::Queued(all) | Missions::Standing(all) => all,
        }
    }

    /// Whether they can be.
    fn check(&self, roadmap: &Roadmap) -> Result<(), NetworkError> {
        if self.all().is_empty() {
            return Err(NetworkError::NoRovers);
        }
        let Missions::Standing(missions) = self else {
            return Ok(());
        };
        for (what, of) in [("start", 0), ("goal", 1)] {
            let place = |mission: &(VertexId, VertexId)| [mission.0, mission.1][of];
            let mut places: Vec<_> = missions.iter().map(place).collect();
            places.sort_unstable();
            if let Some(pair) = places.windows(2).find(|pair| pair[0] == pair[1]) {
                let vertex = pair[0];
                return Err(NetworkError::Shared { what, vertex });
            }
            if let Some(&vertex) = places.last().filter(|v| v.0 as usize >= roadmap.len()) {
                return Err(NetworkError::Outside { what, vertex });
            }
        }
        Ok(())
    }
}

/// Declares the network-guided system in `sim`: a host and an actor `node_01`, ... for each sensor
/// node and `rover_01`, ... for each rover; the links that `wire` makes, for both directions
/// between neighbouring nodes and between each node and each rover; and the monitor, which ends the
/// run.
///
/// # Errors
/// When a setting makes no sense, the phases of a cycle do not fit into it, the team is empty, two
/// rovers would share a vertex at the start or the end, or coverage gaps are not as they may be;
/// and those of `wire`.
pub fn assemble(
    sim: &mut Simulation,
    parts: &Parts<'_>,
    missions: &Missions,
    wire: &mut Wire<'_>,
) -> Result<Network, NetworkError> {
    let config = parts.config;
    let Declared {
        roadmap,
        refused,
        node_names,
        rover_names,
        takes_part,
        wired,
        timing,
    } = declare(sim, parts, missions, wire)?;
    let sensors = &parts.sensors;
    let stay_at_target = matches!(missions, Missions::Standing(_));
    let missions = missions.all().to_vec();
    let has_way =
        |rover: &RoverId| takes_part[rover.0 as usize] && refused.iter().all(|r| r.rover != *rover);
    let queues = match stay_at_target {
        true => BTreeMap::new(),
        false => queues(&missions, has_way),
    };
    let longest_step = longest_step(&roadmap, config, &timing)?;
    let planned: Vec<_> = (0..)
        .map(RoverId)
        .zip(missions.iter().copied())
        .filter(|(id, _)| has_way(id))
        .collect();
    let schedule = Schedule::of(config, &timing, &roadmap, &planned, stay_at_target);
    let backup_lists = match config.failover_after {
        Some(_) => failover::backup_lists(&roadmap, sensors),
        None => Vec::new(),
    };
    let all = takes_part.iter().zip(&missions);
    let team: Vec<_> = all.filter(|(is, _)| **is).map(|(_, one)| *one).collect();
    let is_well_formed = stay_at_target && is_well_formed(&roadmap, &team);
    let site = Arc::new(Shared {
        backup_lists,
        payoffs: Payoffs::new(config, &roadmap),
        schedule: schedule.map_err(NetworkError::NoPlan)?,
        patience: config.patience(wired.slowest(), &timing),
        timing,
        roadmap_from: source(config, &node_names)?,
        node_names,
        rover_names,
        takes_part,
        config: config.clone(),
        queues: queues.into_iter().collect(),
        refused,
        longest_step,
        roadmap,
        sensors: sensors.clone(),
        missions,
        stay_at_target,
        is_well_formed,
    });
    declare_nodes(sim, &site, &wired);
    declare_rovers(sim, &site);
    let (monitor, score) = Monitor::new(site.clone());
    sim.observe(monitor);
    Ok(Network { site, score })
}

/// Hosts and links, before there is any actor, and the clock that follows from them.
pub(crate) struct Declared {
    roadmap: Arc<Roadmap>,
    refused: Vec<Refused>,
    node_names: Vec<String>,
    rover_names: Vec<String>,
    takes_part: Vec<bool>,
    wired: Links,
    /// How long the parts of a planning cycle last.
    pub(crate) timing: Timing,
}

/// Declares hosts and links. Who wants to know how long a cycle is, and no more, stops here: what is
/// planned for the whole team beforehand takes its time.
///
/// # Errors
/// Those of [`assemble`].
pub(crate) fn declare(
    sim: &mut Simulation,
    parts: &Parts<'_>,
    missions: &Missions,
    wire: &mut Wire<'_>,
) -> Result<Declared, NetworkError> {
    let (config, sensors) = (parts.config, &parts.sensors);
    config.check()?;
    missions.check(&parts.roadmap)?;
    parts.world.gaps.check(sensors, config.policy)?;
    let stay_at_target = matches!(missions, Missions::Standing(_));
    let missions = missions.all();
    let roadmap = parts.world.open_part(&parts.roadmap, sensors);
    let node_names = names("node", sensors.len());
    let rover_names = names("rover", missions.len());
    let takes_part = takes_part(&rover_names, parts.only)?;
    let refused = gaps::refused(&roadmap, sensors, missions, &takes_part);
    let team = takes_part.iter().filter(|is| **is).count();
    gaps::check_refused(&refused, &rover_names, team, stay_at_target)?;
    let is_there = |rover: &usize| takes_part[*rover];
    let there: Vec<&String> = (0..rover_names.len())
        .filter(is_there)
        .map(|rover| &rover_names[rover])
        .collect();
    let mut wiring = wiring(sim, sensors, &node_names, &there);
    let places = places_m(&roadmap, sensors, missions);
    for (name, place_m) in node_names.iter().chain(&rover_names).zip(places) {
        wiring.place(name, place_m);
    }
    if let Some(terrain) = &parts.terrain {
        wiring.terrain(terrain.clone());
    }
    let speed = match config.policy {
        Policy::MaxPlus => config.max_plus.processor,
        // What other policies compute takes no time.
        _ => Speed::Unlimited,
    };
    for name in &node_names {
        wiring.processor(name, PLANNER, speed);
    }
    let wired = wire(sim, &wiring)?;
    let links = (wired.slowest(), wired.slowest_rate_bit_per_s());
    let timing = timing(&roadmap, config, links)?;
    Ok(Declared {
        roadmap,
        refused,
        node_names,
        rover_names,
        takes_part,
        wired,
        timing,
    })
}

/// Which rovers there are, by the names that a scenario gives; all if it gives none.
fn takes_part(names: &[String], only: &[String]) -> Result<Vec<bool>, NetworkError> {
    for (at, name) in only.iter().enumerate() {
        let message = if !names.contains(name) {
            let close = suggest::nearest(name, names.iter().map(String::as_str));
            let hint = suggest::did_you_mean(close.as_deref());
            let count = names.len();
            format!("{name:?}: expected the name of one of {count} rovers{hint}")
        } else if only[..at].contains(name) {
            format!("{name:?}: expected each name once")
        } else {
            continue;
        };
        return Err(NetworkError::Only { at, message });
    }
    let is_there = |name: &String| only.is_empty() || only.contains(name);
    Ok(names.iter().map(is_there).collect())
}

/// Whether each rover that stands on the map has a path round all others' starts and goals.
fn is_well_formed(roadmap: &Roadmap, missions: &[(VertexId, VertexId)]) -> bool {
    let missions = missions.iter().copied().map(Mission::from).collect();
    let problem = Problem::new(roadmap, missions, Rules::StayAtTarget);
    problem.is_ok_and(|problem| problem.ill_formed().is_empty())
}

/// Who waits at each entry, in order: all rovers that have a way to their goals.
fn queues(
    missions: &[(VertexId, VertexId)],
    has_way: impl Fn(&RoverId) -> bool,
) -> BTreeMap<VertexId, Vec<RoverId>> {
    let mut queues = BTreeMap::<VertexId, Vec<RoverId>>::new();
    let all = (0..).map(RoverId).zip(missions);
    for (id, (entry, _)) in all.filter(|(id, _)| has_way(id)) {
        queues.entry(*entry).or_default().push(id);
    }
    queues
}

/// The same over links of one's own kind, for simulations without a scenario: `carrier` makes the
/// one from one host to another, by their names.
///
/// # Errors
/// Those of [`assemble`].
pub fn assemble_over<C: Carrier>(
    sim: &mut Simulation,
    parts: &Parts<'_>,
    missions: &Missions,
    mut carrier: impl FnMut(&str, &str) -> C,
) -> Result<Network, NetworkError> {
    let mut wire =
        |sim: &mut Simulation, wiring: &Wiring| Ok(Links::carried(sim, wiring, &mut carrier));
    assemble(sim, parts, missions, &mut wire)
}

/// The node that `network.roadmap_from` names.
fn source(config: &NetworkConfig, names: &[String]) -> Result<Option<NodeId>, NetworkError> {
    let Some(name) = &config.roadmap_from else {
        return Ok(None);
    };
    let at = names.iter().position(|known| known == name);
    let at = at.ok_or_else(|| NetworkError::UnknownSource {
        name: name.clone(),
        first: names.first().cloned().unwrap_or_default(),
        last: names.last().cloned().unwrap_or_default(),
    })?;
    Ok(Some(NodeId(at as u32)))
}

/// The parts of a cycle. The policy `max-plus` moves rovers within its cycles: where nothing is
/// said, they are long enough for the longest edge.
fn timing(
    roadmap: &Roadmap,
    config: &NetworkConfig,
    (latency, rate_bit_per_s): (SimDuration, Option<u64>),
) -> Result<Timing, ConfigError> {
    let mut config = config.clone();
    if config.policy == Policy::MaxPlus && config.motion == Motion::Continuous {
        let longest = EdgeTimes {
            roadmap,
            config: &config,
        }
        .longest();
        config.traverse = longest.map_or(config.traverse, |(_, time)| time);
    }
    config.timing(latency, rate_bit_per_s)
}

/// The longest that a step is planned to take.
///
/// # Errors
/// When an edge takes so long that a cycle of the policy `max-plus` has no time for it, or that
/// driving along it would look like a deadlock.
fn longest_step(
    roadmap: &Roadmap,
    config: &NetworkConfig,
    timing: &Timing,
) -> Result<SimDuration, NetworkError> {
    let ways = EdgeTimes { roadmap, config };
    let longest = ways
        .longest()
        .filter(|_| config.motion == Motion::Continuous);
    let Some((edge, time)) = longest else {
        return Ok(timing.cycle);
    };
    let window = timing.cycle * u64::from(config.deadlock_window);
    let mut limits = vec![("network.deadlock_window", window)];
    if config.policy == Policy::MaxPlus {
        // What a rover is granted at the end of a cycle's phases it has done before the next cycle.
        let left = timing.cycle.saturating_sub(timing.decided_after());
        limits.insert(0, ("what network.cycle leaves after its phases", left));
    }
    match limits.into_iter().find(|&(_, limit)| time >= limit) {
        None => Ok(time.max(timing.cycle)),
        Some((limit_of, limit)) => Err(NetworkError::SlowEdge {
            edge,
            length_m: ways.length_m(edge.0, edge.1),
            time,
            limit_of,
            limit,
        }),
    }
}

fn names(kind: &str, count: usize) -> Vec<String> {
    let count = count as u32;
    (0..count)
        .map(|number| ids::name(kind, number, count))
        .collect()
}

fn declare_nodes(sim: &mut Simulation, site: &Arc<Shared>, wired: &Links) {
    for (id, name) in site.sensors.nodes().zip(&site.node_names) {
        let host = sim.host(name);
        if site.config.policy == Policy::MaxPlus {
            // The other policies' nodes answer in microseconds, or one of them plans for all.
            sim.heavy(host);
        }
        let graph = Arc::new(LocalGraph::new(&site.roadmap, &site.sensors, id));
        let site = site.clone();
        let node = |processor: Processor| {
            move |_: &str| Node::new(site.clone(), id, graph.clone(), processor.clone())
        };
        let planner = format!("{name}/{PLANNER}");
        wired.processor(sim, &planner, |sim, processor| {
            sim.actor(host, name, node(processor))
        });
    }
}

fn declare_rovers(sim: &mut Simulation, site: &Arc<Shared>) {
    for (id, _) in site.team() {
        let name = &site.rover_names[id.0 as usize];
        let (host, site) = (sim.host(name), site.clone());
        sim.actor(host, name, move |_| Rover::new(site.clone(), id));
    }
}

/// Links both ways between neighbouring nodes, and between each node and each rover.
fn wiring(
    sim: &mut Simulation,
    sensors: &SensorNetwork,
    node_names: &[String],
    rover_names: &[&String],
) -> Wiring {
    let node_hosts: Vec<HostId> = node_names.iter().map(|name| sim.host(name)).collect();
    let rover_hosts: Vec<HostId> = rover_names.iter().map(|name| sim.host(name)).collect();
    let mut wiring = Wiring::default();
    for id in sensors.nodes() {
        let node = (node_hosts[id.0 as usize], &*node_names[id.0 as usize]);
        for other in sensors.neighbors(id) {
            let at = other.0 as usize;
            wiring.link(node, (node_hosts[at], &node_names[at]));
        }
        for (host, name) in rover_hosts.iter().zip(rover_names) {
            wiring.both_ways(node, (*host, name));
        }
    }
    wiring
}

/// Where each host stands at first, in the world's frame \[m\]: nodes at their places, as high as a
/// vertex of theirs; then rovers at their entries.
fn places_m<'a>(
    roadmap: &'a Roadmap,
    sensors: &'a SensorNetwork,
    missions: &'a [(VertexId, VertexId)],
) -> impl Iterator<Item = Point3<f64>> + 'a {
    let nodes = sensors.nodes().map(|id| {
        let at = sensors.position_m(id);
        let height_m = sensors.owned(id).first().map(|v| roadmap.height_m(*v));
        Point3::new(at.x, at.y, height_m.unwrap_or(0.0))
    });
    let rovers = missions.iter().map(|(entry, _)| {
        let at = roadmap.position_m(*entry);
        Point3::new(at.x, at.y, roadmap.height_m(*entry))
    });
    nodes.chain(rovers)
}

impl Network {
    /// The score so far: after the run, its result.
    pub fn metrics(&self) -> NetworkMetrics {
        let score = self.score.lock().unwrap_or_else(PoisonError::into_inner);
        score.metrics(&self.site)
    }

    /// How long the parts of a planning cycle last.
    pub fn timing(&self) -> Timing {
        self.site.timing
    }

    /// Whether rovers are coordinated by max-plus, as those of the policy `max-plus` are.
    pub fn coordinates(&self) -> bool {
        self.site.config.policy == Policy::MaxPlus
    }

    /// The length of a planning cycle, stretched if links are slow.
    pub fn cycle(&self) -> SimDuration {
        self.site.timing.cycle
    }

    /// How many rovers have arrived so far.
    pub fn arrived(&self) -> u32 {
        let score = self.score.lock().unwrap_or_else(PoisonError::into_inner);
        score.arrived()
    }

    /// How many collisions there were so far.
    pub fn collisions(&self) -> u32 {
        let score = self.score.lock().unwrap_or_else(PoisonError::into_inner);
        score.collisions()
    }

    /// The nodes' names, in order; hosts are called the same.
    pub fn node_names(&self) -> &[String] {
        &self.site.node_names
    }

    /// The names of the rovers of the whole team, in order; hosts are called the same.
    pub fn rover_names(&self) -> &[String] {
        &self.site.rover_names
    }

    /// How many of them take part.
    pub fn team_size(&self) -> usize {
        self.site.team().count()
    }

    /// Each rover's entry and goal, in the order of the names.
    pub fn missions(&self) -> &[(VertexId, VertexId)] {
        &self.site.missions
    }

    /// The rovers that gaps leave without a way, which never enter: a sentence for each.
    pub fn refused(&self) -> Vec<String> {
        let sentence = |r: &Refused| r.sentence(&self.site.rover_names);
        self.site.refused.iter().map(sentence).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::TeamConfig;
    use crate::testing::{assembled, grid};

    fn part(only: &[&str], network: &NetworkConfig) -> (Simulation, Network) {
        let (world, roadmap) = (WorldConfig::default(), Arc::new(grid(6, 6, &[])));
        let world = WorldConfig { nodes: 4, ..world };
        let sensors = Arc::new(world.place(&roadmap, 3).unwrap());
        let team = TeamConfig {
            only: only.iter().map(|name| (*name).to_owned()).collect(),
            ..TeamConfig::of(12)
        };
        assembled(3, &world, roadmap, sensors, &team, network)
    }

    #[test]
    fn those_that_take_part_are_as_in_the_whole_team_and_the_others_are_not_there() {
        for (policy, failover_after) in [
            (Policy::MaxPlus, None),
            (Policy::Complete, Some(3)),
            (Policy::Reference, None),
        ] {
            let network = NetworkConfig {
                policy,
                failover_after,
                ..NetworkConfig::default()
            };
            let (_, whole) = part(&[], &network);
            let (mut sim, some) = part(&["rover_11", "rover_03"], &network);
            assert_eq!(some.missions(), whole.missions());
            let hosts = sim.host_names().filter(|name| name.starts_with("rover"));
            assert_eq!(hosts.collect::<Vec<_>>(), ["rover_03", "rover_11"]);
            assert_eq!((whole.team_size(), some.team_size()), (12, 2));
            if failover_after.is_some() {
                // Its backup hears from the two there are, and waits for no others.
                let at = SimTime::ZERO + SimDuration::from_millis(1500);
                sim.crash_named_at(at, "node_02").unwrap();
            }
            sim.run(Executor::Inline).unwrap();
            let metrics = some.metrics();
            let done = (metrics.rovers, metrics.arrived, metrics.arrival_s.len());
            assert_eq!(done, (2, 2, 2), "{policy:?}: {metrics:?}");
            assert!(metrics.completed && metrics.collisions == 0);
            assert_eq!(metrics.failovers > 0, failover_after.is_some());
        }
    }

    #[test]
    fn whom_nobody_knows_takes_no_part() {
        let names = names("rover", 12);
        let error = |only: &[&str]| {
            let only: Vec<String> = only.iter().map(|name| (*name).to_owned()).collect();
            takes_part(&names, &only).unwrap_err().to_string()
        };
        assert_eq!(
            error(&["rover_01", "rover_13"]),
            "\"rover_13\": expected the name of one of 12 rovers; did you mean \"rover_03\"?"
        );
        let twice = error(&["rover_01", "rover_02", "rover_01"]);
        assert_eq!(twice, "\"rover_01\": expected each name once");
    }
}
