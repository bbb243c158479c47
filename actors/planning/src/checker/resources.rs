//! The levels of resources, by a sweep over the times at which they change.

use std::collections::BTreeMap;

use super::{Kind, Report, Scene};
use crate::Ticks;
use crate::model::{EffectKind, End, ResourceId, ResourceKind, Value};
use crate::plan::{PlanEffectKind, PlanResource, TokenId};

/// The most intervals that are listed for a resource, and the most tokens for an interval.
const LISTED: usize = 100;

/// A change of a level: how much more from when on, by which token; by none if nobody does it.
type Event = (Ticks, i128, Option<TokenId>);

pub(super) fn check(scene: &Scene<'_>, report: &mut Report) {
    let mut events: Vec<Vec<Event>> = vec![Vec::new(); scene.model.resources.len()];
    for seen in &scene.tokens {
        for (effect, &resource) in seen.token.effects.iter().zip(&seen.resources) {
            let Some(resource) = resource else { continue };
            let kind = scene.model.resources[resource].kind;
            let ends = [seen.token.start, seen.token.end];
            let changes = changes(kind, effect.does, effect.amount, ends);
            let of_token = changes.into_iter().flatten();
            events[resource].extend(of_token.map(|(at, by)| (at, by, Some(seen.token.id))));
        }
    }
    for (resource, events) in events.iter_mut().enumerate() {
        sweep(scene, resource, events, report);
    }
}

/// When an effect changes the level, and by how much: at once, and when it is over.
fn changes(
    resource: ResourceKind,
    does: PlanEffectKind,
    amount: Value,
    [start, end]: [Ticks; 2],
) -> [Option<(Ticks, i128)>; 2] {
    let amount = i128::from(amount);
    let is = |kind: EffectKind| PlanEffectKind::from(kind) == does;
    let (at, by, over) = if is(EffectKind::Uses) {
        (start, -amount, Some(end))
    } else if is(EffectKind::Consumes(End::Start)) {
        (start, -amount, None)
    } else if is(EffectKind::Consumes(End::Finish)) {
        (end, -amount, None)
    } else if is(EffectKind::Produces(End::Start)) {
        (start, amount, None)
    } else {
        (end, amount, None)
    };
    let over = match resource {
        ResourceKind::RateLimited { window_ticks } if by < 0 => {
            Some(at.saturating_add(window_ticks))
        }
        _ => over,
    };
    [Some((at, by)), over.map(|over| (over, -by))]
}

/// Reports the intervals in which the level is outside the limits.
fn sweep(scene: &Scene<'_>, resource: ResourceId, events: &mut Vec<Event>, report: &mut Report) {
    let is = PlanResource::of(scene.model, scene.problem, resource);
    let changes = is.changes.iter();
    events.extend(changes.map(|&(at, by)| (at, i128::from(by), None)));
    // What happens before the horizon has happened when it begins.
    events.iter_mut().for_each(|event| event.0 = event.0.max(0));
    events.sort_by_key(|event| event.0);
    let [least, most] = is.limits.map(|limit| limit.map(i128::from));
    let side = |level: i128| match level {
        level if least.is_some_and(|least| level < least) => Side::Low,
        level if most.is_some_and(|most| level > most) => Side::High,
        _ => Side::Within,
    };
    let horizon = scene.problem.horizon;
    let levels = levels(i128::from(is.initial), events, horizon);
    let mut rest = &levels[..];
    let mut listed = 0;
    while let Some(first) = rest.first() {
        let at = side(first.level);
        let same = rest.iter().take_while(|one| side(one.level) == at).count();
        let (interval, after) = rest.split_at(same);
        let worst = match at {
            Side::Within => None,
            Side::Low => interval.iter().min_by_key(|one| one.level),
            Side::High => interval.iter().max_by_key(|one| one.level),
        };
        let to = after.first().map_or(horizon, |next| next.from);
        if let Some(worst) = worst.filter(|_| listed < LISTED) {
            listed += 1;
            let applied = &events[..worst.applied];
            overuse(
                scene,
                resource,
                (at, worst.level),
                applied,
                [first.from, to],
                report,
            );
        }
        rest = after;
    }
}

/// Where a level is.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Side {
    Within,
    Low,
    High,
}

/// A level, from when on, and how many events have made it.
struct Level {
    from: Ticks,
    level: i128,
    applied: usize,
}

/// The levels from time 0 to the horizon's end. Events of one time happen together.
fn levels(initial: i128, events: &[Event], horizon: Ticks) -> Vec<Level> {
    let first = Level {
        from: 0,
        level: initial,
        applied: 0,
    };
    let mut levels = vec![first];
    let within = events.iter().take_while(|event| event.0 <= horizon);
    for (place, &(at, by, _)) in within.enumerate() {
        let last = &levels[levels.len() - 1];
        let next = Level {
            from: at,
            level: last.level + by,
            applied: place + 1,
        };
        if last.from == at {
            levels.pop();
        }
        levels.push(next);
    }
    levels
}

/// Reports an interval in which the level is on a wrong side, at its worst after these events.
fn overuse(
    scene: &Scene<'_>,
    resource: ResourceId,
    (side, level): (Side, i128),
    applied: &[Event],
    [from, to]: [Ticks; 2],
    report: &mut Report,
) {
    let resource = &scene.model.resources[resource];
    // By token, what it changed and did not give back.
    let mut held: BTreeMap<TokenId, i128> = BTreeMap::new();
    for &(_, by, token) in applied {
        if let Some(token) = token {
            *held.entry(token).or_default() += by;
        }
    }
    let is_low = side == Side::Low;
    held.retain(|_, by| if is_low { *by < 0 } else { *by > 0 });
    let tokens = held.keys().copied().take(LISTED);
    let shares = held.iter().take(LISTED);
    let shares: Vec<String> = shares
        .map(|(token, by)| format!("token {token} {by:+}"))
        .collect();
    let by = match shares.is_empty() {
        true => "no token".to_owned(),
        false => shares.join(", "),
    };
    let (side, limit) = match is_low {
        true => ("below its least", resource.limits.min),
        false => ("above its greatest", resource.limits.max),
    };
    let name = &resource.name;
    let message =
        format!("{name} is at {level} from {from} to {to}, {side} level of {limit}: by {by}");
    let added = report.add(Kind::Overuse, message).tokens(tokens);
    added.times(from, to).at(scene.place(resource.position));
}
