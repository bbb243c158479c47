//! The layouts in `docs/layouts` name what is in a log of the run without arguments: topics, and
//! fields that are plotted. The script for Rerun makes a recording of it, where Rerun is installed.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use farside_network::messages::NodeState;
use serde_json::Value;

use crate::common::{farside, json, skip, text};

fn layouts() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/layouts")
}

/// A log as `farside run` writes it, though of the first seconds alone; and each topic's schema.
fn logged(folder: &Path) -> BTreeMap<String, String> {
    let run = farside(folder, &["run", "--until", "8s", "--out", "run.mcap"]);
    assert_eq!(run.status.code(), Some(0), "{}", text(&run.stderr));
    let info = json(&farside(folder, &["info", "run.mcap", "--json"]));
    let topics = info["topics"].as_array().expect("topics");
    let field = |topic: &Value, name: &str| topic[name].as_str().unwrap_or_default().to_owned();
    let topics = topics
        .iter()
        .map(|topic| (field(topic, "topic"), field(topic, "schema")));
    topics.collect()
}

/// The panels that a layout's tree shows.
fn shown(tree: &Value, panels: &mut BTreeSet<String>) {
    if let Some(panel) = tree.as_str() {
        assert!(panels.insert(panel.to_owned()), "{panel} is shown twice");
        return;
    }
    assert!(
        matches!(tree["direction"].as_str(), Some("row" | "column")),
        "{tree}"
    );
    let share = tree["splitPercentage"].as_f64();
    assert!(
        share.is_some_and(|share| share > 0.0 && share < 100.0),
        "{tree}"
    );
    shown(&tree["first"], panels);
    shown(&tree["second"], panels);
}

/// The fields that a node's state samples have.
fn fields() -> Vec<String> {
    let sample = NodeState {
        cycle: 0,
        rovers: 0,
        iterations: 0,
        forced_stops: 0,
        confirmed_deadlocks: 0,
        deadlock: Vec::new(),
        pairs: 0,
        load: 0,
        handed: 0,
        late: false,
    };
    let sample = serde_json::to_value(sample).expect("it is logged by serde too");
    sample
        .as_object()
        .expect("fields")
        .keys()
        .cloned()
        .collect()
}

#[test]
fn the_layout_names_topics_and_fields_that_a_log_has() {
    let folder = tempfile::tempdir().unwrap();
    let topics = logged(folder.path());
    let layout = std::fs::read(layouts().join("lichtblick.json")).expect("the layout");
    let layout: Value = serde_json::from_slice(&layout).expect("it is JSON");
    // What Lichtblick writes at "Export": all of it, and nothing else.
    let parts: BTreeSet<&str> = layout
        .as_object()
        .unwrap()
        .keys()
        .map(String::as_str)
        .collect();
    let all = [
        "configById",
        "globalVariables",
        "layout",
        "playbackConfig",
        "userNodes",
    ];
    assert_eq!(parts, BTreeSet::from(all));
    let panels = layout["configById"].as_object().unwrap();
    let mut tree = BTreeSet::new();
    shown(&layout["layout"], &mut tree);
    assert_eq!(tree, panels.keys().cloned().collect());
    let mut kinds = BTreeSet::new();
    for (name, panel) in panels {
        let (kind, id) = name.split_once('!').expect("a panel's name is kind!id");
        assert!(
            id.chars().all(|letter| letter.is_ascii_alphanumeric()),
            "{name}"
        );
        kinds.insert(kind);
        match kind {
            "3D" => {
                for topic in panel["topics"].as_object().unwrap().keys() {
                    let schema = topics.get(topic);
                    let drawn = schema.is_some_and(|schema| schema.starts_with("foxglove."));
                    assert!(drawn, "{name}: {topic}: {schema:?}");
                }
                for layer in ["map", "nodes", "rovers"] {
                    assert_eq!(panel["topics"][format!("/scene/{layer}")]["visible"], true);
                }
            }
            "Plot" => {
                for path in panel["paths"].as_array().unwrap() {
                    let value = path["value"].as_str().unwrap();
                    let (topic, field) = value.split_once('.').expect("topic.field");
                    let schema = topics.get(topic).map(String::as_str);
                    assert_eq!(schema, Some("farside.msg.NodeState"), "{value}");
                    assert!(fields().iter().any(|known| known == field), "{value}");
                }
            }
            "RosOut" => {
                let topic = panel["topicToRender"].as_str().unwrap();
                assert_eq!(topics.get(topic).map(String::as_str), Some("foxglove.Log"));
            }
            other => panic!("{other}: nobody knows such a panel"),
        }
    }
    assert_eq!(
        kinds,
        BTreeSet::from(["3D", "Plot", "RosOut"]),
        "map, plots and events"
    );
}

/// Rerun takes the blueprint, and the recording has what the views ask for.
#[test]
fn the_script_for_rerun_makes_a_recording() {
    let packages = ["-c", "import rerun, mcap_protobuf"];
    let has = Command::new("python3").args(packages).output();
    if !has.is_ok_and(|output| output.status.success()) {
        return skip(
            "the_script_for_rerun_makes_a_recording",
            "no python3 with rerun-sdk, mcap and mcap-protobuf-support",
        );
    }
    let folder = tempfile::tempdir().unwrap();
    let topics = logged(folder.path());
    let script = layouts().join("rerun_view.py");
    let source = std::fs::read_to_string(&script).unwrap();
    let named = source
        .lines()
        .find(|line| line.starts_with("SCENE, FRAMES, EVENTS = "));
    let named = named.expect("the topics").split('"').skip(1).step_by(2);
    for topic in named {
        let below = |one: &String| one == topic || one.starts_with(&format!("{topic}/"));
        assert!(topics.keys().any(below), "{topic}");
    }
    let plots = source
        .lines()
        .find(|line| line.starts_with("PLOTS = ["))
        .expect("the plots");
    for plot in plots.split('(').skip(1) {
        let words: Vec<&str> = plot.split('"').skip(1).step_by(2).collect();
        assert_eq!(words[0], "NodeState");
        assert!(fields().iter().any(|known| known == words[1]), "{plot}");
    }
    let made = Command::new("python3")
        .arg(script)
        .args(["run.mcap", "--save", "run.rrd"])
        .current_dir(folder.path())
        .output()
        .expect("python runs");
    assert_eq!(made.status.code(), Some(0), "{}", text(&made.stderr));
    let recording = std::fs::metadata(folder.path().join("run.rrd")).expect("a recording");
    assert!(recording.len() > 100_000, "{}", recording.len());
}
