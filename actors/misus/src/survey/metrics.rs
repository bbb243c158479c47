//! What a survey amounts to: what was achieved of what was wished for, at what cost, and what was learnt.

use std::sync::{OnceLock, PoisonError};

use farside::SimTime;
use farside_actors::system::Better::{Higher, Lower, Neither};
use farside_actors::system::MetricKind::{Number, Rate, Series as Curve};
use farside_actors::system::{Better, Metric, Results, Series, SeriesIndex, with_about};
use farside_worlds::RockField;
use farside_worlds::sky::SOL_S;
use serde::Serialize;

use super::assemble::Survey;
use super::monitor::{Course, Point, STEP};
use super::shared::Shared;
use crate::metrics as learning;

/// Runs of one study are equally long.
const HOUR: SeriesIndex = SeriesIndex {
    label: "time",
    unit: "h",
    lengths_differ: true,
};

/// Metrics of fixed tours, which a survey has not.
const NOT_HERE: [&str; 4] = ["stops", "field_ari_area", "regret_area", "log_score_area"];

const fn number(
    name: &'static str,
    label: &'static str,
    unit: &'static str,
    better: Better,
) -> Metric {
    Metric::new(name, label, unit, Number, better)
}

const fn curve(
    name: &'static str,
    label: &'static str,
    unit: &'static str,
    better: Better,
    about: &'static str,
) -> Metric {
    Metric::new(name, label, unit, Curve(HOUR), better).about(about)
}

/// Those that a survey has beside what is learnt.
const OWN: [Metric; 26] = [
    number("activities_failed", "activities that failed", "", Lower),
    Metric::new("complete", "all goals achieved", "", Rate, Higher),
    number("duplicated", "goals achieved twice", "goals", Lower),
    number("given_up", "goals given up", "goals", Lower),
    number("goals_achieved", "goals achieved", "goals", Higher),
    curve(
        "goals_by_step",
        "goals achieved, by hour",
        "goals",
        Higher,
        "How many goals were achieved by the end of each hour.",
    ),
    number("goals_total", "goals wished for", "goals", Neither),
    number(
        "half_goals",
        "goals for two rovers that one did alone",
        "goals",
        Lower,
    ),
    number("loops", "turns of the closed loop", "loops", Higher),
    number("lost_goals", "goals lost", "goals", Lower),
    number("missed_comm", "daily communications missed", "", Lower),
    curve(
        "operations_by_step",
        "operations of planning in an hour",
        "operations",
        Lower,
        "What all planners looked at in each hour.",
    ),
    number("orphaned", "goals of rovers that are down", "goals", Lower),
    number(
        "plan_moved",
        "activities moved by a new plan",
        "activities",
        Lower,
    ),
    number(
        "plan_operations",
        "operations of planning",
        "operations",
        Lower,
    ),
    number("plan_violations", "what is wrong with plans", "", Lower),
    number("planned_by_rovers", "plans made", "plans", Neither),
    number("reassigned", "goals assigned again", "goals", Neither),
    number("replans", "plans made anew", "plans", Neither),
    number("score", "score", "", Higher),
    curve(
        "score_by_step",
        "score, by hour",
        "",
        Higher,
        "What the goals that were achieved by the end of each hour are worth by Equation 1.",
    ),
    number(
        "sharing_violations",
        "invariants of sharing violated",
        "",
        Lower,
    ),
    number("shed", "goals refused or given back", "goals", Neither),
    curve(
        "traverse_by_step",
        "driven, by hour",
        "m",
        Lower,
        "How far all rovers had driven by the end of each hour.",
    ),
    number("traverse_m", "driven", "m", Lower),
    number(
        "wished_editions",
        "editions of the goal list",
        "editions",
        Neither,
    ),
];

/// What runs can be measured by, sorted by name.
pub(super) fn all() -> &'static [Metric] {
    static ALL: OnceLock<Vec<Metric>> = OnceLock::new();
    ALL.get_or_init(|| {
        let mut all = with_about(&OWN, SurveyMetrics::about);
        let learnt = learning::all().iter().cloned();
        all.extend(learnt.filter(|one| !NOT_HERE.contains(&one.name)));
        all.sort_by_key(|one| one.name);
        all
    })
}

