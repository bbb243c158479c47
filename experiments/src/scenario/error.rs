//! What can be wrong with a scenario.

use std::path::PathBuf;

use thiserror::Error;

use super::location::SourceLocation;
use farside::suggest::did_you_mean;

/// A scenario cannot be found, read or built.
#[derive(Debug, Error)]
pub enum ScenarioError {
    /// Neither a built-in scenario nor a file.
    #[error("{found}: no such scenario or file{}\n  built in: {known}", did_you_mean(.nearest.as_deref()))]
    NotFound {
        /// What was asked for.
        found: String,
        /// The built-in name closest to it.
        nearest: Option<String>,
        /// All built-in names.
        known: String,
    },
    /// The operating system refused.
    #[error("{}: cannot read it: {source}", .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file is no text.
    #[error("{}: byte {at_byte} is not UTF-8; expected TOML text", .path.display())]
    NotUtf8 {
        /// The file.
        path: PathBuf,
        /// The first byte that is no text.
        at_byte: usize,
    },
    /// The file is larger than any that is read.
    #[error("{}: {actual_bytes} bytes; at most {limit_bytes} are read", .path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its size.
        actual_bytes: u64,
        /// The most that is read.
        limit_bytes: u64,
    },
    /// A `--set` argument cannot be taken apart.
    #[error("--set {argument}: {message}")]
    BadSet {
        /// The argument.
        argument: String,
        /// What is wrong with it.
        message: &'static str,
    },
    /// The text is no TOML.
    #[error("{place}: not TOML: {message}{}", quoted(.place))]
    Syntax {
        /// Where.
        place: Box<SourceLocation>,
        /// What the TOML reader found and expected.
        message: String,
    },
    /// A key that does not exist.
    #[error(
        "{place}: unknown key {found:?}{within}{}\n  expected {expected}{}",
        did_you_mean(.nearest.as_deref()), quoted(.place)
    )]
    UnknownKey {
        /// Where.
        place: Box<SourceLocation>,
        /// The key.
        found: String,
        /// The table it is in, as ` in name`.
        within: String,
        /// The key closest to it.
        nearest: Option<String>,
        /// All keys.
        expected: String,
    },
    /// A name that does not exist.
    #[error(
        "{place}: {key}: unknown value {found:?}{}\n  expected {expected}{}",
        did_you_mean(.nearest.as_deref()), quoted(.place)
    )]
    UnknownValue {
        /// Where.
        place: Box<SourceLocation>,
        /// The key.
        key: String,
        /// Its value.
        found: String,
        /// The value closest to it.
        nearest: Option<String>,
        /// All values.
        expected: String,
    },
    /// A value that cannot be.
    #[error("{place}: {key}: {message}{}", quoted(.place))]
    Invalid {
        /// Where.
        place: Box<SourceLocation>,
        /// The key.
        key: String,
        /// What was found and expected.
        message: String,
    },
    /// The settings cannot be written as TOML.
    #[error("cannot write the resolved scenario: {message}")]
    Unwritable {
        /// What stands in the way.
        message: String,
    },
}

/// The line itself, with a mark below the column.
pub(crate) fn quoted(place: &SourceLocation) -> String {
    match place {
        SourceLocation::File {
            line, column, text, ..
        } if !text.is_empty() => {
            let number = line.to_string();
            // Long lines are cut: the mark would be off the screen.
            let shown: String = text.chars().take(120).collect();
            let dashes = " ".repeat(number.len());
            let mark = " ".repeat((*column - 1).min(120));
            format!("\n  {number} | {shown}\n  {dashes} | {mark}^")
        }
        _ => String::new(),
    }
}

impl ScenarioError {
    /// Where in the text or among the `--set` arguments it is, if it is there.
    pub fn place(&self) -> Option<&SourceLocation> {
        match self {
            ScenarioError::Syntax { place, .. }
            | ScenarioError::UnknownKey { place, .. }
            | ScenarioError::UnknownValue { place, .. }
            | ScenarioError::Invalid { place, .. } => Some(place),
            _ => None,
        }
    }
}
