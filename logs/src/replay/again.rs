//! A replay on records of the run executed again, where its log does not hold all that it takes.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use farside::key::EventKey;
use farside::record::{Flow, Observer, ObserverError, Record, RecordClass, Wants};
use farside::replay::{ChargeJournal, RecordEnd, Recorded, Replay};
use farside::{End, Kind, Report, RunInfo, Simulation};

use super::told::{ReplayOutcome, Schemas};

/// Feeds a replay with what it watches.
struct Feeder {
    state: Arc<Mutex<State>>,
    charges: ChargeJournal,
    /// The key of the last event.
    last: Option<EventKey>,
}

struct State {
    replay: Option<Replay>,
    samples: BTreeMap<String, Arc<Kind>>,
    outcome: Option<ReplayOutcome>,
    /// Why it cannot go on.
    error: Option<String>,
}

/// The outcome of a replay beside a run, once that is over.
#[derive(Clone)]
pub struct Again(Arc<Mutex<State>>);

/// Replays actors on what happens in `sim`, the run as its log has it, while that is executed; on one thread, so
/// that charges come in order. A verifier added before it stops the run where it differs from its log.
///
/// ```
/// use farside::prelude::*;
/// use farside::replay::Replay;
/// # struct Idle;
/// # impl Actor for Idle { type Accepts = (); }
/// fn assemble() -> Simulation {
///     let mut sim = Simulation::new(7);
///     let host = sim.host("rover_01");
///     sim.actor(host, "rover_01", |_| Idle);
///     sim
/// }
/// let replay = Replay::new(assemble(), |name| name == "rover_01")?;
/// let mut sim = assemble();
/// let again = farside_logs::again(&mut sim, replay);
/// sim.run(Executor::Inline)?;
/// let outcome = again.outcome()?;
/// assert_eq!((outcome.steps, outcome.differing()), (1, 0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn again(sim: &mut Simulation, mut replay: Replay) -> Again {
    replay.charges_are_told();
    let state = Arc::new(Mutex::new(State {
        replay: Some(replay),
        samples: BTreeMap::new(),
        outcome: None,
        error: None,
    }));
    let charges = sim.journal_charges();
    sim.observe(Feeder {
        state: state.clone(),
        charges,
        last: None,
    });
    Again(state)
}

impl Again {
    /// What came of it. Can be taken once.
    ///
    /// # Errors
    /// Why the replay could not take a record, or that the run is not over.
    pub fn outcome(&self) -> Result<ReplayOutcome, String> {
        let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match state.error.take() {
            Some(error) => Err(error),
            None => state
                .outcome
                .take()
                .ok_or_else(|| "the run is not over".to_owned()),
        }
    }
}

impl Observer for Feeder {
    fn wants(&self) -> Wants {
        Wants {
            bodies: true,
            samples: true,
            checkpoints: false,
        }
    }

    fn begin(&mut self, run: &Arc<RunInfo>) -> Result<(), ObserverError> {
        let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let names = |info: &RunInfo| -> Vec<String> {
            let entities = info.entities.iter();
            entities.map(|entity| entity.name.clone()).collect()
        };
        match &state.replay {
            Some(replay) if names(replay.info()) != names(run) => Err(ObserverError(
                "the replay has other actors or links than the run".to_owned(),
            )),
            _ => Ok(()),
        }
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        if record.class != RecordClass::InFlight {
            self.last = Some(record.key);
        }
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let State {
            replay: Some(replay),
            samples,
            error,
            ..
        } = &mut *state
        else {
            return Ok(Flow::Continue);
        };
        for charge in self.charges.take() {
            replay.charge(&charge);
        }
        let is_near = replay.is_near(record.sender) || replay.is_near(record.receiver);
        if !is_near && record.class != RecordClass::Stop {
            return Ok(Flow::Continue);
        }
        if let (RecordClass::Sample, Some(kind)) = (record.class, record.kind)
            && !samples.contains_key(kind.name())
        {
            samples.insert(kind.name().to_owned(), kind.clone());
        }
        match replay.feed(&Recorded::from(record)) {
            Ok(()) => Ok(Flow::Continue),
            Err(wrong) => {
                *error = Some(wrong.to_string());
                Ok(Flow::Stop("the replay cannot go on".to_owned()))
            }
        }
    }

    fn end(&mut self, report: &Report) -> Result<(), ObserverError> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(replay) = state.replay.take() else {
            return Ok(());
        };
        let info = replay.info().clone();
        let at = report.end_time;
        let report = replay.finish(match &report.end {
            End::Completed => RecordEnd::Completed { at },
            End::Stopped { .. } => RecordEnd::Stopped { at },
            End::Fault(fault) => RecordEnd::Fault {
                at,
                text: fault.to_string(),
                last: self.last,
            },
            End::Interrupted | End::ObserverFailed(_) => RecordEnd::Cut {
                at,
                last: self.last,
            },
        });
        let schemas = Schemas {
            info: &info,
            samples: &state.samples,
        };
        let outcome = ReplayOutcome::of(&report, &schemas);
        state.outcome = Some(outcome);
        Ok(())
    }
}
