//! Who answers for the vertices of a node that is replaced.

use farside_worlds::NodeId;
use serde::{Deserialize, Serialize};

/// A node whose vertices another one answers for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Replacement {
    /// The node.
    pub region: NodeId,
    /// The backup's place in its backup list, from 1.
    pub rank: u32,
}
