//! The planner of a rover as an actor: it owns goals, plans them, carries the plan out as commands to the
//! hardware, and plans anew when the world turns out otherwise (sections 3.1 and 4.2 of the paper).
//!
//! The plan in force goes on while the next one is being made, which takes as long as its operations take on
//! the host's processor. What runs and what is about to begin is the first of each new plan. If something else
//! has begun, or something has failed, before the new plan is ready, it is stale, and made anew.
//!
//! Each handler ends with [`Explorer::go_on`]: what is due begins, and if there is a reason to plan anew, the
//! hardware is asked how it is; the answer begins the planning.

mod conduct;
mod ending;
mod execution;
mod goals;
mod logbook;
mod meeting;
mod replanning;
mod updates;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use farside::prelude::*;
use farside_actors::processor::{Processor, ProcessorChange};
use farside_actors::rover::{
    Command, CommandReport, RoverCommand, RoverHardware, RoverQuery, RoverState, hardware_name,
};
use serde::{Deserialize, Serialize};

use super::messages::{GoalList, GoalListHeld, HalfReady, PlannedActivity, ReplanCause};
use super::outlook::{Forecast, Known, Means, Outlook, Piece, Plan};
use super::shared::Shared;
use crate::shac::{
    GoalAck, GoalAssign, GoalCancel, GoalDigest, GoalOutcome, GoalRelease, GoalStatus, Message,
    Party, Reason,
};
use crate::sharing::{OwnerSeat, SharingDue, receives};
use goals::Desk;
use logbook::Logbook;
use meeting::Meetings;

/// A timer: the plan that was begun with is ready.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct PlanReady {
    /// Its number.
    pub(crate) number: u32,
}

/// A timer: the next plan may be begun.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct PlanDue;

/// A timer: the next activity is due.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct ActivityDue;

/// A timer: an activity should have ended.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct EndDue {
    /// Of the command of this number.
    pub(crate) command: u32,
}

/// A timer: the hardware is asked how it is.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct UpdateDue;

/// The planner of a rover.
pub(crate) struct Explorer {
    shared: Arc<Shared>,
    number: u32,
    processor: Processor,
    seat: OwnerSeat,
    desk: Desk,
    outlook: Outlook,
    log: Logbook,
    /// What the hardware said last, and when.
    state: Option<(SimTime, RoverState)>,
    /// Whether it is being asked.
    is_asking: bool,
    /// Whether what the log says runs may be waited for: it is asked after a restart.
    is_restarted: bool,
    /// Why it has to plan anew, if it has.
    cause: Option<ReplanCause>,
    /// The plan that the processor has in hand.
    in_hand: Option<InHand>,
    /// The timer for what is due next, and when that is.
    due: Option<(SimTime, TimerId)>,
    /// The place of the observation that the rover has driven to \[m\].
    there_m: Option<[f64; 2]>,
    /// Where rocks were seen from where the rover stands now \[m\].
    seen_m: BTreeMap<u32, [f64; 2]>,
    /// Rocks that were looked round for in vain from where the rover stands now.
    unseen: BTreeSet<u32>,
    /// The share of its power that the array yields.
    clean: f64,
    /// What memory could hold when it was last looked at \[bit\].
    memory_size_bits: Option<i64>,
    /// Whether there may be room for more goals than when the last plan was made.
    has_gained: bool,
    /// When the last plan was begun.
    planned: SimTime,
    /// How long it took to be made \[ms\].
    took_ms: i64,
    /// What was looked at for bids since the last plan.
    bid_operations: u64,
    /// Whether the next plan waits until it may be begun.
    is_waiting: bool,
    /// Why what runs is broken off.
    broken_off: Option<Reason>,
    /// Who waits for whom at goals for two rovers.
    meetings: Meetings,
}

/// A plan that is being made.
struct InHand {
    plan: Plan,
    cause: ReplanCause,
    number: u32,
    /// The edition of the list that it is for.
    edition: u64,
    known: Known,
    /// Whether something has happened that it does not reckon with.
    is_stale: bool,
}

impl Explorer {
    /// The planner of the rover of this number.
    pub(crate) fn new(shared: Arc<Shared>, number: u32, processor: Processor) -> Explorer {
        let site = &shared.site;
        let forecast = Forecast::new(
            site.sky,
            site.starts_s,
            &shared.rover,
            site.config.sun_least_rad,
            shared.execution.sun_share,
        );
        let means = Means::new(
            &shared.rover,
            &shared.execution,
            site.config.reserve,
            site.side_m,
            site.catalogue.iter().map(|rock| rock.diameter_m),
        )
        .with_objective(shared.objective.clone());
        let key = shared.key.text("explorer").number(u64::from(number));
        let (planner, mode) = (shared.planner.clone(), shared.execution.mode);
        Explorer {
            seat: OwnerSeat::new(shared.settings.clone(), number, shared.names.clone()),
            desk: Desk::new(shared.clone()),
            outlook: Outlook::new(means, forecast, planner, mode, key),
            log: Logbook::default(),
            state: None,
            is_asking: false,
            is_restarted: false,
            cause: None,
            in_hand: None,
            due: None,
            there_m: None,
            seen_m: BTreeMap::new(),
            unseen: BTreeSet::new(),
            clean: 1.0,
            memory_size_bits: None,
            has_gained: false,
            planned: SimTime::ZERO,
            took_ms: 0,
            bid_operations: 0,
            is_waiting: false,
            broken_off: None,
            meetings: Meetings::default(),
            shared,
            number,
            processor,
        }
    }

