//! The `complete` policy on maps where rovers stand from the start and stay at their goals: random
//! small instances, whatever the number of nodes, over links that lose messages. On well-formed
//! ones all arrive, and on all others that can be solved.

use farside::prelude::*;
use farside_network::cases::strategies::roadmaps;
use farside_network::mapf::{
    CoupledConfig, CoupledError, LacamConfig, Mission, Problem, Rules, coupled, lacam,
};
use farside_network::{Missions, NetworkConfig, NetworkMetrics, Policy};
use farside_worlds::movingai::{Cell, GridMap, GridWorld, TaskList};
use farside_worlds::{Roadmap, SensorNetwork, VertexId, well_formed};
use proptest::prelude::*;

use crate::network_complete::{
    PERFECT, Radio, config, network_of, standing_network, standing_with,
};

type Tasks = Vec<(VertexId, VertexId)>;

#[derive(Clone, Debug)]
struct Instance {
    map: Roadmap,
    tasks: Tasks,
    nodes: usize,
    routes: u32,
    radio: Radio,
    seed: u64,
}

/// Up to so many rovers on up to so many vertices; no two starts and no two goals alike. Some are
/// at their goals from the start.
fn instances(vertices: usize, rovers: usize) -> impl Strategy<Value = Instance> {
    let pick = (any::<[prop::sample::Index; 2]>(), any::<bool>());
    let picks = prop::collection::vec(pick, 1..=rovers);
    let loss = prop_oneof![Just(0.0), Just(0.2)];
    // With one route a request knows no way but the shortest, apart from clear paths.
    let nodes = (1..=8usize, prop_oneof![Just(1), Just(8)]);
    let parts = (roadmaps(vertices), picks, nodes, loss, 0..100u64);
    parts.prop_map(|(map, picks, (nodes, routes), loss, seed)| {
        let mut tasks = Tasks::new();
        for (ends, is_parked) in picks {
            let [start, goal] = ends.map(|at| VertexId(at.index(map.len()) as u32));
            let goal = if is_parked { start } else { goal };
            if tasks.iter().all(|&(a, b)| a != start && b != goal) {
                tasks.push((start, goal));
            }
        }
        let radio = Radio {
            latency_ms: 5,
            loss,
        };
        Instance {
            map,
            tasks,
            nodes,
            routes,
            radio,
            seed,
        }
    })
}

/// Patient enough for retries.
fn complete() -> NetworkConfig {
    NetworkConfig {
        deadlock_window: 400,
        livelock_window: 4000,
        ..config(Policy::Complete)
    }
}

fn run(instance: &Instance, config: &NetworkConfig) -> NetworkMetrics {
    let Instance {
        map,
        tasks,
        nodes,
        routes,
        radio,
        seed,
    } = instance.clone();
    let mut config = config.clone();
    config.complete.routes = routes;
    standing_with(&config, map, nodes, tasks, radio, seed).expect("nothing is planned ahead")
}

/// Whether some path leads from the last vertex of `path` to `goal`, past no vertex twice and none
/// that is `taken`, by trying all.
fn leads_there(
    map: &Roadmap,
    path: &mut Vec<VertexId>,
    goal: VertexId,
    taken: &[VertexId],
) -> bool {
    let here = path[path.len() - 1];
    if taken.contains(&here) {
        return false;
    }
    here == goal
        || map.neighbors(here).iter().any(|&next| {
            !path.contains(&next) && {
                path.push(next);
                let found = leads_there(map, path, goal, taken);
                path.pop();
                found
            }
        })
}

fn is_well_formed(map: &Roadmap, tasks: &Tasks) -> bool {
    (0..tasks.len()).all(|task| {
        let others = tasks.iter().enumerate().filter(|(other, _)| *other != task);
        let taken: Vec<VertexId> = others.flat_map(|(_, &(a, b))| [a, b]).collect();
        let (start, goal) = tasks[task];
        leads_there(map, &mut vec![start], goal, &taken)
    })
}

