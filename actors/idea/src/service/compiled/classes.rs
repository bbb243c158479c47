//! Which values of a parameter a model tells apart.
//!
//! Truth values and symbols are told apart always. Numbers of a parameter are told apart by what
//! functions, tables, guards and literals of the rules make of them, and where they go from there: two
//! numbers that all of these answer alike are of one class. A number that nothing asks of is of one
//! class with all others.

use std::collections::BTreeMap;

use farside_planning::model::{
    Argument, Model, Operand, Pattern, PredicateId, Relationship, RelationshipKind, Rule, Target,
    TypeId, Value, Values, VariableId,
};
use smallvec::SmallVec;

use super::NotCompiled;
use crate::service::propositional::Tables;
use crate::service::propositional::state::reckon;
use crate::service::words;

/// The most numbers of a type that are sorted into classes.
const MOST_NUMBERS: i64 = 1 << 20;

/// The classes of values.
#[derive(Clone, Debug)]
pub(super) enum Classes {
    /// All are alike.
    One,
    /// By number from the least one on.
    Numbers(Value, Vec<u16>),
    /// One for each of some numbers, and one for all others.
    Literals(Vec<Value>),
    /// By the value itself: a truth value or a symbol.
    Each,
    /// Too many to be sorted: of variables that no state may hold a value of.
    Unsorted,
}

impl Classes {
    #[inline]
    pub(super) fn of(&self, value: Value) -> u32 {
        match self {
            Classes::One | Classes::Unsorted => 0,
            Classes::Numbers(least, classes) => u32::from(classes[(value - least) as usize]),
            Classes::Literals(all) => match all.binary_search(&value) {
                Ok(place) => place as u32 + 1,
                Err(_) => 0,
            },
            Classes::Each => value as u32,
        }
    }

    /// As [`of`](Self::of); none for what is no value of the type.
    #[inline]
    pub(super) fn of_type(&self, values: &Values, value: Value) -> Option<u32> {
        match (self, values) {
            (Classes::Numbers(least, classes), _) => {
                let place = usize::try_from(value.wrapping_sub(*least)).ok()?;
                classes.get(place).map(|&class| u32::from(class))
            }
            (_, Values::Truth) => (value == 0 || value == 1).then_some(value as u32),
            (_, Values::Symbols(all)) => all.binary_search(&value).is_ok().then_some(value as u32),
            (_, Values::Numbers(span)) => span.contains(value).then(|| self.of(value)),
        }
    }

    /// How many there are at most.
    pub(super) fn count(&self, model: &Model) -> u64 {
        match self {
            Classes::One | Classes::Unsorted => 1,
            Classes::Numbers(_, classes) => u64::from(classes.iter().max().map_or(0, |&at| at)) + 1,
            Classes::Literals(all) => all.len() as u64 + 1,
            Classes::Each => model.symbols.len().max(2) as u64,
        }
    }
}

/// The classes of all that values may be of: parameters of predicates, and variables of rules.
#[derive(Clone, Debug)]
pub(super) struct Sorts {
    /// By predicate, by place.
    pub(super) parameters: Vec<Vec<Classes>>,
    /// By rule, by variable.
    pub(super) variables: Vec<Vec<Classes>>,
}

/// All parameters, for what is posted: their values by class, from 1 on, with 0 for what is not
/// known.
#[derive(Clone, Debug)]
pub(super) struct Slots {
    /// By predicate: where its parameters begin, how many are inputs, and how many there are.
    said: Vec<[u32; 3]>,
    slots: Vec<Slot>,
    /// The classes of the values of narrow parameters, one parameter after another; 0 for what is no
    /// value of the type.
    classes: Vec<u16>,
    /// What is too wide for that.
    wide: Vec<(Values, Classes)>,
}

/// A parameter.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slot {
    /// How many classes there are, with one for what is not known.
    pub(super) count: u64,
    least: Value,
    /// How many values from the least one on have their class in [`Slots::classes`]; none, if they
    /// are too many.
    known: u32,
    /// Where they begin there, or its place in [`Slots::wide`].
    first: u32,
}

