//! Cases: runs of the network-guided system with all that goes wrong in them.
//!
//! A [`Case`] is a run of the network-guided system with all that goes wrong in it. It prints as a
//! scenario of a few lines that `farside run` reads. With the feature `proptest`,
//! `cases::strategies` makes random ones that shrink: to few rovers, few vertices, good links.
//!
//! # A rule broken, and what is left of the case that shows it
//!
//! In the network-guided system a vertex counts as occupied until its occupant is heard to have
//! left it. [`Sabotage::FreeOnGrant`](crate::Sabotage) breaks that: the vertex is free as soon as
//! the grant of the next one is sent. `tests/network_safety.rs` tries its property, that nobody
//! collides, on random cases with this fault, and finds a collision within a few. `proptest`
//! shrinks it to two rovers, one node, three vertices and a jitter of a millisecond, and prints:
//!
//! ```toml
#![doc = include_str!("cases/freed-on-grant.toml")]
//! ```
//!
//! `farside run` ends this with "1 collisions: rover_02 met rover_01 at vertex 0 at 1.704587464s".
//! At 1.7 s the node sends one rover on and lets the other one follow in the same instant; the
//! follower's grant overtakes the first one's by a fraction of the jitter, and it sets out for a
//! vertex on which the first rover still stands. Without the fault nobody collides. The test
//! `the_scenario_in_the_docs_collides_because_of_the_broken_rule` runs it both ways.

mod case;
#[cfg(any(feature = "proptest", test))]
pub mod strategies;

pub use case::{Case, CaseError, Downtime};
