//! An executive: a plan that is extended one latency ahead, cycle by cycle.
//!
//! Section 2 of the IDEA paper: an agent wakes at multiples of its latency, learns what ended and
//! which values came back, and decides what each timeline says until it wakes again. What it does
//! not need any more it deletes (section 4). What a relation asks for is *due* once the end that
//! it speaks of is now; a token that it asks for starts now, in place of the present one if that
//! may end, or is the one that started now already. A condition ([`Relation::condition`]) is
//! fulfilled by a token that is there, and by no other. Where a token ended and nothing was asked
//! for, a timeline says its default.
//!
//! [`Relation::condition`]: crate::model::Relation::condition

mod ahead;
mod endings;
mod later;
mod now;
mod posted;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use smallvec::SmallVec;

use super::schedule::LoadError;
use super::{Counters, Stack, Verdict, chronological};
use crate::Ticks;
use crate::database::{Cause, Conflict, Database, Owner, Slot, Time, TokenId, Wanted};
use crate::model::{End, Fact, Model, PredicateId, Problem, TimelineId, Value};
use crate::parameters::Operand;
use crate::temporal::{FURTHEST, Span};
pub use ahead::{Branch, Following};
use endings::make_room;
pub use now::{MergeScan, Propagation};
use now::{Now, expire};
use posted::Posted;

/// A plan that is extended one latency ahead.
///
/// ```
/// use std::sync::Arc;
/// use farside_planning::language::{Options, read_model};
/// use farside_planning::search::{Verdict, executive::Executive};
/// # let text = include_str!("../../models/polling.ddl");
/// let model = read_model("polling.ddl", text, &Options::default()).value.expect("it is right");
/// let mut executive = Executive::new(Arc::new(model));
/// assert!(matches!(executive.cycle(0, 10_000), Verdict::Solved));
/// ```
pub struct Executive {
    database: Database,
    now: Now,
    stack: Stack,
    begun: bool,
    goals: Vec<Posted>,
    cancels: Vec<TokenId>,
    /// Whether the past is deleted after each cycle.
    pub forgets: bool,
}

impl Executive {
    /// With nothing on its timelines yet: the first cycle puts their defaults there.
    pub fn new(model: Arc<Model>) -> Self {
        let now = Now::of(&model);
        Executive {
            database: Database::new(model, Span::new(0, FURTHEST)),
            now,
            stack: Stack::default(),
            begun: false,
            goals: Vec::new(),
            cancels: Vec::new(),
            forgets: true,
        }
    }

    /// With what a problem says is the case, as it is at the start of the horizon.
    ///
    /// # Errors
    ///
    /// If a fact cannot be, with those before it.
    pub fn begin(model: Arc<Model>, problem: &Problem) -> Result<Self, LoadError> {
        let mut executive = Executive::new(model);
        for (fact, at) in problem.facts.iter().enumerate() {
            let put = executive.put_fact(fact, at);
            put.map_err(|conflict| LoadError::Fact { fact, conflict })?;
        }
        Ok(executive)
    }

    fn put_fact(&mut self, fact: usize, at: &Fact) -> Result<(), Conflict> {
        let parameters: SmallVec<[Option<Operand>; 4]> = at
            .values
            .iter()
            .map(|value| value.map(Operand::Value))
            .collect();
        self.database.attempt(|database| {
            let known = |span: Span| (span.min == span.max).then_some(Time::At(span.min));
            let token = database.insert(Wanted {
                predicate: at.predicate,
                timeline: Some(at.timeline),
                parameters: &parameters,
                start: known(at.start),
                finish: known(at.finish),
                cause: Cause::Fact(fact),
            })?;
            let owner = Owner::Token(token);
            database.restrict_time(token, End::Start, at.start, owner)?;
            database.restrict_time(token, End::Finish, at.finish, owner)?;
            let (timeline, after) = (at.timeline, database.last(at.timeline));
            database.activate(token, Slot { timeline, after })
        })
    }

    /// Its database, to be asked.
    #[inline]
    pub fn database(&self) -> &Database {
        &self.database
    }

    /// What its searches did.
    pub fn counters(&self) -> Counters {
        let mut counters = self.stack.counters;
        counters.guards += self.now.guards;
        counters
    }

    /// The token that a timeline says now.
    pub fn present(&self, timeline: TimelineId) -> Option<TokenId> {
        self.database.last(timeline)
    }

