//! Where a run takes place: what the scenario says of ground, rocks and sky, built. Runs and pictures
//! build it here alike.

use std::str::FromStr;
use std::sync::Arc;

use farside_actors::system::{Setup, SetupError};
use farside_worlds::geology::{GeologyError, RockClass, StoryKind};
use farside_worlds::rock_field::{FieldClasses, FieldRocks, FieldSpectra, RockFieldSettings};
use farside_worlds::spectra::{MAX_FILE_BYTES, MINERALS, SpectralLibrary};
use farside_worlds::{RockField, Sky};

use crate::config::{ClassConfig, FieldConfig};

/// Ground, rocks and sky of a run.
pub(crate) struct Place {
    pub(crate) field: Arc<RockField>,
    pub(crate) library: Option<Arc<SpectralLibrary>>,
    pub(crate) sky: Sky,
    /// The sky's time at the start of the run \[s since a local solar midnight\].
    pub(crate) starts_s: f64,
}

impl Place {
    /// What a scenario describes, with its chances drawn from the problem's seed.
    pub(crate) fn of(world: &FieldConfig, setup: &mut Setup<'_>) -> Result<Place, SetupError> {
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
pub(crate) fn story(world: &FieldConfig) -> Result<StoryKind, SetupError> {
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
