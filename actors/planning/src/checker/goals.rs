//! Facts, goals, their orders, and what they are worth.

use std::collections::{BTreeMap, VecDeque};

use super::{Bindings, Kind, Report, Scene, Seen, apart};
use crate::model::{Bound, Distance, Fact, Goal, GoalId};
use crate::nearest::did_you_mean;
use crate::plan::TokenId;
use crate::temporal::Span;

pub(super) fn check(scene: &Scene<'_>, report: &mut Report) {
    facts(scene, report);
    let achieved = goals(scene, report);
    orders(scene, &achieved, report);
    score(scene, &achieved, report);
    makespan(scene, report);
}

/// That each fact has a token of its own: a matching of facts to tokens, extended by one fact after
/// another along a path of changes.
fn facts(scene: &Scene<'_>, report: &mut Report) {
    let facts = &scene.problem.facts;
    let fitting: Vec<Vec<usize>> = facts
        .iter()
        .map(|fact| {
            let tokens = scene.by_start[fact.timeline].iter().copied();
            tokens
                .filter(|&index| is_fact(fact, &scene.tokens[index]))
                .collect()
        })
        .collect();
    let mut token_of: Vec<Option<usize>> = vec![None; facts.len()];
    let mut fact_of = vec![None; scene.tokens.len()];
    let mut reached = vec![usize::MAX; scene.tokens.len()];
    for (fact, missing) in facts.iter().enumerate() {
        // By token: the fact from which it was reached.
        let mut from = BTreeMap::new();
        let mut queue = VecDeque::from([fact]);
        let mut free = None;
        'search: while let Some(at) = queue.pop_front() {
            for &token in &fitting[at] {
                if std::mem::replace(&mut reached[token], fact) == fact {
                    continue;
                }
                from.insert(token, at);
                match fact_of[token] {
                    Some(other) => queue.push_back(other),
                    None => {
                        free = Some(token);
                        break 'search;
                    }
                }
            }
        }
        let Some(mut token) = free else {
            missing_fact(scene, missing, report);
            continue;
        };
        // Each fact on the path gives the token that it had to the one before.
        loop {
            let at = from[&token];
            fact_of[token] = Some(at);
            match token_of[at].replace(token) {
                Some(had) => token = had,
                None => break,
            }
        }
    }
}

fn is_fact(fact: &Fact, seen: &Seen<'_>) -> bool {
    let mut values = fact.values.iter().zip(&seen.values);
    seen.predicate == fact.predicate
        && values.all(|(wanted, value)| wanted.is_none() || wanted == value)
        && fact.start.contains(seen.token.start)
        && fact.finish.contains(seen.token.end)
}

fn missing_fact(scene: &Scene<'_>, fact: &Fact, report: &mut Report) {
    let model = scene.model;
    let predicate = &model.predicates[fact.predicate];
    let values = predicate.parameters.iter().zip(&fact.values);
    let values = values.map(|(of, value)| match value {
        Some(value) => model.show(of.of, *value),
        None => "?".into(),
    });
    let values: Vec<String> = values.collect();
    let message = format!(
        "no token is the fact {}({}) on {} that starts within {:?} and ends within {:?}",
        predicate.name,
        values.join(", "),
        model.timelines[fact.timeline].name,
        fact.start,
        fact.finish
    );
    let place = scene.problem_place(fact.position);
    report.add(Kind::Fact, message).at(place);
}

/// That each goal is either achieved or left out. By goal, the token that achieves it.
fn goals(scene: &Scene<'_>, report: &mut Report) -> Vec<Option<usize>> {
    let goals = &scene.problem.goals;
    let ids: BTreeMap<&str, GoalId> = goals
        .iter()
        .enumerate()
        .map(|(id, goal)| (goal.name.as_str(), id))
        .collect();
    let by_id: BTreeMap<TokenId, usize> = scene
        .tokens
        .iter()
        .enumerate()
        .map(|(index, seen)| (seen.token.id, index))
        .collect();
    let mut said = vec![0; goals.len()];
    let mut achieved = vec![None; goals.len()];
    let names = || goals.iter().map(|goal| goal.name.as_str());
    for one in &scene.plan.achieved {
        let Some(&id) = ids.get(one.goal.as_str()) else {
            let near = did_you_mean(&one.goal, names());
            report.add(Kind::Name, format!("there is no goal {:?}{near}", one.goal));
            continue;
        };
        said[id] += 1;
        let place = scene.problem_place(goals[id].position);
        let Some(&index) = by_id.get(&one.token) else {
            let message = format!("goal {:?} is achieved by no token: {}", one.goal, one.token);
            report.add(Kind::Goal, message).at(place);
            continue;
        };
        achieved[id] = Some(index);
        let seen = &scene.tokens[index];
        if let Err(problem) = is_goal(scene, &goals[id], seen) {
            let message = format!("goal {:?} and token {}: {problem}", one.goal, seen.token);
            let added = report
                .add(Kind::Goal, message)
                .tokens([one.token])
                .at(place);
            added.times(seen.token.start, seen.token.end);
        }
    }
    for one in &scene.plan.left_out {
        match ids.get(one.goal.as_str()) {
            Some(&id) => said[id] += 1,
            None => {
                let near = did_you_mean(&one.goal, names());
                report.add(Kind::Name, format!("there is no goal {:?}{near}", one.goal));
            }
        }
    }
    for (id, goal) in goals.iter().enumerate() {
        let problem = match (said[id], achieved[id]) {
            (0, _) => "is neither achieved nor left out",
            (1, Some(_)) => continue,
            (1, None) if goal.weight.is_some() => continue,
            (1, None) => "is not achieved, and no plan is one without it",
            _ => "is listed more than once",
        };
        let place = scene.problem_place(goal.position);
        let message = format!("goal {:?} {problem}", goal.name);
        report.add(Kind::Goal, message).at(place);
    }
    achieved
}

