//! What nodes say to each other to find deadlocks and to resolve them.

use farside_worlds::{NodeId, VertexId};
use serde::{Deserialize, Serialize};

use crate::ids::RoverId;

/// Node to node: who waits for the holder of this vertex, and so on back to the rover that the
/// probe was sent for. It ends where nobody waits; if it comes back, all of them wait for each
/// other.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WaitProbe {
    /// The node that sends, or passes it on.
    pub node: NodeId,
    /// The planning cycle in which that was.
    pub cycle: u32,
    /// The vertex that the last member wants, one of the receiver's.
    pub vertex: VertexId,
    /// Who waits: each for the next one.
    pub members: Vec<Waiting>,
}

/// A rover that has come no nearer to its goal for some time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Waiting {
    /// The rover.
    pub rover: RoverId,
    /// Where it stands.
    pub vertex: VertexId,
    /// Where it wants to go.
    pub goal: VertexId,
}

/// Node to node: a confirmed deadlock for which the nodes before found no place to send a rover to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Resolve {
    /// The node that hands it on.
    pub node: NodeId,
    /// The planning cycle in which that was.
    pub cycle: u32,
    /// Each waits for the next one, and the last for the first.
    pub ring: Vec<Waiting>,
    /// How many of them can go nowhere; the next one is the receiver's.
    pub tried: u32,
}

/// Node to node, the owners of the vertices on the path: plan for this rover to go aside.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Aside {
    /// The node that decided it.
    pub node: NodeId,
    /// The planning cycle in which that was.
    pub cycle: u32,
    /// The rover.
    pub rover: RoverId,
    /// From where it stands to where it goes, vertex by vertex.
    pub path: Vec<VertexId>,
    /// The last planning cycle in which that holds.
    pub until: u32,
}
