//! What a model and a problem say, once their text has been read and every name is resolved.
//!
//! Planners, the database and the checker read these tables; none of them reads text. A rule is
//! stored once for each object that it holds for, so that what it asks for names timelines, and
//! not classes: [`Model::rules_of`] gives those of a token at once.
//!
//! All values are whole numbers: a truth value is 0 or 1, a symbol the place of its name in
//! [`Model::symbols`], a number itself. [`Type`] says which. Times are in ticks.

mod problem;

use std::fmt;

pub use problem::{Combination, Fact, Goal, Order, Problem};

use crate::Ticks;
use crate::temporal::Span;

/// What a parameter can be: a number, a truth value (0 or 1) or a symbol (its place in
/// [`Model::symbols`]).
pub type Value = i64;

/// The place of a type in [`Model::types`].
pub type TypeId = usize;
/// The place of a predicate in [`Model::predicates`].
pub type PredicateId = usize;
/// The place of a timeline in [`Model::timelines`].
pub type TimelineId = usize;
/// The place of a resource in [`Model::resources`].
pub type ResourceId = usize;
/// The place of a rule in [`Model::rules`].
pub type RuleId = usize;
/// The place of a variable in [`Rule::variables`] (or in [`Goal::variables`]).
pub type VariableId = usize;
/// The place of a goal in [`Problem::goals`].
pub type GoalId = usize;

/// Where something stands in a text.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Position {
    /// The place of the file's name in [`Model::files`].
    pub file: u32,
    /// The line, from 1; 0 if it stands in no text.
    pub line: u32,
    /// The character within the line, from 1.
    pub column: u32,
}

impl fmt::Display for Position {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.line, self.column)
    }
}

/// Which planners a model is for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Profile {
    /// Extended one latency ahead by an executive: no resources.
    Executive,
    /// Planned ahead by a scheduler: resources, decompositions, weighted goals.
    #[default]
    Scheduler,
}

/// A model: what timelines, resources and predicates there are, and which rules hold.
#[derive(Clone, Debug, Default)]
pub struct Model {
    /// Which planners it is for.
    pub profile: Profile,
    /// The names of its files, the first one that of the model itself.
    pub files: Vec<String>,
    /// The names of symbols: of enumerations and of objects.
    pub symbols: Vec<String>,
    /// The types of parameters. Type 0 is the truth values, type 1 all numbers.
    pub types: Vec<Type>,
    /// What tokens can say.
    pub predicates: Vec<Predicate>,
    /// The timelines of all objects.
    pub timelines: Vec<Timeline>,
    /// The resources of all objects.
    pub resources: Vec<Resource>,
    /// Relations that are listed.
    pub tables: Vec<Table>,
    /// Functions of users.
    pub functions: Vec<Function>,
    /// What holds for tokens.
    pub rules: Vec<Rule>,
    /// By timeline: by place in [`Timeline::predicates`]: the rules of such tokens.
    pub rules_by_timeline: Vec<Vec<Vec<RuleId>>>,
    /// How a search decides.
    pub control: Control,
}

/// The type of truth values in [`Model::types`].
pub const TRUTH: TypeId = 0;
/// The type of all numbers in [`Model::types`].
pub const NUMBER: TypeId = 1;

/// Which values a parameter can have.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Type {
    /// Its name.
    pub name: String,
    /// Its values.
    pub values: Values,
}

/// The values of a type.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Values {
    /// 0 and 1.
    Truth,
    /// Whole numbers within a span.
    Numbers(Span),
    /// Symbols, in rising order.
    Symbols(Vec<Value>),
}

/// What a token can say: a procedure P(i → s), as section 2 of the IDEA paper has it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Predicate {
    /// Its name.
    pub name: String,
    /// Its parameters: the inputs, then the outputs.
    pub parameters: Vec<Parameter>,
    /// How many of them are inputs.
    pub inputs: usize,
    /// What outputs are, by their places, once its time is over and no status came.
    pub timed_out: Vec<(usize, Value)>,
    /// What outputs are, by their places, once something else took its place and no status came.
    pub preempted: Vec<(usize, Value)>,
}

/// A parameter of a predicate.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parameter {
    /// Its name; empty if the model gives none.
    pub name: String,
    /// Its type.
    pub of: TypeId,
}

/// What a timeline holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimelineKind {
    /// Exactly one token at any time: a state variable, a goal register.
    State,
    /// At most one token at any time: a unary resource.
    Unary,
    /// Any tokens at any time: activities that only resources and rules keep apart.
    Free,
}

