//! No collision, whatever the links and the faults, with either policy: random roadmaps, teams and
//! seeds, loss from 0 to 100 %, latency of several cycles, duplicates, reordering, degradations,
//! crashes and restarts. With the `complete` policy all arrive, as long as something gets through.
//! And that the tests can fail: with a rule of the safety protocol broken they do, and say so in a
//! scenario of a few lines.

use std::cell::Cell;

use farside::prelude::*;
use farside_actors::processor::Speed;
use farside_actors::system::{Files, Results};
use farside_experiments::registry::Registry;
use farside_experiments::scenario::Scenario;
use farside_network::cases::strategies::{Bounds, cases, cases_with_gaps, cut_grid};
use farside_network::cases::{Case, Downtime};
use farside_network::{
    Deadlock, Gaps, NetworkConfig, NetworkMetrics, NoProgress, Outcome, Policy, Sabotage,
    TeamConfig, WorldConfig,
};
use farside_worlds::{Ownership, VertexId};
use proptest::prelude::*;
use proptest::test_runner::{RngAlgorithm, TestCaseError, TestError, TestRng, TestRunner};

/// What every property here is tried on.
fn config(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        failure_persistence: None,
        max_shrink_iters: 4000,
        ..ProptestConfig::default()
    }
}

/// A case as it comes, but with this policy, and with an end.
fn with_policy(mut case: Case, policy: Policy) -> Case {
    case.network.policy = policy;
    (case.network.deadlock_window, case.network.cycle_limit) = match policy {
        // A walk over links that are seconds late takes its time before the first rover enters.
        Policy::Complete => (60, 200),
        _ => (20, 120),
    };
    case
}

fn any_policy() -> impl Strategy<Value = Case> {
    let policy = prop_oneof![Just(Policy::MaxPlus), Just(Policy::Complete)];
    let all = (cases(Bounds::default()), policy, any::<[bool; 4]>());
    all.prop_map(|(mut case, policy, switches)| {
        let [chains, is_rigid, gates, resolution] = switches;
        case.network = match is_rigid {
            true => rigid(),
            false => NetworkConfig::default(),
        };
        case.network.max_plus.acceleration_chains = chains;
        case.network.max_plus.entry_gates = gates;
        case.network.max_plus.junction_resolution = resolution;
        with_policy(case, policy)
    })
}

