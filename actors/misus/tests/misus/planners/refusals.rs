//! What cannot be is said, by key.

use super::scenario::Run;

fn check(text: &str, expected: &str) {
    let run = Run {
        text,
        ..Run::default()
    };
    let said = run.refused();
    assert!(said.contains(expected), "{text}: {said}");
}

#[test]
fn what_has_to_be_done_and_cannot_be_is_explained() {
    check(
        "problem = { communication_power = \"9000W\" }",
        "problem.communication_power: rover_01 cannot make its daily communication: it lacks",
    );
    check(
        "problem = { communication = \"2h\" }",
        "rover_01_communication_1",
    );
}

#[test]
fn bad_values_are_refused() {
    check("planner.choice = \"best\"", "unknown variant `best`");
    check(
        "planner.epsilon = 1.5",
        "planner.epsilon: 1.5: expected 0 to 1",
    );
    check("planner.epsilon = nan", "planner.epsilon: NaN");
    check(
        "planner.steps = 0",
        "planner.steps: 0: expected 1 to 100000",
    );
    check("rounds.every = \"0s\"", "rounds.every");
    check("rounds.processor = \"fast\"", "fast");
    check("lns.operations = 0", "lns.operations: 0");
    check("problem.rovers = 0", "problem.rovers: 0: expected 1 to 50");
    check(
        "problem.bounds = \"none.csv\"",
        "problem.bounds: ./none.csv: cannot read it",
    );
    check("team.rovers = 3", "unknown field `team`");
}

#[test]
fn a_run_needs_an_end() {
    let said = Run::default().tried(None).err().unwrap();
    assert!(said.starts_with("until: missing"), "{said}");
}
