//! What links charge in a run, for who wants to have it in order.

use std::sync::{Arc, Mutex, PoisonError};

use crate::ids::EntityId;
use crate::key::EventKey;

/// Something that a link charged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Charge {
    /// The event in which it was charged.
    pub key: EventKey,
    /// Who was charged for transmitting, or for whom the host received.
    pub actor: EntityId,
    /// For transmitting \[J\].
    pub transmit_j: f64,
    /// For receiving \[J\].
    pub receive_j: f64,
    /// The message as whose sending it was charged; none if it was charged later.
    pub message: Option<ChargedMessage>,
}

/// Which message of an actor was charged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ChargedMessage {
    /// Who it is for.
    pub receiver: EntityId,
    /// The number of its kind in [`RunInfo::kinds`](crate::RunInfo::kinds).
    pub kind: u32,
    /// Its place in the flow.
    pub ordinal: u64,
}

/// What links charge in a run, in order: [`Simulation::journal_charges`](crate::Simulation::journal_charges).
#[derive(Clone, Debug, Default)]
pub struct ChargeJournal(Arc<Mutex<Vec<Charge>>>);

impl ChargeJournal {
    pub(crate) fn note(&self, charge: Charge) {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push(charge);
    }

    /// Takes what was charged since it was last taken.
    pub fn take(&self) -> Vec<Charge> {
        std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}
