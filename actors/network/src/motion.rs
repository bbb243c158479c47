//! How long an edge takes. In cycles: always `network.traverse`. In continuous motion: as long as
//! its length needs, with a highest speed and a highest acceleration, which is also the
//! deceleration.
//!
//! A rover stops at each vertex, unless it holds the grant for the vertex after as it sets out:
//! then it **rolls** through, as fast as it may. Three things bound its speed there: what it can
//! reach on the edge before; what it can brake from on the edge after, at whose end it may have to
//! stand; and the turn: of its velocity only the part along the next edge stays, and of a right
//! angle nothing.
//!
//! Plans reckon with a stop at each vertex. Order drives execution, so a rover that is ahead of its
//! plan does no harm.

mod alone;

use farside::SimDuration;
use farside_worlds::{Roadmap, VertexId};
use nalgebra::{Point3, Vector3};

use super::config::{Motion, NetworkConfig};

/// How fast a rover may be, and become.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Limits {
    /// \[m/s\], above 0.
    pub(super) speed: f64,
    /// Either way \[m/s2\], above 0.
    pub(super) acceleration: f64,
}

/// A way to drive along an edge: up to a peak speed, on with it, down to the end speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Profile {
    length_m: f64,
    /// Speeds at the start, between, and at the end \[m/s\].
    start: f64,
    peak: f64,
    end: f64,
    acceleration: f64,
}

impl Limits {
    /// The fastest way along an edge, with these speeds at its ends. `start` and `end` have to be
    /// such that the length is enough to get from one to the other: see [`Limits::reachable`].
    pub(super) fn profile(&self, length_m: f64, start: f64, end: f64) -> Profile {
        let a = self.acceleration;
        // Speeding up and braking without anything between meet at this speed.
        let top = libm::sqrt(a * length_m + 0.5 * (start * start + end * end));
        Profile {
            length_m,
            start,
            peak: top.min(self.speed).max(start).max(end),
            end,
            acceleration: a,
        }
    }

    /// The highest speed at the end of an edge that begins with `start`.
    pub(super) fn reachable(&self, length_m: f64, start: f64) -> f64 {
        let speed = libm::sqrt(start * start + 2.0 * self.acceleration * length_m);
        speed.min(self.speed)
    }
}

impl Profile {
    /// How long all of it takes \[s\].
    pub(super) fn duration_s(&self) -> f64 {
        self.time_at_s(self.length_m)
    }

    /// When a rover has come so far, from setting out \[s\]; past the end, when it is there.
    pub(super) fn time_at_s(&self, distance_m: f64) -> f64 {
        let (a, peak) = (self.acceleration, self.peak);
        let distance_m = distance_m.clamp(0.0, self.length_m);
        let up_m = (peak * peak - self.start * self.start) / (2.0 * a);
        let down_m = (peak * peak - self.end * self.end) / (2.0 * a);
        let cruise_m = (self.length_m - up_m - down_m).max(0.0);
        if distance_m <= up_m {
            let speed = libm::sqrt(self.start * self.start + 2.0 * a * distance_m);
            return (speed - self.start) / a;
        }
        let up_s = (peak - self.start) / a;
        if distance_m <= up_m + cruise_m {
            return up_s + (distance_m - up_m) / peak;
        }
        let braked_m = (distance_m - up_m - cruise_m).min(down_m);
        let speed = libm::sqrt((peak * peak - 2.0 * a * braked_m).max(self.end * self.end));
        up_s + cruise_m / peak + (peak - speed) / a
    }
}

/// A rover's way along one edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Drive {
    /// How long it takes.
    pub(super) time: SimDuration,
    /// How fast the rover is at its end \[m/s\].
    pub(super) end: f64,
    length_m: f64,
    profile: Option<Profile>,
}

impl Drive {
    /// When the rover has come so far from the vertex it left; none if the edge is not that long.
    pub(super) fn passes(&self, distance_m: f64) -> Option<SimDuration> {
        if distance_m >= self.length_m {
            return None;
        }
        let share = distance_m.max(0.0) / self.length_m;
        let at = match &self.profile {
            Some(profile) => duration(profile.time_at_s(distance_m)),
            None => SimDuration::from_nanos((share * self.time.as_nanos() as f64) as u64),
        };
        Some(at.min(self.time))
    }
}

