//! A problem in a plan database: facts in place, goals as free tokens.

use std::sync::Arc;

use smallvec::SmallVec;

use crate::database::{Cause, Conflict, Database, Owner, Slot, Status, TokenId, Wanted};
use crate::model::{Argument, Bound, Distance, End, Fact, Goal, GoalId, Model, Problem};
use crate::parameters::Operand;
use crate::temporal::Span;

/// A problem, and the plan for it that is in the making.
#[derive(Debug)]
pub struct Schedule {
    /// The plan.
    pub database: Database,
    /// The problem.
    pub problem: Arc<Problem>,
    /// By goal: its token.
    pub goals: Vec<TokenId>,
    /// By fact: its token.
    pub facts: Vec<TokenId>,
    /// By goal: why it cannot be of itself, if it cannot and need not: its token is rejected.
    pub refused: Vec<Option<Conflict>>,
}

/// Why a problem is none: what is the case cannot be.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// A fact that cannot be, with those before it and what their rules say of times and values.
    #[error("fact {fact} cannot be: {conflict}")]
    Fact {
        /// Its place in the problem.
        fact: usize,
        /// Why.
        conflict: Conflict,
    },
    /// A mandatory goal whose own bounds leave no time or value.
    #[error("goal {goal} cannot be: {conflict}")]
    Goal {
        /// Its place in the problem.
        goal: GoalId,
        /// Why.
        conflict: Conflict,
    },
    /// Levels of a resource that add up to more than can be counted.
    #[error("levels beyond what can be counted: {conflict}")]
    Level {
        /// Why.
        conflict: Conflict,
    },
}

impl Schedule {
    /// Puts facts on their timelines, and makes a free token of each goal.
    ///
    /// # Errors
    ///
    /// If what is the case cannot be, or a mandatory goal cannot be of itself.
    pub fn new(model: Arc<Model>, problem: Arc<Problem>) -> Result<Self, LoadError> {
        let mut schedule = Schedule::empty(model, problem);
        schedule.load()?;
        Ok(schedule)
    }

    /// A problem of which nothing is in the database yet.
    pub(crate) fn empty(model: Arc<Model>, problem: Arc<Problem>) -> Self {
        Schedule {
            database: Database::new(model, Span::new(0, problem.horizon)),
            goals: Vec::with_capacity(problem.goals.len()),
            facts: Vec::with_capacity(problem.facts.len()),
            refused: Vec::with_capacity(problem.goals.len()),
            problem,
        }
    }

    /// Puts everything into an empty database, up to what is refused.
    pub(crate) fn load(&mut self) -> Result<(), LoadError> {
        let problem = self.problem.clone();
        let database = &mut self.database;
        for &(resource, initial) in &problem.initial {
            let change = initial - database.model().resources[resource].initial;
            let changed = database.change_level(resource, 0, change);
            changed.map_err(|conflict| LoadError::Level { conflict })?;
        }
        for &(resource, tick, change) in &problem.changes {
            let changed = database.change_level(resource, tick, change);
            changed.map_err(|conflict| LoadError::Level { conflict })?;
        }
        let mut places: Vec<usize> = (0..problem.facts.len()).collect();
        // On a timeline, facts follow each other in the order of their starts.
        places.sort_by_key(|&place| (problem.facts[place].start.min, place));
        let mut facts: Vec<Option<TokenId>> = vec![None; problem.facts.len()];
        for place in places {
            let token = self.put_fact(place, &problem.facts[place]);
            facts[place] = Some(token.map_err(|conflict| LoadError::Fact {
                fact: place,
                conflict,
            })?);
        }
        self.facts = facts.into_iter().flatten().collect();
        for (place, goal) in problem.goals.iter().enumerate() {
            let refused = |conflict| LoadError::Goal {
                goal: place,
                conflict,
            };
            let (token, why_not) = match self.want(place, goal, true) {
                Ok(token) => (token, None),
                Err(conflict) if goal.weight.is_none() => return Err(refused(conflict)),
                Err(conflict) => {
                    let token = self.want(place, goal, false).map_err(refused)?;
                    self.database.reject(token);
                    (token, Some(conflict))
                }
            };
            self.refused.push(why_not);
            self.goals.push(token);
        }
        Ok(())
    }

