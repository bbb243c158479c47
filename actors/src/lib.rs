//! Links, rovers, sensor nodes and planners for Farside.

pub mod network;
