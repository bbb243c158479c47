//! The `complete` policy: no team of queued rovers comes to a deadlock, over perfect links and bad
//! ones, with crashes, on both roadmaps and with all endpoints. On maps where rovers stay at their
//! goals: all arrive on well-formed instances, and where one has to make way for another.

use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap};
use std::sync::Arc;

use farside::prelude::*;
use farside_actors::link::{Link, LinkParams};
use farside_network::mapf::{Mission, Order, Problem, Rules, reference};
use farside_network::{
    Deadlock, Gaps, Missions, Network, NetworkConfig, NetworkError, NetworkMetrics, Parts, Policy,
    TeamConfig, WorldConfig, assemble_over, missions,
};
use farside_worlds::movingai::{Builtin, GridMap, GridWorld, TaskList};
use farside_worlds::{Endpoints, Roadmap, SensorNetwork, VertexId};

#[derive(Clone, Copy, Debug)]
pub(crate) struct Radio {
    pub(crate) latency_ms: u64,
    pub(crate) loss: f64,
}

pub(crate) const PERFECT: Radio = Radio {
    latency_ms: 5,
    loss: 0.0,
};

impl Radio {
    fn link(self) -> Link {
        Link::new(LinkParams {
            latency: SimDuration::from_millis(self.latency_ms),
            loss: self.loss,
            ..LinkParams::default()
        })
    }
}

pub(crate) fn config(policy: Policy) -> NetworkConfig {
    NetworkConfig {
        policy,
        ..NetworkConfig::default()
    }
}

fn queued(
    world: &WorldConfig,
    rovers: u32,
    seed: u64,
    radio: Radio,
    config: &NetworkConfig,
) -> (Simulation, Network) {
    let roadmap = Arc::new(Roadmap::builtin(world.roadmap.name()).unwrap());
    let mut sim = Simulation::new(seed);
    let parts = Parts::placed(world, roadmap, config, seed).unwrap();
    let missions = missions(world, &parts.roadmap, &TeamConfig::of(rovers), seed).unwrap();
    let network = assemble_over(&mut sim, &parts, &Missions::Queued(missions), |_, _| {
        radio.link()
    });
    (sim, network.unwrap())
}

fn standing(
    roadmap: Roadmap,
    nodes: usize,
    tasks: Vec<(VertexId, VertexId)>,
    radio: Radio,
    seed: u64,
) -> NetworkMetrics {
    let config = config(Policy::Complete);
    standing_with(&config, roadmap, nodes, tasks, radio, seed)
        .expect("the missions can be assembled")
}

/// Rovers that stand on a map, with as many nodes as can be placed on it, at most `nodes`.
pub(crate) fn standing_network(
    config: &NetworkConfig,
    roadmap: Roadmap,
    nodes: usize,
    tasks: Vec<(VertexId, VertexId)>,
    radio: Radio,
    seed: u64,
) -> (Simulation, Result<Network, NetworkError>) {
    let place = |nodes: usize| {
        let radius_m = SensorNetwork::default_radius_m(&roadmap, nodes);
        let radii = (0..6).map(|times| radius_m * f64::from(1 << times));
        let mut placed =
            radii.filter_map(|radius_m| SensorNetwork::place(&roadmap, nodes, radius_m, seed).ok());
        placed.next()
    };
    let sensors = (1..=nodes.min(roadmap.len())).rev().find_map(place);
    let sensors = sensors.expect("one node that reaches everywhere can be placed anywhere");
    let missions = Missions::Standing(tasks);
    network_of(config, (roadmap, sensors), &missions, radio, seed)
}

/// A network of these nodes.
pub(crate) fn network_of(
    config: &NetworkConfig,
    (roadmap, sensors): (Roadmap, SensorNetwork),
    missions: &Missions,
    radio: Radio,
    seed: u64,
) -> (Simulation, Result<Network, NetworkError>) {
    let mut sim = Simulation::new(seed);
    let parts = Parts {
        world: &WorldConfig::default(),
        roadmap: Arc::new(roadmap),
        sensors: Arc::new(sensors),
        config,
        terrain: None,
        only: &[],
    };
    let network = assemble_over(&mut sim, &parts, missions, |_, _| radio.link());
    (sim, network)
}

