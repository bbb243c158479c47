//! Random small models, problems and plans: the checker says what a brute force over all ways to
//! choose alternatives, tokens, values and effects says.

use super::*;
use crate::model::{Distance, Function, Operand, RelationshipKind};

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

// The brute force. It knows nothing of the checker's tables but the model and the plan.

fn timeline_of(token: &PlanToken) -> usize {
    ["state", "unary", "free"]
        .iter()
        .position(|name| *name == token.timeline)
        .unwrap()
}

fn predicate_of(token: &PlanToken) -> usize {
    usize::from(token.predicate == "Q")
}

fn values_of(token: &PlanToken) -> Option<i64> {
    match token.arguments[0].1 {
        PlanValue::Number(number) => Some(number),
        _ => None,
    }
}

type Assignment = [i64; VARIABLES];

/// Whether a token is one of a pattern with these values.
fn matches(pattern: &Pattern, token: &PlanToken, values: Assignment) -> bool {
    let timeline = timeline_of(token);
    pattern.timelines.contains(&timeline)
        && pattern.predicate == predicate_of(token)
        && pattern
            .object
            .is_none_or(|variable| values[variable] == timeline as i64)
        && match (pattern.arguments[0], values_of(token)) {
            (Argument::Any, _) => true,
            (Argument::Value(wanted), value) => value == Some(wanted),
            (Argument::Variable(variable), value) => {
                value.is_none_or(|value| value == values[variable])
            }
        }
}

fn assignments() -> Vec<Assignment> {
    (0..9).map(|at| [at / 3, at % 3]).collect()
}

/// The assignments that a rule's master leaves; none if the rule does not hold.
fn guard(_: &Model, rule: &Rule, token: &PlanToken) -> Option<Vec<Assignment>> {
    let left: Vec<Assignment> = assignments()
        .into_iter()
        .filter(|&values| matches(&rule.master, token, values))
        .collect();
    // What differs between them is not known.
    let known = |variable: usize| {
        let mut all = left.iter().map(|values| values[variable]);
        let first = all.next()?;
        all.all(|value| value == first).then_some(first)
    };
    let certain = rule.when.iter().all(|of| {
        let operands = of.operands.iter().map(|operand| match *operand {
            Operand::Variable(variable) => known(variable),
            Operand::Value(value) => Some(value),
            Operand::Start(_) => Some(token.start),
            Operand::Finish(_) => Some(token.end),
            Operand::Duration(_) => Some(token.end - token.start),
        });
        let operands: Option<Vec<i64>> = operands.collect();
        operands.is_some_and(|operands| holds(of.kind, &operands))
    });
    (certain && !left.is_empty()).then_some(left)
}

fn holds(kind: RelationshipKind, values: &[i64]) -> bool {
    match kind {
        RelationshipKind::Equal => values[0] == values[1],
        RelationshipKind::Different => values[0] != values[1],
        RelationshipKind::Less => values[0] < values[1],
        RelationshipKind::AtMost => values[0] <= values[1],
        RelationshipKind::Sum => values[0] + values[1] == values[2],
        RelationshipKind::Product => values[0] * values[1] == values[2],
        RelationshipKind::Table(_) => [[0, 1], [0, 2], [1, 1], [2, 0]]
            .iter()
            .any(|row| row == values),
        RelationshipKind::Function(_) => values[0] >= 2 || values[1] == values[0] + 1,
    }
}

/// All ways to take one alternative of each choice.
fn ways(body: &Body) -> Vec<Vec<&Relation>> {
    match body {
        Body::Relation(relation) => vec![vec![relation]],
        Body::Any(bodies, _) => bodies.iter().flat_map(ways).collect(),
        Body::All(bodies) => bodies.iter().fold(vec![Vec::new()], |before, body| {
            let after = ways(body);
            let pairs = before.iter().flat_map(|first| {
                after
                    .iter()
                    .map(|second| [&first[..], &second[..]].concat())
            });
            pairs.collect()
        }),
    }
}

/// A label: a token, outside (none), or of an alternative that is not taken (not there).
type Labels = Vec<Option<Option<usize>>>;

fn span_of(distance: &Distance, values: Assignment) -> [i64; 2] {
    let value = |bound, none| match bound {
        Bound::None => none,
        Bound::Value(value) => value,
        Bound::Variable(variable) => values[variable],
    };
    [value(distance.min, -1_000), value(distance.max, 1_000)]
}

fn end_of(token: &PlanToken, end: End) -> i64 {
    match end {
        End::Start => token.start,
        End::Finish => token.end,
    }
}

