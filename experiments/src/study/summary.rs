//! What a study's results say, cell by cell, in figures.
//!
//! [`summarise`] makes of each metric what its kind asks for: a mean, a rate, a distribution or a
//! curve, each with its interval at 95 % and, paired by seed, its difference to the baseline. Where
//! seeds share problems, what varies by chance are the blocks of them. How each is
//! computed, and after whom, is said in [`crate::stats`].

pub mod check;
pub mod comparisons;
pub mod effect;
mod figures;
pub mod published;
pub mod series;
pub mod values;

use std::collections::BTreeMap;

use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};
use serde_json::{Map, Value};

use super::results::{MessageCounts, Results, RunOutcome};
use crate::stats::Estimate;
use comparisons::ComparisonSummary;
use effect::SameValues;
use figures::{list_summary, number_summary, overall, rate_summary, text_summary};
use published::{Beside, LineSummary};
use series::{SeriesSummary, series_summary};
use values::{ValueKind, kind_of};

/// The shares at which distributions are given.
pub const SHARES: [f64; 7] = [0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95];

/// From so many blocks of runs on a difference is called one: with five, chance alone has all of
/// them on one side of 0 in one case of sixteen, and a bootstrap of values on one side is sure of
/// it.
pub const SURE_FROM: usize = 6;

/// What a study says. As JSON, what cannot be known (an end of an interval over one run, a median
/// that is never reached) is `null`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// The study's name.
    pub study: String,
    /// What it asks.
    pub question: String,
    /// The scenario's name.
    pub scenario: String,
    /// The version of the code that ran it.
    pub code_version: String,
    /// The cell that others are compared with.
    pub baseline: Option<usize>,
    /// How many runs were planned: fewer are made if a rule stopped them early.
    pub planned: usize,
    /// How many came to their end.
    pub n: usize,
    /// How many failed.
    pub failed: usize,
    /// Each cell, in the manifest's order.
    pub cells: Vec<CellSummary>,
    /// Values of factors that change nothing.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub same_values: Vec<SameValues>,
    /// Numbers and rates over all cells, by metric.
    pub overall: BTreeMap<String, OverallSummary>,
    /// Lines through cells, for whatever was published to be linear.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub lines: Vec<LineSummary>,
    /// Cells against each other, for whatever was published to be more than something else.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub comparisons: Vec<ComparisonSummary>,
}

/// What one cell says.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CellSummary {
    /// Its place in the manifest.
    pub cell: usize,
    /// The value of each factor, by name, in base units.
    pub factors: Map<String, Value>,
    /// The same as people write it, in the manifest's order.
    pub texts: Vec<String>,
    /// How many runs came to their end.
    pub n: usize,
    /// How many failed; they are in no figure.
    pub failed: usize,
    /// How many violated what must never happen.
    pub violated: usize,
    /// How many ended because their time was over.
    pub timed_out: usize,
    /// In how many runs what the scenario plans was never reached, by its entry (`degrade.0`).
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub never_reached: BTreeMap<String, usize>,
    /// What became of the messages of all its runs together.
    pub messages: MessageCounts,
    /// Each metric, in the manifest's order.
    #[serde(serialize_with = "as_map")]
    pub metrics: Vec<NamedSummary>,
    /// What others published of it, and how ours compare.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub published: Vec<Beside>,
}

/// A metric's name and what a cell says of it.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedSummary {
    /// The metric's name.
    pub name: String,
    /// What its runs say.
    pub summary: MetricSummary,
}

fn as_map<S: Serializer>(metrics: &[NamedSummary], serializer: S) -> Result<S::Ok, S::Error> {
    let mut map = serializer.serialize_map(Some(metrics.len()))?;
    for metric in metrics {
        map.serialize_entry(&metric.name, &metric.summary)?;
    }
    map.end()
}

/// What a cell says of a metric.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum MetricSummary {
    /// Numbers.
    Number(NumberSummary),
    /// True or false.
    Rate(RateSummary),
    /// Lists of numbers.
    List(ListSummary),
    /// Curves.
    Series(SeriesSummary),
    /// Words, and how many runs say each.
    Text {
        /// How many runs say anything.
        n: usize,
        /// By word.
        counts: BTreeMap<String, usize>,
    },
    /// No run of the study reports it.
    Absent {
        /// Zero.
        n: usize,
    },
}

impl MetricSummary {
    /// The figure that stands for the cell, with its interval: the mean, the rate, or the median of
    /// lists. None if no run says anything, for curves and for words.
    pub fn estimate(&self) -> Option<Estimate> {
        let (value, low, high) = match self {
            MetricSummary::Number(one) if one.n > 0 => (one.mean, one.ci_low, one.ci_high),
            MetricSummary::Rate(one) if one.n > 0 => (one.mean, one.ci_low, one.ci_high),
            MetricSummary::List(one) if one.values > 0 => {
                (one.median, one.median_low, one.median_high)
            }
            _ => return None,
        };
        Some(Estimate { value, low, high })
    }

