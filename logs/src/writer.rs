//! Writing a log while a run goes on.

use std::collections::BTreeMap;
use std::path::Path;

use farside::record::{Flow, Observer, ObserverError, Record};

use crate::LogError;

/// A file that the run read, or that explains it, kept in the log whole.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Attachment {
    /// Its name, unique within the log.
    pub name: String,
    /// Its media type, as in `text/plain`.
    pub media_type: String,
    /// Its content.
    pub bytes: Vec<u8>,
}

/// How the chunks of a log are compressed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Compression {
    /// Zstandard, at its default level.
    #[default]
    Zstd,
    /// Not at all.
    None,
}

/// What a log holds besides the records, and which records it holds.
#[derive(Clone, Debug, Default)]
pub struct LogOptions {
    /// The scenario's name.
    pub scenario: String,
    /// The scenario as it was resolved, from which the run can be executed again.
    pub resolved: String,
    /// The version of the code that runs.
    pub code_version: String,
    /// What else is to be known about the run.
    pub run: BTreeMap<String, String>,
    /// What may differ from machine to machine: executor, threads, host name. Never compared.
    pub host: BTreeMap<String, String>,
    /// Files to keep in the log.
    pub attachments: Vec<Attachment>,
    /// Topics that are not written, as globs; `*` does not match `/`, `**` does.
    pub exclude: Vec<String>,
    /// Added to every time that MCAP itself stores, in nanoseconds since 1970.
    pub epoch_ns: u64,
    /// How chunks are compressed.
    pub compression: Compression,
}

/// Writes a run to a log.
pub struct LogWriter {}

impl LogWriter {
    /// A writer to a new file at `path`; a file that is there already is replaced.
    pub fn create(path: impl AsRef<Path>, options: LogOptions) -> Result<LogWriter, LogError> {
        let _ = (path.as_ref(), options);
        todo!()
    }
}

impl Observer for LogWriter {
    fn record(&mut self, _record: &Record<'_>) -> Result<Flow, ObserverError> {
        Ok(Flow::Continue)
    }
}
