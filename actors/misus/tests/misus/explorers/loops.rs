//! What others got wrong when a plan is carried out and made anew, and what of it must not happen here.

use std::collections::BTreeMap;

use farside::prelude::*;
use farside_misus::shac::{GoalKey, Reason};
use farside_misus::survey::{Activity, ActivityEnd, ReplanCause};

use super::diary::{Diary, Entry, Run, told};

/// One rover on a small field, whose goals are given: spectra and images of the first rocks.
fn alone(more: &str) -> String {
    let mut text = "world = { rocks = 12, side = '30m' }\nteam.rovers = 1\n\
        rover.known_from = '0.2m'\nsurvey.rocks = 0\nsurvey.squares = 0\n"
        .to_owned();
    text.push_str(more);
    for rock in 0..4 {
        for observation in ["point-image", "point-spectrum"] {
            text.push_str(&format!(
                "\n[[goal]]\nname = '{observation}-{rock}'\nobservation = '{observation}'\nrock = {rock}\n"
            ));
        }
    }
    text
}

fn run(more: &str, hours: u64, crashes: &[(&str, u64, u64)]) -> super::diary::Ran {
    let text = alone(more);
    let ran = Run {
        text: &text,
        hours,
        crashes,
        ..Run::default()
    }
    .run();
    assert!(
        ran.results.violations.is_empty(),
        "{:?}",
        ran.results.violations
    );
    check_order(&ran.diary);
    let plans = causes(&ran.diary).len();
    assert!(
        plans as u64 <= 20 * hours,
        "{plans} plans\n{}",
        told(&ran.diary, "")
    );
    ran
}

/// In every diary: one activity at a time; nothing before its time but an observation where the rover stands already;
/// a plan that is made while something runs begins with that.
fn check_order(diary: &Diary) {
    let mut running = BTreeMap::<&str, Activity>::new();
    let mut before = BTreeMap::<&str, [f64; 2]>::new();
    for (at, who, entry) in diary {
        match entry {
            Entry::Began(began) => {
                let activity = began.planned.activity;
                let other = running.insert(who, activity);
                assert_eq!(other, None, "{at}: {activity:?}\n{}", told(diary, who));
                // Where the rover stands already it need not wait.
                let is_goal = matches!(activity, Activity::Goal(_));
                let place_m = before.get(who.as_str());
                let arrives = is_goal && place_m == Some(&began.planned.position_m);
                let is_due = arrives || *at >= began.planned.starts;
                assert!(is_due, "{at}: {began:?}\n{}", told(diary, who));
            }
            Entry::Ended(ended) => {
                // What was missed has never begun.
                if running.get(who.as_str()) == Some(&ended.planned.activity) {
                    running.remove(who.as_str());
                }
                before.insert(who, ended.planned.position_m);
            }
            Entry::Plan(plan) => {
                if let Some(activity) = running.get(who.as_str()) {
                    let first = plan.activities.first().map(|at| at.activity);
                    assert_eq!(first, Some(*activity), "{at}\n{}", told(diary, who));
                }
            }
            Entry::Incident(_) => {}
        }
    }
}

fn causes(diary: &Diary) -> Vec<ReplanCause> {
    let plan = |(_, _, entry): &(SimTime, String, Entry)| match entry {
        Entry::Plan(plan) => Some(plan.cause),
        _ => None,
    };
    diary.iter().filter_map(plan).collect()
}

/// How observations and drives of each goal ended, in order.
fn ends(diary: &Diary) -> Vec<(Activity, ActivityEnd)> {
    let end = |(_, _, entry): &(SimTime, String, Entry)| match entry {
        Entry::Ended(ended) => Some((ended.planned.activity, ended.end)),
        _ => None,
    };
    diary.iter().filter_map(end).collect()
}

fn count(diary: &Diary, wanted: impl Fn(GoalKey, ActivityEnd) -> bool) -> usize {
    let is_wanted = |(activity, end): &(Activity, ActivityEnd)| match activity {
        Activity::Goal(goal) => wanted(*goal, *end),
        _ => false,
    };
    ends(diary).iter().filter(|one| is_wanted(one)).count()
}

