//! What an owner keeps through a crash, as a value that grows write by write.

use std::collections::BTreeMap;

use farside::SimTime;
use serde::{Deserialize, Serialize};

use crate::shac::messages::{Held, HoldingState};
use crate::shac::outcomes::{Outcome, Outcomes};
use crate::shac::values::{GoalKey, Grant, Reason, Revision, SharedGoal, Term, Version};

/// What an owner keeps through a crash.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OwnerDurable {
    /// Its incarnation and the number of its latest status.
    pub version: Version,
    /// Counts the changes after which it may do what it has refused.
    pub capacity: u32,
    /// Whom it supports.
    pub promise: Promise,
    /// What it holds.
    pub held: BTreeMap<GoalKey, Holding>,
    /// How its last holding of other goals ended.
    pub closed: BTreeMap<GoalKey, Closing>,
    /// Outcomes that it knows of.
    pub outcomes: Outcomes,
}

/// Which centre's term an owner supports, and until when it supports no other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Promise {
    /// Which term.
    pub term: Term,
    /// Until when.
    pub until: SimTime,
}

/// A goal that the rover has accepted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Holding {
    /// The goal, with the parameters as they are now.
    pub goal: SharedGoal,
    /// Which edition of it.
    pub revision: Revision,
    /// Under which grant.
    pub grant: Grant,
    /// When the right to start it ends.
    pub lease_end: SimTime,
    /// Of half of a joint goal: whether another rover is bound to the other half.
    pub confirmed: bool,
    /// When it was started.
    pub started: Option<SimTime>,
}

/// How a holding, or an offer of one, ended.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Closing {
    /// Of which goal.
    pub goal: GoalKey,
    /// Under which grant.
    pub grant: Grant,
    /// How.
    pub state: HoldingState,
    /// Why.
    pub reason: Option<Reason>,
    /// The rover's capacity then.
    pub capacity: u32,
    /// The record, if it was done.
    pub outcome: Option<Outcome>,
}

/// Something that an owner writes, which is a state sample too.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum OwnerWrite {
    /// It started, or its status or its capacity has changed.
    Status {
        /// The version of its status.
        version: Version,
        /// See [`OwnerDurable::capacity`].
        capacity: u32,
    },
    /// It supports a term.
    Promise(Promise),
    /// It holds a goal.
    Held(Holding),
    /// It holds a goal no more, or has refused it.
    Closed(Closing),
    /// It knows of an outcome.
    Outcome(Outcome),
}

impl OwnerDurable {
    /// Carries out a write.
    pub fn apply(&mut self, write: &OwnerWrite) {
        match *write {
            OwnerWrite::Status { version, capacity } => {
                self.version = version;
                self.capacity = capacity;
            }
            OwnerWrite::Promise(promise) => self.promise = promise,
            OwnerWrite::Held(holding) => {
                self.closed.remove(&holding.goal.key);
                self.held.insert(holding.goal.key, holding);
            }
            OwnerWrite::Closed(closing) => {
                self.held.remove(&closing.goal);
                self.closed.insert(closing.goal, closing);
            }
            OwnerWrite::Outcome(outcome) => {
                self.outcomes.insert(outcome);
            }
        }
    }

    /// What it has, or had, of a goal.
    pub fn present(&self, goal: GoalKey) -> Option<Held> {
        let held = self.held.get(&goal).map(|holding| self.of_holding(holding));
        held.or_else(|| self.closed.get(&goal).map(Closing::held))
    }

    /// What it tells of a holding.
    pub(super) fn of_holding(&self, holding: &Holding) -> Held {
        let parameters = &holding.goal.parameters;
        Held {
            goal: holding.goal.key,
            grant: holding.grant,
            state: match holding.started {
                None => HoldingState::Accepted,
                Some(_) => HoldingState::Started,
            },
            lease_end: holding.lease_end,
            confirmed: holding.confirmed,
            revision: holding.revision,
            scheduled: parameters.scheduled,
            duration: parameters.duration,
            memory_bits: parameters.memory_bits,
            reason: None,
            capacity: self.capacity,
            outcome: None,
        }
    }
}

impl Closing {
    /// What is told of it.
    pub(super) fn held(&self) -> Held {
        Held {
            goal: self.goal,
            grant: self.grant,
            state: self.state,
            lease_end: SimTime::ZERO,
            confirmed: false,
            revision: Revision::default(),
            scheduled: None,
            duration: farside::SimDuration::ZERO,
            memory_bits: 0.0,
            reason: self.reason,
            capacity: self.capacity,
            outcome: self.outcome,
        }
    }
}