/// The `complete` policy, with a monitor that waits.
fn patient() -> NetworkConfig {
    NetworkConfig {
        policy: Policy::Complete,
        deadlock_window: 2000,
        livelock_window: 4000,
        cycle_limit: 20_000,
        ..NetworkConfig::default()
    }
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

fn run(case: &Case) -> (NetworkMetrics, Report) {
    let (metrics, report) = case.run(Executor::Inline).expect("the case makes sense");
    assert_eq!(report.end.name(), "stopped", "{}", report.end.detail());
    (metrics, report)
}

/// With how many seeds each case is tried.
const SEEDS: u64 = 8;

/// The case with the first of its seeds with which rovers collide.
fn collides(case: &Case) -> Option<Case> {
    let mut seeded = case.seeds(SEEDS);
    seeded.find(|case| run(case).0.collisions > 0)
}

/// The property: nobody collides.
fn no_collision(case: &Case) -> Result<(), TestCaseError> {
    match collides(case) {
        None => Ok(()),
        Some(case) => Err(TestCaseError::fail(format!("a collision in\n\n{case}"))),
    }
}

proptest! {
    #![proptest_config(config(256))]

    #[test]
    fn rovers_never_collide(case in any_policy()) {
        no_collision(&case)?;
    }
}

proptest! {
    #![proptest_config(config(64))]

    /// Liveness: half of the messages lost, latencies of more than a cycle, outages, nodes and
    /// rovers that crash and come back.
    #[test]
    fn with_the_complete_policy_all_arrive(case in cases(Bounds {
        loss_percent: 50,
        latency: SimDuration::from_millis(1500),
        ..Bounds::default()
    })) {
        let mut case = case;
        case.network = patient();
        let (metrics, report) = run(&case);
        prop_assert!(metrics.completed, "{}", report.end.detail());
        prop_assert_eq!(metrics.collisions, 0);
    }
}

fn any_gaps() -> impl Strategy<Value = Case> {
    let with = |gaps, policy| {
        let cases = cases_with_gaps(Bounds::default(), gaps);
        cases.prop_map(move |case| with_policy(case, policy))
    };
    prop_oneof![
        with(Gaps::Close, Policy::MaxPlus),
        with(Gaps::Close, Policy::Complete),
        with(Gaps::Cross, Policy::Complete),
    ]
}

proptest! {
    #![proptest_config(config(192))]

    #[test]
    fn rovers_never_collide_in_gaps_or_beside_them(case in any_gaps()) {
        prop_assert_eq!(run(&case).0.collisions, 0);
    }
}

proptest! {
    #![proptest_config(config(96))]

    /// Liveness with gaps, which only some of the links' faults reach: nobody waits before one for
    /// ever.
    #[test]
    fn all_that_have_a_way_cross_gaps_and_arrive(case in cases_with_gaps(Bounds {
        loss_percent: 50,
        latency: SimDuration::from_millis(1500),
        ..Bounds::default()
    }, Gaps::Cross)) {
        let mut case = case;
        case.network = patient();
        let (metrics, report) = run(&case);
        let done = metrics.arrived + metrics.refused;
        prop_assert_eq!(done, metrics.rovers, "{}", report.end.detail());
        prop_assert_eq!(metrics.collisions, 0);
    }
}

proptest! {
    #![proptest_config(config(64))]

    /// Work that is handed over may be lost, late, or with a node that crashes.
    #[test]
    fn rovers_do_not_collide_where_loads_are_evened_out(
        case in any_policy(),
        ownership in prop_oneof![Just(Ownership::Balanced), Just(Ownership::Traffic)],
        weight in prop_oneof![Just(0.0), Just(30.0)],
    ) {
        let mut case = with_policy(case, Policy::MaxPlus);
        case.world.ownership = ownership;
        case.network.max_plus.outsourcing = true;
        case.network.max_plus.processor = Speed::PerS(500);
        case.network.max_plus.congestion_weight = weight;
        case.network.max_plus.congestion_spread = 0.5;
        no_collision(&case)?;
    }
}

/// Reads a printed case as the command line does, and runs it.
fn run_as_scenario(text: &str, sets: &[String]) -> (Results, Report) {
    let files = Files::on_disk(std::path::PathBuf::new());
    let scenario = Scenario::parse(
        "printed.toml",
        text.to_owned(),
        sets,
        &Registry::builtin(),
        files,
    );
    let scenario = scenario.unwrap_or_else(|error| panic!("{error}\n{text}"));
    let assembled = scenario.assemble().expect("it makes sense");
    let report = assembled.sim.run(Executor::Inline).expect("it starts");
    ((assembled.system.conclude)(&report), report)
}

proptest! {
    #![proptest_config(config(48))]

    #[test]
    fn what_a_case_prints_is_a_scenario_that_does_the_same(
        case in prop_oneof![any_policy(), any_gaps()],
    ) {
        let mut case = case;
        case.network.cycle_limit = 25;
        let (metrics, report) = run(&case);
        let (results, again) = run_as_scenario(&case.to_string(), &[]);
        prop_assert_eq!(report, again);
        let metrics = serde_json::to_value(metrics).expect("plain numbers");
        prop_assert_eq!(metrics, serde_json::Value::Object(results.metrics));
    }
}

/// The property above with a rule broken: "a vertex counts as occupied until its occupant is heard
/// to have left". The cases are the first of a fixed sequence, so that this does not depend on
/// luck.
#[test]
fn freeing_a_vertex_before_it_is_heard_free_is_found_and_shrinks() {
    for policy in [Policy::MaxPlus, Policy::Complete] {
        let broken = any_policy().prop_map(move |case| {
            let mut case = with_policy(case, policy);
            case.network.sabotage = Sabotage::FreeOnGrant;
            case
        });
        let rng = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
        let mut runner = TestRunner::new_with_rng(config(256), rng);
        let (tried, found_after) = (Cell::new(0), Cell::new(None));
        let found = runner.run(&broken, |case| {
            tried.set(tried.get() + 1);
            let result = no_collision(&case);
            if result.is_err() && found_after.get().is_none() {
                found_after.set(Some(tried.get()));
            }
            result
        });
        let Err(TestError::Fail(_, case)) = found else {
            panic!("{policy:?}: no collision in 256 cases, though the rule is broken");
        };
        let case = collides(&case).expect("it did a moment ago");
        let found_after = found_after.get().unwrap_or_default();
        println!("{policy:?}, found with case {found_after}, shrunk:\n\n{case}");
        assert!(case.team.rovers <= 3, "{case}");
        assert!(case.to_string().lines().count() <= 25, "{case}");
        let (results, _) = run_as_scenario(&case.to_string(), &[]);
        assert_eq!(results.violations.len(), 1, "{case}");
        let sound = ["network.sabotage=none".to_owned()];
        let (results, _) = run_as_scenario(&case.to_string(), &sound);
        assert!(results.violations.is_empty(), "{case}");
    }
}

/// The scenario in the documentation of `farside_actors::invariants`.
#[test]
fn the_scenario_in_the_docs_collides_because_of_the_broken_rule() {
    let text = include_str!("../actors/network/src/cases/freed-on-grant.toml");
    let (results, _) = run_as_scenario(text, &[]);
    let violation = results.violations.join("\n");
    assert_eq!(
        violation,
        "1 collisions: rover_02 met rover_01 at vertex 0 at 1.704587464s"
    );
    let (results, _) = run_as_scenario(text, &["network.sabotage=none".to_owned()]);
    assert!(results.violations.is_empty());
    assert_eq!(results.metrics["collisions"], 0);
}

/// A grid with loops and dead ends, four nodes, six rovers, links without faults.
fn plain(seed: u64) -> Case {
    let map = cut_grid(5, 4, 0x2d5a_96b4_c3a5_1e78);
    Case {
        seed,
        world: WorldConfig {
            roadmap: (&map).into(),
            nodes: 4,
            radius_m: Some(100.0),
            ..WorldConfig::default()
        },
        team: TeamConfig::of(6),
        network: rigid(),
        ..Case::default()
    }
}

fn down(actor: &str, at_ms: u64, for_ms: Option<u64>) -> Downtime {
    Downtime {
        actor: actor.to_owned(),
        at: SimDuration::from_millis(at_ms),
        restart_after: for_ms.map(SimDuration::from_millis),
    }
}

#[test]
fn with_everything_lost_nobody_moves_and_the_run_ends() {
    let mut case = plain(3);
    case.link.loss = 1.0;
    let (metrics, report) = run(&case);
    assert_eq!((metrics.arrived, metrics.collisions), (0, 0));
    let ended = (metrics.deadlock, metrics.no_progress, metrics.outcome);
    let expected = (Deadlock::None, NoProgress::Standing, Outcome::NoProgress);
    assert_eq!(
        ended, expected,
        "a link that loses all may do better next time"
    );
    assert!(metrics.wait_cycles.is_empty(), "all are in their queues");
    let detail = report.end.detail();
    let cycles = metrics.no_progress_cycles;
    let says = format!("no progress within {cycles} cycles: 6 rovers left");
    assert!(detail.contains(&says) && cycles > 2000, "{detail}");
}

#[test]
fn with_a_third_lost_all_arrive() {
    for seed in 1..=5 {
        let mut case = plain(seed);
        case.team.rovers = 3;
        case.link.loss = 0.3;
        let (metrics, report) = run(&case);
        let found = (metrics.arrived, metrics.collisions);
        assert_eq!(found, (3, 0), "{}", report.end.detail());
    }
}

#[test]
fn a_latency_of_several_cycles_slows_down_and_does_not_stop() {
    let mut case = plain(1);
    case.team.rovers = 2;
    case.link.latency = SimDuration::from_millis(2700);
    case.link.jitter = SimDuration::from_millis(450);
    case.network.deadlock_window = 40;
    let (slow, report) = run(&case);
    let found = (slow.arrived, slow.collisions);
    assert_eq!(found, (2, 0), "{}", report.end.detail());
    case.link = plain(1).link;
    let (fast, _) = run(&case);
    assert!(
        slow.cycles > 3 * fast.cycles,
        "{} and {}",
        slow.cycles,
        fast.cycles
    );
}

#[test]
fn a_rover_that_is_gone_for_good_is_named() {
    let mut case = plain(2);
    case.team.rovers = 1;
    case.crash = vec![down("rover_01", 3000, None)];
    let (metrics, report) = run(&case);
    assert_eq!(metrics.deadlock, Deadlock::Passive);
    assert!(metrics.wait_cycles.is_empty(), "it waits for nobody");
    let detail = report.end.detail();
    assert!(
        detail.contains("deadlock: 1 rovers left, rover_01 at vertex"),
        "{detail}"
    );
    let why = metrics.deadlock_reason.unwrap_or_default();
    assert!(why.ends_with("; rover_01 is down for good"), "{why}");
}

#[test]
fn threads_change_nothing() {
    let mut case = plain(7);
    case.team.rovers = 12;
    case.link.jitter = SimDuration::from_millis(4);
    (case.link.loss, case.link.duplicate) = (0.1, 0.1);
    case.crash = vec![
        down("node_02", 2000, Some(3000)),
        down("rover_03", 4000, Some(1500)),
    ];
    let alone = run(&case);
    assert_eq!(run(&case), alone);
    let threads = Executor::Kameo { threads: 2 };
    assert_eq!(case.run(threads).expect("it starts"), alone);
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
        let mut case = plain(seed);
        case.team.rovers = 12;
        case.network.sabotage = sabotage;
        run(&case).0.collisions > 0
    };
    (1..=100).any(collides)
}

