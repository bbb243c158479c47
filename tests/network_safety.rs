//! No collision, whatever the links and the faults: random roadmaps, teams and seeds, loss from
//! 0 to 100 %, latency of several cycles, duplicates, reordering, degradations, crashes and restarts.
//! And that the test can fail: with a rule of the safety protocol broken, the monitor turns red
//! (the last two tests; setting `network.sabotage` in `scenario` shows a shrunk case).

use std::sync::Arc;

use farside::carrier::{Carrier, NoChange, Parcel, Verdicts};
use farside::prelude::*;
use farside_actors::network::{
    Deadlock, NetworkConfig, NetworkMetrics, Sabotage, TeamConfig, WorldConfig, assemble,
};
use farside_worlds::{Endpoints, Roadmap, VertexId};
use nalgebra::Point2;
use proptest::prelude::*;

/// A link that delays, reorders, loses and repeats; worse in the middle of the run.
#[derive(Clone, Debug)]
struct Bad {
    latency_ms: u64,
    jitter_ms: u64,
    loss: f64,
    duplicates: f64,
    /// Between these seconds everything is lost.
    outage_s: (u64, u64),
}

impl Bad {
    fn good() -> Bad {
        Bad {
            latency_ms: 5,
            jitter_ms: 0,
            loss: 0.0,
            duplicates: 0.0,
            outage_s: (0, 0),
        }
    }
}

impl Carrier for Bad {
    type Change = NoChange;

    fn min_delay(&self) -> SimDuration {
        SimDuration::from_millis(self.latency_ms)
    }

    fn carry(&mut self, parcel: &Parcel<'_>, verdicts: &mut Verdicts) {
        let second = parcel.now().as_nanos() / 1_000_000_000;
        if (self.outage_s.0..self.outage_s.1).contains(&second) {
            return verdicts.lose("outage");
        }
        if parcel.random(0, 0, 0).uniform() < self.loss {
            return verdicts.lose("loss");
        }
        let delay = |copy| {
            let share = parcel.random(1, 0, copy).uniform();
            SimDuration::from_secs_f64(
                (self.latency_ms as f64 + share * self.jitter_ms as f64) / 1e3,
            )
        };
        verdicts.deliver(delay(0));
        if parcel.random(2, 0, 0).uniform() < self.duplicates {
            verdicts.deliver(delay(1));
        }
    }

    fn change(&mut self, _change: NoChange, _now: SimTime) {}
}

/// A small world and what goes wrong in it. All small numbers, so that it shrinks well.
#[derive(Clone, Debug)]
struct Scenario {
    seed: u64,
    columns: u32,
    rows: u32,
    /// Edges of the grid are left out by these bits, as long as it stays connected.
    cuts: u64,
    nodes: u32,
    rovers: u32,
    endpoints: Endpoints,
    link: Bad,
    /// (second, tenths until the restart, who).
    crashes: Vec<(u64, u64, u32)>,
    network: NetworkConfig,
}

fn scenario() -> impl Strategy<Value = Scenario> {
    let world = (1..1000u64, 2..6u32, 2..5u32, any::<u64>(), 1..6u32, 1..9u32);
    let endpoints = prop_oneof![
        Just(Endpoints::Alternating),
        Just(Endpoints::AnyToAny),
        Just(Endpoints::WestToEast)
    ];
    let loss = prop_oneof![Just(0.0), 0.0..0.5, 0.5..=1.0];
    let latency = prop_oneof![Just(5u64), 1..100u64, 100..3000u64];
    let link = (
        latency,
        prop_oneof![Just(0u64), 0..2000u64],
        loss,
        0.0..0.5,
        0..40u64,
        0..10u64,
    );
    let crashes = prop::collection::vec((1..40u64, 1..80u64, 0..12u32), 0..6);
    (world, endpoints, link, crashes, any::<[bool; 4]>()).prop_map(
        |(world, endpoints, link, crashes, aids)| Scenario {
            seed: world.0,
            columns: world.1,
            rows: world.2,
            cuts: world.3,
            nodes: world.4,
            rovers: world.5,
            endpoints,
            link: Bad {
                latency_ms: link.0,
                jitter_ms: link.1,
                loss: link.2,
                duplicates: link.3,
                outage_s: (link.4, link.4 + link.5),
            },
            crashes,
            network: NetworkConfig {
                acceleration_chains: aids[0],
                entry_gates: aids[1],
                corridor_tokens: aids[2],
                junction_resolution: aids[3],
                probe_after: 2,
                cycle_limit: 120,
                ..rigid()
            },
        },
    )
}

