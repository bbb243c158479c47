//! A problem in, a plan out: what the planners share, and the complete one.

use std::sync::Arc;

use super::complete::Complete;
use super::extract::extract;
use super::schedule::{LoadError, Schedule};
use super::{Counters, Failure, Stack, Verdict, chronological};
use crate::database::Owner;
use crate::model::{End, GoalId, Model, Problem};
use crate::objective::Objective;
use crate::plan::Plan;
use crate::temporal::Span;

/// How a planner is to be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// How many [operations](crate::database::Database::operations) it may take.
    pub operations: u64,
    /// From which its random choices follow, if it makes any.
    pub seed: u64,
}

/// What a planner found.
#[derive(Debug)]
pub struct Answer {
    /// The best plan; none, if there is none or none was found.
    pub plan: Option<Plan>,
    /// Whether it is proven: that the plan is the best one, or that there is none.
    pub proven: bool,
    /// The operations that it took.
    pub operations: u64,
    /// What its searches did.
    pub counters: Counters,
    /// Where the search for a plan failed, if there is none.
    pub failure: Option<Failure>,
    /// The problem in its database, as it was when the search ended.
    pub schedule: Schedule,
}

/// A planner: it finds a plan with all mandatory goals, and with those others that are worth it.
pub trait Planner {
    /// Its name.
    fn name(&self) -> &'static str;

    /// Plans.
    ///
    /// # Errors
    ///
    /// If what is the case cannot be.
    fn solve(
        &self,
        model: &Arc<Model>,
        problem: &Arc<Problem>,
        settings: Settings,
    ) -> Result<Answer, LoadError>;
}

/// Extends a plan flaw by flaw and takes the last decision back when nothing else can be done
/// ([`Complete`]). If all goals are mandatory it looks for the least makespan until it is proven;
/// else it tries goals by what they bring, most first.
#[derive(Clone, Copy, Debug, Default)]
pub struct Forward;

impl Planner for Forward {
    fn name(&self) -> &'static str {
        "forward"
    }

    fn solve(
        &self,
        model: &Arc<Model>,
        problem: &Arc<Problem>,
        settings: Settings,
    ) -> Result<Answer, LoadError> {
        let schedule = Schedule::new(model.clone(), problem.clone())?;
        let complete = Complete::new(&schedule);
        let mut run = Run {
            reasons: vec![String::new(); problem.goals.len()],
            limit: schedule.database.operations() + settings.operations,
            schedule,
            complete,
            stack: Stack::default(),
            settings,
            name: self.name(),
        };
        let (plan, failure, decided) = run.first();
        let (plan, proven) = match plan {
            None => (None, decided),
            Some(plan) if problem.goals.iter().all(|goal| goal.weight.is_none()) => {
                let (plan, proven) = run.shorten(plan);
                (Some(plan), proven)
            }
            Some(plan) => (Some(run.improve(plan)), false),
        };
        let operations = run.schedule.database.operations();
        Ok(Answer {
            plan,
            proven,
            operations,
            counters: run.stack.counters,
            failure,
            schedule: run.schedule,
        })
    }
}

/// A run of the complete planner.
struct Run {
    schedule: Schedule,
    complete: Complete,
    stack: Stack,
    settings: Settings,
    limit: u64,
    name: &'static str,
    /// By goal: why it is left out.
    reasons: Vec<String>,
}

impl Run {
    /// Searches from the problem as it was loaded, within a budget, and looks at what was found
    /// before all of it is undone.
    fn attempt(&mut self, budget: u64) -> (Verdict, Option<Plan>) {
        let left = self
            .limit
            .saturating_sub(self.schedule.database.operations());
        self.schedule.database.push();
        let database = &mut self.schedule.database;
        let budget = budget.min(left);
        let verdict = chronological(database, &mut self.complete, &mut self.stack, budget);
        let plan = matches!(verdict, Verdict::Solved).then(|| {
            let by = (
                self.name,
                self.settings.seed,
                self.schedule.database.operations(),
            );
            extract(&self.schedule, |goal| self.reasons[goal].clone(), by)
        });
        self.schedule.database.pop();
        (verdict, plan)
    }

