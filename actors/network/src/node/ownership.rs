//! The safety protocol's side of a node, the same for all policies: beacons, departures, and what
//! has to be said again until it is heard.

use farside::prelude::*;
use farside_worlds::{NodeId, VertexId};

use super::Node;
use super::messages::Locations;
use crate::failover::FailoverRecord;
use crate::failover::messages::Content;
use crate::safety::messages::{Beacon, Departed, DepartedAck, Whereabouts};
use crate::safety::{OccupancyTable, Occupant};

impl Node {
    /// Takes in a fact about a rover.
    pub(super) fn hear(
        &mut self,
        ctx: &mut Context<'_, Self>,
        fact: &Whereabouts,
        goal: Option<VertexId>,
    ) {
        if self.base.failover.is_some() {
            ctx.durable::<FailoverRecord>().note(fact);
        }
        let news = ctx
            .durable::<OccupancyTable>()
            .hear(fact, goal, self.base.cycle);
        self.policy.heard(&self.base, ctx, fact, &news);
    }

    /// Repeats grants and departures that were not answered.
    pub(super) fn repeat(&mut self, ctx: &mut Context<'_, Self>) {
        for (vertex, held) in ctx.durable::<OccupancyTable>().unconfirmed(self.base.cycle) {
            self.base
                .send_grant(ctx, held.rover, held.step, Some(vertex));
        }
        let occupancy = ctx.durable::<OccupancyTable>();
        let stay_at_target = self.base.site.stay_at_target;
        let at_goal = |(v, held): &(VertexId, Occupant)| {
            !stay_at_target && held.arrived && held.goal == Some(*v)
        };
        let leaving: Vec<_> = occupancy
            .occupied()
            .filter(at_goal)
            .map(|(_, h)| h)
            .collect();
        for held in leaving {
            self.base.send_grant(ctx, held.rover, held.step + 1, None);
        }
        for duty in ctx.durable::<OccupancyTable>().duties().to_vec() {
            self.send_departed(ctx, duty.to, duty.whereabouts);
        }
    }

    /// Reports a departure to whoever answers for the vertices of `region`.
    fn send_departed(&mut self, ctx: &mut Context<'_, Self>, region: NodeId, fact: Whereabouts) {
        let (node, to) = (self.base.id, self.base.acting(region));
        if to != node {
            let whereabouts = fact;
            let message = Departed { node, whereabouts };
            self.base.tell(ctx, to, Content::Departed(message));
        } else if self.base.answers_for(region) {
            // It took over whom it had something to tell.
            self.hear(ctx, &fact, None);
            ctx.durable::<OccupancyTable>()
                .acknowledged(region, fact.rover, fact.step);
        }
    }
}

impl Handler<Beacon> for Node {
    fn handle(&mut self, beacon: Beacon, ctx: &mut Context<'_, Self>) -> Outcome {
        let fact = beacon.whereabouts;
        let goal = beacon.goal;
        // A rover's first beacon from here may already say that it leaves again: the duty to the
        // node that it came from arises all the same.
        let here = fact.vertex.filter(|&v| self.base.owns(v));
        let occupancy = ctx.durable::<OccupancyTable>();
        let expected = here
            .and_then(|v| occupancy.occupant(v))
            .is_some_and(|held| {
                held.rover == fact.rover && held.step == fact.step && !held.arrived
            });
        self.hear(ctx, &fact, Some(goal));
        if expected {
            self.base.report_departure(ctx, fact, beacon.previous);
        }
        if here == Some(goal) && fact.moving_to.is_none() && !self.base.site.stay_at_target {
            self.base.send_grant(ctx, fact.rover, fact.step + 1, None);
        }
        Ok(())
    }
}

impl Handler<Departed> for Node {
    fn handle(&mut self, message: Departed, ctx: &mut Context<'_, Self>) -> Outcome {
        let fact = message.whereabouts;
        self.hear(ctx, &fact, None);
        let ack = DepartedAck {
            node: self.base.id,
            rover: fact.rover,
            step: fact.step,
        };
        self.base.tell(ctx, message.node, Content::DepartedAck(ack));
        Ok(())
    }
}

impl Handler<DepartedAck> for Node {
    fn handle(&mut self, ack: DepartedAck, ctx: &mut Context<'_, Self>) -> Outcome {
        self.base.acknowledged(ctx, &ack);
        Ok(())
    }
}

impl Handler<Locations> for Node {
    fn handle(&mut self, message: Locations, ctx: &mut Context<'_, Self>) -> Outcome {
        let base = &mut self.base;
        if base.failover.is_some() {
            base.correct(ctx, &message);
        }
        if let Some(at) = base.neighbor(message.node) {
            let neighbor = &mut base.neighbors[at];
            if neighbor.located.is_none_or(|cycle| cycle < message.cycle) {
                neighbor.located = Some(message.cycle);
                neighbor.holdings = message.holdings;
                neighbor.load = message.load;
                neighbor.crowding = message.crowding;
                neighbor.answers = message.answers;
            }
        } else {
            base.located_afar(message);
        }
        Ok(())
    }
}
