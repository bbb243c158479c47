//! Sensor networks: static radio nodes that divide a roadmap among themselves.
//!
//! This file holds a network, its checks and who owns what; the search for a random one is in
//! `placement`, how far nodes reach rovers in `coverage`, another division of the vertices in
//! `ownership`. What the nodes compute and send is no affair of this crate, and neither is the
//! radio: here two nodes are neighbours when they are within one radius of each other.

mod coverage;
mod ownership;
mod placement;

pub use ownership::Ownership;

use nalgebra::Point2;

use crate::error::SensorError;
use crate::ids::{NodeId, VertexId};
use crate::roadmap::{MAX_COORDINATE_M, Roadmap};

/// Radio nodes over a roadmap (*network-guided*, sections 2 and 4). Each vertex belongs to the node
/// nearest to it; nodes within the radius of each other are neighbours. Immutable.
///
/// Every network here keeps four promises: it is connected, every node owns a vertex, every vertex
/// is within the radius of its owner ("coverage of all roadmap vertices", section 4; rovers may be
/// reached less far, see [`SensorNetwork::with_coverage`]), and it is
/// **consistent with the roadmap**: the owners of the two ends of every edge are the same node or
/// neighbours, so that a rover is never handed over out of radio range. The last one is not in the
/// paper; without it rovers stand at such edges for ever.
///
/// ```
/// use farside_worlds::{Roadmap, SensorNetwork};
/// let map = Roadmap::builtin("crater-dense")?;
/// let network = SensorNetwork::place(&map, 28, SensorNetwork::default_radius_m(&map, 28), 7)?;
/// let owned: usize = network.nodes().map(|n| network.owned(n).len()).sum();
/// assert_eq!((network.len(), owned), (28, map.len()));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct SensorNetwork {
    positions_m: Vec<Point2<f64>>,
    radius_m: f64,
    neighbors: Vec<Vec<NodeId>>,
    owners: Vec<NodeId>,
    owned: Vec<Vec<VertexId>>,
    /// How far a node reaches rovers; as far as nodes, if nothing else is said.
    coverage_m: f64,
    /// Vertices out of it, sorted.
    gaps: Vec<VertexId>,
}

impl SensorNetwork {
    /// The network with nodes at `positions_m` \[m\] and radio radius `radius_m` \[m\].
    ///
    /// ```
    /// use farside_worlds::{Roadmap, SensorError, SensorNetwork, VertexId};
    /// use nalgebra::Point2;
    /// let ends = vec![Point2::new(0.0, 0.0), Point2::new(10.0, 0.0)];
    /// let edges = vec![(VertexId(0), VertexId(1))];
    /// let map = Roadmap::new("pair", ends.clone(), edges, vec![VertexId(0)])?;
    /// assert!(SensorNetwork::new(&map, ends.clone(), 10.0).is_ok());
    /// let error = SensorNetwork::new(&map, ends, 9.0).unwrap_err();
    /// assert!(matches!(error, SensorError::InconsistentEdges { .. }));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// When there is no node or more nodes than vertices, the radius is not positive, a node owns
    /// no vertex, vertices are out of their owners' range or edges inconsistent (the errors name
    /// them all).
    pub fn new(
        roadmap: &Roadmap,
        positions_m: Vec<Point2<f64>>,
        radius_m: f64,
    ) -> Result<SensorNetwork, SensorError> {
        check_request(roadmap, positions_m.len(), radius_m)?;
        for (p, node) in positions_m.iter().zip((0..).map(NodeId)) {
            // Written so that a NaN fails.
            if !(p.x.abs() <= MAX_COORDINATE_M && p.y.abs() <= MAX_COORDINATE_M) {
                let (x_m, y_m, limit_m) = (p.x, p.y, MAX_COORDINATE_M);
                return Err(SensorError::Position {
                    node,
                    x_m,
                    y_m,
                    limit_m,
                });
            }
        }
        let owners: Vec<NodeId> = roadmap
            .vertices()
            .map(|v| nearest(&positions_m, roadmap.position_m(v)))
            .collect();
        let mut owned = vec![Vec::new(); positions_m.len()];
        for (vertex, owner) in roadmap.vertices().zip(&owners) {
            owned[owner.0 as usize].push(vertex);
        }
        let neighbors = within_radius(&positions_m, radius_m);
        let network = SensorNetwork {
            positions_m,
            radius_m,
            neighbors,
            owners,
            owned,
            coverage_m: radius_m,
            gaps: Vec::new(),
        };
        network.check(roadmap)?;
        Ok(network)
    }

