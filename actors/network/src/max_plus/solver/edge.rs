//! An edge of the coordination graph: what two rovers' paths are worth together, and the messages
//! along it. Nearly all the time that planning takes is spent here.

use super::meetings::{Meetings, Paths};
use super::{Room, Rules};
use crate::max_plus::payoff::Payoffs;

/// How many columns of payoffs are worked on at once.
pub(super) const LANES: usize = 8;

/// Payoffs of one path of i with the next few of j.
type Lanes = [f32; LANES];

/// An edge (i, j) of the coordination graph at an own rover i.
#[derive(Debug)]
pub(super) struct Edge {
    /// How many paths i and j have.
    size: (usize, usize),
    /// Pairwise payoffs. Blocks of [`LANES`] paths of j, and within a block a row for each path
    /// of i: what a message needs comes in the order in which it lies in memory. Columns that
    /// only fill the last block are worth minus infinity.
    payoffs: Vec<Lanes>,
    /// The message from j: a value for each path of i.
    pub(super) incoming: Vec<f32>,
    /// The last message to j: a value for each path of j. Of an edge that is handed over its base:
    /// a value for each path of i, none before the first.
    pub(super) outgoing: Vec<f32>,
    /// The outgoing message changed in the last iteration.
    pub(super) changed: bool,
    /// The message to j is made by j's node, from its base.
    pub(super) handed: bool,
    /// What the message from j is made of here, if its node handed that over.
    taken: Option<Taken>,
}

/// What edges of the cycle before were made in, so that nothing is allocated for those of this one.
#[derive(Debug, Default)]
pub(super) struct Spare {
    payoffs: Vec<Lanes>,
    incoming: Vec<f32>,
    outgoing: Vec<f32>,
}

/// What j's node sent to have its message made here.
#[derive(Debug)]
struct Taken {
    /// What each path of j is worth without i's message, a block of payoffs' columns together.
    base: Vec<Lanes>,
    /// The message is still to be made from it, or on its way to it.
    due: bool,
}

impl Edge {
    /// The edge between two rovers with these paths, made in what `spare` has.
    pub(super) fn between(
        a: &Paths,
        b: &Paths,
        payoffs: &Payoffs,
        meetings: &mut Meetings,
        spare: Spare,
    ) -> Edge {
        let mut edge = Edge::blank((a.list.len(), b.list.len()), spare);
        a.meet(b, meetings);
        let rows = edge.size.0.max(1);
        let blocks = edge.payoffs.chunks_exact_mut(rows);
        let cycles = meetings.cycles.chunks_exact(rows);
        for ((block, cycles), columns) in blocks.zip(cycles).zip(b.list.chunks(LANES)) {
            let mut worth = [f32::NEG_INFINITY; LANES];
            for (worth, path) in worth.iter_mut().zip(columns) {
                *worth = path.payoff;
            }
            for ((row, path), cycles) in block.iter_mut().zip(&*a.list).zip(cycles) {
                *row = worth.map(|worth| path.payoff + worth);
                // Eight cycles as one number: only those that are not 0 are looked at.
                let mut left = u64::from_le_bytes(*cycles);
                while left > 0 {
                    let lane = left.trailing_zeros() as usize / LANES;
                    let cycle = u32::from(cycles[lane]);
                    row[lane] = payoffs.pairwise(row[lane], Some(cycle));
                    left &= !(0xff << (LANES * lane));
                }
            }
        }
        edge
    }

    /// An edge with no messages yet, and columns that are all worth minus infinity.
    fn blank(size: (usize, usize), spare: Spare) -> Edge {
        let Spare {
            mut payoffs,
            mut incoming,
            mut outgoing,
        } = spare;
        let blank = [f32::NEG_INFINITY; LANES];
        payoffs.clear();
        payoffs.resize(size.0 * size.1.div_ceil(LANES), blank);
        incoming.clear();
        incoming.resize(size.0, 0.0);
        outgoing.clear();
        outgoing.resize(size.1, 0.0);
        Edge {
            size,
            payoffs,
            incoming,
            outgoing,
            changed: false,
            handed: false,
            taken: None,
        }
    }

    /// What the next edge can be made in.
    pub(super) fn into_spare(self) -> Spare {
        Spare {
            payoffs: self.payoffs,
            incoming: self.incoming,
            outgoing: self.outgoing,
        }
    }

    /// Hands the message to j over to j's node. What that needs of the payoffs it makes itself;
    /// they are here only if they are asked for one by one.
    pub(super) fn hand_over(&mut self) {
        self.handed = true;
        self.outgoing.clear();
    }

    /// An edge that is handed over, and has no payoffs.
    pub(super) fn handed_over(size: (usize, usize)) -> Edge {
        Edge {
            size,
            payoffs: Vec::new(),
            incoming: vec![0.0; size.0],
            outgoing: Vec::new(),
            changed: false,
            handed: true,
            taken: None,
        }
    }

    /// The same edge as j sees it, with no messages yet.
    pub(super) fn transposed(&self, spare: Spare) -> Edge {
        let size = (self.size.1, self.size.0);
        let mut edge = Edge::blank(size, spare);
        let blocks = edge.payoffs.chunks_exact_mut(size.0.max(1));
        for (first, rows) in (0..).step_by(LANES).zip(blocks) {
            for (a, row) in rows.iter_mut().enumerate() {
                for (b, payoff) in (first..size.1).zip(row) {
                    *payoff = self.payoff(b, a);
                }
            }
        }
        edge
    }

    /// What path `a` of i and path `b` of j are worth together.
    pub(super) fn payoff(&self, a: usize, b: usize) -> f32 {
        self.payoffs[b / LANES * self.size.0 + a][b % LANES]
    }

