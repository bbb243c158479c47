//! Roadmaps: undirected, connected graphs embedded in the plane, on which rovers move.
//!
//! This file holds the graph and its distances; its checks are in `check`, the file format in
//! `file`. The built-in maps are made by [`crate::generate`]; who owns which vertex is the affair
//! of [`crate::sensors`].

mod check;
mod closed;
mod distances;
mod endpoints;
mod file;
mod well_formed;

use std::sync::Arc;

use nalgebra::Point2;

use crate::error::RoadmapError;
use crate::ids::VertexId;
pub(crate) use check::segments_meet;
use distances::Distances;
pub use distances::DistancesTo;
pub use endpoints::Endpoints;
pub use file::RoadmapTable;
pub use well_formed::{Blocked, well_formed};

/// The most vertices a roadmap may have: twice a full grid of 256 by 256, and more than the largest
/// map of the benchmark of multi-agent path-finding, `orz900d`, has.
pub const MAX_VERTICES: usize = 131_072;

/// The largest magnitude of a coordinate or height \[m\].
pub const MAX_COORDINATE_M: f64 = 1.0e6;

/// A roadmap of safe paths (*network-guided*, section 2): an undirected connected graph, embedded
/// in the plane without crossings, with a boundary where rovers enter and leave. Immutable.
///
/// A rover moves along one edge in one planning cycle, so distances count edges.
///
/// ```
/// use farside_worlds::{Roadmap, VertexId};
/// let map = Roadmap::builtin("crater-sparse")?;
/// assert_eq!((map.len(), map.edge_count()), (178, 183));
/// let (west, east) = (map.boundary()[0], map.boundary()[map.boundary().len() / 2]);
/// let path = map.shortest_path(west, east);
/// assert_eq!(path.len() as u32, map.distance(west, east) + 1);
/// assert!(path.windows(2).all(|step| map.are_adjacent(step[0], step[1])));
/// # Ok::<(), farside_worlds::WorldError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Roadmap {
    name: String,
    positions_m: Vec<Point2<f64>>,
    heights_m: Vec<f64>,
    edges: Vec<(VertexId, VertexId)>,
    boundary: Vec<VertexId>,
    /// Sorted neighbours of each vertex.
    neighbors: Vec<Vec<VertexId>>,
    /// Shared by copies.
    distances: Arc<Distances>,
}

impl Roadmap {
    /// A roadmap of vertices at `positions_m` \[m\], joined by `edges`, with entries and exits at
    /// `boundary` (in any order). Edges are kept as (lower, higher), sorted.
    ///
    /// ```
    /// use farside_worlds::{Roadmap, VertexId};
    /// use nalgebra::Point2;
    /// let v = VertexId;
    /// let corners = vec![Point2::new(0.0, 0.0), Point2::new(9.0, 0.0), Point2::new(9.0, 9.0)];
    /// let edges = vec![(v(1), v(0)), (v(1), v(2))];
    /// let map = Roadmap::new("bend", corners, edges, vec![v(0), v(2)])?;
    /// assert_eq!(map.shortest_path(v(0), v(2)), [v(0), v(1), v(2)]);
    /// # Ok::<(), farside_worlds::RoadmapError>(())
    /// ```
    ///
    /// # Errors
    /// When there is no vertex or no boundary, an index is out of range, an edge or boundary vertex
    /// is given twice, an edge joins a vertex to itself, the graph falls apart, two vertices
    /// coincide, two edges meet elsewhere than at a common end, or two vertices may be more than
    /// 65,534 edges apart.
    pub fn new(
        name: &str,
        positions_m: Vec<Point2<f64>>,
        edges: Vec<(VertexId, VertexId)>,
        boundary: Vec<VertexId>,
    ) -> Result<Roadmap, RoadmapError> {
        let edges = in_order(edges);
        check::graph(&positions_m, &edges, &boundary)?;
        check::embedding(&positions_m, &edges)?;
        Self::checked(name, positions_m, edges, boundary)
    }

