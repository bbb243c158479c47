//! A complete search of plans: every flaw with all decisions that may put it right.
//!
//! Resources are looked at as they are at the earliest times, which satisfy all constraints. Where
//! a level breaks a limit, some pair of what contributes must be in order (precedence constraint
//! posting, as in A. Cesta, A. Oddi and S. F. Smith, *A Constraint-Based Method for Project
//! Scheduling with Time Windows*, 2002), or something must wait for what the problem gives. Each
//! decision excludes those that were tried before it, so that no schedule is looked for twice.

mod actions;
mod flaws;
mod over_use;
mod places;

use std::sync::Arc;

pub(super) use flaws::{first_gap, first_open, first_over_use, first_unbound};

use super::schedule::Schedule;
use super::{Decision, Flaw, Strategy};
use crate::Ticks;
use crate::database::{Conflict, Database, Open, Owner, Step, Time, TokenId};
use crate::model::{End, GoalId, Problem};
use crate::parameters::Operand;
use crate::temporal::{Constraint, Span};
use actions::{close, fill, make_room, precede};
use over_use::{assignments, over_use_decisions};
use places::{gap_decisions, goal_decisions, open_decisions};

/// How many values of a parameter are tried.
const VALUES: usize = 64;

/// All flaws of a schedule, with all their decisions.
#[derive(Clone, Debug)]
pub struct Complete {
    problem: Arc<Problem>,
    goals: Vec<TokenId>,
    /// By goal: whether the plan must have it.
    wanted: Vec<bool>,
    /// How many decisions were numbered: each is an owner of its own.
    decisions: u32,
    /// Whether an effect may go back to a resource that it was on: a search that takes decisions
    /// back in turn must not, or it would not end.
    pub(super) assigns_back: bool,
    /// Whether values of a parameter were left out: what failed then proves nothing.
    pub(super) left_out: bool,
}

impl Complete {
    /// For a schedule, with its mandatory goals.
    pub fn new(schedule: &Schedule) -> Self {
        let goals = schedule.problem.goals.iter();
        Complete {
            problem: schedule.problem.clone(),
            goals: schedule.goals.clone(),
            wanted: goals.map(|goal| goal.weight.is_none()).collect(),
            decisions: 0,
            assigns_back: false,
            left_out: false,
        }
    }

    /// Says whether the plan must have a goal.
    pub fn want(&mut self, goal: GoalId, wanted: bool) {
        self.wanted[goal] = wanted;
    }

    /// Whether the plan must have a goal.
    pub fn wants(&self, goal: GoalId) -> bool {
        self.wanted[goal]
    }

    /// The problem.
    pub fn problem(&self) -> &Arc<Problem> {
        &self.problem
    }

    /// By goal: its token.
    pub fn goals(&self) -> &[TokenId] {
        &self.goals
    }

    /// How many decisions were numbered.
    pub(crate) fn numbered(&self) -> u32 {
        self.decisions
    }

    /// An owner for a new decision.
    pub(super) fn owner(&mut self) -> Owner {
        self.decisions += 1;
        Owner::Decision(self.decisions)
    }
}

impl Strategy for Complete {
    fn next(&mut self, database: &mut Database) -> Option<Flaw> {
        if let Some(open) = first_open(database) {
            return Some(Flaw::Open(open));
        }
        let missing =
            |goal: &GoalId| self.wanted[*goal] && !Schedule::is_in(database, self.goals[*goal]);
        if let Some(goal) = (0..self.goals.len()).find(missing) {
            return Some(Flaw::Goal(self.goals[goal]));
        }
        if let Some((resource, over_use)) = first_over_use(database) {
            return Some(Flaw::OverUse {
                resource,
                bound: over_use.bound,
                tick: over_use.worst_tick,
            });
        }
        first_unbound(database).or_else(|| first_gap(database))
    }

    fn decisions(&mut self, database: &mut Database, flaw: Flaw, into: &mut Vec<Decision>) {
        match flaw {
            Flaw::Open(Open { instance, step }) => open_decisions(database, instance, step, into),
            Flaw::Goal(token) => {
                let pattern = &self.problem.goals[self.goal_of(token)].pattern;
                goal_decisions(database, pattern, token, into);
            }
            Flaw::OverUse {
                resource, bound, ..
            } => {
                let levels = database.levels(resource);
                if let Some(over_use) = levels.earliest.first_over_use_of(bound, Ticks::MIN) {
                    over_use_decisions(database, resource, &over_use, into);
                    let back = self.assigns_back;
                    assignments(database, resource, &over_use, back, into);
                }
            }
            Flaw::Unbound { token, parameter } => {
                let operand = database.token(token).map(|at| at.parameters[parameter]);
                if let Some(Operand::Variable(variable)) = operand {
                    let domain = database.store().domain(variable);
                    self.left_out |= domain.len() > VALUES as u64;
                    let values = domain.values();
                    into.extend(values.take(VALUES).map(Decision::Bind));
                }
            }
            Flaw::Gap { timeline, after } => gap_decisions(database, timeline, after, into),
        }
    }

