//! Running a study: which run is next, what is done with each that ends, and when it is over.

use std::collections::{BTreeMap, BTreeSet};
use std::convert::Infallible;
use std::path::PathBuf;
use std::sync::Arc;

use serde_json::Value;

use crate::scenario::{Assembled, Scenario};

use super::error::{StoreError, StudyError};
use super::execute::{Executed, Interrupts, execute};
use super::lengths::Lengths;
use super::load;
use super::plan::StudyPlan;
use super::pool::{self, Dispatch};
use super::results::{Manifest, Metric, Results, RunOutcome, RunRecord};
use super::stop::{self, Sample};
use super::store::{Found, Shard, Store, Times};
use super::summary::values::value_of;

/// If the first so many runs of a cell all fail, the study stops.
const FAILURES: usize = 3;

/// How to run a study.
///
/// ```
/// use farside_experiments::study::{RunOptions, Shard};
/// let options = RunOptions::new("results/mine".into());
/// assert_eq!((options.shard, options.keep_going), (Shard::WHOLE, false));
/// ```
#[derive(Clone, Debug)]
pub struct RunOptions {
    /// The results folder. It may hold runs of the same study: those are not run again.
    pub folder: PathBuf,
    /// How many runs at once; one for each core unless set.
    pub jobs: usize,
    /// Which part of the runs.
    pub shard: Shard,
    /// Go on when all first runs of a cell fail.
    pub keep_going: bool,
}

impl RunOptions {
    /// All runs, into `folder`, on all cores.
    pub fn new(folder: PathBuf) -> Self {
        RunOptions {
            folder,
            jobs: std::thread::available_parallelism().map_or(1, usize::from),
            shard: Shard::WHOLE,
            keep_going: false,
        }
    }
}

/// How far a study is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    /// Runs done, those of earlier starts included.
    pub done: usize,
    /// Runs that this shard will have; with a stopping rule it may become more.
    pub total: usize,
    /// Runs that failed.
    pub failed: usize,
    /// Runs done since this start.
    pub since_start: usize,
}

/// How the running of a study ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// All runs of the shard are done.
    Complete,
    /// It was interrupted; started again, it goes on.
    Interrupted,
}

/// Runs what is left of a study and writes it to the folder. `watch` is told after each run.
///
/// ```
/// use farside_experiments::study::{Interrupts, RunOptions, Study, results::Results, run};
/// use farside_experiments::registry::Registry;
/// let text = r#"
///     question = "How many rovers arrive in twenty seconds?"
///     scenario = "network/crater-dense"
///     metrics = ["arrived"]
///     set = { until = "20s", team.rovers = 2 }
///     seeds = 2
///     [[factor]]
///     name = "loss"
///     key = "links.default.loss"
///     values = [0, 0.3]
/// "#;
/// let study = Study::parse("arrivals.toml", text.to_owned(), "".into())?;
/// let plan = study.plan(&[], None, &Registry::builtin())?;
/// # let scratch = tempfile::tempdir()?;
/// # let folder = scratch.path().join("arrivals");
/// let options = RunOptions::new(folder.clone());
/// run(plan, &options, &Interrupts::default(), &mut |_| {})?;
/// assert_eq!(Results::load(&folder)?.runs.len(), 4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// When the folder cannot be used, a metric does not exist, or a cell's first runs all fail.
pub fn run(
    plan: StudyPlan,
    options: &RunOptions,
    interrupts: &Interrupts,
    watch: &mut dyn FnMut(Progress),
) -> Result<Ended, StudyError> {
    let fresh = Store::look(&options.folder, &plan.manifest)? == Found::Nothing;
    let tried = if fresh {
        match try_out(&plan, options.keep_going, interrupts)? {
            Some(tried) => tried,
            None => return Ok(Ended::Interrupted),
        }
    } else {
        // Figures of others may be added when the runs are done.
        let runs = load::runs(&options.folder, &plan.manifest)?;
        let done = runs.iter().find_map(|run| match &run.outcome {
            RunOutcome::Done { metrics, .. } => Some(metrics),
            RunOutcome::Failed { .. } => None,
        });
        done.map_or(Ok(()), |metrics| plan.check_published(metrics))?;
        Vec::new()
    };
    let StudyPlan {
        manifest,
        scenarios,
        ..
    } = plan;
    let (store, known) = Store::open(&options.folder, &manifest, options.shard)?;
    let measured: Arc<[Metric]> = manifest.metrics.clone().into();
    let mut runs = Runs::new(manifest, store, options, interrupts.clone(), watch);
    for record in &known {
        runs.note(record);
        let checked = runs.lengths.check(&runs.manifest, record);
        checked.map_err(|message| StoreError::Series {
            path: options.folder.clone(),
            message,
        })?;
    }
    for run in tried {
        if runs.is_ours(run.cell, run.seed) {
            runs.done(run);
        }
    }
    runs.check_known(&known)?;
    runs.since_start = 0;
    runs.tell();
    let scenarios: Arc<[Scenario]> = scenarios.into();
    let flag = interrupts.clone();
    let work = move |job: Job| {
        let scenario = &scenarios[job.cell];
        let seeds = scenario.seeds_of(job.seed, job.problem_seed);
        let executed = execute(scenario, seeds, &measured, &flag, unobserved);
        executed.map(|executed| Run {
            cell: job.cell,
            seed: job.seed,
            executed,
        })
    };
    pool::run(options.jobs, work, &mut runs).map_err(StudyError::Workers)?;
    match runs.trouble {
        Some(error) => Err(error),
        None if interrupts.is_raised() => Ok(Ended::Interrupted),
        None => Ok(Ended::Complete),
    }
}

