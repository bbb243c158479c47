//! The rover's model, planned and checked; the executive's, extended tick by tick.

use std::sync::Arc;

use super::*;
use crate::Ticks;
use crate::checker::check;
use crate::plan::Plan;
use crate::search::executive::Executive;
use crate::search::{Forward, Planner, Settings, Verdict};

/// The plan for a problem of the rover, if there is one, and whether that is proven.
fn solve(text: &str) -> (Option<Plan>, bool) {
    let model = Arc::new(rover());
    let problem = read_problem("problem.ddl", text, &model, &Options::default());
    let problem = Arc::new(problem.value.expect("it is right"));
    let settings = Settings {
        operations: 1_000_000,
        seed: 1,
    };
    let answer = Forward
        .solve(&model, &problem, settings)
        .expect("what is the case can be");
    if let Some(plan) = &answer.plan {
        assert_eq!(check(&model, &problem, plan), []);
    }
    (answer.plan, answer.proven)
}

#[test]
fn a_drive_is_added_where_an_observation_needs_it() {
    let (plan, _) = solve(ROVER_PROBLEM);
    let plan = plan.expect("there is one");
    let drives = plan
        .tokens
        .iter()
        .filter(|token| token.predicate == "Going");
    assert_eq!(drives.count(), 2);
    assert!((plan.score - 18.5).abs() < 1e-9, "{}", plan.score);
}

#[test]
fn what_is_too_much_has_no_plan_and_without_one_goal_it_has() {
    let (plan, _) = solve(TOO_MUCH);
    assert!(plan.is_none(), "{plan:?}");
    let goal = |line: &&str| !line.starts_with("(Goal study_3");
    let less: Vec<&str> = TOO_MUCH.lines().filter(goal).collect();
    assert_eq!(less.len() + 1, TOO_MUCH.lines().count());
    assert!(solve(&less.join("\n")).0.is_some());
}

/// What the monitor of motion says while all polls are answered at each tick, the tilt and the roll
/// with these angles, and commands with a status.
fn recover(angles: impl Fn(Ticks) -> [Value; 2], status: &str) -> Vec<String> {
    let model = read_model("executive.ddl", EXECUTIVE, &Options::default());
    let model = Arc::new(model.value.expect("it is right"));
    let timeline = |name: &str| {
        model
            .timelines
            .iter()
            .position(|of| of.name == name)
            .expect("it is a timeline")
    };
    let status = model
        .symbols
        .iter()
        .position(|name| name == status)
        .expect("it is a status");
    let [location, monitor] = ["Location_SV", "MotionMonitor_SV"].map(timeline);
    let polls = ["Tilt_SV", "Roll_SV", "Temperature_SV", "Power_SV"].map(timeline);
    let mut executive = Executive::new(model.clone());
    let mut said: Vec<String> = Vec::new();
    for tick in 0..40 {
        let [tilt, roll] = angles(tick);
        let answers = [
            [Value::from(tilt.abs() > 25), tilt],
            [Value::from(roll.abs() > 20), roll],
            [0, 30],
            [0, 80],
        ];
        for (poll, [alarm, value]) in polls.into_iter().zip(answers).filter(|_| tick > 0) {
            let token = executive.present(poll).expect("a state has a token");
            executive
                .report(token, &[alarm, value, 1], true, tick)
                .expect("it can be");
        }
        let present = |executive: &Executive, timeline| {
            let token = executive.present(timeline)?;
            Some((token, executive.database().token(token)?.predicate))
        };
        if let Some((token, predicate)) = present(&executive, location)
            && model.predicates[predicate].name != "Still"
        {
            executive
                .report(token, &[status as Value], true, tick)
                .expect("it can be");
        }
        let verdict = executive.cycle(tick, 100_000);
        assert!(
            matches!(verdict, Verdict::Solved),
            "tick {tick}: {verdict:?}"
        );
        let (_, predicate) = present(&executive, monitor).expect("a state has a token");
        let name = &model.predicates[predicate].name;
        if said.last() != Some(name) {
            said.push(name.clone());
        }
    }
    said
}

#[test]
fn an_executive_recovers_from_an_alarm_step_by_step() {
    let recovery = ["Nominal", "Stopping", "BackingUp", "Turning", "Nominal"];
    assert_eq!(recover(|_| [10, -10], "ok"), ["Nominal"]);
    let once = |tick| [if tick == 10 { -30 } else { 0 }, 0];
    assert_eq!(recover(once, "ok"), recovery);
    assert_eq!(recover(once, "failed"), ["Nominal", "Stopping", "Safe"]);
}