/// What keeps a token from being a goal.
fn is_goal(scene: &Scene<'_>, goal: &Goal, seen: &Seen<'_>) -> Result<(), String> {
    let mut bindings = Bindings::new(goal.variables.len());
    if !scene.fits(&goal.pattern, seen, &goal.variables, &mut bindings) {
        return Err("the token says something else".into());
    }
    let (start, end) = (seen.token.start, seen.token.end);
    let times: [(&str, i64, Span); 3] = [
        ("starts at", start, goal.start),
        ("ends at", end, goal.finish),
        ("lasts", end.saturating_sub(start), goal.duration),
    ];
    for (what, is, asked) in times {
        if !asked.contains(is) {
            return Err(format!("it {what} {is}, which is not within {asked:?}"));
        }
    }
    Ok(())
}

/// That goals which are achieved are in the orders that the problem asks for.
fn orders(scene: &Scene<'_>, achieved: &[Option<usize>], report: &mut Report) {
    let value = |bound: Bound, none: i64| match bound {
        Bound::Value(value) => value,
        // An order has no variables.
        Bound::None | Bound::Variable(_) => none,
    };
    for order in &scene.problem.orders {
        let (Some(from), Some(to)) = (achieved[order.from], achieved[order.to]) else {
            continue;
        };
        let (from, to) = (&scene.tokens[from], &scene.tokens[to]);
        let is_apart = |distance: &&Distance| {
            let asked = Span::new(value(distance.min, i64::MIN), value(distance.max, i64::MAX));
            !asked.contains(apart(distance, from, to))
        };
        if let Some(distance) = order.distances.iter().find(is_apart) {
            let message = format!(
                "the order of goals {:?} and {:?} is violated: {}",
                scene.problem.goals[order.from].name,
                scene.problem.goals[order.to].name,
                too_far(distance, from, to)
            );
            let place = scene.problem_place(order.position);
            let tokens = [from.token.id, to.token.id];
            report.add(Kind::Order, message).tokens(tokens).at(place);
        }
    }
}

/// How far ends are apart.
fn too_far(distance: &Distance, from: &Seen<'_>, to: &Seen<'_>) -> String {
    let end = |end| match end {
        crate::model::End::Start => "start",
        crate::model::End::Finish => "end",
    };
    let (mut first, mut second) = (
        format!("the {} of token {}", end(distance.from), from.token),
        format!("the {} of token {}", end(distance.to), to.token),
    );
    if distance.backward {
        std::mem::swap(&mut first, &mut second);
    }
    let is = apart(distance, from, to);
    format!("{second} lies {is} ticks after {first}")
}

/// Equation 1: the weights of the goals that are achieved and of the combinations of which all are.
fn score(scene: &Scene<'_>, achieved: &[Option<usize>], report: &mut Report) {
    let goals = scene.problem.goals.iter().zip(achieved);
    let of_goals = goals.filter_map(|(goal, token)| token.and(goal.weight));
    let combinations = scene.problem.combinations.iter();
    let whole = combinations.filter(|one| one.goals.iter().all(|&goal| achieved[goal].is_some()));
    let of_combinations = whole.map(|one| one.weight);
    let (mut score, mut magnitude) = (0.0, 1.0);
    for weight in of_goals.chain(of_combinations) {
        score += weight;
        magnitude += f64::abs(weight);
    }
    // Sums in another order differ in their last digits.
    let is_equal = (scene.plan.score - score).abs() <= 1e-9 * magnitude;
    if !is_equal {
        let message = format!("the score is {}, and should be {score}", scene.plan.score);
        report.add(Kind::Score, message);
    }
}

/// The latest end of a token that achieves a goal.
fn makespan(scene: &Scene<'_>, report: &mut Report) {
    let (is, should) = (scene.plan.makespan, scene.plan.latest_end());
    if is != should {
        report.add(
            Kind::Makespan,
            format!("the makespan is {is}, and should be {should}"),
        );
    }
}
