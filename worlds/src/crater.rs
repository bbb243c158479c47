//! The crater of the network-guided paper: generated terrain with a rim, slopes, smaller craters,
//! rocks, and the map of where a rover must not go.
//!
//! The paper shows "the same crater-like environment" for both its roadmaps and does not publish
//! it; the shape here is our own. Roadmaps over it are made by [`crate::generate`].

use farside::random::RandomKey;
use nalgebra::Point2;

use crate::error::TerrainError;
use crate::rocks::{Rock, RockAbundance};
use crate::terrain::HeightField;

mod relief;

/// What a crater is made from. The defaults are those of the built-in roadmaps.
#[derive(Clone, Debug, PartialEq)]
pub struct CraterSettings {
    /// The seed of all draws.
    pub seed: u64,
    /// The mean radius of the rim's crest \[m\]; over 0, at most 2000.
    pub rim_radius_m: f64,
    /// The floor's depth below the plain \[m\]; over 0, at most the rim's radius.
    pub depth_m: f64,
    /// The crest's height over the plain \[m\]; over 0, at most the rim's radius.
    pub rim_height_m: f64,
    /// Half the side of the square of terrain, which has the crater in its middle \[m\]; over the
    /// rim's radius, at most 4000.
    pub half_side_m: f64,
    /// The distance between height samples \[m\]; over 0.1, at most half the rim's radius.
    pub resolution_m: f64,
    /// The share of the ground covered by rocks (Golombek and Rapp's k); over 0, at most 1.
    pub rock_abundance: f64,
    /// The diameter of the smallest rocks drawn \[m\].
    pub rock_least_m: f64,
    /// The diameter from which a rock is a boulder, which a rover must go round \[m\].
    pub boulder_least_m: f64,
    /// The slope from which ground is too steep \[rad\].
    pub slope_limit_rad: f64,
}

impl Default for CraterSettings {
    /// An old, shallow crater 400 m across with slopes that a rover can mostly drive. The rovers of
    /// the Mars Exploration mission stopped at a tilt of 30 degrees; 20 leave a margin for rocks
    /// under a wheel. Rocks are as frequent as at a fairly rocky site (8 %).
    fn default() -> Self {
        CraterSettings {
            seed: 2010,
            rim_radius_m: 200.0,
            depth_m: 25.0,
            rim_height_m: 5.0,
            half_side_m: 256.0,
            resolution_m: 2.0,
            rock_abundance: 0.08,
            rock_least_m: 0.5,
            boulder_least_m: 1.0,
            slope_limit_rad: 20.0 * std::f64::consts::PI / 180.0,
        }
    }
}

/// Whether a rover may be at a place, and if not, why.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Hazard {
    /// It may.
    None,
    /// The ground is too steep.
    Steep,
    /// A boulder lies there.
    Boulder,
}

/// A generated crater: its terrain, its rocks and its hazards.
///
/// ```
/// use farside_worlds::{Crater, CraterSettings, Hazard};
/// let crater = Crater::generate(&CraterSettings::default())?;
/// let terrain = crater.terrain();
/// assert!(terrain.height_m(0.0, 0.0) < -15.0); // the floor
/// let boulder = crater.rocks().iter().find(|rock| rock.diameter_m > 1.0).unwrap();
/// assert_ne!(crater.hazard(boulder.position_m.x, boulder.position_m.y), Hazard::None);
/// # Ok::<(), farside_worlds::TerrainError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Crater {
    settings: CraterSettings,
    terrain: HeightField,
    rocks: Vec<Rock>,
    /// One for each height sample, for the square of one resolution around it.
    hazards: Vec<Hazard>,
}

