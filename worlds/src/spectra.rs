//! Reflectance spectra: a model that mixes minerals, and libraries of measured ones.

mod error;
mod library;

pub use error::LibraryError;
pub use library::SpectralLibrary;
