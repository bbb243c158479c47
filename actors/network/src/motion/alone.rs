//! How long a way takes a rover that is alone: the least there is.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use farside::SimDuration;
use farside_worlds::VertexId;

use super::EdgeTimes;

/// A rover that is about to drive along the edge from `here` to `next`.
struct Start {
    here: VertexId,
    next: VertexId,
    /// [m/s].
    speed: f64,
}

impl EdgeTimes<'_> {
    /// The least time from standing at `from` to standing at `to`: on the fastest way, rolling
    /// through each vertex where the rover may. One that is not certain where it is never rolls.
    ///
    /// Of two rovers that set out along the same edge the one that is not later and not slower has
    /// no more time before it. So of those that are neither, all are followed.
    pub(crate) fn alone(&self, from: VertexId, to: VertexId) -> SimDuration {
        if from == to {
            return SimDuration::ZERO;
        }
        let mut starts = Vec::new();
        let mut open = BinaryHeap::new();
        let mut seen = BTreeMap::<(VertexId, VertexId), Vec<f64>>::new();
        for &next in self.roadmap.neighbors(from) {
            open.push(Reverse((SimDuration::ZERO, None, starts.len())));
            starts.push(Start {
                here: from,
                next,
                speed: 0.0,
            });
        }
        while let Some(Reverse((time, there, at))) = open.pop() {
            if there == Some(to) {
                return time;
            }
            let Start { here, next, speed } = starts[at];
            // Those before it were no later.
            let faster = seen.entry((here, next)).or_default();
            if faster.iter().any(|&other| other >= speed) {
                continue;
            }
            faster.push(speed);
            if next == to {
                let takes = self.step((here, next), None, speed).0;
                open.push(Reverse((time + takes, Some(to), at)));
            }
            for &beyond in self.roadmap.neighbors(next) {
                let (takes, end) = self.step((here, next), Some(beyond), speed);
                open.push(Reverse((time + takes, None, starts.len())));
                starts.push(Start {
                    here: next,
                    next: beyond,
                    speed: end,
                });
            }
        }
        unreachable!("a roadmap is connected")
    }

    /// How long an edge takes, and how fast the rover is at its end [m/s].
    fn step(
        &self,
        edge: (VertexId, VertexId),
        beyond: Option<VertexId>,
        speed: f64,
    ) -> (SimDuration, f64) {
        if self.config.location_sigma_m > 0.0 {
            return (self.planned(edge.0, edge.1), 0.0);
        }
        let drive = self.drive(edge, beyond, speed);
        (drive.time, drive.end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{Motion, NetworkConfig};
    use crate::testing::{grid, v};
    use farside_worlds::Roadmap;
    use nalgebra::Vector2;
    use proptest::prelude::*;

    fn config() -> NetworkConfig {
        NetworkConfig {
            motion: Motion::Continuous,
            speed: 2.0,
            acceleration_limit: 1.0,
            ..NetworkConfig::default()
        }
    }

    #[test]
    fn straight_on_it_stops_only_at_the_end() {
        // 0 1 2 3 4 5 6 7, 10 m apart.
        let roadmap = grid(4, 2, &[]);
        let time = |config: &NetworkConfig, from, to| {
            let roadmap = &roadmap;
            EdgeTimes { roadmap, config }
                .alone(v(from), v(to))
                .as_nanos()
        };
        let config = config();
        // Up to 2 m/s and down again takes 2 s over 2 m each: 2 + 26 / 2 + 2.
        assert_eq!(time(&config, 0, 3), 17_000_000_000);
        // One corner at which it stands: twice the same over 10 m and over 30 m, in either order.
        assert_eq!(time(&config, 0, 7), 7_000_000_000 + 17_000_000_000);
        assert_eq!(time(&config, 2, 2), 0);
        // It stops for a fix at each vertex.
        let lost = NetworkConfig {
            location_sigma_m: 0.5,
            location_fix: SimDuration::from_secs(3),
            ..config
        };
        assert_eq!(time(&lost, 0, 2), 2 * (7_000_000_000 + 3_000_000_000));
    }

    /// Tries every simple way, driven as a rover drives that always holds the next grant.
    fn walk(ways: &EdgeTimes<'_>, path: &mut Vec<VertexId>, to: VertexId, best: &mut SimDuration) {
        let here = path[path.len() - 1];
        if here == to {
            let (mut speed, mut time) = (0.0, SimDuration::ZERO);
            for at in 1..path.len() {
                let edge = (path[at - 1], path[at]);
                let drive = ways.drive(edge, path.get(at + 1).copied(), speed);
                (speed, time) = (drive.end, time + drive.time);
            }
            *best = time.min(*best);
            return;
        }
        for &next in ways.roadmap.neighbors(here) {
            if !path.contains(&next) {
                path.push(next);
                walk(ways, path, to, best);
                path.pop();
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

        /// On grids that were shaken, so that ways turn by all angles: the way that comes to an
        /// edge first need not be the one that comes to its end first.
        #[test]
        fn no_way_is_faster(shifts_m in prop::collection::vec((-4.0..4.0f64, -4.0..4.0f64), 9)) {
            let even = grid(3, 3, &[]);
            let place = |(v, (x, y)): (VertexId, &(f64, f64))| even.position_m(v) + Vector2::new(*x, *y);
            let places = even.vertices().zip(&shifts_m).map(place).collect();
            let edges = even.edges().to_vec();
            let roadmap = Roadmap::new("shaken", places, edges, even.boundary().to_vec()).unwrap();
            let config = config();
            let ways = EdgeTimes { roadmap: &roadmap, config: &config };
            for from in roadmap.vertices() {
                for to in roadmap.vertices().filter(|to| *to != from) {
                    let mut best = SimDuration::from_secs(1_000_000);
                    walk(&ways, &mut vec![from], to, &mut best);
                    prop_assert_eq!(ways.alone(from, to), best, "{:?} to {:?}", from, to);
                }
            }
        }
    }
}
