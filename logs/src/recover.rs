//! Saving what can be saved of a cut or damaged file.

use std::fmt;
use std::path::Path;

use serde::Serialize;

use crate::LogError;

/// What was saved of a damaged file, and what was lost.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RecoverReport {
    /// Messages written.
    pub messages: u64,
    /// Chunks read.
    pub chunks: u64,
    /// Attachments written.
    pub attachments: u64,
    /// Metadata records written.
    pub metadata: u64,
    /// Bytes of the broken file that held nothing that could be read.
    pub bytes_lost: u64,
    /// What was lost, in words.
    pub lost: Vec<String>,
}

impl fmt::Display for RecoverReport {
    fn fmt(&self, _f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Ok(())
    }
}

/// Writes every complete chunk and record of `broken` to a new file `out`.
pub fn recover(
    broken: impl AsRef<Path>,
    out: impl AsRef<Path>,
) -> Result<RecoverReport, LogError> {
    let _ = (broken.as_ref(), out.as_ref());
    todo!()
}
