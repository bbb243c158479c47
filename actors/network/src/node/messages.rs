//! What nodes say to each other, whatever their policy, and what they record.

use farside_worlds::NodeId;
use serde::{Deserialize, Serialize};

use crate::max_plus::messages::Load;
use crate::safety::messages::Holding;

/// Step 1 of a planning cycle, node to neighbours: who is, or may be, on the node's vertices.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Locations {
    /// The node.
    pub node: NodeId,
    /// The planning cycle, from 0.
    pub cycle: u32,
    /// One for each of the node's vertices that is not free.
    pub holdings: Vec<Holding>,
    /// With `network.max_plus.outsourcing`: how much the node has to compute.
    pub load: Option<Load>,
    /// With `network.max_plus.congestion_spread`: how crowded it is at the node and behind it, in
    /// rovers a vertex.
    pub crowding: Option<f64>,
    /// With `network.failover_after`: the nodes for whose vertices it answers.
    pub answers: Vec<NodeId>,
}

/// What a node records when it was given the last part of the roadmap.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RoadmapKnown {
    /// The node.
    pub node: NodeId,
}
