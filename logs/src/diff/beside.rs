//! What two files hold beside their messages: channels and their schemas, metadata, attachments.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::DiffReport;
use super::entry::{Mode, Names};
use super::index::{Beside, Index};
use crate::channel::{ChannelInfo, SchemaInfo};
use crate::shown::{apart, escaped};
use crate::source::{Attached, Sum};
use crate::writer::SCENARIO_ATTACHMENT;

/// Notes of one kind that are written out.
const NOTES_SHOWN: usize = 20;

/// Compares what is beside the messages; channels in the order of their topics. Gives the topics whose messages are to be read by field
/// even if their bytes are the same, since their schemas read them differently.
pub(super) fn compare(
    (a, b): (&Index<'_>, &Index<'_>),
    (file_a, file_b): (&str, &str),
    mode: Mode,
    (names, order): (&mut Names, &[u32]),
    report: &mut DiffReport,
) -> BTreeSet<u32> {
    let mut by_field = BTreeSet::new();
    let (channels_a, channels_b) = (a.channels(names), b.channels(names));
    let mut told = BTreeSet::new();
    let mut notes = Vec::new();
    for topic in order {
        let declared = channels_a.contains_key(topic) || channels_b.contains_key(topic);
        if !declared || !told.insert(topic) {
            continue;
        }
        let name = escaped(names.name(*topic));
        match (channels_a.get(topic), channels_b.get(topic)) {
            (Some(x), Some(y)) => {
                let mut found = Channels::default();
                found.compare(&name, x, y);
                notes.append(&mut found.notes);
                report.beside.append(&mut found.differences);
                if found.by_field {
                    by_field.insert(*topic);
                }
            }
            (x, _) => {
                let (index, file) = if x.is_some() {
                    (a, file_a)
                } else {
                    (b, file_b)
                };
                if !index.has_records(*topic) {
                    notes.push(format!(
                        "{name} has no messages, and is declared in {file} only"
                    ));
                }
            }
        }
    }
    let more = notes.len().saturating_sub(NOTES_SHOWN);
    notes.truncate(NOTES_SHOWN);
    report.notes.append(&mut notes);
    if more > 0 {
        report
            .notes
            .push(format!("and {more} more such notes on channels"));
    }
    let (a, b) = (&a.beside, &b.beside);
    metadata(a, b, mode, report);
    attachments(a, b, mode, report);
    if mode == Mode::Any && a.header != b.header {
        for (what, x, y) in [
            ("profiles", &a.header.0, &b.header.0),
            ("libraries", &a.header.1, &b.header.1),
        ] {
            if x != y {
                let (x, y) = apart(x, y);
                report.notes.push(format!(
                    "{what} differ, which is not compared: {x:?} | {y:?}"
                ));
            }
        }
    }
    for (file, beside) in [(file_a, a), (file_b, b)] {
        for other in &beside.others {
            report
                .notes
                .push(format!("{file} has {other}: not compared"));
        }
    }
    by_field
}

/// What the channels of one topic differ in.
#[derive(Default)]
struct Channels {
    notes: Vec<String>,
    differences: Vec<String>,
    by_field: bool,
}

impl Channels {
    fn compare(&mut self, topic: &str, x: &[Arc<ChannelInfo>], y: &[Arc<ChannelInfo>]) {
        if x.len() != y.len() {
            let (n, m) = (x.len(), y.len());
            self.notes.push(format!("{topic} has {n} channels | {m}"));
        }
        for (a, b) in x.iter().zip(y) {
            if a.encoding != b.encoding {
                let (x, y) = apart(&a.encoding, &b.encoding);
                let what = format!("the encoding of {topic} differs: {x:?} | {y:?}");
                self.differences.push(what);
            }
            let keys: BTreeSet<&String> = a.metadata.keys().chain(b.metadata.keys()).collect();
            for key in keys {
                let (x, y) = (a.metadata.get(key), b.metadata.get(key));
                if x != y {
                    let what = format!("metadata {key:?} of channel {topic}");
                    self.differences.push(two(&what, x, y));
                }
            }
            self.schemas(topic, a.schema.as_deref(), b.schema.as_deref());
        }
    }

    fn schemas(&mut self, topic: &str, a: Option<&SchemaInfo>, b: Option<&SchemaInfo>) {
        let (a, b) = match (a, b) {
            (None, None) => return,
            (Some(a), Some(b)) => (a, b),
            (a, _) => {
                let word = |has: bool| if has { "present" } else { "absent" };
                let (x, y) = (word(a.is_some()), word(a.is_none()));
                self.notes
                    .push(format!("the schema of {topic} differs: {x} | {y}"));
                return;
            }
        };
        for (what, x, y) in [
            ("name", &a.name, &b.name),
            ("encoding", &a.encoding, &b.encoding),
        ] {
            if x != y {
                let (x, y) = apart(x, y);
                self.notes.push(format!(
                    "the schema of {topic} differs in its {what}: {x:?} | {y:?}"
                ));
            }
        }
        if a.data == b.data && a.name == b.name {
            return;
        }
        let what = match (a.types(), b.types()) {
            (Ok(x), Ok(y)) => match x.difference(y) {
                Some(what) => {
                    self.by_field = true;
                    what
                }
                None => "only in what no message shows".to_owned(),
            },
            (Err(_), _) | (_, Err(_)) => {
                let (n, m) = (a.data.len(), b.data.len());
                format!("{n} bytes | {m} bytes, compared by bytes only")
            }
        };
        self.notes
            .push(escaped(&format!("the schema of {topic} differs: {what}")));
    }
}