/// Phases that do not stretch with latency, so that messages come cycles late.
fn rigid() -> NetworkConfig {
    NetworkConfig {
        cycle: Some(SimDuration::from_secs(1)),
        exchange: Some(SimDuration::from_millis(50)),
        optimisation: Some(SimDuration::from_millis(500)),
        iteration_timeout: Some(SimDuration::from_millis(20)),
        ..NetworkConfig::default()
    }
}

/// A connected grid with some edges cut out: trees, loops, corridors.
fn roadmap(columns: u32, rows: u32, cuts: u64) -> Roadmap {
    let count = columns * rows;
    let at = |i: u32| Point2::new(f64::from(i % columns) * 10.0, f64::from(i / columns) * 10.0);
    let rim = |i: &u32| {
        let (x, y) = (i % columns, i / columns);
        x == 0 || y == 0 || x + 1 == columns || y + 1 == rows
    };
    let build = |edges: &[(u32, u32)]| {
        Roadmap::new(
            "cut grid",
            (0..count).map(at).collect(),
            edges
                .iter()
                .map(|&(a, b)| (VertexId(a), VertexId(b)))
                .collect(),
            (0..count).filter(rim).map(VertexId).collect(),
        )
    };
    let right = (0..count)
        .filter(|i| (i + 1) % columns != 0)
        .map(|i| (i, i + 1));
    let up = (0..count - columns).map(|i| (i, i + columns));
    let mut edges: Vec<_> = right.chain(up).collect();
    for (bit, edge) in edges.clone().into_iter().enumerate() {
        if cuts >> (bit % 64) & 1 == 1 {
            let fewer: Vec<_> = edges.iter().copied().filter(|&e| e != edge).collect();
            if build(&fewer).is_ok() {
                edges = fewer;
            }
        }
    }
    build(&edges).expect("the whole grid is connected")
}

fn run(scenario: &Scenario) -> (NetworkMetrics, Report) {
    run_on(scenario, Executor::Inline)
}

fn run_on(scenario: &Scenario, executor: Executor) -> (NetworkMetrics, Report) {
    let map = Arc::new(roadmap(scenario.columns, scenario.rows, scenario.cuts));
    let world = WorldConfig {
        nodes: scenario.nodes.min(map.len() as u32),
        radius_m: Some(100.0),
        endpoints: scenario.endpoints,
        ..WorldConfig::default()
    };
    let sensors = Arc::new(world.place(&map, scenario.seed).expect("everyone in range"));
    let team = TeamConfig {
        rovers: scenario.rovers,
    };
    let mut sim = Simulation::new(scenario.seed);
    let mut connect = |sim: &mut Simulation, (a, from): (HostId, &str), (b, to): (HostId, &str)| {
        sim.link(a, b, &format!("{from}-{to}"), scenario.link.clone());
    };
    let (settings, seed) = (&scenario.network, scenario.seed);
    let network = assemble(
        &mut sim,
        &world,
        map,
        sensors,
        &team,
        settings,
        seed,
        &mut connect,
    )
    .unwrap();
    let names: Vec<_> = network
        .node_names()
        .iter()
        .chain(network.rover_names())
        .collect();
    for &(second, tenths, who) in &scenario.crashes {
        let name = names[who as usize % names.len()];
        // Off the cycle's own instants, so that crashes fall between any two events.
        let down = SimTime::ZERO + SimDuration::from_millis(second * 1000 + tenths * 97 % 1000);
        network.crash_at(&mut sim, down, name).unwrap();
        network
            .restart_at(
                &mut sim,
                down + SimDuration::from_millis(tenths * 100),
                name,
            )
            .unwrap();
    }
    let report = sim.run(executor).unwrap();
    assert_eq!(report.end.name(), "stopped", "{}", report.end.detail());
    (network.metrics(), report)
}

