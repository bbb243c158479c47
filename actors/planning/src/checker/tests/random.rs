//! Random small models, problems and plans: the checker says what a brute force over all ways to
//! choose alternatives, tokens, values and effects says.

mod brute;

use super::*;
use crate::model::{Distance, Function, Operand, RelationshipKind};
use brute::{guard, is_valid, predicate_of, timeline_of, values_of, worth};

/// Numbers that look random: splitmix64.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = self.0;
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((x ^ (x >> 31)) % limit as u64) as usize
    }

    fn value(&mut self) -> i64 {
        self.below(3) as i64
    }

    fn once_in(&mut self, times: usize) -> bool {
        self.below(times) == 0
    }
}

const HORIZON: Ticks = 6;
const SMALL: usize = 2;
const VARIABLES: usize = 2;

fn model(random: &mut Random) -> Model {
    let timeline = |name: &str, object, kind| Timeline {
        name: name.to_owned(),
        object,
        kind,
        predicates: vec![0, 1],
        default: None,
        initial: None,
    };
    let ty = |name: &str, values| Type {
        name: name.to_owned(),
        values,
    };
    let capacity = |kind, initial| Resource {
        limits: Span::new(0, initial),
        ..resource("r", kind, initial, 1)
    };
    let mut model = Model {
        types: vec![
            ty("Truth", Values::Truth),
            ty("Number", Values::Numbers(Span::ALL)),
            ty("Small", Values::Numbers(Span::new(0, 2))),
        ],
        predicates: vec![of("P", &[("x", SMALL)]), of("Q", &[("y", SMALL)])],
        timelines: vec![
            timeline("state", 0, TimelineKind::State),
            timeline("unary", 1, TimelineKind::Unary),
            timeline("free", 2, TimelineKind::Free),
        ],
        resources: vec![
            capacity(ResourceKind::Renewable, 3),
            capacity(ResourceKind::Depletable, 3),
            capacity(ResourceKind::RateLimited { window_ticks: 2 }, 2),
        ],
        tables: vec![Table {
            name: "pairs".into(),
            columns: 2,
            rows: vec![0, 1, 0, 2, 1, 1, 2, 0],
        }],
        functions: vec![Function {
            name: "next".into(),
            arguments: 2,
            call: |inputs| (inputs[0] < 2).then(|| inputs[0] + 1),
        }],
        ..Model::default()
    };
    for (id, resource) in model.resources.iter_mut().enumerate() {
        resource.name = format!("r{id}");
    }
    for id in 0..random.below(4) {
        let rule = a_rule(random, line(100 + id as u32));
        model.rules.push(rule);
    }
    model
}

fn argument(random: &mut Random) -> Argument {
    match random.below(5) {
        0 => Argument::Any,
        1 => Argument::Value(random.value()),
        _ => Argument::Variable(random.below(VARIABLES)),
    }
}

fn a_pattern(random: &mut Random) -> Pattern {
    let first = random.below(3);
    let mut timelines = vec![first];
    if random.once_in(3) {
        timelines.push((first + 1) % 3);
    }
    Pattern {
        timelines,
        object: random.once_in(6).then(|| random.below(VARIABLES)),
        ..pattern(0, random.below(2), &[argument(random)])
    }
}

fn bound(random: &mut Random, value: i64) -> Bound {
    match random.below(6) {
        0 => Bound::None,
        1 | 2 => Bound::Variable(random.below(VARIABLES)),
        _ => Bound::Value(value),
    }
}

fn a_body(random: &mut Random, depth: usize, labels: &mut usize) -> Body {
    let many = |random: &mut Random, labels: &mut usize| {
        let count = random.below(3);
        (0..count)
            .map(|_| a_body(random, depth - 1, labels))
            .collect()
    };
    match random.below(5) {
        0 | 1 if depth > 0 => Body::All(many(random, labels)),
        2 if depth > 0 => Body::Any(many(random, labels), line(0)),
        _ if *labels > 2 => Body::All(Vec::new()),
        _ => {
            use RelationKind as R;
            let kinds = [
                R::Meets,
                R::MetBy,
                R::Before,
                R::After,
                R::Starts,
                R::Ends,
                R::Equals,
                R::Contains,
                R::ContainedBy,
                R::StartsDuring,
                R::StartsBefore,
                R::EndsDuring,
                R::EndsAfter,
            ];
            let kind = kinds[random.below(kinds.len())];
            let given: Vec<[Bound; 2]> = (0..random.below(3))
                .map(|_| [bound(random, 0), bound(random, 2)])
                .collect();
            let anchor = random.below(*labels);
            let target = match random.once_in(5) {
                true => Target::Label(random.below(*labels)),
                false => {
                    *labels += 1;
                    Target::New(a_pattern(random), *labels - 1)
                }
            };
            Body::Relation(Box::new(Relation {
                position: line(0),
                kind,
                anchor,
                target,
                distances: kind.distances(&given),
                condition: false,
            }))
        }
    }
}

