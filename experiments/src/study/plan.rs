//! Plans: a study whose every cell has been built once, so that what is wrong is known before
//! anything runs.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde_json::{Map, Value};

use farside::suggest::nearest;

use crate::scenario::{self, Scenario, ScenarioError, Source, SourceLocation};
use farside_actors::system::Files;

use crate::registry::Registry;

use super::design;
use super::error::StudyError;
use super::factors::{Blame, FactorPlan, factors};
use super::file::{Seeds, StudyFile};
use super::level::{Level, Setting, settings};
use super::metrics;
use super::published::published;
use super::results::{Cell, FORMAT, Manifest, Metric, Stop};

type FilesByName = BTreeMap<String, Vec<u8>>;

/// The most seeds of a study.
const MAX_SEEDS: u64 = 1_000_000;

/// Fewer seeds say nothing about the width of an interval.
const LEAST_MIN_SEEDS: u32 = 5;

/// A study, read and checked as far as that goes without its scenario.
pub struct Study {
    name: String,
    /// Where a scenario's file is looked for.
    folder: PathBuf,
    source: Source,
    file: StudyFile,
    factors: Vec<FactorPlan>,
    pub(super) cells: Vec<Cell>,
}

/// A study that can run.
pub struct StudyPlan {
    /// What is run.
    pub manifest: Manifest,
    /// A scenario for each cell.
    pub(super) scenarios: Vec<Scenario>,
    /// What the scenario says in some cell that has no effect, for people.
    pub remarks: Vec<String>,
    /// The files that its scenario was read from.
    pub(crate) inputs: Vec<PathBuf>,
    source: Source,
}

/// Scenarios of cells, the files that they read, and what is remarked on them.
struct Built {
    /// Where on disk the files lie.
    paths: Vec<PathBuf>,
    scenarios: Vec<Scenario>,
    files: FilesByName,
    remarks: Vec<String>,
}

impl Study {
    /// Reads a built-in study or a file.
    ///
    /// ```
    /// use farside_experiments::study::Study;
    /// use farside_experiments::registry::Registry;
    /// let registry = Registry::builtin();
    /// let study = Study::open("degradation/loss", &registry)?;
    /// assert!(study.question().ends_with('?'));
    /// let plan = study.plan(&["team.rovers=5".to_owned()], Some(3), &registry)?;
    /// assert_eq!(plan.manifest.seeds, [1, 2, 3]);
    /// # Ok::<(), farside_experiments::study::StudyError>(())
    /// ```
    ///
    /// # Errors
    /// When it cannot be found or read, or is wrong.
    pub fn open(study: &str, registry: &Registry) -> Result<Study, StudyError> {
        if let Some(text) = registry.study(study) {
            let read = Self::parse(study, text.to_owned(), PathBuf::new())?;
            let name = study.to_owned();
            return Ok(Study { name, ..read });
        }
        let path = Path::new(study);
        let mut missing = false;
        let text = scenario::read(path, || {
            missing = true;
            ScenarioError::NotFound {
                found: study.to_owned(),
                nearest: None,
                known: String::new(),
            }
        });
        if missing {
            let names = registry.study_names();
            return Err(StudyError::NotFound {
                found: study.to_owned(),
                nearest: nearest(study, names.iter().copied()),
                known: names.join(", "),
            });
        }
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        Self::parse(study, text?, folder)
    }

    /// Reads a study's text; `name` is what messages call it, and files are looked for from
    /// `folder`.
    ///
    /// # Errors
    /// When it is wrong.
    pub fn parse(name: &str, text: String, folder: PathBuf) -> Result<Study, StudyError> {
        let source = Source::new(name, text, &[])?;
        let file = {
            let document = source.document()?;
            StudyFile::deserialize(toml::Deserializer::from(document))
        };
        let file = file.map_err(|error| ScenarioError::from_toml(&source, &error))?;
        let blame = Blame(&source);
        let mut factors = factors(&file, &blame)?;
        let cells = design::cells(&file, &mut factors, &blame)?;
        Ok(Study {
            name: scenario::stem(name),
            folder,
            source,
            file,
            factors,
            cells,
        })
    }

