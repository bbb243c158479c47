//! What fields of messages were, thinned to what a figure can show.

use std::collections::BTreeMap;
use std::path::Path;

use farside::suggest::{did_you_mean, nearest};
use farside_logs::{AnyMessage, AnyMessages, Log, Value};

use super::Wanted;
use crate::commands::CommandError;

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
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Curve {
    pub(super) topic: String,
    pub(super) field: String,
    /// Times in nanoseconds and values, thinned.
    pub(super) points: Vec<(u64, f64)>,
    /// How many values there were.
    pub(super) values: u64,
    /// The least and the greatest finite value.
    pub(super) range: Option<[f64; 2]>,
    /// Messages whose field was no number.
    pub(super) no_number: u64,
    /// Values stand for a time of this length each, once there are too many.
    width_ns: u64,
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
            if its.all(|curve| curve.values == 0) {
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
            .filter(|curve| curve.values > 0)
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
        ..Curve::default()
    });
    let field = &wanted.field;
    let found = value
        .at(field)
        .or_else(|| value.at(&format!("body.{field}")));
    match found.and_then(|found| found.as_f64()) {
        Some(number) => curve.push(time_ns, number),
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

impl Curve {
    /// Adds a value. Once there are too many, of each short time the first, least, greatest and last are kept.
    fn push(&mut self, time_ns: u64, value: f64) {
        self.values += 1;
        if value.is_finite() {
            let [least, greatest] = self.range.unwrap_or([value; 2]);
            self.range = Some([least.min(value), greatest.max(value)]);
        }
        self.points.push((time_ns, value));
        if self.points.len() >= 4 * POINTS {
            self.thin();
        }
    }

    fn thin(&mut self) {
        let times = self.points.iter().map(|(time_ns, _)| *time_ns);
        let (from, until) = (times.clone().min().unwrap_or(0), times.max().unwrap_or(0));
        self.width_ns = ((until - from) / (POINTS as u64 / 4) + 1).max(self.width_ns);
        let width_ns = self.width_ns;
        let mut kept: Vec<(u64, f64)> = Vec::new();
        for group in self
            .points
            .chunk_by(|a, b| a.0 / width_ns == b.0 / width_ns)
        {
            let order = |a: &&(u64, f64), b: &&(u64, f64)| a.1.total_cmp(&b.1);
            let ends = [group.first(), group.last()];
            let extremes = [group.iter().min_by(order), group.iter().max_by(order)];
            let mut some: Vec<(u64, f64)> = ends
                .into_iter()
                .chain(extremes)
                .flatten()
                .copied()
                .collect();
            some.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
            some.dedup_by(|a, b| a.0 == b.0 && a.1.to_bits() == b.1.to_bits());
            kept.append(&mut some);
        }
        self.points = kept;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinned_curves_keep_their_extremes_and_ends() {
        let mut curve = Curve::default();
        let value = |at: u64| if at == 54_321 { 99.0 } else { (at % 17) as f64 };
        for at in 0..100_000 {
            curve.push(at * 1_000, value(at));
        }
        assert!(curve.points.len() < 4 * POINTS, "{}", curve.points.len());
        assert_eq!(curve.values, 100_000);
        assert_eq!(curve.range, Some([0.0, 99.0]));
        assert!(curve.points.contains(&(54_321_000, 99.0)));
        assert_eq!(curve.points[0], (0, 0.0));
        assert_eq!(curve.points.last(), Some(&(99_999_000, value(99_999))));
        assert!(curve.points.is_sorted_by_key(|(time_ns, _)| *time_ns));
    }
}