fn a_relationship(random: &mut Random, labels: usize, in_guard: bool) -> Relationship {
    use RelationshipKind as K;
    let kinds = [
        (K::Equal, 2),
        (K::Different, 2),
        (K::Less, 2),
        (K::AtMost, 2),
        (K::Sum, 3),
        (K::Product, 3),
        (K::Table(0), 2),
        (K::Function(0), 2),
    ];
    // What a guard computes is tried apart: these compute nothing.
    let (first, count) = if in_guard { (1, 3) } else { (0, kinds.len()) };
    let (kind, operands) = kinds[first + random.below(count)];
    let operand = |random: &mut Random| match random.below(8) {
        0 => Operand::Value(random.value()),
        1 => Operand::Start(random.below(labels)),
        2 => Operand::Finish(random.below(labels)),
        3 => Operand::Duration(random.below(labels)),
        _ => Operand::Variable(random.below(VARIABLES)),
    };
    Relationship {
        position: line(0),
        kind,
        operands: (0..operands).map(|_| operand(random)).collect(),
    }
}

fn a_rule(random: &mut Random, at: Position) -> Rule {
    let mut labels = 1;
    let body = match random.once_in(3) {
        true => Body::All(Vec::new()),
        false => a_body(random, 2, &mut labels),
    };
    let kinds = [
        EffectKind::Uses,
        EffectKind::Uses,
        EffectKind::Consumes(End::Start),
        EffectKind::Consumes(End::Finish),
        EffectKind::Produces(End::Start),
        EffectKind::Produces(End::Finish),
    ];
    let effects = (0..random.below(6) / 3).map(|_| Effect {
        position: at,
        resources: match random.below(4) {
            3 => vec![0, 1],
            one => vec![one],
        },
        kind: kinds[random.below(kinds.len())],
        amount: match random.below(3) {
            0 => Bound::Variable(random.below(VARIABLES)),
            _ => Bound::Value(random.value()),
        },
    });
    let effects = effects.collect();
    let variable = |name: &str| Variable {
        name: name.to_owned(),
        of: SMALL,
    };
    Rule {
        position: at,
        master: a_pattern(random),
        variables: vec![variable("?x"), variable("?y")],
        when: match random.once_in(4) {
            true => vec![a_relationship(random, 1, true)],
            false => Vec::new(),
        },
        duration: random
            .once_in(3)
            .then(|| [bound(random, 1), bound(random, 4)]),
        relationships: (0..random.below(5) / 2)
            .map(|_| a_relationship(random, labels, false))
            .collect(),
        effects,
        body,
        labels,
    }
}

fn a_plan(random: &mut Random, model: &Model) -> (Problem, Plan) {
    let mut spans = Vec::new();
    let (a, b) = (random.below(7) as Ticks, random.below(7) as Ticks);
    let cuts = [0, a.min(b), a.max(b), HORIZON];
    spans.extend(cuts.windows(2).map(|pair| (0, [pair[0], pair[1]])));
    spans.retain(|(_, [start, end])| start < end);
    for timeline in [1, 2] {
        let mut from = 0;
        for _ in 0..random.below(3) {
            let start = from + random.below(3) as Ticks;
            let end = start + random.below(4) as Ticks;
            if end <= HORIZON {
                spans.push((timeline, [start, end]));
                from = if timeline == 1 { end } else { 0 };
            }
        }
    }
    let problem = Problem {
        horizon: HORIZON,
        ..Problem::default()
    };
    let mut plan = Plan::new(model, &problem);
    for (id, (timeline, times)) in spans.into_iter().enumerate() {
        let value = (!random.once_in(8)).then(|| random.value());
        let on = (timeline, random.below(2));
        let mut token = PlanToken::new(model, id as u32, on, &[value], times);
        let rules = model
            .rules
            .iter()
            .filter(|rule| guard(model, rule, &token).is_some());
        let effects = rules.flat_map(|rule| &rule.effects).map(|effect| {
            let amount = match effect.amount {
                Bound::Value(amount) => amount,
                _ => random.value(),
            };
            (
                effect,
                effect.resources[random.below(effect.resources.len())],
                amount,
            )
        });
        let effects: Vec<_> = effects.collect();
        token = token.with_effects(model, &effects);
        plan.tokens.push(token);
    }
    let problem = wanted(random, problem, &mut plan);
    (problem, plan)
}