impl Crater {
    /// The crater of these settings: the same for the same settings, on every machine.
    ///
    /// # Errors
    /// When a setting is out of its range, or the terrain would have too many samples or rocks.
    pub fn generate(settings: &CraterSettings) -> Result<Crater, TerrainError> {
        check(settings)?;
        let key = RandomKey::new(settings.seed).text("crater");
        let terrain = relief::height_field(settings, key)?;
        let half = settings.half_side_m;
        let (low_m, high_m) = (Point2::new(-half, -half), Point2::new(half, half));
        let mut stream = key.text("rocks").stream();
        let abundance = RockAbundance::new(settings.rock_abundance)?;
        let rocks = abundance.draw(low_m, high_m, settings.rock_least_m, &mut stream)?;
        let hazards = hazards(settings, &terrain, &rocks);
        Ok(Crater {
            settings: settings.clone(),
            terrain,
            rocks,
            hazards,
        })
    }

    /// What it was made from.
    pub fn settings(&self) -> &CraterSettings {
        &self.settings
    }

    /// The ground; its origin of coordinates is the crater's middle.
    pub fn terrain(&self) -> &HeightField {
        &self.terrain
    }

    /// The rocks, boulders and smaller ones, in no particular order.
    pub fn rocks(&self) -> &[Rock] {
        &self.rocks
    }

    /// What is wrong with the place at (x, y) \[m\], judged by the nearest sample.
    pub fn hazard(&self, x_m: f64, y_m: f64) -> Hazard {
        self.hazards[nearest_sample(&self.terrain, x_m, y_m)]
    }

    /// Whether no place within `margin_m` of the segment has a hazard, judged each half resolution.
    pub fn is_clear(&self, from_m: Point2<f64>, to_m: Point2<f64>, margin_m: f64) -> bool {
        let way = to_m - from_m;
        let step_m = 0.5 * self.settings.resolution_m;
        let steps = libm::ceil(way.norm() / step_m).max(1.0) as u32;
        let aside = (margin_m / step_m) as i32 + 1;
        (0..=steps).all(|i| {
            let p = from_m + way * (f64::from(i) / f64::from(steps));
            (-aside..=aside).all(|dx| {
                (-aside..=aside).all(|dy| {
                    let (dx_m, dy_m) = (f64::from(dx) * step_m, f64::from(dy) * step_m);
                    libm::hypot(dx_m, dy_m) > margin_m
                        || self.hazard(p.x + dx_m, p.y + dy_m) == Hazard::None
                })
            })
        })
    }
}

fn check(settings: &CraterSettings) -> Result<(), TerrainError> {
    let s = settings;
    let radius_m = s.rim_radius_m;
    let ranges = [
        ("rim_radius_m", 0.0, 2000.0, radius_m),
        ("depth_m", 0.0, radius_m, s.depth_m),
        ("rim_height_m", 0.0, radius_m, s.rim_height_m),
        ("half_side_m", radius_m, 4000.0, s.half_side_m),
        ("resolution_m", 0.1, 0.5 * radius_m, s.resolution_m),
        ("boulder_least_m", 0.0, f64::MAX, s.boulder_least_m),
        (
            "slope_limit_rad",
            0.0,
            std::f64::consts::FRAC_PI_2,
            s.slope_limit_rad,
        ),
    ];
    for (setting, above, limit, actual) in ranges {
        // Written so that a NaN fails.
        if !(actual > above && actual <= limit) {
            return Err(TerrainError::Setting {
                setting,
                above,
                limit,
                actual,
            });
        }
    }
    Ok(())
}

/// The index of the sample nearest to (x, y).
fn nearest_sample(terrain: &HeightField, x_m: f64, y_m: f64) -> usize {
    let index = |offset_m: f64, count: usize| {
        let samples = libm::round(offset_m / terrain.resolution_m());
        samples.clamp(0.0, (count - 1) as f64) as usize
    };
    let origin_m = terrain.origin_m();
    let column = index(x_m - origin_m.x, terrain.columns());
    index(y_m - origin_m.y, terrain.rows()) * terrain.columns() + column
}

