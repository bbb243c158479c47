//! Ticks after this one: what would come if nothing is heard, or what is guessed is heard.
//!
//! What is decided for now is decided so that it goes on until the last of them. Only what is
//! decided for now stays: what comes later is planned anew when it comes, with what was heard then.

use std::sync::Arc;

use crate::Ticks;
use crate::database::{Conflict, Database, TokenId};
use crate::model::{Argument, Model, Operand, RelationshipKind, Value, Values};
use crate::search::{Decision, Flaw};

/// The ticks that are looked at, and what was decided.
#[derive(Clone, Debug, Default)]
pub(super) struct Later {
    /// The last one.
    pub(super) until: Ticks,
    /// Whether statuses are guessed.
    pub(super) guess: bool,
    /// What is to be decided in any case, the first decision last.
    pub(super) script: Vec<Decision>,
    /// The tick of this cycle.
    base: Ticks,
    /// Each tick that was left for the next, and how deep the database was.
    steps: Vec<(usize, Ticks)>,
    /// What was decided for now, and how deep the database was.
    decided: Vec<(usize, Decision)>,
    /// By predicate: by parameter: what it is guessed to be, the best first; nothing for what is
    /// not guessed.
    values: Arc<[Vec<Vec<Value>>]>,
}

impl Later {
    pub(super) fn of(model: &Model) -> Self {
        let predicates = 0..model.predicates.len();
        Later {
            values: predicates.map(|at| guesses_of(model, at)).collect(),
            ..Later::default()
        }
    }

    /// A search begins at a tick.
    pub(super) fn begin(&mut self, tick: Ticks, until: Ticks) {
        (self.base, self.until) = (tick, until);
        self.steps.clear();
        self.decided.clear();
        self.script.clear();
    }

    /// What was decided for now, to be decided again: the first decision last.
    pub(super) fn take_script(&mut self) -> Vec<Decision> {
        self.decided.drain(..).rev().map(|at| at.1).collect()
    }

    pub(super) fn note(&mut self, database: &Database, tick: Ticks, decision: Decision) {
        if self.until > self.base && tick == self.base {
            self.decided.push((database.depth(), decision));
        }
    }

    pub(super) fn step(&mut self, database: &Database, tick: &mut Ticks) {
        self.steps.push((database.depth(), *tick));
        *tick += 1;
    }

    pub(super) fn undone(&mut self, database: &Database, tick: &mut Ticks) {
        let depth = database.depth();
        while let Some((_, left)) = self.steps.pop_if(|at| at.0 > depth) {
            *tick = left;
        }
        self.decided.retain(|at| at.0 <= depth);
    }

    /// An output of a token that may end now, and is guessed: not in this cycle, where what is heard
    /// is known.
    pub(super) fn unbound(&self, database: &Database, tick: Ticks) -> Option<Flaw> {
        if !self.guess || tick == self.base {
            return None;
        }
        (0..database.lanes()).find_map(|timeline| {
            let token = database.last(timeline)?;
            let finish = database.finish(token);
            let at = database.token(token)?;
            let open = |&parameter: &usize| {
                database.value(at.parameters[parameter]).is_none()
                    && !self.values[at.predicate][parameter].is_empty()
            };
            let mut parameters = 0..at.parameters.len();
            let parameter = parameters.find(open)?;
            (finish.min <= tick && finish.max > tick).then_some(Flaw::Unbound { token, parameter })
        })
    }

    pub(super) fn guesses(
        &self,
        database: &Database,
        token: TokenId,
        parameter: usize,
        into: &mut Vec<Decision>,
    ) {
        if let Some(at) = database.token(token) {
            let values = self.values[at.predicate][parameter].iter();
            into.extend(values.map(|&value| Decision::Bind(value)));
        }
    }

    /// An output is guessed; with the last one the token ends.
    pub(super) fn guess(
        &self,
        database: &mut Database,
        (token, parameter): (TokenId, usize),
        value: Value,
        tick: Ticks,
    ) -> Result<(), Conflict> {
        database.attempt(|database| {
            database.learn(token, parameter, &[value])?;
            let Some(at) = database.token(token) else {
                return Ok(());
            };
            let open = (0..at.parameters.len()).any(|place| {
                database.value(at.parameters[place]).is_none()
                    && !self.values[at.predicate][place].is_empty()
            });
            if open {
                return Ok(());
            }
            database.end(token, tick.max(database.finish(token).min))
        })
    }
}

/// By parameter of a predicate: the values that it is guessed to have: those that rules name, in
/// their order, then others; none of what an input is, a measured number, or what follows from
/// others.
fn guesses_of(model: &Model, predicate: usize) -> Vec<Vec<Value>> {
    let said = &model.predicates[predicate];
    let parameters = 0..said.parameters.len();
    parameters
        .map(|place| guesses_at(model, predicate, place))
        .collect()
}

fn guesses_at(model: &Model, predicate: usize, place: usize) -> Vec<Value> {
    let said = &model.predicates[predicate];
    let all: Vec<Value> = match &model.types[said.parameters[place].of].values {
        _ if place < said.inputs => return Vec::new(),
        Values::Truth => vec![1, 0],
        Values::Symbols(all) => all.clone(),
        Values::Numbers(_) => return Vec::new(),
    };
    let rules = { model.rules.iter() }.filter(|at| at.master.predicate == predicate);
    let follows = rules.clone().any(|rule| {
        rule.relationships.iter().any(|at| {
            let gives = matches!(at.kind, RelationshipKind::Function(_));
            match (at.operands.last(), rule.master.arguments[place]) {
                (Some(&Operand::Variable(one)), Argument::Variable(other)) => gives && one == other,
                _ => false,
            }
        })
    });
    if follows {
        return Vec::new();
    }
    let missing = |value: Value| {
        said.timed_out.contains(&(place, value)) || said.preempted.contains(&(place, value))
    };
    let named = rules.filter_map(|rule| match rule.master.arguments[place] {
        Argument::Value(value) => Some(value),
        _ => None,
    });
    let mut guesses = Vec::new();
    for value in named.chain(all) {
        if !missing(value) && !guesses.contains(&value) {
            guesses.push(value);
        }
    }
    guesses
}
