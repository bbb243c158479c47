//! Who owns what, evened out: vertices go from nodes that have much to neighbours that have less,
//! as far as a network's promises allow.
//!
//! A vertex may go from its owner to the owner of a vertex beside it, if that one is in range of it
//! and everyone beside it stays the same node or a neighbour, the old owner keeps a vertex, and its
//! part falls into no more pieces than before. A step is one such move, or a chain of them from a
//! node over others to one that has less: what is between keeps as much as it had. Each step lowers
//! the sum of the squares of what nodes have, so that there is an end; it need not be the best of
//! all.

use serde::{Deserialize, Serialize};

use super::SensorNetwork;
use crate::ids::{NodeId, VertexId};
use crate::roadmap::Roadmap;

/// Vertices looked at over all steps, which bounds the time that large maps take.
const MOST_WORK: usize = 20_000_000;

/// By what rule vertices get their owners.
///
/// ```
/// use farside_worlds::{Ownership, Roadmap, SensorNetwork};
/// let map = Roadmap::builtin("crater-dense")?;
/// let nearest = SensorNetwork::place(&map, 28, SensorNetwork::default_radius_m(&map, 28), 7)?;
/// let even = nearest.clone().owned_by(&map, Ownership::Balanced);
/// let most = |network: &SensorNetwork| network.nodes().map(|n| network.owned(n).len()).max();
/// assert!(most(&even) < most(&nearest));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Ownership {
    /// Each vertex belongs to the node nearest to it: the paper's.
    #[default]
    Nearest,
    /// Nodes own as equally many vertices as radio range allows.
    Balanced,
    /// The same, where a vertex counts as often as shortest paths between boundary vertices lead
    /// over it: rovers are to be expected there.
    Traffic,
}

impl SensorNetwork {
    /// The same nodes, with the vertices divided among them by this rule. All promises hold still.
    ///
    /// `roadmap` is the one that the network was made for.
    #[must_use]
    pub fn owned_by(self, roadmap: &Roadmap, rule: Ownership) -> SensorNetwork {
        match rule {
            Ownership::Nearest => self,
            Ownership::Balanced => self.evened_out(roadmap, &vec![1; roadmap.len()]),
            Ownership::Traffic => self.evened_out(roadmap, &traffic(roadmap)),
        }
    }

    fn evened_out(self, roadmap: &Roadmap, weights: &[u64]) -> SensorNetwork {
        let mut division = Division::new(&self, roadmap, weights);
        let steps = (MOST_WORK / (roadmap.len() * self.len())).max(1);
        for _ in 0..steps {
            if !division.step() {
                break;
            }
        }
        let owners = division.owners;
        let mut owned = vec![Vec::new(); self.len()];
        for (vertex, owner) in roadmap.vertices().zip(&owners) {
            owned[owner.0 as usize].push(vertex);
        }
        SensorNetwork {
            owners,
            owned,
            ..self
        }
    }
}

/// One more than the number of pairs of boundary vertices whose shortest path leads over each
/// vertex.
fn traffic(roadmap: &Roadmap) -> Vec<u64> {
    let mut over = vec![1; roadmap.len()];
    let ends = roadmap.boundary();
    for (at, &from) in ends.iter().enumerate() {
        for &to in &ends[at + 1..] {
            for v in roadmap.shortest_path(from, to) {
                over[v.0 as usize] += 1;
            }
        }
    }
    over
}

/// A vertex that goes to another node.
type Move = (VertexId, NodeId);

/// A division of the vertices on its way to an even one.
struct Division<'a> {
    network: &'a SensorNetwork,
    roadmap: &'a Roadmap,
    weights: &'a [u64],
    owners: Vec<NodeId>,
    /// How many vertices each node owns, and what they weigh together.
    counts: Vec<usize>,
    loads: Vec<u64>,
}

impl<'a> Division<'a> {
    fn new(network: &'a SensorNetwork, roadmap: &'a Roadmap, weights: &'a [u64]) -> Self {
        let load = |n| network.owned(n).iter().map(|v| weights[v.0 as usize]).sum();
        Division {
            network,
            roadmap,
            weights,
            owners: network.owners.clone(),
            counts: network.nodes().map(|n| network.owned(n).len()).collect(),
            loads: network.nodes().map(load).collect(),
        }
    }

