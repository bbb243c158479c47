//! One scenario tried: built, run, judged.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use farside::record::{Flow, Observer, ObserverError, Record};
use farside::ruling::RulingEnd;
use farside::{End, Executor, Report};
use farside_actors::system::{Files, Results, Watch};
use serde::{Deserialize, Serialize};
use toml::Table;

use crate::registry::Registry;
use crate::scenario::{Assembled, Forbidden, Scenario};

/// What scenarios are tried with.
#[derive(Clone, Copy)]
pub(super) struct Bench<'a> {
    pub(super) registry: &'a Registry,
    pub(super) files: &'a Files,
    /// What a scenario is called in messages.
    pub(super) name: &'a str,
    /// What must never happen, and is to.
    pub(super) forbidden: &'a Forbidden,
}

/// What came of a scenario.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Verdict {
    /// It happens.
    Violates {
        /// When the run ended [ns].
        end_ns: u64,
        /// The places of `[[lose]]` entries that met no message, or changed nothing.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        idle: Vec<u32>,
    },
    /// It does not.
    Holds,
    /// There is no such run.
    Impossible,
}

/// A run, and all that can be asked of it.
pub(super) struct Tried {
    pub(super) report: Report,
    pub(super) results: Results,
    lose: usize,
}

impl Bench<'_> {
    /// Reads a scenario.
    ///
    /// # Errors
    /// Why there is none, for people.
    pub(super) fn read(&self, table: &Table) -> Result<Scenario, String> {
        let text = toml::to_string(table).map_err(|error| error.to_string())?;
        let (registry, files) = (self.registry, self.files.clone());
        let scenario = Scenario::parse(self.name, text, &[], registry, files);
        let scenario = scenario.map_err(|error| error.to_string())?;
        Ok(scenario.named(self.name))
    }

    /// Runs a scenario on this thread; `prepare` may add observers. None if it was interrupted.
    ///
    /// # Errors
    /// Why it cannot run, for people.
    pub(super) fn run(
        &self,
        table: &Table,
        interrupts: &[Arc<AtomicBool>],
        prepare: impl FnOnce(&mut Assembled),
    ) -> Result<Option<Tried>, String> {
        let run = || {
            let scenario = self.read(table)?;
            let mut assembled = scenario.assemble().map_err(|error| error.to_string())?;
            prepare(&mut assembled);
            let flag = assembled.sim.interrupt();
            let interrupts = interrupts.to_vec();
            assembled.sim.observe(Breaker { interrupts, flag });
            let report = assembled.sim.run(Executor::Inline);
            let report = report.map_err(|error| error.to_string())?;
            let results = (assembled.system.conclude)(&report);
            let tried = Tried {
                lose: scenario.shared().lose.len(),
                report,
                results,
            };
            Ok(match tried.report.end {
                End::Interrupted => None,
                _ => Some(tried),
            })
        };
        // What a panic leaves behind half done is dropped with the simulation.
        let done = catch_unwind(AssertUnwindSafe(run));
        done.unwrap_or_else(|_| Err("it panicked".to_owned()))
    }

    /// Runs a scenario until it is known whether it happens; none if it was interrupted.
    pub(super) fn judge(&self, table: &Table, interrupts: &[Arc<AtomicBool>]) -> Option<Verdict> {
        let name = self.forbidden.name().to_owned();
        let is_lasting = self.forbidden.is_lasting();
        let watched = |assembled: &mut Assembled| {
            if let (true, Some(watch)) = (is_lasting, assembled.system.watch.take()) {
                assembled.sim.observe(Watcher { watch, name });
            }
        };
        match self.run(table, interrupts, watched) {
            Ok(tried) => tried.map(|tried| self.verdict(&tried)),
            Err(_) => Some(Verdict::Impossible),
        }
    }

    pub(super) fn verdict(&self, tried: &Tried) -> Verdict {
        let Tried {
            report, results, ..
        } = tried;
        match &report.end {
            End::ObserverFailed(_) => return Verdict::Impossible,
            _ if !self.forbidden.is_broken(report, results) => return Verdict::Holds,
            _ => {}
        }
        let losses = report.rulings.iter().take(tried.lose);
        let idle = (0..)
            .zip(losses)
            .filter(|(_, end)| **end != RulingEnd::Applied);
        Verdict::Violates {
            end_ns: report.end_time.as_nanos(),
            idle: idle.map(|(at, _)| at).collect(),
        }
    }
}

/// Stops a run once what must never happen has.
struct Watcher {
    watch: Watch,
    name: String,
}

impl Observer for Watcher {
    fn record(&mut self, _: &Record<'_>) -> Result<Flow, ObserverError> {
        Ok(match (self.watch)(&self.name) {
            true => Flow::Stop(self.name.clone()),
            false => Flow::Continue,
        })
    }
}

/// Interrupts a run when a flag outside is raised.
struct Breaker {
    interrupts: Vec<Arc<AtomicBool>>,
    flag: Arc<AtomicBool>,
}

impl Observer for Breaker {
    fn record(&mut self, _: &Record<'_>) -> Result<Flow, ObserverError> {
        let mut interrupts = self.interrupts.iter();
        if interrupts.any(|interrupt| interrupt.load(Ordering::Relaxed)) {
            self.flag.store(true, Ordering::SeqCst);
        }
        Ok(Flow::Continue)
    }
}
