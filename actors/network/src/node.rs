//! The sensor node: plans for the rovers on its vertices and admits rovers to them. This file holds
//! its state, its clock and the dispatch of messages; what a cycle does is in [`cycle`], max-plus in
//! [`optimise`], admission in [`admit`]. What helps the paper's policy out of standstills, each behind
//! a key of its own: [`gates`], [`probes`], [`resolution`]; what evens out loads:
//! [`balance`].

mod admit;
mod balance;
mod cycle;
mod gates;
mod optimise;
mod pacing;
mod probes;
mod resolution;
mod takeover;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use farside::prelude::*;
use farside_worlds::{NodeId, VertexId};
use serde::{Deserialize, Serialize};

use super::assemble::Site;
use super::assignment::Request;
use super::config::Policy;
use super::lng::LocalGraph;
use super::messages::{
    Account, Aside, Assignments, Beacon, CandidatePaths, Departed, DepartedAck, Holding, Load,
    Locations, MaxPlus, Passed, Replaced, Resolve, WaitProbe,
};
use super::reservation::messages::{ItineraryAnswer, Relay};
use super::reservation::{Atlas, RegistryDue};
use super::rover::Rover;
use super::safety::Ledger;
use optimise::Optimiser;
use probes::Probes;
use resolution::Resolution;
use takeover::Wards;

/// A sensor node of the network-guided system: runs the six steps of section 3.2 in each planning
/// cycle, and owns vertices by the safety protocol.
///
/// Its record of who holds its vertices is durable; what it plans is not.
pub struct Node {
    pub(super) site: Arc<Site>,
    pub(super) id: NodeId,
    graph: Arc<LocalGraph>,
    pub(super) neighbors: Vec<Neighbor>,
    pub(super) rovers: Vec<Address<Rover>>,
    pub(super) cycle: u32,
    phase: Phase,
    optimiser: Optimiser,
    /// Pairs of candidate paths in an iteration of the last cycle, if nothing was handed over.
    load: u64,
    /// Requests for this node's vertices in this cycle.
    requests: Vec<Request>,
    /// Own rovers that leave their vertex in this cycle without accelerating.
    leaving: Vec<VertexId>,
    forced_stops: u32,
    /// Who answers for which node's vertices, with `network.takeover_after`.
    wards: Option<Wards>,
    probes: Probes,
    resolution: Resolution,
    /// When the timer of the `complete` policy fires \[ns\].
    pub(super) alarm: Option<(u64, TimerId)>,
}

/// What a node knows of a neighbour.
pub(super) struct Neighbor {
    id: NodeId,
    pub(super) address: Address<Node>,
    /// The latest cycle in which it told its locations, and what it told.
    located: Option<u32>,
    holdings: Vec<Holding>,
    /// What else it told with its locations.
    load: Option<Load>,
    crowding: Option<f64>,
    answers: Vec<NodeId>,
}

/// The parts of a planning cycle, in order. A timer begins each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(crate) enum Phase {
    /// Beacons arrive; the entry queues are served.
    Listen,
    /// Step 1: locations are exchanged.
    Locate,
    /// Steps 2 and 3: candidate paths.
    Propose,
    /// Step 4: max-plus.
    Optimise,
    /// Step 5: assignments are exchanged.
    Assign,
    /// Step 6: vertices are granted.
    Admit,
}

/// Timer: a phase of the cycle begins.
#[derive(Serialize, Deserialize)]
#[doc(hidden)]
pub struct PhaseBegins {
    phase: Phase,
}

/// Timer: neighbours' vectors are overdue.
#[derive(Serialize, Deserialize)]
#[doc(hidden)]
pub struct IterationOverdue;

/// Timer: the processor is done with payoffs or an iteration of max-plus in this cycle.
#[derive(Serialize, Deserialize)]
#[doc(hidden)]
pub struct ProcessorDone {
    cycle: u32,
}

impl Node {
    pub(crate) fn new(site: Arc<Site>, id: NodeId, graph: Arc<LocalGraph>) -> Self {
        Node {
            site,
            id,
            graph,
            neighbors: Vec::new(),
            rovers: Vec::new(),
            cycle: 0,
            // A node that starts in the middle of a cycle waits for the next.
            phase: Phase::Admit,
            optimiser: Optimiser::default(),
            load: 0,
            requests: Vec::new(),
            leaving: Vec::new(),
            forced_stops: 0,
            wards: None,
            probes: Probes::default(),
            resolution: Resolution::default(),
            alarm: None,
        }
    }

