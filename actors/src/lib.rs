//! Links, rovers, sensor nodes, planners and plain traffic for Farside.

pub mod link;
pub mod network;
pub mod planning;
pub mod radio;
pub mod traffic;
pub mod units;
