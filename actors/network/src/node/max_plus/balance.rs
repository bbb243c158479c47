//! Even loads (*network-guided*, section 5, iii): work handed over to neighbours that have less of
//! it, and paths that lead away from crowds.
//!
//! **What is handed over.** A max-plus vector from rover i of one node to rover j of a neighbour is
//! the best that i can do for each path of j. What that takes beside the payoffs of the pair, which
//! both nodes can make, is one number for each path of i: what it is worth without j's own message.
//! A node that has too much to compute sends these instead of the vector, and j's node makes the
//! vector. It takes no more messages and about the same bytes; what is lost or late is missing as
//! the vector itself would be. In lockstep the same numbers come out, bit for bit.
//!
//! **To whom, and how much.** With its locations each node says how much it has to compute, and how
//! much more than they can do its neighbours had. Who has more than it can do fills up those with
//! less, as water would, and leaves room in each for the others that have a claim to it. A
//! neighbour that said nothing in this cycle is left alone. Work goes to a node that said less than
//! its own node did, by the same two numbers at both, and a vector is never passed on twice: so
//! nothing goes to and fro.

use std::sync::Arc;

use farside::prelude::*;
use farside_worlds::{NodeId, VertexId};

use super::MaxPlusPolicy;
use crate::ids::RoverId;
use crate::max_plus::candidates::{CandidatePath, Destination};
use crate::max_plus::messages::Load;
use crate::node::Node;
use crate::node::base::Base;
use crate::safety::OccupancyTable;

/// How many iterations a node should have time for: max-plus needs about so many to converge.
const ITERATIONS: u64 = 10;

/// A neighbour that may compute for others.
#[derive(Clone, Copy, Debug)]
struct Helper {
    /// What it has to compute itself, in pairs an iteration.
    pairs: u64,
    /// How much there is that it could be handed.
    usable: u64,
    /// By how much its neighbours have too much to do.
    claims: u64,
}

impl Helper {
    /// What a node with too much to do by `excess` hands it, to fill it up to `level`.
    fn takes(&self, level: u64, excess: u64) -> u64 {
        let room = u128::from(level.saturating_sub(self.pairs));
        let all = u128::from(self.claims.max(excess).max(1));
        let share = room * u128::from(excess) / all;
        self.usable.min(u64::try_from(share).unwrap_or(u64::MAX))
    }
}

/// What a node that has `own` pairs to look at in an iteration, and can do `limit` of them, hands
/// each helper: up to the lowest level at which it is rid of what is above it.
fn fill_up(own: u64, limit: u64, helpers: &[Helper]) -> Vec<u64> {
    let excess = own.saturating_sub(limit);
    let takes = |level| helpers.iter().map(move |h| h.takes(level, excess));
    let (mut low, mut high) = (0, own);
    while low < high && excess > 0 {
        let level = low + (high - low) / 2;
        let left = own.saturating_sub(takes(level).fold(0, u64::saturating_add));
        if left <= level.max(limit) {
            high = level;
        } else {
            low = level + 1;
        }
    }
    takes(high).collect()
}

impl MaxPlusPolicy {
    /// How many pairs of candidate paths an iteration may have so that there is time for enough of
    /// them; none if the processor takes no time.
    fn pairs_limit(&self, base: &Base, now: SimTime) -> Option<u64> {
        let pairs = self
            .processor
            .operations_in(now, base.site.timing.optimisation);
        // The payoffs take as long as an iteration.
        pairs.map(|pairs| pairs / (ITERATIONS + 1))
    }

    /// What neighbours are to know of this node's load, if it may hand work over.
    pub(super) fn told_load(&self, base: &Base, now: SimTime) -> Option<Load> {
        let limit = self
            .pairs_limit(base, now)
            .filter(|_| base.site.config.max_plus.outsourcing)?;
        let recent = |told: u32| base.cycle.saturating_sub(told) <= 1;
        let heard = base
            .neighbors
            .iter()
            .filter(|n| n.located.is_some_and(recent));
        let loads = heard.filter_map(|n| n.load);
        Some(Load {
            pairs: self.load,
            claims: loads.map(|l| l.pairs.saturating_sub(limit)).sum(),
        })
    }

