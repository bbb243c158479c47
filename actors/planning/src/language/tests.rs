//! Tests of the language as a whole.

use super::*;
use crate::model::*;
use crate::temporal::Span;

mod findings;
mod format;
mod hostile;
mod meaning;
mod proofs;
mod reference;
mod solved;

const FIGURE_5: &str = include_str!("../../models/figure-5.ddl");
const ROVER: &str = include_str!("../../models/rover.ddl");
const EXECUTIVE: &str = include_str!("../../models/executive.ddl");
const TOO_MUCH: &str = include_str!("../../models/rover-too-much.ddl");
const ROVER_PROBLEM: &str = include_str!("../../models/rover-problem.ddl");

/// The findings of a reading, one a line.
fn shown<T>(read: &Read<T>) -> String {
    let lines: Vec<String> = read.findings.iter().map(Finding::to_string).collect();
    lines.join("\n")
}

fn rover() -> Model {
    let read = read_model("rover.ddl", ROVER, &Options::default());
    assert_eq!(shown(&read), "");
    read.value.expect("it is right")
}

#[test]
fn figure_5_is_accepted_as_printed_with_one_warning() {
    let read = read_model("figure-5.ddl", FIGURE_5, &Options::default());
    assert_eq!(
        shown(&read),
        "figure-5.ddl:4:2: warning: expected ) to close SINGLE, found :duration_bounds"
    );
    let model = read.value.expect("it is accepted");
    let names: Vec<&str> = model
        .timelines
        .iter()
        .map(|timeline| &*timeline.name)
        .collect();
    assert_eq!(names, ["TempMeasure_SV", "Fans_SV"]);
    let rule = &model.rules[0];
    assert_eq!(rule.master.arguments[2], Argument::Value(1));
    assert_eq!(model.predicates[0].inputs, 0);
    assert_eq!(model.predicates[1].inputs, 1);
    let Body::All(parts) = &rule.body else {
        panic!("{:?}", rule.body)
    };
    let Body::Relation(relation) = &parts[0] else {
        panic!("{parts:?}")
    };
    assert_eq!((relation.kind, relation.anchor), (RelationKind::Meets, 0));

    let strict = Options {
        strict: true,
        ..Options::default()
    };
    let read = read_model("figure-5.ddl", FIGURE_5, &strict);
    assert_eq!(
        shown(&read),
        "figure-5.ddl:4:2: error: expected ) to close SINGLE, found :duration_bounds"
    );
    assert!(read.value.is_none());
}

#[test]
fn the_rover_and_its_problem_are_read() {
    let model = rover();
    let read = read_problem(
        "rover-problem.ddl",
        ROVER_PROBLEM,
        &model,
        &Options::default(),
    );
    assert_eq!(shown(&read), "");
    let problem = read.value.expect("it is right");
    assert_eq!(problem.goals.len(), 4);
    assert_eq!(problem.goals[3].name, "downlink_1");
    assert_eq!(problem.goals[3].start, Span::new(300, 400));
    let read = read_problem("rover-too-much.ddl", TOO_MUCH, &model, &Options::default());
    assert_eq!(shown(&read), "");
}

#[test]
fn the_executive_has_eleven_timelines_and_no_finding() {
    let read = read_model("executive.ddl", EXECUTIVE, &Options::default());
    assert_eq!(shown(&read), "");
    let model = read.value.expect("it is right");
    assert_eq!(
        (model.timelines.len(), model.profile),
        (11, Profile::Executive)
    );
}
