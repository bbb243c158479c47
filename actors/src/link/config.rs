//! Which link has which parameters, and when they change: the `[links]` table and the
//! `[[degrade]]` entries of a scenario.

use std::collections::BTreeSet;
use std::fmt;

use farside::SimDuration;
use serde::de::{DeserializeSeed, Error as _, MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use thiserror::Error;

use super::params::{DEGRADE_KEYS, Key, Seen};
use super::{LinkOverrides, LinkParams};
use crate::processor::Slowdown;
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

/// A `[[degrade]]` entry: from `at` to `until` the links that match have other parameters, or the
/// processors that match are slower. Where entries overlap, the last in the file wins, parameter by
/// parameter.
///
/// ```
/// use farside_actors::link::{Degrade, Degraded};
/// let text = "at = '60s'\nuntil = '90s'\nlinks = 'node_*-*'\noutage = true";
/// let degrade: Degrade = toml::from_str(text)?;
/// let Degraded::Links { over, .. } = degrade.what else { panic!("links") };
/// assert_eq!(over.outage, Some(true));
/// let degrade: Degrade = toml::from_str("at = '60s'\nprocessors = 'node_07'\nslowdown = 50")?;
/// let Degraded::Processors { slowdown, .. } = degrade.what else { panic!("processors") };
/// assert_eq!(slowdown.factor(), 50.0);
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Degrade {
    /// When it begins, from the start of the run.
    pub at: SimDuration,
    /// When it ends; without, it lasts.
    pub until: Option<SimDuration>,
    /// What is worse meanwhile.
    pub what: Degraded,
}

/// What a degradation makes worse.
#[derive(Clone, Debug, PartialEq)]
pub enum Degraded {
    /// Links.
    Links {
        /// The pattern over link names.
        pattern: String,
        /// What the links have meanwhile.
        over: Box<LinkOverrides>,
    },
    /// Processors.
    Processors {
        /// The pattern over names `{host}/{processor}`, or over hosts' names for all that a host
        /// has.
        pattern: String,
        /// By how much the processors are slower meanwhile.
        slowdown: Slowdown,
    },
}

impl Degrade {
    /// When any of these begins or ends, ascending.
    pub(crate) fn instants<'a>(all: impl Iterator<Item = &'a Degrade>) -> BTreeSet<SimDuration> {
        all.flat_map(|degrade| [Some(degrade.at), degrade.until])
            .flatten()
            .collect()
    }

    /// Whether there is an instant at which both hold.
    pub(crate) fn overlaps(&self, other: &Degrade) -> bool {
        self.until.is_none_or(|until| other.at < until)
            && other.until.is_none_or(|until| self.at < until)
    }

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
        match &self.what {
            Degraded::Links { pattern, over } => {
                map.serialize_entry("links", pattern)?;
                over.write(&mut map)?;
            }
            Degraded::Processors { pattern, slowdown } => {
                map.serialize_entry("processors", pattern)?;
                map.serialize_entry("slowdown", slowdown)?;
            }
        }
        map.end()
    }
}

/// Reads a key of an entry, and refuses one that is not for what the entry degrades, at its place.
struct EntryKey<'a> {
    seen: &'a mut Seen,
}

impl<'de> DeserializeSeed<'de> for EntryKey<'_> {
    type Value = &'static str;

    fn deserialize<D: Deserializer<'de>>(self, from: D) -> Result<&'static str, D::Error> {
        from.deserialize_identifier(self)
    }
}

/// Keys that are for processors only.
const OF_PROCESSORS: [&str; 2] = ["processors", "slowdown"];

impl Visitor<'_> for EntryKey<'_> {
    type Value = &'static str;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a key of a degradation")
    }

    fn visit_str<E: serde::de::Error>(self, name: &str) -> Result<&'static str, E> {
        let key = Key {
            keys: DEGRADE_KEYS,
            seen: &mut *self.seen,
        }
        .visit_str::<E>(name)?;
        let specific = |key: &str| !["at", "until"].contains(&key);
        let of_processors = |key: &str| OF_PROCESSORS.contains(&key);
        let earlier = self.seen.iter().map(|(seen, _)| *seen);
        let mut earlier = earlier.filter(|seen| specific(seen));
        let other = earlier.find(|seen| of_processors(seen) != of_processors(key));
        match other.filter(|_| specific(key)) {
            None => Ok(key),
            Some(other) => Err(E::custom(format!(
                "{key} stands beside {other}: expected either links and their parameters, or \
                 processors and slowdown"
            ))),
        }
    }
}

impl<'de> Deserialize<'de> for Degrade {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Entry;

        impl<'de> Visitor<'de> for Entry {
            type Value = Degrade;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(
                    "a table of at, until, and links and their parameters or processors and \
                     slowdown",
                )
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Degrade, A::Error> {
                let (mut at, mut until, mut links) = (None, None, None);
                let (mut processors, mut slowdown) = (None, None);
                let mut over = LinkOverrides::default();
                let mut seen = Vec::new();
                while let Some(key) = map.next_key_seed(EntryKey { seen: &mut seen })? {
                    match key {
                        "at" => at = Some(map.next_value::<Written>()?.0),
                        "until" => until = Some(map.next_value::<Written>()?.0),
                        "links" => links = Some(map.next_value()?),
                        "processors" => processors = Some(map.next_value()?),
                        "slowdown" => slowdown = Some(map.next_value()?),
                        _ => over.read(key, &mut map)?,
                    }
                }
                let missing = A::Error::missing_field;
                let what = match (processors, slowdown) {
                    (Some(pattern), Some(slowdown)) => Degraded::Processors { pattern, slowdown },
                    (Some(_), None) => return Err(missing("slowdown")),
                    (None, Some(_)) => return Err(missing("processors")),
                    (None, None) => Degraded::Links {
                        pattern: links.ok_or_else(|| missing("links"))?,
                        over: Box::new(over),
                    },
                };
                Ok(Degrade {
                    at: at.ok_or_else(|| missing("at"))?,
                    until,
                    what,
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
    #[error("{pattern:?} is no pattern over names: {error}")]
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
    /// A pattern matches no processor.
    #[error("{pattern:?} matches no processor{}", match .nearest {
        Some(_) => did_you_mean(.nearest.as_deref()),
        None => ": this system has none".to_owned(),
    })]
    NoSuchProcessor {
        /// Where in the scenario.
        key: Vec<String>,
        /// The pattern.
        pattern: String,
        /// The name or pattern closest to it in spelling, if there are processors at all.
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
            | LinkConfigError::NoSuchProcessor { key, .. }
            | LinkConfigError::EndsBeforeItBegins { key, .. }
            | LinkConfigError::TooMany { key, .. }
            | LinkConfigError::Value { key, .. }
            | LinkConfigError::ChangesNothing { key } => key,
        }
    }
}
