//! The page of a run, or of two beside each other: one HTML file that loads nothing.
//!
//! A log is read once, in bounded memory. What it says becomes four blocks for each side, compressed and in base 64
//! (`columns`): the head, JSON with names, flows, counts and what is beside the messages; the rows (`rows`), numbers
//! by column; the map (`map`) and the curves (`series`), JSON; and what messages say (`details`). The scripts in
//! `assets/`, a file for each concern, draw it. Nothing of a log stands in the page but in such blocks and, escaped,
//! in its title: so nothing that a log says can be taken for markup.

mod columns;
mod details;
mod map;
mod markup;
mod rows;
mod series;
#[cfg(test)]
mod tests;

use std::path::Path;

use farside::SimDuration;
use farside_logs::{
    AnyMessage, AnyMessages, DiffReport, Differing, Log, LogError, LogInfo, RecordRef, escaped,
};
use serde_json::{Value as Json, json};

use details::Details;
use map::Map;
use rows::{Bounds, Happened, Rows};
use series::Series;

/// As many rows as a page of one log has; a page of two has half as many of each.
const ROWS: usize = 2_200_000;

/// Logs of up to so many messages are told to the nanosecond, larger ones to the microsecond.
const EXACT: u64 = 250_000;

/// The part of a run that a page shows, in nanoseconds since its start.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Window {
    pub(crate) from_ns: u64,
    pub(crate) until_ns: u64,
}

impl Default for Window {
    fn default() -> Self {
        Window {
            from_ns: 0,
            until_ns: u64::MAX,
        }
    }
}

impl Window {
    /// What the page says of it; nothing of a whole run.
    fn note(self) -> Option<String> {
        let Window { from_ns, until_ns } = self;
        let time = |ns| SimDuration::from_nanos(ns);
        let span = match (from_ns, until_ns) {
            (0, u64::MAX) => return None,
            (from, u64::MAX) => format!("from {} on", time(from)),
            (from, until) => format!("from {} to {}", time(from), time(until)),
        };
        Some(format!(
            "The page shows the run {span}: what was before or after is not on it."
        ))
    }
}

/// A log as a page shows it.
pub(crate) struct Side {
    head: Json,
    rows: String,
    map: String,
    series: String,
    details: String,
    /// Messages and events that can be looked at one by one.
    pub(crate) shown: u32,
    /// Those that are only counted.
    pub(crate) left_out: u64,
    /// Which part of the run was asked for, unless the whole.
    asked: Option<String>,
    /// What a reader should know of what the page does not have, and was not asked to leave out.
    pub(crate) warnings: Vec<String>,
    /// The time that it is to show begins behind the end of the log.
    pub(crate) is_behind_its_end: bool,
}

impl Side {
    /// What a reader should know of what the page does not have.
    pub(crate) fn notes(&self) -> impl Iterator<Item = &String> {
        self.asked.iter().chain(&self.warnings)
    }
}

/// What a log is read into.
struct Reading<'a> {
    rows: Rows,
    map: Map,
    series: Series,
    /// Since when times count; a log of another program counts from its earliest message.
    start_ns: u64,
    /// What is read of it. On the page times count from where it begins.
    window: Window,
    /// Which of the two logs of a comparison it is, and which messages differ.
    marks: Option<(usize, &'a Differing)>,
    is_farside: bool,
    unreadable: u64,
    first_unreadable: String,
    /// Something is as late as what is read begins.
    reaches_window: bool,
}

/// Reads a log, or a part of it, for a page of one run.
///
/// # Errors
/// If it cannot be read, or is damaged before its end.
pub(crate) fn read(path: &Path, window: Window) -> Result<Side, LogError> {
    read_for(path, window, None)
}

/// Reads one of two logs, the first (0) or the second (1), for a page of what differs between them.
///
/// # Errors
/// Those of [`read`].
pub(crate) fn read_beside(
    path: &Path,
    log: usize,
    differing: &Differing,
) -> Result<Side, LogError> {
    read_for(path, Window::default(), Some((log, differing)))
}

