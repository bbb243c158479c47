//! Planning without a simulator: what plans of activities under time and resources stand on.
//!
//! Nothing here knows a rover, an actor, a link or a clock. Time is a whole number of ticks, whose
//! length is the user's; search is bounded by counted operations and never by a clock; the same
//! edits give the same state on any machine.
//!
//! | module | what it is |
//! |---|---|
//! | [`arena`] | values with ids that a later value in the same place does not answer to |
//! | [`checker`] | whether a plan is valid, and if not, why: shares no code with the planners |
//! | [`draw`] | a plan as a Gantt chart |
//! | [`model`] | what a model and a problem say, with every name resolved |
//! | [`plan`] | a plan as data and as JSON |
//! | [`sch`] | project scheduling problems (RCPSP/max) in ProGen/max's format |
//! | [`temporal`] | points in time and bounds on their differences, kept consistent edit by edit |

pub mod arena;
pub mod checker;
pub mod draw;
pub mod model;
mod nearest;
pub mod plan;
pub mod sch;
pub mod temporal;

/// Time in ticks: the user says how long one is.
pub type Ticks = i64;
