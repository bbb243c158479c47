//! What all rovers carry to learn with: known before the run, and the same for all of them.

use farside_actors::system::SetupError;

use crate::analysis::features::SpectralBasis;
use crate::analysis::library::ReferenceLibrary;
use crate::analysis::objective::MineralGauge;
use crate::config::{LearnConfig, Objective};
use farside_actors::field::Place;

/// How many mixtures of minerals rovers carry, where no library of spectra is given.
const MIXTURES: usize = 300;

/// What all rovers carry to learn with: a basis of spectra, and a gauge for the mineral of
/// `learn.mineral`, if the library knows it.
pub(crate) struct Tools {
    pub(crate) basis: SpectralBasis,
    pub(crate) gauge: Option<MineralGauge>,
}

impl Tools {
    /// From the scenario's library of spectra, or from mixtures of the built-in minerals.
    pub(crate) fn new(place: &Place, learn: &LearnConfig) -> Result<Tools, SetupError> {
        let library = match &place.library {
            Some(library) => ReferenceLibrary::measured(library),
            None => ReferenceLibrary::mixed(place.field.wavelengths_nm(), MIXTURES),
        };
        let wrong = |error: &dyn std::fmt::Display| SetupError::value("world.spectra", error);
        let basis = library.basis().map_err(|error| wrong(&error))?;
        let minerals = library.minerals();
        let at = minerals.iter().position(|name| *name == learn.mineral);
        let gauge = match at {
            Some(at) => {
                let gauge = library.gauge(&basis, at);
                Some(gauge.map_err(|error| wrong(&error))?)
            }
            None if learn.objective != Objective::Mineral => None,
            None => {
                let (known, wanted) = (minerals.join(", "), &learn.mineral);
                let hint = farside::suggest::nearest(wanted, minerals.iter().map(String::as_str));
                let hint = farside::suggest::did_you_mean(hint.as_deref());
                let message = format!("{wanted:?}: expected one of {known}{hint}");
                return Err(SetupError::value("learn.mineral", message));
            }
        };
        Ok(Tools { basis, gauge })
    }
}
