//! The `[[fork]]` entries of a scenario: from an instant on the run is as the scenario with some keys set
//! otherwise has it. What was before is the run without the entry, event by event.

use farside::{SimDuration, SimTime, Simulation};
use farside_actors::system::{Seeds, Settings, Setup, SetupError};
use farside_actors::wiring::LinkBuilder;
use farside_actors::{settings, units};

use super::location::one_line;
use super::{Scenario, ScenarioError, Shared};
use crate::registry::Registry;

settings! {
    /// A `[[fork]]` entry: from an instant on, other settings.
    ///
    /// | key | meaning | default |
    /// |---|---|---|
    /// | `at` | from when on, over 0 and after the entry before | needed |
    /// | `set` | what is set, as `--set` has it; for this entry and those after it | needed |
    ///
    /// Links, degradations, crashes and the end can be set, and those keys of a system that its actors
    /// can take up in a restart.
    pub struct Fork {
        /// From when on, from the start of the run.
        pub at: SimDuration [with = "units::duration"] = SimDuration::ZERO;
        /// What is set, each as `--set` has it: `links.default.loss=0.3`.
        pub set: Vec<String>;
    }
}

/// A scenario from a fork on.
pub(super) struct Changed {
    at: SimDuration,
    shared: Shared,
    settings: Box<dyn Settings>,
    /// The keys of the system that differ from what holds before.
    keys: Vec<String>,
}

impl Changed {
    /// From when on.
    pub(super) fn at(&self) -> SimDuration {
        self.at
    }

    /// The shared keys.
    pub(super) fn shared(&self) -> &Shared {
        &self.shared
    }

    pub(super) fn set_until(&mut self, until: SimDuration) {
        self.shared.until = Some(until);
    }

    /// The links that it has; `index` is its place among the forks.
    pub(super) fn links(&self, index: usize) -> Result<LinkBuilder, SetupError> {
        let builder = LinkBuilder::new(&self.shared.links, &self.shared.degrade);
        builder.map_err(|error| {
            let (key, message) = SetupError::from(error).into_parts();
            SetupError::value(
                &format!("fork.{index}.set"),
                format!("{}: {message}", key.join(".")),
            )
        })
    }
}

/// The tables of [`Shared`] that a fork may set.
const CHANGEABLE: [&str; 5] = ["links", "degrade", "crash", "until", "description"];

/// What is wrong with an entry: the key in it, and what was found and expected.
pub(super) struct Mistake {
    pub(super) key: &'static str,
    pub(super) message: String,
}

/// Checks what entries say by themselves, given the one before.
pub(super) fn check(fork: &Fork, before: Option<&Fork>) -> Result<(), Mistake> {
    let mistake = |key, message| Err(Mistake { key, message });
    let at = fork.at;
    if at.is_zero() {
        let message =
            "0s: expected a time over zero; what holds from the start is the scenario's own";
        return mistake("at", message.to_owned());
    }
    if let Some(before) = before.filter(|before| before.at >= at) {
        let message = format!(
            "{at}: expected a time after that of the entry before, {}",
            before.at
        );
        return mistake("at", message);
    }
    if fork.set.is_empty() {
        let message =
            "this key is missing: expected what is set, as in set = [\"links.default.loss=0.3\"]";
        return mistake("set", message.to_owned());
    }
    Ok(())
}

/// Checks that a fork changes nothing that a run cannot change: `shared` is what the scenario has without it,
/// `changed` what it has with it.
pub(super) fn check_changes(shared: &Shared, changed: &Shared) -> Result<(), String> {
    let table = |shared: &Shared| toml::Table::try_from(shared).unwrap_or_default();
    let (mut before, mut after) = (table(shared), table(changed));
    for key in CHANGEABLE {
        before.remove(key);
        after.remove(key);
    }
    let keys = before.keys().chain(after.keys());
    let mut differing = keys.filter(|key| before.get(*key) != after.get(*key));
    match differing.next() {
        None => Ok(()),
        Some(key) => Err(format!("{key}: {}", refusal(key))),
    }
}