/// The most values of which a slot knows each.
const MOST_KNOWN: usize = 1 << 10;

impl Slots {
    pub(super) fn of(model: &Model, sorts: &Sorts) -> Slots {
        let mut all = Slots {
            said: Vec::new(),
            slots: Vec::new(),
            classes: Vec::new(),
            wide: Vec::new(),
        };
        for (said, sorts) in model.predicates.iter().zip(&sorts.parameters) {
            let first = all.slots.len();
            let counts = [first, said.inputs, said.parameters.len()];
            all.said.push(counts.map(|at| at as u32));
            for (at, classes) in said.parameters.iter().zip(sorts) {
                let slot = all.slot(model, at.of, classes);
                all.slots.push(slot);
            }
        }
        all
    }

    fn slot(&mut self, model: &Model, of: TypeId, classes: &Classes) -> Slot {
        let values = &model.types[of].values;
        let (least, most) = match values {
            Values::Truth => (0, 1),
            Values::Symbols(all) => {
                let (first, last) = (all.first(), all.last());
                (first.map_or(0, |&at| at), last.map_or(0, |&at| at))
            }
            Values::Numbers(span) => (span.min, span.max),
        };
        let count = classes.count(model) + 1;
        let known = most.saturating_sub(least).saturating_add(1);
        let narrow = known <= MOST_KNOWN as Value && count < u64::from(u16::MAX);
        let class = |value| { classes.of_type(values, value) }.map_or(0, |at| at as u16 + 1);
        let (known, first) = match narrow {
            true => (known as u32, self.classes.len()),
            false => (0, self.wide.len()),
        };
        if narrow {
            self.classes.extend((least..=most).map(class));
        } else {
            self.wide.push((values.clone(), classes.clone()));
        }
        Slot {
            count,
            least,
            known,
            first: first as u32,
        }
    }

    /// The parameters that a goal gives, or a status.
    #[inline(always)]
    pub(super) fn given(&self, predicate: PredicateId, is_goal: bool) -> &[Slot] {
        let [first, inputs, all] = self.said[predicate].map(|at| at as usize);
        let given = match is_goal {
            true => first..first + inputs,
            false => first + inputs..first + all,
        };
        &self.slots[given]
    }

    /// The class of a value; 0 if it is none of the type.
    #[inline(always)]
    pub(super) fn class(&self, slot: &Slot, value: Value) -> u32 {
        let place = value.wrapping_sub(slot.least) as u64;
        if place < u64::from(slot.known) {
            u32::from(self.classes[slot.first as usize + place as usize])
        } else if slot.known == 0 {
            self.wide_class(slot, value)
        } else {
            0
        }
    }

    #[inline(never)]
    fn wide_class(&self, slot: &Slot, value: Value) -> u32 {
        let (values, classes) = &self.wide[slot.first as usize];
        classes.of_type(values, value).map_or(0, |class| class + 1)
    }
}

/// What is asked of the values of a parameter or a variable.
#[derive(Debug, Default)]
struct Asked {
    literals: Vec<Value>,
    /// What rules make of a variable.
    questions: Vec<(usize, VariableId)>,
}

impl Sorts {
    /// As coarse as can be: what is not measured is told apart always, numbers are not.
    fn coarsest(tables: &Tables) -> Sorts {
        let model = &tables.model;
        let of = |of: TypeId| match &model.types[of].values {
            Values::Numbers(_) if tables.is_measured(of) => Classes::One,
            Values::Numbers(span) => {
                let classes = 0..(span.max - span.min + 1) as u16;
                Classes::Numbers(span.min, classes.collect())
            }
            _ => Classes::Each,
        };
        let predicates = model.predicates.iter();
        let parameters = predicates.map(|at| at.parameters.iter().map(|at| of(at.of)).collect());
        let rules = model.rules.iter();
        let variables = rules.map(|at| at.variables.iter().map(|at| of(at.of)).collect());
        Sorts {
            parameters: parameters.collect(),
            variables: variables.collect(),
        }
    }

