//! Step 4, max-plus over the network: when a node iterates, and what it tells whom.
//!
//! A node goes on to the next iteration when all its neighbours' messages of this one are here, or
//! when they are overdue; vectors that did not come stay as they were last heard, at first zero. A
//! node whose vectors no longer change says so once and falls silent until something new comes in.

use farside::MatchKey;
use farside::prelude::*;
use farside_worlds::NodeId;

use super::{IterationOverdue, Node, Phase};
use crate::network::candidates::CandidatePath;
use crate::network::max_plus::MaxPlus as Problem;
use crate::network::messages::{CandidatePaths, MaxPlus, RoverId};
use crate::network::payoff::Payoffs;

/// A node's part in the optimisation of one cycle.
#[derive(Default)]
pub(super) struct Optimiser {
    problem: Option<Problem>,
    /// The last iteration made.
    pub(super) iteration: u32,
    running: bool,
    /// The last iteration changed nothing.
    settled: bool,
    /// Something came in since.
    dirty: bool,
    peers: Vec<Peer>,
    overdue: Option<TimerId>,
}

/// A neighbour that takes part.
struct Peer {
    node: NodeId,
    /// The last iteration heard of.
    heard: u32,
    /// It has nothing more to say, as far as is known here.
    settled: bool,
    /// It knows that this node has nothing more to say.
    told_settled: bool,
}

impl Optimiser {
    pub(super) fn reset(&mut self) {
        *self = Optimiser::default();
    }

    /// Begins with the node's own rovers.
    pub(super) fn pose(
        &mut self,
        node: NodeId,
        payoffs: Payoffs,
        tolerance: f32,
        rovers: Vec<(RoverId, Vec<CandidatePath>)>,
    ) {
        self.problem = Some(Problem::new(node, payoffs, tolerance, rovers));
    }

    /// How many rovers the node plans for.
    pub(super) fn rovers(&self) -> u32 {
        self.best().count() as u32
    }

    /// The best path of each own rover as things stand.
    pub(super) fn best(&self) -> impl Iterator<Item = (RoverId, &CandidatePath)> {
        self.problem.iter().flat_map(Problem::best)
    }

    fn peer(&mut self, node: NodeId) -> Option<&mut Peer> {
        self.peers.iter_mut().find(|peer| peer.node == node)
    }

    /// Something is to be computed.
    fn awake(&self) -> bool {
        self.running && (!self.settled || self.dirty)
    }

    /// All that this iteration waits for is here.
    fn ready(&self) -> bool {
        let iteration = self.iteration;
        let heard = |peer: &Peer| peer.settled || peer.heard >= iteration;
        self.peers.iter().all(heard)
    }
}

impl Node {
    /// The optimisation begins.
    pub(super) fn optimise(&mut self, ctx: &mut Context<'_, Self>) {
        let problem = self.optimiser.problem.as_ref();
        if problem.is_some_and(|problem| problem.best().next().is_some()) {
            self.optimiser.running = true;
            self.iterate(ctx);
            self.advance(ctx);
        }
    }

    /// Iterates as long as nothing is missing; then waits, but not for ever.
    fn advance(&mut self, ctx: &mut Context<'_, Self>) {
        while self.optimiser.awake() && self.optimiser.ready() {
            self.iterate(ctx);
        }
        if self.optimiser.awake() {
            if self.optimiser.overdue.is_none() {
                let timeout = self.site.config.iteration_timeout;
                self.optimiser.overdue = Some(ctx.timer(timeout, IterationOverdue));
            }
        } else if let Some(timer) = self.optimiser.overdue.take() {
            ctx.cancel(timer);
        }
    }

