//! Step 6: who is admitted to the node's vertices, and the safety protocol's side of it: beacons,
//! departures, following closely (*network-guided*, section 3.5).

use farside::prelude::*;
use farside_worlds::{NodeId, VertexId};

use super::{Node, Phase};
use crate::assignment::{Request, winner};
use crate::config::{Policy, Sabotage};
use crate::messages::{
    Assignments, Beacon, Content, Departed, DepartedAck, NodeState, RoverId, Whereabouts,
};
use crate::safety::{Duty, Ledger};
use crate::takeover::Charter;

impl Node {
    /// Grants each free vertex to one of those whose paths enter it now.
    pub(super) fn admit(&mut self, ctx: &mut Context<'_, Self>) {
        self.forced_stops = 0;
        let mut wanted: Vec<VertexId> = self.requests.iter().map(|r| r.vertex).collect();
        wanted.sort_unstable();
        wanted.dedup();
        for vertex in wanted {
            self.sabotage(ctx, vertex);
            let is_move = |r: &&Request| r.vertex == vertex && !r.follows;
            let moves = self.requests.iter().filter(is_move).count() as u32;
            let admitted = self.admit_one(ctx, vertex, false);
            self.forced_stops += moves - u32::from(admitted);
            // A vertex that its occupant left since paths were made is free for who would follow.
            if moves == 0 {
                self.admit_one(ctx, vertex, true);
            }
        }
        let (load, handed) = self.optimiser.load();
        ctx.sample(&NodeState {
            cycle: self.cycle,
            rovers: self.optimiser.rovers(),
            iterations: self.optimiser.iteration,
            forced_stops: self.forced_stops,
            confirmed_deadlocks: std::mem::take(&mut self.probes.confirmed),
            deadlock: self.probes.named.clone(),
            pairs: self.optimiser.pairs,
            load,
            handed,
            late: self.optimiser.is_at_work(),
        });
    }

    /// Admits the best of those that ask for `vertex`, if it is free. False if nobody is.
    fn admit_one(&mut self, ctx: &mut Context<'_, Self>, vertex: VertexId, follows: bool) -> bool {
        let ledger = ctx.durable::<Ledger>();
        while ledger.occupant(vertex).is_none() {
            let asks = |r: &&Request| r.vertex == vertex && (follows || !r.follows);
            let all = self.requests.iter().filter(asks);
            let Some(best) = winner(all, self.site.config.priority).copied() else {
                return false;
            };
            self.requests.retain(|r| *r != best);
            let (rover, step) = (best.rover, best.step);
            if ledger.grant(vertex, rover, step, Some(best.from), self.cycle) {
                self.send_grant(ctx, rover, step, Some(vertex));
                self.presume_left(ctx, (rover, step), best.from, vertex);
                return true;
            }
        }
        false
    }

    /// A vertex of this node is free again: those who wait for it in this cycle may have it, who
    /// would follow only if the one that left was to be followed.
    fn freed(&mut self, ctx: &mut Context<'_, Self>, vertex: VertexId) {
        if self.phase != Phase::Admit {
            return;
        }
        let followed = self.site.config.acceleration && self.leaving.contains(&vertex);
        self.admit_one(ctx, vertex, followed);
    }

    pub(super) fn hear(
        &mut self,
        ctx: &mut Context<'_, Self>,
        fact: &Whereabouts,
        goal: Option<VertexId>,
    ) {
        if self.wards.is_some() {
            ctx.durable::<Charter>().note(fact);
        }
        let news = ctx.durable::<Ledger>().hear(fact, goal, self.cycle);
        if self.site.config.policy != Policy::Paper {
            for &previous in &news.unheard {
                self.report_departure(ctx, *fact, Some(previous));
            }
            if !news.freed.is_empty() {
                self.departed(ctx, &news.freed);
            }
            return;
        }
        for vertex in news.freed {
            self.freed(ctx, vertex);
        }
    }

    /// Grants an occupied vertex, now and then: what [`Sabotage::GrantOccupied`] is for.
    fn sabotage(&mut self, ctx: &mut Context<'_, Self>, vertex: VertexId) {
        let Sabotage::GrantOccupied(probability) = self.site.config.sabotage else {
            return;
        };
        let held = ctx.durable::<Ledger>().occupant(vertex).is_some();
        if held && ctx.random("sabotage").chance(probability) {
            let asks = self.requests.iter().find(|r| r.vertex == vertex).copied();
            if let Some(Request {
                rover, step, from, ..
            }) = asks
            {
                let ledger = ctx.durable::<Ledger>();
                ledger.force(vertex, rover, step, Some(from), self.cycle);
                self.send_grant(ctx, rover, step, Some(vertex));
            }
        }
    }

