//! Rock fields after Golombek and Rapp (1997): how many rocks of which size lie on the ground.
//!
//! A rock here is a place and a diameter. What a rock is made of is the affair of the geology that
//! rovers study, not of this file.

use farside::random::Stream;
use nalgebra::Point2;

use crate::error::TerrainError;

/// The largest rock that is drawn \[m\]; larger ones are parts of the terrain.
pub const MAX_DIAMETER_M: f64 = 5.0;

/// The most rocks that a field may be expected to hold.
pub const MAX_ROCKS: f64 = 1.0e6;

/// A rock on the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rock {
    /// Where its centre lies \[m\].
    pub position_m: Point2<f64>,
    /// Its diameter \[m\].
    pub diameter_m: f64,
}

/// The size-frequency distribution of rocks at a site, known by the share of the ground that rocks
/// cover: 0.02 at Phoenix, 0.03 at InSight, 0.05 at Spirit's site, 0.19 at Pathfinder's.
///
/// The cumulative share of area covered by rocks of diameter D \[m\] or more is
/// `F(D) = k exp(-q D)` with `q = 1.79 + 0.152 / k` (Golombek and Rapp 1997).
///
/// ```
/// use farside_worlds::RockAbundance;
/// let spirit = RockAbundance::new(0.05)?;
/// assert_eq!(spirit.area_fraction(0.0), 0.05);
/// assert!(spirit.per_m2(0.5) > 10.0 * spirit.per_m2(1.0));
/// # Ok::<(), farside_worlds::TerrainError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RockAbundance {
    covered: f64,
    decay_per_m: f64,
}

impl RockAbundance {
    /// The distribution of a site whose rocks cover this share of the ground.
    ///
    /// # Errors
    /// When the share is not over 0 and at most 1.
    pub fn new(covered: f64) -> Result<RockAbundance, TerrainError> {
        if !(covered > 0.0 && covered <= 1.0) {
            return Err(TerrainError::RockAbundance { actual: covered });
        }
        Ok(RockAbundance {
            covered,
            decay_per_m: 1.79 + 0.152 / covered,
        })
    }

    /// The share of the ground covered by rocks of this diameter \[m\] or more.
    pub fn area_fraction(&self, diameter_m: f64) -> f64 {
        self.covered * libm::exp(-self.decay_per_m * diameter_m)
    }

    /// Rocks of just this diameter \[m\], for each square metre of ground and metre of diameter.
    pub fn density_per_m3(&self, diameter_m: f64) -> f64 {
        let area_m2 = std::f64::consts::FRAC_PI_4 * diameter_m * diameter_m;
        self.decay_per_m * self.area_fraction(diameter_m) / area_m2
    }

    /// Rocks of this diameter \[m\] up to [`MAX_DIAMETER_M`], for each square metre of ground.
    pub fn per_m2(&self, diameter_m: f64) -> f64 {
        // Simpson's rule in the logarithm of the diameter, in which the density is smooth.
        const STEPS: usize = 512;
        let (low, high) = (libm::log(diameter_m), libm::log(MAX_DIAMETER_M));
        let step = (high - low) / STEPS as f64;
        let sum: f64 = (0..=STEPS)
            .map(|i| {
                let diameter_m = libm::exp(low + step * i as f64);
                let weight = match i {
                    0 | STEPS => 1.0,
                    odd if odd % 2 == 1 => 4.0,
                    _ => 2.0,
                };
                weight * diameter_m * self.density_per_m3(diameter_m)
            })
            .sum();
        sum * step / 3.0
    }

    /// The diameter \[m\] of a rock drawn from those of `least_m` up to [`MAX_DIAMETER_M`].
    pub fn draw_diameter_m(&self, least_m: f64, stream: &mut Stream) -> f64 {
        loop {
            // The density is 1/D^2, drawn by inversion, thinned by the exponential.
            let spread = 1.0 - least_m / MAX_DIAMETER_M;
            let diameter_m = least_m / (1.0 - spread * stream.uniform());
            if stream.chance(libm::exp(-self.decay_per_m * (diameter_m - least_m))) {
                return diameter_m;
            }
        }
    }

