//! What a cycle is told of goals: those that come, and those that are taken back.

use smallvec::SmallVec;

use super::endings::{close, make_room};
use super::now::goal_order;
use super::{Executive, Following};
use crate::Ticks;
use crate::database::{Cause, Conflict, Database, Slot, Time, TokenId, Wanted};
use crate::model::{PredicateId, TimelineId, Value};
use crate::parameters::Operand;

/// A goal that comes with the next cycle.
#[derive(Clone, Debug)]
pub(super) struct Posted {
    timeline: TimelineId,
    predicate: PredicateId,
    parameters: SmallVec<[Option<Operand>; 4]>,
}

impl Posted {
    fn insert(&self, database: &mut Database, tick: Ticks) -> Result<TokenId, Conflict> {
        database.insert(Wanted {
            predicate: self.predicate,
            timeline: Some(self.timeline),
            parameters: &self.parameters,
            start: Some(Time::At(tick)),
            finish: None,
            cause: Cause::User,
        })
    }
}

impl Executive {
    /// A goal from elsewhere: with the next cycle a timeline says this, in place of what it says.
    /// It is put there after what search control names first, so that safety comes before it.
    ///
    /// # Errors
    ///
    /// If it cannot be there as things are: it is no goal then.
    pub fn request(
        &mut self,
        timeline: TimelineId,
        predicate: PredicateId,
        parameters: &[Option<Value>],
        tick: Ticks,
    ) -> Result<(), Conflict> {
        let parameters = parameters.iter().map(|value| value.map(Operand::Value));
        let posted = Posted {
            timeline,
            predicate,
            parameters: parameters.collect(),
        };
        self.try_out(|database, endings| {
            let after = make_room(database, endings, timeline, tick)?;
            let token = posted.insert(database, tick)?;
            database.activate(token, Slot { timeline, after })
        })?;
        self.goals.push(posted);
        Ok(())
    }

    /// A token ends with the next cycle, pre-empted, if nothing else ends it.
    ///
    /// # Errors
    ///
    /// If it may not end then.
    pub fn cancel(&mut self, token: TokenId, tick: Ticks) -> Result<(), Conflict> {
        self.try_out(|database, endings| close(database, endings, token, tick).map(|_| ()))?;
        self.cancels.push(token);
        Ok(())
    }

    /// Whether an edit can be; it is not done.
    fn try_out(
        &mut self,
        edit: impl FnOnce(&mut Database, &[super::endings::Endings]) -> Result<(), Conflict>,
    ) -> Result<(), Conflict> {
        let endings = &self.now.endings;
        self.database.push();
        let outcome = self.database.settled(|database| edit(database, endings));
        self.database.pop();
        outcome
    }

    /// Whether a goal of a timeline waits for the next cycle.
    pub fn has_goal(&self, timeline: TimelineId) -> bool {
        self.goals.iter().any(|goal| goal.timeline == timeline)
    }

    /// The first goal that waits for the next cycle: its timeline, and what it says.
    pub fn first_goal(&self) -> Option<(TimelineId, PredicateId)> {
        self.goals
            .first()
            .map(|goal| (goal.timeline, goal.predicate))
    }

    /// Whether a goal or a cancel of a timeline waits for the next cycle.
    pub fn is_posted(&self, timeline: TimelineId) -> bool {
        let of = |&token: &TokenId| self.database.token(token).and_then(|at| at.timeline);
        self.has_goal(timeline) || self.cancels.iter().any(|token| of(token) == Some(timeline))
    }

    /// Tokens that were taken back end; goals wait for their turn in the search.
    pub(super) fn take_posted(&mut self) {
        let tick = self.now.tick;
        for &token in &self.cancels {
            let at = self.database.token(token);
            if let Some(timeline) = at.and_then(|at| at.timeline) {
                self.now.ahead.bar(timeline);
            }
            let (database, endings) = (&mut self.database, &self.now.endings);
            if database.finish(token).max > tick {
                // If it may not end any more, by what came after it was taken back, it goes on.
                let _ = database.attempt(|database| close(database, endings, token, tick));
            }
        }
        self.now.goals.clear();
        for goal in &self.goals {
            let order = goal_order(self.database.model(), goal.timeline, goal.predicate);
            let inserted = goal.insert(&mut self.database, tick);
            let token = inserted.expect("a goal that was tried out can be wanted");
            self.now.goals.push((order, token, goal.timeline));
            self.now.ahead.bar(goal.timeline);
        }
    }

    /// What was posted is done.
    pub(super) fn posted_is_done(&mut self) {
        self.goals.clear();
        self.cancels.clear();
        self.now.goals.clear();
    }

    /// What a timeline says next, once what it says now has ended and no rule asks for anything,
    /// in place of what was left of the plan before; without steps, nothing. The first step is
    /// the root.
    pub fn follow(&mut self, timeline: TimelineId, steps: Vec<Following>) {
        self.now.ahead.set(timeline, steps);
    }
}
