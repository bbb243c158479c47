//! What nodes say to each other in a planning cycle of the policy `max-plus`, and what they record
//! of it.

use std::sync::Arc;

use farside_worlds::NodeId;
use serde::{Deserialize, Serialize};

use super::candidates::CandidatePath;
use crate::ids::RoverId;

/// What a node has to compute in an iteration of max-plus, in pairs of candidate paths, as it was
/// in the cycle before.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Load {
    /// Its own part, nothing handed over.
    pub pairs: u64,
    /// By how much its neighbours' parts, as it heard of them, are more than their processors can
    /// do: they all may want to hand over.
    pub claims: u64,
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
    pub paths: Arc<[CandidatePath]>,
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
    /// With `network.max_plus.outsourcing`: what the receiver is to make vectors of, from and to
    /// the same rovers. The values are of the speaker's paths: what each is worth to it, the
    /// receiver's vector to it left out.
    pub bases: Vec<Vector>,
    /// With `network.max_plus.anytime`: what the node's rovers would do as things stood before this
    /// iteration.
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
