//! Iterative repair: a plan is made by putting one conflict right after the other, in any order,
//! and by taking back whatever stands in the way.
//!
//! Section 3.1 of the MISUS paper: conflicts are resolved one by one, by moving, adding or deleting
//! activities; section 4.2: first a plan with what is mandatory, then goals are added, each the one
//! that brings most, and the best plan without conflicts is kept. A plan with mandatory goals only
//! is made shorter by flattening: some of the orders that its end rests on are taken back, and the
//! over-uses that come are put in another order (A. Cesta, A. Oddi and S. F. Smith, *Iterative
//! Flattening: A Scalable Method for Solving Multi-Capacity Scheduling Problems*, 2000).
//!
//! The database takes no edit that breaks times or values. So a decision that would is refused,
//! and the refusal says who stands in its way: one of those gives way then, an order that was
//! decided before, or a goal.

use std::sync::Arc;

use rand_pcg::Pcg32;

use super::choices::{Choices, below};
use super::complete::{Complete, first_gap, first_open, first_over_use, first_unbound};
use super::extract::extract;
use super::schedule::{LoadError, Schedule};
use super::solve::{Answer, OF_ITSELF, Planner, Settings, most_gain};
use super::{Counters, Decision, Failure, Flaw, Strategy};
use crate::Ticks;
use crate::database::{Cause, Conflict, Database, Owner, Status, TokenId};
use crate::model::{End, GoalId, Model, Problem};
use crate::objective::Objective;
use crate::plan::Plan;
use crate::temporal::{Constraint, Span};

/// How often a goal is deleted before the plan does without it: three times, as in the reading of
/// the MISUS paper.
const DELETIONS: u32 = 3;

/// How many conflicts are put right, for each goal, before a plan is given up for a new start.
const PATIENCE: u64 = 40;

/// The planner that repairs.
#[derive(Clone, Copy, Debug, Default)]
pub struct Repair {
    /// What it chooses where there is a choice.
    pub choices: Choices,
}

impl Planner for Repair {
    fn name(&self) -> &'static str {
        "repair"
    }

    fn solve(
        &self,
        model: &Arc<Model>,
        problem: &Arc<Problem>,
        settings: Settings,
    ) -> Result<Answer, LoadError> {
        self.run(model, problem, settings, Work::solve)
    }
}

impl Repair {
    /// The first plan that it finds with all mandatory goals.
    ///
    /// # Errors
    ///
    /// If what is the case cannot be.
    pub(crate) fn first(
        &self,
        model: &Arc<Model>,
        problem: &Arc<Problem>,
        settings: Settings,
    ) -> Result<Answer, LoadError> {
        self.run(model, problem, settings, Work::first)
    }

    fn run(
        &self,
        model: &Arc<Model>,
        problem: &Arc<Problem>,
        settings: Settings,
        find: fn(&mut Work, u64) -> (Option<Plan>, bool),
    ) -> Result<Answer, LoadError> {
        let schedule = Schedule::new(model.clone(), problem.clone())?;
        let mut complete = Complete::new(&schedule);
        complete.assigns_back = true;
        let limit = schedule.database.operations() + settings.operations;
        let mut work = Work {
            complete,
            choices: self.choices,
            random: Pcg32::new(settings.seed, STREAM),
            posted: Vec::new(),
            deletions: vec![0; problem.goals.len()],
            counters: Counters::default(),
            failure: None,
            limit,
            spent: 0,
            base: schedule.database.clone(),
            schedule,
        };
        let (plan, proven) = find(&mut work, settings.seed);
        Ok(Answer {
            proven,
            operations: work.operations(),
            counters: work.counters,
            failure: work.failure.take().filter(|_| plan.is_none()),
            schedule: work.schedule,
            plan,
        })
    }
}

/// The same where there is a plan already, and a shorter one is looked for.
const LESS_PATIENCE: u64 = 4;

/// How many attempts from the best plan there are for one from the problem as it was loaded.
const ANEW: u32 = 3;

/// The stream of the generator that is this planner's.
const STREAM: u64 = 0x7265_7061_6972;

/// An order that the repair decided, and can take back.
#[derive(Clone, Copy, Debug)]
struct Posted {
    token: TokenId,
    constraint: Constraint,
    owner: Owner,
}

/// What came of a conflict.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Progress {
    /// There is none.
    Complete,
    /// One was put right, or something gave way for it.
    Repaired,
    /// Nothing puts it right.
    Stuck,
}

