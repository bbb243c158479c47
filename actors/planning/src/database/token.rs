//! What the database keeps of a token, and of who asked for it.

use smallvec::{Array, SmallVec};

use crate::Ticks;
use crate::arena::Id;
use crate::model::{GoalId, PredicateId, RuleId, TimelineId};
use crate::parameters::{self, Operand};
use crate::temporal::{Constraint, Point};

use super::rules::Instance;

/// A token of the database.
pub type TokenId = Id<Token>;
/// A rule as it holds for one token.
pub type InstanceId = Id<Instance>;

/// When something is: known for good, or a point of the temporal network.
///
/// An executive starts tokens now. Such a time needs no point, and edits that speak of it change a
/// single bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Time {
    /// At this tick.
    At(Ticks),
    /// Within the bounds of a point.
    Point(Point),
}

/// How a token stands to the plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// Wanted, and not yet in the plan.
    Free,
    /// In the plan, on its timeline.
    Active,
    /// What it wants, this active token does.
    Merged(TokenId),
    /// The plan does without it.
    Rejected,
}

/// Why a token is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// It is the case: a fact of the problem, by its place.
    Fact(usize),
    /// It is wanted: a goal of the problem.
    Goal(GoalId),
    /// A rule of another token asks for it.
    Rule {
        /// The rule.
        rule: RuleId,
        /// The other token.
        master: TokenId,
    },
    /// A timeline had nothing else to say.
    Filler,
    /// The user of the database put it there.
    User,
}

/// Whose a constraint is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Owner {
    /// A token itself: how long it lasts, which values its parameters can have, when it was said
    /// to start or end.
    Token(TokenId),
    /// A rule of a token; which of its relations, if it is one's.
    Rule {
        /// The token that the rule holds for.
        master: TokenId,
        /// The rule.
        rule: RuleId,
        /// The place of the relation among all of the rule, in the order of the text.
        relation: Option<u32>,
    },
    /// The order of two tokens on a timeline.
    Sequence {
        /// The one that comes first.
        first: TokenId,
        /// The one that comes next.
        second: TokenId,
    },
    /// That a token is merged into another.
    Merge(TokenId),
    /// An order between goals of the problem, by its place.
    Order(usize),
    /// A decision of a search, by a number of its own.
    Decision(u32),
    /// What the problem gives: levels of resources that no token changes.
    Given,
    /// The past, as it was before it was forgotten.
    Past,
}

impl Owner {
    /// The token whose rule it is, if it is a rule's.
    pub fn master(self) -> Option<TokenId> {
        match self {
            Owner::Rule { master, .. } => Some(master),
            _ => None,
        }
    }
}

/// A token: a predicate with parameters, over a time.
#[derive(Debug)]
pub struct Token {
    /// What it says.
    pub predicate: PredicateId,
    /// Its timeline, once it is active.
    pub timeline: Option<TimelineId>,
    /// How it stands to the plan.
    pub status: Status,
    /// Why it is there.
    pub cause: Cause,
    /// When it starts.
    pub start: Time,
    /// When it ends.
    pub finish: Time,
    /// By parameter: its value or variable.
    pub parameters: SmallVec<[Operand; 4]>,
    /// How many relations of rules count on it.
    pub supports: u32,
    pub(super) before: Option<TokenId>,
    pub(super) after: Option<TokenId>,
    /// That it starts when the one before it has ended.
    pub(super) order: Option<Constraint>,
    /// Orders to other tokens, which go when it leaves the plan.
    pub(super) orders: SmallVec<[Constraint; 2]>,
    /// Constraints of times that go with it.
    pub(super) times: SmallVec<[Constraint; 2]>,
    /// Constraints of parameters that go with it.
    pub(super) values: SmallVec<[parameters::Constraint; 2]>,
    /// The rules that hold for it, or may.
    pub(super) instances: SmallVec<[InstanceId; 4]>,
    /// The relations that count on it.
    pub(super) supported: SmallVec<[(InstanceId, u32); 2]>,
    /// The tokens that are merged into it.
    pub(super) merged: SmallVec<[TokenId; 1]>,
    /// What makes it equal to the token that it is merged into.
    pub(super) merged_times: SmallVec<[Constraint; 2]>,
    pub(super) merged_values: SmallVec<[parameters::Constraint; 2]>,
    /// Since which edit the trail need not keep it again.
    pub(super) kept: u64,
}

// Each change of a token keeps what it was: lists of what can be copied are copied as a whole, which
// a derived clone does not do.
impl Clone for Token {
    fn clone(&self) -> Self {
        Token {
            parameters: copy(&self.parameters),
            orders: copy(&self.orders),
            times: copy(&self.times),
            values: copy(&self.values),
            instances: copy(&self.instances),
            supported: copy(&self.supported),
            merged: copy(&self.merged),
            merged_times: copy(&self.merged_times),
            merged_values: copy(&self.merged_values),
            ..*self
        }
    }
}

/// A copy of a list, which most often is empty.
#[inline]
pub(super) fn copy<A: Array<Item: Copy>>(list: &SmallVec<A>) -> SmallVec<A> {
    match &list[..] {
        [] => SmallVec::new(),
        all => SmallVec::from_slice(all),
    }
}

impl Token {
    /// The token before it on its timeline.
    #[inline]
    pub fn before(&self) -> Option<TokenId> {
        self.before
    }

    /// The token after it on its timeline.
    #[inline]
    pub fn after(&self) -> Option<TokenId> {
        self.after
    }

    /// The rules that hold for it, or may.
    pub fn instances(&self) -> &[InstanceId] {
        &self.instances
    }
}
