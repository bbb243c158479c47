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
//! | [`database`] | tokens on timelines, tied by rules, times and parameters |
//! | [`draw`] | a plan as a Gantt chart |
//! | [`explain`] | why there is no plan, in sentences and as JSON, and which goals to drop |
//! | [`language`] | from the text of a model or a problem to its tables, with what is wrong and where |
//! | [`model`] | what a model and a problem say, with every name resolved |
//! | [`objective`] | what a plan is worth by the goals that it achieves |
//! | [`parameters`] | variables and what ties them together, kept consistent edit by edit |
//! | [`plan`] | a plan as data and as JSON |
//! | [`profile`] | how low and how high the level of a resource can be while times are flexible |
//! | [`sch`] | project scheduling problems (RCPSP/max) in ProGen/max's format |
//! | [`search`] | how what is missing in a plan is put right |
//! | [`temporal`] | points in time and bounds on their differences, kept consistent edit by edit |

pub mod arena;
pub mod checker;
pub mod database;
pub mod draw;
pub mod explain;
pub mod language;
pub mod model;
mod nearest;
pub mod objective;
pub mod parameters;
pub mod plan;
pub mod profile;
pub mod sch;
pub mod search;
pub mod temporal;

/// Time in ticks: the user says how long one is.
pub type Ticks = i64;
