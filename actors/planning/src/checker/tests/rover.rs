//! A rover that drives and takes pictures, a day of it, and a plan for that day.

use super::*;

pub(super) fn line(line: u32) -> Position {
    Position {
        file: 0,
        line,
        column: 1,
    }
}

pub(super) fn pattern(
    timeline: TimelineId,
    predicate: PredicateId,
    arguments: &[Argument],
) -> Pattern {
    Pattern {
        position: line(0),
        timelines: vec![timeline],
        object: None,
        predicate,
        arguments: arguments.to_vec(),
    }
}

pub(super) fn relation(at: u32, kind: RelationKind, target: Pattern, label: usize) -> Body {
    Body::Relation(Box::new(Relation {
        position: line(at),
        kind,
        anchor: 0,
        target: Target::New(target, label),
        distances: kind.distances(&[]),
        condition: false,
    }))
}

pub(super) fn rule(at: u32, master: Pattern, variables: &[(&str, usize)], body: Vec<Body>) -> Rule {
    let variables = variables.iter().map(|&(name, of)| Variable {
        name: name.to_owned(),
        of,
    });
    Rule {
        position: line(at),
        master,
        variables: variables.collect(),
        when: Vec::new(),
        duration: None,
        relationships: Vec::new(),
        effects: Vec::new(),
        labels: body.len() + 1,
        body: Body::All(body),
    }
}

pub(super) const AT: usize = 0;
pub(super) const DRIVE: usize = 1;
pub(super) const TAKE: usize = 2;
pub(super) const LOCATION: usize = 0;
pub(super) const CAMERA: usize = 1;
pub(super) const ROCK: i64 = 0;
pub(super) const BASE: i64 = 1;
pub(super) const PLACE: usize = 2;

pub(super) fn of(name: &str, parameters: &[(&str, usize)]) -> Predicate {
    let parameters = parameters.iter().map(|&(name, of)| Parameter {
        name: name.to_owned(),
        of,
    });
    Predicate {
        name: name.to_owned(),
        inputs: parameters.len(),
        parameters: parameters.collect(),
        ..Predicate::default()
    }
}

pub(super) fn resource(name: &str, kind: ResourceKind, initial: i64, at: u32) -> Resource {
    Resource {
        name: name.to_owned(),
        object: 2,
        kind,
        initial,
        limits: Span::new(0, initial),
        changes: Vec::new(),
        position: line(at),
    }
}

/// A rover that drives and takes pictures.
pub(super) fn rover() -> Model {
    use Argument::Variable as V;
    let ty = |name: &str, values| Type {
        name: name.to_owned(),
        values,
    };
    let timeline = |name: &str, kind, predicates: &[usize]| Timeline {
        name: name.to_owned(),
        object: 2,
        kind,
        predicates: predicates.to_vec(),
        default: None,
        initial: None,
    };
    let mut take = rule(
        10,
        pattern(CAMERA, TAKE, &[V(0)]),
        &[("?place", PLACE)],
        vec![relation(
            11,
            RelationKind::ContainedBy,
            pattern(LOCATION, AT, &[V(0)]),
            1,
        )],
    );
    take.duration = Some([Bound::Value(2), Bound::Value(4)]);
    take.effects = vec![Effect {
        position: line(12),
        resources: vec![1],
        kind: EffectKind::Uses,
        amount: Bound::Value(3),
    }];
    let mut drive = rule(
        20,
        pattern(LOCATION, DRIVE, &[V(0), V(1)]),
        &[("?from", PLACE), ("?to", PLACE), ("?far", 1)],
        vec![
            relation(21, RelationKind::MetBy, pattern(LOCATION, AT, &[V(0)]), 1),
            relation(22, RelationKind::Meets, pattern(LOCATION, AT, &[V(1)]), 2),
        ],
    );
    drive.relationships = vec![Relationship {
        position: line(23),
        kind: RelationshipKind::Table(0),
        operands: (0..3).map(Operand::Variable).collect(),
    }];
    drive.duration = Some([Bound::Variable(2), Bound::Variable(2)]);
    drive.effects = vec![Effect {
        position: line(24),
        resources: vec![0],
        kind: EffectKind::Consumes(End::Finish),
        amount: Bound::Variable(2),
    }];
    Model {
        files: vec!["models/rover.ddl".into()],
        symbols: vec!["rock".into(), "base".into(), "k9".into()],
        types: vec![
            ty("Truth", Values::Truth),
            ty("Number", Values::Numbers(Span::ALL)),
            ty("Place", Values::Symbols(vec![ROCK, BASE])),
        ],
        predicates: vec![
            of("At", &[("place", PLACE)]),
            of("Drive", &[("from", PLACE), ("to", PLACE)]),
            of("Take", &[("place", PLACE)]),
        ],
        timelines: vec![
            timeline("k9.Location", TimelineKind::State, &[AT, DRIVE]),
            timeline("k9.Camera", TimelineKind::Unary, &[TAKE]),
        ],
        resources: vec![
            resource("battery", ResourceKind::Depletable, 5, 2),
            resource("power", ResourceKind::Renewable, 4, 3),
        ],
        tables: vec![Table {
            name: "distance".into(),
            columns: 3,
            rows: vec![ROCK, BASE, 3, BASE, ROCK, 3],
        }],
        rules: vec![take, drive],
        ..Model::default()
    }
}

