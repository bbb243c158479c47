//! `farside plan`: models, problems and plans as a user meets them.

use std::path::{Path, PathBuf};
use std::process::Output;

use serde_json::Value;

use crate::common::{farside, json, text};

/// A folder with the models that come with the crate.
fn folder() -> (tempfile::TempDir, PathBuf) {
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../actors/planning/models");
    let folder = tempfile::tempdir().unwrap();
    for name in [
        "figure-5.ddl",
        "psp2.sch",
        "rover.ddl",
        "rover-problem.ddl",
        "rover-too-much.ddl",
    ] {
        std::fs::copy(models.join(name), folder.path().join(name)).unwrap();
    }
    let at = folder.path().to_owned();
    (folder, at)
}

/// Runs `farside plan` and holds it to an exit code.
fn plan(at: &Path, arguments: &[&str], exit: i32) -> Output {
    let output = farside(at, &[&["plan"], arguments].concat());
    let said = format!("{}{}", text(&output.stdout), text(&output.stderr));
    assert_eq!(output.status.code(), Some(exit), "{arguments:?}: {said}");
    output
}

fn out(output: &Output) -> &str {
    text(&output.stdout)
}

#[test]
fn figure_5_as_printed_is_accepted_with_a_warning() {
    let (_folder, at) = folder();
    let output = plan(&at, &["check", "figure-5.ddl"], 0);
    let warning = "figure-5.ddl:4:2: warning: expected ) to close SINGLE, found :duration_bounds\n\
                   figure-5.ddl: 1 warning\n";
    assert_eq!(out(&output), warning);
    let output = plan(&at, &["check", "figure-5.ddl", "--strict"], 1);
    assert!(out(&output).contains("figure-5.ddl:4:2: error: "));
    let output = plan(&at, &["check", "figure-5.ddl", "--json"], 0);
    let read = json(&output);
    assert_eq!(
        (&read["valid"], &read["findings"][0]["line"]),
        (&Value::from(true), &Value::from(4))
    );
}

#[test]
fn the_normal_form_of_a_normal_form_is_the_same_bytes() {
    let (_folder, at) = folder();
    let once = plan(&at, &["format", "figure-5.ddl"], 0).stdout;
    plan(&at, &["format", "figure-5.ddl", "--check"], 1);
    plan(&at, &["format", "figure-5.ddl", "--write"], 0);
    assert_eq!(std::fs::read(at.join("figure-5.ddl")).unwrap(), once);
    assert_eq!(plan(&at, &["format", "figure-5.ddl"], 0).stdout, once);
    plan(&at, &["format", "figure-5.ddl", "--check"], 0);
    // Nothing is left beside it.
    assert_eq!(std::fs::read_dir(&at).unwrap().count(), 5);
    std::fs::write(at.join("open.ddl"), "(Define_Model a\n").unwrap();
    let output = plan(&at, &["format", "open.ddl"], 2);
    assert!(
        text(&output.stderr).contains("open.ddl:"),
        "{}",
        text(&output.stderr)
    );
}

#[test]
fn psp2_takes_45_ticks_and_a_shifted_start_is_a_violation() {
    let (_folder, at) = folder();
    let solved = json(&plan(
        &at,
        &["solve", "psp2.sch", "--out", "p.json", "--json"],
        0,
    ));
    assert_eq!(
        (&solved["makespan"], &solved["proven"]),
        (&Value::from(45), &Value::from(true))
    );
    assert_eq!(solved["feasible"], Value::from(true));
    let output = plan(&at, &["validate", "psp2.sch", "p.json"], 0);
    assert!(
        out(&output).contains("valid: 10 tokens"),
        "{}",
        out(&output)
    );
    // The one that starts first, a tick earlier than it may: or later, if it starts at once.
    let mut read: Value =
        serde_json::from_slice(&std::fs::read(at.join("p.json")).unwrap()).unwrap();
    let start = read["tokens"][4]["start"].as_i64().unwrap();
    read["tokens"][4]["start"] = Value::from(start + 1);
    std::fs::write(at.join("q.json"), read.to_string()).unwrap();
    let output = plan(&at, &["validate", "psp2.sch", "q.json"], 1);
    assert!(
        out(&output).contains("q.json: not valid: "),
        "{}",
        out(&output)
    );
    let violations = json(&plan(&at, &["validate", "psp2.sch", "q.json", "--json"], 1));
    assert_eq!(violations["valid"], Value::from(false));
    assert!(
        violations["violations"][0]["message"]
            .as_str()
            .unwrap()
            .len()
            > 10
    );
    // A repair finds as short a plan, and does not prove it.
    let solved = json(&plan(
        &at,
        &["solve", "psp2.sch", "--planner", "repair", "--json"],
        0,
    ));
    assert_eq!(
        (&solved["makespan"], &solved["planner"]),
        (&Value::from(45), &Value::from("repair"))
    );
}