    fn put_fact(&mut self, place: usize, fact: &Fact) -> Result<TokenId, Conflict> {
        let values = fact.values.iter().map(|value| value.map(Operand::Value));
        let parameters: SmallVec<[Option<Operand>; 4]> = values.collect();
        self.database.attempt(|database| {
            let token = database.insert(Wanted {
                predicate: fact.predicate,
                timeline: Some(fact.timeline),
                parameters: &parameters,
                start: None,
                finish: None,
                cause: Cause::Fact(place),
            })?;
            let owner = Owner::Token(token);
            database.restrict_time(token, End::Start, fact.start, owner)?;
            database.restrict_time(token, End::Finish, fact.finish, owner)?;
            let after = database.last(fact.timeline);
            let timeline = fact.timeline;
            database.activate(token, Slot { timeline, after })?;
            Ok(token)
        })
    }

    /// A goal's token, free; `bounded` by what the goal says of its times.
    fn want(&mut self, place: GoalId, goal: &Goal, bounded: bool) -> Result<TokenId, Conflict> {
        self.database.attempt(|database| {
            let mut variables: SmallVec<[Option<Operand>; 4]> =
                SmallVec::from_elem(None, goal.variables.len());
            for argument in &goal.pattern.arguments {
                if let Argument::Variable(variable) = *argument
                    && variables[variable].is_none()
                {
                    let of = goal.variables[variable].of;
                    variables[variable] = Some(database.new_variable(of));
                }
            }
            let arguments = goal.pattern.arguments.iter();
            let parameters: SmallVec<[Option<Operand>; 4]> = arguments
                .map(|argument| match *argument {
                    Argument::Any => None,
                    Argument::Value(value) => Some(Operand::Value(value)),
                    Argument::Variable(variable) => variables[variable],
                })
                .collect();
            let token = database.insert(Wanted {
                predicate: goal.pattern.predicate,
                timeline: goal.pattern.timelines.first().copied(),
                parameters: &parameters,
                start: None,
                finish: None,
                cause: Cause::Goal(place),
            })?;
            if bounded {
                let owner = Owner::Token(token);
                database.restrict_time(token, End::Start, goal.start, owner)?;
                database.restrict_time(token, End::Finish, goal.finish, owner)?;
                database.restrict_duration(token, goal.duration, owner)?;
            }
            Ok(token)
        })
    }

    /// Puts a goal's token on a timeline, with the problem's orders to the goals that are in the
    /// plan.
    ///
    /// # Errors
    ///
    /// If it cannot be there: nothing changes.
    pub fn activate_goal(
        problem: &Problem,
        goals: &[TokenId],
        database: &mut Database,
        goal: GoalId,
        slot: Slot,
    ) -> Result<(), Conflict> {
        database.attempt(|database| {
            database.activate(goals[goal], slot)?;
            Schedule::order_goal(problem, goals, database, goal)
        })
    }

    /// A goal's token is done by an active one, with the problem's orders.
    ///
    /// # Errors
    ///
    /// If it cannot be: nothing changes.
    pub fn merge_goal(
        problem: &Problem,
        goals: &[TokenId],
        database: &mut Database,
        goal: GoalId,
        into: TokenId,
    ) -> Result<(), Conflict> {
        database.attempt(|database| {
            database.merge(goals[goal], into)?;
            Schedule::order_goal(problem, goals, database, goal)
        })
    }

    /// Posts the problem's orders between a goal that is in the plan now and the others that are.
    fn order_goal(
        problem: &Problem,
        goals: &[TokenId],
        database: &mut Database,
        goal: GoalId,
    ) -> Result<(), Conflict> {
        for (place, order) in problem.orders.iter().enumerate() {
            let other = match (order.from == goal, order.to == goal) {
                (true, _) => order.to,
                (_, true) => order.from,
                _ => continue,
            };
            if other != goal && !Schedule::is_in(database, goals[other]) {
                continue;
            }
            let (from, to) = (goals[order.from], goals[order.to]);
            for distance in &order.distances {
                let span = span_of(distance);
                let times = [(from, distance.from), (to, distance.to)];
                let times = times.map(|(token, end)| database.time(token, end));
                database.order_for(goals[goal], times, span, Owner::Order(place))?;
            }
        }
        Ok(())
    }

    /// Whether a token is in the plan: active, or merged into one that is.
    pub fn is_in(database: &Database, token: TokenId) -> bool {
        let status = database.token(token).map(|at| at.status);
        matches!(status, Some(Status::Active | Status::Merged(_)))
    }
}

/// The bounds of a distance whose bounds are values.
fn span_of(distance: &Distance) -> Span {
    let value = |bound, none| match bound {
        Bound::Value(value) => value,
        Bound::None | Bound::Variable(_) => none,
    };
    let span = Span::new(value(distance.min, i64::MIN), value(distance.max, i64::MAX));
    if distance.backward {
        span.negated()
    } else {
        span
    }
}
