//! What nodes say to each other on a reservation walk. Plain serde types: the log describes them
//! field by field.

use farside_worlds::{NodeId, VertexId};
use serde::{Deserialize, Serialize};

use crate::failover::rank::Replacement;
use crate::ids::RoverId;
use crate::mapf::safe_intervals::{Label, TimedVisit};

/// Node to neighbour: items, each to be taken once, and a receipt for those that came the other way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Relay {
    /// The node.
    pub node: NodeId,
    /// All items below this number were taken.
    pub taken: u64,
    /// Items taken beyond that.
    pub beyond: Vec<u64>,
    /// When this was sent \[ns\].
    pub sent: u64,
    /// When the message was sent that this answers, by its sender's clock \[ns\].
    pub echo: Option<u64>,
    /// New and repeated items.
    pub items: Vec<Numbered>,
    /// With `network.takeover_after`: between whom this is, and who answers for them.
    pub between: Option<Between>,
}

/// The two homes that a [`Relay`] goes between, each with the rank that answers for it: numbers begin
/// anew when one of them is replaced.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Between {
    /// For whose vertices the sender speaks.
    pub from: NodeId,
    /// Its place in that node's line of succession, from 0.
    pub from_rank: u32,
    /// Whose vertices this is about.
    pub to: NodeId,
    /// The place of whom the sender takes to answer for those.
    pub to_rank: u32,
}

/// Node to rover, with `network.takeover_after`: a way could be reserved for you. It is yours once you
/// have taken it, which you do unless one of its vertices has been taken over since. Repeated each
/// cycle until answered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Itinerary {
    /// The node that answers for where the way begins.
    pub node: NodeId,
    /// The way.
    pub way: Way,
    /// Who answered for the way's vertices as it was reserved: the nodes that were replaced by then. All
    /// others by themselves.
    pub replaced: Vec<Replacement>,
}

/// Rover to node: whether it has taken the way of an [`Itinerary`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ItineraryAnswer {
    /// The rover's walk.
    pub walk: Walk,
    /// It has, for good.
    pub taken: bool,
}

/// A reserved way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Way {
    /// The walk that reserved it.
    pub walk: Walk,
    /// The step of the first visit; each further one is one step on.
    pub first_step: u32,
    /// All visits, in order.
    pub visits: Vec<TimedVisit>,
}

/// An item with its number on the way from one node to another, from 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Numbered {
    /// The number.
    pub number: u64,
    /// The item.
    pub item: Item,
}

/// One step of a walk.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Item {
    /// Forward: where and when the rover could be.
    Probe(Probe),
    /// Backward: the way chosen, to be entered in the books.
    Reserve(Reserve),
    /// Forward or backward: what became of it.
    Settle(Settle),
    /// Backward: who stands for ever on this path is asked to step aside for a while.
    Yield(Yield),
    /// To all: a part of the roadmap, for nodes that are given it over the network.
    Roadmap(RoadmapPart),
    /// Forward: where and when the rover could be if others made way.
    Wish(Wish),
}

/// A part of the roadmap.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RoadmapPart {
    /// Its number, from 0.
    pub part: u32,
    /// How many parts there are.
    pub parts: u32,
    /// Some vertices, in order.
    pub vertices: Vec<MapVertex>,
    /// The edges whose lower end is one of them, as (lower, higher).
    pub edges: Vec<(VertexId, VertexId)>,
}

/// A vertex of the roadmap.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapVertex {
    /// The vertex.
    pub vertex: VertexId,
    /// Where it is, in the world's frame \[m\].
    pub position_m: [f64; 3],
    /// Rovers may enter or leave here.
    pub is_boundary: bool,
    /// The node that owns it.
    pub owner: NodeId,
}

/// A rover that stays at its goal would have a way if nobody stood on it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Yield {
    /// The walk that found no other way.
    pub walk: Walk,
    /// The path that it would take.
    pub path: Vec<VertexId>,
    /// The nodes along it.
    pub route: Vec<NodeId>,
    /// The place in `route` of the node that this is for.
    pub at: u32,
    /// For whom way is made: when the first attempt of its walk began \[ns\], and the rover. This one,
    /// or, where this one is to make way itself, the one it makes way for.
    pub elder: (u64, RoverId),
}

/// One attempt to reserve a way for a rover.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Walk {
    /// The rover.
    pub rover: RoverId,
    /// The attempt, from 1.
    pub attempt: u32,
    /// When its first attempt began \[ns\]: of two walks that want the same, the older one wins.
    pub since: u64,
}

impl Walk {
    /// Whether this is an earlier attempt of the same walk.
    pub(crate) fn is_before(&self, other: &Walk) -> bool {
        (self.rover, self.since) == (other.rover, other.since) && self.attempt < other.attempt
    }

    /// Whether this walk goes before `other`.
    pub fn is_older_than(&self, other: &Walk) -> bool {
        self.age() < other.age()
    }

    /// When its first attempt began \[ns\], and the rover: whose is less goes before.
    pub fn age(&self) -> (u64, RoverId) {
        (self.since, self.rover)
    }
}

/// The forward half of a walk along one of several routes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Probe {
    /// The walk.
    pub walk: Walk,
    /// How many probes of this attempt there are, one for each route.
    pub probes: u32,
    /// When the attempt began \[ns\].
    pub started: u64,
    /// The nodes to pass, from the rover's to its goal's.
    pub route: Vec<NodeId>,
    /// The place in `route` of the node that this is for.
    pub at: u32,
    /// Where the rover wants to go.
    pub goal: VertexId,
    /// The step with which the way begins.
    pub first_step: u32,
    /// Only asks what the way would be if nobody stood still for ever.
    pub wishful: bool,
    /// Where the rover can be, and when.
    pub labels: Vec<Label>,
    /// Those of them, by place, from which the next node goes on.
    pub frontier: Vec<u32>,
}

/// A probe that only asks what the way would be if nobody stood still for ever.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Wish {
    /// The probe.
    pub probe: Probe,
    /// As in [`Yield`].
    pub elder: (u64, RoverId),
}

/// The backward half: the way is entered in the books of all that own a part of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reserve {
    /// The walk.
    pub walk: Walk,
    /// The step of the first visit; each further one is one step on.
    pub first_step: u32,
    /// All visits, from the rover's place to its goal.
    pub way: Vec<TimedVisit>,
    /// The last visit that is not entered yet.
    pub at: u32,
    /// With `network.takeover_after`: the ranks of those who have entered a part as deputies.
    pub replaced: Vec<Replacement>,
}

impl Reserve {
    /// The way, for its rover.
    pub(crate) fn into_way(self) -> Way {
        Way {
            walk: self.walk,
            first_step: self.first_step,
            visits: self.way,
        }
    }
}

/// What became of a walk, passed on along its route.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settle {
    /// The walk.
    pub walk: Walk,
    /// What became of it.
    pub verdict: Verdict,
    /// The nodes along its way.
    pub route: Vec<NodeId>,
    /// The place in `route` of the node that this is for.
    pub at: u32,
}

/// What became of a walk.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Verdict {
    /// All of the way is reserved: it is irrevocable. Goes forward.
    Confirmed,
    /// A part could not be had: what was entered is struck out. Goes forward.
    Released,
    /// The same, for the node that began: it tries again. Goes backward.
    Failed,
    /// There is no way as things stand. Goes backward.
    NoWay,
}