    /// Takes the grant of a step for proof that it is being taken: what [`Sabotage::FreeOnGrant`] is
    /// for. Returns the vertex left if it is one of this node's, and free now.
    pub(crate) fn presume_left(
        &mut self,
        ctx: &mut Context<'_, Self>,
        (rover, step): (RoverId, u32),
        from: VertexId,
        to: VertexId,
    ) -> Option<VertexId> {
        if self.site.config.sabotage != Sabotage::FreeOnGrant {
            return None;
        }
        let presumed = Whereabouts {
            rover,
            step: step - 1,
            vertex: Some(from),
            moving_to: Some(to),
        };
        if !self.owns(from) {
            self.tell_departure(ctx, self.site.sensors.owner(from), presumed);
            return None;
        }
        let news = ctx.durable::<Ledger>().hear(&presumed, None, self.cycle);
        if self.site.config.policy == Policy::Paper {
            for &vertex in &news.freed {
                self.freed(ctx, vertex);
            }
        }
        news.freed.first().copied()
    }

    /// A rover came over from a neighbour's vertex: the neighbour has to know.
    fn report_departure(
        &mut self,
        ctx: &mut Context<'_, Self>,
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

    fn tell_departure(
        &mut self,
        ctx: &mut Context<'_, Self>,
        to: NodeId,
        whereabouts: Whereabouts,
    ) {
        ctx.durable::<Ledger>().take_on(Duty { to, whereabouts });
        self.send_departed(ctx, to, whereabouts);
    }

    pub(super) fn is_rover(&self, rover: RoverId) -> bool {
        (rover.0 as usize) < self.rovers.len()
    }
}

impl Handler<Beacon> for Node {
    fn handle(&mut self, beacon: Beacon, ctx: &mut Context<'_, Self>) -> Outcome {
        let fact = beacon.whereabouts;
        let goal = beacon.goal;
        // A rover's first beacon from here may already say that it leaves again: the duty to the
        // node that it came from arises all the same.
        let here = fact.vertex.filter(|&v| self.owns(v));
        let ledger = ctx.durable::<Ledger>();
        let expected = here.and_then(|v| ledger.occupant(v)).is_some_and(|held| {
            held.rover == fact.rover && held.step == fact.step && !held.arrived
        });
        self.hear(ctx, &fact, Some(goal));
        if expected {
            self.report_departure(ctx, fact, beacon.previous);
        }
        if here == Some(goal) && fact.moving_to.is_none() && !self.site.stays {
            self.send_grant(ctx, fact.rover, fact.step + 1, None);
        }
        Ok(())
    }
}

impl Handler<Departed> for Node {
    fn handle(&mut self, message: Departed, ctx: &mut Context<'_, Self>) -> Outcome {
        let fact = message.whereabouts;
        self.hear(ctx, &fact, None);
        let ack = DepartedAck {
            node: self.id,
            rover: fact.rover,
            step: fact.step,
        };
        self.tell(ctx, message.node, Content::DepartedAck(ack));
        Ok(())
    }
}

impl Handler<DepartedAck> for Node {
    fn handle(&mut self, ack: DepartedAck, ctx: &mut Context<'_, Self>) -> Outcome {
        self.acknowledged(ctx, &ack);
        Ok(())
    }
}

impl Handler<Assignments> for Node {
    fn handle(&mut self, message: Assignments, ctx: &mut Context<'_, Self>) -> Outcome {
        if !self.knows_roadmap(ctx) {
            return Ok(());
        }
        let decided = self.phase == Phase::Admit;
        for assignment in &message.rovers {
            if !self.is_rover(assignment.rover) {
                continue;
            }
            if message.cycle == self.cycle && !decided {
                self.file(assignment);
                continue;
            }
            // Too late to be weighed against others. Granted if the vertex is free, so that
            // latency slows rovers down and does not stop them.
            let Some(request) = Request::of(assignment).filter(|r| self.owns(r.vertex)) else {
                continue;
            };
            let Request {
                rover,
                step,
                from,
                vertex,
                ..
            } = request;
            let ledger = ctx.durable::<Ledger>();
            if ledger.grant(vertex, rover, step, Some(from), self.cycle) {
                self.send_grant(ctx, rover, step, Some(vertex));
                self.presume_left(ctx, (rover, step), from, vertex);
            }
        }
        Ok(())
    }
}