    fn check(&self, roadmap: &Roadmap) -> Result<(), SensorError> {
        if let Some(node) = self.nodes().find(|&n| self.owned(n).is_empty()) {
            return Err(SensorError::Idle { node });
        }
        let radius_m = self.radius_m;
        let vertices = self.beyond(roadmap, radius_m);
        if !vertices.is_empty() {
            return Err(SensorError::Uncovered { vertices, radius_m });
        }
        let edges = self.inconsistent_edges(roadmap);
        if !edges.is_empty() {
            return Err(SensorError::InconsistentEdges {
                edges,
                radius_m: self.radius_m,
            });
        }
        // A connected roadmap, no idle node and consistent edges leave no other possibility.
        assert!(
            self.is_connected(),
            "a consistent network over a connected roadmap is connected"
        );
        Ok(())
    }

    fn inconsistent_edges(&self, roadmap: &Roadmap) -> Vec<(VertexId, VertexId)> {
        let broken = |&&(u, v): &&(VertexId, VertexId)| {
            let (a, b) = (self.owner(u), self.owner(v));
            a != b && !self.are_neighbors(a, b)
        };
        roadmap.edges().iter().filter(broken).copied().collect()
    }

    fn is_connected(&self) -> bool {
        let mut reached = vec![false; self.len()];
        let mut stack = vec![NodeId(0)];
        while let Some(node) = stack.pop() {
            if !std::mem::replace(&mut reached[node.0 as usize], true) {
                stack.extend(self.neighbors(node));
            }
        }
        reached.iter().all(|&yes| yes)
    }

    /// The number of nodes; at least 1.
    #[allow(clippy::len_without_is_empty, reason = "a network is never empty")]
    pub fn len(&self) -> usize {
        self.positions_m.len()
    }

    /// All nodes, from 0 up.
    pub fn nodes(&self) -> impl ExactSizeIterator<Item = NodeId> + use<> {
        (0..self.positions_m.len() as u32).map(NodeId)
    }

    /// Where the node stands \[m\].
    ///
    /// # Panics
    /// When `n` is not in the network, here and below: a bug in the caller.
    pub fn position_m(&self, n: NodeId) -> Point2<f64> {
        self.positions_m[n.0 as usize]
    }

    /// The radio radius of every node \[m\].
    pub fn radius_m(&self) -> f64 {
        self.radius_m
    }

    /// The other nodes within the radius of `n`, sorted.
    pub fn neighbors(&self, n: NodeId) -> &[NodeId] {
        &self.neighbors[n.0 as usize]
    }

    /// Whether two different nodes are within the radius of each other.
    pub fn are_neighbors(&self, a: NodeId, b: NodeId) -> bool {
        self.neighbors(a).binary_search(&b).is_ok()
    }

    /// The node that the vertex belongs to: the nearest, of equally near ones the lowest, unless
    /// [`SensorNetwork::owned_by`] said otherwise.
    pub fn owner(&self, v: VertexId) -> NodeId {
        self.owners[v.0 as usize]
    }

    /// The vertices that `n` owns, sorted; at least one.
    pub fn owned(&self, n: NodeId) -> &[VertexId] {
        &self.owned[n.0 as usize]
    }
}

