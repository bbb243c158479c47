//! `farside problem`: what a scenario's planners have to solve, for other programs.

use crate::common::{farside, json, text};

#[test]
fn a_problem_is_that_of_the_run_with_its_seed() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let set = ["--set", "problem.rocks_most=12"];
    let export = |more: &[&str]| {
        let words = [
            &["problem", "misus/planners", "--seed", "7"],
            &set[..],
            more,
        ]
        .concat();
        farside(folder, &words)
    };
    let printed = export(&[]);
    assert_eq!(printed.status.code(), Some(0), "{}", text(&printed.stderr));
    assert_eq!(export(&["--out", "-"]).stdout, printed.stdout);
    let said = export(&["--out", "p.json"]);
    assert_eq!(
        text(&said.stdout),
        "p.json: the problem of misus/planners, seed 7\n"
    );
    let written = std::fs::read(folder.join("p.json")).unwrap();
    assert_eq!(written, printed.stdout);
    // Once more, over what is there.
    assert_eq!(export(&["--out", "p.json"]).status.code(), Some(0));

    let problem: serde_json::Value = serde_json::from_slice(&written).unwrap();
    let run = ["run", "misus/planners", "--seed", "7", "--no-log", "--json"];
    let ran = json(&farside(folder, &[&run, &set[..]].concat()));
    let goals = problem["goals"].as_array().unwrap().len();
    assert_eq!(ran["metrics"]["goals_total"], goals);
    let name = problem["name"].as_str().unwrap();
    let check = ["check", "misus/planners", "--set", "seed=7"];
    let checked = farside(folder, &[&check, &set[..]].concat());
    let note = format!("# problem: {name}, {goals} goals");
    assert!(text(&checked.stdout).contains(&note), "{note}");
}

#[test]
fn what_has_no_problem_is_told_what_has_and_nothing_is_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let refused = |words: &[&str]| {
        let output = farside(folder, &[&["problem"], words].concat());
        assert_eq!((output.status.code(), text(&output.stdout)), (Some(2), ""));
        text(&output.stderr).to_owned()
    };
    let said = refused(&["network/crater-dense"]);
    assert!(
        said.contains("its system \"network\" has no problem to export")
            && said.contains("\n  misus-planning: rovers, observations")
            && said.contains("(misus/planners)"),
        "{said}"
    );
    let scenario = "system = 'misus-planning'\nuntil = '1sol'\n";
    for name in ["mine.toml", "notes.txt"] {
        std::fs::write(folder.join(name), scenario).unwrap();
    }
    let said = refused(&["mine.toml", "--out", "./mine.toml"]);
    assert!(said.contains("mine.toml"), "{said}");
    let said = refused(&["mine.toml", "--out", "notes.txt"]);
    assert!(
        said.contains("is there already and is no problem"),
        "{said}"
    );
    for name in ["mine.toml", "notes.txt"] {
        let kept = std::fs::read_to_string(folder.join(name)).unwrap();
        assert_eq!(kept, scenario);
    }
    let said = refused(&["mine.toml", "--set", "problem.rovers=0"]);
    assert!(
        said.contains("problem.rovers: 0: expected 1 to 50"),
        "{said}"
    );
}
