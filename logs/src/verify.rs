//! Comparing a log with a re-execution of its run, record by record, as it goes on.

use std::path::Path;

use farside::record::{Flow, Observer, ObserverError, Record};
use serde::Serialize;

use crate::LogError;

/// The first record in which a log and a re-execution differ.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Mismatch {
    /// The virtual time of the record, in seconds.
    pub time_s: f64,
    /// Its topic.
    pub topic: String,
    /// Who sent the message, or whom the event happened to.
    pub sender: String,
    /// Who the message is for.
    pub receiver: String,
    /// The message's place in its flow.
    pub ordinal: u64,
    /// The field that differs, as in `body.pose.x`.
    pub field: String,
    /// Its value in the log.
    pub logged: String,
    /// Its value in the re-execution.
    pub rerun: String,
}

/// What came of comparing a log with a re-execution.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "result", rename_all = "snake_case")]
pub enum VerifyOutcome {
    /// Every record, every checkpoint and the end are the same.
    Same {
        /// How many records of the log were compared.
        records: u64,
        /// How many checkpoints were compared.
        checkpoints: u64,
        /// The digest of both.
        digest: String,
    },
    /// The log is a prefix of a run, and the same as the re-execution as far as it goes.
    Prefix {
        /// How many records of the log were compared.
        records: u64,
        /// How many checkpoints were compared.
        checkpoints: u64,
        /// The virtual time of the log's last record, in seconds.
        last_s: Option<f64>,
        /// The virtual time of the log's last checkpoint, in seconds: up to there filtered topics
        /// agree too.
        last_checkpoint_s: Option<f64>,
        /// What the log lacks.
        missing: String,
    },
    /// They differ, here first.
    Different {
        /// How many records before this one are the same.
        records: u64,
        /// The first difference.
        first: Box<Mismatch>,
    },
}

/// An observer that compares the run it watches with a log.
pub struct Verifier {}

/// Gives the outcome of a [`Verifier`] once the run is over.
#[derive(Clone)]
pub struct VerifyHandle {}

impl Verifier {
    /// A verifier against the log at `path`.
    pub fn open(path: impl AsRef<Path>) -> Result<Verifier, LogError> {
        let _ = path.as_ref();
        todo!()
    }

    /// A handle to the outcome, to keep when the verifier is given to a simulation.
    pub fn handle(&self) -> VerifyHandle {
        VerifyHandle {}
    }
}

impl VerifyHandle {
    /// The outcome.
    pub fn outcome(&self) -> Result<VerifyOutcome, LogError> {
        todo!()
    }
}

impl Observer for Verifier {
    fn record(&mut self, _record: &Record<'_>) -> Result<Flow, ObserverError> {
        Ok(Flow::Continue)
    }
}
