//! How tokens end of which no status says how: by their time, or since something else comes.

use smallvec::SmallVec;

use crate::Ticks;
use crate::database::{Conflict, Database, Token, TokenId};
use crate::model::{Model, PredicateId, TimelineId, TimelineKind, Value};

/// How a token ends of which no status says how.
#[derive(Clone, Copy, Debug)]
enum Ending {
    TimedOut,
    Preempted,
}

/// The outputs of a predicate that say how a token ended, and what they say then.
#[derive(Clone, Debug, Default)]
pub(super) struct Endings {
    timed_out: SmallVec<[(usize, Value); 1]>,
    preempted: SmallVec<[(usize, Value); 1]>,
}

impl Endings {
    pub(super) fn of(model: &Model, predicate: PredicateId) -> Endings {
        let predicate = &model.predicates[predicate];
        Endings {
            timed_out: SmallVec::from_slice(&predicate.timed_out),
            preempted: SmallVec::from_slice(&predicate.preempted),
        }
    }

    /// Whether all outputs of a token that say how it ended have values, or there are none.
    fn is_said(&self, database: &Database, token: &Token) -> bool {
        let mut outputs = self.timed_out.iter().chain(&self.preempted);
        outputs.all(|&(place, _)| database.value(token.parameters[place]).is_some())
    }

    /// Whether no output says how a token ended.
    fn is_silent(&self) -> bool {
        self.timed_out.is_empty() && self.preempted.is_empty()
    }
}

/// Binds the outputs of a token that say how it ended, if no status did.
fn say_ending(
    database: &mut Database,
    endings: &[Endings],
    token: TokenId,
    ending: Ending,
) -> Result<bool, Conflict> {
    let Some(at) = database.token(token) else {
        return Ok(false);
    };
    let outputs = match ending {
        Ending::TimedOut => &endings[at.predicate].timed_out,
        Ending::Preempted => &endings[at.predicate].preempted,
    };
    let mut said = false;
    for &(place, value) in outputs {
        let is = database.token(token).map(|at| at.parameters[place]);
        if is.is_some_and(|is| database.value(is).is_none()) {
            database.learn(token, place, &[value])?;
            said = true;
        }
    }
    Ok(said)
}

/// Ends a token at a tick, or when it had to end before, with the status that says how, if none
/// came; whether there was anything to say.
///
/// # Errors
///
/// If it cannot end then, or its status not be that.
pub(super) fn close(
    database: &mut Database,
    endings: &[Endings],
    token: TokenId,
    now: Ticks,
) -> Result<bool, Conflict> {
    let finish = database.finish(token);
    let at = finish.max.min(now);
    let open = finish.min != finish.max;
    // Most often there is nothing to say, or a status said it.
    if database
        .token(token)
        .is_none_or(|of| endings[of.predicate].is_said(database, of))
    {
        if open {
            database.end(token, at)?;
        }
        return Ok(open);
    }
    let timed_out = database
        .longest(token)
        .is_some_and(|longest| database.start(token).min.saturating_add(longest) == at);
    if open {
        database.end(token, at)?;
    }
    let ending = if timed_out {
        Ending::TimedOut
    } else {
        Ending::Preempted
    };
    Ok(say_ending(database, endings, token, ending)? || open)
}

/// Whether a token has ended, and no status is to say how.
pub(super) fn is_closed(database: &Database, endings: &[Endings], token: TokenId) -> bool {
    let finish = database.finish(token);
    let silent = database
        .token(token)
        .is_none_or(|at| endings[at.predicate].is_silent());
    silent && finish.min == finish.max
}

/// Ends the present token of a timeline, if it is not over: the token after which a new one comes.
pub(super) fn make_room(
    database: &mut Database,
    endings: &[Endings],
    timeline: TimelineId,
    now: Ticks,
) -> Result<Option<TokenId>, Conflict> {
    let last = database.last(timeline);
    if let Some(last) = last
        && database.model().timelines[timeline].kind != TimelineKind::Free
    {
        close(database, endings, last, now)?;
    }
    Ok(last)
}