    /// The built-in name, or the file's name without its ending.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What it asks.
    pub fn question(&self) -> &str {
        &self.file.question
    }

    /// Builds every cell once, with `sets` laid over the scenario and, if given, another number of
    /// `seeds` than the study's.
    ///
    /// # Errors
    /// When anything is wrong that can be known before a run: a key that does not exist, a value
    /// that the scenario refuses, a baseline that is no cell.
    pub fn plan(
        self,
        sets: &[String],
        seeds: Option<u64>,
        registry: &Registry,
    ) -> Result<StudyPlan, StudyError> {
        let blame = Blame(&self.source);
        self.check_arguments(sets)?;
        let base = self.scenario(sets, registry)?;
        let metrics = self.metrics(&base, registry, &blame)?;
        let stop = self.stop(&metrics, &blame)?;
        let seeds = self.seeds(seeds, &blame)?;
        let block = super::blocks::block(&self.file, &self.factors, seeds.len(), &blame)?;
        let baseline = self.baseline(&blame)?;
        let published = published(&self.file, &self.factors, &self.cells, &metrics, &blame)?;
        self.check_axes(&blame)?;
        super::blocks::check_problem(&base, block, &blame)?;
        let scenario_text = base.resolved()?;
        let scenario_file = self.folder.join(&self.file.scenario);
        let Built {
            paths,
            scenarios,
            files,
            remarks,
        } = self.scenarios(&base, &scenario_text, seeds[0], registry)?;
        let manifest = Manifest {
            format: FORMAT,
            code_version: registry.version(),
            study: self.name,
            question: self.file.question,
            scenario: base.name().to_owned(),
            scenario_text,
            files,
            factors: self.factors.into_iter().map(|plan| plan.factor).collect(),
            metrics,
            baseline,
            cells: self.cells,
            seeds,
            block,
            stop,
            published,
            report: self.file.report,
        };
        super::load::check_names(&manifest).map_err(StudyError::Argument)?;
        let mut inputs = paths;
        // What is built in lies nowhere: a path at which nothing is harms nobody.
        inputs.push(scenario_file);
        Ok(StudyPlan {
            manifest,
            scenarios,
            remarks,
            inputs,
            source: self.source,
        })
    }

    fn metrics(
        &self,
        base: &Scenario,
        registry: &Registry,
        blame: &Blame<'_>,
    ) -> Result<Vec<Metric>, ScenarioError> {
        let listed = &self.file.metrics;
        if listed.is_empty() {
            return Err(blame.invalid("metrics", "expected at least one metric"));
        }
        for (index, metric) in listed.iter().enumerate() {
            if listed[..index]
                .iter()
                .any(|other| other.name == metric.name)
            {
                let message = format!("{:?} is there twice", metric.name);
                return Err(blame.invalid(&format!("metrics.{index}"), message));
            }
        }
        let system = &base.shared().system;
        let known = |name: &str| registry.metric(system, name);
        let filled = |file| metrics::metric(file, known);
        Ok(listed.iter().map(filled).collect())
    }

    fn stop(&self, metrics: &[Metric], blame: &Blame<'_>) -> Result<Option<Stop>, ScenarioError> {
        let Some(stop) = &self.file.stop else {
            return Ok(None);
        };
        let names: Vec<&str> = metrics.iter().map(|metric| metric.name.as_str()).collect();
        if !names.contains(&stop.metric.as_str()) {
            return Err(blame.unknown("stop.metric", &stop.metric, &names));
        }
        if !(stop.width > 0.0 && stop.width.is_finite()) {
            let message = format!("{}: expected a number above zero", stop.width);
            return Err(blame.invalid("stop.width", message));
        }
        if stop.min_seeds < LEAST_MIN_SEEDS {
            let found = stop.min_seeds;
            let message = format!("{found}: expected at least {LEAST_MIN_SEEDS}");
            return Err(blame.invalid("stop.min_seeds", message));
        }
        if stop.max_seeds < stop.min_seeds || u64::from(stop.max_seeds) > MAX_SEEDS {
            let (found, least) = (stop.max_seeds, stop.min_seeds);
            let message = format!("{found}: expected from min_seeds, {least}, to {MAX_SEEDS}");
            return Err(blame.invalid("stop.max_seeds", message));
        }
        if self.file.seeds.is_some() {
            return Err(blame.invalid("seeds", "with [stop], max_seeds says how many there are"));
        }
        Ok(Some(Stop {
            metric: stop.metric.clone(),
            width: stop.width,
            min_seeds: stop.min_seeds as usize,
        }))
    }

