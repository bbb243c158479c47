//! A plan as data, and as JSON: which tokens there are, when, why, and what they do to resources.
//!
//! A plan names everything, so that it can be read, drawn and compared without the model's tables.
//! Nothing here says whether a plan is valid: that is the checker's part.
//!
//! # The format
//!
//! One JSON object, whose field `format` is [`FORMAT`]. Times are whole ticks. A value is a number,
//! a truth value, a symbol as a string, or `null` where it is not bound. A minor version adds
//! fields; a major one changes what is there.
//!
//! ```
//! use farside_planning::plan::Plan;
//! let text = r#"{
//!     "format": "farside-plan/1.0", "model": "rover.ddl", "problem": "day 1", "horizon": 100,
//!     "planner": "repair", "seed": 1, "operations": 12, "score": 2.5, "makespan": 40,
//!     "timelines": [{ "name": "k9.Location", "kind": "state" }],
//!     "tokens": [{
//!         "id": 1, "timeline": "k9.Location", "predicate": "At", "arguments": { "place": "rock" },
//!         "start": 40, "end": 100, "start_window": [40, 55], "end_window": [100, 100],
//!         "origin": { "goal": "there" }
//!     }],
//!     "achieved": [{ "goal": "there", "token": 1 }]
//! }"#;
//! let plan = Plan::from_json(text.as_bytes())?;
//! assert_eq!(plan.tokens[0].to_string(), "1 At(rock) on k9.Location [40 100]");
//! assert_eq!(Plan::from_json(plan.to_json().as_bytes())?, plan);
//! let slip = text.replace("\"end\":", "\"ende\":");
//! let error = Plan::from_json(slip.as_bytes()).unwrap_err().to_string();
//! assert!(error.contains("line 7") && error.contains("did you mean \"end\"?"), "{error}");
//! # Ok::<(), farside_planning::plan::PlanError>(())
//! ```

mod build;
mod json;
#[cfg(test)]
mod tests;

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::Ticks;
use crate::temporal::Span;

pub(crate) use build::argument_name;
pub use build::{Effects, place};
pub use json::{FORMAT, MAX_FILE_BYTES, PlanError};

/// A token's number within a plan.
pub type TokenId = u32;

/// A plan: what there is when, and what it achieves.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Always the same: which format it is.
    pub format: json::Format,
    /// The file of the model.
    pub model: String,
    /// The name of the problem.
    pub problem: String,
    /// The times in which everything lies are 0 to this \[ticks\].
    pub horizon: Ticks,
    /// Which planner made it.
    pub planner: String,
    /// The seed that it started from.
    pub seed: u64,
    /// How many operations it took.
    pub operations: u64,
    /// What the achieved goals and combinations of goals are worth: Equation 1 of the MISUS paper.
    pub score: f64,
    /// The latest end of a token that achieves a goal; 0 if none does \[ticks\].
    pub makespan: Ticks,
    /// All timelines of the model, in its order.
    pub timelines: Vec<PlanTimeline>,
    /// All resources of the model, in its order, as they are in the problem.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub resources: Vec<PlanResource>,
    /// The tokens, in any order.
    pub tokens: Vec<PlanToken>,
    /// The goals that are achieved.
    #[serde(default)]
    pub achieved: Vec<Achieved>,
    /// The goals that are not.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<LeftOut>,
    /// What keeps the flexible times together. If any are listed, all are: the tokens' windows are
    /// then what these constraints leave.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub constraints: Vec<PlanConstraint>,
}

/// A timeline, as a plan knows it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanTimeline {
    /// Its full name.
    pub name: String,
    /// What it holds.
    pub kind: PlanTimelineKind,
}

/// What a timeline holds: see [`crate::model::TimelineKind`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PlanTimelineKind {
    /// Exactly one token at any time.
    State,
    /// At most one token at any time.
    Unary,
    /// Any tokens at any time.
    Free,
}

/// A resource, as a plan knows it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanResource {
    /// Its full name.
    pub name: String,
    /// What its uses add up to.
    pub kind: PlanResourceKind,
    /// The level when the horizon begins.
    pub initial: i64,
    /// The least and the greatest level that are allowed; `null` where there is no limit.
    pub limits: [Option<i64>; 2],
    /// From a tick on, so much more: what no token does.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub changes: Vec<(Ticks, i64)>,
}

/// What uses of a resource add up to: see [`crate::model::ResourceKind`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PlanResourceKind {
    /// What is used comes back at the end of the use.
    Renewable,
    /// What is consumed is gone until something produces it.
    Depletable,
    /// What is taken counts for so many ticks.
    RateLimited(Ticks),
}