/// Facts, goals and orders, most of which the plan keeps.
fn wanted(random: &mut Random, mut problem: Problem, plan: &mut Plan) -> Problem {
    for id in 0..random.below(3) {
        let token = &plan.tokens[random.below(plan.tokens.len())];
        problem.facts.push(Fact {
            position: line(0),
            timeline: timeline_of(token),
            predicate: predicate_of(token),
            values: vec![values_of(token).filter(|_| id == 0)],
            start: Span::at_most(token.start + random.below(2) as Ticks),
            finish: Span::at_least(token.end),
        });
    }
    for id in 0..random.below(3) {
        let token = &plan.tokens[random.below(plan.tokens.len())];
        let (start, end, number) = (token.start, token.end, token.id);
        let argument = match (random.below(3), values_of(token)) {
            (0, Some(value)) => Argument::Value(value),
            (1, _) => Argument::Any,
            _ => Argument::Variable(0),
        };
        let weight = random.once_in(2).then(|| random.value() as f64);
        let target = pattern(timeline_of(token), predicate_of(token), &[argument]);
        problem.goals.push(Goal {
            variables: vec![Variable {
                name: "?g".into(),
                of: SMALL,
            }],
            duration: Span::at_least(end - start),
            finish: Span::at_most(end + 1),
            ..goal(&format!("g{id}"), target, Span::at_least(start - 1), weight)
        });
        if weight.is_some() && random.once_in(3) {
            plan.left_out.push(LeftOut {
                goal: format!("g{id}"),
                reason: String::new(),
            });
        } else {
            plan.achieved.push(Achieved {
                goal: format!("g{id}"),
                token: number,
            });
        }
    }
    if problem.goals.len() == 2 {
        let distance = Distance {
            from: End::Start,
            to: End::Finish,
            min: Bound::Value(random.value() - 1),
            max: Bound::None,
            backward: random.once_in(2),
        };
        problem.orders.push(Order {
            position: line(0),
            from: 0,
            to: 1,
            distances: vec![distance],
        });
        problem.combinations.push(Combination {
            name: "both".into(),
            position: line(0),
            goals: vec![0, 1],
            weight: -1.0,
        });
    }
    plan.score = worth(&problem, plan);
    plan.makespan = plan.latest_end();
    problem
}

/// Changes one field of a plan.
fn mutate(random: &mut Random, plan: &mut Plan) {
    if plan.tokens.is_empty() {
        return;
    }
    let index = random.below(plan.tokens.len());
    let token = &mut plan.tokens[index];
    let by = [-1, 1][random.below(2)];
    match random.below(12) {
        0 => token.start += by,
        1 => token.end += by,
        2 => token.start_window[1] = token.start + by,
        3 => token.end_window[0] = token.end + by,
        4 => token.arguments[0].1 = PlanValue::Number(random.value()),
        5 => token.arguments[0].1 = PlanValue::Unbound,
        6 => {
            let old = std::mem::replace(&mut token.predicate, "P".into());
            token.arguments[0].0 = "x".into();
            if old == "P" {
                token.predicate = "Q".into();
                token.arguments[0].0 = "y".into();
            }
        }
        7 => token.timeline = ["state", "unary", "free"][random.below(3)].into(),
        8 => match token.effects.first_mut() {
            Some(effect) => effect.amount += by,
            None => plan.score += 1.0,
        },
        9 => match token.effects.first_mut() {
            Some(effect) => effect.resource = format!("r{}", random.below(3)),
            None => plan.makespan += 1,
        },
        10 => match plan.achieved.first_mut() {
            Some(achieved) => achieved.token = token.id,
            None => drop(plan.tokens.remove(index)),
        },
        _ => {
            // The windows move along: the time alone would be outside them.
            let [start, end] = [token.start + by, token.end + by];
            shift(plan, index, [start, end]);
        }
    }
}

#[test]
fn the_checker_says_what_a_brute_force_says() {
    let (mut valid, mut invalid, mut spoiled) = (0, 0, 0);
    for seed in 0..30_000 {
        let mut random = Random(seed);
        let model = model(&mut random);
        let (problem, mut plan) = a_plan(&mut random, &model);
        let mut was_valid = None;
        for _ in 0..3 {
            let expected = is_valid(&model, &problem, &plan);
            let violations = check(&model, &problem, &plan);
            assert_eq!(
                violations.is_empty(),
                expected,
                "seed {seed}: {violations:#?}\n{}\n{:#?}\n{problem:#?}",
                plan.to_json(),
                model.rules
            );
            *(if expected { &mut valid } else { &mut invalid }) += 1;
            spoiled += usize::from(was_valid == Some(true) && !expected);
            was_valid = Some(expected);
            mutate(&mut random, &mut plan);
        }
    }
    // It is no comparison if nearly all plans are of one kind.
    assert!(
        valid > 15_000 && invalid > 15_000 && spoiled > 5_000,
        "{valid} {invalid} {spoiled}"
    );
}
