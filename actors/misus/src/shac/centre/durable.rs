//! What a centre keeps through a crash, as a value that grows write by write.

use std::collections::BTreeMap;

use farside::SimTime;
use serde::{Deserialize, Serialize};

use crate::shac::outcomes::{Outcome, Outcomes};
use crate::shac::record::GoalRecord;
use crate::shac::values::{GoalKey, Term};

/// What a centre keeps through a crash.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CentreDurable {
    /// How often it was started.
    pub incarnation: u32,
    /// What it knows of terms.
    pub office: Office,
    /// All goals it was ever told of.
    pub table: BTreeMap<GoalKey, GoalRecord>,
    /// Outcomes that it knows of.
    pub outcomes: Outcomes,
}

/// What a centre knows of terms.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Office {
    /// The latest term that it knows of.
    pub term: Term,
    /// The latest term for which it was elected.
    pub elected: Term,
    /// When all leases of earlier terms have ended, known or not.
    pub waits_until: SimTime,
}

/// Something that a centre writes, which is a state sample too.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum CentreWrite {
    /// It started.
    Started {
        /// How often, with this time.
        incarnation: u32,
    },
    /// It stands, is elected, or knows of another centre.
    Office(Office),
    /// What has become of a goal.
    Goal(GoalRecord),
    /// It knows of an outcome.
    Outcome(Outcome),
}

impl CentreDurable {
    /// Carries out a write.
    pub fn apply(&mut self, write: &CentreWrite) {
        match write {
            CentreWrite::Started { incarnation } => self.incarnation = *incarnation,
            CentreWrite::Office(office) => self.office = *office,
            CentreWrite::Goal(record) => {
                self.table.insert(record.wish.goal.key, record.clone());
            }
            CentreWrite::Outcome(outcome) => {
                self.outcomes.insert(*outcome);
            }
        }
    }
}