/// A timeline of an object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Timeline {
    /// Its full name, as `k9.Fans_SV`; the state variable's alone if its class has one object
    /// that nobody named.
    pub name: String,
    /// The symbol of its object.
    pub object: Value,
    /// What it holds.
    pub kind: TimelineKind,
    /// What its tokens can say.
    pub predicates: Vec<PredicateId>,
    /// What a planner lets it say where nothing else is asked for.
    pub default: Option<Filler>,
    /// What an executive lets it say first, if that is not its default.
    pub initial: Option<Filler>,
}

/// A token that fills a timeline where nothing is asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Filler {
    /// What it says.
    pub predicate: PredicateId,
    /// By parameter: its value, or none if any will do.
    pub values: Vec<Option<Value>>,
}

/// What uses of a resource add up to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResourceKind {
    /// What is used comes back at the end of the use: a processor, a bus, power.
    Renewable,
    /// What is consumed is gone until something produces it: energy, memory.
    Depletable,
    /// What is taken within any `window_ticks` is limited, and what was taken longer ago does
    /// not count: a duty cycle, the starts of a motor.
    RateLimited {
        /// How long a take counts \[ticks\].
        window_ticks: Ticks,
    },
}

/// A resource of an object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Resource {
    /// Its full name, as timelines have theirs.
    pub name: String,
    /// The symbol of its object.
    pub object: Value,
    /// What uses add up to.
    pub kind: ResourceKind,
    /// The level when the horizon begins: the capacity of a renewable or rate-limited one.
    pub initial: Value,
    /// Between which levels it must stay.
    pub limits: Span,
    /// What is changed for a while or for good by nobody's token: from a tick on, so much more.
    pub changes: Vec<(Ticks, Value)>,
    /// Where it is declared.
    pub position: Position,
}

/// A relation whose rows are listed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Table {
    /// Its name.
    pub name: String,
    /// How many values a row has.
    pub columns: usize,
    /// The rows, one after another, in rising order.
    pub rows: Vec<Value>,
}

/// A pure function of a user: from all arguments but the last to the last.
#[derive(Clone)]
pub struct Function {
    /// Its name.
    pub name: String,
    /// How many arguments it has, with the output.
    pub arguments: usize,
    /// What it gives; none if it does not know, and then its output stays unbound.
    pub call: fn(&[Value]) -> Option<Value>,
}

impl fmt::Debug for Function {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.name, self.arguments)
    }
}

/// A compatibility: what must hold wherever a token of its master's kind is.
#[derive(Clone, Debug)]
pub struct Rule {
    /// Where it stands.
    pub position: Position,
    /// The tokens that it holds for. Literals among its arguments are a guard: while they are
    /// undecided, the rule does not hold yet.
    pub master: Pattern,
    /// Its variables, shared by all that it says.
    pub variables: Vec<Variable>,
    /// More of the guard: what must be certain for the rule to hold.
    pub when: Vec<Relationship>,
    /// How long the master lasts, least and most.
    pub duration: Option<[Bound; 2]>,
    /// What ties variables together.
    pub relationships: Vec<Relationship>,
    /// What the master does to resources.
    pub effects: Vec<Effect>,
    /// Which other tokens there must be.
    pub body: Body,
    /// How many tokens it names: the master is 0, the others follow in the order of the text.
    pub labels: usize,
}

/// A variable of a rule.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Variable {
    /// Its name, with the question mark.
    pub name: String,
    /// Its type.
    pub of: TypeId,
}

/// Tokens of a predicate on one of some timelines.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pattern {
    /// Where it stands.
    pub position: Position,
    /// The timelines on which such a token can be, in the order in which they are tried.
    pub timelines: Vec<TimelineId>,
    /// The variable that is the timeline's object, if there is one.
    pub object: Option<VariableId>,
    /// What it says.
    pub predicate: PredicateId,
    /// By parameter of the predicate.
    pub arguments: Vec<Argument>,
}

/// What a pattern says of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Argument {
    /// Anything.
    Any,
    /// This value.
    Value(Value),
    /// The value of a variable.
    Variable(VariableId),
}

/// A number that a rule says, or asks a variable for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bound {
    /// No bound.
    None,
    /// This number.
    Value(Value),
    /// The value of a variable.
    Variable(VariableId),
}