pub(super) fn unobserved(_: &mut Assembled) -> Result<(), Infallible> {
    Ok(())
}

/// Runs the first cell's first seed to learn which metrics there are; if it fails, a few more.
/// `None` if it was interrupted.
fn try_out(
    plan: &StudyPlan,
    keep_going: bool,
    interrupts: &Interrupts,
) -> Result<Option<Vec<Run>>, StudyError> {
    let manifest = &plan.manifest;
    let mut tried = Vec::new();
    let cells = if keep_going { manifest.cells.len() } else { 1 };
    let first = manifest.seeds.len().min(FAILURES);
    for (cell, scenario) in plan.scenarios.iter().enumerate().take(cells) {
        for &seed in &manifest.seeds[..first] {
            let seeds = scenario.seeds_of(seed, manifest.problem_seed(seed));
            let executed = execute(scenario, seeds, &manifest.metrics, interrupts, unobserved);
            let Some(executed) = executed else {
                return Ok(None);
            };
            let ended = matches!(executed.outcome, RunOutcome::Done { .. });
            if ended {
                plan.check_metrics(&executed.metrics)?;
            }
            tried.push(Run {
                cell,
                seed,
                executed,
            });
            if ended {
                return Ok(Some(tried));
            }
        }
    }
    // All failed: whoever counts failures says so.
    Ok(Some(tried))
}

/// A run to do.
struct Job {
    cell: usize,
    seed: u64,
    problem_seed: Option<u64>,
}

/// A run that is done.
struct Run {
    cell: usize,
    seed: u64,
    executed: Executed,
}

/// What is kept of a run that is done.
#[derive(Clone, Copy)]
struct Brief {
    failed: bool,
    sample: Sample,
}

/// The runs of a study, done and to do.
struct Runs<'a> {
    manifest: Manifest,
    store: Store,
    shard: Shard,
    keep_going: bool,
    folder: PathBuf,
    interrupts: Interrupts,
    watch: &'a mut dyn FnMut(Progress),
    /// What is known of each run, by cell and place of the seed.
    known: Vec<Vec<Option<Brief>>>,
    /// The runs to begin next, one of each cell: seeds come first, so that each cell has some soon.
    due: BTreeSet<(usize, usize)>,
    /// Which run of each cell is due, as the place of its seed.
    queued: Vec<Option<usize>>,
    /// How many seeds of each cell are done or begun, or belong to others.
    begun: Vec<usize>,
    /// How many seeds each cell is to have.
    target: Vec<usize>,
    /// Where each seed stands.
    places: BTreeMap<u64, usize>,
    /// Runs that this shard is to have.
    total: usize,
    failed: usize,
    done: usize,
    since_start: usize,
    /// Which indices the curves of each cell have.
    lengths: Lengths,
    /// Why nothing more is begun.
    trouble: Option<StudyError>,
}

