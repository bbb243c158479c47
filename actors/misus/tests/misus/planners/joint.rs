//! Goals that two rovers have to make at one time, over links that lose, repeat and delay: whole or not at all.

use farside::random::RandomKey;
use farside_misus::planner::instance::Instance;
use farside_misus::planner::lns::{self, LnsConfig};
use farside_misus::planner::problem::{ProblemConfig, generate};
use proptest::prelude::*;

use super::scenario::{Ran, Run};
use super::synchronised::{CHOICES, assert_equal, without_network_of};

const PROBLEMS: &str = "problem = { rocks_least = 5, rocks_most = 12, joint = 0.6 }";

fn problems() -> ProblemConfig {
    ProblemConfig {
        rocks_least: 5,
        rocks_most: 12,
        joint_share: 0.6,
        ..ProblemConfig::default()
    }
}

/// By goal for two rovers: when rovers begin it at the end.
fn meetings(ran: &Ran, problem: u64) -> Vec<Vec<i64>> {
    let instance = Instance::new(&generate(&problems(), problem).unwrap()).unwrap();
    let joint = (0..instance.goals()).filter(|goal| instance.is_joint(*goal));
    let starts = joint.map(|goal| {
        let stops = ran.plans.iter().flatten().filter(|stop| stop.0 == goal);
        stops.map(|stop| stop.2).collect()
    });
    starts.collect()
}

#[test]
fn those_who_wait_plan_what_rounds_plan_whatever_is_lost() {
    let (mut achieved, mut withdrawn) = (0.0, 0.0);
    for (choice, text) in CHOICES {
        for seed in 1..=4 {
            let text = format!("{text}\n{PROBLEMS}");
            let whole = Run {
                text: &text,
                problem: seed,
                seed,
                ..Run::default()
            };
            let bad = Run {
                links: "default = { latency = \"200ms\", jitter = \"30s\", loss = 0.5 }",
                crashes: &[
                    ("rover_02", 250, 900),
                    ("centre", 400, 1200),
                    ("centre", 1400, 1500),
                ],
                ..whole
            };
            let rounds = without_network_of(&problems(), choice, seed, seed);
            for run in [whole, bad] {
                let ran = run.run();
                assert_equal(&ran, &rounds);
                assert_eq!(ran.figure("half_plans"), 0.0);
                achieved += ran.figure("joint_goals_achieved");
                withdrawn += ran.figure("halves_withdrawn");
            }
        }
    }
    assert!(achieved > 20.0 && withdrawn > 0.0, "{achieved} {withdrawn}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// Who does not wait: at the end each goal for two is with two at one time, or with nobody.
    #[test]
    fn goals_for_two_are_whole_or_not_at_all(
        problem in 0_u64..1_000,
        seed in 0_u64..1_000,
        loss in 0.0..0.8_f64,
        late_s in 0_u32..200,
        choice in prop_oneof![Just("idgs"), Just("simple-reward"), Just("random"), Just("lns")],
        crash_s in 1_u64..2_000,
    ) {
        let text = format!(
            "planner = {{ choice = \"{choice}\", deletions = 1 }}\nlns.operations = 50_000\n\
             rounds.synchronised = false\n{PROBLEMS}"
        );
        let links = format!(
            "default = {{ latency = \"50ms\", jitter = \"{late_s}s\", loss = {loss}, duplicate = 0.2 }}"
        );
        let ran = Run {
            text: &text,
            links: &links,
            problem,
            seed,
            crashes: &[("rover_01", crash_s, crash_s + 90), ("centre", crash_s + 30, crash_s + 200)],
            ..Run::default()
        };
        let ran = ran.run();
        prop_assert_eq!(&ran.results.violations, &Vec::<String>::new());
        prop_assert_eq!(ran.figure("half_plans"), 0.0);
        let mut achieved = 0;
        for starts in meetings(&ran, problem) {
            prop_assert!(starts.is_empty() || starts.len() == 2 && starts[0] == starts[1], "{starts:?}");
            achieved += usize::from(!starts.is_empty());
        }
        prop_assert_eq!(achieved as f64, ran.figure("joint_goals_achieved"));
    }
}

/// Nobody hears the last word of a centre that is silent: nobody goes to a meeting, and none is counted.
#[test]
fn without_a_last_word_nobody_goes() {
    for synchronised in [true, false] {
        let text = format!("rounds.synchronised = {synchronised}\n{PROBLEMS}");
        let run = Run {
            text: &text,
            problem: 3,
            seed: 3,
            ..Run::default()
        };
        let healthy = run.run();
        assert!(healthy.figure("joint_goals_achieved") > 0.0);
        let silent = Run {
            crashes: &[("centre", 1_100, 1_000_000)],
            ..run
        };
        let silent = silent.run();
        assert_eq!(silent.figure("joint_goals_achieved"), 0.0);
        assert_eq!(silent.figure("half_plans"), 0.0);
        assert!(silent.results.violations.is_empty());
        assert!(silent.figure("score") < healthy.figure("score"));
        assert!(silent.figure("score") > 0.0);
    }
}

/// A rover that crashes for good after its last step never hears the last word, and the other may go alone: that
/// is counted as what it is, and worth nothing.
#[test]
fn who_goes_alone_is_counted_as_that() {
    let text = format!("rounds.synchronised = false\n{PROBLEMS}");
    let whole = Run {
        text: &text,
        problem: 3,
        seed: 3,
        ..Run::default()
    };
    let score = whole.run().figure("score");
    let alone = (1_140..1_300).step_by(10).map(|crash_s| {
        let crashed = Run {
            crashes: &[("rover_02", crash_s, 1_000_000)],
            ..whole
        };
        let ran = crashed.run();
        assert_eq!(ran.figure("plan_violations"), 0.0);
        assert!(ran.results.violations.is_empty());
        assert!(ran.figure("half_plans") == 0.0 || ran.figure("score") < score);
        ran.figure("half_plans")
    });
    let alone: Vec<f64> = alone.collect();
    assert!(alone.iter().any(|half| *half > 0.0), "{alone:?}");
    assert_eq!((alone[0], alone[alone.len() - 1]), (0.0, 0.0), "{alone:?}");
}

#[test]
fn the_centre_can_plan_meetings_for_all_at_once() {
    let text = format!(
        "planner = {{ choice = \"lns\", steps = 3 }}\nlns.operations = 100_000\n{PROBLEMS}"
    );
    for seed in 1..=4 {
        let run = Run {
            text: &text,
            links: "default = { latency = \"50ms\", loss = 0.3 }",
            problem: seed,
            seed,
            ..Run::default()
        };
        let ran = run.run();
        let instance = Instance::new(&generate(&problems(), seed).unwrap()).unwrap();
        let config = LnsConfig {
            operations: 100_000,
            ..LnsConfig::default()
        };
        let found = lns::plan(&instance, &config, RandomKey::new(seed)).unwrap();
        let score = ran.figure("score");
        let expected = found.score;
        assert!(
            (score - expected).abs() < 1e-6,
            "{score}, expected {expected}"
        );
        assert_eq!(ran.figure("half_plans"), 0.0);
        assert!(ran.figure("joint_goals_achieved") > 0.0);
    }
}
