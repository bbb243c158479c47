//! Searches: how what is missing in a plan database is put right.
//!
//! What is missing is a *flaw*: a relation that no token fulfils, a goal without a token, an
//! over-used resource, a gap on a timeline. For each flaw there are *decisions* that put it right.
//! A [`Strategy`] says which flaw comes next and which decisions there are, in the order in which
//! they are to be tried; [`chronological`] tries them, and takes the last one back when nothing
//! else can be done.
//!
//! All searches are bounded by [operations](Database::operations), counted by the database and its
//! parts, and never by a clock: the same problem gives the same plan, or the same want of one, on
//! any machine.

mod both;
pub mod choices;
mod chronological;
pub mod complete;
pub mod executive;
mod extract;
mod repair;
pub mod schedule;
mod solve;
#[cfg(test)]
mod tests;

use crate::Ticks;
use crate::database::{Conflict, Database, InstanceId, Open, Slot, TokenId};
use crate::model::{End, ResourceId, RuleId, TimelineId, Value};
use crate::profile::Bound;

pub use both::Both;
pub use chronological::{Stack, chronological};
pub use extract::extract;
pub use repair::Repair;
pub use solve::{Answer, Forward, Planner, Settings};

/// What is missing in a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flaw {
    /// A relation that no token fulfils yet, or a choice of a rule.
    Open(Open),
    /// A goal's token that is on no timeline.
    Goal(TokenId),
    /// A resource whose level breaks a limit, if each token is as early as it can be.
    OverUse {
        /// The resource.
        resource: ResourceId,
        /// Which limit.
        bound: Bound,
        /// When it is worst.
        tick: Ticks,
    },
    /// A parameter that must have a value, and has none.
    Unbound {
        /// Whose parameter.
        token: TokenId,
        /// Its place.
        parameter: usize,
    },
    /// Two tokens of a timeline of states that do not meet.
    Gap {
        /// The timeline.
        timeline: TimelineId,
        /// The token before the gap; none if it begins with the horizon.
        after: Option<TokenId>,
    },
}

/// A way to put a flaw right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decision {
    /// An active token fulfils a relation.
    Support(TokenId),
    /// A new token fulfils a relation, fills a gap, or a goal's goes there.
    Insert(Slot),
    /// The same, where a token that only rules or gaps asked for makes room.
    Displace {
        /// Where.
        slot: Slot,
        /// Which token goes.
        token: TokenId,
    },
    /// A relation between labelled tokens is posted.
    Relate,
    /// Something comes before something, and what has a lesser rank does not hold.
    Order(Precedence, u32),
    /// A token does not start before a tick.
    Wait {
        /// The token.
        token: TokenId,
        /// The tick.
        until: Ticks,
    },
    /// An effect is done to another of the resources that will do.
    Assign {
        /// Whose effect.
        instance: InstanceId,
        /// Which of its effects.
        effect: u32,
        /// The other resource.
        resource: ResourceId,
    },
    /// A parameter has a value.
    Bind(Value),
    /// The two tokens at a gap meet, or the one ends with the horizon.
    Close,
    /// An alternative of a choice.
    Alternative(u32),
}

/// That one end of a token comes at least so many ticks after an end of another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Precedence {
    /// What comes first.
    pub from: (TokenId, End),
    /// What comes then.
    pub to: (TokenId, End),
    /// How many ticks later, at least.
    pub gap: Ticks,
}

impl Precedence {
    /// How many ticks of room it leaves, as far as the two times alone say; below 0, none.
    pub fn slack(&self, database: &Database) -> Ticks {
        let from = database.bounds_of(database.time(self.from.0, self.from.1));
        let to = database.bounds_of(database.time(self.to.0, self.to.1));
        to.max.saturating_sub(from.min).saturating_sub(self.gap)
    }
}

/// Which flaw comes next, and how it can be put right.
pub trait Strategy {
    /// The flaw that comes next; none, if the plan is complete.
    fn next(&mut self, database: &mut Database) -> Option<Flaw>;

    /// The decisions that may put a flaw right, the best one first.
    fn decisions(&mut self, database: &mut Database, flaw: Flaw, into: &mut Vec<Decision>);

    /// Carries a decision out.
    ///
    /// # Errors
    ///
    /// If it cannot be: what was done of it is left, and undone with the decision before it.
    fn decide(
        &mut self,
        database: &mut Database,
        flaw: Flaw,
        decision: Decision,
    ) -> Result<(), Conflict>;

    /// Whether a flaw that nothing puts right was asked to see whether the decision for the flaw
    /// before it is one: a guard, and no choice that is taken back.
    fn is_guard(&self, _database: &Database, _before: Flaw, _failed: Flaw) -> bool {
        false
    }

    /// The last decisions were undone: what the strategy keeps of the database is to be so, too.
    fn undone(&mut self, _database: &Database) {}
}

/// How a search ended.
#[derive(Clone, Debug)]
pub enum Verdict {
    /// Without flaws.
    Solved,
    /// No decisions put this flaw right, with all those before it: the database is as it was
    /// before the search.
    Impossible(Failure),
    /// The budget is spent: the database is as it was before the search.
    OverBudget,
}

/// The flaw at which a search failed after its longest way.
#[derive(Clone, Debug)]
pub struct Failure {
    /// The flaw.
    pub flaw: Flaw,
    /// Why its decisions were refused.
    pub conflicts: Vec<Conflict>,
    /// Who asks for what is missing, if a rule does.
    pub instance: Option<InstanceId>,
    /// The rule that asks for it, which is known after what asked was undone, too.
    pub rule: Option<RuleId>,
}

/// What a search did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Decisions that were carried out.
    pub decisions: u64,
    /// Decisions that were taken back, since what followed was impossible.
    pub backtracks: u64,
    /// Alternatives whose leading condition did not hold: they are guards, and nothing was taken
    /// back.
    pub guards: u64,
    /// Decisions that the database refused.
    pub refusals: u64,
}
