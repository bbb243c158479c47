//! Rock fields: ground with hills, boulders and rocks of several classes, laid out by a story.
//!
//! How many rocks of which size there are says [`RockAbundance`](crate::RockAbundance); where they
//! lie and what they are, a [`Story`]; what they are made of and look like, their [`RockClass`].
//!
//! A rock field belongs to the world. Instruments of a rover read it and add their noise; metrics and
//! pictures compare with its [`RockField::truth`]. What decides on board, such as data analysis and
//! planners, is never handed a `RockField`, so that it cannot look.

mod composition;
mod footprint;
mod grid;
mod ground;
mod palette;
mod placement;
mod settings;

use farside::random::RandomKey;
use nalgebra::Point2;

use composition::{Composition, GROUND_TEXTURE};
pub use footprint::Footprint;
use grid::Grid;
use palette::Palette;
pub use settings::{FieldClasses, FieldRocks, FieldSpectra, MAX_FIELD_ROCKS, RockFieldSettings};

use crate::crater::Hazard;
use crate::geology::{GeologyError, RockClass, Story, StoryKind, TEXTURE};
use crate::rocks::Rock;
use crate::terrain::HeightField;

/// A rock of a field, as anyone may know it who sees it: its place and its size.
pub type FieldRock = Rock;

/// Ground with rocks.
///
/// ```
/// use farside_worlds::{RockField, RockFieldSettings, StoryKind};
/// use nalgebra::{Point2, Point3};
/// let settings = RockFieldSettings { story: StoryKind::Lava, seed: 7, ..RockFieldSettings::default() };
/// let field = RockField::generate(&settings)?;
/// assert_eq!((field.rocks().len(), field.classes().len()), (90, 4));
///
/// // A point spectrometer of one milliradian on a mast of 1.5 m, pointed at a rock 10 m away.
/// let rock = field.near(Point2::origin(), 20.0).next().expect("rocks are everywhere");
/// let aim_m = field.rocks()[rock].position_m;
/// let from_m = field.terrain().antenna_m(aim_m.x - 10.0, aim_m.y, 1.5);
/// let footprint = field.footprint(from_m, aim_m, 0.5e-3);
/// let mut spectrum = vec![0.0; field.wavelengths_nm().len()];
/// field.mixed_reflectance(&footprint, &mut spectrum);
/// assert_eq!(spectrum, field.reflectance(rock));
/// # Ok::<(), farside_worlds::GeologyError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct RockField {
    settings: RockFieldSettings,
    story: Story,
    ground: HeightField,
    terrain: HeightField,
    rocks: Vec<Rock>,
    grid: Grid,
    /// The diameter of the largest rock; 0 without rocks.
    largest_m: f64,
    classes: Vec<RockClass>,
    minerals: Vec<String>,
    composition: Composition,
}

impl RockField {
    /// The field of these settings: the same for the same settings, on every machine.
    ///
    /// # Errors
    /// When a setting is out of its range, there is no such class, a class cannot be drawn from (see
    /// [`RockClass::check`]), or there would be more than [`MAX_FIELD_ROCKS`] rocks or 2^24 height
    /// samples.
    pub fn generate(settings: &RockFieldSettings) -> Result<RockField, GeologyError> {
        settings.check()?;
        let key = RandomKey::new(settings.seed).text("rock_field");
        let palette = Palette::of(settings, key)?;
        let mut stream = key.text("story").stream();
        let story = Story::draw(
            settings.story,
            palette.classes.len(),
            settings.side_m,
            &mut stream,
        );
        let mut rocks = placement::rocks(settings, &story, key)?;
        let grid = Grid::sort(settings.side_m, &mut rocks);
        let ground = ground::bare(settings, key)?;
        let terrain = ground::with_boulders(&ground, &rocks, settings.boulder_least_m)?;
        let composition = Composition::draw(&settings.spectra, &palette, &story, &rocks, key);
        Ok(RockField {
            settings: settings.clone(),
            story,
            ground,
            terrain,
            largest_m: rocks.iter().map(|rock| rock.diameter_m).fold(0.0, f64::max),
            rocks,
            grid,
            classes: palette.classes,
            minerals: palette.minerals,
            composition,
        })
    }

    /// What it was made from.
    pub fn settings(&self) -> &RockFieldSettings {
        &self.settings
    }

    /// The surface that hides things: hills and boulders are in it.
    pub fn terrain(&self) -> &HeightField {
        &self.terrain
    }

    /// The rocks, by place: cells of a grid from south to north, in each row from west to east.
    pub fn rocks(&self) -> &[FieldRock] {
        &self.rocks
    }

    /// The classes of rock that there are. Which rock is of which, [`RockField::truth`] knows.
    pub fn classes(&self) -> &[RockClass] {
        &self.classes
    }

    /// How the field came to be, which is a truth, too.
    pub fn story(&self) -> StoryKind {
        self.settings.story
    }

    /// The names of the minerals, in the order of fractions.
    pub fn minerals(&self) -> &[String] {
        &self.minerals
    }

    /// The wavelengths of the bands \[nm\], ascending.
    pub fn wavelengths_nm(&self) -> &[f64] {
        &self.composition.wavelengths_nm
    }