#[test]
fn a_rover_does_what_it_has_and_a_new_plan_leaves_alone_what_runs() {
    let ran = run("", 8, &[]);
    let done = count(&ran.diary, |_, end| end == ActivityEnd::Done);
    assert!(done >= 6, "{done}\n{}", told(&ran.diary, ""));
    // Early and late ends were reasons to plan anew, while other things ran.
    let causes = causes(&ran.diary);
    assert!(causes.contains(&ReplanCause::Early), "{causes:?}");
    let communicated = ends(&ran.diary);
    assert!(communicated.contains(&(Activity::Communication(0), ActivityEnd::Done)));
    // The same again, on more cores, is the same.
    let text = alone("");
    let again = Run {
        text: &text,
        hours: 8,
        executor: Executor::Kameo { threads: 2 },
        ..Run::default()
    };
    assert_eq!(again.run().report.digest, ran.report.digest);
}

#[test]
fn what_fails_is_tried_so_often_and_given_up_with_a_reason_and_the_rest_is_done() {
    let broken = "[[rover.fault]]\nat = '1min'\nkind = 'instrument-fails'\npart = 'mini_tes'\n";
    let ran = run(&format!("execution.retries = 2\n{broken}"), 8, &[]);
    let hardware = ActivityEnd::Interrupted(Reason::Hardware);
    let mut tries = BTreeMap::<GoalKey, (u32, u32)>::new();
    for (activity, end) in ends(&ran.diary) {
        if let Activity::Goal(goal) = activity {
            let tries = tries.entry(goal).or_default();
            tries.0 += u32::from(end == hardware);
            tries.1 += u32::from(end == ActivityEnd::Failed(Reason::Hardware));
        }
    }
    let given_up = tries.values().filter(|tries| tries.1 > 0);
    assert!(given_up.clone().count() >= 3, "{}", told(&ran.diary, ""));
    assert!(given_up.clone().all(|tries| *tries == (2, 1)), "{tries:?}");
    // Its camera answers as before.
    let done = count(&ran.diary, |_, end| end == ActivityEnd::Done);
    assert!(done >= 3, "{}", told(&ran.diary, ""));
}

#[test]
fn what_failed_is_done_when_its_hardware_answers_again() {
    let broken = "[[rover.fault]]\nat = '1min'\nkind = 'instrument-fails'\npart = 'mini_tes'\n\
        duration = '1h'\n";
    let ran = run(&format!("execution.retries = 10\n{broken}"), 9, &[]);
    let goals: Vec<GoalKey> = ends(&ran.diary)
        .into_iter()
        .filter_map(|(activity, end)| match (activity, end) {
            (Activity::Goal(goal), ActivityEnd::Interrupted(Reason::Hardware)) => Some(goal),
            _ => None,
        })
        .collect();
    assert!(!goals.is_empty());
    let done = |goal: &GoalKey| {
        count(&ran.diary, |at, end| {
            at == *goal && end == ActivityEnd::Done
        })
    };
    assert!(
        goals.iter().any(|goal| done(goal) == 1),
        "{}",
        told(&ran.diary, "")
    );
}

#[test]
fn a_drive_that_never_ends_is_broken_off_and_a_blocked_one_goes_round() {
    let faults = "[[rover.fault]]\nat = '20s'\nkind = 'blocked-path'\n\
        [[rover.fault]]\nat = '1h'\nkind = 'never-ends'\npart = 'wheels'\nduration = '3h'\n";
    let ran = run(faults, 9, &[]);
    let causes = causes(&ran.diary);
    assert!(
        causes.contains(&ReplanCause::Blocked),
        "{}",
        told(&ran.diary, "")
    );
    assert!(causes.contains(&ReplanCause::Late));
    let is_broken_off = |(activity, end): &(Activity, ActivityEnd)| {
        matches!(activity, Activity::Drive(_)) && matches!(end, ActivityEnd::Interrupted(_))
    };
    let ends = ends(&ran.diary);
    let broken_off = ends.iter().position(is_broken_off);
    let later = &ends[broken_off.expect("a drive was broken off")..];
    assert!(
        later.iter().any(|(_, end)| *end == ActivityEnd::Done),
        "{}",
        told(&ran.diary, "")
    );
}

