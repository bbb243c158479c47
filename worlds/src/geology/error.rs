//! What can be wrong with a geology or a rock field that a user described.

use crate::error::TerrainError;

/// Why a rock field cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GeologyError {
    /// The ground or the sizes of the rocks cannot be made.
    #[error(transparent)]
    Terrain(#[from] TerrainError),
    /// No story has this name.
    #[error("there is no story {name:?}; did you mean {nearest:?}? There are {all}")]
    UnknownStory {
        /// The name asked for.
        name: String,
        /// The story closest to it in spelling.
        nearest: &'static str,
        /// All names.
        all: String,
    },
    /// No class has this name.
    #[error("there is no class of rock {name:?}; did you mean {nearest:?}? There are {all}")]
    UnknownClass {
        /// The name asked for.
        name: String,
        /// The class closest to it in spelling.
        nearest: String,
        /// All names.
        all: String,
    },
    /// A class is there twice.
    #[error("the class of rock {name:?} is given twice; expected each once")]
    DuplicateClass {
        /// Its name.
        name: String,
    },
    /// There are no classes, or more than there can be.
    #[error("a field has 1 to {most} classes of rock; {actual} were asked for")]
    ClassCount {
        /// The most there can be.
        most: usize,
        /// The classes asked for.
        actual: usize,
    },
    /// Classes of one's own are over the built-in minerals, a library has its own.
    #[error("classes of one's own are not for a field whose spectra come from a library")]
    CustomWithLibrary,
    /// A class has a fraction too many or too few.
    #[error(
        "the class {class:?} has {actual} fractions; expected {expected}, one for each mineral"
    )]
    FractionCount {
        /// The class.
        class: String,
        /// The fractions found.
        actual: usize,
        /// The minerals.
        expected: usize,
    },
    /// The fractions of a class are no whole.
    #[error("the fractions of the class {class:?} sum to {sum}; expected 1")]
    FractionSum {
        /// The class.
        class: String,
        /// Their sum.
        sum: f64,
    },
    /// A figure of a class is out of its range.
    #[error("{setting} of the class {class:?} must be within {least} and {most}; it is {actual}")]
    ClassSetting {
        /// The class.
        class: String,
        /// Which figure.
        setting: &'static str,
        /// The least value it may have.
        least: f64,
        /// The largest value it may have.
        most: f64,
        /// The value found.
        actual: f64,
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

impl GeologyError {
    /// No class has this name; these are there, at least one.
    pub(crate) fn unknown_class<'a>(
        name: &str,
        names: impl Iterator<Item = &'a str>,
    ) -> GeologyError {
        let all: Vec<&str> = names.collect();
        let distance = |known: &&&str| strsim::damerau_levenshtein(known, name);
        let nearest = all.iter().min_by_key(distance).copied().unwrap_or_default();
        GeologyError::UnknownClass {
            name: name.chars().take(40).collect(),
            nearest: nearest.to_owned(),
            all: all.join(", "),
        }
    }
}
