//! The heights of a crater: bowl, rim and apron, a lobed outline, smaller craters and roughness.

use farside::random::RandomKey;
use nalgebra::Point2;

use super::CraterSettings;
use crate::error::TerrainError;
use crate::terrain::{HeightField, MAX_SAMPLES, Noise};

/// Waves of the outline round the rim, as (times round, share of the radius).
const OUTLINE: [(f64, f64); 4] = [(2.0, 0.025), (3.0, 0.02), (5.0, 0.012), (9.0, 0.006)];

/// Octaves of roughness, as (length \[m\], amplitude \[m\]).
const ROUGHNESS: [(f64, f64); 4] = [(90.0, 2.6), (40.0, 1.4), (18.0, 0.6), (8.0, 0.22)];

/// How many smaller craters there are.
const SMALL_CRATERS: usize = 34;

/// How steeply the bowl rises: the power of the distance from the middle.
const BOWL_POWER: f64 = 2.3;

/// A smaller crater.
struct Pit {
    centre_m: Point2<f64>,
    radius_m: f64,
}

pub(super) fn height_field(
    settings: &CraterSettings,
    key: RandomKey,
) -> Result<HeightField, TerrainError> {
    let half = settings.half_side_m;
    let columns = libm::ceil(2.0 * half / settings.resolution_m) as usize + 1;
    if columns * columns > MAX_SAMPLES {
        return Err(TerrainError::TooManySamples {
            limit: MAX_SAMPLES,
            actual: columns * columns,
        });
    }
    let phases = OUTLINE.map(|(times, _)| {
        2.0 * std::f64::consts::PI * key.text("outline").number(times as u64).uniform()
    });
    let pits = pits(settings, key);
    let octaves: Vec<Noise> = ROUGHNESS
        .iter()
        .map(|&(length_m, amplitude_m)| {
            let key = key.text("roughness").number(length_m as u64);
            Noise::new(half, length_m, amplitude_m, &mut key.stream())
        })
        .collect();
    let mut heights_m = Vec::with_capacity(columns * columns);
    for row in 0..columns {
        for column in 0..columns {
            let x_m = -half + column as f64 * settings.resolution_m;
            let y_m = -half + row as f64 * settings.resolution_m;
            let rough_m: f64 = octaves.iter().map(|noise| noise.at(x_m, y_m)).sum();
            let pits_m: f64 = pits.iter().map(|pit| pit.height_m(x_m, y_m)).sum();
            heights_m.push(bowl_m(settings, &phases, x_m, y_m) + rough_m + pits_m);
        }
    }
    HeightField::new(
        Point2::new(-half, -half),
        settings.resolution_m,
        columns,
        heights_m,
    )
}

/// The large crater: a bowl up to its crest, an apron beyond that falls with the cube of the
/// distance.
fn bowl_m(settings: &CraterSettings, phases: &[f64], x_m: f64, y_m: f64) -> f64 {
    let angle = libm::atan2(y_m, x_m);
    let waves = OUTLINE.iter().zip(phases);
    let lobes: f64 = waves
        .map(|((times, share), phase)| share * libm::sin(times * angle + phase))
        .sum();
    let distance = libm::hypot(x_m, y_m) / (settings.rim_radius_m * (1.0 + lobes));
    let relief_m = settings.depth_m + settings.rim_height_m;
    let bowl_m = -settings.depth_m + relief_m * libm::pow(distance, BOWL_POWER);
    let apron_m = settings.rim_height_m / (distance * distance * distance).max(1.0e-3);
    // The two meet at the crest; a smooth minimum rounds it off.
    let (low_m, high_m) = (bowl_m.min(apron_m), bowl_m.max(apron_m));
    let softness_m = 1.5;
    low_m - softness_m * libm::log1p(libm::exp((low_m - high_m) / softness_m))
}

fn pits(settings: &CraterSettings, key: RandomKey) -> Vec<Pit> {
    let mut stream = key.text("pits").stream();
    let scale = settings.rim_radius_m / 200.0;
    (0..SMALL_CRATERS)
        .map(|_| {
            let half = settings.half_side_m;
            let x_m = stream.uniform_in(-half, half);
            let y_m = stream.uniform_in(-half, half);
            // Many small, few large: a power law between 6 and 24 m.
            let radius_m = scale * 6.0 / libm::sqrt(1.0 - 0.9375 * stream.uniform());
            Pit {
                centre_m: Point2::new(x_m, y_m),
                radius_m,
            }
        })
        .collect()
}

impl Pit {
    /// A bowl with a depth of a fifth of the diameter, and a low rim that fades out.
    fn height_m(&self, x_m: f64, y_m: f64) -> f64 {
        let distance = libm::hypot(x_m - self.centre_m.x, y_m - self.centre_m.y) / self.radius_m;
        let (depth_m, rim_m) = (0.36 * self.radius_m, 0.06 * self.radius_m);
        if distance < 1.0 {
            rim_m - (depth_m + rim_m) * (1.0 - distance * distance)
        } else {
            let fade = (2.0 - distance).max(0.0);
            rim_m * fade * fade
        }
    }
}
