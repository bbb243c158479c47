//! Each rule is there for something: without it, something is violated.

use super::sharing::{Partition, RULES, Scenario, Wished, Wishing, World, without};
use farside_misus::shac::Rules;

/// The rule that is left out, the seed at which the search for a run that shows it begins, and what is
/// violated then.
const SEEN: [(&str, u64, &str); 13] = [
    ("write_first", 2, "released after the start"),
    ("newer_only", 12, "two leases"),
    ("highest_status", 2, "an old status"),
    ("release_binds", 11, "released after the start"),
    (
        "present_epoch_only",
        4,
        "a lease that its centre does not know",
    ),
    ("revoke_safely", 2, "a lease that its centre does not know"),
    ("start_in_lease", 12, "started beyond the lease"),
    ("pass_outcomes_on", 2, "outcomes differ"),
    ("drop_achieved", 30, "started what is known to be achieved"),
    ("mandate", 2, "two centres"),
    ("bind_pairs", 4, "half a pair alone"),
    ("refusals_hold", 90, "asked again and again"),
    ("withdrawn_for_good", 8, "a goal came back"),
];

#[test]
fn without_a_rule_something_is_violated() {
    for (rule, first, expected) in SEEN {
        let rules = without(rule).unwrap();
        let mut runs = (first..first + 40).map(|seed| World::new(Scenario::random(seed), rules));
        let is_seen = runs.any(|world| world.run().is_err_and(|seen| seen.what == expected));
        assert!(is_seen, "without {rule} nobody saw: {expected}");
    }
    let seen: Vec<&str> = SEEN
        .iter()
        .map(|(rule, ..)| *rule)
        .chain(["wait_out"])
        .collect();
    assert!(
        RULES.iter().all(|(rule, _)| seen.contains(rule)),
        "a rule that no test breaks"
    );
}

/// All goals are wished for anew; then the old centre and rover 0 are cut off together. It grants
/// goals until its mandate ends; its successor, whom the other two elect, does not know of them.
fn cut_off(seed: u64) -> Scenario {
    let wish = |at_s, what| (0..5).map(move |goal| Wishing { at_s, goal, what });
    let wishes = wish(200, Wished::Not).chain(wish(390, Wished::Again));
    Scenario {
        protocol: 1,
        rovers: 3,
        candidates: vec![3, 1],
        has_elections: true,
        has_windows: false,
        goals: 5,
        pairs: 0,
        loss: 0.0,
        duplication: 0.0,
        delay_s: 2,
        crash_at_event: 0.0,
        zeal: 0.0,
        partitions: vec![Partition {
            from_s: 396,
            for_s: 9_000,
            side: 0b0_1001,
        }],
        crashes: Vec::new(),
        wishes: wishes.collect(),
        ..Scenario::random(seed)
    }
}

#[test]
fn a_new_centre_waits_out_leases_that_it_does_not_know() {
    let mut seen = 0;
    for seed in 0..30 {
        let hasty = World::new(cut_off(seed), without("wait_out").unwrap()).run();
        seen += u32::from(
            hasty.is_err_and(|seen| seen.what == "a lease that its centre does not know"),
        );
        World::new(cut_off(seed), Rules::ALL).run().unwrap();
    }
    assert!(seen > 0);
}

/// The guard is the most that clocks may differ. Here they differ by up to ten guards.
#[test]
fn clocks_that_differ_by_more_than_the_guard_break_leases() {
    let mut runs = (0..60).map(|seed| Scenario {
        skew_s: 600,
        ..Scenario::random(seed)
    });
    let broken = [
        "two leases",
        "a lease that its centre does not know",
        "two centres",
    ];
    let is_seen = runs.any(|scenario| {
        let run = World::new(scenario, Rules::ALL).run();
        run.is_err_and(|seen| broken.contains(&seen.what))
    });
    assert!(is_seen);
}
