//! How evenly nodes' processors are loaded, from what nodes record of themselves.

use crate::max_plus::messages::NodeState;
use crate::metrics::NetworkMetrics;

/// Sums over the cycles of a run.
#[derive(Debug, Default)]
pub(crate) struct Loads {
    /// The cycle that is being added up, and the most that a node was given in it.
    cycle: Option<(u32, u64)>,
    /// Cycles before it, and the sum of what the busiest node was given in each.
    cycles: u64,
    peaks: u64,
    /// What each node was given, by its number among all actors.
    nodes: Vec<u64>,
    /// What was to be computed in an iteration, and how much of that was handed over.
    load: u64,
    handed: u64,
    /// Optimisations, and how many of them came to no end.
    planned: u64,
    late: u64,
}

impl Loads {
    /// A node's cycle. Cycles come in order.
    pub(crate) fn add(&mut self, node: usize, state: &NodeState) {
        match &mut self.cycle {
            Some((cycle, peak)) if *cycle == state.cycle => *peak = state.pairs.max(*peak),
            _ => {
                self.close();
                self.cycle = Some((state.cycle, state.pairs));
            }
        }
        if self.nodes.len() <= node {
            self.nodes.resize(node + 1, 0);
        }
        self.nodes[node] += state.pairs;
        self.load += state.load;
        self.handed += state.handed;
        self.planned += u64::from(state.rovers > 0);
        self.late += u64::from(state.late);
    }

    fn close(&mut self) {
        if let Some((_, peak)) = self.cycle.take() {
            self.cycles += 1;
            self.peaks += peak;
        }
    }

    /// Writes what it comes to for a network of so many nodes.
    pub(crate) fn write(&self, nodes: usize, metrics: &mut NetworkMetrics) {
        let last = self.cycle.map_or(0, |(_, peak)| peak);
        let cycles = self.cycles + u64::from(self.cycle.is_some());
        let all: u64 = self.nodes.iter().sum();
        let busiest = self.nodes.iter().max().copied().unwrap_or(0);
        let ratio = |part: u64, whole: u64| part as f64 / whole.max(1) as f64;
        metrics.pairs_per_cycle = ratio(all, cycles * nodes as u64);
        metrics.peak_load = ratio(self.peaks + last, cycles);
        metrics.busiest_share = ratio(busiest, all);
        metrics.late_optimisations = ratio(self.late, self.planned);
        metrics.outsourced = ratio(self.handed, self.load);
        if all > 0 {
            metrics.load_imbalance = metrics.peak_load / metrics.pairs_per_cycle;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(cycle: u32, pairs: u64, late: bool) -> NodeState {
        NodeState {
            cycle,
            rovers: u32::from(pairs > 0),
            iterations: 1,
            forced_stops: 0,
            confirmed_deadlocks: 0,
            deadlock: Vec::new(),
            pairs,
            load: pairs,
            handed: pairs / 4,
            late,
        }
    }

    #[test]
    fn peaks_are_of_cycles_and_shares_of_the_run() {
        let mut loads = Loads::default();
        for (node, cycle, pairs, late) in [
            (7, 0, 40, false),
            (9, 0, 10, false),
            (7, 1, 0, false),
            (9, 1, 70, true),
        ] {
            loads.add(node, &state(cycle, pairs, late));
        }
        let mut metrics = NetworkMetrics::default();
        loads.write(2, &mut metrics);
        assert_eq!((metrics.pairs_per_cycle, metrics.peak_load), (30.0, 55.0));
        assert_eq!(metrics.load_imbalance, 55.0 / 30.0);
        assert_eq!(metrics.busiest_share, 80.0 / 120.0);
        assert_eq!(metrics.late_optimisations, 1.0 / 3.0);
        assert_eq!(metrics.outsourced, 29.0 / 120.0);
    }

    #[test]
    fn nothing_computed_is_no_load() {
        let mut metrics = NetworkMetrics::default();
        Loads::default().write(3, &mut metrics);
        assert_eq!(metrics, NetworkMetrics::default());
    }
}
