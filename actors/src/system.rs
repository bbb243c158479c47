//! Systems: what a scenario can run. A [`System`] brings all that is its own: the keys that it
//! reads, its metrics, its built-in scenarios and studies, its pictures, and how it is assembled.
//! Whoever reads scenarios and runs studies knows this trait and no system.
//!
//! What this is not: the list of systems that a program knows, which is the program's.

mod account;
mod builtin;
mod documented;
mod error;
mod files;
mod gathered;
mod invariant;
mod metric;
mod own_table;
mod picture;
mod removable;
mod section;
mod series;
pub mod settings;

use std::sync::Arc;

use farside::scene::Scene;
use farside::{Pattern, Report, SimDuration, Simulation};
use farside_worlds::contacts::ContactPlan;
use serde_json::{Map, Value};

use crate::link::{Degrade, LinkConfigError};

use crate::wiring::{LinkBuilder, Links, Wire, Wiring};
pub use account::{Account, Doing, Phase, outages};
pub use builtin::Builtin;
pub use documented::{parted, with_about};
pub use error::SetupError;
pub use files::{Files, no_file};
pub use gathered::Gathered;
pub use invariant::Invariant;
pub use metric::{Better, Metric, MetricKind, SeriesIndex};
pub use own_table::OwnTable;
pub use picture::{
    PictureError, PictureInfo, PictureOption, PictureRequest, Recorded, Recording, RecordingEnd,
};
pub use removable::{Entries, Removable};
pub use section::{Key, Section};
pub use series::{Series, SeriesError};

/// A kind of system: reads its own tables of a scenario, and says what it has.
///
/// Only [`name`](System::name), [`sections`](System::sections) and [`parse`](System::parse) have to
/// be written; a system without metrics of its own is measured by what the kernel counts.
pub trait System: Send + Sync {
    /// The name that scenarios give as `system`.
    fn name(&self) -> &str;

    /// What it is, in a line.
    fn about(&self) -> &str;

    /// The top-level tables of a scenario that this system reads, besides those all systems share,
    /// each with its keys.
    fn sections(&self) -> Vec<Section>;

    /// What a run of it can be measured by.
    fn metrics(&self) -> &[Metric] {
        &[]
    }

    /// What must never happen in a run of it, sorted by name. Scenarios name them in `never`, and who
    /// makes a failing run small says by them what failed.
    fn invariants(&self) -> &[Invariant] {
        &[]
    }

    /// Its built-in scenarios, sorted by name.
    fn scenarios(&self) -> &[Builtin] {
        &[]
    }

    /// Its built-in studies, sorted by name.
    fn studies(&self) -> &[Builtin] {
        &[]
    }

    /// The pictures that can be drawn of a run's log; the first is drawn unless another is named.
    fn pictures(&self) -> &[PictureInfo] {
        &[]
    }

    /// What `problem` exports of its scenarios, in a line: what there is to plan, as a file for other
    /// programs to solve. None for a system whose planners have no such problem.
    fn problem(&self) -> Option<&str> {
        None
    }

    /// Keys that once had other names. Scenarios, `--set` and studies may use the old ones: they
    /// are read as the new ones, and whoever uses them is told.
    fn renamed(&self) -> Vec<Renamed> {
        Vec::new()
    }

    /// Reads its tables; `T::deserialize(sections)` of a serde type is all it takes.
    ///
    /// # Errors
    /// Those of serde; they become messages with file, line and column.
    fn parse(&self, sections: toml::Deserializer<'_>)
    -> Result<Box<dyn Settings>, toml::de::Error>;
}

/// A key that once had another name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Renamed {
    /// The dotted key as it was: `network.damping`.
    pub old: String,
    /// The dotted key as it is: `network.max_plus.damping`.
    pub new: String,
}

/// The settings of one scenario for one system. Several threads may build from them at once.
pub trait Settings: Send + Sync {
    /// The same keys again, defaults filled in.
    ///
    /// # Errors
    /// When a value cannot be written as TOML.
    fn resolved(&self) -> Result<toml::Table, toml::ser::Error>;

    /// Checks ranges, when the scenario is read.
    ///
    /// # Errors
    /// When a value is out of its range; the error names its key.
    fn check(&self) -> Result<(), SetupError> {
        Ok(())
    }

