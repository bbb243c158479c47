//! Planners that do not wait for each other, over links that lose, repeat and delay.

use proptest::prelude::*;

use super::scenario::Run;

const NOT_WAITING: &str =
    "rounds.synchronised = false\nproblem = { rocks_least = 4, rocks_most = 12 }";

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// Whatever is lost, late, repeated or crashes: no goal is planned twice, and all plans can be
    /// carried out. Goals are shed often, so that they go from hand to hand and back.
    #[test]
    fn plans_are_valid_whatever_links_do(
        problem in 0_u64..1_000,
        seed in 0_u64..1_000,
        loss in 0.0..0.9_f64,
        late_s in 0_u32..200,
        choice in prop_oneof![Just("idgs"), Just("simple-reward"), Just("random")],
        rovers in 2_u32..=3,
        waits in any::<bool>(),
        crash_s in 1_u64..2_000,
    ) {
        let text = format!(
            "planner.choice = \"{choice}\"\nrounds.synchronised = {waits}\n\
             planner.steps = 40\nplanner.deletions = 1\nproblem.rovers = {rovers}"
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
        prop_assert_eq!(ran.figure("plan_violations"), 0.0);
        prop_assert_eq!(ran.figure("planner_steps"), f64::from(40 * rovers));
        let mut goals: Vec<usize> = Vec::new();
        let total = ran.figure("goals_total") as usize;
        goals.extend(ran.plans.iter().flatten().map(|stop| stop.0).filter(|task| *task < total));
        prop_assert_eq!(goals.len() as f64, ran.figure("goals_achieved"));
    }
}

/// What is lost costs those who do not wait some of what they plan.
#[test]
fn rare_contact_costs_science() {
    let score = |loss: &str| {
        let links = format!("default = {{ latency = \"50ms\", loss = {loss} }}");
        let scores = (1..=10).map(|seed| {
            let run = Run {
                text: NOT_WAITING,
                links: &links,
                problem: seed,
                seed,
                ..Run::default()
            };
            run.run().figure("score")
        });
        scores.sum::<f64>()
    };
    assert!(score("0.95") < score("0.0"));
}

#[test]
fn slow_processors_take_longer_for_the_same_plan() {
    let run = |text| {
        Run {
            text,
            ..Run::default()
        }
        .run()
    };
    let fast = run("rounds.processor = \"unlimited\"");
    let slow = run("rounds.processor = \"2/s\"");
    assert_eq!(fast.curve("score_by_step"), slow.curve("score_by_step"));
    assert!(slow.report.end_time > fast.report.end_time);
}
