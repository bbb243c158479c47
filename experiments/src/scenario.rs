//! Scenarios: TOML files that say which system runs, in which world, over which links.
//!
//! The keys that every system shares are read here; `[world]`, `[team]` and whatever else a system
//! has of its own are read by the system ([`farside_actors::system::System`]). A mistake is one
//! message with its place, what was found, what was expected and the nearest valid name.

mod blame;
pub(crate) mod condition;
pub mod contacts;
mod crash;
mod error;
mod file;
mod fork;
mod location;
mod parts;
mod planned;
mod reference;
mod rulings;
mod seeds;
mod source;
mod without_run;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use farside::suggest::nearest;
use farside::{End, Report, SimDuration, SimTime, Simulation};
use farside_actors::link::{Degrade, LinksConfig, Timeline};
use farside_actors::radio::RadioConfig;
use farside_actors::system::{Assembly, Files, Seeds, Settings, Setup, SetupError};
use farside_actors::wiring::LinkBuilder;
use farside_actors::{settings, units};
use nalgebra::Point3;
use serde::{Deserialize, Serialize};

use crate::registry::Registry;
pub use condition::Forbidden;
use contacts::{ContactsConfig, LinkContacts};
pub use crash::Crash;
pub use error::ScenarioError;
pub(crate) use file::{read, stem};
use fork::Changed;
pub use fork::Fork;
pub(crate) use fork::check_replay;
pub use location::SourceLocation;
use parts::{part, roots, system_name};
pub use planned::{Never, Planned};
pub use reference::shared_sections;
pub use rulings::{Deliver, Lose, Postpone};
pub(crate) use source::Source;

settings! {
    /// What every scenario has, whatever its system.
    pub struct Shared {
        /// The name of the system that runs.
        pub system: String;
        /// One line about the scenario.
        pub description: String [skip_serializing_if = "String::is_empty"];
        /// The run's seed. TOML's integers are signed, so it has 63 bits.
        pub seed: u64;
        /// What the problem is drawn from, where several runs are to share one: the world, the
        /// team, the goals, as the system says. The run's seed unless given.
        pub problem_seed: Option<u64> [skip_serializing_if = "Option::is_none"];
        /// Shuffles what happens at one instant, to see whether a result hangs on its order.
        /// Without, the order is that of the actors' names.
        pub tie_seed: Option<u64> [skip_serializing_if = "Option::is_none"];
        /// When the run stops, if the system does not stop it sooner.
        pub until: Option<SimDuration>
            [with = "units::duration::option", skip_serializing_if = "Option::is_none"];
        /// A contact plan that says when the links of its hosts are there.
        pub contacts: Option<ContactsConfig> [skip_serializing_if = "Option::is_none"];
        /// The parameters of the links: `[links.default]`, and a table for each pattern over links'
        /// names, which are `{from}-{to}`.
        pub links: LinksConfig;
        /// The radios that links may go through, by name.
        pub radios: BTreeMap<String, RadioConfig> [skip_serializing_if = "BTreeMap::is_empty"];
        /// Where hosts stand at first, where the system does not say: x east, y north, z up.
        pub places: BTreeMap<String, [Coordinate; 3]>
            [skip_serializing_if = "BTreeMap::is_empty"];
        /// When links are worse.
        pub degrade: Vec<Degrade> [skip_serializing_if = "Vec::is_empty"];
        /// When actors crash.
        pub crash: Vec<Crash> [skip_serializing_if = "Vec::is_empty"];
        /// Messages that are lost, whatever their links decide.
        pub lose: Vec<Lose> [skip_serializing_if = "Vec::is_empty"];
        /// Messages that arrive, whatever their links decide.
        pub deliver: Vec<Deliver> [skip_serializing_if = "Vec::is_empty"];
        /// Messages that arrive later than their links decide.
        pub postpone: Vec<Postpone> [skip_serializing_if = "Vec::is_empty"];
        /// Other settings from an instant on.
        pub fork: Vec<Fork> [skip_serializing_if = "Vec::is_empty"];
        /// What must never happen, whatever else does: invariants of the system by name, or conditions
        /// over its metrics, as in `arrived<rovers`. A run in which it does is a violated one.
        pub never: Vec<String> [skip_serializing_if = "Vec::is_empty"];
        /// What the log holds.
        pub log: LogSettings;
    }
}