    fn seeds(&self, wanted: Option<u64>, blame: &Blame<'_>) -> Result<Vec<u64>, StudyError> {
        let own = match (&self.file.stop, &self.file.seeds) {
            (Some(stop), _) => Seeds::Count(u64::from(stop.max_seeds)),
            (None, Some(seeds)) => seeds.clone(),
            (None, None) => Seeds::Count(30),
        };
        let range = |count: u64| (1..=MAX_SEEDS).contains(&count);
        match (own, wanted) {
            (_, Some(count)) if !range(count) => Err(StudyError::Argument(format!(
                "--seeds {count}: expected from 1 to {MAX_SEEDS}"
            ))),
            (Seeds::Count(_), Some(count)) => Ok((1..=count).collect()),
            (Seeds::Count(count), None) if range(count) => Ok((1..=count).collect()),
            (Seeds::Count(count), None) => {
                let message = format!("{count}: expected from 1 to {MAX_SEEDS} seeds");
                Err(blame.invalid("seeds", message).into())
            }
            (Seeds::List(list), wanted) => {
                let mut sorted = list.clone();
                sorted.sort_unstable();
                if list.is_empty() {
                    return Err(blame.invalid("seeds", "expected at least one seed").into());
                }
                if let Some(pair) = sorted.windows(2).find(|pair| pair[0] == pair[1]) {
                    let message = format!("{} is there twice", pair[0]);
                    return Err(blame.invalid("seeds", message).into());
                }
                let count = wanted.unwrap_or(list.len() as u64) as usize;
                let first = list.get(..count).map(<[u64]>::to_vec);
                first.ok_or_else(|| {
                    let listed = list.len();
                    let message = format!("--seeds {count}: the study lists {listed} seeds");
                    StudyError::Argument(message)
                })
            }
        }
    }

    fn baseline(&self, blame: &Blame<'_>) -> Result<Option<usize>, ScenarioError> {
        let Some(table) = &self.file.baseline else {
            // A drawn point is no better than another.
            let drawn = self.file.design == super::file::Design::LatinHypercube;
            return Ok((!drawn).then_some(0));
        };
        let wanted: Vec<(String, Level)> = table
            .iter()
            .map(|(name, value)| (name.clone(), Level::new(value)))
            .collect();
        let factors: Vec<_> = self.factors.iter().map(|f| f.factor.clone()).collect();
        let found = design::find(&factors, &self.cells, &wanted);
        found
            .map(Some)
            .map_err(|message| blame.invalid("baseline", message))
    }

    /// Checks what plots are to put where: factors, each in one place.
    fn check_axes(&self, blame: &Blame<'_>) -> Result<(), ScenarioError> {
        let factors = self.factors.iter().map(|plan| plan.factor.name.as_str());
        let factors: Vec<&str> = factors.collect();
        let said: Vec<(&str, &str)> = self.file.report.said().collect();
        for (index, (key, name)) in said.iter().enumerate() {
            let place = format!("report.{key}");
            if !factors.contains(name) {
                return Err(blame.unknown(&place, name, &factors));
            }
            if let Some((other, _)) = said[..index].iter().find(|(_, taken)| taken == name) {
                let message = format!("{name:?} is {other} already: expected another factor");
                return Err(blame.invalid(&place, message));
            }
        }
        Ok(())
    }

    /// Refuses arguments that would have no effect.
    fn check_arguments(&self, sets: &[String]) -> Result<(), StudyError> {
        for set in sets {
            let key = set.split('=').next().unwrap_or("").trim();
            let varies = |plan: &&FactorPlan| plan.keys.iter().any(|known| known == key);
            if let Some(plan) = self.factors.iter().find(varies) {
                let name = &plan.factor.name;
                return Err(StudyError::Argument(format!(
                    "--set {set}: the study varies this key, as its factor {name}"
                )));
            }
            if key == "seed" {
                return Err(StudyError::Argument(format!(
                    "--set {set}: a study has its own seeds; --seeds says how many"
                )));
            }
        }
        Ok(())
    }

