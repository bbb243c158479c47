//! Mistakes that readers and systems report, with the place of the key to blame.

use farside::suggest::nearest;
use farside_actors::system::SetupError;

use super::error::ScenarioError;
use super::location::one_line;
use super::source::Source;

impl ScenarioError {
    /// An error of the TOML reader, with its place and the nearest valid name.
    pub(crate) fn from_toml(source: &Source, error: &toml::de::Error) -> Self {
        let span = error.span().unwrap_or(0..0);
        let place = source.place(span.start);
        let key = source.key_at(&span);
        // Shortened only where it is shown: the names at its end are all needed to find the
        // nearest.
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
