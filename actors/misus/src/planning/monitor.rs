//! The monitor: keeps what planners recorded of their steps, for the results. It sees committed records only,
//! and never an actor.

use std::sync::{Arc, Mutex, PoisonError};

use farside::RunInfo;
use farside::record::{Flow, Observer, ObserverError, Record, RecordClass, Wants};

use super::messages::{CentralRound, PlannerStep};
use super::shared::{CENTRE, Shared};

/// What is known of all planners.
#[derive(Default)]
pub(super) struct Tally {
    /// By rover: its steps, in order.
    pub(super) steps: Vec<Vec<PlannerStep>>,
    pub(super) reassigned: u64,
    /// What the centre looked at.
    pub(super) central_operations: u64,
    /// The goals that were given up.
    pub(super) deleted: Vec<u32>,
}

/// What an actor is.
#[derive(Clone, Copy)]
enum Role {
    Other,
    Centre,
    Rover(usize),
}

/// Watches a run.
pub(super) struct Monitor {
    shared: Arc<Shared>,
    tally: Arc<Mutex<Tally>>,
    roles: Vec<Role>,
}

impl Monitor {
    /// A monitor, and what it will write to.
    pub(super) fn new(shared: Arc<Shared>) -> (Monitor, Arc<Mutex<Tally>>) {
        let tally = Arc::new(Mutex::new(Tally {
            steps: vec![Vec::new(); shared.rovers.len()],
            ..Tally::default()
        }));
        let monitor = Monitor {
            shared,
            tally: tally.clone(),
            roles: Vec::new(),
        };
        (monitor, tally)
    }

    fn role(&self, name: &str) -> Role {
        let rover = self.shared.rovers.iter().position(|rover| rover == name);
        match rover {
            Some(rover) => Role::Rover(rover),
            None if name == CENTRE => Role::Centre,
            None => Role::Other,
        }
    }
}

impl Observer for Monitor {
    fn wants(&self) -> Wants {
        Wants {
            bodies: false,
            samples: true,
            checkpoints: false,
        }
    }

    fn begin(&mut self, run: &Arc<RunInfo>) -> Result<(), ObserverError> {
        let roles = run.entities.iter().map(|one| self.role(&one.name));
        self.roles = roles.collect();
        Ok(())
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        let (Some(kind), RecordClass::Sample) = (record.kind, record.class) else {
            return Ok(Flow::Continue);
        };
        let failed = |error: farside::encoding::DecodeError| ObserverError(error.to_string());
        let mut tally = self.tally.lock().unwrap_or_else(PoisonError::into_inner);
        match (self.roles[record.sender.index()], kind.name()) {
            (Role::Rover(rover), "PlannerStep") => {
                let step: PlannerStep = kind.schema().decode(record.body).map_err(failed)?;
                tally.steps[rover].push(step);
            }
            (Role::Centre, "CentralRound") => {
                let round: CentralRound = kind.schema().decode(record.body).map_err(failed)?;
                tally.reassigned += u64::from(round.reassigned);
                tally.central_operations += round.operations;
                tally.deleted = round.deleted;
            }
            _ => {}
        }
        Ok(Flow::Continue)
    }
}
