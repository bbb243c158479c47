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

/// When a message was delivered [s], and its content.
fn bodies(folder: &Path, topic: &str) -> Vec<(f64, Value)> {
    let records = cat(folder, topic).into_iter();
    records
        .map(|(at_s, data)| (at_s, data["body"].clone()))
        .collect()
}

#[test]
fn rovers_on_tours_drive_for_as_long_as_their_commands_ran() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    run(
        at,
        &[
            "misus/learn",
            "--until",
            "6h",
            "--set",
            "log.exclude=[]",
            "--set",
            "crash=[{ actor = 'rover_03', at = '3h', restart = '4h' }]",
        ],
    );
    let given = bodies(at, "/rover_02/rover_command");
    let reports = bodies(at, "/rover_02/hardware/command_report");
    let end_s = 6.0 * 3600.0;
    let ran_s = |kind: &str| -> f64 {
        let of_kind = given
            .iter()
            .filter(|(_, body)| body["command"].get(kind).is_some());
        let each = of_kind.map(|(given_s, body)| {
            let ended = reports
                .iter()
                .find(|(_, report)| report["id"] == body["id"]);
            ended.map_or(end_s, |(ended_s, _)| *ended_s) - given_s
        });
        each.sum()
    };
    let story = why(at, &["rover_02"]);
    assert_whole(&story);
    for (kind, says) in [
        ("drive", "drives to"),
        ("image", "takes an image"),
        ("spectrum", "takes a spectrum"),
    ] {
        let (told_s, ran_s) = (spent(&story, "active", says), ran_s(kind));
        assert!(
            ran_s > 60.0 && near(told_s, ran_s),
            "{kind}: {told_s} {ran_s}"
        );
    }
    assert_eq!(why(at, &["rover_02/hardware"])["account"], story["account"]);
    // The others do not stop while one is down.
    assert_eq!(spent(&story, "down", ""), 0.0);
    let down = why(at, &["rover_03"]);
    assert_whole(&down);
    assert!(near(spent(&down, "down", "is down"), 3600.0), "{down}");
}

#[test]
fn planners_wait_for_whose_plans_they_have_not_heard_of() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    run(
        at,
        &[
            "misus/planners",
            "--set",
            "log.exclude=[]",
            "--set",
            "links.\"rover_03-rover_02\".latency='9s'",
        ],
    );
    let begun = cat(at, "/timer/rover_02/step_begins");
    let made = cat(at, "/state/rover_02/planner_step");
    assert_eq!((begun.len(), made.len()), (20, 20));
    let planned_s: f64 = begun
        .iter()
        .zip(&made)
        .map(|(from, to)| to.0 - from.0)
        .sum();
    let story = why(at, &["rover_02"]);
    assert_whole(&story);
    let told_s = spent(&story, "active", "makes step");
    assert!(
        planned_s > 0.5 && near(told_s, planned_s),
        "{told_s} {planned_s}"
    );
    // For each of the others: from the end of a step of its own until it hears that theirs is made.
    let waited_for_s = |other: &str| -> f64 {
        let phases = story["account"].as_array().unwrap().iter();
        let waits = phases.filter(|phase| {
            let waits_for = phase["waits_for"].as_array().unwrap();
            waits_for.contains(&Value::from(other))
        });
        let each = waits
            .map(|phase| phase["until_s"].as_f64().unwrap() - phase["from_s"].as_f64().unwrap());
        each.sum()
    };
    let heard_late_s = |other: &str| -> f64 {
        let held = cat(at, &format!("/{other}/plan_held"));
        let to_it = held
            .iter()
            .filter(|(_, data)| data["receiver"] == "rover_02");
        let heard: Vec<(f64, u64)> = to_it
            .map(|(at_s, data)| (*at_s, data["body"]["steps"].as_u64().unwrap()))
            .collect();
        let each = made.iter().map(|(made_s, step)| {
            let steps = step["steps"].as_u64().unwrap();
            let first = heard.iter().find(|(_, theirs)| *theirs >= steps);
            (first.unwrap_or_else(|| panic!("step {steps}")).0 - made_s).max(0.0)
        });
        each.sum()
    };
    for (other, least_s) in [("rover_01", 0.5), ("rover_03", 170.0)] {
        let (told_s, heard_s) = (waited_for_s(other), heard_late_s(other));
        assert!(
            heard_s > least_s && near(told_s, heard_s),
            "{other}: {told_s} {heard_s}"
        );
    }
}
