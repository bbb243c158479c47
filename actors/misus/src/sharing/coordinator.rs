//! The actor of the central planner, on the lander or on a rover.

use std::sync::Arc;

use farside::prelude::*;

use super::post::{MOST_MOVES, Names, SharingDue, post, receives, set_timer};
use crate::shac::{
    Centre, CentreDurable, CentreWrite, GoalAck, GoalAssign, GoalCancel, GoalDigest, GoalKey,
    GoalOutcome, GoalRelease, GoalStatus, Message, Output, Parameters, Reason, Settings,
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

/// The actor of the central planner, or of one that may become it.
pub struct Coordinator {
    settings: Arc<Settings>,
    site: u32,
    names: Names,
    mind: Box<dyn TeamMind>,
    /// There from the start on.
    centre: Option<Centre>,
    timer: Option<TimerId>,
}

impl Coordinator {
    /// The coordinator of a site.
    pub fn new(
        settings: Arc<Settings>,
        site: u32,
        names: Names,
        mind: Box<dyn TeamMind>,
    ) -> Coordinator {
        Coordinator {
            settings,
            site,
            names,
            mind,
            centre: None,
            timer: None,
        }
    }

    fn receive(&mut self, message: &Message, ctx: &mut Context<'_, Self>) -> Outcome {
        if let Some(centre) = &mut self.centre {
            let out = centre.receive(ctx.now(), message);
            self.carry_out(out, ctx)?;
        }
        self.think(ctx)
    }

    /// Writes, then sends.
    fn carry_out(&self, out: Output<CentreWrite>, ctx: &mut Context<'_, Self>) -> Outcome {
        for write in &out.writes {
            ctx.durable::<CentreDurable>().apply(write);
            ctx.sample(write);
        }
        post(ctx, &self.names, out.sends)
    }

    /// Asks the mind until it is content.
    fn think(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        let now = ctx.now();
        let mut refused: Option<String> = None;
        for _ in 0..MOST_MOVES {
            let Some(centre) = &mut self.centre else {
                return Ok(());
            };
            let Some(next) = self.mind.next(now, centre, refused.as_deref()) else {
                let wake = centre.wake(now).min(self.mind.wake());
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

impl Actor for Coordinator {
    type Accepts = (
        GoalAssign,
        GoalAck,
        GoalStatus,
        GoalRelease,
        GoalCancel,
        GoalOutcome,
        GoalDigest,
        SharingDue,
    );

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        let durable = ctx.durable::<CentreDurable>().clone();
        let (centre, out) = Centre::start(self.settings.clone(), self.site, durable, ctx.now());
        self.centre = Some(centre);
        self.carry_out(out, ctx)?;
        self.think(ctx)
    }
}

impl Handler<SharingDue> for Coordinator {
    fn handle(&mut self, _: SharingDue, ctx: &mut Context<'_, Self>) -> Outcome {
        if let Some(centre) = &mut self.centre {
            let out = centre.tick(ctx.now());
            self.carry_out(out, ctx)?;
        }
        self.think(ctx)
    }
}

receives!(Coordinator: GoalAssign as Assign, GoalAck as Ack, GoalStatus as Status,
    GoalRelease as Release, GoalCancel as Cancel, GoalOutcome as Outcome, GoalDigest as Digest);
