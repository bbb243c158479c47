//! Planners beside the checker, on the models that come with the crate.

mod same;

use std::sync::Arc;

use super::*;
use crate::checker;
use crate::language::{Options, read_model, read_problem};
use crate::model::{Model, Problem};
use crate::temporal::Span;

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
    let planners: [&dyn Planner; 2] = [&Forward, &Repair::default()];
    for planner in planners {
        let answer = planner.solve(&model, &problem, settings).expect("it loads");
        let plan = answer
            .plan
            .unwrap_or_else(|| panic!("{:?}", answer.failure));
        let violations = checker::check(&model, &problem, &plan);
        assert!(violations.is_empty(), "{}: {violations:#?}", planner.name());
        assert!(plan.tokens.iter().any(|token| token.predicate == "Going"));
        assert_eq!((planner.name(), plan.score), (planner.name(), 18.5));
    }
}

fn polling() -> executive::Executive {
    let text = include_str!("../../models/polling.ddl");
    let model = read_model("polling.ddl", text, &Options::default()).ok();
    executive::Executive::new(Arc::new(
        model.unwrap_or_else(|findings| panic!("{findings}")),
    ))
}

/// Section 3.3 of the IDEA paper: the fan is turned on in the cycle in which a temperature above
/// the threshold is known, and stays as it is while no value comes.
#[test]
fn a_fan_is_turned_on_in_the_cycle_that_learns_the_temperature() {
    let mut executive = polling();
    assert!(matches!(executive.cycle(0, 10_000), Verdict::Solved));
    let said = |executive: &executive::Executive, timeline| {
        let token = executive.present(timeline).expect("it says something");
        let at = executive.database().token(token).expect("it is there");
        let model = executive.database().model().clone();
        let values = at.parameters.iter();
        let values: Vec<_> = values.map(|&one| executive.database().value(one)).collect();
        let start = executive.database().start(token).min;
        (model.predicates[at.predicate].name.clone(), values, start)
    };
    assert_eq!(said(&executive, 1), ("Unknown".to_owned(), vec![], 0));
    for (tick, temperature, fan) in [(1, 290, 0), (2, 301, 1), (3, 299, 0)] {
        let poll = executive.present(0).expect("there is a poll");
        let outputs = [i64::from(temperature > 300), temperature, 1];
        executive
            .report(poll, &outputs, true, tick)
            .expect("it ends after a tick");
        assert!(matches!(executive.cycle(tick, 10_000), Verdict::Solved));
        let fans = ("DeviceSetFanState".to_owned(), vec![Some(fan)], tick);
        assert_eq!(said(&executive, 1), fans);
        assert_eq!(said(&executive, 0).2, tick);
    }
    // No value comes: the poll ends by its time, and the rule's guard stays undecided.
    assert!(matches!(executive.cycle(4, 10_000), Verdict::Solved));
    assert_eq!(said(&executive, 1).2, 3);
    assert_eq!(said(&executive, 0).2, 4);
    assert!(
        executive.database().len() <= 4,
        "{}",
        executive.database().len()
    );
}

fn project(name: &str, bytes: &[u8]) -> (Arc<Model>, Arc<Problem>) {
    let read = crate::sch::read(name, bytes);
    let (model, problem) = read.unwrap_or_else(|error| panic!("{name}: {error}"));
    (Arc::new(model), Arc::new(problem))
}

/// EUROPA's own example: 45 is proven to be the least makespan, by EUROPA and by CP-SAT.
#[test]
fn psp2_takes_45_ticks_and_no_less() {
    let (model, problem) = project("psp2.sch", include_bytes!("../../models/psp2.sch"));
    let settings = Settings {
        operations: 1_000_000,
        seed: 1,
    };
    let planners: [&dyn Planner; 2] = [&Forward, &Repair::default()];
    for planner in planners {
        let answer = planner.solve(&model, &problem, settings).expect("it loads");
        let plan = answer.plan.expect("there is a plan");
        assert_eq!((planner.name(), plan.makespan), (planner.name(), 45));
        let violations = checker::check(&model, &problem, &plan);
        assert!(violations.is_empty(), "{}: {violations:#?}", planner.name());
    }
    let answer = Forward.solve(&model, &problem, settings).expect("it loads");
    assert!(answer.proven, "{} operations", answer.operations);
}

