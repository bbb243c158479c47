//! The search for a random network that keeps a network's promises.
//!
//! Nodes are thrown over the roadmap, a few metres apart; then broken edges pull their owners
//! together and idle nodes are thrown again, until nothing is broken or the attempt is given up
//! for the next. All draws come from the seed, so that equal requests get equal networks.

use farside::random::{RandomKey, Stream};
use nalgebra::Point2;

use super::coverage::check_coverage;
use super::{SensorNetwork, check_request, nearest};
use crate::error::SensorError;
use crate::ids::NodeId;
use crate::roadmap::Roadmap;

/// Placements tried before the search gives up, and fewer where each is dear.
const ATTEMPTS: usize = 64;

/// Nodes times vertices over all attempts, which bounds the time a hopeless search takes.
const MOST_WORK: usize = 4_000_000;

/// Repairs tried on each of them.
const REPAIRS: usize = 64;

/// Throws of one node before its distance from others, or from the roadmap, is let go.
const THROWS: usize = 64;

/// The least distance between two thrown nodes, as a share of the mean spacing.
const LEAST_SPACING: f64 = 0.5;

/// The default radius in mean spacings; tuned so that (nearly) every seed places 14, 21 and 28
/// nodes on both built-in roadmaps.
const RADIUS_SPACINGS: f64 = 1.9;

impl SensorNetwork {
    /// A random network of so many nodes, the same for the same `seed`.
    ///
    /// ```
    /// use farside_worlds::{Roadmap, SensorError, SensorNetwork};
    /// let map = Roadmap::builtin("crater-sparse")?;
    /// let radius_m = SensorNetwork::default_radius_m(&map, 14);
    /// let network = SensorNetwork::place(&map, 14, radius_m, 3)?;
    /// assert_eq!(network, SensorNetwork::place(&map, 14, radius_m, 3)?);
    /// let error = SensorNetwork::place(&map, 14, 20.0, 3).unwrap_err();
    /// assert!(matches!(error, SensorError::NoPlacement { .. }));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// When `nodes` is 0 or more than there are vertices, the radius is not positive, or no
    /// placement was found; that error has what was wrong with the last one.
    pub fn place(
        roadmap: &Roadmap,
        nodes: usize,
        radius_m: f64,
        seed: u64,
    ) -> Result<SensorNetwork, SensorError> {
        Self::place_covering(roadmap, nodes, radius_m, radius_m, seed)
    }

    /// The same with nodes that reach rovers as far as `coverage_m` \[m\] only, and placed so that
    /// this leaves no gap.
    ///
    /// # Errors
    /// The same; and when `coverage_m` is not a positive finite number.
    pub fn place_covering(
        roadmap: &Roadmap,
        nodes: usize,
        radius_m: f64,
        coverage_m: f64,
        seed: u64,
    ) -> Result<SensorNetwork, SensorError> {
        check_request(roadmap, nodes, radius_m)?;
        check_coverage(coverage_m)?;
        let key = RandomKey::new(seed)
            .text("sensor_placement")
            .number(nodes as u64);
        let attempts = (MOST_WORK / (nodes * roadmap.len())).clamp(2, ATTEMPTS);
        let mut last = None;
        for attempt in 0..attempts {
            let mut search = Search::new(
                roadmap,
                (radius_m, coverage_m),
                key.number(attempt as u64).stream(),
            );
            search.throw_all(nodes);
            match search.repaired() {
                Ok(network) => return Ok(network),
                Err(error) => last = Some(Box::new(error)),
            }
        }
        let last = last.expect("at least one placement was tried");
        let suggested_m = Self::default_radius_m(roadmap, nodes);
        Err(SensorError::NoPlacement {
            nodes,
            radius_m,
            coverage_m,
            attempts,
            last,
            suggested_m,
        })
    }

    /// A radio radius \[m\] with which [`SensorNetwork::place`] finds a placement for (nearly)
    /// every seed: a fixed multiple of the nodes' mean spacing over the roadmap.
    pub fn default_radius_m(roadmap: &Roadmap, nodes: usize) -> f64 {
        libm::ceil(RADIUS_SPACINGS * mean_spacing_m(roadmap, nodes)).max(1.0)
    }
}

/// The spacing that so many nodes have when spread evenly over the roadmap's extent \[m\].
fn mean_spacing_m(roadmap: &Roadmap, nodes: usize) -> f64 {
    let (low, high) = extent_m(roadmap);
    let size = high - low;
    let nodes = nodes.max(1) as f64;
    // An ellipse in the extent; or a line, where the extent is flat.
    let area_m2 = std::f64::consts::FRAC_PI_4 * size.x * size.y;
    libm::sqrt(area_m2 / nodes).max(libm::hypot(size.x, size.y) / nodes)
}

/// The south-western and north-eastern corners of the box round all vertices.
fn extent_m(roadmap: &Roadmap) -> (Point2<f64>, Point2<f64>) {
    let start = roadmap.position_m(crate::VertexId(0));
    roadmap
        .vertices()
        .map(|v| roadmap.position_m(v))
        .fold((start, start), |(low, high), p| (low.inf(&p), high.sup(&p)))
}

/// One attempt at a placement.
struct Search<'a> {
    roadmap: &'a Roadmap,
    radius_m: f64,
    /// How far a node reaches rovers.
    coverage_m: f64,
    stream: Stream,
    positions_m: Vec<Point2<f64>>,
}