    /// How many pairs of candidate paths of its `rovers` each neighbour is to be handed.
    pub(super) fn quotas(
        &self,
        base: &Base,
        now: SimTime,
        rovers: &[(RoverId, Arc<[CandidatePath]>)],
    ) -> Vec<(NodeId, u64)> {
        let limit = self
            .pairs_limit(base, now)
            .filter(|_| base.site.config.max_plus.outsourcing);
        let Some(limit) = limit.filter(|&limit| self.load > limit) else {
            return Vec::new();
        };
        let paths: usize = rovers.iter().map(|(_, paths)| paths.len()).sum();
        // Neighbours' rovers are taken to have as many paths as the own ones.
        let each = paths.div_ceil(rovers.len().max(1));
        let heard = base.neighbors.iter();
        let heard = heard.filter(|n| n.located == Some(base.cycle));
        let (ids, helpers): (Vec<_>, Vec<_>) = heard
            .filter_map(|n| {
                let helper = Helper {
                    pairs: n.load?.pairs,
                    usable: (paths * each * n.holdings.len()) as u64,
                    claims: n.load?.claims,
                };
                Some((n.id, helper))
            })
            .unzip();
        let pairs = fill_up(self.load, limit, &helpers);
        ids.into_iter().zip(pairs).collect()
    }

    /// How crowded it is here and behind, for neighbours that want to know more than the holdings.
    pub(super) fn told_crowding(&self, base: &Base, ctx: &mut Context<'_, Node>) -> Option<f64> {
        let config = &base.site.config;
        let spread = config.max_plus.congestion_spread;
        if config.max_plus.congestion_weight == 0.0 || spread == 0.0 {
            return None;
        }
        let own = self.occupancy(
            base,
            ctx.durable::<OccupancyTable>().occupied().count(),
            base.id,
        );
        let theirs = base.neighbors.iter().map(|n| self.crowding(base, n.id));
        let mean = theirs.sum::<f64>() / base.neighbors.len().max(1) as f64;
        Some((1.0 - spread) * own + spread * mean)
    }

    /// So many rovers for each vertex of a node.
    fn occupancy(&self, base: &Base, rovers: usize, node: NodeId) -> f64 {
        rovers as f64 / base.site.sensors.owned(node).len() as f64
    }

    /// How crowded it is at a neighbour, as last heard; 0 at others.
    fn crowding(&self, base: &Base, node: NodeId) -> f64 {
        let Some(at) = base.neighbor(node) else {
            return 0.0;
        };
        let neighbor = &base.neighbors[at];
        let told = || self.occupancy(base, neighbor.holdings.len(), node);
        neighbor.crowding.unwrap_or_else(told)
    }

    /// What a path loses because it leads where others are \[edges\]. `here` are the rovers at this
    /// node, the path's own one among them. Who stays where it is adds to no crowd.
    pub(super) fn congestion(&self, base: &Base, path: &CandidatePath, here: usize) -> f64 {
        let weight = base.site.config.max_plus.congestion_weight;
        if weight == 0.0 || path.destination != Destination::Leaf || path.length() == 0 {
            return 0.0;
        }
        let end: Option<&VertexId> = path.vertices.last();
        let owner = end.map(|&end| base.site.sensors.owner(end));
        let crowding = match owner {
            Some(owner) if owner == base.id => self.occupancy(base, here.saturating_sub(1), owner),
            Some(owner) => self.crowding(base, owner),
            None => 0.0,
        };
        weight * crowding
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn helper(pairs: u64, usable: u64, claims: u64) -> Helper {
        Helper {
            pairs,
            usable,
            claims,
        }
    }

    #[test]
    fn who_has_less_is_filled_up_as_by_water() {
        let free = |pairs| helper(pairs, 1000, 0);
        assert_eq!(fill_up(90, 0, &[free(10), free(80), free(20)]), [30, 0, 20]);
        // Down to what it can do, and no further.
        assert_eq!(fill_up(90, 70, &[free(10), free(20)]), [15, 5]);
        assert_eq!(fill_up(70, 70, &[free(10)]), [0]);
        // What there is to hand over may not be enough.
        assert_eq!(fill_up(90, 0, &[helper(0, 7, 0), free(10)]), [7, 37]);
        // Of a neighbour that others want too only a share.
        assert_eq!(fill_up(90, 50, &[helper(0, 1000, 400)]), [8]);
    }

    proptest! {
        #[test]
        fn nobody_is_given_what_makes_it_the_busier_one(
            own in 0..100_000u64,
            limit in 0..100_000u64,
            helpers in proptest::collection::vec(
                (0..100_000u64, 0..100_000u64, 0..100_000u64), 0..8,
            ),
        ) {
            let helpers: Vec<_> = helpers.iter().map(|&(p, u, c)| helper(p, u, c)).collect();
            let given = fill_up(own, limit, &helpers);
            let sum: u64 = given.iter().sum();
            let left = own - sum;
            // A level is a whole number, and each helper may be one pair above it.
            let rest = helpers.len() as u64;
            prop_assert!(left + rest >= own.min(limit));
            for (helper, &given) in helpers.iter().zip(&given) {
                prop_assert!(given == 0 || helper.pairs < own);
                prop_assert!(helper.pairs + given <= own.max(helper.pairs));
                prop_assert!(given == 0 || helper.pairs + given <= left.max(limit) + rest);
                prop_assert!(given <= helper.usable);
            }
        }
    }
}
