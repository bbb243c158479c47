//! Digests as they are, and have to stay: the same in debug and release, on every machine, in every
//! later version of the code that does not say otherwise in its CHANGELOG.
//!
//! A toy model pins what the kernel does with noise, crashes and ties. Every built-in scenario is
//! pinned too, cut short, those of the network system with each of its policies: a scenario that is
//! not in `golden/scenarios.txt` fails the test. Whoever means to change a digest prints that file
//! anew, reads what is different, and says why in the CHANGELOG:
//!
//! ```text
//! cargo test -p farside-tests golden::print -- --ignored --nocapture | grep / > new.txt
//! mv new.txt tests/golden/scenarios.txt
//! ```

use std::fmt::Write as _;

use farside::Executor;
use farside_experiments::registry::Registry;
use farside_experiments::scenario::Scenario;
use farside_tests::chatter::Chatter;

/// Four hosts, noisy links with look-ahead.
fn noisy() -> Chatter {
    Chatter {
        seed: 7,
        tie_seed: None,
        hosts: vec![2, 1, 2, 1],
        min_delay_ns: 3,
        jitter_ns: 5,
        loss_16: 4,
        copies_16: 3,
        holds_16: 4,
        shared: false,
        controls: Vec::new(),
        hosts_energy: false,
        tells: Vec::new(),
        stop_after: 0,
        fail_after: 0,
        until_ns: 60,
    }
}

fn check(model: &Chatter, end: &str, delivered: u64, digest: &str) {
    for executor in EXECUTORS {
        let report = model.build().run(executor).expect("the model can start");
        let found = (report.end.name(), report.counts.delivered);
        assert_eq!(found, (end, delivered), "{}", executor.name());
        assert_eq!(report.digest.to_string(), digest, "{}", executor.name());
    }
}

#[test]
fn noisy_links() {
    check(&noisy(), "stopped", 142, "5010a12aff7fd4c5fc76311c48715af1");
}

#[test]
fn crashes_restarts_and_a_shared_link() {
    let model = Chatter {
        shared: true,
        controls: vec![(0, 10, false), (0, 25, true), (3, 30, true), (4, 41, false)],
        ..noisy()
    };
    check(&model, "stopped", 95, "83c5a56fa01062cf672d7eade71218bb");
}

#[test]
fn shuffled_ties_without_look_ahead_until_a_fault() {
    let model = Chatter {
        tie_seed: Some(11),
        min_delay_ns: 0,
        fail_after: 30,
        ..noisy()
    };
    check(&model, "fault", 105, "64db73158ad6db515710da8eba562c94");
}

/// What the test runs of each built-in scenario, in the order of their names: a line a run,
/// with what came of it.
const SCENARIOS: &str = include_str!("golden/scenarios.txt");

/// The executors that have to agree.
const EXECUTORS: [Executor; 2] = [Executor::Inline, Executor::Kameo { threads: 2 }];

/// A cut of a built-in scenario: small enough that all together take seconds in the debug profile.
struct Cut {
    scenario: &'static str,
    /// What sets it apart from other cuts of the scenario.
    variant: &'static str,
    sets: Vec<&'static str>,
}

/// The policies and motions that each scenario of the network system is run with. The search over
/// all rovers at once is feasible for few of them.
const NETWORK_VARIANTS: [(&str, &[&str]); 6] = [
    ("max-plus", &["network.policy=max-plus"]),
    ("complete", &["network.policy=complete"]),
    ("reference", &["network.policy=reference"]),
    ("prioritised", &["network.policy=prioritised"]),
    ("coupled", &["network.policy=coupled", "team.rovers=3"]),
    (
        "continuous",
        &["network.policy=complete", "network.motion=continuous"],
    ),
];

/// The runs of one scenario. One of a new system runs for its first minute unless it is named here.
fn cuts_of(scenario: &'static str) -> Vec<Cut> {
    let cut = |variant, sets: &[&[&'static str]]| Cut {
        scenario,
        variant,
        sets: sets.concat(),
    };
    if !scenario.starts_with("network/") {
        let until = match scenario {
            // Its first pass is hours away.
            "traffic/contact-plan" => "until=6h",
            // Rovers take a quarter of an hour from rock to rock.
            _ if scenario.starts_with("misus/") => "until=8h",
            _ => "until=60s",
        };
        return vec![cut("as it is", &[&[until]])];
    }
    let of_variant = |(variant, sets): &(&'static str, &'static [&'static str])| {
        // Gaps can be crossed with one policy only.
        let gaps: &[&str] = match (scenario, sets[0]) {
            ("network/crater-gaps", policy) if policy != "network.policy=complete" => {
                &["world.gaps=close"]
            }
            _ => &[],
        };
        cut(variant, &[&["until=12s", "team.rovers=25"], gaps, sets])
    };
    // With the gaps closed, three rovers have no way.
    let is_feasible =
        |(variant, _): &&(&str, _)| (scenario, *variant) != ("network/crater-gaps", "coupled");
    let variants = NETWORK_VARIANTS.iter().filter(is_feasible);
    variants.map(of_variant).collect()
}

fn cuts() -> impl Iterator<Item = Cut> {
    Registry::builtin()
        .scenario_names()
        .into_iter()
        .flat_map(cuts_of)
}

impl Cut {
    /// What its line begins with.
    fn name(&self) -> String {
        format!("{} | {} | ", self.scenario, self.variant)
    }

    /// The line of `golden/scenarios.txt` that says what came of a run.
    fn line(&self, executor: Executor) -> String {
        let sets: Vec<String> = self.sets.iter().map(|set| (*set).to_owned()).collect();
        let scenario = Scenario::open(self.scenario, &sets, &Registry::builtin());
        let assembled = scenario.and_then(|scenario| scenario.assemble());
        let assembled = assembled
            .unwrap_or_else(|error| panic!("{}, {}: {error}", self.scenario, self.variant));
        let report = assembled.sim.run(executor).expect("the model can start");
        let (name, delivered) = (self.name(), report.counts.delivered);
        format!("{name}{delivered} delivered | {}", report.digest)
    }
}

#[test]
fn every_built_in_scenario() {
    let mut pinned: Vec<&str> = SCENARIOS.lines().collect();
    let mut wrong = String::new();
    for cut in cuts() {
        let at = pinned.iter().position(|line| line.starts_with(&cut.name()));
        let expected = at.map_or("no line", |at| pinned.remove(at));
        for executor in EXECUTORS {
            let found = cut.line(executor);
            if found != expected {
                let by = executor.name();
                let _ = write!(wrong, "\n  expected {expected}\n  found    {found} ({by})");
            }
        }
    }
    for line in pinned {
        let _ = write!(wrong, "\n  no built-in scenario has the run {line}");
    }
    let hint = "tests/golden.rs says which command prints the file anew";
    assert!(
        wrong.is_empty(),
        "tests/golden/scenarios.txt:{wrong}\n{hint}"
    );
}

/// Prints `golden/scenarios.txt` as it would be now.
#[test]
#[ignore = "prints digests, checks nothing"]
fn print() {
    // The harness may have begun a line.
    println!();
    for cut in cuts() {
        println!("{}", cut.line(Executor::Inline));
    }
}