    /// The rocks of `least_m` diameter or more between two corners, as a Poisson field.
    ///
    /// # Errors
    /// When `least_m` is not between 1 cm and [`MAX_DIAMETER_M`], or more than [`MAX_ROCKS`] are to
    /// be expected.
    pub fn draw(
        &self,
        low_m: Point2<f64>,
        high_m: Point2<f64>,
        least_m: f64,
        stream: &mut Stream,
    ) -> Result<Vec<Rock>, TerrainError> {
        if !(0.01..MAX_DIAMETER_M).contains(&least_m) {
            let limit_m = MAX_DIAMETER_M;
            return Err(TerrainError::RockDiameter {
                actual_m: least_m,
                limit_m,
            });
        }
        let size = high_m - low_m;
        let expected = self.per_m2(least_m) * size.x * size.y;
        if expected.is_nan() || expected > MAX_ROCKS {
            return Err(TerrainError::TooManyRocks {
                limit: MAX_ROCKS,
                expected,
            });
        }
        let mut rocks = Vec::new();
        // As many as exponential gaps of mean 1/expected fit into 1: a Poisson count.
        let mut filled = gap(stream);
        while filled < expected {
            let x_m = stream.uniform_in(low_m.x, high_m.x);
            let y_m = stream.uniform_in(low_m.y, high_m.y);
            let diameter_m = self.draw_diameter_m(least_m, stream);
            rocks.push(Rock {
                position_m: Point2::new(x_m, y_m),
                diameter_m,
            });
            filled += gap(stream);
        }
        Ok(rocks)
    }
}

/// An exponential gap of mean 1, by inversion: how it is drawn is part of what the built-in maps
/// are.
fn gap(stream: &mut Stream) -> f64 {
    -libm::log(1.0 - stream.uniform())
}

#[cfg(test)]
mod tests {
    use super::*;
    use farside::random::RandomKey;

    #[test]
    fn drawn_rocks_cover_what_the_formula_says() {
        let site = RockAbundance::new(0.10).unwrap();
        let side_m = 400.0;
        let mut stream = RandomKey::new(5).text("rocks").stream();
        let corner = Point2::new(side_m, side_m);
        let rocks = site
            .draw(Point2::origin(), corner, 0.3, &mut stream)
            .unwrap();
        for least_m in [0.3, 0.5, 0.8] {
            let large: Vec<f64> = rocks
                .iter()
                .map(|r| r.diameter_m)
                .filter(|&d| d >= least_m)
                .collect();
            let area_m2: f64 = large
                .iter()
                .map(|d| std::f64::consts::FRAC_PI_4 * d * d)
                .sum();
            let (share, expected) = (area_m2 / (side_m * side_m), site.area_fraction(least_m));
            assert!(
                (share / expected - 1.0).abs() < 0.1,
                "{least_m} m: {share} of {expected}"
            );
            let (count, expected) = (large.len() as f64, site.per_m2(least_m) * side_m * side_m);
            let deviations = (count - expected) / libm::sqrt(expected);
            assert!(
                deviations.abs() < 4.0,
                "{least_m} m: {count} rocks of {expected}"
            );
        }
    }

    #[test]
    fn each_rule_has_its_error() {
        assert!(matches!(
            RockAbundance::new(0.0),
            Err(TerrainError::RockAbundance { .. })
        ));
        assert!(matches!(
            RockAbundance::new(f64::NAN),
            Err(TerrainError::RockAbundance { .. })
        ));
        let site = RockAbundance::new(0.05).unwrap();
        let draw = |side_m: f64, least_m| {
            let mut stream = RandomKey::new(1).stream();
            site.draw(
                Point2::origin(),
                Point2::new(side_m, side_m),
                least_m,
                &mut stream,
            )
        };
        assert!(matches!(
            draw(10.0, 9.0),
            Err(TerrainError::RockDiameter { .. })
        ));
        assert!(matches!(
            draw(10.0, f64::NAN),
            Err(TerrainError::RockDiameter { .. })
        ));
        assert!(matches!(
            draw(1e6, 0.1),
            Err(TerrainError::TooManyRocks { .. })
        ));
    }
}