    /// The same for vertices on the points of a lattice, each edge between two beside each other:
    /// these cannot meet elsewhere, and need no search for those that do.
    pub(crate) fn on_lattice(
        name: &str,
        positions_m: Vec<Point2<f64>>,
        edges: Vec<(VertexId, VertexId)>,
        boundary: Vec<VertexId>,
    ) -> Result<Roadmap, RoadmapError> {
        let edges = in_order(edges);
        check::graph(&positions_m, &edges, &boundary)?;
        Self::checked(name, positions_m, edges, boundary)
    }

    fn checked(
        name: &str,
        positions_m: Vec<Point2<f64>>,
        edges: Vec<(VertexId, VertexId)>,
        mut boundary: Vec<VertexId>,
    ) -> Result<Roadmap, RoadmapError> {
        let mut neighbors = vec![Vec::new(); positions_m.len()];
        for &(u, v) in &edges {
            neighbors[u.0 as usize].push(v);
            neighbors[v.0 as usize].push(u);
        }
        for list in &mut neighbors {
            list.sort_unstable();
        }
        let distances = Arc::new(Distances::new(&neighbors)?);
        sort_round_the_rim(&positions_m, &mut boundary);
        let heights_m = vec![0.0; positions_m.len()];
        let name = name.to_owned();
        Ok(Roadmap {
            name,
            positions_m,
            heights_m,
            edges,
            boundary,
            neighbors,
            distances,
        })
    }

    /// The same roadmap with the terrain's height at each vertex \[m\], for viewers and radio
    /// links.
    ///
    /// # Errors
    /// When there is not one finite height for each vertex.
    pub fn with_heights_m(mut self, heights_m: Vec<f64>) -> Result<Roadmap, RoadmapError> {
        check::heights(self.len(), &heights_m)?;
        self.heights_m = heights_m;
        Ok(self)
    }

    /// The roadmap's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The number of vertices; at least 1.
    #[allow(clippy::len_without_is_empty, reason = "a roadmap is never empty")]
    pub fn len(&self) -> usize {
        self.positions_m.len()
    }

    /// The number of edges.
    pub fn edge_count(&self) -> usize {
        self.edges.len()
    }

    /// All vertices, from 0 up.
    pub fn vertices(&self) -> impl ExactSizeIterator<Item = VertexId> + use<> {
        (0..self.positions_m.len() as u32).map(VertexId)
    }

    /// All edges as (lower, higher), sorted.
    pub fn edges(&self) -> &[(VertexId, VertexId)] {
        &self.edges
    }

    /// The vertices one edge away from `v`, sorted.
    ///
    /// # Panics
    /// When `v` is not in the roadmap, here and below: a bug in the caller.
    pub fn neighbors(&self, v: VertexId) -> &[VertexId] {
        &self.neighbors[v.0 as usize]
    }

    /// Whether an edge joins `u` and `v`.
    pub fn are_adjacent(&self, u: VertexId, v: VertexId) -> bool {
        self.neighbors(u).binary_search(&v).is_ok()
    }

    /// Where `v` lies in the plane, x to the east and y to the north \[m\].
    pub fn position_m(&self, v: VertexId) -> Point2<f64> {
        self.positions_m[v.0 as usize]
    }

    /// The terrain's height at `v` \[m\]; 0 where no terrain was given.
    pub fn height_m(&self, v: VertexId) -> f64 {
        self.heights_m[v.0 as usize]
    }

    /// The vertices where rovers enter and leave, anticlockwise round the mean of all positions,
    /// from the west (-pi) on.
    pub fn boundary(&self) -> &[VertexId] {
        &self.boundary
    }

    /// The fewest edges between `u` and `v`; [`Roadmap::UNREACHABLE`] if none lead there, which
    /// only happens where vertices are closed ([`Roadmap::without`]). Of many vertices to one goal,
    /// [`Roadmap::distances_to`] tells them faster.
    pub fn distance(&self, u: VertexId, v: VertexId) -> u32 {
        assert!(
            (v.0 as usize) < self.len(),
            "vertex {} of {}",
            v.0,
            self.len()
        );
        self.distances.between(&self.neighbors, u, v)
    }

