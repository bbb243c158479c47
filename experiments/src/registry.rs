//! The systems that a program knows: those that are built in, and those that a user adds. This is
//! the only file here that names a system.
//!
//! ```no_run
//! use farside_experiments::{cli, registry::Registry};
//!
//! fn main() -> std::process::ExitCode {
//!     cli::main(Registry::builtin()) // .with(MySystem).named("mine", env!("CARGO_PKG_VERSION"))
//! }
//! ```
//!
//! `experiments/examples/own_system.rs` is such a binary, whole.

use farside::suggest::nearest;
use farside_actors::system::{Builtin, Metric, System};
use farside_idea::IdeaSystem;
use farside_misus::{MisusSystem, PlanningSystem, SurveySystem};
use farside_network::NetworkSystem;
use farside_traffic::TrafficSystem;
use thiserror::Error;

use crate::version::CODE_VERSION;

/// The systems that a binary knows.
///
/// ```
/// use farside_experiments::registry::Registry;
/// let registry = Registry::builtin();
/// assert_eq!(registry.find("network").unwrap().name(), "network");
/// assert!(registry.scenario("network/crater-dense").unwrap().contains("rovers = 50"));
/// assert!(registry.study("degradation/loss").unwrap().contains("links.default.loss"));
/// assert_eq!(registry.scenario("network/moon"), None);
/// ```
pub struct Registry {
    systems: Vec<Box<dyn System>>,
    program: Program,
}

/// The binary that knows these systems.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Program {
    name: &'static str,
    version: &'static str,
}

/// Farside's own.
const FARSIDE: Program = Program {
    name: "farside",
    version: CODE_VERSION,
};

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
            program: FARSIDE,
        }
    }

    /// What the binary is called and its version, if it is not `farside` itself: in its help, its
    /// completions, what `--version` says, and in the logs and results that it writes.
    ///
    /// ```
    /// use farside_experiments::registry::Registry;
    /// let cave = Registry::builtin().named("cave", "3.1.4");
    /// assert_eq!(cave.program(), "cave");
    /// assert!(cave.version().starts_with("cave 3.1.4 (farside "));
    /// ```
    #[must_use]
    pub fn named(mut self, name: &'static str, version: &'static str) -> Self {
        self.program = Program { name, version };
        self
    }

    /// What the binary is called.
    pub fn program(&self) -> &'static str {
        self.program.name
    }

    /// The version that logs and results are stamped with: Farside's, and of another binary its
    /// name and version before that.
    pub fn version(&self) -> String {
        match &self.program {
            farside if *farside == FARSIDE => CODE_VERSION.to_owned(),
            Program { name, version } => format!("{name} {version} (farside {CODE_VERSION})"),
        }
    }

    /// Knows the systems that are built in.
    pub fn builtin() -> Self {
        Registry::empty()
            .with(NetworkSystem)
            .with(IdeaSystem)
            .with(MisusSystem)
            .with(PlanningSystem)
            .with(SurveySystem)
            .with(TrafficSystem)
    }

    /// Knows `system` too; of two with one name, the later one.
    #[must_use]
    pub fn with(mut self, system: impl System + 'static) -> Self {
        self.systems.retain(|known| known.name() != system.name());
        self.systems.push(Box::new(system));
        self
    }

    /// All systems, in the order in which they were added.
    pub fn systems(&self) -> impl Iterator<Item = &dyn System> {
        self.systems.iter().map(Box::as_ref)
    }

    /// The system called `name`.
    ///
    /// # Errors
    /// When there is none.
    pub fn find(&self, name: &str) -> Result<&dyn System, UnknownSystem> {
        let found = self.systems().find(|system| system.name() == name);
        found.ok_or_else(|| {
            let names: Vec<&str> = self.systems().map(System::name).collect();
            UnknownSystem {
                found: name.to_owned(),
                nearest: nearest(name, names.iter().copied()),
                expected: format!("one of {}", names.join(", ")),
            }
        })
    }

    /// All built-in scenarios, sorted by name.
    pub fn scenarios(&self) -> Vec<Builtin> {
        sorted(self.systems().flat_map(System::scenarios))
    }

    /// Their names.
    pub fn scenario_names(&self) -> Vec<&'static str> {
        self.scenarios().iter().map(|one| one.name).collect()
    }

    /// The text of a built-in scenario.
    pub fn scenario(&self, name: &str) -> Option<&'static str> {
        Builtin::find(&self.scenarios(), name).map(|one| one.text)
    }

    /// All built-in studies, sorted by name.
    pub fn studies(&self) -> Vec<Builtin> {
        sorted(self.systems().flat_map(System::studies))
    }

    /// Their names.
    pub fn study_names(&self) -> Vec<&'static str> {
        self.studies().iter().map(|one| one.name).collect()
    }

    /// The text of a built-in study.
    pub fn study(&self, name: &str) -> Option<&'static str> {
        Builtin::find(&self.studies(), name).map(|one| one.text)
    }

    /// What a system says of a metric, if the system is known and has it.
    pub fn metric(&self, system: &str, name: &str) -> Option<&Metric> {
        let system = self.systems().find(|known| known.name() == system)?;
        system.metrics().iter().find(|metric| metric.name == name)
    }
}

fn sorted<'a>(builtin: impl Iterator<Item = &'a Builtin>) -> Vec<Builtin> {
    let mut all: Vec<Builtin> = builtin.copied().collect();
    all.sort_unstable_by_key(|one| one.name);
    all
}
