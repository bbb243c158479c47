//! Why a rule does not hold, in sentences.

use super::super::{Kind, Report, Scene, Seen};
use super::Spot;
use super::settle::does;
use crate::model::{
    Argument, Effect, Operand, Pattern, Position, Relation, RelationKind, Relationship,
    RelationshipKind, Rule, Target, Value,
};
use crate::plan::{TokenId, place};

/// Why a rule does not hold.
pub(super) struct Failure<'a> {
    /// How much had been found.
    pub(super) depth: usize,
    pub(super) why: Why<'a>,
    /// By label.
    pub(super) labels: Vec<Spot>,
    /// By variable.
    pub(super) values: Vec<Option<Value>>,
}

#[derive(Clone, Copy)]
pub(super) enum Why<'a> {
    /// No token fits.
    NoTarget(&'a Relation),
    /// A token that is given does not fit.
    Apart(&'a Relation),
    /// Values do not.
    Values(&'a Relationship),
    /// A value that something here asks for is not known, or not of its type.
    Unknown(Position),
    /// The master lasts shorter or longer than this.
    Lasts(Option<Value>, Option<Value>),
    /// An effect is not listed, or otherwise.
    Effect(&'a Effect),
}

impl Failure<'_> {
    pub(super) fn tell(
        &self,
        scene: &Scene<'_>,
        rule: &Rule,
        master: &Seen<'_>,
        report: &mut Report,
    ) {
        let token = master.token;
        let (kind, position, message) = match self.why {
            Why::NoTarget(relation) => {
                let (kind, wanted) = (name(relation.kind), self.wanted(scene, rule, relation));
                let anchor = self.token(scene, relation.anchor).unwrap_or(master).token;
                let message = format!("there is no {wanted} for token {anchor}: {kind}");
                (Kind::Relation, relation.position, message)
            }
            Why::Apart(relation) => {
                let kind = name(relation.kind);
                let message = format!("token {token}: what it names is not there in time: {kind}");
                (Kind::Relation, relation.position, message)
            }
            Why::Values(of) => {
                let message = format!(
                    "token {token}: it does not hold that {}",
                    self.says(scene, rule, of)
                );
                (Kind::Relationship, of.position, message)
            }
            Why::Unknown(position) => {
                let message = format!("token {token}: a value that the rule needs is not known");
                (Kind::Undecided, position, message)
            }
            Why::Lasts(min, max) => {
                let lasts = token.end - token.start;
                let bound = match (min, max) {
                    (Some(min), _) if lasts < min => format!("at least {min}"),
                    (_, max) => format!("at most {}", max.unwrap_or(Value::MAX)),
                };
                let message = format!("token {token} lasts {lasts} ticks, and must last {bound}");
                (Kind::Duration, rule.position, message)
            }
            Why::Effect(effect) => (
                Kind::Effect,
                effect.position,
                self.unlisted(scene, master, effect),
            ),
        };
        let others = self.labels.iter().filter_map(|spot| match spot {
            Spot::Token(index) => Some(scene.tokens[*index].token.id),
            Spot::Nowhere | Spot::Outside => None,
        });
        let mut tokens: Vec<TokenId> = others.collect();
        tokens.dedup();
        let place = scene.place(position);
        report.add(kind, message).tokens(tokens).at(place);
    }

    /// The token of a label.
    fn token<'s>(&self, scene: &'s Scene<'s>, label: usize) -> Option<&'s Seen<'s>> {
        match self.labels.get(label) {
            Some(&Spot::Token(index)) => scene.tokens.get(index),
            _ => None,
        }
    }

    /// What a relation asks for, as `At(rock) on k9.Location`.
    fn wanted(&self, scene: &Scene<'_>, rule: &Rule, relation: &Relation) -> String {
        let Target::New(pattern, _) = &relation.target else {
            return "such token".to_owned();
        };
        let Pattern {
            predicate,
            arguments,
            timelines,
            ..
        } = pattern;
        let model = scene.model;
        let predicate = &model.predicates[*predicate];
        let parameters = predicate.parameters.iter().zip(arguments);
        let values = parameters.map(|(parameter, argument)| match *argument {
            Argument::Any => "_".to_owned(),
            Argument::Value(value) => model.show(parameter.of, value),
            Argument::Variable(variable) => match self.values[variable] {
                Some(value) => model.show(parameter.of, value),
                None => rule.variables[variable].name.clone(),
            },
        });
        let values: Vec<String> = values.collect();
        let on: Vec<&str> = timelines
            .iter()
            .take(5)
            .map(|&timeline| model.timelines[timeline].name.as_str())
            .collect();
        format!(
            "{}({}) on {}",
            predicate.name,
            values.join(", "),
            on.join(" or ")
        )
    }

    /// A relationship with what is known of its operands, as `?a = 3 < 2`.
    fn says(&self, scene: &Scene<'_>, rule: &Rule, of: &Relationship) -> String {
        let model = scene.model;
        let operands = of.operands.iter().map(|operand| {
            let end = |label: usize, what: &str| match self.token(scene, label) {
                Some(seen) => format!("the {what} of token {}", seen.token.id),
                None => format!("the {what} of a token"),
            };
            match *operand {
                Operand::Value(value) => value.to_string(),
                Operand::Variable(variable) => {
                    let of = &rule.variables[variable];
                    match self.values[variable] {
                        Some(value) => format!("{} = {}", of.name, model.show(of.of, value)),
                        None => of.name.clone(),
                    }
                }
                Operand::Start(label) => end(label, "start"),
                Operand::Finish(label) => end(label, "end"),
                Operand::Duration(label) => end(label, "duration"),
            }
        });
        let kind = match of.kind {
            RelationshipKind::Equal => "equal",
            RelationshipKind::Different => "different",
            RelationshipKind::Less => "less",
            RelationshipKind::AtMost => "at most",
            RelationshipKind::Sum => "sum",
            RelationshipKind::Product => "product",
            RelationshipKind::Table(table) => &model.tables[table].name,
            RelationshipKind::Function(function) => &model.functions[function].name,
        };
        let operands: Vec<String> = operands.collect();
        format!("{kind}({})", operands.join(", "))
    }

    /// How a listed effect differs from what it should be, or that there is none.
    fn unlisted(&self, scene: &Scene<'_>, master: &Seen<'_>, effect: &Effect) -> String {
        let token = master.token;
        let (at, does) = (place(scene.model, effect.position), does(effect));
        let names = effect.resources.iter().take(5);
        let names: Vec<&str> = names
            .map(|&id| scene.model.resources[id].name.as_str())
            .collect();
        let names = names.join(" or ");
        match token.effects.iter().find(|listed| listed.place == at) {
            None => format!("token {token} {does} {names}, and lists no such effect"),
            Some(listed) => format!(
                "token {token} {does} {names}, and the effect that it lists is another: {} of {}",
                listed.amount, listed.resource
            ),
        }
    }
}

/// A relation as the language has it.
fn name(kind: RelationKind) -> &'static str {
    match kind {
        RelationKind::Meets => "meets",
        RelationKind::MetBy => "met_by",
        RelationKind::Before => "before",
        RelationKind::After => "after",
        RelationKind::Starts => "starts",
        RelationKind::Ends => "ends",
        RelationKind::Equals => "equals",
        RelationKind::Contains => "contains",
        RelationKind::ContainedBy => "contained_by",
        RelationKind::StartsDuring => "starts_during",
        RelationKind::StartsBefore => "starts_before",
        RelationKind::EndsDuring => "ends_during",
        RelationKind::EndsAfter => "ends_after",
        RelationKind::Distance => "temporaldistance",
    }
}