/// A repair that goes on.
struct Work {
    schedule: Schedule,
    complete: Complete,
    choices: Choices,
    random: Pcg32,
    posted: Vec<Posted>,
    /// By goal: how often it was deleted.
    deletions: Vec<u32>,
    counters: Counters,
    failure: Option<Failure>,
    limit: u64,
    /// Operations of databases that were given up.
    spent: u64,
    /// The problem as it was loaded.
    base: Database,
}

impl Work {
    fn operations(&self) -> u64 {
        self.spent + self.schedule.database.operations()
    }

    fn is_over(&self) -> bool {
        self.operations() > self.limit
    }

    /// Goes back to a database as it was, and counts what was done since.
    fn return_to(&mut self, database: &Database, posted: &[Posted]) {
        // A copy is work too: else a start that fails at once would go on for ever.
        let copied = 1 + database.len() as u64;
        self.spent = self.operations() - database.operations() + copied;
        self.schedule.database.clone_from(database);
        self.posted.clear();
        self.posted.extend_from_slice(posted);
    }

    /// The best plan that is found, and whether it is proven.
    fn solve(&mut self, seed: u64) -> (Option<Plan>, bool) {
        let mut goals = self.complete.problem().goals.iter();
        if goals.any(|goal| goal.weight.is_some()) {
            (self.by_worth(seed), false)
        } else {
            self.by_makespan(seed)
        }
    }

    /// A plan with all mandatory goals, the first that is found.
    fn first(&mut self, seed: u64) -> (Option<Plan>, bool) {
        let patience = PATIENCE * (self.complete.goals().len() as u64 + 1);
        while !self.repair(patience) {
            if self.is_over() {
                return (None, false);
            }
            let base = self.base.clone();
            self.return_to(&base, &[]);
        }
        let by = ("repair", seed, self.operations());
        let plan = extract(&self.schedule, |_| String::new(), by);
        (Some(plan), false)
    }

    /// A plan with all mandatory goals, as short as can be found, and whether none is shorter.
    ///
    /// Each plan must end earlier than the best one. So what is tried is a repair of the best one,
    /// some of whose orders are taken back, or now and then of the problem as it was loaded.
    fn by_makespan(&mut self, seed: u64) -> (Option<Plan>, bool) {
        let mut best: Option<(Plan, Database, Vec<Posted>)> = None;
        let goals = self.complete.goals().len() as u64 + 1;
        let mut attempts = 0_u32;
        while !self.is_over() {
            let patience = if best.is_none() {
                PATIENCE
            } else {
                LESS_PATIENCE
            };
            if self.repair(patience * goals) {
                let by = ("repair", seed, self.operations());
                let plan = extract(&self.schedule, |_| String::new(), by);
                best = Some((plan, self.schedule.database.clone(), self.posted.clone()));
                attempts = 0;
            }
            attempts += 1;
            let Some((plan, database, posted)) = &best else {
                let base = self.base.clone();
                self.return_to(&base, &[]);
                continue;
            };
            let bound = plan.makespan - 1;
            if bound < 0 {
                return (best.map(|(plan, ..)| plan), true);
            }
            if attempts.is_multiple_of(ANEW) || posted.is_empty() {
                let base = self.base.clone();
                self.return_to(&base, &[]);
                if !self.end_by(bound) {
                    // Not even without resources.
                    return (best.map(|(plan, ..)| plan), true);
                }
                continue;
            }
            let (database, posted) = (database.clone(), posted.clone());
            self.return_to(&database, &posted);
            self.relax();
            while !self.end_by(bound) && !self.posted.is_empty() {
                self.relax();
            }
        }
        (best.map(|(plan, ..)| plan), false)
    }

    /// Says that all goals end by a tick; whether they can, as far as times say.
    fn end_by(&mut self, bound: Ticks) -> bool {
        let database = &mut self.schedule.database;
        self.complete.goals().iter().all(|&token| {
            let by = Span::at_most(bound);
            let bounded = database.restrict_time(token, End::Finish, by, Owner::Given);
            bounded.is_ok()
        })
    }

    /// Takes back as many orders as times rest on, or fewer, one at least.
    fn relax(&mut self) {
        let database = &self.schedule.database;
        let tight = self
            .posted
            .iter()
            .map(|at| database.is_tight(at.constraint));
        let mut costs: Vec<i64> = tight.map(|tight| i64::from(!tight)).collect();
        let tight = costs.iter().filter(|&&cost| cost == 0).count();
        // Options of the same cost come in any order.
        for last in (1..self.posted.len()).rev() {
            let other = below(&mut self.random, last + 1);
            self.posted.swap(last, other);
            costs.swap(last, other);
        }
        let goes = 1 + below(&mut self.random, tight.max(1));
        for _ in 0..goes.min(costs.len()) {
            let place = (self.choices.relaxed.pick)(&costs, &mut self.random);
            costs.swap_remove(place);
            self.take_back(place);
        }
    }

