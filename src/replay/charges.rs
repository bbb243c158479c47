//! Links of a replay, and what they charge.

use std::sync::{Arc, Mutex, PoisonError};

use crate::carrier::{AnyCarrier, Parcel, Verdicts};
use crate::charge::ChargedMessage;
use crate::ids::{EntityId, KindIndex};
use crate::time::SimTime;
use crate::topology::FixedMap;

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