    /// What is hidden from rovers: for metrics and pictures alone.
    pub fn truth(&self) -> FieldTruth<'_> {
        FieldTruth { field: self }
    }

    /// The reflectance of a rock in each band, without noise: 0 to 1, or what a library says.
    ///
    /// # Panics
    /// When there is no such rock.
    pub fn reflectance(&self, rock: usize) -> &[f64] {
        match &self.settings.spectra {
            FieldSpectra::Mixed => {
                let bands = self.wavelengths_nm().len();
                &self.composition.reflectance[rock * bands..(rock + 1) * bands]
            }
            FieldSpectra::Library(library) => {
                library
                    .sample(self.composition.sample[rock] as usize)
                    .reflectance
            }
        }
    }

    /// The reflectance of the ground between the rocks in each band: sand of all classes alike, half
    /// under dust; with a library the mean of the samples, all classes alike.
    pub fn ground_reflectance(&self) -> &[f64] {
        &self.composition.ground_reflectance
    }

    /// The statistics of a rock's texture, without noise, in the order of
    /// [`TEXTURE_NAMES`](crate::TEXTURE_NAMES).
    ///
    /// # Panics
    /// When there is no such rock.
    pub fn texture(&self, rock: usize) -> [f64; TEXTURE] {
        self.composition.looks[rock].texture
    }

    /// The statistics of the texture of the ground between the rocks.
    pub fn ground_texture(&self) -> [f64; TEXTURE] {
        GROUND_TEXTURE
    }

    /// The rocks whose centres lie within a radius \[m\] of a place, ascending.
    pub fn near(&self, center_m: Point2<f64>, radius_m: f64) -> impl Iterator<Item = usize> {
        let ranges = self.grid.ranges(center_m, radius_m);
        let within =
            move |&rock: &usize| (self.rocks[rock].position_m - center_m).norm() <= radius_m;
        ranges.flatten().filter(within)
    }

    /// What is wrong with a place \[m\]: under a boulder, or too steep.
    pub fn hazard(&self, x_m: f64, y_m: f64) -> Hazard {
        let place_m = Point2::new(x_m, y_m);
        let mut boulders = self.near(place_m, 0.5 * self.largest_m).filter(|&rock| {
            let rock = &self.rocks[rock];
            rock.diameter_m >= self.settings.boulder_least_m
                && (rock.position_m - place_m).norm() <= 0.5 * rock.diameter_m
        });
        if boulders.next().is_some() {
            Hazard::Boulder
        } else if self.slope_rad(x_m, y_m) > self.settings.slope_limit_rad {
            Hazard::Steep
        } else {
            Hazard::None
        }
    }

    /// Whether a rover must not be at a place \[m\].
    pub fn is_obstacle(&self, x_m: f64, y_m: f64) -> bool {
        self.hazard(x_m, y_m) != Hazard::None
    }

    /// The ground without its boulders, on which a rover's wheels stand.
    pub fn ground(&self) -> &HeightField {
        &self.ground
    }

    /// The slope of the ground without its boulders \[rad\].
    pub fn slope_rad(&self, x_m: f64, y_m: f64) -> f64 {
        self.ground.slope_rad(x_m, y_m)
    }

    /// The height of the ground without its boulders \[m\].
    pub fn ground_m(&self, x_m: f64, y_m: f64) -> f64 {
        self.ground.height_m(x_m, y_m)
    }
}

/// What is true of a rock and hidden from rovers. Only metrics and pictures look at it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RockTruth<'a> {
    /// Its class, an index into [`RockField::classes`].
    pub class: u16,
    /// The fraction of each of [`RockField::minerals`] by volume; they sum to 1.
    pub fractions: &'a [f64],
    /// The size of its grains \[um\]; none, if its spectrum is measured.
    pub grain_um: Option<f64>,
    /// The share of its surface that dust covers, 0 to 1; 0, if its spectrum is measured.
    pub dust: f64,
    /// The sample of the library whose spectrum it has, if there is a library.
    pub sample: Option<usize>,
}

/// The truth about all rocks of a field: for metrics and pictures, never for what decides on board.
///
/// ```
/// use farside_worlds::{RockField, RockFieldSettings};
/// let field = RockField::generate(&RockFieldSettings::default())?;
/// let truth = field.truth();
/// let rock = truth.rock(3);
/// assert_eq!(rock.class, truth.classes()[3]);
/// assert!((rock.fractions.iter().sum::<f64>() - 1.0).abs() < 1e-12);
/// # Ok::<(), farside_worlds::GeologyError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct FieldTruth<'a> {
    field: &'a RockField,
}

impl<'a> FieldTruth<'a> {
    /// The truth about one rock.
    ///
    /// # Panics
    /// When there is no such rock.
    pub fn rock(&self, rock: usize) -> RockTruth<'a> {
        let composition = &self.field.composition;
        let class = composition.class[rock];
        match &self.field.settings.spectra {
            FieldSpectra::Mixed => {
                let minerals = self.field.minerals.len();
                let look = &composition.looks[rock];
                RockTruth {
                    class,
                    fractions: &composition.fractions[rock * minerals..(rock + 1) * minerals],
                    grain_um: Some(look.grain_um),
                    dust: look.dust,
                    sample: None,
                }
            }
            FieldSpectra::Library(library) => {
                let sample = composition.sample[rock] as usize;
                RockTruth {
                    class,
                    fractions: library.sample(sample).fractions,
                    grain_um: None,
                    dust: 0.0,
                    sample: Some(sample),
                }
            }
        }
    }

    /// The class of each rock.
    pub fn classes(&self) -> &'a [u16] {
        &self.field.composition.class
    }

    /// The story with its parameters, which laid the rocks out.
    pub fn story(&self) -> &'a Story {
        &self.field.story
    }
}

#[cfg(test)]
mod tests;
