//! What lies on timelines, and whether it lies in the horizon.

use std::collections::{BTreeMap, BTreeSet};

use super::{Kind, Report, Scene, Seen};
use crate::model::{TimelineId, TimelineKind};
use crate::plan::{Origin, TokenId};

pub(super) fn check(scene: &Scene<'_>, report: &mut Report) {
    horizon(scene, report);
    origins(scene, report);
    for (timeline, of) in scene.model.timelines.iter().enumerate() {
        match of.kind {
            TimelineKind::Free => {}
            TimelineKind::Unary => one_after_another(scene, timeline, report),
            TimelineKind::State => {
                one_after_another(scene, timeline, report);
                no_gap(scene, timeline, report);
            }
        }
    }
}

/// That tokens lie in the horizon, and so does what they are anchored to.
fn horizon(scene: &Scene<'_>, report: &mut Report) {
    let horizon = scene.problem.horizon;
    let is_outside: Vec<bool> = scene
        .tokens
        .iter()
        .map(|seen| seen.token.start < 0 || seen.token.end > horizon)
        .collect();
    let above = outside_above(scene, &is_outside);
    for (index, seen) in scene.tokens.iter().enumerate() {
        let token = seen.token;
        if is_outside[index] {
            let message = format!("token {token} is not in the horizon, 0 to {horizon}");
            let added = report.add(Kind::Horizon, message).tokens([token.id]);
            added.times(token.start, token.end);
        } else if let Some(above) = above[index] {
            let above = scene.tokens[above].token;
            let message = format!(
                "token {token} is anchored to token {above}, which is not in the horizon, 0 to \
                 {horizon}"
            );
            report
                .add(Kind::Horizon, message)
                .tokens([token.id, above.id]);
        }
    }
}

/// By token: the nearest outside the horizon of its master, its master's master, and so on.
fn outside_above(scene: &Scene<'_>, is_outside: &[bool]) -> Vec<Option<usize>> {
    let tokens = scene.tokens.iter().enumerate();
    let by_id: BTreeMap<TokenId, usize> =
        tokens.map(|(index, seen)| (seen.token.id, index)).collect();
    let master = |index: usize| match scene.tokens[index].token.origin {
        Origin::Rule { master, .. } => by_id.get(&master).copied(),
        _ => None,
    };
    let mut above = vec![None; scene.tokens.len()];
    let mut known = vec![false; scene.tokens.len()];
    for index in 0..scene.tokens.len() {
        // Up to what is known, which in a circle of masters is where it was entered.
        let mut path = Vec::new();
        let mut next = Some(index);
        while let Some(at) = next.filter(|&at| !known[at]) {
            known[at] = true;
            path.push(at);
            next = master(at);
        }
        for at in path.into_iter().rev() {
            above[at] = master(at).and_then(|master| match is_outside[master] {
                true => Some(master),
                false => above[master],
            });
        }
    }
    above
}

/// That masters and goals are there.
fn origins(scene: &Scene<'_>, report: &mut Report) {
    let tokens = &scene.plan.tokens;
    let ids: BTreeSet<TokenId> = tokens.iter().map(|token| token.id).collect();
    let goals = scene.problem.goals.iter();
    let goals: BTreeSet<&str> = goals.map(|goal| goal.name.as_str()).collect();
    for token in tokens {
        match &token.origin {
            Origin::Rule { master, .. } if !ids.contains(master) => {
                let message = format!("the master of token {token} is {master}, which is none");
                report.add(Kind::Origin, message).tokens([token.id]);
            }
            Origin::Goal(goal) if !goals.contains(goal.as_str()) => {
                let message = format!("token {token} is there for {goal:?}, which is no goal");
                report.add(Kind::Origin, message).tokens([token.id]);
            }
            _ => {}
        }
    }
}

/// That of two tokens, one is over when the other starts.
fn one_after_another(scene: &Scene<'_>, timeline: TimelineId, report: &mut Report) {
    let mut last: Option<&Seen<'_>> = None;
    for &index in &scene.by_start[timeline] {
        let seen = &scene.tokens[index];
        if let Some(last) = last
            && seen.token.start < last.token.end
        {
            let (one, other) = (last.token, seen.token);
            let name = &scene.model.timelines[timeline].name;
            let message = format!("{name} has two tokens at once: {one} and {other}");
            let added = report
                .add(Kind::Overlap, message)
                .tokens([one.id, other.id]);
            added.times(other.start, other.end.min(one.end));
        }
        if last.is_none_or(|last| last.token.end < seen.token.end) {
            last = Some(seen);
        }
    }
}

/// That there is a token at any time of the horizon.
fn no_gap(scene: &Scene<'_>, timeline: TimelineId, report: &mut Report) {
    let name = &scene.model.timelines[timeline].name;
    let mut covered = 0;
    let tokens = scene.by_start[timeline]
        .iter()
        .map(|&index| scene.tokens[index].token);
    let ends = tokens.map(|token| (token.start, token.end));
    let horizon = scene.problem.horizon;
    for (start, end) in ends.chain([(horizon, horizon)]) {
        if start.min(horizon) > covered {
            let until = start.min(horizon);
            let message = format!("{name} has no token from {covered} to {until}");
            report.add(Kind::Gap, message).times(covered, until);
        }
        covered = covered.max(end);
    }
}