/// A coordinate as scenarios write it, in metres: a length that may be negative.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Coordinate(pub f64);

impl TryFrom<String> for Coordinate {
    type Error = units::UnitError;

    fn try_from(text: String) -> Result<Self, units::UnitError> {
        match text.trim_start().strip_prefix('-') {
            Some(rest) => units::parse_length_m(rest).map(|length_m| Coordinate(-length_m)),
            None => units::parse_length_m(&text).map(Coordinate),
        }
    }
}

impl From<Coordinate> for String {
    fn from(coordinate: Coordinate) -> String {
        let sign = if coordinate.0 < 0.0 { "-" } else { "" };
        format!("{sign}{}", units::print_length_m(coordinate.0.abs()))
    }
}

settings! {
    /// The `[log]` table.
    pub struct LogSettings {
        /// Topics that are not written, as globs; `*` does not match `/`, `**` does.
        pub exclude: Vec<String>;
        /// Whether the log holds what viewers draw: `/tf`, `/scene`, `/poses/...`, `/log`.
        pub viewer: bool = true;
    }
}

/// A scenario, read and resolved.
pub struct Scenario {
    name: String,
    shared: Shared,
    settings: Box<dyn Settings>,
    source: Source,
    files: Files,
    /// What must never happen.
    forbidden: Vec<Forbidden>,
    /// What holds from each of its forks on.
    changed: Vec<Changed>,
}

/// A simulation built from a scenario, ready to run.
pub struct Assembled {
    /// The simulation.
    pub sim: Simulation,
    /// What the system made: its results, its goal, its scene; its notes are in `notes`.
    pub system: Assembly,
    /// The files that were read, for the log.
    pub files: Files,
    /// The contacts of its links, if the scenario has a plan.
    pub contacts: Option<LinkContacts>,
    /// What became of the files that other programs wrote, and of the world, a line at a time, for
    /// people.
    pub notes: Vec<String>,
    /// What the scenario says that has no effect or is called otherwise now, for people.
    pub remarks: Vec<String>,
    /// What is planned for instants of the run, to ask afterwards what of it was never reached.
    pub planned: Planned,
}

/// The links of a scenario, before hosts are known, and what was read for them.
struct DeclaredLinks {
    links: LinkBuilder,
    contacts: Option<LinkContacts>,
    notes: Vec<String>,
}

impl Scenario {
    /// Reads a built-in scenario or a file, with `--set` arguments laid over it.
    ///
    /// ```
    /// use farside_experiments::{registry::Registry, scenario::Scenario};
    /// let sets = ["team.rovers=5".to_owned(), "links.default.loss=30%".to_owned()];
    /// let scenario = Scenario::open("network/crater-dense", &sets, &Registry::builtin())?;
    /// assert_eq!(scenario.shared().links.default.loss, 0.3);
    /// # Ok::<(), farside_experiments::scenario::ScenarioError>(())
    /// ```
    ///
    /// # Errors
    /// When it cannot be found or read, or is wrong.
    pub fn open(
        scenario: &str,
        sets: &[String],
        registry: &Registry,
    ) -> Result<Scenario, ScenarioError> {
        if let Some(text) = registry.scenario(scenario) {
            let files = Files::on_disk(PathBuf::new());
            return Self::parse(scenario, text.to_owned(), sets, registry, files);
        }
        let path = Path::new(scenario);
        let text = read(path, || {
            let names = registry.scenario_names();
            ScenarioError::NotFound {
                found: scenario.to_owned(),
                nearest: nearest(scenario, names.iter().copied()),
                known: names.join(", "),
            }
        })?;
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        Self::parse(scenario, text, sets, registry, Files::on_disk(folder))
    }

