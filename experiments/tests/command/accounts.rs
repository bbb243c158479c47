//! What `why` tells of actors of each system, beside what is counted from the log by another way.

use std::path::Path;

use serde_json::Value;

use crate::common::{farside, json, text};

fn run(folder: &Path, arguments: &[&str]) {
    let output = farside(folder, &[&["run"], arguments].concat());
    assert!(output.status.code() < Some(2), "{}", text(&output.stderr));
}

fn why(folder: &Path, arguments: &[&str]) -> Value {
    let output = farside(
        folder,
        &[&["why", "run.mcap", "--json"], arguments].concat(),
    );
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    json(&output)
}

/// The records of a topic: when, and what they say.
fn cat(folder: &Path, topic: &str) -> Vec<(f64, Value)> {
    let output = farside(folder, &["cat", "run.mcap", topic]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let lines = text(&output.stdout).lines();
    let each = lines.map(|line| {
        let message: Value = serde_json::from_str(line).unwrap();
        (
            message["log_time_ns"].as_f64().unwrap() / 1e9,
            message["data"].clone(),
        )
    });
    each.collect()
}

/// How long an actor does something, of which the text says this [s].
fn spent(story: &Value, doing: &str, says: &str) -> f64 {
    let phases = story["account"].as_array().unwrap().iter();
    let phases = phases
        .filter(|phase| phase["doing"] == doing && phase["text"].as_str().unwrap().contains(says));
    let long =
        |phase: &Value| phase["until_s"].as_f64().unwrap() - phase["from_s"].as_f64().unwrap();
    phases.map(long).sum()
}

/// An account has no gap and no overlap.
fn assert_whole(story: &Value) {
    let phases = story["account"].as_array().unwrap();
    assert_eq!(phases[0]["from_s"], 0.0, "{story}");
    for pair in phases.windows(2) {
        assert_eq!(pair[0]["until_s"], pair[1]["from_s"], "{pair:?}");
    }
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-6
}

#[test]
fn agents_wait_for_those_whom_they_have_asked() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let crash = "crash=[{ actor = 'system', at = '150s', restart = '170s' }]";
    run(
        at,
        &[
            "idea/k9",
            "--set",
            crash,
            "--until",
            "400s",
            "--set",
            "log.exclude=[]",
        ],
    );
    let mission = why(at, &["mission"]);
    assert_whole(&mission);
    // By what the timeline of goals says, record by record.
    let says = cat(at, "/state/mission/timeline_says");
    let goals: Vec<_> = says
        .iter()
        .filter(|(_, says)| says["timeline"] == "Goal_SV")
        .collect();
    let mut asked_s = 0.0;
    for (place, (from_s, says)) in goals.iter().enumerate() {
        let until_s = goals.get(place + 1).map_or(400.0, |(next_s, _)| *next_s);
        if says["says"] != "NoGoal" {
            asked_s += until_s - from_s;
        }
    }
    let waited_s = spent(&mission, "waiting", "has asked system");
    assert!(
        asked_s > 100.0 && near(waited_s, asked_s),
        "{waited_s} {asked_s}"
    );
    let phases = mission["account"].as_array().unwrap();
    let asked = phases
        .iter()
        .filter(|phase| phase["text"].as_str().unwrap().contains("has asked"));
    assert!(asked.clone().count() > 1);
    assert!(asked.clone().all(|phase| phase["waits_for"][0] == "system"));
    // The agent that it waits for was down.
    let system = why(at, &["system", "--try"]);
    assert_whole(&system);
    assert!(near(spent(&system, "down", "is down"), 20.0), "{system}");
    let tried = &system["tried"]["escapes"][0];
    assert!(
        tried["without"]
            .as_str()
            .unwrap()
            .starts_with("[[crash]] 1"),
        "{tried}"
    );
    assert_eq!(tried["is_other"], true, "{tried}");
    assert!(tried["less_idle_ns"].as_i64() > Some(0), "{tried}");
    assert_eq!(mission["crashes"].as_array().unwrap().len(), 1, "{mission}");
    // Alarms and faults stand where they were.
    let k9 = why(at, &["k9"]);
    assert_whole(&k9);
    let told = k9["account"].to_string();
    assert!(
        told.contains("rock under wheel: left at 60s") && told.contains("roll alarm"),
        "{told}"
    );
}

