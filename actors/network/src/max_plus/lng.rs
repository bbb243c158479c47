//! The local neighbourhood graph of a sensor node (*network-guided*, section 3.2): the part of the
//! roadmap owned by the node and its radio neighbours, with its leaves and its shortest paths.
//!
//! Static: built once, from the roadmap and the network. Who stands where is no affair of this
//! file.

use std::collections::VecDeque;
use std::sync::OnceLock;

use farside_worlds::{NodeId, Roadmap, SensorNetwork, VertexId};

/// Marks a vertex outside the graph, and an unreachable one.
const NONE: u32 = u32::MAX;

/// `LNG(n)`: the union of the node's own subgraph and its neighbours', with all roadmap edges
/// between them.
#[derive(Debug)]
pub(crate) struct LocalGraph {
    /// Sorted; a local index is a place in this list.
    vertices: Vec<VertexId>,
    /// Local index of each vertex of the roadmap.
    local: Vec<u32>,
    neighbors: Vec<Vec<u32>>,
    /// Hops inside the graph to each vertex that was ever a destination, worked out then: on large
    /// roadmaps a table of all pairs would not fit, and only leaves and goals are destinations.
    hops: Vec<OnceLock<Box<[u32]>>>,
    /// The connected component of each vertex, by its lowest local index.
    component: Vec<u32>,
    /// The leaves, ascending: see [`LocalGraph::leaves`].
    leaves: Vec<u32>,
}

impl LocalGraph {
    pub(crate) fn new(roadmap: &Roadmap, sensors: &SensorNetwork, node: NodeId) -> Self {
        let mut vertices = sensors.owned(node).to_vec();
        for &neighbor in sensors.neighbors(node) {
            vertices.extend_from_slice(sensors.owned(neighbor));
        }
        LocalGraph::over(roadmap, vertices)
    }

    /// The subgraph of `roadmap` induced by `vertices`.
    pub(crate) fn over(roadmap: &Roadmap, mut vertices: Vec<VertexId>) -> Self {
        vertices.sort_unstable();
        let mut local = vec![NONE; roadmap.len()];
        for (index, v) in vertices.iter().enumerate() {
            local[v.0 as usize] = index as u32;
        }
        let inside = |v: &VertexId| Some(local[v.0 as usize]).filter(|&index| index != NONE);
        let neighbors: Vec<Vec<u32>> = vertices
            .iter()
            .map(|&v| roadmap.neighbors(v).iter().filter_map(inside).collect())
            .collect();
        // A leaf has at most one neighbour inside, or an edge that leads out.
        let leaves = (0..vertices.len())
            .filter(|&i| {
                neighbors[i].len() <= 1 || neighbors[i].len() < roadmap.neighbors(vertices[i]).len()
            })
            .map(|i| i as u32)
            .collect();
        LocalGraph {
            hops: vec![OnceLock::new(); vertices.len()],
            component: components(&neighbors),
            vertices,
            local,
            neighbors,
            leaves,
        }
    }

    /// The number of vertices.
    pub(crate) fn len(&self) -> usize {
        self.vertices.len()
    }

