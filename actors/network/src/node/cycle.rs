//! The steps of a planning cycle (*network-guided*, section 3.2) other than max-plus and
//! admission: entries, locations, candidate paths, assignments.

use farside::MatchKey;
use farside::prelude::*;
use farside_worlds::VertexId;

use super::{Node, Phase, PhaseBegins};
use crate::assignment::Request;
use crate::candidates::{CandidatePath, FirstStep, candidates};
use crate::config::Policy;
use crate::messages::{
    Assignment, Assignments, CandidatePaths, Content, Grant, Locations, RoverId, RoverPaths,
};
use crate::safety::{Ledger, Occupant};

impl Node {
    /// A cycle begins: what was lost is said again, and queues are served.
    pub(super) fn listen(&mut self, ctx: &mut Context<'_, Self>) {
        let timing = &self.site.timing;
        self.cycle = self.site.cycle_at(ctx.now());
        let knows_roadmap = self.knows_roadmap(ctx);
        if self.site.config.policy != Policy::Paper || !knows_roadmap {
            let phase = Phase::Listen;
            ctx.timer(self.site.until_next_cycle(ctx.now()), PhaseBegins { phase });
            if !knows_roadmap {
                return;
            }
            self.watch(ctx);
            self.repeat(ctx);
            self.apply(ctx);
            if self.takes_over() {
                // Silence tells; and who has lost a report is told again.
                self.locate(ctx);
            }
            return;
        }
        for (phase, delay) in [
            (Phase::Locate, timing.exchange),
            (Phase::Propose, timing.exchange * 2),
            (Phase::Optimise, timing.exchange * 3),
            (Phase::Assign, timing.exchange * 3 + timing.optimisation),
            (Phase::Admit, timing.decided_after()),
            (Phase::Listen, self.site.until_next_cycle(ctx.now())),
        ] {
            ctx.timer(delay, PhaseBegins { phase });
        }
        self.requests.clear();
        self.leaving.clear();
        self.load = self.optimiser.load().0;
        self.optimiser.reset();
        self.watch(ctx);
        self.repeat(ctx);
        let site = self.site.clone();
        for (entry, queue) in &site.queues {
            if !self.owns(*entry) || !self.lets_in(ctx, *entry, queue) {
                continue;
            }
            let released = ctx.durable::<Ledger>().release(*entry, queue, self.cycle);
            if let Some(rover) = released {
                self.send_grant(ctx, rover, 1, Some(*entry));
            }
        }
    }

    /// Whether the gate lets the next rover of a queue in.
    fn lets_in(&self, ctx: &mut Context<'_, Self>, entry: VertexId, queue: &[RoverId]) -> bool {
        ctx.durable::<Ledger>().next_in(entry, queue).is_some() && self.gate_is_open(ctx)
    }

    /// Repeats grants and departures that were not answered.
    fn repeat(&mut self, ctx: &mut Context<'_, Self>) {
        for (vertex, held) in ctx.durable::<Ledger>().unconfirmed(self.cycle) {
            self.send_grant(ctx, held.rover, held.step, Some(vertex));
        }
        let ledger = ctx.durable::<Ledger>();
        let stays = self.site.stays;
        let at_goal =
            |(v, held): &(VertexId, Occupant)| !stays && held.arrived && held.goal == Some(*v);
        let leaving: Vec<_> = ledger.occupied().filter(at_goal).map(|(_, h)| h).collect();
        for held in leaving {
            self.send_grant(ctx, held.rover, held.step + 1, None);
        }
        for duty in ctx.durable::<Ledger>().duties().to_vec() {
            self.send_departed(ctx, duty.to, duty.whereabouts);
        }
    }

    pub(crate) fn send_grant(
        &self,
        ctx: &mut Context<'_, Self>,
        rover: RoverId,
        step: u32,
        to: Option<VertexId>,
    ) {
        let node = self.id;
        ctx.send(self.rovers[rover.0 as usize], Grant { node, step, to });
    }