#[test]
fn a_rover_at_the_wrong_place_gets_a_drive() {
    let (_folder, at) = folder();
    let task = [
        "solve",
        "rover.ddl",
        "rover-problem.ddl",
        "--out",
        "sol.json",
        "--ops",
        "100000",
    ];
    let output = plan(&at, &task, 0);
    assert!(
        out(&output).contains("Going(lander, rock_1) on rover_1.Position_SV"),
        "{}",
        out(&output)
    );
    let output = plan(
        &at,
        &["validate", "rover.ddl", "rover-problem.ddl", "sol.json"],
        0,
    );
    assert!(
        out(&output).contains("sol.json: valid: "),
        "{}",
        out(&output)
    );
    let first = std::fs::read(at.join("sol.json")).unwrap();
    plan(&at, &task, 0);
    assert_eq!(
        std::fs::read(at.join("sol.json")).unwrap(),
        first,
        "another plan"
    );
    plan(&at, &["draw", "sol.json", "--out", "sol.svg"], 0);
    let chart = std::fs::read_to_string(at.join("sol.svg")).unwrap();
    assert!(chart.contains("Going"), "the drive is not drawn");
    crate::ink::assert_readable("sol.svg", &chart);
}

#[test]
fn a_sol_that_is_too_full_is_explained_and_solves_without_what_is_named() {
    let (_folder, at) = folder();
    let task = ["solve", "rover.ddl", "rover-too-much.ddl"];
    let output = plan(&at, &[&task[..], &["--explain"]].concat(), 1);
    let said = out(&output);
    assert!(
        said.contains("(rover.ddl:") && said.contains("(rover-too-much.ddl:"),
        "{said}"
    );
    assert!(said.contains("there is a plan"), "{said}");
    let told = json(&plan(&at, &[&task[..], &["--json"]].concat(), 1));
    assert_ne!(told["feasible"], Value::from(true));
    let dropped = told["explanation"]["goals"].as_array().unwrap();
    assert_eq!(dropped.len(), 1, "{told}");
    let name = dropped[0].as_str().unwrap();
    let problem = std::fs::read_to_string(at.join("rover-too-much.ddl")).unwrap();
    let goal = format!("(Goal {name} ");
    let rest: Vec<&str> = problem
        .lines()
        .filter(|line| !line.starts_with(&goal))
        .collect();
    std::fs::write(at.join("less.ddl"), rest.join("\n")).unwrap();
    plan(
        &at,
        &["solve", "rover.ddl", "less.ddl", "--out", "less.json"],
        0,
    );
    plan(&at, &["validate", "rover.ddl", "less.ddl", "less.json"], 0);
}

