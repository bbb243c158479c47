//! Step 4, max-plus over the network: when a node iterates, and what it tells whom.
//!
//! A node goes on to the next iteration when all its neighbours' messages of this one are here, or
//! when they are overdue; vectors that did not come stay as they were last heard, at first zero. A
//! node whose vectors no longer change says so once and falls silent until something new comes in.
//!
//! Over links with a bit rate it sends nothing before the last is on the air, and nothing that
//! comes too late: see [`pacing`].
//!
//! With a finite `network.max_plus.processor` all this takes time. A node compares candidate paths
//! as they come in, one neighbour's after the other's, and then iterates; an iteration takes what
//! is there as it begins, and its messages go out when it is done. What is not done when the
//! optimisation is over was in vain. A node may have neighbours make vectors for it: see `balance`.

use std::sync::Arc;

use farside::MatchKey;
use farside::prelude::*;
use farside_worlds::NodeId;

use super::{IterationOverdue, MaxPlusPolicy, ProcessorDone, pacing};
use crate::ids::RoverId;
use crate::max_plus::candidates::CandidatePath;
use crate::max_plus::messages::{CandidatePaths, Choice, MaxPlus};
use crate::max_plus::payoff::Payoffs;
use crate::max_plus::solver::{Room, Rules, Solver};
use crate::node::Node;
use crate::node::base::Base;
use crate::node::policy::Phase;

/// A node's part in the optimisation of one cycle.
#[derive(Default)]
pub(super) struct Optimiser {
    solver: Option<Solver>,
    /// What is left of the cycle before, until this one's problem is made.
    room: Room,
    /// The last iteration made.
    pub(super) iteration: u32,
    running: bool,
    /// The last iteration changed nothing.
    settled: bool,
    /// Something came in since.
    dirty: bool,
    peers: Vec<Peer>,
    overdue: Option<TimerId>,
    /// The processor is at work, and a timer tells when this is done.
    task: Option<Task>,
    /// When the payoffs of all candidate paths that came in are made.
    payoffs_done: SimTime,
    /// When what this node has sent to its neighbours in this cycle is on the air.
    sent: SimTime,
    /// When the optimisation is over.
    ends: SimTime,
    /// What neighbours were told that the own rovers would do.
    announced: Vec<Choice>,
    /// How many pairs of candidate paths each neighbour may be handed over.
    quotas: Vec<(NodeId, u64)>,
    /// Pairs of candidate paths that the processor was given in this cycle.
    pub(super) pairs: u64,
}

