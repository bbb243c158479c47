//! The field that a run takes place on, for every system whose rovers drive freely: what the scenario
//! says of ground, rocks and sky, and how it is built. Runs and pictures build it here alike.

use std::str::FromStr;
use std::sync::Arc;

use farside_worlds::geology::{GeologyError, RockClass, StoryKind};
use farside_worlds::rock_field::{FieldClasses, FieldRocks, FieldSpectra, RockFieldSettings};
use farside_worlds::spectra::{MAX_FILE_BYTES, MINERALS, SpectralLibrary};
use farside_worlds::{RockField, Sky};

use farside::SimDuration;

use crate::rover::RoverSite;
use crate::system::settings::{Within, in_unit, one_of, such_that};
use crate::system::{Setup, SetupError};
use crate::{settings, units};

settings! {
    /// The `[world]` table: the ground, its rocks and the sky over it.
    pub struct FieldConfig {
        /// The story that laid the rocks: which class to expect where.
        pub story: String = "strata".to_owned(),
            one_of(&["strata", "ejecta", "lava", "outwash", "uniform"]);
        /// How many classes of rock there are, of those built in or of the library's; unless they are
        /// named or described.
        pub classes: u32 = 4, 1..=8;
        /// The classes by name, of those built in or of the library's.
        pub class_names: Vec<String> [skip_serializing_if = "Vec::is_empty"];
        /// Classes of one's own, in place of those built in; not with a library.
        pub own_classes as "class": Vec<ClassConfig> [skip_serializing_if = "Vec::is_empty"], Within;
        /// How many rocks there are: the largest to be expected at the abundance.
        pub rocks: u32 = 90, 1..=5_000;
        /// The side of the square field.
        pub side_m as "side": f64 [with = "units::length_m"] = 100.0, in_unit("m", 5.0..=2_000.0);
        /// The share of the ground that rocks cover (Golombek and Rapp's k).
        pub abundance: f64 [with = "units::fraction"] = 0.05, in_unit("of 1", 0.001..=1.0);
        /// How many hills there are.
        pub hills: u32 = 3, 0..=100;
        /// How high the highest hill is.
        pub hill_height_m as "hill_height": f64 [with = "units::length_m"] = 4.0,
            in_unit("m", 0.0..=500.0);
        /// A library of measured spectra in a CSV file, of which each rock has one; without, spectra
        /// are mixed from the absorption bands of minerals.
        pub spectra: Option<String> [skip_serializing_if = "Option::is_none"];
        /// Where on Mars it is, north is positive; Gusev crater unless given.
        pub latitude_rad as "latitude": f64 [with = "units::angle_rad"]
            = -14.6 * std::f64::consts::PI / 180.0, in_unit("rad", -1.571..=1.571);
        /// The season at the start: the Sun's longitude, 0 at the northern spring equinox.
        pub season_rad as "season": f64 [with = "units::angle_rad"]
            = 1.5 * std::f64::consts::PI, in_unit("rad", 0.0..=6.284);
        /// The optical depth of the dust in the air.
        pub dust: f64 = 0.5, 0.0..=10.0;
        /// The time of day at which the run starts, from local midnight.
        pub starts: SimDuration [with = "units::duration"] = SimDuration::from_secs(7 * 3600);
    }
}

settings! {
    /// A `[[world.class]]` entry: a class of rock of one's own. Fractions are by volume and sum to 1.
    pub struct ClassConfig {
        /// Its name.
        pub name: String, such_that("a name", |_| "missing".to_owned(), |name: &String| !name.is_empty());
        /// The mean fraction of olivine.
        pub olivine: f64 [with = "units::fraction"];
        /// The mean fraction of orthopyroxene.
        pub orthopyroxene: f64 [with = "units::fraction"];
        /// The mean fraction of clinopyroxene.
        pub clinopyroxene: f64 [with = "units::fraction"];
        /// The mean fraction of plagioclase.
        pub plagioclase: f64 [with = "units::fraction"];
        /// The mean fraction of hematite.
        pub hematite: f64 [with = "units::fraction"];
        /// The standard deviation of the logarithm of each fraction.
        pub scatter: f64 = 0.1, 0.0..=1.0;
        /// The median size of its grains.
        pub grain_m as "grain": f64 [with = "units::length_m"] = 2e-4, in_unit("m", 5e-6..=5e-3);
        /// The mean share of a rock's surface that dust covers.
        pub dust: f64 [with = "units::fraction"] = 0.1;
        /// The mean contrast of its texture: squared difference of neighbouring pixels, 0 to 1.
        pub contrast: f64 = 0.2, 0.0..=1.0;
        /// The mean energy of its texture: how even it is, 0 to 1.
        pub energy: f64 = 0.15, 0.0..=1.0;
        /// The mean correlation of neighbouring pixels, -1 to 1.
        pub correlation: f64 = 0.5, -1.0..=1.0;
        /// The mean anisotropy of its texture, 0 to 1.
        pub anisotropy: f64 = 0.1, 0.0..=1.0;
        /// The standard deviation of each statistic of texture.
        pub texture_scatter: f64 = 0.05, 0.0..=1.0;
    }
}