/// Whether tokens can be labels such that all relations of a way, and what follows, hold.
fn found_from(
    relations: &[&Relation],
    labels: &mut Labels,
    plan: &Plan,
    values: Assignment,
    rest: &dyn Fn(&Labels) -> bool,
) -> bool {
    let Some((relation, others)) = relations.split_first() else {
        return rest(labels);
    };
    let Some(anchor) = labels[relation.anchor] else {
        return false;
    };
    let is_apart = |target: usize| {
        let anchor = &plan.tokens[anchor.unwrap()];
        relation.distances.iter().all(|distance| {
            let sign = if distance.backward { -1 } else { 1 };
            let target = end_of(&plan.tokens[target], distance.to);
            let [min, max] = span_of(distance, values);
            (min..=max).contains(&(sign * (target - end_of(anchor, distance.from))))
        })
    };
    // There are times for the target, and at none of them it has a tick in the horizon.
    let only_outside = || {
        let Some(anchor) = anchor else { return true };
        let anchor = &plan.tokens[anchor];
        let can_be = |end: End, time: i64| {
            let mut distances = relation.distances.iter().filter(|at| at.to == end);
            distances.all(|at| {
                let [min, max] = span_of(at, values);
                let sign = if at.backward { -1 } else { 1 };
                (min..=max).contains(&(sign * (time - end_of(anchor, at.from))))
            })
        };
        let starts = (-10..16).filter(|&start| can_be(End::Start, start));
        let pairs = starts.flat_map(|start| (start..16).map(move |end| (start, end)));
        let mut pairs = pairs
            .filter(|&(_, end)| can_be(End::Finish, end))
            .peekable();
        pairs.peek().is_some() && pairs.all(|(start, end)| start >= HORIZON || end <= 0)
    };
    match relation.target {
        Target::Label(label) => match labels[label] {
            None => false,
            Some(target) => {
                let holds = anchor.is_none() || target.is_none() || is_apart(target.unwrap());
                holds && found_from(others, labels, plan, values, rest)
            }
        },
        Target::New(ref pattern, label) => {
            let mut all: Vec<Option<usize>> = Vec::new();
            if anchor.is_some() {
                let fitting = (0..plan.tokens.len()).filter(|&index| {
                    labels[0] != Some(Some(index))
                        && matches(pattern, &plan.tokens[index], values)
                        && is_apart(index)
                });
                all.extend(fitting.map(Some));
            }
            if only_outside() {
                all.push(None);
            }
            let found = all.into_iter().any(|target| {
                labels[label] = Some(target);
                found_from(others, labels, plan, values, rest)
            });
            labels[label] = None;
            found
        }
    }
}

/// Whether a rule holds for a token.
fn rule_holds(model: &Model, rule: &Rule, plan: &Plan, master: usize) -> bool {
    let token = &plan.tokens[master];
    let listed: Vec<_> = token
        .effects
        .iter()
        .filter(|listed| listed.place == crate::plan::place(model, rule.position))
        .collect();
    let Some(left) = guard(model, rule, token) else {
        return listed.is_empty();
    };
    left.into_iter().any(|values| {
        let lasts = token.end - token.start;
        let is_bound = rule.duration.is_none_or(|[min, max]| {
            let distance = Distance {
                from: End::Start,
                to: End::Start,
                min,
                max,
                backward: false,
            };
            let [min, max] = span_of(&distance, values);
            (min..=max).contains(&lasts)
        });
        let is_listed = |effect: &Effect, at: usize| {
            let amount = match effect.amount {
                Bound::Value(amount) => amount,
                Bound::Variable(variable) => values[variable],
                Bound::None => return false,
            };
            listed[at].amount == amount
                && listed[at].does == effect.kind.into()
                && effect
                    .resources
                    .iter()
                    .any(|id| format!("r{id}") == listed[at].resource)
        };
        let effects = match (&rule.effects[..], listed.len()) {
            ([], 0) => true,
            ([one], 1) => is_listed(one, 0),
            _ => false,
        };
        let relationships = |labels: &Labels| {
            rule.relationships.iter().all(|of| {
                let there = |label: usize| labels[label].flatten().map(|at| &plan.tokens[at]);
                let operands = of.operands.iter().map(|operand| match *operand {
                    Operand::Value(value) => Some(value),
                    Operand::Variable(variable) => Some(values[variable]),
                    Operand::Start(label) => there(label).map(|token| token.start),
                    Operand::Finish(label) => there(label).map(|token| token.end),
                    Operand::Duration(label) => there(label).map(|token| token.end - token.start),
                });
                let operands: Option<Vec<i64>> = operands.collect();
                operands.is_none_or(|operands| holds(of.kind, &operands))
            })
        };
        is_bound
            && effects
            && ways(&rule.body).iter().any(|way| {
                let mut labels = vec![None; rule.labels];
                labels[0] = Some(Some(master));
                found_from(way, &mut labels, plan, values, &relationships)
            })
    })
}

