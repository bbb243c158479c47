//! Small random models.

use rand_core::Rng as _;
use rand_pcg::Pcg32;

use crate::model::*;
use crate::temporal::Span;

/// Numbers below a limit, the same for a seed.
pub(super) struct Dice(Pcg32);

impl Dice {
    pub(super) fn new(seed: u64) -> Self {
        Dice(Pcg32::new(seed, 7))
    }

    /// Below `limit`, or 0.
    pub(super) fn below(&mut self, limit: usize) -> usize {
        match limit {
            0 => 0,
            limit => self.0.next_u32() as usize % limit,
        }
    }

    pub(super) fn one_in(&mut self, limit: usize) -> bool {
        self.below(limit) == 0
    }

    /// One of a list, if it is not empty.
    pub(super) fn pick<T: Copy>(&mut self, of: &[T]) -> Option<T> {
        of.get(self.below(of.len())).copied()
    }
}

const SMALL: TypeId = 2;

/// Three timelines, one of each kind, three predicates, two resources and some rules.
pub(super) fn random(dice: &mut Dice) -> Model {
    let types = [
        ("Truth", Values::Truth),
        ("Number", Values::Numbers(Span::new(-1_000, 1_000))),
        ("Small", Values::Numbers(Span::new(0, 4))),
    ];
    let parameter = |name: &str| Parameter {
        name: name.to_owned(),
        of: SMALL,
    };
    let predicate = |name: &str, parameters: Vec<Parameter>| Predicate {
        name: name.to_owned(),
        inputs: parameters.len(),
        parameters,
        ..Predicate::default()
    };
    let timeline = |name: &str, kind| Timeline {
        name: name.to_owned(),
        object: 0,
        kind,
        predicates: vec![0, 1, 2],
        default: None,
        initial: None,
    };
    let resource = |name: &str, kind| Resource {
        name: name.to_owned(),
        object: 0,
        kind,
        initial: 10,
        limits: Span::new(0, 10),
        changes: Vec::new(),
        position: Position::default(),
    };
    let mut model = Model {
        symbols: vec!["it".to_owned()],
        types: types
            .into_iter()
            .map(|(name, values)| Type {
                name: name.to_owned(),
                values,
            })
            .collect(),
        predicates: vec![
            predicate("None", Vec::new()),
            predicate("One", vec![parameter("a")]),
            predicate("Two", vec![parameter("a"), parameter("b")]),
        ],
        timelines: vec![
            timeline("state", TimelineKind::State),
            timeline("unary", TimelineKind::Unary),
            timeline("free", TimelineKind::Free),
        ],
        resources: vec![
            resource("power", ResourceKind::Renewable),
            resource("spare", ResourceKind::Renewable),
            resource("energy", ResourceKind::Depletable),
        ],
        rules_by_timeline: vec![vec![Vec::new(); 3]; 3],
        ..Model::default()
    };
    for rule in 0..2 + dice.below(5) {
        let (timeline, predicate) = (dice.below(3), dice.below(3));
        model.rules_by_timeline[timeline][predicate].push(rule);
        let one = random_rule(dice, timeline, predicate);
        model.rules.push(one);
    }
    model
}

const VARIABLES: usize = 3;