/// Two values of something, where they differ.
fn two(what: &str, x: Option<&String>, y: Option<&String>) -> String {
    let text = match (x, y) {
        (Some(x), Some(y)) => {
            let (x, y) = apart(x, y);
            format!("{x:?} | {y:?}")
        }
        (Some(x), None) => format!("{:?} | absent", crate::shown::shorten(x)),
        (None, Some(y)) => format!("absent | {:?}", crate::shown::shorten(y)),
        (None, None) => String::new(),
    };
    escaped(&format!("{what} differs: {text}"))
}

/// Compares metadata records: the n-th of a name with the n-th. What Farside writes of a run and
/// its machine is told elsewhere, or is not to be compared.
fn metadata(a: &Beside, b: &Beside, mode: Mode, report: &mut DiffReport) {
    type Records<'a> = BTreeMap<(&'a str, usize), [Option<&'a BTreeMap<String, String>>; 2]>;
    let mut records: Records<'_> = BTreeMap::new();
    for (side, beside) in [a, b].into_iter().enumerate() {
        let mut times: BTreeMap<&str, usize> = BTreeMap::new();
        for (name, entries) in &beside.metadata {
            let own = name == "farside" || name.starts_with("farside.");
            if mode == Mode::Farside && own {
                continue;
            }
            let time = times.entry(name).or_default();
            records.entry((name, *time)).or_default()[side] = Some(entries);
            *time += 1;
        }
    }
    for ((name, _), both) in records {
        let [Some(x), Some(y)] = both else {
            let word = |entries: Option<_>| {
                if entries.is_some() {
                    "present"
                } else {
                    "absent"
                }
            };
            let (x, y) = (word(both[0]), word(both[1]));
            report
                .beside
                .push(escaped(&format!("metadata {name} differs: {x} | {y}")));
            continue;
        };
        report.metadata += 1;
        let keys: BTreeSet<&String> = x.keys().chain(y.keys()).collect();
        for key in keys {
            if x.get(key) != y.get(key) {
                let what = format!("metadata {name}.{key}");
                report.beside.push(two(&what, x.get(key), y.get(key)));
            }
        }
    }
}

fn attachments(a: &Beside, b: &Beside, mode: Mode, report: &mut DiffReport) {
    let mut found: BTreeMap<(&str, usize), [Option<&Attached>; 2]> = BTreeMap::new();
    for (side, beside) in [a, b].into_iter().enumerate() {
        let mut times: BTreeMap<&str, usize> = BTreeMap::new();
        for attached in &beside.attachments {
            if mode == Mode::Farside && attached.name == SCENARIO_ATTACHMENT {
                continue;
            }
            let time = times.entry(&attached.name).or_default();
            found.entry((&attached.name, *time)).or_default()[side] = Some(attached);
            *time += 1;
        }
    }
    for ((name, _), both) in found {
        let name = escaped(name);
        let [Some(x), Some(y)] = both else {
            let word = |attached: Option<_>| {
                if attached.is_some() {
                    "present"
                } else {
                    "absent"
                }
            };
            let (x, y) = (word(both[0]), word(both[1]));
            report
                .beside
                .push(format!("attachment {name} differs: {x} | {y}"));
            continue;
        };
        report.attachments += 1;
        let hash = |attached: &Attached| match attached.sum {
            Sum::Matches(hash) | Sum::Differs(hash) => hash,
            Sum::NotLookedAt => 0,
        };
        if (x.data_bytes, hash(x)) != (y.data_bytes, hash(y)) {
            let show = |attached: &Attached| {
                format!(
                    "{} bytes, hash {:016x}",
                    attached.data_bytes,
                    hash(attached)
                )
            };
            let what = format!("attachment {name} differs: {} | {}", show(x), show(y));
            report.beside.push(what);
        }
        if x.media_type != y.media_type {
            let what = format!("media type of attachment {name}");
            report
                .beside
                .push(two(&what, Some(&x.media_type), Some(&y.media_type)));
        }
        let times = |attached: &Attached| (attached.log_time, attached.create_time);
        if mode == Mode::Any && times(x) != times(y) {
            let what = format!("the times of attachment {name} differ: not compared");
            report.notes.push(what);
        }
        for (which, attached) in [("first", x), ("second", y)] {
            if let Sum::Differs(_) = attached.sum {
                let what = "does not match its checksum";
                report
                    .notes
                    .push(format!("attachment {name} of the {which} file {what}"));
            }
        }
    }
}