    /// Reads a scenario's text; `name` is what messages call it.
    ///
    /// # Errors
    /// When it is wrong.
    pub fn parse(
        name: &str,
        text: String,
        sets: &[String],
        registry: &Registry,
        files: Files,
    ) -> Result<Scenario, ScenarioError> {
        let mut source = Source::new(name, text.clone(), sets)?;
        let system = {
            let document = source.document()?;
            let system = registry.find(&system_name(&source, document.get_ref())?);
            system.map_err(|unknown| ScenarioError::UnknownValue {
                place: source.place_of_key(&["system".to_owned()]),
                key: "system".to_owned(),
                found: unknown.found,
                nearest: unknown.nearest,
                expected: unknown.expected,
            })?
        };
        source.rename(system.renamed())?;
        let (shared, settings) = {
            let document = source.document()?;
            let (shared, own) = part(&source, document, &roots(system))?;
            let shared = Shared::deserialize(toml::Deserializer::from(shared));
            let settings = system.parse(toml::Deserializer::from(own));
            (
                shared.map_err(|error| ScenarioError::from_toml(&source, &error))?,
                settings.map_err(|error| ScenarioError::from_toml(&source, &error))?,
            )
        };
        let mut scenario = Scenario {
            name: if registry.scenario(name).is_some() {
                name.to_owned()
            } else {
                stem(name)
            },
            shared,
            settings,
            source,
            files,
            forbidden: Vec::new(),
            changed: Vec::new(),
        };
        let checked = scenario.settings.check();
        checked.map_err(|error| ScenarioError::from_setup(&scenario.source, error))?;
        scenario.check_crashes()?;
        scenario.read_never(system)?;
        rulings::check(&scenario.shared)
            .map_err(|mistake| scenario.invalid(mistake.key, mistake.message))?;
        scenario.read_forks(&text, sets, registry)?;
        Ok(scenario)
    }

    /// The scenario under another name, as the log of a run has it.
    #[must_use]
    pub fn named(mut self, name: &str) -> Self {
        self.name = name.to_owned();
        self
    }

    /// The built-in name, or the file's name without its ending.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The keys that every system shares.
    pub fn shared(&self) -> &Shared {
        &self.shared
    }

