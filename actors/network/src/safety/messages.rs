//! What rovers and the owners of vertices say to each other so that no two rovers meet, and what
//! rovers record of themselves.

use farside_actors::invariants::Place;
use farside_worlds::{NodeId, VertexId};
use serde::{Deserialize, Serialize};

use crate::ids::RoverId;

/// Rover to node, each cycle and at each change: where it is. Cumulative: a later one replaces any
/// that were lost. With `moving_to` it says LEAVING: the rover is irrevocably on its way, and its
/// vertex is free.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Beacon {
    /// Who, where, after how many steps.
    pub whereabouts: Whereabouts,
    /// The vertex it came from; none if it entered the roadmap here.
    pub previous: Option<VertexId>,
    /// Where it wants to go.
    pub goal: VertexId,
}

/// A fact about a rover that stays true: at step `step` it is (or was) at `vertex`, and if
/// `moving_to` is there, its next step leads (or led) to that vertex and to no other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Whereabouts {
    /// The rover.
    pub rover: RoverId,
    /// Steps completed; 0 in the entry queue. Entering and leaving the roadmap are steps.
    pub step: u32,
    /// Where that step led; none before it entered and after it left.
    pub vertex: Option<VertexId>,
    /// The vertex it is on its way to, irrevocably.
    pub moving_to: Option<VertexId>,
}

impl Whereabouts {
    /// Where that is on the roadmap.
    pub fn place(&self) -> Place<VertexId> {
        match (self.vertex, self.moving_to) {
            (None, _) => Place::Away,
            (Some(here), None) => Place::At(here),
            (Some(here), Some(next)) => Place::Between(here, next),
        }
    }
}

/// Node to rover: take step `step`, to a vertex that is now yours, or off the roadmap. Repeated
/// each cycle until the step is heard done.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Grant {
    /// The node that grants, which owns the vertex.
    pub node: NodeId,
    /// The step that this permits, and no other.
    pub step: u32,
    /// Where to; none: leave the roadmap at your goal.
    pub to: Option<VertexId>,
}

/// Node to node: a rover you may still hold a vertex for has gone on. Repeated each cycle until
/// acknowledged.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Departed {
    /// The node that reports.
    pub node: NodeId,
    /// What it heard of the rover.
    pub whereabouts: Whereabouts,
}

/// Node to node: a [`Departed`] was heard and is on record.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DepartedAck {
    /// The node that acknowledges.
    pub node: NodeId,
    /// The rover.
    pub rover: RoverId,
    /// The step that was reported.
    pub step: u32,
}

/// A vertex that is not free.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Holding {
    /// The vertex.
    pub vertex: VertexId,
    /// Who holds it: stands there, or was granted it and is not known to have come.
    pub rover: RoverId,
    /// The step with which the rover comes, or came.
    pub step: u32,
    /// Its goal, where the node has heard it.
    pub goal: Option<VertexId>,
}

/// A rover's state as it records it at every change: the truth, not what a node believes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RoverState {
    /// Who, where, after how many steps. With `moving_to`, it is on the edge between the two
    /// vertices.
    pub whereabouts: Whereabouts,
    /// The entry it waits at, or came through.
    pub entry: VertexId,
    /// Where it wants to go.
    pub goal: VertexId,
    /// What links have charged it so far for what it transmitted \[J\].
    pub transmit_energy_j: f64,
}