/// Checks that `changed` differs from `base` in nothing but settings of actors, as a replay may have them: all
/// else comes from the record.
pub(crate) fn check_replay(base: &Scenario, changed: &Scenario) -> Result<(), String> {
    let table = |shared: &Shared| toml::Table::try_from(shared).unwrap_or_default();
    let (mut before, mut after) = (table(&base.shared), table(&changed.shared));
    for free in ["links", "description"] {
        before.remove(free);
        after.remove(free);
    }
    let keys = before.keys().chain(after.keys());
    let mut differing_keys = keys.filter(|key| before.get(*key) != after.get(*key));
    if let Some(key) = differing_keys.next() {
        let why = match key.as_str() {
            "seed" | "problem_seed" | "tie_seed" | "system" => refusal(key),
            _ => "this comes from the record: a replay changes settings of its actors alone",
        };
        return Err(format!("{key}: {why}"));
    }
    let resolved = |scenario: &Scenario| scenario.settings.resolved().unwrap_or_default();
    let keys = differing("", &resolved(base), &resolved(changed));
    let of_world = |key: &&String| {
        let root = key.split('.').next().unwrap_or_default();
        matches!(root, "world" | "team")
    };
    match keys.iter().find(of_world) {
        Some(key) => Err(format!(
            "{key}: the world and the team are those of the record"
        )),
        None => Ok(()),
    }
}

/// Why a key cannot be set in mid-run.
fn refusal(key: &str) -> &'static str {
    match key {
        "system" => "the system cannot change in mid-run",
        "seed" | "problem_seed" | "tie_seed" => {
            "seeds cannot change in mid-run: all draws of the run have one"
        }
        "contacts" => "a contact plan is known from the start, and cannot change in mid-run",
        "radios" => "radios are shared by links from the start, and cannot change in mid-run",
        "places" => "where hosts stand at first cannot change in mid-run",
        "lose" | "deliver" | "postpone" => {
            "this is about single messages whenever they are sent: it goes to the top of the scenario"
        }
        "fork" => "a fork within a fork: expected an entry of its own",
        "never" => {
            "what must never happen is judged at the run's end: it goes to the top of the scenario"
        }
        "log" => "what the log holds cannot change in mid-run",
        _ => "this cannot change in mid-run",
    }
}

/// A key of a system that a fork may not set.
pub(super) fn refuse_own(key: &str) -> String {
    format!(
        "{key}: its system builds its world and its team with this before the run; to change it, run the \
         changed scenario from the start"
    )
}

/// The keys in which two tables differ, dotted, below `name`.
pub(super) fn differing(name: &str, before: &toml::Table, after: &toml::Table) -> Vec<String> {
    let mut keys: Vec<&String> = before.keys().chain(after.keys()).collect();
    keys.sort_unstable();
    keys.dedup();
    let mut differing = Vec::new();
    for key in keys {
        let dotted = match name {
            "" => key.clone(),
            name => format!("{name}.{key}"),
        };
        match (before.get(key), after.get(key)) {
            (Some(toml::Value::Table(before)), Some(toml::Value::Table(after))) => {
                differing.extend(self::differing(&dotted, before, after));
            }
            (before, after) if before != after => differing.push(dotted),
            _ => {}
        }
    }
    differing
}

