//! The default team on the dense roadmap: 50 rovers, 28 nodes, links of 5 ms that lose 2 %. All
//! arrive, also when nodes and rovers crash on the way.

use std::sync::Arc;

use farside::prelude::*;
use farside_actors::link::{Link, LinkParams};
use farside_network::{
    Deadlock, Missions, Network, NetworkConfig, NetworkError, Parts, TeamConfig, WorldConfig,
    assemble_over, missions,
};
use farside_worlds::Roadmap;

/// Six milliseconds, give or take one; a fiftieth is lost.
fn lossy() -> Link {
    Link::new(LinkParams {
        latency: SimDuration::from_millis(6),
        jitter: SimDuration::from_millis(1),
        loss: 0.02,
        ..LinkParams::default()
    })
}

fn team(seed: u64, rovers: u32) -> Result<(Simulation, Network), NetworkError> {
    let world = WorldConfig::default();
    let roadmap = Arc::new(Roadmap::builtin(world.roadmap.name()).unwrap());
    let mut sim = Simulation::new(seed);
    let (team, network) = (TeamConfig::of(rovers), NetworkConfig::default());
    let parts = Parts::placed(&world, roadmap, &network, seed).unwrap();
    let missions = Missions::Queued(missions(&world, &parts.roadmap, &team, seed)?);
    let network = assemble_over(&mut sim, &parts, &missions, |_, _| lossy())?;
    Ok((sim, network))
}

#[test]
fn the_default_team_arrives() {
    let (sim, network) = team(1, 50).unwrap();
    let report = sim.run(Executor::Inline).unwrap();
    let metrics = network.metrics();
    assert_eq!(report.end.detail(), "@control: all rovers have arrived");
    assert_eq!((metrics.arrived, metrics.collisions), (50, 0));
    assert_eq!(metrics.deadlock, Deadlock::None);
    assert!(metrics.path_ratio > 1.0 && metrics.time_ratio > metrics.path_ratio);
    assert!(metrics.max_plus_iterations > 1.0);
}

#[test]
fn the_team_arrives_after_crashes() {
    let (mut sim, network) = team(2, 25).unwrap();
    let at = |tenths| SimTime::ZERO + SimDuration::from_millis(tenths * 100 + 7);
    // Every third node, then every node at once, then every fourth rover.
    let nodes = network.node_names().iter().enumerate();
    for (i, name) in nodes.map(|(i, name)| (i as u64, name)) {
        if i % 3 == 0 {
            sim.crash_named_at(at(40 + 3 * i), name).unwrap();
            sim.restart_named_at(at(90 + 5 * i), name).unwrap();
        }
        sim.crash_named_at(at(304), name).unwrap();
        sim.restart_named_at(at(331), name).unwrap();
    }
    for (i, name) in (0..).zip(network.rover_names()).step_by(4) {
        sim.crash_named_at(at(150 + 7 * i), name).unwrap();
        sim.restart_named_at(at(200 + 7 * i), name).unwrap();
    }
    let report = sim.run(Executor::Inline).unwrap();
    let metrics = network.metrics();
    assert_eq!(
        (metrics.arrived, metrics.collisions),
        (25, 0),
        "{}",
        report.end.detail()
    );
}

#[test]
fn what_makes_no_sense_is_refused() {
    assert_eq!(team(1, 0).err(), Some(NetworkError::NoRovers));
    let (mut sim, _) = team(1, 3).unwrap();
    let error = sim.crash_named_at(SimTime::ZERO, "rover_4").unwrap_err();
    assert!(error.to_string().contains("rover_4"), "{error}");
}