    /// How many runs say anything.
    pub fn n(&self) -> usize {
        match self {
            MetricSummary::Number(number) => number.n,
            MetricSummary::Rate(rate) => rate.n,
            MetricSummary::List(list) => list.n,
            MetricSummary::Series(series) => series.n,
            MetricSummary::Text { n, .. } | MetricSummary::Absent { n } => *n,
        }
    }
}

/// Numbers of a cell.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NumberSummary {
    /// How many runs report a number: those that failed do not, nor those that have none.
    pub n: usize,
    /// Their mean.
    pub mean: f64,
    /// The lower end of its interval.
    pub ci_low: f64,
    /// The upper end.
    pub ci_high: f64,
    /// The mean of the middle half.
    pub iqm: f64,
    /// The lower end of its interval.
    pub iqm_low: f64,
    /// The upper end.
    pub iqm_high: f64,
    /// The least; not a number if there are none.
    pub min: f64,
    /// The greatest.
    pub max: f64,
    /// How much more than in the baseline, with the same seeds. None in the baseline itself.
    pub difference: Option<Difference>,
}

/// How often something is true in a cell.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RateSummary {
    /// How many runs say true or false.
    pub n: usize,
    /// How many say true.
    pub happened: usize,
    /// The rate: `happened / n`.
    pub mean: f64,
    /// The lower end of its interval.
    pub ci_low: f64,
    /// The upper end.
    pub ci_high: f64,
    /// How much more often than in the baseline, with the same seeds. None in the baseline itself.
    pub difference: Option<Difference>,
    /// McNemar's test against the baseline.
    pub mcnemar: Option<McNemarSummary>,
}

/// McNemar's test of a cell against the baseline.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct McNemarSummary {
    /// Seeds with which it is true here and not in the baseline.
    pub only_here: usize,
    /// Seeds with which it is true in the baseline and not here.
    pub only_baseline: usize,
    /// How often chance alone tells them apart as clearly.
    pub p: f64,
}

/// A difference to the baseline: here minus there, over the seeds that both have.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// How many seeds both have.
    pub n: usize,
    /// How many blocks they are, or the same where no seeds share a problem.
    pub blocks: usize,
    /// The mean difference.
    pub mean: f64,
    /// The lower end of its interval.
    pub ci_low: f64,
    /// The upper end.
    pub ci_high: f64,
}

impl Difference {
    fn new(n: usize, blocks: usize, estimate: Estimate) -> Self {
        Difference {
            n,
            blocks,
            mean: estimate.value,
            ci_low: estimate.low,
            ci_high: estimate.high,
        }
    }

    /// Whether there are blocks enough for anything to be sure of, see [`SURE_FROM`].
    pub fn has_blocks_enough(&self) -> bool {
        self.blocks >= SURE_FROM
    }

    /// The figure with its interval.
    pub fn estimate(&self) -> Estimate {
        Estimate {
            value: self.mean,
            low: self.ci_low,
            high: self.ci_high,
        }
    }
}

/// Lists of a cell, pooled over its runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ListSummary {
    /// How many runs report a list.
    pub n: usize,
    /// How many things they list.
    pub values: usize,
    /// How many of those happened.
    pub happened: usize,
    /// How many had not when their run's time was over.
    pub censored: usize,
    /// How many never would: their run ended otherwise.
    pub never: usize,
    /// When it had happened to half, by Kaplan and Meier.
    pub median: f64,
    /// The lower end of its interval.
    pub median_low: f64,
    /// The upper end.
    pub median_high: f64,
    /// Quantiles at [`SHARES`], by `p50` and the like. If all happened, those of the values; if
    /// not, the times at which the Kaplan-Meier curve passes the share.
    pub quantiles: BTreeMap<String, f64>,
}

/// What all cells say together: each cell counts the same in the mean.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OverallSummary {
    /// The mean of the cells' means.
    pub mean: f64,
    /// The lower end of its interval.
    pub ci_low: f64,
    /// The upper end.
    pub ci_high: f64,
    /// The mean of the middle half of all runs.
    pub iqm: f64,
    /// The lower end of its interval.
    pub iqm_low: f64,
    /// The upper end.
    pub iqm_high: f64,
}