    /// One iteration, and its messages.
    fn iterate(&mut self, ctx: &mut Context<'_, Self>) {
        let optimiser = &mut self.optimiser;
        if let Some(timer) = optimiser.overdue.take() {
            ctx.cancel(timer);
        }
        let Some(problem) = &mut optimiser.problem else {
            return;
        };
        if optimiser.iteration >= self.site.config.max_iterations || problem.is_trivial() {
            optimiser.running = false;
            return;
        }
        optimiser.iteration += 1;
        optimiser.dirty = false;
        optimiser.settled = !problem.iterate();
        for peer in &mut optimiser.peers {
            let vectors = problem.changed_for(peer.node);
            let awaited = !optimiser.settled && !peer.settled;
            if vectors.is_empty() && peer.told_settled == optimiser.settled && !awaited {
                continue;
            }
            peer.told_settled = optimiser.settled;
            // New vectors wake it: an answer is to be expected.
            peer.settled &= vectors.is_empty();
            let at = self.neighbors.binary_search_by_key(&peer.node, |n| n.id);
            let Ok(at) = at else { continue };
            let key = MatchKey::new(self.cycle, optimiser.iteration);
            let message = MaxPlus {
                node: self.id,
                cycle: self.cycle,
                iteration: optimiser.iteration,
                settled: optimiser.settled,
                vectors,
            };
            ctx.send_keyed(self.neighbors[at].address, key, message);
        }
    }
}

impl Handler<CandidatePaths> for Node {
    fn handle(&mut self, message: CandidatePaths, ctx: &mut Context<'_, Self>) -> Outcome {
        let in_time = (Phase::Propose..=Phase::Optimise).contains(&self.phase);
        let optimiser = &mut self.optimiser;
        let Some(problem) = optimiser.problem.as_mut().filter(|_| in_time) else {
            return Ok(());
        };
        if message.cycle != self.cycle || optimiser.peers.iter().any(|p| p.node == message.node) {
            return Ok(());
        }
        let rovers = message.rovers.into_iter().map(|r| (r.rover, r.paths));
        problem.add(message.node, rovers.collect());
        optimiser.peers.push(Peer {
            node: message.node,
            heard: 0,
            settled: false,
            told_settled: false,
        });
        // It came late: the optimisation takes it in.
        if optimiser.running {
            optimiser.dirty = true;
            self.advance(ctx);
        } else if self.phase == Phase::Optimise && optimiser.iteration == 0 {
            self.optimise(ctx);
        }
        Ok(())
    }
}

impl Handler<MaxPlus> for Node {
    fn handle(&mut self, message: MaxPlus, ctx: &mut Context<'_, Self>) -> Outcome {
        let in_time = (Phase::Propose..=Phase::Optimise).contains(&self.phase);
        let optimiser = &mut self.optimiser;
        if message.cycle != self.cycle || !in_time {
            return Ok(());
        }
        let settled = optimiser.settled;
        let (iteration, node) = (message.iteration, message.node);
        let Some(peer) = optimiser.peer(node) else {
            return Ok(());
        };
        // Of reordered messages the older one has nothing to add.
        if peer.heard >= iteration {
            return Ok(());
        }
        peer.heard = iteration;
        peer.settled = message.settled;
        // It expects an answer to new vectors.
        peer.told_settled &= message.vectors.is_empty();
        if let Some(problem) = &mut optimiser.problem {
            for vector in &message.vectors {
                optimiser.dirty |= problem.receive(vector);
            }
        }
        // Who was silent, or late, joins the iteration that the others have reached.
        let reached = iteration.saturating_sub(u32::from(!settled));
        let limit = self.site.config.max_iterations;
        optimiser.iteration = optimiser.iteration.max(reached).min(limit);
        self.advance(ctx);
        Ok(())
    }
}

impl Handler<IterationOverdue> for Node {
    fn handle(&mut self, _timer: IterationOverdue, ctx: &mut Context<'_, Self>) -> Outcome {
        self.optimiser.overdue = None;
        if self.phase == Phase::Optimise && self.optimiser.awake() {
            self.iterate(ctx);
            self.advance(ctx);
        }
        Ok(())
    }
}
