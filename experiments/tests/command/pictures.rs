//! `farside draw`: what it draws, and what it refuses.

use std::collections::BTreeMap;
use std::path::Path;

use farside::SimDuration;
use farside::encoding::Schema;
use farside_logs::Log;
use farside_network::NetworkConfig;
use farside_network::messages::RoverState;

use crate::common::{farside, json, text};
use crate::ink::assert_readable;

const CROWD: [&str; 9] = [
    "run",
    "--set",
    "team.rovers=60",
    "--set",
    "network.max_plus.max_iterations=1",
    "--until",
    "25s",
    "--out",
    "run.mcap",
];

/// Draws, and gives back the picture.
fn drawn(folder: &Path, more: &[&str]) -> String {
    let output = farside(
        folder,
        &[&["draw", "run.mcap", "--out", "p.svg"], more].concat(),
    );
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    std::fs::read_to_string(folder.join("p.svg")).unwrap()
}

/// Checks that every tag is closed, in order.
fn assert_well_formed(svg: &str) {
    let mut open = Vec::new();
    for part in svg.split('<').skip(1) {
        let (tag, after) = part.split_once('>').expect("a tag ends");
        assert!(!after.contains('>'), "{after}");
        match tag {
            tag if tag.starts_with('?') || tag.ends_with('/') => {}
            tag if tag.starts_with('/') => assert_eq!(open.pop(), Some(&tag[1..])),
            tag => open.push(tag.split([' ', '\n']).next().unwrap()),
        }
    }
    assert!(open.is_empty(), "{open:?}");
}

/// How many rovers are on the map at a time, by the log.
fn on_the_map(log: &Path, at_ns: u64) -> usize {
    let schema = Schema::of::<RoverState>().unwrap();
    let mut last = BTreeMap::new();
    for record in Log::open(log).unwrap().records().unwrap() {
        let record = record.unwrap();
        if record.topic.ends_with("/rover_state") && record.key.time_ns <= at_ns {
            let state: RoverState = schema.decode(&record.body).unwrap();
            last.insert(record.sender, state.whereabouts.vertex.is_some());
        }
    }
    last.values().filter(|on| **on).count()
}

#[test]
fn the_map_has_the_rovers_of_its_instant() {
    let folder = tempfile::tempdir().unwrap();
    let run = farside(folder.path(), &CROWD);
    assert!(
        run.status.code().is_some_and(|code| code < 2),
        "{}",
        text(&run.stderr)
    );
    for (at, at_ns) in [("0s", 0), ("6.7s", 6_700_000_000), ("20s", 20_000_000_000)] {
        let map = drawn(folder.path(), &["--at", at]);
        assert_well_formed(&map);
        let discs = map.matches("<circle class=\"rover disc").count();
        assert_eq!(
            discs,
            on_the_map(&folder.path().join("run.mcap"), at_ns),
            "{at}"
        );
    }
    let corridor = drawn(folder.path(), &["corridor", "--along", "auto"]);
    assert_well_formed(&corridor);
    assert_readable("map", &drawn(folder.path(), &[]));
    assert_readable("corridor", &corridor);
    assert!(corridor.contains("class=\"stand"));
    assert_eq!(
        drawn(folder.path(), &["corridor", "--along", "auto"]),
        corridor
    );
    let refused = |more: &[&str], says: &str| {
        let output = farside(folder.path(), &[&["draw", "run.mcap"], more].concat());
        assert_eq!(output.status.code(), Some(2));
        assert!(
            text(&output.stderr).contains(says),
            "{}",
            text(&output.stderr)
        );
    };
    refused(&["--at", "1h"], "the run ended at 25");
    refused(
        &["corridor", "--along", "99999"],
        "has no vertex 99999: expected 0 to",
    );
    refused(
        &["corridor", "--along", "a,b"],
        "expected auto, or vertices",
    );
    refused(&["corridor", "--along", "1,2,1"], "through vertex");
}

