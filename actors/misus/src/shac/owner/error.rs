//! What the protocol does not let a rover's planner do.

use farside::SimTime;
use thiserror::Error;

use crate::shac::definition::{Parameter, Stage};
use crate::shac::values::GoalKey;

/// What the protocol does not let a planner do.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum OwnerError {
    /// The rover is not offered the goal, or no longer.
    #[error("goal {goal:?} is not offered at {now}")]
    NotOffered {
        /// Which.
        goal: GoalKey,
        /// When.
        now: SimTime,
    },
    /// The rover does not hold the goal.
    #[error("goal {goal:?} is not held")]
    NotHeld {
        /// Which.
        goal: GoalKey,
    },
    /// What was asked for is possible only before the start, or only after it.
    #[error("goal {goal:?} is {}: expected the opposite", started_or_not(*.started))]
    Started {
        /// Which.
        goal: GoalKey,
        /// Whether it has started.
        started: bool,
    },
    /// The rover is bound to its half of a joint goal.
    #[error("goal {goal:?} is half of a joint goal, which is held until its lease ends")]
    Bound {
        /// Which.
        goal: GoalKey,
    },
    /// Nobody is known to be bound to the other half of a joint goal.
    #[error("the other half of goal {goal:?} is not known to be held")]
    Unconfirmed {
        /// Which.
        goal: GoalKey,
    },
    /// The activity would end after its lease.
    #[error("goal {goal:?} would end at {ends}, its lease ends at {lease_end}")]
    LeaseTooShort {
        /// Which.
        goal: GoalKey,
        /// When the activity would end.
        ends: SimTime,
        /// When its lease does.
        lease_end: SimTime,
    },
    /// Another rover has achieved the goal.
    #[error("goal {goal:?} is achieved")]
    Achieved {
        /// Which.
        goal: GoalKey,
    },
    /// An owner may not set this parameter, or not at this stage.
    #[error("an owner may not set {parameter:?} of a goal that is {stage:?}")]
    NotPermitted {
        /// Which.
        parameter: Parameter,
        /// How far the goal is.
        stage: Stage,
    },
}

fn started_or_not(started: bool) -> &'static str {
    if started { "started" } else { "not started" }
}
