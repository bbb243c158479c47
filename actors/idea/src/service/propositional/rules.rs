//! Rules as the propositional technology holds them: flat, and without numbers that tie tokens
//! together.

use farside_planning::Ticks;
use farside_planning::model::{
    Argument, Body, Bound, Model, Operand, Position, Relation, RelationshipKind, Rule, RuleId,
    Target, Value, Values, VariableId,
};
use thiserror::Error;

/// A part of a rule's body, by its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(in crate::service) enum Part {
    Relation(u16),
    Choice(u16),
}

/// A rule's body without nesting.
#[derive(Clone, Debug, Default)]
pub(in crate::service) struct Flat {
    pub(in crate::service) relations: Vec<Relation>,
    /// By choice: by alternative: its parts.
    pub(in crate::service) choices: Vec<Vec<Vec<Part>>>,
    pub(in crate::service) top: Vec<Part>,
    /// The variables among the master's arguments, each with the first place that it has.
    pub(in crate::service) named: Vec<(VariableId, usize)>,
    /// Least and most ticks that the master lasts.
    pub(in crate::service) duration: Option<[Ticks; 2]>,
}

/// Why the propositional technology does not hold a model.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum Numeric {
    /// A rule whose numbers tie tokens, times or parameters together.
    #[error("{rule}: {what}: only the temporal technology holds this")]
    Coupled {
        /// Where the rule stands, and its master.
        rule: String,
        /// What couples, and where.
        what: String,
    },
}

impl Flat {
    /// # Errors
    ///
    /// If a number of the rule couples what it speaks of.
    pub(in crate::service) fn of(model: &Model, rule: RuleId) -> Result<Flat, Numeric> {
        let said = &model.rules[rule];
        let coupled = |at: Position, what: &str| Numeric::Coupled {
            rule: super::super::words::rule(model, rule),
            what: format!("{what} at {}", model.place(at)),
        };
        let mut flat = Flat::default();
        flat.top = flat.parts(&said.body);
        if let Some([min, max]) = said.duration {
            let bounds = (constant(min, Ticks::MIN), constant(max, Ticks::MAX));
            let (Some(min), Some(max)) = bounds else {
                return Err(coupled(said.position, "a variable duration"));
            };
            flat.duration = Some([min, max]);
        }
        if let Some(effect) = said.effects.first() {
            return Err(coupled(effect.position, "an effect on a resource"));
        }
        for relation in &flat.relations {
            let variable = |bound: Bound| matches!(bound, Bound::Variable(_));
            let mut distances = relation.distances.iter();
            if distances.any(|at| variable(at.min) || variable(at.max)) {
                return Err(coupled(relation.position, "a variable distance"));
            }
        }
        for said in said.relationships.iter().chain(&said.when) {
            let is_time =
                |operand: &Operand| !matches!(operand, Operand::Value(_) | Operand::Variable(_));
            if said.operands.iter().any(is_time) {
                return Err(coupled(said.position, "a time among values"));
            }
        }
        let named = |operand: Option<&Operand>| match operand {
            Some(Operand::Variable(variable)) => {
                let is = Argument::Variable(*variable);
                said.master.arguments.contains(&is)
            }
            _ => true,
        };
        for said in &said.relationships {
            // What only gives a number is reckoned once the others are known.
            let what = match said.kind {
                RelationshipKind::Sum if named(said.operands.last()) => "a sum",
                RelationshipKind::Product if named(said.operands.last()) => "a product",
                RelationshipKind::Less | RelationshipKind::AtMost => "an order of numbers",
                _ => continue,
            };
            return Err(coupled(said.position, what));
        }
        flat.name(said);
        Ok(flat)
    }

    fn name(&mut self, rule: &Rule) {
        for (place, argument) in rule.master.arguments.iter().enumerate() {
            if let Argument::Variable(variable) = *argument
                && self.named.iter().all(|named| named.0 != variable)
            {
                self.named.push((variable, place));
            }
        }
    }

    fn parts(&mut self, body: &Body) -> Vec<Part> {
        match body {
            Body::All(parts) => parts.iter().flat_map(|part| self.parts(part)).collect(),
            Body::Any(alternatives, _) => {
                let place = self.choices.len();
                self.choices.push(Vec::new());
                let alternatives = alternatives.iter().map(|part| self.parts(part)).collect();
                self.choices[place] = alternatives;
                vec![Part::Choice(place as u16)]
            }
            Body::Relation(relation) => {
                self.relations.push((**relation).clone());
                vec![Part::Relation(self.relations.len() as u16 - 1)]
            }
        }
    }
}

/// A bound that is a number, or none.
pub(in crate::service) fn constant(bound: Bound, none: Ticks) -> Option<Ticks> {
    match bound {
        Bound::None => Some(none),
        Bound::Value(value) => Some(value),
        Bound::Variable(_) => None,
    }
}

/// How early a subgoal of a relation comes, as the model's search control says.
pub(in crate::service) fn early(model: &Model, relation: &Relation) -> u32 {
    let Target::New(pattern, _) = &relation.target else {
        return 0;
    };
    let subgoals = &model.control.subgoals;
    let timeline = pattern.timelines.first();
    let named = timeline.and_then(|&timeline| {
        let wanted = (timeline, pattern.predicate);
        subgoals.iter().position(|&at| at == wanted)
    });
    named.unwrap_or(subgoals.len() + 1) as u32
}

/// Whether a value is one of a type.
pub(in crate::service) fn is_of(model: &Model, of: usize, value: Value) -> bool {
    match &model.types[of].values {
        Values::Truth => value == 0 || value == 1,
        Values::Numbers(span) => span.contains(value),
        Values::Symbols(all) => all.binary_search(&value).is_ok(),
    }
}
