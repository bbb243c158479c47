//! Which values of a parameter a model tells apart.
//!
//! Truth values and symbols are told apart always. Numbers are told apart by what functions, tables,
//! guards and literals of the rules make of them: two numbers that all of these answer alike are of
//! one class. A number that nothing asks of is of one class with all others.

use std::collections::BTreeMap;

use farside_planning::model::{
    Argument, Model, Operand, Pattern, Relationship, RelationshipKind, Rule, Target, TypeId, Value,
    Values, VariableId,
};
use smallvec::SmallVec;

use super::NotCompiled;
use crate::service::propositional::Tables;
use crate::service::propositional::state::reckon;
use crate::service::words;

/// The most numbers of a type that are sorted into classes.
const MOST_NUMBERS: i64 = 1 << 20;

/// The classes of a type's values.
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
}

impl Classes {
    #[inline]
    pub(super) fn of(&self, value: Value) -> u32 {
        match self {
            Classes::One => 0,
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
            Classes::One => 1,
            Classes::Numbers(_, classes) => u64::from(classes.iter().max().map_or(0, |&at| at)) + 1,
            Classes::Literals(all) => all.len() as u64 + 1,
            Classes::Each => model.symbols.len().max(2) as u64,
        }
    }
}

/// By type: its classes.
///
/// # Errors
///
/// If a rule asks of more numbers than can be sorted, or of several measured ones at once.
pub(super) fn classes(tables: &Tables) -> Result<Vec<Classes>, NotCompiled> {
    let types = &tables.model.types;
    let mut known: Vec<Classes> = { types.iter() }
        .map(|of| match of.values {
            Values::Numbers(_) => Classes::One,
            _ => Classes::Each,
        })
        .collect();
    // What a function makes of a number is told apart by its own class: classes are split until
    // those of one class lead to one class.
    loop {
        let types = 0..tables.model.types.len();
        let finer: Result<Vec<Classes>, NotCompiled> =
            types.map(|of| classes_of(tables, of, &known)).collect();
        let finer = finer?;
        let count = |all: &[Classes]| -> u64 { all.iter().map(|at| at.count(&tables.model)).sum() };
        if count(&finer) == count(&known) {
            return Ok(finer);
        }
        known = finer;
    }
}

fn classes_of(tables: &Tables, of: TypeId, coarse: &[Classes]) -> Result<Classes, NotCompiled> {
    let model = &tables.model;
    let Values::Numbers(span) = model.types[of].values else {
        return Ok(Classes::Each);
    };
    if !tables.is_measured(of) {
        let classes = 0..(span.max - span.min + 1) as u16;
        return Ok(Classes::Numbers(span.min, classes.collect()));
    }
    let mut questions: Vec<(usize, VariableId)> = Vec::new();
    let mut literals: Vec<Value> = Vec::new();
    for (rule, said) in model.rules.iter().enumerate() {
        patterns(said, &tables.flats[rule].relations, |pattern| {
            let parameters = &model.predicates[pattern.predicate].parameters;
            for (argument, parameter) in pattern.arguments.iter().zip(parameters) {
                if let Argument::Value(value) = *argument
                    && parameter.of == of
                {
                    literals.push(value);
                }
            }
        });
        patterns(said, &tables.flats[rule].relations, |pattern| {
            let parameters = &model.predicates[pattern.predicate].parameters;
            for (argument, parameter) in pattern.arguments.iter().zip(parameters) {
                if let Argument::Variable(variable) = *argument
                    && parameter.of == of
                    && asks_of(said, variable)
                    && !questions.contains(&(rule, variable))
                {
                    questions.push((rule, variable));
                }
            }
        });
    }
    if questions.is_empty() && literals.is_empty() {
        return Ok(Classes::One);
    }
    if questions.is_empty() {
        literals.sort_unstable();
        literals.dedup();
        return Ok(Classes::Literals(literals));
    }
    let count = span.max.saturating_sub(span.min).saturating_add(1);
    if count > MOST_NUMBERS {
        let rule = questions
            .first()
            .map_or(String::new(), |at| words::rule(model, at.0));
        let of = model.types[of].name.clone();
        return Err(NotCompiled::Numbers { of, rule });
    }
    for &(rule, variable) in &questions {
        check_alone(tables, rule, variable)?;
    }
    let mut known: BTreeMap<Vec<Option<Value>>, u16> = BTreeMap::new();
    let mut classes = Vec::with_capacity(count as usize);
    for value in span.min..=span.max {
        let mut answers: Vec<Option<Value>> = Vec::new();
        answers.extend(literals.iter().map(|&at| Some(Value::from(at == value))));
        for &(rule, variable) in &questions {
            ask(tables, coarse, (rule, variable), value, &mut answers);
        }
        let next = u16::try_from(known.len()).map_err(|_| NotCompiled::Numbers {
            of: model.types[of].name.clone(),
            rule: questions
                .first()
                .map_or(String::new(), |at| words::rule(model, at.0)),
        })?;
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
    coarse: &[Classes],
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
    for (variable, known) in known.iter().enumerate() {
        if variable != of {
            let of = said.variables[variable].of;
            let class = |value| coarse[of].of_type(&tables.model.types[of].values, value);
            answers.push(known.map(|value| class(value).map_or(-1, Value::from)));
        }
    }
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
            // A function of symbols, too: each number is a class of its own.
            _ => answers.push(Some(value)),
        }
    }
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