    fn owner(&self, v: VertexId) -> NodeId {
        self.owners[v.0 as usize]
    }

    fn unevenness(&self) -> u128 {
        let square = |&load: &u64| u128::from(load) * u128::from(load);
        self.loads.iter().map(square).sum()
    }

    fn apply(&mut self, (v, to): Move) {
        let (from, weight) = (self.owner(v), self.weights[v.0 as usize]);
        self.loads[from.0 as usize] -= weight;
        self.loads[to.0 as usize] += weight;
        self.counts[from.0 as usize] -= 1;
        self.counts[to.0 as usize] += 1;
        self.owners[v.0 as usize] = to;
    }

    /// Whether `v` may go to `to`, which owns a vertex beside it.
    fn may_go(&self, (v, to): Move) -> bool {
        let from = self.owner(v);
        let radius_m = self.network.radius_m().min(self.network.coverage_m());
        let way = self.network.position_m(to) - self.roadmap.position_m(v);
        let beside = self.roadmap.neighbors(v);
        let agrees = |&u: &VertexId| {
            let owner = self.owner(u);
            owner == to || self.network.are_neighbors(owner, to)
        };
        from != to
            && self.counts[from.0 as usize] > 1
            && beside.iter().any(|&u| self.owner(u) == to)
            && way.norm_squared() <= radius_m * radius_m
            && beside.iter().all(agrees)
            && !self.parts(v, from)
    }

    /// Whether the vertices of `owner` beside `v` are connected only by way of it.
    fn parts(&self, v: VertexId, owner: NodeId) -> bool {
        let mut beside = self.roadmap.neighbors(v).iter().copied();
        let own = |&u: &VertexId| self.owner(u) == owner;
        let Some(first) = beside.find(own) else {
            // A piece of its own, which is gone then.
            return false;
        };
        let (mut reached, mut stack) = (vec![first], vec![first]);
        while let Some(u) = stack.pop() {
            for &w in self.roadmap.neighbors(u) {
                if w != v && own(&w) && !reached.contains(&w) {
                    reached.push(w);
                    stack.push(w);
                }
            }
        }
        beside.filter(own).any(|u| !reached.contains(&u))
    }

    /// The lightest vertex that may go from each node to each other one, of equals the lowest: by
    /// the node it comes from, then by the one it goes to.
    fn moves(&self) -> Vec<Vec<Move>> {
        let mut moves: Vec<Vec<Move>> = vec![Vec::new(); self.counts.len()];
        for v in self.roadmap.vertices() {
            let mut takers: Vec<_> = self
                .roadmap
                .neighbors(v)
                .iter()
                .map(|&u| self.owner(u))
                .collect();
            takers.sort_unstable();
            takers.dedup();
            for to in takers {
                if !self.may_go((v, to)) {
                    continue;
                }
                let known = &mut moves[self.owner(v).0 as usize];
                let weight = |v: VertexId| self.weights[v.0 as usize];
                match known.iter_mut().find(|m| m.1 == to) {
                    Some(other) if weight(v) < weight(other.0) => other.0 = v,
                    Some(_) => {}
                    None => known.push((v, to)),
                }
            }
        }
        for list in &mut moves {
            list.sort_unstable_by_key(|m| m.1);
        }
        moves
    }

    /// Makes the division more even by a move or a chain of moves, from the node that has most if
    /// it can be. False if there is none.
    fn step(&mut self) -> bool {
        let moves = self.moves();
        let mut sources: Vec<NodeId> = self.network.nodes().collect();
        sources.sort_by_key(|n| (u64::MAX - self.loads[n.0 as usize], *n));
        sources
            .into_iter()
            .any(|source| self.relieve(source, &moves))
    }

    /// Takes something from `source`, over as few nodes as possible.
    fn relieve(&mut self, source: NodeId, moves: &[Vec<Move>]) -> bool {
        let before = self.unevenness();
        // Breadth first over nodes; how each was reached.
        let mut reached: Vec<Option<(NodeId, Move)>> = vec![None; self.counts.len()];
        let mut queue = std::collections::VecDeque::from([source]);
        while let Some(node) = queue.pop_front() {
            for &(v, to) in &moves[node.0 as usize] {
                if to == source || reached[to.0 as usize].is_some() {
                    continue;
                }
                reached[to.0 as usize] = Some((node, (v, to)));
                queue.push_back(to);
                let has_less = self.loads[to.0 as usize] < self.loads[source.0 as usize];
                if has_less && self.shift(to, &reached, before) {
                    return true;
                }
            }
        }
        false
    }

