//! What registers carry, in the words of a model, and back: each side has its own symbols.

use std::sync::Arc;

use farside_planning::model::{Model, PredicateId, TimelineId, Value, Values};
use thiserror::Error;

use crate::register::RegisterValue;

/// Why what a register carries means nothing to a model.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum WordingError {
    /// The timeline does not say such a thing.
    #[error("{timeline} does not say {procedure}")]
    Procedure {
        /// The timeline.
        timeline: String,
        /// The procedure.
        procedure: String,
    },
    /// It has another number of parameters.
    #[error("{procedure}: expected {expected} {what}, found {actual}")]
    Count {
        /// The procedure.
        procedure: String,
        /// `inputs` or `outputs`.
        what: &'static str,
        /// How many the model has.
        expected: usize,
        /// How many were given.
        actual: usize,
    },
    /// A value is not of the parameter's type.
    #[error("{procedure}: {parameter}: expected a {expected}, found {actual}")]
    Type {
        /// The procedure.
        procedure: String,
        /// The parameter.
        parameter: String,
        /// The type's name.
        expected: String,
        /// The value.
        actual: String,
    },
}

/// A value in words.
pub fn encode(model: &Model, predicate: PredicateId, place: usize, value: Value) -> RegisterValue {
    let of = model.predicates[predicate].parameters[place].of;
    match &model.types[of].values {
        Values::Truth => RegisterValue::Truth(value != 0),
        Values::Numbers(_) => RegisterValue::Number(value),
        Values::Symbols(_) => {
            let name = usize::try_from(value)
                .ok()
                .and_then(|at| model.symbols.get(at));
            RegisterValue::Symbol(name.map_or("", String::as_str).into())
        }
    }
}

/// The place of a procedure among the predicates of a model.
///
/// # Errors
///
/// If the timeline does not say such a thing.
pub fn procedure(
    model: &Model,
    timeline: TimelineId,
    name: &str,
) -> Result<PredicateId, WordingError> {
    let at = &model.timelines[timeline];
    let found = at
        .predicates
        .iter()
        .find(|&&one| model.predicates[one].name == name);
    found.copied().ok_or_else(|| WordingError::Procedure {
        timeline: at.name.clone(),
        procedure: name.to_owned(),
    })
}

/// The inputs of a procedure as a model's values.
///
/// # Errors
///
/// If there are too many or too few, or one is not of its type.
pub fn inputs(
    model: &Model,
    predicate: PredicateId,
    given: &[RegisterValue],
) -> Result<Vec<Value>, WordingError> {
    let procedure = &model.predicates[predicate];
    check_count(model, predicate, "inputs", procedure.inputs, given.len())?;
    let each = given.iter().enumerate();
    each.map(|(place, value)| decode(model, predicate, place, value))
        .collect()
}

/// The outputs of a procedure as a model's values. None at all is what a side says that knows none.
///
/// # Errors
///
/// If there are too many or too few, or one is not of its type.
pub fn outputs(
    model: &Model,
    predicate: PredicateId,
    given: &[Option<RegisterValue>],
) -> Result<Vec<Option<Value>>, WordingError> {
    let procedure = &model.predicates[predicate];
    let expected = procedure.parameters.len() - procedure.inputs;
    if given.is_empty() {
        return Ok(vec![None; expected]);
    }
    check_count(model, predicate, "outputs", expected, given.len())?;
    let each = given.iter().enumerate();
    each.map(|(place, value)| {
        let place = procedure.inputs + place;
        value
            .as_ref()
            .map(|value| decode(model, predicate, place, value))
            .transpose()
    })
    .collect()
}

fn check_count(
    model: &Model,
    predicate: PredicateId,
    what: &'static str,
    expected: usize,
    actual: usize,
) -> Result<(), WordingError> {
    match expected == actual {
        true => Ok(()),
        false => Err(WordingError::Count {
            procedure: model.predicates[predicate].name.clone(),
            what,
            expected,
            actual,
        }),
    }
}

fn decode(
    model: &Model,
    predicate: PredicateId,
    place: usize,
    value: &RegisterValue,
) -> Result<Value, WordingError> {
    let procedure = &model.predicates[predicate];
    let parameter = &procedure.parameters[place];
    let of = &model.types[parameter.of];
    let found = match (&of.values, value) {
        (Values::Truth, RegisterValue::Truth(truth)) => Some(Value::from(*truth)),
        (Values::Numbers(span), RegisterValue::Number(number)) => {
            Some(*number).filter(|number| (span.min..=span.max).contains(number))
        }
        (Values::Symbols(symbols), RegisterValue::Symbol(name)) => {
            let is_it = |&&symbol: &&Value| {
                let at = usize::try_from(symbol).ok();
                at.and_then(|at| model.symbols.get(at))
                    .is_some_and(|one| **one == **name)
            };
            symbols.iter().find(is_it).copied()
        }
        _ => None,
    };
    found.ok_or_else(|| WordingError::Type {
        procedure: procedure.name.clone(),
        parameter: parameter.name.clone(),
        expected: of.name.clone(),
        actual: match value {
            RegisterValue::Truth(truth) => truth.to_string(),
            RegisterValue::Number(number) => number.to_string(),
            RegisterValue::Symbol(name) => name.to_string(),
        },
    })
}

/// By output of a predicate: the value called `symbol`, where its type has one.
pub fn named_outputs(model: &Model, predicate: PredicateId, symbol: &str) -> Vec<Option<Value>> {
    let procedure = &model.predicates[predicate];
    let known = model.symbols.iter().position(|one| one == symbol);
    let known = known.and_then(|at| Value::try_from(at).ok());
    let outputs = procedure.parameters[procedure.inputs..].iter();
    outputs
        .map(|output| match &model.types[output.of].values {
            Values::Symbols(symbols) => known.filter(|value| symbols.contains(value)),
            _ => None,
        })
        .collect()
}

/// What a token says, for people: `Stopping(tilt 0)`.
pub fn words(model: &Model, predicate: PredicateId, parameters: &[Option<Value>]) -> String {
    let procedure = &model.predicates[predicate];
    let mut text = procedure.name.clone();
    let known = parameters.iter().enumerate().take(procedure.inputs);
    let inputs: Vec<String> = known
        .map(|(place, value)| match value {
            Some(value) => plain(model, predicate, place, *value).to_string(),
            None => "?".to_owned(),
        })
        .collect();
    if !inputs.is_empty() {
        text.push('(');
        text.push_str(&inputs.join(" "));
        text.push(')');
    }
    text
}

/// The outputs of a token for people, `?` where one is not known.
pub fn output_words(
    model: &Model,
    predicate: PredicateId,
    parameters: &[Option<Value>],
) -> Vec<String> {
    let inputs = model.predicates[predicate].inputs;
    let outputs = parameters.iter().enumerate().skip(inputs);
    outputs
        .map(|(place, value)| match value {
            Some(value) => plain(model, predicate, place, *value).to_string(),
            None => "?".to_owned(),
        })
        .collect()
}

fn plain(model: &Model, predicate: PredicateId, place: usize, value: Value) -> Arc<str> {
    match encode(model, predicate, place, value) {
        RegisterValue::Truth(truth) => truth.to_string().into(),
        RegisterValue::Number(number) => number.to_string().into(),
        RegisterValue::Symbol(name) => name,
    }
}
