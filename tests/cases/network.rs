//! Teams over links that lose more than half: a pause is no deadlock, and none that arrives is
//! called one.

use std::path::{Path, PathBuf};

use farside::Executor;
use farside_actors::system::Files;
use farside_experiments::registry::Registry;
use farside_experiments::scenario::Scenario;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("cases/network")
}

type Metrics = serde_json::Map<String, serde_json::Value>;

/// What the case of this name gives with these keys set.
fn run(case: &str, sets: &[String]) -> Metrics {
    run_with(case, "", sets)
}

/// The same with more tables at its end.
fn run_with(case: &str, tables: &str, sets: &[String]) -> Metrics {
    let file = folder().join(case);
    let text = std::fs::read_to_string(&file).expect("the case is there") + tables;
    let files = Files::on_disk(folder());
    let scenario = Scenario::parse(case, text, sets, &Registry::builtin(), files);
    let scenario = scenario.expect("it is a scenario");
    let assembled = scenario.assemble().expect("it makes sense");
    let report = assembled.sim.run(Executor::Inline).expect("it starts");
    (assembled.system.conclude)(&report).metrics
}

/// Each case with its rovers, and when the last of them arrives \[s\].
const CASES: [(&str, u32, f64); 3] = [
    ("loss-60-mesh.toml", 5, 43.2),
    ("loss-60-seventeen.toml", 17, 126.2),
    ("loss-60-corridor.toml", 2, 62.3),
];

#[test]
fn every_file_is_tried() {
    let files = std::fs::read_dir(folder()).expect("the folder is there");
    let names = files.map(|file| file.expect("a file").file_name());
    let mut scenarios: Vec<_> = names.filter(|name| name != "README.md").collect();
    scenarios.sort();
    let mut tried = CASES.map(|(case, ..)| case);
    tried.sort_unstable();
    assert_eq!(scenarios, tried);
}

#[test]
fn late_and_lost_messages_are_no_deadlock() {
    for (case, rovers, last_s) in CASES {
        let metrics = run(case, &[]);
        assert_eq!(metrics["arrived"], rovers, "{case}");
        assert_eq!(metrics["deadlock"], "none", "{case}");
        assert_eq!(metrics["outcome"], "arrived", "{case}");
        let times = metrics["arrival_s"].as_array().expect("one for each");
        let latest = times
            .iter()
            .filter_map(|time| time.as_f64())
            .fold(0.0, f64::max);
        assert!((latest - last_s).abs() < 0.1, "{case}: {latest}");
    }
}

/// What the policy promises, as the user of a bad link sees it: from 40 to 80 % lost, and late.
#[test]
fn with_more_lost_and_late_all_arrive_too() {
    for (case, rovers, _) in CASES {
        for (loss, latency) in [(0.4, "2s"), (0.7, "5ms"), (0.7, "700ms"), (0.8, "50ms")] {
            for seed in 1..=5 {
                let sets = [
                    format!("links.default.loss={loss}"),
                    format!("links.default.latency={latency}"),
                    format!("seed={seed}"),
                ];
                let metrics = run(case, &sets);
                assert_eq!(metrics["arrived"], rovers, "{case} with {sets:?}");
                assert_eq!(metrics["deadlock"], "none", "{case} with {sets:?}");
            }
        }
    }
}

/// A node that is down for many windows, links that are closed for some: what is fixed to come is
/// waited for.
#[test]
fn what_is_fixed_to_come_is_waited_for() {
    for (case, rovers, _) in CASES {
        let down = "[[crash]]\nactor = 'node_*1'\nat = '10s'\nrestart_after = '900s'\n";
        let metrics = run_with(case, down, &["links.default.loss=0.2".to_owned()]);
        assert_eq!(metrics["arrived"], rovers, "{case} with a node down");
        let outage = "[[degrade]]\nlinks = '*'\nat = '10s'\nuntil = '110s'\nloss = 1\n";
        let metrics = run_with(case, outage, &[]);
        assert_eq!(metrics["arrived"], rovers, "{case} with links down");
        let times = metrics["arrival_s"].as_array().expect("one for each");
        assert!(
            times.iter().any(|time| time.as_f64() > Some(110.0)),
            "{case}"
        );
    }
}
