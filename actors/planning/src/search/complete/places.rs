//! Where tokens can go: what is asked for, goals, gaps.

use crate::Ticks;
use crate::database::{Cause, Database, InstanceId, Slot, Step, TokenId};
use crate::model::{End, Pattern, SlotOrder, Target, TimelineId, TimelineKind};
use crate::parameters::Kind;
use crate::search::Decision;
use crate::temporal::Span;

/// All that may achieve a goal: tokens that are there, then places for its own.
pub(super) fn goal_decisions(
    database: &Database,
    pattern: &Pattern,
    token: TokenId,
    into: &mut Vec<Decision>,
) {
    for &timeline in &pattern.timelines {
        if database.model().timelines[timeline].kind != TimelineKind::Free {
            let same = database
                .on(timeline)
                .filter(|&at| same_kind(database, token, at));
            into.extend(same.map(Decision::Support));
        }
    }
    let window = [database.start(token), database.finish(token)];
    slots(database, pattern, window, None, into);
}

/// Whether a token can be merged into another, as far as each parameter alone says.
fn same_kind(database: &Database, token: TokenId, other: TokenId) -> bool {
    let (Some(token), Some(other)) = (database.token(token), database.token(other)) else {
        return false;
    };
    token.predicate == other.predicate
        && token
            .parameters
            .iter()
            .zip(&other.parameters)
            .all(|(one, other)| {
                one == other
                    || database.store().entailed(&Kind::Equal, &[*one, *other]) != Some(false)
            })
}

/// All that may put right what an instance asks for.
pub(super) fn open_decisions(
    database: &Database,
    instance: InstanceId,
    step: Step,
    into: &mut Vec<Decision>,
) {
    let relation = match step {
        Step::Choice(choice) => {
            let alternatives = database.alternatives(instance, choice).len() as u32;
            into.extend((0..alternatives).map(Decision::Alternative));
            return;
        }
        Step::Relation(relation) => relation,
    };
    let said = database.relation(instance, relation);
    let Target::New(pattern, _) = &said.target else {
        into.push(Decision::Relate);
        return;
    };
    let Some(anchor) = database
        .instance(instance)
        .and_then(|at| at.label(said.anchor))
    else {
        return;
    };
    let mut window = [Span::ALL; 2];
    for distance in &said.distances {
        let from = database.bounds_of(database.time(anchor, distance.from));
        let span = database.span(instance, distance.min, distance.max, distance.backward);
        let place = usize::from(distance.to == End::Finish);
        let add = |time: Ticks, by: Ticks| match by {
            Ticks::MIN | Ticks::MAX => by,
            by => time.saturating_add(by),
        };
        let at = Span::new(add(from.min, span.min), add(from.max, span.max));
        window[place] = window[place].intersect(at);
    }
    for &timeline in &pattern.timelines {
        for token in database.on(timeline) {
            let within = !database.start(token).intersect(window[0]).is_empty()
                && !database.finish(token).intersect(window[1]).is_empty();
            if within && token != anchor && database.fits(instance, relation, token) {
                into.push(Decision::Support(token));
            }
        }
    }
    if !said.condition {
        let near = Some(database.start(anchor).min);
        slots(database, pattern, window, near, into);
    }
}

/// The places where a token can be that starts and ends within a window, in the order that the
/// model's search control says; then those where something that only rules asked for makes room.
fn slots(
    database: &Database,
    pattern: &Pattern,
    [start, finish]: [Span; 2],
    near: Option<Ticks>,
    into: &mut Vec<Decision>,
) {
    let mut displacing = Vec::new();
    for &timeline in &pattern.timelines {
        if database.model().timelines[timeline].kind == TimelineKind::Free {
            let after = database.last(timeline);
            into.push(Decision::Insert(Slot { timeline, after }));
            continue;
        }
        let from = into.len();
        let mut after = None;
        loop {
            let next = match after {
                None => database.first(timeline),
                Some(token) => database.token(token).and_then(|at| at.after()),
            };
            let bounds = |after: Option<TokenId>, next: Option<TokenId>| {
                let begins = after.map_or(Ticks::MIN, |at| database.finish(at).min);
                let ends = next.map_or(Ticks::MAX, |at| database.start(at).max);
                begins < ends && begins <= start.max && finish.min <= ends && start.min < ends
            };
            let slot = Slot { timeline, after };
            if bounds(after, next) {
                into.push(Decision::Insert(slot));
            }
            let Some(next) = next else { break };
            let beyond = database.token(next).and_then(|at| at.after());
            if is_removable(database, next) && bounds(after, beyond) {
                let token = next;
                displacing.push(Decision::Displace { slot, token });
            }
            after = Some(next);
        }
        order_slots(database, timeline, pattern, near, &mut into[from..]);
    }
    into.extend(displacing);
}

/// Whether only rules or gaps asked for a token, so that it can make room.
fn is_removable(database: &Database, token: TokenId) -> bool {
    let cause = database.token(token).map(|at| at.cause);
    matches!(cause, Some(Cause::Rule { .. } | Cause::Filler))
}

fn order_slots(
    database: &Database,
    timeline: TimelineId,
    pattern: &Pattern,
    near: Option<Ticks>,
    slots: &mut [Decision],
) {
    let rules = database.model().control.slots.iter();
    let mut said = rules.filter(|at| (at.0, at.1) == (timeline, pattern.predicate));
    match said.next().map_or(SlotOrder::Earliest, |at| at.2) {
        SlotOrder::Earliest => {}
        SlotOrder::Latest => slots.reverse(),
        SlotOrder::Nearest => slots.sort_by_key(|slot| match slot {
            Decision::Insert(Slot { after, .. }) => {
                let begins = after.map_or(0, |at| database.finish(at).min);
                begins.abs_diff(near.unwrap_or(0))
            }
            _ => u64::MAX,
        }),
    }
}

/// Two tokens of states meet, or one more is put between them.
pub(super) fn gap_decisions(
    database: &Database,
    timeline: TimelineId,
    after: Option<TokenId>,
    into: &mut Vec<Decision>,
) {
    let next = match after {
        None => database.first(timeline),
        Some(after) => database.token(after).and_then(|at| at.after()),
    };
    if after.is_some() || next.is_some() {
        into.push(Decision::Close);
    }
    if database.model().timelines[timeline].default.is_some() {
        into.push(Decision::Insert(Slot { timeline, after }));
    }
}
