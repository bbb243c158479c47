//! The rover's model, planned and checked.

use std::sync::Arc;

use super::*;
use crate::checker::check;
use crate::plan::Plan;
use crate::search::{Forward, Planner, Settings};

/// The plan for a problem of the rover, if there is one, and whether that is proven.
fn solve(text: &str) -> (Option<Plan>, bool) {
    let model = Arc::new(rover());
    let problem = read_problem("problem.ddl", text, &model, &Options::default());
    let problem = Arc::new(problem.value.expect("it is right"));
    let settings = Settings {
        operations: 1_000_000,
        seed: 1,
    };
    let answer = Forward
        .solve(&model, &problem, settings)
        .expect("what is the case can be");
    if let Some(plan) = &answer.plan {
        assert_eq!(check(&model, &problem, plan), []);
    }
    (answer.plan, answer.proven)
}

#[test]
fn a_drive_is_added_where_an_observation_needs_it() {
    let (plan, _) = solve(ROVER_PROBLEM);
    let plan = plan.expect("there is one");
    let drives = plan
        .tokens
        .iter()
        .filter(|token| token.predicate == "Going");
    assert_eq!(drives.count(), 2);
    assert!((plan.score - 18.5).abs() < 1e-9, "{}", plan.score);
}

#[test]
fn what_is_too_much_has_no_plan_and_without_one_goal_it_has() {
    let (plan, _) = solve(TOO_MUCH);
    assert!(plan.is_none(), "{plan:?}");
    let goal = |line: &&str| !line.starts_with("(Goal study_3");
    let less: Vec<&str> = TOO_MUCH.lines().filter(goal).collect();
    assert_eq!(less.len() + 1, TOO_MUCH.lines().count());
    assert!(solve(&less.join("\n")).0.is_some());
}
