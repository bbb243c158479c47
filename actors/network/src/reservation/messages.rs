//! What nodes say to each other on a reservation request. Plain serde types: the log describes them
//! field by field.

use farside_worlds::{NodeId, VertexId};
use serde::{Deserialize, Serialize};

use crate::failover::rank::Replacement;
use crate::ids::RoverId;
use crate::mapf::safe_intervals::{Label, TimedVisit};

/// Node to neighbour: items, each to be taken once, and a receipt for those that came the other
/// way.
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
    /// With `network.failover_after`: between whom this is, and who answers for them.
    pub between: Option<Between>,
}

/// The two regions that a [`Relay`] goes between, each with the rank that answers for it: numbers
/// begin anew when one of them is replaced.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Between {
    /// For whose vertices the sender speaks.
    pub from: NodeId,
    /// Its place in that node's backup list, from 0.
    pub from_rank: u32,
    /// Whose vertices this is about.
    pub to: NodeId,
    /// The place of whom the sender takes to answer for those.
    pub to_rank: u32,
}

/// Node to rover, with `network.failover_after`: a path could be reserved for you. It is yours once
/// you have taken it, which you do unless one of its vertices has been taken over since. Repeated
/// each cycle until answered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Itinerary {
    /// The node that answers for where the path begins.
    pub node: NodeId,
    /// The path.
    pub path: TimedPath,
    /// Who answered for the path's vertices as it was reserved: the nodes that were replaced by
    /// then. All others by themselves.
    pub replaced: Vec<Replacement>,
}

/// Rover to node: whether it has taken the path of an [`Itinerary`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ItineraryAnswer {
    /// The rover's request.
    pub request: ReservationRequest,
    /// It has, for good.
    pub taken: bool,
}

/// A reserved path.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TimedPath {
    /// The request that reserved it.
    pub request: ReservationRequest,
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

/// One step of a request.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Item {
    /// Forward: where and when the rover could be.
    Probe(Probe),
    /// Backward: the path chosen, to be entered in the tables.
    Reserve(Reserve),
    /// Forward or backward: what became of it.
    Settle(Settle),
    /// Backward: who stands for ever on this path is asked to step aside for a while.
    Displace(Displace),
    /// To all: a part of the roadmap, for nodes that are given it over the network.
    Roadmap(RoadmapPart),
    /// Forward: where and when the rover could be if others made room.
    Wish(Wish),
    /// Forward: the same as a probe, along a path that keeps clear of all others' places.
    Clear(Clear),
    /// To a parent or to children in the tree of nodes: a step of a joint resolution.
    Joint(Joint),
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

/// A rover that stays at its goal would have a path if nobody stood on it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Displace {
    /// The request that found no other way.
    pub request: ReservationRequest,
    /// The path that it would take.
    pub path: Vec<VertexId>,
    /// The nodes along it.
    pub route: Vec<NodeId>,
    /// The place in `route` of the node that this is for.
    pub at: u32,
    /// For whom way is made: when the first attempt of its request began \[ns\], and the rover.
    /// This one, or, where this one is to make room itself, the one it makes room for.
    pub priority: (u64, RoverId),
}

/// One attempt to reserve a path for a rover.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ReservationRequest {
    /// The rover.
    pub rover: RoverId,
    /// The attempt, from 1.
    pub attempt: u32,
    /// When its first attempt began \[ns\]: of two requests that want the same, the older one wins.
    pub since: u64,
}

impl ReservationRequest {
    /// Whether this is an earlier attempt of the same request.
    pub(crate) fn is_before(&self, other: &ReservationRequest) -> bool {
        (self.rover, self.since) == (other.rover, other.since) && self.attempt < other.attempt
    }

    /// Whether this request goes before `other`.
    pub fn is_older_than(&self, other: &ReservationRequest) -> bool {
        self.age() < other.age()
    }

    /// When its first attempt began \[ns\], and the rover: whose is less goes before.
    pub fn age(&self) -> (u64, RoverId) {
        (self.since, self.rover)
    }
}