/// Rounded up, so that nothing is earlier than it can be.
fn duration(seconds: f64) -> SimDuration {
    SimDuration::from_nanos((libm::ceil(seconds * 1e9) as u64).max(1))
}

/// Edges and how they are driven along.
pub(super) struct EdgeTimes<'a> {
    pub(super) roadmap: &'a Roadmap,
    pub(super) config: &'a NetworkConfig,
}

impl EdgeTimes<'_> {
    fn limits(&self) -> Limits {
        Limits {
            speed: self.config.speed,
            acceleration: self.config.acceleration_limit,
        }
    }

    /// From `u` straight to `v`, on the ground \[m\].
    fn way_m(&self, u: VertexId, v: VertexId) -> Vector3<f64> {
        let place = |v| {
            let at = self.roadmap.position_m(v);
            Point3::new(at.x, at.y, self.roadmap.height_m(v))
        };
        place(v) - place(u)
    }

    /// How long an edge is \[m\].
    pub(super) fn length_m(&self, u: VertexId, v: VertexId) -> f64 {
        self.way_m(u, v).norm()
    }

    /// Along the edge from `here` to `next`, setting out with `start` \[m/s\]; `beyond` is the
    /// vertex after, if the rover may roll on to it.
    pub(super) fn drive(
        &self,
        (here, next): (VertexId, VertexId),
        beyond: Option<VertexId>,
        start: f64,
    ) -> Drive {
        let length_m = self.length_m(here, next);
        if self.config.motion == Motion::Cycles {
            return Drive {
                time: self.config.traverse,
                end: 0.0,
                length_m,
                profile: None,
            };
        }
        let limits = self.limits();
        let end = beyond.map_or(0.0, |beyond| {
            let (before, after) = (self.way_m(here, next), self.way_m(next, beyond));
            let turn = before.dot(&after) / (before.norm() * after.norm());
            let brakes_from = limits.reachable(after.norm(), 0.0);
            // Where it has to slow down to that, the edge is long enough: it was bounded by
            // what the rover can brake from when it began.
            let reaches = limits.reachable(length_m, start);
            (limits.speed * turn.max(0.0)).min(brakes_from).min(reaches)
        });
        let profile = limits.profile(length_m, start, end);
        Drive {
            time: duration(profile.duration_s()),
            end,
            length_m,
            profile: Some(profile),
        }
    }

    /// How long the edge takes from rest to rest, and a fix of the position: what plans reckon
    /// with.
    pub(super) fn planned(&self, u: VertexId, v: VertexId) -> SimDuration {
        let time = self.drive((u, v), None, 0.0).time;
        match self.config.location_sigma_m > 0.0 {
            true => time + self.config.location_fix,
            false => time,
        }
    }

    /// The edge that takes longest, and how long.
    pub(super) fn longest(&self) -> Option<((VertexId, VertexId), SimDuration)> {
        let edges = self.roadmap.edges().iter();
        let timed = edges.map(|&(u, v)| ((u, v), self.planned(u, v)));
        timed.max_by_key(|(_, time)| *time)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{grid, v};
    use proptest::prelude::*;

    /// The time for each distance, by small steps of time: accelerate as long as the end speed can
    /// still be had, then brake.
    fn integrate(limits: &Limits, length_m: f64, start: f64, end: f64, to_m: f64) -> f64 {
        const STEP: f64 = 1e-4;
        let (mut at, mut speed, mut time) = (0.0, start, 0.0);
        while at < to_m && time < 1e3 {
            let faster = (speed + limits.acceleration * STEP).min(limits.speed);
            let need = (faster * faster - end * end) / (2.0 * limits.acceleration);
            let left = length_m - at - 0.5 * (speed + faster) * STEP;
            let next = if need <= left {
                faster
            } else {
                // The braking that just does it, which is at the limit but for rounding.
                (speed - limits.acceleration * STEP).max(end).max(1e-3)
            };
            at += 0.5 * (speed + next) * STEP;
            speed = next;
            time += STEP;
        }
        time
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

        /// The closed form is what integration says, at each distance and each pair of speeds.
        #[test]
        fn times_are_those_of_integration(
            speed in 0.5f64..6.0,
            acceleration in 0.2f64..3.0,
            length_m in 1.0f64..40.0,
            start in 0.0f64..1.0,
            end in 0.0f64..1.0,
            share in 0.05f64..1.0,
        ) {
            let limits = Limits { speed, acceleration };
            // Any start from which the rover can stop, and any end that it can reach and brake to.
            let start = start * limits.reachable(length_m, 0.0);
            let lowest = libm::sqrt((start * start - 2.0 * acceleration * length_m).max(0.0));
            let end = lowest + end * (limits.reachable(length_m, start) - lowest);
            let profile = limits.profile(length_m, start, end);
            let expected = integrate(&limits, length_m, start, end, share * length_m);
            let actual = profile.time_at_s(share * length_m);
            // Close to a deadlock at the end a millimetre takes long.
            prop_assert!((actual - expected).abs() < 0.03, "{} and {}", actual, expected);
        }

        /// The further, the later; and never faster than the limit.
        #[test]
        fn nothing_is_faster_than_allowed(
            speed in 0.5f64..6.0,
            acceleration in 0.2f64..3.0,
            length_m in 1.0f64..40.0,
            start in 0.0f64..1.0,
        ) {
            let limits = Limits { speed, acceleration };
            let start = start * limits.reachable(length_m, 0.0);
            let profile = limits.profile(length_m, start, 0.0);
            let step_m = length_m / 100.0;
            for i in 0..100 {
                let at = |i: u32| profile.time_at_s(f64::from(i) * step_m);
                prop_assert!(at(i + 1) - at(i) >= step_m / speed * (1.0 - 1e-9));
            }
        }
    }

    fn config() -> NetworkConfig {
        NetworkConfig {
            motion: Motion::Continuous,
            speed: 2.0,
            acceleration_limit: 1.0,
            ..NetworkConfig::default()
        }
    }

    #[test]
    fn rest_to_rest_is_a_trapezium_or_a_triangle() {
        let limits = Limits {
            speed: 2.0,
            acceleration: 1.0,
        };
        // 2 s up over 2 m, 3 s at 2 m/s, 2 s down.
        assert_eq!(limits.profile(10.0, 0.0, 0.0).duration_s(), 7.0);
        // Too short for full speed: 1 s up, 1 s down over half a metre each.
        assert_eq!(limits.profile(1.0, 0.0, 0.0).duration_s(), 2.0);
    }

    #[test]
    fn a_rover_rolls_straight_on_and_stops_for_a_corner() {
        let (roadmap, config) = (grid(4, 2, &[]), config());
        let ways = EdgeTimes {
            roadmap: &roadmap,
            config: &config,
        };
        let stops = ways.drive((v(0), v(1)), None, 0.0);
        let rolls = ways.drive((v(0), v(1)), Some(v(2)), 0.0);
        let turns = ways.drive((v(0), v(1)), Some(v(5)), 0.0);
        let back = ways.drive((v(0), v(1)), Some(v(0)), 0.0);
        assert_eq!(stops, turns);
        assert_eq!(stops, back);
        assert_eq!((stops.time, stops.end), (SimDuration::from_secs(7), 0.0));
        // 2 s up over 2 m, 8 m at 2 m/s.
        assert_eq!((rolls.time, rolls.end), (SimDuration::from_secs(6), 2.0));
        let on = ways.drive((v(1), v(2)), Some(v(3)), rolls.end);
        assert_eq!((on.time, on.end), (SimDuration::from_secs(5), 2.0));
        assert_eq!(on.passes(4.0), Some(SimDuration::from_secs(2)));
        assert_eq!(on.passes(10.0), None);
    }

    #[test]
    fn in_cycles_every_edge_takes_the_same() {
        let roadmap = grid(3, 1, &[]);
        let config = NetworkConfig::default();
        let ways = EdgeTimes {
            roadmap: &roadmap,
            config: &config,
        };
        let drive = ways.drive((v(0), v(1)), Some(v(2)), 0.0);
        assert_eq!((drive.time, drive.end), (config.traverse, 0.0));
        assert_eq!(drive.passes(5.0), Some(SimDuration::from_millis(100)));
    }
}
