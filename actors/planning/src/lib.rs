//! Planning without a simulator: what plans of activities under time and resources stand on.
//!
//! Nothing here knows a rover, an actor, a link or a clock. Time is a whole number of ticks, whose
//! length is the user's; search is bounded by counted operations and never by a clock; the same
//! edits give the same state on any machine.
//!
//! | module | what it is |
//! |---|---|
//! | [`arena`] | values with ids that a later value in the same place does not answer to |
//! | [`language`] | from the text of a model or a problem to its tables, with what is wrong and where |
//! | [`model`] | what a model and a problem say, with every name resolved |
//! | [`temporal`] | points in time and bounds on their differences, kept consistent edit by edit |

pub mod arena;
pub mod language;
pub mod model;
pub mod temporal;

/// Time in ticks: the user says how long one is.
pub type Ticks = i64;