    fn take_back(&mut self, place: usize) {
        let posted = self.posted.swap_remove(place);
        let database = &mut self.schedule.database;
        database.take_back_order(posted.token, posted.constraint);
    }

    /// A plan with all mandatory goals and with others by what they bring, as section 4.2 says.
    fn by_worth(&mut self, seed: u64) -> Option<Plan> {
        let problem = self.complete.problem().clone();
        let patience = PATIENCE * (problem.goals.len() as u64 + 1);
        while !self.repair(patience) {
            if self.is_over() {
                return None;
            }
            let base = self.base.clone();
            self.return_to(&base, &[]);
        }
        let mut objective = Objective::new(&problem);
        let goals = 0..problem.goals.len();
        let mut closed: Vec<bool> = goals.map(|goal| self.complete.wants(goal)).collect();
        for (goal, &wanted) in closed.iter().enumerate() {
            objective.set(goal, wanted);
        }
        let mut best = (self.schedule.database.clone(), self.posted.clone());
        let mut reasons = vec!["it was never the goal that brings most".to_owned(); closed.len()];
        for (goal, refused) in self.schedule.refused.iter().enumerate() {
            if refused.is_some() {
                closed[goal] = true;
                OF_ITSELF.clone_into(&mut reasons[goal]);
            }
        }
        while !self.is_over() {
            let Some(goal) = most_gain(&objective, &closed) else {
                break;
            };
            if objective.gain(goal) <= 0.0 {
                for (goal, reason) in reasons.iter_mut().enumerate().filter(|at| !closed[at.0]) {
                    if objective.gain(goal) <= 0.0 {
                        "it would be worth nothing more".clone_into(reason);
                    }
                }
                break;
            }
            self.complete.want(goal, true);
            if self.repair(patience) {
                objective.set(goal, true);
                closed[goal] = true;
                best = (self.schedule.database.clone(), self.posted.clone());
                continue;
            }
            self.complete.want(goal, false);
            let (database, posted) = best.clone();
            self.return_to(&database, &posted);
            self.deletions[goal] += 1;
            if self.deletions[goal] == DELETIONS {
                closed[goal] = true;
                reasons[goal] = format!("no plan with it was found in {DELETIONS} attempts");
            }
        }
        let (database, posted) = best;
        self.return_to(&database, &posted);
        let by = ("repair", seed, self.operations());
        Some(extract(&self.schedule, |goal| reasons[goal].clone(), by))
    }

    /// Puts conflicts right until there are none; not if that takes more than so many, or if
    /// nothing puts one right.
    fn repair(&mut self, patience: u64) -> bool {
        for _ in 0..patience {
            if self.is_over() {
                return false;
            }
            match self.step() {
                Progress::Complete => return true,
                Progress::Repaired => {}
                Progress::Stuck => return false,
            }
        }
        false
    }

    /// The conflicts that there are, the first of each kind, with the rank of its kind.
    fn conflicts(&mut self) -> Vec<(i64, Flaw)> {
        let database = &mut self.schedule.database;
        let mut found = Vec::new();
        if let Some(open) = first_open(database) {
            found.push((0, Flaw::Open(open)));
        }
        let goals = self.complete.goals().iter().enumerate();
        for (goal, &token) in goals {
            if self.complete.wants(goal) && !Schedule::is_in(database, token) {
                found.push((1, Flaw::Goal(token)));
                break;
            }
        }
        if let Some((resource, over_use)) = first_over_use(database) {
            let (bound, tick) = (over_use.bound, over_use.worst_tick);
            found.push((
                2,
                Flaw::OverUse {
                    resource,
                    bound,
                    tick,
                },
            ));
        }
        found.extend(first_unbound(database).map(|flaw| (3, flaw)));
        found.extend(first_gap(database).map(|flaw| (4, flaw)));
        found
    }

