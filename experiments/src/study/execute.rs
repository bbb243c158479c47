//! One run of a study: built, executed, concluded. Whatever goes wrong in it is its outcome.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError, Weak};

use farside::{Counts, End, Executor, Report};
use serde_json::{Map, Value};

use crate::scenario::{Assembled, Never, Planned, Scenario};
use crate::wall::timed;
use farside_actors::system::{Results, Seeds};

use super::results::{MessageCounts, Metric, RunOutcome};

/// Ends all runs of a study early.
///
/// ```
/// use farside_experiments::study::Interrupts;
/// let interrupts = Interrupts::default();
/// interrupts.clone().raise();
/// assert!(interrupts.is_raised());
/// ```
#[derive(Clone, Debug, Default)]
pub struct Interrupts(Arc<Inner>);

#[derive(Debug, Default)]
struct Inner {
    raised: AtomicBool,
    /// The flags of the runs under way.
    runs: Mutex<Vec<Weak<AtomicBool>>>,
}

impl Interrupts {
    /// Ends the runs under way after the event in hand; no other begins.
    pub fn raise(&self) {
        self.0.raised.store(true, Ordering::SeqCst);
        let runs = self.0.runs.lock().unwrap_or_else(PoisonError::into_inner);
        for run in runs.iter().filter_map(Weak::upgrade) {
            run.store(true, Ordering::SeqCst);
        }
    }

    /// Whether it was raised.
    pub fn is_raised(&self) -> bool {
        self.0.raised.load(Ordering::SeqCst)
    }

    /// Raises `run` too when it is raised.
    pub(crate) fn watch(&self, run: &Arc<AtomicBool>) {
        let mut runs = self.0.runs.lock().unwrap_or_else(PoisonError::into_inner);
        runs.retain(|run| run.strong_count() > 0);
        runs.push(Arc::downgrade(run));
        if self.is_raised() {
            run.store(true, Ordering::SeqCst);
        }
    }
}

/// What came of an execution.
#[derive(Debug)]
pub(crate) struct Executed {
    /// What is recorded of it.
    pub(crate) outcome: RunOutcome,
    /// Why its log, or another observer, could not go on; then the outcome says nothing.
    pub(crate) unrecorded: Option<String>,
    /// All that the system reports.
    pub(crate) metrics: Map<String, Value>,
    /// The wall time of building the simulation [s].
    pub(crate) setup_s: f64,
    /// The wall time of running it [s].
    pub(crate) run_s: f64,
}

impl Executed {
    fn failed(error: String) -> Self {
        Executed {
            outcome: RunOutcome::Failed { error },
            unrecorded: None,
            metrics: Map::new(),
            setup_s: 0.0,
            run_s: 0.0,
        }
    }
}

/// Runs `scenario` with `seeds` on this thread; `prepare` may add observers. `None` if it was
/// interrupted: that says nothing about the run.
pub(crate) fn execute<E: std::fmt::Display>(
    scenario: &Scenario,
    seeds: Seeds,
    metrics: &[Metric],
    interrupts: &Interrupts,
    prepare: impl FnOnce(&mut Assembled) -> Result<(), E>,
) -> Option<Executed> {
    // What a panic leaves behind half done is dropped with the simulation.
    let executed = catch_unwind(AssertUnwindSafe(|| {
        run(scenario, seeds, metrics, interrupts, prepare)
    }));
    executed.unwrap_or_else(|payload| {
        let text = panic_text(&*payload);
        Some(Executed::failed(format!("panicked: {text}")))
    })
}

fn run<E: std::fmt::Display>(
    scenario: &Scenario,
    seeds: Seeds,
    metrics: &[Metric],
    interrupts: &Interrupts,
    prepare: impl FnOnce(&mut Assembled) -> Result<(), E>,
) -> Option<Executed> {
    let (assembled, setup_s) = timed(|| scenario.assemble_seeded(seeds));
    let mut assembled = match assembled {
        Ok(assembled) => assembled,
        Err(error) => return Some(Executed::failed(error.to_string())),
    };
    if let Err(error) = prepare(&mut assembled) {
        return Some(Executed::failed(error.to_string()));
    }
    interrupts.watch(&assembled.sim.interrupt());
    let planned = std::mem::take(&mut assembled.planned);
    let ((report, results), run_s) = timed(|| {
        let report = assembled.sim.run(Executor::Inline);
        let results = report
            .as_ref()
            .map(|report| (assembled.system.conclude)(report));
        let results = results.unwrap_or_default();
        (report, results)
    });
    let unrecorded = match &report {
        Ok(report) => match &report.end {
            End::ObserverFailed(error) => Some(error.clone()),
            _ => None,
        },
        Err(_) => None,
    };
    let outcome = match report {
        Ok(report) => outcome(scenario, &report, &results, metrics, &planned)?,
        Err(error) => RunOutcome::Failed {
            error: error.to_string(),
        },
    };
    Some(Executed {
        outcome,
        unrecorded,
        metrics: results.metrics,
        setup_s,
        run_s,
    })
}

/// What is recorded of a run; nothing if it was interrupted.
fn outcome(
    scenario: &Scenario,
    report: &Report,
    results: &Results,
    metrics: &[Metric],
    planned: &Planned,
) -> Option<RunOutcome> {
    match &report.end {
        End::Interrupted => return None,
        End::Fault(_) | End::ObserverFailed(_) => {
            return Some(RunOutcome::Failed {
                error: report.end.detail(),
            });
        }
        End::Completed | End::Stopped { .. } => {}
    }
    let measured = metrics.iter().filter_map(|metric| {
        let value = results.metrics.get(&metric.name)?;
        Some((metric.name.clone(), value.clone()))
    });
    let never = planned.never(report).filter(Never::is_whole);
    Some(RunOutcome::Done {
        end: report.end.name().to_owned(),
        end_detail: report.end.detail(),
        digest: report.digest.to_string(),
        sim_time_s: report.end_time.as_secs_f64(),
        timed_out: scenario.is_time_out(&report.end),
        events: report.counts.events,
        messages: (&report.counts).into(),
        metrics: measured.collect(),
        violations: results.violations.clone(),
        never_reached: never.map(|never| never.key().to_owned()).collect(),
    })
}

impl From<&Counts> for MessageCounts {
    fn from(counts: &Counts) -> Self {
        MessageCounts {
            sent: counts.sent,
            delivered: counts.delivered,
            lost: counts.lost,
            duplicated: counts.duplicated,
            in_flight: counts.in_flight,
            lost_by_reason: counts.lost_by_reason.clone(),
        }
    }
}

fn panic_text(payload: &(dyn std::any::Any + Send)) -> String {
    let text = payload
        .downcast_ref::<&str>()
        .map(|text| (*text).to_owned());
    text.or_else(|| payload.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "a value that is no text".to_owned())
}
