//! What lies on timelines, and whether it lies in the horizon.

use std::collections::BTreeMap;

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
    let is_outside = |seen: &Seen<'_>| seen.token.start < 0 || seen.token.end > horizon;
    let by_id: BTreeMap<TokenId, &Seen<'_>> = scene
        .tokens
        .iter()
        .map(|seen| (seen.token.id, seen))
        .collect();
    for seen in &scene.tokens {
        let token = seen.token;
        if is_outside(seen) {
            let message = format!("token {token} is not in the horizon, 0 to {horizon}");
            let added = report.add(Kind::Horizon, message).tokens([token.id]);
            added.times(token.start, token.end);
            continue;
        }
        // The chain of masters may be a circle, which is no longer than there are tokens.
        let mut master = token;
        for _ in 0..scene.tokens.len() {
            let Origin::Rule { master: id, .. } = master.origin else {
                break;
            };
            let Some(above) = by_id.get(&id) else { break };
            if is_outside(above) {
                let message = format!(
                    "token {token} is anchored to token {}, which is not in the horizon, 0 to \
                     {horizon}",
                    above.token
                );
                report
                    .add(Kind::Horizon, message)
                    .tokens([token.id, above.token.id]);
                break;
            }
            if above.token.id == token.id {
                break;
            }
            master = above.token;
        }
    }
}

/// That masters are there.
fn origins(scene: &Scene<'_>, report: &mut Report) {
    let ids: std::collections::BTreeSet<TokenId> =
        scene.plan.tokens.iter().map(|token| token.id).collect();
    for token in &scene.plan.tokens {
        match &token.origin {
            Origin::Rule { master, .. } if !ids.contains(master) => {
                let message = format!("the master of token {token} is {master}, which is none");
                report.add(Kind::Origin, message).tokens([token.id]);
            }
            Origin::Goal(goal) if !scene.problem.goals.iter().any(|one| one.name == *goal) => {
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
