//! Measures the paper's Table 1 (*network-guided*, section 4) and the figures in the text beside
//! it: 14, 21 and 28 nodes with 25, 50, 75 and 100 rovers on both roadmaps, over links of 5 ms that
//! lose nothing unless told to.
//!
//!     cargo run --release -p farside-network --example table_1 -- [SEEDS] [KEY=VALUE]...
//!
//! Keys: `first_seed`, `maps`, `nodes`, `rovers` (lists with commas), `loss`, `latency_ms`,
//! `jitter_ms`, `digest` (true, false), `cycle`, `optimisation`, `iteration_timeout` (durations),
//! `processor` (`unlimited`, `2M/s`), `damping`, `anytime`, `outsourcing`, `congestion` (weight),
//! `spread`, `iterations`, `priority` (longest_wait, lowest_id), `endpoints` (alternating,
//! any-to-any, west-to-east), `ownership` (nearest, balanced, traffic), `acceleration`, `chains`
//! (true, false), `cycle_limit`, `livelock_window`, `motion` (cycles, continuous), `speed`,
//! `acceleration_limit`, `sigma` (of locations), `roadmap_from`, and the payoffs' `factor`,
//! `backtrack`, `leaf_wait`, `noise`. Aids: `gates`, `probes`, `resolution` (true, false), `gate`
//! (occupancy), `probe_after`, `hold` (cycles).

use std::sync::Arc;

use farside::prelude::*;
use farside_actors::link::{Link, LinkParams};
use farside_actors::units::parse_duration;
use farside_network::{
    Missions, Motion, NetworkConfig, NetworkMetrics, NoProgress, Parts, Policy, Priority,
    TeamConfig, WorldConfig, assemble_over, missions,
};
use farside_worlds::{Endpoints, Ownership, Roadmap};

struct Options {
    first_seed: u64,
    seeds: u64,
    maps: Vec<String>,
    nodes: Vec<u32>,
    rovers: Vec<u32>,
    radio: LinkParams,
    digest: bool,
    endpoints: Endpoints,
    ownership: Ownership,
    network: NetworkConfig,
}

fn options() -> Result<Options, Box<dyn std::error::Error>> {
    let mut options = Options {
        first_seed: 1,
        seeds: 16,
        maps: vec!["crater-dense".into(), "crater-sparse".into()],
        nodes: vec![14, 21, 28],
        rovers: vec![25, 50, 75, 100],
        radio: LinkParams::default(),
        digest: false,
        endpoints: Endpoints::default(),
        ownership: Ownership::default(),
        network: NetworkConfig::default(),
    };
    let numbers = |text: &str| {
        text.split(',')
            .map(str::parse)
            .collect::<Result<Vec<u32>, _>>()
    };
    for argument in std::env::args().skip(1) {
        let Some((key, value)) = argument.split_once('=') else {
            options.seeds = argument.parse()?;
            continue;
        };
        let network = &mut options.network;
        match key {
            "policy" => {
                network.policy = match value {
                    "complete" => Policy::Complete,
                    "reference" => Policy::Reference,
                    "prioritised" => Policy::Prioritised,
                    _ => Policy::MaxPlus,
                }
            }
            "routes" => network.complete.routes = value.parse()?,
            "ahead" => network.grants_ahead = value.parse()?,
            "motion" => {
                network.motion = match value {
                    "continuous" => Motion::Continuous,
                    _ => Motion::Cycles,
                }
            }
            "speed" => network.speed = value.parse()?,
            "acceleration_limit" => network.acceleration_limit = value.parse()?,
            "roadmap_from" => network.roadmap_from = Some(value.to_owned()),
            "sigma" => network.location_sigma_m = value.parse()?,
            "passive" => network.deadlock_window = value.parse()?,
            "first_seed" => options.first_seed = value.parse()?,
            "maps" => options.maps = value.split(',').map(str::to_owned).collect(),
            "nodes" => options.nodes = numbers(value)?,
            "rovers" => options.rovers = numbers(value)?,
            "loss" => options.radio.loss = value.parse()?,
            "latency_ms" => options.radio.latency = SimDuration::from_millis(value.parse()?),
            "jitter_ms" => options.radio.jitter = SimDuration::from_millis(value.parse()?),
            "digest" => options.digest = value.parse()?,
            "processor" => network.max_plus.processor = value.parse()?,
            "damping" => network.max_plus.damping = value.parse()?,
            "outsourcing" => network.max_plus.outsourcing = value.parse()?,
            "congestion" => network.max_plus.congestion_weight = value.parse()?,
            "spread" => network.max_plus.congestion_spread = value.parse()?,
            "anytime" => network.max_plus.anytime = value.parse()?,
            "cycle" => network.cycle = Some(parse_duration(value)?),
            "optimisation" => network.optimisation = Some(parse_duration(value)?),
            "iteration_timeout" => network.iteration_timeout = Some(parse_duration(value)?),
            "iterations" => network.max_plus.max_iterations = value.parse()?,
            "cycle_limit" => network.cycle_limit = value.parse()?,
            "livelock_window" => network.livelock_window = value.parse()?,
            "chains" => network.max_plus.acceleration_chains = value.parse()?,
            "gates" => network.max_plus.entry_gates = value.parse()?,
            "gate" => network.max_plus.entry_gate_occupancy = value.parse()?,
            "probes" => network.max_plus.deadlock_probes = value.parse()?,
            "probe_after" => network.max_plus.probe_after = value.parse()?,
            "resolution" => network.max_plus.junction_resolution = value.parse()?,
            "hold" => network.max_plus.aside_hold = value.parse()?,
            "acceleration" => network.max_plus.acceleration = value.parse()?,
            "factor" => network.max_plus.longest_path_factor = value.parse()?,
            "backtrack" => network.max_plus.backtrack_penalty = value.parse()?,
            "leaf_wait" => network.max_plus.leaf_wait_penalty = value.parse()?,
            "noise" => network.max_plus.noise = value.parse()?,
            "priority" if value == "lowest_id" => network.max_plus.priority = Priority::LowestId,
            "priority" => network.max_plus.priority = Priority::LongestWait,
            "ownership" => {
                options.ownership = match value {
                    "balanced" => Ownership::Balanced,
                    "traffic" => Ownership::Traffic,
                    _ => Ownership::Nearest,
                }
            }
            "endpoints" => {
                options.endpoints = match value {
                    "any-to-any" => Endpoints::AnyToAny,
                    "west-to-east" => Endpoints::WestToEast,
                    _ => Endpoints::Alternating,
                }
            }
            _ => return Err(format!("unknown key {key}").into()),
        }
    }
    Ok(options)
}

