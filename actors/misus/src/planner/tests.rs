//! Whatever is planned, by whomever, is judged by the checker that shares no code with planners.

use farside::SimDuration;
use farside::random::RandomKey;
use proptest::prelude::*;

use super::casper::{Casper, Choice, PlannerConfig};
use super::chain::{Chain, Visit};
use super::instance::Instance;
use super::lns::{self, LnsConfig};
use super::plan::{TeamPlan, score, violations};
use super::problem::{Combination, Problem, ProblemConfig, generate};
use super::rounds::{Rounds, run, team_plan};

/// What is changed of a generated problem: (which goal, what, a number).
type Change = (u8, u8, u32);

/// Problems with all that problems can have: windows, requirements, mandatory goals, goals for two rovers,
/// negative combinations, communication in the middle of a sol, hardly any energy or memory.
fn problems() -> impl Strategy<Value = Problem> {
    let numbers = (1..5u32, 1..4u32, 1..7u32, 0..3u32, any::<u64>());
    let shorts = (60..400u64, 10..400u32, 20..300u64, 0..200u64);
    let changes = prop::collection::vec((any::<u8>(), 0..5u8, any::<u32>()), 0..10);
    (numbers, shorts, changes).prop_map(
        |((rovers, sols, rocks, joint, seed), (minutes, watt_hours, megabits, window), changes)| {
            let config = ProblemConfig {
                rovers,
                sols,
                rocks_least: rocks,
                rocks_most: rocks,
                sol_length: SimDuration::from_secs(60 * minutes),
                energy_j: f64::from(watt_hours) * 3600.0,
                memory_bits: megabits * 1_000_000,
                communication_window: SimDuration::from_secs(60 * (window.max(10))),
                combination_dropped: 0.2,
                joint_share: f64::from(joint) / 4.0,
                ..ProblemConfig::default()
            };
            let mut problem = generate(&config, seed).expect("all is in range");
            for change in changes {
                alter(&mut problem, change);
            }
            problem
        },
    )
}

fn alter(problem: &mut Problem, (goal, what, number): Change) {
    let rocks = problem.goals.len() / 3;
    let rock = usize::from(goal) % rocks;
    let at = usize::from(goal) % problem.goals.len();
    let names: Vec<String> = problem.goals.iter().map(|goal| goal.name.clone()).collect();
    let mut changed = problem.clone();
    match what {
        0 => {
            let opens_ms = i64::from(number) % 20_000_000;
            let closes_ms = opens_ms + changed.goals[at].duration_ms + 3_600_000;
            changed.goals[at].window_ms = Some([opens_ms, closes_ms]);
        }
        1 => changed.goals[3 * rock + 2].requires = vec![names[3 * rock].clone()],
        2 => changed.goals[3 * rock].mandatory = true,
        3 => {
            let goals = [at, (at + 1 + number as usize % 5) % names.len()];
            let goals = goals.map(|goal| names[goal].clone()).to_vec();
            changed.combinations.push(Combination {
                goals,
                weight: -30.0,
            });
        }
        _ => changed.goals[at].weight = f64::from(number % 40) - 20.0,
    }
    // Some changes do not go together.
    if changed.resolve().is_ok() {
        *problem = changed;
    }
}

fn check(problem: &Problem, plan: &TeamPlan, claimed: f64) -> Result<(), TestCaseError> {
    prop_assert_eq!(violations(problem, plan), []);
    prop_assert!((score(problem, plan) - claimed).abs() < 1e-6);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    /// No plan violates anything, and each is worth what its planner says, whoever plans what.
    #[test]
    fn no_plan_of_any_planner_violates_anything(problem in problems(), seed in 0..100u64) {
        let instance = Instance::new(&problem).unwrap();
        let config = LnsConfig { operations: 20_000, ..LnsConfig::default() };
        match lns::plan(&instance, &config, RandomKey::new(seed)) {
            Ok(found) => {
                let chains: Vec<&Chain> = found.chains.iter().collect();
                check(&problem, &team_plan(&problem, &instance, &chains), found.score)?;
            }
            Err(unmet) => prop_assert!(instance.task(unmet.task).mandatory),
        }
        for choice in [Choice::Idgs, Choice::SimpleReward, Choice::Random] {
            let config = PlannerConfig { choice, offers: 3, ..PlannerConfig::default() };
            match run(&problem, &instance, &config, RandomKey::new(seed)) {
                Ok(rounds) => check(&problem, &rounds.plan, rounds.score[19])?,
                Err(unmet) => prop_assert!(instance.task(unmet.task).mandatory),
            }
        }
    }

    /// A plan that is taken over after the problem has changed is one of the changed problem.
    #[test]
    fn a_plan_that_is_taken_over_violates_nothing(
        problem in problems(),
        changes in prop::collection::vec((any::<u8>(), 0..5u8, any::<u32>()), 1..5),
    ) {
        let instance = Instance::new(&problem).unwrap();
        let config = LnsConfig { operations: 5_000, ..LnsConfig::default() };
        let Ok(found) = lns::plan(&instance, &config, RandomKey::new(1)) else { return Ok(()) };
        let mut changed = problem.clone();
        for change in changes {
            alter(&mut changed, change);
        }
        changed.rovers[0].position_m = [-1.5, 2.5];
        let instance = Instance::new(&changed).unwrap();
        let config = PlannerConfig::default();
        let Ok(mut casper) = Casper::new(&instance, 0, &config, RandomKey::new(1)) else { return Ok(()) };
        let goals: Vec<usize> = found.chains[0].goals(&instance).collect();
        for &goal in &goals {
            if casper.assign(&instance, goal, None).is_err() {
                return Ok(());
            }
        }
        let nodes = found.chains[0].nodes().iter();
        let before: Vec<(usize, Visit)> = nodes
            .map(|node| (node.sol, Visit::new(&instance, node.visit.task)))
            .collect();
        if casper.resume(&instance, &before).is_ok() {
            prop_assert!(casper.plan().violation().is_none());
            let value = casper.score().value();
            let step = casper.step(&instance);
            prop_assert!(casper.score().value() >= value || !step.improved);
        }
    }
}

