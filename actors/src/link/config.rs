//! Which link has which parameters, and when they change: the `[links]` table and the
//! `[[degrade]]` entries of a scenario, and what builds links from them.

use std::collections::BTreeSet;
use std::fmt;

use farside::{HostId, LinkId, SimDuration, SimTime, Simulation};
use globset::{Glob, GlobMatcher};
use serde::de::{MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use thiserror::Error;

use super::{JitterShape, Link, LinkChange, LinkOverrides, LinkParams};
use crate::units;

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
/// assert_eq!(degrade.outage, Some(true));
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Degrade {
    /// When it begins, from the start of the run.
    #[serde(with = "units::duration")]
    pub at: SimDuration,
    /// When it ends; without, it lasts.
    #[serde(
        default,
        with = "units::duration::option",
        skip_serializing_if = "Option::is_none"
    )]
    pub until: Option<SimDuration>,
    /// The pattern over link names.
    pub links: String,
    /// The latency meanwhile.
    #[serde(
        default,
        with = "units::duration::option",
        skip_serializing_if = "Option::is_none"
    )]
    pub latency: Option<SimDuration>,
    /// The jitter meanwhile.
    #[serde(
        default,
        with = "units::duration::option",
        skip_serializing_if = "Option::is_none"
    )]
    pub jitter: Option<SimDuration>,
    /// The jitter's shape meanwhile.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub jitter_shape: Option<JitterShape>,
    /// The loss meanwhile.
    #[serde(
        default,
        with = "units::fraction::option",
        skip_serializing_if = "Option::is_none"
    )]
    pub loss: Option<f64>,
    /// The duplication meanwhile.
    #[serde(
        default,
        with = "units::fraction::option",
        skip_serializing_if = "Option::is_none"
    )]
    pub duplicate: Option<f64>,
    /// Whether the links are out meanwhile.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outage: Option<bool>,
}

impl Degrade {
    fn overrides(&self) -> LinkOverrides {
        LinkOverrides {
            latency: self.latency,
            jitter: self.jitter,
            jitter_shape: self.jitter_shape,
            least_delay: None,
            loss: self.loss,
            duplicate: self.duplicate,
            outage: self.outage,
        }
    }

    fn is_active(&self, at: SimDuration) -> bool {
        self.at <= at && self.until.is_none_or(|until| at < until)
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
    #[error("{pattern:?} matches no link{}", hint(.nearest.as_deref()))]
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
    /// A degradation that leaves everything as it is.
    #[error(
        "it changes nothing: expected at least one of latency, jitter, jitter_shape, loss, duplicate, outage"
    )]
    ChangesNothing {
        /// Where in the scenario.
        key: Vec<String>,
    },
}

fn hint(nearest: Option<&str>) -> String {
    nearest.map_or_else(String::new, |name| format!("; did you mean {name:?}?"))
}

impl LinkConfigError {
    /// Where in the scenario the mistake is: the keys from the top, entries of arrays by number.
    pub fn key(&self) -> &[String] {
        match self {
            LinkConfigError::BadPattern { key, .. }
            | LinkConfigError::NoSuchLink { key, .. }
            | LinkConfigError::EndsBeforeItBegins { key, .. }
            | LinkConfigError::TooMany { key, .. }
            | LinkConfigError::ChangesNothing { key } => key,
        }
    }
}

/// A pattern, and whether any link has matched it.
struct Pattern {
    key: Vec<String>,
    text: String,
    glob: GlobMatcher,
    used: bool,
}

impl Pattern {
    fn new(key: Vec<String>, text: &str) -> Result<Self, LinkConfigError> {
        match Glob::new(text) {
            Ok(glob) => Ok(Pattern {
                key,
                text: text.to_owned(),
                glob: glob.compile_matcher(),
                used: false,
            }),
            Err(error) => Err(LinkConfigError::BadPattern {
                key,
                pattern: text.to_owned(),
                error: error.kind().to_string(),
            }),
        }
    }

