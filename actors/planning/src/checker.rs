//! Whether a plan is valid, and if not, every reason why not.
//!
//! The checker reads a [`Model`], a [`Problem`] and a [`Plan`], and shares no code with what makes
//! plans: no network, no profile, no propagation. It looks at the fixed times of the tokens and
//! tries definitions, so that a mistake of a planner is not made here again.
//!
//! # What is valid
//!
//! - **Timelines.** Two tokens on a state or unary timeline are one after the other; those of a
//!   state timeline leave no time of the horizon without one. A token takes the ticks from its
//!   start up to, but without, its end.
//! - **Horizon.** Each token lies in it, and what a rule asks for can lie in it: a relation whose
//!   target could only end by time 0 or start at the horizon's end or later is not asked for, and
//!   neither is what is anchored to such a target.
//! - **Facts and goals.** Each fact has a token of its own. Each goal is said to be achieved, by a
//!   token that fits it, or to be left out, which mandatory ones must not be. A token may achieve
//!   several goals.
//! - **Rules.** A rule holds for a token that its master fits and whose `when` is certain; what an
//!   argument that is not bound leaves undecided is not certain. Where it holds, there are tokens
//!   for its relations, other than the master, and values for its variables, such that all that it
//!   says is true. A relationship that only an unbound argument leaves undecided is no violation;
//!   one that speaks of a token that was not asked for is none either.
//! - **Resources.** Each effect of a rule that holds is listed with the resource that was taken,
//!   but for what changes it by 0. The level stays within the limits from time 0 to the horizon's
//!   end. A use that ends when another begins does not meet it. What is taken of a rate-limited
//!   resource, a use when it starts, counts until the window is over, however long the use.
//! - **Score, makespan, windows** are what the plan's own definitions make them.
//!
//! ```
//! use farside_planning::checker::{Kind, check};
//! use farside_planning::model::{Model, Predicate, Problem, Timeline, TimelineKind};
//! use farside_planning::plan::{Plan, PlanToken};
//! let mut model = Model::default();
//! let at = Predicate { name: "At".into(), ..Predicate::default() };
//! model.predicates.push(at);
//! model.timelines.push(Timeline {
//!     name: "k9.Location".into(),
//!     object: 0,
//!     kind: TimelineKind::State,
//!     predicates: vec![0],
//!     default: None,
//!     initial: None,
//! });
//! let problem = Problem { horizon: 10, ..Problem::default() };
//! let mut plan = Plan::new(&model, &problem);
//! plan.tokens.push(PlanToken::new(&model, 1, (0, 0), &[], [0, 10]));
//! assert!(check(&model, &problem, &plan).is_empty());
//! plan.tokens[0].end = 8;
//! plan.tokens[0].end_window = [8, 8];
//! let violations = check(&model, &problem, &plan);
//! assert_eq!(violations[0].kind, Kind::Gap);
//! assert_eq!(violations[0].to_string(), "k9.Location has no token from 8 to 10");
//! ```

mod goals;
mod names;
mod relationships;
mod resources;
mod rules;
#[cfg(test)]
mod tests;
mod timelines;
mod windows;

use std::fmt;

use serde::Serialize;

use crate::Ticks;
use crate::model::{
    Argument, Distance, End, Model, Pattern, Position, PredicateId, Problem, ResourceId,
    TimelineId, Value, Values, Variable,
};
use crate::plan::{Plan, PlanToken, TokenId};

/// The most violations that are listed.
pub const MAX_VIOLATIONS: usize = 1_000;

/// What is wrong with a plan.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Violation {
    /// Which kind of thing it is.
    pub kind: Kind,
    /// The tokens that it is about.
    pub tokens: Vec<TokenId>,
    /// From when to when, if it is about times \[ticks\].
    pub times: Option<[Ticks; 2]>,
    /// Where the model or the problem says what is violated, as `file:line:column`; empty if
    /// neither does.
    pub place: String,
    /// What is wrong, in a sentence.
    pub message: String,
}

/// Kinds of violations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// A name that the model or the problem does not know, or a plan for another problem.
    Name,
    /// A value that is not of its parameter's type.
    Domain,
    /// A token that ends before it starts.
    Inverted,
    /// A token outside the horizon, or anchored to one.
    Horizon,
    /// A time without a token on a state timeline.
    Gap,
    /// Two tokens at once where only one can be.
    Overlap,
    /// A fact without a token.
    Fact,
    /// A goal that is not achieved though it must be or is said to be.
    Goal,
    /// Goals whose times are in no order that the problem allows.
    Order,
    /// A rule whose relations find no tokens.
    Relation,
    /// A rule whose values do not fit together.
    Relationship,
    /// A token that lasts too short or too long for a rule.
    Duration,
    /// What a token is said to do to resources is not what the rules say.
    Effect,
    /// A resource outside its limits.
    Overuse,
    /// A score that is another.
    Score,
    /// A makespan that is another.
    Makespan,
    /// A window without its token's time in it, or other than the plan's constraints make it.
    Window,
    /// A constraint of the plan that the fixed times violate.
    Constraint,
    /// A reason for a token that is none.
    Origin,
    /// What could not be decided: values without bounds, or too many ways to try.
    Undecided,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.place.is_empty() {
            write!(f, "{}: ", self.place)?;
        }
        f.write_str(&self.message)
    }
}

