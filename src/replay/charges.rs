//! What links charge, from the run to the replay.

use std::sync::{Arc, Mutex, PoisonError};

use crate::carrier::{AnyCarrier, Parcel, Verdicts};
use crate::ids::{EntityId, KindIndex};
use crate::key::EventKey;
use crate::time::SimTime;
use crate::topology::FixedMap;

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

/// Which message of whom is charged what as it is sent.
#[derive(Clone, Default)]
pub(super) struct OnSending(Arc<Mutex<FixedMap<(EntityId, ChargedMessage), f64>>>);

impl OnSending {
    pub(super) fn add(&self, sender: EntityId, message: ChargedMessage, energy_j: f64) {
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        *known.entry((sender, message)).or_default() += energy_j;
    }

    fn take(&self, sender: EntityId, message: ChargedMessage) -> f64 {
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        known.remove(&(sender, message)).unwrap_or_default()
    }
}

/// A link of a replay: takes each message to the comparison, and none any further.
pub(super) struct Absent(pub(super) OnSending);

/// Why messages do not arrive in a replay.
pub(super) const REPLAYED: &str = "replayed";

impl AnyCarrier for Absent {
    fn carry(&mut self, parcel: &Parcel<'_>, verdicts: &mut Verdicts) {
        let message = ChargedMessage {
            receiver: parcel.receiver,
            kind: parcel.kind_index as KindIndex,
            ordinal: parcel.ordinal,
        };
        let energy_j = self.0.take(parcel.sender, message);
        if energy_j != 0.0 {
            verdicts.charge(energy_j);
        }
        verdicts.lose(REPLAYED);
    }

    fn change(&mut self, _change: Box<dyn std::any::Any + Send>, _now: SimTime) {}
}
