//! The actor on a rover whose mind needs to know nothing but what it is offered and holds.

use std::sync::Arc;

use farside::prelude::*;

use super::post::{Names, SharingDue, receives};
use super::seat::{OwnerSeat, RoverMind};
use crate::shac::{
    GoalAck, GoalAssign, GoalCancel, GoalDigest, GoalOutcome, GoalRelease, GoalStatus, Message,
    Settings,
};

/// The actor on a rover that owns goals.
pub struct Pursuer {
    seat: OwnerSeat,
    mind: Box<dyn RoverMind>,
}

impl Pursuer {
    /// The pursuer of the rover of this number.
    pub fn new(
        settings: Arc<Settings>,
        rover: u32,
        names: Names,
        mind: Box<dyn RoverMind>,
    ) -> Pursuer {
        let seat = OwnerSeat::new(settings, rover, names);
        Pursuer { seat, mind }
    }

    fn receive(&mut self, message: &Message, ctx: &mut Context<'_, Self>) -> Outcome {
        self.seat.receive(message, ctx)?;
        self.seat.think(&mut *self.mind, ctx)
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
        self.seat.start(ctx)?;
        self.seat.think(&mut *self.mind, ctx)
    }
}

impl Handler<SharingDue> for Pursuer {
    fn handle(&mut self, _: SharingDue, ctx: &mut Context<'_, Self>) -> Outcome {
        self.seat.tick(ctx)?;
        self.seat.think(&mut *self.mind, ctx)
    }
}

receives!(Pursuer: GoalAssign as Assign, GoalAck as Ack, GoalStatus as Status,
    GoalRelease as Release, GoalCancel as Cancel, GoalOutcome as Outcome, GoalDigest as Digest);
