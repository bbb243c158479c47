//! What came of a replay.

use crate::ids::MatchKey;
use crate::record::RecordClass;
use crate::time::SimTime;

/// What an actor does that others could see.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum OutputClass {
    /// It sends a message, whatever becomes of it.
    Message,
    /// It changes a link.
    Change,
    /// It records a state sample.
    Sample,
    /// It asks for the run to stop.
    Stop,
    /// It fails, which ends the run.
    Fault,
}

impl OutputClass {
    /// One word for it.
    pub fn name(self) -> &'static str {
        match self {
            OutputClass::Message => "message",
            OutputClass::Change => "change",
            OutputClass::Sample => "sample",
            OutputClass::Stop => "stop",
            OutputClass::Fault => "fault",
        }
    }
}

/// One output.
#[derive(Clone, Debug, PartialEq)]
pub struct Output {
    /// When: for a message, when it was sent.
    pub time: SimTime,
    /// Its place in the flow (sender, receiver, kind), counted from 0; of samples, among those of this kind.
    pub ordinal: u64,
    /// The protocol's own identity for the message, if it gave one.
    pub match_key: Option<MatchKey>,
    /// What was encoded: of a stop or a fault, its text. None where very much waited to be compared: then
    /// only its hash was kept.
    pub body: Option<Vec<u8>>,
}

/// An event of an actor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Step {
    /// What happened: a message was delivered, a timer fired, ...
    pub class: RecordClass,
    /// When.
    pub time: SimTime,
    /// To whom.
    pub actor: String,
    /// Who sent the message; else as `actor`, or `@control`.
    pub sender: String,
    /// The message's kind; empty where there is none.
    pub kind: String,
    /// The message's place in its flow.
    pub ordinal: u64,
}

/// An output that is not as recorded.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// What kind of output.
    pub class: OutputClass,
    /// Whose.
    pub actor: String,
    /// Who the message is for, or the link that is changed; empty otherwise.
    pub receiver: String,
    /// The kind of the message, change or sample; empty otherwise.
    pub kind: String,
    /// What differs: `presence`, `sent`, `match_key`, `body`.
    pub field: &'static str,
    /// The recorded one; none if there is none.
    pub expected: Option<Output>,
    /// The one of the replay; none if there is none.
    pub actual: Option<Output>,
    /// The event in which it was made, as far as it is known.
    pub event: Option<Step>,
    /// The last input that led to that event: itself, or if it is a timer, what it goes back to.
    pub input: Option<Step>,
}

impl Difference {
    /// When: the earlier one of the two.
    pub fn time(&self) -> SimTime {
        let both = self.expected.iter().chain(&self.actual);
        both.map(|output| output.time).min().unwrap_or_default()
    }
}

/// How many outputs are as recorded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// As recorded.
    pub same: u64,
    /// At another time, or with another content.
    pub changed: u64,
    /// Recorded only.
    pub missing: u64,
    /// Of the replay only.
    pub extra: u64,
    /// Of the replay, with a fate that the record is over before: not compared.
    pub unsettled: u64,
}

impl Tally {
    /// How many differ.
    pub fn differing(&self) -> u64 {
        self.changed + self.missing + self.extra
    }

    pub(super) fn add(&mut self, other: &Tally) {
        self.same += other.same;
        self.changed += other.changed;
        self.missing += other.missing;
        self.extra += other.extra;
        self.unsettled += other.unsettled;
    }
}

/// How the outputs of one kind of one actor compare.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KindTally {
    /// Whose.
    pub actor: String,
    /// What kind of output.
    pub class: OutputClass,
    /// The kind of the message, change or sample; empty otherwise.
    pub kind: String,
    /// How many.
    pub tally: Tally,
    /// It is not in the record, and was not compared; then `tally` has how many there were as
    /// [`Tally::unsettled`].
    pub left_out: bool,
}

/// How many events the living actors had, and whether as many at each instant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Steps {
    /// Recorded.
    pub recorded: u64,
    /// Of the replay.
    pub replayed: u64,
    /// Instants at which there was another number of them.
    pub differing: u64,
    /// The first of these.
    pub first: Option<SimTime>,
}

/// What came of a replay.
#[derive(Clone, Debug, PartialEq)]
pub struct ReplayReport {
    /// Recorded messages, and whatever else came to the living actors from elsewhere.
    pub inputs: u64,
    /// Events of the living actors.
    pub steps: Steps,
    /// Outputs by actor, class and kind.
    pub kinds: Vec<KindTally>,
    /// The first output that is not as recorded.
    pub first: Option<Difference>,
    /// What links charged was asked for, and is not known: the replay is void, see
    /// [`Replay::charge`](super::Replay::charge).
    pub needs_charges: bool,
    /// The fault in which the replay ended before its record, or as its record did.
    pub fault: Option<String>,
    /// How far the replay went.
    pub until: SimTime,
}

impl ReplayReport {
    /// All outputs together.
    pub fn total(&self) -> Tally {
        let mut total = Tally::default();
        for kind in self.kinds.iter().filter(|kind| !kind.left_out) {
            total.add(&kind.tally);
        }
        total
    }
}