#[test]
fn a_plan_that_comes_too_late_is_stale_and_made_anew() {
    // While a slow processor plans, an instrument fails.
    let more = "survey.processor = '1/s'\nexecution.mode = 'batch'\n[[rover.fault]]\nat = '1min'\nkind = 'instrument-fails'\n\
        part = 'mini_tes'\nduration = '2h'\n";
    let ran = run(more, 8, &[]);
    let causes = causes(&ran.diary);
    let done = count(&ran.diary, |_, end| end == ActivityEnd::Done);
    assert!(done >= 3, "{}", told(&ran.diary, ""));
    assert!(
        causes.contains(&ReplanCause::Stale),
        "{causes:?}\n{}",
        told(&ran.diary, "")
    );
}

#[test]
fn after_a_crash_a_rover_asks_what_runs_and_goes_on() {
    let all = ["planner_01", "rover_01", "rover_01/hardware"];
    let mut crashes = vec![("planner_01", 500, 510)];
    crashes.extend(all.map(|name| (name, 3_600, 4_200)));
    let ran = run("", 9, &crashes);
    let started = causes(&ran.diary).into_iter();
    let started = started.filter(|cause| *cause == ReplanCause::Started);
    assert_eq!(started.count(), 3, "{}", told(&ran.diary, ""));
    // What ran on while only the planner was away ended as if it had not been.
    let first = ends(&ran.diary).into_iter();
    let mut first = first.filter(|(activity, _)| matches!(activity, Activity::Goal(_)));
    assert_eq!(first.next().map(|(_, end)| end), Some(ActivityEnd::Done));
    // What ended unheard was tried again, and done.
    let is_lost =
        |(_, end): &&(Activity, ActivityEnd)| *end == ActivityEnd::Interrupted(Reason::Hardware);
    let ends = ends(&ran.diary);
    let lost: Vec<Activity> = ends
        .iter()
        .filter(is_lost)
        .map(|(activity, _)| *activity)
        .collect();
    assert_eq!(lost.len(), 1, "{}", told(&ran.diary, ""));
    assert!(ends.contains(&(lost[0], ActivityEnd::Done)));
    assert_eq!(count(&ran.diary, |_, end| end == ActivityEnd::Done), 8);
    assert_eq!(ran.results.metrics["duplicated"].as_f64(), Some(0.0));
}

#[test]
fn actions_of_a_chain_do_not_start_together() {
    let ran = run("", 6, &[]);
    let mut under = None;
    let (mut drives, mut observed) = (0, 0);
    for (at, _, entry) in &ran.diary {
        match entry {
            Entry::Began(began) => {
                assert_eq!(under, None, "{at}\n{}", told(&ran.diary, ""));
                under = Some(began.planned.activity);
            }
            Entry::Ended(ended) if under == Some(ended.planned.activity) => {
                under = None;
                let activity = ended.planned.activity;
                drives += u32::from(matches!(activity, Activity::Drive(_)));
                observed += u32::from(matches!(activity, Activity::Goal(_)));
            }
            _ => {}
        }
    }
    assert!(drives >= 2 && observed >= 4, "{}", told(&ran.diary, ""));
}

#[test]
fn a_mandatory_goal_that_a_plan_has_no_room_for_is_explained() {
    // It is wished for only when it is too late for what it takes.
    let more = "[[goal]]\nname = 'late'\nobservation = 'point-spectrum'\nrock = 5\nadded = '2h'\n\
        closes = '3h'\nmandatory = true\n[[rover.fault]]\nat = '1h'\nkind = 'instrument-fails'\n\
        part = 'mini_tes'\n";
    let ran = run(more, 5, &[]);
    let plans = ran.diary.iter().filter_map(|(_, _, entry)| match entry {
        Entry::Plan(plan) => Some(plan),
        _ => None,
    });
    let unmet = plans.flat_map(|plan| &plan.unmet);
    let reasons: Vec<Reason> = unmet.map(|one| one.reason).collect();
    assert!(
        reasons.contains(&Reason::Time),
        "{reasons:?}\n{}",
        told(&ran.diary, "")
    );
}

