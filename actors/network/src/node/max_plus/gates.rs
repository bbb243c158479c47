//! Entry gates: an entry's owner lets nobody in while the roadmap around it is full.
//!
//! A roadmap with more rovers than places to pass cannot be untangled by planning. What the owner
//! counts is its local neighbourhood graph, with its neighbours' holdings as last heard (step 1): a
//! cycle old, and older still from a neighbour that is silent. So the limit is a damper and no
//! guarantee; several owners may let in a rover each at the same time.
//!
//! An aid that was tried and made things worse: a token for each corridor (a chain of vertices where
//! two rovers cannot pass each other), which opened it in one direction at a time. With it 73 % of
//! the teams of 100 rovers deadlocked, without it 50 % (dense roadmap, 28 nodes, 15 seeds). Beyond a
//! corridor there are only single junctions and other corridors, so that a rover that waits for a
//! token waits in somebody's way, and the detours that would clear it need tokens too. What would
//! help is to grant a corridor together with everything beyond it, up to the goal: that is what the
//! policy `complete` does. Nor does a penalty for entering against the flow help: all teams deadlock.

use farside::prelude::*;

use super::MaxPlusPolicy;
use crate::node::Node;
use crate::node::base::Base;
use crate::safety::Ledger;

impl MaxPlusPolicy {
    /// Whether one more rover may come in here.
    pub(super) fn gate_is_open(&self, base: &Base, ctx: &mut Context<'_, Node>) -> bool {
        let config = &base.site.config;
        if !config.max_plus.entry_gates {
            return true;
        }
        let own = ctx.durable::<Ledger>().occupied().count();
        let theirs: usize = base.neighbors.iter().map(|n| n.holdings.len()).sum();
        may_enter(
            own + theirs,
            self.graph.len(),
            config.max_plus.entry_gate_occupancy,
        )
    }
}

/// Whether a graph of `vertices`, of which `held` are not free, has room for one more below the
/// share `limit`. An empty one always has, so that a low limit slows down and never stops.
fn may_enter(held: usize, vertices: usize, limit: f64) -> bool {
    held == 0 || (held + 1) as f64 <= limit * vertices as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_counts_the_rover_to_come_and_never_shuts_out_all() {
        assert!(may_enter(4, 10, 0.5) && !may_enter(5, 10, 0.5));
        assert!(may_enter(0, 10, 0.0) && !may_enter(1, 10, 0.0));
        assert!(may_enter(9, 10, 1.0));
    }
}
