//! Where a run takes place: what the scenario says of ground, rocks and sky, built. Runs and pictures
//! build it here alike.

use std::str::FromStr;
use std::sync::Arc;

use farside_actors::system::{Setup, SetupError};
use farside_worlds::geology::{GeologyError, StoryKind};
use farside_worlds::rock_field::{FieldClasses, FieldRocks, FieldSpectra, RockFieldSettings};
use farside_worlds::spectra::SpectralLibrary;
use farside_worlds::{RockField, Sky};

use crate::config::FieldConfig;

/// The most bytes of a spectral library that are read.
const MAX_LIBRARY_BYTES: u64 = 64 << 20;

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
            classes: FieldClasses::Count(world.classes as usize),
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
        let field = RockField::generate(&settings).map_err(blame)?;
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
    let bytes = setup.files.read(name, MAX_LIBRARY_BYTES).map_err(wrong)?;
    let library = SpectralLibrary::from_csv(&bytes);
    let library = library.map_err(|error| wrong(format!("{name}: {error}")))?;
    Ok(Some(Arc::new(library)))
}

/// Which key an error of the field is of.
fn blame(error: GeologyError) -> SetupError {
    SetupError::value("world", error)
}