    fn count(&self, model: &Model) -> u64 {
        let all = self.parameters.iter().chain(&self.variables).flatten();
        all.map(|at| at.count(model)).sum()
    }
}

/// What is told apart.
///
/// # Errors
///
/// If a rule asks of more numbers than can be sorted, or of several measured ones at once.
pub(super) fn classes(tables: &Tables) -> Result<Sorts, NotCompiled> {
    let mut sorts = Sorts::coarsest(tables);
    // Where a value goes it is told apart by the classes of there, and so is what a function makes of
    // it: classes are split until those of one class lead to one class.
    loop {
        let finer = split(tables, &sorts)?;
        if finer.count(&tables.model) == sorts.count(&tables.model) {
            return Ok(finer);
        }
        sorts = finer;
    }
}

fn split(tables: &Tables, coarse: &Sorts) -> Result<Sorts, NotCompiled> {
    let model = &tables.model;
    let mut finer = coarse.clone();
    for (predicate, said) in model.predicates.iter().enumerate() {
        for (place, parameter) in said.parameters.iter().enumerate() {
            if tables.is_measured(parameter.of) {
                let mut asked = Asked::default();
                for rule in 0..model.rules.len() {
                    asked.add_parameter(tables, coarse, rule, (predicate, place));
                }
                let sorted = sort_out(tables, coarse, parameter.of, asked)?;
                finer.parameters[predicate][place] = sorted;
            }
        }
    }
    for (rule, said) in model.rules.iter().enumerate() {
        for (variable, at) in said.variables.iter().enumerate() {
            if tables.is_measured(at.of) {
                let mut asked = Asked::default();
                asked.add_variable(tables, coarse, rule, variable, None);
                let sorted = match sort_out(tables, coarse, at.of, asked) {
                    Err(NotCompiled::Numbers { .. }) => Classes::Unsorted,
                    sorted => sorted?,
                };
                finer.variables[rule][variable] = sorted;
            }
        }
    }
    Ok(finer)
}

impl Asked {
    /// What a rule asks of a parameter, wherever it names it.
    fn add_parameter(
        &mut self,
        tables: &Tables,
        coarse: &Sorts,
        rule: usize,
        (predicate, place): (PredicateId, usize),
    ) {
        let mut variables: SmallVec<[VariableId; 4]> = SmallVec::new();
        let said = &tables.model.rules[rule];
        patterns(said, &tables.flats[rule].relations, |pattern| {
            if pattern.predicate == predicate {
                match pattern.arguments[place] {
                    Argument::Value(value) => self.literals.push(value),
                    Argument::Variable(variable) => variables.push(variable),
                    Argument::Any => {}
                }
            }
        });
        for variable in variables {
            self.add_variable(tables, coarse, rule, variable, Some((predicate, place)));
        }
    }

    /// What a rule asks of a variable, and of the parameters that have its value, but for one.
    fn add_variable(
        &mut self,
        tables: &Tables,
        coarse: &Sorts,
        rule: usize,
        variable: VariableId,
        but: Option<(PredicateId, usize)>,
    ) {
        let said = &tables.model.rules[rule];
        let mut asks = asks_of(said, variable);
        patterns(said, &tables.flats[rule].relations, |pattern| {
            for (place, argument) in pattern.arguments.iter().enumerate() {
                if *argument == Argument::Variable(variable)
                    && but != Some((pattern.predicate, place))
                {
                    match &coarse.parameters[pattern.predicate][place] {
                        Classes::One | Classes::Each | Classes::Unsorted => {}
                        Classes::Literals(all) => self.literals.extend(all),
                        Classes::Numbers(..) => asks = true,
                    }
                }
            }
        });
        if asks && !self.questions.contains(&(rule, variable)) {
            self.questions.push((rule, variable));
        }
    }
}

