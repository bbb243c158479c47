//! What a log says, for people and other programs: `cat`, `plot`, `why`, charts of `draw`, and which parts `diff`
//! compares.

use std::path::Path;

use serde_json::Value;

use crate::common::{farside, json, text};

const LATE: &str = "\
system = \"network\"
seed = 4
until = \"20s\"

[world]
roadmap = \"crater-dense\"
nodes = 28

[team]
rovers = 6

[[degrade]]
at = \"5s\"
until = \"15s\"
links = \"node_*-rover_01\"
loss = \"100%\"

[[crash]]
actor = \"node_0[1-9]\"
at = \"6s\"
restart = \"14s\"
";

/// A folder with the log of a run in which a rover hears nothing for a while.
fn logged() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("late.toml"), LATE).unwrap();
    let run = farside(folder.path(), &["run", "late.toml", "--out", "late.mcap"]);
    assert_eq!(run.status.code(), Some(0), "{}", text(&run.stderr));
    folder
}

#[track_caller]
fn done(folder: &Path, arguments: &[&str]) -> String {
    let output = farside(folder, arguments);
    assert_eq!(
        output.status.code(),
        Some(0),
        "{arguments:?}: {}",
        text(&output.stderr)
    );
    text(&output.stdout).to_owned()
}

#[track_caller]
fn refused(folder: &Path, arguments: &[&str], why: &str) {
    let output = farside(folder, arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    assert!(
        text(&output.stderr).contains(why),
        "{}",
        text(&output.stderr)
    );
}

#[test]
fn every_message_is_a_line() {
    let folder = logged();
    let folder = folder.path();
    let info = json(&farside(folder, &["info", "late.mcap", "--json"]));
    let topics = info["topics"].as_array().unwrap();
    let beacons = topics
        .iter()
        .find(|topic| topic["topic"] == "/rover_01/beacon")
        .unwrap();
    let lines = done(folder, &["cat", "late.mcap", "/rover_01/beacon"]);
    let lines: Vec<Value> = lines
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(lines.len() as u64, beacons["messages"].as_u64().unwrap());
    assert!(lines.iter().all(|line| line["topic"] == "/rover_01/beacon"));
    let table = done(folder, &["cat", "late.mcap", "/rover_01/beacon", "--csv"]);
    assert_eq!(table.lines().count(), lines.len() + 1);
    let early = done(
        folder,
        &["cat", "late.mcap", "/rover_01/beacon", "--at", "5s"],
    );
    assert!((1..lines.len()).contains(&early.lines().count()));
    refused(
        folder,
        &["cat", "late.mcap", "/rover_01/becon"],
        "did you mean \"/rover_01/beacon\"?",
    );
}

#[test]
fn fields_are_plotted_over_time() {
    let folder = logged();
    let folder = folder.path();
    let field = "/state/rover_0[1-3]/rover_state.transmit_energy_j";
    let output = farside(
        folder,
        &["plot", "late.mcap", field, "--out", "e.svg", "--json"],
    );
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let document = json(&output);
    let curves = document["curves"].as_array().unwrap();
    assert_eq!(curves.len(), 3);
    assert!(
        curves
            .iter()
            .all(|curve| curve["values"].as_u64().unwrap() > 1)
    );
    let svg = std::fs::read_to_string(folder.join("e.svg")).unwrap();
    roxmltree::Document::parse(&svg).unwrap();
    let sent = "/rover_01/beacon.sent_ns";
    done(
        folder,
        &[
            "plot",
            "late.mcap",
            sent,
            "--from",
            "2s",
            "--at",
            "9s",
            "--out",
            "s.svg",
        ],
    );
    for (field, why) in [
        ("/rover_01/beacon", "the field is missing"),
        (
            "/rover_1/beacon.sent_ns",
            "did you mean \"/rover_01/beacon\"?",
        ),
        ("/rover_01/beacon.sent", "no message has a number there"),
        ("/rover_01/beacon.sender", "no message has a number there"),
    ] {
        refused(folder, &["plot", "late.mcap", field, "--out", "n.svg"], why);
    }
    assert!(!folder.join("n.svg").exists());
}

#[test]
fn it_is_told_why_a_rover_waited() {
    let folder = logged();
    let folder = folder.path();
    let told = done(
        folder,
        &["why", "late.mcap", "rover_01", "--out", "why.svg"],
    );
    assert!(told.contains("lost on the way to it: "), "{told}");
    assert!(
        told.contains("[[degrade]] 1: links = \"node_*-rover_01\", loss = 1.0"),
        "{told}"
    );
    let svg = std::fs::read_to_string(folder.join("why.svg")).unwrap();
    roxmltree::Document::parse(&svg).unwrap();
    let document = json(&farside(
        folder,
        &["why", "late.mcap", "rover_01", "--try", "--json"],
    ));
    let phases = document["account"].as_array().unwrap();
    assert!(
        phases.is_sorted_by(|a, b| a["until_s"] == b["from_s"]),
        "{phases:?}"
    );
    let escapes = document["tried"]["escapes"].as_array().unwrap();
    let degrade = escapes.iter().find(|escape| {
        let without = escape["without"].as_str().unwrap();
        without.starts_with("[[degrade]] 1")
    });
    assert_eq!(degrade.unwrap()["is_other"], true);
    let node = done(folder, &["why", "late.mcap", "node_03"]);
    assert!(node.contains("     6.000 s     14.000 s  down "), "{node}");
    refused(
        folder,
        &["why", "late.mcap", "rover_1"],
        "did you mean \"rover_01\"?",
    );
    refused(
        folder,
        &["why", "late.mcap", "rover_01", "--at", "1h"],
        "the run ended at",
    );
}

#[test]
fn charts_are_of_what_is_asked_for() {
    let folder = logged();
    let folder = folder.path();
    let part = ["--from", "5s", "--at", "8s", "--actor", "rover_01"];
    for (language, file, lost) in [
        ("mermaid", "late-sequence.mmd", "-x"),
        ("plantuml", "late-sequence.puml", " ->x "),
    ] {
        done(
            folder,
            &[&["draw", "late.mcap", "--sequence", language], &part[..]].concat(),
        );
        let chart = std::fs::read_to_string(folder.join(file)).unwrap();
        assert!(
            chart.contains("rover_01") && chart.contains(lost),
            "{chart}"
        );
        assert!(!chart.contains("rover_02"), "{chart}");
    }
    let of = "node_06,rover_01,Grant,2";
    let told = farside(folder, &["draw", "late.mcap", "--causes", "--of", of]);
    let all = farside(
        folder,
        &["draw", "late.mcap", "--causes", "--out", "all.dot"],
    );
    assert_eq!(all.status.code(), Some(0));
    let graph = std::fs::read_to_string(folder.join("all.dot")).unwrap();
    assert!(graph.contains(" -> ") && graph.ends_with("}\n"));
    // Whether there is such a message, or which there are instead, is said.
    assert!(matches!(told.status.code(), Some(0 | 2)));
    let unknown = [
        "draw",
        "late.mcap",
        "--causes",
        "--of",
        "node_6,rover_01,Grant,2",
    ];
    refused(folder, &unknown, "did you mean");
    let nobody = [
        "draw",
        "late.mcap",
        "--sequence",
        "mermaid",
        "--actor",
        "rover_1",
    ];
    refused(folder, &nobody, "did you mean \"rover_01\"?");
    refused(
        folder,
        &["draw", "late.mcap", "--actor", "rover_01"],
        "--sequence and --causes",
    );
}

#[test]
fn some_topics_and_fields_are_compared() {
    let folder = logged();
    let folder = folder.path();
    let other = ["run", "late.toml", "--set", "seed=5", "--out", "other.mcap"];
    done(folder, &other);
    let files = ["diff", "late.mcap", "other.mcap", "--json"];
    let topic = farside(
        folder,
        &[&files[..], &["--topic", "/rover_01/beacon"]].concat(),
    );
    assert_eq!(topic.status.code(), Some(1));
    let document = json(&topic);
    let names: Vec<&str> = document["topics"]
        .as_array()
        .unwrap()
        .iter()
        .map(|topic| topic["topic"].as_str().unwrap())
        .collect();
    assert_eq!(names, ["/rover_01/beacon"]);
    refused(
        folder,
        &[&files[..3], &["--topic", "/rover_1/beacon"]].concat(),
        "/rover_01/beacon",
    );
    refused(
        folder,
        &[&files[..3], &["--ignore", "body.vertx"]].concat(),
        "body.vert",
    );
}
