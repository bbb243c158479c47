//! Comparing two logs: which messages differ, which one first, and what caused it.

mod agree;
mod aligning;
mod behaviour;
mod beside;
mod causal;
mod chain;
mod comparison;
mod detail;
mod differing;
mod entry;
mod found;
mod index;
mod known;
mod matching;
mod offset;
mod reach;
mod root;
mod scenario;
mod spill;
#[cfg(test)]
mod tests;
mod text;
mod words;

use std::collections::BTreeMap;
use std::path::Path;

pub use behaviour::{FieldChange, Rate};

use serde::Serialize;

use crate::LogError;
use crate::fields::{Rules, Tolerance};
pub use chain::{CauseChain, CausedBy, causes};
pub use differing::Differing;

/// How two logs are compared.
///
/// ```
/// let options = farside_logs::DiffOptions { tolerance: 1e-9, ..Default::default() };
/// assert!(options.ignore.is_empty());
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DiffOptions {
    /// Floating-point numbers are the same if they differ by at most this, or by at most this
    /// times the larger one; times, if they differ by at most this many seconds.
    pub tolerance: f64,
    /// Times are the same if they differ by at most this, in nanoseconds, whatever holds for numbers.
    pub time_tolerance_ns: Option<u64>,
    /// What single fields may differ by, and all within them: `header.stamp`, `ranges`, `log_time`.
    pub field_tolerances: Vec<(String, Tolerance)>,
    /// What is not compared: topics, as globs, where `*` does not match `/`, and `**` does; and, without
    /// any of these letters, fields: `header.stamp`.
    pub ignore: Vec<String>,
    /// The only topics that are compared, as globs; all, if there is none.
    pub topics: Vec<String>,
}

impl DiffOptions {
    /// Whether something that is left out may be a field.
    pub(crate) fn names_field(name: &str) -> bool {
        !name.contains(['/', '*', '?', '[', '{'])
    }

    /// What is said about fields.
    pub(crate) fn rules(&self) -> Rules {
        let mut rules = Rules::new(self.tolerance, self.time_tolerance_ns);
        for (field, tolerance) in &self.field_tolerances {
            rules.within(field, *tolerance);
        }
        for name in self.ignore.iter().filter(|name| Self::names_field(name)) {
            rules.ignore(name);
        }
        rules
    }
}

/// One event of a chain of causes.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Cause {
    /// When it happened, in seconds.
    pub time_s: f64,
    /// When it happened, in nanoseconds.
    pub time_ns: u64,
    /// Its topic.
    pub topic: String,
    /// Who sent the message, or whom the event happened to.
    pub sender: String,
    /// Who the message was for.
    pub receiver: String,
    /// The message's place in its flow.
    pub ordinal: u64,
    /// What happened: `delivered`, `timer`, `start`, ...
    pub fate: String,
    /// How many events of the same timer, one the cause of the next, come before this one in a row;
    /// they are not listed.
    #[serde(skip_serializing_if = "is_zero")]
    pub repeats: u64,
    /// When the first of them was, in nanoseconds; 0 without any.
    #[serde(skip_serializing_if = "is_zero")]
    pub since_ns: u64,
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde passes a reference"
)]
fn is_zero(count: &u64) -> bool {
    *count == 0
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde passes a reference"
)]
fn is_no_offset(offset_ns: &i64) -> bool {
    *offset_ns == 0
}

/// How one of the two logs has a message.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Carried {
    /// What the message is called in this log, for `fork` and for scenarios: sender, receiver, kind, and its
    /// number in that flow.
    pub id: String,
    /// When it was sent, in nanoseconds.
    pub sent_ns: u64,
    /// When its fate was, in nanoseconds.
    pub at_ns: u64,
    /// Its fate: `delivered`, `lost`, ...
    pub fate: String,
    /// Why it was lost; empty if it was not.
    pub reason: String,
    /// How the link carried it: the parts of its delay, the attempts; empty if the link does not
    /// say.
    pub carriage: String,
}

/// The first difference, in causal order.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FirstDifference {
    /// When, in seconds: the earlier one of the two.
    pub time_s: f64,
    /// When, in nanoseconds.
    pub time_ns: u64,
    /// The topic; that of `a` where both have the message.
    pub topic: String,
    /// Who sent the message, or whom the event happened to.
    pub sender: String,
    /// Who the message is for.
    pub receiver: String,
    /// The message's place in its flow.
    pub ordinal: u64,
    /// The protocol's own identity for the message, if it gave one.
    pub match_key: Option<String>,
    /// The field that differs: `fate`, `log_time`, `body.pose.x`, ...; `presence` if only one log
    /// has the message.
    pub field: String,
    /// Its value in the first log.
    pub a: String,
    /// Its value in the second log.
    pub b: String,
    /// The link that carried it; empty if none did.
    pub link: String,
    /// Why it was lost in one of them; empty if it was not.
    pub reason: String,
    /// How the link carried it in the first log that has it: the parts of its delay, the attempts;
    /// empty if the link does not say.
    pub carriage: String,
    /// How the first log has it; none if it has not, or no link carried it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub carried_a: Option<Carried>,
    /// How the second log has it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub carried_b: Option<Carried>,
    /// True for what was planned before the run and is no work of any actor: a crash, a restart, a
    /// change of a link, something that an actor is told.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub injected: bool,
    /// What caused it, nearest first, back to a start.
    pub causes: Vec<Cause>,
    /// How many causes are left out between the last but one and the last, repeats of timers
    /// besides.
    pub causes_omitted: u64,
}

