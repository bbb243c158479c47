//! What a study would do: how many runs, and about how long they take.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Serialize;

use super::error::{StoreError, StudyError};
use super::execute::{Interrupts, execute};
use super::load;
use super::plan::StudyPlan;
use super::runner::{RunOptions, sample, unobserved};
use super::stop::{self, Sample};
use super::store::{Found, Store};

/// Where what a run takes is known from.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "by")]
pub enum Basis {
    /// The times of runs in the results folder.
    Stored {
        /// How many.
        runs: usize,
    },
    /// Runs made for this, which are not kept.
    Tried {
        /// How many: the first seed of some cells.
        runs: usize,
    },
}

/// What a study would do.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Forecast {
    /// How many cells there are.
    pub cells: usize,
    /// How many seeds each has; with a stopping rule, at most.
    pub seeds: usize,
    /// How many runs this start would make at least; with a stopping rule it may be more.
    pub runs: usize,
    /// How many it would make at most.
    pub runs_at_most: usize,
    /// How many are done.
    pub done: usize,
    /// The mean wall time of a run \[s\]; none if no run could be made.
    pub run_s: Option<f64>,
    /// What that rests on.
    pub basis: Option<Basis>,
    /// How many runs are made at once.
    pub jobs: usize,
}

impl Forecast {
    /// About how long so many runs take \[s\].
    pub fn wall_s(&self, runs: usize) -> Option<f64> {
        let at_once = self.jobs.clamp(1, runs.max(1));
        self.run_s.map(|run_s| run_s * runs as f64 / at_once as f64)
    }
}

/// The most cells of which a run is tried.
const TRIED: usize = 3;

/// Finds out what `run` would do with the same plan and options; nothing is written. If no times of
/// runs are stored, the first seed of the first, the middle and the last cell is run.
///
/// # Errors
/// When the folder holds anything else than results of this study.
pub fn forecast(
    plan: &StudyPlan,
    options: &RunOptions,
    interrupts: &Interrupts,
) -> Result<Forecast, StudyError> {
    let manifest = &plan.manifest;
    let known = match Store::look(&options.folder, manifest)? {
        Found::Nothing => Vec::new(),
        Found::Same | Found::Earlier => load::runs(&options.folder, manifest)?,
    };
    let known: BTreeMap<(usize, u64), Sample> = known
        .iter()
        .map(|run| {
            let metric = manifest.stop.as_ref().map(|stop| stop.metric.as_str());
            let sample = metric.map_or(Sample::None, |metric| sample(&run.outcome, metric));
            ((run.cell, run.seed), sample)
        })
        .collect();
    let (cells, seeds) = (manifest.cells.len(), manifest.seeds.len());
    let has = |cell: usize, place: usize| options.shard.has(manifest, cell, place);
    let count = |least: bool| {
        let of_cell = |cell: usize| {
            let of_seed = |seed: &u64| known.get(&(cell, *seed)).copied();
            let samples: Vec<Option<Sample>> = manifest.seeds.iter().map(of_seed).collect();
            let target = manifest.stop.as_ref().map_or(seeds, |rule| {
                let target = stop::target(rule, seeds, manifest.block, &samples);
                let is_over = samples[..target].iter().all(Option::is_some);
                if least || is_over { target } else { seeds }
            });
            let open = (0..target).filter(|place| samples[*place].is_none());
            open.filter(|place| has(cell, *place)).count()
        };
        (0..cells).map(of_cell).sum::<usize>()
    };
    let runs = count(true);
    let mut forecast = Forecast {
        cells,
        seeds,
        runs,
        runs_at_most: count(false).max(runs),
        done: known.len(),
        run_s: None,
        basis: None,
        jobs: options.jobs,
    };
    let stored = stored_s(&options.folder)?;
    if stored.is_empty() {
        let tried = tried_s(plan, interrupts);
        forecast.basis = Some(Basis::Tried { runs: tried.len() }).filter(|_| !tried.is_empty());
        forecast.run_s = mean(&tried);
    } else {
        forecast.basis = Some(Basis::Stored { runs: stored.len() });
        forecast.run_s = mean(&stored);
    }
    Ok(forecast)
}