farside_actors::documented! {
    /// What came of a survey, beside what was learnt.
    #[derive(Clone, Debug, Default, PartialEq, Serialize)]
    pub struct SurveyMetrics {
        /// What the goals that were achieved are worth by Equation 1: each once, with the weight that it had
        /// on the list when it was first achieved, and each combination with the weight that it had when
        /// its last goal was.
        ///
        /// Source: the MISUS paper, section 4.1.
        pub score: f64,
        /// How many goals were ever on the list.
        pub goals_total: u32,
        /// How many different goals were achieved.
        pub goals_achieved: u32,
        /// Goals for two rovers of which only one rover did its half: worth nothing.
        pub half_goals: u32,
        /// Whether all goals of the last list are achieved.
        pub complete: bool,
        /// How far all rovers drove \[m\].
        ///
        /// Source: the MISUS paper, section 5.2.
        pub traverse_m: f64,
        /// How often a rover refused a goal, or gave one back.
        pub shed: u64,
        /// How often the centre gave a goal to a rover that some rover had been given before.
        pub reassigned: u64,
        /// Goals that were achieved more than once.
        pub duplicated: u32,
        /// Goals that at the end belong to a rover that is down.
        pub orphaned: u32,
        /// Goals that the centre has given up with a reason, and that are wished for still.
        pub given_up: u32,
        /// Goals of which the centre in office has no record although it has their list, or which it takes for
        /// those of a rover that has nothing of them. Each is a violation.
        pub lost_goals: u32,
        /// What is wrong with plans and with how they were carried out: power, memory, windows and times, by a
        /// checker that shares no code with planners. Each is a violation.
        pub plan_violations: u64,
        /// What must not happen between who shares goals, whatever links do: two leases of one goal, a start
        /// beyond its lease, a goal taken away after its start, a withdrawn goal that comes back. Each is
        /// a violation.
        pub sharing_violations: u64,
        /// Daily communications whose time passed without them, all rovers together.
        pub missed_comm: u32,
        /// Activities that failed or were broken off.
        pub activities_failed: u64,
        /// How many plans rovers made.
        pub planned_by_rovers: u32,
        /// How many of them were not a rover's first.
        pub replans: u32,
        /// Activities that are gone from the next plan or were moved in it, for each plan that was not a
        /// rover's first: the less, the stabler.
        pub plan_moved: Option<f64>,
        /// What all planners looked at, the centre's among them.
        pub plan_operations: u64,
        /// How often the prioritiser was asked after new readings had come: the turns of the closed loop of the
        /// paper's Figure 1.
        pub loops: u32,
        /// How many editions of the goal list there were.
        pub wished_editions: u32,
    }
}

/// Daily communications that should have been made by `end` and were not.
fn missed(shared: &Shared, course: &Course, end: SimTime) -> u32 {
    let execution = &shared.execution;
    if execution.communication.is_zero() {
        return 0;
    }
    let from_s = libm::floor(shared.site.starts_s / SOL_S) * SOL_S;
    let closes_s = |sol: u32| {
        let until_s = execution.communicate_until.as_secs_f64();
        from_s + f64::from(sol) * SOL_S + until_s - shared.site.starts_s
    };
    // One that could not begin after the start of the run is not missed.
    let could = |sol: &u32| closes_s(*sol) >= execution.communication.as_secs_f64();
    let over = (0..).take_while(|sol| closes_s(*sol) <= end.as_secs_f64());
    let due: Vec<u32> = over.filter(could).collect();
    let rovers = course.tally.rovers.iter();
    let missed = rovers.map(|rover| {
        let made = due.iter().filter(|sol| rover.communicated.contains(sol));
        (due.len() - made.count()) as u32
    });
    missed.sum()
}

