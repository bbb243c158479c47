//! What a rock field is made from, and which of it can be.

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

use crate::geology::{GeologyError, RockClass, StoryKind};
use crate::spectra::SpectralLibrary;

/// The most rocks of a field.
pub const MAX_FIELD_ROCKS: usize = 100_000;

/// Which classes of rock a field has.
#[derive(Clone, Debug, PartialEq)]
pub enum FieldClasses {
    /// This many, drawn from those built in; with a library, from its groups.
    Count(usize),
    /// Built-in classes by name; with a library, groups by the name of their mineral.
    Named(Vec<String>),
    /// Classes of one's own, over the built-in minerals; not with a library.
    Custom(Vec<RockClass>),
}

/// How many rocks a field has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FieldRocks {
    /// As many of this diameter \[m\] or more as the abundance says, as a Poisson field.
    FromDiameter(f64),
    /// Exactly so many: the largest ones that are to be expected at this abundance.
    Exactly(usize),
}

/// Where the spectra of the rocks come from.
#[derive(Clone, Debug, PartialEq)]
pub enum FieldSpectra {
    /// Mixed from the absorption bands of the built-in minerals.
    Mixed,
    /// Each rock has the spectrum and the fractions of a sample of this library; its class is the
    /// sample's dominant mineral.
    Library(Arc<SpectralLibrary>),
}

/// What a rock field is made from.
#[derive(Clone, Debug, PartialEq)]
pub struct RockFieldSettings {
    /// The seed of all draws.
    pub seed: u64,
    /// The side of the square field \[m, 10 to 4000\], which has the origin of coordinates in its
    /// middle.
    pub side_m: f64,
    /// How the field came to be.
    pub story: StoryKind,
    /// Which classes of rock there are.
    pub classes: FieldClasses,
    /// The share of the ground covered by rocks (Golombek and Rapp's k); over 0, at most 1.
    pub abundance: f64,
    /// How many rocks there are.
    pub rocks: FieldRocks,
    /// The distance between height samples \[m, 0.1 to a tenth of the side\].
    pub resolution_m: f64,
    /// How many hills there are, 0 to 1000.
    pub hills: usize,
    /// The height of the highest hill \[m, 0 to 100\]; the others have at least half of it.
    pub hill_height_m: f64,
    /// The diameter from which a rock is a boulder, which a rover must go round and which hides
    /// what is behind it \[m, over 0\].
    pub boulder_least_m: f64,
    /// The slope from which ground is too steep \[rad, over 0, at most pi/2\].
    pub slope_limit_rad: f64,
    /// Around the middle there is no rock and no hill within this radius \[m, 0 to a quarter of the
    /// side\], so that rovers can start there.
    pub clear_radius_m: f64,
    /// Where spectra come from.
    pub spectra: FieldSpectra,
}

impl Default for RockFieldSettings {
    /// 90 rocks of four classes on a square of 100 m, as frequent as at the site of Spirit (5 %), with
    /// three low hills. Rovers of the Mars Exploration mission stopped at a tilt of 30 degrees; 20
    /// leave a margin for rocks under a wheel.
    fn default() -> Self {
        RockFieldSettings {
            seed: 1,
            side_m: 100.0,
            story: StoryKind::Strata,
            classes: FieldClasses::Count(4),
            abundance: 0.05,
            rocks: FieldRocks::Exactly(90),
            resolution_m: 0.5,
            hills: 3,
            hill_height_m: 4.0,
            boulder_least_m: 1.0,
            slope_limit_rad: 20.0 * PI / 180.0,
            clear_radius_m: 6.0,
            spectra: FieldSpectra::Mixed,
        }
    }
}

impl RockFieldSettings {
    /// Whether each is within its range. Classes, abundance and diameters are for others to check.
    pub(super) fn check(&self) -> Result<(), GeologyError> {
        let tiny = f64::MIN_POSITIVE;
        let ranges = [
            ("side_m", 10.0, 4000.0, self.side_m),
            ("resolution_m", 0.1, 0.1 * self.side_m, self.resolution_m),
            ("hills", 0.0, 1000.0, self.hills as f64),
            ("hill_height_m", 0.0, 100.0, self.hill_height_m),
            ("boulder_least_m", tiny, f64::MAX, self.boulder_least_m),
            ("slope_limit_rad", tiny, FRAC_PI_2, self.slope_limit_rad),
            (
                "clear_radius_m",
                0.0,
                0.25 * self.side_m,
                self.clear_radius_m,
            ),
        ];
        for (setting, least, most, actual) in ranges {
            // Written so that a NaN fails.
            if !(actual >= least && actual <= most) {
                return Err(GeologyError::Setting {
                    setting,
                    least,
                    most,
                    actual,
                });
            }
        }
        if let FieldRocks::Exactly(count) = self.rocks
            && !(1..=MAX_FIELD_ROCKS).contains(&count)
        {
            return Err(GeologyError::Setting {
                setting: "rocks",
                least: 1.0,
                most: MAX_FIELD_ROCKS as f64,
                actual: count as f64,
            });
        }
        Ok(())
    }
}