/// A cycle that is left to the links is as long in pictures as it was in the run.
#[test]
fn pictures_count_the_cycles_of_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let latency = SimDuration::from_secs(1);
    let run = [
        "run",
        "--set",
        "team.rovers=5",
        "--set",
        "links.default.latency=1s",
        "--until",
        "70s",
        "--out",
        "run.mcap",
        "--json",
    ];
    let metrics = &json(&farside(folder.path(), &run))["metrics"];
    let timing = NetworkConfig::default().timing(latency, None).unwrap();
    let (cycle_s, whole) = (
        timing.cycle.as_secs_f64(),
        70.0 / timing.cycle.as_secs_f64(),
    );
    assert!(whole > 3.0 && whole < 4.0, "{cycle_s}");
    assert_eq!(metrics["cycles"], 4, "{metrics}");
    let map = drawn(folder.path(), &[]);
    assert!(map.contains("Cycle 3."), "a cycle lasts {cycle_s} s");
}

/// What befell a run is in its corridor's picture: who was down, and what was worse, when.
#[test]
fn crashes_and_degradations_are_marked() {
    const STORM: &str = "system = 'network'\nseed = 3\nuntil = '160s'\n\
        team.rovers = 40\nnetwork.policy = 'complete'\nnetwork.failover_after = 3\n\
        links.default.loss = 0.02\n\
        [[degrade]]\nlinks = '*'\nat = '30s'\nuntil = '60s'\nloss = '40%'\n\
        [[degrade]]\nlinks = 'node_*-rover_*'\nat = '50s'\nuntil = '75s'\nlatency = '800ms'\n\
        [[crash]]\nactor = 'node_05'\nat = '40s'\nrestart_after = '20s'\n\
        [[crash]]\nactor = 'rover_07'\nat = '20s'\nrestart_after = '15s'\n\
        [[crash]]\nactor = 'rover_12'\nat = '45s'\nrestart_after = '10s'\n";
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("storm.toml"), STORM).unwrap();
    farside(folder.path(), &["run", "storm.toml", "--out", "run.mcap"]);
    let picture = drawn(folder.path(), &["corridor"]);
    for said in ["links *: loss 0.4</text>", "rover_07 is down</text>"] {
        assert!(picture.contains(said), "{said}");
    }
    assert_eq!(picture.matches("<rect class=\"worse\"").count(), 2);
    // The first is as wide as 30 s of the run are.
    let (_, rest) = picture.split_once("<rect class=\"worse\"").unwrap();
    let width = rest.split("width=\"").nth(1).unwrap();
    let width: f64 = width.split('"').next().unwrap().parse().unwrap();
    let axis = picture.split("width=\"").nth(1).unwrap();
    let axis: f64 = axis.split('"').next().unwrap().parse::<f64>().unwrap() - 86.0 - 210.0;
    let end_s = json(&farside(
        folder.path(),
        &["run", "storm.toml", "--no-log", "--json"],
    ));
    let end_s = end_s["sim_time_s"].as_f64().unwrap();
    assert!(
        (width / axis - 30.0 / end_s).abs() < 0.001,
        "{width} of {axis}, {end_s} s"
    );
    // Before it began there is none.
    let before = drawn(folder.path(), &["corridor", "--at", "9s"]);
    assert!(!before.contains("links *: loss") && !before.contains("is down"));
}

/// The coordination graph is there if asked for, and how far a metre is always.
#[test]
fn a_map_shows_what_it_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let run = [
        "run",
        "--set",
        "team.rovers=30",
        "--until",
        "10s",
        "--out",
        "run.mcap",
    ];
    farside(folder.path(), &run);
    let (plain, with) = (
        drawn(folder.path(), &[]),
        drawn(folder.path(), &["--with", "coordination"]),
    );
    assert!(!plain.contains("class=\"coordination") && with.contains("class=\"coordination"));
    assert!(plain.contains("class=\"scale\"") && plain.contains(" m</text>"));
    assert!(plain.contains("contours every 5 m"));
    let output = farside(
        folder.path(),
        &["draw", "run.mcap", "--with", "coordinaton"],
    );
    assert_eq!(output.status.code(), Some(2));
    let says = text(&output.stderr);
    assert!(says.contains("did you mean \"coordination\"?"), "{says}");
    let output = farside(
        folder.path(),
        &["draw", "run.mcap", "corridor", "--with", "x"],
    );
    assert!(text(&output.stderr).contains("does not take --with"));
}