    /// Declares hosts, actors and links; returns what tells the results once the run is over.
    ///
    /// # Errors
    /// When the settings cannot be; the error names the key.
    fn assemble(&self, setup: &mut Setup<'_>) -> Result<Assembly, SetupError>;

    /// Whose restart takes up another value of this key in mid-run, as patterns over actors' names: what a
    /// fork of a run may set. None, the default, for a key with which the world or the team is built.
    fn taken_up_by(&self, _key: &str) -> Option<Vec<Pattern>> {
        None
    }

    /// What of these settings a smaller scenario can be without, the most costly first: members of the
    /// team, goals. What all systems share, such as crashes, is known without.
    fn removable(&self) -> Vec<Removable> {
        Vec::new()
    }

    /// What the planners of a run have to solve, as the text of a file, if its system has such a
    /// thing ([`System::problem`]). `setup` is what the run would be built from: the same seeds give the
    /// problem that the run plans.
    ///
    /// # Errors
    /// When the settings cannot be; the error names the key.
    fn problem(&self, _setup: &mut Setup<'_>) -> Result<Option<String>, SetupError> {
        Ok(None)
    }

    /// What an actor did in a recorded run and what it waited for, up to a time or the run's end; none, the
    /// default, if the system has nothing to tell of this actor. `setup` is what the run was built from.
    ///
    /// # Errors
    /// When the recording has not what it is told from.
    fn account(
        &self,
        _actor: &str,
        _run: &dyn Recording,
        _until_ns: Option<u64>,
        _setup: &mut Setup<'_>,
    ) -> Result<Option<Account>, PictureError> {
        Ok(None)
    }

    /// Draws one of [`System::pictures`] from what a run recorded. `setup` is what the run was built
    /// from: what a system works out of its settings and links it works out in one place, for runs
    /// and pictures alike.
    ///
    /// # Errors
    /// When the recording has not what the picture shows, or an option makes no sense.
    fn draw(
        &self,
        picture: &str,
        _run: &dyn Recording,
        _request: &PictureRequest,
        _setup: &mut Setup<'_>,
    ) -> Result<crate::figure::Figure, PictureError> {
        Err(PictureError::Unknown {
            picture: picture.to_owned(),
        })
    }
}

/// What the chances of a run are drawn from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seeds {
    /// Of the run: links, crashes, actors.
    pub run: u64,
    /// Of what several runs may share: the world, the team, the goals, as the system says.
    pub problem: u64,
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
    /// Reads the files that the scenario names.
    pub files: &'a mut Files,
    /// The scenario's contact plan, over hosts' names and in the run's time, for who plans by it.
    /// Links follow it where `[links]` and `[[degrade]]` say nothing else: what one link has by all
    /// that is planned, [`Links::nominal`] says.
    pub contacts: Option<Arc<ContactPlan>>,
    /// The scenario's `[[degrade]]` entries, for who shows them: links and processors have them.
    pub degrades: Vec<Degrade>,
    links: Option<LinkBuilder>,
    remarks: Vec<String>,
}

impl<'a> Setup<'a> {
    /// What a run with these seeds is built from.
    pub fn new(
        seeds: Seeds,
        until: Option<SimDuration>,
        sim: &'a mut Simulation,
        files: &'a mut Files,
        links: LinkBuilder,
    ) -> Self {
        Setup {
            problem_seed: seeds.problem,
            run_seed: seeds.run,
            until,
            sim,
            files,
            contacts: links.plan().cloned(),
            degrades: links.degrades().to_vec(),
            links: Some(links),
            remarks: Vec::new(),
        }
    }

    /// Declares all links of the system at once, as the scenario has them. What is asked of links
    /// is asked of what this returns, so that no answer can come before all links are known.
    ///
    /// # Errors
    /// When a pattern of the scenario matches no link, or a link cannot be.
    ///
    /// # Panics
    /// When it is called twice.
    pub fn link(&mut self, wiring: &Wiring) -> Result<Links, LinkConfigError> {
        self.wired(|sim, wire| wire(sim, wiring))
    }

