//! Planners beside the checker, on the models that come with the crate.

use std::sync::Arc;

use super::*;
use crate::checker;
use crate::language::{Options, read_model, read_problem};
use crate::model::{Model, Problem};

fn read(model: (&str, &str), problem: (&str, &str)) -> (Arc<Model>, Arc<Problem>) {
    let model = read_model(model.0, model.1, &Options::default()).ok();
    let model = model.unwrap_or_else(|findings| panic!("{findings}"));
    let problem = read_problem(problem.0, problem.1, &model, &Options::default()).ok();
    let problem = problem.unwrap_or_else(|findings| panic!("{findings}"));
    (Arc::new(model), Arc::new(problem))
}

fn rover() -> (Arc<Model>, Arc<Problem>) {
    read(
        ("rover.ddl", include_str!("../../models/rover.ddl")),
        (
            "rover-problem.ddl",
            include_str!("../../models/rover-problem.ddl"),
        ),
    )
}

/// Section 3.1 of the MISUS paper: a rover at the wrong place for an observation gets a drive.
#[test]
fn an_observation_elsewhere_brings_a_drive() {
    let (model, problem) = rover();
    let settings = Settings {
        operations: 2_000_000,
        seed: 1,
    };
    let answer = Forward.solve(&model, &problem, settings).expect("it loads");
    let plan = answer
        .plan
        .unwrap_or_else(|| panic!("{:?}", answer.failure));
    for token in &plan.tokens {
        println!("{token}");
    }
    println!("{:?} {:?}", plan.achieved, plan.left_out);
    println!("{} operations, {:?}", answer.operations, answer.counters);
    let violations = checker::check(&model, &problem, &plan);
    assert!(violations.is_empty(), "{violations:#?}");
    assert!(plan.tokens.iter().any(|token| token.predicate == "Going"));
}
