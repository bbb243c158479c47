//! One scenario under many tie seeds, on all cores.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use farside::{End, Executor, Report};
use farside_actors::system::{Results, System};
use farside_logs::LogWriter;
use indicatif::ProgressBar;
use serde_json::Value;

use crate::commands::CommandError;
use crate::commands::run::log_options;
use crate::registry::Registry;
use crate::scenario::condition::names;
use crate::scenario::{Forbidden, Scenario};
use crate::study::Interrupts;

/// A scenario, and what its runs need.
pub(super) struct Runs<'a> {
    pub(super) scenario: &'a Scenario,
    pub(super) system: &'a dyn System,
    pub(super) registry: &'a Registry,
    pub(super) interrupts: &'a Interrupts,
}

/// What a run came to.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Ran {
    pub(super) tie_seed: Option<u64>,
    pub(super) digest: String,
    pub(super) has_failed: bool,
    /// Name and value of each, in the same order in all runs of a scenario as far as they have the same.
    pub(super) conclusions: Vec<(String, Value)>,
}

impl Runs<'_> {
    /// What the runs with these tie seeds came to, in their order.
    pub(super) fn all(
        &self,
        tie_seeds: &[Option<u64>],
        jobs: usize,
    ) -> Result<Vec<Ran>, CommandError> {
        let bar = ProgressBar::new(tie_seeds.len() as u64);
        let next = AtomicUsize::new(0);
        let done = Mutex::new(BTreeMap::new());
        let work = || {
            loop {
                let number = next.fetch_add(1, Ordering::Relaxed);
                let Some(tie_seed) = tie_seeds.get(number) else {
                    return;
                };
                if self.interrupts.is_raised() {
                    return;
                }
                let ran = self.one(*tie_seed, None);
                bar.inc(1);
                let mut done = done.lock().unwrap_or_else(PoisonError::into_inner);
                done.insert(number, ran);
            }
        };
        std::thread::scope(|scope| {
            for _ in 0..jobs.min(tie_seeds.len()) {
                scope.spawn(work);
            }
        });
        bar.finish_and_clear();
        let done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
        if self.interrupts.is_raised() {
            return Err(interrupted());
        }
        done.into_values().collect()
    }

    /// One run, logged whole if there is somewhere to.
    pub(super) fn one(
        &self,
        tie_seed: Option<u64>,
        log: Option<&Path>,
    ) -> Result<Ran, CommandError> {
        let mut assembled = self.scenario.assemble()?;
        assembled.sim.tie_seed(tie_seed);
        if let Some(path) = log {
            let mut options =
                log_options(self.scenario, &assembled, Executor::Inline, self.registry)?;
            options.exclude.clear();
            assembled.sim.observe(LogWriter::create(path, options)?);
        }
        self.interrupts.watch(&assembled.sim.interrupt());
        let report = assembled.sim.run(Executor::Inline)?;
        match &report.end {
            End::Interrupted => return Err(interrupted()),
            End::ObserverFailed(error) => return Err(CommandError::Arguments(error.clone())),
            _ => {}
        }
        let results = (assembled.system.conclude)(&report);
        Ok(Ran {
            tie_seed,
            digest: report.digest.to_string(),
            has_failed: matches!(report.end, End::Fault(_)),
            conclusions: self.conclusions(&report, &results),
        })
    }

    fn conclusions(&self, report: &Report, results: &Results) -> Vec<(String, Value)> {
        let mut all = vec![("end".to_owned(), Value::from(end(report)))];
        for name in names(self.system) {
            // Names of the system's own are read as they are.
            let Ok(forbidden) = Forbidden::parse(name, self.system) else {
                continue;
            };
            let is_broken = forbidden.is_broken(report, results);
            all.push((format!("broken: {name}"), is_broken.into()));
        }
        all.push((
            "sim_time_s".to_owned(),
            report.end_time.as_secs_f64().into(),
        ));
        let metrics = results.metrics.iter();
        all.extend(metrics.map(|(name, value)| (name.clone(), value.clone())));
        all
    }
}

/// Why a run ended, without when.
fn end(report: &Report) -> String {
    match &report.end {
        End::Completed => "nothing was left to happen".to_owned(),
        End::Stopped { reason, .. } => reason.clone(),
        End::Fault(fault) => format!("FAILED: {fault}"),
        other => other.name().to_owned(),
    }
}

fn interrupted() -> CommandError {
    CommandError::Interrupted("which conclusions hang on ties is not told".to_owned())
}
