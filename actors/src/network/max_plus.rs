//! Max-plus (*network-guided*, section 3.4): one node's share of the message passing that
//! maximises the global utility Q (equation 1) over the coordination graph.
//!
//! Pure computation: which vectors change, not how they travel. A vector for rover j has one value
//! for each of j's candidate paths.

use farside_worlds::NodeId;

use super::candidates::CandidatePath;
use super::messages::{RoverId, Vector};
use super::payoff::{Payoffs, collision};

/// A rover of the coordination graph, as one node sees it.
#[derive(Debug)]
struct Agent {
    rover: RoverId,
    node: NodeId,
    paths: Vec<CandidatePath>,
    /// A hash of each path's vertices: paths whose hashes share no bit share no vertex.
    masks: Vec<Mask>,
}

type Mask = [u64; 4];

/// An edge (i, j) of the coordination graph at an own rover i.
#[derive(Debug)]
struct Edge {
    other: usize,
    /// Pairwise payoffs, a row for each path of i, a column for each path of j.
    payoffs: Vec<f32>,
    /// The message from j: a value for each path of i.
    incoming: Vec<f32>,
    /// The last message to j: a value for each path of j.
    outgoing: Vec<f32>,
    /// The next message to j, while an iteration is computed.
    fresh: Vec<f32>,
    /// The outgoing message changed in the last iteration.
    changed: bool,
}

/// What one node optimises in one cycle: its own rovers, its neighbours' rovers, and the edges
/// between them that touch an own one.
#[derive(Debug)]
pub(crate) struct MaxPlus {
    node: NodeId,
    payoffs: Payoffs,
    /// The largest change that counts as none.
    tolerance: f32,
    agents: Vec<Agent>,
    /// The first agents are the node's own.
    own: usize,
    /// Edges at each own agent, in the order in which the others were added.
    edges: Vec<Vec<Edge>>,
}

impl MaxPlus {
    /// The problem of `node` with its own `rovers`, whose paths have their unary payoffs.
    pub(crate) fn new(
        node: NodeId,
        payoffs: Payoffs,
        tolerance: f32,
        rovers: Vec<(RoverId, Vec<CandidatePath>)>,
    ) -> Self {
        let mut problem = MaxPlus {
            node,
            payoffs,
            tolerance,
            agents: Vec::new(),
            own: rovers.len(),
            edges: Vec::new(),
        };
        for (rover, paths) in rovers {
            problem.agents.push(Agent::new(rover, node, paths));
        }
        for i in 0..problem.own {
            let others = (0..problem.own).filter(|&j| j != i);
            let edges = others.map(|j| problem.edge(i, j)).collect();
            problem.edges.push(edges);
        }
        problem
    }

    /// Adds a neighbour's rovers. Those known already are left as they are.
    pub(crate) fn add(&mut self, node: NodeId, rovers: Vec<(RoverId, Vec<CandidatePath>)>) {
        for (rover, paths) in rovers {
            let known = self.agents.iter().any(|agent| agent.rover == rover);
            if known || paths.is_empty() {
                continue;
            }
            self.agents.push(Agent::new(rover, node, paths));
            let j = self.agents.len() - 1;
            for i in 0..self.own {
                let edge = self.edge(i, j);
                self.edges[i].push(edge);
            }
        }
    }

    fn edge(&self, i: usize, j: usize) -> Edge {
        let (a, b) = (&self.agents[i], &self.agents[j]);
        let mut payoffs = Vec::with_capacity(a.paths.len() * b.paths.len());
        for (path_a, mask_a) in a.paths.iter().zip(&a.masks) {
            for (path_b, mask_b) in b.paths.iter().zip(&b.masks) {
                let meet = mask_a.iter().zip(mask_b).any(|(x, y)| x & y != 0);
                let collision = if meet {
                    collision(path_a, path_b)
                } else {
                    None
                };
                let sum = path_a.payoff + path_b.payoff;
                payoffs.push(self.payoffs.pairwise(sum, collision));
            }
        }
        Edge {
            other: j,
            payoffs,
            incoming: vec![0.0; a.paths.len()],
            outgoing: vec![0.0; b.paths.len()],
            fresh: vec![0.0; b.paths.len()],
            changed: false,
        }
    }

    /// True if no own rover interacts with another: there is nothing to pass on.
    pub(crate) fn is_trivial(&self) -> bool {
        self.edges.iter().all(Vec::is_empty)
    }

    /// Takes a neighbour's message. False if it fits no edge, or changes nothing.
    pub(crate) fn receive(&mut self, vector: &Vector) -> bool {
        let agents = &self.agents;
        let own = agents[..self.own].iter().position(|a| a.rover == vector.to);
        let Some(i) = own else { return false };
        let from = |edge: &&mut Edge| agents[edge.other].rover == vector.from;
        let Some(edge) = self.edges[i].iter_mut().find(from) else {
            return false;
        };
        let fits = edge.incoming.len() == vector.values.len()
            && vector.values.iter().all(|value| value.is_finite());
        if !fits || edge.incoming == vector.values {
            return false;
        }
        edge.incoming.copy_from_slice(&vector.values);
        true
    }