/// Which tokens there must be.
#[derive(Clone, Debug)]
pub enum Body {
    /// All of these; with none, nothing.
    All(Vec<Body>),
    /// One of these: the first that can be.
    Any(Vec<Body>, Position),
    /// One relation.
    Relation(Box<Relation>),
}

/// Which end of a token.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum End {
    /// Where it starts.
    Start,
    /// Where it ends: the first tick at which it is over.
    Finish,
}

/// That the end `to` of a target lies `min` to `max` ticks after the end `from` of the anchor, or,
/// if it is `backward`, as much before it: `temporaldistance(from, [min max], to)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Distance {
    /// Which end of the anchor.
    pub from: End,
    /// Which end of the target.
    pub to: End,
    /// At least so many ticks.
    pub min: Bound,
    /// At most so many ticks.
    pub max: Bound,
    /// Whether it is the anchor's end that is later.
    pub backward: bool,
}

/// A temporal relation by its name in the language.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum RelationKind {
    /// The target starts when the anchor ends.
    Meets,
    /// The anchor starts when the target ends.
    MetBy,
    /// The target starts after the anchor's end: 1 tick after it or more if no bounds are given.
    Before,
    /// The anchor starts after the target's end.
    After,
    /// Both start together.
    Starts,
    /// Both end together.
    Ends,
    /// Both start and end together.
    Equals,
    /// The target lies within the anchor.
    Contains,
    /// The anchor lies within the target.
    ContainedBy,
    /// The anchor starts while the target lasts.
    StartsDuring,
    /// The anchor starts before the target does.
    StartsBefore,
    /// The anchor ends while the target lasts.
    EndsDuring,
    /// The anchor ends after the target does.
    EndsAfter,
    /// Any distance between an end of the anchor and one of the target: `temporaldistance`. It
    /// has no usual distances.
    Distance,
}

/// That a token stands in a temporal relation to another.
#[derive(Clone, Debug)]
pub struct Relation {
    /// Where it stands.
    pub position: Position,
    /// Its name.
    pub kind: RelationKind,
    /// The label of the token that it is said of: 0 is the master.
    pub anchor: usize,
    /// The token that it asks for.
    pub target: Target,
    /// What it says of times.
    pub distances: Vec<Distance>,
    /// Whether the target must be there already: a condition, which never inserts a token.
    pub condition: bool,
}

/// The token that a relation asks for.
#[derive(Clone, Debug)]
pub enum Target {
    /// A token of this pattern, which gets this label.
    New(Pattern, usize),
    /// The token that has this label already.
    Label(usize),
}

/// What a token does to a resource.
#[derive(Clone, Debug)]
pub struct Effect {
    /// Where it stands.
    pub position: Position,
    /// The resources that will do, in the order in which they are tried.
    pub resources: Vec<ResourceId>,
    /// What it does.
    pub kind: EffectKind,
    /// How much; at least 0.
    pub amount: Bound,
}

/// What is done to a resource.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EffectKind {
    /// Less of it from start to end.
    Uses,
    /// Less of it from an end on.
    Consumes(End),
    /// More of it from an end on.
    Produces(End),
}

/// A parametric constraint.
#[derive(Clone, Debug)]
pub struct Relationship {
    /// Where it stands.
    pub position: Position,
    /// What it says.
    pub kind: RelationshipKind,
    /// Of what.
    pub operands: Vec<Operand>,
}

/// What a parametric constraint says of its operands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RelationshipKind {
    /// All are equal.
    Equal,
    /// The two are not.
    Different,
    /// The first is less than the second.
    Less,
    /// The first is at most the second.
    AtMost,
    /// The last is the sum of the others.
    Sum,
    /// The last is the product of the others.
    Product,
    /// They are a row of a table, by its place in [`Model::tables`].
    Table(usize),
    /// The last is what a function gives, by its place in [`Model::functions`].
    Function(usize),
}

/// What a parametric constraint speaks of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operand {
    /// A value.
    Value(Value),
    /// A variable of the rule.
    Variable(VariableId),
    /// When a token starts, by its label \[ticks\].
    Start(usize),
    /// When a token ends, by its label \[ticks\].
    Finish(usize),
    /// How long a token lasts, by its label \[ticks\].
    Duration(usize),
}

/// How a search decides: section 3.3 of the IDEA paper names these three.
#[derive(Clone, Debug, Default)]
pub struct Control {
    /// Which subgoals first: the earlier in the list. What is not in it comes after, as found.
    pub subgoals: Vec<(TimelineId, PredicateId)>,
    /// Which slots of a timeline first for tokens of a predicate; [`SlotOrder::Earliest`] else.
    pub slots: Vec<(TimelineId, PredicateId, SlotOrder)>,
    /// Which parameters a search does not bind, since another system will.
    pub unbound: Vec<(PredicateId, usize)>,
}

