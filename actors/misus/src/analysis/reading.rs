//! What one reading says of one rock, as rovers exchange it.
//!
//! A row holds features, not the spectrum: a spectrum of a hundred bands becomes four numbers (see
//! [`super::features`]).

use serde::{Deserialize, Serialize};

/// How many features a spectrum becomes.
pub const SPECTRAL: usize = 4;

/// How many statistics an image of a rock's surface becomes.
pub const TEXTURAL: usize = 4;

/// Who made a reading: a rover between two restarts. A rover that restarts without its memory counts
/// its readings from 0 again, so it has to call itself something new.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
pub struct Origin {
    /// The rover's number.
    pub rover: u32,
    /// How often the rover has started before. A rover's later origins have higher ones.
    pub incarnation: u32,
}

/// The name of a reading: no two readings of a team share one.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
pub struct ReadingId {
    /// Who made it.
    pub origin: Origin,
    /// Its place among the readings of its origin, from 0.
    pub ordinal: u32,
}

/// What a spectrometer says of a rock.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spectral {
    /// The spectrum's components in the library's basis, without unit.
    pub features: [f32; SPECTRAL],
    /// The standard deviation of each, from the instrument's noise at that range. Finite, at least 0.
    pub noise_sd: f32,
}

/// What a camera says of a rock's surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Textural {
    /// The statistics of the image, without unit.
    pub features: [f32; TEXTURAL],
    /// The standard deviation of each, from the camera's noise at that range. Finite, at least 0.
    pub noise_sd: f32,
}

/// What a rover read of a rock. An image of many rocks is a reading for each of them.
///
/// ```
/// use farside_misus::analysis::reading::{Reading, Textural};
/// let image = Reading {
///     rock: 7,
///     position_m: [12.0, 3.5],
///     position_sd_m: 0.2,
///     diameter_m: 0.4,
///     spectral: None,
///     textural: Some(Textural { features: [0.3, 0.1, 0.8, 0.2], noise_sd: 0.02 }),
/// };
/// assert!(image.check().is_ok());
/// let broken = Reading { position_m: [f32::NAN, 0.0], ..image };
/// assert_eq!(broken.check().unwrap_err().to_string(),
///     "the reading of rock 7 has the position NaN, must be finite");
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Reading {
    /// Which rock it is of: its number in the team's catalogue.
    pub rock: u32,
    /// Where the rover thinks the rock is, east and north \[m\].
    pub position_m: [f32; 2],
    /// The standard deviation of either coordinate \[m\]. Finite, at least 0.
    pub position_sd_m: f32,
    /// How large the rock looks \[m\]. Finite, at least 0.
    pub diameter_m: f32,
    /// From a spectrometer.
    pub spectral: Option<Spectral>,
    /// From a camera.
    pub textural: Option<Textural>,
}

/// A reading that no instrument gives.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ReadingError {
    /// A number is not finite.
    #[error("the reading of rock {rock} has the {what} {actual}, must be finite")]
    NotFinite {
        /// The rock's number.
        rock: u32,
        /// `position`, `spectral feature` or `textural feature`.
        what: &'static str,
        /// What it is.
        actual: f32,
    },
    /// A standard deviation or a length is not one.
    #[error("the reading of rock {rock} has the {what} {actual}, must be finite and at least 0")]
    Noise {
        /// The rock's number.
        rock: u32,
        /// `position_sd_m`, `diameter_m` or `noise_sd`.
        what: &'static str,
        /// What it is.
        actual: f32,
    },
}

impl Reading {
    /// Whether all numbers are such that they can be averaged.
    ///
    /// # Errors
    /// Names the first number that is not finite, or a standard deviation or a length below 0.
    pub fn check(&self) -> Result<(), ReadingError> {
        let rock = self.rock;
        let finite = |what, values: &[f32]| match values.iter().find(|v| !v.is_finite()) {
            Some(&actual) => Err(ReadingError::NotFinite { rock, what, actual }),
            None => Ok(()),
        };
        let noise = |what, actual: f32| match actual.is_finite() && actual >= 0.0 {
            true => Ok(()),
            false => Err(ReadingError::Noise { rock, what, actual }),
        };
        finite("position", &self.position_m)?;
        noise("position_sd_m", self.position_sd_m)?;
        noise("diameter_m", self.diameter_m)?;
        if let Some(spectral) = &self.spectral {
            finite("spectral feature", &spectral.features)?;
            noise("noise_sd", spectral.noise_sd)?;
        }
        if let Some(textural) = &self.textural {
            finite("textural feature", &textural.features)?;
            noise("noise_sd", textural.noise_sd)?;
        }
        Ok(())
    }
}

/// A reading with its name and version: what rovers exchange.
///
/// Of two rows of one id the later version counts, as when a rover has corrected its estimate of where
/// a rock is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Which reading it is.
    pub id: ReadingId,
    /// When its origin wrote it: the count of the origin's writes so far, from 1.
    pub version: u32,
    /// What was read.
    pub reading: Reading,
}
