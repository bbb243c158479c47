//! What planning costs in virtual time and in messages: processors that take time, phases that
//! stretch with latency, and the count of what was said.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex};

use farside::prelude::*;
use farside::record::{Flow, Observer, ObserverError, Record, RecordClass, Wants};
use farside_actors::processor::Speed;
use farside_network::messages::{CandidatePaths, Locations, MaxPlus, RoverId};
use farside_network::{
    ConfigError, MaxPlusConfig, Missions, NetworkConfig, NetworkError, NetworkMetrics, Parts,
    TeamConfig, WorldConfig, assemble_over, missions,
};
use farside_worlds::{NodeId, Roadmap, SensorNetwork};

/// What nodes told each other in one planning cycle.
#[derive(Default)]
struct Heard {
    /// How many candidate paths each rover of a node has.
    paths: BTreeMap<NodeId, Vec<u64>>,
    /// When each node sent its first vectors.
    first: BTreeMap<NodeId, SimTime>,
    choices: usize,
    /// Which node plans for each rover.
    planners: BTreeMap<RoverId, NodeId>,
    /// How much each node said that it has to compute.
    loads: BTreeMap<NodeId, u64>,
    /// Between which rovers a vector was left to the second one's node to make.
    handed: BTreeSet<(RoverId, RoverId)>,
}

#[derive(Default)]
struct Book {
    cycles: BTreeMap<u32, Heard>,
    messages: u64,
    bytes: u64,
}

/// Reads all messages between nodes.
struct Ear(Arc<Mutex<Book>>);

impl Observer for Ear {
    fn wants(&self) -> Wants {
        Wants {
            bodies: true,
            ..Wants::default()
        }
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        let mut book = self.0.lock().unwrap();
        let (RecordClass::Delivered, Some(kind)) = (record.class, record.kind) else {
            book.messages += u64::from(record.class.is_fate());
            book.bytes += record.body.len() as u64 * u64::from(record.class.is_fate());
            return Ok(Flow::Continue);
        };
        book.messages += 1;
        book.bytes += record.body.len() as u64;
        if kind.name() == "CandidatePaths" {
            let message: CandidatePaths = kind.schema().decode(record.body).unwrap();
            let sizes = message.rovers.iter().map(|rover| rover.paths.len() as u64);
            let heard = book.cycles.entry(message.cycle).or_default();
            heard.paths.insert(message.node, sizes.collect());
            let planners = message.rovers.iter().map(|r| (r.rover, message.node));
            heard.planners.extend(planners);
        } else if kind.name() == "Locations" {
            let message: Locations = kind.schema().decode(record.body).unwrap();
            let heard = book.cycles.entry(message.cycle).or_default();
            let load = message.load.map(|load| (message.node, load.pairs));
            heard.loads.extend(load);
        } else if kind.name() == "MaxPlus" {
            let message: MaxPlus = kind.schema().decode(record.body).unwrap();
            let heard = book.cycles.entry(message.cycle).or_default();
            let first = heard.first.entry(message.node).or_insert(record.sent);
            *first = record.sent.min(*first);
            heard.choices += message.choices.len();
            let pairs = message.bases.iter().map(|base| (base.from, base.to));
            heard.handed.extend(pairs);
        }
        Ok(Flow::Continue)
    }
}

struct Run {
    metrics: NetworkMetrics,
    report: Report,
    book: Arc<Mutex<Book>>,
    sensors: Arc<SensorNetwork>,
}

/// `rovers` on the dense roadmap over links of `latency` that lose nothing.
fn run(rovers: u32, latency: SimDuration, network: &NetworkConfig) -> Result<Run, NetworkError> {
    let (world, seed) = (WorldConfig::default(), 3);
    let roadmap = Arc::new(Roadmap::builtin(world.roadmap.name()).unwrap());
    let mut sim = Simulation::new(seed);
    let wire = FixedDelay::new(latency);
    let parts = Parts::placed(&world, roadmap, network, seed).unwrap();
    let missions = missions(&world, &parts.roadmap, &TeamConfig::of(rovers), seed)?;
    let missions = Missions::Queued(missions);
    let system = assemble_over(&mut sim, &parts, &missions, |_, _| wire.clone())?;
    let book = Arc::new(Mutex::new(Book::default()));
    sim.observe(Ear(book.clone()));
    let report = sim.run(Executor::Inline).unwrap();
    Ok(Run {
        metrics: system.metrics(),
        report,
        book,
        sensors: parts.sensors,
    })
}