fn sort_out(
    tables: &Tables,
    coarse: &Sorts,
    of: TypeId,
    asked: Asked,
) -> Result<Classes, NotCompiled> {
    let model = &tables.model;
    let Asked {
        mut literals,
        questions,
    } = asked;
    literals.sort_unstable();
    literals.dedup();
    let (Values::Numbers(span), Some(&(first, _))) = (&model.types[of].values, questions.first())
    else {
        return Ok(match literals[..] {
            [] => Classes::One,
            _ => Classes::Literals(literals),
        });
    };
    let too_many = || NotCompiled::Numbers {
        of: model.types[of].name.clone(),
        rule: words::rule(model, first),
    };
    let count = span.max.saturating_sub(span.min).saturating_add(1);
    if count > MOST_NUMBERS {
        return Err(too_many());
    }
    for &(rule, variable) in &questions {
        check_alone(tables, rule, variable)?;
    }
    let mut known: BTreeMap<Vec<Option<Value>>, u16> = BTreeMap::new();
    let mut classes = Vec::with_capacity(count as usize);
    for value in span.min..=span.max {
        let mut answers: Vec<Option<Value>> = Vec::new();
        answers.extend(literals.iter().map(|&at| Some(Value::from(at == value))));
        for &question in &questions {
            ask(tables, coarse, question, value, &mut answers);
        }
        let next = u16::try_from(known.len()).map_err(|_| too_many())?;
        classes.push(*known.entry(answers).or_insert(next));
    }
    Ok(Classes::Numbers(span.min, classes))
}

fn patterns(
    rule: &Rule,
    relations: &[farside_planning::model::Relation],
    mut see: impl FnMut(&Pattern),
) {
    see(&rule.master);
    for relation in relations {
        if let Target::New(pattern, _) = &relation.target {
            see(pattern);
        }
    }
}

fn relationships(rule: &Rule) -> impl Iterator<Item = &Relationship> {
    rule.relationships.iter().chain(&rule.when)
}

fn asks_of(rule: &Rule, variable: VariableId) -> bool {
    relationships(rule).any(|said| asks(said, variable))
}

/// Whether a relationship asks of a variable, and does not just give it.
fn asks(said: &Relationship, variable: VariableId) -> bool {
    let is = |operand: &Operand| *operand == Operand::Variable(variable);
    match said.operands.split_last() {
        Some((_, inputs)) if gives(said.kind) => inputs.iter().any(is),
        _ => said.operands.iter().any(is),
    }
}

/// Whether what a rule asks of a number it asks of that number alone.
fn check_alone(tables: &Tables, rule: usize, of: VariableId) -> Result<(), NotCompiled> {
    let said = &tables.model.rules[rule];
    let mut mine: SmallVec<[VariableId; 4]> = smallvec::smallvec![of];
    for relationship in relationships(said) {
        let variables = relationship
            .operands
            .iter()
            .filter_map(|operand| match *operand {
                Operand::Variable(variable) => Some(variable),
                _ => None,
            });
        let variables: SmallVec<[VariableId; 4]> = variables.collect();
        if !mine.iter().any(|&at| asks(relationship, at)) {
            continue;
        }
        let last = variables.last().copied();
        let is_function = gives(relationship.kind);
        let is_symbolic = |variable: VariableId| !tables.is_measured(said.variables[variable].of);
        let others = variables.iter().filter(|&&at| {
            let given = is_function && Some(at) == last;
            !(mine.contains(&at) || given || is_symbolic(at))
        });
        if others.count() > 0 {
            return Err(NotCompiled::Several {
                rule: words::rule(&tables.model, rule),
            });
        }
        if is_function {
            mine.extend(last);
        }
    }
    Ok(())
}

