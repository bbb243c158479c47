//! The default team on the dense roadmap: 50 rovers, 28 nodes, links of 5 ms that lose 2 %. All
//! arrive, also when nodes and rovers crash on the way.

use std::sync::Arc;

use farside::carrier::{Carrier, NoChange, Parcel, Verdicts};
use farside::prelude::*;
use farside_network::{
    Deadlock, Missions, Network, NetworkConfig, NetworkError, Parts, TeamConfig, WorldConfig,
    assemble_over, missions,
};
use farside_worlds::Roadmap;

struct Lossy;

impl Carrier for Lossy {
    type Change = NoChange;

    fn min_delay(&self) -> SimDuration {
        SimDuration::from_millis(5)
    }

    fn carry(&mut self, parcel: &Parcel<'_>, verdicts: &mut Verdicts) {
        if parcel.random(0, 0, 0).uniform() < 0.02 {
            return verdicts.lose("loss");
        }
        let jitter = parcel.random(1, 0, 0).uniform() * 2e6;
        verdicts.deliver(self.min_delay() + SimDuration::from_nanos(jitter as u64));
    }

    fn change(&mut self, _change: NoChange, _now: SimTime) {}
}

fn team(seed: u64, rovers: u32) -> Result<(Simulation, Network), NetworkError> {
    let world = WorldConfig::default();
    let roadmap = Arc::new(Roadmap::builtin(world.roadmap.name()).unwrap());
    let mut sim = Simulation::new(seed);
    let (team, network) = (TeamConfig { rovers }, NetworkConfig::default());
    let parts = Parts::placed(&world, roadmap, &network, seed).unwrap();
    let missions = Missions::Queued(missions(&world, &parts.roadmap, &team, seed)?);
    let network = assemble_over(&mut sim, &parts, &missions, |_, _| Lossy)?;
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
            network.crash_at(&mut sim, at(40 + 3 * i), name).unwrap();
            network.restart_at(&mut sim, at(90 + 5 * i), name).unwrap();
        }
        network.crash_at(&mut sim, at(304), name).unwrap();
        network.restart_at(&mut sim, at(331), name).unwrap();
    }
    for (i, name) in (0..).zip(network.rover_names()).step_by(4) {
        network.crash_at(&mut sim, at(150 + 7 * i), name).unwrap();
        network.restart_at(&mut sim, at(200 + 7 * i), name).unwrap();
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
    let (mut sim, network) = team(1, 3).unwrap();
    let error = network
        .crash_at(&mut sim, SimTime::ZERO, "rover_4")
        .unwrap_err();
    assert_eq!(
        error.to_string(),
        "no node or rover is called rover_4; there are node_01 to rover_03"
    );
}