    /// One iteration: every own rover's messages from what came in before it. True if one of them
    /// changed by more than the tolerance.
    pub(crate) fn iterate(&mut self) -> bool {
        let mut changed = false;
        let mut base = Vec::new();
        for i in 0..self.own {
            let total = self.total(i);
            for edge in &mut self.edges[i] {
                base.clear();
                base.extend(total.iter().zip(&edge.incoming).map(|(t, m)| t - m));
                changed |= edge.refresh(&base, self.tolerance);
            }
        }
        self.deliver_within();
        changed
    }

    /// Messages between two own rovers take effect once the iteration is complete.
    fn deliver_within(&mut self) {
        for i in 0..self.own {
            // Before any neighbour's rover is added, an own agent's edges lead to all the other
            // own agents, in order: the place of j in the list of i is known.
            for j in 0..i {
                let (low, high) = self.edges.split_at_mut(i);
                let (down, up) = (&mut high[0][j], &mut low[j][i - 1]);
                debug_assert!(down.other == j && up.other == i);
                if down.changed {
                    up.incoming.copy_from_slice(&down.outgoing);
                }
                if up.changed {
                    down.incoming.copy_from_slice(&up.outgoing);
                }
            }
        }
    }

    /// The vectors for the rovers of `node` that changed in the last iteration.
    pub(crate) fn changed_for(&self, node: NodeId) -> Vec<Vector> {
        let mut vectors = Vec::new();
        for (agent, edges) in self.agents.iter().zip(&self.edges) {
            for edge in edges.iter().filter(|edge| edge.changed) {
                let other = &self.agents[edge.other];
                if other.node == node && node != self.node {
                    vectors.push(Vector {
                        from: agent.rover,
                        to: other.rover,
                        values: edge.outgoing.clone(),
                    });
                }
            }
        }
        vectors
    }

    /// g_i: the unary payoffs and all incoming messages of an own rover, a value for each path.
    fn total(&self, i: usize) -> Vec<f32> {
        let mut total: Vec<f32> = self.agents[i].paths.iter().map(|p| p.payoff).collect();
        for edge in &self.edges[i] {
            for (t, m) in total.iter_mut().zip(&edge.incoming) {
                *t += m;
            }
        }
        total
    }

    /// The best path of each own rover as things stand, the first of equals.
    pub(crate) fn best(&self) -> impl Iterator<Item = (RoverId, &CandidatePath)> {
        (0..self.own).map(|i| {
            let agent = &self.agents[i];
            let mut best = (f32::NEG_INFINITY, 0);
            for (at, value) in self.total(i).into_iter().enumerate() {
                if value > best.0 {
                    best = (value, at);
                }
            }
            (agent.rover, &agent.paths[best.1])
        })
    }
}

impl Agent {
    fn new(rover: RoverId, node: NodeId, paths: Vec<CandidatePath>) -> Self {
        let mask = |path: &CandidatePath| {
            let mut mask = Mask::default();
            for v in &path.vertices {
                mask[(v.0 / 64 % 4) as usize] |= 1 << (v.0 % 64);
            }
            mask
        };
        let masks = paths.iter().map(mask).collect();
        Agent {
            rover,
            node,
            paths,
            masks,
        }
    }
}

