//! Random runs: nothing that has to hold is violated.

use farside_misus::shac::Rules;
use proptest::prelude::*;

use super::sharing::{Crash, Partition, Scenario, Tally, Wished, Wishing, World};

fn run_all(seeds: std::ops::Range<u64>) -> Tally {
    let mut sum = Tally::default();
    for seed in seeds {
        let scenario = Scenario::random(seed);
        let tally = World::new(scenario.clone(), Rules::ALL).run();
        sum += tally.unwrap_or_else(|violation| panic!("{violation:?}\n{scenario:#?}"));
    }
    sum
}

#[test]
fn random_runs_violate_nothing() {
    let tally = run_all(0..150);
    // They are no runs in which nothing happens.
    assert!(
        tally.crashes > 100 && tally.achieved > 300 && tally.elections > 50,
        "{tally:?}"
    );
    assert!(tally.duplicates > 0 && tally.unachievable > 0, "{tally:?}");
}

/// `cargo test --release -p farside-misus --test misus shac -- --ignored`
#[test]
#[ignore = "a minute and a half in a release build"]
fn ten_thousand_random_runs_violate_nothing() {
    run_all(200_000..210_000);
}

#[test]
fn a_run_is_a_function_of_its_scenario() {
    let twice = [(); 2].map(|()| World::new(Scenario::random(7), Rules::ALL).run());
    assert_eq!(twice[0], twice[1]);
}

prop_compose! {
    fn partition()(from_s in 0u64..10_000, for_s in 1u64..5_000, side in 0u32..256) -> Partition {
        Partition { from_s, for_s, side }
    }
}

prop_compose! {
    fn crash()(party in 0u32..8, at_s in 0u64..10_000, for_s in 1u64..4_000) -> Crash {
        Crash { party, at_s, for_s }
    }
}

prop_compose! {
    fn wishing()(
        at_s in 0u64..10_000,
        goal in 0u32..6,
        what in prop::sample::select(vec![Wished::Not, Wished::Again, Wished::Reweighed]),
    ) -> Wishing {
        Wishing { at_s, goal, what }
    }
}

prop_compose! {
    /// Any scenario. What it shrinks to has no more crashes, partitions and goals than it needs.
    fn scenario()(
        seed in any::<u64>(),
        protocol in 0usize..4,
        (rovers, lander) in (1u32..5, prop::bool::ANY),
        (has_elections, has_windows) in (prop::bool::ANY, prop::bool::ANY),
        (goals, pairs) in (1u32..6, 0u32..3),
        (loss, duplication, zeal) in (0.0f64..0.9, 0.0f64..0.5, 0.0f64..0.4),
        delay_s in 1u64..300,
        crash_at_event in prop::sample::select(vec![0.0, 0.002, 0.01]),
        partitions in prop::collection::vec(partition(), 0..4),
        crashes in prop::collection::vec(crash(), 0..5),
        wishes in prop::collection::vec(wishing(), 0..5),
    ) -> Scenario {
        let candidates = if lander { vec![rovers, 0] } else { vec![0] };
        let pairs = if rovers > 1 { pairs } else { 0 };
        Scenario {
            seed, protocol, rovers, candidates, has_elections, has_windows, goals, pairs, loss,
            duplication, delay_s, skew_s: 60, crash_at_event, zeal, partitions, crashes, wishes,
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, max_shrink_iters: 400, ..ProptestConfig::default() })]

    #[test]
    fn any_scenario_violates_nothing(scenario in scenario()) {
        let tally = World::new(scenario, Rules::ALL).run();
        prop_assert!(tally.is_ok(), "{:?}", tally.unwrap_err());
    }
}
