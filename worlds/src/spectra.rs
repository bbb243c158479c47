//! Reflectance spectra of rocks: a model that mixes minerals, and libraries of measured ones.
//!
//! - [`SpectralModel`] computes the reflectance of a rock from its minerals, the size of its grains
//!   and the dust on it.
//! - [`SpectralLibrary`] reads measured spectra with known mineral fractions from a CSV file. The
//!   file is foreign: any bytes give a library or an error that names line and column, within
//!   bounded memory. Reading it from disk is the caller's affair, and so is putting the file's name
//!   before an error.
//!
//! Instruments, and so noise and the mixing of what lies within a beam, are not here.

mod error;
mod library;
mod minerals;
mod model;

pub use error::{LibraryError, LibraryProblem};
pub use library::{LibrarySample, SpectralLibrary};
pub use minerals::MINERALS;
pub use model::{GRAIN_UM, SpectralModel};

/// The most bytes of a library that are read.
pub const MAX_FILE_BYTES: usize = 16 << 20;

/// The most minerals of a library.
pub const MAX_MINERALS: usize = 64;

/// The most bands of a library.
pub const MAX_BANDS: usize = 4096;

/// The longest wavelength of a band \[nm\].
const MAX_WAVELENGTH_NM: f64 = 100_000.0;

/// The largest reflectance. Spectra that are divided by their value in one band exceed 1.
pub const MAX_REFLECTANCE: f64 = 100.0;

/// How far the sum of a sample's fractions may be from 1: files round each to four digits or to
/// whole tenths of a percent. What is read is divided by its sum.
pub const FRACTION_TOLERANCE: f64 = 2e-3;

/// The wavelengths of the built-in bands \[nm\]: 450 to 2450 in steps of 20, as in the built-in
/// library.
///
/// ```
/// let bands = farside_worlds::spectra::wavelength_grid_nm();
/// assert_eq!((bands.len(), bands[0], bands[100]), (101, 450.0, 2450.0));
/// ```
pub fn wavelength_grid_nm() -> Vec<f64> {
    (0..=100)
        .map(|band| 450.0 + 20.0 * f64::from(band))
        .collect()
}

#[cfg(test)]
mod tests;
