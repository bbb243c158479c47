//! What can go wrong with a log: one error type for the crate.

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::shown::escaped;

/// A log could not be written, read or compared.
///
/// ```
/// let error = farside_logs::info("no/such/file.mcap").unwrap_err();
/// assert!(error.to_string().contains("no/such/file.mcap"));
/// ```
#[derive(Debug, Error)]
pub enum LogError {
    /// The operating system refused.
    #[error("{path}: cannot {action}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What was tried.
        action: &'static str,
        /// What the system said.
        source: io::Error,
    },
    /// What does not fit into memory could not be put into a temporary file.
    #[error(
        "{path}: cannot {action} a temporary file for what the comparison keeps: {source} (TMPDIR \
         names another folder)"
    )]
    Temporary {
        /// The folder for temporary files.
        path: PathBuf,
        /// What was tried.
        action: &'static str,
        /// What the system said.
        source: io::Error,
    },
    /// The file does not start like an MCAP file.
    #[error("{path}: not an MCAP file: it {actual}; expected {expected} at its start")]
    NotMcap {
        /// The file.
        path: PathBuf,
        /// The magic bytes, in hexadecimal.
        expected: String,
        /// What is there instead, in words.
        actual: String,
    },
    /// A pipe or a device, which cannot be read from several places.
    #[error("{path}: is a pipe or a device, not a file: write it to a file first")]
    NotAFile {
        /// What was to be read or written.
        path: PathBuf,
    },
    /// A folder, a pipe or a device, in whose place no file can be put.
    #[error("{path}: is {what}, in whose place no log can be put")]
    NotWritable {
        /// What was to be written.
        path: PathBuf,
        /// What it is.
        what: &'static str,
    },
    /// A part of the file is damaged.
    #[error("{path}: damaged at byte {offset}: {what}")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Where the damaged part starts.
        offset: u64,
        /// What is wrong with it.
        what: String,
    },
    /// A part of the file is larger than this crate is willing to hold in memory.
    #[error(
        "{path}: the {what} at byte {offset} has {actual} bytes, more than the {limit} allowed"
    )]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// What it is.
        what: &'static str,
        /// Where it starts.
        offset: u64,
        /// Its size, in bytes.
        actual: u64,
        /// The most that is accepted, in bytes.
        limit: u64,
    },
    /// An MCAP file, but not one that Farside wrote.
    #[error("{path}: an MCAP file, but not the log of a Farside run: {missing}")]
    NotFarside {
        /// The file.
        path: PathBuf,
        /// What a Farside log would have.
        missing: String,
    },
    /// A log of a format that this version does not read.
    #[error("{path}: log format {actual}, but this version reads {expected}")]
    Format {
        /// The file.
        path: PathBuf,
        /// The formats that can be read.
        expected: String,
        /// The log's format.
        actual: String,
    },
    /// The MCAP library refused a record.
    #[error("{path}: {source}")]
    Mcap {
        /// The file.
        path: PathBuf,
        /// What it said.
        source: Box<mcap::McapError>,
    },
    /// A record that cannot be replayed.
    #[error("{path}: cannot be replayed: {reason}")]
    Replay {
        /// The file.
        path: PathBuf,
        /// Why not.
        reason: String,
    },
    /// A topic glob that cannot be read.
    #[error("topic glob {glob:?}: {reason}")]
    Glob {
        /// The glob.
        glob: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A topic that a file does not have.
    #[error("{path}: has no topic {topic:?}{hint}")]
    NoSuchTopic {
        /// The file.
        path: PathBuf,
        /// The topic that was asked for.
        topic: String,
        /// The nearest that there is, as a question; empty if none is near.
        hint: String,
    },
    /// A name that is no field of any message that was compared, and no topic.
    #[error("no message that is compared has a field {field:?}{hint}")]
    NoSuchField {
        /// The field that was named.
        field: String,
        /// The nearest that there is, as a question; empty if none is near.
        hint: String,
    },
    /// A name that is a part of a time, of which nothing can be said alone.
    #[error("{field:?} is a part of a time, and times are compared as a whole: name {time:?}")]
    PartOfTime {
        /// The field that was named.
        field: String,
        /// The time.
        time: String,
    },
    /// More topics than an MCAP file can have channels.
    #[error("no channel is left for topic {topic}: a log has at most {limit}")]
    TooManyTopics {
        /// The topic.
        topic: String,
        /// The most channels that a log can have.
        limit: u16,
    },
    /// The result of a run was asked for before the run was over.
    #[error("{path}: the re-execution did not reach its end")]
    Unfinished {
        /// The log it was to be compared with.
        path: PathBuf,
    },
    /// The file to write is being written by another run, of this process or another.
    #[error("{path}: another run is writing it")]
    Busy {
        /// The file.
        path: PathBuf,
    },
    /// The file to write is the file to read.
    #[error("{path}: is read by this command, which does not write over what it reads")]
    SameFile {
        /// The file.
        path: PathBuf,
    },
    /// The file to write is there already, and is something else than a log.
    #[error("{path}: is there already and is no log: it is not replaced")]
    InTheWay {
        /// The file.
        path: PathBuf,
    },
}

impl LogError {
    /// Whether a file could not be written, which is no fault of what was read.
    ///
    /// ```
    /// use farside_logs::{LogOptions, LogWriter};
    /// let error = LogWriter::create("no/such/folder/a.mcap", LogOptions::default()).err().unwrap();
    /// assert!(error.is_of_output());
    /// assert!(!farside_logs::info("no/such/file.mcap").unwrap_err().is_of_output());
    /// ```
    pub fn is_of_output(&self) -> bool {
        match self {
            LogError::Io { action, .. } => !matches!(*action, "open" | "read"),
            LogError::NotWritable { .. } | LogError::Temporary { .. } => true,
            _ => false,
        }
    }

    pub(crate) fn io(path: &Path, action: &'static str, source: io::Error) -> Self {
        LogError::Io {
            path: path.to_owned(),
            action,
            source,
        }
    }

    pub(crate) fn mcap(path: &Path, source: mcap::McapError) -> Self {
        match source {
            mcap::McapError::Io(source) => LogError::io(path, "write", source),
            source => LogError::Mcap {
                path: path.to_owned(),
                source: Box::new(source),
            },
        }
    }

    pub(crate) fn damaged(path: &Path, offset: u64, what: impl Into<String>) -> Self {
        LogError::Damaged {
            path: path.to_owned(),
            offset,
            what: escaped(&what.into()),
        }
    }
}
