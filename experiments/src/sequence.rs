//! Who sent what to whom in a part of a run, from its log, as charts that other programs draw: sequence
//! charts for Mermaid and PlantUML, and graphs of causes for Graphviz.

mod dot;
mod mermaid;
mod plantuml;

use std::collections::{BTreeMap, BTreeSet};

pub(crate) use dot::graph;
use farside::record::RecordClass;
use farside::{BadPattern, Pattern, SimDuration, SimTime};
use farside_logs::{CauseChain, Log, LogError, LoggedRecord, Records};

/// As many arrows as a chart has before they are folded, and then left out: Mermaid draws texts of up to 50,000
/// letters.
const ARROWS: usize = 400;

/// Into how many equal times a span is divided in which arrows that say the same are one.
const FOLDS: u64 = 20;

/// A language in which charts are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Language {
    /// `sequenceDiagram` of Mermaid
    Mermaid,
    /// `@startuml` of PlantUML
    Plantuml,
}

/// What is to be charted.
pub(crate) struct Part {
    /// The beginning of the time span.
    pub(crate) from: Option<SimDuration>,
    /// Its end, which belongs to it.
    pub(crate) until: Option<SimDuration>,
    /// Actors of which one sends or receives what is charted; all if there is none.
    pub(crate) actors: Vec<Actors>,
}

/// Actors by a glob over their names.
#[derive(Clone, Debug)]
pub(crate) struct Actors {
    text: String,
    pattern: Pattern,
}

impl std::str::FromStr for Actors {
    type Err = BadPattern;

    fn from_str(text: &str) -> Result<Actors, BadPattern> {
        let pattern = Pattern::over_names(text)?;
        let text = text.to_owned();
        Ok(Actors { text, pattern })
    }
}

impl std::fmt::Display for Actors {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.text)
    }
}

impl Actors {
    fn are_of(&self, record: &LoggedRecord) -> bool {
        self.pattern.matches(&record.sender) || self.pattern.matches(&record.receiver)
    }
}

impl Part {
    fn has(&self, record: &LoggedRecord) -> bool {
        let time = SimTime::from_nanos(record.key.time_ns).since(SimTime::ZERO);
        let in_time = self.from.is_none_or(|from| time >= from)
            && self.until.is_none_or(|until| time <= until);
        let mut actors = self.actors.iter();
        in_time && (self.actors.is_empty() || actors.any(|some| some.are_of(record)))
    }

    /// Nothing behind this time is of the part.
    fn is_over(&self, time_ns: u64) -> bool {
        let time = SimTime::from_nanos(time_ns).since(SimTime::ZERO);
        self.until.is_some_and(|until| time > until)
    }
}

/// What becomes of the messages of an arrow.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Fate {
    Delivered,
    Lost,
    InFlight,
}

/// One message, or several that say the same.
#[derive(Clone, Debug, PartialEq)]
struct Arrow {
    /// When the first of them arrived or was lost, and when it was sent, in nanoseconds.
    at_ns: u64,
    sent_ns: u64,
    /// When the last of them arrived or was lost.
    last_ns: u64,
    sender: usize,
    receiver: usize,
    fate: Fate,
    /// The kind, and which message of its flow it is.
    kind: String,
    number: String,
    /// Why they were lost.
    reason: String,
    count: u64,
}

/// Something that happened to an actor or a link and is no message.
#[derive(Clone, Debug, PartialEq)]
struct Note {
    at_ns: u64,
    /// The participant that it is beside; none if it is none of them.
    beside: Option<usize>,
    text: String,
}

#[derive(Clone, Debug, PartialEq)]
enum Step {
    Arrow(Arrow),
    Note(Note),
}

/// A sequence chart, in the order in which things happened.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Chart {
    title: String,
    /// Names of actors, in order of their first appearance.
    participants: Vec<String>,
    steps: Vec<Step>,
    /// Messages that it stands for.
    messages: u64,
    /// Of these, how many were lost.
    lost: u64,
    /// What a reader should know of what it does not show.
    remarks: Vec<String>,
}

/// What of a log is charted, in the order of its records; bodies are left out.
pub(crate) struct Selected {
    records: Vec<LoggedRecord>,
    remarks: Vec<String>,
}

impl Selected {
    /// The first glob by which nothing was selected.
    pub(crate) fn unknown<'a>(&self, actors: &'a [Actors]) -> Option<&'a Actors> {
        let is_known = |some: &&Actors| self.records.iter().any(|record| some.are_of(record));
        actors.iter().find(|some| !is_known(some))
    }

    /// What is of these actors; all if there are none.
    pub(crate) fn of(mut self, actors: &[Actors]) -> Selected {
        let is_of = |record: &LoggedRecord| actors.iter().any(|some| some.are_of(record));
        self.records
            .retain(|record| actors.is_empty() || is_of(record));
        self
    }
}

/// As many records as are held of a log: above that a chart of them says nothing.
const RECORDS: usize = 200_000;

