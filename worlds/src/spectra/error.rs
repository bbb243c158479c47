//! What can be wrong with a library of spectra, and on which line.

/// Why a library of spectra cannot be read.
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
    /// There is nothing in it.
    #[error("the file holds no sample")]
    Empty,
}
