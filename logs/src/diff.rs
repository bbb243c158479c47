//! Comparing two logs: which messages differ, which one first, and what caused it.

mod beside;
mod detail;
mod index;
mod matching;
mod scenario;
mod text;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use serde::Serialize;

use crate::LogError;
use crate::fields::FieldDiff;
use crate::log::Log;
use crate::topics::Topics;
use index::{Index, Mode, Names};

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
    /// Topics that are not compared, as globs; `*` does not match `/`, `**` does.
    pub ignore: Vec<String>,
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

/// How one of the two logs has a message.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Carried {
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

/// How one topic differs.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TopicDiff {
    /// The topic.
    pub topic: String,
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
    /// Messages in both that differ.
    pub changed: u64,
    /// Messages that only the first log has.
    pub only_in_a: u64,
    /// Messages that only the second log has.
    pub only_in_b: u64,
    /// Messages that come in another order on their topic.
    pub reordered: u64,
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
    /// The topics that differ, most differences first.
    pub topics: Vec<TopicDiff>,
}

/// Compares two logs.
///
/// Farside's logs are aligned by the identity of each message: sender, receiver, kind, and the
/// match key where the protocol gave one, or else the ordinal. The messages of other MCAP files are
/// aligned on each topic: what is the same, and between these what says the same, what was at the
/// same time, and last by place. Protobuf and JSON are compared field by field, anything else by
/// its bytes; so is what cannot be read, and a note says why. Metadata and attachments are
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
/// far as it goes.
pub fn diff(
    a: impl AsRef<Path>,
    b: impl AsRef<Path>,
    options: &DiffOptions,
) -> Result<DiffReport, LogError> {
    let (a, b) = (a.as_ref(), b.as_ref());
    // A glob that makes no sense is told before anything is read.
    Topics::new(&options.ignore)?;
    let starts = [index::start(a)?, index::start(b)?];
    let heads = starts.each_ref().map(|log| log.as_ref().map(Log::head));
    let mode = match heads.iter().flatten().count() {
        2 => Mode::Farside,
        _ => Mode::Any,
    };
    // What one of them did not write is no difference.
    let filtered = heads.iter().flatten().flat_map(|head| &head.exclude);
    let ignore: Vec<String> = options.ignore.iter().chain(filtered).cloned().collect();
    let ignore = Topics::new(&ignore)?;
    let strangers = heads.iter().filter(|head| head.is_none()).count();
    let mut names = Names::default();
    let mut comparison = Comparison {
        a: Index::build(a, mode, &ignore, &mut names)?,
        b: Index::build(b, mode, &ignore, &mut names)?,
        mode,
        tolerance: options.tolerance,
        report: DiffReport {
            file_a: a.display().to_string(),
            file_b: b.display().to_string(),
            ..DiffReport::default()
        },
        topics: BTreeMap::new(),
        earliest: None,
        earliest_own: None,
        by_field: BTreeSet::new(),
        reasons: BTreeSet::new(),
        names,
    };
    let short = text::short(a, b);
    comparison.note_files(&short, strangers);
    if let [Some(a), Some(b)] = &starts {
        let notes = &mut comparison.report.notes;
        scenario::note(notes, a, b);
    }
    comparison.by_field = beside::compare(
        (&comparison.a, &comparison.b),
        (&short.0, &short.1),
        mode,
        &comparison.names,
        &mut comparison.report,
    );
    comparison.compare()?;
    comparison.finish()
}

/// How much of one log is held while the other is read, in bytes.
const HELD_BYTES: usize = 64 << 20;

/// A difference, and where it is.
#[derive(Clone, Copy)]
enum Found {
    Changed(u32, u32),
    OnlyInA(u32),
    OnlyInB(u32),
    Reordered(u32, u32),
}