    /// [`Setup::link`] as a function to hand on, for a system that can also be put together without
    /// a scenario.
    pub fn wired<T>(&mut self, assemble: impl FnOnce(&mut Simulation, &mut Wire<'_>) -> T) -> T {
        let (links, remarks) = (&mut self.links, &mut self.remarks);
        assemble(self.sim, &mut |sim, wiring| {
            let builder = links.take();
            let builder = builder.expect("a system declares its links in one call");
            let links = builder.build(sim, wiring)?;
            *remarks = links.remarks().to_vec();
            Ok(links)
        })
    }

    /// Whether links go through radios, which ask where hosts are.
    pub fn has_radios(&self) -> bool {
        self.links.as_ref().is_some_and(LinkBuilder::has_radios)
    }

    /// What the scenario says of links and processors that has no effect, once the system is
    /// assembled.
    ///
    /// # Errors
    /// When the system has declared no links, and the scenario has patterns for some.
    pub fn close(mut self) -> Result<Vec<String>, LinkConfigError> {
        if self.links.is_some() {
            self.link(&Wiring::default())?;
        }
        Ok(self.remarks)
    }
}

/// A system that is put together, ready to run.
pub struct Assembly {
    /// Tells what came of the run.
    pub conclude: Conclude,
    /// What the run is to achieve, for a progress bar.
    pub goal: Option<Goal>,
    /// Draws the run for viewers.
    pub scene: Option<Box<dyn Scene>>,
    /// What people may want to know of the world that is built, a line at a time.
    pub notes: Vec<String>,
    /// What begins at an instant of the run, by the key of the scenario that says so. Who reads the
    /// results is told if the run ends before. Crashes, degradations, contacts and what actors are
    /// told are known without.
    pub planned: Vec<(String, SimDuration)>,
    /// Tells whether the invariant of this name is broken by now, for invariants that last and that
    /// are watched while the run is on; false for all others. Asked after each record.
    pub watch: Option<Watch>,
}

impl Assembly {
    /// A system whose results `conclude` tells.
    pub fn new(conclude: impl FnOnce(&Report) -> Results + 'static) -> Self {
        Assembly {
            conclude: Box::new(conclude),
            goal: None,
            scene: None,
            notes: Vec::new(),
            planned: Vec::new(),
            watch: None,
        }
    }

    /// Watched while the run is on.
    #[must_use]
    pub fn with_watch(mut self, watch: impl Fn(&str) -> bool + Send + 'static) -> Self {
        self.watch = Some(Box::new(watch));
        self
    }

    /// With something that begins at an instant of the run, and the key that says so.
    #[must_use]
    pub fn with_planned(mut self, key: impl Into<String>, at: SimDuration) -> Self {
        self.planned.push((key.into(), at));
        self
    }

    /// With a goal to count towards.
    #[must_use]
    pub fn with_goal(mut self, goal: Goal) -> Self {
        self.goal = Some(goal);
        self
    }

    /// Drawn for viewers.
    #[must_use]
    pub fn with_scene(mut self, scene: impl Scene + 'static) -> Self {
        self.scene = Some(Box::new(scene));
        self
    }

    /// With lines for people.
    #[must_use]
    pub fn with_notes(mut self, notes: Vec<String>) -> Self {
        self.notes = notes;
        self
    }
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

/// Tells whether an invariant is broken by now.
pub type Watch = Box<dyn Fn(&str) -> bool + Send>;

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

impl Results {
    /// The fields of a struct as metrics.
    ///
    /// ```
    /// use farside_actors::system::Results;
    /// #[derive(serde::Serialize)]
    /// struct Counted { heard: u32 }
    /// assert_eq!(Results::of(&Counted { heard: 3 }).metrics["heard"], 3);
    /// ```
    pub fn of(metrics: &impl serde::Serialize) -> Self {
        let mut results = Results::default();
        // A struct of plain numbers, names and lists is always a JSON object.
        if let Ok(Value::Object(all)) = serde_json::to_value(metrics) {
            results.metrics = all;
        }
        results
    }

    /// With one more figure for programs; a [`Series`] is a curve.
    ///
    /// ```
    /// use farside_actors::system::{Results, Series};
    /// let results = Results::default().metric("heard", 3).metric("over_time", Series::counted([0.0]));
    /// assert_eq!(results.metrics["over_time"]["index"][0], 0.0);
    /// ```
    #[must_use]
    pub fn metric(mut self, name: &str, value: impl Into<Value>) -> Self {
        self.metrics.insert(name.to_owned(), value.into());
        self
    }

    /// Adds a line for people.
    pub fn line(&mut self, label: impl Into<String>, text: impl Into<String>) {
        self.summary.push((label.into(), text.into()));
    }
}
