//! The policy `max-plus`: the six steps of section 3.2 in each planning cycle. This file holds its
//! state and its clock; what a cycle does is in [`cycle`], max-plus in [`optimise`], admission in
//! [`admit`]. What helps it out of deadlocks, each behind a key of its own: [`gates`], [`probes`],
//! [`resolution`]; what evens out loads: [`balance`].

mod admit;
mod balance;
mod cycle;
mod gates;
mod optimise;
mod pacing;
mod probes;
mod resolution;
#[cfg(test)]
mod tests;

use std::any::Any;
use std::collections::BTreeMap;
use std::sync::Arc;

use farside::prelude::*;
use farside_actors::processor::Processor;
use farside_worlds::{NodeId, VertexId};
use serde::{Deserialize, Serialize};

use super::Node;
use super::base::Base;
use super::policy::{NodePolicy, Phase, PhaseBegins};
use super::reservations::Reservations;
use crate::ids::RoverId;
use crate::max_plus::assignment::Request;
use crate::max_plus::lng::LocalGraph;
use crate::safety::News;
use crate::safety::messages::Whereabouts;
use optimise::Optimiser;
use probes::Probes;
use resolution::Resolution;

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

/// A node's part in the algorithm.
pub(super) struct MaxPlusPolicy {
    /// The node's local neighbourhood graph.
    graph: Arc<LocalGraph>,
    /// The one over all regions that the node answers for, where it is another; and which regions.
    surveyed: Option<(Vec<NodeId>, Arc<LocalGraph>)>,
    phase: Phase,
    optimiser: Optimiser,
    /// Pairs of candidate paths in an iteration of the last cycle, if nothing was handed over.
    load: u64,
    /// Requests for this node's vertices in this cycle.
    requests: Vec<Request>,
    processor: Processor,
    /// Own rovers that leave their vertex in this cycle without accelerating.
    leaving: Vec<VertexId>,
    forced_stops: u32,
    /// Where rovers' paths of the cycle before led, with `network.max_plus.keep_bonus`.
    assigned: BTreeMap<RoverId, VertexId>,
    probes: Probes,
    resolution: Resolution,
    /// What carries the roadmap to nodes that are given it over the network.
    roadmap_carrier: Option<Reservations>,
}

impl MaxPlusPolicy {
    pub(super) fn new(base: &Base, graph: Arc<LocalGraph>, processor: Processor) -> Self {
        MaxPlusPolicy {
            processor,
            graph,
            surveyed: None,
            // A node that starts in the middle of a cycle waits for the next.
            phase: Phase::Admit,
            optimiser: Optimiser::default(),
            load: 0,
            requests: Vec::new(),
            leaving: Vec::new(),
            forced_stops: 0,
            assigned: BTreeMap::new(),
            probes: Probes::default(),
            resolution: Resolution::default(),
            roadmap_carrier: base.site.roadmap_from.map(|_| Reservations::default()),
        }
    }

    /// The graph to plan in: around all regions that this node answers for, as far as anybody does.
    pub(super) fn survey(&mut self, base: &Base) {
        let Some(failover) = &base.failover else {
            return;
        };
        let sensors = &base.site.sensors;
        let around =
            |&region: &NodeId| std::iter::once(region).chain(sensors.neighbors(region).to_vec());
        let all = |regions: &[NodeId]| {
            let mut all: Vec<NodeId> = regions.iter().flat_map(around).collect();
            all.sort_unstable();
            all.dedup();
            all
        };
        let open = |region: &NodeId| {
            let acting = failover.acting[region.0 as usize];
            base.answers_for(*region) || acting != base.id && !base.is_silent(acting)
        };
        let mut regions = all(&failover.regions);
        regions.retain(open);
        let graph = if regions == all(&[base.id]) {
            None
        } else {
            match &self.surveyed {
                Some((known, graph)) if *known == regions => Some((regions, graph.clone())),
                _ => {
                    let vertices = regions
                        .iter()
                        .flat_map(|&region| sensors.owned(region))
                        .copied();
                    let graph = LocalGraph::over(&base.site.roadmap, vertices.collect());
                    Some((regions, Arc::new(graph)))
                }
            }
        };
        self.surveyed = graph;
    }

    /// The graph that [`MaxPlusPolicy::survey`] has made.
    fn surveyed(&self) -> &LocalGraph {
        let other = self.surveyed.as_ref();
        other.map_or(&*self.graph, |(_, graph)| graph)
    }
}

impl NodePolicy for MaxPlusPolicy {
    fn open_cycle(&mut self, base: &Base, ctx: &mut Context<'_, Node>) {
        self.phase = Phase::Listen;
        let timing = &base.site.timing;
        for (phase, delay) in [
            (Phase::Locate, timing.exchange),
            (Phase::Propose, timing.exchange * 2),
            (Phase::Optimise, timing.exchange * 3),
            (Phase::Assign, timing.exchange * 3 + timing.optimisation),
            (Phase::Admit, timing.decided_after()),
        ] {
            ctx.timer(delay, PhaseBegins { phase });
        }
        self.requests.clear();
        self.leaving.clear();
        self.load = self.optimiser.load().0;
        self.optimiser.reset();
    }

    fn begin_cycle(&mut self, base: &Base, ctx: &mut Context<'_, Node>) {
        self.serve_queues(base, ctx);
    }

    fn begin_phase(&mut self, base: &Base, ctx: &mut Context<'_, Node>, phase: Phase) {
        self.phase = phase;
        match phase {
            Phase::Listen => {}
            Phase::Locate => {
                let load = self.told_load(base, ctx.now());
                let crowding = self.told_crowding(base, ctx);
                base.locate(ctx, load, crowding);
            }
            Phase::Propose => self.propose(base, ctx),
            Phase::Optimise => self.optimise(base, ctx),
            Phase::Assign => self.assign(base, ctx),
            Phase::Admit => self.admit(base, ctx),
        }
    }

    fn heard(
        &mut self,
        base: &Base,
        ctx: &mut Context<'_, Node>,
        _fact: &Whereabouts,
        news: &News,
    ) {
        for &vertex in &news.freed {
            self.freed(base, ctx, vertex);
        }
    }

    fn give_up(&mut self, vertices: &[VertexId]) {
        self.requests
            .retain(|r| vertices.binary_search(&r.vertex).is_err());
    }

    fn reservations(&mut self) -> Option<&mut Reservations> {
        self.roadmap_carrier.as_mut()
    }
}

impl Node {
    /// The policy, if it is this one, and the rest of the node.
    fn max_plus(&mut self) -> Option<(&mut MaxPlusPolicy, &Base)> {
        let policy: &mut dyn Any = &mut *self.policy;
        Some((policy.downcast_mut()?, &self.base))
    }
}