fn read_for(
    path: &Path,
    window: Window,
    marks: Option<(usize, &Differing)>,
) -> Result<Side, LogError> {
    // Said of what is no MCAP file before anything else.
    let mut messages = AnyMessages::open(path, &[])?;
    let info = farside_logs::info(path)?;
    let start_ns = Log::open(path).ok().map(|log| log.epoch_ns());
    let logs = 1 + usize::from(marks.is_some());
    let bounds = Bounds {
        rows: ROWS / logs,
        more: ROWS / logs / 8,
        unit_ns: if info.messages <= EXACT { 1 } else { 1_000 },
    };
    let mut reading = Reading {
        rows: Rows::new(bounds, Details::of_at_most(details::BYTES / logs)),
        map: Map::default(),
        series: Series::default(),
        is_farside: start_ns.is_some(),
        // Messages may be in any order: time begins with the earliest.
        start_ns: start_ns.or(info.start_ns).unwrap_or(0),
        window,
        marks,
        unreadable: 0,
        first_unreadable: String::new(),
        reaches_window: false,
    };
    while let Some(message) = messages.next()? {
        reading.add(&message);
    }
    let cut = messages.cut().map(str::to_owned);
    Ok(reading.finish(path, &info, cut))
}

impl Reading<'_> {
    fn add(&mut self, message: &AnyMessage<'_>) {
        let Window { from_ns, until_ns } = self.window;
        let at_ns = message.log_time_ns().saturating_sub(self.start_ns);
        if at_ns > until_ns {
            return;
        }
        let is_before = at_ns < from_ns;
        self.reaches_window |= !is_before;
        let at_ns = at_ns.saturating_sub(from_ns);
        self.rows.reaches(at_ns);
        let channel = message.channel();
        let schema = channel.schema.as_ref().map_or("", |schema| &schema.name);
        if map::is_drawn(schema) {
            match message.value() {
                Ok(value) => self.map.add(schema, message.topic(), &value, at_ns),
                Err(error) => self.miss(message, &error.to_string()),
            }
        }
        // Where things stand as the page begins is seen on its map; nothing else is of what was before.
        if is_before {
            return;
        }
        if !self.is_farside {
            return self.add_foreign(message, schema, at_ns);
        }
        match channel.role() {
            "message" | "event" => match message.record() {
                Some(record) => {
                    let from_ns = self.window.from_ns;
                    let differs = self.differs(message);
                    let happened = Happened {
                        differs,
                        ..Happened::of(&record, at_ns, from_ns)
                    };
                    self.rows.add(&happened, || said(message, &record));
                }
                None => self.miss(message, "malformed"),
            },
            "state" => match message.value() {
                Ok(value) => {
                    let topic = message.topic();
                    let inner = topic.strip_prefix("/state/").unwrap_or(topic);
                    let (actor, kind) = inner.rsplit_once('/').unwrap_or(("", inner));
                    self.series.add(kind, actor, &value, at_ns);
                }
                Err(error) => self.miss(message, &error.to_string()),
            },
            _ => {}
        }
    }

    /// A message of another program: each topic is an actor that says it.
    fn add_foreign(&mut self, message: &AnyMessage<'_>, schema: &str, at_ns: u64) {
        let value = message.value();
        match &value {
            Ok(value) => self.series.add(schema, message.topic(), value, at_ns),
            Err(error) => self.miss(message, &error.to_string()),
        }
        let published = message.publish_time_ns();
        // What was published before the first message was logged is drawn from there.
        let begin_ns = self.start_ns.saturating_add(self.window.from_ns);
        let sent_ns = published.saturating_sub(begin_ns).min(at_ns);
        let topic = escaped(message.topic());
        let happened = Happened {
            class: "message",
            sender: &topic,
            receiver: &topic,
            link: "",
            kind: schema,
            reason: "",
            ordinal: u64::from(message.sequence()),
            copy: 0,
            at_ns,
            sent_ns,
            key: None,
            cause: None,
            differs: self.differs(message),
        };
        let said = || match &value {
            Ok(value) => value.to_string(),
            Err(error) => format!("{} bytes: {error}", message.data().len()),
        };
        self.rows.add(&happened, said);
    }

    fn differs(&self, message: &AnyMessage<'_>) -> bool {
        let marks = self.marks;
        marks.is_some_and(|(log, differing)| differing.has(log, message))
    }

    fn miss(&mut self, message: &AnyMessage<'_>, why: &str) {
        if self.unreadable == 0 {
            self.first_unreadable = format!("{}: {why}", escaped(message.topic()));
        }
        self.unreadable += 1;
    }

    fn finish(mut self, path: &Path, info: &LogInfo, cut: Option<String>) -> Side {
        let asked = self.window.note();
        let mut warnings: Vec<String> = Vec::new();
        warnings.extend(cut.as_ref().map(|cut| format!("The log is {cut}.")));
        let is_cut = cut.is_some();
        let missing = info.missing.iter().filter(|_| !is_cut);
        let missing: Vec<String> = missing.map(|missing| escaped(missing)).collect();
        warnings.extend(missing);
        if self.unreadable > 0 {
            let (count, first) = (self.unreadable, &self.first_unreadable);
            warnings.push(format!(
                "{count} messages could not be read; the first, {first}"
            ));
        }
        let (shown, left_out) = (self.rows.rows(), self.rows.left_out());
        let file = path.file_name().unwrap_or_default().to_string_lossy();
        // First: what there is no room for is told in the head.
        let details = self.rows.details.packed();
        let map = match self.map.is_empty() {
            true => Json::Null,
            false => self.map.told(),
        };
        let head = json!({
            "file": escaped(&file),
            "path": escaped(&path.display().to_string()),
            "farside": self.is_farside,
            "facts": facts(info),
            "scenario": info.run.as_ref().map(|run| escaped(&run.scenario)),
            "notes": asked.iter().chain(&warnings).collect::<Vec<_>>(),
            "from_ns": self.window.from_ns,
            "told": self.rows.told(),
        });
        Side {
            head,
            rows: columns::block(&self.rows.bytes()),
            map: columns::block(map.to_string().as_bytes()),
            series: columns::block(self.series.told().to_string().as_bytes()),
            details,
            shown,
            left_out,
            asked,
            warnings,
            is_behind_its_end: self.window.from_ns > 0 && !self.reaches_window,
        }
    }
}