/// None where the policy plans ahead and finds no plan.
pub(crate) fn standing_with(
    config: &NetworkConfig,
    roadmap: Roadmap,
    nodes: usize,
    tasks: Vec<(VertexId, VertexId)>,
    radio: Radio,
    seed: u64,
) -> Option<NetworkMetrics> {
    let network = match standing_network(config, roadmap, nodes, tasks, radio, seed) {
        (_, Err(NetworkError::NoPlan(_))) => return None,
        (sim, network) => (sim, network.unwrap()),
    };
    network.0.run(Executor::Inline).unwrap();
    Some(network.1.metrics())
}

#[track_caller]
fn all_arrive(metrics: &NetworkMetrics) {
    assert_eq!(
        (metrics.arrived, metrics.collisions, metrics.deadlock),
        (metrics.rovers, 0, Deadlock::None),
        "{:?}",
        metrics.deadlock_reason
    );
}

#[test]
fn all_endpoints_on_both_roadmaps() {
    for map in ["crater-dense", "crater-sparse"] {
        for endpoints in [
            Endpoints::Alternating,
            Endpoints::AnyToAny,
            Endpoints::WestToEast,
        ] {
            let world = WorldConfig {
                roadmap: map.into(),
                endpoints,
                nodes: 21,
                ..WorldConfig::default()
            };
            let (sim, network) = queued(&world, 100, 3, PERFECT, &config(Policy::Complete));
            sim.run(Executor::Inline).unwrap();
            all_arrive(&network.metrics());
        }
    }
}

#[test]
fn late_and_lossy_links_slow_a_team_down_and_do_not_stop_it() {
    let time = |latency_ms, loss| {
        let radio = Radio { latency_ms, loss };
        let world = WorldConfig::default();
        let (sim, network) = queued(&world, 30, 5, radio, &config(Policy::Complete));
        sim.run(Executor::Inline).unwrap();
        all_arrive(&network.metrics());
        network.metrics().cycles
    };
    let healthy = time(5, 0.0);
    assert!(time(5, 0.5) > healthy);
    assert!(time(3000, 0.3) > 3 * healthy);
}

#[test]
fn nodes_and_rovers_that_crash_and_come_back() {
    let world = WorldConfig::default();
    let radio = Radio {
        latency_ms: 5,
        loss: 0.1,
    };
    let (mut sim, network) = queued(&world, 50, 2, radio, &config(Policy::Complete));
    let at = |tenths: u64| SimTime::ZERO + SimDuration::from_millis(tenths * 100 + 3);
    for (i, name) in (0..).zip(network.node_names()) {
        sim.crash_named_at(at(1 + 9 * i), name).unwrap();
        sim.restart_named_at(at(60 + 9 * i), name).unwrap();
    }
    for (i, name) in (0..).zip(network.rover_names()).step_by(5) {
        sim.crash_named_at(at(100 + 7 * i), name).unwrap();
        sim.restart_named_at(at(180 + 7 * i), name).unwrap();
    }
    sim.run(Executor::Inline).unwrap();
    all_arrive(&network.metrics());
}

/// A third of the vertices is out of everybody's hearing.
#[test]
fn a_team_crosses_gaps_over_lossy_links_and_past_crashes() {
    let world = WorldConfig {
        coverage_m: Some(50.0),
        gaps: Gaps::Cross,
        ..WorldConfig::default()
    };
    let radio = Radio {
        latency_ms: 5,
        loss: 0.2,
    };
    let (mut sim, network) = queued(&world, 60, 2, radio, &config(Policy::Complete));
    let at = |tenths: u64| SimTime::ZERO + SimDuration::from_millis(tenths * 100 + 3);
    for (i, name) in (0..).zip(network.node_names()) {
        sim.crash_named_at(at(1 + 9 * i), name).unwrap();
        sim.restart_named_at(at(60 + 9 * i), name).unwrap();
    }
    for (i, name) in (0..).zip(network.rover_names()).step_by(3) {
        sim.crash_named_at(at(100 + 7 * i), name).unwrap();
        sim.restart_named_at(at(180 + 7 * i), name).unwrap();
    }
    sim.run(Executor::Inline).unwrap();
    let metrics = network.metrics();
    let roadmap = Roadmap::builtin(world.roadmap.name()).unwrap();
    let gaps = world.place(&roadmap, 2).unwrap().gaps().len();
    assert!(gaps * 10 > roadmap.len(), "{gaps} gaps");
    assert!(metrics.arrived > 20, "{:?}", metrics.deadlock_reason);
    let done = (metrics.arrived + metrics.refused, metrics.collisions);
    assert_eq!(done, (60, 0), "{:?}", metrics.deadlock_reason);
}

