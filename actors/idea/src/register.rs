//! Goal registers: the contracts between an agent and those that it controls, or that control it
//! (section 2 of the IDEA paper), and how they survive links that lose, repeat and reorder.
//!
//! A register joins two sides. The *controlling* side sets its procedure, P(i → s) with all inputs
//! bound; the *controlled* side carries it out and sets the status s. A register is never empty: what
//! takes a goal back is another procedure, such as `NoGoal`.
//!
//! | rule | why |
//! |---|---|
//! | procedures are numbered 1, 2, … within an *epoch*, the controlling side's life | order, and each begins at most once |
//! | a load is repeated until it is acknowledged, later and later | loss |
//! | the controlled side takes the number after its last one; a higher one only as far as the controlling side has ended what lies between | a goal that must be done is never skipped |
//! | it answers a load that it has taken already with what it last said | loss of the answer |
//! | a status is repeated until it is acknowledged, or a later procedure is loaded | loss |
//! | the first status that ends a contract counts; others are *stale* | repetition, reordering |
//! | what the controlled side has taken and said is durable; after a restart it says `FAULT` of what it was at | each begins at most once, and done is said of what was done |
//! | a new life of the controlling side asks what has become of a contract that a former life has loaded, until it is answered; the first load of the new life ends the former one, so that what never came by then never begins | the former life may have crashed before its load arrived, or before it heard of the end |
//!
//! A question is a status of the contract, still open, that the *controlling* side sends. The answer is
//! how the contract ended, or that it is refused since it never came.
//!
//! Time-outs are durations from acceptance, counted by the controlled side. Neither side ends a
//! contract because a link is silent, unless the register has a lease.

mod controlled;
mod controlling;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use farside::SimDuration;
use serde::{Deserialize, Serialize};

pub use controlled::{Controlled, Taken};
pub use controlling::{Controlling, Heard};

/// A value as registers carry it: each side's model has symbols of its own.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum RegisterValue {
    /// A truth value.
    Truth(bool),
    /// A number.
    Number(i64),
    /// A symbol, by its name.
    Symbol(Arc<str>),
}

/// A contract of a register: its epoch, and its number within it.
pub type ContractKey = (u32, u32);

/// A register says this procedure from now on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RegisterLoad {
    /// The register's name, the same on both sides.
    pub register: Arc<str>,
    /// The controlling side's life, from 1.
    pub epoch: u32,
    /// The procedure's number within the epoch, from 1.
    pub number: u32,
    /// How many procedures just before it the controlling side has ended without an answer: they
    /// need not begin.
    pub superseded: u32,
    /// The procedure.
    pub procedure: Arc<str>,
    /// Its inputs.
    pub inputs: Vec<RegisterValue>,
}

/// What has become of a procedure; from the controlling side, the question what has.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RegisterStatus {
    /// The register's name.
    pub register: Arc<str>,
    /// The epoch of the load.
    pub epoch: u32,
    /// The procedure's number.
    pub number: u32,
    /// How many statuses of it there were before: the highest counts.
    pub revision: u32,
    /// The outputs, as far as they are known.
    pub outputs: Vec<Option<RegisterValue>>,
    /// Whether it is over, and how.
    pub end: ContractEnd,
}

/// Whether a contract is over, and how.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ContractEnd {
    /// It goes on.
    Open,
    /// Its outputs are what came of it.
    Ended,
    /// The controlled side could not go on: it restarted, or is faulty.
    Fault,
    /// It never began.
    Refused {
        /// Why: the procedure or a value is unknown there, what goes on may not end, or the load never
        /// came before the next life of the controlling side.
        reason: String,
    },
}

/// That a load or a status has arrived.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RegisterAck {
    /// The register's name.
    pub register: Arc<str>,
    /// The epoch of what it answers.
    pub epoch: u32,
    /// The number of what it answers.
    pub number: u32,
    /// Of what: the controlled side acknowledges loads, the controlling side statuses.
    pub of: Acknowledged,
}

/// What is acknowledged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Acknowledged {
    /// A load.
    Load,
    /// A status, and those before it, by its revision.
    Status {
        /// The revision.
        revision: u32,
    },
}

/// An agent is faulty and takes no part any more.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct AgentOffline {
    /// Its name.
    pub agent: Arc<str>,
    /// Its life, from 1.
    pub epoch: u32,
    /// The tick of its own clock at which it found out.
    pub tick: u64,
    /// Why.
    pub reason: String,
}

/// How long to wait before something is said again: after `first`, and each time twice as long, up to
/// `most`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Backoff {
    /// After the first time.
    pub first: SimDuration,
    /// At most.
    pub most: SimDuration,
}

impl Backoff {
    /// How long to wait after something was said so many times, counted from 1.
    ///
    /// ```
    /// use farside::SimDuration;
    /// use farside_idea::register::Backoff;
    /// let secs = SimDuration::from_secs;
    /// let backoff = Backoff { first: secs(2), most: secs(10) };
    /// let waits: Vec<SimDuration> = (1..=4).map(|times| backoff.after(times)).collect();
    /// assert_eq!(waits, [secs(2), secs(4), secs(8), secs(10)]);
    /// ```
    pub fn after(&self, times: u32) -> SimDuration {
        let doubled = 1_u64
            .checked_shl(times.saturating_sub(1))
            .unwrap_or(u64::MAX);
        let wait_ns = self.first.as_nanos().saturating_mul(doubled);
        SimDuration::from_nanos(wait_ns).min(self.most)
    }
}
