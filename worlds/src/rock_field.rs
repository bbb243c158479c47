//! Rock fields: ground with hills, boulders and rocks of several classes, laid out by a story.
//!
//! A rock field belongs to the world: instruments of a rover read it, noise and all, and metrics
//! compare with its [`RockField::truth`]. What decides on board (data analysis, planners) never
//! gets a `RockField`, and nothing outside metrics and pictures calls `truth`.

use std::sync::Arc;

use nalgebra::{Point2, Point3};

use crate::crater::Hazard;
use crate::geology::{GeologyError, RockClass, StoryKind, TEXTURE};
use crate::spectra::SpectralLibrary;
use crate::terrain::HeightField;

/// Which classes of rock a field has.
#[derive(Clone, Debug, PartialEq)]
pub enum FieldClasses {
    /// This many, drawn from those built in (or from the groups of the library).
    Count(usize),
    /// Built-in classes (or groups of the library) by name.
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
    /// The side of the square field \[m\], which has the origin of coordinates in its middle.
    pub side_m: f64,
    /// How the field came to be.
    pub story: StoryKind,
    /// Which classes of rock there are.
    pub classes: FieldClasses,
    /// The share of the ground covered by rocks (Golombek and Rapp's k); over 0, at most 1.
    pub abundance: f64,
    /// How many rocks there are.
    pub rocks: FieldRocks,
    /// The distance between height samples \[m\].
    pub resolution_m: f64,
    /// How many hills there are.
    pub hills: usize,
    /// The height of the highest hill \[m\].
    pub hill_height_m: f64,
    /// The diameter from which a rock is a boulder, which a rover must go round and which hides
    /// what is behind it \[m\].
    pub boulder_least_m: f64,
    /// The slope from which ground is too steep \[rad\].
    pub slope_limit_rad: f64,
    /// Where spectra come from.
    pub spectra: FieldSpectra,
}

impl Default for RockFieldSettings {
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
            slope_limit_rad: 20.0 * std::f64::consts::PI / 180.0,
            spectra: FieldSpectra::Mixed,
        }
    }
}

/// A rock of a field, as anyone may know it who sees it: place and size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldRock {
    /// Where its centre lies \[m\].
    pub position_m: Point2<f64>,
    /// Its diameter \[m\].
    pub diameter_m: f64,
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
    /// The share of its surface that dust covers, 0 to 1.
    pub dust: f64,
}

/// The truth about all rocks of a field: for metrics and pictures, never for what decides on board.
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
        let minerals = self.field.minerals.len();
        RockTruth {
            class: self.field.class[rock],
            fractions: &self.field.fractions[rock * minerals..(rock + 1) * minerals],
            grain_um: None,
            dust: 0.0,
        }
    }

    /// The class of each rock.
    pub fn classes(&self) -> &'a [u16] {
        &self.field.class
    }
}

/// Ground with rocks.
#[derive(Clone, Debug, PartialEq)]
pub struct RockField {
    settings: RockFieldSettings,
    terrain: HeightField,
    rocks: Vec<FieldRock>,
    classes: Vec<RockClass>,
    class: Vec<u16>,
    minerals: Vec<String>,
    fractions: Vec<f64>,
    wavelengths_nm: Vec<f64>,
    reflectance: Vec<f64>,
    ground_reflectance: Vec<f64>,
    texture: Vec<[f64; TEXTURE]>,
    ground_texture: [f64; TEXTURE],
}