impl<'a> Runs<'a> {
    fn new(
        manifest: Manifest,
        store: Store,
        options: &RunOptions,
        interrupts: Interrupts,
        watch: &'a mut dyn FnMut(Progress),
    ) -> Self {
        let (cells, seeds) = (manifest.cells.len(), manifest.seeds.len());
        let mut runs = Runs {
            store,
            shard: options.shard,
            keep_going: options.keep_going,
            folder: options.folder.clone(),
            interrupts,
            watch,
            known: vec![vec![None; seeds]; cells],
            due: BTreeSet::new(),
            queued: vec![None; cells],
            begun: vec![0; cells],
            target: vec![0; cells],
            places: (0..)
                .zip(&manifest.seeds)
                .map(|(at, seed)| (*seed, at))
                .collect(),
            total: 0,
            failed: 0,
            done: 0,
            since_start: 0,
            lengths: Lengths::default(),
            trouble: None,
            manifest,
        };
        for cell in 0..cells {
            runs.aim(cell);
            runs.plan_next(cell);
        }
        runs
    }

    /// Whether the run at these places is in this shard.
    fn has(&self, cell: usize, place: usize) -> bool {
        self.shard.has(&self.manifest, cell, place)
    }

    fn is_ours(&self, cell: usize, seed: u64) -> bool {
        let place = self.places.get(&seed);
        place.is_some_and(|place| self.has(cell, *place) && *place < self.target[cell])
    }

    /// Finds out how many seeds the cell is to have, as far as is known.
    fn aim(&mut self, cell: usize) {
        let all = self.manifest.seeds.len();
        let target = match &self.manifest.stop {
            None => all,
            Some(stop) => {
                let known = self.known[cell].iter();
                let samples: Vec<_> = known.map(|run| run.map(|run| run.sample)).collect();
                stop::target(stop, all, self.manifest.block, &samples)
            }
        };
        let more = self.target[cell]..target;
        self.total += more.filter(|place| self.has(cell, *place)).count();
        self.target[cell] = target;
    }

    /// Finds the cell's next run.
    fn plan_next(&mut self, cell: usize) {
        let from = self.begun[cell];
        let open = |place: &usize| self.known[cell][*place].is_none() && self.has(cell, *place);
        let next = (from..self.target[cell]).find(open);
        self.queued[cell] = next;
        if let Some(place) = next {
            self.due.insert((place, cell));
        }
    }

    /// Takes a record into account.
    fn note(&mut self, record: &RunRecord) {
        let Some(&place) = self.places.get(&record.seed) else {
            return;
        };
        let cell = record.cell;
        let failed = matches!(record.outcome, RunOutcome::Failed { .. });
        let sample = match &self.manifest.stop {
            Some(stop) => sample(&record.outcome, &stop.metric),
            None => Sample::None,
        };
        if self.known[cell][place]
            .replace(Brief { failed, sample })
            .is_some()
        {
            return;
        }
        if self.has(cell, place) {
            self.done += 1;
            self.since_start += 1;
            self.failed += usize::from(failed);
        }
        self.aim(cell);
        if self.queued[cell] == Some(place) {
            self.due.remove(&(place, cell));
            self.queued[cell] = None;
        }
        if self.queued[cell].is_none() {
            self.plan_next(cell);
        }
    }

    /// The cell, if its first runs in this shard are done and all failed.
    fn hopeless(&self, cell: usize) -> Option<(usize, usize)> {
        let all = 0..self.target[cell];
        let first: Vec<usize> = all
            .filter(|place| self.has(cell, *place))
            .take(FAILURES)
            .collect();
        let failed = |place: &usize| self.known[cell][*place].is_some_and(|run| run.failed);
        let hopeless = !first.is_empty() && first.iter().all(failed);
        hopeless.then(|| (first[0], first.len()))
    }

    /// Says what the first runs, and those of earlier starts, found out.
    fn check_known(&mut self, known: &[RunRecord]) -> Result<(), StudyError> {
        if let Some(error) = self.trouble.take() {
            return Err(error);
        }
        let cells = 0..self.manifest.cells.len();
        let hopeless = cells.filter_map(|cell| Some((cell, self.hopeless(cell)?.0)));
        let Some((cell, place)) = hopeless.take(usize::from(!self.keep_going)).next() else {
            return Ok(());
        };
        let seed = self.manifest.seeds[place];
        let first = known
            .iter()
            .find(|run| (run.cell, run.seed) == (cell, seed));
        let error = match first.map(|run| &run.outcome) {
            Some(RunOutcome::Failed { error }) => error.clone(),
            _ => String::new(),
        };
        let advice = "an earlier start recorded this; if the cause is mended, remove the folder";
        Err(self.cell_fails(cell, seed, format!("{error}\n  {advice}")))
    }

