//! Step 6: who is admitted to the node's vertices, and following closely (*network-guided*, section
//! 3.5).

use farside::prelude::*;
use farside_worlds::VertexId;

use super::MaxPlusPolicy;
use crate::config::Sabotage;
use crate::ids::RoverId;
use crate::max_plus::assignment::{Request, winner};
use crate::max_plus::messages::{Assignments, NodeState};
use crate::node::Node;
use crate::node::base::Base;
use crate::node::policy::Phase;
use crate::safety::OccupancyTable;

impl MaxPlusPolicy {
    /// Grants each free vertex to one of those whose paths enter it now.
    pub(super) fn admit(&mut self, base: &Base, ctx: &mut Context<'_, Node>) {
        self.forced_stops = 0;
        let mut wanted: Vec<VertexId> = self.requests.iter().map(|r| r.vertex).collect();
        wanted.sort_unstable();
        wanted.dedup();
        for vertex in wanted {
            self.sabotage(base, ctx, vertex);
            let is_move = |r: &&Request| r.vertex == vertex && !r.follows;
            let moves = self.requests.iter().filter(is_move).count() as u32;
            let admitted = self.admit_one(base, ctx, vertex, false);
            self.forced_stops += moves - u32::from(admitted);
            // A vertex that its occupant left since paths were made is free for who would follow.
            if moves == 0 {
                self.admit_one(base, ctx, vertex, true);
            }
        }
        let (load, handed) = self.optimiser.load();
        ctx.sample(&NodeState {
            cycle: base.cycle,
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
    fn admit_one(
        &mut self,
        base: &Base,
        ctx: &mut Context<'_, Node>,
        vertex: VertexId,
        follows: bool,
    ) -> bool {
        let occupancy = ctx.durable::<OccupancyTable>();
        while occupancy.occupant(vertex).is_none() {
            let asks = |r: &&Request| r.vertex == vertex && (follows || !r.follows);
            let all = self.requests.iter().filter(asks);
            let Some(best) = winner(all, base.site.config.max_plus.priority).copied() else {
                return false;
            };
            self.requests.retain(|r| *r != best);
            let (rover, step) = (best.rover, best.step);
            if occupancy.grant(vertex, rover, step, Some(best.from), base.cycle) {
                base.send_grant(ctx, rover, step, Some(vertex));
                self.presume_left(base, ctx, (rover, step), (best.from, vertex));
                return true;
            }
        }
        false
    }

    /// A vertex of this node is free again: those who wait for it in this cycle may have it, who
    /// would follow only if the one that left was to be followed.
    pub(super) fn freed(&mut self, base: &Base, ctx: &mut Context<'_, Node>, vertex: VertexId) {
        if self.phase != Phase::Admit {
            return;
        }
        let followed = base.site.config.max_plus.acceleration && self.leaving.contains(&vertex);
        self.admit_one(base, ctx, vertex, followed);
    }

    /// See [`Base::presume_left`].
    fn presume_left(
        &mut self,
        base: &Base,
        ctx: &mut Context<'_, Node>,
        step: (RoverId, u32),
        edge: (VertexId, VertexId),
    ) {
        for vertex in base.presume_left(ctx, step, edge) {
            self.freed(base, ctx, vertex);
        }
    }

    /// Grants an occupied vertex, now and then: what [`Sabotage::GrantOccupied`] is for.
    fn sabotage(&mut self, base: &Base, ctx: &mut Context<'_, Node>, vertex: VertexId) {
        let Sabotage::GrantOccupied(probability) = base.site.config.sabotage else {
            return;
        };
        let held = ctx.durable::<OccupancyTable>().occupant(vertex).is_some();
        if held && ctx.random("sabotage").chance(probability) {
            let asks = self.requests.iter().find(|r| r.vertex == vertex).copied();
            if let Some(Request {
                rover, step, from, ..
            }) = asks
            {
                let occupancy = ctx.durable::<OccupancyTable>();
                occupancy.force(vertex, rover, step, Some(from), base.cycle);
                base.send_grant(ctx, rover, step, Some(vertex));
            }
        }
    }
}

impl MaxPlusPolicy {
    fn take_assignments(&mut self, base: &Base, ctx: &mut Context<'_, Node>, message: Assignments) {
        if !base.knows_roadmap(ctx) {
            return;
        }
        let decided = self.phase == Phase::Admit;
        for assignment in &message.rovers {
            if !base.is_rover(assignment.rover) {
                continue;
            }
            if base.site.payoffs.keep > 0.0
                && let Some(end) = assignment.path.vertices.last()
            {
                // The rover may come to this node's vertices.
                self.assigned.insert(assignment.rover, *end);
            }
            if message.cycle == base.cycle && !decided {
                self.file(base, assignment);
                continue;
            }
            // Too late to be weighed against others. Granted if the vertex is free, so that
            // latency slows rovers down and does not stop them.
            let Some(request) = Request::of(assignment).filter(|r| base.owns(r.vertex)) else {
                continue;
            };
            let Request {
                rover,
                step,
                from,
                vertex,
                ..
            } = request;
            let occupancy = ctx.durable::<OccupancyTable>();
            if occupancy.grant(vertex, rover, step, Some(from), base.cycle) {
                base.send_grant(ctx, rover, step, Some(vertex));
                self.presume_left(base, ctx, (rover, step), (from, vertex));
            }
        }
    }
}

impl Handler<Assignments> for Node {
    fn handle(&mut self, message: Assignments, ctx: &mut Context<'_, Node>) -> Outcome {
        if let Some((policy, base)) = self.max_plus() {
            policy.take_assignments(base, ctx, message);
        }
        Ok(())
    }
}
