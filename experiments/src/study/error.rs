//! What can be wrong with a study, its results folder, or its runs.

use std::path::{Path, PathBuf};

use thiserror::Error;

use farside::suggest::did_you_mean;

use crate::scenario::{ScenarioError, SourceLocation};

/// A study cannot be read, planned or run.
#[derive(Debug, Error)]
pub enum StudyError {
    /// Neither a built-in study nor a file.
    #[error("{found}: no such study or file{}\n  built in: {known}", did_you_mean(.nearest.as_deref()))]
    NotFound {
        /// What was asked for.
        found: String,
        /// The built-in name closest to it.
        nearest: Option<String>,
        /// All built-in names.
        known: String,
    },
    /// The study's text, or the scenario's.
    #[error(transparent)]
    Text(#[from] ScenarioError),
    /// The scenario cannot be with what the study sets.
    #[error("{place}: {what}: the scenario refuses it\n  {error}")]
    Refused {
        /// Where the study says it.
        place: Box<SourceLocation>,
        /// What it sets.
        what: String,
        /// What the scenario says.
        error: Box<ScenarioError>,
    },
    /// An argument of the command line that does not fit the study.
    #[error("{0}")]
    Argument(String),
    /// The results folder.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The first runs of a cell all failed: so would the others.
    #[error(
        "cell {cell} ({values}): its first {runs} runs all failed, so the study stops\n  seed {seed}: \
         {error}\n  --keep-going runs the rest all the same"
    )]
    CellFails {
        /// The cell.
        cell: usize,
        /// Its factor values.
        values: String,
        /// How many failed.
        runs: usize,
        /// A seed that failed.
        seed: u64,
        /// Why it did.
        error: String,
    },
    /// The operating system gave no threads.
    #[error("cannot start the workers: {0}")]
    Workers(#[source] std::io::Error),
}

/// A results folder cannot be used.
#[derive(Debug, Error)]
pub enum StoreError {
    /// The operating system refused.
    #[error("{}: {doing}: {source}", .path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What was tried: `cannot read it`.
        doing: &'static str,
        /// What the system said.
        source: std::io::Error,
    },
    /// The folder holds something else.
    #[error(
        "{}: not a results folder, and not empty: it holds {entry}\n  expected an empty folder, one \
         that does not exist, or one with a manifest.json", .path.display()
    )]
    Foreign {
        /// The folder.
        path: PathBuf,
        /// A file in it.
        entry: String,
    },
    /// There are no results.
    #[error("{}: not a results folder: it has no manifest.json", .path.display())]
    NoManifest {
        /// The folder.
        path: PathBuf,
    },
    /// A manifest of a format that this version cannot read.
    #[error("{}: format {found}: this version reads and writes {expected}", .path.display())]
    Format {
        /// The manifest.
        path: PathBuf,
        /// Its format.
        found: String,
        /// What is read.
        expected: u32,
    },
    /// A line or file that is not what is written there.
    #[error("{}{}: {message}", .path.display(), .line.map(|line| format!(":{line}")).unwrap_or_default())]
    Corrupt {
        /// The file.
        path: PathBuf,
        /// The line, from 1; none for a file that is one document.
        line: Option<usize>,
        /// What is wrong.
        message: String,
    },
    /// Curves of one cell that have other lengths or indices.
    #[error("{}: {message}", .path.display())]
    Series {
        /// The results folder.
        path: PathBuf,
        /// Which runs, and what differs.
        message: String,
    },
    /// The folder holds the results of something else.
    #[error(
        "{}: holds other results: {difference}\n  give another folder with --out, or remove this one",
        .path.display()
    )]
    Other {
        /// The folder.
        path: PathBuf,
        /// What differs.
        difference: String,
    },
    /// Another process works on the same runs.
    #[error(
        "{}: another process is working on these runs\n  wait until it ends, or part the work: \
         --shard 1/2 for one process, --shard 2/2 for the other", .path.display()
    )]
    Busy {
        /// The lock file.
        path: PathBuf,
    },
    /// Results that cannot be joined.
    #[error("these results are of different studies: {difference}")]
    Unlike {
        /// What differs.
        difference: String,
    },
    /// Two records of one run that say different things.
    #[error("cell {cell}, seed {seed}: two records of this run differ: {a} and {b}")]
    Conflict {
        /// The cell.
        cell: usize,
        /// The seed.
        seed: u64,
        /// One outcome.
        a: String,
        /// The other.
        b: String,
    },
}

impl StoreError {
    /// Whether something could not be written, which is no fault of what was read.
    pub fn is_of_output(&self) -> bool {
        matches!(self, StoreError::Io { doing, .. } if *doing != READING)
    }
}

/// What is done when results are read.
pub(super) const READING: &str = "cannot read it";

/// What makes of an error of the operating system one of a folder.
pub(super) fn io(path: &Path, doing: &'static str) -> impl FnOnce(std::io::Error) -> StoreError {
    move |source| StoreError::Io {
        path: path.to_owned(),
        doing,
        source,
    }
}