fn figures(shared: &Shared, course: &Course, end: SimTime) -> SurveyMetrics {
    let tally = &course.tally;
    let rovers = || tally.rovers.iter();
    let replans: u32 = rovers().map(|rover| rover.replans).sum();
    let moved: u64 = rovers().map(|rover| rover.moved).sum();
    let last = tally.lists.last();
    let is_done = |list: &super::messages::GoalList| {
        let mut goals = list.goals.iter();
        goals.all(|goal| tally.achieved.contains_key(&goal.key))
    };
    SurveyMetrics {
        score: tally.score,
        goals_total: tally.wished().len() as u32,
        goals_achieved: tally.goals_achieved(),
        half_goals: tally.half_goals(),
        complete: last.is_some_and(is_done),
        traverse_m: rovers().map(|rover| rover.driven_m).sum(),
        shed: rovers().map(|rover| rover.shed).sum(),
        reassigned: tally.reassigned,
        duplicated: tally.achieved.values().filter(|times| **times > 1).count() as u32,
        orphaned: tally.orphaned(),
        given_up: tally.given_up(),
        lost_goals: tally.lost_goals().len() as u32,
        plan_violations: tally.plan_violations,
        sharing_violations: tally.sharing_violations,
        missed_comm: missed(shared, course, end),
        activities_failed: rovers().map(|rover| rover.failed).sum(),
        planned_by_rovers: rovers().map(|rover| rover.plans).sum(),
        replans,
        plan_moved: (replans > 0).then(|| moved as f64 / f64::from(replans)),
        plan_operations: tally.operations(),
        loops: tally.loops(),
        wished_editions: tally.lists.len() as u32,
    }
}

/// What came of a survey that ended at `end`.
pub(super) fn results(survey: &Survey, field: &RockField, end: SimTime) -> Results {
    let mut course = survey.course.lock().unwrap_or_else(PoisonError::into_inner);
    course.note(end);
    let metrics = figures(&survey.shared, &course, end);
    let config = &survey.shared.site.config;
    let learnt = learning::of(&survey.team, config, field, end);
    let mut results = learning::results(learnt);
    NOT_HERE
        .iter()
        .for_each(|name| drop(results.metrics.remove(*name)));
    results.metrics.extend(Results::of(&metrics).metrics);
    let points = &course.points;
    let mut before = 0;
    let operations = points.iter().map(|point| {
        let in_step = point.operations - before;
        before = point.operations;
        in_step as f64
    });
    let operations: Vec<f64> = operations.collect();
    let of = |value: fn(&Point) -> f64| by_step(points.iter().map(value).collect());
    let mut results = results
        .metric("score_by_step", of(|point| point.score))
        .metric("goals_by_step", of(|point| f64::from(point.goals)))
        .metric("operations_by_step", by_step(operations))
        .metric("traverse_by_step", of(|point| point.driven_m));
    say(&mut results, &metrics);
    let lost = course.tally.lost_goals();
    let lost = lost.iter().map(|goal| format!("goal lost: {goal:?}"));
    results.violations = course
        .tally
        .violations
        .iter()
        .cloned()
        .chain(lost)
        .collect();
    results
}

/// Lines for people.
fn say(results: &mut Results, metrics: &SurveyMetrics) {
    let (achieved, total) = (metrics.goals_achieved, metrics.goals_total);
    results.line("goals achieved", format!("{achieved} of {total}"));
    results.line("score", format!("{:.1}", metrics.score));
    results.line("turns of the loop", metrics.loops.to_string());
    let (replans, operations) = (metrics.replans, metrics.plan_operations);
    results.line(
        "plans made anew",
        format!("{replans}, {operations} operations"),
    );
    let (shed, again) = (metrics.shed, metrics.reassigned);
    results.line(
        "goals given back",
        format!("{shed}, {again} assigned again"),
    );
    if metrics.given_up > 0 {
        results.line("goals given up", metrics.given_up.to_string());
    }
    if metrics.orphaned > 0 {
        results.line(
            "goals of rovers that are down",
            metrics.orphaned.to_string(),
        );
    }
    if metrics.missed_comm > 0 {
        results.line("communications missed", metrics.missed_comm.to_string());
    }
}

/// A curve over hours, from 1.
fn by_step(values: Vec<f64>) -> Series {
    let step_h = STEP.as_secs_f64() / 3600.0;
    let index = (1..=values.len())
        .map(|step| step as f64 * step_h)
        .collect();
    let values = values.into_iter().map(Some).collect();
    Series::new(index, values).unwrap_or_default()
}
