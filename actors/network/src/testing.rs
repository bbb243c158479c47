//! Small roadmaps for the tests of this module.

use std::sync::Arc;

use farside::{FixedDelay, SimDuration, Simulation};
use farside_worlds::{Roadmap, SensorNetwork, VertexId};
use nalgebra::Point2;

use crate::{
    Missions, Network, NetworkConfig, Parts, TeamConfig, WorldConfig, assemble_over, missions,
};

/// A simulation of a team over links of 5 ms that lose nothing.
pub(crate) fn assembled(
    seed: u64,
    world: &WorldConfig,
    roadmap: Arc<Roadmap>,
    sensors: Arc<SensorNetwork>,
    team: &TeamConfig,
    config: &NetworkConfig,
) -> (Simulation, Network) {
    let missions = missions(world, &roadmap, team, seed).expect("there is a way to drive");
    let parts = Parts {
        world,
        roadmap,
        sensors,
        config,
        terrain: None,
        only: &team.only,
    };
    let wire = FixedDelay::new(SimDuration::from_millis(5));
    let missions = Missions::Queued(missions);
    let mut sim = Simulation::new(seed);
    let system = assemble_over(&mut sim, &parts, &missions, |_, _| wire.clone());
    (sim, system.expect("it makes sense"))
}

pub(crate) fn v(id: u32) -> VertexId {
    VertexId(id)
}

/// A grid of `columns` x `rows` vertices 10 m apart, row by row, without the `missing` edges; its
/// outermost vertices are the boundary.
pub(crate) fn grid(columns: u32, rows: u32, missing: &[(u32, u32)]) -> Roadmap {
    let positions_m = (0..columns * rows)
        .map(|i| Point2::new(10.0 * f64::from(i % columns), 10.0 * f64::from(i / columns)))
        .collect();
    let mut edges = Vec::new();
    for i in 0..columns * rows {
        if (i + 1) % columns != 0 {
            edges.push((i, i + 1));
        }
        if i + columns < columns * rows {
            edges.push((i, i + columns));
        }
    }
    edges.retain(|edge| !missing.contains(edge));
    let edges = edges.into_iter().map(|(a, b)| (v(a), v(b))).collect();
    let on_the_rim = |&i: &u32| {
        let (x, y) = (i % columns, i / columns);
        x == 0 || y == 0 || x + 1 == columns || y + 1 == rows
    };
    let boundary = (0..columns * rows).filter(on_the_rim).map(v).collect();
    Roadmap::new("grid", positions_m, edges, boundary).expect("a connected grid")
}
