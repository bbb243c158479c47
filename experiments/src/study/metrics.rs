//! Metrics: those that every run has, and which a run can be measured by.

use farside_actors::system::Better::{Higher, Lower, Neither};
use farside_actors::system::{
    Metric as KnownMetric, MetricKind, Series, SeriesIndex as KnownIndex,
};
use serde_json::{Map, Value};

use super::file::MetricFile;
use super::results::{DeclaredBetter, Metric, SeriesIndex};

/// What is known of every run, whatever its system; `messages.lost.outage` and so on besides.
pub(crate) const KERNEL: [KnownMetric; 8] = [
    KnownMetric::number("events", "events", "events", Neither)
        .about("How many events were handled: messages delivered, timers, starts, crashes."),
    KnownMetric::number("sim_time_s", "virtual time", "s", Neither)
        .about("When the run ended, in virtual time."),
    KnownMetric::number("violations", "violations", "", Lower)
        .about("How often something happened that must never happen, as the system says."),
    KnownMetric::number("messages.sent", "messages sent", "messages", Neither)
        .about("Messages that actors sent, further copies that links made not included."),
    KnownMetric::number(
        "messages.delivered",
        "message copies delivered",
        "messages",
        Higher,
    )
    .about("Copies of messages that arrived."),
    KnownMetric::number("messages.lost", "message copies lost", "messages", Lower)
        .about("Copies of messages that were lost, for whatever reason; messages.lost.REASON has those for one."),
    KnownMetric::number(
        "messages.duplicated",
        "message copies duplicated",
        "messages",
        Neither,
    )
    .about("Copies of messages beyond the first of each."),
    KnownMetric::number(
        "messages.in_flight",
        "message copies under way at the end",
        "messages",
        Neither,
    )
    .about("Copies of messages that were on their way when the run ended."),
];

/// A metric with what the study leaves open filled in, by what the kernel and the system know.
pub(super) fn metric<'a>(
    file: &MetricFile,
    known: impl FnOnce(&str) -> Option<&'a KnownMetric>,
) -> Metric {
    let name = file.name.as_str();
    let kernel = KERNEL.iter().find(|metric| metric.name == name);
    let known = kernel.or_else(|| known(name));
    let (label, unit) = known.map_or((name, ""), |metric| (metric.label, metric.unit));
    Metric {
        name: file.name.clone(),
        label: file.label.clone().unwrap_or_else(|| label.to_owned()),
        unit: file.unit.clone().unwrap_or_else(|| unit.to_owned()),
        index: index(file, known),
        kind: known.map(|metric| metric.kind.into()),
        better: known.and_then(|metric| DeclaredBetter::of(metric.better)),
    }
}

/// What the index of a curve is: what the study says of it, and for the rest the system.
fn index(file: &MetricFile, known: Option<&KnownMetric>) -> Option<SeriesIndex> {
    let own = file.index.clone();
    let declared = known.and_then(|metric| match metric.kind {
        MetricKind::Series(index) => Some(index),
        _ => None,
    });
    if own.is_none() && declared.is_none() {
        return None;
    }
    let own = own.unwrap_or_default();
    let declared = declared.unwrap_or(KnownIndex::new("index", ""));
    Some(SeriesIndex {
        label: own.label.unwrap_or_else(|| declared.label.to_owned()),
        unit: own.unit.unwrap_or_else(|| declared.unit.to_owned()),
        lengths_differ: own.lengths_differ.unwrap_or(declared.lengths_differ),
    })
}

/// Whether it can be summed up: a number, true or false, a word, a list of numbers, a curve; or
/// nothing yet.
fn is_measure(value: &Value) -> bool {
    match value {
        Value::Number(_) | Value::Bool(_) | Value::String(_) | Value::Null => true,
        Value::Array(entries) => entries
            .iter()
            .all(|entry| entry.is_number() || entry.is_null()),
        Value::Object(_) => Series::from_json(value).is_ok(),
    }
}

/// Whether a run with these results can be measured by it.
pub(super) fn is_measurable(results: &Map<String, Value>, name: &str) -> bool {
    let lost_for = |reason: &str| !reason.is_empty();
    measurable(results).contains(&name) || name.strip_prefix("messages.lost.").is_some_and(lost_for)
}

/// What a run with these results can be measured by.
pub(super) fn measurable(results: &Map<String, Value>) -> Vec<&str> {
    let of_the_system = results.iter().filter(|(_, value)| is_measure(value));
    let names = of_the_system.map(|(name, _)| name.as_str());
    names
        .chain(KERNEL.iter().map(|metric| metric.name))
        .collect()
}