#[test]
fn a_project_without_a_schedule_says_which_activities_stand_against_each_other() {
    let (_folder, at) = folder();
    // Both use all there is, and each must start before the other ends.
    let project = "2 1 0 0\n0 1 2 1 2 [0] [0]\n1 1 2 2 3 [1] [4]\n2 1 2 1 3 [-3] [5]\n3 1 0\n\
                   0 1 0 0\n1 1 4 2\n2 1 5 2\n3 1 0 0\n2\n";
    std::fs::write(at.join("two.sch"), project).unwrap();
    let output = plan(&at, &["solve", "two.sch", "--explain"], 1);
    let said = out(&output);
    for part in [
        "There is no plan with all mandatory goals: that is proven.",
        "These goals cannot all be: activity_1 (two.sch:7:1), activity_2 (two.sch:8:1).",
        "Without activity_2 (two.sch:8:1) there is a plan. No smaller set of goals will do",
    ] {
        assert!(said.contains(part), "{said}");
    }
    let told = json(&plan(&at, &["solve", "two.sch", "--json"], 1));
    assert_eq!(told["feasible"], Value::from(false));
    assert_eq!(told["explanation"]["smallest"], Value::from("proven"));
    assert_eq!(told["explanation"]["goals"][0], Value::from("activity_2"));
}

#[test]
fn wrong_input_is_named_with_its_place() {
    let (_folder, at) = folder();
    let slip = std::fs::read_to_string(at.join("rover.ddl")).unwrap();
    std::fs::write(
        at.join("slip.ddl"),
        slip.replacen("(Define_Predicate", "(Define_Predicat", 1),
    )
    .unwrap();
    std::fs::write(at.join("short.sch"), "2 1 0 0\n0 1 2 1\n").unwrap();
    std::fs::write(at.join("bytes.ddl"), b"(Define_Model a)\n\xff\xfe").unwrap();
    std::fs::write(
        at.join("plan.json"),
        "{ \"format\": \"farside-plan/1.0\", \"modell\": 1 }",
    )
    .unwrap();
    for (arguments, part) in [
        (
            &["solve", "slip.ddl", "rover-problem.ddl"][..],
            "the nearest is Define_Predicate",
        ),
        (
            &["solve", "rover.ddl"],
            "expected MODEL PROBLEM, or FILE.sch",
        ),
        (
            &["solve", "psp2.sch", "rover-problem.ddl"],
            "needs no problem",
        ),
        (&["solve", "short.sch"], "short.sch: line 2"),
        (&["solve", "nothing.sch"], "nothing.sch: cannot read it"),
        (&["check", "bytes.ddl"], "bytes.ddl:2: byte 1"),
        (
            &["validate", "psp2.sch", "plan.json"],
            "did you mean \"model\"?",
        ),
        (&["draw", "psp2.sch", "--out", "p.svg"], "psp2.sch: line 1"),
    ] {
        let output = plan(&at, arguments, 2);
        let said = text(&output.stderr);
        assert!(said.contains(part), "{arguments:?}: {said}");
        assert_eq!(out(&output), "");
    }
    let output = plan(&at, &["check", "slip.ddl"], 1);
    assert!(out(&output).contains("slip.ddl:"), "{}", out(&output));
}

#[test]
fn no_file_is_written_over_that_is_read_or_is_no_plan() {
    let (_folder, at) = folder();
    std::fs::hard_link(at.join("psp2.sch"), at.join("hard.json")).unwrap();
    std::fs::write(at.join("thesis.txt"), "all my work").unwrap();
    let project = std::fs::read(at.join("psp2.sch")).unwrap();
    for (to, part) in [
        ("psp2.sch", "is read by this command"),
        ("hard.json", "is read by this command"),
        ("thesis.txt", "is there already and is no plan"),
    ] {
        let output = plan(&at, &["solve", "psp2.sch", "--out", to], 2);
        assert!(
            text(&output.stderr).contains(part),
            "{}",
            text(&output.stderr)
        );
    }
    assert_eq!(std::fs::read(at.join("psp2.sch")).unwrap(), project);
    assert_eq!(
        std::fs::read(at.join("thesis.txt")).unwrap(),
        b"all my work"
    );
    for _ in 0..2 {
        plan(&at, &["solve", "psp2.sch", "--out", "p.json"], 0);
    }
    let output = plan(&at, &["draw", "p.json", "--out", "p.json"], 2);
    assert!(text(&output.stderr).contains("is read by this command"));
    plan(&at, &["draw", "p.json", "--out", "p.svg"], 0);
    plan(&at, &["draw", "p.json", "--out", "p.svg"], 0);
}