/// The forward half of a request along one of several routes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Probe {
    /// The request.
    pub request: ReservationRequest,
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
    /// The step with which the path begins.
    pub first_step: u32,
    /// Only asks what the path would be if nobody stood still for ever.
    pub wishful: bool,
    /// Where the rover can be, and when.
    pub labels: Vec<Label>,
    /// Those of them, by place, from which the next node goes on.
    pub frontier: Vec<u32>,
}

/// A probe that only asks what the path would be if nobody stood still for ever.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Wish {
    /// The probe.
    pub probe: Probe,
    /// As in [`Displace`].
    pub priority: (u64, RoverId),
}

/// A probe that follows a path past no start and no goal of any other rover. What each node hands
/// on has the path's own vertex among it, for late enough.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Clear {
    /// The probe.
    pub probe: Probe,
    /// Where the path leaves each node of the probe's route; at the last one, the goal.
    pub exits: Vec<VertexId>,
}

/// A step of a joint resolution: one node plans for all rovers of a map on which they stay.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Joint {
    /// Who says it.
    pub from: NodeId,
    /// Which resolution, from 1.
    pub round: u32,
    /// The step.
    pub step: JointStep,
}

/// What is said in a joint resolution.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum JointStep {
    /// Towards the root: a request has found no path.
    Ask,
    /// From the root: begin no request.
    Hold,
    /// Towards the root: no request that began in this part of the tree is under way.
    Held,
    /// From the root: grant nothing any more, and say what is reserved.
    Tell,
    /// Towards the root: what is reserved in this part of the tree.
    Told(Reserved),
    /// From the root: the plan.
    Plan {
        /// How much holds of what was reserved, of each rover.
        stops: Vec<Stop>,
        /// What is planned in this part of the tree, rover by rover, each rover's visits in order.
        visits: Vec<PlannedVisit>,
    },
    /// From the root: there is no plan; go on as before.
    GoOn {
        /// There never will be one.
        is_hopeless: bool,
    },
}

/// All that is reserved before a joint plan.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Reserved {
    /// The visits.
    pub visits: Vec<ReservedVisit>,
}

/// A visit that is reserved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ReservedVisit {
    /// Whose.
    pub rover: RoverId,
    /// The step with which the rover comes.
    pub step: u32,
    /// Where and when.
    pub visit: TimedVisit,
    /// The vertex was given to the rover.
    pub granted: bool,
}

/// The last of a rover's reserved visits that holds when a joint plan begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stop {
    /// The rover.
    pub rover: RoverId,
    /// The visit's step.
    pub step: u32,
}

/// A visit of a joint plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlannedVisit {
    /// What stands for the plan in the tables.
    pub request: ReservationRequest,
    /// The step with which the rover comes.
    pub step: u32,
    /// Where it comes from; none for where it stops as the plan begins.
    pub from: Option<VertexId>,
    /// Where and when.
    pub visit: TimedVisit,
}

/// The backward half: the path is entered in the tables of all that own a part of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reserve {
    /// The request.
    pub request: ReservationRequest,
    /// The step of the first visit; each further one is one step on.
    pub first_step: u32,
    /// All visits, from the rover's place to its goal.
    pub path: Vec<TimedVisit>,
    /// The last visit that is not entered yet.
    pub at: u32,
    /// With `network.failover_after`: the ranks of those who have entered a part as backups.
    pub replaced: Vec<Replacement>,
}

impl Reserve {
    /// The path, for its rover.
    pub(crate) fn into_path(self) -> TimedPath {
        TimedPath {
            request: self.request,
            first_step: self.first_step,
            visits: self.path,
        }
    }
}

/// What became of a request, passed on along its route.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settle {
    /// The request.
    pub request: ReservationRequest,
    /// What became of it.
    pub verdict: Verdict,
    /// The nodes along its path.
    pub route: Vec<NodeId>,
    /// The place in `route` of the node that this is for.
    pub at: u32,
}

/// What became of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Verdict {
    /// All of the path is reserved: it is irrevocable. Goes forward.
    Confirmed,
    /// A part could not be had: what was entered is struck out. Goes forward.
    Released,
    /// The same, for the node that began: it tries again. Goes backward.
    Failed,
    /// There is no path as things stand. Goes backward.
    NoPath,
}
