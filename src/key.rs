//! The key that puts all events of a run in one order.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::ids::EntityId;
use crate::time::SimTime;

/// The key of an event: keys are unique, and events are handled in key order.
///
/// `step` counts the zero-delay hops at one instant and is 0 again after any positive delay, so a
/// cause sorts before its effect. The sender assigns the key from its own counter, so nothing
/// another actor does can change it. `tie` is zero unless the run has a tie seed.
///
/// ```
/// use farside::{EntityId, key::EventKey, time::SimTime};
/// let first = EventKey { time: SimTime::ZERO, step: 0, tie: 0, source: EntityId::CONTROL, count: 0
/// }; let hop = EventKey { step: 1, ..first };
/// assert!(first < hop);
/// ```
// The derived order is the order of the run: the fields' order is part of the contract.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct EventKey {
    /// When the event is handled.
    pub time: SimTime,
    /// Zero-delay hops since the last positive delay.
    pub step: u32,
    /// Hash that shuffles sources at one (time, step) under a tie seed; otherwise 0.
    pub tie: u32,
    /// Who caused the event: for a delivery, the link that carried it.
    pub source: EntityId,
    /// The source's own counter.
    pub count: u64,
}

impl fmt::Display for EventKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}+{} #{}.{}",
            self.time, self.step, self.source.0, self.count
        )
    }
}

/// An exclusive upper bound on the events to handle: everything before `step` of `time`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Bound {
    pub(crate) time: SimTime,
    pub(crate) step: u32,
}

impl Bound {
    #[cfg(test)]
    pub(crate) const NEVER: Bound = Bound {
        time: SimTime::MAX,
        step: u32::MAX,
    };

    pub(crate) fn at(time: SimTime) -> Self {
        Bound { time, step: 0 }
    }
}
