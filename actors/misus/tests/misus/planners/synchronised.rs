//! Planners that wait for each other plan what they plan without a network, whatever is lost.

use farside::prelude::*;
use farside::random::RandomKey;
use farside_misus::planner::casper::{Choice, PlannerConfig};
use farside_misus::planner::instance::Instance;
use farside_misus::planner::lns::{self, LnsConfig};
use farside_misus::planner::problem::{ProblemConfig, generate};
use farside_misus::planner::rounds::{Rounds, run};

use super::scenario::{Ran, Run};

pub(crate) const CHOICES: [(Choice, &str); 3] = [
    (Choice::Idgs, "planner.choice = \"idgs\""),
    (Choice::SimpleReward, "planner.choice = \"simple-reward\""),
    (Choice::Random, "planner.choice = \"random\""),
];

fn without_network(choice: Choice, problem: u64, seed: u64) -> Rounds {
    without_network_of(&ProblemConfig::default(), choice, problem, seed)
}

pub(crate) fn without_network_of(
    problems: &ProblemConfig,
    choice: Choice,
    problem: u64,
    seed: u64,
) -> Rounds {
    let problem = generate(problems, problem).unwrap();
    let instance = Instance::new(&problem).unwrap();
    let config = PlannerConfig {
        choice,
        ..PlannerConfig::default()
    };
    run(&problem, &instance, &config, RandomKey::new(seed)).unwrap()
}

pub(crate) fn assert_equal(ran: &Ran, rounds: &Rounds) {
    let bits = |values: &[f64]| -> Vec<u64> { values.iter().map(|v| v.to_bits()).collect() };
    for (metric, values) in [
        ("score_by_step", &rounds.score),
        ("goals_by_step", &rounds.goals),
        ("operations_by_step", &rounds.operations),
        ("traverse_by_step", &rounds.traverse_m),
    ] {
        assert_eq!(bits(&ran.curve(metric)), bits(values), "{metric}");
    }
    let starts = |plan: &Vec<(usize, usize, i64)>| -> Vec<(usize, i64)> {
        plan.iter().map(|(_, sol, start)| (*sol, *start)).collect()
    };
    let planned: Vec<Vec<(usize, i64)>> = ran.plans.iter().map(starts).collect();
    let expected = rounds.plan.rovers.iter().map(|stops| {
        let stops = stops.iter().map(|stop| (stop.sol, stop.start_ms));
        stops.collect::<Vec<_>>()
    });
    assert_eq!(planned, expected.collect::<Vec<_>>());
    assert_eq!(ran.figure("shed"), rounds.shed as f64);
    assert_eq!(ran.figure("reassigned"), rounds.reassigned as f64);
    assert_eq!(ran.figure("goals_deleted"), rounds.deleted.len() as f64);
    let operations = rounds.operations.iter().sum::<f64>() + rounds.central_operations as f64;
    assert_eq!(ran.figure("plan_operations"), operations);
    assert_eq!(ran.figure("plan_violations"), 0.0);
    assert!(ran.results.violations.is_empty());
}

#[test]
fn over_perfect_links_they_plan_what_rounds_plan() {
    for (choice, text) in CHOICES {
        for seed in 1..=4 {
            let ran = Run {
                text,
                problem: 10 + seed,
                seed,
                ..Run::default()
            };
            assert_equal(&ran.run(), &without_network(choice, 10 + seed, seed));
        }
    }
}

#[test]
fn loss_and_crashes_cost_those_who_wait_time_and_nothing_else() {
    let (choice, text) = CHOICES[0];
    let whole = Run {
        text,
        problem: 12,
        seed: 3,
        ..Run::default()
    };
    let bad = Run {
        links: "default = { latency = \"200ms\", jitter = \"30s\", loss = 0.6 }",
        ..whole
    };
    let (whole, bad) = (whole.run(), bad.run());
    let rounds = without_network(choice, 12, 3);
    assert!(rounds.shed > 0 && rounds.reassigned > 0, "{rounds:?}");
    assert_equal(&bad, &rounds);
    assert!(bad.report.end_time > whole.report.end_time);
    let crashed = Run {
        text,
        problem: 12,
        seed: 3,
        links: "default = { latency = \"200ms\", loss = 0.2 }",
        crashes: &[
            ("rover_02", 250, 900),
            ("centre", 400, 1200),
            ("rover_01", 1300, 1301),
        ],
        ..Run::default()
    };
    assert_equal(&crashed.run(), &rounds);
}

#[test]
fn inline_and_threaded_runs_have_one_digest() {
    for text in ["", "rounds.synchronised = false"] {
        let inline = Run {
            text,
            links: "default = { latency = \"200ms\", jitter = \"2s\", loss = 0.3 }",
            ..Run::default()
        };
        let threaded = Run {
            executor: Executor::Kameo { threads: 2 },
            ..inline
        };
        let (inline, threaded) = (inline.run(), threaded.run());
        assert_eq!(inline.report.digest, threaded.report.digest);
        assert_eq!(inline.results.metrics, threaded.results.metrics);
    }
}

#[test]
fn the_centre_can_plan_for_all_at_once() {
    let text = "planner = { choice = \"lns\", steps = 3 }\nlns.operations = 200_000";
    for seed in 1..=5 {
        let run = Run {
            text,
            problem: seed,
            seed,
            ..Run::default()
        };
        let ran = run.run();
        let instance = Instance::new(&generate(&ProblemConfig::default(), seed).unwrap()).unwrap();
        let config = LnsConfig {
            operations: 200_000,
            ..LnsConfig::default()
        };
        let found = lns::plan(&instance, &config, RandomKey::new(seed)).unwrap();
        assert!((ran.figure("score") - found.score).abs() < 1e-6);
        assert_eq!(ran.figure("plan_violations"), 0.0);
    }
}