fn random_rule(dice: &mut Dice, timeline: TimelineId, predicate: PredicateId) -> Rule {
    let mut labels = 1;
    let master = pattern(dice, timeline, predicate, 6);
    let body = body(dice, &mut labels, 2);
    let variable = |name: &str| Variable {
        name: name.to_owned(),
        of: SMALL,
    };
    let duration = match dice.below(4) {
        0 => Some([Bound::Value(1), Bound::Value(6)]),
        1 => Some([Bound::Variable(0), Bound::Value(9)]),
        _ => None,
    };
    let mut relationships = Vec::new();
    for _ in 0..dice.below(3) {
        relationships.push(relationship(dice, true));
    }
    // A guard speaks of what the master's arguments say.
    let when = match dice.below(4) {
        0 => vec![relationship(dice, false)],
        _ => Vec::new(),
    };
    let effects = match dice.below(3) {
        0 => vec![Effect {
            position: Position::default(),
            resources: vec![0, 1],
            kind: EffectKind::Uses,
            amount: [Bound::Value(3), Bound::Variable(1)][dice.below(2)],
        }],
        1 => vec![Effect {
            position: Position::default(),
            resources: vec![2],
            kind: [
                EffectKind::Consumes(End::Start),
                EffectKind::Produces(End::Finish),
            ][dice.below(2)],
            amount: Bound::Value(2),
        }],
        _ => Vec::new(),
    };
    Rule {
        position: Position::default(),
        master,
        variables: ["?a", "?b", "?c"].map(variable).to_vec(),
        when,
        duration,
        relationships,
        effects,
        body,
        labels,
    }
}

fn pattern(dice: &mut Dice, timeline: TimelineId, predicate: PredicateId, any: usize) -> Pattern {
    let argument = |dice: &mut Dice| match dice.below(any) {
        0 => Argument::Value(dice.below(5) as Value),
        1 => Argument::Any,
        _ => Argument::Variable(dice.below(VARIABLES)),
    };
    let mut arguments = Vec::new();
    for _ in 0..predicate {
        arguments.push(argument(dice));
    }
    Pattern {
        position: Position::default(),
        timelines: vec![timeline],
        object: None,
        predicate,
        arguments,
    }
}

fn relationship(dice: &mut Dice, times: bool) -> Relationship {
    let variable = |dice: &mut Dice| Operand::Variable(dice.below(VARIABLES));
    let kind = [
        RelationshipKind::AtMost,
        RelationshipKind::Different,
        RelationshipKind::Less,
        RelationshipKind::Sum,
    ][dice.below(if times { 4 } else { 3 })];
    let mut operands = vec![variable(dice), variable(dice)];
    match kind {
        RelationshipKind::Sum => operands.push(Operand::Duration(0)),
        _ if dice.one_in(3) => operands[1] = Operand::Value(dice.below(5) as Value),
        _ if dice.one_in(6) => operands[1] = Operand::Start(0),
        _ => {}
    }
    Relationship {
        position: Position::default(),
        kind,
        operands,
    }
}

fn body(dice: &mut Dice, labels: &mut usize, depth: usize) -> Body {
    let parts = |dice: &mut Dice, labels: &mut usize, count: usize| {
        let mut parts = Vec::new();
        for _ in 0..count {
            parts.push(body(dice, labels, depth - 1));
        }
        parts
    };
    match dice.below(if depth > 0 { 4 } else { 1 }) {
        1 => Body::All(parts(dice, labels, 2)),
        2 => Body::Any(parts(dice, labels, 2), Position::default()),
        _ => Body::Relation(Box::new(relation(dice, labels))),
    }
}

fn relation(dice: &mut Dice, labels: &mut usize) -> Relation {
    let kind = [
        RelationKind::Meets,
        RelationKind::Before,
        RelationKind::ContainedBy,
        RelationKind::Starts,
        RelationKind::Equals,
        RelationKind::EndsDuring,
    ][dice.below(6)];
    let bounds = match dice.below(4) {
        0 => vec![[Bound::Value(0), Bound::Value(8)]; 2],
        1 => vec![[Bound::Variable(2), Bound::None]; 2],
        _ => Vec::new(),
    };
    let anchor = if dice.one_in(3) {
        dice.below(*labels)
    } else {
        0
    };
    let label = *labels;
    *labels += 1;
    let (timeline, predicate) = (dice.below(3), dice.below(3));
    Relation {
        position: Position::default(),
        kind,
        anchor,
        target: Target::New(pattern(dice, timeline, predicate, 6), label),
        distances: kind.distances(&bounds),
        condition: false,
    }
}
