//! How a run ended: the digest, the counts, and why.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::digest::Digest;
use crate::fault::Fault;
use crate::ruling::RulingEnd;
use crate::time::SimTime;

/// Why a run ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum End {
    /// Nothing was left to happen.
    Completed,
    /// An actor, an observer or a control event stopped it.
    Stopped {
        /// The name of who asked, `@control` for a control event or an observer.
        by: String,
        /// The reason given.
        reason: String,
    },
    /// The interrupt flag was raised from outside.
    Interrupted,
    /// A fault.
    Fault(Box<Fault>),
    /// An observer failed; the run ends because it can no longer be recorded.
    ObserverFailed(String),
}

impl End {
    /// One word for logs and programs.
    pub fn name(&self) -> &'static str {
        match self {
            End::Completed => "completed",
            End::Stopped { .. } => "stopped",
            End::Interrupted => "interrupted",
            End::Fault(_) => "fault",
            End::ObserverFailed(_) => "observer_failed",
        }
    }

    /// What there is to say beyond the name; empty when the run simply completed.
    pub fn detail(&self) -> String {
        match self {
            End::Completed | End::Interrupted => String::new(),
            End::Stopped { by, reason } => format!("{by}: {reason}"),
            End::Fault(fault) => fault.to_string(),
            End::ObserverFailed(error) => error.clone(),
        }
    }
}

/// What a run counted. Every copy of a message is delivered, lost or in flight.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counts {
    /// Events handled.
    pub events: u64,
    /// Messages sent, links' further copies not included.
    pub sent: u64,
    /// Copies delivered.
    pub delivered: u64,
    /// Copies lost.
    pub lost: u64,
    /// Further copies that links made.
    pub duplicated: u64,
    /// Copies on their way when the run ended.
    pub in_flight: u64,
    /// Copies lost, by reason.
    pub lost_by_reason: BTreeMap<String, u64>,
}

/// The result of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// The digest over all that was committed; [`Digest::EMPTY`] if it was switched off.
    pub digest: Digest,
    /// What happened, in numbers.
    pub counts: Counts,
    /// The virtual time at which the run ended.
    pub end_time: SimTime,
    /// Why it ended.
    pub end: End,
    /// What came of each ruling on a message, in the order of
    /// [`Simulation::rule`](crate::Simulation::rule).
    pub rulings: Vec<RulingEnd>,
}

impl Report {
    /// The fault that ended the run, if one did.
    pub fn fault(&self) -> Option<&Fault> {
        match &self.end {
            End::Fault(fault) => Some(fault),
            _ => None,
        }
    }
}
