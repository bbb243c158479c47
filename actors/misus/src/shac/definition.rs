//! Shared activities and protocols as data: what a TOML file says of them.
//!
//! A protocol is a choice of values for a few keys: how the next owner is chosen, with which lease,
//! when a goal may be taken away. It is no table of messages and transitions, because those are what
//! keeps goals safe on bad links, and no file may break that.

use std::collections::BTreeMap;

use farside::SimDuration;
use farside::suggest;
use farside_actors::units;
use serde::{Deserialize, Serialize};
use thiserror::Error;
use toml::Spanned;

const BUILTIN: &str = include_str!("builtin.toml");

/// Shared activities and protocols by name.
///
/// ```
/// use farside_misus::shac::{Chooser, Definitions};
/// let mut definitions = Definitions::builtin();
/// definitions.read("mine.toml", r#"
///     [protocol.in-turn]
///     chooser = "least-loaded"
///     lease = "2h"
///     reassign = "lease"
/// "#)?;
/// assert_eq!(definitions.protocol("in-turn")?.chooser, Chooser::LeastLoaded);
/// let error = definitions.protocol("markt").unwrap_err();
/// assert!(error.to_string().ends_with("did you mean \"market\"?"), "{error}");
/// # Ok::<(), farside_misus::shac::DefinitionError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Definitions {
    protocols: BTreeMap<String, Protocol>,
    activities: BTreeMap<String, SharedActivity>,
}

/// How goals change hands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct Protocol {
    /// How the next owner is chosen.
    pub chooser: Chooser,
    /// For how long an owner may start the goal, from the grant on; for ever if not given.
    #[serde(default, with = "units::duration::option")]
    pub lease: Option<SimDuration>,
    /// Whether a lease is prolonged while its owner is heard from.
    #[serde(default)]
    pub renewed: bool,
    /// When a goal is handed out again whose owner does not answer.
    pub reassign: Reassign,
    /// Whether the central planner may take back a goal that has not started.
    #[serde(default)]
    pub revocable: bool,
    /// For how long bids are waited for; with `chooser = "best-bid"` only.
    #[serde(default, with = "units::duration::option")]
    pub bids_for: Option<SimDuration>,
    /// How often all rovers refuse a goal until it is declared unachievable; without limit if not
    /// given.
    #[serde(default)]
    pub give_up_after: Option<u32>,
}

/// How the next owner of a goal is chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Chooser {
    /// By the central planner, which calls [`Centre::assign`](super::Centre::assign).
    Planner,
    /// The rover that bids the highest score.
    BestBid,
    /// The rover that owns the fewest goals.
    LeastLoaded,
}

/// When a goal is handed out again whose owner does not answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reassign {
    /// Never: no goal is achieved twice, and those of a rover that is lost are lost with it.
    Never,
    /// At the lease's end and a guard: an owner that had started it may achieve it a second time.
    Lease,
}

/// Who sets parameters. All other rovers observe.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// Hands goals out.
    Centre,
    /// Has accepted the goal.
    Owner,
}

/// How far a goal is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stage {
    /// Nobody owns it.
    Pooled,
    /// It was granted, and has not started as far as is known.
    Owned,
    /// It has started.
    Started,
}

/// A parameter of a shared activity, see [`Parameters`](super::Parameters).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Parameter {
    /// Where it takes place.
    Target,
    /// How long it takes.
    Duration,
    /// The earliest start.
    Start,
    /// What it stores.
    Memory,
    /// When it is planned to start.
    Scheduled,
    /// What it is worth.
    Weight,
}

impl Parameter {
    /// All parameters.
    pub const ALL: [Parameter; 6] = [
        Parameter::Target,
        Parameter::Duration,
        Parameter::Start,
        Parameter::Memory,
        Parameter::Scheduled,
        Parameter::Weight,
    ];
}

/// That a role may set a parameter at some stages.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Permission {
    /// Who.
    pub role: Role,
    /// When.
    pub stages: Vec<Stage>,
}

/// An activity that several planners share.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SharedActivity {
    /// The name of the protocol by which it changes hands.
    pub protocol: String,
    /// Who may set which parameter, and when. What is not named nobody sets after the goal was added.
    #[serde(default)]
    pub parameters: BTreeMap<Parameter, Vec<Permission>>,
}

impl SharedActivity {
    /// Whether a role may set a parameter of a goal that is so far.
    ///
    /// ```
    /// use farside_misus::shac::{Definitions, Parameter, Role, Stage};
    /// let definitions = Definitions::builtin();
    /// let observation = definitions.activity("observation")?;
    /// assert!(observation.may_set(Role::Owner, Parameter::Scheduled, Stage::Owned));
    /// assert!(!observation.may_set(Role::Owner, Parameter::Target, Stage::Owned));
    /// # Ok::<(), farside_misus::shac::DefinitionError>(())
    /// ```
    pub fn may_set(&self, role: Role, parameter: Parameter, stage: Stage) -> bool {
        let permissions = self
            .parameters
            .get(&parameter)
            .map_or(&[][..], Vec::as_slice);
        permissions
            .iter()
            .any(|permission| permission.role == role && permission.stages.contains(&stage))
    }
}

