//! What decisions do to a database.

use smallvec::SmallVec;

use crate::database::{Cause, Conflict, Database, Owner, Slot, Status, Time, TokenId, Wanted};
use crate::model::{End, TimelineId};
use crate::parameters::Operand;
use crate::search::Precedence;
use crate::temporal::{Constraint, Span};

/// Two tokens meet; the first one starts with the horizon, the last one ends with it.
pub(super) fn close(
    database: &mut Database,
    timeline: TimelineId,
    after: Option<TokenId>,
    owner: Owner,
) -> Result<Option<(TokenId, Constraint)>, Conflict> {
    let horizon = database.horizon();
    let next = match after {
        None => database.first(timeline),
        Some(after) => database.token(after).and_then(|at| at.after()),
    };
    let (token, times, span) = match (after, next) {
        (None, Some(first)) => {
            let times = [Time::At(0), database.time(first, End::Start)];
            (first, times, Span::exactly(horizon.min))
        }
        (Some(last), None) => {
            let times = [Time::At(0), database.time(last, End::Finish)];
            (last, times, Span::exactly(horizon.max))
        }
        (Some(first), Some(second)) => {
            let times = [
                database.time(first, End::Finish),
                database.time(second, End::Start),
            ];
            (second, times, Span::exactly(0))
        }
        (None, None) => return Ok(None),
    };
    database.order_for(token, times, span, owner)
}

/// A timeline says its default after a token, from that token's end on.
pub(super) fn fill(
    database: &mut Database,
    slot: Slot,
    after: Option<TokenId>,
    owner: Owner,
) -> Result<(), Conflict> {
    let model = database.model().clone();
    let Some(default) = &model.timelines[slot.timeline].default else {
        let owner = after.map_or(Owner::Given, Owner::Token);
        return Err(Conflict::Mismatch { owner });
    };
    let values = default.values.iter().map(|value| value.map(Operand::Value));
    let parameters: SmallVec<[Option<Operand>; 4]> = values.collect();
    database.attempt(|database| {
        let token = database.insert(Wanted {
            predicate: default.predicate,
            timeline: Some(slot.timeline),
            parameters: &parameters,
            start: None,
            finish: None,
            cause: Cause::Filler,
        })?;
        database.activate(token, slot)?;
        close(database, slot.timeline, after, owner)?;
        Ok(())
    })
}

/// Removes a token, so that there is room where it was; not if the slot goes with it.
pub(super) fn make_room(
    database: &mut Database,
    slot: Slot,
    token: TokenId,
) -> Result<(), Conflict> {
    database.remove(token);
    let stays = |after| {
        database
            .token(after)
            .is_some_and(|at| at.status == Status::Active)
    };
    if slot.after.is_none_or(stays) {
        return Ok(());
    }
    let owner = Owner::Token(token);
    Err(Conflict::Mismatch { owner })
}

/// Posts a precedence, or its contrary.
pub(super) fn precede(
    database: &mut Database,
    precedence: Precedence,
    holds: bool,
    owner: Owner,
) -> Result<Option<(TokenId, Constraint)>, Conflict> {
    let Precedence { from, to, gap } = precedence;
    let span = if holds {
        Span::at_least(gap)
    } else {
        Span::at_most(gap - 1)
    };
    let times = [from, to].map(|(token, end)| database.time(token, end));
    database.order_for(to.0, times, span, owner)
}
