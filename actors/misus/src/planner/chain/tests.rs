//! Chains beside a walk through the plan that knows nothing of slack.

use proptest::prelude::*;

use super::*;
use crate::planner::objective::ObjectiveConfig;
use crate::planner::problem::{Activity, FORMAT, Goal, Problem, Rover, Sol};

const NAMES: [&str; 8] = ["a", "b", "c", "d", "e", "f", "g", "h"];

fn goal(
    number: usize,
    at: (i32, i32),
    numbers: (i64, i64, i64),
    window: Option<(i64, i64)>,
) -> Goal {
    let (duration_ms, power_mw, memory_bits) = numbers;
    Goal {
        name: NAMES[number].to_owned(),
        rock: None,
        kind: None,
        position_m: [f64::from(at.0) / 10.0, f64::from(at.1) / 10.0],
        duration_ms,
        power_mw,
        memory_bits,
        weight: 1.0,
        window_ms: window.map(|(opens, length)| [opens, opens + duration_ms + length]),
        requires: Vec::new(),
        rovers: 1,
        mandatory: false,
    }
}

/// Small problems of one rover, in which all that can be short is short now and then.
fn problems() -> impl Strategy<Value = Problem> {
    let window = prop::option::weighted(0.3, (0..12_000i64, 0..3_000i64));
    let goals = (
        (-99..99i32, -99..99i32),
        (0..2_000i64, 0..50i64, 0..40i64),
        window,
    );
    let activity = (0..4_500i64, 0..500i64, 0..20i64, 0..60i64);
    let sols = (
        1..4usize,
        1_000..6_000i64,
        0..200_000i64,
        0..100i64,
        0..30i64,
    );
    (
        prop::collection::vec(goals, 1..8),
        prop::collection::vec(activity, 0..3),
        sols,
    )
        .prop_map(
            |(goals, activities, (sols, length_ms, energy_uj, memory_bits, stored))| {
                let sol = |number: i64| Sol {
                    opens_ms: number * 7_000,
                    closes_ms: number * 7_000 + length_ms.max(5_000),
                    energy_uj,
                };
                let goals = goals.into_iter().enumerate();
                let activities = activities.into_iter().enumerate();
                Problem {
                    format: FORMAT.to_owned(),
                    name: "small".to_owned(),
                    side_m: 20.0,
                    rovers: vec![Rover {
                        name: "rover".to_owned(),
                        position_m: [0.0, 0.0],
                        speed_mm_s: 10_000,
                        drive_mw: 100,
                        memory_bits,
                        stored_bits: stored.min(memory_bits),
                        sols: (0..sols as i64).map(sol).collect(),
                    }],
                    goals: goals
                        .map(|(n, (at, numbers, window))| goal(n, at, numbers, window))
                        .collect(),
                    combinations: Vec::new(),
                    objective: ObjectiveConfig::default(),
                    activities: activities
                        .map(|(number, (opens, duration_ms, power_mw, sends_bits))| {
                            let base_ms = (number % sols) as i64 * 7_000;
                            Activity {
                                name: NAMES[number].to_owned(),
                                rover: "rover".to_owned(),
                                sol: number % sols,
                                window_ms: [base_ms + opens, base_ms + opens + duration_ms],
                                duration_ms,
                                power_mw,
                                sends_bits,
                            }
                        })
                        .collect(),
                }
            },
        )
}

/// The violation and the time of driving of a plan, walked through step by step.
fn walk(problem: &Problem, instance: &Instance, plan: &[(usize, Visit)]) -> (Violation, i64) {
    let rover = &problem.rovers[0];
    let mut late = vec![0i64; rover.sols.len()];
    let mut energy = vec![0i64; rover.sols.len()];
    let (mut now, mut place, mut stored, mut over) =
        (0, instance.vehicles()[0].start, rover.stored_bits, 0i64);
    let mut driving = 0;
    for (sol, visit) in plan {
        let task = instance.task(visit.task);
        now = now.max(rover.sols[*sol].opens_ms);
        // A sol that ends late does not make the next one late.
        if plan
            .iter()
            .take_while(|at| at != &&(*sol, *visit))
            .all(|at| at.0 < *sol)
        {
            now = rover.sols[*sol].opens_ms;
        }
        let to = task.place.unwrap_or(place);
        let drive = instance.drive_ms(0, place, to);
        driving += drive;
        now = (now + drive).max(visit.opens_ms) + task.duration_ms;
        late[*sol] = late[*sol].max(now - visit.closes_ms.min(rover.sols[*sol].closes_ms));
        energy[*sol] += drive * rover.drive_mw + task.energy_uj;
        stored += task.adds_bits;
        over = over.max(stored - rover.memory_bits);
        stored = (stored - task.sends_bits).max(0);
        place = to;
    }
    let lacking = energy
        .iter()
        .zip(&rover.sols)
        .map(|(used, sol)| (used - sol.energy_uj).max(0));
    let violation = Violation {
        late_ms: late.iter().sum(),
        energy_uj: lacking.sum(),
        bits: over,
    };
    (violation, driving)
}