fn hazards(settings: &CraterSettings, terrain: &HeightField, rocks: &[Rock]) -> Vec<Hazard> {
    let mut hazards = Vec::with_capacity(terrain.heights_m().len());
    for row in 0..terrain.rows() {
        for column in 0..terrain.columns() {
            let p = terrain.sample_position_m(column, row);
            let steep = terrain.slope_rad(p.x, p.y) > settings.slope_limit_rad;
            hazards.push(if steep { Hazard::Steep } else { Hazard::None });
        }
    }
    for rock in rocks
        .iter()
        .filter(|rock| rock.diameter_m >= settings.boulder_least_m)
    {
        let (p, reach_m) = (rock.position_m, 0.5 * rock.diameter_m);
        for (dx, dy) in [
            (-1.0, -1.0),
            (-1.0, 1.0),
            (1.0, -1.0),
            (1.0, 1.0),
            (0.0, 0.0),
        ] {
            hazards[nearest_sample(terrain, p.x + dx * reach_m, p.y + dy * reach_m)] =
                Hazard::Boulder;
        }
    }
    hazards
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_settings_give_the_same_crater() {
        let settings = CraterSettings {
            resolution_m: 8.0,
            ..CraterSettings::default()
        };
        let crater = Crater::generate(&settings).unwrap();
        assert_eq!(crater, Crater::generate(&settings).unwrap());
        let other = CraterSettings {
            seed: 2011,
            ..settings
        };
        assert_ne!(
            crater.terrain(),
            Crater::generate(&other).unwrap().terrain()
        );
    }

    #[test]
    fn it_has_a_floor_a_rim_and_a_plain() {
        let crater = Crater::generate(&CraterSettings::default()).unwrap();
        let ring_m = |radius_m: f64| {
            let heights = (0..72).map(|i| {
                let (sin, cos) = libm::sincos(f64::from(i) * std::f64::consts::PI / 36.0);
                crater.terrain().height_m(radius_m * cos, radius_m * sin)
            });
            heights.sum::<f64>() / 72.0
        };
        let (floor_m, wall_m, rim_m, plain_m) =
            (ring_m(30.0), ring_m(130.0), ring_m(200.0), ring_m(255.0));
        assert!(
            floor_m + 5.0 < wall_m && wall_m + 5.0 < rim_m,
            "{floor_m} {wall_m} {rim_m}"
        );
        assert!(plain_m + 1.0 < rim_m, "{plain_m} {rim_m}");
    }

    #[test]
    fn most_ground_is_safe_and_some_is_not() {
        let crater = Crater::generate(&CraterSettings::default()).unwrap();
        let share = |hazard| {
            let count = crater.hazards.iter().filter(|&&h| h == hazard).count();
            count as f64 / crater.hazards.len() as f64
        };
        let (steep, boulder) = (share(Hazard::Steep), share(Hazard::Boulder));
        assert!(
            (0.02..0.25).contains(&steep),
            "{steep} of the ground is steep"
        );
        assert!(
            (0.001..0.05).contains(&boulder),
            "{boulder} of the ground is under boulders"
        );
    }

    #[test]
    fn settings_out_of_range_are_errors() {
        let base = CraterSettings::default;
        let bad = [
            CraterSettings {
                rim_radius_m: f64::NAN,
                ..base()
            },
            CraterSettings {
                depth_m: -1.0,
                ..base()
            },
            CraterSettings {
                half_side_m: 100.0,
                ..base()
            },
            CraterSettings {
                resolution_m: 0.05,
                ..base()
            },
            CraterSettings {
                slope_limit_rad: 2.0,
                ..base()
            },
        ];
        for settings in bad {
            let error = Crater::generate(&settings).unwrap_err();
            assert!(matches!(error, TerrainError::Setting { .. }), "{error}");
        }
        let fine = CraterSettings {
            half_side_m: 4000.0,
            resolution_m: 0.5,
            ..base()
        };
        let error = Crater::generate(&fine).unwrap_err();
        assert!(
            matches!(error, TerrainError::TooManySamples { .. }),
            "{error}"
        );
    }
}
