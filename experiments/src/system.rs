//! Systems: what a scenario can run. The network-guided one and open-loop traffic are built in; a
//! binary of your own registers its own and calls the same command line.
//!
//! ```no_run
//! use farside_experiments::{cli, system::Registry};
//!
//! fn main() -> std::process::ExitCode {
//!     cli::main(Registry::builtin()) // .with(MySystem)
//! }
//! ```
//!
//! `experiments/examples/own_system.rs` is such a binary, whole.

mod files;
mod series;

use farside::{Report, SimDuration, Simulation};
use farside_actors::link::{LinkBuilder, LinkConfigError};
use farside_logs::Scene;
use serde_json::{Map, Value};
use thiserror::Error;

use crate::picture::Site;
use crate::scenario::nearest;
pub use files::Files;
pub use series::{Series, SeriesError, SeriesMetric};

/// A kind of system: reads its own tables of a scenario.
pub trait System: Send + Sync {
    /// The name that scenarios give as `system`.
    fn name(&self) -> &str;

    /// The top-level keys of a scenario that this system reads, besides those all systems share.
    fn sections(&self) -> &[&str];

    /// The metrics of its runs that are curves ([`Series`]), with what their index is.
    fn series(&self) -> &[SeriesMetric] {
        &[]
    }

    /// Reads those keys; `T::deserialize(sections)` of a serde type is all it takes.
    ///
    /// # Errors
    /// Those of serde; they become messages with file, line and column.
    fn parse(&self, sections: toml::Deserializer<'_>)
    -> Result<Box<dyn Settings>, toml::de::Error>;
}

/// The settings of one scenario for one system. Several threads may build from them at once.
pub trait Settings: Send + Sync {
    /// The same keys again, defaults filled in.
    ///
    /// # Errors
    /// When a value cannot be written as TOML.
    fn resolved(&self) -> Result<toml::Table, toml::ser::Error>;

    /// Declares hosts, actors and links; returns what tells the results once the run is over.
    ///
    /// # Errors
    /// When the settings cannot be; the error names the key.
    fn assemble(&self, setup: &mut Setup<'_>) -> Result<Conclude, SetupError>;

    /// Where a run of the problem with this seed takes place, if on a roadmap of which pictures can
    /// be drawn.
    ///
    /// # Errors
    /// Those of [`Settings::assemble`].
    fn site(&self, _problem_seed: u64, _files: &mut Files) -> Result<Option<Site>, SetupError> {
        Ok(None)
    }
}

/// What a system builds from.
pub struct Setup<'a> {
    /// What worlds, teams and goals are drawn from. Runs that share it share their problem; the
    /// run's seed unless a scenario or a study's blocks say otherwise.
    pub problem_seed: u64,
    /// The run's own seed, which links, crashes and actors draw from.
    pub run_seed: u64,
    /// When the run stops at the latest, if the scenario says.
    pub until: Option<SimDuration>,
    /// The simulation to fill.
    pub sim: &'a mut Simulation,
    /// Builds links as the scenario has them.
    pub links: &'a mut LinkBuilder,
    /// Reads the files that the scenario names.
    pub files: &'a mut Files,
    /// What the run is to achieve, for a progress bar; a system that knows sets it.
    pub goal: Option<Goal>,
    /// Draws the run for viewers; a system that can sets it.
    pub scene: Option<Box<dyn Scene>>,
    /// What people may want to know of the world that is built, a line at a time.
    pub notes: Vec<String>,
}

/// What a run is to achieve, in units that can be counted while it lasts.
pub struct Goal {
    /// What is counted: `rovers arrived`.
    pub what: &'static str,
    /// How many there are.
    pub of: u64,
    /// How many are done. Asked many times a second.
    pub done: Box<dyn Fn() -> u64 + Send>,
}

/// Tells what came of a run.
pub type Conclude = Box<dyn FnOnce(&Report) -> Results>;

/// What came of a run, beyond what the kernel counts.
#[derive(Clone, Debug, Default)]
pub struct Results {
    /// Figures for programs; names carry units. A curve is a [`Series`], turned into JSON.
    pub metrics: Map<String, Value>,
    /// The same for people: lines of a table.
    pub summary: Vec<(String, String)>,
    /// What must never happen and did: a collision. Any makes the command exit with 1.
    pub violations: Vec<String>,
}

/// Settings that cannot be.
#[derive(Debug, Error)]
pub enum SetupError {
    /// Links or degradations.
    #[error(transparent)]
    Links(#[from] LinkConfigError),
    /// A value of the system's own.
    #[error("{key}: {message}")]
    Value {
        /// The dotted key.
        key: String,
        /// What was found and what was expected.
        message: String,
    },
}

impl SetupError {
    /// A value that cannot be, by its dotted key.
    ///
    /// ```
    /// use farside_experiments::system::SetupError;
    /// let error = SetupError::value("team.rovers", "0: expected at least 1");
    /// assert_eq!(error.to_string(), "team.rovers: 0: expected at least 1");
    /// ```
    pub fn value(key: &str, message: impl ToString) -> Self {
        SetupError::Value {
            key: key.to_owned(),
            message: message.to_string(),
        }
    }

    pub(crate) fn into_parts(self) -> (Vec<String>, String) {
        match self {
            SetupError::Links(error) => (error.key().to_vec(), error.to_string()),
            SetupError::Value { key, message } => {
                (key.split('.').map(str::to_owned).collect(), message)
            }
        }
    }
}

/// The systems that a binary knows.
///
/// ```
/// use farside_experiments::system::Registry;
/// assert_eq!(Registry::builtin().find("network").unwrap().name(), "network");
/// ```
pub struct Registry {
    systems: Vec<Box<dyn System>>,
}

/// No system has the name.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("unknown system {found:?}: expected {expected}")]
pub struct UnknownSystem {
    /// The name.
    pub found: String,
    /// The system's name closest to it.
    pub nearest: Option<String>,
    /// All names.
    pub expected: String,
}

impl Registry {
    /// Knows no system.
    pub fn empty() -> Self {
        Registry {
            systems: Vec::new(),
        }
    }

    /// Knows the systems that are built in.
    pub fn builtin() -> Self {
        Registry::empty()
            .with(network::Network)
            .with(traffic::Traffic)
    }

    /// Knows `system` too; of two with one name, the later one.
    #[must_use]
    pub fn with(mut self, system: impl System + 'static) -> Self {
        self.systems.retain(|known| known.name() != system.name());
        self.systems.push(Box::new(system));
        self
    }

    /// The system called `name`.
    ///
    /// # Errors
    /// When there is none.
    pub fn find(&self, name: &str) -> Result<&dyn System, UnknownSystem> {
        let found = self.systems.iter().find(|system| system.name() == name);
        found.map(Box::as_ref).ok_or_else(|| {
            let names: Vec<&str> = self.systems.iter().map(|system| system.name()).collect();
            UnknownSystem {
                found: name.to_owned(),
                nearest: nearest(name, names.iter().copied()),
                expected: format!("one of {}", names.join(", ")),
            }
        })
    }
}

mod network;
mod traffic;