#[test]
fn threads_change_nothing() {
    let run = |executor| {
        let radio = Radio {
            latency_ms: 20,
            loss: 0.1,
        };
        let world = WorldConfig::default();
        let (mut sim, network) = queued(&world, 20, 9, radio, &config(Policy::Complete));
        // They are not, but the run is to have several engines.
        let host = sim.host("node_01");
        sim.heavy(host);
        let host = sim.host("node_02");
        sim.heavy(host);
        assert_eq!(sim.executor_that_pays(2), Executor::Kameo { threads: 2 });
        let report = sim.run(executor).unwrap();
        (network.metrics(), report)
    };
    assert_eq!(run(Executor::Inline), run(Executor::Kameo { threads: 2 }));
}

/// What is planned centrally is driven as it was planned, cycle by cycle.
#[test]
fn the_references_plan_is_driven() {
    let world = WorldConfig::default();
    let (sim, network) = queued(&world, 60, 4, PERFECT, &config(Policy::Reference));
    sim.run(Executor::Inline).unwrap();
    let metrics = network.metrics();
    all_arrive(&metrics);
    let roadmap = Roadmap::builtin(world.roadmap.name()).unwrap();
    let all = missions(&world, &roadmap, &TeamConfig::of(60), 4).unwrap();
    let all = all.into_iter().map(|(a, b)| Mission::new(a, b)).collect();
    let problem = Problem::new(&roadmap, all, Rules::DisappearAtTarget).unwrap();
    let plan = reference(&problem, &Order::QueuePosition).plan;
    let planned = plan.metrics(&problem);
    // Following takes some milliseconds, so a rover may come a cycle early (grants are given ahead)
    // or late.
    let ratio = metrics.time_ratio / planned.time_ratio;
    assert!((0.9..1.1).contains(&ratio), "{ratio}");
    let (sim, network) = queued(&world, 60, 4, PERFECT, &config(Policy::Complete));
    sim.run(Executor::Inline).unwrap();
    let ratio = network.metrics().time_ratio / metrics.time_ratio;
    assert!((0.85..1.15).contains(&ratio), "{ratio}");
}

#[test]
fn the_baseline_that_fails_leaves_rovers_out() {
    let world = WorldConfig::default();
    let (sim, network) = queued(&world, 100, 1, PERFECT, &config(Policy::Prioritised));
    sim.run(Executor::Inline).unwrap();
    let metrics = network.metrics();
    assert_eq!(
        (metrics.collisions, metrics.deadlock),
        (0, Deadlock::Passive)
    );
    assert!((30..95).contains(&metrics.arrived), "{}", metrics.arrived);
    let (sim, network) = queued(&world, 4, 1, PERFECT, &config(Policy::Coupled));
    sim.run(Executor::Inline).unwrap();
    all_arrive(&network.metrics());
    assert!(network.metrics().plan_expansions > 20);
}

#[test]
fn rovers_that_stay_at_their_goals_arrive_on_a_well_formed_instance() {
    let file = Builtin::find("rubble-32-32-10").unwrap();
    let map = GridMap::from_movingai(file.map).unwrap();
    let tasks = TaskList::from_movingai(file.tasks).unwrap();
    let grid = GridWorld::new(file.map_name, &map, 10.0, tasks.first(50).unwrap()).unwrap();
    assert!(grid.blocked().is_empty());
    let radio = Radio {
        latency_ms: 20,
        loss: 0.2,
    };
    let metrics = standing(grid.roadmap().clone(), 16, grid.tasks().to_vec(), radio, 1);
    all_arrive(&metrics);
    assert!(metrics.time_ratio < 2.0, "{}", metrics.time_ratio);
}