/// What a processor that takes time does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Task {
    /// It makes payoffs, or waits until what it sent is on the air; then comes the next iteration.
    Payoffs,
    /// It computes an iteration, after which nothing changed, or something did.
    Iteration { settled: bool },
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
        let room = self.solver.take().map(Solver::into_room);
        *self = Optimiser {
            room: room.unwrap_or_default(),
            ..Optimiser::default()
        };
    }

    /// How many rovers the node plans for.
    pub(super) fn rovers(&self) -> u32 {
        self.solver.as_ref().map_or(0, Solver::rovers) as u32
    }

    /// Pairs of candidate paths in an iteration, if nothing is handed over; and those that are.
    pub(super) fn load(&self) -> (u64, u64) {
        let of = |solver: &Solver| (solver.pairs_of_its_own(), solver.handed());
        self.solver.as_ref().map_or((0, 0), of)
    }

    /// What the processor is at will not be done in time.
    pub(super) fn is_at_work(&self) -> bool {
        self.task.is_some()
    }

    /// The path of each own rover as things stand.
    pub(super) fn best(&self) -> Vec<(RoverId, &CandidatePath)> {
        let converged = self.settled && self.peers.iter().all(|peer| peer.settled);
        self.solver
            .as_ref()
            .map_or_else(Vec::new, |solver| solver.best(converged))
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

impl MaxPlusPolicy {
    /// Begins with the node's own rovers.
    pub(super) fn pose(
        &mut self,
        base: &Base,
        ctx: &Context<'_, Node>,
        rovers: Vec<(RoverId, Arc<[CandidatePath]>)>,
    ) {
        let config = &base.site.config;
        let rules = Rules {
            tolerance: config.max_plus.convergence as f32,
            damping: config.max_plus.damping as f32,
            anytime: config.max_plus.anytime,
        };
        let payoffs: Payoffs = base.site.payoffs;
        let room = std::mem::take(&mut self.optimiser.room);
        self.optimiser.quotas = self.quotas(base, ctx.now(), &rovers);
        self.optimiser.solver = Some(Solver::new(payoffs, rules, room, rovers));
        self.charge_payoffs(ctx);
    }

    /// Candidate paths are being sent to all neighbours.
    pub(super) fn charge_sending(&mut self, base: &Base, now: SimTime, message: &CandidatePaths) {
        self.optimiser.sent = now + pacing::paths_take(&base.site.timing, message);
    }

    /// The processor has more candidate paths to compare.
    fn charge_payoffs(&mut self, ctx: &Context<'_, Node>) {
        let (optimiser, processor) = (&mut self.optimiser, &self.processor);
        let pairs = optimiser.solver.as_mut().map_or(0, Solver::take_compared);
        optimiser.pairs += pairs;
        let begins = optimiser.payoffs_done.max(ctx.now());
        optimiser.payoffs_done = begins + processor.time_for(begins, pairs);
    }

    /// The optimisation begins.
    pub(super) fn optimise(&mut self, base: &Base, ctx: &mut Context<'_, Node>) {
        if self.optimiser.rovers() > 0 {
            self.optimiser.running = true;
            let left = base.site.timing.decided_after() - base.site.timing.exchange;
            self.optimiser.ends = base.site.cycle_start(base.cycle) + left;
            self.iterate(base, ctx);
            self.advance(base, ctx);
        }
    }

    /// Iterates as long as nothing is missing; then waits, but not for ever.
    fn advance(&mut self, base: &Base, ctx: &mut Context<'_, Node>) {
        let free = |optimiser: &Optimiser| optimiser.awake() && optimiser.task.is_none();
        while free(&self.optimiser) && self.optimiser.ready() {
            self.iterate(base, ctx);
        }
        if free(&self.optimiser) {
            if self.optimiser.overdue.is_none() {
                let timeout = base.site.timing.iteration_timeout;
                self.optimiser.overdue = Some(ctx.timer(timeout, IterationOverdue));
            }
        } else if let Some(timer) = self.optimiser.overdue.take() {
            ctx.cancel(timer);
        }
    }

    /// Begins an iteration, and is done with it at once if the processor takes no time.
    fn iterate(&mut self, base: &Base, ctx: &mut Context<'_, Node>) {
        let (optimiser, config) = (&mut self.optimiser, &base.site.config);
        if let Some(timer) = optimiser.overdue.take() {
            ctx.cancel(timer);
        }
        let Some(solver) = &mut optimiser.solver else {
            return;
        };
        if optimiser.iteration >= config.max_plus.max_iterations || solver.is_trivial() {
            optimiser.running = false;
            return;
        }
        let cycle = base.cycle;
        let pairs = solver.pairs();
        let takes = self.processor.time_for(ctx.now(), pairs);
        let takes = takes.max(config.max_plus.iteration_time);
        let left = |until: SimTime| until.since(until.min(ctx.now()));
        // Its messages are to go out when the last are on the air, and not to be older than that.
        let idle = left(optimiser.sent).saturating_sub(takes);
        let left = left(optimiser.payoffs_done).max(idle);
        if !left.is_zero() {
            optimiser.task = Some(Task::Payoffs);
            ctx.timer(left, ProcessorDone { cycle });
            return;
        }
        optimiser.dirty = false;
        let settled = !solver.compute();
        optimiser.pairs += pairs;
        if takes.is_zero() {
            self.complete(base, ctx, settled);
        } else {
            optimiser.task = Some(Task::Iteration { settled });
            ctx.timer(takes, ProcessorDone { cycle });
        }
    }

    /// An iteration is computed: its messages go out.
    fn complete(&mut self, base: &Base, ctx: &mut Context<'_, Node>, settled: bool) {
        let (optimiser, timing) = (&mut self.optimiser, base.site.timing);
        let Some(solver) = &mut optimiser.solver else {
            return;
        };
        solver.deliver();
        let choices = solver.choices();
        // Others judge their paths by these.
        let rethought = choices != optimiser.announced;
        optimiser.iteration += 1;
        optimiser.settled = settled;
        for peer in &mut optimiser.peers {
            let (vectors, bases) = solver.changed_for(peer.node);
            let is_silent = vectors.is_empty() && bases.is_empty();
            let awaited = !optimiser.settled && !peer.settled;
            let told = peer.told_settled == optimiser.settled && !rethought;
            if is_silent && told && !awaited {
                continue;
            }
            let at = base.neighbors.binary_search_by_key(&peer.node, |n| n.id);
            let Ok(at) = at else { continue };
            let key = MatchKey::new(base.cycle, optimiser.iteration);
            let message = MaxPlus {
                node: base.id,
                cycle: base.cycle,
                iteration: optimiser.iteration,
                settled: optimiser.settled,
                vectors,
                bases,
                choices: choices.clone(),
            };
            let sent = ctx.now() + pacing::vectors_take(&timing, &message);
            if timing.rate_bit_per_s.is_some() && sent >= optimiser.ends {
                continue;
            }
            optimiser.sent = optimiser.sent.max(sent);
            peer.told_settled = optimiser.settled;
            // New vectors wake it: an answer is to be expected.
            peer.settled &= is_silent;
            ctx.send_keyed(base.neighbors[at].address, key, message);
        }
        optimiser.announced = choices;
    }
}

impl MaxPlusPolicy {
    fn take_paths(&mut self, base: &Base, ctx: &mut Context<'_, Node>, message: CandidatePaths) {
        let in_time = (Phase::Propose..=Phase::Optimise).contains(&self.phase);
        let optimiser = &mut self.optimiser;
        let Some(solver) = optimiser.solver.as_mut().filter(|_| in_time) else {
            return;
        };
        if message.cycle != base.cycle || optimiser.peers.iter().any(|p| p.node == message.node) {
            return;
        }
        let rovers = message.rovers.into_iter().map(|r| (r.rover, r.paths));
        let quotas = optimiser.quotas.iter();
        let quota = quotas.filter(|quota| quota.0 == message.node).map(|q| q.1);
        solver.add(message.node, rovers.collect(), quota.sum());
        optimiser.peers.push(Peer {
            node: message.node,
            heard: 0,
            settled: false,
            told_settled: false,
        });
        self.charge_payoffs(ctx);
        let optimiser = &mut self.optimiser;
        // It came late: the optimisation takes it in.
        if optimiser.running {
            optimiser.dirty = true;
            self.advance(base, ctx);
        } else if self.phase == Phase::Optimise && optimiser.iteration == 0 {
            self.optimise(base, ctx);
        }
    }
}

impl Handler<CandidatePaths> for Node {
    fn handle(&mut self, message: CandidatePaths, ctx: &mut Context<'_, Node>) -> Outcome {
        if let Some((policy, base)) = self.max_plus() {
            policy.take_paths(base, ctx, message);
        }
        Ok(())
    }
}

impl MaxPlusPolicy {
    fn take_vectors(&mut self, base: &Base, ctx: &mut Context<'_, Node>, message: MaxPlus) {
        let in_time = (Phase::Propose..=Phase::Optimise).contains(&self.phase);
        let optimiser = &mut self.optimiser;
        if message.cycle != base.cycle || !in_time {
            return;
        }
        let settled = optimiser.settled;
        let (iteration, node) = (message.iteration, message.node);
        let Some(peer) = optimiser.peer(node) else {
            return;
        };
        // Of reordered messages the older one has nothing to add.
        if peer.heard >= iteration {
            return;
        }
        peer.heard = iteration;
        peer.settled = message.settled;
        // It expects an answer to new vectors.
        peer.told_settled &= message.vectors.is_empty() && message.bases.is_empty();
        if let Some(solver) = &mut optimiser.solver {
            for vector in &message.vectors {
                optimiser.dirty |= solver.receive(vector);
            }
            for base in &message.bases {
                optimiser.dirty |= solver.take(base);
            }
            for choice in &message.choices {
                solver.note(choice);
            }
        }
        // Who was silent, or late, joins the iteration that the others have reached.
        let reached = iteration.saturating_sub(u32::from(!settled));
        let limit = base.site.config.max_plus.max_iterations;
        optimiser.iteration = optimiser.iteration.max(reached).min(limit);
        self.advance(base, ctx);
    }
}

impl Handler<MaxPlus> for Node {
    fn handle(&mut self, message: MaxPlus, ctx: &mut Context<'_, Node>) -> Outcome {
        if let Some((policy, base)) = self.max_plus() {
            policy.take_vectors(base, ctx, message);
        }
        Ok(())
    }
}

impl MaxPlusPolicy {
    fn processor_done(&mut self, base: &Base, ctx: &mut Context<'_, Node>, timer: ProcessorDone) {
        if timer.cycle != base.cycle || self.phase != Phase::Optimise {
            return;
        }
        match self.optimiser.task.take() {
            Some(Task::Payoffs) => self.iterate(base, ctx),
            Some(Task::Iteration { settled }) => self.complete(base, ctx, settled),
            None => {}
        }
        self.advance(base, ctx);
    }
}

impl Handler<ProcessorDone> for Node {
    fn handle(&mut self, timer: ProcessorDone, ctx: &mut Context<'_, Node>) -> Outcome {
        if let Some((policy, base)) = self.max_plus() {
            policy.processor_done(base, ctx, timer);
        }
        Ok(())
    }
}

impl MaxPlusPolicy {
    fn iteration_overdue(
        &mut self,
        base: &Base,
        ctx: &mut Context<'_, Node>,
        _timer: IterationOverdue,
    ) {
        self.optimiser.overdue = None;
        if self.phase == Phase::Optimise && self.optimiser.awake() {
            self.iterate(base, ctx);
            self.advance(base, ctx);
        }
    }
}

impl Handler<IterationOverdue> for Node {
    fn handle(&mut self, timer: IterationOverdue, ctx: &mut Context<'_, Node>) -> Outcome {
        if let Some((policy, base)) = self.max_plus() {
            policy.iteration_overdue(base, ctx, timer);
        }
        Ok(())
    }
}
