//! The actor of the centre, or of one that may become it: the centre's seat, and what it decides.

use std::sync::Arc;

use farside::prelude::*;
use farside_actors::processor::{Processor, ProcessorChange};

use super::assigning::TeamPlanner;
use super::messages::{GoalList, GoalListHeld, GoalsAchieved, OfficeHeld};
use super::shared::Shared;
use crate::shac::{
    GoalAck, GoalAssign, GoalCancel, GoalDigest, GoalOutcome, GoalRelease, GoalStatus, Message,
    Party,
};
use crate::sharing::{CentreSeat, SharingDue, receives};

/// The centre of a site.
pub(super) struct SurveyCentre {
    shared: Arc<Shared>,
    site: u32,
    seat: CentreSeat,
    mind: TeamPlanner,
    /// How many goals the scientist was told to be achieved.
    told: usize,
    /// What the scientist was told of who is the centre, with elections.
    told_office: Option<bool>,
}

/// What it keeps through crashes, besides what the protocol keeps.
#[derive(Default)]
struct Kept(GoalList);

impl SurveyCentre {
    pub(super) fn new(shared: Arc<Shared>, site: u32, processor: Processor) -> SurveyCentre {
        let (settings, names) = (shared.settings.clone(), shared.names.clone());
        SurveyCentre {
            seat: CentreSeat::new(settings, site, names),
            mind: TeamPlanner::new(shared.clone(), processor),
            shared,
            site,
            told: 0,
            told_office: None,
        }
    }

    fn receive(&mut self, message: &Message, ctx: &mut Context<'_, Self>) -> Outcome {
        self.seat.receive(message, ctx)?;
        self.think(ctx)
    }

    fn think(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        self.seat.think(&mut self.mind, ctx)?;
        let told = self.mind.told();
        if let Some(shared) = told.map_err(|fault| HandlerError::new(fault.to_string()))? {
            ctx.sample(&shared);
        }
        self.tell_scientist(ctx)
    }

    fn tell_scientist(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        let Some(centre) = self.seat.centre() else {
            return Ok(());
        };
        let goals = centre.durable().outcomes.goals_achieved();
        if goals.len() > self.told {
            self.told = goals.len();
            let scientist = self.shared.lead_at(self.site);
            let scientist = ctx.recipient::<GoalsAchieved>(scientist)?;
            ctx.send(scientist, GoalsAchieved { goals });
        }
        let holds = centre.is_in_office(ctx.now());
        if self.shared.settings.election.is_some() && self.told_office != Some(holds) {
            self.told_office = Some(holds);
            let scientist = self.shared.lead_at(self.site);
            let scientist = ctx.recipient::<OfficeHeld>(scientist)?;
            let list = self.mind.list().clone();
            ctx.send(scientist, OfficeHeld { holds, list });
        }
        Ok(())
    }
}

impl Actor for SurveyCentre {
    type Accepts = (
        GoalAssign,
        GoalAck,
        GoalStatus,
        GoalRelease,
        GoalCancel,
        GoalOutcome,
        GoalDigest,
        GoalList,
        SharingDue,
        ProcessorChange,
    );

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        self.mind.take(ctx.durable::<Kept>().0.clone());
        self.seat.start(ctx)?;
        self.think(ctx)
    }
}

impl Handler<GoalList> for SurveyCentre {
    fn handle(&mut self, list: GoalList, ctx: &mut Context<'_, Self>) -> Outcome {
        let author = self.shared.author_of(list.edition).to_owned();
        self.mind.take(list);
        let edition = self.mind.list().edition;
        if ctx.durable::<Kept>().0.edition < edition {
            ctx.durable::<Kept>().0 = self.mind.list().clone();
        }
        let from = Party::Centre(self.site);
        let is_open = self.shared.settings.windows.is_open(ctx.now());
        if is_open || author == self.shared.lead_at(self.site) {
            let scientist = ctx.recipient::<GoalListHeld>(&author)?;
            ctx.send(scientist, GoalListHeld { from, edition });
        }
        self.think(ctx)
    }
}

impl Handler<SharingDue> for SurveyCentre {
    fn handle(&mut self, _: SharingDue, ctx: &mut Context<'_, Self>) -> Outcome {
        self.seat.tick(ctx)?;
        self.think(ctx)
    }
}

impl Handler<ProcessorChange> for SurveyCentre {
    fn handle(&mut self, _: ProcessorChange, _: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

receives!(SurveyCentre: GoalAssign as Assign, GoalAck as Ack, GoalStatus as Status,
    GoalRelease as Release, GoalCancel as Cancel, GoalOutcome as Outcome, GoalDigest as Digest);
