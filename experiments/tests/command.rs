//! The `farside` command as a user meets it: what it prints where, and how it exits.

use std::path::Path;
use std::process::{Command, Output, Stdio};

use serde_json::Value;

fn farside(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_farside"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("the binary runs")
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).expect("output is UTF-8")
}

/// Runs a small scenario; more arguments follow.
const SMALL: [&str; 5] = ["run", "--set", "team.rovers=5", "--until", "10s"];

fn small<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&SMALL, more].concat()
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).expect("stdout is one JSON document")
}

#[test]
fn a_run_ends_with_a_table_and_says_where_the_log_is() {
    let folder = tempfile::tempdir().unwrap();
    let output = farside(folder.path(), &small(&[]));
    assert_eq!(output.status.code(), Some(0));
    let table = text(&output.stdout);
    for part in [
        "network/crater-dense, seed 1",
        "team",
        "messages",
        "clock",
        "run.mcap",
    ] {
        assert!(table.contains(part), "{part} is not in\n{table}");
    }
    assert!(
        output.stderr.is_empty(),
        "no bar where there is no terminal"
    );
    assert!(folder.path().join("run.mcap").metadata().unwrap().len() > 1000);
}

#[test]
fn json_has_what_programs_are_promised_and_does_not_hang_on_how_it_runs() {
    let folder = tempfile::tempdir().unwrap();
    let one = json(&farside(
        folder.path(),
        &small(&["--json", "--executor", "inline"]),
    ));
    for key in [
        "scenario",
        "seed",
        "executor",
        "digest",
        "sim_time_s",
        "wall_s",
        "events",
    ] {
        assert!(!one[key].is_null(), "{key}");
    }
    for key in ["sent", "delivered", "lost", "duplicated", "lost_by_reason"] {
        assert!(!one["messages"][key].is_null(), "{key}");
    }
    assert_eq!(one["metrics"]["rovers"], 5);
    let threads = small(&["--json", "--no-log", "--threads", "3"]);
    let other = json(&farside(folder.path(), &threads));
    assert_eq!(one["digest"], other["digest"]);
    assert_eq!(other["log"], Value::Null);
    let seeded = json(&farside(
        folder.path(),
        &small(&["--json", "--no-log", "--seed", "9"]),
    ));
    assert_ne!(one["digest"], seeded["digest"]);
}

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
        (&["run", "--out", "no/such/folder/x.mcap"], "cannot create"),
        (&["run", "--until", "soon"], "expected a duration"),
        (&["run", "--threads", "0"], "1..=1024"),
        (&["run", "--seed", "-1"], "-1"),
        (&["check"], "SCENARIO"),
        (&["rnu"], "rnu"),
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
    assert_eq!(listed[1]["name"], "network/crater-sparse");
    let script = farside(folder.path(), &["completions", "bash"]);
    assert!(text(&script.stdout).contains("_farside"));
}

#[test]
fn a_reader_who_has_seen_enough_is_no_error() {
    let folder = tempfile::tempdir().unwrap();
    let mut child = Command::new(env!("CARGO_BIN_EXE_farside"))
        .args(small(&["--no-log"]))
        .current_dir(folder.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert!(output.stderr.is_empty(), "{}", text(&output.stderr));
}

#[test]
fn a_log_is_verified_by_running_it_again() {
    let folder = tempfile::tempdir().unwrap();
    let sets = [
        "--set",
        "links.default.duplicate=0.1",
        "--tie-seed",
        "3",
        "--seed",
        "5",
    ];
    let run = json(&farside(
        folder.path(),
        &small(&[&["--json"], &sets[..]].concat()),
    ));
    let verified = farside(folder.path(), &["verify", "run.mcap", "--json"]);
    assert_eq!(
        verified.status.code(),
        Some(0),
        "{}",
        text(&verified.stderr)
    );
    let verified = json(&verified);
    assert_eq!(verified["result"], "same");
    assert_eq!(verified["digest"], run["digest"]);
    let said = farside(
        folder.path(),
        &["verify", "run.mcap", "--executor", "inline"],
    );
    assert!(text(&said.stdout).starts_with("run.mcap: the same: "));
    let info = json(&farside(folder.path(), &["info", "run.mcap", "--json"]));
    assert_eq!(info["run"]["seed"], 5);
    assert_eq!(info["run"]["digest"], run["digest"]);
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

#[test]
fn what_is_no_log_of_ours_is_trouble() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("x.mcap"), "not an MCAP file").unwrap();
    std::fs::write(folder.path().join("empty.mcap"), "").unwrap();
    for command in ["verify", "info"] {
        for log in ["x.mcap", "empty.mcap", "missing.mcap", "."] {
            let output = farside(folder.path(), &[command, log]);
            assert_eq!(output.status.code(), Some(2), "{command} {log}");
            assert!(text(&output.stderr).starts_with("error: "));
        }
    }
}

#[test]
#[cfg(unix)]
fn an_interrupted_run_leaves_a_whole_log() {
    let folder = tempfile::tempdir().unwrap();
    let child = Command::new(env!("CARGO_BIN_EXE_farside"))
        // Far more than a second's work on any machine.
        .args(["run", "--set", "team.rovers=150", "--set", "world.nodes=14"])
        .current_dir(folder.path())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let log = folder.path().join("run.mcap");
    while !log.metadata().is_ok_and(|metadata| metadata.len() > 50_000) {
        std::thread::yield_now();
    }
    let process = child.id().to_string();
    let killed = Command::new("kill").args(["-TERM", &process]).status();
    assert!(killed.unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(3));
    assert!(text(&output.stdout).contains("interrupted at"));
    let info = json(&farside(folder.path(), &["info", "run.mcap", "--json"]));
    assert_eq!(info["run"]["end"], "interrupted");
    assert_eq!(info["missing"].as_array().map(Vec::len), Some(0));
    let verified = farside(folder.path(), &["verify", "run.mcap"]);
    assert_eq!(
        verified.status.code(),
        Some(0),
        "{}",
        text(&verified.stdout)
    );
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_fails_the_run_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let output = farside(folder.path(), &small(&["--out", "/dev/full", "--json"]));
    assert_eq!(output.status.code(), Some(3));
    assert_eq!(json(&output)["end"], "observer_failed");
    assert!(
        text(&output.stderr).contains("No space left"),
        "{}",
        text(&output.stderr)
    );
}
