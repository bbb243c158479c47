//! Scenarios: what is refused, what `check` prints, what is listed.

use crate::common::{farside, json, text};

#[test]
fn wrong_input_exits_with_2_and_writes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("latin.toml"), b"system = 'r\xe9seau'").unwrap();
    for (arguments, part) in [
        (
            &["run", "network/crater-dnse"][..],
            "did you mean \"network/crater-dense\"?",
        ),
        (&["run", "missing.toml"], "no such scenario or file"),
        (&["run", "."], "directory"),
        (&["run", "latin.toml"], "not UTF-8"),
        (&["run", "--set", "links.default.loss=1.5"], "from 0 to 1"),
        (
            &["run", "--set", "links.defualt.loss=1"],
            "did you mean \"default\"?",
        ),
        (&["run", "--until", "soon"], "expected a duration"),
        (&["run", "--threads", "0"], "1..=1024"),
        (&["run", "--seed", "-1"], "-1"),
        (&["check"], "SCENARIO"),
        (&["rnu"], "rnu"),
        (
            &["scenarios", "network/ruble"],
            "did you mean \"network/rubble\"?",
        ),
        (
            &["run", "degradation/loss"],
            "is a study, and a scenario is expected here\n  `farside study degradation/loss` runs it",
        ),
        (
            &["study", "network/rubble"],
            "is a scenario, and a study is expected here",
        ),
    ] {
        let output = farside(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(
            text(&output.stderr).contains(part),
            "{}",
            text(&output.stderr)
        );
        assert!(output.stdout.is_empty());
    }
    assert!(!folder.path().join("run.mcap").exists());
}

#[test]
fn a_checked_scenario_runs_the_same_from_its_file() {
    let folder = tempfile::tempdir().unwrap();
    let set = [
        "--set",
        "team.rovers=5",
        "--set",
        "links.rover_*-node_*.loss=30%",
    ];
    let checked = farside(
        folder.path(),
        &[&["check", "network/crater-sparse"], &set[..]].concat(),
    );
    assert_eq!(checked.status.code(), Some(0));
    std::fs::write(folder.path().join("mine.toml"), &checked.stdout).unwrap();
    let run = |scenario: &[&str]| {
        let rest = ["--until", "10s", "--json", "--no-log"];
        json(&farside(
            folder.path(),
            &[&["run"], scenario, &rest].concat(),
        ))
    };
    let built_in = run(&[&["network/crater-sparse"], &set[..]].concat());
    let mine = run(&["mine.toml"]);
    assert_eq!(built_in["digest"], mine["digest"]);
    assert_eq!(mine["scenario"], "mine");
}

#[test]
fn scenarios_and_completions_are_listed() {
    let folder = tempfile::tempdir().unwrap();
    let listed = farside(folder.path(), &["scenarios"]);
    assert!(text(&listed.stdout).contains("network/crater-dense   50 rovers"));
    let listed = json(&farside(folder.path(), &["scenarios", "--json"]));
    let names: Vec<&str> = listed
        .as_array()
        .unwrap()
        .iter()
        .filter_map(|s| s["name"].as_str())
        .collect();
    assert!(
        names.is_sorted() && names.contains(&"network/crater-radio"),
        "{names:?}"
    );
    let script = farside(folder.path(), &["completions", "bash"]);
    assert!(text(&script.stdout).contains("_farside"));
}

#[test]
fn a_roadmap_of_ones_own_travels_in_the_log() {
    let folder = tempfile::tempdir().unwrap();
    let map = "name = 'ring'\nboundary = [0, 2]\nedges = [[0, 1], [1, 2], [2, 3], [0, 3]]\n\
        positions_m = [[0, 0], [50, 0], [50, 50], [0, 50]]";
    std::fs::write(folder.path().join("ring.toml"), map).unwrap();
    let scenario = "system = 'network'\nuntil = '30s'\nworld.roadmap = 'ring.toml'\n\
        world.nodes = 2\nteam.rovers = 2";
    std::fs::write(folder.path().join("mine.toml"), scenario).unwrap();
    let run = farside(folder.path(), &["run", "mine.toml", "--json"]);
    assert_eq!(run.status.code(), Some(0), "{}", text(&run.stderr));
    std::fs::remove_file(folder.path().join("ring.toml")).unwrap();
    std::fs::remove_file(folder.path().join("mine.toml")).unwrap();
    let verified = farside(folder.path(), &["verify", "run.mcap"]);
    assert_eq!(
        verified.status.code(),
        Some(0),
        "{}",
        text(&verified.stderr)
    );
}

/// The table of keys in the docs of links, and what `explain` knows.
#[test]
fn every_key_of_links_and_its_other_names_are_explained() {
    let docs = include_str!("../../../actors/src/link.rs");
    let rows = docs.lines().filter_map(|line| line.strip_prefix("//! | `"));
    let folder = tempfile::tempdir().unwrap();
    let mut names = 0;
    for row in rows {
        let cells: Vec<&str> = row.split('|').collect();
        let key = cells[0].trim().trim_end_matches('`');
        let aliases = cells.get(1).into_iter().flat_map(|cell| cell.split(','));
        let aliases = aliases.map(|alias| alias.trim().trim_matches('`'));
        for name in aliases.chain([key]).filter(|name| !name.is_empty()) {
            names += 1;
            // A name alone may be that of a table, as `contacts` is.
            let alone = (name != key).then(|| name.to_owned());
            for asked in alone.into_iter().chain([format!("links.default.{name}")]) {
                let output = farside(folder.path(), &["explain", &asked]);
                let said = text(&output.stdout);
                let whole = format!("links.default.{key}\n");
                assert!(
                    said.contains(&whole),
                    "{asked}: {said}{}",
                    text(&output.stderr)
                );
            }
        }
    }
    assert!(names > 30, "{names}");
}

/// Each route is a search of its own: their number is bounded, and the bound is told.
#[test]
fn along_how_many_routes_a_path_is_looked_for_is_bounded() {
    let folder = tempfile::tempdir().unwrap();
    for (routes, code) in [("100", 0), ("101", 2), ("4294967295", 2), ("0", 2)] {
        let set = format!("network.complete.routes={routes}");
        let output = farside(folder.path(), &["check", "network/rubble", "--set", &set]);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{routes}: {said}");
        assert!(code == 0 || said.contains("routes"), "{said}");
    }
}
