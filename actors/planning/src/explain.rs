//! Why there is no plan: which tokens, which rules and where they stand, and which goals to drop.
//!
//! An explanation says what was found out and no more. That there is no plan is *proven* if a
//! complete search came to its end without one; else no plan was found. The goals to drop are ones
//! without which a plan was found; [`Smallest`] says what is known of how few they are. The
//! [reasons](Explanation::reasons) are where the way of a search that got furthest ended: times or
//! values that cannot all be, or a resource that is over-used, each with the tokens, the rules and
//! the goals that it rests on.
//!
//! Everything is bounded by counted operations. Plain sentences are what [`Display`](std::fmt::Display)
//! gives; as JSON it is what its fields are.
//!
//! ```
//! use std::sync::Arc;
//! use farside_planning::explain::{self, Request, Smallest};
//! use farside_planning::language::{Options, read_model, read_problem};
//! let model = "
//! (Define_Object_Class Rover :state_variables ((Unary Arm_SV)))
//! (Define_Predicate Grip ())
//! (Define_Member_Values (Rover Arm_SV) (Grip))
//! (Define_Compatibility (SINGLE ((Rover Arm_SV) ((Grip ())))) :duration_bounds [30 30])
//! ";
//! let problem = "
//! (Define_Problem noon :horizon [0 50])
//! (Goal one (SINGLE ((Rover Arm_SV) ((Grip ())))) :start [0 10] :mandatory)
//! (Goal two (SINGLE ((Rover Arm_SV) ((Grip ())))) :start [12 20] :mandatory)
//! ";
//! let model = read_model("arm.ddl", model, &Options::default()).ok()?;
//! let problem = read_problem("noon.ddl", problem, &model, &Options::default()).ok()?;
//! let request = Request { operations: 10_000, seed: 1, is_proven: false };
//! let told = explain::missing_plan(&Arc::new(model), &Arc::new(problem), request);
//! assert!(told.proven);
//! assert_eq!((told.goals, told.smallest), (vec!["two".to_owned()], Some(Smallest::Proven)));
//! let places: Vec<&str> = told.reasons.iter().flat_map(|reason| reason.places()).collect();
//! assert!(places.contains(&"noon.ddl:3:1"), "{places:?}");
//! # Ok::<(), farside_planning::language::Findings>(())
//! ```

mod goals;
mod recorder;
mod sets;
mod teller;
#[cfg(test)]
mod tests;
mod values;
mod words;

use std::sync::Arc;

use serde::Serialize;

use crate::Ticks;
use crate::database::{Conflict, Database};
use crate::model::{GoalId, Model, Problem};
use crate::plan::PlanValue;
use crate::search::schedule::Schedule;
use goals::Tries;
use teller::Teller;

/// What an explanation may take, and what is known before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Request {
    /// How many [operations](Database::operations) it may take.
    pub operations: u64,
    /// From which random choices of a repair follow.
    pub seed: u64,
    /// Whether a complete search has proven already that there is no such plan.
    pub is_proven: bool,
}

/// Why there is no plan, or why a plan is without a goal.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Explanation {
    /// What is the matter.
    pub outcome: Outcome,
    /// The goal without which there is a plan, if it is about one only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub goal: Option<ToldGoal>,
    /// Whether it is proven that there is no plan with all goals in question.
    pub proven: bool,
    /// The names of the goals to drop.
    pub goals: Vec<String>,
    /// The same goals with what is known of them.
    pub to_drop: Vec<ToldGoal>,
    /// What is known of how few they are; none if there are none.
    pub smallest: Option<Smallest>,
    /// Goals that cannot all be, with what is the case, as a complete search has proven: without
    /// any one of them no proof was found. Empty if no such set is known.
    pub together: Vec<ToldGoal>,
    /// The goal that was to be added to a plan with those that are not to be dropped, if that is what
    /// the reasons are of; none if they are of a search of its own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub added: Option<ToldGoal>,
    /// Whether the reasons are all that there is: no search had a choice where it failed.
    pub only_way: bool,
    /// Where the way that got furthest ended.
    pub reasons: Vec<Reason>,
    /// How many operations the explanation took.
    pub operations: u64,
}

/// What is the matter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// What is the case cannot be, whatever is wanted: no goals help.
    Facts,
    /// Without any goals no plan was found, and that there is none is not proven.
    FactsUndecided,
    /// The goals, with what is the case, cannot all be, or no plan with all was found.
    Goals,
    /// There is a plan after all: the explanation came upon one.
    Possible,
}

/// What is known of how few the goals to drop are. Without them a plan was found, in any case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Smallest {
    /// No smaller set will do.
    Proven,
    /// None of them can be kept alone: with any one of them back there is no plan. Another set may
    /// be smaller.
    Irreducible,
    /// Nothing more: the budget did not say whether fewer will do.
    Found,
}