    /// How many pairs of paths it has.
    pub(super) fn pairs(&self) -> u64 {
        (self.size.0 * self.size.1) as u64
    }

    /// How many pairs of paths an iteration looks at: for the message to j, and for the one from j.
    pub(super) fn work(&self) -> u64 {
        self.pairs() * (u64::from(!self.handed) + u64::from(self.taken.is_some()))
    }

    /// Takes what j's node has its message made of. False if it does not fit, or is no news. Who
    /// handed an edge over does not take it in return: a message is never passed on twice.
    pub(super) fn take(&mut self, base: &[f32]) -> bool {
        let fits = base.len() == self.size.1 && base.iter().all(|v| v.is_finite());
        if !fits || self.handed {
            return false;
        }
        let block = |values: &[f32]| {
            // What fills the last block meets payoffs of minus infinity.
            let mut lanes = [0.0; LANES];
            lanes[..values.len()].copy_from_slice(values);
            lanes
        };
        let base: Vec<Lanes> = base.chunks(LANES).map(block).collect();
        if self.taken.as_ref().is_some_and(|taken| taken.base == base) {
            return false;
        }
        self.taken = Some(Taken { base, due: true });
        true
    }

    /// Makes the message from j, as [`refresh`](Edge::refresh) would at j's node. True if it
    /// changed.
    pub(super) fn make_incoming(&mut self, rules: &Rules, fresh: &mut Vec<f32>) -> bool {
        let Some(taken) = self.taken.as_mut().filter(|taken| taken.due) else {
            return false;
        };
        fresh.clear();
        for a in 0..self.size.0 {
            let mut best = [f32::NEG_INFINITY; LANES];
            let rows = self.payoffs[a..].iter().step_by(self.size.0);
            for (base, row) in taken.base.iter().zip(rows) {
                for ((best, worth), payoff) in best.iter_mut().zip(base).zip(row) {
                    let value = worth + payoff;
                    *best = if value > *best { value } else { *best };
                }
            }
            fresh.push(best.into_iter().fold(f32::NEG_INFINITY, f32::max));
        }
        let changed = settle(fresh, &self.incoming, rules);
        if changed {
            self.incoming.copy_from_slice(fresh);
        }
        // A damped message goes on to approach what it was made of.
        taken.due = changed && rules.damping > 0.0;
        changed
    }

    /// Takes a message from j. False if it does not fit, or is no news.
    pub(super) fn hear(&mut self, values: &[f32]) -> bool {
        let fits = self.incoming.len() == values.len() && values.iter().all(|v| v.is_finite());
        if !fits || self.incoming == values {
            return false;
        }
        self.incoming.copy_from_slice(values);
        true
    }

    /// The message to j: the best that i can do for each path of j by what i's paths are worth in
    /// all (`room.total`), with j's own message left out; its mean is subtracted (on cyclic graphs
    /// messages would grow without bound). True if it changed.
    pub(super) fn refresh(&mut self, rules: &Rules, room: &mut Room) -> bool {
        let Room {
            total, base, fresh, ..
        } = room;
        base.clear();
        base.extend(total.iter().zip(&self.incoming).map(|(t, m)| t - m));
        if self.handed {
            let moved = |(new, old): (&f32, &f32)| (new - old).abs() > rules.tolerance;
            let is_first = self.outgoing.len() != base.len();
            self.changed = is_first || base.iter().zip(&self.outgoing).any(moved);
            if self.changed {
                self.outgoing.clone_from(base);
            }
            return self.changed;
        }
        fresh.clear();
        // Two blocks at a time: while one waits for the result of its last row, the other goes on.
        let rows = self.size.0.max(1);
        let mut pairs = self.payoffs.chunks_exact(2 * rows);
        for pair in &mut pairs {
            fresh.extend(best_of::<2>(base, pair).as_flattened());
        }
        if !pairs.remainder().is_empty() {
            fresh.extend(best_of::<1>(base, pairs.remainder()).as_flattened());
        }
        fresh.truncate(self.size.1);
        let changed = settle(fresh, &self.outgoing, rules);
        if changed {
            self.outgoing.copy_from_slice(fresh);
        }
        self.changed = changed;
        changed
    }
}

/// The most that a path of i and each of so many blocks of paths of j are worth together; `base` is
/// what i's paths are worth.
#[inline(always)]
fn best_of<const BLOCKS: usize>(base: &[f32], payoffs: &[Lanes]) -> [Lanes; BLOCKS] {
    let rows = base.len();
    let blocks: [&[Lanes]; BLOCKS] = std::array::from_fn(|at| &payoffs[at * rows..][..rows]);
    let mut best = [[f32::NEG_INFINITY; LANES]; BLOCKS];
    for (row, worth) in base.iter().enumerate() {
        for (best, block) in best.iter_mut().zip(&blocks) {
            for (best, payoff) in best.iter_mut().zip(&block[row]) {
                let value = worth + payoff;
                // Unlike `f32::max`, this compiles to one vector instruction: nothing is NaN.
                *best = if value > *best { value } else { *best };
            }
        }
    }
    best
}

/// Makes a message of what each path is worth at best: the mean subtracted, damped by the `old`
/// one. True if it changed.
fn settle(fresh: &mut [f32], old: &[f32], rules: &Rules) -> bool {
    let mean = fresh.iter().sum::<f32>() / fresh.len() as f32;
    let mut changed = false;
    for (new, old) in fresh.iter_mut().zip(old) {
        *new -= mean;
        if rules.damping > 0.0 {
            *new = rules.damping * old + (1.0 - rules.damping) * *new;
        }
        changed |= (*new - old).abs() > rules.tolerance;
    }
    changed
}