    /// Makes the moves by which `last` was reached, if all of them can be made and it is more even
    /// then than `before`.
    fn shift(&mut self, last: NodeId, reached: &[Option<(NodeId, Move)>], before: u128) -> bool {
        let mut at = last;
        let mut undo: Vec<Move> = Vec::new();
        // From the end: who passes something on has got nothing yet that it could pass on instead.
        while let Some((from, step)) = reached[at.0 as usize] {
            if self.owner(step.0) != from || !self.may_go(step) {
                break;
            }
            undo.push((step.0, from));
            self.apply(step);
            at = from;
        }
        let is_whole = reached[at.0 as usize].is_none();
        if is_whole && self.unevenness() < before {
            return true;
        }
        while let Some(step) = undo.pop() {
            self.apply(step);
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point2;
    use proptest::prelude::*;

    fn sizes(network: &SensorNetwork) -> Vec<usize> {
        network.nodes().map(|n| network.owned(n).len()).collect()
    }

    /// Vertices on a line, 10 m apart.
    fn line(length: u32) -> Roadmap {
        let places = (0..length).map(|i| Point2::new(10.0 * f64::from(i), 0.0));
        let edges = (1..length).map(|i| (VertexId(i - 1), VertexId(i)));
        let ends = vec![VertexId(0), VertexId(length - 1)];
        Roadmap::new("line", places.collect(), edges.collect(), ends).unwrap()
    }

    #[test]
    fn a_chain_of_moves_passes_over_those_that_have_enough() {
        // Whatever goes from one node to the next alone leaves it as uneven as it was.
        let map = line(9);
        let places = [10.0, 60.0, 70.0].map(|x| Point2::new(x, 0.0));
        let nearest = SensorNetwork::new(&map, places.to_vec(), 100.0).unwrap();
        assert_eq!(sizes(&nearest), [4, 3, 2]);
        let even = nearest.clone().owned_by(&map, Ownership::Balanced);
        assert_eq!(sizes(&even), [3, 3, 3]);
        assert_eq!(even.check(&map), Ok(()));
        assert_eq!(nearest.clone().owned_by(&map, Ownership::Nearest), nearest);
    }

    #[test]
    fn traffic_counts_the_pairs_whose_ways_lead_over() {
        assert_eq!(traffic(&line(3)), [2, 2, 2]);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        /// On both built-in roadmaps, whatever the number of nodes and their places.
        #[test]
        fn every_promise_holds_and_loads_are_no_less_even(
            seed: u64, nodes in 2..30usize, dense: bool, traffic_counts: bool,
        ) {
            let map = Roadmap::builtin(if dense { "crater-dense" } else { "crater-sparse" }).unwrap();
            let radius_m = SensorNetwork::default_radius_m(&map, nodes);
            let Ok(nearest) = SensorNetwork::place(&map, nodes, radius_m, seed) else {
                return Ok(());
            };
            let rule = if traffic_counts { Ownership::Traffic } else { Ownership::Balanced };
            let even = nearest.clone().owned_by(&map, rule);
            prop_assert_eq!(even.check(&map), Ok(()));
            prop_assert_eq!(&even, &nearest.clone().owned_by(&map, rule));
            let mut all: Vec<_> = even.nodes().flat_map(|n| even.owned(n).to_vec()).collect();
            prop_assert!(even.nodes().all(|n| even.owned(n).iter().all(|&v| even.owner(v) == n)));
            all.sort_unstable();
            prop_assert_eq!(all, map.vertices().collect::<Vec<_>>());
            let weights = if traffic_counts { traffic(&map) } else { vec![1; map.len()] };
            let unevenness = |n: &SensorNetwork| Division::new(n, &map, &weights).unevenness();
            prop_assert!(unevenness(&even) <= unevenness(&nearest));
            // Nothing more can be done.
            prop_assert!(!Division::new(&even, &map, &weights).step());
        }
    }
}