fn planned(problem: &Problem, choice: Choice, seed: u64) -> Rounds {
    let instance = Instance::new(problem).unwrap();
    let config = PlannerConfig {
        choice,
        epsilon: 0.0,
        ..PlannerConfig::default()
    };
    run(problem, &instance, &config, RandomKey::new(seed)).unwrap()
}

/// Of two cheap goals whose combination is worth -30, who knows takes one, and who does not takes both.
#[test]
fn a_combination_of_negative_weight_is_declined_by_who_knows_it() {
    let config = ProblemConfig {
        rovers: 1,
        rocks_least: 5,
        rocks_most: 5,
        ..ProblemConfig::default()
    };
    let mut problem = generate(&config, 4).unwrap();
    problem.combinations.clear();
    let two = ["rock_01_a", "rock_02_a"];
    for goal in &mut problem.goals {
        // All are quick, and the two are worth a little more than others.
        goal.duration_ms = 60_000;
        goal.memory_bits = 0;
        goal.weight = if two.contains(&goal.name.as_str()) {
            12.0
        } else {
            10.0
        };
    }
    let goals = two.map(str::to_owned).to_vec();
    problem.combinations.push(Combination {
        goals,
        weight: -30.0,
    });
    let taken = |choice, seed| {
        let plan = planned(&problem, choice, seed).plan;
        let stops = plan.rovers.iter().flatten();
        stops
            .filter(|stop| two.contains(&stop.task.as_str()))
            .count()
    };
    for seed in 0..10 {
        assert_eq!(taken(Choice::Idgs, seed), 1);
        assert_eq!(taken(Choice::SimpleReward, seed), 2);
    }
}

/// What users want of plans besides: the dearer a metre is, the less is driven, whoever plans.
#[test]
fn the_dearer_a_metre_is_the_less_is_driven() {
    let driven = |drive_per_m: f64| {
        let mut problem = generate(&ProblemConfig::default(), 4).unwrap();
        problem.objective.drive_per_m = drive_per_m;
        let rounds = planned(&problem, Choice::Idgs, 1);
        assert_eq!(violations(&problem, &rounds.plan), []);
        let instance = Instance::new(&problem).unwrap();
        let config = LnsConfig {
            operations: 50_000,
            ..LnsConfig::default()
        };
        let found = lns::plan(&instance, &config, RandomKey::new(1)).unwrap();
        let chains = found.chains.iter();
        let lns_mm: u64 = chains.map(|chain| chain.drive_mm(&instance)).sum();
        [rounds.traverse_m[19], lns_mm as f64 * 1e-3]
    };
    let [free, cheap, dear] = [0.0, 1.0, 1e6].map(driven);
    assert!(
        cheap[0] < free[0] && cheap[1] < free[1],
        "{free:?} {cheap:?}"
    );
    assert!(
        dear[0] < cheap[0] && dear[1] < cheap[1],
        "{cheap:?} {dear:?}"
    );
}

/// Who chooses goals without regard to what they cost takes no plan that costs more than it is worth.
#[test]
fn no_plan_is_taken_that_costs_more_than_it_is_worth() {
    let mut problem = generate(&ProblemConfig::default(), 4).unwrap();
    for choice in [Choice::SimpleReward, Choice::Random] {
        problem.objective.drive_per_m = 0.0;
        assert!(planned(&problem, choice, 1).traverse_m[19] > 0.0);
        problem.objective.drive_per_m = 1e6;
        assert_eq!(planned(&problem, choice, 1).traverse_m[19], 0.0);
    }
}

