//! The plan database: tokens on timelines, tied by rules, times and parameters.
//!
//! A plan in the making is always consistent: an edit that breaks times or parameters is refused,
//! changes nothing, and names whose constraints cannot all hold. What is still missing is counted,
//! not refused: relations of rules that no token fulfils yet ([`Database::open`]), resources that
//! are over-used, gaps in timelines. Searches resolve these; the database decides nothing.
//!
//! # Shape
//!
//! A token's times are points of a [temporal network](crate::temporal), or ticks once nobody can
//! change them; its parameters are values, or variables of a [store of parametric
//! constraints](crate::parameters). Variables are shared: a token that a rule asks for has the
//! rule's own variables, so that nothing must be kept equal. Active tokens are ordered on their
//! timeline. For each token the rules of its predicate are *instances*, which wait for their
//! guard, hold, or are void.
//!
//! Every constraint has an [`Owner`], so that any token goes at any time with what it brought, and
//! every conflict can be told. [`Database::push`] and [`Database::pop`] undo edits at a cost that
//! follows their number; [`Database::forget`] deletes the past.

mod edit;
mod forget;
mod guards;
mod learn;
mod resources;
mod rules;
mod support;
#[cfg(test)]
mod tests;
mod times;
mod token;
mod trail;

use std::fmt;
use std::sync::Arc;

pub use edit::Wanted;
pub use resources::Levels;
pub use rules::{Guard, Instance, Open, Step};
pub use support::Slot;
pub use token::{Cause, InstanceId, Owner, Status, Time, Token, TokenId};

use crate::Ticks;
use crate::arena::Arena;
use crate::model::{Model, TimelineId};
use crate::parameters::{self, Domain, Operand, Store};
use crate::temporal::{self, Network, Point, Span};
use rules::Flat;
use times::Mirror;
use trail::Change;

/// Why an edit was refused.
#[derive(Clone, Debug)]
pub enum Conflict {
    /// Times that cannot all be.
    Times(temporal::Conflict<Owner>),
    /// Values that cannot all be.
    Values(parameters::Refusal<Owner>),
    /// Two known times whose distance is not what it must be.
    Known {
        /// Whose constraint it is.
        owner: Owner,
        /// The distance \[ticks\].
        is: Ticks,
        /// What it must be \[ticks\].
        expected: Span,
    },
    /// Amounts of a resource add up to more than can be counted.
    Amount {
        /// Whose amount it is.
        owner: Owner,
    },
    /// A token that is not what a relation asks for: another predicate, timeline or object.
    Mismatch {
        /// Whose relation it is.
        owner: Owner,
    },
}

impl Conflict {
    /// Whose constraints cannot all hold, without repetition.
    pub fn owners(&self) -> Vec<Owner> {
        let mut owners: Vec<Owner> = match self {
            Conflict::Times(conflict) => conflict.owners().copied().collect(),
            Conflict::Values(parameters::Refusal::Conflict(conflict)) => {
                conflict.owners().copied().collect()
            }
            Conflict::Values(_) => Vec::new(),
            Conflict::Known { owner, .. }
            | Conflict::Mismatch { owner }
            | Conflict::Amount { owner } => vec![*owner],
        };
        owners.sort_unstable();
        owners.dedup();
        owners
    }
}

impl fmt::Display for Conflict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Conflict::Times(conflict) => conflict.fmt(f),
            Conflict::Values(conflict) => conflict.fmt(f),
            Conflict::Known {
                owner,
                is,
                expected,
            } => write!(f, "{owner:?}: {is} ticks where {expected:?} are expected"),
            Conflict::Amount { owner } => {
                write!(f, "{owner:?}: amounts beyond what can be counted")
            }
            Conflict::Mismatch { owner } => write!(f, "{owner:?}: not what the relation asks for"),
        }
    }
}

impl std::error::Error for Conflict {}

impl From<temporal::Conflict<Owner>> for Conflict {
    fn from(conflict: temporal::Conflict<Owner>) -> Self {
        Conflict::Times(conflict)
    }
}

impl From<parameters::Refusal<Owner>> for Conflict {
    fn from(conflict: parameters::Refusal<Owner>) -> Self {
        Conflict::Values(conflict)
    }
}

