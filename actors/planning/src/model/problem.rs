//! What a problem says, once names are resolved: what is the case, and what is wanted.

use super::{
    Distance, GoalId, Pattern, Position, PredicateId, ResourceId, TimelineId, Value, Variable,
};
use crate::Ticks;
use crate::temporal::Span;

/// A problem: what is the case, and what is wanted.
#[derive(Clone, Debug, Default)]
pub struct Problem {
    /// Its name.
    pub name: String,
    /// Its files, as [`Model::files`](super::Model::files).
    pub files: Vec<String>,
    /// The times in which everything lies \[ticks\]; it begins at 0.
    pub horizon: Ticks,
    /// What is the case.
    pub facts: Vec<Fact>,
    /// What is wanted.
    pub goals: Vec<Goal>,
    /// What goals are worth together: section 4.1 of the MISUS paper.
    pub combinations: Vec<Combination>,
    /// What holds between the times of goals.
    pub orders: Vec<Order>,
    /// Levels with which resources begin here, other than the model says.
    pub initial: Vec<(ResourceId, Value)>,
    /// Changes of resources by nobody's token: from a tick on, so much more.
    pub changes: Vec<(ResourceId, Ticks, Value)>,
}

/// A token that is the case, whatever is planned.
#[derive(Clone, Debug)]
pub struct Fact {
    /// Where it stands.
    pub position: Position,
    /// Its timeline.
    pub timeline: TimelineId,
    /// What it says.
    pub predicate: PredicateId,
    /// By parameter: its value, or none if it is not known.
    pub values: Vec<Option<Value>>,
    /// When it starts \[ticks\].
    pub start: Span,
    /// When it ends \[ticks\].
    pub finish: Span,
}

/// A token that is wanted.
#[derive(Clone, Debug)]
pub struct Goal {
    /// Its name.
    pub name: String,
    /// Where it stands.
    pub position: Position,
    /// The token.
    pub pattern: Pattern,
    /// Its variables: values that are left to the planner.
    pub variables: Vec<Variable>,
    /// When it starts \[ticks\].
    pub start: Span,
    /// When it ends \[ticks\].
    pub finish: Span,
    /// How long it lasts \[ticks\].
    pub duration: Span,
    /// What it is worth; none if no plan is one without it.
    pub weight: Option<f64>,
}

/// What goals are worth together, besides what each is worth.
#[derive(Clone, Debug)]
pub struct Combination {
    /// Its name.
    pub name: String,
    /// Where it stands.
    pub position: Position,
    /// The goals, all of which must be achieved.
    pub goals: Vec<GoalId>,
    /// What is added; it may be negative.
    pub weight: f64,
}

/// What holds between the times of two goals.
#[derive(Clone, Debug)]
pub struct Order {
    /// Where it stands.
    pub position: Position,
    /// The goal that it is said of.
    pub from: GoalId,
    /// The goal whose time is bounded by the first one's.
    pub to: GoalId,
    /// What it says; its bounds are values.
    pub distances: Vec<Distance>,
}