/// All that is wrong with a plan; nothing if it is valid. At most [`MAX_VIOLATIONS`] are listed.
pub fn check(model: &Model, problem: &Problem, plan: &Plan) -> Vec<Violation> {
    let mut report = Report::default();
    let scene = names::resolve(model, problem, plan, &mut report);
    timelines::check(&scene, &mut report);
    goals::check(&scene, &mut report);
    rules::check(&scene, &mut report);
    resources::check(&scene, &mut report);
    windows::check(&scene, &mut report);
    report.violations
}

/// The violations that were found.
#[derive(Default)]
struct Report {
    violations: Vec<Violation>,
}

impl Report {
    fn add(&mut self, kind: Kind, message: String) -> Added<'_> {
        if self.violations.len() < MAX_VIOLATIONS {
            self.violations.push(Violation {
                kind,
                tokens: Vec::new(),
                times: None,
                place: String::new(),
                message,
            });
            return Added(self.violations.last_mut());
        }
        Added(None)
    }
}

/// A violation that was just added; none if there are too many.
struct Added<'a>(Option<&'a mut Violation>);

impl Added<'_> {
    fn tokens(mut self, tokens: impl IntoIterator<Item = TokenId>) -> Self {
        if let Some(violation) = &mut self.0 {
            violation.tokens.extend(tokens);
        }
        self
    }

    fn times(mut self, from: Ticks, to: Ticks) -> Self {
        if let Some(violation) = &mut self.0 {
            violation.times = Some([from, to]);
        }
        self
    }

    fn at(mut self, place: String) -> Self {
        if let Some(violation) = &mut self.0 {
            violation.place = place;
        }
        self
    }
}

/// A plan with its names resolved. Tokens that have unknown names or end before they start are not
/// in it.
struct Scene<'a> {
    model: &'a Model,
    problem: &'a Problem,
    plan: &'a Plan,
    tokens: Vec<Seen<'a>>,
    /// By timeline: the tokens, by start and then end.
    by_start: Vec<Vec<usize>>,
    /// By timeline: the tokens, by end and then start.
    by_end: Vec<Vec<usize>>,
}

/// A token with its names resolved.
struct Seen<'a> {
    token: &'a PlanToken,
    timeline: TimelineId,
    predicate: PredicateId,
    /// By parameter; none if it is not bound.
    values: Vec<Option<Value>>,
    /// By listed effect: its resource, if there is such a one.
    resources: Vec<Option<ResourceId>>,
}

impl Seen<'_> {
    fn end(&self, end: End) -> Ticks {
        match end {
            End::Start => self.token.start,
            End::Finish => self.token.end,
        }
    }
}

impl Scene<'_> {
    /// Where something stands, if it stands anywhere.
    fn place(&self, position: Position) -> String {
        match position.line {
            0 => String::new(),
            _ => self.model.place(position),
        }
    }

    /// The same in the problem's files.
    fn problem_place(&self, position: Position) -> String {
        let file = self.problem.files.get(position.file as usize);
        match (position.line, file) {
            (0, _) => String::new(),
            (_, Some(file)) => format!("{file}:{position}"),
            (_, None) => position.to_string(),
        }
    }

    /// Whether a value is of a type.
    fn is_of(&self, of: usize, value: Value) -> bool {
        match &self.model.types[of].values {
            Values::Truth => value == 0 || value == 1,
            Values::Numbers(span) => span.contains(value),
            Values::Symbols(symbols) => symbols.binary_search(&value).is_ok(),
        }
    }

    /// Whether a token is one of a pattern. If so, `bindings` hold the values of its variables, and
    /// none of those whose arguments are not bound: they are `open`.
    fn fits(
        &self,
        pattern: &Pattern,
        seen: &Seen<'_>,
        variables: &[Variable],
        bindings: &mut Bindings,
    ) -> bool {
        if seen.predicate != pattern.predicate || !pattern.timelines.contains(&seen.timeline) {
            return false;
        }
        let object = self.model.timelines[seen.timeline].object;
        let is_object = |v: usize, bindings: &mut Bindings| {
            self.is_of(variables[v].of, object) && bindings.bind(v, object)
        };
        if pattern
            .object
            .is_some_and(|variable| !is_object(variable, bindings))
        {
            return false;
        }
        pattern
            .arguments
            .iter()
            .zip(&seen.values)
            .all(|(argument, &value)| match (*argument, value) {
                (Argument::Any, _) => true,
                (Argument::Value(wanted), value) => value == Some(wanted),
                (Argument::Variable(variable), Some(value)) => {
                    self.is_of(variables[variable].of, value) && bindings.bind(variable, value)
                }
                (Argument::Variable(variable), None) => {
                    bindings.open[variable] = true;
                    true
                }
            })
    }
}

/// What is known of variables.
#[derive(Clone, Debug, Default)]
struct Bindings {
    values: Vec<Option<Value>>,
    /// Which ones stand for an argument that is not bound.
    open: Vec<bool>,
}

impl Bindings {
    fn new(variables: usize) -> Bindings {
        Bindings {
            values: vec![None; variables],
            open: vec![false; variables],
        }
    }

    /// Whether a variable has this value, or had none until now.
    fn bind(&mut self, variable: usize, value: Value) -> bool {
        *self.values[variable].get_or_insert(value) == value
    }
}

/// How many ticks lie between the ends that a distance speaks of, in its direction.
fn apart(distance: &Distance, anchor: &Seen<'_>, target: &Seen<'_>) -> Ticks {
    let (from, to) = (anchor.end(distance.from), target.end(distance.to));
    match distance.backward {
        true => from.saturating_sub(to),
        false => to.saturating_sub(from),
    }
}