/// What the same planner is given comes out the same, to the last bit.
#[test]
fn the_same_draws_give_the_same_plans() {
    let problem = generate(&ProblemConfig::default(), 11).unwrap();
    let first = planned(&problem, Choice::Random, 3);
    assert_eq!(planned(&problem, Choice::Random, 3), first);
    assert_ne!(planned(&problem, Choice::Random, 4), first);
}

/// The paper's claims in small: 6 problems, 2 runs each. The whole study is an example.
#[test]
fn who_knows_of_interdependence_scores_more_and_drives_less() {
    let mut sums = [[0.0; 2]; 3];
    for seed in 0..6 {
        let problem = generate(&ProblemConfig::default(), seed).unwrap();
        let instance = Instance::new(&problem).unwrap();
        let choices = [Choice::Idgs, Choice::SimpleReward, Choice::Random];
        for (choice, sums) in choices.into_iter().zip(&mut sums) {
            let config = PlannerConfig {
                choice,
                ..PlannerConfig::default()
            };
            for number in 0..2 {
                let key = RandomKey::new(seed).number(number);
                let rounds = run(&problem, &instance, &config, key).unwrap();
                sums[0] += rounds.score[9];
                sums[1] += rounds.traverse_m[19];
            }
        }
    }
    let [idgs, simple, random] = sums;
    assert!(
        idgs[0] > 1.1 * simple[0] && simple[0] > 1.1 * random[0],
        "{sums:?}"
    );
    assert!(idgs[1] < simple[1] && idgs[1] < random[1], "{sums:?}");
}

/// What is mandatory is planned although it is worth nothing, and what cannot be done is named.
#[test]
fn mandatory_goals_are_planned_first_and_never_given_up() {
    let config = ProblemConfig {
        rocks_least: 10,
        rocks_most: 10,
        ..ProblemConfig::default()
    };
    let mut problem = generate(&config, 2).unwrap();
    for goal in problem
        .goals
        .iter_mut()
        .filter(|goal| goal.name.ends_with("_c"))
        .take(5)
    {
        (goal.mandatory, goal.weight) = (true, -5.0);
    }
    for choice in [Choice::Idgs, Choice::Random] {
        let rounds = planned(&problem, choice, 1);
        assert_eq!(violations(&problem, &rounds.plan), []);
    }
    for goal in &mut problem.goals {
        goal.mandatory = true;
    }
    let instance = Instance::new(&problem).unwrap();
    let refused = run(
        &problem,
        &instance,
        &PlannerConfig::default(),
        RandomKey::new(1),
    );
    let refused = refused.unwrap_err().to_string();
    assert!(refused.contains("cannot do what it has to"), "{refused}");
}

/// One rover with two sols of 100 s, in which it can drive 90 m and do little besides; `x` and `y` are far
/// away at one place, and `y` can be done only by who has spent the night there; `z` and `v` are on the way.
fn far_away() -> Problem {
    let config = ProblemConfig {
        rovers: 1,
        rocks_least: 2,
        rocks_most: 2,
        side_least_m: 200.0,
        side_most_m: 200.0,
        start_within_m: 0.0,
        speed_m_per_s: 1.0,
        sol_length: SimDuration::from_secs(100),
        communication: SimDuration::from_secs(1),
        communication_window: SimDuration::from_secs(100),
        ..ProblemConfig::default()
    };
    let mut problem = generate(&config, 1).unwrap();
    problem.combinations.clear();
    problem.goals.truncate(4);
    let goals = [
        ("x", 90.0, 1, 1.0),
        ("y", 90.0, 60, 5.0),
        ("z", 5.0, 1, 1.0),
        ("v", 6.0, 1, 1.0),
    ];
    for (goal, (name, east_m, duration_s, weight)) in problem.goals.iter_mut().zip(goals) {
        goal.name = name.to_owned();
        goal.position_m = [east_m, 0.0];
        (goal.duration_ms, goal.weight) = (1000 * duration_s, weight);
    }
    problem
}

/// Who has not been at a place at the end of a sol does not begin the next one there.
#[test]
fn what_cannot_be_reached_any_more_leaves_the_plan_with_what_is_withdrawn() {
    let problem = far_away();
    let instance = Instance::new(&problem).unwrap();
    let config = PlannerConfig::default();
    let mut casper = Casper::new(&instance, 0, &config, RandomKey::new(1)).unwrap();
    let plan = |casper: &Casper| casper.plan().goals(&instance).collect::<Vec<_>>();
    casper.assign(&instance, 0, None).unwrap();
    casper.step(&instance);
    casper.assign(&instance, 1, None).unwrap();
    casper.step(&instance);
    assert_eq!(plan(&casper), [0, 1]);
    casper.withdraw(&instance, 0).unwrap();
    assert!(casper.plan().violation().is_none());
    assert_eq!((plan(&casper), casper.score().value()), (vec![], 0.0));
}