impl Scenario {
    /// Reads what holds from each fork on.
    pub(super) fn read_forks(
        &mut self,
        text: &str,
        sets: &[String],
        registry: &Registry,
    ) -> Result<(), ScenarioError> {
        let forks = std::mem::take(&mut self.shared.fork);
        let mut sets = sets.to_vec();
        let mut before = None;
        for (index, fork) in forks.iter().enumerate() {
            let wrong = |last: &str, message: String| {
                let key = ["fork".to_owned(), index.to_string(), last.to_owned()];
                self.invalid(key.to_vec(), message)
            };
            check(fork, before.replace(fork))
                .map_err(|mistake| wrong(mistake.key, mistake.message))?;
            sets.extend(fork.set.iter().cloned());
            // A fork within a fork would be read for ever.
            let alone = sets.iter().cloned().chain(["fork=[]".to_owned()]);
            let alone: Vec<String> = alone.collect();
            if let Some(nested) = fork
                .set
                .iter()
                .find(|set| set.trim_start().starts_with("fork"))
            {
                return Err(wrong("set", format!("{nested}: a fork within a fork")));
            }
            let changed = Self::parse(
                &self.name,
                text.to_owned(),
                &alone,
                registry,
                self.files.clone(),
            );
            let changed =
                changed.map_err(|error| wrong("set", one_line(&error.to_string()).to_owned()))?;
            let was = self.changed.last();
            let (shared, settings) = match was {
                Some(was) => (&was.shared, &was.settings),
                None => (&self.shared, &self.settings),
            };
            check_changes(shared, &changed.shared).map_err(|message| wrong("set", message))?;
            let resolved = |settings: &dyn Settings| settings.resolved().unwrap_or_default();
            let keys = differing("", &resolved(&**settings), &resolved(&*changed.settings));
            self.changed.push(Changed {
                at: fork.at,
                shared: changed.shared,
                settings: changed.settings,
                keys,
            });
        }
        self.shared.fork = forks;
        Ok(())
    }

    /// What holds of the shared keys, from when until when, in order.
    pub(super) fn eras(&self) -> impl Iterator<Item = (&Shared, SimDuration, Option<SimDuration>)> {
        let starts = self
            .changed
            .iter()
            .map(|changed| (&changed.shared, changed.at));
        let starts = std::iter::once((&self.shared, SimDuration::ZERO)).chain(starts);
        let ends = self.changed.iter().map(|changed| Some(changed.at));
        let ends = ends.chain(std::iter::once(None));
        starts
            .zip(ends)
            .map(|((shared, from), until)| (shared, from, until))
    }

    /// When the run stops by the clock, if it does.
    pub(crate) fn until(&self) -> Option<SimDuration> {
        self.changed
            .last()
            .map_or(self.shared.until, |last| last.shared.until)
    }

    /// Restarts, at each fork that sets keys of the system, the actors that take them up.
    pub(super) fn rebuild(&self, sim: &mut Simulation, seeds: Seeds) -> Result<(), ScenarioError> {
        for (index, changed) in self.changed.iter().enumerate() {
            let wrong = |message: String| {
                let key = ["fork".to_owned(), index.to_string(), "set".to_owned()];
                self.invalid(key.to_vec(), message)
            };
            if changed.keys.is_empty() {
                continue;
            }
            let mut patterns = Vec::new();
            for key in &changed.keys {
                let who = changed.settings.taken_up_by(key);
                patterns.extend(who.ok_or_else(|| wrong(refuse_own(key)))?);
            }
            let mut files = self.files.clone();
            let links = self
                .links(&mut files)
                .map_err(|error| wrong(error.to_string()))?
                .links;
            let mut other = sim.twin();
            let mut setup = Setup::new(seeds, self.until(), &mut other, &mut files, links);
            let assembled = changed.settings.assemble(&mut setup);
            assembled.map_err(|error| wrong(error.to_string()))?;
            let at = SimTime::ZERO + changed.at;
            let picked = |name: &str| patterns.iter().any(|pattern| pattern.matches(name));
            let rebuilt = sim.rebuild_at(at, other, picked);
            let rebuilt = rebuilt.map_err(|error| {
                let keys = changed.keys.join(", ");
                wrong(format!("{keys}: {error}"))
            })?;
            if rebuilt.is_empty() {
                let keys = changed.keys.join(", ");
                return Err(wrong(format!("{keys}: no actor of the run takes this up")));
            }
        }
        Ok(())
    }
}