    /// The scenario with what the study and the command set laid over it.
    fn scenario(&self, sets: &[String], registry: &Registry) -> Result<Scenario, StudyError> {
        let own = settings(&self.file.set, "set");
        let mut all: Vec<String> = own.iter().map(|one| one.argument.clone()).collect();
        all.extend_from_slice(sets);
        let name = &self.file.scenario;
        let opened = if registry.scenario(name).is_some() {
            Scenario::open(name, &all, registry)
        } else {
            let path = self.folder.join(name);
            Scenario::open(&path.to_string_lossy(), &all, registry)
        };
        opened.map_err(|error| {
            if let ScenarioError::NotFound { known, .. } = error {
                return StudyError::Text(ScenarioError::UnknownValue {
                    place: self.source.place_of_key(&["scenario".to_owned()]),
                    key: "scenario".to_owned(),
                    found: name.clone(),
                    nearest: nearest(name, registry.scenario_names().into_iter()),
                    expected: format!("a file, or one of {known}"),
                });
            }
            let blamed = own.iter().find(|one| is_place_of(&error, &one.argument));
            match blamed {
                Some(one) => StudyError::Refused {
                    place: self.source.place_of_key(&one.path),
                    what: one.argument.clone(),
                    error: Box::new(error),
                },
                None => StudyError::Text(error),
            }
        })
    }

    /// A scenario for each cell, each built once, and all files that they read.
    fn scenarios(
        &self,
        base: &Scenario,
        text: &str,
        seed: u64,
        registry: &Registry,
    ) -> Result<Built, StudyError> {
        let mut files = base.files().clone();
        let mut scenarios = Vec::new();
        let mut remarks: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        for (index, cell) in self.cells.iter().enumerate() {
            let built = of_cell(base.name(), text, cell, files.clone(), registry);
            let built = built.and_then(|scenario| {
                let assembled = scenario.assemble_seeded(scenario.seeds_of(seed, None))?;
                Ok((scenario, assembled.files, assembled.remarks))
            });
            let (scenario, read, remarked) = built.map_err(|error| self.refused(index, error))?;
            scenarios.push(scenario);
            for remark in remarked {
                remarks.entry(remark).or_default().push(index);
            }
            files = read;
        }
        let (all, paths) = (files.all().clone(), files.paths());
        for scenario in &mut scenarios {
            // What is on disk may change while the study runs.
            scenario.keep_files(Files::kept(all.clone()));
        }
        let cells = self.cells.len();
        let remarks = remarks
            .into_iter()
            .map(|(remark, within)| told_of_cells(&remark, &within, cells));
        Ok(Built {
            remarks: base.renamed_remarks().chain(remarks).collect(),
            paths,
            scenarios,
            files: all,
        })
    }

    /// A cell that the scenario refuses, with the value to blame.
    fn refused(&self, index: usize, error: ScenarioError) -> StudyError {
        let cell = &self.cells[index];
        let factors = self.factors.iter().enumerate();
        let of_factor = |(at, plan): (usize, &FactorPlan)| {
            let sets = plan.sets_of(&cell.values[at], &cell.texts[at]);
            std::iter::repeat_n(at, sets)
        };
        let blamed = factors
            .flat_map(of_factor)
            .zip(&cell.sets)
            .find(|(_, argument)| is_place_of(&error, argument))
            .map(|(at, _)| at);
        let (keys, what) = match blamed {
            Some(at) => {
                let name = &self.factors[at].factor.name;
                let text = &cell.texts[at];
                (
                    self.keys_of_value(index, at, &error),
                    format!("factor {name} = {text}"),
                )
            }
            None => {
                let texts = cell.texts.join(", ");
                (vec!["factor".to_owned()], format!("cell {index} ({texts})"))
            }
        };
        StudyError::Refused {
            place: self.source.place_of_key(&keys),
            what,
            error: Box::new(error),
        }
    }