#[test]
fn windows_of_goals_are_obeyed_and_mandatory_goals_come_first() {
    let more = "[[goal]]\nname = 'late'\nobservation = 'point-image'\nrock = 5\nopens = '4h'\ncloses = '5h'\n\
        mandatory = true\n";
    let ran = run(more, 8, &[]);
    let mut begins = ran.diary.iter().filter_map(|(at, _, entry)| match entry {
        Entry::Began(began) => Some((*at, began.planned.activity)),
        _ => None,
    });
    let opens = SimTime::from_secs(4 * 3600);
    let late = begins.find(|(_, activity)| match activity {
        Activity::Goal(GoalKey::Observation(id)) => {
            id.target == farside_misus::analysis::goals::Target::Rock(5)
        }
        _ => false,
    });
    let (at, _) = late.unwrap_or_else(|| panic!("it is begun\n{}", told(&ran.diary, "")));
    assert!(at >= opens && at < opens + SimDuration::from_secs(3600));
}

#[test]
fn plans_from_nothing_look_at_more_than_plans_that_go_on() {
    let operations = |mode: &str| {
        let ran = run(&format!("execution.mode = '{mode}'\n"), 6, &[]);
        ran.results.metrics["plan_operations"]
            .as_f64()
            .expect("it is counted")
    };
    let [batch, continuous] = ["batch", "continuous"].map(operations);
    assert!(batch > 1.2 * continuous, "{batch} {continuous}");
}

#[test]
fn what_a_drive_comes_too_late_for_is_no_reason_to_plan_without_end() {
    let more = "[[goal]]\nname = 'late'\nobservation = 'point-image'\nrock = 6\nadded = '4h1min'\n\
        closes = '4h40min'\n[[rover.fault]]\nat = '4h'\nkind = 'never-ends'\npart = 'wheels'\nduration = '3h'\n";
    let ran = run(more, 7, &[]);
    let drive = ends(&ran.diary)
        .into_iter()
        .rfind(|(activity, _)| matches!(activity, Activity::Drive(_)));
    let (_, end) = drive.expect("it drives");
    assert!(
        matches!(end, ActivityEnd::Interrupted(_)),
        "{}",
        told(&ran.diary, "")
    );
}

#[test]
fn on_a_market_rovers_bid_what_a_goal_adds_to_their_plans() {
    let text = alone("survey.protocol = 'market'\n").replace("team.rovers = 1", "team.rovers = 2");
    let ran = Run {
        text: &text,
        hours: 8,
        ..Run::default()
    }
    .run();
    assert!(
        ran.results.violations.is_empty(),
        "{:?}",
        ran.results.violations
    );
    check_order(&ran.diary);
    let done = count(&ran.diary, |_, end| end == ActivityEnd::Done);
    assert!(done >= 6, "{}", told(&ran.diary, ""));
}

/// The faults of the scenario that has one of every kind.
fn every_fault() -> &'static str {
    let text = include_str!("../../../scenarios/faults.toml");
    let (first, last) = (text.find("[[rover.fault]]"), text.find("[links.default]"));
    &text[first.expect("it has faults")..last.expect("it has links")]
}

#[test]
#[ignore = "two sols of three rovers take minutes in a debug build"]
fn with_every_kind_of_fault_nothing_is_violated() {
    for seed in 1..=2 {
        let run = Run {
            text: every_fault(),
            seed,
            hours: 49,
            ..Run::default()
        };
        let ran = run.run();
        assert!(
            ran.results.violations.is_empty(),
            "{:?}",
            ran.results.violations
        );
        check_order(&ran.diary);
        for metric in ["plan_violations", "sharing_violations", "lost_goals"] {
            assert_eq!(ran.results.metrics[metric].as_f64(), Some(0.0), "{metric}");
        }
        println!("{}", told(&ran.diary, ""));
        for metric in [
            "goals_achieved",
            "replans",
            "missed_comm",
            "brown_outs",
            "score",
        ] {
            println!("{metric} {:?}", ran.results.metrics[metric]);
        }
    }
}
