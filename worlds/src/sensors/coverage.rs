//! How far nodes reach rovers, and the vertices where nobody does (*network-guided*, section 5,
//! asks what to do "if there are gaps in the coverage of the workspace").

use super::SensorNetwork;
use crate::error::SensorError;
use crate::ids::VertexId;
use crate::roadmap::Roadmap;

impl SensorNetwork {
    /// The same network with nodes that reach rovers as far as `coverage_m` \[m\], and each other
    /// as far as before. Vertices farther than that from their owners are its gaps.
    ///
    /// ```
    /// use farside_worlds::{Roadmap, SensorNetwork, VertexId};
    /// use nalgebra::Point2;
    /// let places = [0.0, 10.0, 20.0].map(|x| Point2::new(x, 0.0)).to_vec();
    /// let edges = vec![(VertexId(0), VertexId(1)), (VertexId(1), VertexId(2))];
    /// let map = Roadmap::new("line", places, edges, vec![VertexId(0), VertexId(2)])?;
    /// let nodes = [2.0, 18.0].map(|x| Point2::new(x, 0.0)).to_vec();
    /// let network = SensorNetwork::new(&map, nodes, 20.0)?;
    /// assert!(network.gaps().is_empty());
    /// let network = network.with_coverage(&map, 5.0)?;
    /// assert_eq!(network.gaps(), [VertexId(1)]);
    /// assert!(network.covers(VertexId(2)) && !network.covers(VertexId(1)));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// When `coverage_m` is not a positive finite number.
    pub fn with_coverage(
        mut self,
        roadmap: &Roadmap,
        coverage_m: f64,
    ) -> Result<SensorNetwork, SensorError> {
        check_coverage(coverage_m)?;
        self.gaps = self.beyond(roadmap, coverage_m);
        self.coverage_m = coverage_m;
        Ok(self)
    }

    /// The vertices farther than `reach_m` from their owners, sorted.
    pub(super) fn beyond(&self, roadmap: &Roadmap, reach_m: f64) -> Vec<VertexId> {
        let far = |&v: &VertexId| {
            let way = self.position_m(self.owner(v)) - roadmap.position_m(v);
            way.norm_squared() > reach_m * reach_m
        };
        roadmap.vertices().filter(far).collect()
    }

    /// How far a node reaches rovers \[m\].
    pub fn coverage_m(&self) -> f64 {
        self.coverage_m
    }

    /// The vertices at which no node reaches a rover, sorted.
    pub fn gaps(&self) -> &[VertexId] {
        &self.gaps
    }

    /// Whether the vertex's owner reaches rovers there.
    pub fn covers(&self, v: VertexId) -> bool {
        self.gaps.binary_search(&v).is_err()
    }
}

pub(super) fn check_coverage(coverage_m: f64) -> Result<(), SensorError> {
    if coverage_m > 0.0 && coverage_m.is_finite() {
        return Ok(());
    }
    Err(SensorError::Coverage {
        actual_m: coverage_m,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::NodeId;

    #[test]
    fn who_reaches_less_far_has_gaps_or_stands_closer() {
        let map = Roadmap::builtin("crater-dense").unwrap();
        let radius_m = SensorNetwork::default_radius_m(&map, 28);
        let plain = SensorNetwork::place(&map, 28, radius_m, 3).unwrap();
        assert!(plain.gaps().is_empty());
        let reach_m = |v| (plain.position_m(plain.owner(v)) - map.position_m(v)).norm();
        let farthest_m = map.vertices().map(reach_m).fold(0.0, f64::max);
        let coverage_m = 0.9 * farthest_m;
        let short = plain.clone().with_coverage(&map, coverage_m).unwrap();
        let expected: Vec<VertexId> = map
            .vertices()
            .filter(|&v| reach_m(v) > coverage_m)
            .collect();
        assert!(!expected.is_empty());
        assert_eq!(short.gaps(), expected);
        assert_eq!(short.position_m(NodeId(0)), plain.position_m(NodeId(0)));
        let moved = SensorNetwork::place_covering(&map, 28, radius_m, coverage_m, 3).unwrap();
        assert!(moved.gaps().is_empty() && moved.coverage_m() == coverage_m);
        let error = plain.with_coverage(&map, f64::NAN).unwrap_err();
        assert!(matches!(error, SensorError::Coverage { .. }));
        let error = SensorNetwork::place_covering(&map, 28, radius_m, 3.0, 3).unwrap_err();
        let text = error.to_string();
        assert!(text.contains("a coverage nearer to the radius"), "{text}");
    }
}