#[test]
fn rovers_of_a_survey_drive_observe_and_wait() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let degrade =
        "degrade=[{ at = '1000s', until = '9000s', links = 'lander-rover_02', loss = '100%' }]";
    run(
        at,
        &[
            "misus/mars-survey",
            "--until",
            "4h",
            "--set",
            degrade,
            "--set",
            "log.exclude=[]",
            "--set",
            "crash=[{ host = 'rover_02', at = '1200s', restart = '2000s' }]",
        ],
    );
    let story = why(at, &["planner_02"]);
    assert_whole(&story);
    let end_s = 4.0 * 3600.0;
    // From the records of activities alone: those that began and ended, and the one that was not over.
    let ended = cat(at, "/state/planner_02/activity_ended");
    let spans = ended.iter().map(|(ended_s, said)| {
        let began = said["began"].as_f64().unwrap_or_else(|| panic!("{said}")) / 1e9;
        (began, *ended_s, said["planned"]["activity"].to_string())
    });
    let spans: Vec<_> = spans.collect();
    let driven: f64 = spans
        .iter()
        .filter(|span| span.2.contains("drive"))
        .map(|span| span.1 - span.0)
        .sum();
    let open = cat(at, "/state/planner_02/activity_began");
    let last = open
        .last()
        .filter(|(began_s, _)| spans.iter().all(|span| (span.0 - began_s).abs() > 1e-9));
    let is_drive = |said: &Value| said["planned"]["activity"].to_string().contains("drive");
    let open_s = last
        .filter(|(_, said)| is_drive(said))
        .map_or(0.0, |(began_s, _)| end_s - began_s);
    let told_s = spent(&story, "active", "drives to");
    assert!(
        driven > 600.0 && near(told_s, driven + open_s),
        "{told_s} {driven} {open_s}"
    );
    // The hardware and the scientist of the rover fare alike.
    assert_eq!(why(at, &["rover_02"])["account"], story["account"]);
    assert_eq!(why(at, &["rover_02/hardware"])["account"], story["account"]);
    let touched = story["degrades"].as_array().unwrap();
    assert_eq!(touched.len(), 1, "{story}");
    assert!(
        touched[0]["text"]
            .as_str()
            .unwrap()
            .contains("lander-rover_02")
    );
    let tried = why(at, &["planner_02", "--try"]);
    let tried = tried["tried"]["escapes"].as_array().unwrap().clone();
    let without = |what: &str| {
        let mut tried = tried.iter();
        let found = tried.find(|one| one["without"].as_str().unwrap().starts_with(what));
        found.unwrap_or_else(|| panic!("{what}: {tried:?}"))
    };
    // Its leases outlive the silence; its computer's crash costs it the time of the crash.
    assert!(without("[[degrade]] 1")["is_other"].is_boolean());
    assert_eq!(without("[[crash]] 1")["is_other"], true);
    assert!(without("[[crash]] 1")["less_idle_ns"].as_i64() > Some(0));
    assert!(near(spent(&story, "down", "is down"), 800.0), "{story}");
    let centre = why(at, &["centre"]);
    assert_eq!(spent(&centre, "active", "shares goals out"), end_s);
}

#[test]
fn hosts_wait_where_nothing_comes_for_longer_than_it_should() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scenario = "system = 'traffic'\nuntil = '60s'\n[traffic]\nhosts = ['a', 'b', 'c']\n\
        flow = [{ from = 'a', to = 'b', size = '100B', period = '1s', stop = '40s' }]\n\
        [[degrade]]\nat = '10s'\nuntil = '20s'\nlinks = 'a-b'\nloss = 1.0\n\
        [[crash]]\nactor = 'b'\nat = '30s'\nrestart = '32s'\n";
    std::fs::write(at.join("s.toml"), scenario).unwrap();
    run(at, &["s.toml"]);
    let b = why(at, &["b", "--try", "--least", "0s"]);
    assert_whole(&b);
    // By the arrivals: whatever is longer than three periods.
    let arrivals: Vec<f64> = cat(at, "/a/datagram")
        .into_iter()
        .map(|(at_s, _)| at_s)
        .collect();
    let gaps = arrivals.windows(2).map(|pair| pair[1] - pair[0]);
    let silent: f64 = gaps.filter(|gap| *gap > 3.0 + 1e-9).sum();
    assert!(
        silent > 10.0 && near(spent(&b, "waiting", "hears nothing of a > b"), silent),
        "{b}"
    );
    assert_eq!(spent(&b, "down", "is down"), 2.0);
    assert_eq!(b["account"][1]["waits_for"][0], "a");
    let tried = b["tried"]["escapes"].as_array().unwrap();
    assert!(
        tried.iter().any(|one| {
            let without = one["without"].as_str().unwrap();
            without.starts_with("[[degrade]] 1")
                && one["less_idle_ns"].as_i64() > Some(10_000_000_000)
        }),
        "{b}"
    );
    assert!(
        tried
            .iter()
            .any(|one| one["without"].as_str().unwrap().starts_with("the loss of"))
    );
    let a = why(at, &["a"]);
    assert!(near(spent(&a, "active", "sends 1 flow"), 39.005), "{a}");
}