/// The active tokens of a timeline: a list from first to last.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Lane {
    first: Option<TokenId>,
    last: Option<TokenId>,
    tokens: u32,
}

/// A plan database.
#[derive(Clone)]
pub struct Database {
    model: Arc<Model>,
    /// By rule: its body without nesting.
    flats: Arc<[Flat]>,
    network: Network<Owner>,
    store: Store<Owner>,
    tokens: Arena<Token>,
    instances: Arena<Instance>,
    lanes: Vec<Lane>,
    /// What rules ask for that no token fulfils yet, in the order in which it was asked for.
    open: Vec<Open>,
    /// By the place of a variable: how many tokens and instances have it.
    holders: Vec<u32>,
    /// By the place of a variable: the instances whose guard, or whose bounds of times, ask it.
    watchers: Vec<Vec<InstanceId>>,
    /// Variables that follow times of tokens.
    mirrors: Vec<Mirror>,
    /// By type: its values.
    domains: Vec<Domain>,
    /// By table of the model.
    tables: Vec<parameters::Rows>,
    levels_by_resource: Vec<Levels>,
    /// By the place of a point: the token that it is a time of, where there are resources.
    token_of_point: Vec<Option<TokenId>>,
    /// Tokens whose effects may have changed.
    dirty: Vec<TokenId>,
    changed_points: Vec<Point>,
    /// Variables that are equal to others now, or were: to be told of.
    equalities: Vec<parameters::Variable>,
    /// Instances that watched a variable in whose place a value stands now: to be told of it.
    told: Vec<InstanceId>,
    /// Kept for its memory.
    changed: Vec<parameters::Variable>,
    trail: Vec<Change>,
    /// What changes on the trail changed or took away, the last one last.
    kept_tokens: Vec<Token>,
    kept_instances: Vec<Instance>,
    levels: Vec<Level>,
    /// Whether something was retracted that variables may rest on which follow times.
    loosened: bool,
    /// Whether an edit goes on.
    edits: bool,
    /// The number of the next push: what was kept since the last one need not be kept again.
    serial: u64,
    steps: u64,
}

/// A push that is neither undone nor committed.
#[derive(Clone, Copy, Debug)]
struct Level {
    /// How long the trail was.
    start: usize,
    serial: u64,
}

impl Database {
    /// Without tokens; all times lie within `horizon`.
    ///
    /// # Panics
    ///
    /// As [`Network::new`] does: if the horizon does not hold 0.
    pub fn new(model: Arc<Model>, horizon: Span) -> Self {
        let flats = model.rules.iter().map(Flat::of).collect();
        let domains = model
            .types
            .iter()
            .map(|of| Domain::from(&of.values))
            .collect();
        let tables = model.tables.iter().map(parameters::Rows::from).collect();
        let levels_by_resource = model.resources.iter().map(Levels::of).collect();
        let lanes = vec![Lane::default(); model.timelines.len()];
        Database {
            model,
            flats,
            network: Network::new(horizon),
            store: Store::new(),
            tokens: Arena::new(),
            instances: Arena::new(),
            lanes,
            open: Vec::new(),
            holders: Vec::new(),
            watchers: Vec::new(),
            mirrors: Vec::new(),
            domains,
            tables,
            levels_by_resource,
            token_of_point: Vec::new(),
            dirty: Vec::new(),
            changed_points: Vec::new(),
            equalities: Vec::new(),
            told: Vec::new(),
            changed: Vec::new(),
            trail: Vec::new(),
            kept_tokens: Vec::new(),
            kept_instances: Vec::new(),
            levels: Vec::new(),
            loosened: false,
            edits: false,
            serial: 1,
            steps: 0,
        }
    }

    /// The model.
    #[inline]
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// The times in which everything lies.
    pub fn horizon(&self) -> Span {
        self.network.horizon()
    }

    /// A token, if it is there.
    #[inline]
    pub fn token(&self, token: TokenId) -> Option<&Token> {
        self.tokens.get(token)
    }

    /// All tokens, in the order of their places.
    pub fn tokens(&self) -> impl Iterator<Item = (TokenId, &Token)> {
        self.tokens.iter()
    }

    /// How many tokens there are.
    pub fn len(&self) -> usize {
        self.tokens.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.tokens.is_empty()
    }