    /// Which of its keys are called otherwise now, for people.
    pub(crate) fn renamed_remarks(&self) -> impl Iterator<Item = String> + '_ {
        self.source.remarks()
    }

    /// Which of its entries about single messages met none, or changed nothing, for people.
    pub(crate) fn unmet_rulings(&self, report: &Report) -> Vec<String> {
        rulings::remarks(&self.shared, report)
    }

    /// Where it reads files.
    pub(crate) fn files(&self) -> &Files {
        &self.files
    }

    /// Knows `files` from now on, and reads no other.
    pub(crate) fn keep_files(&mut self, files: Files) {
        self.files = files;
    }

    /// Replaces the end, as `--until` does.
    pub fn set_until(&mut self, until: SimDuration) {
        self.shared.until = Some(until);
        for changed in &mut self.changed {
            changed.set_until(until);
        }
    }

    /// The scenario with everything that was left to defaults filled in, as TOML. Read again, it
    /// gives the same run.
    ///
    /// # Errors
    /// When a setting cannot be written as TOML.
    pub fn resolved(&self) -> Result<String, ScenarioError> {
        let unwritable = |error: toml::ser::Error| ScenarioError::Unwritable {
            message: error.to_string(),
        };
        let mut table = toml::Table::try_from(&self.shared).map_err(unwritable)?;
        let own = self.settings.resolved().map_err(unwritable)?;
        let mut all = toml::Table::new();
        // Plain values first; then the system's tables, and the shared ones after them.
        let shared_tables = table.split_tables();
        all.extend(table);
        all.extend(own);
        all.extend(shared_tables);
        toml::to_string(&all).map_err(unwritable)
    }

    /// The same, as it is from its last fork on.
    ///
    /// # Errors
    /// Those of [`Scenario::resolved`].
    pub(crate) fn last_resolved(&self) -> Result<String, ScenarioError> {
        let shared = self.changed.last().map_or(&self.shared, Changed::shared);
        toml::to_string(shared).map_err(|error| ScenarioError::Unwritable {
            message: error.to_string(),
        })
    }

    /// The degradations as they are from its last fork on.
    pub(crate) fn last_degrades(&self) -> &[Degrade] {
        &self
            .changed
            .last()
            .map_or(&self.shared, Changed::shared)
            .degrade
    }

    /// Builds the simulation.
    ///
    /// # Errors
    /// When the settings cannot be: more nodes than vertices, a pattern that matches no link, a
    /// crash of an actor that does not exist.
    pub fn assemble(&self) -> Result<Assembled, ScenarioError> {
        self.assemble_seeded(self.seeds())
    }

    /// Builds the simulation with other seeds than the scenario's, as studies do.
    ///
    /// # Errors
    /// Those of [`Scenario::assemble`].
    pub fn assemble_seeded(&self, seeds: Seeds) -> Result<Assembled, ScenarioError> {
        let seed = seeds.run;
        let wrong = |error: SetupError| ScenarioError::from_setup(&self.source, error);
        let mut sim = Simulation::new(seed);
        sim.tie_seed(self.shared.tie_seed);
        let mut files = self.files.clone();
        let declared = self.links(&mut files).map_err(wrong)?;
        let DeclaredLinks {
            links,
            contacts,
            mut notes,
        } = declared;
        let mut setup = Setup::new(seeds, self.until(), &mut sim, &mut files, links);
        let mut system = self.settings.assemble(&mut setup).map_err(wrong)?;
        self.forbid(&mut system);
        let remarks = setup.close().map_err(|error| wrong(error.into()))?;
        notes.append(&mut system.notes);
        self.check_places(&sim)?;
        let mut planned = self.planned(&sim, contacts.as_ref());
        for (key, at) in std::mem::take(&mut system.planned) {
            planned.add(key, "begins", None, vec![at]);
        }
        if let Some(contacts) = &contacts {
            contacts.check_hosts(&sim).map_err(wrong)?;
            notes.extend(contacts.notes(&sim));
        }
        for (shared, from, until) in self.eras() {
            for (index, crash) in shared.crash.iter().enumerate() {
                let times = crash.plan(&mut sim, seed, index, self.until(), (from, until));
                let times = times.map_err(|mistake| self.crash_error(index, mistake))?;
                let each = |what| (!crash.goes_on()).then_some(what);
                planned.add(format!("crash.{index}"), "is", each("crashes"), times.down);
                let key = format!("crash.{index}.restart");
                planned.add(key, "is", each("restarts"), times.up);
            }
        }
        self.rebuild(&mut sim, seeds)?;
        rulings::declare(&self.shared, &mut sim);
        let remarks = remarks
            .into_iter()
            .chain(planned.behind_until())
            .chain(self.source.remarks())
            .chain(contacts.iter().flat_map(LinkContacts::remarks))
            .collect();
        if let Some(until) = self.until() {
            sim.stop_at(SimTime::ZERO + until, &reason_of(until));
        }
        Ok(Assembled {
            sim,
            system,
            files,
            contacts,
            notes,
            remarks,
            planned,
        })
    }

    /// What the link from one host to another has when.
    ///
    /// # Errors
    /// When links make no sense, or a file cannot be read.
    pub(crate) fn link_between(
        &self,
        from: &str,
        to: &str,
    ) -> Result<Arc<Timeline>, ScenarioError> {
        let declared = self.links(&mut self.files.clone());
        let declared = declared.map_err(|error| ScenarioError::from_setup(&self.source, error));
        Ok(declared?.links.between(from, to))
    }

    /// The links as the scenario has them, before hosts are known.
    fn links(&self, files: &mut Files) -> Result<DeclaredLinks, SetupError> {
        let mut links = LinkBuilder::new(&self.shared.links, &self.shared.degrade)?;
        for (index, changed) in self.changed.iter().enumerate() {
            links.change_from(changed.at(), changed.links(index)?);
        }
        links.until(self.until());
        links.radios(&self.shared.radios)?;
        for (host, [x, y, z]) in &self.shared.places {
            links.place(host, Point3::new(x.0, y.0, z.0));
        }
        let contacts = self.shared.contacts.as_ref();
        let contacts = contacts.map(|config| LinkContacts::read(config, files));
        let contacts = contacts.transpose()?;
        if let Some(contacts) = &contacts {
            links.set_plan(contacts.plan().clone());
        }
        let mut notes = Vec::new();
        links.read_traces(|name| {
            let trace = contacts::read_trace(name, files)?;
            notes.push(format!("trace {name:?}: {trace}"));
            Ok(trace)
        })?;
        Ok(DeclaredLinks {
            links,
            contacts,
            notes,
        })
    }

    /// What is planned for instants of the run, but for crashes.
    fn planned(&self, sim: &Simulation, contacts: Option<&LinkContacts>) -> Planned {
        let mut planned = Planned::new(self.until());
        for (shared, from, until) in self.eras() {
            for (index, degrade) in shared.degrade.iter().enumerate() {
                let is_here = degrade.at >= from && until.is_none_or(|until| degrade.at < until);
                if is_here {
                    let key = format!("degrade.{index}");
                    planned.add(key, "begins", None, vec![degrade.at]);
                }
            }
        }
        for (index, changed) in self.changed.iter().enumerate() {
            planned.add(format!("fork.{index}"), "begins", None, vec![changed.at()]);
        }
        planned.add_contacts(contacts, &self.shared.links, sim);
        planned.add_tells(sim);
        planned
    }

    /// Whether a run ended because its time was over.
    pub(crate) fn is_time_out(&self, end: &End) -> bool {
        match (end, self.until()) {
            (End::Stopped { by, reason }, Some(until)) => {
                by.starts_with('@') && *reason == reason_of(until)
            }
            _ => false,
        }
    }

    fn check_places(&self, sim: &Simulation) -> Result<(), ScenarioError> {
        let known = |name: &str| sim.host_names().any(|host| host == name);
        match self.shared.places.keys().find(|name| !known(name)) {
            None => Ok(()),
            Some(name) => {
                let key = ["places".to_owned(), name.clone()];
                Err(ScenarioError::UnknownValue {
                    place: self.source.place_of_key(&key),
                    key: key.join("."),
                    found: name.clone(),
                    nearest: nearest(name, sim.host_names()),
                    expected: format!("the name of one of {} hosts", sim.host_names().count()),
                })
            }
        }
    }

    fn check_crashes(&self) -> Result<(), ScenarioError> {
        for (index, crash) in self.shared.crash.iter().enumerate() {
            let checked = crash.check_alone(self.shared.until);
            checked.map_err(|mistake| self.crash_error(index, mistake))?;
        }
        Ok(())
    }

    /// A mistake in a key.
    fn invalid(&self, key: Vec<String>, message: String) -> ScenarioError {
        ScenarioError::Invalid {
            place: self.source.place_of_key(&key),
            key: key.join("."),
            message,
        }
    }

    fn crash_error(&self, index: usize, mistake: crash::Mistake) -> ScenarioError {
        let mut key = vec!["crash".to_owned(), index.to_string()];
        key.push(mistake.key.to_owned());
        ScenarioError::Invalid {
            place: self.source.place_of_key(&key),
            key: key.join("."),
            message: mistake.message,
        }
    }
}

/// Why a run stops whose time is over.
fn reason_of(until: SimDuration) -> String {
    format!("until {until}")
}

/// Takes the tables out of a table.
trait SplitTables {
    fn split_tables(&mut self) -> toml::Table;
}

impl SplitTables for toml::Table {
    fn split_tables(&mut self) -> toml::Table {
        let is_table = |value: &toml::Value| match value {
            toml::Value::Table(_) => true,
            toml::Value::Array(entries) => entries.iter().any(toml::Value::is_table),
            _ => false,
        };
        let (tables, plain) = std::mem::take(self)
            .into_iter()
            .partition(|(_, value)| is_table(value));
        *self = plain;
        tables
    }
}

#[cfg(test)]
mod tests;