    fn matches(&mut self, name: &str) -> bool {
        let yes = self.glob.is_match(name);
        self.used |= yes;
        yes
    }
}

/// Builds links by name from [`LinksConfig`] and [`Degrade`]s, and checks that every pattern
/// matches some link.
///
/// ```
/// use farside::Simulation;
/// use farside_actors::link::{LinkBuilder, LinksConfig};
/// let links: LinksConfig = toml::from_str("'base-rover_*' = { loss = 0.5 }").unwrap();
/// let mut sim = Simulation::new(1);
/// let (base, rover) = (sim.host("base"), sim.host("rover_1"));
/// let mut builder = LinkBuilder::new(&links, &[])?;
/// builder.connect(&mut sim, (base, "base"), (rover, "rover_1"));
/// builder.finish()?;
///
/// let links: LinksConfig = toml::from_str("'base-rovre_*' = { loss = 0.5 }").unwrap();
/// let mut builder = LinkBuilder::new(&links, &[])?;
/// builder.connect(&mut sim, (base, "base"), (rover, "rover_1"));
/// let error = builder.finish().unwrap_err();
/// assert!(error.to_string().ends_with("matches no link; did you mean \"base-rover_*\"?"));
/// # Ok::<(), farside_actors::link::LinkConfigError>(())
/// ```
pub struct LinkBuilder {
    default: LinkParams,
    overrides: Vec<(Pattern, LinkOverrides)>,
    degrades: Vec<(Pattern, Degrade)>,
    names: Vec<String>,
    /// What links were given before: most of them share a base and the degradations they meet.
    timelines: Vec<Timeline>,
}

/// The changes of all links with one base and one set of degradations.
struct Timeline {
    base: LinkParams,
    /// Indices into the degradations.
    degrades: Vec<usize>,
    changes: Vec<(SimDuration, LinkParams)>,
}

/// The most patterns, and the most degradations.
const MAX_ENTRIES: usize = 1000;

impl LinkBuilder {
    /// A builder for links with these parameters and changes.
    ///
    /// # Errors
    /// When a pattern cannot be read, or a degradation makes no sense by itself.
    pub fn new(links: &LinksConfig, degrades: &[Degrade]) -> Result<Self, LinkConfigError> {
        for (key, actual) in [("links", links.patterns.len()), ("degrade", degrades.len())] {
            // Each is matched with each link's name.
            if actual > MAX_ENTRIES {
                return Err(LinkConfigError::TooMany {
                    key: vec![key.to_owned()],
                    actual,
                    limit: MAX_ENTRIES,
                });
            }
        }
        let mut builder = LinkBuilder {
            default: links.default.clone(),
            overrides: Vec::new(),
            degrades: Vec::new(),
            names: Vec::new(),
            timelines: Vec::new(),
        };
        for (text, over) in &links.patterns {
            let key = vec!["links".to_owned(), text.clone()];
            let pattern = Pattern::new(key, text)?;
            builder.overrides.push((pattern, over.clone()));
        }
        for (index, degrade) in degrades.iter().enumerate() {
            let key = |last: &str| vec!["degrade".to_owned(), index.to_string(), last.to_owned()];
            if let Some(until) = degrade.until.filter(|until| *until <= degrade.at) {
                return Err(LinkConfigError::EndsBeforeItBegins {
                    key: key("until"),
                    at: degrade.at.to_string(),
                    until: until.to_string(),
                });
            }
            if degrade.overrides() == LinkOverrides::default() {
                let key = vec!["degrade".to_owned(), index.to_string()];
                return Err(LinkConfigError::ChangesNothing { key });
            }
            let pattern = Pattern::new(key("links"), &degrade.links)?;
            builder.degrades.push((pattern, degrade.clone()));
        }
        Ok(builder)
    }