const LATENCY: SimDuration = SimDuration::from_millis(5);

/// When a node's first vectors leave, by the rules of the processor's documentation and the times
/// of the phases alone: 40 us for each pair of paths.
fn expected(heard: &Heard, sensors: &SensorNetwork, node: NodeId) -> SimDuration {
    let pairs = |a: &[u64], b: &[u64]| a.iter().sum::<u64>() * b.iter().sum::<u64>();
    let own = &heard.paths[&node];
    let squares: u64 = own.iter().map(|n| n * n).sum();
    // Each pair of own rovers, in both directions.
    let within = pairs(own, own) - squares;
    let neighbors = sensors.neighbors(node).iter();
    let others = neighbors.filter_map(|other| heard.paths.get(other));
    let across: u64 = others.map(|theirs| pairs(own, theirs)).sum();
    let takes = |pairs: u64| SimDuration::from_micros(40 * pairs);
    let ms = SimDuration::from_millis;
    let proposed = ms(100) + takes(within / 2);
    let payoffs = proposed.max(ms(100) + LATENCY) + takes(across);
    payoffs.max(ms(150)) + takes(within + across)
}

#[test]
fn the_first_vectors_leave_when_they_are_computed() {
    let network = NetworkConfig {
        max_plus: MaxPlusConfig {
            processor: Speed::PerS(25_000),
            ..MaxPlusConfig::default()
        },
        cycle_limit: 30,
        ..NetworkConfig::default()
    };
    let Run { book, sensors, .. } = run(40, LATENCY, &network).unwrap();
    let book = book.lock().unwrap();
    let (mut in_time, mut too_late) = (0, 0);
    for (cycle, heard) in &book.cycles {
        let start = SimTime::from_secs(u64::from(*cycle));
        for node in heard.paths.keys() {
            let others = sensors.neighbors(*node).iter();
            if others.clone().all(|n| !heard.paths.contains_key(n)) {
                continue;
            }
            let at = start + expected(heard, &sensors, *node);
            if at < start + SimDuration::from_millis(650) {
                assert_eq!(heard.first.get(node), Some(&at), "cycle {cycle}, {node:?}");
                in_time += 1;
            } else {
                assert_eq!(heard.first.get(node), None, "cycle {cycle}, {node:?}");
                too_late += 1;
            }
        }
    }
    assert!(in_time > 50 && too_late > 10, "{in_time}, {too_late}");
}

#[test]
fn a_processor_too_slow_for_anything_leaves_rovers_to_the_owners() {
    let network = NetworkConfig {
        max_plus: MaxPlusConfig {
            processor: Speed::PerS(1),
            ..MaxPlusConfig::default()
        },
        cycle_limit: 60,
        ..NetworkConfig::default()
    };
    let slow = run(30, LATENCY, &network).unwrap();
    assert_eq!(slow.metrics.collisions, 0);
    // A pair of rovers with one path each would be done; there are hardly any.
    assert!(slow.metrics.max_plus_iterations < 0.2);
    let unlimited = NetworkConfig {
        max_plus: MaxPlusConfig {
            processor: Speed::Unlimited,
            ..MaxPlusConfig::default()
        },
        ..network
    };
    let fast = run(30, LATENCY, &unlimited).unwrap();
    assert!(fast.metrics.max_plus_iterations > 2.0);
    assert!(slow.metrics.interventions > fast.metrics.interventions);
}

