//! The steps of a planning cycle (*network-guided*, section 3.2) other than max-plus and admission:
//! entries, candidate paths, assignments.

use std::sync::Arc;

use farside::MatchKey;
use farside::prelude::*;
use farside_worlds::VertexId;

use super::MaxPlusPolicy;
use crate::failover::messages::Content;
use crate::ids::RoverId;
use crate::max_plus::assignment::Request;
use crate::max_plus::candidates::{CandidatePath, FirstStep, candidates};
use crate::max_plus::messages::{Assignment, Assignments, CandidatePaths, RoverPaths};
use crate::node::Node;
use crate::node::base::Base;
use crate::safety::{OccupancyTable, Occupant};

impl MaxPlusPolicy {
    /// Serves the queues of the entries that the node owns.
    pub(super) fn serve_queues(&mut self, base: &Base, ctx: &mut Context<'_, Node>) {
        for (entry, queue) in &base.site.queues {
            if !base.owns(*entry) || !self.lets_in(base, ctx, *entry, queue) {
                continue;
            }
            let released = ctx
                .durable::<OccupancyTable>()
                .release(*entry, queue, base.cycle);
            if let Some(rover) = released {
                base.send_grant(ctx, rover, 1, Some(*entry));
            }
        }
    }

    /// Whether the gate lets the next rover of a queue in.
    fn lets_in(
        &self,
        base: &Base,
        ctx: &mut Context<'_, Node>,
        entry: VertexId,
        queue: &[RoverId],
    ) -> bool {
        ctx.durable::<OccupancyTable>()
            .next_in(entry, queue)
            .is_some()
            && self.gate_is_open(base, ctx)
    }

    /// Steps 2 and 3.
    pub(super) fn propose(&mut self, base: &Base, ctx: &mut Context<'_, Node>) {
        self.survey(base);
        self.probe(base, ctx);
        let mut rovers: Vec<(_, Arc<[_]>)> = Vec::new();
        for (here, held, goal) in self.movable(base, ctx) {
            let paths = self.candidates(base, ctx, here, &held, goal);
            rovers.push((held.rover, paths.into()));
        }
        if !rovers.is_empty() {
            let paths = |(rover, paths): &(RoverId, Arc<[CandidatePath]>)| RoverPaths {
                rover: *rover,
                paths: paths.clone(),
            };
            let message = CandidatePaths {
                node: base.id,
                cycle: base.cycle,
                rovers: rovers.iter().map(paths).collect(),
            };
            self.charge_sending(base, ctx.now(), &message);
            for neighbor in &base.neighbors {
                ctx.send_keyed(
                    neighbor.address,
                    MatchKey::new(base.cycle, 0),
                    message.clone(),
                );
            }
        }
        self.pose(base, ctx, rovers);
    }

    /// The rovers that this node plans for: on its vertices, with somewhere to go, and not known to
    /// hold their next vertex already.
    fn movable(
        &self,
        base: &Base,
        ctx: &mut Context<'_, Node>,
    ) -> Vec<(VertexId, Occupant, VertexId)> {
        let occupancy = ctx.durable::<OccupancyTable>();
        let mut movable = Vec::new();
        for (here, held) in occupancy.occupied() {
            let Some(goal) = held.goal.filter(|&goal| held.arrived && goal != here) else {
                continue;
            };
            let is_next = |rover, step| rover == held.rover && step > held.step;
            let granted_here = occupancy.occupied().any(|(_, o)| is_next(o.rover, o.step));
            let mut theirs = base.reports();
            if !granted_here && !theirs.any(|h| is_next(h.rover, h.step)) {
                movable.push((here, held, goal));
            }
        }
        movable
    }

    /// Step 2 for one rover, unary payoffs included.
    fn candidates(
        &self,
        base: &Base,
        ctx: &mut Context<'_, Node>,
        here: VertexId,
        held: &Occupant,
        goal: VertexId,
    ) -> Vec<CandidatePath> {
        let occupancy = ctx.durable::<OccupancyTable>();
        let occupied = |v| {
            if base.owns(v) {
                return occupancy.occupant(v).is_some();
            }
            base.reports().any(|holding| holding.vertex == v)
        };
        if let Some(paths) = self.path_aside(base, here, held, occupied) {
            return paths;
        }
        let mut paths = candidates(self.surveyed(), here, goal, occupied);
        // Who was sent here goes back at no penalty.
        let previous = held.previous.filter(|_| !self.was_sent(held.rover, here));
        let key = u64::from(base.cycle) << 32 | u64::from(held.rover.0);
        let here_now = ctx.durable::<OccupancyTable>().occupied().count();
        let mut draws = ctx.random_at("payoff_noise", key).stream();
        for path in &mut paths {
            let noise = draws.uniform_in(0.0, base.site.config.max_plus.noise);
            let (roadmap, payoffs) = (&base.site.roadmap, &base.site.payoffs);
            path.payoff = payoffs.unary(roadmap, path, goal, previous, noise);
            path.payoff -= self.congestion(base, path, here_now) as f32;
            if self.assigned.get(&held.rover) == path.vertices.last() {
                path.payoff += payoffs.keep as f32;
            }
        }
        paths
    }

    /// Step 5: the best paths as things stand.
    pub(super) fn assign(&mut self, base: &Base, ctx: &mut Context<'_, Node>) {
        let occupancy = ctx.durable::<OccupancyTable>();
        let mut rovers = Vec::new();
        let keeps = base.site.payoffs.keep > 0.0;
        for (rover, path) in self.optimiser.best() {
            if keeps && let Some(end) = path.vertices.last() {
                self.assigned.insert(rover, *end);
            }
            let here = path.vertices[0];
            let still_here = |o: &&Occupant| o.rover == rover && o.arrived;
            let Some(held) = occupancy.occupant(here).filter(still_here) else {
                continue;
            };
            if path.first_step() != FirstStep::Stay {
                rovers.push(Assignment {
                    rover,
                    step: held.step + 1,
                    waited: base.cycle.saturating_sub(held.since),
                    path: path.clone(),
                });
            }
        }
        for assignment in &rovers {
            let first = assignment.path.first_step();
            let follows = matches!(first, FirstStep::Follow(_));
            if !follows || base.site.config.max_plus.acceleration_chains {
                self.leaving.push(assignment.path.vertices[0]);
            }
            self.file(base, assignment);
        }
        if rovers.is_empty() {
            return;
        }
        let message = Assignments {
            node: base.id,
            cycle: base.cycle,
            rovers,
        };
        for neighbor in &base.neighbors {
            ctx.send_keyed(
                neighbor.address,
                MatchKey::new(base.cycle, 0),
                message.clone(),
            );
        }
        base.tell_partners(ctx, &Content::Assignments(message));
    }

    /// Keeps what an assignment asks of this node.
    pub(super) fn file(&mut self, base: &Base, assignment: &Assignment) {
        let request = Request::of(assignment);
        // A link may have made two of one message.
        let is_new = |r: &Request| base.owns(r.vertex) && !self.requests.contains(r);
        let request = request.filter(is_new);
        self.requests.extend(request);
    }
}