    /// The keys that lead to where a cell's value stands in the study.
    fn keys_of_value(&self, cell: usize, factor: usize, error: &ScenarioError) -> Vec<String> {
        let file = &self.file.factor[factor];
        let owned = |keys: &[&str]| keys.iter().map(|key| (*key).to_owned()).collect();
        let at = factor.to_string();
        if let Some(values) = &file.values {
            let value = &self.cells[cell].values[factor];
            let text = &self.cells[cell].texts[factor];
            let place = values.iter().position(|v| Level::new(v).is(value, text));
            return owned(&["factor", &at, "values", &place.unwrap_or(0).to_string()]);
        }
        if let Some(variants) = &file.variants {
            let text = &self.cells[cell].texts[factor];
            let place = variants.iter().position(|variant| variant.name == *text);
            let place = place.unwrap_or(0);
            let set = variants.get(place).map(|variant| {
                settings(&variant.set, &format!("factor.{at}.variants.{place}.set"))
            });
            let blamed = |one: &Setting| is_place_of(error, &one.argument);
            let set = set.and_then(|set| set.into_iter().find(blamed));
            return set.map_or_else(
                || owned(&["factor", &at, "variants", &place.to_string()]),
                |set| set.path,
            );
        }
        if file.range.is_some() {
            return owned(&["factor", &at, "range"]);
        }
        owned(&["cell", &cell.to_string(), &file.name])
    }
}

impl StudyPlan {
    /// Checks that a run which ended like this has what the study measures.
    pub(super) fn check_metrics(&self, results: &Map<String, Value>) -> Result<(), ScenarioError> {
        let blame = Blame(&self.source);
        for (index, metric) in self.manifest.metrics.iter().enumerate() {
            let name = metric.name.as_str();
            if !metrics::is_measurable(results, name) {
                let known = metrics::measurable(results);
                return Err(blame.unknown(&format!("metrics.{index}"), name, &known));
            }
            if let (Some(kind), Some(value)) = (metric.kind, results.get(name))
                && !kind.holds(value)
            {
                let message =
                    format!("{name}: its system declares {kind:?}, and a run has {value}");
                return Err(blame.invalid(&format!("metrics.{index}"), message));
            }
        }
        if let Some(stop) = &self.manifest.stop
            && let Some(Value::Array(_) | Value::String(_) | Value::Object(_)) =
                results.get(&stop.metric)
        {
            let metric = &stop.metric;
            let message = format!("{metric}: expected a metric that is a number, or true or false");
            return Err(blame.invalid("stop.metric", message));
        }
        self.check_published(results)
    }

    /// Checks that what was published is of metrics of which it can be said, as a run that ended
    /// has them.
    pub(super) fn check_published(
        &self,
        results: &Map<String, Value>,
    ) -> Result<(), ScenarioError> {
        let blame = Blame(&self.source);
        for (index, table) in self.manifest.published.iter().enumerate() {
            super::published::check_kind(index, table, results.get(&table.metric), &blame)?;
        }
        Ok(())
    }
}

/// A remark, and on which of `cells` cells it is.
fn told_of_cells(remark: &str, within: &[usize], cells: usize) -> String {
    const SHOWN: usize = 12;
    let mut names: Vec<String> = within.iter().take(SHOWN).map(usize::to_string).collect();
    if within.len() > SHOWN {
        names.push(format!("and {} more", within.len() - SHOWN));
    }
    match within.len() {
        all if all == cells => format!("in each cell: {remark}"),
        1 => format!("in cell {}: {remark}", names[0]),
        _ => format!("in cells {}: {remark}", names.join(", ")),
    }
}

/// The scenario of a cell: the text with the cell's sets laid over it. A study's runs and their
/// reproduction both come from here.
pub(super) fn of_cell(
    name: &str,
    text: &str,
    cell: &Cell,
    files: Files,
    registry: &Registry,
) -> Result<Scenario, ScenarioError> {
    let label = format!("{name} (resolved)");
    let parsed = Scenario::parse(&label, text.to_owned(), &cell.sets, registry, files);
    Ok(parsed?.named(name))
}

/// Whether the mistake is in this `--set` argument.
fn is_place_of(error: &ScenarioError, argument: &str) -> bool {
    matches!(error.place(), Some(SourceLocation::Set { argument: blamed }) if blamed == argument)
}
