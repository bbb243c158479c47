//! Maps on which rovers stay at their goals, where some once did not arrive.

use std::path::Path;

use farside::Executor;
use farside_actors::system::{Files, Results};
use farside_experiments::registry::Registry;
use farside_experiments::scenario::Scenario;

/// What comes of one of the scenarios with this policy and so many nodes.
fn run(name: &str, policy: &str, nodes: u32) -> Results {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("cases/maps");
    let file = format!("{name}.toml");
    let text = std::fs::read_to_string(folder.join(&file)).expect("it is there");
    let sets = [
        format!("world.nodes={nodes}"),
        format!("network.policy={policy}"),
    ];
    let files = Files::on_disk(folder);
    let scenario = Scenario::parse(&file, text, &sets, &Registry::builtin(), files);
    let assembled = scenario
        .and_then(|s| s.assemble())
        .expect("it is a scenario");
    let report = assembled.sim.run(Executor::Inline).expect("it runs");
    (assembled.system.conclude)(&report)
}

fn figure(results: &Results, name: &str) -> Option<u64> {
    results.metrics[name].as_u64()
}

#[test]
fn on_a_ring_with_somebody_on_it_the_other_way_round_is_found() {
    for nodes in 1..=12 {
        let results = run("ring10", "complete", nodes);
        let figures = ["arrived", "sum_of_costs", "makespan"].map(|name| figure(&results, name));
        let expected = [2, 33, 33].map(Some);
        assert_eq!(figures, expected, "{nodes} nodes");
    }
}

#[test]
fn chains_of_rovers_that_have_to_push_each_other_come_apart() {
    let cases = [
        ("push", 3, 7),
        ("tiny_555_0", 5, 21),
        ("tiny_555_19", 5, 25),
        ("tiny_666_18", 6, 23),
    ];
    for (name, rovers, least) in cases {
        for (policy, nodes) in [
            ("complete", 1),
            ("complete", 2),
            ("complete", 4),
            ("lacam", 2),
        ] {
            let results = run(name, policy, nodes);
            let what = format!("{name}, {policy}, {nodes} nodes");
            assert_eq!(figure(&results, "arrived"), Some(rovers), "{what}");
            let cost = figure(&results, "sum_of_costs").expect("all have arrived");
            assert!((least..=least * 3 / 2).contains(&cost), "{what}: {cost}");
        }
    }
}
