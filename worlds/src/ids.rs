//! Numbers of vertices and of sensor nodes.

use std::fmt;

use serde::{Deserialize, Serialize};

/// The index of a vertex of a [`Roadmap`](crate::Roadmap), from 0.
///
/// ```
/// use farside_worlds::VertexId;
/// assert!(VertexId(2) < VertexId(10));
/// ```
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize,
)]
#[serde(transparent)]
pub struct VertexId(pub u32);

/// The index of a node of a [`SensorNetwork`](crate::SensorNetwork), from 0.
///
/// ```
/// use farside_worlds::NodeId;
/// assert!(NodeId(2) < NodeId(10));
/// ```
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize,
)]
#[serde(transparent)]
pub struct NodeId(pub u32);

impl fmt::Display for VertexId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}