    /// Looks at one conflict: a decision puts it right, or something gives way for one.
    fn step(&mut self) -> Progress {
        let conflicts = self.conflicts();
        if conflicts.is_empty() {
            return Progress::Complete;
        }
        let ranks: Vec<i64> = conflicts.iter().map(|at| at.0).collect();
        let chosen = (self.choices.conflict.pick)(&ranks, &mut self.random);
        let flaw = conflicts[chosen].1;
        let mut decisions = Vec::new();
        self.complete
            .decisions(&mut self.schedule.database, flaw, &mut decisions);
        let mut refusals: Vec<Conflict> = Vec::new();
        while !decisions.is_empty() {
            let costs: Vec<i64> = (0..).take(decisions.len()).collect();
            let chosen = (self.choices.decision.pick)(&costs, &mut self.random);
            let decision = decisions.remove(chosen);
            match self.carry_out(flaw, decision) {
                Ok(()) => {
                    self.counters.decisions += 1;
                    return Progress::Repaired;
                }
                Err(conflict) => {
                    self.counters.refusals += 1;
                    refusals.push(conflict);
                }
            }
            if self.is_over() {
                return Progress::Stuck;
            }
        }
        if self.give_way(flaw, &refusals) {
            self.counters.backtracks += 1;
            return Progress::Repaired;
        }
        let instance = match flaw {
            Flaw::Open(open) => Some(open.instance),
            _ => None,
        };
        let asks = instance.and_then(|at| self.schedule.database.instance(at));
        self.failure = Some(Failure {
            flaw,
            conflicts: refusals,
            instance,
            rule: asks.map(|at| at.rule),
        });
        Progress::Stuck
    }

    fn carry_out(&mut self, flaw: Flaw, decision: Decision) -> Result<(), Conflict> {
        let database = &mut self.schedule.database;
        let (posted, owner) = self.complete.carry_out(database, flaw, decision)?;
        if let Some((token, constraint)) = posted {
            self.posted.push(Posted {
                token,
                constraint,
                owner,
            });
        }
        Ok(())
    }

    /// Of those who stand in the way of a conflict's decisions one gives way: an order that was
    /// decided is taken back, or a goal is deleted. Whether there was one.
    fn give_way(&mut self, flaw: Flaw, refusals: &[Conflict]) -> bool {
        let mut owners: Vec<Owner> = refusals.iter().flat_map(Conflict::owners).collect();
        if let Flaw::OverUse {
            resource, bound, ..
        } = flaw
        {
            let levels = self.schedule.database.levels(resource);
            let over_use = levels.earliest.first_over_use_of(bound, Ticks::MIN);
            let contributors = over_use.into_iter().flat_map(|at| at.contributors);
            owners.extend(contributors.map(|at| at.owner));
        }
        owners.sort_unstable();
        owners.dedup();
        let mut culprits: Vec<(i64, Culprit)> = Vec::new();
        for owner in owners {
            if let Some(place) = self.posted.iter().position(|at| at.owner == owner) {
                culprits.push((0, Culprit::Order(place)));
            }
            let tokens = match owner {
                Owner::Token(token) | Owner::Merge(token) => vec![token],
                Owner::Rule { master, .. } => vec![master],
                Owner::Sequence { first, second } => vec![first, second],
                _ => Vec::new(),
            };
            for token in tokens {
                if let Some(goal) = self.root(token)
                    && !self.is_of(flaw, goal)
                {
                    let culprit = Culprit::Goal(goal);
                    if !culprits.iter().any(|at| at.1 == culprit) {
                        culprits.push((1, culprit));
                    }
                }
            }
        }
        if culprits.is_empty() {
            return false;
        }
        let costs: Vec<i64> = culprits.iter().map(|at| at.0).collect();
        let chosen = (self.choices.culprit.pick)(&costs, &mut self.random);
        match culprits[chosen].1 {
            Culprit::Order(place) => self.take_back(place),
            Culprit::Goal(goal) => self.delete(goal),
        }
        true
    }

    /// The goal for which a token is there, if it is for one.
    fn root(&self, token: TokenId) -> Option<GoalId> {
        let mut at = token;
        // A rule's master was there before the token, so this ends.
        loop {
            match self.schedule.database.token(at)?.cause {
                Cause::Goal(goal) => return Some(goal),
                Cause::Rule { master, .. } if master != at => at = master,
                _ => return None,
            }
        }
    }

    /// Whether a flaw is a goal's own.
    fn is_of(&self, flaw: Flaw, goal: GoalId) -> bool {
        match flaw {
            Flaw::Goal(token) => self.complete.goals()[goal] == token,
            _ => false,
        }
    }

    /// Takes a goal out of the plan: it is a conflict again, and is put elsewhere.
    fn delete(&mut self, goal: GoalId) {
        let database = &mut self.schedule.database;
        let token = self.complete.goals()[goal];
        match database.token(token).map(|at| at.status) {
            Some(Status::Active) => database.deactivate(token),
            Some(Status::Merged(_)) => database.unmerge(token),
            _ => {}
        }
        self.posted
            .retain(|at| database.network().constraint(at.constraint).is_some());
    }
}

/// What may give way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Culprit {
    /// An order, by its place among those that were posted.
    Order(usize),
    /// A goal.
    Goal(GoalId),
}