/// The circles that the report names are circles: each rover stands where it is said to stand, and
/// the next one stands on a vertex that would bring it nearer to its goal.
#[test]
fn rovers_that_wait_in_a_circle_are_named() {
    let mut circles = 0;
    for seed in 1..=40 {
        let mut case = plain(seed);
        case.team.rovers = 14;
        case.network.livelock_window = 60;
        let mut sim = Simulation::new(seed);
        let system = case.assemble(&mut sim).expect("the case makes sense");
        let report = sim.run(Executor::Inline).expect("it starts");
        let metrics = system.metrics();
        let deadlock = metrics.deadlock_reason.unwrap_or_default();
        if !metrics.stuck {
            assert!(metrics.wait_cycles.is_empty());
            continue;
        }
        assert!(deadlock.starts_with(report.end.detail().trim_start_matches("@control: ")));
        let map = case.roadmap().expect("a roadmap");
        for cycle in &metrics.wait_cycles {
            let waiters = &cycle.0;
            for (i, waiter) in waiters.iter().enumerate() {
                let next = &waiters[(i + 1) % waiters.len()];
                let number: usize = waiter.agent["rover_".len()..].parse().expect("a number");
                let goal = system.missions()[number - 1].1;
                let (here, there) = (waiter.at.expect("on the map"), next.at.expect("there too"));
                assert!(map.are_adjacent(here, there), "{deadlock}");
                let is_nearer = map.distance(there, goal) < map.distance(here, goal);
                assert!(is_nearer, "{deadlock}");
            }
            circles += 1;
        }
        match metrics.wait_cycles.first() {
            Some(shortest) => assert!(deadlock.ends_with(&format!("; {shortest}"))),
            None if metrics.no_progress == NoProgress::Moving => {
                assert!(deadlock.ends_with("rovers moved without coming nearer to their goals"));
            }
            None => {}
        }
    }
    assert!(
        circles >= 3,
        "only {circles} circles in 40 runs of a crowded map"
    );
}

#[test]
fn a_roadmap_that_is_none_is_named_with_its_place() {
    let text = "system = 'network'\n[world]\nnodes = 1\nroadmap = { boundary = [0], \
                positions_m = [[0, 0]], edges = [[0, 1]] }";
    let parse = |text: &str| {
        let files = Files::on_disk(std::path::PathBuf::new());
        Scenario::parse("x.toml", text.to_owned(), &[], &Registry::builtin(), files)
    };
    let error = parse(text).expect("it has the right form").assemble().err();
    let error = error.expect("there is no vertex 1").to_string();
    assert!(error.starts_with("x.toml:4:"), "{error}");
    assert!(
        error.contains("vertex") && error.contains(&VertexId(1).to_string()),
        "{error}"
    );
    let error = parse(&text.replace("edges", "edge"))
        .err()
        .expect("an unknown key")
        .to_string();
    assert!(error.contains("edge"), "{error}");
    assert!(error.starts_with("x.toml:4:"), "{error}");
}