/// The rovers of an instance that leave it well-formed, one after the other.
fn made_well_formed(mut instance: Instance) -> Instance {
    let mut tasks = Tasks::new();
    for &task in &instance.tasks {
        tasks.push(task);
        if !is_well_formed(&instance.map, &tasks) {
            tasks.pop();
        }
    }
    instance.tasks = tasks;
    instance
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 96,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn on_a_well_formed_instance_all_arrive(
        instance in instances(30, 10).prop_map(made_well_formed),
    ) {
        prop_assert_eq!(well_formed(&instance.map, &instance.tasks), []);
        let metrics = run(&instance, &complete());
        prop_assert_eq!(metrics.arrived, metrics.rovers, "{:?}", metrics.deadlock_reason);
        prop_assert_eq!(metrics.collisions, 0);
    }

    /// With failover there is no joint resolution: the argument is that of well-formed instances.
    #[test]
    fn nor_does_it_take_a_joint_plan(instance in instances(24, 8).prop_map(made_well_formed)) {
        let config = NetworkConfig {
            failover_after: Some(100),
            ..complete()
        };
        let metrics = run(&instance, &config);
        prop_assert_eq!(metrics.arrived, metrics.rovers, "{:?}", metrics.deadlock_reason);
        prop_assert_eq!(metrics.collisions, 0);
    }

    /// The exact search says which instances can be solved.
    #[test]
    fn whatever_can_be_solved_is(instance in instances(9, 5)) {
        let missions = instance.tasks.iter().copied().map(Mission::from).collect();
        let problem = Problem::new(&instance.map, missions, Rules::StayAtTarget).expect("it is one");
        let solvable = match coupled(&problem, &CoupledConfig::default()) {
            Ok(_) => true,
            Err(CoupledError::Unsolvable { .. }) => false,
            Err(CoupledError::Exhausted { .. }) => return Ok(()),
        };
        let metrics = run(&instance, &complete());
        prop_assert_eq!(metrics.collisions, 0);
        let all = metrics.arrived == metrics.rovers;
        prop_assert_eq!(all, solvable, "{:?}", metrics.deadlock_reason);
    }
}

/// So many rovers on a map at random places, more than half of which may have no clear path.
fn crowd(map: &GridMap, rovers: usize, seed: u64) -> (Roadmap, Tasks) {
    let tasks = TaskList::random("x.map", map, rovers, seed).expect("there is room");
    let grid = GridWorld::new("x.map", map, 10.0, tasks.tasks()).expect("all can be reached");
    (grid.roadmap().clone(), grid.tasks().to_vec())
}

/// A crowd, its nodes and links, and when its nodes and every third rover crash and come back \[ms\].
#[derive(Clone, Debug)]
struct Trouble {
    walls: u64,
    rovers: usize,
    nodes: usize,
    radio: Radio,
    crashes: Vec<(u64, u64)>,
    seed: u64,
}