/// Reads a part of a log.
///
/// # Errors
/// If the log cannot be read.
pub(crate) fn select(log: &Log, part: &Part) -> Result<Selected, LogError> {
    let mut records: Records = log.records()?;
    let mut selected = Selected {
        records: Vec::new(),
        remarks: Vec::new(),
    };
    let mut more = 0_u64;
    while let Some((record, channel)) = records.next_ref()? {
        if part.is_over(record.key.time_ns) {
            break;
        }
        if record.class == RecordClass::Sample {
            continue;
        }
        let record = LoggedRecord::bodiless(&record, channel);
        if !part.has(&record) {
            continue;
        }
        match selected.records.len() < RECORDS {
            true => selected.records.push(record),
            false => more += 1,
        }
    }
    if more > 0 {
        selected.remarks.push(format!(
            "{more} records behind the first {RECORDS} of this part are left out"
        ));
    }
    if let Some(missing) = records.ending().cut.as_ref() {
        let (offset, what) = missing;
        selected
            .remarks
            .push(format!("the log is cut at byte {offset}: {what}"));
    }
    if !log.exclude().is_empty() {
        let topics = log.exclude().join(", ");
        selected
            .remarks
            .push(format!("topics that were not written: {topics}"));
    }
    Ok(selected)
}

/// What led to a message, as a selection: earliest first.
pub(crate) fn chain(chain: CauseChain) -> Selected {
    let mut remarks = Vec::new();
    if chain.omitted > 0 {
        remarks.push(format!(
            "{} causes before the first that is shown are left out",
            chain.omitted
        ));
    }
    if let Some(unknown) = &chain.unknown {
        let at = SimTime::from_nanos(unknown.time_ns).since(SimTime::ZERO);
        remarks.push(format!(
            "the first cause, an event of {} at {at}, is not in the log",
            unknown.source
        ));
    }
    let mut records: Vec<LoggedRecord> = Vec::new();
    for event in chain.events.into_iter().rev() {
        let mut record = event.record;
        if event.repeats > 0 {
            let times = event.repeats;
            record.note = format!("and {times} times before");
        }
        records.push(record);
    }
    Selected { records, remarks }
}

impl Chart {
    /// The chart of a selection.
    pub(crate) fn new(title: String, selected: Selected) -> Chart {
        let mut chart = Chart {
            title,
            remarks: selected.remarks,
            ..Chart::default()
        };
        let mut numbers = BTreeMap::new();
        let actors: BTreeSet<String> = selected
            .records
            .iter()
            .filter(|record| record.class.is_fate())
            .flat_map(|record| [record.sender.clone(), record.receiver.clone()])
            .collect();
        for record in &selected.records {
            chart.add(record, &actors, &mut numbers);
        }
        chart.fold();
        chart
    }

    /// How many messages it stands for, and what it does not show.
    pub(crate) fn told(&self) -> String {
        let Chart { messages, lost, .. } = self;
        let actors = self.participants.len();
        let mut text = format!("{messages} messages between {actors} actors, {lost} lost");
        for remark in &self.remarks {
            text.push_str(&format!("\n  {remark}"));
        }
        text
    }

    /// Written in a language.
    pub(crate) fn written(&self, language: Language) -> String {
        match language {
            Language::Mermaid => mermaid::write(self),
            Language::Plantuml => plantuml::write(self),
        }
    }

    fn add(
        &mut self,
        record: &LoggedRecord,
        actors: &BTreeSet<String>,
        numbers: &mut BTreeMap<String, usize>,
    ) {
        let mut participant = |name: &str| {
            *numbers.entry(name.to_owned()).or_insert_with(|| {
                self.participants.push(name.to_owned());
                self.participants.len() - 1
            })
        };
        let fate = match record.class {
            RecordClass::Delivered => Fate::Delivered,
            RecordClass::Lost => Fate::Lost,
            RecordClass::InFlight => Fate::InFlight,
            RecordClass::Crash
            | RecordClass::Restart
            | RecordClass::Change
            | RecordClass::Told
            | RecordClass::Stop => {
                let is_there = actors.contains(&record.receiver);
                let beside = is_there.then(|| participant(&record.receiver));
                self.steps.push(Step::Note(Note {
                    at_ns: record.key.time_ns,
                    beside,
                    text: event_text(record),
                }));
                return;
            }
            RecordClass::Start
            | RecordClass::Timer
            | RecordClass::HandOver
            | RecordClass::Sample => return,
        };
        let (sender, receiver) = (participant(&record.sender), participant(&record.receiver));
        self.messages += 1;
        self.lost += u64::from(fate == Fate::Lost);
        self.steps.push(Step::Arrow(Arrow {
            at_ns: record.key.time_ns,
            sent_ns: record.sent_ns,
            last_ns: record.key.time_ns,
            sender,
            receiver,
            fate,
            kind: record.kind.clone(),
            number: number(record),
            reason: record.reason.clone(),
            count: 1,
        }));
    }