    /// The fewest edges to `goal` from every vertex.
    pub fn distances_to(&self, goal: VertexId) -> DistancesTo<'_> {
        self.distances.to(&self.neighbors, goal)
    }

    /// The largest distance between two vertices, of those that have one. On roadmaps of more than
    /// 4,096 vertices it is worked out when it is first asked for.
    pub fn diameter(&self) -> u32 {
        self.distances.diameter(&self.neighbors)
    }

    /// A path of fewest edges from `u` to `v`, both included; of several, the one whose vertices
    /// come first in order (each step goes to the lowest vertex that is nearer to `v`).
    ///
    /// # Panics
    /// Also when none leads there.
    pub fn shortest_path(&self, u: VertexId, v: VertexId) -> Vec<VertexId> {
        let left = self.distances_to(v);
        let mut path = Vec::with_capacity(left.from(u) as usize + 1);
        let mut here = u;
        path.push(here);
        while here != v {
            let next = self
                .neighbors(here)
                .iter()
                .find(|&&w| left.from(w) + 1 == left.from(here));
            here = *next.expect("where a path leads there some neighbour is nearer");
            path.push(here);
        }
        path
    }
}

/// Each edge as (lower, higher), sorted.
fn in_order(mut edges: Vec<(VertexId, VertexId)>) -> Vec<(VertexId, VertexId)> {
    for edge in &mut edges {
        *edge = (edge.0.min(edge.1), edge.0.max(edge.1));
    }
    edges.sort_unstable();
    edges
}

/// Sorts the boundary by angle round the mean of all positions, equal angles by vertex.
fn sort_round_the_rim(positions_m: &[Point2<f64>], boundary: &mut [VertexId]) {
    let count = positions_m.len() as f64;
    let centre_x = positions_m.iter().map(|p| p.x).sum::<f64>() / count;
    let centre_y = positions_m.iter().map(|p| p.y).sum::<f64>() / count;
    let angle = |v: &VertexId| {
        let p = positions_m[v.0 as usize];
        libm::atan2(p.y - centre_y, p.x - centre_x)
    };
    boundary.sort_by(|a, b| angle(a).total_cmp(&angle(b)).then(a.cmp(b)));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn v(id: u32) -> VertexId {
        VertexId(id)
    }

    /// A square 0 1 2 3 with a tail 4 at corner 0.
    fn square() -> Roadmap {
        let points = [
            (0.0, 0.0),
            (10.0, 0.0),
            (10.0, 10.0),
            (0.0, 10.0),
            (-10.0, -5.0),
        ];
        let positions_m = points.map(|(x, y)| Point2::new(x, y)).to_vec();
        let edges = [(1, 0), (1, 2), (3, 2), (0, 3), (4, 0)]
            .map(|(a, b)| (v(a), v(b)))
            .to_vec();
        Roadmap::new("square", positions_m, edges, vec![v(2), v(4), v(1)]).unwrap()
    }

    #[test]
    fn ties_go_to_the_lowest_vertex() {
        let map = square();
        assert_eq!(map.shortest_path(v(0), v(2)), [v(0), v(1), v(2)]);
        assert_eq!(map.shortest_path(v(2), v(0)), [v(2), v(1), v(0)]);
        assert_eq!(map.shortest_path(v(3), v(3)), [v(3)]);
    }

    #[test]
    fn distances_and_neighbours() {
        let map = square();
        assert_eq!(map.distance(v(4), v(2)), 3);
        assert_eq!(map.diameter(), 3);
        assert_eq!(map.neighbors(v(0)), [v(1), v(3), v(4)]);
        assert!(map.are_adjacent(v(3), v(0)) && !map.are_adjacent(v(1), v(3)));
        assert_eq!(map.edges()[0], (v(0), v(1)));
    }

    #[test]
    fn the_boundary_runs_round_the_rim() {
        assert_eq!(square().boundary(), [v(4), v(1), v(2)]);
    }

    #[test]
    fn one_vertex_is_a_roadmap() {
        let map = Roadmap::new("dot", vec![Point2::origin()], vec![], vec![v(0)]).unwrap();
        assert_eq!((map.len(), map.edge_count(), map.diameter()), (1, 0, 0));
    }
}