    /// A plan with all mandatory goals, or why there is none, and whether that is proven.
    fn first(&mut self) -> (Option<Plan>, Option<Failure>, bool) {
        match self.attempt(u64::MAX) {
            (Verdict::Impossible(failure), _) => {
                let proven = !self.complete.left_out;
                (None, Some(failure), proven)
            }
            (Verdict::OverBudget, _) => (None, None, false),
            (Verdict::Solved, plan) => (plan, None, true),
        }
    }

    /// Looks for plans that end earlier, until there is none.
    fn shorten(&mut self, mut best: Plan) -> (Plan, bool) {
        loop {
            // Without goals nothing would be bounded.
            if best.makespan == 0 {
                return (best, true);
            }
            let bound = Span::at_most(best.makespan - 1);
            self.schedule.database.push();
            let mut allowed = true;
            for goal in 0..self.schedule.goals.len() {
                let token = self.schedule.goals[goal];
                let owner = Owner::Token(token);
                let database = &mut self.schedule.database;
                let bounded = database.restrict_time(token, End::Finish, bound, owner);
                allowed &= bounded.is_ok();
            }
            let found = match allowed {
                true => self.attempt(u64::MAX),
                false => {
                    self.schedule.database.pop();
                    return (best, true);
                }
            };
            self.schedule.database.pop();
            match found {
                (_, Some(plan)) => best = plan,
                (Verdict::Impossible(_), None) => return (best, !self.complete.left_out),
                (_, None) => return (best, false),
            }
        }
    }

    /// Takes goals in, the one that brings most first, each if there is a plan with it.
    fn improve(&mut self, mut best: Plan) -> Plan {
        let problem = self.schedule.problem.clone();
        let mut objective = Objective::new(&problem);
        let mut tried = vec![false; problem.goals.len()];
        for (goal, _) in problem.goals.iter().enumerate() {
            if self.complete.wants(goal) {
                objective.set(goal, true);
                tried[goal] = true;
            } else if self.schedule.refused[goal].is_some() {
                OF_ITSELF.clone_into(&mut self.reasons[goal]);
                tried[goal] = true;
            }
        }
        let mut left = tried.iter().filter(|tried| !**tried).count() as u64;
        while let Some(goal) = most_gain(&objective, &tried) {
            tried[goal] = true;
            if objective.gain(goal) <= 0.0 {
                self.reasons[goal] = "it would be worth nothing more".to_owned();
                continue;
            }
            let spent = self.schedule.database.operations();
            let share = self.limit.saturating_sub(spent) / left.max(1);
            left -= 1;
            self.complete.want(goal, true);
            match self.attempt(share) {
                (_, Some(plan)) => {
                    best = plan;
                    objective.set(goal, true);
                }
                (verdict, None) => {
                    self.complete.want(goal, false);
                    self.reasons[goal] = match verdict {
                        Verdict::OverBudget => "no plan with it was found in time".to_owned(),
                        _ if self.complete.left_out => {
                            "no plan with it was found among the values that were tried".to_owned()
                        }
                        _ => "there is no plan with it and those that are worth more".to_owned(),
                    };
                }
            }
        }
        for one in &mut best.left_out {
            let goal = problem.goals.iter().position(|goal| goal.name == one.goal);
            if let Some(goal) = goal {
                one.reason.clone_from(&self.reasons[goal]);
            }
        }
        best.operations = self.schedule.database.operations();
        best
    }
}

/// Why a goal is left out whose own bounds leave no time or value.
pub(super) const OF_ITSELF: &str = "what it says of times and values cannot be";

/// The goal not yet tried that brings most; of equals, the first.
pub(super) fn most_gain(objective: &Objective, tried: &[bool]) -> Option<GoalId> {
    let open = (0..tried.len()).filter(|&goal| !tried[goal]);
    open.fold(None, |best: Option<GoalId>, goal| match best {
        Some(best) if objective.gain(best) >= objective.gain(goal) => Some(best),
        _ => Some(goal),
    })
}
