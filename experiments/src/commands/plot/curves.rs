//! What fields of messages were, thinned to what a figure can show.

use std::collections::BTreeMap;
use std::path::Path;

use farside::suggest::{did_you_mean, nearest};
use farside_logs::{AnyMessage, AnyMessages, Log, Value};

use super::Wanted;
use crate::commands::CommandError;
use crate::thinned::Thinned;

/// As many curves as can be told apart.
const CURVES: usize = 42;

/// As many points as a curve keeps: two for each pixel, the least and the greatest there.
const POINTS: usize = 4096;

/// The time span, in nanoseconds since the log's first message, or since the start of a Farside run.
pub(super) struct Part {
    pub(super) from_ns: u64,
    pub(super) until_ns: u64,
}

/// A field of a topic over time.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Curve {
    pub(super) topic: String,
    pub(super) field: String,
    /// Its values, thinned.
    pub(super) values: Thinned,
    /// Messages whose field was no number.
    pub(super) no_number: u64,
}

/// All that is plotted.
#[derive(Debug, Default)]
pub(super) struct Curves {
    pub(super) curves: Vec<Curve>,
    pub(super) remarks: Vec<String>,
}

impl Curves {
    pub(super) fn read(
        path: &Path,
        wanted: &[Wanted],
        part: &Part,
    ) -> Result<Curves, CommandError> {
        let globs: Vec<String> = wanted.iter().map(|one| one.glob.clone()).collect();
        let mut messages = AnyMessages::open(path, &globs)?;
        // Runs begin at a time of their own, whichever message is the first.
        let mut start_ns = Log::open(path).ok().map(|log| log.epoch_ns());
        let mut curves: BTreeMap<(usize, String), Curve> = BTreeMap::new();
        let mut unread: Option<String> = None;
        let mut fields: Vec<String> = Vec::new();
        while let Some(message) = messages.next()? {
            let start_ns = *start_ns.get_or_insert(message.log_time_ns());
            let time_ns = message.log_time_ns().saturating_sub(start_ns);
            if time_ns < part.from_ns || time_ns > part.until_ns {
                continue;
            }
            let value = match message.value() {
                Ok(value) => value,
                Err(error) => {
                    let topic = message.topic();
                    unread.get_or_insert_with(|| format!("{topic}: {error}"));
                    continue;
                }
            };
            if fields.is_empty() {
                value.flatten(&mut |path, _| fields.push(path.to_owned()));
            }
            for (at, one) in wanted.iter().enumerate() {
                if one.topics.matches(message.topic()) {
                    add(&mut curves, at, one, &message, &value, time_ns)?;
                }
            }
        }
        let mut remarks: Vec<String> = messages.cut().map(str::to_owned).into_iter().collect();
        remarks.extend(unread.map(|unread| format!("not read: {unread}")));
        let curves: Vec<Curve> = curves.into_values().collect();
        for one in wanted {
            let its = curves.iter().filter(|curve| curve.field == one.field);
            let mut its = its.filter(|curve| one.topics.matches(&curve.topic));
            if its.all(|curve| curve.values.values == 0) {
                return Err(none(one, &curves, &fields, &remarks));
            }
        }
        for curve in curves.iter().filter(|curve| curve.no_number > 0) {
            let Curve {
                topic,
                field,
                no_number,
                ..
            } = curve;
            remarks.push(format!(
                "{topic}.{field}: {no_number} messages have no number there"
            ));
        }
        let curves = curves
            .into_iter()
            .filter(|curve| curve.values.values > 0)
            .collect();
        Ok(Curves { curves, remarks })
    }
}

fn add(
    curves: &mut BTreeMap<(usize, String), Curve>,
    at: usize,
    wanted: &Wanted,
    message: &AnyMessage<'_>,
    value: &Value<'_>,
    time_ns: u64,
) -> Result<(), CommandError> {
    let key = (at, message.topic().to_owned());
    if curves.len() >= CURVES && !curves.contains_key(&key) {
        return Err(CommandError::Arguments(format!(
            "{}.{}: more than {CURVES} curves cannot be told apart; ask for fewer topics",
            wanted.glob, wanted.field
        )));
    }
    let curve = curves.entry(key).or_insert_with(|| Curve {
        topic: message.topic().to_owned(),
        field: wanted.field.clone(),
        values: Thinned::to(POINTS),
        no_number: 0,
    });
    let field = &wanted.field;
    let found = value
        .at(field)
        .or_else(|| value.at(&format!("body.{field}")));
    match found.and_then(|found| found.as_f64()) {
        Some(number) => curve.values.push(time_ns, number),
        None => curve.no_number += 1,
    }
    Ok(())
}

/// Why nothing of a field is plotted.
fn none(wanted: &Wanted, curves: &[Curve], fields: &[String], remarks: &[String]) -> CommandError {
    let Wanted { glob, field, .. } = wanted;
    let text = |why: &str| CommandError::Arguments(format!("{glob}.{field}: {why}"));
    let is_its = |curve: &&Curve| curve.field == *field && wanted.topics.matches(&curve.topic);
    if !curves.iter().any(|curve| is_its(&curve)) {
        return match remarks.first() {
            Some(remark) => text(remark),
            None => text("there is no message on this topic in this time"),
        };
    }
    let hint = did_you_mean(nearest(field, fields.iter().map(String::as_str)).as_deref());
    text(&format!("no message has a number there{hint}"))
}
