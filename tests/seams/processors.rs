//! Processors that become slower: in the log, in the digest, in what `diff` and `info` say.

use std::path::Path;

use farside::encoding::Schema;
use farside::prelude::*;
use farside::record::RecordClass;
use farside_actors::processor::ProcessorChange;
use farside_experiments::registry::Registry;
use farside_experiments::scenario::Scenario;
use farside_logs::{DiffOptions, Log, LogOptions, LogWriter, diff, info};

/// The slowdown of one node, from 5 s to 8 s, that the tests are about.
const SLOW: &str = "degrade=[{ at = '5s', until = '8s', processors = 'node_07', slowdown = 50 }]";

fn assemble(sets: &[&str]) -> Result<farside_experiments::scenario::Assembled, String> {
    let sets = ["until=12s", "team.rovers=20"].iter().chain(sets);
    let sets: Vec<String> = sets.map(|set| (*set).to_owned()).collect();
    let scenario = Scenario::open("network/crater-dense", &sets, &Registry::builtin());
    let assembled = scenario.and_then(|scenario| scenario.assemble());
    assembled.map_err(|error| error.to_string())
}

fn run(sets: &[&str], executor: Executor, log: Option<&Path>) -> Report {
    let mut sim = assemble(sets).expect("it can be assembled").sim;
    if let Some(path) = log {
        sim.observe(LogWriter::create(path, LogOptions::default()).expect("a log"));
    }
    sim.run(executor).expect("it can start")
}

#[test]
fn both_ends_of_a_slowdown_are_recorded_and_part_of_the_digest() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("slow.mcap");
    let slow = run(&[SLOW], Executor::Inline, Some(&path));
    assert_eq!(slow, run(&[SLOW], Executor::Kameo { threads: 2 }, None));
    let schema = Schema::of::<ProcessorChange>().expect("it can be described");
    let mut told = Vec::new();
    let mut records = Log::open(&path)
        .and_then(|log| log.records())
        .expect("a log");
    while let Some((record, channel)) = records.next_ref().expect("it is whole") {
        if record.class == RecordClass::Told {
            assert_eq!(channel.topic, "/event/told/processor_change");
            let change: ProcessorChange = schema.decode(record.body).expect("a change");
            assert_eq!(change.processor, "node_07/planner");
            told.push((record.key.time_ns / 1_000_000_000, change.slowdown));
        }
    }
    assert_eq!(told, [(5, 50.0), (8, 1.0)]);
    // What does not slow anything down is recorded all the same.
    let healthy = run(&[], Executor::Inline, None);
    let told = run(&[&SLOW.replace("50", "1.5")], Executor::Inline, None);
    assert_ne!(slow.digest, healthy.digest);
    assert_ne!(told.digest, healthy.digest);
}

#[test]
fn info_shows_it_at_its_time_and_diff_names_it_first() {
    let folder = tempfile::tempdir().expect("a folder");
    let [healthy, slow] = ["healthy", "slow"].map(|name| folder.path().join(name));
    run(&[], Executor::Inline, Some(&healthy));
    run(&[SLOW], Executor::Inline, Some(&slow));
    let text = info(&slow).expect("a log").to_string();
    for line in [
        "5.000 s: told node_07: ProcessorChange {processor: node_07/planner, slowdown: 50}",
        "8.000 s: told node_07: ProcessorChange {processor: node_07/planner, slowdown: 1}",
    ] {
        assert!(text.contains(line), "{text}");
    }
    assert_eq!(info(&healthy).expect("a log").control_events, 0);
    let report = diff(&healthy, &slow, &DiffOptions::default()).expect("comparable");
    let first = report.first.expect("they differ");
    assert_eq!(
        (first.topic.as_str(), first.time_s),
        ("/event/told/processor_change", 5.0)
    );
}

#[test]
fn planning_is_late_where_the_processor_is_slow() {
    // Over all nodes and from the start, so that nothing is planned: as with a slower processor.
    let slow = ["degrade=[{ at = '0s', processors = '*/planner', slowdown = 100 }]"];
    let slower = ["network.max_plus.processor=4k/s"];
    let counts = |sets: &[&str]| run(sets, Executor::Inline, None).counts;
    let (degraded, configured) = (counts(&slow), counts(&slower));
    assert_eq!(degraded.sent, configured.sent);
    assert_ne!(degraded.sent, counts(&[]).sent);
}

#[test]
fn mistakes_are_told_with_their_place_and_the_nearest_name() {
    let refused = |entry: &str| {
        let set = format!("degrade=[{{ at = '5s', {entry} }}]");
        assemble(&[&set]).map(|_| ()).expect_err(entry)
    };
    let says = |entry: &str, parts: &[&str]| {
        let error = refused(entry);
        assert!(
            parts.iter().all(|part| error.contains(part)),
            "{entry}: {error}"
        );
    };
    let none = "matches no processor; did you mean";
    says(
        "processors = 'nod_07', slowdown = 50",
        &["degrade.0.processors", none, "\"node_07\"?"],
    );
    says(
        "processors = 'node_07/planer', slowdown = 50",
        &[none, "\"node_07/planner\"?"],
    );
    says(
        "processors = 'rover_*/*', slowdown = 50",
        &[none, "\"node_*/planner\"?"],
    );
    let range = "expected a factor above 0";
    for bad in ["0", "-2", "nan", "0.0"] {
        let entry = format!("processors = 'node_07', slowdown = {bad}");
        says(&entry, &["degrade.0.slowdown", range]);
    }
    says(
        "slowdown = 50",
        &["degrade.0", "the key `processors` is missing"],
    );
    says(
        "processors = '*'",
        &["degrade.0", "the key `slowdown` is missing"],
    );
    let either = "expected either links and their parameters, or processors and slowdown";
    for (entry, key) in [
        ("processors = '*', slowdown = 2, loss = 0.5", "loss"),
        ("loss = 0.5, processors = '*', slowdown = 2", "processors"),
        ("links = '*', slowdown = 2", "slowdown"),
        ("processors = '*', links = '*', slowdown = 2", "links"),
    ] {
        says(entry, &[&format!("degrade.0.{key}"), either]);
    }
    // Nothing is slow that takes no time.
    let unlimited = assemble(&["network.max_plus.processor=unlimited", SLOW]);
    let remarks = unlimited.expect("it has no effect").remarks;
    assert!(
        remarks.iter().any(|remark| remark.contains("unlimited")),
        "{remarks:?}"
    );
    let traffic = "degrade=[{ at = '5s', processors = '*', slowdown = 2 }]".to_owned();
    let scenario = Scenario::open("traffic/contact-plan", &[traffic], &Registry::builtin());
    let error = scenario.and_then(|scenario| scenario.assemble().map(|_| ()));
    let error = error.expect_err("it has no processors").to_string();
    assert!(
        error.contains("matches no processor: this system has none"),
        "{error}"
    );
}