struct Comparison {
    a: Index,
    b: Index,
    mode: Mode,
    tolerance: f64,
    names: Names,
    report: DiffReport,
    topics: BTreeMap<u32, TopicDiff>,
    earliest: Option<Found>,
    /// The earliest that nobody injected.
    earliest_own: Option<Found>,
    /// Topics whose schemas differ: their messages are read even where their bytes are the same.
    by_field: BTreeSet<u32>,
    /// Why messages on a topic were compared by their bytes only.
    reasons: BTreeSet<(u32, String)>,
}

/// How the topics of events begin that are planned before a run.
const INJECTED: [&str; 4] = [
    "/event/crash",
    "/event/restart",
    "/event/change",
    "/event/told",
];

/// The order in which differences are sorted: time, step, whether an actor is the source, the
/// source, its count, whether it is the fate of a message and no event, place in the log.
type Order<'a> = (u64, u32, bool, &'a str, u64, bool, u32);

impl Comparison {
    fn note_files(&mut self, names: &(String, String), strangers: usize) {
        let notes = &mut self.report.notes;
        if strangers == 1 {
            notes.push("only one of the two is a Farside log: compared by topic".to_owned());
        }
        for (name, index) in [(&names.0, &self.a), (&names.1, &self.b)] {
            match (&index.cut, &index.end) {
                (Some((offset, what)), _) => {
                    notes.push(format!("{name} is cut at byte {offset}: {what}"));
                }
                (None, None) if self.mode == Mode::Farside => {
                    notes.push(format!(
                        "{name} has no farside.end: its run did not end in the log"
                    ));
                }
                _ => {}
            }
        }
    }

    fn topic(&mut self, topic: u32) -> &mut TopicDiff {
        let name = self.names.name(topic);
        self.topics.entry(topic).or_insert_with(|| TopicDiff {
            topic: name.to_owned(),
            ..TopicDiff::default()
        })
    }

