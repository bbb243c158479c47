//! One result: whatever executor runs a model, on however many threads, watched or not.

use farside::{End, Executor, FaultCause, Report};
use farside_tests::chatter::{Chatter, Ledger};
use proptest::prelude::*;

prop_compose! {
    pub(crate) fn chatter()(
        seed in any::<u64>(),
        tie_seed in prop::option::of(any::<u64>()),
        hosts in prop::collection::vec(1u8..3, 1..5),
        min_delay_ns in 0u64..6,
        jitter_ns in 0u64..6,
        loss_16 in 0u8..17,
        copies_16 in 0u8..9,
        holds_16 in 0u8..9,
        shared in any::<bool>(),
        controls in prop::collection::vec((any::<u8>(), 0u64..40, any::<bool>()), 0..6),
        hosts_energy in any::<bool>(),
        tells in prop::collection::vec((any::<u8>(), 0u64..40, 0u8..4), 0..6),
        stop_after in prop_oneof![Just(0u32), 1u32..40],
        fail_after in prop_oneof![Just(0u32), 1u32..60],
        until_ns in 1u64..50,
    ) -> Chatter {
        Chatter {
            seed, tie_seed, hosts, min_delay_ns, jitter_ns, loss_16, copies_16, holds_16, shared,
            controls, hosts_energy, tells, stop_after, fail_after, until_ns,
        }
    }
}

fn inline(model: &Chatter) -> Report {
    model
        .build()
        .run(Executor::Inline)
        .expect("the model can start")
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, ..ProptestConfig::default() })]

    #[test]
    fn every_executor_gives_the_same_report(model in chatter(), threads in 1usize..4) {
        let expected = inline(&model);
        let kameo = model.build().run(Executor::Kameo { threads }).expect("the model can start");
        prop_assert_eq!(expected, kameo);
    }

    #[test]
    fn watching_changes_nothing(model in chatter()) {
        let expected = inline(&model);
        let mut watched = model.build();
        watched.observe(Ledger::new().0);
        prop_assert_eq!(expected, watched.run(Executor::Inline).expect("the model can start"));
    }

    #[test]
    fn every_message_copy_has_exactly_one_fate(model in chatter(), kameo in any::<bool>()) {
        let (ledger, tally) = Ledger::new();
        let mut sim = model.build();
        sim.observe(ledger);
        let executor = if kameo { Executor::Kameo { threads: 2 } } else { Executor::Inline };
        let report = sim.run(executor).expect("the model can start");
        let mut tally = tally.lock().expect("the run is over").clone();
        let counts = &report.counts;
        prop_assert_eq!(counts.sent, tally.sent);
        prop_assert_eq!(counts.sent + counts.duplicated, tally.fates.len() as u64);
        prop_assert_eq!(counts.sent + counts.duplicated,
            counts.delivered + counts.lost + counts.in_flight);
        tally.fates.sort();
        let fates = tally.fates.len();
        tally.fates.dedup();
        prop_assert_eq!(fates, tally.fates.len(), "two fates for one copy");
        prop_assert_eq!(tally.before_their_cause, 0);
        if report.fault().is_none() {
            // What is in flight at the end is recorded after the end, with keys still to come.
            prop_assert_eq!(tally.out_of_order, 0);
        }
    }

    #[test]
    fn a_link_that_undercuts_its_min_delay_is_named(mut model in chatter()) {
        model.fail_after = 0;
        model.min_delay_ns += 2;
        let run = |executor| model.build_undercutting().run(executor).expect("the model can start");
        let expected = run(Executor::Inline);
        prop_assert_eq!(&expected, &run(Executor::Kameo { threads: 2 }));
        if let End::Fault(fault) = &expected.end {
            let named = matches!(&fault.cause, FaultCause::UndercutsMinDelay { declared, actual, .. }
                if actual < declared);
            prop_assert!(named, "{fault}");
        }
    }
}

/// Without the check, an engine hears of a message after it has run past it.
#[test]
fn without_the_min_delay_check_executors_disagree() {
    let model = |seed| Chatter {
        seed,
        tie_seed: None,
        hosts: vec![2, 2, 2, 2],
        min_delay_ns: 8,
        jitter_ns: 3,
        loss_16: 0,
        copies_16: 0,
        holds_16: 0,
        shared: false,
        controls: Vec::new(),
        hosts_energy: false,
        tells: Vec::new(),
        stop_after: 0,
        fail_after: 0,
        until_ns: 60,
    };
    let run = |seed, executor| {
        let mut sim = model(seed).build_undercutting();
        sim.without_min_delay_check();
        sim.run(executor).expect("the model can start").digest
    };
    let disagree = |seed| run(seed, Executor::Inline) != run(seed, Executor::Kameo { threads: 2 });
    assert!(
        (0..10).any(disagree),
        "the check of min_delay would be for nothing"
    );
}