    fn now_ms(ctx: &Context<'_, Self>) -> i64 {
        millis(ctx.now())
    }

    fn hardware(&self, ctx: &Context<'_, Self>) -> Result<Address<RoverHardware>, HandlerError> {
        let rover = &self.shared.site.rovers[self.number as usize];
        Ok(ctx.lookup::<RoverHardware>(&hardware_name(rover))?)
    }

    /// Gives the hardware a command. Returns its number.
    fn command(
        &mut self,
        ctx: &mut Context<'_, Self>,
        command: Command,
    ) -> Result<u32, HandlerError> {
        let hardware = self.hardware(ctx)?;
        self.log.commands += 1;
        let id = self.log.commands;
        ctx.send(hardware, RoverCommand { id, command });
        Ok(id)
    }

    /// Asks the hardware how it is.
    fn ask(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        if !std::mem::replace(&mut self.is_asking, true) {
            let hardware = self.hardware(ctx)?;
            ctx.send(hardware, RoverQuery { id: 0 });
        }
        Ok(())
    }

    /// There is a reason to plan anew. Of several the first is named.
    fn plan_anew(&mut self, cause: ReplanCause) {
        self.cause.get_or_insert(cause);
    }

    /// What each handler ends with.
    fn go_on(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        self.begin_what_is_due(ctx)?;
        if self.cause.is_some() && self.in_hand.is_none() && !self.is_asking {
            match self.state.clone() {
                Some((at, state)) if at == ctx.now() => self.plan_now(ctx, &state)?,
                _ => self.ask(ctx)?,
            }
        }
        ctx.durable::<Logbook>().clone_from(&self.log);
        Ok(())
    }

    fn receive(&mut self, message: &Message, ctx: &mut Context<'_, Self>) -> Outcome {
        self.seat.receive(message, ctx)?;
        self.settle_goals(ctx)
    }
}

/// A time as whole milliseconds.
fn millis(at: SimTime) -> i64 {
    (at.as_nanos() / 1_000_000).min(i64::MAX as u64) as i64
}

/// Whole milliseconds as a time.
fn time(at_ms: i64) -> SimTime {
    SimTime::from_nanos((at_ms.max(0) as u64).saturating_mul(1_000_000))
}

/// A piece as it is told.
fn planned(piece: &Piece) -> PlannedActivity {
    PlannedActivity {
        activity: piece.activity,
        position_m: piece.position_m,
        starts: time(piece.starts_ms),
        ends: time(piece.ends_ms),
        battery_j: piece.battery_j,
        memory_bits: piece.memory_bits,
    }
}

/// Bytes as bits.
fn bits(bytes: u64) -> i64 {
    i64::try_from(bytes)
        .unwrap_or(i64::MAX / 8)
        .saturating_mul(8)
}

impl Actor for Explorer {
    type Accepts = (
        GoalAssign,
        GoalAck,
        GoalStatus,
        GoalRelease,
        GoalCancel,
        GoalOutcome,
        GoalDigest,
        SharingDue,
        GoalList,
        HalfReady,
        CommandReport,
        RoverState,
        PlanReady,
        PlanDue,
        ActivityDue,
        EndDue,
        UpdateDue,
        ProcessorChange,
    );

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        self.log.clone_from(ctx.durable::<Logbook>());
        self.desk.read(&self.log.list);
        self.is_restarted = ctx.incarnation() > 0;
        self.seat.start(ctx)?;
        self.plan_anew(ReplanCause::Started);
        self.ask(ctx)?;
        self.update_later(ctx);
        self.settle_goals(ctx)
    }
}

impl Handler<GoalList> for Explorer {
    fn handle(&mut self, list: GoalList, ctx: &mut Context<'_, Self>) -> Outcome {
        let author = self.shared.author_of(list.edition).to_owned();
        if list.edition > self.log.list.edition {
            self.desk.read(&list);
            self.log.list = list;
            self.plan_anew(ReplanCause::Worth);
        }
        let held = GoalListHeld {
            from: Party::Owner(self.number),
            edition: self.log.list.edition,
        };
        let science = ctx.recipient::<GoalListHeld>(&author)?;
        ctx.send(science, held);
        self.settle_goals(ctx)
    }
}

impl Handler<SharingDue> for Explorer {
    fn handle(&mut self, _: SharingDue, ctx: &mut Context<'_, Self>) -> Outcome {
        self.seat.tick(ctx)?;
        self.settle_goals(ctx)
    }
}

impl Handler<ProcessorChange> for Explorer {
    fn handle(&mut self, _: ProcessorChange, _: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

receives!(Explorer: GoalAssign as Assign, GoalAck as Ack, GoalStatus as Status,
    GoalRelease as Release, GoalCancel as Cancel, GoalOutcome as Outcome, GoalDigest as Digest);
