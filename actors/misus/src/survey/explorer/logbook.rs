//! What a rover's planner remembers through a crash: its plan, what it has begun, what it has tried, and which
//! list of goals it knows.

use std::collections::{BTreeMap, BTreeSet};

use farside::SimTime;

use super::conduct::{Drive, Look};
use crate::shac::{GoalKey, Reason};
use crate::survey::messages::{ActivityEnd, GoalList};
use crate::survey::outlook::{Piece, Plan};

/// What a rover's planner remembers through a crash.
#[derive(Clone, Debug, Default)]
pub(super) struct Logbook {
    /// How many commands it has given.
    pub(super) commands: u32,
    /// How many plans it has made.
    pub(super) plans: u32,
    /// The plan in force.
    pub(super) plan: Option<Plan>,
    /// What of it has not begun, in order.
    pub(super) ahead: Vec<Piece>,
    /// What runs.
    pub(super) under: Option<Under>,
    /// What has ended and is told once the hardware has said how it is.
    pub(super) ended: Vec<(Under, ActivityEnd)>,
    /// The list of goals with the highest edition.
    pub(super) list: GoalList,
    /// How often goals have failed since they were taken, and when they may be tried again \[ms\].
    pub(super) tried: BTreeMap<GoalKey, (u32, i64)>,
    /// How many plans in a row have left goals out.
    pub(super) left_out: BTreeMap<GoalKey, u32>,
    /// Goals that it has given up, with the reason, and in which sol.
    pub(super) given_up: BTreeMap<GoalKey, (Reason, u32)>,
    /// The sols whose communication is done, or given up.
    pub(super) communicated: BTreeSet<u32>,
    /// How often the present sol's communication has failed.
    pub(super) communication_tries: u32,
    /// The share of rocks for which it has to look round once it is there, as of late.
    pub(super) searches: Option<f64>,
    /// The sol that it last planned in.
    pub(super) sol: u32,
}

/// An activity that runs.
#[derive(Clone, Debug)]
pub(super) struct Under {
    /// As it was planned.
    pub(super) piece: Piece,
    /// In which plan.
    pub(super) plan: u32,
    pub(super) began: SimTime,
    /// When it is expected to have ended \[ms\].
    pub(super) expected_ms: i64,
    pub(super) conduct: Conduct,
    /// The number of the command that runs for it.
    pub(super) command: u32,
}

/// How an activity is carried out.
#[derive(Clone, Debug)]
pub(super) enum Conduct {
    Drive(Drive),
    Look(Look),
    /// By one command, whose end is its end.
    Single,
}
