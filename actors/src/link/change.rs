//! A change of a link's parameters, as logs hold it.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::{LinkOverrides, LinkParams, Window};
use crate::units;

/// What a link is told, and what the log shows of it: the parameters that are replaced, by key, as
/// a scenario would write them (`{"loss": "0.3", "latency": "1.3s", "rate": "off"}`).
///
/// A link that was built with a [`super::Timeline`] knows its changes from the start, and messages
/// that it transmits later count on them; the events are there for who reads the log. Such changes
/// are `planned`, and the link takes no notice. Any other change holds from its own instant on.
///
/// ```
/// use farside_actors::link::{LinkChange, LinkOverrides};
/// let change = LinkChange::from(&LinkOverrides { loss: Some(0.3), ..LinkOverrides::default() });
/// assert_eq!(change.set()["loss"], "0.3");
/// assert_eq!(change.overrides().unwrap().loss, Some(0.3));
/// ```
// Text, because thirty parameters of many types would be thirty columns in every viewer.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LinkChange {
    set: BTreeMap<String, String>,
    planned: bool,
}

impl LinkChange {
    /// The parameters that are replaced, by key.
    pub fn set(&self) -> &BTreeMap<String, String> {
        &self.set
    }

    /// Whether the link knew of it from the start.
    pub fn is_planned(&self) -> bool {
        self.planned
    }

    /// A change that the link's timeline has already.
    pub(crate) fn planned(from: &LinkParams, to: &LinkParams) -> Self {
        LinkChange {
            planned: true,
            ..LinkChange::from(&from.changes_to(to))
        }
    }

    /// A contact opens, or closes: what the log is told of what the link has planned.
    pub(super) fn contact(window: Option<&Window>) -> Self {
        let state = if window.is_some() { "open" } else { "closed" };
        let rate = window.and_then(|window| window.rate);
        let owlt = window.and_then(|window| window.owlt);
        let set = [
            ("contact", Some(state.to_owned())),
            ("rate", rate.map(units::print_data_rate)),
            ("latency", owlt.map(units::print_duration)),
        ];
        let set = set.into_iter();
        LinkChange {
            set: set
                .filter_map(|(key, text)| Some((key.to_owned(), text?)))
                .collect(),
            planned: true,
        }
    }

    /// The parameters, read.
    ///
    /// # Errors
    /// When one is none: the change was not made by this crate.
    pub fn overrides(&self) -> Result<LinkOverrides, toml::de::Error> {
        let mut table = toml::Table::new();
        for (key, text) in &self.set {
            table.insert(key.clone(), value_of(text));
        }
        LinkOverrides::deserialize(table)
    }
}

/// As `--set` reads it: TOML, or a string where it is none.
fn value_of(text: &str) -> toml::Value {
    let parsed = toml::from_str::<toml::Table>(&format!("value = {text}"));
    let value = parsed.ok().and_then(|mut table| table.remove("value"));
    value.unwrap_or_else(|| toml::Value::String(text.to_owned()))
}

fn text_of(value: &toml::Value) -> String {
    match value {
        toml::Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}

impl From<&LinkOverrides> for LinkChange {
    fn from(over: &LinkOverrides) -> Self {
        // Every value is one that TOML can hold: queue limits are below 2^63.
        let table = toml::Table::try_from(over).unwrap_or_default();
        LinkChange {
            set: table
                .iter()
                .map(|(key, value)| (key.clone(), text_of(value)))
                .collect(),
            planned: false,
        }
    }
}

impl From<LinkParams> for LinkChange {
    fn from(params: LinkParams) -> Self {
        LinkChange::from(&LinkOverrides::from(params))
    }
}
