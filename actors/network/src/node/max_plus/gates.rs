//! Entry gates: an entry's owner lets nobody in while the roadmap around it is full.
//!
//! A roadmap with more rovers than places to pass cannot be untangled by planning. What the owner
//! counts is its local neighbourhood graph, with its neighbours' holdings as last heard (step 1): a
//! cycle old, and older still from a neighbour that is silent. So the limit is a damper and no
//! guarantee; several owners may let in a rover each at the same time.

use farside::prelude::*;

use super::MaxPlusPolicy;
use crate::node::Node;
use crate::node::base::Base;
use crate::safety::OccupancyTable;

impl MaxPlusPolicy {
    /// Whether one more rover may come in here.
    pub(super) fn gate_is_open(&self, base: &Base, ctx: &mut Context<'_, Node>) -> bool {
        let config = &base.site.config;
        if !config.max_plus.entry_gates {
            return true;
        }
        let own = ctx.durable::<OccupancyTable>().occupied().count();
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
