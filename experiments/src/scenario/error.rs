//! What can be wrong with a scenario.

use std::path::PathBuf;

use thiserror::Error;

use super::source::{Place, Source, one_line};
use farside::suggest::{did_you_mean, nearest};
use farside_actors::system::SetupError;

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
        place: Box<Place>,
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
        place: Box<Place>,
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
        place: Box<Place>,
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
        place: Box<Place>,
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
pub(crate) fn quoted(place: &Place) -> String {
    match place {
        Place::File {
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
    pub fn place(&self) -> Option<&Place> {
        match self {
            ScenarioError::Syntax { place, .. }
            | ScenarioError::UnknownKey { place, .. }
            | ScenarioError::UnknownValue { place, .. }
            | ScenarioError::Invalid { place, .. } => Some(place),
            _ => None,
        }
    }

    /// An error of the TOML reader, with its place and the nearest valid name.
    pub(crate) fn from_toml(source: &Source, error: &toml::de::Error) -> Self {
        let span = error.span().unwrap_or(0..0);
        let place = source.place(span.start);
        let key = source.key_at(&span);
        // Shortened only where it is shown: the names at its end are all needed to find the nearest.
        let message = in_words(one_line(error.message()));
        let names = backticked(&message);
        let unknown = ["unknown field", "unknown variant"]
            .iter()
            .position(|start| message.starts_with(start));
        let (Some(unknown), Some((found, expected))) = (unknown, names.split_first()) else {
            let message = shortened(message);
            return ScenarioError::Invalid {
                place,
                key,
                message,
            };
        };
        let nearest = nearest(found, expected.iter().copied());
        let expected = match expected {
            [only] => (*only).to_owned(),
            names => format!("one of {}", names.join(", ")),
        };
        let found = (*found).to_owned();
        if unknown == 1 {
            return ScenarioError::UnknownValue {
                place,
                key,
                found,
                nearest,
                expected,
            };
        }
        let table = key.rsplit_once('.').map(|(table, _)| table);
        ScenarioError::UnknownKey {
            place,
            found,
            nearest,
            expected,
            within: table.map_or_else(String::new, |table| format!(" in {table}")),
        }
    }

    /// An error of a system's assembly, with the place of the key it names.
    pub(super) fn from_setup(source: &Source, error: SetupError) -> Self {
        let (key, message) = error.into_parts();
        ScenarioError::Invalid {
            place: source.place_of_key(&key),
            key: key.join("."),
            message: shortened(message),
        }
    }
}

/// The most characters of a message from a system: worlds name everything that is wrong with them.
const MAX_MESSAGE: usize = 400;

fn shortened(message: String) -> String {
    match message.char_indices().nth(MAX_MESSAGE) {
        Some((end, _)) => format!("{} ... and so on", &message[..end]),
        None => message,
    }
}

/// Serde's message with words in place of Rust's types.
fn in_words(message: String) -> String {
    let words = [
        ("u64", "a whole number from 0 on"),
        ("u32", "a whole number from 0 on"),
        ("u16", "a whole number from 0 on"),
        ("usize", "a whole number from 0 on"),
        ("f64", "a number"),
        ("f32", "a number"),
        ("a boolean", "true or false"),
        ("a map", "a table"),
        ("a sequence", "an array"),
    ];
    let Some((start, expected)) = message.rsplit_once("expected ") else {
        return match message.strip_prefix("missing field ") {
            Some(field) => format!("the key {field} is missing"),
            None => message,
        };
    };
    match words
        .iter()
        .find(|(rust, _)| expected == *rust || expected.starts_with("struct "))
    {
        Some(_) if expected.starts_with("struct ") => format!("{start}expected a table"),
        Some((_, words)) => format!("{start}expected {words}"),
        None => message,
    }
}

/// What stands between backticks.
fn backticked(message: &str) -> Vec<&str> {
    message.split('`').skip(1).step_by(2).collect()
}