/// What a picture is written as is said by the file's ending, and by --format.
#[test]
fn pictures_are_written_for_papers_and_slides() {
    let folder = tempfile::tempdir().unwrap();
    let run = [
        "run",
        "--set",
        "team.rovers=3",
        "--until",
        "5s",
        "--out",
        "run.mcap",
    ];
    farside(folder.path(), &run);
    let draw = |more: &[&str]| farside(folder.path(), &[&["draw", "run.mcap"], more].concat());
    let begins = |name: &str, with: &[u8]| {
        std::fs::read(folder.path().join(name)).is_ok_and(|bytes| bytes.starts_with(with))
    };
    if cfg!(feature = "export") {
        assert_eq!(draw(&["--out", "a.pdf"]).status.code(), Some(0));
        assert!(begins("a.pdf", b"%PDF-") && !folder.path().join("a.svg").exists());
        let json = json(&draw(&["--format", "pdf,png", "--json"]));
        let files = serde_json::json!(["run-map.svg", "run-map.pdf", "run-map.png"]);
        assert_eq!(json["files"], files);
        assert!(begins("run-map.png", b"\x89PNG") && begins("run-map.svg", b"<?xml"));
        // Not over what is something else.
        std::fs::write(folder.path().join("b.pdf"), "mine").unwrap();
        assert_eq!(draw(&["--out", "b.pdf"]).status.code(), Some(2));
    } else {
        for more in [["--out", "a.pdf"], ["--format", "png"]] {
            let output = draw(&more);
            assert_eq!(output.status.code(), Some(2));
            let says = text(&output.stderr);
            assert!(
                says.contains("--features farside-experiments/export"),
                "{says}"
            );
        }
    }
}

/// The circle that a run reports and the one that its pictures name are the same.
#[test]
fn a_run_and_its_pictures_name_the_same_circle() {
    let folder = tempfile::tempdir().unwrap();
    let run = [
        "run",
        "--set",
        "team.rovers=60",
        "--set",
        "network.max_plus.max_iterations=1",
        "--set",
        "network.livelock_window=60",
        "--until",
        "300s",
        "--out",
        "run.mcap",
        "--json",
    ];
    let metrics = &json(&farside(folder.path(), &run))["metrics"];
    assert!(metrics["stuck"] == true, "{metrics}");
    let circle = metrics["wait_cycles"][0].as_array().expect("a circle");
    let waiter = |waiter: &serde_json::Value| {
        let agent = waiter["agent"].as_str().unwrap();
        format!("{agent} at {}", waiter["at"])
    };
    let waiters: Vec<String> = circle.iter().map(waiter).collect();
    let (first, rest) = waiters.split_first().unwrap();
    let first_name = first.split(' ').next().unwrap();
    let named = format!(
        "{first} waits for {}, which waits for {first_name}.",
        rest.join(", which waits for ")
    );
    for more in [&[][..], &["corridor", "--along", "auto"]] {
        let picture = drawn(folder.path(), more);
        assert!(picture.contains(&named), "{named} is not in the picture");
    }
}

#[test]
fn what_cannot_be_drawn_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("no.mcap"), "no log").unwrap();
    let output = farside(folder.path(), &["draw", "no.mcap"]);
    assert_eq!(output.status.code(), Some(2));
    let run = [
        "run",
        "traffic/open-loop",
        "--until",
        "2s",
        "--out",
        "t.mcap",
    ];
    farside(folder.path(), &run);
    let output = farside(folder.path(), &["draw", "t.mcap"]);
    assert_eq!(output.status.code(), Some(2));
    let says = "its system \"traffic\" has no pictures";
    assert!(
        text(&output.stderr).contains(says),
        "{}",
        text(&output.stderr)
    );
}