/// CP-SAT's answers for the generated instances: of 10 activities the complete search decides each
/// as it does, and to the same makespan.
#[test]
fn small_projects_are_decided_as_cp_sat_decides_them() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/models/rcpsp_max");
    let answers = std::fs::read_to_string(format!("{folder}/answers.csv")).expect("it is there");
    let mut decided = 0;
    for line in answers.lines().skip(1) {
        let fields: Vec<&str> = line.split(',').collect();
        let (name, activities, feasible) = (fields[0], fields[1], fields[2] == "1");
        if activities != "10" {
            continue;
        }
        let bytes = std::fs::read(format!("{folder}/{name}")).expect("it is there");
        let (model, problem) = project(name, &bytes);
        let settings = Settings {
            operations: 1_000_000,
            seed: 1,
        };
        let least = match Forward.solve(&model, &problem, settings) {
            // What is the case is nothing here, so goals alone cannot be.
            Err(_) => None,
            Ok(answer) => {
                assert!(answer.proven, "{name}: {} operations", answer.operations);
                if let Some(plan) = &answer.plan {
                    let violations = checker::check(&model, &problem, plan);
                    assert!(violations.is_empty(), "{name}: {violations:#?}");
                }
                answer.plan.map(|plan| plan.makespan.to_string())
            }
        };
        let expected = feasible.then(|| fields[3].to_owned());
        assert_eq!((name, least), (name, expected));
        decided += 1;
    }
    assert_eq!(decided, 30);
}

/// The complete planner proves what it can in its part of the operations; else repair has the rest.
#[test]
fn one_planner_proves_and_else_the_other_repairs() {
    let (model, problem) = project("psp2.sch", include_bytes!("../../models/psp2.sch"));
    let solve = |operations| {
        let settings = Settings {
            operations,
            seed: 1,
        };
        let answer = Both::default().solve(&model, &problem, settings);
        let answer = answer.expect("it loads");
        assert!(answer.operations <= operations + operations / 4);
        let plan = answer.plan.expect("there is a plan");
        assert!(checker::check(&model, &problem, &plan).is_empty());
        (plan.planner, plan.makespan, answer.proven)
    };
    assert_eq!(solve(1_000_000), ("forward".to_owned(), 45, true));
    let (_, makespan, proven) = solve(40_000);
    assert!(makespan >= 45 && !proven);
}

#[test]
fn a_problem_without_goals_has_the_empty_plan() {
    let (model, _) = rover();
    let problem = Arc::new(Problem {
        horizon: 0,
        ..Problem::default()
    });
    let settings = Settings {
        operations: 10_000,
        seed: 1,
    };
    let planners: [&dyn Planner; 3] = [&Forward, &Repair::default(), &Both::default()];
    for planner in planners {
        let answer = planner.solve(&model, &problem, settings).expect("it loads");
        assert_eq!(answer.plan.map(|plan| plan.tokens.len()), Some(0));
    }
    let answer = Both::default().solve(&model, &problem, settings);
    let answer = answer.expect("it loads");
    assert!(answer.proven && answer.operations < 1_000);
}

/// A goal that leaves itself no time is left out by name, and the others are planned.
#[test]
fn a_goal_that_cannot_be_of_itself_is_left_out() {
    let (model, mut problem) = rover();
    // The language would refuse it: a program's problem need not come from a text.
    let changed = Arc::make_mut(&mut problem);
    let mut never = changed.goals[2].clone();
    "never".clone_into(&mut never.name);
    never.weight = Some(50.0);
    never.start = Span::new(10, 20);
    never.finish = Span::new(100, 110);
    never.duration = Span::new(5, 10);
    changed.goals.push(never);
    let settings = Settings {
        operations: 500_000,
        seed: 1,
    };
    let planners: [&dyn Planner; 2] = [&Forward, &Repair::default()];
    for planner in planners {
        let answer = planner
            .solve(&model, &problem, settings)
            .expect("it need not be");
        let plan = answer.plan.expect("there is one");
        assert!(checker::check(&model, &problem, &plan).is_empty());
        let left = plan.left_out.iter().find(|at| at.goal == "never");
        let left = left.unwrap_or_else(|| panic!("{}", planner.name()));
        assert_eq!(left.reason, "what it says of times and values cannot be");
        assert!(plan.achieved.len() >= 3, "{}", planner.name());
    }
}

/// A parameter has more values than are tried, and the only one that will do is not among them:
/// that there is no plan is not called proven.
#[test]
fn values_that_were_not_tried_prove_nothing() {
    let model = "
        (Define_Object_Class Rover :state_variables ((Free Work_SV)))
        (Define_Type Size [0 1000])
        (Define_Predicate Dig ((Size ?depth)))
        (Define_Member_Values (Rover Work_SV) (Dig))
        (Define_Compatibility (SINGLE ((Rover Work_SV) ((Dig (?depth)))))
         :parameter_functions (remainder (?depth 997 ?rest) exceeds (?rest 995 ?fits))
         :constraints (= ?fits True))";
    let problem = "(Define_Problem day :horizon [0 100])
        (Goal one (SINGLE ((Rover Work_SV) ((Dig (?depth))))) :mandatory)";
    let (model, problem) = read(("m.ddl", model), ("p.ddl", problem));
    let settings = Settings {
        operations: 100_000,
        seed: 1,
    };
    let answer = Forward.solve(&model, &problem, settings).expect("it loads");
    assert!(answer.plan.is_none() && !answer.proven);
}
