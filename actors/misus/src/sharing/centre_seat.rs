//! The seat of a centre: what an actor needs to run a [`Centre`], whatever else it does. It gives the machine
//! the kernel's time, its durable memory, its timer and its links.

use std::sync::Arc;

use farside::prelude::*;

use super::post::{MOST_MOVES, Names, SharingDue, post, set_timer};
use crate::shac::{
    Centre, CentreDurable, CentreWrite, GoalKey, Message, Output, Parameters, Reason, Settings,
    SharedGoal,
};

/// What decides for a team, and what it wishes for.
pub trait TeamMind: Send + 'static {
    /// What to do next; nothing if it is content. Asked again after each move, with what the protocol
    /// said of the last one if it was refused.
    fn next(&mut self, now: SimTime, centre: &Centre, refused: Option<&str>) -> Option<TeamMove>;

    /// When it wants to be asked again at the latest.
    fn wake(&self) -> SimTime;
}

/// What a central planner can do; each is the method of [`Centre`] of that name.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs, reason = "the methods of `Centre` say what each does")]
pub enum TeamMove {
    Add(SharedGoal),
    Change(GoalKey, Parameters),
    Withdraw(GoalKey),
    Assign(GoalKey, Vec<u32>),
    Revoke(GoalKey),
    Declare(GoalKey, Reason),
}

/// A centre within an actor of type `A`, which hands it the protocol's messages and its timer.
pub(crate) struct CentreSeat {
    settings: Arc<Settings>,
    site: u32,
    names: Names,
    /// There from the start on.
    centre: Option<Centre>,
    timer: Option<TimerId>,
}

impl CentreSeat {
    pub(crate) fn new(settings: Arc<Settings>, site: u32, names: Names) -> CentreSeat {
        CentreSeat {
            settings,
            site,
            names,
            centre: None,
            timer: None,
        }
    }

    /// The centre; none before the actor has started.
    pub(crate) fn centre(&self) -> Option<&Centre> {
        self.centre.as_ref()
    }

    /// Starts the centre with what is left of an earlier one.
    pub(crate) fn start<A: Actor>(&mut self, ctx: &mut Context<'_, A>) -> Outcome {
        let durable = ctx.durable::<CentreDurable>().clone();
        let (centre, out) = Centre::start(self.settings.clone(), self.site, durable, ctx.now());
        self.centre = Some(centre);
        self.carry_out(out, ctx)
    }

    /// Hands the centre a message.
    pub(crate) fn receive<A: Actor>(
        &mut self,
        message: &Message,
        ctx: &mut Context<'_, A>,
    ) -> Outcome {
        let Some(centre) = &mut self.centre else {
            return Ok(());
        };
        let out = centre.receive(ctx.now(), message);
        self.carry_out(out, ctx)
    }

    /// Tells the centre that time has passed.
    pub(crate) fn tick<A: Actor>(&mut self, ctx: &mut Context<'_, A>) -> Outcome {
        let Some(centre) = &mut self.centre else {
            return Ok(());
        };
        let out = centre.tick(ctx.now());
        self.carry_out(out, ctx)
    }

    /// Asks a mind until it is content, and sets the timer for when it or the centre wants to be asked
    /// again.
    pub(crate) fn think<A: Actor + Handler<SharingDue>>(
        &mut self,
        mind: &mut (impl TeamMind + ?Sized),
        ctx: &mut Context<'_, A>,
    ) -> Outcome {
        let now = ctx.now();
        let mut refused: Option<String> = None;
        for _ in 0..MOST_MOVES {
            let Some(centre) = &mut self.centre else {
                return Ok(());
            };
            let Some(next) = mind.next(now, centre, refused.as_deref()) else {
                let wake = centre.wake(now).min(mind.wake());
                set_timer(ctx, &mut self.timer, wake);
                return Ok(());
            };
            match carry(centre, now, next) {
                Ok(out) => {
                    refused = None;
                    self.carry_out(out, ctx)?;
                }
                Err(error) => refused = Some(error),
            }
        }
        Err(HandlerError::new("a central planner moves without end"))
    }

    /// Writes, then sends.
    fn carry_out<A: Actor>(&self, out: Output<CentreWrite>, ctx: &mut Context<'_, A>) -> Outcome {
        for write in &out.writes {
            ctx.durable::<CentreDurable>().apply(write);
            ctx.sample(write);
        }
        post(ctx, &self.names, out.sends)
    }
}

/// Makes a move.
fn carry(centre: &mut Centre, now: SimTime, next: TeamMove) -> Result<Output<CentreWrite>, String> {
    match next {
        TeamMove::Add(goal) => centre.add(now, goal).map_err(|error| error.to_string()),
        TeamMove::Change(goal, to) => {
            let changed = centre.change(now, goal, &to);
            changed.map_err(|error| error.to_string())
        }
        TeamMove::Withdraw(goal) => centre
            .withdraw(now, goal)
            .map_err(|error| error.to_string()),
        TeamMove::Assign(goal, rovers) => {
            let assigned = centre.assign(now, goal, &rovers);
            assigned.map_err(|error| error.to_string())
        }
        TeamMove::Revoke(goal) => centre.revoke(now, goal).map_err(|error| error.to_string()),
        TeamMove::Declare(goal, reason) => {
            let declared = centre.declare(now, goal, reason);
            declared.map_err(|error| error.to_string())
        }
    }
}