/// Ground, rocks and sky of a run.
pub struct Place {
    /// Ground and rocks.
    pub field: Arc<RockField>,
    /// The library that rocks have their spectra of, if the scenario names one.
    pub library: Option<Arc<SpectralLibrary>>,
    /// The sky.
    pub sky: Sky,
    /// The sky's time at the start of the run \[s since a local solar midnight\].
    pub starts_s: f64,
}

impl Place {
    /// What a scenario describes, with its chances drawn from the problem's seed.
    ///
    /// # Errors
    /// When a key names what there is not, a file cannot be read, or a field cannot be so.
    pub fn of(world: &FieldConfig, setup: &mut Setup<'_>) -> Result<Place, SetupError> {
        let library = library(world, setup)?;
        let settings = RockFieldSettings {
            seed: setup.problem_seed,
            side_m: world.side_m,
            story: story(world)?,
            classes: classes(world)?,
            abundance: world.abundance,
            rocks: FieldRocks::Exactly(world.rocks as usize),
            hills: world.hills as usize,
            hill_height_m: world.hill_height_m,
            spectra: match &library {
                Some(library) => FieldSpectra::Library(library.clone()),
                None => FieldSpectra::Mixed,
            },
            ..RockFieldSettings::default()
        };
        let field = RockField::generate(&settings).map_err(|error| blame(world, &error))?;
        let sky = Sky::new(
            world.latitude_rad.to_degrees(),
            world.season_rad.to_degrees(),
            world.dust,
        );
        let sky = sky.map_err(|error| SetupError::value("world", error))?;
        Ok(Place {
            field: Arc::new(field),
            library,
            sky,
            starts_s: world.starts.as_secs_f64(),
        })
    }

    /// Where rovers are.
    pub fn site(&self) -> RoverSite {
        RoverSite {
            ground: self.field.clone(),
            sky: self.sky,
            starts_s: self.starts_s,
        }
    }
}

/// The classes of a field: described, named, or so many.
fn classes(world: &FieldConfig) -> Result<FieldClasses, SetupError> {
    if world.own_classes.is_empty() {
        return Ok(match world.class_names.as_slice() {
            [] => FieldClasses::Count(world.classes as usize),
            names => FieldClasses::Named(names.to_vec()),
        });
    }
    if !world.class_names.is_empty() {
        let message = "given beside [[world.class]]: expected one of both";
        return Err(SetupError::value("world.class_names", message));
    }
    let own = world.own_classes.iter().map(own_class);
    Ok(FieldClasses::Custom(own.collect()))
}

/// A class as the scenario describes it, over the built-in minerals in their order.
fn own_class(class: &ClassConfig) -> RockClass {
    let of_mineral = |mineral: &&str| match *mineral {
        "olivine" => class.olivine,
        "orthopyroxene" => class.orthopyroxene,
        "clinopyroxene" => class.clinopyroxene,
        "plagioclase" => class.plagioclase,
        "hematite" => class.hematite,
        other => unreachable!("no key of a class is for {other}"),
    };
    RockClass {
        name: class.name.clone(),
        fractions: MINERALS.iter().map(of_mineral).collect(),
        scatter: class.scatter,
        grain_um: 1e6 * class.grain_m,
        dust: class.dust,
        texture: [
            class.contrast,
            class.energy,
            class.correlation,
            class.anisotropy,
        ],
        texture_scatter: [class.texture_scatter; 4],
    }
}

/// The story of a field.
///
/// # Errors
/// When there is none of that name.
pub fn story(world: &FieldConfig) -> Result<StoryKind, SetupError> {
    StoryKind::from_str(&world.story).map_err(|error| SetupError::value("world.story", error))
}

/// The library of spectra that the scenario names.
fn library(
    world: &FieldConfig,
    setup: &mut Setup<'_>,
) -> Result<Option<Arc<SpectralLibrary>>, SetupError> {
    let Some(name) = &world.spectra else {
        return Ok(None);
    };
    let wrong = |message: String| SetupError::value("world.spectra", message);
    let bytes = setup
        .files
        .read(name, MAX_FILE_BYTES as u64)
        .map_err(wrong)?;
    let library = SpectralLibrary::from_csv(&bytes);
    let library = library.map_err(|error| wrong(format!("{name}: {error}")))?;
    Ok(Some(Arc::new(library)))
}

/// Which key an error of the field is of.
fn blame(world: &FieldConfig, error: &GeologyError) -> SetupError {
    let own = |class: &String| world.own_classes.iter().position(|own| own.name == *class);
    let key = match error {
        GeologyError::UnknownClass { .. } => "world.class_names".to_owned(),
        GeologyError::ClassCount { .. } => "world.classes".to_owned(),
        GeologyError::FractionSum { class, .. }
        | GeologyError::FractionCount { class, .. }
        | GeologyError::ClassSetting { class, .. }
        | GeologyError::DuplicateClass { name: class } => match own(class) {
            Some(index) => format!("world.class.{index}"),
            None => "world.class_names".to_owned(),
        },
        _ => "world".to_owned(),
    };
    SetupError::value(&key, error)
}