/// The first rover's goal lies behind the second one's: it is asked to step aside, and comes back.
#[test]
fn a_rover_at_its_goal_makes_way() {
    let text = b"type octile\nheight 2\nwidth 6\nmap\n......\n@@.@@@\n";
    let map = GridMap::from_movingai(text).unwrap();
    let scen = b"version 1\n0\ta.map\t6\t2\t0\t0\t5\t0\t5\n0\ta.map\t6\t2\t1\t0\t4\t0\t3\n";
    let tasks = TaskList::from_movingai(scen).unwrap();
    let grid = GridWorld::new("a.map", &map, 10.0, tasks.tasks()).unwrap();
    assert_eq!(grid.blocked().len(), 1);
    for nodes in [1, 2, 3] {
        let (map, tasks) = (grid.roadmap().clone(), grid.tasks().to_vec());
        let metrics = standing(map, nodes, tasks, PERFECT, 1);
        all_arrive(&metrics);
        assert!(metrics.mean_backtracks > 0.0);
    }
}

/// Far from well-formed: almost one cell in three has a rover, and most must make way for some
/// other.
#[test]
fn crowded_maps_are_sorted_out() {
    let map = GridMap::random(16, 16, 0.1, 4).unwrap();
    for seed in 1..4 {
        let tasks = TaskList::random("x.map", &map, 65, seed).unwrap();
        let grid = GridWorld::new("x.map", &map, 10.0, tasks.tasks()).unwrap();
        assert!(grid.blocked().len() > 5, "{}", grid.blocked().len());
        let radio = Radio {
            latency_ms: 5,
            loss: 0.05,
        };
        let metrics = standing(grid.roadmap().clone(), 6, grid.tasks().to_vec(), radio, 1);
        all_arrive(&metrics);
        let costs = metrics.costs.unwrap();
        assert!(costs.suboptimality.unwrap() < 12.0, "{costs:?}");
    }
}

/// The least sum of costs of two rovers, by trying all that they can do: in each step each of them
/// moves, waits, or stays at its goal for good, which costs nothing any more.
fn least_sum(map: &Roadmap, tasks: &[(VertexId, VertexId)]) -> Option<u64> {
    type State = [(VertexId, bool); 2];
    let start: State = [(tasks[0].0, false), (tasks[1].0, false)];
    let mut open = BinaryHeap::from([Reverse((0, start))]);
    let mut done = BTreeSet::new();
    while let Some(Reverse((cost, state))) = open.pop() {
        if state.iter().all(|&(_, stays)| stays) {
            return Some(cost);
        }
        if !done.insert(state) {
            continue;
        }
        for rover in 0..2 {
            if state[rover] == (tasks[rover].1, false) {
                let mut next = state;
                next[rover].1 = true;
                open.push(Reverse((cost, next)));
            }
        }
        let moves = |(at, stays): (VertexId, bool)| match stays {
            true => vec![at],
            false => [&[at], map.neighbors(at)].concat(),
        };
        let step = state.iter().filter(|(_, stays)| !stays).count() as u64;
        for a in moves(state[0]) {
            for b in moves(state[1]) {
                let swap = (a, b) == (state[1].0, state[0].0);
                if a != b && !swap {
                    let next = [(a, state[0].1), (b, state[1].1)];
                    open.push(Reverse((cost + step, next)));
                }
            }
        }
    }
    None
}

/// What the exact search plans costs, when it is driven, what no solution can undercut; local
/// knowledge costs no less.
#[test]
fn costs_are_counted_as_in_the_literature() {
    let mut solved = 0;
    for seed in 0..12 {
        let map = GridMap::random(4, 3, 0.3, seed).unwrap();
        let Ok(tasks) = TaskList::random("x.map", &map, 2, seed) else {
            continue;
        };
        let grid = GridWorld::new("x.map", &map, 10.0, tasks.tasks()).unwrap();
        let costs = |policy| {
            let config = NetworkConfig {
                grants_ahead: 0,
                ..config(policy)
            };
            let (map, tasks) = (grid.roadmap().clone(), grid.tasks().to_vec());
            standing_with(&config, map, 1, tasks, PERFECT, 1).map(|metrics| metrics.costs.unwrap())
        };
        let least = least_sum(grid.roadmap(), grid.tasks());
        let exact = costs(Policy::Coupled).and_then(|costs| costs.sum_of_costs);
        assert_eq!(exact, least, "seed {seed}");
        let local = costs(Policy::Complete).unwrap();
        assert!(local.sum_of_costs.is_none_or(|sum| Some(sum) >= least));
        assert!(least.is_none_or(|least| least >= local.sum_of_costs_bound));
        solved += u32::from(least.is_some());
    }
    assert!(solved > 6, "{solved}");
}
