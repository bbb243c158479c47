//! Whether the topics and fields that somebody names are there.

use std::collections::BTreeSet;
use std::path::Path;

use farside::suggest::{did_you_mean, nearest};

use super::DiffOptions;
use super::entry::Mode;
use super::index::Index;
use crate::LogError;
use crate::any::AnyMessages;
use crate::channel::ChannelInfo;
use crate::topics::Topics;
use crate::value;

/// How deep fields are looked for.
const DEPTH: usize = 12;

/// How many fields are looked for on one channel.
const NAMES: usize = 20_000;

/// Messages of a channel without a schema that are looked at for the fields that they have.
const LOOKED_AT: u64 = 100;

/// What a message has beside what it says, in any file.
const OF_ALL: [&str; 3] = ["log_time", "publish_time", "data"];

/// What a record of Farside's has.
const OF_RECORDS: [&str; 7] = ["log_time", "sent", "fate", "link", "reason", "note", "body"];

/// Checks all names in the options; both logs are read to their ends.
pub(super) fn check(
    (a, b): (&Index<'_>, &Index<'_>),
    mode: Mode,
    options: &DiffOptions,
) -> Result<(), LogError> {
    let channels = || a.scanner.channels().iter().chain(b.scanner.channels());
    for glob in &options.topics {
        let topics = Topics::new(std::slice::from_ref(glob))?;
        if !channels().any(|channel| topics.matches(&channel.topic)) {
            let close = nearest(glob, channels().map(|channel| channel.topic.as_str()));
            return Err(LogError::NoSuchTopic {
                path: a.scanner.path().to_owned(),
                topic: glob.clone(),
                hint: did_you_mean(close.as_deref()),
            });
        }
    }
    let rules = options.rules();
    if !rules.name_fields() {
        return Ok(());
    }
    let always = match mode {
        Mode::Farside => &OF_RECORDS[..],
        Mode::Any => &OF_ALL,
    };
    let mut names: BTreeSet<String> = always.iter().map(|name| (*name).to_owned()).collect();
    for channel in channels() {
        of_channel(channel, &mut names);
    }
    let is_topic = |name: &String| channels().any(|channel| channel.topic == *name);
    let ignored = |name: &String| options.ignore.contains(name) && is_topic(name);
    let is_missing =
        |names: &BTreeSet<String>, name: &String| !names.contains(name) && !ignored(name);
    if rules.named().any(|name| is_missing(&names, &name)) {
        for log in [a, b] {
            of_messages(log.scanner.path(), &mut names)?;
        }
    }
    let mut parts = rules.named().filter(|name| !ignored(name));
    if let Some((field, time)) = parts.find_map(|name| part_of_time(&names, name)) {
        return Err(LogError::PartOfTime { field, time });
    }
    match rules.named().find(|name| is_missing(&names, name)) {
        None => Ok(()),
        Some(field) => {
            let close = nearest(&field, names.iter().map(String::as_str));
            let hint = did_you_mean(close.as_deref());
            Err(LogError::NoSuchField { field, hint })
        }
    }
}

/// A field that is a part of a time, and that time: whatever is said of it alone has no effect, since times are
/// compared as a whole.
fn part_of_time(names: &BTreeSet<String>, field: String) -> Option<(String, String)> {
    let (time, part) = field.rsplit_once('.')?;
    let within = format!("{time}.");
    let others = names.iter().filter_map(|name| name.strip_prefix(&within));
    let others: Vec<&str> = others.filter(|other| *other != part).collect();
    let is_time = matches!(others[..], [other] if value::are_time(part, other));
    is_time.then(|| (field.clone(), time.to_owned()))
}

/// The fields that a channel's schema declares.
fn of_channel(channel: &ChannelInfo, names: &mut BTreeSet<String>) {
    let Some(schema) = &channel.schema else {
        return;
    };
    let mut left = NAMES;
    let mut add = |name: &str| {
        left = left.saturating_sub(1);
        names.insert(name.to_owned());
        left > 0
    };
    if schema.encoding == "protobuf" {
        if let Ok(types) = schema.types() {
            types.fields(&mut |name| add(name), DEPTH);
        }
    } else if let Ok(layout) = schema.layout() {
        layout.fields(&mut |name| add(name), DEPTH);
    }
}

/// The fields that the first messages of channels have whose schemas declare none.
fn of_messages(path: &Path, names: &mut BTreeSet<String>) -> Result<(), LogError> {
    let mut messages = AnyMessages::open(path, &[])?;
    let mut read = std::collections::BTreeMap::new();
    while let Some(message) = messages.next()? {
        let channel = message.channel();
        if channel.encoding != "json" && channel.encoding != "protobuf" {
            continue;
        }
        let count = read.entry(channel.serial).or_insert(0u64);
        *count += 1;
        if *count > LOOKED_AT || names.len() > NAMES {
            continue;
        }
        if let Ok(value) = message.value() {
            value::names(&value, &mut |name| {
                names.insert(name.to_owned());
            });
        }
    }
    Ok(())
}
