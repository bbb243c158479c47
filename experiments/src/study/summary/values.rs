//! What a run says under a metric's name, and of which kind it is.

use std::borrow::Cow;
use std::collections::BTreeMap;

use serde_json::Value;

use crate::stats::survival::Observation;
use crate::study::results::{DeclaredKind, MessageCounts, Results, RunOutcome, RunRecord};
use farside_actors::system::Series;

/// What a metric's values are, in all cells alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ValueKind {
    /// Numbers, summed up by their mean.
    Number,
    /// True or false, summed up as a rate.
    Rate,
    /// Lists of numbers, summed up as a distribution.
    List,
    /// Curves, summed up index by index.
    Series,
    /// Words, which are counted.
    Text,
    /// No run reports it.
    Absent,
}

impl From<DeclaredKind> for ValueKind {
    fn from(declared: DeclaredKind) -> ValueKind {
        match declared {
            DeclaredKind::Number => ValueKind::Number,
            DeclaredKind::Rate => ValueKind::Rate,
            DeclaredKind::List => ValueKind::List,
            DeclaredKind::Series => ValueKind::Series,
            DeclaredKind::Word => ValueKind::Text,
        }
    }
}

/// What a run says under a metric's name: one of the system's, or, where the system has none of
/// that name, what the kernel counts: `messages.sent` (`delivered`, `lost`, `duplicated`,
/// `in_flight`), `messages.lost.loss` and so on for each reason, `events`, `sim_time_s`,
/// `violations`. None for a run that failed or does not know it; `null` is none too.
pub fn value_of<'a>(outcome: &'a RunOutcome, name: &str) -> Option<Cow<'a, Value>> {
    let RunOutcome::Done {
        sim_time_s,
        events,
        messages,
        metrics,
        violations,
        ..
    } = outcome
    else {
        return None;
    };
    if let Some(value) = metrics.get(name) {
        return (!value.is_null()).then_some(Cow::Borrowed(value));
    }
    let number = match name {
        "events" => Value::from(*events),
        "sim_time_s" => Value::from(*sim_time_s),
        "violations" => Value::from(violations.len()),
        name => Value::from(message_count(messages, name.strip_prefix("messages.")?)?),
    };
    Some(Cow::Owned(number))
}

fn message_count(messages: &MessageCounts, name: &str) -> Option<u64> {
    Some(match name {
        "sent" => messages.sent,
        "delivered" => messages.delivered,
        "lost" => messages.lost,
        "duplicated" => messages.duplicated,
        "in_flight" => messages.in_flight,
        name => {
            let reason = name
                .strip_prefix("lost_by_reason.")
                .or_else(|| name.strip_prefix("lost."))?;
            // A reason that never struck is not listed.
            messages.lost_by_reason.get(reason).copied().unwrap_or(0)
        }
    })
}

/// A run's value as a number; true is 1 and false 0. None for one that is not finite.
pub fn number_of(run: &RunRecord, name: &str) -> Option<f64> {
    let value = value_of(&run.outcome, name)?;
    let number = match value.as_ref() {
        Value::Bool(yes) => Some(f64::from(u8::from(*yes))),
        value => value.as_f64(),
    };
    number.filter(|number| number.is_finite())
}

/// The kind of a metric: what its system declares; of others, what all runs say. One list makes it
/// lists, one curve curves, one word makes it words; numbers and truth values together are numbers.
pub fn kind_of(results: &Results, name: &str) -> ValueKind {
    let metrics = &results.manifest.metrics;
    let declared = metrics.iter().find(|metric| metric.name == name);
    let declared = declared.and_then(|metric| metric.kind);
    if let Some(declared) = declared {
        let mut runs = results.runs.iter();
        let reported = runs.any(|run| value_of(&run.outcome, name).is_some());
        return if reported {
            declared.into()
        } else {
            ValueKind::Absent
        };
    }
    let mut kind = ValueKind::Absent;
    for run in &results.runs {
        let Some(value) = value_of(&run.outcome, name) else {
            continue;
        };
        match (value.as_ref(), kind) {
            (Value::Array(_), _) => return ValueKind::List,
            (Value::Object(_), _) if Series::from_json(&value).is_ok() => return ValueKind::Series,
            (Value::String(_) | Value::Object(_), _) => kind = ValueKind::Text,
            (Value::Number(_), ValueKind::Absent | ValueKind::Rate) => kind = ValueKind::Number,
            (Value::Bool(_), ValueKind::Absent) => kind = ValueKind::Rate,
            _ => {}
        }
    }
    kind
}

/// What the runs of a cell say under the name of a list, as things that were watched: rovers, say,
/// until they arrived. A `null` in a run whose time was over is censored at its end. In a run that
/// ended otherwise it never happens: it is watched for ever. What one run lists shares its fate,
/// and so do runs of one block.
pub fn observations(results: &Results, cell: usize, name: &str) -> Vec<Observation> {
    let mut observations = Vec::new();
    let manifest = &results.manifest;
    let places = manifest.seeds.iter().enumerate();
    let places: BTreeMap<u64, usize> = match manifest.block {
        0 | 1 => BTreeMap::new(),
        _ => places.map(|(place, seed)| (*seed, place)).collect(),
    };
    for (alone, run) in results.of_cell(cell).iter().enumerate() {
        let place = places.get(&run.seed);
        let group = place.map_or(alone, |place| place / manifest.block);
        let Some(value) = value_of(&run.outcome, name) else {
            continue;
        };
        let (Value::Array(values), RunOutcome::Done { sim_time_s, .. }) =
            (value.as_ref(), &run.outcome)
        else {
            continue;
        };
        let (sim_time_s, timed_out) = (*sim_time_s, timed_out(run));
        observations.extend(values.iter().map(|value| match value.as_f64() {
            Some(time) => Observation {
                time,
                happened: true,
                group,
            },
            None => Observation {
                time: if timed_out { sim_time_s } else { f64::INFINITY },
                happened: false,
                group,
            },
        }));
    }
    observations
}

/// The curves of a cell's runs, by seed; a run that has none is left out.
pub fn curves(results: &Results, cell: usize, name: &str) -> BTreeMap<u64, Series> {
    let runs = results.of_cell(cell).iter();
    let curves = runs.filter_map(|run| {
        let value = value_of(&run.outcome, name)?;
        Some((run.seed, Series::from_json(&value).ok()?))
    });
    curves.collect()
}

fn timed_out(run: &RunRecord) -> bool {
    matches!(
        run.outcome,
        RunOutcome::Done {
            timed_out: true,
            ..
        }
    )
}