    fn order<'a>(names: &'a Names, index: &Index, at: u32) -> Order<'a> {
        let entry = &index.entries[at as usize];
        let source = names.name(entry.source);
        let actor = source != "@control";
        (
            entry.time_ns,
            entry.step,
            actor,
            source,
            entry.count,
            !entry.event,
            at,
        )
    }

    /// When a difference shows: the earlier of its two records.
    fn when(&self, found: Found) -> Order<'_> {
        let a = |at| Self::order(&self.names, &self.a, at);
        let b = |at| Self::order(&self.names, &self.b, at);
        match found {
            Found::Changed(x, y) | Found::Reordered(x, y) => a(x).min(b(y)),
            Found::OnlyInA(x) => a(x),
            Found::OnlyInB(y) => b(y),
        }
    }

    fn found(&mut self, found: Found) {
        let earlier = self
            .earliest
            .is_none_or(|known| self.when(found) < self.when(known));
        if earlier {
            self.earliest = Some(found);
        }
        let earlier = self
            .earliest_own
            .is_none_or(|known| self.when(found) < self.when(known));
        if earlier && !self.is_injected(found) {
            self.earliest_own = Some(found);
        }
    }

    /// Whether a difference is of an event that was planned before the run.
    fn is_injected(&self, found: Found) -> bool {
        let injected = |index: &Index, at: u32| {
            let topic = self.names.name(index.entries[at as usize].topic);
            INJECTED.iter().any(|start| topic.starts_with(start))
        };
        self.mode == Mode::Farside
            && match found {
                Found::Changed(x, y) | Found::Reordered(x, y) => {
                    injected(&self.a, x) && injected(&self.b, y)
                }
                Found::OnlyInA(x) => injected(&self.a, x),
                Found::OnlyInB(y) => injected(&self.b, y),
            }
    }

    fn compare(&mut self) -> Result<(), LogError> {
        let matching = match self.mode {
            Mode::Farside => matching::matching(&self.a, &self.b),
            Mode::Any => matching::aligned(&self.a, &self.b),
        };
        self.count_records();
        // The bytes of two messages may differ and their fields not, or the other way round.
        let by_field = self.tolerance > 0.0 || self.mode == Mode::Any;
        let mut to_read = Vec::new();
        let mut renumbered = 0;
        for (x, y) in &matching.pairs {
            let (a, b) = (&self.a.entries[*x as usize], &self.b.entries[*y as usize]);
            renumbered += u64::from(a.sequence != b.sequence);
            let differently = self.by_field.contains(&a.topic) || self.by_field.contains(&b.topic);
            match a.content == b.content {
                true if !differently => {}
                false if !by_field => self.changed(*x, *y),
                _ => to_read.push((*x, *y)),
            }
        }
        self.read(&to_read)?;
        if renumbered > 0 {
            let what = format!("{renumbered} messages have other sequence numbers: not compared");
            self.report.notes.push(what);
        }
        for at in &matching.only_in_a {
            let topic = self.a.entries[*at as usize].topic;
            self.topic(topic).only_in_a += 1;
            self.found(Found::OnlyInA(*at));
        }
        for at in &matching.only_in_b {
            let topic = self.b.entries[*at as usize].topic;
            self.topic(topic).only_in_b += 1;
            self.found(Found::OnlyInB(*at));
        }
        self.compare_order(&matching.pairs);
        Ok(())
    }

    fn count_records(&mut self) {
        let mut ignored = [0; 2];
        for (side, ignored) in ignored.iter_mut().enumerate() {
            let index = if side == 0 { &self.a } else { &self.b };
            for (role, count) in &index.left_out {
                let role = if role.is_empty() { "other" } else { role };
                let counts = self.report.not_compared.entry(role.to_owned());
                counts.or_default()[side] += *count;
            }
            let entries = index.entries.len();
            for at in 0..entries {
                let index = if side == 0 { &self.a } else { &self.b };
                let entry = index.entries[at];
                if entry.ignored {
                    *ignored += 1;
                    continue;
                }
                let topic = self.topic(entry.topic);
                match side {
                    0 => topic.a += 1,
                    _ => topic.b += 1,
                }
                match side {
                    0 => self.report.records_a += 1,
                    _ => self.report.records_b += 1,
                }
            }
        }
        if ignored != [0; 2] {
            let what = "ignored".to_owned();
            self.report.not_compared.insert(what, ignored);
        }
    }

    fn changed(&mut self, x: u32, y: u32) {
        let topic = self.a.entries[x as usize].topic;
        self.topic(topic).changed += 1;
        self.found(Found::Changed(x, y));
    }

    /// Compares pairs of messages by their fields, a part of them at a time: within a part each
    /// file is read from front to back, however differently the two are ordered.
    fn read(&mut self, mut pairs: &[(u32, u32)]) -> Result<(), LogError> {
        while !pairs.is_empty() {
            let mut held = Vec::new();
            let mut bytes = 0;
            while let Some((x, y)) = pairs.get(held.len())
                && bytes < HELD_BYTES
            {
                let message = detail::Held::fetch(&mut self.a, *x)?;
                bytes += message.bytes() + 100;
                held.push((self.b.entries[*y as usize].position, *x, *y, message));
            }
            pairs = &pairs[held.len()..];
            held.sort_by_key(|(position, ..)| *position);
            for (_, x, y, message) in held {
                let (mode, tolerance) = (self.mode, self.tolerance);
                if let Some(diff) = message.against(&mut self.b, y, mode, tolerance)? {
                    self.changed(x, y);
                    let topic = self.a.entries[x as usize].topic;
                    self.reasons.extend(diff.why.map(|why| (topic, why)));
                }
            }
        }
        Ok(())
    }

    /// Counts the messages that come in another order on their topic.
    fn compare_order(&mut self, pairs: &[(u32, u32)]) {
        let topic = |pair: &(u32, u32)| self.a.entries[pair.0 as usize].topic;
        let same = |pair: &&(u32, u32)| topic(pair) == self.b.entries[pair.1 as usize].topic;
        let mut by_topic: Vec<(u32, u32)> = pairs.iter().filter(same).copied().collect();
        // Stable: pairs come in the order of the first log.
        by_topic.sort_by_key(topic);
        let mut reordered = Vec::new();
        for group in by_topic.chunk_by(|one, other| topic(one) == topic(other)) {
            let places: Vec<u32> = group.iter().map(|pair| pair.1).collect();
            let (count, first) = matching::out_of_order(&places);
            if let Some(first) = first {
                reordered.push((topic(&group[0]), count, group[first]));
            }
        }
        for (topic, count, (x, y)) in reordered {
            self.topic(topic).reordered += count;
            self.found(Found::Reordered(x, y));
        }
    }

    fn finish(mut self) -> Result<DiffReport, LogError> {
        for topic in self.topics.values() {
            self.report.changed += topic.changed;
            self.report.only_in_a += topic.only_in_a;
            self.report.only_in_b += topic.only_in_b;
            self.report.reordered += topic.reordered;
        }
        self.report.identical = self.earliest.is_none() && self.report.beside.is_empty();
        if let Some(found) = self.earliest {
            let injected = self.is_injected(found);
            let mut first = self.describe(found)?;
            first.injected = injected;
            self.report.first = Some(first);
            let own = self.earliest_own.filter(|_| injected);
            let own = own.map(|own| self.describe(own));
            self.report.consequence = own.transpose()?;
        }
        for (topic, why) in std::mem::take(&mut self.reasons) {
            let topic = self.names.name(topic);
            let note = format!("messages on {topic} were compared by their bytes: {why}");
            self.report.notes.push(note);
        }
        let differing = |topic: &TopicDiff| topic.differences() > 0;
        self.report.topics = self.topics.into_values().filter(differing).collect();
        self.report.topics.sort_by(|a, b| {
            b.differences()
                .cmp(&a.differences())
                .then_with(|| a.topic.cmp(&b.topic))
        });
        Ok(self.report)
    }

    fn describe(&mut self, found: Found) -> Result<FirstDifference, LogError> {
        let time_ns = self.when(found).0;
        let (mode, names) = (self.mode, &self.names);
        let mut first = match found {
            Found::OnlyInA(x) => {
                let entry = self.a.entries[x as usize];
                let diff = FieldDiff::new("presence", "present", "absent");
                detail::describe(&mut self.a, &entry, mode, names, diff)?
            }
            Found::OnlyInB(y) => {
                let entry = self.b.entries[y as usize];
                let diff = FieldDiff::new("presence", "absent", "present");
                let mut first = detail::describe(&mut self.b, &entry, mode, names, diff)?;
                first.carried_b = first.carried_a.take();
                first
            }
            Found::Reordered(x, y) => {
                let entry = self.a.entries[x as usize];
                let diff = FieldDiff::new("order", format!("record {x}"), format!("record {y}"));
                detail::describe(&mut self.a, &entry, mode, names, diff)?
            }
            Found::Changed(x, y) => {
                let (a, b) = (self.a.entries[x as usize], self.b.entries[y as usize]);
                let held = detail::Held::fetch(&mut self.a, x)?;
                let diff = held.against(&mut self.b, y, mode, self.tolerance)?;
                let reason = diff.as_ref().and_then(|diff| diff.why.clone());
                self.reasons.extend(reason.map(|why| (a.topic, why)));
                let diff = diff.unwrap_or_else(|| FieldDiff::new("body", "one", "another"));
                let mut first = detail::describe(&mut self.a, &a, mode, names, diff.clone())?;
                let other = detail::describe(&mut self.b, &b, mode, names, diff)?;
                // The link and the reason are those of the loss, in whichever log it is.
                if first.reason.is_empty() {
                    first.reason = other.reason;
                }
                if first.link.is_empty() {
                    first.link = other.link;
                }
                first.carried_b = other.carried_a;
                first
            }
        };
        first.time_s = crate::envelope::seconds(time_ns);
        first.time_ns = time_ns;
        Ok(first)
    }
}

impl TopicDiff {
    fn differences(&self) -> u64 {
        self.changed + self.only_in_a + self.only_in_b + self.reordered
    }
}
