//! Everything that nodes and rovers of the network-guided system say to each other, and what they
//! record of their state. Plain serde types: the log describes them field by field.

use farside_worlds::{NodeId, VertexId};
use serde::{Deserialize, Serialize};

pub use super::ids::RoverId;

use farside_actors::invariants::Place;

use super::candidates::CandidatePath;
use super::reservation::messages::{Relay, Way};

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

/// Node to rover, with `network.takeover_after`: the vertices of `home` are mine from now on. Where
/// are you? Repeated each cycle until answered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Inquiry {
    /// The deputy that asks.
    pub node: NodeId,
    /// The node that has fallen silent, whose vertices are to be taken over.
    pub home: NodeId,
    /// The deputy's place in that node's line of succession, from 1.
    pub rank: u32,
}

/// Rover to node: the answer to an [`Inquiry`], and to a grant by a node that is replaced. From now on
/// the rover obeys grants of this home's vertices from the deputy of this rank only.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Account {
    /// Whose vertices this is about.
    pub home: NodeId,
    /// Whom the rover obeys there: a place in the line of succession, from 0.
    pub rank: u32,
    /// Who, where, after how many steps.
    pub whereabouts: Whereabouts,
    /// The vertex it came from.
    pub previous: Option<VertexId>,
    /// Where it wants to go.
    pub goal: VertexId,
    /// The ways reserved for it that it has not driven to their ends, with the policy `complete`.
    pub ways: Vec<Way>,
}

/// Node to neighbours, each cycle: which nodes are replaced, as far as it knows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Replaced {
    /// All that are.
    pub homes: Vec<Replacement>,
}

/// A node whose vertices another one answers for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Replacement {
    /// The node.
    pub home: NodeId,
    /// The deputy's place in its line of succession, from 1.
    pub rank: u32,
}

/// Node to node by way of others: a deputy and those beside the vertices that it took over
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
    /// Steps of walks, with the policy `complete`.
    Relay(Relay),
}

/// Step 1 of a planning cycle, node to neighbours: who is, or may be, on the node's vertices.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Locations {
    /// The node.
    pub node: NodeId,
    /// The planning cycle, from 0.
    pub cycle: u32,
    /// One for each of the node's vertices that is not free.
    pub holdings: Vec<Holding>,
    /// With `network.outsourcing`: how much the node has to compute.
    pub load: Option<Load>,
    /// With `network.congestion_spread`: how crowded it is at the node and behind it, in rovers a vertex.
    pub crowding: Option<f64>,
    /// With `network.takeover_after`: the nodes for whose vertices it answers.
    pub answers: Vec<NodeId>,
}

/// What a node has to compute in an iteration of max-plus, in pairs of candidate paths, as it was in the
/// cycle before.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Load {
    /// Its own part, nothing handed over.
    pub pairs: u64,
    /// By how much its neighbours' parts, as it heard of them, are more than their processors can do:
    /// they all may want to hand over.
    pub claims: u64,
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

/// Step 3, node to neighbours: the candidate paths of its rovers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CandidatePaths {
    /// The node.
    pub node: NodeId,
    /// The planning cycle.
    pub cycle: u32,
    /// Each rover's candidates.
    pub rovers: Vec<RoverPaths>,
}

/// One rover's candidate paths.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RoverPaths {
    /// The rover.
    pub rover: RoverId,
    /// Its candidates; a max-plus vector has one value for each, in this order.
    pub paths: Vec<CandidatePath>,
}

/// Step 4, node to neighbour: the max-plus vectors that changed in one iteration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MaxPlus {
    /// The node.
    pub node: NodeId,
    /// The planning cycle.
    pub cycle: u32,
    /// The iteration, from 1.
    pub iteration: u32,
    /// Nothing changed at this node: it will say no more until it hears something new.
    pub settled: bool,
    /// The vectors.
    pub vectors: Vec<Vector>,
    /// With `network.outsourcing`: what the receiver is to make vectors of, from and to the same rovers.
    /// The values are of the speaker's paths: what each is worth to it, the receiver's vector to it
    /// left out.
    pub bases: Vec<Vector>,
    /// With `network.anytime`: what the node's rovers would do as things stood before this iteration.
    pub choices: Vec<Choice>,
}

/// Which of its candidate paths a rover would take.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Choice {
    /// The rover.
    pub rover: RoverId,
    /// The place of the path among its candidates, from 0.
    pub path: u32,
}

/// The message of one rover to another in max-plus, mean subtracted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Vector {
    /// The rover i that speaks, of the sending node.
    pub from: RoverId,
    /// The rover j that is spoken to, of the receiving node.
    pub to: RoverId,
    /// A value for each candidate path of j.
    pub values: Vec<f32>,
}

/// Step 5, node to neighbours: the paths assigned to its rovers. To the owner of the vertex that a
/// path enters first it is also the request to be admitted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Assignments {
    /// The node.
    pub node: NodeId,
    /// The planning cycle.
    pub cycle: u32,
    /// One for each rover that is not told to stay.
    pub rovers: Vec<Assignment>,
}

/// The path assigned to a rover.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Assignment {
    /// The rover.
    pub rover: RoverId,
    /// The step it would take next.
    pub step: u32,
    /// For how many cycles it has stood where it stands.
    pub waited: u32,
    /// The path.
    pub path: CandidatePath,
}

/// Node to node: who waits for the holder of this vertex, and so on back to the rover that the
/// probe was sent for. It ends where nobody waits; if it comes back, all of them wait for each other.
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

/// What a node records when it was given the last part of the roadmap.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RoadmapKnown {
    /// The node.
    pub node: NodeId,
}

/// What a node records of itself once in each cycle, when vertices are granted.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct NodeState {
    /// The planning cycle.
    pub cycle: u32,
    /// Rovers it plans for.
    pub rovers: u32,
    /// Max-plus iterations in this cycle.
    pub iterations: u32,
    /// Rovers that it kept from a vertex that their paths enter in this cycle.
    pub forced_stops: u32,
    /// Deadlocks confirmed in this cycle by its probes, other than the last named before.
    pub confirmed_deadlocks: u32,
    /// The last deadlock that it confirmed: each rover waits for the next, the last for the first.
    pub deadlock: Vec<RoverId>,
    /// Pairs of candidate paths that its processor was given to look at in this cycle.
    pub pairs: u64,
    /// Pairs of candidate paths in an iteration of max-plus, if it handed nothing over.
    pub load: u64,
    /// How many of these it handed over.
    pub handed: u64,
    /// The processor was still at work when the optimisation was over.
    pub late: bool,
}

/// What a deputy records when it begins to answer for another node's vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TakenOver {
    /// The node that is replaced.
    pub home: NodeId,
    /// The node that answers for its vertices.
    pub deputy: NodeId,
    /// The planning cycle.
    pub cycle: u32,
}
