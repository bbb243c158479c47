//! The planners of MISUS as actors: a central planner and one on each rover, on hosts of their own, that
//! exchange their plans over links after each optimisation step (the paper's section 5).
//!
//! One step is made in each period, and takes as long as its operations take on the host's processor.
//! Planners that are synchronised wait for each other after each step, as in the paper's evaluation; then what
//! they plan is what [`rounds::run`](crate::planner::rounds::run) plans, whatever links lose. Planners that
//! are not go on with what they last heard.
//!
//! What keeps a goal with one rover at a time, whatever is lost, repeated or late: each assignment of a goal has a
//! number. Only the rover that has a goal gives it up, once and for all of that number; the centre assigns it
//! anew, with the next number, only when it has heard that. Messages say all that holds, not what has changed,
//! so the next one makes up for one that is lost.
//!
//! What this is not: [`crate::shac`], whose goals are also carried out, withdrawn and leased. Plans here are
//! made, and not carried out.

mod assemble;
mod builtin;
mod centre;
mod config;
mod messages;
mod metrics;
mod monitor;
mod rover;
mod shared;
mod system;

pub use config::RoundsConfig;
pub use messages::{
    Assigned, CentralRound, GoalsAssigned, PlanHeld, PlannedStop, PlannerStep, Reserved,
};
pub use metrics::PlanningMetrics;
pub use system::PlanningSystem;