fn trouble() -> impl Strategy<Value = Trouble> {
    let crashes = prop::collection::vec((0..6000u64, 100..6000u64), 0..4);
    let radio = (5..400u64, 0..30u32);
    let parts = (
        0..50u64,
        12..34usize,
        1..=9usize,
        radio,
        crashes,
        0..1000u64,
    );
    parts.prop_map(
        |(walls, rovers, nodes, (latency_ms, loss), crashes, seed)| Trouble {
            walls,
            rovers,
            nodes,
            radio: Radio {
                latency_ms,
                loss: f64::from(loss) / 100.0,
            },
            crashes,
            seed,
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 24,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    /// What all together can do they do, whatever is lost, late, or down for a while.
    #[test]
    fn a_crowd_in_trouble_arrives(trouble in trouble()) {
        let Trouble { walls, rovers, nodes, radio, crashes, seed } = trouble;
        let map = GridMap::random(9, 9, 0.15, walls).expect("it is a map");
        let (roadmap, tasks) = crowd(&map, rovers, seed);
        let missions = tasks.iter().copied().map(Mission::from).collect();
        let problem = Problem::new(&roadmap, missions, Rules::StayAtTarget).expect("it is one");
        prop_assume!(lacam(&problem, &LacamConfig::default()).is_ok());
        let (mut sim, network) = standing_network(&complete(), roadmap, nodes, tasks, radio, seed);
        let network = network.expect("it makes sense");
        let at = |ms: u64| SimTime::ZERO + SimDuration::from_millis(ms);
        for (i, (down, length)) in crashes.into_iter().enumerate() {
            let all = match i % 2 {
                0 => network.node_names(),
                _ => network.rover_names(),
            };
            let name = &all[(seed as usize + i) % all.len()];
            sim.crash_named_at(at(down), name).expect("it is there");
            sim.restart_named_at(at(down + length), name).expect("it is there");
        }
        sim.run(Executor::Inline).expect("it runs");
        let metrics = network.metrics();
        prop_assert_eq!(metrics.collisions, 0);
        prop_assert_eq!(metrics.arrived, metrics.rovers, "{:?}", metrics.deadlock_reason);
    }
}

/// Nodes and rovers that crash in the middle of a joint resolution lose nothing of it.
#[test]
fn a_joint_resolution_outlives_crashes_and_losses() {
    let map = GridMap::random(12, 12, 0.1, 4).expect("it is a map");
    for seed in 1..4 {
        let (roadmap, tasks) = crowd(&map, 45, seed);
        let radio = Radio {
            latency_ms: 50,
            loss: 0.2,
        };
        let (mut sim, network) = standing_network(&complete(), roadmap, 6, tasks, radio, seed);
        let network = network.expect("it makes sense");
        let at = |ms: u64| SimTime::ZERO + SimDuration::from_millis(ms);
        for (i, name) in (0..).zip(network.node_names()) {
            sim.crash_named_at(at(150 + 130 * i), name)
                .expect("it is there");
            sim.restart_named_at(at(2500 + 400 * i), name)
                .expect("it is there");
        }
        for (i, name) in (0..).zip(network.rover_names()).step_by(3) {
            sim.crash_named_at(at(3000 + 70 * i), name)
                .expect("it is there");
            sim.restart_named_at(at(8000 + 70 * i), name)
                .expect("it is there");
        }
        sim.run(Executor::Inline).expect("it runs");
        let metrics = network.metrics();
        let done = (metrics.arrived, metrics.collisions);
        assert_eq!(done, (45, 0), "{:?}", metrics.deadlock_reason);
    }
}

/// What a crowded map costs, beside what it costs who knows everything from the start.
#[test]
fn a_crowd_costs_little_more_than_planned_from_the_start() {
    let map = GridMap::random(16, 16, 0.15, 7).expect("it is a map");
    for seed in 1..4 {
        let (roadmap, tasks) = crowd(&map, 70, seed);
        let cost = |policy| {
            let config = NetworkConfig {
                grants_ahead: 0,
                ..config(policy)
            };
            let (map, tasks) = (roadmap.clone(), tasks.clone());
            let metrics = standing_with(&config, map, 8, tasks, PERFECT, 1).expect("it is solved");
            metrics
                .costs
                .and_then(|costs| costs.sum_of_costs)
                .expect("all arrive")
        };
        let (here, there) = (cost(Policy::Complete), cost(Policy::Lacam));
        assert!(here * 4 < there * 5, "seed {seed}: {here} where {there} do");
    }
}

/// Two nodes side by side on 20 columns of 40 rows, the left one's border with the right one 40
/// vertices long. Of the right one's first column leads one on, at its far end; nearer vertices
/// lead nowhere but along the column, in which `in_column` is in row 30.
fn long_border(in_column: char) -> (GridWorld, SensorNetwork) {
    let row = |y: usize| match y {
        39 => ".".repeat(20) + "\n",
        30 => format!("..........{in_column}@@@@@@@@@\n"),
        _ => "...........@@@@@@@@@\n".to_owned(),
    };
    let rows: String = (0..40).map(row).collect();
    let text = format!("type octile\nheight 40\nwidth 20\nmap\n{rows}");
    let map = GridMap::from_movingai(text.as_bytes()).expect("it is a map");
    let line = |from: &str, to: &str| format!("0\tx.map\t20\t40\t{from}\t{to}\t0\n");
    let mut scen = "version 1\n".to_owned() + &line("0\t0", "19\t39");
    if in_column == '.' {
        scen += &line("10\t30", "10\t30");
    }
    let tasks = TaskList::from_movingai(scen.as_bytes()).expect("they are tasks");
    let grid = GridWorld::new("x.map", &map, 10.0, tasks.tasks()).expect("all can be reached");
    let place = |column: u32| {
        let [top, bottom] = [0, 39].map(|y| {
            let vertex = grid.vertex(Cell { x: column, y }).expect("it is free");
            grid.roadmap().position_m(vertex)
        });
        top + (bottom - top) * 0.5
    };
    // As far from the border on either side.
    let (left, right) = (place(9), place(10));
    let sensors = SensorNetwork::new(grid.roadmap(), vec![left, right], 1000.0);
    (grid, sensors.expect("they cover all"))
}

/// A parked rover cuts off what is nearest; the clear path goes on from where the border is far.
#[test]
fn a_clear_path_is_handed_on_past_a_long_border() {
    let (grid, sensors) = long_border('.');
    assert_eq!(grid.blocked().len(), 0);
    let missions = Missions::Standing(grid.tasks().to_vec());
    let places = (grid.roadmap().clone(), sensors);
    let (sim, network) = network_of(&complete(), places, &missions, PERFECT, 1);
    let network = network.expect("it makes sense");
    sim.run(Executor::Inline).expect("it runs");
    let metrics = network.metrics();
    assert_eq!(metrics.arrived, 2, "{:?}", metrics.deadlock_reason);
}

/// A wall cuts off what is nearest: what is left of the other region is two parts. Queued rovers
/// know no clear paths.
#[test]
fn what_lies_far_along_a_border_is_found() {
    let (grid, sensors) = long_border('@');
    let missions = Missions::Queued(grid.tasks().to_vec());
    let places = (grid.roadmap().clone(), sensors);
    let (sim, network) = network_of(&complete(), places, &missions, PERFECT, 1);
    let network = network.expect("it makes sense");
    sim.run(Executor::Inline).expect("it runs");
    let metrics = network.metrics();
    assert_eq!(metrics.arrived, 1, "{:?}", metrics.deadlock_reason);
}
