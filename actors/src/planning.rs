//! Planning on roadmaps in space and time, without messages.

pub mod safe_intervals;