/// `z` and `v` together make `x` worth less than nothing, but without `x` there is no `y`.
#[test]
fn a_search_does_not_strand_a_rover_by_dropping_what_is_worth_nothing() {
    let mut problem = far_away();
    for (goals, weight) in [(["z", "v"], 20.0), (["x", "z"], -10.0)] {
        let goals = goals.map(str::to_owned).to_vec();
        problem.combinations.push(Combination { goals, weight });
    }
    let instance = Instance::new(&problem).unwrap();
    let config = LnsConfig {
        operations: 20_000,
        ..LnsConfig::default()
    };
    for seed in 0..5 {
        let found = lns::plan(&instance, &config, RandomKey::new(seed)).unwrap();
        assert!(found.chains[0].violation().is_none());
        assert_eq!(found.score, 22.0);
    }
}

/// Goals for two rovers are worth much: every planner brings some pairs together, at one time.
#[test]
fn rovers_meet_where_two_are_needed() {
    let config = ProblemConfig {
        joint_share: 0.5,
        ..ProblemConfig::default()
    };
    let problem = generate(&config, 3).unwrap();
    let instance = Instance::new(&problem).unwrap();
    let meetings = |plan: &TeamPlan| {
        let goals = problem.goals.iter().filter(|goal| goal.rovers == 2);
        let done = goals.filter(|goal| {
            let mut stops = plan.rovers.iter().flatten();
            stops.any(|stop| stop.task == goal.name)
        });
        done.count()
    };
    let rounds = planned(&problem, Choice::Idgs, 1);
    let config = LnsConfig {
        operations: 200_000,
        ..LnsConfig::default()
    };
    let found = lns::plan(&instance, &config, RandomKey::new(1)).unwrap();
    let chains: Vec<&Chain> = found.chains.iter().collect();
    let searched = team_plan(&problem, &instance, &chains);
    for plan in [&rounds.plan, &searched] {
        assert_eq!(violations(&problem, plan), []);
        assert!(meetings(plan) >= 2, "{}", meetings(plan));
    }
    assert!(found.score >= score(&problem, &rounds.plan));
}

/// The checker finds each thing that can be wrong with a plan that is right.
#[test]
fn whatever_is_wrong_with_a_plan_is_found() {
    let problem = generate(&ProblemConfig::default(), 2).unwrap();
    let plan = planned(&problem, Choice::Idgs, 1).plan;
    assert_eq!(violations(&problem, &plan), []);
    let goals = |task: &str| !task.contains("communication");
    let at = plan.rovers[0]
        .iter()
        .rposition(|stop| goals(&stop.task))
        .unwrap();
    let name = plan.rovers[0][at].task.clone();
    let check = |change: &dyn Fn(&mut Problem, &mut TeamPlan), expected: &str| {
        let (mut problem, mut plan) = (problem.clone(), plan.clone());
        change(&mut problem, &mut plan);
        let found = violations(&problem, &plan);
        let found: Vec<String> = found.iter().map(|one| format!("{one:?}")).collect();
        assert!(
            found.iter().any(|one| one.starts_with(expected)),
            "{expected}: {found:?}"
        );
    };
    check(&|_, plan| plan.rovers[0][at].start_ms -= 1, "Early");
    check(
        &|_, plan| plan.rovers[0][at].start_ms += 20_000_000,
        "Window",
    );
    check(
        &|problem, _| problem.rovers[0].sols[0].energy_uj = 1_000,
        "Power",
    );
    check(
        &|problem, _| problem.rovers[0].memory_bits = 1_000,
        "Memory",
    );
    check(&|_, plan| plan.rovers[0][at].sol = 9, "Unknown");
    check(
        &|_, plan| plan.rovers[0][at].task = "nothing".to_owned(),
        "Unknown",
    );
    check(&|_, plan| plan.rovers.truncate(2), "Rovers");
    check(
        &|_, plan| plan.rovers[0].retain(|stop| goals(&stop.task)),
        "Missing",
    );
    check(
        &|_, plan| plan.rovers[1] = plan.rovers[0].clone(),
        "Together",
    );
    let absent = problem
        .goals
        .iter()
        .find(|goal| plan.rovers[0].iter().all(|stop| stop.task != goal.name));
    let absent = absent.expect("one rover does not do all").name.clone();
    check(
        &|problem, _| {
            let mut goals = problem.goals.iter_mut();
            let goal = goals.find(|goal| goal.name == name).unwrap();
            goal.requires.push(absent.clone());
        },
        "Order",
    );
}