    /// How many timelines there are.
    #[inline]
    pub(crate) fn lanes(&self) -> usize {
        self.lanes.len()
    }

    /// The first token of a timeline.
    #[inline]
    pub fn first(&self, timeline: TimelineId) -> Option<TokenId> {
        self.lanes[timeline].first
    }

    /// The last token of a timeline.
    #[inline]
    pub fn last(&self, timeline: TimelineId) -> Option<TokenId> {
        self.lanes[timeline].last
    }

    /// The active tokens of a timeline, the first one first.
    pub fn on(&self, timeline: TimelineId) -> impl Iterator<Item = TokenId> {
        std::iter::successors(self.first(timeline), |&token| self.at(token).after)
    }

    /// A rule as it holds for a token.
    #[inline]
    pub fn instance(&self, instance: InstanceId) -> Option<&Instance> {
        self.instances.get(instance)
    }

    /// What rules ask for that no token fulfils yet, in the order in which it was asked for.
    pub fn open(&self) -> &[Open] {
        &self.open
    }

    /// How much was done: what edits looked at in times and parameters, and tokens and instances
    /// that were made, changed or removed. A search is bounded by it.
    pub fn operations(&self) -> u64 {
        let work = self.network.work();
        self.steps + work.points + work.inequalities + self.store.work().operations()
    }

    /// Counts what was looked at elsewhere on the database's behalf.
    pub(crate) fn spend(&mut self, operations: u64) {
        self.steps += operations;
    }

    /// Asks everything again: the guard of each rule of each token, and what it says of the token's
    /// times and parameters, without asking what changed. It is what a database without incremental
    /// propagation does at each edit; it finds what is known already, and costs what there is.
    ///
    /// # Errors
    ///
    /// If something does not hold, which incremental propagation missed.
    pub fn propagate_fully(&mut self) -> Result<(), InstanceId> {
        let mut looked = self.tokens.len() as u64;
        let mut wrong = None;
        for (id, at) in self.instances.iter() {
            let rule = &self.model.rules[at.rule];
            looked += 1 + rule.master.arguments.len() as u64;
            if self.guard(id) != at.guard {
                wrong = wrong.or(Some(id));
            }
            if at.guard != Guard::Holds {
                continue;
            }
            for said in &rule.relationships {
                looked += said.operands.len() as u64;
                if self.is_broken(at, said) {
                    wrong = wrong.or(Some(id));
                }
            }
            if let (Some([min, max]), Some(token)) = (rule.duration, self.tokens.get(at.master)) {
                looked += 1;
                let span = self.span(id, min, max, false);
                let (start, finish) = (self.bounds_of(token.start), self.bounds_of(token.finish));
                let lasts = Span::new(finish.min - start.max, finish.max.saturating_sub(start.min));
                if lasts.max < span.min || lasts.min > span.max {
                    wrong = wrong.or(Some(id));
                }
            }
            looked += at.times.len() as u64;
        }
        self.steps += looked;
        wrong.map_or(Ok(()), Err)
    }

    /// The value of an operand, if it has one only.
    #[inline]
    pub fn value(&self, operand: Operand) -> Option<i64> {
        match operand {
            Operand::Value(value) => Some(value),
            Operand::Variable(variable) => self.store.value(variable),
        }
    }

    /// The least and the greatest value of an operand.
    pub fn values(&self, operand: Operand) -> Span {
        match operand {
            Operand::Value(value) => Span::exactly(value),
            Operand::Variable(variable) => self.store.domain(variable).span(),
        }
    }

    /// The temporal network, to be asked.
    pub fn network(&self) -> &Network<Owner> {
        &self.network
    }

    /// The store of parameters, to be asked.
    pub fn store(&self) -> &Store<Owner> {
        &self.store
    }

    /// A token that is there.
    #[inline]
    fn at(&self, token: TokenId) -> &Token {
        self.tokens.get(token).expect("the token is there")
    }

    /// An instance that is there.
    #[inline]
    fn instance_at(&self, instance: InstanceId) -> &Instance {
        self.instances.get(instance).expect("the instance is there")
    }
}

impl fmt::Debug for Database {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Database")
            .field("tokens", &self.tokens.len())
            .field("open", &self.open.len())
            .field("network", &self.network)
            .finish_non_exhaustive()
    }
}