#[test]
fn a_small_team_arrives_over_links_of_a_second() {
    let latency = SimDuration::from_secs(1);
    let stretched = run(6, latency, &NetworkConfig::default()).unwrap();
    let metrics = &stretched.metrics;
    assert_eq!((metrics.arrived, metrics.collisions), (6, 0));
    assert!(metrics.time_ratio < 1.5, "{}", metrics.time_ratio);
    // What stretches is time, not the number of cycles.
    let fast = run(6, LATENCY, &NetworkConfig::default()).unwrap();
    assert_eq!(metrics.cycles, fast.metrics.cycles);

    // With the phases of fast links what is said in one is heard cycles later.
    let rigid = NetworkConfig {
        cycle: Some(SimDuration::from_secs(1)),
        exchange: Some(SimDuration::from_millis(50)),
        optimisation: Some(SimDuration::from_millis(500)),
        iteration_timeout: Some(SimDuration::from_millis(20)),
        ..NetworkConfig::default()
    };
    let slow = run(6, latency, &rigid).unwrap();
    assert!(slow.metrics.time_ratio > 2.0 * metrics.time_ratio);

    // A cycle that is set is not stretched.
    let short = NetworkConfig {
        exchange: None,
        ..rigid
    };
    let error = run(6, latency, &short).err();
    let schedule = |error| matches!(error, NetworkError::Config(ConfigError::Schedule { .. }));
    assert!(error.is_some_and(schedule));
}

#[test]
fn messages_bytes_and_steps_add_up() {
    let Run {
        metrics,
        report,
        book,
        ..
    } = run(12, LATENCY, &NetworkConfig::default()).unwrap();
    let book = book.lock().unwrap();
    let rover_cycles = f64::from(metrics.rovers * metrics.cycles);
    let close = |a: f64, b: f64| (a - b).abs() <= 1e-9 * b;
    assert_eq!(report.counts.sent, book.messages);
    let sent = report.counts.sent as f64;
    assert!(close(metrics.messages_per_rover_cycle * rover_cycles, sent));
    assert!(close(
        metrics.bytes_per_rover_cycle * rover_cycles,
        book.bytes as f64
    ));
    let steps = metrics.mean_steps * f64::from(metrics.arrived);
    assert!(close(metrics.total_steps as f64, steps) && steps > 0.0);
}

#[test]
fn choices_are_announced_for_anytime_only() {
    for (anytime, damping) in [(false, 0.5), (true, 0.0), (true, 0.7)] {
        let network = NetworkConfig {
            max_plus: MaxPlusConfig {
                anytime,
                damping,
                ..MaxPlusConfig::default()
            },
            cycle_limit: 25,
            ..NetworkConfig::default()
        };
        let Run { metrics, book, .. } = run(30, LATENCY, &network).unwrap();
        assert_eq!(metrics.collisions, 0);
        let book = book.lock().unwrap();
        let choices: usize = book.cycles.values().map(|heard| heard.choices).sum();
        assert_eq!(choices > 0, anytime);
    }
}

#[test]
fn work_goes_from_the_busier_node_to_the_other_one_only() {
    let slow = NetworkConfig {
        max_plus: MaxPlusConfig {
            processor: Speed::PerS(100_000),
            ..MaxPlusConfig::default()
        },
        cycle_limit: 40,
        ..NetworkConfig::default()
    };
    let outsourcing = NetworkConfig {
        max_plus: MaxPlusConfig {
            outsourcing: true,
            ..slow.max_plus.clone()
        },
        ..slow.clone()
    };
    let Run { metrics, book, .. } = run(40, LATENCY, &outsourcing).unwrap();
    assert_eq!(metrics.collisions, 0);
    let mut handed = 0;
    for heard in book.lock().unwrap().cycles.values() {
        for (from, to) in &heard.handed {
            let load = |rover| heard.loads[&heard.planners[rover]];
            assert!(load(from) > load(to), "{from:?} to {to:?}");
            handed += 1;
        }
    }
    assert!(handed > 100, "{handed}");
    assert!(metrics.outsourced > 0.05, "{}", metrics.outsourced);

    // Nobody says a word about it unless told to, or where processors are fast enough.
    let fast = NetworkConfig {
        max_plus: MaxPlusConfig {
            processor: Speed::Unlimited,
            ..outsourcing.max_plus.clone()
        },
        ..outsourcing
    };
    for network in [slow, fast] {
        let Run { metrics, book, .. } = run(40, LATENCY, &network).unwrap();
        assert_eq!(metrics.outsourced, 0.0);
        let book = book.lock().unwrap();
        let silent = |heard: &Heard| heard.loads.is_empty() && heard.handed.is_empty();
        assert!(book.cycles.values().all(silent));
    }
}
