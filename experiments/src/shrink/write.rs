//! A small scenario as a file: without what is as it is by default, with a word on where it comes from.

use std::path::{Path, PathBuf};

use farside_actors::system::{Files, Section};
use toml::{Table, Value};

use crate::registry::Registry;
use crate::scenario::{Scenario, shared_sections};

/// How all files begin that a search writes.
pub(crate) const BEGINNING: &str = "# Made small by ";

/// A scenario as text, without keys that are as they are by default: read, it is the same.
pub(crate) fn short(table: &Table, registry: &Registry, files: &Files) -> String {
    let whole = toml::to_string(table).unwrap_or_default();
    let system = table.get("system").and_then(Value::as_str);
    let system = system.and_then(|name| registry.find(name).ok());
    let own = system.map_or_else(Vec::new, |system| system.sections());
    let mut less = table.clone();
    for section in own.iter().chain(&shared_sections()) {
        forget_defaults(&mut less, section);
    }
    forget_empty(&mut less);
    let text = toml::to_string(&less).unwrap_or_default();
    let resolved = |text: &str| {
        let scenario = Scenario::parse("small", text.to_owned(), &[], registry, files.clone());
        scenario.ok()?.resolved().ok()
    };
    match resolved(&text) {
        Some(short) if Some(&short) == resolved(&whole).as_ref() => text,
        _ => whole,
    }
}

fn forget_defaults(table: &mut Table, section: &Section) {
    let mut within = table;
    for step in section.name.split('.').filter(|step| !step.is_empty()) {
        match within.get_mut(step) {
            Some(Value::Table(next)) => within = next,
            _ => return,
        }
    }
    let as_default = |key: &str, value: &Value| section.defaults.get(key) == Some(value);
    within.retain(|key, value| key == "system" || !as_default(key, value));
}

/// Forgets tables in which nothing is left, but for entries of arrays.
fn forget_empty(table: &mut Table) {
    for (_, value) in table.iter_mut() {
        if let Value::Table(within) = value {
            forget_empty(within);
        }
    }
    table.retain(|_, value| !matches!(value, Value::Table(within) if within.is_empty()));
}

/// Where the files that a scenario reads have to be for a scenario at `path`, and what is in them: those
/// that are not there yet.
///
/// # Errors
/// A file that is there and is another one, or a name that leads elsewhere.
pub(crate) fn beside(path: &Path, files: &Files) -> Result<Vec<(PathBuf, Vec<u8>)>, String> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut missing = Vec::new();
    for (name, bytes) in files.all() {
        let relative = Path::new(name.as_str());
        if relative.is_absolute() {
            continue;
        }
        let place = folder.join(relative);
        match std::fs::read(&place) {
            Ok(found) if found == *bytes => {}
            Ok(_) => {
                let place = place.display();
                return Err(format!(
                    "{place}: is there already, and is not the file that the scenario reads"
                ));
            }
            Err(_) => {
                let mut steps = relative.components();
                if !steps.all(|step| matches!(step, std::path::Component::Normal(_))) {
                    return Err(format!(
                        "{name}: the scenario reads it, and it cannot be put there"
                    ));
                }
                missing.push((place, bytes.clone()));
            }
        }
    }
    Ok(missing)
}
