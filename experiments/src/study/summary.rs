//! What a study's results say, cell by cell, in figures.
//!
//! [`summarise`] makes of each metric what its kind asks for: a mean, a rate or a distribution,
//! each with its interval at 95 % and, paired by seed, its difference to the baseline. How each is
//! computed, and after whom, is said in [`crate::stats`].

pub mod published;
pub mod values;

use std::collections::BTreeMap;

use farside::random::RandomKey;
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};
use serde_json::{Map, Value};

use super::results::{MessageCounts, Results, RunOutcome, RunRecord};
use crate::stats::distribution::Ecdf;
use crate::stats::survival::{Survival, kaplan_meier};
use crate::stats::{Estimate, bootstrap, rates};
use published::{Beside, LineSummary};
use values::{Kind, kind_of, number_of, observations, value_of};

/// The shares at which distributions are given.
pub const SHARES: [f64; 7] = [0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95];

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
    /// Numbers and rates over all cells, by metric.
    pub overall: BTreeMap<String, OverallSummary>,
    /// Lines through cells, for whatever was published to be linear.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub lines: Vec<LineSummary>,
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
    /// lists. None if no run says anything, and for words.
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
    /// The mean difference.
    pub mean: f64,
    /// The lower end of its interval.
    pub ci_low: f64,
    /// The upper end.
    pub ci_high: f64,
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
    /// Quantiles at [`SHARES`], by `p50` and the like. If all happened, those of the values; if not,
    /// the times at which the Kaplan-Meier curve passes the share.
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
/// # let metric = |name: &str| Metric { name: name.into(), label: name.into(), unit: "s".into() };
/// # let manifest = Manifest { format: FORMAT, code_version: "1".into(), study: "doc".into(),
/// #     question: "?".into(), scenario: "s".into(), scenario_text: "".into(),
/// #     files: Default::default(), factors: vec![], metrics: vec![metric("ratio")],
/// #     baseline: None, cells: vec![Cell { values: vec![], texts: vec![], sets: vec![] }],
/// #     seeds: (0..8).collect(), stop: None, published: vec![] };
/// # let run = |seed: u64| RunRecord { cell: 0, seed, outcome: RunOutcome::Done {
/// #     end: "completed".into(), end_detail: "".into(), digest: "".into(), sim_time_s: 9.0,
/// #     timed_out: false, events: 1, messages: MessageCounts::default(),
/// #     metrics: json!({"ratio": seed as f64}).as_object().unwrap().clone(), violations: vec![] } };
/// # let results = Results { manifest, runs: (0..8).map(run).collect() };
/// use farside_experiments::study::summary::{MetricSummary, summarise};
/// let summary = summarise(&results);
/// let MetricSummary::Number(ratio) = &summary.cells[0].metrics[0].summary else { panic!() };
/// assert_eq!((ratio.n, ratio.mean, ratio.max), (8, 3.5, 7.0));
/// assert!(ratio.ci_low < 3.5 && 3.5 < ratio.ci_high);
/// ```
pub fn summarise(results: &Results) -> Summary {
    let manifest = &results.manifest;
    let kinds: Vec<(String, Kind)> = manifest
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
        .filter(|(_, kind)| matches!(kind, Kind::Number | Kind::Rate));
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
        overall: overall.collect(),
        lines,
        cells,
    }
}

/// The mean of some values with its interval, `(mean, low, high)`, as [`bootstrap::mean`] has it:
/// what a stopping rule looks at. Fewer than two values give an infinite interval.
///
/// True-or-false metrics are better served by [`interval_of_metric`]: if all values are equal, this
/// interval has no width, and Wilson's has.
///
/// ```
/// use farside_experiments::study::summary::interval_of;
/// let (mean, low, high) = interval_of(&[1.0, 2.0, 3.0, 4.0]);
/// assert!(mean == 2.5 && 1.0 < low && high < 4.0);
/// assert_eq!(interval_of(&[1.0]).2, f64::INFINITY);
/// ```
pub fn interval_of(values: &[f64]) -> (f64, f64, f64) {
    let key = RandomKey::new(0).text("interval_of");
    let Estimate { value, low, high } = bootstrap::mean(values, key);
    (value, low, high)
}

