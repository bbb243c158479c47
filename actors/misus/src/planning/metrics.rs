//! What a run of planners amounts to: what the team's plan is worth, step by step, and at what cost.

use std::sync::{OnceLock, PoisonError};

use farside_actors::system::Better::{Higher, Lower, Neither};
use farside_actors::system::MetricKind::{Number, Rate, Series as Curve};
use farside_actors::system::{Metric, Results, Series, SeriesIndex, with_about};
use serde::Serialize;

use super::assemble::Team;
use super::messages::{PlannedStop, PlannerStep};
use super::monitor::Tally;
use super::shared::Shared;
use crate::planner::chain::Chain;
use crate::planner::plan::{Stop, TeamPlan, violations};
use crate::planner::score::Score;

/// A run may end before some have made all steps.
const STEP: SeriesIndex = SeriesIndex {
    label: "optimisation step",
    unit: "",
    lengths_differ: true,
};

const fn curve(
    name: &'static str,
    label: &'static str,
    unit: &'static str,
    better: farside_actors::system::Better,
    about: &'static str,
) -> Metric {
    Metric::new(name, label, unit, Curve(STEP), better).about(about)
}

/// Sorted by name.
const ALL: [Metric; 15] = [
    Metric::new("complete", "all goals achieved", "", Rate, Higher),
    Metric::new(
        "goals_achieved",
        "goals in the plan",
        "goals",
        Number,
        Higher,
    ),
    curve(
        "goals_by_step",
        "goals in the plan",
        "goals",
        Higher,
        "How many goals the team's plan achieves after each optimisation step. Source: the MISUS paper, Figure 4.",
    ),
    Metric::new("goals_deleted", "goals given up", "goals", Number, Lower),
    Metric::new(
        "goals_total",
        "goals of the problem",
        "goals",
        Number,
        Neither,
    ),
    curve(
        "operations_by_step",
        "operations of a step",
        "operations",
        Lower,
        "What all rovers' planners look at in each optimisation step: the time that it takes on a processor. \
         Source: the MISUS paper, Figure 5.",
    ),
    Metric::new(
        "plan_operations",
        "operations of planning",
        "operations",
        Number,
        Lower,
    ),
    Metric::new(
        "plan_violations",
        "what is wrong with the plan",
        "",
        Number,
        Lower,
    ),
    Metric::new(
        "planner_steps",
        "optimisation steps made",
        "steps",
        Number,
        Neither,
    ),
    Metric::new(
        "reassigned",
        "goals assigned again",
        "goals",
        Number,
        Neither,
    ),
    Metric::new("score", "score of the plan", "", Number, Higher),
    curve(
        "score_by_step",
        "score of the plan",
        "",
        Higher,
        "What the team's plan is worth by Equation 1 after each optimisation step. Source: the MISUS paper, \
         Figure 3.",
    ),
    Metric::new("shed", "goals shed", "goals", Number, Neither),
    curve(
        "traverse_by_step",
        "length of all drives",
        "m",
        Lower,
        "How far the team drives in all by its plan, after each optimisation step. Source: the MISUS paper, \
         section 5.2.",
    ),
    Metric::new("traverse_m", "length of all drives", "m", Number, Lower),
];

/// What runs can be measured by, each with what its field says.
pub(super) fn all() -> &'static [Metric] {
    static ALL_ABOUT: OnceLock<Vec<Metric>> = OnceLock::new();
    ALL_ABOUT.get_or_init(|| with_about(&ALL, PlanningMetrics::about))
}

farside_actors::documented! {
    /// What came of a run.
    #[derive(Clone, Debug, Default, PartialEq, Serialize)]
    pub struct PlanningMetrics {
        /// What the team's plan is worth at the end by Equation 1, which no planner knows.
        ///
        /// Source: the MISUS paper, section 4.1 and Figure 3.
        pub score: f64,
        /// How many goals there are.
        pub goals_total: u32,
        /// How many goals the team's plan achieves at the end.
        ///
        /// Source: the MISUS paper, Figure 4.
        pub goals_achieved: u32,
        /// Whether the team's plan achieves all goals.
        pub complete: bool,
        /// How far the team drives in all by its plan at the end \[m\].
        ///
        /// Source: the MISUS paper, section 5.2.
        pub traverse_m: f64,
        /// How often a rover shed a goal that its plan had no room for.
        pub shed: u64,
        /// How often the centre assigned a goal to another rover than before, or offered it again.
        pub reassigned: u64,
        /// How many goals the centre has given up.
        pub goals_deleted: u32,
        /// What a checker that shares no code with planners finds wrong with the team's plan: power,
        /// memory, windows, order, goals that two rovers plan, and what has to be done and is not.
        pub plan_violations: u32,
        /// What all planners looked at.
        pub plan_operations: u64,
        /// How many optimisation steps rovers made, all together.
        pub planner_steps: u64,
    }
}