/// A token of a plan.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanToken {
    /// Its number; no other token has it.
    pub id: TokenId,
    /// The timeline on which it is.
    pub timeline: String,
    /// What it says.
    pub predicate: String,
    /// By the name of the parameter, in the predicate's order. A parameter without a name of its
    /// own is `#` and its place, from 1.
    #[serde(
        default,
        with = "json::arguments",
        skip_serializing_if = "Vec::is_empty"
    )]
    pub arguments: Vec<(String, PlanValue)>,
    /// When it starts \[ticks\].
    pub start: Ticks,
    /// When it ends: the first tick at which it is over.
    pub end: Ticks,
    /// The times to which its start can move, if others move along.
    pub start_window: [Ticks; 2],
    /// The times to which its end can move, if others move along.
    pub end_window: [Ticks; 2],
    /// Why it is there.
    pub origin: Origin,
    /// What it does to resources.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub effects: Vec<PlanEffect>,
}

/// What a parameter of a token is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PlanValue {
    /// Not bound: another system will.
    Unbound,
    /// A truth value.
    Truth(bool),
    /// A number.
    Number(i64),
    /// A symbol, by its name.
    Symbol(String),
}

/// Why a token is in a plan.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Origin {
    /// A goal wants it.
    Goal(String),
    /// It is the case: where the problem says so, as `file:line:column`.
    Fact(String),
    /// A rule of another token asks for it.
    Rule {
        /// Where the rule's relation stands, as `file:line:column`.
        place: String,
        /// The token that the rule is of.
        master: TokenId,
    },
    /// It fills a timeline where nothing is asked for.
    Filler,
}

/// What a token does to a resource.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanEffect {
    /// Where the model says so, as `file:line:column`.
    pub place: String,
    /// The resource.
    pub resource: String,
    /// What it does.
    pub does: PlanEffectKind,
    /// How much.
    pub amount: i64,
}

/// What is done to a resource: see [`crate::model::EffectKind`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PlanEffectKind {
    /// Less of it from start to end.
    Uses,
    /// Less of it from an end on.
    Consumes(PlanEnd),
    /// More of it from an end on.
    Produces(PlanEnd),
}

/// Which end of a token.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PlanEnd {
    /// Where it starts.
    Start,
    /// Where it ends.
    End,
}

/// That a goal is achieved.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Achieved {
    /// The goal.
    pub goal: String,
    /// The token that achieves it.
    pub token: TokenId,
}

/// That a goal is not achieved.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeftOut {
    /// The goal.
    pub goal: String,
    /// Why.
    pub reason: String,
}

/// That an end of a token lies some ticks after that of another.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanConstraint {
    /// From here; from time 0 if it is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<Moment>,
    /// To here; to time 0 if it is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to: Option<Moment>,
    /// At least so many ticks, if it says so; negative where `to` may come first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min: Option<Ticks>,
    /// At most so many ticks, if it says so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max: Option<Ticks>,
    /// Why, mostly as `file:line:column`.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub why: String,
}

/// An end of a token.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Moment {
    /// The token.
    pub token: TokenId,
    /// Which end of it.
    pub at: PlanEnd,
}

impl Plan {
    /// The latest end of a token that achieves a goal; 0 if none does.
    pub fn latest_end(&self) -> Ticks {
        let achieving = self.achieved.iter().filter_map(|one| self.token(one.token));
        achieving.map(|token| token.end).max().unwrap_or(0)
    }

    /// The token of a number. Looks at all of them.
    pub fn token(&self, id: TokenId) -> Option<&PlanToken> {
        self.tokens.iter().find(|token| token.id == id)
    }
}

impl PlanToken {
    /// What it says, as `At(rock)`.
    pub fn says(&self) -> String {
        let values: Vec<String> = self.arguments.iter().map(|(_, v)| v.to_string()).collect();
        if values.is_empty() {
            return self.predicate.clone();
        }
        format!("{}({})", self.predicate, values.join(", "))
    }

    /// Where it stands in time.
    pub fn span(&self) -> Span {
        Span::new(self.start, self.end)
    }
}

impl fmt::Display for PlanToken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (id, says, timeline) = (self.id, self.says(), &self.timeline);
        write!(f, "{id} {says} on {timeline} {:?}", self.span())
    }
}

impl fmt::Display for PlanValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            PlanValue::Unbound => f.write_str("?"),
            PlanValue::Truth(true) => f.write_str("True"),
            PlanValue::Truth(false) => f.write_str("False"),
            PlanValue::Number(number) => number.fmt(f),
            PlanValue::Symbol(name) => f.write_str(name),
        }
    }
}