    /// The neighbours of `v` inside the graph, ascending; none if `v` is outside.
    pub(crate) fn neighbors(&self, v: VertexId) -> impl Iterator<Item = VertexId> + '_ {
        let index = Some(self.local[v.0 as usize]).filter(|&index| index != NONE);
        let list = index.map_or(&[][..], |index| &self.neighbors[index as usize]);
        list.iter().map(|&n| self.vertices[n as usize])
    }

    /// The local indices of two vertices that are joined inside the graph.
    fn joined(&self, u: VertexId, v: VertexId) -> Option<(u32, u32)> {
        let (u, v) = (self.local[u.0 as usize], self.local[v.0 as usize]);
        let inside = u != NONE && v != NONE;
        let joined = inside && self.component[u as usize] == self.component[v as usize];
        joined.then_some((u, v))
    }

    /// Hops to a vertex, by local indices.
    fn hops_to(&self, to: u32) -> &[u32] {
        self.hops[to as usize].get_or_init(|| hops(&self.neighbors, to).into())
    }

    /// The leaves in the connected component of `from`, ascending: vertices with at most one
    /// neighbour inside the graph, or with an edge that leaves it. `from` itself may be one.
    pub(crate) fn leaves(&self, from: VertexId) -> impl Iterator<Item = VertexId> + '_ {
        let all = self.leaves.iter().map(|&l| self.vertices[l as usize]);
        all.filter(move |&leaf| self.joined(from, leaf).is_some())
    }

    /// A shortest path inside the graph, both ends included; of several, each step goes to the
    /// lowest vertex. `None` where an end is outside, or there is no path.
    pub(crate) fn path(&self, from: VertexId, to: VertexId) -> Option<Vec<VertexId>> {
        let (mut here, to) = self.joined(from, to)?;
        let hops = self.hops_to(to);
        let mut left = hops[here as usize];
        let mut path = Vec::with_capacity(left as usize + 2);
        path.push(from);
        while left > 0 {
            left -= 1;
            let nearer = |&&n: &&u32| hops[n as usize] == left;
            let next = self.neighbors[here as usize].iter().find(nearer);
            here = *next.expect("a vertex at finite distance has a nearer neighbour");
            path.push(self.vertices[here as usize]);
        }
        Some(path)
    }
}

/// Hops to `source`, [`NONE`] where there is no path.
fn hops(neighbors: &[Vec<u32>], source: u32) -> Vec<u32> {
    let mut row = vec![NONE; neighbors.len()];
    row[source as usize] = 0;
    let mut queue = VecDeque::from([source]);
    while let Some(u) = queue.pop_front() {
        for &v in &neighbors[u as usize] {
            if row[v as usize] == NONE {
                row[v as usize] = row[u as usize] + 1;
                queue.push_back(v);
            }
        }
    }
    row
}

/// The lowest vertex that each is joined with.
fn components(neighbors: &[Vec<u32>]) -> Vec<u32> {
    let mut component = vec![NONE; neighbors.len()];
    let mut stack = Vec::new();
    for first in 0..neighbors.len() as u32 {
        if component[first as usize] != NONE {
            continue;
        }
        component[first as usize] = first;
        stack.push(first);
        while let Some(u) = stack.pop() {
            for &v in &neighbors[u as usize] {
                if component[v as usize] == NONE {
                    component[v as usize] = first;
                    stack.push(v);
                }
            }
        }
    }
    component
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{grid, v};

    #[test]
    fn leaves_are_dead_ends_and_ways_out() {
        // 0 1 2 3 in a row and 4 5 6 7 above: a 4 x 2 grid with all edges.
        let map = grid(4, 2, &[]);
        let part = LocalGraph::over(&map, vec![v(0), v(1), v(2), v(4)]);
        let leaves: Vec<_> = part.leaves(v(0)).collect();
        // 0 has two neighbours inside and no edge out; 1 leads to 5, 2 to 3 and 6, 4 to 5.
        assert_eq!(leaves, [v(1), v(2), v(4)]);
    }

    #[test]
    fn paths_stay_inside_and_components_apart() {
        let map = grid(4, 2, &[]);
        let part = LocalGraph::over(&map, vec![v(0), v(4), v(5), v(6), v(3)]);
        assert_eq!(part.path(v(0), v(6)).unwrap(), [v(0), v(4), v(5), v(6)]);
        assert_eq!(part.path(v(0), v(3)), None);
        assert_eq!(part.path(v(0), v(7)), None);
        assert!(part.leaves(v(0)).all(|leaf| leaf != v(3)));
    }

    #[test]
    fn the_whole_map_gives_the_roadmaps_own_distances() {
        let map = Roadmap::builtin("crater-sparse").unwrap();
        let whole = LocalGraph::over(&map, map.vertices().collect());
        for u in map.vertices().step_by(7) {
            for w in map.vertices() {
                assert_eq!(whole.path(u, w), Some(map.shortest_path(u, w)));
            }
        }
    }
}
