//! Numbers of vertices and of sensor nodes, and how numbers of what has a name are written.

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

/// The index of a node of a [`SensorNetwork`](crate::SensorNetwork), from 0. It is written as the
/// number in the node's name, from 1.
///
/// ```
/// use farside_worlds::NodeId;
/// assert!(NodeId(2) < NodeId(10));
/// // node_03
/// let written = toml::Value::try_from(NodeId(2))?;
/// assert_eq!(written.as_integer(), Some(3));
/// assert_eq!(written.try_into::<NodeId>()?, NodeId(2));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize,
)]
#[serde(transparent)]
pub struct NodeId(#[serde(with = "numbered")] pub u32);

/// Writes an index from 0 as the number from 1 that names have: for `#[serde(with = ...)]` of what
/// is called `rover_01` and so on, so that who reads a log finds one number for one rover.
pub mod numbered {
    use serde::{Deserialize, Deserializer, Serializer};

    /// Writes the number.
    ///
    /// # Errors
    /// When the serializer fails.
    pub fn serialize<S: Serializer>(index: &u32, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_u32(index.wrapping_add(1))
    }

    /// Reads the number. Any is the number of some index, so that any bytes of a message read as a
    /// value: 0, which nothing is called, as the last.
    ///
    /// # Errors
    /// When it is no number.
    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<u32, D::Error> {
        u32::deserialize(from).map(|number| number.wrapping_sub(1))
    }
}

impl fmt::Display for VertexId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}
