//! Which link has which parameters, and when they change: the `[links]` table and the
//! `[[degrade]]` entries of a scenario.

use std::fmt;

use farside::SimDuration;
use serde::de::{Error as _, MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use thiserror::Error;

use super::params::{DEGRADE_KEYS, Key};
use super::{LinkOverrides, LinkParams};
use crate::units;
use farside::suggest::did_you_mean;

/// The `[links]` table: `default`, and by pattern what some links have instead. Of several patterns
/// that match a link and set one parameter, the last in the file wins.
///
/// ```
/// use farside_actors::link::LinksConfig;
/// let text = "
///     default = { latency = '5ms', jitter = '1ms', loss = 0.02 }
///     'rover_*-node_*' = { loss = 0.3 }
///     'rover_7-*' = { outage = true }
/// ";
/// let links: LinksConfig = toml::from_str(text)?;
/// assert_eq!(links.default.loss, 0.02);
/// assert_eq!(links.patterns[0].0, "rover_*-node_*");
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LinksConfig {
    /// What every link has.
    pub default: LinkParams,
    /// Patterns over link names, in the file's order, and what they replace.
    pub patterns: Vec<(String, LinkOverrides)>,
}

impl Serialize for LinksConfig {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let mut map = to.serialize_map(Some(1 + self.patterns.len()))?;
        map.serialize_entry("default", &self.default)?;
        for (pattern, over) in &self.patterns {
            map.serialize_entry(pattern, over)?;
        }
        map.end()
    }
}

impl<'de> Deserialize<'de> for LinksConfig {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Table;

        impl<'de> Visitor<'de> for Table {
            type Value = LinksConfig;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a table of `default` and patterns over link names")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<LinksConfig, A::Error> {
                let mut links = LinksConfig::default();
                while let Some(key) = map.next_key::<String>()? {
                    if key == "default" {
                        links.default = map.next_value()?;
                    } else {
                        links.patterns.push((key, map.next_value()?));
                    }
                }
                Ok(links)
            }
        }

        from.deserialize_map(Table)
    }
}

/// A `[[degrade]]` entry: from `at` to `until` the links that match have other parameters. Where
/// entries overlap, the last in the file wins, parameter by parameter.
///
/// ```
/// use farside_actors::link::Degrade;
/// let text = "at = '60s'\nuntil = '90s'\nlinks = 'node_*-*'\noutage = true";
/// let degrade: Degrade = toml::from_str(text)?;
/// assert_eq!(degrade.over.outage, Some(true));
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Degrade {
    /// When it begins, from the start of the run.
    pub at: SimDuration,
    /// When it ends; without, it lasts.
    pub until: Option<SimDuration>,
    /// The pattern over link names.
    pub links: String,
    /// What the links have meanwhile.
    pub over: LinkOverrides,
}

impl Degrade {
    pub(crate) fn is_active(&self, at: SimDuration) -> bool {
        self.at <= at && self.until.is_none_or(|until| at < until)
    }
}

/// A duration, as scenarios have it.
struct Written(SimDuration);

impl Serialize for Written {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        units::duration::serialize(&self.0, to)
    }
}

impl<'de> Deserialize<'de> for Written {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        units::duration::deserialize(from).map(Written)
    }
}

// By hand: serde's `flatten` would lose the places of mistakes.
impl Serialize for Degrade {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let mut map = to.serialize_map(None)?;
        map.serialize_entry("at", &Written(self.at))?;
        if let Some(until) = self.until {
            map.serialize_entry("until", &Written(until))?;
        }
        map.serialize_entry("links", &self.links)?;
        self.over.write(&mut map)?;
        map.end()
    }
}

impl<'de> Deserialize<'de> for Degrade {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Entry;

        impl<'de> Visitor<'de> for Entry {
            type Value = Degrade;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a table of at, until, links and a link's parameters")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Degrade, A::Error> {
                let (mut at, mut until, mut links) = (None, None, None);
                let mut over = LinkOverrides::default();
                let mut seen = Vec::new();
                while let Some(key) = map.next_key_seed(Key {
                    keys: DEGRADE_KEYS,
                    seen: &mut seen,
                })? {
                    match key {
                        "at" => at = Some(map.next_value::<Written>()?.0),
                        "until" => until = Some(map.next_value::<Written>()?.0),
                        "links" => links = Some(map.next_value()?),
                        _ => over.read(key, &mut map)?,
                    }
                }
                Ok(Degrade {
                    at: at.ok_or_else(|| A::Error::missing_field("at"))?,
                    until,
                    links: links.ok_or_else(|| A::Error::missing_field("links"))?,
                    over,
                })
            }
        }

        from.deserialize_map(Entry)
    }
}

/// What is wrong with `[links]` or `[[degrade]]`.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum LinkConfigError {
    /// A pattern cannot be read.
    #[error("{pattern:?} is no pattern over link names: {error}")]
    BadPattern {
        /// Where in the scenario: the keys from the top, entries of arrays by number.
        key: Vec<String>,
        /// The pattern.
        pattern: String,
        /// What is wrong with it.
        error: String,
    },
    /// A pattern matches no link.
    #[error("{pattern:?} matches no link{}", did_you_mean(.nearest.as_deref()))]
    NoSuchLink {
        /// Where in the scenario.
        key: Vec<String>,
        /// The pattern.
        pattern: String,
        /// The link name or pattern closest to it in spelling, if there are links at all.
        nearest: Option<String>,
    },
    /// A degradation ends before it begins.
    #[error("it ends at {until:?}: expected a time after {at:?}, when it begins")]
    EndsBeforeItBegins {
        /// Where in the scenario.
        key: Vec<String>,
        /// When it begins.
        at: String,
        /// When it ends.
        until: String,
    },
    /// More entries than anyone means.
    #[error("{actual} entries: expected at most {limit}")]
    TooMany {
        /// Where in the scenario.
        key: Vec<String>,
        /// How many there are.
        actual: usize,
        /// The most there may be.
        limit: usize,
    },
    /// A value that cannot be.
    #[error("{message}")]
    Value {
        /// Where in the scenario.
        key: Vec<String>,
        /// What was found and what was expected.
        message: String,
    },
    /// A degradation that leaves everything as it is.
    #[error("it changes nothing: expected a link's parameters, such as latency, loss or outage")]
    ChangesNothing {
        /// Where in the scenario.
        key: Vec<String>,
    },
}

impl LinkConfigError {
    /// Where in the scenario the mistake is: the keys from the top, entries of arrays by number.
    pub fn key(&self) -> &[String] {
        match self {
            LinkConfigError::BadPattern { key, .. }
            | LinkConfigError::NoSuchLink { key, .. }
            | LinkConfigError::EndsBeforeItBegins { key, .. }
            | LinkConfigError::TooMany { key, .. }
            | LinkConfigError::Value { key, .. }
            | LinkConfigError::ChangesNothing { key } => key,
        }
    }
}