    /// Makes one arrow of those that say the same at about the same time, if there are too many; leaves out what
    /// is too much even so.
    fn fold(&mut self) {
        let arrows = |steps: &[Step]| {
            let is_arrow = |step: &&Step| matches!(step, Step::Arrow(_));
            steps.iter().filter(is_arrow).count()
        };
        if arrows(&self.steps) <= ARROWS {
            return;
        }
        let times = self.steps.iter().map(Step::at_ns);
        let (from, until) = (times.clone().min().unwrap_or(0), times.max().unwrap_or(0));
        let width = (until - from) / FOLDS + 1;
        let mut kept: Vec<Step> = Vec::new();
        let mut open: BTreeMap<(u64, usize, usize, String, Fate, String), usize> = BTreeMap::new();
        for step in std::mem::take(&mut self.steps) {
            let Step::Arrow(arrow) = &step else {
                kept.push(step);
                continue;
            };
            let key = (
                (arrow.at_ns - from) / width,
                arrow.sender,
                arrow.receiver,
                arrow.kind.clone(),
                arrow.fate,
                arrow.reason.clone(),
            );
            match open.get(&key) {
                Some(&at) => {
                    if let Step::Arrow(first) = &mut kept[at] {
                        first.count += 1;
                        first.last_ns = arrow.at_ns;
                    }
                }
                None => {
                    open.insert(key, kept.len());
                    kept.push(step);
                }
            }
        }
        let span = SimDuration::from_nanos(width);
        self.remarks.push(format!(
            "messages between the same two that say the same are one arrow within {span}"
        ));
        self.steps = kept;
        self.cut(arrows(&self.steps).saturating_sub(ARROWS));
    }

    /// Leaves out the last arrows, and what is behind them.
    fn cut(&mut self, too_many: usize) {
        if too_many == 0 {
            return;
        }
        let mut left = ARROWS;
        let end = self.steps.iter().position(|step| {
            let is_arrow = matches!(step, Step::Arrow(_));
            left -= usize::from(is_arrow && left > 0);
            is_arrow && left == 0
        });
        let cut = self.steps.split_off(end.map_or(0, |end| end + 1));
        let messages: u64 = cut.iter().map(Step::messages).sum();
        let from = cut.first().map_or(0, Step::at_ns);
        let from = SimTime::from_nanos(from).since(SimTime::ZERO);
        self.remarks.push(format!(
            "{messages} messages from {from} on are left out: ask for a shorter time, or for some actors"
        ));
    }
}

impl Step {
    fn at_ns(&self) -> u64 {
        match self {
            Step::Arrow(arrow) => arrow.at_ns,
            Step::Note(note) => note.at_ns,
        }
    }

    fn messages(&self) -> u64 {
        match self {
            Step::Arrow(arrow) => arrow.count,
            Step::Note(_) => 0,
        }
    }
}

impl Arrow {
    /// What stands at it: when, what, and what became of it.
    fn label(&self) -> String {
        let at = seconds(self.at_ns);
        let what = match self.count {
            1 => format!("{} {}", self.kind, self.number),
            count => format!("{} × {count}", self.kind),
        };
        let mut text = match self.last_ns > self.at_ns && self.count > 1 {
            true => format!("{at} to {} s: {what}", seconds(self.last_ns)),
            false => format!("{at} s: {what}"),
        };
        if self.count == 1 && self.sent_ns != self.at_ns {
            text.push_str(&format!(", sent {} s", seconds(self.sent_ns)));
        }
        match self.fate {
            Fate::Delivered => {}
            Fate::Lost => text.push_str(&format!(", lost: {}", self.reason)),
            Fate::InFlight => text.push_str(", in flight at the end"),
        }
        text
    }
}

/// Seconds, without zeros at the end.
fn seconds(ns: u64) -> String {
    let text = format!("{}.{:09}", ns / 1_000_000_000, ns % 1_000_000_000);
    let text = text.trim_end_matches('0').trim_end_matches('.');
    text.to_owned()
}

/// Which message of its flow a record is of.
fn number(record: &LoggedRecord) -> String {
    let number = match record.match_key {
        Some(key) => key.to_string(),
        None => record.ordinal.to_string(),
    };
    match record.copy {
        0 => number,
        copy => format!("{number}+{copy}"),
    }
}

/// What happened, of what is no message.
fn event_text(record: &LoggedRecord) -> String {
    let at = seconds(record.key.time_ns);
    let receiver = &record.receiver;
    let what = match record.class {
        RecordClass::Crash => "crash".to_owned(),
        RecordClass::Restart => "restart".to_owned(),
        RecordClass::Change => format!("{receiver} changes: {}", record.kind),
        RecordClass::Told => format!("told {}", record.kind),
        RecordClass::Stop => "stop".to_owned(),
        other => format!("{} {}", other.name(), record.kind)
            .trim_end()
            .to_owned(),
    };
    match record.note.is_empty() {
        true => format!("{at} s: {what}"),
        false => format!("{at} s: {what}, {}", record.note),
    }
}

#[cfg(test)]
mod tests;