    fn cell_fails(&self, cell: usize, seed: u64, error: String) -> StudyError {
        let (_, runs) = self.hopeless(cell).unwrap_or_default();
        let factors = self.manifest.factors.iter();
        let values = factors.zip(&self.manifest.cells[cell].texts);
        let values: Vec<String> = values
            .map(|(factor, text)| format!("{} = {text}", factor.name))
            .collect();
        StudyError::CellFails {
            cell,
            values: values.join(", "),
            runs,
            seed,
            error,
        }
    }

    fn tell(&mut self) {
        (self.watch)(Progress {
            done: self.done,
            total: self.total,
            failed: self.failed,
            since_start: self.since_start,
        });
    }
}

impl Dispatch for Runs<'_> {
    type Job = Job;
    type Done = Option<Run>;

    fn next(&mut self) -> Option<Job> {
        if self.trouble.is_some() || self.interrupts.is_raised() {
            return None;
        }
        let (place, cell) = self.due.pop_first()?;
        self.begun[cell] = place + 1;
        self.plan_next(cell);
        Some(Job {
            cell,
            seed: self.manifest.seeds[place],
            problem_seed: self.manifest.problem_seed(self.manifest.seeds[place]),
        })
    }

    fn done(&mut self, run: Option<Run>) {
        if let Some(run) = run {
            Runs::done(self, run);
        }
    }
}

impl Runs<'_> {
    /// Writes a run down.
    fn done(&mut self, run: Run) {
        let Run {
            cell,
            seed,
            executed,
        } = run;
        let record = RunRecord {
            cell,
            seed,
            outcome: executed.outcome,
        };
        let times = Times {
            cell,
            seed,
            setup_s: executed.setup_s,
            run_s: executed.run_s,
        };
        if let Err(message) = self.lengths.check(&self.manifest, &record) {
            let path = self.folder.clone();
            let error = StoreError::Series { path, message };
            self.trouble.get_or_insert(error.into());
            return;
        }
        if let Err(error) = self.store.append(&record, &times) {
            self.trouble.get_or_insert(error.into());
            return;
        }
        self.note(&record);
        if let RunOutcome::Failed { error } = record.outcome
            && !self.keep_going
            && self.trouble.is_none()
            && self.hopeless(cell).is_some()
        {
            self.trouble = Some(self.cell_fails(cell, seed, error));
        }
        self.tell();
    }
}

impl Results {
    /// How many runs are still to do.
    ///
    /// ```
    /// # use farside_experiments::study::results::*;
    /// # let manifest = Manifest { format: FORMAT, code_version: "0".into(), study: "s".into(),
    /// #     question: "?".into(), scenario: "x".into(), scenario_text: String::new(),
    /// #     files: Default::default(), factors: vec![], metrics: vec![], baseline: None,
    /// #     cells: vec![Cell { values: vec![], texts: vec![], sets: vec![] }], seeds: vec![1, 2],
    /// #     block: 1, stop: None, published: vec![], report: Default::default() };
    /// let results = Results { manifest, runs: Vec::new() }; // one cell, two seeds
    /// assert_eq!(results.missing(), 2);
    /// ```
    pub fn missing(&self) -> usize {
        self.missing_runs().len()
    }

    /// The runs that are still to do, as cells and places of seeds.
    pub(super) fn missing_runs(&self) -> Vec<(usize, usize)> {
        let seeds = &self.manifest.seeds;
        let missing = |cell: usize| {
            let runs = self.of_cell(cell);
            let samples: Vec<Option<Sample>> = seeds
                .iter()
                .map(|seed| {
                    let at = runs.binary_search_by_key(seed, |run| run.seed).ok()?;
                    let stop = self.manifest.stop.as_ref();
                    Some(stop.map_or(Sample::None, |stop| sample(&runs[at].outcome, &stop.metric)))
                })
                .collect();
            let target = match &self.manifest.stop {
                Some(stop) => stop::target(stop, seeds.len(), self.manifest.block, &samples),
                None => seeds.len(),
            };
            let places = (0..target).filter(move |place| samples[*place].is_none());
            places.map(move |place| (cell, place))
        };
        (0..self.manifest.cells.len()).flat_map(missing).collect()
    }
}

/// What a run says about the metric that decides when a cell has seeds enough.
pub(super) fn sample(outcome: &RunOutcome, metric: &str) -> Sample {
    match value_of(outcome, metric).as_deref() {
        Some(Value::Bool(flag)) => Sample::Flag(*flag),
        Some(value) => value.as_f64().map_or(Sample::None, Sample::Number),
        None => Sample::None,
    }
}