    /// Step 1.
    pub(super) fn locate(&mut self, ctx: &mut Context<'_, Self>) {
        if !self.spread(ctx) {
            return;
        }
        let message = Locations {
            node: self.id,
            cycle: self.cycle,
            holdings: ctx.durable::<Ledger>().holdings(),
            load: self.told_load(),
            crowding: self.told_crowding(ctx),
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

    /// Steps 2 and 3.
    pub(super) fn propose(&mut self, ctx: &mut Context<'_, Self>) {
        self.survey();
        self.probe(ctx);
        let rovers: Vec<_> = self
            .movable(ctx)
            .into_iter()
            .map(|(here, held, goal)| (held.rover, self.candidates(ctx, here, &held, goal)))
            .collect();
        if !rovers.is_empty() {
            let paths = |(rover, paths): &(RoverId, Vec<CandidatePath>)| RoverPaths {
                rover: *rover,
                paths: paths.clone(),
            };
            let message = CandidatePaths {
                node: self.id,
                cycle: self.cycle,
                rovers: rovers.iter().map(paths).collect(),
            };
            self.charge_sending(ctx.now(), &message);
            for neighbor in &self.neighbors {
                ctx.send_keyed(
                    neighbor.address,
                    MatchKey::new(self.cycle, 0),
                    message.clone(),
                );
            }
        }
        self.pose(ctx, rovers);
    }

    /// The rovers that this node plans for: on its vertices, with somewhere to go, and not known to
    /// hold their next vertex already.
    fn movable(&self, ctx: &mut Context<'_, Self>) -> Vec<(VertexId, Occupant, VertexId)> {
        let ledger = ctx.durable::<Ledger>();
        let mut movable = Vec::new();
        for (here, held) in ledger.occupied() {
            let Some(goal) = held.goal.filter(|&goal| held.arrived && goal != here) else {
                continue;
            };
            let is_next = |rover, step| rover == held.rover && step > held.step;
            let granted_here = ledger.occupied().any(|(_, o)| is_next(o.rover, o.step));
            let mut theirs = self.reports();
            if !granted_here && !theirs.any(|h| is_next(h.rover, h.step)) {
                movable.push((here, held, goal));
            }
        }
        movable
    }

    /// Step 2 for one rover, unary payoffs included.
    fn candidates(
        &self,
        ctx: &mut Context<'_, Self>,
        here: VertexId,
        held: &Occupant,
        goal: VertexId,
    ) -> Vec<CandidatePath> {
        let ledger = ctx.durable::<Ledger>();
        let occupied = |v| {
            if self.owns(v) {
                return ledger.occupant(v).is_some();
            }
            self.reports().any(|holding| holding.vertex == v)
        };
        if let Some(paths) = self.path_aside(here, held, occupied) {
            return paths;
        }
        let mut paths = candidates(self.surveyed(), here, goal, occupied);
        // Who was sent here goes back at no penalty.
        let previous = held.previous.filter(|_| !self.was_sent(held.rover, here));
        let key = u64::from(self.cycle) << 32 | u64::from(held.rover.0);
        let here_now = ctx.durable::<Ledger>().occupied().count();
        let mut draws = ctx.random_at("payoff_noise", key).stream();
        for path in &mut paths {
            let noise = draws.uniform_in(0.0, self.site.config.noise);
            let (roadmap, payoffs) = (&self.site.roadmap, &self.site.payoffs);
            path.payoff = payoffs.unary(roadmap, path, goal, previous, noise);
            path.payoff -= self.congestion(path, here_now) as f32;
        }
        paths
    }

    /// Step 5: the best paths as things stand.
    pub(super) fn assign(&mut self, ctx: &mut Context<'_, Self>) {
        let ledger = ctx.durable::<Ledger>();
        let mut rovers = Vec::new();
        for (rover, path) in self.optimiser.best() {
            let here = path.vertices[0];
            let still_here = |o: &&Occupant| o.rover == rover && o.arrived;
            let Some(held) = ledger.occupant(here).filter(still_here) else {
                continue;
            };
            if path.first_step() != FirstStep::Stay {
                rovers.push(Assignment {
                    rover,
                    step: held.step + 1,
                    waited: self.cycle.saturating_sub(held.since),
                    path: path.clone(),
                });
            }
        }
        for assignment in &rovers {
            let first = assignment.path.first_step();
            let follows = matches!(first, FirstStep::Follow(_));
            if !follows || self.site.config.acceleration_chains {
                self.leaving.push(assignment.path.vertices[0]);
            }
            self.file(assignment);
        }
        if rovers.is_empty() {
            return;
        }
        let message = Assignments {
            node: self.id,
            cycle: self.cycle,
            rovers,
        };
        for neighbor in &self.neighbors {
            ctx.send_keyed(
                neighbor.address,
                MatchKey::new(self.cycle, 0),
                message.clone(),
            );
        }
        self.tell_partners(ctx, &Content::Assignments(message));
    }

    /// Keeps what an assignment asks of this node.
    pub(super) fn file(&mut self, assignment: &Assignment) {
        let request = Request::of(assignment);
        // A link may have made two of one message.
        let is_new = |r: &Request| self.owns(r.vertex) && !self.requests.contains(r);
        let request = request.filter(is_new);
        self.requests.extend(request);
    }
}