/// The interval that the summary of `cell` has for the metric `name`: around the mean of numbers,
/// the rate of truth values, or the median of lists. None for words, and for what no run of the
/// cell reports. The kind is judged by the runs of the cell alone.
pub fn interval_of_metric(results: &Results, cell: usize, name: &str) -> Option<Estimate> {
    let runs = results.of_cell(cell);
    let reported = runs.iter().find_map(|run| value_of(&run.outcome, name))?;
    match reported.as_ref() {
        Value::Array(_) => Some(survival(runs, name).median()),
        Value::Bool(_) => {
            let truths = truths(runs, name);
            let happened = truths.values().filter(|yes| **yes).count();
            Some(rates::wilson(happened, truths.len()))
        }
        Value::Number(_) => {
            let values: Vec<f64> = numbers(runs, name).into_values().collect();
            Some(bootstrap::mean(&values, key(results, cell, name)))
        }
        Value::Null | Value::String(_) | Value::Object(_) => None,
    }
}

/// When what a list counts happens in the given runs of one cell, see [`observations`].
pub fn survival(runs: &[RunRecord], name: &str) -> Survival {
    kaplan_meier(&observations(runs, name))
}

/// The baseline, if there is such a cell.
fn baseline(results: &Results) -> Option<usize> {
    let cells = results.manifest.cells.len();
    results.manifest.baseline.filter(|cell| *cell < cells)
}

/// The address of the draws for a metric in a cell. By names, so that a study with one more cell or
/// metric keeps the intervals of all others.
fn key(results: &Results, cell: usize, metric: &str) -> RandomKey {
    let texts = results.manifest.cells.get(cell).map(|cell| &cell.texts);
    let factors = results.manifest.factors.iter().map(|factor| &factor.name);
    let base = RandomKey::new(0).text("bootstrap").text(metric);
    let name: Vec<String> = factors
        .zip(texts.into_iter().flatten())
        .map(|(factor, text)| format!("{factor}={text}"))
        .collect();
    base.text(&name.join("\n"))
}

