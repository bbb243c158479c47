//! What goals, grants, terms and participants are called.

use farside::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};

use super::definition::Parameter;
use crate::analysis::goals::GoalId;

/// The name of a shared goal: an observation that the data analysis wishes for, or a number of a
/// problem that was generated.
///
/// ```
/// use farside_misus::analysis::goals::{GoalId, Observation, Target};
/// use farside_misus::shac::GoalKey;
/// let id = GoalId { target: Target::Rock(4), observation: Observation::PointImage };
/// assert_eq!(GoalKey::from(id), GoalKey::Observation(id));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum GoalKey {
    /// A goal of a generated problem.
    Numbered(u32),
    /// A goal of the closed loop.
    Observation(GoalId),
}

impl From<GoalId> for GoalKey {
    fn from(id: GoalId) -> GoalKey {
        GoalKey::Observation(id)
    }
}

/// Who takes part in the protocol. A rover on which a centre may run has both.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Party {
    /// The owner on the rover of this number.
    Owner(u32),
    /// The centre, or one that may become it, at the site of this number.
    Centre(u32),
}

/// The time of office of one centre. Ordered by number, then by site, so that no two centres share
/// one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Term {
    /// From 1; 0 is before the first.
    pub number: u32,
    /// The site of its centre.
    pub centre: u32,
}

/// Names one handing out of a goal. For one goal, later ones are larger.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Grant {
    /// The term in which it was given.
    pub term: Term,
    /// Counts the grants of the goal, from 1; 0 is before the first.
    pub epoch: u32,
}

/// Which edition of a goal's parameters. Ordered by number, then by site.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Revision {
    /// From 1.
    pub number: u32,
    /// The site of the centre that made it.
    pub site: u32,
}

/// Which status of a rover. The incarnation rises at each restart, the sequence at each change.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Version {
    /// How often the owner was started, from 1.
    pub incarnation: u32,
    /// How often its status changed.
    pub sequence: u32,
}

/// The parameters of a shared activity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parameters {
    /// Where it takes place, east and north \[m\].
    pub target_m: [f64; 2],
    /// How long it takes at most.
    pub duration: SimDuration,
    /// The earliest start.
    pub start: SimTime,
    /// What it stores \[bit\].
    pub memory_bits: f64,
    /// When it is planned to start, once somebody has planned it.
    pub scheduled: Option<SimTime>,
    /// What it is worth by itself. It may be negative.
    pub weight: f64,
}

impl Parameters {
    /// Sets one parameter to what it is in others.
    pub(super) fn take(&mut self, parameter: Parameter, from: &Parameters) {
        match parameter {
            Parameter::Target => self.target_m = from.target_m,
            Parameter::Duration => self.duration = from.duration,
            Parameter::Start => self.start = from.start,
            Parameter::Memory => self.memory_bits = from.memory_bits,
            Parameter::Scheduled => self.scheduled = from.scheduled,
            Parameter::Weight => self.weight = from.weight,
        }
    }
}

/// A goal that is shared: what a rover is asked to do.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SharedGoal {
    /// Its name.
    pub key: GoalKey,
    /// The other half, if two rovers have to do it together.
    pub partner: Option<GoalKey>,
    /// What there is to know of it.
    pub parameters: Parameters,
}

impl SharedGoal {
    /// A goal for one rover at a place, of weight 1, without memory, whenever it suits.
    pub fn new(key: GoalKey, target_m: [f64; 2], duration: SimDuration) -> SharedGoal {
        SharedGoal {
            key,
            partner: None,
            parameters: Parameters {
                target_m,
                duration,
                start: SimTime::ZERO,
                memory_bits: 0.0,
                scheduled: None,
                weight: 1.0,
            },
        }
    }
}

/// A goal as it is wished for, or no longer. Of two editions the larger revision holds, whoever
/// made it in whichever term, so that a withdrawn goal is not brought back by old news.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Wish {
    /// The goal.
    pub goal: SharedGoal,
    /// Which edition.
    pub revision: Revision,
    /// Whether it is no longer wished for.
    pub withdrawn: bool,
}

/// Why a goal is refused, released, given up or declared unachievable.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Reason {
    /// No time is left for it.
    Time,
    /// It takes more power or energy than there is.
    Power,
    /// It takes more memory than there is.
    Memory,
    /// Its target cannot be reached.
    Path,
    /// It is worth less than what it would displace, or less than nothing.
    Worth,
    /// The hardware failed.
    Hardware,
    /// Its lease ended.
    LeaseEnded,
    /// Another rover has achieved it.
    Achieved,
    /// It is no longer wished for.
    Withdrawn,
    /// All rovers refused it, as often as the protocol allows.
    RefusedByAll,
    /// The centre took it back.
    Revoked,
    /// The central planner declared it unachievable.
    Declared,
    /// The rover that was to do the other half did not come.
    Partner,
}
