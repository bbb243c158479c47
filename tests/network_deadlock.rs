//! What is called a deadlock is one: random roadmaps, teams, policies, links and crashes, in each
//! of which the run is continued with the monitor off.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use farside::prelude::*;
use farside::record::{Flow, Observer, ObserverError, Record, RecordClass, Wants};
use farside_network::cases::Case;
use farside_network::cases::strategies::{Bounds, cases};
use farside_network::messages::RoverState;
use farside_network::{Deadlock, NetworkConfig, NetworkMetrics, NoProgress, Outcome, Policy};
use proptest::prelude::*;
use proptest::test_runner::{RngAlgorithm, TestRng, TestRunner};

/// When each rover last moved, by name: begun or ended an edge, entered or left.
#[derive(Clone, Default)]
struct LastMoves(
    Arc<Mutex<BTreeMap<String, (RoverState, SimTime)>>>,
    Arc<Mutex<Vec<String>>>,
);

impl Observer for LastMoves {
    fn wants(&self) -> Wants {
        Wants {
            samples: true,
            ..Wants::default()
        }
    }

    fn begin(&mut self, run: &Arc<farside::RunInfo>) -> Result<(), ObserverError> {
        let names = run.entities.iter().map(|entity| entity.name.clone());
        *self.1.lock().unwrap() = names.collect();
        Ok(())
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        let kind = record.kind.filter(|kind| kind.name() == "RoverState");
        if record.class == RecordClass::Sample
            && let Some(kind) = kind
        {
            let state: RoverState = kind.schema().decode(record.body).unwrap();
            let name = self.1.lock().unwrap()[record.sender.index()].clone();
            let mut moves = self.0.lock().unwrap();
            // A restart records the same state again, and is no move.
            let same = |known: &(RoverState, SimTime)| known.0.whereabouts == state.whereabouts;
            if !moves.get(&name).is_some_and(same) {
                moves.insert(name, (state, record.time()));
            }
        }
        Ok(Flow::Continue)
    }
}

/// The run, when each rover last moved in it, and when it ended.
fn run(case: &Case) -> (NetworkMetrics, BTreeMap<String, SimTime>, SimTime) {
    let mut sim = Simulation::new(case.seed);
    let system = case.assemble(&mut sim).expect("the case makes sense");
    let moves = LastMoves::default();
    sim.observe(moves.clone());
    let report = sim.run(Executor::Inline).expect("it starts");
    assert_eq!(report.end.name(), "stopped", "{}", report.end.detail());
    let moves = moves.0.lock().unwrap();
    let moves = moves.iter().map(|(name, (_, at))| (name.clone(), *at));
    (system.metrics(), moves.collect(), report.end_time)
}

/// Crowded: as many rovers as there are vertices, or nearly.
fn crowded() -> impl Strategy<Value = Case> {
    let bounds = Bounds {
        vertices: 7,
        nodes: 3,
        rovers: 10,
        loss_percent: 80,
        latency: SimDuration::from_millis(500),
        crashes: 2,
        degradations: 1,
        ..Bounds::default()
    };
    let policies = prop_oneof![
        3 => Just(Policy::MaxPlus),
        1 => Just(Policy::Complete),
        1 => Just(Policy::Prioritised),
    ];
    let all = (cases(bounds), policies, any::<[bool; 4]>());
    all.prop_map(|(mut case, policy, [gates, resolution, chains, is_calm])| {
        case.network = NetworkConfig {
            policy,
            livelock_window: 60,
            ..NetworkConfig::default()
        };
        case.network.max_plus.entry_gates = gates;
        case.network.max_plus.junction_resolution = resolution;
        case.network.max_plus.acceleration_chains = chains;
        if is_calm {
            (case.link.loss, case.crash, case.degrade) = (0.0, Vec::new(), Vec::new());
        }
        case
    })
}

/// What is found in all cases, so that the property is not true for want of any.
#[derive(Default)]
struct Found {
    deadlocks: Cell<u32>,
    locked: Cell<u32>,
    without_progress: Cell<u32>,
    arrived_all_the_same: Cell<u32>,
}

fn more(count: &Cell<u32>) {
    count.set(count.get() + 1);
}

#[test]
fn what_is_called_a_deadlock_stays_one() {
    let config = ProptestConfig {
        cases: 1000,
        failure_persistence: None,
        max_shrink_iters: 400,
        ..ProptestConfig::default()
    };
    let found = Found::default();
    let rng = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
    let result = TestRunner::new_with_rng(config, rng).run(&crowded(), |case| {
        let (metrics, _, end) = run(&case);
        let is_deadlock = metrics.deadlock != Deadlock::None;
        prop_assert_eq!(metrics.outcome == Outcome::Deadlock, is_deadlock);
        prop_assert_eq!(metrics.deadlocked, is_deadlock);
        prop_assert!(
            !(metrics.completed && metrics.stuck),
            "{:?}",
            metrics.deadlock_reason
        );
        if !metrics.stuck {
            return Ok(());
        }
        let mut unwatched = case.clone();
        (
            unwatched.network.deadlock_window,
            unwatched.network.livelock_window,
        ) = (u32::MAX / 2, u32::MAX / 2);
        unwatched.network.cycle_limit = metrics.cycles + 50 * 20;
        let (later, moves, _) = run(&unwatched);
        if metrics.no_progress != NoProgress::None {
            more(&found.without_progress);
            if later.completed {
                more(&found.arrived_all_the_same);
            }
            return Ok(());
        }
        more(&found.deadlocks);
        prop_assert!(
            !later.completed,
            "it arrives: {:?}",
            metrics.deadlock_reason
        );
        for rover in &metrics.locked_rovers {
            more(&found.locked);
            let moved = moves.get(rover).is_some_and(|at| *at > end);
            prop_assert!(!moved, "{} moves: {:?}", rover, metrics.deadlock_reason);
        }
        Ok(())
    });
    result.unwrap_or_else(|error| panic!("{error}"));
    let (deadlocks, locked) = (found.deadlocks.get(), found.locked.get());
    let (without, arrived) = (
        found.without_progress.get(),
        found.arrived_all_the_same.get(),
    );
    println!(
        "{deadlocks} deadlocks with {locked} rovers, {without} without progress, {arrived} of \
         which arrive if they may go on"
    );
    assert!(deadlocks >= 30 && locked >= 60, "{deadlocks}, {locked}");
}
