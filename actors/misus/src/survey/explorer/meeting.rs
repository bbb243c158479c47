//! Goals for two rovers: each waits at the place of its half until it has heard that the other one is there, and
//! that the other one has heard the same of it. Then both begin. Who waits in vain gives its half up, with a reason:
//! no half is begun alone, whoever is lost and whatever links lose before.

use std::collections::BTreeMap;

use farside::prelude::*;

use super::{Explorer, time};
use crate::shac::{GoalKey, Holding, Party, Reason};
use crate::survey::messages::{Activity, HalfReady, ReplanCause};

/// How often a rover that waits says so.
const AGAIN: SimDuration = SimDuration::from_secs(10);

/// How long what was heard of the other rover holds.
const HOLDS: SimDuration = SimDuration::from_secs(60);

/// What was said and heard of meetings, by own half.
#[derive(Default)]
pub(super) struct Meetings {
    said: BTreeMap<GoalKey, SimTime>,
    heard: BTreeMap<GoalKey, Heard>,
}

/// That the other rover is there.
#[derive(Clone, Copy)]
struct Heard {
    at: SimTime,
    /// Whether it knows that this one is there, too.
    is_mutual: bool,
}

/// Whether a rover waits before it begins a goal.
pub(super) enum Wait {
    /// It does not have to.
    No,
    /// Until then, at the least.
    Until(SimTime),
    /// It has waited for too long: the goal is given up.
    Over,
}

impl Explorer {
    /// What is held of a goal for two rovers.
    fn half(&self, goal: GoalKey) -> Option<&Holding> {
        let holding = self.seat.owner()?.durable().held.get(&goal)?;
        holding.goal.partner.is_some().then_some(holding)
    }

    /// Whether the rover has to wait for another one before it begins a goal at whose place it is.
    pub(super) fn wait_for_partner(
        &mut self,
        ctx: &mut Context<'_, Self>,
        goal: GoalKey,
    ) -> Result<Wait, HandlerError> {
        let now = ctx.now();
        if self.half(goal).is_none_or(|half| half.started.is_some()) {
            return Ok(Wait::No);
        }
        let heard = self.meetings.heard.get(&goal).copied();
        let heard = heard.filter(|heard| now <= heard.at + HOLDS);
        if heard.is_some_and(|heard| heard.is_mutual) {
            self.say_ready(ctx, goal, true)?;
            return Ok(Wait::No);
        }
        let own = self.own_goals().into_iter().find(|own| own.key == goal);
        let latest = own.map(|own| time(own.window_ms[1] - own.duration_ms));
        let said = self.meetings.said.get(&goal).copied();
        if latest.is_none_or(|latest| now > latest) {
            self.meetings.heard.remove(&goal);
            let is_for = |activity| super::goals::goal_of(activity) == Some(goal);
            self.log.ahead.retain(|piece| !is_for(piece.activity));
            self.plan_anew(ReplanCause::Failed);
            self.give_up(goal, Reason::Partner, ctx)?;
            return Ok(Wait::Over);
        }
        if said.is_none_or(|said| now >= said + AGAIN) {
            self.say_ready(ctx, goal, heard.is_some())?;
        }
        let said = self.meetings.said.get(&goal).copied();
        Ok(Wait::Until(said.unwrap_or(now) + AGAIN))
    }

    /// Tells the others that this rover is there, if anything may be sent.
    fn say_ready(&mut self, ctx: &mut Context<'_, Self>, goal: GoalKey, heard: bool) -> Outcome {
        let now = ctx.now();
        self.meetings.said.insert(goal, now);
        if !self.shared.settings.windows.is_open(now) {
            return Ok(());
        }
        let ready = HalfReady {
            rover: self.number,
            goal,
            heard,
        };
        let others = (0..self.shared.settings.rovers).filter(|other| *other != self.number);
        for other in others {
            let name = &self.shared.names[&Party::Owner(other)];
            let recipient = ctx.recipient::<HalfReady>(name)?;
            ctx.send(recipient, ready);
        }
        Ok(())
    }
}

impl Handler<HalfReady> for Explorer {
    fn handle(&mut self, ready: HalfReady, ctx: &mut Context<'_, Self>) -> Outcome {
        let now = ctx.now();
        let halves = self.seat.owner().into_iter();
        let mut halves = halves.flat_map(|owner| owner.durable().held.values());
        let own = halves.find(|half| half.goal.partner == Some(ready.goal));
        let Some(own) = own.map(|half| half.goal.key) else {
            return Ok(());
        };
        let heard = Heard {
            at: now,
            is_mutual: ready.heard,
        };
        let before = self.meetings.heard.insert(own, heard);
        let said = self.meetings.said.get(&own).copied();
        let under = self.log.under.as_ref();
        let runs = under.is_some_and(|under| under.piece.activity == Activity::Goal(own));
        // Who is not there yet has nothing to say.
        let is_due = match runs {
            true => said.is_none_or(|said| now >= said + AGAIN),
            false => said.is_some() && before.is_none_or(|before| now > before.at + HOLDS),
        };
        if is_due {
            self.say_ready(ctx, own, true)?;
        }
        self.go_on(ctx)
    }
}
