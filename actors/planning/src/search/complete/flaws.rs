//! What is missing in a schedule, the first of each kind.

use crate::Ticks;
use crate::database::{Database, Open, Owner, Status, Step};
use crate::model::{ResourceId, Target, TimelineId, TimelineKind};
use crate::profile::OverUse;
use crate::search::Flaw;

/// What rules ask for, by the order of the model's search control, then as it was asked for.
pub(in crate::search) fn first_open(database: &Database) -> Option<Open> {
    let subgoals = &database.model().control.subgoals;
    let rank = |open: &Open| -> Option<usize> {
        let Step::Relation(at) = open.step else {
            return Some(0);
        };
        let relation = database.relation(open.instance, at);
        let instance = database.instance(open.instance)?;
        // Without its anchor a relation says nothing of times yet.
        instance.label(relation.anchor)?;
        match &relation.target {
            Target::Label(label) => instance.label(*label).map(|_| 0),
            Target::New(pattern, _) => {
                let named = |at: &(TimelineId, usize)| {
                    pattern.timelines.contains(&at.0) && at.1 == pattern.predicate
                };
                let place = subgoals.iter().position(named);
                Some(1 + place.unwrap_or(subgoals.len()))
            }
        }
    };
    let ranked = database
        .open()
        .iter()
        .filter_map(|open| Some((rank(open)?, open)));
    // The first of the least.
    ranked.min_by_key(|at| at.0).map(|at| *at.1)
}

/// The first place on a timeline of states where two tokens do not meet.
pub(in crate::search) fn first_gap(database: &Database) -> Option<Flaw> {
    let horizon = database.horizon();
    for (timeline, at) in database.model().timelines.iter().enumerate() {
        if at.kind != TimelineKind::State {
            continue;
        }
        let gap = |after| Some(Flaw::Gap { timeline, after });
        let mut last = None;
        for token in database.on(timeline) {
            let meets = match last {
                None => database.start(token).max <= horizon.min,
                Some(last) => database.meets(last, token),
            };
            if !meets {
                return gap(last);
            }
            last = Some(token);
        }
        let ends = last.is_some_and(|last| database.finish(last).min >= horizon.max);
        if !ends && horizon.min < horizon.max {
            return gap(last);
        }
    }
    None
}

/// The first over-use at the earliest times, of any resource.
pub(in crate::search) fn first_over_use(
    database: &mut Database,
) -> Option<(ResourceId, OverUse<Owner>)> {
    let mut first: Option<(ResourceId, OverUse<Owner>)> = None;
    for resource in 0..database.model().resources.len() {
        let over_use = database
            .levels(resource)
            .earliest
            .first_over_use(Ticks::MIN);
        if let Some(over_use) = over_use
            && first
                .as_ref()
                .is_none_or(|(_, at)| over_use.worst_tick < at.worst_tick)
        {
            first = Some((resource, over_use));
        }
    }
    first
}

/// The first parameter of an active token that must have a value and has none.
pub(in crate::search) fn first_unbound(database: &Database) -> Option<Flaw> {
    let model = database.model();
    let active = database.tokens().filter(|at| at.1.status == Status::Active);
    for (token, at) in active {
        let inputs = model.predicates[at.predicate].inputs;
        for (parameter, &operand) in at.parameters.iter().enumerate().take(inputs) {
            let left = model.control.unbound.contains(&(at.predicate, parameter));
            if !left && database.value(operand).is_none() {
                return Some(Flaw::Unbound { token, parameter });
            }
        }
    }
    None
}
