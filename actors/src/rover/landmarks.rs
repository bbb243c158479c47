//! How an image places a rover: among rocks that it knows, by the one shift and rotation that brings
//! what it sees nearest to what it remembers.

use std::collections::BTreeMap;

use farside_worlds::RockField;
use nalgebra::Point2;

use super::body::Pose;

/// The fewest known rocks that place a rover.
const LEAST_ROCKS: usize = 3;

/// The smallest standard deviation of a place that is believed \[m\].
const LEAST_SIGMA_M: f64 = 0.02;

/// A rock in an image, relative to the rover.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sighting {
    pub(super) rock: u32,
    /// As measured \[m\].
    pub(super) ahead_m: f64,
    pub(super) left_m: f64,
    /// The standard deviation of each of them \[m\].
    pub(super) sigma_m: f64,
}

/// A rock that a rover knows the place of.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Landmark {
    place_m: Point2<f64>,
    sigma_m: f64,
}

/// The rocks that a rover knows, by number.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Landmarks(BTreeMap<u32, Landmark>);

impl Landmarks {
    /// Those that are known from orbit: of this diameter or more.
    pub(super) fn from_orbit(field: &RockField, least_m: f64) -> Landmarks {
        let rocks = (0..).zip(field.rocks());
        let seen = rocks.filter(|(_, rock)| rock.diameter_m >= least_m);
        let landmark = |(number, rock): (u32, &farside_worlds::FieldRock)| {
            let (place_m, sigma_m) = (rock.position_m, LEAST_SIGMA_M);
            (number, Landmark { place_m, sigma_m })
        };
        Landmarks(seen.map(landmark).collect())
    }

    /// Where a rover is that sees these, and the standard deviation of its place \[m\]; none if too
    /// few are known. The fit weighs each by how well it is known and seen, and has a closed form.
    ///
    /// Rocks that were remembered from one place are all wrong by the same: no number of them makes
    /// the place more certain than it was then.
    pub(super) fn place(&self, sightings: &[Sighting]) -> Option<(Pose, f64)> {
        let known = || {
            let landmark = |seen: &Sighting| Some((*seen, *self.0.get(&seen.rock)?));
            sightings.iter().filter_map(landmark)
        };
        if known().count() < LEAST_ROCKS {
            return None;
        }
        let weight = |seen: &Sighting, landmark: &Landmark| {
            1.0 / (seen.sigma_m * seen.sigma_m + landmark.sigma_m * landmark.sigma_m)
        };
        let (mut sum, mut seen_m, mut known_m) = (0.0, [0.0; 2], [0.0; 2]);
        let (mut sharpness, mut landmark_m) = (0.0, 0.0);
        for (seen, landmark) in known() {
            let weight = weight(&seen, &landmark);
            sum += weight;
            sharpness += 1.0 / (seen.sigma_m * seen.sigma_m);
            landmark_m += weight * landmark.sigma_m;
            add(&mut seen_m, weight, [seen.ahead_m, seen.left_m]);
            add(&mut known_m, weight, landmark.place_m.coords.into());
        }
        let (seen_m, known_m) = (seen_m.map(|s| s / sum), known_m.map(|s| s / sum));
        let (mut dot, mut cross) = (0.0, 0.0);
        for (seen, landmark) in known() {
            let weight = weight(&seen, &landmark);
            let [ahead_m, left_m] = [seen.ahead_m - seen_m[0], seen.left_m - seen_m[1]];
            let east_m = landmark.place_m.x - known_m[0];
            let north_m = landmark.place_m.y - known_m[1];
            dot += weight * (ahead_m * east_m + left_m * north_m);
            cross += weight * (ahead_m * north_m - left_m * east_m);
        }
        if dot == 0.0 && cross == 0.0 {
            return None;
        }
        let yaw_rad = libm::atan2(cross, dot);
        let turned = Pose {
            yaw_rad,
            ..Pose::default()
        };
        let middle_m = turned.place_at(seen_m[0], seen_m[1]);
        let pose = Pose {
            east_m: known_m[0] - middle_m.x,
            north_m: known_m[1] - middle_m.y,
            yaw_rad,
        };
        let sigma_m = libm::hypot(libm::sqrt(1.0 / sharpness), landmark_m / sum);
        Some((pose, sigma_m.max(LEAST_SIGMA_M)))
    }

    /// Remembers rocks that were not known, as they are seen from where the rover believes to be.
    pub(super) fn remember(&mut self, sightings: &[Sighting], from: &Pose, sigma_m: f64) {
        for seen in sightings {
            self.0.entry(seen.rock).or_insert_with(|| Landmark {
                place_m: from.place_at(seen.ahead_m, seen.left_m),
                sigma_m: libm::hypot(sigma_m, seen.sigma_m).max(LEAST_SIGMA_M),
            });
        }
    }
}

fn add(sum: &mut [f64; 2], weight: f64, value: [f64; 2]) {
    sum[0] += weight * value[0];
    sum[1] += weight * value[1];
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Seen without error, known rocks give the pose that they are seen from.
        #[test]
        fn a_pose_is_found_again(
            places in prop::collection::vec((-20.0f64..20.0, -20.0f64..20.0), 3..20),
            east_m in -5.0f64..5.0,
            north_m in -5.0f64..5.0,
            yaw_rad in -3.1f64..3.1,
        ) {
            let spread = places.iter().any(|p| (p.0 - places[0].0).abs() > 1.0);
            prop_assume!(spread);
            let pose = Pose { east_m, north_m, yaw_rad };
            let mut landmarks = Landmarks::default();
            let origin = Pose::default();
            let seen_from = |from: &Pose| -> Vec<Sighting> {
                let sighting = |(rock, place): (u32, &(f64, f64))| {
                    let [ahead_m, left_m] = from.to_body(Point2::new(place.0, place.1));
                    Sighting { rock, ahead_m, left_m, sigma_m: 0.1 }
                };
                (0..).zip(&places).map(sighting).collect()
            };
            landmarks.remember(&seen_from(&origin), &origin, 0.0);
            let (found, sigma_m) = landmarks.place(&seen_from(&pose)).unwrap();
            prop_assert!((found.east_m - east_m).abs() < 1e-6);
            prop_assert!((found.north_m - north_m).abs() < 1e-6);
            prop_assert!((found.yaw_rad - yaw_rad).abs() < 1e-6);
            prop_assert!(sigma_m < 0.15);
            prop_assert_eq!(landmarks.place(&seen_from(&pose)[..2]), None);
        }
    }
}
