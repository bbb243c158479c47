//! What a run of planners amounts to: what the team's plan is worth, step by step, and at what cost.

use std::sync::{OnceLock, PoisonError};

use farside_actors::system::Better::{Higher, Lower, Neither};
use farside_actors::system::MetricKind::{Number, Rate, Series as Curve};
use farside_actors::system::{Metric, Results, Series, SeriesIndex, with_about};
use serde::Serialize;

use super::assemble::Team;
use super::messages::{PlanSettled, PlannedStop, PlannerStep};
use super::monitor::Tally;
use super::shared::Shared;
use crate::planner::casper::{Casper, Unmet};
use crate::planner::chain::{Chain, Visit};
use crate::planner::instance::Instance;
use crate::planner::plan::{PlanViolation, Stop, TeamPlan, violations};
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
const ALL: [Metric; 21] = [
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
        "goals in the plan, by step",
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
        "half_plans",
        "goals for two that one goes to alone",
        "goals",
        Number,
        Lower,
    ),
    Metric::new(
        "halves_withdrawn",
        "halves of pairs withdrawn",
        "goals",
        Number,
        Neither,
    ),
    Metric::new(
        "joint_goals_achieved",
        "goals for two rovers in the plan",
        "goals",
        Number,
        Higher,
    ),
    Metric::new(
        "joint_goals_total",
        "goals for two rovers of the problem",
        "goals",
        Number,
        Neither,
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
    Metric::new(
        "score_bound",
        "proven bound of the score",
        "",
        Number,
        Neither,
    ),
    curve(
        "score_by_step",
        "score of the plan, by step",
        "",
        Higher,
        "What the team's plan is worth by Equation 1 after each optimisation step. Source: the MISUS paper, \
         Figure 3.",
    ),
    Metric::new(
        "score_gap",
        "score below the proven bound",
        "",
        Number,
        Lower,
    ),
    Metric::new("shed", "goals shed", "goals", Number, Neither),
    curve(
        "traverse_by_step",
        "length of all drives, by step",
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
        /// What no plan of the problem is worth more than, if that is proved and `problem.bounds` has it.
        pub score_bound: Option<f64>,
        /// By which share of the bound the plan is worth less, from 0, if a bound is known. What it is
        /// made of, who planned or who proved, it does not say.
        pub score_gap: Option<f64>,
        /// How many goals there are.
        pub goals_total: u32,
        /// How many goals the team's plan achieves at the end.
        ///
        /// Source: the MISUS paper, Figure 4.
        pub goals_achieved: u32,
        /// Whether the team's plan achieves all goals.
        pub complete: bool,
        /// How many goals there are that need two rovers at one time.
        pub joint_goals_total: u32,
        /// How many of these two rovers plan for one time, and know that both do.
        pub joint_goals_achieved: u32,
        /// How many of these one rover goes to alone: it has heard the centre's last word, and the other has
        /// not until the end of the run. They are worth nothing.
        pub half_plans: u32,
        /// How often a rover took its half of such a goal out of its plan, because the other had shed it or
        /// had no room for it.
        pub halves_withdrawn: u64,
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
pub(super) struct Curves {
    pub(super) score: Vec<f64>,
    pub(super) goals: Vec<f64>,
    operations: Vec<f64>,
    pub(super) traverse_m: Vec<f64>,
}

impl Curves {
    /// What plans come to replaces what the last step came to.
    fn conclude(&mut self, worth: &Worth) {
        let last = |curve: &mut Vec<f64>, value: f64| {
            if let Some(last) = curve.last_mut() {
                *last = value;
            }
        };
        last(&mut self.score, worth.score);
        last(&mut self.goals, worth.goals.into());
        last(&mut self.traverse_m, worth.traverse_m);
    }
}

/// What plans of all rovers are worth together.
struct Worth {
    score: f64,
    goals: u32,
    joint_goals: u32,
    half_plans: u32,
    traverse_m: f64,
}

/// The plan of a rover, and how far it drives.
pub(super) type Route<'a> = (&'a [PlannedStop], u64);

/// What rovers plan, as far as they have recorded it.
pub(super) fn recorded(tally: &Tally) -> Vec<Route<'_>> {
    let rovers = tally.settled.iter().zip(&tally.steps);
    let plan = rovers.map(|(settled, steps)| match (settled, steps.last()) {
        (Some(settled), _) => (&settled.plan[..], settled.traverse_mm),
        (None, Some(step)) => (&step.plan[..], step.traverse_mm),
        (None, None) => (&[][..], 0),
    });
    plan.collect()
}

