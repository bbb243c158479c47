//! What every node has, whatever its policy: its vertices and neighbours, and the ways to say
//! something. What it says and hears of failover is in [`failover`](super::failover).

use std::sync::Arc;

use farside::LookupError;
use farside::MatchKey;
use farside::prelude::*;
use farside_worlds::{NodeId, VertexId};

use super::Node;
use super::failover::FailoverState;
use super::messages::Locations;
use crate::config::Sabotage;
use crate::failover::messages::Content;
use crate::ids::RoverId;
use crate::max_plus::messages::Load;
use crate::reservation::Atlas;
use crate::rover::Rover;
use crate::safety::messages::{Departed, Grant, Holding, Whereabouts};
use crate::safety::{Duty, OccupancyTable};
use crate::shared::Shared;

/// A node without its policy.
pub(super) struct Base {
    pub(super) site: Arc<Shared>,
    pub(super) id: NodeId,
    pub(super) neighbors: Vec<Neighbor>,
    /// Those of the whole team; none of one that does not take part.
    pub(super) rovers: Vec<Option<Address<Rover>>>,
    /// The planning cycle.
    pub(super) cycle: u32,
    /// Who answers for which node's vertices, with `network.failover_after`.
    pub(super) failover: Option<FailoverState>,
}

/// What a node knows of a neighbour.
pub(super) struct Neighbor {
    pub(super) id: NodeId,
    pub(super) address: Address<Node>,
    /// The latest cycle in which it told its locations, and what it told.
    pub(super) located: Option<u32>,
    pub(super) holdings: Vec<Holding>,
    /// What else it told with its locations.
    pub(super) load: Option<Load>,
    pub(super) crowding: Option<f64>,
    pub(super) answers: Vec<NodeId>,
}

impl Base {
    pub(super) fn new(site: Arc<Shared>, id: NodeId) -> Self {
        Base {
            site,
            id,
            neighbors: Vec::new(),
            rovers: Vec::new(),
            cycle: 0,
            failover: None,
        }
    }

    /// Looks up all that the node may send to.
    pub(super) fn look_up(&mut self, ctx: &Context<'_, Node>) -> Result<(), LookupError> {
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
        for (name, is_there) in self.site.rover_names.iter().zip(&self.site.takes_part) {
            let rover = is_there.then(|| ctx.lookup::<Rover>(name)).transpose()?;
            self.rovers.push(rover);
        }
        Ok(())
    }

    pub(super) fn neighbor(&self, id: NodeId) -> Option<usize> {
        self.neighbors.binary_search_by_key(&id, |n| n.id).ok()
    }

    /// Whether it may take part: where nodes are given the roadmap over the network, only with all
    /// of it.
    pub(super) fn knows_roadmap(&self, ctx: &mut Context<'_, Node>) -> bool {
        let source = self.site.roadmap_from;
        source.is_none() || ctx.durable::<Atlas>().is_known(source)
    }

    /// Whether it answers for `v`: its own vertex, or one that it took over.
    pub(super) fn owns(&self, v: VertexId) -> bool {
        self.answers_for(self.site.sensors.owner(v))
    }

    pub(super) fn is_rover(&self, rover: RoverId) -> bool {
        self.address(rover).is_some()
    }

    /// Where a rover hears, if it takes part.
    pub(super) fn address(&self, rover: RoverId) -> Option<Address<Rover>> {
        self.rovers.get(rover.0 as usize).copied().flatten()
    }

    pub(super) fn send_grant(
        &self,
        ctx: &mut Context<'_, Node>,
        rover: RoverId,
        step: u32,
        to: Option<VertexId>,
    ) {
        let node = self.id;
        if let Some(address) = self.address(rover) {
            ctx.send(address, Grant { node, step, to });
        }
    }

    /// Step 1: tells neighbours who is on the node's vertices, and what else its policy has to say.
    pub(super) fn locate(
        &self,
        ctx: &mut Context<'_, Node>,
        load: Option<Load>,
        crowding: Option<f64>,
    ) {
        if !self.spread(ctx) {
            return;
        }
        let message = Locations {
            node: self.id,
            cycle: self.cycle,
            holdings: ctx.durable::<OccupancyTable>().holdings(),
            load,
            crowding,
            answers: self.told_answers(),
        };
        for neighbor in &self.neighbors {
            ctx.send_keyed(
                neighbor.address,
                MatchKey::new(self.cycle, 0),
                message.clone(),
            );
        }
        self.tell_partners(ctx, &Content::Locations(message));
    }

    /// The same, for policies that have no exchange of locations: with failover, silence tells, and
    /// who has lost a report is told again.
    pub(super) fn locate_for_failover(&self, ctx: &mut Context<'_, Node>) {
        if self.takes_over() {
            self.locate(ctx, None, None);
        }
    }

    /// Takes the grant of a step for proof that it is being taken: what [`Sabotage::FreeOnGrant`]
    /// is for. Returns what is free because of that: the vertex left, if it is one of this node's.
    pub(super) fn presume_left(
        &self,
        ctx: &mut Context<'_, Node>,
        (rover, step): (RoverId, u32),
        (from, to): (VertexId, VertexId),
    ) -> Vec<VertexId> {
        if self.site.config.sabotage != Sabotage::FreeOnGrant {
            return Vec::new();
        }
        let presumed = Whereabouts {
            rover,
            step: step - 1,
            vertex: Some(from),
            moving_to: Some(to),
        };
        if !self.owns(from) {
            self.tell_departure(ctx, self.site.sensors.owner(from), presumed);
            return Vec::new();
        }
        ctx.durable::<OccupancyTable>()
            .hear(&presumed, None, self.cycle)
            .freed
    }

    /// A rover came over from a neighbour's vertex: the neighbour has to know.
    pub(super) fn report_departure(
        &self,
        ctx: &mut Context<'_, Node>,
        fact: Whereabouts,
        previous: Option<VertexId>,
    ) {
        let from = previous.map(|v| self.site.sensors.owner(v));
        let Some(to) = from.filter(|&owner| !self.answers_for(owner)) else {
            return;
        };
        // What is to be told is that it came here; where it goes next is another story.
        let whereabouts = Whereabouts {
            moving_to: None,
            ..fact
        };
        self.tell_departure(ctx, to, whereabouts);
    }

    pub(super) fn tell_departure(
        &self,
        ctx: &mut Context<'_, Node>,
        to: NodeId,
        whereabouts: Whereabouts,
    ) {
        ctx.durable::<OccupancyTable>()
            .take_on(Duty { to, whereabouts });
        let (node, acting) = (self.id, self.acting(to));
        if acting != node {
            let message = Departed { node, whereabouts };
            self.tell(ctx, acting, Content::Departed(message));
        }
    }
}