/// In which order the slots of a timeline are tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlotOrder {
    /// From the horizon's begin.
    Earliest,
    /// From its end.
    Latest,
    /// The ones next to the token that asks for it first.
    Nearest,
}

impl Model {
    /// The rules of tokens of a predicate on a timeline.
    pub fn rules_of(&self, timeline: TimelineId, predicate: PredicateId) -> &[RuleId] {
        let predicates = &self.timelines[timeline].predicates;
        match predicates.iter().position(|&at| at == predicate) {
            Some(place) => &self.rules_by_timeline[timeline][place],
            None => &[],
        }
    }

    /// How a value of a type is written: a symbol by its name.
    pub fn show(&self, of: TypeId, value: Value) -> String {
        match &self.types[of].values {
            Values::Truth => if value == 0 { "False" } else { "True" }.to_string(),
            Values::Numbers(_) => value.to_string(),
            Values::Symbols(_) => {
                let name = usize::try_from(value)
                    .ok()
                    .and_then(|value| self.symbols.get(value));
                name.cloned().unwrap_or_else(|| value.to_string())
            }
        }
    }

    /// Where something stands, as `file:line:column`.
    pub fn place(&self, position: Position) -> String {
        let file = self.files.get(position.file as usize);
        let file = file.map_or("", String::as_str);
        format!("{file}:{position}")
    }
}

impl RelationKind {
    /// What it says of times, with the bounds that a model gives, or with the usual ones: exactly
    /// together for the ends that its name puts together, any time in the right order for the
    /// others (*IDEA*'s reading: `[0 0]` for the concurrent kind, else `[0 +inf]`).
    ///
    /// The bounds given are those of its distances, in their order: of starts before those of
    /// ends.
    ///
    /// ```
    /// use farside_planning::model::{Bound, RelationKind};
    /// let usual = RelationKind::Meets.distances(&[]);
    /// assert_eq!((usual[0].min, usual[0].max), (Bound::Value(0), Bound::Value(0)));
    /// let within = RelationKind::Before.distances(&[[Bound::Value(5), Bound::Value(10)]]);
    /// assert_eq!((within[0].min, within[0].max), (Bound::Value(5), Bound::Value(10)));
    /// ```
    pub fn distances(self, given: &[[Bound; 2]]) -> Vec<Distance> {
        use End::{Finish, Start};
        let together = [Bound::Value(0), Bound::Value(0)];
        let later = [Bound::Value(0), Bound::None];
        let strictly = [Bound::Value(1), Bound::None];
        // From the anchor's end to the target's: backward ones count from the target.
        let rows: &[(End, End, [Bound; 2], bool)] = match self {
            RelationKind::Meets => &[(Finish, Start, together, false)],
            RelationKind::MetBy => &[(Start, Finish, together, true)],
            RelationKind::Before => &[(Finish, Start, strictly, false)],
            RelationKind::After => &[(Start, Finish, strictly, true)],
            RelationKind::Starts => &[(Start, Start, together, false)],
            RelationKind::Ends => &[(Finish, Finish, together, false)],
            RelationKind::Equals => &[
                (Start, Start, together, false),
                (Finish, Finish, together, false),
            ],
            RelationKind::Contains => {
                &[(Start, Start, later, false), (Finish, Finish, later, true)]
            }
            RelationKind::ContainedBy => {
                &[(Start, Start, later, true), (Finish, Finish, later, false)]
            }
            RelationKind::StartsDuring => {
                &[(Start, Start, later, true), (Start, Finish, later, false)]
            }
            RelationKind::StartsBefore => &[(Start, Start, later, false)],
            RelationKind::EndsDuring => {
                &[(Finish, Start, later, true), (Finish, Finish, later, false)]
            }
            RelationKind::EndsAfter => &[(Finish, Finish, later, true)],
            RelationKind::Distance => &[],
        };
        let mut distances = Vec::with_capacity(rows.len());
        for (row, &(from, to, usual, backward)) in rows.iter().enumerate() {
            let [min, max] = given.get(row).copied().unwrap_or(usual);
            distances.push(Distance {
                from,
                to,
                min,
                max,
                backward,
            });
        }
        distances
    }
}