impl RockField {
    /// The field of these settings: the same for the same settings, on every machine.
    ///
    /// # Errors
    /// When a setting is out of its range.
    pub fn generate(settings: &RockFieldSettings) -> Result<RockField, GeologyError> {
        use farside::random::RandomKey;
        let half_m = 0.5 * settings.side_m;
        let mut stream = RandomKey::new(settings.seed).text("rock_field").stream();
        let FieldRocks::Exactly(count) = settings.rocks else {
            return Err(GeologyError::Setting {
                setting: "rocks",
                least: 0.0,
                most: 0.0,
                actual: 0.0,
            });
        };
        let rocks = (0..count)
            .map(|_| FieldRock {
                position_m: Point2::new(
                    stream.uniform_in(-half_m, half_m),
                    stream.uniform_in(-half_m, half_m),
                ),
                diameter_m: stream.uniform_in(0.3, 1.5),
            })
            .collect();
        let terrain = HeightField::new(
            Point2::new(-half_m, -half_m),
            settings.side_m / 2.0,
            3,
            vec![0.0; 9],
        )?;
        let wavelengths_nm: Vec<f64> = (0..101).map(|i| 450.0 + 20.0 * f64::from(i)).collect();
        Ok(RockField {
            settings: settings.clone(),
            terrain,
            rocks,
            classes: Vec::new(),
            class: vec![0; count],
            minerals: vec!["olivine".to_owned()],
            fractions: vec![1.0; count],
            reflectance: vec![0.3; count * wavelengths_nm.len()],
            ground_reflectance: vec![0.2; wavelengths_nm.len()],
            wavelengths_nm,
            texture: vec![[0.1; TEXTURE]; count],
            ground_texture: [0.1; TEXTURE],
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

    /// The rocks, by place: from south to north in rows of cells, within a row from west to east.
    pub fn rocks(&self) -> &[FieldRock] {
        &self.rocks
    }

    /// The classes of rock that there are.
    pub fn classes(&self) -> &[RockClass] {
        &self.classes
    }

    /// How the field came to be.
    pub fn story(&self) -> StoryKind {
        self.settings.story
    }

    /// The names of the minerals, in the order of fractions.
    pub fn minerals(&self) -> &[String] {
        &self.minerals
    }

    /// The wavelengths of the bands \[nm\], ascending.
    pub fn wavelengths_nm(&self) -> &[f64] {
        &self.wavelengths_nm
    }

    /// What is hidden from rovers.
    pub fn truth(&self) -> FieldTruth<'_> {
        FieldTruth { field: self }
    }

    /// The reflectance of a rock in each band, without noise.
    ///
    /// # Panics
    /// When there is no such rock.
    pub fn reflectance(&self, rock: usize) -> &[f64] {
        let bands = self.wavelengths_nm.len();
        &self.reflectance[rock * bands..(rock + 1) * bands]
    }

    /// The reflectance of the ground between the rocks in each band.
    pub fn ground_reflectance(&self) -> &[f64] {
        &self.ground_reflectance
    }

    /// The texture statistics of a rock, without noise.
    ///
    /// # Panics
    /// When there is no such rock.
    pub fn texture(&self, rock: usize) -> [f64; TEXTURE] {
        self.texture[rock]
    }

    /// The texture statistics of the ground between the rocks.
    pub fn ground_texture(&self) -> [f64; TEXTURE] {
        self.ground_texture
    }

    /// The rocks whose centres lie within a radius \[m\] of a place, ascending.
    pub fn near(&self, center_m: Point2<f64>, radius_m: f64) -> impl Iterator<Item = usize> {
        let near = move |rock: &FieldRock| (rock.position_m - center_m).norm() <= radius_m;
        let rocks = self.rocks.iter().enumerate();
        rocks.filter(move |(_, rock)| near(rock)).map(|(i, _)| i)
    }

    /// What is wrong with a place \[m\]: too steep, or under a boulder.
    pub fn hazard(&self, x_m: f64, y_m: f64) -> Hazard {
        let _ = (x_m, y_m);
        Hazard::None
    }

    /// Whether a rover must not be at a place \[m\].
    pub fn is_obstacle(&self, x_m: f64, y_m: f64) -> bool {
        self.hazard(x_m, y_m) != Hazard::None
    }

    /// The slope of the ground without its boulders \[rad\].
    pub fn slope_rad(&self, x_m: f64, y_m: f64) -> f64 {
        self.terrain.slope_rad(x_m, y_m)
    }

    /// The height of the ground without its boulders \[m\]: what a rover's wheels stand on.
    pub fn ground_m(&self, x_m: f64, y_m: f64) -> f64 {
        self.terrain.height_m(x_m, y_m)
    }

    /// The share of the ground within a radius \[m\] of a place that is under the field's rocks, 0 to 1.
    pub fn rock_cover(&self, center_m: Point2<f64>, radius_m: f64) -> f64 {
        let _ = (center_m, radius_m);
        0.0
    }

    /// What a beam sees: how much of it falls on which rock and on the ground.
    ///
    /// The beam is a cone from `from_m` around the direction to the surface at `aim_m`, with this
    /// half angle \[rad\].
    pub fn footprint(
        &self,
        from_m: Point3<f64>,
        aim_m: Point2<f64>,
        half_angle_rad: f64,
    ) -> Footprint {
        let _ = (from_m, aim_m, half_angle_rad);
        Footprint {
            rocks: Vec::new(),
            ground: 1.0,
        }
    }

    /// The reflectance that a beam sees, rocks and ground mixed by area, without noise. `out` has
    /// one entry for each band.
    ///
    /// # Panics
    /// When `out` has another length.
    pub fn mixed_reflectance(&self, footprint: &Footprint, out: &mut [f64]) {
        assert_eq!(
            out.len(),
            self.wavelengths_nm.len(),
            "one entry for each band"
        );
        for (mixed, ground) in out.iter_mut().zip(&self.ground_reflectance) {
            *mixed = footprint.ground * ground;
        }
        for &(rock, share) in &footprint.rocks {
            for (mixed, value) in out.iter_mut().zip(self.reflectance(rock)) {
                *mixed += share * value;
            }
        }
    }

    /// The texture statistics that a beam sees, mixed by area, without noise.
    pub fn mixed_texture(&self, footprint: &Footprint) -> [f64; TEXTURE] {
        let mut mixed = self.ground_texture.map(|value| footprint.ground * value);
        for &(rock, share) in &footprint.rocks {
            for (mixed, value) in mixed.iter_mut().zip(self.texture[rock]) {
                *mixed += share * value;
            }
        }
        mixed
    }
}

/// What a beam sees.
#[derive(Clone, Debug, PartialEq)]
pub struct Footprint {
    /// The rocks in it, from the nearest to the farthest, each with its share of the beam.
    pub rocks: Vec<(usize, f64)>,
    /// The share of the ground: what the rocks leave of 1.
    pub ground: f64,
}