    pub(super) fn neighbor(&self, id: NodeId) -> Option<usize> {
        self.neighbors.binary_search_by_key(&id, |n| n.id).ok()
    }

    /// Whether there is anything to reserve, or to be given over the network.
    fn keeps_registry(&self) -> bool {
        self.site.config.policy != Policy::Paper || self.site.roadmap_from.is_some()
    }

    /// Whether it may take part: where nodes are given the roadmap over the network, only with all of it.
    pub(super) fn knows_roadmap(&self, ctx: &mut Context<'_, Self>) -> bool {
        let source = self.site.roadmap_from;
        source.is_none() || ctx.durable::<Atlas>().is_known(source)
    }

    /// Whether it answers for `v`: its own vertex, or one that it took over.
    fn owns(&self, v: VertexId) -> bool {
        self.answers_for(self.site.sensors.owner(v))
    }
}

impl Actor for Node {
    type Accepts = (
        Beacon,
        Departed,
        DepartedAck,
        Locations,
        CandidatePaths,
        MaxPlus,
        Assignments,
        PhaseBegins,
        IterationOverdue,
        Relay,
        RegistryDue,
        WaitProbe,
        Resolve,
        Aside,
        ProcessorDone,
        Account,
        Replaced,
        Passed,
        ItineraryAnswer,
    );

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        for &id in self.site.sensors.neighbors(self.id) {
            self.neighbors.push(Neighbor {
                id,
                address: ctx.lookup::<Node>(&self.site.node_names[id.0 as usize])?,
                located: None,
                holdings: Vec::new(),
                load: None,
                crowding: None,
                answers: Vec::new(),
            });
        }
        for name in &self.site.rover_names {
            self.rovers.push(ctx.lookup::<Rover>(name)?);
        }
        self.open_wards(ctx);
        // A node that was replaced has no vertices of its own any more.
        let owned: &[VertexId] = match self.answers_for(self.id) {
            true => self.site.sensors.owned(self.id),
            false => &[],
        };
        let ledger = ctx.durable::<Ledger>();
        let is_new = ledger.is_new();
        ledger.open(owned, self.rovers.len());
        for (rover, vertex) in self.site.standing().filter(|_| is_new) {
            let goal = self.site.missions[rover.0 as usize].1;
            ledger.stand(vertex, rover, goal);
        }
        if self.keeps_registry() {
            self.open_registry(ctx);
        }
        // The first cycle begins at once; after a restart, the next.
        let delay = if ctx.now() == SimTime::ZERO {
            SimDuration::ZERO
        } else {
            self.site.until_next_cycle(ctx.now())
        };
        let phase = Phase::Listen;
        ctx.timer(delay, PhaseBegins { phase });
        Ok(())
    }
}

impl Handler<PhaseBegins> for Node {
    fn handle(&mut self, timer: PhaseBegins, ctx: &mut Context<'_, Self>) -> Outcome {
        self.phase = timer.phase;
        match timer.phase {
            Phase::Listen => self.listen(ctx),
            Phase::Locate => self.locate(ctx),
            Phase::Propose => self.propose(ctx),
            Phase::Optimise => self.optimise(ctx),
            Phase::Assign => self.assign(ctx),
            Phase::Admit => self.admit(ctx),
        }
        Ok(())
    }
}

impl Handler<Locations> for Node {
    fn handle(&mut self, message: Locations, ctx: &mut Context<'_, Self>) -> Outcome {
        if self.wards.is_some() {
            self.correct(ctx, &message);
        }
        if let Some(at) = self.neighbor(message.node) {
            let neighbor = &mut self.neighbors[at];
            if neighbor.located.is_none_or(|cycle| cycle < message.cycle) {
                neighbor.located = Some(message.cycle);
                neighbor.holdings = message.holdings;
                neighbor.load = message.load;
                neighbor.crowding = message.crowding;
                neighbor.answers = message.answers;
            }
        } else {
            self.located_afar(message);
        }
        Ok(())
    }
}
