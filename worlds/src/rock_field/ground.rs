//! The ground of a rock field: gentle waves, hills, and boulders upon it.

use farside::random::RandomKey;
use nalgebra::Point2;

use super::settings::RockFieldSettings;
use crate::error::TerrainError;
use crate::rocks::Rock;
use crate::terrain::{HeightField, MAX_SAMPLES, Noise};

/// Octaves of roughness, as (length \[m\], amplitude \[m\]): slopes of a few degrees.
const ROUGHNESS: [(f64, f64); 2] = [(25.0, 0.40), (8.0, 0.12)];

/// The least and the largest radius of a hill over its height. At 4 its steepest place has 21
/// degrees.
const HILL_RADII: [f64; 2] = [4.0, 7.0];

/// A hill.
struct Hill {
    center_m: Point2<f64>,
    radius_m: f64,
    height_m: f64,
}

/// The ground without its boulders.
pub(super) fn bare(
    settings: &RockFieldSettings,
    key: RandomKey,
) -> Result<HeightField, TerrainError> {
    let half_m = 0.5 * settings.side_m;
    let columns = libm::ceil(settings.side_m / settings.resolution_m) as usize + 1;
    if columns * columns > MAX_SAMPLES {
        return Err(TerrainError::TooManySamples {
            limit: MAX_SAMPLES,
            actual: columns * columns,
        });
    }
    let octaves = ROUGHNESS.map(|(length_m, amplitude_m)| {
        let mut stream = key.text("roughness").number(length_m as u64).stream();
        Noise::new(half_m, length_m, amplitude_m, &mut stream)
    });
    let at_m = |index: usize| -half_m + index as f64 * settings.resolution_m;
    let mut heights_m = Vec::with_capacity(columns * columns);
    for row in 0..columns {
        for column in 0..columns {
            let (x_m, y_m) = (at_m(column), at_m(row));
            heights_m.push(octaves[0].at(x_m, y_m) + octaves[1].at(x_m, y_m));
        }
    }
    for hill in hills(settings, key) {
        let inside = |center_m: f64| {
            let sample = |offset_m: f64| (offset_m + half_m) / settings.resolution_m;
            let first = libm::ceil(sample(center_m - hill.radius_m)).max(0.0) as usize;
            let after = libm::floor(sample(center_m + hill.radius_m) + 1.0).max(0.0) as usize;
            first..after.min(columns)
        };
        for row in inside(hill.center_m.y) {
            for column in inside(hill.center_m.x) {
                heights_m[row * columns + column] += hill.at_m(at_m(column), at_m(row));
            }
        }
    }
    HeightField::new(
        Point2::new(-half_m, -half_m),
        settings.resolution_m,
        columns,
        heights_m,
    )
}

fn hills(settings: &RockFieldSettings, key: RandomKey) -> Vec<Hill> {
    let half_m = 0.5 * settings.side_m;
    let mut stream = key.text("hills").stream();
    let hill = |number: usize| {
        let height_m = match number {
            0 => settings.hill_height_m,
            _ => settings.hill_height_m * stream.uniform_in(0.5, 1.0),
        };
        let radius_m = height_m * stream.uniform_in(HILL_RADII[0], HILL_RADII[1]);
        let least_m = settings.clear_radius_m + radius_m;
        let away_m = stream.uniform_in(least_m, least_m.max(half_m));
        let (sine, cosine) = libm::sincos(stream.uniform_in(0.0, std::f64::consts::TAU));
        Hill {
            center_m: Point2::new(away_m * cosine, away_m * sine),
            radius_m,
            height_m,
        }
    };
    (0..settings.hills).map(hill).collect()
}

impl Hill {
    /// Its height over the ground around it.
    fn at_m(&self, x_m: f64, y_m: f64) -> f64 {
        let (dx_m, dy_m) = (x_m - self.center_m.x, y_m - self.center_m.y);
        let share = (dx_m * dx_m + dy_m * dy_m) / (self.radius_m * self.radius_m);
        // A NaN, of a hill without any height, adds nothing.
        let rest = if share < 1.0 { 1.0 - share } else { 0.0 };
        self.height_m * rest * rest
    }
}

/// The ground with its boulders, half spheres upon it: rocks are about half as high as they are wide
/// (M. Golombek and D. Rapp, 1997). Where no sample lies under a boulder, the nearest one is raised.
pub(super) fn with_boulders(
    bare: &HeightField,
    rocks: &[Rock],
    least_m: f64,
) -> Result<HeightField, TerrainError> {
    let (columns, rows, step_m) = (bare.columns(), bare.rows(), bare.resolution_m());
    let mut heights_m = bare.heights_m().to_vec();
    for rock in rocks.iter().filter(|rock| rock.diameter_m >= least_m) {
        let radius_m = 0.5 * rock.diameter_m;
        let offset = (rock.position_m - bare.origin_m()) / step_m;
        let reach = radius_m / step_m;
        let base_m = bare.height_m(rock.position_m.x, rock.position_m.y);
        let range = |center: f64, count: usize| {
            let first = libm::ceil(center - reach).max(0.0) as usize;
            first..(libm::floor(center + reach).max(-1.0) + 1.0).min(count as f64) as usize
        };
        let mut raise = |column: usize, row: usize, height_m: f64| {
            let sample = &mut heights_m[row * columns + column];
            *sample = sample.max(base_m + height_m);
        };
        for row in range(offset.y, rows) {
            for column in range(offset.x, columns) {
                let away = (bare.sample_position_m(column, row) - rock.position_m).norm_squared();
                if away < radius_m * radius_m {
                    raise(column, row, libm::sqrt(radius_m * radius_m - away));
                }
            }
        }
        let nearest =
            |center: f64, count: usize| libm::round(center).clamp(0.0, (count - 1) as f64) as usize;
        raise(
            nearest(offset.x, columns),
            nearest(offset.y, rows),
            0.5 * radius_m,
        );
    }
    HeightField::new(bare.origin_m(), step_m, columns, heights_m)
}