fn run(
    options: &Options,
    map: &str,
    nodes: u32,
    rovers: u32,
    seed: u64,
) -> Result<(NetworkMetrics, Report), Box<dyn std::error::Error>> {
    let world = WorldConfig {
        roadmap: map.into(),
        nodes,
        endpoints: options.endpoints,
        ownership: options.ownership,
        ..WorldConfig::default()
    };
    let roadmap = Arc::new(Roadmap::builtin(map)?);
    let parts = Parts::placed(&world, roadmap, &options.network, seed)?;
    let team = TeamConfig::of(rovers);
    let mut sim = Simulation::new(seed);
    if !options.digest {
        sim.without_digest();
    }
    let missions = Missions::Queued(missions(&world, &parts.roadmap, &team, seed)?);
    let network = assemble_over(&mut sim, &parts, &missions, |_, _| {
        Link::new(options.radio.clone())
    })?;
    let report = sim.run(Executor::Inline)?;
    if let Some(fault) = report.fault() {
        return Err(fault.to_string().into());
    }
    Ok((network.metrics(), report))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let options = options()?;
    println!(
        "{:13} nodes rovers  dead%  pass  act  lim  arrived  path  time  steps  stops  back  forced%  iter  cycles  msgs/cycle  B/rover  total  coll  confirmed  late%  uneven  out%",
        "map"
    );
    for map in &options.maps {
        for &nodes in &options.nodes {
            for &rovers in &options.rovers {
                let seeds = options.first_seed..options.first_seed + options.seeds;
                let results = seeds.map(|seed| run(&options, map, nodes, rovers, seed));
                let results = results.collect::<Result<Vec<_>, _>>()?;
                print_cell(map, nodes, rovers, &results);
                for (_, report) in results.iter().filter(|_| options.digest) {
                    println!("    {}", report.digest);
                }
            }
        }
    }
    Ok(())
}

/// Means over all seeds; path figures over the runs in which all arrived, as in the paper.
fn print_cell(map: &str, nodes: u32, rovers: u32, results: &[(NetworkMetrics, Report)]) {
    let n = results.len() as f64;
    let percent = |test: &dyn Fn(&NetworkMetrics) -> bool| {
        100.0 * results.iter().filter(|(m, _)| test(m)).count() as f64 / n
    };
    let complete: Vec<_> = results
        .iter()
        .filter(|(m, _)| m.arrived == m.rovers)
        .collect();
    let mean = |value: &dyn Fn(&NetworkMetrics) -> f64| {
        complete.iter().map(|(m, _)| value(m)).sum::<f64>() / complete.len() as f64
    };
    let all = |value: &dyn Fn(&(NetworkMetrics, Report)) -> f64| {
        results.iter().map(value).sum::<f64>() / n
    };
    println!(
        "{map:13} {nodes:5} {rovers:6}  {:5.0} {:5.0}{:5.0}{:5.0}  {:7.1}  {:4.2}  {:4.2}  {:5.1}  {:5.1}  {:4.2}  {:7.1}  {:4.1}  {:6.0}  {:10.0}  {:7.0}  {:5.0}  {:4.0}  {:9.1}  {:5.1}  {:6.2}  {:4.1}",
        percent(&|m| m.stuck),
        percent(&|m| m.stuck && m.no_progress != NoProgress::Moving),
        percent(&|m| m.no_progress == NoProgress::Moving),
        percent(&|m| !m.stuck && m.arrived < m.rovers),
        all(&|(m, _)| f64::from(m.arrived)),
        mean(&|m| m.path_ratio),
        mean(&|m| m.time_ratio),
        mean(&|m| m.mean_steps),
        mean(&|m| m.mean_stops),
        mean(&|m| m.mean_backtracks),
        all(&|(m, _)| 100.0 * m.intervention_rate),
        all(&|(m, _)| m.max_plus_iterations),
        mean(&|m| f64::from(m.cycles)),
        all(&|(m, r)| r.counts.sent as f64 / f64::from(m.cycles)),
        all(&|(m, _)| m.bytes_per_rover_cycle),
        mean(&|m| m.total_steps as f64),
        all(&|(m, _)| f64::from(m.collisions)),
        all(&|(m, _)| f64::from(m.confirmed_deadlocks)),
        all(&|(m, _)| 100.0 * m.late_optimisations),
        all(&|(m, _)| m.load_imbalance),
        all(&|(m, _)| 100.0 * m.outsourced),
    );
}
