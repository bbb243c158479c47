//! What owners and centres send each other. The kind of each message is its type's name.

use farside::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};

use super::outcomes::Outcome;
use super::record::GoalRecord;
use super::values::{GoalKey, Grant, Party, Reason, Revision, SharedGoal, Term, Version};

/// From the centre to an owner: a goal is offered for bids, granted, or its lease or its
/// parameters have changed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GoalAssign {
    /// Who sends it.
    pub from: Party,
    /// The term of the centre that sends it.
    pub by: Term,
    /// The goal.
    pub goal: SharedGoal,
    /// Which edition of the goal.
    pub revision: Revision,
    /// Under which grant; of an offer, the last one before.
    pub grant: Grant,
    /// What is granted.
    pub terms: AssignTerms,
}

/// What is granted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum AssignTerms {
    /// Nothing yet: what would the rover give for it?
    Offer {
        /// When bids are compared.
        until: SimTime,
    },
    /// The goal.
    Lease {
        /// When the right to start it ends.
        end: SimTime,
        /// Of half of a joint goal: whether another rover is bound to the other half.
        confirmed: bool,
    },
}

/// To who sent something: it came, and this is how things are now.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GoalAck {
    /// Who sends it.
    pub from: Party,
    /// What came.
    pub what: Acknowledged,
}

/// What came.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Acknowledged {
    /// An assignment or a cancellation: what the owner has of that goal.
    Holding(Held),
    /// An offer.
    Bid {
        /// Of which goal.
        goal: GoalKey,
        /// Which edition of the goal.
        revision: Revision,
        /// What it would add to the rover's score; none if the rover does not want it.
        score: Option<f64>,
        /// The rover's capacity, see [`GoalStatus::capacity`].
        capacity: u32,
    },
    /// Releases, and other ends of holdings.
    Ends {
        /// The term of the centre that has taken them.
        by: Term,
        /// Which.
        ends: Vec<Closed>,
    },
    /// A status; this is the highest version that came.
    Status(Version),
    /// Outcomes: how many of each rover are known, from the first on.
    Outcomes(Vec<u32>),
    /// Records of another centre, up to this change.
    Records(Version),
}

/// The end of a holding.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Closed {
    /// Of which goal.
    pub goal: GoalKey,
    /// Under which grant.
    pub grant: Grant,
}

/// From an owner to everyone: all that it holds, and the ends of holdings that the centre has not
/// acknowledged.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GoalStatus {
    /// Who sends it.
    pub from: Party,
    /// The highest version holds.
    pub version: Version,
    /// The latest term that the owner knows of.
    pub term: Term,
    /// Counts the changes after which the rover may do what it has refused.
    pub capacity: u32,
    /// What it holds, by goal.
    pub holdings: Vec<Held>,
}

/// What an owner has, or had, of a goal.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Held {
    /// Which goal.
    pub goal: GoalKey,
    /// Under which grant.
    pub grant: Grant,
    /// How far it is.
    pub state: HoldingState,
    /// When the right to start it ends.
    pub lease_end: SimTime,
    /// Of half of a joint goal: whether the owner knows that another rover is bound to the other half.
    pub confirmed: bool,
    /// Which edition of the goal it knows.
    pub revision: Revision,
    /// When it is planned to start.
    pub scheduled: Option<SimTime>,
    /// How long the owner thinks it takes.
    pub duration: SimDuration,
    /// What the owner thinks it stores \[bit\].
    pub memory_bits: f64,
    /// Why it ended.
    pub reason: Option<Reason>,
    /// The rover's capacity when it ended, or now.
    pub capacity: u32,
    /// The record, once it is done.
    pub outcome: Option<Outcome>,
}

/// How far a holding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum HoldingState {
    /// The rover never took it.
    Refused,
    /// The rover means to do it.
    Accepted,
    /// The rover is doing it.
    Started,
    /// It has done it.
    Done,
    /// It has started it, or was bound to it, and could not do it.
    Failed,
    /// It has given it back.
    Released,
    /// The centre has taken it back.
    Cancelled,
    /// The lease ended before the start.
    Lapsed,
    /// Another rover has achieved it.
    Superseded,
}

impl HoldingState {
    /// Whether the rover still has the goal.
    pub fn is_open(self) -> bool {
        matches!(self, HoldingState::Accepted | HoldingState::Started)
    }
}

/// From an owner to the centre: it will not do the goal. It is repeated in each status.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GoalRelease {
    /// Who sends it.
    pub from: Party,
    /// What it had.
    pub held: Held,
}

/// From the centre to an owner: it is not to start the goal, if it has not.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GoalCancel {
    /// Who sends it.
    pub from: Party,
    /// The term of the centre that sends it.
    pub by: Term,
    /// Which goal.
    pub goal: GoalKey,
    /// Under which grant.
    pub grant: Grant,
}

/// From everyone to everyone: outcomes that the other may lack.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GoalOutcome {
    /// Who sends it.
    pub from: Party,
    /// Which.
    pub outcomes: Vec<Outcome>,
}

/// On contact, restart and election: what the sender knows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GoalDigest {
    /// Who sends it.
    pub from: Party,
    /// The latest term that the sender knows of.
    pub term: Term,
    /// Until when the sender supports that term, or has it.
    pub until: SimTime,
    /// Whether it wants to be answered.
    pub asks: bool,
    /// How many outcomes of each rover it knows, from the first on.
    pub have: Vec<u32>,
    /// The status of the recipient that it has, if any.
    pub status: Option<Version>,
    /// The sender stands for the office of centre.
    pub seeks: Option<Support>,
    /// A term for which the sender stood in vain, and will not stand again: promises of it are void.
    pub renounces: Option<Term>,
    /// The sender supports the recipient.
    pub supports: Option<Support>,
    /// From an owner that supports the recipient: all that it has or ever had, by goal.
    pub holdings: Vec<Held>,
    /// From one centre to another: what has changed in its records.
    pub records: Vec<GoalRecord>,
    /// The sender's incarnation, and up to which of its changes the records go.
    pub version: Version,
}

/// A promise, asked for or given: to support no other term until an instant.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Support {
    /// Which term.
    pub term: Term,
    /// Until when.
    pub until: SimTime,
}

/// Any of the messages. It is not sent itself.
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// See [`GoalAssign`].
    Assign(GoalAssign),
    /// See [`GoalAck`].
    Ack(GoalAck),
    /// See [`GoalStatus`].
    Status(GoalStatus),
    /// See [`GoalRelease`].
    Release(GoalRelease),
    /// See [`GoalCancel`].
    Cancel(GoalCancel),
    /// See [`GoalOutcome`].
    Outcome(GoalOutcome),
    /// See [`GoalDigest`].
    Digest(GoalDigest),
}

impl Message {
    /// Who sends it.
    pub fn from(&self) -> Party {
        match self {
            Message::Assign(message) => message.from,
            Message::Ack(message) => message.from,
            Message::Status(message) => message.from,
            Message::Release(message) => message.from,
            Message::Cancel(message) => message.from,
            Message::Outcome(message) => message.from,
            Message::Digest(message) => message.from,
        }
    }
}

/// What comes of a call: what to write, and then what to send.
#[derive(Clone, Debug, PartialEq)]
pub struct Output<W> {
    /// To be written to durable memory before anything is sent. Each is a state sample too.
    pub writes: Vec<W>,
    /// To whom, and what.
    pub sends: Vec<(Party, Message)>,
}

impl<W> Default for Output<W> {
    fn default() -> Output<W> {
        Output {
            writes: Vec::new(),
            sends: Vec::new(),
        }
    }
}