pub(super) fn goal(name: &str, target: Pattern, start: Span, weight: Option<f64>) -> Goal {
    Goal {
        name: name.to_owned(),
        position: line(40),
        pattern: target,
        variables: Vec::new(),
        start,
        finish: Span::ALL,
        duration: Span::ALL,
        weight,
    }
}

pub(super) fn day() -> Problem {
    let take = |place| pattern(CAMERA, TAKE, &[Argument::Value(place)]);
    Problem {
        name: "day".into(),
        files: vec!["day.ddl".into()],
        horizon: 20,
        facts: vec![Fact {
            position: line(30),
            timeline: LOCATION,
            predicate: AT,
            values: vec![Some(BASE)],
            start: Span::exactly(0),
            finish: Span::ALL,
        }],
        goals: vec![
            goal("shot", take(ROCK), Span::new(9, 15), None),
            goal("again", take(ROCK), Span::ALL, Some(1.5)),
            goal("home", take(BASE), Span::ALL, Some(2.0)),
        ],
        combinations: vec![
            Combination {
                name: "both".into(),
                position: line(41),
                goals: vec![0, 1],
                weight: 0.25,
            },
            Combination {
                name: "all".into(),
                position: line(42),
                goals: vec![0, 1, 2],
                weight: 9.0,
            },
        ],
        orders: vec![Order {
            position: line(43),
            from: 0,
            to: 1,
            distances: RelationKind::Before.distances(&[]),
        }],
        ..Problem::default()
    }
}

pub(super) fn plan(model: &Model, problem: &Problem) -> Plan {
    let token = |id, on, values: &[i64], times| {
        let values: Vec<Option<i64>> = values.iter().copied().map(Some).collect();
        PlanToken::new(model, id, on, &values, times)
    };
    let uses = [(&model.rules[0].effects[0], 1, 3)];
    let consumes = [(&model.rules[1].effects[0], 0, 3)];
    let mut plan = Plan::new(model, problem);
    plan.tokens = vec![
        token(1, (LOCATION, AT), &[BASE], [0, 5]),
        token(2, (LOCATION, DRIVE), &[BASE, ROCK], [5, 8]).with_effects(model, &consumes),
        token(3, (LOCATION, AT), &[ROCK], [8, 20]),
        token(4, (CAMERA, TAKE), &[ROCK], [10, 12]).with_effects(model, &uses),
        token(5, (CAMERA, TAKE), &[ROCK], [14, 16]).with_effects(model, &uses),
    ];
    plan.tokens[1].origin = Origin::Rule {
        place: "rover.ddl:11:1".into(),
        master: 4,
    };
    let achieved = |goal: &str, token| Achieved {
        goal: goal.to_owned(),
        token,
    };
    plan.achieved = vec![achieved("shot", 4), achieved("again", 5)];
    plan.left_out = vec![LeftOut {
        goal: "home".into(),
        reason: "too far".into(),
    }];
    plan.score = 1.75;
    plan.makespan = 16;
    plan
}
