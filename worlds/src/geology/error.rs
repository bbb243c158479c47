//! What can be wrong with a geology or a rock field that a user described.

use crate::error::TerrainError;

/// Why a rock field cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GeologyError {
    /// The ground or the sizes of the rocks cannot be made.
    #[error(transparent)]
    Terrain(#[from] TerrainError),
    /// No story has this name.
    #[error("there is no story {name:?}; did you mean {nearest:?}?")]
    UnknownStory {
        /// The name asked for.
        name: String,
        /// The story closest to it in spelling.
        nearest: &'static str,
    },
    /// A setting of the field is out of its range.
    #[error("{setting} must be within {least} and {most}; it is {actual}")]
    Setting {
        /// The setting's name, with its unit.
        setting: &'static str,
        /// The least value it may have.
        least: f64,
        /// The largest value it may have.
        most: f64,
        /// The value found.
        actual: f64,
    },
}