fn plain(seed: u64) -> Scenario {
    Scenario {
        seed,
        columns: 5,
        rows: 4,
        cuts: 0x2d5a_96b4_c3a5_1e78,
        nodes: 4,
        rovers: 6,
        endpoints: Endpoints::Alternating,
        link: Bad::good(),
        crashes: Vec::new(),
        network: rigid(),
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn rovers_never_collide(scenario in scenario()) {
        let (metrics, report) = run(&scenario);
        prop_assert_eq!(metrics.collisions, 0, "{}", report.end.detail());
    }
}

#[test]
fn with_everything_lost_nobody_moves_and_the_run_ends() {
    let mut scenario = plain(3);
    scenario.link.loss = 1.0;
    let (metrics, report) = run(&scenario);
    assert_eq!((metrics.arrived, metrics.collisions), (0, 0));
    assert_eq!(metrics.deadlock, Deadlock::Passive);
    assert!(
        report
            .end
            .detail()
            .contains("passive deadlock: 6 rovers left")
    );
}

#[test]
fn with_a_third_lost_all_arrive() {
    for seed in 1..=5 {
        let mut scenario = plain(seed);
        scenario.rovers = 3;
        scenario.link.loss = 0.3;
        let (metrics, report) = run(&scenario);
        assert_eq!(
            (metrics.arrived, metrics.collisions),
            (3, 0),
            "{}",
            report.end.detail()
        );
    }
}

#[test]
fn a_latency_of_several_cycles_slows_down_and_does_not_stop() {
    let mut scenario = plain(1);
    scenario.rovers = 2;
    scenario.link.latency_ms = 2300;
    scenario.link.jitter_ms = 900;
    scenario.network.passive_window = 40;
    let (slow, report) = run(&scenario);
    assert_eq!(
        (slow.arrived, slow.collisions),
        (2, 0),
        "{}",
        report.end.detail()
    );
    scenario.link = Bad::good();
    let (fast, _) = run(&scenario);
    assert!(
        slow.cycles > 3 * fast.cycles,
        "{} and {}",
        slow.cycles,
        fast.cycles
    );
}

#[test]
fn a_rover_that_is_gone_for_good_is_named() {
    let mut scenario = plain(2);
    scenario.rovers = 1;
    // Nothing restarts it within the run.
    scenario.crashes = vec![(3, 1_000_000, scenario.nodes)];
    let (metrics, report) = run(&scenario);
    assert_eq!(metrics.deadlock, Deadlock::Passive);
    assert!(
        report.end.detail().contains("rover_01 at vertex"),
        "{}",
        report.end.detail()
    );
}

#[test]
fn threads_change_nothing() {
    let mut scenario = plain(7);
    scenario.rovers = 12;
    scenario.link = Bad {
        jitter_ms: 30,
        loss: 0.1,
        duplicates: 0.1,
        ..Bad::good()
    };
    scenario.crashes = vec![(2, 30, 1), (4, 15, 6)];
    let (metrics, report) = run(&scenario);
    assert_eq!(run(&scenario), (metrics.clone(), report.clone()));
    let threads = Executor::Kameo { threads: 2 };
    assert_eq!(run_on(&scenario, threads), (metrics, report));
}

/// The monitor notices if a rule is broken: owners that grant an occupied vertex now and then.
#[test]
fn granting_an_occupied_vertex_is_noticed() {
    assert!(collides_with(Sabotage::GrantOccupied(0.05)));
}

/// And rovers that move without a grant.
#[test]
fn moving_without_a_grant_is_noticed() {
    assert!(collides_with(Sabotage::MoveUnbidden(0.05)));
}

/// Whether one of a hundred small runs with this fault shows a collision.
fn collides_with(sabotage: Sabotage) -> bool {
    let collides = |seed| {
        let mut scenario = plain(seed);
        scenario.rovers = 12;
        scenario.network.sabotage = sabotage;
        run(&scenario).0.collisions > 0
    };
    (1..=100).any(collides)
}