/// What is wrong with a file of definitions.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum DefinitionError {
    /// It is no TOML, or a key is unknown, missing or of the wrong type.
    #[error("{file}: {message}")]
    Syntax {
        /// Which file.
        file: String,
        /// What the reader says, with line and column.
        message: String,
    },
    /// Keys that do not go together.
    #[error("{file}, line {line}: {what} \"{name}\": {expected}")]
    Contradiction {
        /// Which file.
        file: String,
        /// Where the table begins, from 1.
        line: usize,
        /// `protocol` or `activity`.
        what: &'static str,
        /// Its name.
        name: String,
        /// What is found and what was expected.
        expected: String,
    },
    /// There is none of that name.
    #[error("no {what} \"{name}\"{nearest}")]
    Unknown {
        /// `protocol` or `activity`.
        what: &'static str,
        /// The name.
        name: String,
        /// The nearest name that there is, as a question.
        nearest: String,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    protocol: BTreeMap<String, Spanned<Protocol>>,
    #[serde(default)]
    activity: BTreeMap<String, Spanned<SharedActivity>>,
}

impl Definitions {
    /// What is built in: the protocols `assign-and-release`, `lease` and `market`, and the activity
    /// `observation`.
    pub fn builtin() -> Definitions {
        let mut definitions = Definitions {
            protocols: BTreeMap::new(),
            activities: BTreeMap::new(),
        };
        let read = definitions.read("builtin.toml", BUILTIN);
        read.expect("a test reads what is built in");
        definitions
    }

    /// Adds what a file defines. A name that is taken gets the new meaning.
    ///
    /// # Errors
    /// When the text is no TOML, keys are unknown or missing or do not go together, or an activity
    /// names a protocol that there is not. Nothing is added then.
    pub fn read(&mut self, file: &str, text: &str) -> Result<(), DefinitionError> {
        let parsed: File = toml::from_str(text).map_err(|error| DefinitionError::Syntax {
            file: file.to_owned(),
            message: error.to_string().trim_end().to_owned(),
        })?;
        let contradiction = |what, name: &String, at: usize, expected| {
            let line = text[..at.min(text.len())].matches('\n').count() + 1;
            let (file, name) = (file.to_owned(), name.clone());
            DefinitionError::Contradiction {
                file,
                line,
                what,
                name,
                expected,
            }
        };
        let mut all = self.clone();
        for (name, protocol) in parsed.protocol {
            let at = protocol.span().start;
            let protocol = protocol.into_inner();
            let checked = protocol.check();
            checked.map_err(|expected| contradiction("protocol", &name, at, expected))?;
            all.protocols.insert(name, protocol);
        }
        for (name, activity) in parsed.activity {
            let at = activity.span().start;
            let activity = activity.into_inner();
            let known = all.protocol(&activity.protocol);
            known.map_err(|error| contradiction("activity", &name, at, error.to_string()))?;
            all.activities.insert(name, activity);
        }
        *self = all;
        Ok(())
    }

    /// The protocol of a name.
    ///
    /// # Errors
    /// When there is none; the error names the nearest.
    pub fn protocol(&self, name: &str) -> Result<&Protocol, DefinitionError> {
        let found = self.protocols.get(name);
        found.ok_or_else(|| unknown("protocol", name, self.protocols.keys()))
    }

    /// The activity of a name.
    ///
    /// # Errors
    /// When there is none; the error names the nearest.
    pub fn activity(&self, name: &str) -> Result<&SharedActivity, DefinitionError> {
        let found = self.activities.get(name);
        found.ok_or_else(|| unknown("activity", name, self.activities.keys()))
    }
}

fn unknown<'a>(
    what: &'static str,
    name: &str,
    names: impl Iterator<Item = &'a String>,
) -> DefinitionError {
    let nearest = suggest::nearest(name, names.map(String::as_str));
    let nearest = suggest::did_you_mean(nearest.as_deref());
    let name = name.to_owned();
    DefinitionError::Unknown {
        what,
        name,
        nearest,
    }
}

impl Protocol {
    /// What does not go together, if anything.
    fn check(&self) -> Result<(), String> {
        if self.lease.is_some_and(SimDuration::is_zero) {
            return Err("lease = \"0s\": expected a lease over 0".to_owned());
        }
        if self.lease.is_none() && self.reassign == Reassign::Lease {
            return Err("reassign = \"lease\" without a lease: expected a key `lease`".to_owned());
        }
        if self.lease.is_none() && self.renewed {
            return Err("renewed = true without a lease: expected a key `lease`".to_owned());
        }
        let takes_bids = self.chooser == Chooser::BestBid;
        match self.bids_for {
            None if takes_bids => {
                Err("chooser = \"best-bid\": expected a key `bids_for`".to_owned())
            }
            Some(_) if !takes_bids => {
                Err("bids_for: expected with chooser = \"best-bid\" only".to_owned())
            }
            Some(time) if time.is_zero() => {
                Err("bids_for = \"0s\": expected a time over 0".to_owned())
            }
            _ if self.give_up_after == Some(0) => {
                Err("give_up_after = 0: expected at least 1, or no such key".to_owned())
            }
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests;
