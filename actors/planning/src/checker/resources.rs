//! The levels of resources, by a sweep over the times at which they change.

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
        ResourceKind::Renewable | ResourceKind::Depletable => over,
        ResourceKind::RateLimited { window_ticks } => {
            Some(over.unwrap_or(at).saturating_add(window_ticks))
        }
    };
    [Some((at, by)), over.map(|over| (over, -by))]
}

/// Reports the intervals in which the level is outside the limits.
fn sweep(scene: &Scene<'_>, resource: ResourceId, events: &mut Vec<Event>, report: &mut Report) {
    let is = PlanResource::of(scene.model, scene.problem, resource);
    events.extend(
        is.changes
            .iter()
            .map(|&(at, by)| (at, i128::from(by), None)),
    );
    // What happens before the horizon has happened when it begins.
    events.iter_mut().for_each(|event| event.0 = event.0.max(0));
    events.sort_by_key(|event| event.0);
    let limits = scene.model.resources[resource].limits;
    let (min, max) = (i128::from(limits.min), i128::from(limits.max));
    let (min, max) = (
        if limits.min == Value::MIN {
            i128::MIN
        } else {
            min
        },
        if limits.max == Value::MAX {
            i128::MAX
        } else {
            max
        },
    );
    let horizon = scene.problem.horizon;
    let mut level = i128::from(is.initial);
    let mut wrong: Option<(Ticks, i128, usize)> = None;
    let (mut next, mut now, mut listed) = (0, 0, 0);
    loop {
        while events.get(next).is_some_and(|event| event.0 == now) {
            level += events[next].1;
            next += 1;
        }
        let is_wrong = level < min || level > max;
        match wrong {
            // A worse level in the same interval is the one to be told.
            Some((from, worst, _)) if is_wrong && (worst < min) == (level < min) => {
                let is_worse = if level < min {
                    level < worst
                } else {
                    level > worst
                };
                if is_worse {
                    wrong = Some((from, level, next));
                }
            }
            _ => {
                if let Some(found) = wrong.take() {
                    overuse(
                        scene,
                        (resource, limits.min, limits.max),
                        &events[..],
                        found,
                        now,
                        report,
                    );
                    listed += 1;
                }
                wrong = is_wrong.then_some((now, level, next));
            }
        }
        match events.get(next) {
            Some(event) if event.0 <= horizon && listed < LISTED => now = event.0,
            _ => break,
        }
    }
    if let Some(found) = wrong {
        overuse(
            scene,
            (resource, limits.min, limits.max),
            &events[..],
            found,
            horizon,
            report,
        );
    }
}

/// Reports an interval in which the level was wrong, after the first `applied` events at its worst.
fn overuse(
    scene: &Scene<'_>,
    (resource, min, max): (ResourceId, Value, Value),
    events: &[Event],
    (from, level, applied): (Ticks, i128, usize),
    to: Ticks,
    report: &mut Report,
) {
    let is_low = level < i128::from(min);
    // By token, what it changed and did not give back.
    let mut held: std::collections::BTreeMap<TokenId, i128> = Default::default();
    for &(_, by, token) in &events[..applied] {
        if let Some(token) = token {
            *held.entry(token).or_default() += by;
        }
    }
    let tokens = held
        .iter()
        .filter(|(_, by)| if is_low { **by < 0 } else { **by > 0 });
    let tokens: Vec<TokenId> = tokens.map(|(&token, _)| token).take(LISTED).collect();
    let shares = tokens
        .iter()
        .map(|token| format!("token {token} {:+}", held[token]));
    let shares: Vec<String> = shares.collect();
    let model = scene.model;
    let name = &model.resources[resource].name;
    let (side, limit) = match is_low {
        true => ("below its least", min),
        false => ("above its greatest", max),
    };
    let by = match shares.is_empty() {
        true => "no token".into(),
        false => shares.join(", "),
    };
    let message =
        format!("{name} is at {level} from {from} to {to}, {side} level of {limit}: by {by}");
    let place = scene.place(model.resources[resource].position);
    let added = report.add(Kind::Overuse, message).tokens(tokens);
    added.times(from, to).at(place);
}
