//! Comparing two logs: which messages differ, which one first, and what caused it.

mod detail;
mod index;
mod matching;
mod scenario;
mod text;

use std::collections::BTreeMap;
use std::path::Path;

use serde::Serialize;

use crate::LogError;
use crate::fields::FieldDiff;
use crate::log::Log;
use crate::topics::Topics;
use index::{Entry, Index, Mode, Names};

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
}

/// The first difference, in causal order.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FirstDifference {
    /// When, in seconds: the earlier one of the two.
    pub time_s: f64,
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
    /// What caused it, nearest first, back to a start.
    pub causes: Vec<Cause>,
    /// How many causes are left out between the last but one and the last.
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
    /// True if nothing that was compared differs.
    pub identical: bool,
    /// The first difference.
    pub first: Option<FirstDifference>,
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
    /// What else is to be known: a log that is cut, seeds that differ.
    pub notes: Vec<String>,
    /// The topics that differ, most differences first.
    pub topics: Vec<TopicDiff>,
}

/// Compares two logs.
///
/// Farside's logs are aligned by the identity of each message: sender, receiver, kind, and the
/// match key where the protocol gave one, or else the ordinal. Other MCAP files are aligned by
/// topic and place on the topic; protobuf and JSON are compared field by field, anything else by
/// its bytes. State samples, what depends on the machine, and topics that one of the logs does
/// not have because they were filtered are never compared.
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
        names,
    };
    comparison.note_files(&text::short(a, b), strangers);
    if let [Some(a), Some(b)] = &starts {
        let notes = &mut comparison.report.notes;
        scenario::note(notes, a, b);
    }
    comparison.compare()?;
    comparison.finish()
}

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
}

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
    }

    fn compare(&mut self) -> Result<(), LogError> {
        let matching = matching::matching(&self.a, &self.b);
        for at in 0..self.a.entries.len() {
            let Entry { topic, ignored, .. } = self.a.entries[at];
            if !ignored {
                self.topic(topic).a += 1;
                self.report.records_a += 1;
            }
        }
        for at in 0..self.b.entries.len() {
            let Entry { topic, ignored, .. } = self.b.entries[at];
            if !ignored {
                self.topic(topic).b += 1;
                self.report.records_b += 1;
            }
        }
        // The bytes of two messages may differ and their fields not.
        let by_field = self.tolerance > 0.0 || self.mode == Mode::Any;
        for (x, y) in &matching.pairs {
            let (a, b) = (self.a.entries[*x as usize], self.b.entries[*y as usize]);
            if a.content == b.content {
                continue;
            }
            if by_field {
                let (one, other) = ((&mut self.a, &a), (&mut self.b, &b));
                if detail::pair(one, other, self.mode, self.tolerance)?.is_none() {
                    continue;
                }
            }
            self.topic(a.topic).changed += 1;
            self.found(Found::Changed(*x, *y));
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
        self.report.identical = self.earliest.is_none();
        if let Some(found) = self.earliest {
            self.report.first = Some(self.describe(found)?);
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
                detail::describe(&mut self.b, &entry, mode, names, diff)?
            }
            Found::Reordered(x, y) => {
                let entry = self.a.entries[x as usize];
                let diff = FieldDiff::new("order", format!("record {x}"), format!("record {y}"));
                detail::describe(&mut self.a, &entry, mode, names, diff)?
            }
            Found::Changed(x, y) => {
                let (a, b) = (self.a.entries[x as usize], self.b.entries[y as usize]);
                let pair = ((&mut self.a, &a), (&mut self.b, &b));
                let diff = detail::pair(pair.0, pair.1, mode, self.tolerance)?;
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
                first
            }
        };
        first.time_s = crate::envelope::seconds(time_ns);
        Ok(first)
    }
}

impl TopicDiff {
    fn differences(&self) -> u64 {
        self.changed + self.only_in_a + self.only_in_b + self.reordered
    }
}
