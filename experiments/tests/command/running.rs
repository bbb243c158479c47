//! Running a scenario: the table, the JSON document, interruptions, full disks.

use std::process::{Command, Stdio};

use serde_json::Value;

use crate::common::{farside, json, small, text};

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
