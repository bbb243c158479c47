//! The safety protocol's side of a node, the same for all policies: beacons, departures, and what has to
//! be said again until it is heard.

use farside::prelude::*;
use farside_worlds::{NodeId, VertexId};

use super::Node;
use super::messages::Locations;
use crate::failover::Charter;
use crate::failover::messages::Content;
use crate::safety::messages::{Beacon, Departed, DepartedAck, Whereabouts};
use crate::safety::{Ledger, Occupant};

impl Node {
    /// Takes in a fact about a rover.
    pub(super) fn hear(
        &mut self,
        ctx: &mut Context<'_, Self>,
        fact: &Whereabouts,
        goal: Option<VertexId>,
    ) {
        if self.base.wards.is_some() {
            ctx.durable::<Charter>().note(fact);
        }
        let news = ctx.durable::<Ledger>().hear(fact, goal, self.base.cycle);
        self.policy.heard(&self.base, ctx, fact, &news);
    }

    /// Repeats grants and departures that were not answered.
    pub(super) fn repeat(&mut self, ctx: &mut Context<'_, Self>) {
        for (vertex, held) in ctx.durable::<Ledger>().unconfirmed(self.base.cycle) {
            self.base
                .send_grant(ctx, held.rover, held.step, Some(vertex));
        }
        let ledger = ctx.durable::<Ledger>();
        let stays = self.base.site.stays;
        let at_goal =
            |(v, held): &(VertexId, Occupant)| !stays && held.arrived && held.goal == Some(*v);
        let leaving: Vec<_> = ledger.occupied().filter(at_goal).map(|(_, h)| h).collect();
        for held in leaving {
            self.base.send_grant(ctx, held.rover, held.step + 1, None);
        }
        for duty in ctx.durable::<Ledger>().duties().to_vec() {
            self.send_departed(ctx, duty.to, duty.whereabouts);
        }
    }

    /// Reports a departure to whoever answers for the vertices of `home`.
    fn send_departed(&mut self, ctx: &mut Context<'_, Self>, home: NodeId, fact: Whereabouts) {
        let (node, to) = (self.base.id, self.base.acting(home));
        if to != node {
            let whereabouts = fact;
            let message = Departed { node, whereabouts };
            self.base.tell(ctx, to, Content::Departed(message));
        } else if self.base.answers_for(home) {
            // It took over whom it had something to tell.
            self.hear(ctx, &fact, None);
            ctx.durable::<Ledger>()
                .acknowledged(home, fact.rover, fact.step);
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
        let ledger = ctx.durable::<Ledger>();
        let expected = here.and_then(|v| ledger.occupant(v)).is_some_and(|held| {
            held.rover == fact.rover && held.step == fact.step && !held.arrived
        });
        self.hear(ctx, &fact, Some(goal));
        if expected {
            self.base.report_departure(ctx, fact, beacon.previous);
        }
        if here == Some(goal) && fact.moving_to.is_none() && !self.base.site.stays {
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
        if base.wards.is_some() {
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
