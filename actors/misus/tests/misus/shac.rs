//! The protocol of shared goals: random runs on bad networks, each rule broken once, and single
//! situations on a network that loses nothing.

#[path = "../../examples/support/sharing.rs"]
mod sharing;

mod encoding;
mod kernel;
mod rules;
mod runs;
mod situations;
mod team;