    /// Puts a token on a timeline from a tick on, as a goal from elsewhere does; the present one
    /// ends then.
    ///
    /// # Errors
    ///
    /// If it cannot be there: nothing changes.
    pub fn start(
        &mut self,
        timeline: TimelineId,
        predicate: PredicateId,
        parameters: &[Option<Value>],
        tick: Ticks,
    ) -> Result<TokenId, Conflict> {
        let parameters: Vec<Option<Operand>> = parameters
            .iter()
            .map(|value| value.map(Operand::Value))
            .collect();
        let (now, endings) = (tick, &self.now.endings);
        self.database.attempt(|database| {
            let after = make_room(database, endings, timeline, now)?;
            let token = database.insert(Wanted {
                predicate,
                timeline: Some(timeline),
                parameters: &parameters,
                start: Some(Time::At(now)),
                finish: None,
                cause: Cause::User,
            })?;
            database.activate(token, Slot { timeline, after })?;
            Ok(token)
        })
    }

    /// A status came back for a token: outputs have values now, those that are given, and the token
    /// ends as soon as it may, if the status ends it.
    ///
    /// # Errors
    ///
    /// If an output cannot have the value, or the token not end: nothing changes.
    pub fn report<O: Copy + Into<Option<Value>>>(
        &mut self,
        token: TokenId,
        outputs: &[O],
        ends: bool,
        tick: Ticks,
    ) -> Result<(), Conflict> {
        if self.now.propagation == Propagation::Full {
            let missed = self.database.propagate_fully();
            debug_assert!(missed.is_ok(), "{missed:?}");
        }
        self.database.attempt(|database| {
            let Some(at) = database.token(token) else {
                return Ok(());
            };
            let inputs = database.model().predicates[at.predicate].inputs;
            let mut known: SmallVec<[Value; 4]> = SmallVec::new();
            for (place, &output) in (inputs..).zip(outputs) {
                match output.into() {
                    Some(value) => known.push(value),
                    None if known.is_empty() => {}
                    None => {
                        database.learn(token, place - known.len(), &known)?;
                        known.clear();
                    }
                }
            }
            let end = inputs + outputs.len();
            if !known.is_empty() {
                database.learn(token, end - known.len(), &known)?;
            }
            if ends {
                let earliest = database.finish(token).min.max(tick);
                database.end(token, earliest)?;
            }
            Ok(())
        })
    }

    /// Which tokens conditions are compared with, and what is propagated.
    pub fn work(&mut self, scan: MergeScan, propagation: Propagation) {
        (self.now.scan, self.now.propagation) = (scan, propagation);
    }

    /// A cycle: all tokens whose time is over end, and what follows is decided, with at most so
    /// many operations. If it cannot be, nothing was decided.
    pub fn cycle(&mut self, tick: Ticks, budget: u64) -> Verdict {
        self.cycle_ahead(tick, 1, false, budget)
    }

    /// As [`cycle`](Self::cycle), so that what is decided now lets the plan go on until so many ticks
    /// from now are over: until then no status comes, or, if statuses are guessed, the one that rules
    /// name first and that lets the plan go on, as early as it may. If nothing lets it go on, it is
    /// decided for now alone.
    pub fn cycle_ahead(
        &mut self,
        tick: Ticks,
        horizon: Ticks,
        guess: bool,
        budget: u64,
    ) -> Verdict {
        self.now.later.guess = guess;
        let limit = self.database.operations().saturating_add(budget);
        let mut script = Vec::new();
        if horizon > 1 {
            let verdict = self.attempt_cycle(tick, horizon, budget);
            script = self.now.later.take_script();
            self.now.tick = tick;
            self.database.pop();
            match verdict {
                Verdict::OverBudget => return verdict,
                Verdict::Impossible(_) => script.clear(),
                Verdict::Solved => {}
            }
        }
        let left = limit.saturating_sub(self.database.operations());
        self.now.later.begin(tick, tick);
        self.now.later.script = script;
        let verdict = self.attempt_again(tick, left);
        if matches!(verdict, Verdict::Solved) {
            self.begun = true;
            self.database.commit();
            self.now.ahead.decided(&self.database, tick);
            self.posted_is_done();
            if self.forgets {
                self.database.forget(tick);
            }
        } else {
            self.database.pop();
        }
        verdict
    }

    /// Looks ahead; all of it is to be undone by a pop.
    fn attempt_cycle(&mut self, tick: Ticks, horizon: Ticks, budget: u64) -> Verdict {
        let until = tick.saturating_add(horizon - 1);
        self.now.later.begin(tick, until);
        self.attempt_again(tick, budget)
    }

    fn attempt_again(&mut self, tick: Ticks, budget: u64) -> Verdict {
        self.now.tick = tick;
        self.database.push();
        if self.begun {
            expire(&mut self.database, &self.now.endings, tick);
        }
        self.now.ahead.begin();
        self.take_posted();
        chronological(&mut self.database, &mut self.now, &mut self.stack, budget)
    }

    /// Deletes what ended before a tick or at it, but for the present tokens and those before them.
    pub fn forget(&mut self, before: Ticks) {
        self.database.forget(before);
    }
}
