//! What can be wrong with a library of spectra, on which line and in which column.

use super::{FRACTION_TOLERANCE, MAX_BANDS, MAX_MINERALS, MAX_REFLECTANCE, MAX_WAVELENGTH_NM};

/// Why a library of spectra cannot be read.
///
/// ```
/// use farside_worlds::spectra::SpectralLibrary;
/// let text = "id,olivine,plagioclase,r450,r470\nA-1,0.5,0.5,0.31,nan\n";
/// let error = SpectralLibrary::from_csv(text.as_bytes()).unwrap_err();
/// assert_eq!(
///     error.to_string(),
///     "line 2, column \"r470\": reflectance \"nan\": expected a number from 0 to 100"
/// );
/// assert_eq!(error.line(), Some(2));
/// ```
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LibraryError {
    /// The file is larger than any that is read.
    #[error("the file has {actual_bytes} bytes; at most {limit_bytes} are read")]
    TooLarge {
        /// The most bytes that are read.
        limit_bytes: usize,
        /// The file's size.
        actual_bytes: usize,
    },
    /// The file is no text.
    #[error("line {line}: not text: a byte is not UTF-8")]
    NotText {
        /// The line, from 1.
        line: usize,
    },
    /// There is no header.
    #[error("the file is empty: expected a header `id,MINERAL...,rNNN...`")]
    NoHeader,
    /// There is a header and nothing below it.
    #[error("the file holds no sample below its header; expected at least one")]
    NoSample,
    /// A line as a whole is wrong.
    #[error("line {line}: {problem}")]
    Line {
        /// The line, from 1.
        line: usize,
        /// What is wrong.
        problem: LibraryProblem,
    },
    /// One field of a line is wrong.
    #[error("line {line}, column {column:?}: {problem}")]
    Field {
        /// The line, from 1.
        line: usize,
        /// The column's name in the header, or what stands there if it is the header that is wrong.
        column: String,
        /// What is wrong.
        problem: LibraryProblem,
    },
}

impl LibraryError {
    /// The line that is wrong, from 1, if it is one.
    pub fn line(&self) -> Option<usize> {
        match self {
            LibraryError::NotText { line }
            | LibraryError::Line { line, .. }
            | LibraryError::Field { line, .. } => Some(*line),
            LibraryError::TooLarge { .. } | LibraryError::NoHeader | LibraryError::NoSample => None,
        }
    }
}

/// What is wrong at one place of a library. Texts from the file are cut to 40 characters.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LibraryProblem {
    /// A column of the header is none that can stand there.
    #[error("no such column: expected {expected}; did you mean {nearest:?}?")]
    UnknownColumn {
        /// What can stand there.
        expected: &'static str,
        /// The name closest to it.
        nearest: String,
    },
    /// Two columns have one name.
    #[error("this column is given twice: expected each once")]
    DuplicateColumn,
    /// There is no column of a mineral.
    #[error("no mineral: expected `id`, at least one mineral, and then the bands")]
    NoMineral,
    /// More minerals than anyone means.
    #[error("{actual} minerals: at most {MAX_MINERALS} are read")]
    TooManyMinerals {
        /// The minerals found.
        actual: usize,
    },
    /// There are too few or too many bands.
    #[error("{actual} bands: expected 2 to {MAX_BANDS} columns `rNNN`, NNN being nanometres")]
    BandCount {
        /// The bands found.
        actual: usize,
    },
    /// A wavelength is out of range.
    #[error("expected a wavelength over 0 and up to {MAX_WAVELENGTH_NM} nm")]
    Wavelength,
    /// A wavelength is not longer than the one before it.
    #[error("{actual_nm} nm after {before_nm} nm: expected ascending wavelengths, each once")]
    Unsorted {
        /// The wavelength of the column before \[nm\].
        before_nm: f64,
        /// The wavelength of this column \[nm\].
        actual_nm: f64,
    },
    /// A quoted field does not end, or goes on after its end.
    #[error("a field in quotes must end with a quote before the next comma or the line's end")]
    Quotes,
    /// A line has another number of fields than the header.
    #[error("{actual} fields: expected {expected}, as the header has{}", missing.as_deref().map(|name| format!("; {name:?} is the first that is missing")).unwrap_or_default())]
    FieldCount {
        /// The fields found.
        actual: usize,
        /// The header's.
        expected: usize,
        /// The first column without a field.
        missing: Option<String>,
    },
    /// A sample has no name.
    #[error("the sample has no id: expected a name")]
    NoId,
    /// Two samples have one name.
    #[error("the sample {id:?} is that of line {other_line}, too: expected each id once")]
    DuplicateId {
        /// The name.
        id: String,
        /// The line of the other one.
        other_line: usize,
    },
    /// A fraction is no number from 0 to 1.
    #[error("fraction {found:?}: expected a number from 0 to 1")]
    Fraction {
        /// What stands there.
        found: String,
    },
    /// The fractions do not make a whole.
    #[error("the fractions sum to {sum}: expected 1 within {FRACTION_TOLERANCE}")]
    FractionSum {
        /// Their sum.
        sum: f64,
    },
    /// A reflectance is no number within its range.
    #[error("reflectance {found:?}: expected a number from 0 to {MAX_REFLECTANCE}")]
    Reflectance {
        /// What stands there.
        found: String,
    },
}
