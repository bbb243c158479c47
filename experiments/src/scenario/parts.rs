//! The parts of a scenario's document: what all systems share, and what one system has of its own.

use farside::suggest::nearest;
use farside_actors::system::System;
use farside_actors::system::settings::Table as _;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::{ScenarioError, Shared, Source};

/// The value of `system`, which decides who reads the rest.
pub(super) fn system_name(source: &Source, root: &DeTable<'_>) -> Result<String, ScenarioError> {
    match root
        .get("system")
        .map(|value| (value.span(), value.get_ref()))
    {
        Some((_, DeValue::String(name))) => Ok(name.to_string()),
        Some((span, other)) => Err(ScenarioError::Invalid {
            place: source.place(span.start),
            key: "system".to_owned(),
            message: format!(
                "found {}: expected the name of a system, as in system = \"network\"",
                other.type_str()
            ),
        }),
        None => Err(ScenarioError::Invalid {
            place: source.place(0),
            key: "system".to_owned(),
            message:
                "this key is missing: expected the name of a system, as in system = \"network\""
                    .to_owned(),
        }),
    }
}

/// The keys that all systems share, and those of this one.
type Parts<'i> = (Spanned<DeTable<'i>>, Spanned<DeTable<'i>>);

/// Parts the document into the keys that all systems share and those of this one.
pub(super) fn part<'i>(
    source: &Source,
    document: Spanned<DeTable<'i>>,
    sections: &[String],
) -> Result<Parts<'i>, ScenarioError> {
    let span = document.span();
    let shared_keys = &Shared::sections("")[0].keys;
    let (mut shared, mut own) = (DeTable::new(), DeTable::new());
    for (key, value) in document.into_inner() {
        let name = key.get_ref().as_ref();
        if shared_keys.iter().any(|key| key.name == name) {
            shared.insert(key, value);
        } else if sections.iter().any(|section| section == name) {
            own.insert(key, value);
        } else {
            let own = || sections.iter().map(String::as_str);
            let known = || shared_keys.iter().map(|key| key.name).chain(own());
            return Err(ScenarioError::UnknownKey {
                place: source.place(key.span().start),
                found: name.to_owned(),
                nearest: nearest(name, known()),
                expected: format!("one of {}", known().collect::<Vec<_>>().join(", ")),
                within: String::new(),
            });
        }
    }
    Ok((Spanned::new(span.clone(), shared), Spanned::new(span, own)))
}

/// The top-level tables that a system reads.
pub(super) fn roots(system: &dyn System) -> Vec<String> {
    let mut roots = Vec::new();
    for section in system.sections() {
        let root = section.root().to_owned();
        if !roots.contains(&root) {
            roots.push(root);
        }
    }
    roots
}
