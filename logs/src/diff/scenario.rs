//! In what the scenarios of two logs differ, key by key.

use std::collections::BTreeMap;
use std::fmt;

use toml::{Table, Value};

use crate::log::Log;

/// Keys that are named; two scenarios of different systems have nothing in common.
const KEYS_SHOWN: usize = 12;

/// Letters of a value that are shown.
const VALUE_SHOWN: usize = 60;

/// Something in which the starts of two runs differ.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Input {
    /// What it is: a dotted key of the scenario, or `seed`, `tie seed`, `code version`, `file`.
    pub(super) key: String,
    /// In both; none where it is not there.
    pub(super) values: [Option<String>; 2],
}

impl Input {
    fn new(key: &str, values: [Option<String>; 2]) -> Self {
        let key = key.to_owned();
        Input { key, values }
    }
}

impl fmt::Display for Input {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [a, b] = self.values.each_ref().map(|value| match value {
            None => "none".to_owned(),
            Some(value) => match value.char_indices().nth(VALUE_SHOWN) {
                Some((at, _)) => format!("{}...", &value[..at]),
                None => value.clone(),
            },
        });
        write!(f, "{}: {a} | {b}", self.key)
    }
}

/// Notes what is not the same at the starts of two logs, and gives all of it that a run depends on.
pub(super) fn note(notes: &mut Vec<String>, a: &Log, b: &Log) -> Vec<Input> {
    let pair = |what: &str, one: &str, other: &str| -> Option<String> {
        let or_none = |text: &str| match text {
            "" => "none".to_owned(),
            text => text.to_owned(),
        };
        (one != other).then(|| format!("{what} differ: {} | {}", or_none(one), or_none(other)))
    };
    let tie_seed = |log: &Log| log.tie_seed().map(|n| n.to_string());
    let mut inputs = Vec::new();
    let of_all = [
        ("seed", [a, b].map(|log| Some(log.seed().to_string()))),
        ("tie seed", [a, b].map(tie_seed)),
        (
            "code version",
            [a, b].map(|log| Some(log.code_version().to_owned())),
        ),
    ];
    for (what, values) in of_all {
        if values[0] != values[1] {
            let [one, other] = values
                .each_ref()
                .map(|value| value.as_deref().unwrap_or(""));
            notes.extend(pair(&format!("{what}s"), one, other));
            inputs.push(Input::new(what, values));
        }
    }
    let (one, other) = (a.head(), b.head());
    notes.extend(pair("scenarios", &one.scenario, &other.scenario));
    if one.scenario_hash != other.scenario_hash {
        match differing(a.scenario(), b.scenario()) {
            Some(mut keys) => {
                let more = keys.len().saturating_sub(KEYS_SHOWN);
                let named = keys.iter().take(KEYS_SHOWN);
                notes.extend(named.map(|key| format!("scenario: {key}")));
                if more > 0 {
                    notes.push(format!("scenario: and {more} more keys"));
                }
                inputs.append(&mut keys);
            }
            None => {
                let hashes = [&one.scenario_hash, &other.scenario_hash];
                notes.extend(pair("resolved scenarios", hashes[0], hashes[1]));
                let hashes = hashes.map(|hash| Some(hash.clone()));
                inputs.push(Input::new("resolved scenario", hashes));
            }
        }
    }
    let filtered = |log: &Log| log.exclude().join(", ");
    notes.extend(pair("filtered topics", &filtered(a), &filtered(b)));
    inputs
}

/// The keys that differ; none if one of the two is no TOML. The seed is told apart from the scenario.
fn differing(a: Option<&str>, b: Option<&str>) -> Option<Vec<Input>> {
    let read = |text: Option<&str>| {
        let table: Table = text?.parse().ok()?;
        let mut keys = BTreeMap::new();
        flatten("", Value::Table(table), &mut keys);
        keys.remove("seed");
        Some(keys)
    };
    let (a, b) = (read(a)?, read(b)?);
    let mut names: Vec<&String> = a.keys().chain(b.keys()).collect();
    names.sort();
    names.dedup();
    let both = |name: &String| [a.get(name).cloned(), b.get(name).cloned()];
    let inputs = names.into_iter().map(|name| Input::new(name, both(name)));
    Some(
        inputs
            .filter(|input| input.values[0] != input.values[1])
            .collect(),
    )
}

/// Each value that holds no others, by its dotted key.
fn flatten(key: &str, value: Value, keys: &mut BTreeMap<String, String>) {
    match value {
        Value::Table(table) if !table.is_empty() => {
            for (name, value) in table {
                let bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
                let name = if name.chars().all(bare) {
                    name
                } else {
                    format!("{name:?}")
                };
                let dot = if key.is_empty() { "" } else { "." };
                flatten(&format!("{key}{dot}{name}"), value, keys);
            }
        }
        // Numbers and names stay together; a list of tables is told entry by entry.
        Value::Array(values) if values.iter().any(Value::is_table) => {
            for (at, value) in values.into_iter().enumerate() {
                flatten(&format!("{key}[{at}]"), value, keys);
            }
        }
        value => {
            keys.insert(key.to_owned(), value.to_string());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_that_differ_are_named_with_both_values() {
        let a = "seed = 1\n[links.default]\nloss = 0.02\nrate = 1\n[[crash]]\nat = \"1s\"";
        let b = "seed = 2\n[links.default]\nloss = 0.05\nrate = 1\n[links.\"a*\"]\nloss = 1\n\
                 [[crash]]\nat = \"2s\"";
        let keys = [
            "crash[0].at: \"1s\" | \"2s\"",
            "links.\"a*\".loss: none | 1",
            "links.default.loss: 0.02 | 0.05",
        ];
        let found = differing(Some(a), Some(b)).unwrap();
        let found: Vec<String> = found.iter().map(Input::to_string).collect();
        assert_eq!(found, keys);
        assert_eq!(differing(Some(a), Some("{")), None);
    }
}
