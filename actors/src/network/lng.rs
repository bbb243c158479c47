//! The local neighbourhood graph of a sensor node (*network-guided*, section 3.2): the part of the
//! roadmap owned by the node and its radio neighbours, with its leaves and its shortest paths.
//!
//! Static: built once, from the roadmap and the network. Who stands where is no affair of this file.

use farside_worlds::{NodeId, Roadmap, SensorNetwork, VertexId};

/// Marks a vertex outside the graph, and an unreachable one.
const NONE: u16 = u16::MAX;

/// `LNG(n)`: the union of the node's own subgraph and its neighbours', with all roadmap edges
/// between them.
#[derive(Debug)]
pub(crate) struct LocalGraph {
    /// Sorted; a local index is a place in this list.
    vertices: Vec<VertexId>,
    /// Local index of each vertex of the roadmap.
    local: Vec<u16>,
    neighbors: Vec<Vec<u16>>,
    /// Hops inside the graph between all pairs, row by row.
    hops: Vec<u16>,
    /// The leaves, ascending: see [`LocalGraph::leaves`].
    leaves: Vec<u16>,
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
            local[v.0 as usize] = index as u16;
        }
        let inside = |v: &VertexId| Some(local[v.0 as usize]).filter(|&index| index != NONE);
        let neighbors: Vec<Vec<u16>> = vertices
            .iter()
            .map(|&v| roadmap.neighbors(v).iter().filter_map(inside).collect())
            .collect();
        // A leaf has at most one neighbour inside, or an edge that leads out.
        let leaves = (0..vertices.len())
            .filter(|&i| {
                neighbors[i].len() <= 1 || neighbors[i].len() < roadmap.neighbors(vertices[i]).len()
            })
            .map(|i| i as u16)
            .collect();
        let hops = hops(&neighbors);
        LocalGraph {
            vertices,
            local,
            neighbors,
            hops,
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
        let list = index.map_or(&[][..], |index| &self.neighbors[usize::from(index)]);
        list.iter().map(|&n| self.vertices[usize::from(n)])
    }

    /// The fewest edges between two vertices of the graph on a path inside it; `None` if one is
    /// outside, or no such path exists.
    pub(crate) fn distance(&self, u: VertexId, v: VertexId) -> Option<u32> {
        let (u, v) = (self.local[u.0 as usize], self.local[v.0 as usize]);
        if u == NONE || v == NONE {
            return None;
        }
        let hops = self.hops[usize::from(u) * self.vertices.len() + usize::from(v)];
        (hops != NONE).then_some(u32::from(hops))
    }

    /// The leaves in the connected component of `from`, ascending: vertices with at most one
    /// neighbour inside the graph, or with an edge that leaves it. `from` itself may be one.
    pub(crate) fn leaves(&self, from: VertexId) -> impl Iterator<Item = VertexId> + '_ {
        let all = self.leaves.iter().map(|&l| self.vertices[usize::from(l)]);
        all.filter(move |&leaf| self.distance(from, leaf).is_some())
    }

    /// A shortest path inside the graph, both ends included; of several, each step goes to the
    /// lowest vertex. `None` where [`LocalGraph::distance`] is.
    pub(crate) fn path(&self, from: VertexId, to: VertexId) -> Option<Vec<VertexId>> {
        let mut left = self.distance(from, to)? as u16;
        let to_row = usize::from(self.local[to.0 as usize]) * self.vertices.len();
        let mut here = self.local[from.0 as usize];
        let mut path = Vec::with_capacity(usize::from(left) + 2);
        path.push(from);
        while left > 0 {
            left -= 1;
            let nearer = |&&n: &&u16| self.hops[to_row + usize::from(n)] == left;
            let next = self.neighbors[usize::from(here)].iter().find(nearer);
            here = *next.expect("a vertex at finite distance has a nearer neighbour");
            path.push(self.vertices[usize::from(here)]);
        }
        Some(path)
    }
}

/// Hops between all pairs, row by row, [`NONE`] where there is no path.
fn hops(neighbors: &[Vec<u16>]) -> Vec<u16> {
    let n = neighbors.len();
    let mut hops = vec![NONE; n * n];
    let mut queue = std::collections::VecDeque::new();
    for (source, row) in hops.chunks_exact_mut(n.max(1)).enumerate() {
        row[source] = 0;
        queue.push_back(source);
        while let Some(u) = queue.pop_front() {
            for &v in &neighbors[u] {
                let v = usize::from(v);
                if row[v] == NONE {
                    row[v] = row[u] + 1;
                    queue.push_back(v);
                }
            }
        }
    }
    hops
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::testing::{grid, v};

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
        assert_eq!(part.distance(v(0), v(3)), None);
        assert_eq!(part.path(v(0), v(7)), None);
        assert!(part.leaves(v(0)).all(|leaf| leaf != v(3)));
    }

    #[test]
    fn the_whole_map_gives_the_roadmaps_own_distances() {
        let map = Roadmap::builtin("crater-sparse").unwrap();
        let whole = LocalGraph::over(&map, map.vertices().collect());
        for u in map.vertices().step_by(7) {
            for w in map.vertices() {
                assert_eq!(whole.distance(u, w), Some(map.distance(u, w)));
            }
            let path = whole.path(u, v(0)).unwrap();
            assert_eq!(path, map.shortest_path(u, v(0)));
        }
    }
}
