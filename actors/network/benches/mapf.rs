//! What planning costs: wall time of one core for a cycle of all nodes together, and for whole
//! runs, with 100 rovers on the dense roadmap over perfect links, everything else that happens in a
//! run included, without digest and log. Beside times it says what was done, which no other load on
//! the machine changes: cycles and messages; for instructions run it under `valgrind
//! --tool=callgrind`.
//!
//! ```text
//! cargo bench -p farside-network --bench mapf
//! cargo bench -p farside-network --bench mapf -- max-plus 28 unlimited 1   # 250 cycles
//! ```

// A benchmark measures real time.
#![allow(clippy::disallowed_types)]

use std::sync::Arc;
use std::time::Instant;

use farside::prelude::*;
use farside_actors::processor::Speed;
use farside_network::{
    MaxPlusConfig, Missions, NetworkConfig, PAPER_SPEED, Parts, Policy, TeamConfig, WorldConfig,
    assemble_over, missions,
};
use farside_worlds::Roadmap;

const ROVERS: u32 = 100;

/// From here on teams that come to a deadlock do the same cycle again and again.
const CYCLES: u32 = 250;

const SEEDS: u64 = 4;

/// What a run took.
#[derive(Clone, Copy, Default)]
struct Cost {
    wall_s: f64,
    cycles: u32,
    messages: f64,
    arrived: u32,
}

fn run(nodes: u32, network: &NetworkConfig, seed: u64) -> Cost {
    let world = WorldConfig {
        nodes,
        ..WorldConfig::default()
    };
    let roadmap = Arc::new(Roadmap::builtin(world.roadmap.name()).expect("a built-in roadmap"));
    let parts = Parts::placed(&world, roadmap, network, seed).expect("a placement");
    let mut sim = Simulation::new(seed);
    sim.without_digest();
    let wire = FixedDelay::new(SimDuration::from_millis(5));
    let team = TeamConfig::of(ROVERS);
    let missions = missions(&world, &parts.roadmap, &team, seed).expect("there is a way");
    let missions = Missions::Queued(missions);
    let system = assemble_over(&mut sim, &parts, &missions, |_, _| wire.clone());
    let system = system.expect("it fits together");
    let start = Instant::now();
    sim.run(Executor::Inline).expect("it starts");
    let wall_s = start.elapsed().as_secs_f64();
    let metrics = system.metrics();
    let rover_cycles = f64::from(metrics.rovers) * f64::from(metrics.cycles);
    Cost {
        wall_s,
        cycles: metrics.cycles,
        messages: metrics.messages_per_rover_cycle * rover_cycles,
        arrived: metrics.arrived,
    }
}

fn config(policy: Policy, processor: Speed, cycle_limit: Option<u32>) -> NetworkConfig {
    let default = NetworkConfig::default();
    NetworkConfig {
        policy,
        max_plus: MaxPlusConfig {
            processor,
            ..MaxPlusConfig::default()
        },
        cycle_limit: cycle_limit.unwrap_or(default.cycle_limit),
        ..default
    }
}

/// Runs with `SEEDS` seeds, and prints a line. Returns the mean time of a cycle [ms], beside
/// `peer_ms` of another policy.
fn row(
    nodes: u32,
    policy: Policy,
    processor: Speed,
    cycle_limit: Option<u32>,
    peer_ms: Option<f64>,
) -> f64 {
    let network = config(policy, processor, cycle_limit);
    let runs: Vec<Cost> = (1..=SEEDS).map(|seed| run(nodes, &network, seed)).collect();
    let per_cycle = runs
        .iter()
        .map(|run| 1e3 * run.wall_s / f64::from(run.cycles));
    let worst_ms = per_cycle.fold(0.0, f64::max);
    let sum = |of: fn(&Cost) -> f64| runs.iter().map(of).sum::<f64>();
    let (wall_s, cycles) = (sum(|run| run.wall_s), sum(|run| f64::from(run.cycles)));
    let mean_ms = 1e3 * wall_s / cycles;
    println!(
        "{:<8}  {nodes:5}  {:>9}  {mean_ms:14.2}  {:9.2}  {worst_ms:9.2}  {:11.2}  {:10.0}  \
         {:14.0}  {:7.1}",
        format!("{policy:?}").to_lowercase(),
        processor.to_string(),
        mean_ms / peer_ms.unwrap_or(mean_ms),
        wall_s / SEEDS as f64,
        cycles / SEEDS as f64,
        sum(|run| run.messages) / cycles,
        sum(|run| f64::from(run.arrived)) / SEEDS as f64,
    );
    mean_ms
}

/// `max-plus 28 unlimited 1`: one run, for a profiler.
fn one(arguments: &[String]) -> Option<Cost> {
    let [policy, nodes, processor, seed] = arguments else {
        return None;
    };
    let policy = match policy.as_str() {
        "max-plus" => Policy::MaxPlus,
        "complete" => Policy::Complete,
        _ => return None,
    };
    let network = config(policy, processor.parse().ok()?, Some(CYCLES));
    Some(run(nodes.parse().ok()?, &network, seed.parse().ok()?))
}

fn main() {
    // Cargo adds a word of its own.
    let arguments: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| a != "--bench")
        .collect();
    if let Some(cost) = one(&arguments) {
        println!(
            "{:.2} s, {} cycles, {:.0} messages",
            cost.wall_s, cost.cycles, cost.messages
        );
        return;
    }
    println!(
        "policy    nodes  processor  ms/cycle, mean  of peer's  worst run  s/run, mean  cycles/run  \
         messages/cycle  arrived"
    );
    println!("the peer, which reserves paths through time, whole runs:");
    let peer_ms = Some(row(28, Policy::Complete, Speed::Unlimited, None, None));
    println!("at most {CYCLES} cycles:");
    for nodes in [14, 21, 28] {
        for processor in [Speed::Unlimited, PAPER_SPEED] {
            row(nodes, Policy::MaxPlus, processor, Some(CYCLES), peer_ms);
        }
    }
    println!("whole runs:");
    for processor in [Speed::Unlimited, PAPER_SPEED] {
        row(28, Policy::MaxPlus, processor, None, peer_ms);
    }
}