    /// Declares the link `{from}-{to}`, and its changes.
    pub fn connect(
        &mut self,
        sim: &mut Simulation,
        (from_host, from): (HostId, &str),
        (to_host, to): (HostId, &str),
    ) -> LinkId<LinkChange> {
        let name = format!("{from}-{to}");
        let mut base = self.default.clone();
        for (pattern, over) in &mut self.overrides {
            if pattern.matches(&name) {
                base = base.with(over);
            }
        }
        let mut degrades = Vec::new();
        for (index, (pattern, _)) in self.degrades.iter_mut().enumerate() {
            if pattern.matches(&name) {
                degrades.push(index);
            }
        }
        let changes = &self.timeline(&base, degrades).changes;
        let link = changes
            .iter()
            .fold(Link::new(base), |link, (_, params)| link.may_become(params));
        let id = sim.link(from_host, to_host, &name, link);
        for (at, params) in changes {
            sim.change_at(SimTime::ZERO + *at, id, params.clone().into());
        }
        self.names.push(name);
        id
    }

    /// What such a link has from each instant on at which a degradation begins or ends.
    fn timeline(&mut self, base: &LinkParams, degrades: Vec<usize>) -> &Timeline {
        let known = |known: &Timeline| known.base == *base && known.degrades == degrades;
        if let Some(at) = self.timelines.iter().position(known) {
            return &self.timelines[at];
        }
        let mine: Vec<(&Degrade, LinkOverrides)> = degrades
            .iter()
            .map(|&index| &self.degrades[index].1)
            .map(|degrade| (degrade, degrade.overrides()))
            .collect();
        let instants: BTreeSet<SimDuration> = mine
            .iter()
            .flat_map(|(degrade, _)| [Some(degrade.at), degrade.until])
            .flatten()
            .collect();
        let params_at = |at: SimDuration| {
            let active = mine.iter().filter(|(degrade, _)| degrade.is_active(at));
            active.fold(base.clone(), |params, (_, over)| params.with(over))
        };
        let changes = instants.into_iter().map(|at| (at, params_at(at))).collect();
        self.timelines.push(Timeline {
            base: base.clone(),
            degrades,
            changes,
        });
        &self.timelines[self.timelines.len() - 1]
    }

    /// Checks that every pattern has matched some link.
    ///
    /// # Errors
    /// When one has not; the error has the nearest name.
    pub fn finish(self) -> Result<(), LinkConfigError> {
        let overrides = self.overrides.iter().map(|(pattern, _)| pattern);
        let degrades = self.degrades.iter().map(|(pattern, _)| pattern);
        match overrides.chain(degrades).find(|pattern| !pattern.used) {
            None => Ok(()),
            Some(unused) => Err(LinkConfigError::NoSuchLink {
                key: unused.key.clone(),
                pattern: unused.text.clone(),
                nearest: self.nearest(unused),
            }),
        }
    }
}

impl LinkBuilder {
    /// The link name, or the pattern that names with other numbers share, closest to a pattern; in
    /// `[links]` it may also have been meant for `default`.
    fn nearest(&self, pattern: &Pattern) -> Option<String> {
        let mut candidates: BTreeSet<String> = self.names.iter().map(|name| shape(name)).collect();
        candidates.extend(self.names.iter().cloned());
        let distance = |name: &str| strsim::damerau_levenshtein(name, &pattern.text);
        // Link names are long and `default` is short, so that anything short is nearer to it: only
        // a slip of the keys counts.
        if pattern.key[0] == "links" && distance("default") <= SLIP {
            candidates.insert("default".to_owned());
        }
        candidates.into_iter().min_by_key(|name| distance(name))
    }
}

/// How many letters a mistyped word may be off.
const SLIP: usize = 3;

/// The name with `*` for each run of digits.
fn shape(name: &str) -> String {
    let mut shape = String::with_capacity(name.len());
    for c in name.chars() {
        if !c.is_ascii_digit() {
            shape.push(c);
        } else if !shape.ends_with('*') {
            shape.push('*');
        }
    }
    shape
}