    fn decide(
        &mut self,
        database: &mut Database,
        flaw: Flaw,
        decision: Decision,
    ) -> Result<(), Conflict> {
        if let Decision::Order(precedence, rank) = decision {
            let mut all = Vec::new();
            if rank > 0 {
                self.decisions(database, flaw, &mut all);
            }
            return database.attempt(|database| {
                for before in all.into_iter().take(rank as usize) {
                    if let Decision::Order(before, _) = before {
                        let owner = self.owner();
                        precede(database, before, false, owner)?;
                    }
                }
                let owner = self.owner();
                precede(database, precedence, true, owner)?;
                Ok(())
            });
        }
        self.carry_out(database, flaw, decision).map(|_| ())
    }
}

/// An order that was posted for a token, and whose it is.
pub(super) type Posted = (Option<(TokenId, Constraint)>, Owner);

impl Complete {
    /// Carries out a decision that excludes no other: what it posted, if that can be taken back.
    pub(super) fn carry_out(
        &mut self,
        database: &mut Database,
        flaw: Flaw,
        decision: Decision,
    ) -> Result<Posted, Conflict> {
        let owner = self.owner();
        let posted = match (flaw, decision) {
            (_, Decision::Order(precedence, _)) => precede(database, precedence, true, owner)?,
            (_, Decision::Wait { token, until }) => {
                let times = [Time::At(0), database.time(token, End::Start)];
                database.order_for(token, times, Span::at_least(until), owner)?
            }
            (Flaw::Gap { timeline, after }, Decision::Close) => {
                close(database, timeline, after, owner)?
            }
            _ => {
                self.put_right(database, flaw, decision, owner)?;
                None
            }
        };
        Ok((posted, owner))
    }

    /// Carries out a decision about tokens and values.
    fn put_right(
        &mut self,
        database: &mut Database,
        flaw: Flaw,
        decision: Decision,
        owner: Owner,
    ) -> Result<(), Conflict> {
        match (flaw, decision) {
            (
                _,
                Decision::Assign {
                    instance,
                    effect,
                    resource,
                },
            ) => database.assign(instance, effect, resource),
            (Flaw::Unbound { token, parameter }, Decision::Bind(value)) => {
                database.bind(token, parameter, value, owner)
            }
            (Flaw::Open(Open { instance, step }), decision) => match (step, decision) {
                (Step::Choice(choice), Decision::Alternative(alternative)) => {
                    database.choose(instance, choice, alternative);
                    Ok(())
                }
                (Step::Relation(relation), Decision::Support(token)) => {
                    database.support(instance, relation, token)
                }
                (Step::Relation(relation), Decision::Insert(slot)) => database
                    .insert_for(instance, relation, slot, None)
                    .map(|_| ()),
                (Step::Relation(relation), Decision::Displace { slot, token }) => {
                    database.attempt(|database| {
                        make_room(database, slot, token)?;
                        // Whoever asks may have gone with it.
                        if !database.open().contains(&Open { instance, step }) {
                            let owner = Owner::Token(token);
                            return Err(Conflict::Mismatch { owner });
                        }
                        database.insert_for(instance, relation, slot, None)?;
                        Ok(())
                    })
                }
                (Step::Relation(relation), Decision::Relate) => {
                    database.relate_labels(instance, relation)
                }
                _ => unreachable!("{decision:?} is no decision for {flaw:?}"),
            },
            (Flaw::Goal(token), decision) => self.put_goal(database, token, decision),
            (Flaw::Gap { after, .. }, Decision::Insert(slot)) => fill(database, slot, after, owner),
            _ => unreachable!("{decision:?} is no decision for {flaw:?}"),
        }
    }

    /// The goal that a token is.
    fn goal_of(&self, token: TokenId) -> GoalId {
        let goal = self.goals.iter().position(|&at| at == token);
        goal.expect("the token is a goal's")
    }

    fn put_goal(
        &mut self,
        database: &mut Database,
        token: TokenId,
        decision: Decision,
    ) -> Result<(), Conflict> {
        let goal = self.goal_of(token);
        let (problem, goals) = (&self.problem, &self.goals);
        match decision {
            Decision::Insert(slot) => Schedule::activate_goal(problem, goals, database, goal, slot),
            Decision::Displace { slot, token } => database.attempt(|database| {
                make_room(database, slot, token)?;
                Schedule::activate_goal(problem, goals, database, goal, slot)
            }),
            Decision::Support(into) => Schedule::merge_goal(problem, goals, database, goal, into),
            _ => unreachable!("{decision:?} is no decision for a goal"),
        }
    }
}
