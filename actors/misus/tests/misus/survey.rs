//! The closed loop: it turns, nothing happens that must never happen, whatever links lose and whoever is lost,
//! and what cannot be is said by key.

#[path = "../../examples/support/survey.rs"]
#[allow(dead_code, reason = "examples use the rest")]
mod runs;

mod elections;
mod loops;
mod meetings;
mod own_goals;
mod pictures;
mod random;
mod refusals;