/// Whether levels are within limits, tick by tick.
fn levels_hold(model: &Model, plan: &Plan) -> bool {
    model.resources.iter().all(|resource| {
        (0..=HORIZON).all(|now| {
            let effects = plan
                .tokens
                .iter()
                .flat_map(|token| token.effects.iter().map(move |effect| (token, effect)));
            let of_it = effects.filter(|(_, effect)| effect.resource == resource.name);
            let level = of_it.fold(resource.initial, |level, (token, effect)| {
                let window = match resource.kind {
                    ResourceKind::RateLimited { window_ticks } => Some(window_ticks),
                    _ => None,
                };
                let is = |kind: EffectKind| effect.does == kind.into();
                let (from, to, by) = if is(EffectKind::Uses) {
                    (
                        token.start,
                        Some(token.end + window.unwrap_or(0)),
                        -effect.amount,
                    )
                } else {
                    let consumes = [
                        EffectKind::Consumes(End::Start),
                        EffectKind::Consumes(End::Finish),
                    ];
                    let by = if consumes.into_iter().any(is) {
                        -effect.amount
                    } else {
                        effect.amount
                    };
                    let starts = [
                        EffectKind::Consumes(End::Start),
                        EffectKind::Produces(End::Start),
                    ];
                    let at = if starts.into_iter().any(is) {
                        token.start
                    } else {
                        token.end
                    };
                    (at, window.map(|window| at + window), by)
                };
                let in_force = from <= now && to.is_none_or(|to| now < to);
                level + if in_force { by } else { 0 }
            });
            resource.limits.contains(level)
        })
    })
}

fn worth(problem: &Problem, plan: &Plan) -> f64 {
    let is_achieved = |goal: usize| {
        plan.achieved
            .iter()
            .any(|one| one.goal == problem.goals[goal].name)
    };
    let goals = (0..problem.goals.len()).filter(|&goal| is_achieved(goal));
    let weights = goals.filter_map(|goal| problem.goals[goal].weight);
    let combinations = problem.combinations.iter();
    let whole = combinations.filter(|one| one.goals.iter().all(|&goal| is_achieved(goal)));
    weights.chain(whole.map(|one| one.weight)).sum()
}

/// Whether tokens are fitting for facts, each for one.
fn facts_hold(facts: &[Fact], plan: &Plan, taken: &mut Vec<usize>) -> bool {
    let Some((fact, others)) = facts.split_first() else {
        return true;
    };
    (0..plan.tokens.len()).any(|index| {
        let token = &plan.tokens[index];
        let fits = !taken.contains(&index)
            && timeline_of(token) == fact.timeline
            && predicate_of(token) == fact.predicate
            && fact.values[0].is_none_or(|value| values_of(token) == Some(value))
            && fact.start.contains(token.start)
            && fact.finish.contains(token.end);
        if !fits {
            return false;
        }
        taken.push(index);
        let all = facts_hold(others, plan, taken);
        taken.pop();
        all
    })
}

fn goals_hold(problem: &Problem, plan: &Plan) -> bool {
    let token_of = |goal: usize| {
        let name = &problem.goals[goal].name;
        plan.achieved
            .iter()
            .find(|one| one.goal == *name)
            .map(|one| plan.token(one.token).unwrap())
    };
    let goals = problem
        .goals
        .iter()
        .enumerate()
        .all(|(id, goal)| match token_of(id) {
            None => goal.weight.is_some(),
            Some(token) => {
                assignments()
                    .into_iter()
                    .any(|values| matches(&goal.pattern, token, values))
                    && goal.start.contains(token.start)
                    && goal.finish.contains(token.end)
                    && goal.duration.contains(token.end - token.start)
            }
        });
    let orders = problem.orders.iter().all(|order| {
        let (Some(from), Some(to)) = (token_of(order.from), token_of(order.to)) else {
            return true;
        };
        order.distances.iter().all(|distance| {
            let sign = if distance.backward { -1 } else { 1 };
            let [min, max] = span_of(distance, [0; 2]);
            let is = sign * (end_of(to, distance.to) - end_of(from, distance.from));
            (min..=max).contains(&is)
        })
    });
    goals && orders
}

fn is_valid(model: &Model, problem: &Problem, plan: &Plan) -> bool {
    let tokens = &plan.tokens;
    let well_formed = tokens.iter().all(|token| {
        token.start <= token.end
            && (0..=HORIZON).contains(&token.start)
            && (0..=HORIZON).contains(&token.end)
            && (token.start_window[0]..=token.start_window[1]).contains(&token.start)
            && (token.end_window[0]..=token.end_window[1]).contains(&token.end)
            && [token.start_window, token.end_window]
                .iter()
                .all(|[from, to]| (0..=HORIZON).contains(from) && (0..=HORIZON).contains(to))
    });
    let ordered = (0..tokens.len()).all(|one| {
        (0..one).all(|other| {
            let (one, other) = (&tokens[one], &tokens[other]);
            one.timeline != other.timeline
                || one.timeline == "free"
                || one.end <= other.start
                || other.end <= one.start
        })
    });
    let covered = (0..HORIZON).all(|now| {
        let there = tokens.iter().filter(|token| token.timeline == "state");
        there
            .filter(|token| token.start <= now && now < token.end)
            .count()
            == 1
    });
    well_formed
        && ordered
        && covered
        && facts_hold(&problem.facts, plan, &mut Vec::new())
        && goals_hold(problem, plan)
        && levels_hold(model, plan)
        && plan.score == worth(problem, plan)
        && plan.makespan == plan.latest_end()
        && model
            .rules
            .iter()
            .all(|rule| (0..tokens.len()).all(|token| rule_holds(model, rule, plan, token)))
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