/// What a rule makes of a number, if nothing else is known.
fn ask(
    tables: &Tables,
    coarse: &Sorts,
    (rule, of): (usize, VariableId),
    value: Value,
    answers: &mut Vec<Option<Value>>,
) {
    let said = &tables.model.rules[rule];
    let mut known: SmallVec<[Option<Value>; 8]> = SmallVec::from_elem(None, said.variables.len());
    known[of] = Some(value);
    let seen = |known: &[Option<Value>], operand: &Operand| match *operand {
        Operand::Value(value) => Some(value),
        Operand::Variable(variable) => known[variable],
        _ => None,
    };
    // As often as one function can follow another.
    for _ in 0..said.relationships.len() {
        for relationship in &said.relationships {
            if !gives(relationship.kind) {
                continue;
            }
            let (last, inputs) = relationship.operands.split_last().expect("it has operands");
            let inputs: Option<SmallVec<[Value; 4]>> =
                inputs.iter().map(|at| seen(&known, at)).collect();
            if let (Some(inputs), Operand::Variable(output)) = (inputs, *last) {
                known[output] = match relationship.kind {
                    RelationshipKind::Function(at) => (tables.model.functions[at].call)(&inputs),
                    kind => reckon(kind, &inputs),
                };
            }
        }
    }
    let model = &tables.model;
    let class = |classes: &Classes, of: TypeId, value: Option<Value>| {
        let class = |value| classes.of_type(&model.types[of].values, value);
        value.map(|value| class(value).map_or(-1, Value::from))
    };
    for (variable, &value) in known.iter().enumerate() {
        if variable != of {
            let classes = &coarse.variables[rule][variable];
            answers.push(class(classes, said.variables[variable].of, value));
        }
    }
    patterns(said, &tables.flats[rule].relations, |pattern| {
        let places = coarse.parameters[pattern.predicate].iter();
        let parameters = &model.predicates[pattern.predicate].parameters;
        for ((argument, classes), at) in pattern.arguments.iter().zip(places).zip(parameters) {
            if let Argument::Variable(variable) = *argument {
                answers.push(class(classes, at.of, known[variable]));
            }
        }
    });
    for relationship in relationships(said) {
        // With symbols that are not known it may hold or not: all of them are tried.
        let operands: SmallVec<[Option<Value>; 4]> = relationship
            .operands
            .iter()
            .map(|at| seen(&known, at))
            .collect();
        let open: SmallVec<[usize; 2]> = (0..operands.len())
            .filter(|&at| operands[at].is_none())
            .collect();
        match open[..] {
            [] => {
                let values: SmallVec<[Value; 4]> = operands.into_iter().flatten().collect();
                answers.push(Some(Value::from(tables.holds(relationship.kind, &values))));
            }
            [one] if !gives(relationship.kind) => {
                for other in others(tables, said, relationship.operands[one]) {
                    let values: SmallVec<[Value; 4]> = { operands.iter().enumerate() }
                        .map(|(at, value)| if at == one { other } else { value.unwrap_or(0) })
                        .collect();
                    answers.push(Some(Value::from(tables.holds(relationship.kind, &values))));
                }
            }
            // A function of others: whether it gives what is known is not told apart.
            _ if gives(relationship.kind) && !has_input(relationship, &known) => {}
            // A function of symbols, too: each number is a class of its own.
            _ => answers.push(Some(value)),
        }
    }
}

/// Whether one of the variables that a function is of is known.
fn has_input(said: &Relationship, known: &[Option<Value>]) -> bool {
    let inputs = &said.operands[..said.operands.len() - 1];
    inputs.iter().any(|operand| match *operand {
        Operand::Variable(variable) => known[variable].is_some(),
        _ => false,
    })
}

/// Whether the last operand follows from the others.
fn gives(kind: RelationshipKind) -> bool {
    use RelationshipKind::{Function, Product, Sum};
    matches!(kind, Function(_) | Sum | Product)
}

/// The values that an operand may have, of which there are few.
fn others(tables: &Tables, rule: &Rule, operand: Operand) -> Vec<Value> {
    let Operand::Variable(variable) = operand else {
        return Vec::new();
    };
    match &tables.model.types[rule.variables[variable].of].values {
        Values::Truth => vec![0, 1],
        Values::Symbols(all) => all.clone(),
        Values::Numbers(span) => (span.min..=span.max).collect(),
    }
}