fn summarise_cell(results: &Results, cell: usize, kinds: &[(String, Kind)]) -> CellSummary {
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
                ..
            } => {
                summary.n += 1;
                summary.timed_out += usize::from(*timed_out);
                summary.violated += usize::from(!violations.is_empty());
                add_counts(&mut summary.messages, messages);
            }
        }
    }
    for (name, kind) in kinds {
        let of_metric = match kind {
            Kind::Number => MetricSummary::Number(number_summary(results, cell, name)),
            Kind::Rate => MetricSummary::Rate(rate_summary(results, cell, name)),
            Kind::List => MetricSummary::List(list_summary(runs, name)),
            Kind::Text => text_summary(runs, name),
            Kind::Absent => MetricSummary::Absent { n: 0 },
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

/// The numbers of some runs, by seed.
fn numbers(runs: &[RunRecord], name: &str) -> BTreeMap<u64, f64> {
    let numbers = runs
        .iter()
        .map(|run| Some((run.seed, number_of(run, name)?)));
    numbers.flatten().collect()
}

/// The truth values of some runs, by seed.
fn truths(runs: &[RunRecord], name: &str) -> BTreeMap<u64, bool> {
    let truths = runs
        .iter()
        .map(|run| Some((run.seed, value_of(&run.outcome, name)?.as_bool()?)));
    truths.flatten().collect()
}

/// What two cells say with the same seed.
fn paired<T: Copy>(here: &BTreeMap<u64, T>, there: &BTreeMap<u64, T>) -> Vec<(T, T)> {
    let pairs = here
        .iter()
        .map(|(seed, value)| Some((*value, *there.get(seed)?)));
    pairs.flatten().collect()
}

/// The baseline to compare `cell` with.
fn other(results: &Results, cell: usize) -> Option<&[RunRecord]> {
    let baseline = baseline(results).filter(|baseline| *baseline != cell)?;
    Some(results.of_cell(baseline))
}

fn number_summary(results: &Results, cell: usize, name: &str) -> NumberSummary {
    let here = numbers(results.of_cell(cell), name);
    let key = key(results, cell, name);
    let difference = other(results, cell).map(|there| {
        let pairs = paired(&here, &numbers(there, name));
        Difference::new(
            pairs.len(),
            bootstrap::paired_difference(&pairs, key.text("difference")),
        )
    });
    let values: Vec<f64> = here.into_values().collect();
    let (mean, iqm) = bootstrap::mean_and_interquartile_mean(&values, key);
    NumberSummary {
        n: values.len(),
        mean: mean.value,
        ci_low: mean.low,
        ci_high: mean.high,
        iqm: iqm.value,
        iqm_low: iqm.low,
        iqm_high: iqm.high,
        // Of NaN and a number, the functions return the number.
        min: values.iter().copied().fold(f64::NAN, f64::min),
        max: values.iter().copied().fold(f64::NAN, f64::max),
        difference,
    }
}

impl Difference {
    fn new(n: usize, estimate: Estimate) -> Self {
        Difference {
            n,
            mean: estimate.value,
            ci_low: estimate.low,
            ci_high: estimate.high,
        }
    }
}

fn rate_summary(results: &Results, cell: usize, name: &str) -> RateSummary {
    let here = truths(results.of_cell(cell), name);
    let happened = here.values().filter(|yes| **yes).count();
    let rate = rates::wilson(happened, here.len());
    let pairs = other(results, cell).map(|there| paired(&here, &truths(there, name)));
    let test = pairs.as_deref().map(rates::mcnemar);
    RateSummary {
        n: here.len(),
        happened,
        mean: rate.value,
        ci_low: rate.low,
        ci_high: rate.high,
        difference: test
            .map(|test| Difference::new(test.pairs(), rates::paired_rate_difference(&test))),
        mcnemar: test.map(|test| McNemarSummary {
            only_here: test.only_first,
            only_baseline: test.only_second,
            p: test.p,
        }),
    }
}

fn list_summary(runs: &[RunRecord], name: &str) -> ListSummary {
    let observations = observations(runs, name);
    let curve = kaplan_meier(&observations);
    let happened = observations.iter().filter(|one| one.happened).count();
    let never = observations.iter().filter(|one| one.time.is_infinite());
    let never = never.count();
    let median = curve.median();
    let all_happened = happened == observations.len();
    let times: Vec<f64> = observations.iter().map(|one| one.time).collect();
    let ecdf = Ecdf::new(if all_happened { &times } else { &[] });
    let quantile = |share: f64| {
        if all_happened {
            ecdf.quantile(share)
        } else {
            curve.quantile(share)
        }
    };
    ListSummary {
        n: runs
            .iter()
            .filter(|run| value_of(&run.outcome, name).is_some_and(|value| value.is_array()))
            .count(),
        values: observations.len(),
        happened,
        censored: observations.len() - happened - never,
        never,
        median: median.value,
        median_low: median.low,
        median_high: median.high,
        quantiles: SHARES
            .iter()
            .map(|share| (format!("p{:02.0}", share * 100.0), quantile(*share)))
            .collect(),
    }
}

fn text_summary(runs: &[RunRecord], name: &str) -> MetricSummary {
    let mut counts = BTreeMap::new();
    for value in runs.iter().filter_map(|run| value_of(&run.outcome, name)) {
        let word = value
            .as_str()
            .map_or_else(|| value.to_string(), str::to_owned);
        *counts.entry(word).or_default() += 1;
    }
    MetricSummary::Text {
        n: counts.values().sum(),
        counts,
    }
}

fn overall(results: &Results, name: &str) -> OverallSummary {
    let cells = 0..results.manifest.cells.len();
    let values: Vec<Vec<f64>> = cells
        .map(|cell| numbers(results.of_cell(cell), name).into_values().collect())
        .collect();
    let key = RandomKey::new(0).text("stratified").text(name);
    let overall = bootstrap::stratified(&values, key);
    let (mean, iqm) = (overall.mean, overall.interquartile_mean);
    OverallSummary {
        mean: mean.value,
        ci_low: mean.low,
        ci_high: mean.high,
        iqm: iqm.value,
        iqm_low: iqm.low,
        iqm_high: iqm.high,
    }
}

#[cfg(test)]
mod tests;