/// Sums up a study. The same results give the same summary, to the last bit.
///
/// ```
/// # use farside_experiments::study::results::*;
/// # use serde_json::json;
/// # let metric = |name: &str| Metric { name: name.into(), label: name.into(), unit: "s".into(),
/// #     index: None, kind: None, better: None };
/// # let manifest = Manifest { format: FORMAT, code_version: "1".into(), study: "doc".into(),
/// #     question: "?".into(), scenario: "s".into(), scenario_text: "".into(),
/// #     files: Default::default(), factors: vec![], metrics: vec![metric("ratio")],
/// #     baseline: None, cells: vec![Cell { values: vec![], texts: vec![], sets: vec![] }],
/// #     seeds: (0..8).collect(), block: 1, stop: None, published: vec![], report: Default::default() };
/// # let run = |seed: u64| RunRecord { cell: 0, seed, outcome: RunOutcome::Done {
/// #     end: "completed".into(), end_detail: "".into(), digest: "".into(), sim_time_s: 9.0,
/// #     timed_out: false, events: 1, messages: MessageCounts::default(),
/// #     metrics: json!({"ratio": seed as f64}).as_object().unwrap().clone(),
/// #     violations: vec![], never_reached: vec![] } };
/// # let results = Results { manifest, runs: (0..8).map(run).collect() };
/// use farside_experiments::study::summary::{MetricSummary, summarise};
/// let summary = summarise(&results);
/// let MetricSummary::Number(ratio) = &summary.cells[0].metrics[0].summary else { panic!() };
/// assert_eq!((ratio.n, ratio.mean, ratio.max), (8, 3.5, 7.0));
/// assert!(ratio.ci_low < 3.5 && 3.5 < ratio.ci_high);
/// ```
pub fn summarise(results: &Results) -> Summary {
    let manifest = &results.manifest;
    let kinds: Vec<(String, ValueKind)> = manifest
        .metrics
        .iter()
        .map(|metric| (metric.name.clone(), kind_of(results, &metric.name)))
        .collect();
    let mut cells: Vec<CellSummary> = (0..manifest.cells.len())
        .map(|cell| summarise_cell(results, cell, &kinds))
        .collect();
    let lines = published::set_beside(manifest, &mut cells);
    let scalars = kinds
        .iter()
        .filter(|(_, kind)| matches!(kind, ValueKind::Number | ValueKind::Rate));
    let overall = scalars.map(|(name, _)| (name.clone(), overall(results, name)));
    Summary {
        study: manifest.study.clone(),
        question: manifest.question.clone(),
        scenario: manifest.scenario.clone(),
        code_version: manifest.code_version.clone(),
        baseline: baseline(results),
        planned: manifest.cells.len() * manifest.seeds.len(),
        n: cells.iter().map(|cell| cell.n).sum(),
        failed: cells.iter().map(|cell| cell.failed).sum(),
        same_values: effect::same_values(results),
        overall: overall.collect(),
        lines,
        comparisons: comparisons::compare(results, &kinds),
        cells,
    }
}

/// The baseline, if there is such a cell.
fn baseline(results: &Results) -> Option<usize> {
    let cells = results.manifest.cells.len();
    results.manifest.baseline.filter(|cell| *cell < cells)
}

fn summarise_cell(results: &Results, cell: usize, kinds: &[(String, ValueKind)]) -> CellSummary {
    let manifest = &results.manifest;
    let runs = results.of_cell(cell);
    let names = manifest.factors.iter().map(|factor| factor.name.clone());
    let values = manifest.cells[cell].values.iter().cloned();
    let mut summary = CellSummary {
        cell,
        factors: names.zip(values).collect(),
        texts: manifest.cells[cell].texts.clone(),
        n: 0,
        failed: 0,
        violated: 0,
        timed_out: 0,
        never_reached: BTreeMap::new(),
        messages: MessageCounts::default(),
        metrics: Vec::with_capacity(kinds.len()),
        published: Vec::new(),
    };
    for run in runs {
        match &run.outcome {
            RunOutcome::Failed { .. } => summary.failed += 1,
            RunOutcome::Done {
                timed_out,
                messages,
                violations,
                never_reached,
                ..
            } => {
                summary.n += 1;
                for entry in never_reached {
                    *summary.never_reached.entry(entry.clone()).or_default() += 1;
                }
                summary.timed_out += usize::from(*timed_out);
                summary.violated += usize::from(!violations.is_empty());
                add_counts(&mut summary.messages, messages);
            }
        }
    }
    for (name, kind) in kinds {
        let of_metric = match kind {
            ValueKind::Number => MetricSummary::Number(number_summary(results, cell, name)),
            ValueKind::Rate => MetricSummary::Rate(rate_summary(results, cell, name)),
            ValueKind::List => MetricSummary::List(list_summary(results, cell, name)),
            ValueKind::Series => MetricSummary::Series(series_summary(results, cell, name)),
            ValueKind::Text => text_summary(runs, name),
            ValueKind::Absent => MetricSummary::Absent { n: 0 },
        };
        summary.metrics.push(NamedSummary {
            name: name.clone(),
            summary: of_metric,
        });
    }
    summary
}

fn add_counts(total: &mut MessageCounts, run: &MessageCounts) {
    total.sent += run.sent;
    total.delivered += run.delivered;
    total.lost += run.lost;
    total.duplicated += run.duplicated;
    total.in_flight += run.in_flight;
    for (reason, count) in &run.lost_by_reason {
        *total.lost_by_reason.entry(reason.clone()).or_default() += count;
    }
}

#[cfg(test)]
mod tests;
