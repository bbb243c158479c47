//! How far plans are from the best that there is: problems whose optimum `experiments/oracles/misus_exact.py` has
//! proved by going through all sets of goals, and what was ever found of larger ones. What planners may look at is
//! counted; no clock is.

use farside::random::RandomKey;
use farside_misus::planner::bounds::Bounds;
use farside_misus::planner::casper::PlannerConfig;
use farside_misus::planner::chain::Chain;
use farside_misus::planner::instance::Instance;
use farside_misus::planner::lns::{self, LnsConfig};
use farside_misus::planner::plan::{score, violations};
use farside_misus::planner::problem::{Problem, ProblemConfig, generate};
use farside_misus::planner::rounds::{run, team_plan};

/// What `misus_exact.py` and `misus_bound.py` have found, as it is built in.
const TABLE: &str = include_str!("../../../bounds.csv");

/// The best plans that anybody has found of the problems of ten rocks.
const BEST: &str = include_str!("best_of_ten_rocks.csv");

/// How many operations the planner of the whole team has: a hundredth of what it looks at in a second.
const OPERATIONS: u64 = 400_000;

fn problem(rocks: u32, seed: u64) -> Problem {
    let config = ProblemConfig {
        rocks_least: rocks,
        rocks_most: rocks,
        ..ProblemConfig::default()
    };
    generate(&config, seed).unwrap()
}

/// What the plan of the rovers' planners is worth.
fn idgs(problem: &Problem) -> f64 {
    let instance = Instance::new(problem).unwrap();
    let key = RandomKey::new(1);
    let plan = run(problem, &instance, &PlannerConfig::default(), key).unwrap();
    assert_eq!(violations(problem, &plan.plan), []);
    score(problem, &plan.plan)
}

/// What the plan of the search for the whole team is worth.
fn team(problem: &Problem, operations: u64) -> f64 {
    let instance = Instance::new(problem).unwrap();
    let config = LnsConfig {
        operations,
        ..LnsConfig::default()
    };
    let found = lns::plan(&instance, &config, RandomKey::new(1)).unwrap();
    let chains: Vec<&Chain> = found.chains.iter().collect();
    let plan = team_plan(problem, &instance, &chains);
    assert_eq!(violations(problem, &plan), []);
    score(problem, &plan)
}

fn mean(shares: &[f64]) -> f64 {
    shares.iter().sum::<f64>() / shares.len() as f64
}

fn worst(shares: &[f64]) -> f64 {
    shares.iter().copied().fold(f64::INFINITY, f64::min)
}

/// The first problems of six rocks whose optimum is proven, with it.
fn proven() -> Vec<(Problem, f64)> {
    let is_proven = |digest: &str| {
        let mut lines = TABLE.lines();
        lines.any(|line| line.starts_with(digest) && line.contains(",true,"))
    };
    let problems = (0..40).map(|seed| problem(6, seed));
    let proven = problems.filter(|problem| is_proven(&problem.digest()));
    let bound = |problem: Problem| {
        let bound = Bounds::builtin().of(&problem.digest());
        (problem, bound.expect("it is in the table"))
    };
    proven.take(20).map(bound).collect()
}

#[test]
fn of_twenty_proven_optima_rovers_reach_nine_tenths_and_the_team_almost_all() {
    let proven = proven();
    assert_eq!(proven.len(), 20);
    let (mut rovers, mut teams) = (Vec::new(), Vec::new());
    for (problem, bound) in &proven {
        rovers.push(idgs(problem) / bound);
        teams.push(team(problem, OPERATIONS) / bound);
    }
    // No plan is worth more than what was proved by a program that shares nothing with ours.
    let most = rovers.iter().chain(&teams).copied().fold(0.0, f64::max);
    assert!(most <= 1.0 + 1e-9, "{most}");
    assert!(mean(&rovers) >= 0.90, "{rovers:?}");
    assert!(mean(&teams) >= 0.97 && worst(&teams) >= 0.94, "{teams:?}");
    println!(
        "idgs {:.4}, {:.4} at worst; lns {:.4}, {:.4} at worst",
        mean(&rovers),
        worst(&rovers),
        mean(&teams),
        worst(&teams)
    );
}

/// `cargo test --release -p farside-misus --test misus planners -- --ignored`: half a second of one core for each problem.
#[test]
#[ignore = "ten seconds in a release build"]
fn of_twenty_proven_optima_the_team_reaches_all_but_a_twentieth_in_a_second() {
    let teams = proven();
    let teams = teams
        .iter()
        .map(|(problem, bound)| team(problem, 20_000_000) / bound);
    let teams: Vec<f64> = teams.collect();
    assert!(mean(&teams) >= 0.97 && worst(&teams) >= 0.95, "{teams:?}");
}

#[test]
fn of_ten_rocks_rovers_reach_nine_tenths_of_the_best_known() {
    let best = BEST.lines().skip(1).map(|line| {
        let cells: Vec<&str> = line.split(',').collect();
        (cells[0].parse().unwrap(), cells[1].parse().unwrap())
    });
    let best: Vec<(u64, f64)> = best.collect();
    assert_eq!(best.len(), 10);
    let shares = best
        .iter()
        .map(|&(seed, best)| idgs(&problem(10, seed)) / best);
    let shares: Vec<f64> = shares.collect();
    assert!(mean(&shares) >= 0.90, "{shares:?}");
    println!("idgs {:.4}, {:.4} at worst", mean(&shares), worst(&shares));
}
