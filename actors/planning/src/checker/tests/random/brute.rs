//! The definitions of a valid plan, by trying everything. It knows nothing of the checker's tables
//! but the model and the plan.

use super::super::*;
use super::{HORIZON, VARIABLES};
use crate::model::{Distance, Operand, RelationshipKind};

pub(super) fn timeline_of(token: &PlanToken) -> usize {
    ["state", "unary", "free"]
        .iter()
        .position(|name| *name == token.timeline)
        .unwrap()
}

pub(super) fn predicate_of(token: &PlanToken) -> usize {
    usize::from(token.predicate == "Q")
}

pub(super) fn values_of(token: &PlanToken) -> Option<i64> {
    match token.arguments[0].1 {
        PlanValue::Number(number) => Some(number),
        _ => None,
    }
}

pub(super) type Assignment = [i64; VARIABLES];

/// Whether a token is one of a pattern with these values.
pub(super) fn matches(pattern: &Pattern, token: &PlanToken, values: Assignment) -> bool {
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

pub(super) fn assignments() -> Vec<Assignment> {
    (0..9).map(|at| [at / 3, at % 3]).collect()
}

/// The assignments that a rule's master leaves; none if the rule does not hold.
pub(super) fn guard(_: &Model, rule: &Rule, token: &PlanToken) -> Option<Vec<Assignment>> {
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

pub(super) fn holds(kind: RelationshipKind, values: &[i64]) -> bool {
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
pub(super) fn ways(body: &Body) -> Vec<Vec<&Relation>> {
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
pub(super) type Labels = Vec<Option<Option<usize>>>;

pub(super) fn span_of(distance: &Distance, values: Assignment) -> [i64; 2] {
    let value = |bound, none| match bound {
        Bound::None => none,
        Bound::Value(value) => value,
        Bound::Variable(variable) => values[variable],
    };
    [value(distance.min, -1_000), value(distance.max, 1_000)]
}

pub(super) fn end_of(token: &PlanToken, end: End) -> i64 {
    match end {
        End::Start => token.start,
        End::Finish => token.end,
    }
}

/// Whether tokens can be labels such that all relations of a way, and what follows, hold.
pub(super) fn found_from(
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
pub(super) fn rule_holds(model: &Model, rule: &Rule, plan: &Plan, master: usize) -> bool {
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
            ([one], 0) => match one.amount {
                Bound::Value(amount) => amount == 0,
                Bound::Variable(variable) => values[variable] == 0,
                Bound::None => false,
            },
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
pub(super) fn levels_hold(model: &Model, plan: &Plan) -> bool {
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
                let at_end = [
                    EffectKind::Consumes(End::Finish),
                    EffectKind::Produces(End::Finish),
                ];
                let produces = [
                    EffectKind::Produces(End::Start),
                    EffectKind::Produces(End::Finish),
                ];
                let produces = produces.into_iter().any(is);
                let from = if at_end.into_iter().any(is) {
                    token.end
                } else {
                    token.start
                };
                let by = if produces {
                    effect.amount
                } else {
                    -effect.amount
                };
                let to = match window {
                    Some(window) if !produces => Some(from + window),
                    _ => is(EffectKind::Uses).then_some(token.end),
                };
                let in_force = from <= now && to.is_none_or(|to| now < to);
                level + if in_force { by } else { 0 }
            });
            resource.limits.contains(level)
        })
    })
}

pub(super) fn worth(problem: &Problem, plan: &Plan) -> f64 {
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
pub(super) fn facts_hold(facts: &[Fact], plan: &Plan, taken: &mut Vec<usize>) -> bool {
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

pub(super) fn goals_hold(problem: &Problem, plan: &Plan) -> bool {
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

pub(super) fn is_valid(model: &Model, problem: &Problem, plan: &Plan) -> bool {
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