fn mean(times_s: &[f64]) -> Option<f64> {
    (!times_s.is_empty()).then(|| times_s.iter().sum::<f64>() / times_s.len() as f64)
}

/// What the runs in a folder took, building them included \[s\].
fn stored_s(folder: &Path) -> Result<Vec<f64>, StoreError> {
    let mut all = Vec::new();
    for path in load::files_called(folder, "times")? {
        // A process that was killed leaves a cut line; times decide nothing.
        let text = std::fs::read_to_string(&path).unwrap_or_default();
        let lines = text
            .lines()
            .filter_map(|line| serde_json::from_str(line).ok());
        all.extend(lines.filter_map(|times: serde_json::Value| {
            Some(times["setup_s"].as_f64()? + times["run_s"].as_f64()?)
        }));
    }
    Ok(all)
}

/// What a run of some cells takes \[s\].
fn tried_s(plan: &StudyPlan, interrupts: &Interrupts) -> Vec<f64> {
    let manifest = &plan.manifest;
    let last = manifest.cells.len() - 1;
    let mut cells = vec![0, last / 2, last];
    cells.dedup();
    cells.truncate(TRIED);
    let seed = manifest.seeds[0];
    let tried = cells.into_iter().filter_map(|cell| {
        let scenario = &plan.scenarios[cell];
        let seeds = scenario.seeds_of(seed, manifest.problem_seed(seed));
        let executed = execute(scenario, seeds, &manifest.metrics, interrupts, unobserved)?;
        Some(executed.setup_s + executed.run_s).filter(|time_s| *time_s > 0.0)
    });
    tried.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registry::Registry;
    use crate::study::{Shard, Study, run};

    fn plan(seeds: u64, stop: &str) -> StudyPlan {
        let text = format!(
            "question = '?'\nscenario = 'network/crater-sparse'\nmetrics = ['arrived']\n\
             set = {{ until = '5s', team.rovers = 1 }}\n{stop}\n\
             [[factor]]\nname = 'loss'\nkey = 'links.default.loss'\nvalues = [0, 0.1, 0.2]\n"
        );
        let study = Study::parse("s.toml", text, "".into()).unwrap();
        let seeds = stop.is_empty().then_some(seeds);
        study.plan(&[], seeds, &Registry::builtin()).unwrap()
    }

    fn foretold(plan: &StudyPlan, options: &RunOptions) -> Forecast {
        forecast(plan, options, &Interrupts::default()).unwrap()
    }

    #[test]
    fn what_is_foretold_is_what_is_run() {
        let folder = tempfile::tempdir().unwrap();
        let mut options = RunOptions::new(folder.path().join("s"));
        options.jobs = 1;
        let before = foretold(&plan(4, ""), &options);
        assert_eq!((before.runs, before.runs_at_most, before.done), (12, 12, 0));
        assert_eq!(before.basis, Some(Basis::Tried { runs: 3 }));
        assert!(!options.folder.exists(), "nothing is written");
        options.shard = "1/2".parse().unwrap();
        let half = foretold(&plan(4, ""), &options);
        let mut total = 0;
        run(plan(4, ""), &options, &Interrupts::default(), &mut |at| {
            total = at.total
        })
        .unwrap();
        assert_eq!(half.runs, total);
        let after = foretold(&plan(4, ""), &options);
        assert_eq!((after.runs, after.done), (0, 6));
        assert_eq!(after.basis, Some(Basis::Stored { runs: 6 }));
        options.shard = Shard::WHOLE;
        let rest = foretold(&plan(4, ""), &options);
        assert_eq!(rest.runs, 6);
        let twice = Forecast {
            run_s: Some(3.0),
            jobs: 2,
            ..rest
        };
        assert_eq!((twice.wall_s(6), twice.wall_s(1)), (Some(9.0), Some(3.0)));
    }

    #[test]
    fn a_stopping_rule_has_a_least_and_a_most() {
        let rule = "stop = { metric = 'arrived', width = 1.0, min_seeds = 5, max_seeds = 20 }";
        let folder = tempfile::tempdir().unwrap();
        let options = RunOptions::new(folder.path().join("s"));
        let told = foretold(&plan(0, rule), &options);
        assert_eq!((told.runs, told.runs_at_most), (15, 60));
    }
}