fn check_request(roadmap: &Roadmap, nodes: usize, radius_m: f64) -> Result<(), SensorError> {
    if nodes == 0 || nodes > roadmap.len() {
        return Err(SensorError::NodeCount {
            vertices: roadmap.len(),
            actual: nodes,
        });
    }
    if !(radius_m > 0.0 && radius_m.is_finite()) {
        return Err(SensorError::Radius { actual_m: radius_m });
    }
    Ok(())
}

/// The node nearest to `p`, of equally near ones the lowest.
fn nearest(positions_m: &[Point2<f64>], p: Point2<f64>) -> NodeId {
    let mut best = (f64::INFINITY, NodeId(0));
    for (at, node) in positions_m.iter().zip((0..).map(NodeId)) {
        let squared = (at - p).norm_squared();
        if squared < best.0 {
            best = (squared, node);
        }
    }
    best.1
}

fn within_radius(positions_m: &[Point2<f64>], radius_m: f64) -> Vec<Vec<NodeId>> {
    let near = |a: usize, b: usize| {
        a != b && (positions_m[a] - positions_m[b]).norm_squared() <= radius_m * radius_m
    };
    let all = 0..positions_m.len();
    all.clone()
        .map(|a| {
            all.clone()
                .filter(|&b| near(a, b))
                .map(|b| NodeId(b as u32))
                .collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four vertices on a line, 10 m apart.
    fn line() -> Roadmap {
        let positions_m = (0..4)
            .map(|i| Point2::new(10.0 * f64::from(i), 0.0))
            .collect();
        let edges = (0..3).map(|i| (VertexId(i), VertexId(i + 1))).collect();
        Roadmap::new("line", positions_m, edges, vec![VertexId(0), VertexId(3)]).unwrap()
    }

    fn at(xs: &[f64]) -> Vec<Point2<f64>> {
        xs.iter().map(|&x| Point2::new(x, 0.0)).collect()
    }

    #[test]
    fn a_tie_goes_to_the_lowest_node() {
        let network = SensorNetwork::new(&line(), at(&[20.0, 0.0]), 20.0).unwrap();
        let owners: Vec<u32> = (0..4).map(|v| network.owner(VertexId(v)).0).collect();
        assert_eq!(owners, [1, 0, 0, 0]);
        assert_eq!(network.owned(NodeId(1)), [VertexId(0)]);
        assert_eq!(network.neighbors(NodeId(0)), [NodeId(1)]);
    }

    #[test]
    fn each_rule_has_its_error() {
        let map = line();
        let error = |xs: &[f64], radius_m| SensorNetwork::new(&map, at(xs), radius_m).unwrap_err();
        assert_eq!(
            error(&[], 1.0),
            SensorError::NodeCount {
                vertices: 4,
                actual: 0
            }
        );
        assert_eq!(
            error(&[0.0; 5], 1.0),
            SensorError::NodeCount {
                vertices: 4,
                actual: 5
            }
        );
        assert_eq!(error(&[0.0], 0.0), SensorError::Radius { actual_m: 0.0 });
        assert!(matches!(
            error(&[0.0], f64::NAN),
            SensorError::Radius { .. }
        ));
        assert!(matches!(
            error(&[f64::NAN], 1.0),
            SensorError::Position { .. }
        ));
        assert_eq!(
            error(&[0.0, 0.0], 1.0),
            SensorError::Idle { node: NodeId(1) }
        );
        let edges = vec![(VertexId(1), VertexId(2))];
        let radius_m = 29.0;
        assert_eq!(
            error(&[0.0, 30.0], radius_m),
            SensorError::InconsistentEdges { edges, radius_m }
        );
        let vertices = vec![VertexId(2), VertexId(3)];
        assert_eq!(
            error(&[0.0], 19.0),
            SensorError::Uncovered {
                vertices,
                radius_m: 19.0
            }
        );
        let text = error(&[0.0, 30.0], radius_m).to_string();
        assert!(text.contains("1 edges") && text.contains("1 - 2"), "{text}");
    }

    #[test]
    fn the_radius_itself_is_in_range() {
        assert!(SensorNetwork::new(&line(), at(&[0.0, 30.0]), 30.0).is_ok());
    }
}