/// What a message says, and how its link carried it in a line of its own.
fn said(message: &AnyMessage<'_>, record: &RecordRef<'_>) -> String {
    let body = match (record.note, record.body) {
        ("", []) => String::new(),
        ("", _) => match message.value() {
            Ok(value) => value
                .field("body")
                .map_or_else(String::new, ToString::to_string),
            Err(error) => format!("{} bytes: {error}", record.body.len()),
        },
        (note, _) => escaped(note),
    };
    let Some(carriage) = &record.carriage else {
        return body;
    };
    let parts = [
        ("queue", carriage.queue.as_nanos()),
        ("serialization", carriage.serialization.as_nanos()),
        ("propagation", carriage.propagation.as_nanos()),
        ("retries", carriage.retries.as_nanos()),
    ];
    let parts = parts.into_iter().filter(|(_, ns)| *ns > 0);
    let mut parts: Vec<String> = parts
        .map(|(name, ns)| format!("{name} {}", milliseconds(ns as f64)))
        .collect();
    if carriage.jitter_ns != 0 {
        parts.push(format!(
            "jitter {}",
            milliseconds(carriage.jitter_ns as f64)
        ));
    }
    if carriage.attempts != 1 {
        parts.push(format!("{} attempts", carriage.attempts));
    }
    match parts.is_empty() {
        true => body,
        false => format!("{body}\n{}", parts.join(", ")),
    }
}

fn milliseconds(ns: f64) -> String {
    format!("{:.3} ms", ns / 1e6)
}

/// What there is to say of a log in front of everything else.
fn facts(info: &LogInfo) -> Vec<[String; 2]> {
    let mut facts: Vec<[String; 2]> = Vec::new();
    let mut fact = |name: &str, value: String| facts.push([name.to_owned(), value]);
    match &info.run {
        Some(run) => {
            fact("scenario", escaped(&run.scenario));
            fact("seed", run.seed.to_string());
            if let Some(tie_seed) = run.tie_seed {
                fact("tie seed", tie_seed.to_string());
            }
            if let Some(end) = &run.end {
                let detail = match run.end_detail.as_str() {
                    "" => String::new(),
                    detail => format!(": {detail}"),
                };
                fact("end", escaped(&format!("{end}{detail}")));
            }
            if let Some(digest) = &run.digest {
                fact("digest", escaped(digest));
            }
            fact("code", escaped(&run.code_version));
            if !run.exclude.is_empty() {
                fact("not written", escaped(&run.exclude.join(", ")));
            }
        }
        None => {
            fact("written by", escaped(&info.library));
            fact("messages", info.messages.to_string());
            fact("topics", info.topics.len().to_string());
        }
    }
    facts
}

/// The page of one log.
pub(crate) fn of_run(side: &Side) -> String {
    let file = side.head["file"].as_str().unwrap_or_default();
    let title = format!("Run {file}");
    markup::page(&title, &[side], &Json::Null)
}

/// The page of two logs and what differs between them.
///
/// # Errors
/// If the report is no JSON, which it always is.
pub(crate) fn of_diff(sides: [&Side; 2], report: &DiffReport) -> Result<String, serde_json::Error> {
    let [a, b] = sides.map(|side| side.head["file"].as_str().unwrap_or_default());
    let title = format!("{a} beside {b}");
    Ok(markup::page(&title, &sides, &serde_json::to_value(report)?))
}
