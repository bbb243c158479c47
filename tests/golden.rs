//! Digests as they are, and have to stay: the same in debug and release, on every machine, in every
//! later version of the code that does not say otherwise in its CHANGELOG.

use farside::Executor;
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
    for executor in [Executor::Inline, Executor::Kameo { threads: 2 }] {
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
    check(&model, "stopped", 95, "9f6a4558babcbac3d0d8fa44bc75aab1");
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
