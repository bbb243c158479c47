//! Sets of goals: the next one of a size, a problem with some of its goals, and whether more goals
//! can only make it harder.

use crate::model::{Body, EffectKind, GoalId, Model, Problem, TimelineKind};

/// The next places in rising order, each below `count`; whether there are any.
pub(super) fn next_places(places: &mut [usize], count: usize) -> bool {
    let size = places.len();
    let Some(at) = (0..size).rev().find(|&at| places[at] < count - size + at) else {
        return false;
    };
    places[at] += 1;
    for next in at + 1..size {
        places[next] = places[next - 1] + 1;
    }
    true
}

/// The problem with some of its goals only.
pub(super) fn only(problem: &Problem, kept: &[bool]) -> Problem {
    let mut places = Vec::with_capacity(kept.len());
    let mut next = 0;
    for &kept in kept {
        places.push(kept.then_some(next));
        next += usize::from(kept);
    }
    let mut less = problem.clone();
    let mut at = kept.iter();
    less.goals.retain(|_| *at.next().unwrap_or(&false));
    less.combinations.retain_mut(|combination| {
        let goals = combination.goals.iter().map(|&goal| places[goal]);
        match goals.collect::<Option<Vec<GoalId>>>() {
            Some(goals) => combination.goals = goals,
            None => return false,
        }
        true
    });
    less.orders.retain_mut(|order| {
        let (Some(from), Some(to)) = (places[order.from], places[order.to]) else {
            return false;
        };
        (order.from, order.to) = (from, to);
        true
    });
    less
}

/// Whether what a token needs and does can only stand in the way of others.
pub(super) fn is_only_in_the_way(model: &Model) -> bool {
    fn has_condition(body: &Body) -> bool {
        match body {
            Body::All(parts) | Body::Any(parts, _) => parts.iter().any(has_condition),
            Body::Relation(relation) => relation.condition,
        }
    }
    // On other timelines a token also fills time, or does what another asks for.
    let free = model
        .timelines
        .iter()
        .all(|at| at.kind == TimelineKind::Free);
    free && model.rules.iter().all(|rule| {
        let produces = |kind| matches!(kind, EffectKind::Produces(_));
        !rule.effects.iter().any(|effect| produces(effect.kind)) && !has_condition(&rule.body)
    })
}