/// By goal: when plans begin it.
fn starts_ms(instance: &Instance, plans: &[Route<'_>]) -> Vec<Vec<i64>> {
    let mut starts = vec![Vec::new(); instance.goals()];
    for stop in plans.iter().flat_map(|(plan, _)| *plan) {
        if let Some(starts) = starts.get_mut(stop.task as usize) {
            starts.push(stop.start_ms);
        }
    }
    starts
}

/// Whether as many rovers begin a goal at a time as it needs.
fn is_whole(instance: &Instance, goal: usize, starts_ms: &[i64], start_ms: i64) -> bool {
    let together = starts_ms.iter().filter(|start| **start == start_ms);
    together.count() >= instance.task(goal).rovers as usize
}

/// By goal: whether plans achieve it.
pub(super) fn achieved(instance: &Instance, plans: &[Route<'_>]) -> Vec<bool> {
    let starts_ms = starts_ms(instance, plans);
    let goals = starts_ms.iter().enumerate();
    let achieved = goals.map(|(goal, starts_ms)| {
        let mut starts = starts_ms.iter();
        starts.any(|start| is_whole(instance, goal, starts_ms, *start))
    });
    achieved.collect()
}

/// What plans are worth together. A goal for two rovers counts if two begin it at one time.
fn worth(instance: &Instance, score: &mut Score, plans: &[Route<'_>]) -> Worth {
    let goals = instance.goals();
    let starts_ms = starts_ms(instance, plans);
    let achieved = achieved(instance, plans);
    let achieved = || (0..goals).filter(|goal| achieved[*goal]);
    let mut half_plans = 0;
    for (rover, (plan, _)) in plans.iter().enumerate() {
        let stops = plan.iter().filter(|stop| (stop.task as usize) < goals);
        let (whole, half): (Vec<&PlannedStop>, Vec<&PlannedStop>) = stops.partition(|stop| {
            let goal = stop.task as usize;
            is_whole(instance, goal, &starts_ms[goal], stop.start_ms)
        });
        let held: Vec<usize> = whole.iter().map(|stop| stop.task as usize).collect();
        score.hear(rover, &held);
        half_plans += half.len() as u32;
    }
    Worth {
        score: score.value(),
        goals: achieved().count() as u32,
        joint_goals: achieved().filter(|goal| instance.is_joint(*goal)).count() as u32,
        half_plans,
        traverse_m: plans.iter().map(|(_, mm)| mm).sum::<u64>() as f64 / 1e3,
    }
}

/// The team after each step; a rover that made fewer steps than others keeps its last plan.
pub(super) fn curves(shared: &Shared, tally: &Tally) -> Curves {
    let mut score = Score::new(&shared.instance);
    let mut curves = Curves::default();
    let most = tally.steps.iter().map(Vec::len).max().unwrap_or(0);
    for at in 0..most {
        let made = tally.steps.iter().filter_map(|steps| steps.get(at));
        let operations: u64 = made.map(|step| step.operations).sum();
        let plans = tally.steps.iter().map(|steps| {
            let step = steps.get(at).or(steps.last());
            step.map_or((&[][..], 0), |step| (&step.plan[..], step.traverse_mm))
        });
        let plans: Vec<Route<'_>> = plans.collect();
        let worth = worth(&shared.instance, &mut score, &plans);
        curves.score.push(worth.score);
        curves.goals.push(worth.goals.into());
        curves.operations.push(operations as f64);
        curves.traverse_m.push(worth.traverse_m);
    }
    curves
}

/// What each rover carries out. One that has not planned yet does what it has to; one that has not heard which
/// goals for two rovers both have planned does none.
fn carried_out(shared: &Shared, tally: &Tally) -> Vec<(Vec<PlannedStop>, u64)> {
    let instance = &shared.instance;
    let of = |chain: &Chain| {
        let stops = chain.nodes().iter().map(PlannedStop::from);
        (stops.collect(), chain.drive_mm(instance))
    };
    let rovers = tally.settled.iter().zip(&tally.steps).enumerate();
    let plan = |(rover, (settled, steps)): (usize, (&Option<PlanSettled>, &Vec<PlannerStep>))| {
        if let Some(settled) = settled {
            return (settled.plan.clone(), settled.traverse_mm);
        }
        let Some(last) = steps.last() else {
            return of(&Chain::new(instance, rover));
        };
        let is_joint = |stop: &PlannedStop| {
            let task = stop.task as usize;
            task < instance.goals() && instance.is_joint(task)
        };
        if !last.plan.iter().any(is_joint) {
            return (last.plan.clone(), last.traverse_mm);
        }
        let alone = alone(shared, rover, &last.plan);
        of(&alone.unwrap_or_else(|_| Chain::new(instance, rover)))
    };
    rovers.map(plan).collect()
}

/// A rover's plan without the goals that it cannot do alone.
fn alone(shared: &Shared, rover: usize, plan: &[PlannedStop]) -> Result<Chain, Unmet> {
    let instance = &shared.instance;
    let mut casper = Casper::new(instance, rover, &shared.planner, shared.key)?;
    let goals = plan.iter().filter(|stop| {
        let task = stop.task as usize;
        task < instance.goals() && !instance.is_joint(task)
    });
    let mut visits = Vec::new();
    for stop in goals {
        let goal = stop.task as usize;
        casper.assign(instance, goal, None)?;
        visits.push((stop.sol as usize, Visit::new(instance, goal)));
    }
    casper.resume(instance, &visits)?;
    Ok(casper.plan().clone())
}

/// The team's plan at the end, by name.
fn team_plan(shared: &Shared, plans: &[(Vec<PlannedStop>, u64)]) -> TeamPlan {
    let (problem, goals) = (&shared.problem, shared.instance.goals());
    let name = |task: usize| match task.checked_sub(goals) {
        Some(activity) => problem.activities[activity].name.clone(),
        None => problem.goals[task].name.clone(),
    };
    let stops = |(plan, _): &(Vec<PlannedStop>, u64)| {
        let stops = plan.iter().map(|stop| Stop {
            task: name(stop.task as usize),
            sol: stop.sol as usize,
            start_ms: stop.start_ms,
        });
        stops.collect()
    };
    TeamPlan {
        rovers: plans.iter().map(stops).collect(),
    }
}

/// Whether fewer rovers do a goal than it needs. That is counted by itself: it is what became of the last word.
fn is_half(violation: &PlanViolation) -> bool {
    match violation {
        PlanViolation::Together {
            rovers, expected, ..
        } => *rovers < *expected as usize,
        _ => false,
    }
}

/// What came of a run.
pub(super) fn results(team: &Team) -> Results {
    let tally = team.tally.lock().unwrap_or_else(PoisonError::into_inner);
    let shared = &team.shared;
    let plans = carried_out(shared, &tally);
    let routes: Vec<Route<'_>> = plans.iter().map(|(plan, mm)| (&plan[..], *mm)).collect();
    let worth = worth(&shared.instance, &mut Score::new(&shared.instance), &routes);
    let mut curves = curves(shared, &tally);
    curves.conclude(&worth);
    let mut violated = violations(&shared.problem, &team_plan(shared, &plans));
    violated.retain(|violation| !is_half(violation));
    let metrics = metrics(shared, &tally, &worth, violated.len() as u32);
    let mut results = Results::of(&metrics)
        .metric("score_by_step", by_step(curves.score))
        .metric("goals_by_step", by_step(curves.goals))
        .metric("operations_by_step", by_step(curves.operations))
        .metric("traverse_by_step", by_step(curves.traverse_m));
    lines(&metrics, &mut results);
    results.violations = violated.iter().map(|one| format!("plan: {one}")).collect();
    results
}

fn metrics(shared: &Shared, tally: &Tally, worth: &Worth, violated: u32) -> PlanningMetrics {
    let instance = &shared.instance;
    let steps = || tally.steps.iter().flatten();
    let goals_total = instance.goals() as u32;
    let joint = (0..instance.goals()).filter(|goal| instance.is_joint(*goal));
    let operations: u64 = steps().map(|step| step.operations).sum();
    let settled = tally.settled.iter().flatten();
    let withdrawn = settled.map(|settled| u64::from(settled.withdrawn));
    PlanningMetrics {
        score: worth.score,
        score_bound: shared.bound,
        score_gap: shared
            .bound
            .filter(|bound| *bound > 0.0)
            .map(|bound| 1.0 - worth.score / bound),
        goals_total,
        goals_achieved: worth.goals,
        complete: worth.goals == goals_total,
        joint_goals_total: joint.count() as u32,
        joint_goals_achieved: worth.joint_goals,
        half_plans: worth.half_plans,
        halves_withdrawn: steps().map(|step| u64::from(step.withdrawn)).sum::<u64>()
            + withdrawn.sum::<u64>(),
        traverse_m: worth.traverse_m,
        shed: steps().map(|step| u64::from(step.shed)).sum(),
        reassigned: tally.reassigned,
        goals_deleted: tally.deleted.len() as u32,
        plan_violations: violated,
        plan_operations: operations + tally.central_operations,
        planner_steps: steps().count() as u64,
    }
}

/// The same for people.
fn lines(metrics: &PlanningMetrics, results: &mut Results) {
    let score = match (metrics.score_bound, metrics.score_gap) {
        (Some(bound), Some(gap)) => {
            let percent = 100.0 * gap;
            format!(
                "{:.2}, {percent:.1} % below the proven bound {bound:.2}",
                metrics.score
            )
        }
        _ => format!("{:.2}", metrics.score),
    };
    results.line("score of the plan", score);
    let (achieved, total) = (metrics.goals_achieved, metrics.goals_total);
    results.line("goals in the plan", format!("{achieved} of {total}"));
    if metrics.joint_goals_total > 0 {
        let (joint, total) = (metrics.joint_goals_achieved, metrics.joint_goals_total);
        let half = metrics.half_plans;
        results.line(
            "goals for two rovers",
            format!("{joint} of {total}, {half} by one alone"),
        );
    }
    let traverse_m = metrics.traverse_m;
    results.line("length of all drives", format!("{traverse_m:.0} m"));
    let (shed, again) = (metrics.shed, metrics.reassigned);
    results.line("goals shed", format!("{shed}, {again} assigned again"));
    results.line("operations", metrics.plan_operations.to_string());
}

/// A curve over steps, from 1.
fn by_step(values: Vec<f64>) -> Series {
    let index = (1..=values.len()).map(|step| step as f64).collect();
    let values = values.into_iter().map(Some).collect();
    Series::new(index, values).unwrap_or_default()
}