fn plan(chain: &Chain) -> Vec<(usize, Visit)> {
    chain
        .nodes()
        .iter()
        .map(|node| (node.sol, node.visit))
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    /// Every test of an insertion says what the plan comes to that it would make, and every change
    /// leaves the chain with the sums of its plan.
    #[test]
    fn insertions_are_what_a_walk_says(
        problem in problems(),
        order in prop::collection::vec((0..8usize, any::<u16>(), any::<u8>()), 1..14),
    ) {
        let Ok(instance) = Instance::new(&problem) else { return Ok(()) };
        let mut chain = Chain::new(&instance, 0);
        for (goal, place, what) in order {
            let goal = goal % instance.goals();
            if let Some(at) = chain.position(goal) {
                if what % 3 == 0 {
                    let range = chain.sol(chain.nodes()[at].sol);
                    let before = plan(&chain);
                    prop_assert!(chain.reverse(&instance, at, range.end - 1));
                    let mut turned = before;
                    turned[at..range.end].reverse();
                    prop_assert_eq!(plan(&chain), turned);
                } else {
                    chain.remove(&instance, at);
                }
            } else {
                let visit = match what % 4 {
                    0 => Visit::at(&instance, goal, i64::from(what) * 40),
                    _ => Visit::new(&instance, goal),
                };
                let mut found = Vec::new();
                for sol in 0..problem.rovers[0].sols.len() {
                    for index in chain.sol(sol).start..=chain.sol(sol).end {
                        let tested = chain.insertion(&instance, &visit, sol, index);
                        let mut with = plan(&chain);
                        with.insert(index, (sol, visit));
                        let (violation, driving) = walk(&problem, &instance, &with);
                        prop_assert_eq!(tested.violation, violation);
                        prop_assert_eq!(tested.added_ms, driving - chain.drive_ms());
                        found.push((sol, index, tested));
                    }
                }
                let (best, tested) = chain.best_insertion(&instance, &visit);
                let best = best.expect("it requires nothing");
                prop_assert_eq!(tested, found.len() as u64);
                let size = |violation: &Violation| violation.size(&instance.vehicles()[0]);
                let least = found.iter().map(|at| size(&at.2.violation)).fold(f64::MAX, f64::min);
                prop_assert_eq!(size(&best.violation), least);
                let (sol, index, tested) = found[usize::from(place) % found.len()];
                chain.insert(&instance, visit, sol, index);
                let at = chain.position(goal).map(|at| chain.nodes()[at].start_ms);
                prop_assert_eq!(at, Some(tested.start_ms));
            }
            let (violation, driving) = walk(&problem, &instance, &plan(&chain));
            prop_assert_eq!(chain.violation(), violation);
            prop_assert_eq!(chain.drive_ms(), driving);
        }
    }
}

#[test]
fn what_a_goal_requires_comes_before_it() {
    let mut problem = Problem {
        format: FORMAT.to_owned(),
        name: "order".to_owned(),
        side_m: 20.0,
        rovers: vec![Rover {
            name: "rover".to_owned(),
            position_m: [0.0, 0.0],
            speed_mm_s: 1_000,
            drive_mw: 1,
            memory_bits: 100,
            stored_bits: 0,
            sols: vec![Sol {
                opens_ms: 0,
                closes_ms: 90_000,
                energy_uj: 1_000_000_000,
            }],
        }],
        goals: (0..3)
            .map(|n| goal(n, (30 * n as i32, 0), (10, 1, 1), None))
            .collect(),
        combinations: Vec::new(),
        activities: Vec::new(),
        objective: ObjectiveConfig::default(),
    };
    problem.goals[0].requires = vec!["c".to_owned()];
    let instance = Instance::new(&problem).unwrap();
    let mut chain = Chain::new(&instance, 0);
    let visit = |goal| Visit::new(&instance, goal);
    assert_eq!(chain.best_insertion(&instance, &visit(0)).0, None);
    for goal in [2, 1, 0] {
        let found = chain.best_insertion(&instance, &visit(goal)).0.unwrap();
        chain.accept(&instance, visit(goal), &found);
    }
    assert_eq!(chain.goals(&instance).collect::<Vec<_>>(), [1, 2, 0]);
    assert!(!chain.reverse(&instance, 1, 2));
    assert!(chain.reverse(&instance, 0, 1));
}