/// What the walk back from a difference ends at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RootKind {
    /// A link decided otherwise about a message that was sent in both, alike.
    Verdict,
    /// Something that was planned: a crash, a restart, a change of a link, something that an actor is told.
    Event,
    /// An actor said or did something else before anything reached it otherwise.
    Actor,
    /// One of the runs, or one of the logs, ended earlier.
    End,
}

/// What differences began with.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Root {
    /// What it is.
    pub kind: RootKind,
    /// When, in seconds: the earlier one of the two logs.
    pub time_s: f64,
    /// When, in nanoseconds.
    pub time_ns: u64,
    /// It in a sentence.
    pub what: String,
    /// The actor or the link; empty at an end.
    pub actor: String,
    /// The message, as `fork` and scenarios call it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub message: Option<String>,
    /// Of a link's decision: what is known of the draw behind it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub draw: Option<String>,
    /// Of a loss by chance: its reason.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub by_chance: Option<String>,
    /// Of something planned: how much else that was planned for that time differs.
    #[serde(skip_serializing_if = "is_zero")]
    pub more: u64,
}

/// One step on the way by which differences came.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Hop {
    /// When, in seconds.
    pub time_s: f64,
    /// When, in nanoseconds.
    pub time_ns: u64,
    /// The actor that was reached, or a link whose later decisions depend on it.
    pub actor: String,
    /// How it was.
    pub how: String,
    /// The message, if it was by one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub message: Option<String>,
}

/// How a difference first reached an actor: as something that it received otherwise, or did not receive; or, if
/// that came before, as something that it sent or did otherwise.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Reached {
    /// The actor.
    pub actor: String,
    /// When, in seconds: the earlier one of the two logs.
    pub time_s: f64,
    /// When, in nanoseconds.
    pub time_ns: u64,
    /// On which topic.
    pub topic: String,
    /// How.
    pub how: String,
    /// The message, if it was by one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub message: Option<String>,
    /// What its way began with; none only in logs whose records contradict each other.
    pub root: Option<Root>,
    /// The way: whom the difference reached first, and so on to the actor itself.
    pub path: Vec<Hop>,
    /// How many steps are left out in the middle of a long way.
    pub path_omitted: usize,
}

/// How one topic differs.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TopicDiff {
    /// The topic.
    pub topic: String,
    /// When the first of its differences is, in nanoseconds; none if there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_ns: Option<u64>,
    /// Messages compared in the first log.
    pub a: u64,
    /// Messages compared in the second log.
    pub b: u64,
    /// Messages in both that differ.
    pub changed: u64,
    /// Messages that only the first log has.
    pub only_in_a: u64,
    /// Messages that only the second log has.
    pub only_in_b: u64,
    /// Messages that come in another order.
    pub reordered: u64,
    /// How often there are messages in the first log.
    pub rate_a: Rate,
    /// How often there are messages in the second log.
    pub rate_b: Rate,
    /// The fields that differ in the messages that changed, most often first; in Farside's logs of the first
    /// few thousand such messages.
    pub fields: Vec<FieldChange>,
}

/// How two logs differ.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct DiffReport {
    /// The first log's file.
    pub file_a: String,
    /// The second log's file.
    pub file_b: String,
    /// True if nothing that was compared differs, neither messages nor what is beside them.
    pub identical: bool,
    /// The first message that differs.
    pub first: Option<FirstDifference>,
    /// If that was injected, the first difference that was not: what it led to.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub consequence: Option<FirstDifference>,
    /// Of Farside's logs, what the first difference began with.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub root: Option<Root>,
    /// What differs at the starts of the two runs and may be behind that: keys of the scenario with both
    /// values, seeds, versions, files. All that differs, if nothing fits; empty if nothing does.
    pub inputs: Vec<String>,
    /// Messages in both that differ.
    pub changed: u64,
    /// Messages that only the first log has.
    pub only_in_a: u64,
    /// Messages that only the second log has.
    pub only_in_b: u64,
    /// Messages that come in another order on their topic.
    pub reordered: u64,
    /// By how much later the second log was recorded, in nanoseconds: times are compared after that. 0 in
    /// Farside's logs, and where there is none that is sure.
    #[serde(skip_serializing_if = "is_no_offset")]
    pub offset_ns: i64,
    /// How many records were compared in the first log.
    pub records_a: u64,
    /// How many records were compared in the second log.
    pub records_b: u64,
    /// Metadata records that both files have.
    pub metadata: u64,
    /// Attachments that both files have.
    pub attachments: u64,
    /// What differs beside the messages: metadata, attachments, encodings.
    pub beside: Vec<String>,
    /// What was not compared: how many messages of either file, by what they are.
    pub not_compared: BTreeMap<String, [u64; 2]>,
    /// What else is to be known: a log that is cut, seeds or schemas that differ, what could be
    /// compared by its bytes only.
    pub notes: Vec<String>,
    /// Of Farside's logs, whom the differences reached, in the order in which they did, and by which ways.
    pub spread: Vec<Reached>,
    /// The topics that differ, most differences first.
    pub topics: Vec<TopicDiff>,
}

