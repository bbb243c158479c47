//! The protocol of shared goals alone, on a network that loses, repeats, delays and parts, with actors
//! that crash at any event: random runs, and what must hold after each event of one.
//!
//! A run is a function of a [`Scenario`], which prints as what it is, and of the rules that are kept.

#[path = "sharing/checks.rs"]
mod checks;
#[path = "sharing/planners.rs"]
mod planners;
#[path = "sharing/scenario.rs"]
mod scenario;
#[path = "sharing/world.rs"]
mod world;

pub(crate) use checks::Violation;
pub(crate) use scenario::{Crash, Partition, Scenario, Wished, Wishing};
pub(crate) use world::{Tally, World};