/// A goal as an explanation names it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ToldGoal {
    /// Its name.
    pub name: String,
    /// Whether no plan is one without it.
    pub mandatory: bool,
    /// Where it stands, as `file:line:column`.
    pub place: String,
}

/// Something that cannot be.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Reason {
    /// Which kind of thing it is.
    pub kind: ReasonKind,
    /// What it is, in a sentence without its end.
    pub message: String,
    /// Where the model or the problem asks for it; empty if neither does.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub place: String,
    /// From when to when, if it is about times \[ticks\]; the latter is none if it is for good.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub times: Option<(Ticks, Option<Ticks>)>,
    /// By how many ticks times miss, or by how much a resource is over-used.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub amount: Option<i64>,
    /// What cannot all hold, in the order of a cycle; or what contributes to an over-use.
    pub parts: Vec<Part>,
}

/// Kinds of reasons.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ReasonKind {
    /// Times that cannot all be.
    Times,
    /// Values that cannot all be.
    Values,
    /// A resource beyond a limit.
    OverUse,
    /// Something that is asked for and has no place.
    Missing,
    /// A token that is not what a rule asks for.
    Mismatch,
    /// Amounts beyond what can be counted.
    Amount,
    /// What takes more operations than an edit may.
    Undecided,
}

/// A part of a reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Part {
    /// What it says, in a sentence without its end.
    pub message: String,
    /// Where that stands, as `file:line:column`; empty if it stands in no text.
    pub place: String,
    /// How much it takes or gives, if it contributes to an over-use.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub amount: Option<i64>,
    /// The tokens that it is about.
    pub tokens: Vec<ToldToken>,
}

/// A token as an explanation names it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ToldToken {
    /// What it says.
    pub predicate: String,
    /// By the name of the parameter.
    #[serde(serialize_with = "arguments")]
    pub arguments: Vec<(String, PlanValue)>,
    /// Where it is or would be; none if that is not decided.
    pub timeline: Option<String>,
    /// When it can start, as far as is decided \[ticks\].
    pub start: [Ticks; 2],
    /// When it can end.
    pub end: [Ticks; 2],
    /// Why it is there, in words.
    pub why: String,
    /// Where that stands, as `file:line:column`; empty if it stands in no text.
    pub place: String,
}

fn arguments<S: serde::Serializer>(
    arguments: &[(String, PlanValue)],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_map(arguments.iter().map(|(name, value)| (name, value)))
}

/// Why there is no plan with all mandatory goals, or why none was found.
pub fn missing_plan(model: &Arc<Model>, problem: &Arc<Problem>, request: Request) -> Explanation {
    let mandatory = problem.goals.iter().map(|goal| goal.weight.is_none());
    let in_question = mandatory.collect();
    Tries::new(model, problem, request).explain(in_question, None)
}

/// Why a plan that achieves the goals `achieved` is without another one, or why none with it was
/// found: the goals to drop are others, without which it can be achieved.
pub fn left_out(
    model: &Arc<Model>,
    problem: &Arc<Problem>,
    achieved: &[bool],
    goal: GoalId,
    request: Request,
) -> Explanation {
    let mut in_question = achieved.to_vec();
    in_question[goal] = true;
    Tries::new(model, problem, request).explain(in_question, Some(goal))
}

/// What a refusal of a database says, in words: who asks for what, and where.
///
/// Tokens that are gone since are named by what is still known of them.
pub fn refusal(database: &Database, problem: &Problem, conflict: &Conflict) -> Reason {
    Teller::new(database, problem, &[], "a token that is gone").conflict(conflict)
}

/// All over-uses of resources that there are in a schedule if each token is as early as it can be.
pub fn over_uses(schedule: &mut Schedule) -> Vec<Reason> {
    let resources = schedule.database.model().resources.len();
    let mut found = Vec::new();
    for resource in 0..resources {
        let levels = schedule.database.levels(resource);
        let over_uses: Vec<_> = levels.earliest.over_uses().collect();
        let teller = Teller::new(&schedule.database, &schedule.problem, &[], "");
        found.extend(over_uses.iter().map(|one| teller.over_use(resource, one)));
    }
    found
}

impl Reason {
    /// Where all that it rests on stands, in rising order.
    pub fn places(&self) -> Vec<&str> {
        let tokens = self.parts.iter().flat_map(|part| &part.tokens);
        let parts = self.parts.iter().map(|part| part.place.as_str());
        let own = std::iter::once(self.place.as_str());
        let all = tokens.map(|token| token.place.as_str()).chain(parts);
        let mut places: Vec<&str> = all.chain(own).filter(|place| !place.is_empty()).collect();
        places.sort_unstable();
        places.dedup();
        places
    }
}
