//! The actor on each rover.

use std::sync::Arc;

use farside::prelude::*;

use super::post::{MOST_MOVES, Names, SharingDue, post, receives, set_timer};
use crate::shac::{
    GoalAck, GoalAssign, GoalCancel, GoalDigest, GoalKey, GoalOutcome, GoalRelease, GoalStatus,
    Message, Output, Owner, OwnerDurable, OwnerError, OwnerWrite, Parameter, Parameters, Reason,
    Settings,
};

/// What decides for a rover.
pub trait RoverMind: Send + 'static {
    /// What to do next, given what the rover is offered and holds; nothing if it is content. Asked
    /// again after each move, with what the protocol said of the last one if it was refused.
    fn next(
        &mut self,
        now: SimTime,
        owner: &Owner,
        refused: Option<&OwnerError>,
    ) -> Option<RoverMove>;

    /// When it wants to be asked again at the latest.
    fn wake(&self) -> SimTime;
}

/// What a rover's planner can do; each is the method of [`Owner`] of that name.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs, reason = "the methods of `Owner` say what each does")]
pub enum RoverMove {
    Accept(GoalKey),
    Refuse(GoalKey, Reason),
    Bid(GoalKey, Option<f64>),
    Release(GoalKey, Reason),
    Begin(GoalKey),
    Done(GoalKey),
    Failed(GoalKey, Reason),
    Set(GoalKey, Parameter, Parameters),
    CapacityChanged,
}

/// The actor on a rover that owns goals.
pub struct Pursuer {
    settings: Arc<Settings>,
    rover: u32,
    names: Names,
    mind: Box<dyn RoverMind>,
    /// There from the start on.
    owner: Option<Owner>,
    timer: Option<TimerId>,
}

impl Pursuer {
    /// The pursuer of the rover of this number.
    pub fn new(
        settings: Arc<Settings>,
        rover: u32,
        names: Names,
        mind: Box<dyn RoverMind>,
    ) -> Pursuer {
        Pursuer {
            settings,
            rover,
            names,
            mind,
            owner: None,
            timer: None,
        }
    }

    fn receive(&mut self, message: &Message, ctx: &mut Context<'_, Self>) -> Outcome {
        if let Some(owner) = &mut self.owner {
            let out = owner.receive(ctx.now(), message);
            self.carry_out(out, ctx)?;
        }
        self.think(ctx)
    }

    /// Writes, then sends.
    fn carry_out(&self, out: Output<OwnerWrite>, ctx: &mut Context<'_, Self>) -> Outcome {
        for write in &out.writes {
            ctx.durable::<OwnerDurable>().apply(write);
            ctx.sample(write);
        }
        post(ctx, &self.names, out.sends)
    }

    /// Asks the mind until it is content.
    fn think(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        let now = ctx.now();
        let mut refused = None;
        for _ in 0..MOST_MOVES {
            let Some(owner) = &mut self.owner else {
                return Ok(());
            };
            let Some(next) = self.mind.next(now, owner, refused.as_ref()) else {
                let wake = owner.wake(now).min(self.mind.wake());
                set_timer(ctx, &mut self.timer, wake);
                return Ok(());
            };
            match carry(owner, now, next) {
                Ok(out) => {
                    refused = None;
                    self.carry_out(out, ctx)?;
                }
                Err(error) => refused = Some(error),
            }
        }
        Err(HandlerError::new("a rover's planner moves without end"))
    }
}

/// Makes a move.
fn carry(
    owner: &mut Owner,
    now: SimTime,
    next: RoverMove,
) -> Result<Output<OwnerWrite>, OwnerError> {
    match next {
        RoverMove::Accept(goal) => owner.accept(now, goal),
        RoverMove::Refuse(goal, reason) => owner.refuse(now, goal, reason),
        RoverMove::Bid(goal, score) => owner.bid(now, goal, score),
        RoverMove::Release(goal, reason) => owner.release(now, goal, reason),
        RoverMove::Begin(goal) => owner.begin(now, goal),
        RoverMove::Done(goal) => owner.done(now, goal),
        RoverMove::Failed(goal, reason) => owner.failed(now, goal, reason),
        RoverMove::Set(goal, parameter, to) => owner.set(now, goal, parameter, &to),
        RoverMove::CapacityChanged => Ok(owner.capacity_changed(now)),
    }
}

impl Actor for Pursuer {
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
        let durable = ctx.durable::<OwnerDurable>().clone();
        let (owner, out) = Owner::start(self.settings.clone(), self.rover, durable, ctx.now());
        self.owner = Some(owner);
        self.carry_out(out, ctx)?;
        self.think(ctx)
    }
}

impl Handler<SharingDue> for Pursuer {
    fn handle(&mut self, _: SharingDue, ctx: &mut Context<'_, Self>) -> Outcome {
        if let Some(owner) = &mut self.owner {
            let out = owner.tick(ctx.now());
            self.carry_out(out, ctx)?;
        }
        self.think(ctx)
    }
}

receives!(Pursuer: GoalAssign as Assign, GoalAck as Ack, GoalStatus as Status,
    GoalRelease as Release, GoalCancel as Cancel, GoalOutcome as Outcome, GoalDigest as Digest);