impl<'a> Search<'a> {
    fn new(roadmap: &'a Roadmap, (radius_m, coverage_m): (f64, f64), stream: Stream) -> Self {
        Search {
            roadmap,
            radius_m,
            coverage_m,
            stream,
            positions_m: Vec::new(),
        }
    }

    fn throw_all(&mut self, nodes: usize) {
        let spacing_m = mean_spacing_m(self.roadmap, nodes);
        for _ in 0..nodes {
            let position = self.throw(spacing_m);
            self.positions_m.push(position);
        }
    }

    /// A place near the roadmap and away from the nodes thrown so far, if a few throws find one.
    fn throw(&mut self, spacing_m: f64) -> Point2<f64> {
        let (low, high) = extent_m(self.roadmap);
        let mut place = low;
        for _ in 0..THROWS {
            // `uniform_in` of a flat extent gives that extent.
            place.x = self.stream.uniform_in(low.x, high.x);
            place.y = self.stream.uniform_in(low.y, high.y);
            let clear = self
                .positions_m
                .iter()
                .all(|p| (p - place).norm() >= LEAST_SPACING * spacing_m);
            let mut vertices = self.roadmap.vertices().map(|v| self.roadmap.position_m(v));
            if clear && vertices.any(|p| (p - place).norm() <= LEAST_SPACING * spacing_m) {
                break;
            }
        }
        place
    }

    /// The network, once its broken promises are mended; or what is broken still.
    fn repaired(&mut self) -> Result<SensorNetwork, SensorError> {
        let mut repairs = 0;
        loop {
            let broken = match self.network() {
                Ok(network) => return Ok(network),
                Err(error) if repairs == REPAIRS => return Err(error),
                Err(error) => error,
            };
            repairs += 1;
            match broken {
                SensorError::Idle { node } => self.settle(node),
                SensorError::InconsistentEdges { edges, .. } => {
                    for (u, v) in edges {
                        let a = nearest(&self.positions_m, self.roadmap.position_m(u));
                        let b = nearest(&self.positions_m, self.roadmap.position_m(v));
                        self.pull_together(a, b);
                    }
                }
                SensorError::Uncovered { vertices, .. } => {
                    for v in vertices {
                        self.pull_to(self.roadmap.position_m(v));
                    }
                }
                other => return Err(other),
            }
        }
    }

    /// The network as it stands.
    fn network(&self) -> Result<SensorNetwork, SensorError> {
        let network = SensorNetwork::new(self.roadmap, self.positions_m.clone(), self.radius_m)?;
        let network = network.with_coverage(self.roadmap, self.coverage_m)?;
        if network.gaps.is_empty() {
            return Ok(network);
        }
        Err(SensorError::Uncovered {
            vertices: network.gaps,
            radius_m: self.coverage_m,
        })
    }

    /// Moves an idle node to a vertex at random: it is then the nearest to that one, unless
    /// another stands there.
    fn settle(&mut self, node: NodeId) {
        let vertex = crate::VertexId(self.stream.below(self.roadmap.len() as u64) as u32);
        self.positions_m[node.0 as usize] = self.roadmap.position_m(vertex);
    }

    /// Moves the node nearest to `place` until it just reaches it.
    fn pull_to(&mut self, place: Point2<f64>) {
        let node = nearest(&self.positions_m, place).0 as usize;
        let way = place - self.positions_m[node];
        let excess_m = way.norm() - 0.99 * self.radius_m.min(self.coverage_m);
        if excess_m > 0.0 {
            self.positions_m[node] += way * (excess_m / way.norm());
        }
    }

    /// Moves two nodes towards each other until they are just within the radius.
    fn pull_together(&mut self, a: NodeId, b: NodeId) {
        let (from, to) = (
            self.positions_m[a.0 as usize],
            self.positions_m[b.0 as usize],
        );
        let apart_m = (to - from).norm();
        let excess_m = apart_m - 0.99 * self.radius_m;
        if excess_m <= 0.0 {
            return;
        }
        let step = (to - from) * (0.5 * excess_m / apart_m);
        self.positions_m[a.0 as usize] += step;
        self.positions_m[b.0 as usize] -= step;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Placements are pinned: a change of the search changes every run that uses one.
    #[test]
    fn golden_placement() {
        let map = Roadmap::builtin("crater-dense").unwrap();
        let network = SensorNetwork::place(&map, 28, 145.0, 1).unwrap();
        let p = network.position_m(NodeId(0));
        assert_eq!((p.x, p.y), (55.309394100004056, 212.5978179787905));
        let owned: Vec<usize> = network.nodes().map(|n| network.owned(n).len()).collect();
        assert_eq!(
            owned,
            [
                7, 9, 6, 10, 7, 10, 6, 12, 5, 10, 12, 5, 7, 20, 5, 12, 3, 2, 4, 17, 6, 10, 6, 5, 2,
                9, 9, 12
            ]
        );
    }

    #[test]
    fn what_cannot_be_placed_is_an_error_with_advice() {
        let map = Roadmap::builtin("crater-sparse").unwrap();
        let small = SensorNetwork::place(&map, 14, 20.0, 1)
            .unwrap_err()
            .to_string();
        assert!(small.contains("a radius of 201 m usually does"), "{small}");
        assert!(small.contains("no node covers"), "{small}");
        let many = SensorNetwork::place(&map, 178, 1000.0, 1)
            .unwrap_err()
            .to_string();
        assert!(many.contains("fewer nodes"), "{many}");
        let none = SensorNetwork::place(&map, 0, 100.0, 1).unwrap_err();
        assert_eq!(
            none,
            SensorError::NodeCount {
                vertices: 178,
                actual: 0
            }
        );
    }
}
