//! Metrics: labels and units of those that are known, and which a run has.

use serde_json::{Map, Value};

use super::file::MetricFile;
use super::results::{Metric, SeriesIndex};
use crate::system::{Series, SeriesMetric};

/// What is known of every run, whatever its system; `messages.lost.outage` and so on besides.
const KERNEL: [&str; 8] = [
    "events",
    "sim_time_s",
    "violations",
    "messages.sent",
    "messages.delivered",
    "messages.lost",
    "messages.duplicated",
    "messages.in_flight",
];

/// Labels and units of metrics whose names say too little, by name.
const KNOWN: [(&str, &str, &str); 37] = [
    ("arrival_s", "time to the goal", "s"),
    ("arrived", "rovers at their goals", "rovers"),
    (
        "busiest_share",
        "share of the busiest node in what all computed",
        "",
    ),
    ("collisions", "collisions", ""),
    ("completed", "all rovers at their goals", ""),
    ("confirmed_deadlocks", "deadlocks confirmed by probes", ""),
    ("cycles", "planning cycles", "cycles"),
    ("deadlocked", "standstill", ""),
    ("events", "events", "events"),
    ("intervention_rate", "cycles with an intervention", ""),
    ("interventions", "interventions", "cycles"),
    (
        "late_optimisations",
        "optimisations that were not done in time",
        "",
    ),
    ("load_imbalance", "busiest node's load over the mean", ""),
    ("makespan", "makespan", "steps"),
    ("makespan_bound", "longest shortest path", "steps"),
    ("max_plus_iterations", "max-plus iterations per cycle", ""),
    ("mean_backtracks", "moves back per rover", ""),
    ("mean_steps", "steps per rover", ""),
    ("mean_stops", "stops per rover", ""),
    ("messages.delivered", "message copies delivered", "messages"),
    (
        "messages.duplicated",
        "message copies duplicated",
        "messages",
    ),
    (
        "messages.in_flight",
        "message copies under way at the end",
        "messages",
    ),
    ("messages.lost", "message copies lost", "messages"),
    ("messages.sent", "messages sent", "messages"),
    ("outsourced", "share of the work that was handed over", ""),
    (
        "pairs_per_cycle",
        "pairs of paths per node and cycle",
        "pairs",
    ),
    (
        "path_ratio",
        "steps of those that arrived over the shortest path",
        "",
    ),
    (
        "peak_load",
        "pairs of paths per cycle at the busiest node",
        "pairs",
    ),
    ("rovers", "rovers", "rovers"),
    ("sim_time_s", "virtual time", "s"),
    ("suboptimality", "sum of costs over its bound", ""),
    ("sum_of_costs", "sum of costs", "steps"),
    ("sum_of_costs_bound", "sum of shortest paths", "steps"),
    (
        "time_ratio",
        "time of those that arrived over the shortest path",
        "",
    ),
    (
        "total_steps",
        "steps of all rovers that arrived, together",
        "steps",
    ),
    (
        "transmit_energy_j",
        "energy of the rovers' transmissions",
        "J",
    ),
    ("violations", "violations", ""),
];

/// A metric with what the study leaves open filled in, as far as that is known without its system.
pub(super) fn metric(file: &MetricFile) -> Metric {
    let known = KNOWN.iter().find(|(name, ..)| *name == file.name);
    let (label, unit) = known.map_or((file.name.as_str(), ""), |(_, label, unit)| (label, unit));
    Metric {
        name: file.name.clone(),
        label: file.label.clone().unwrap_or_else(|| label.to_owned()),
        unit: file.unit.clone().unwrap_or_else(|| unit.to_owned()),
        index: None,
    }
}

/// What the index of a metric's curves is: what the study says, else what the system does. None if
/// neither says anything.
pub(super) fn index(file: &MetricFile, declared: &[SeriesMetric]) -> Option<SeriesIndex> {
    let own = file.index.clone();
    let declared = declared.iter().find(|one| one.name == file.name);
    if own.is_none() && declared.is_none() {
        return None;
    }
    let own = own.unwrap_or_default();
    let declared = declared.copied().unwrap_or(SeriesMetric {
        name: "",
        index_label: "index",
        index_unit: "",
        lengths_differ: false,
    });
    Some(SeriesIndex {
        label: own.label.unwrap_or_else(|| declared.index_label.to_owned()),
        unit: own.unit.unwrap_or_else(|| declared.index_unit.to_owned()),
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
    names.chain(KERNEL).collect()
}
