//! Links, rovers, sensor nodes and planners for Farside.

pub mod link;
pub mod network;
pub mod radio;
pub mod units;