/// The team step by step.
#[derive(Default)]
struct Curves {
    score: Vec<f64>,
    goals: Vec<f64>,
    operations: Vec<f64>,
    traverse_m: Vec<f64>,
}

/// The team after each step; a rover that made fewer steps than others keeps its last plan.
fn curves(shared: &Shared, tally: &Tally) -> Curves {
    let instance = &shared.instance;
    let mut score = Score::new(instance);
    let mut curves = Curves::default();
    let most = tally.steps.iter().map(Vec::len).max().unwrap_or(0);
    for at in 0..most {
        let mut achieved = vec![false; instance.goals()];
        let (mut operations, mut traverse_mm) = (0, 0);
        for (rover, steps) in tally.steps.iter().enumerate() {
            operations += steps.get(at).map_or(0, |step| step.operations);
            let Some(step) = steps.get(at).or(steps.last()) else {
                continue;
            };
            let tasks = step.plan.iter().map(|stop| stop.task as usize);
            let goals: Vec<usize> = tasks.filter(|task| *task < instance.goals()).collect();
            goals.iter().for_each(|goal| achieved[*goal] = true);
            score.hear(rover, &goals);
            traverse_mm += step.traverse_mm;
        }
        let goals = achieved.iter().filter(|achieved| **achieved).count();
        curves.score.push(score.value());
        curves.goals.push(goals as f64);
        curves.operations.push(operations as f64);
        curves.traverse_m.push(traverse_mm as f64 / 1e3);
    }
    curves
}

/// The team's plan at the end. A rover that has not planned yet does what it has to.
fn team_plan(shared: &Shared, tally: &Tally) -> TeamPlan {
    let (problem, goals) = (&shared.problem, shared.instance.goals());
    let name = |task: usize| match task.checked_sub(goals) {
        Some(activity) => problem.activities[activity].name.clone(),
        None => problem.goals[task].name.clone(),
    };
    let unplanned = |rover: usize| -> Vec<PlannedStop> {
        let chain = Chain::new(&shared.instance, rover);
        chain.nodes().iter().map(PlannedStop::from).collect()
    };
    let stops = |(rover, steps): (usize, &Vec<PlannerStep>)| {
        let last = steps.last().map(|step| step.plan.clone());
        let plan = last.unwrap_or_else(|| unplanned(rover));
        let stops = plan.into_iter().map(|stop| Stop {
            task: name(stop.task as usize),
            sol: stop.sol as usize,
            start_ms: stop.start_ms,
        });
        stops.collect()
    };
    TeamPlan {
        rovers: tally.steps.iter().enumerate().map(stops).collect(),
    }
}

/// What came of a run.
pub(super) fn results(team: &Team) -> Results {
    let tally = team.tally.lock().unwrap_or_else(PoisonError::into_inner);
    let shared = &team.shared;
    let curves = curves(shared, &tally);
    let violated = violations(&shared.problem, &team_plan(shared, &tally));
    let last = |curve: &[f64]| curve.last().copied().unwrap_or(0.0);
    let steps = || tally.steps.iter().flatten();
    let goals_total = shared.instance.goals() as u32;
    let goals_achieved = last(&curves.goals) as u32;
    let operations: u64 = steps().map(|step| step.operations).sum();
    let metrics = PlanningMetrics {
        score: last(&curves.score),
        goals_total,
        goals_achieved,
        complete: goals_achieved == goals_total,
        traverse_m: last(&curves.traverse_m),
        shed: steps().map(|step| u64::from(step.shed)).sum(),
        reassigned: tally.reassigned,
        goals_deleted: tally.deleted.len() as u32,
        plan_violations: violated.len() as u32,
        plan_operations: operations + tally.central_operations,
        planner_steps: steps().count() as u64,
    };
    let mut results = Results::of(&metrics)
        .metric("score_by_step", by_step(curves.score))
        .metric("goals_by_step", by_step(curves.goals))
        .metric("operations_by_step", by_step(curves.operations))
        .metric("traverse_by_step", by_step(curves.traverse_m));
    results.line("score of the plan", format!("{:.2}", metrics.score));
    results.line(
        "goals in the plan",
        format!("{goals_achieved} of {goals_total}"),
    );
    results.line(
        "length of all drives",
        format!("{:.0} m", metrics.traverse_m),
    );
    let (shed, again) = (metrics.shed, metrics.reassigned);
    results.line("goals shed", format!("{shed}, {again} assigned again"));
    results.line("operations", metrics.plan_operations.to_string());
    results.violations = violated.iter().map(|one| format!("plan: {one}")).collect();
    results
}

/// A curve over steps, from 1.
fn by_step(values: Vec<f64>) -> Series {
    let index = (1..=values.len()).map(|step| step as f64).collect();
    let values = values.into_iter().map(Some).collect();
    Series::new(index, values).unwrap_or_default()
}
