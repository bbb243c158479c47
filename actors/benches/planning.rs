//! What a planning cycle of the paper's policy costs: wall time of one core for all nodes together,
//! with 100 rovers on the dense roadmap over perfect links, everything else that happens in a run
//! included, without digest and log.
//!
//! ```text
//! cargo bench -p farside-actors --bench planning
//! ```

// A benchmark measures real time.
#![allow(clippy::disallowed_types)]

use std::sync::Arc;
use std::time::Instant;

use farside::prelude::*;
use farside_actors::network::{NetworkConfig, Processor, TeamConfig, WorldConfig, assemble};
use farside_worlds::Roadmap;

const ROVERS: u32 = 100;

/// From here on teams that come to a standstill do the same cycle again and again.
const CYCLES: u32 = 250;

const SEEDS: u64 = 4;

/// Wall time and planning cycles of a run.
fn run(nodes: u32, processor: Processor, seed: u64) -> (f64, u32) {
    let world = WorldConfig {
        nodes,
        ..WorldConfig::default()
    };
    let network = NetworkConfig {
        processor,
        cycle_limit: CYCLES,
        ..NetworkConfig::default()
    };
    let roadmap = Arc::new(Roadmap::builtin(&world.roadmap).expect("a built-in roadmap"));
    let sensors = Arc::new(world.place(&roadmap, seed).expect("a placement"));
    let mut sim = Simulation::new(seed);
    sim.without_digest();
    let wire = FixedDelay::new(SimDuration::from_millis(5));
    let mut connect = |sim: &mut Simulation, (a, from): (HostId, &str), (b, to): (HostId, &str)| {
        sim.link(a, b, &format!("{from}-{to}"), wire.clone());
    };
    let team = TeamConfig { rovers: ROVERS };
    let system = assemble(
        &mut sim,
        &world,
        roadmap,
        sensors,
        &team,
        &network,
        seed,
        &mut connect,
    )
    .expect("it fits together");
    let start = Instant::now();
    sim.run(Executor::Inline).expect("it starts");
    (start.elapsed().as_secs_f64(), system.metrics().cycles)
}

fn main() {
    println!("nodes  processor  ms/cycle, mean  worst run  s/run, mean");
    for nodes in [14, 21, 28] {
        for processor in [Processor::Unlimited, Processor::PAPER] {
            let runs: Vec<_> = (1..=SEEDS)
                .map(|seed| run(nodes, processor, seed))
                .collect();
            let per_cycle = runs.iter().map(|(s, cycles)| 1e3 * s / f64::from(*cycles));
            let worst = per_cycle.fold(0.0, f64::max);
            let seconds: f64 = runs.iter().map(|(s, _)| s).sum();
            let cycles: u32 = runs.iter().map(|(_, cycles)| cycles).sum();
            println!(
                "{nodes:5}  {:>9}  {:14.1}  {worst:9.1}  {:11.2}",
                processor.to_string(),
                1e3 * seconds / f64::from(cycles),
                seconds / SEEDS as f64,
            );
        }
    }
}
