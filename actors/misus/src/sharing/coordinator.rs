//! The actor of the central planner, on the lander or on a rover.

use std::sync::Arc;

use farside::prelude::*;

use super::centre_seat::{CentreSeat, TeamMind};
use super::post::{Names, SharingDue, receives};
use crate::shac::{
    GoalAck, GoalAssign, GoalCancel, GoalDigest, GoalOutcome, GoalRelease, GoalStatus, Message,
    Settings,
};

/// The actor of the central planner, or of one that may become it.
pub struct Coordinator {
    seat: CentreSeat,
    mind: Box<dyn TeamMind>,
}

impl Coordinator {
    /// The coordinator of a site.
    pub fn new(
        settings: Arc<Settings>,
        site: u32,
        names: Names,
        mind: Box<dyn TeamMind>,
    ) -> Coordinator {
        let seat = CentreSeat::new(settings, site, names);
        Coordinator { seat, mind }
    }

    fn receive(&mut self, message: &Message, ctx: &mut Context<'_, Self>) -> Outcome {
        self.seat.receive(message, ctx)?;
        self.seat.think(&mut *self.mind, ctx)
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
        self.seat.start(ctx)?;
        self.seat.think(&mut *self.mind, ctx)
    }
}

impl Handler<SharingDue> for Coordinator {
    fn handle(&mut self, _: SharingDue, ctx: &mut Context<'_, Self>) -> Outcome {
        self.seat.tick(ctx)?;
        self.seat.think(&mut *self.mind, ctx)
    }
}

receives!(Coordinator: GoalAssign as Assign, GoalAck as Ack, GoalStatus as Status,
    GoalRelease as Release, GoalCancel as Cancel, GoalOutcome as Outcome, GoalDigest as Digest);