impl Edge {
    /// The message to j from `base`, what i's paths are worth without j's own message; its mean
    /// is subtracted (on cyclic graphs messages would grow without bound).
    fn refresh(&mut self, base: &[f32], tolerance: f32) -> bool {
        self.fresh.fill(f32::NEG_INFINITY);
        let rows = self.payoffs.chunks_exact(self.fresh.len());
        for (worth, row) in base.iter().zip(rows) {
            for (best, payoff) in self.fresh.iter_mut().zip(row) {
                let value = worth + payoff;
                // Unlike `f32::max`, this compiles to one vector instruction: nothing is NaN here.
                *best = if value > *best { value } else { *best };
            }
        }
        let mean = self.fresh.iter().sum::<f32>() / self.fresh.len() as f32;
        self.changed = false;
        for (new, old) in self.fresh.iter_mut().zip(&self.outgoing) {
            *new -= mean;
            self.changed |= (*new - old).abs() > tolerance;
        }
        if self.changed {
            std::mem::swap(&mut self.fresh, &mut self.outgoing);
        }
        self.changed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::candidates::Destination;
    use farside::random::{RandomKey, Stream};

    fn payoffs() -> Payoffs {
        Payoffs {
            longest: 100.0,
            backtrack: 40.0,
            leaf_wait: 45.0,
            imminent: -1000.0,
        }
    }

    /// Random paths on 6 vertices; whether they make sense on a roadmap does not matter here.
    fn random_paths(stream: &mut Stream) -> Vec<CandidatePath> {
        let count = 2 + stream.below(3);
        (0..count)
            .map(|_| {
                let vertices = (0..2 + stream.below(3))
                    .map(|_| farside_worlds::VertexId(stream.below(6) as u32))
                    .collect();
                CandidatePath {
                    destination: Destination::Leaf,
                    vertices,
                    payoff: stream.uniform_in(0.0, 50.0) as f32,
                }
            })
            .collect()
    }

    /// The joint choice that maximises Q, by trying all.
    fn exhaustive(rovers: &[Vec<CandidatePath>], pairs: &[(usize, usize)]) -> Vec<usize> {
        let mut best = (f32::NEG_INFINITY, vec![]);
        let mut choice = vec![0; rovers.len()];
        loop {
            let mut q: f32 = choice.iter().zip(rovers).map(|(&c, r)| r[c].payoff).sum();
            for &(i, j) in pairs {
                let (a, b) = (&rovers[i][choice[i]], &rovers[j][choice[j]]);
                q += payoffs().pairwise(a.payoff + b.payoff, collision(a, b));
            }
            if q > best.0 {
                best = (q, choice.clone());
            }
            let Some(at) = (0..choice.len()).find(|&i| choice[i] + 1 < rovers[i].len()) else {
                return best.1;
            };
            choice[at] += 1;
            choice[..at].fill(0);
        }
    }

    fn problem(node: u32, rovers: &[(u32, &Vec<CandidatePath>)]) -> MaxPlus {
        let rovers = rovers
            .iter()
            .map(|&(id, paths)| (RoverId(id), paths.clone()));
        MaxPlus::new(NodeId(node), payoffs(), 1e-3, rovers.collect())
    }

    #[test]
    fn two_rovers_of_one_node_get_the_best_pair() {
        let mut stream = RandomKey::new(5).text("pair").stream();
        for _ in 0..200 {
            let rovers = [random_paths(&mut stream), random_paths(&mut stream)];
            let mut one = problem(0, &[(0, &rovers[0]), (1, &rovers[1])]);
            while one.iterate() {}
            let chosen: Vec<_> = one.best().map(|(_, path)| path.clone()).collect();
            let best = exhaustive(&rovers, &[(0, 1)]);
            assert_eq!(
                chosen,
                [rovers[0][best[0]].clone(), rovers[1][best[1]].clone()]
            );
        }
    }

    /// A chain a - b - c over three nodes, where a and c do not hear each other: a tree.
    #[test]
    fn a_chain_of_nodes_finds_the_exhaustive_optimum() {
        let mut stream = RandomKey::new(6).text("chain").stream();
        for _ in 0..200 {
            let rovers: Vec<_> = (0..3).map(|_| random_paths(&mut stream)).collect();
            let mut nodes: Vec<_> = (0..3)
                .map(|i| problem(i, &[(i, &rovers[i as usize])]))
                .collect();
            for (a, b) in [(0, 1), (1, 0), (1, 2), (2, 1)] {
                let agent = (RoverId(b as u32), rovers[b].clone());
                nodes[a].add(NodeId(b as u32), vec![agent]);
            }
            for _ in 0..6 {
                for node in &mut nodes {
                    node.iterate();
                }
                for (a, b) in [(0, 1), (1, 0), (1, 2), (2, 1)] {
                    for vector in nodes[a].changed_for(NodeId(b as u32)) {
                        nodes[b].receive(&vector);
                    }
                }
            }
            assert!(
                nodes.iter_mut().all(|node| !node.iterate()),
                "a tree converges"
            );
            let best = exhaustive(&rovers, &[(0, 1), (1, 2)]);
            for (i, node) in nodes.iter().enumerate() {
                assert_eq!(node.best().next().unwrap().1, &rovers[i][best[i]]);
            }
        }
    }

    #[test]
    fn vectors_that_fit_no_edge_are_refused() {
        let mut stream = RandomKey::new(7).text("refuse").stream();
        let rovers = [random_paths(&mut stream), random_paths(&mut stream)];
        let mut one = problem(0, &[(0, &rovers[0])]);
        assert!(one.is_trivial());
        one.add(
            NodeId(1),
            vec![(RoverId(1), rovers[1].clone()), (RoverId(1), vec![])],
        );
        assert!(!one.is_trivial());
        let vector = |from, to, values| Vector {
            from: RoverId(from),
            to: RoverId(to),
            values,
        };
        let fitting = vec![1.0; rovers[0].len()];
        assert!(!one.receive(&vector(2, 0, fitting.clone())));
        assert!(!one.receive(&vector(1, 3, fitting.clone())));
        assert!(!one.receive(&vector(1, 0, vec![f32::NAN; rovers[0].len()])));
        assert!(!one.receive(&vector(1, 0, vec![1.0; 9])));
        assert!(one.receive(&vector(1, 0, fitting.clone())));
        assert!(!one.receive(&vector(1, 0, fitting)), "no news");
    }
}
