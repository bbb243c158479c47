//! Links, rovers, sensor nodes, planners, plain traffic, and what watches over them, for Farside.

pub mod invariants;
pub mod link;
pub mod network;
pub mod planning;
pub mod radio;
pub mod traffic;
pub mod units;
