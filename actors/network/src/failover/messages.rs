//! What nodes and rovers say to each other when a node has fallen silent.

use farside_worlds::{NodeId, VertexId};
use serde::{Deserialize, Serialize};

use super::rank::Replacement;
use crate::max_plus::messages::Assignments;
use crate::node::messages::Locations;
use crate::reservation::messages::{Relay, TimedPath};
use crate::safety::messages::{Departed, DepartedAck, Whereabouts};

/// Node to rover, with `network.failover_after`: the vertices of `region` are mine from now on.
/// Where are you? Repeated each cycle until answered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Inquiry {
    /// The backup that asks.
    pub node: NodeId,
    /// The node that has fallen silent, whose vertices are to be taken over.
    pub region: NodeId,
    /// The backup's place in that node's backup list, from 1.
    pub rank: u32,
}

/// Rover to node: the answer to an [`Inquiry`], and to a grant by a node that is replaced. From now
/// on the rover obeys grants of this region's vertices from the backup of this rank only.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Account {
    /// Whose vertices this is about.
    pub region: NodeId,
    /// Whom the rover obeys there: a place in the backup list, from 0.
    pub rank: u32,
    /// Who, where, after how many steps.
    pub whereabouts: Whereabouts,
    /// The vertex it came from.
    pub previous: Option<VertexId>,
    /// Where it wants to go.
    pub goal: VertexId,
    /// The paths reserved for it that it has not driven to their ends, with the policy `complete`.
    pub paths: Vec<TimedPath>,
}

/// Node to neighbours, each cycle: which nodes are replaced, as far as it knows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Replaced {
    /// All that are.
    pub regions: Vec<Replacement>,
}

/// Node to node by way of others: a backup and those beside the vertices that it took over
/// need not be radio neighbours.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Passed {
    /// Whom it is for.
    pub to: NodeId,
    /// How often it may still be passed on.
    pub hops: u32,
    /// What it says.
    pub content: Content,
}

/// What is passed on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Content {
    /// Step 1.
    Locations(Locations),
    /// Step 5.
    Assignments(Assignments),
    /// A rover has gone on.
    Departed(Departed),
    /// That is on record.
    DepartedAck(DepartedAck),
    /// Steps of requests, with the policy `complete`.
    Relay(Relay),
}

/// What a backup records when it begins to answer for another node's vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FailedOver {
    /// The node that is replaced.
    pub region: NodeId,
    /// The node that answers for its vertices.
    pub backup: NodeId,
    /// The planning cycle.
    pub cycle: u32,
}
