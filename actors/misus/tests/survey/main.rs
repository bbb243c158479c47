//! The closed loop: it turns, nothing happens that must never happen, whatever links lose and whoever is lost,
//! and what cannot be is said by key.

#[path = "../../examples/support/survey.rs"]
mod survey;

mod loops;
mod own_goals;
mod refusals;
