//! In what the scenarios of two logs differ, key by key.

use std::collections::BTreeMap;

use toml::{Table, Value};

use crate::log::Log;

/// Keys that are named; two scenarios of different systems have nothing in common.
const KEYS_SHOWN: usize = 12;

/// Letters of a value that are shown.
const VALUE_SHOWN: usize = 60;

/// Notes what is not the same at the starts of two logs.
pub(super) fn note(notes: &mut Vec<String>, a: &Log, b: &Log) {
    let pair = |what: &str, one: &str, other: &str| -> Option<String> {
        let or_none = |text: &str| match text {
            "" => "none".to_owned(),
            text => text.to_owned(),
        };
        (one != other).then(|| format!("{what} differ: {} | {}", or_none(one), or_none(other)))
    };
    let tie_seed = |log: &Log| log.tie_seed().map_or(String::new(), |n| n.to_string());
    let (one, other) = (a.head(), b.head());
    let starts = [
        pair("seeds", &a.seed().to_string(), &b.seed().to_string()),
        pair("tie seeds", &tie_seed(a), &tie_seed(b)),
        pair("scenarios", &one.scenario, &other.scenario),
    ];
    notes.extend(starts.into_iter().flatten());
    if one.scenario_hash != other.scenario_hash {
        match differing(a.scenario(), b.scenario()) {
            Some(keys) => {
                let more = keys.len().saturating_sub(KEYS_SHOWN);
                let named = keys.into_iter().take(KEYS_SHOWN);
                notes.extend(named.map(|key| format!("scenario: {key}")));
                if more > 0 {
                    notes.push(format!("scenario: and {more} more keys"));
                }
            }
            None => notes.extend(pair(
                "resolved scenarios",
                &one.scenario_hash,
                &other.scenario_hash,
            )),
        }
    }
    let filtered = |log: &Log| log.exclude().join(", ");
    notes.extend(pair(
        "code versions",
        &one.code_version,
        &other.code_version,
    ));
    notes.extend(pair("filtered topics", &filtered(a), &filtered(b)));
}

/// The keys that differ, as `links.default.loss: 0.02 | 0.05`; none if one of the two is no TOML.
/// The seed is told apart from the scenario.
fn differing(a: Option<&str>, b: Option<&str>) -> Option<Vec<String>> {
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
    let value = |keys: &BTreeMap<String, String>, name: &String| {
        keys.get(name).map_or("none".to_owned(), |value| {
            let cut = value.char_indices().nth(VALUE_SHOWN);
            cut.map_or(value.clone(), |(at, _)| format!("{}...", &value[..at]))
        })
    };
    let differ = |name: &&String| a.get(*name) != b.get(*name);
    let line = |name: &String| format!("{name}: {} | {}", value(&a, name), value(&b, name));
    Some(names.into_iter().filter(differ).map(line).collect())
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
        assert_eq!(differing(Some(a), Some(b)).unwrap(), keys);
        assert_eq!(differing(Some(a), Some("{")), None);
    }
}