/// Compares two logs.
///
/// Farside's logs are aligned by the identity of each message: sender, receiver, kind, and the
/// match key where the protocol gave one; or else what says the same and was sent at the same time, and
/// of the rest the place in the flow, without what only one log has before it. The messages of other MCAP files are
/// aligned on each topic: what is the same, and between these what says the same, what has the same
/// number, what was at the same time or nearest to it, and last by place; if the second log was recorded
/// later by a time that is sure, after that. CDR, ROS 1, protobuf, JSON and FlatBuffers are compared field
/// by field, anything else by its bytes; so is what cannot be read, and a note says why. Metadata and attachments are
/// compared, and schemas: a field that is set and that the two do not declare alike differs.
///
/// In Farside's logs state samples, what is drawn and what depends on the machine are not compared,
/// nor in any the topics that one of the logs does not have because they were filtered; the report
/// counts them. Of numbers that are no number one is as good as another; 0 and -0 differ unless
/// there is a tolerance; `null` in JSON is something else than nothing, and 1 the same as 1.0.
///
/// ```no_run
/// use farside_logs::{DiffOptions, diff};
/// let report = diff("healthy.mcap", "sick.mcap", &DiffOptions::default())?;
/// if let Some(first) = &report.first {
///     println!("{} differs in {}", first.topic, first.field);
/// }
/// # Ok::<(), farside_logs::LogError>(())
/// ```
///
/// # Errors
/// If one of the files cannot be read, or is damaged before its end; a cut file is compared as
/// far as it goes. If no message has a field or a topic that the options name.
pub fn diff(
    a: impl AsRef<Path>,
    b: impl AsRef<Path>,
    options: &DiffOptions,
) -> Result<DiffReport, LogError> {
    let limits = Limits::default();
    Ok(comparison::compare(a.as_ref(), b.as_ref(), options, limits, None)?.0)
}

/// Compares two logs as [`diff`] does, and says of each message whether it differs.
///
/// ```no_run
/// let (report, differing) = farside_logs::diff_marked("a.mcap", "b.mcap", &Default::default())?;
/// let mut messages = farside_logs::AnyMessages::open("a.mcap", &[])?;
/// let mut count = 0;
/// while let Some(message) = messages.next()? {
///     count += u64::from(differing.has(0, &message));
/// }
/// println!("{count} of a.mcap, {} in both changed", report.changed);
/// # Ok::<(), farside_logs::LogError>(())
/// ```
///
/// # Errors
/// Those of [`diff`].
pub fn diff_marked(
    a: impl AsRef<Path>,
    b: impl AsRef<Path>,
    options: &DiffOptions,
) -> Result<(DiffReport, Differing), LogError> {
    let mut differing = Differing::default();
    let limits = Limits::default();
    let marks = Some(&mut differing);
    let (report, _) = comparison::compare(a.as_ref(), b.as_ref(), options, limits, marks)?;
    differing.sort();
    Ok((report, differing))
}

/// How a comparison goes about it: changes its speed and its memory, but for one never what it finds.
#[derive(Clone, Copy)]
pub(crate) struct Limits {
    /// How many entries of each log may be in memory.
    entries: usize,
    /// How many pairs may be in memory that are to be compared by field, or in their order.
    pairs: usize,
    /// How many bytes of one log's messages are in memory while the other is read.
    message_bytes: usize,
    /// Whether the front of both is passed over as long as it agrees.
    passes_front: bool,
    /// How many messages are kept in mind that have another place in their flow in the other log. With more
    /// than these a message may be paired with another one, and the report says so.
    shifted: usize,
}

impl Limits {
    /// How many of these may wait that are to be paired a second time.
    fn left(&self) -> usize {
        (self.entries / 4).max(1)
    }
}

impl Default for Limits {
    fn default() -> Self {
        Limits {
            entries: 256 << 10,
            pairs: 64 << 10,
            message_bytes: 64 << 20,
            passes_front: true,
            shifted: 256 << 10,
        }
    }
}

/// What a comparison took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Usage {
    /// The most bytes that waited in memory at a time, without the two chunks that are open.
    pub(crate) most_bytes: usize,
    /// Bytes that were put into temporary files.
    pub(crate) file_bytes: u64,
    /// How many records of each log agreed at the front.
    pub(crate) agreed: [u32; 2],
}

impl TopicDiff {
    fn differences(&self) -> u64 {
        self.changed + self.only_in_a + self.only_in_b + self.reordered
    }
}
