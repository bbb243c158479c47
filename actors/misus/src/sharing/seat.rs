//! The seat of an owner: what an actor needs to run an [`Owner`], whatever else it does. It gives the
//! machine the kernel's time, its durable memory, its timer and its links.

use std::sync::Arc;

use farside::prelude::*;

use super::post::{MOST_MOVES, Names, SharingDue, post, set_timer};
use crate::shac::{
    GoalKey, Message, Output, Owner, OwnerDurable, OwnerError, OwnerWrite, Parameter, Parameters,
    Reason, Settings,
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

/// An owner within an actor of type `A`, which hands it the protocol's messages and its timer.
pub(crate) struct OwnerSeat {
    settings: Arc<Settings>,
    rover: u32,
    names: Names,
    /// There from the start on.
    owner: Option<Owner>,
    timer: Option<TimerId>,
}

impl OwnerSeat {
    pub(crate) fn new(settings: Arc<Settings>, rover: u32, names: Names) -> OwnerSeat {
        OwnerSeat {
            settings,
            rover,
            names,
            owner: None,
            timer: None,
        }
    }

    /// The owner; none before the actor has started.
    pub(crate) fn owner(&self) -> Option<&Owner> {
        self.owner.as_ref()
    }

    /// Starts the owner with what is left of an earlier one.
    pub(crate) fn start<A: Actor>(&mut self, ctx: &mut Context<'_, A>) -> Outcome {
        let durable = ctx.durable::<OwnerDurable>().clone();
        let (owner, out) = Owner::start(self.settings.clone(), self.rover, durable, ctx.now());
        self.owner = Some(owner);
        self.carry_out(out, ctx)
    }

    /// Hands the owner a message.
    pub(crate) fn receive<A: Actor>(
        &mut self,
        message: &Message,
        ctx: &mut Context<'_, A>,
    ) -> Outcome {
        let Some(owner) = &mut self.owner else {
            return Ok(());
        };
        let out = owner.receive(ctx.now(), message);
        self.carry_out(out, ctx)
    }

    /// Tells the owner that time has passed.
    pub(crate) fn tick<A: Actor>(&mut self, ctx: &mut Context<'_, A>) -> Outcome {
        let Some(owner) = &mut self.owner else {
            return Ok(());
        };
        let out = owner.tick(ctx.now());
        self.carry_out(out, ctx)
    }

    /// Makes a move. What the protocol does not allow changes nothing, and is handed back.
    pub(crate) fn decide<A: Actor>(
        &mut self,
        next: RoverMove,
        ctx: &mut Context<'_, A>,
    ) -> Result<Result<(), OwnerError>, HandlerError> {
        let Some(owner) = &mut self.owner else {
            return Err(HandlerError::new("an owner is asked before it has started"));
        };
        match carry(owner, ctx.now(), next) {
            Ok(out) => self.carry_out(out, ctx).map(Ok),
            Err(error) => Ok(Err(error)),
        }
    }

    /// Asks a mind until it is content, and sets the timer for when it or the owner wants to be asked
    /// again.
    pub(crate) fn think<A: Actor + Handler<SharingDue>>(
        &mut self,
        mind: &mut (impl RoverMind + ?Sized),
        ctx: &mut Context<'_, A>,
    ) -> Outcome {
        let now = ctx.now();
        let mut refused = None;
        for _ in 0..MOST_MOVES {
            let Some(owner) = &self.owner else {
                return Ok(());
            };
            let Some(next) = mind.next(now, owner, refused.as_ref()) else {
                let wake = owner.wake(now).min(mind.wake());
                set_timer(ctx, &mut self.timer, wake);
                return Ok(());
            };
            refused = self.decide(next, ctx)?.err();
        }
        Err(HandlerError::new("a rover's planner moves without end"))
    }

    /// Writes, then sends.
    fn carry_out<A: Actor>(&self, out: Output<OwnerWrite>, ctx: &mut Context<'_, A>) -> Outcome {
        for write in &out.writes {
            ctx.durable::<OwnerDurable>().apply(write);
            ctx.sample(write);
        }
        post(ctx, &self.names, out.sends)
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
