//! Tables for other programs: one row for each run, and one for each cell and metric.
//!
//! As RFC 4180 has it, but with line feeds alone. The same results give the same bytes; numbers are
//! written in full, so that reading them back gives the same numbers.

mod series;
mod values;

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;

use crate::study::results::{Claim, Manifest, Results, RunOutcome, RunRecord};
use crate::study::summary::comparisons::ComparisonSummary;
use crate::study::summary::values::{ValueKind, kind_of, value_of};
use crate::study::summary::{
    Difference, ListSummary, MetricSummary, NumberSummary, RateSummary, SHARES, Summary,
};

/// What becomes of messages, in the columns `messages.sent` and so on.
const COUNTS: [&str; 5] = ["sent", "delivered", "lost", "duplicated", "in_flight"];

/// One row for each run, in order of (cell, seed): what it varied, how it ended, what became of its
/// messages, and each metric that is a number, a truth value or a word. Lists and curves are in a
/// table of their own, see [`values_csv`]. What a run does not have is empty.
pub fn results_csv(results: &Results) -> String {
    let manifest = &results.manifest;
    let reasons = reasons(results);
    let scalars: Vec<&str> = manifest
        .metrics
        .iter()
        .map(|metric| metric.name.as_str())
        // What is counted has its columns already.
        .filter(|name| !name.starts_with("messages.") && !FIXED.contains(name))
        .filter(|name| !matches!(kind_of(results, name), ValueKind::List | ValueKind::Series))
        .collect();
    let counts = COUNTS.iter().map(|count| format!("messages.{count}"));
    let by_reason = reasons
        .iter()
        .map(|reason| format!("messages.lost.{reason}"));
    let counted: Vec<String> = counts.chain(by_reason).collect();
    let mut header = vec!["cell".to_owned()];
    header.extend(manifest.factors.iter().map(|factor| factor.name.clone()));
    header.extend(FIXED.iter().map(|&name| name.to_owned()));
    header.extend(counted.iter().cloned());
    header.extend(scalars.iter().map(|&name| name.to_owned()));
    header.push("error".to_owned());
    let mut table = Table::new(header);
    for run in &results.runs {
        let mut row = vec![run.cell.to_string()];
        row.extend(texts(manifest, run.cell));
        row.extend(fixed(run));
        let names = counted
            .iter()
            .map(String::as_str)
            .chain(scalars.iter().copied());
        row.extend(names.map(|name| {
            let value = value_of(&run.outcome, name);
            value.map_or_else(String::new, |value| scalar(&value))
        }));
        row.push(match &run.outcome {
            RunOutcome::Failed { error } => error.clone(),
            RunOutcome::Done { .. } => String::new(),
        });
        table.row(row);
    }
    table.finish()
}

const FIXED: [&str; 8] = [
    "seed",
    "status",
    "end",
    "digest",
    "sim_time_s",
    "timed_out",
    "events",
    "violations",
];

fn fixed(run: &RunRecord) -> Vec<String> {
    let mut row = vec![run.seed.to_string()];
    match &run.outcome {
        RunOutcome::Failed { .. } => {
            row.push("failed".to_owned());
            row.resize(FIXED.len(), String::new());
        }
        RunOutcome::Done {
            end,
            digest,
            sim_time_s,
            timed_out,
            events,
            violations,
            ..
        } => row.extend([
            "done".to_owned(),
            end.clone(),
            digest.clone(),
            number(*sim_time_s),
            timed_out.to_string(),
            events.to_string(),
            violations.len().to_string(),
        ]),
    }
    row
}

/// Every reason for which any run lost a message, by name.
pub(super) fn reasons(results: &Results) -> BTreeSet<String> {
    let mut reasons = BTreeSet::new();
    for run in &results.runs {
        if let RunOutcome::Done { messages, .. } = &run.outcome {
            reasons.extend(messages.lost_by_reason.keys().cloned());
        }
    }
    reasons
}

fn texts(manifest: &Manifest, cell: usize) -> Vec<String> {
    let texts = manifest.cells.get(cell).map(|cell| cell.texts.clone());
    let mut texts = texts.unwrap_or_default();
    texts.resize(manifest.factors.len(), String::new());
    texts
}

fn scalar(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Number(number) => number.as_f64().map_or_else(
            || number.to_string(),
            |float| match number.as_u64() {
                Some(whole) => whole.to_string(),
                None => self::number(float),
            },
        ),
        other => other.to_string(),
    }
}

/// A number in full, empty if it is none.
fn number(value: f64) -> String {
    if value.is_finite() {
        value.to_string()
    } else {
        String::new()
    }
}

/// One row for each cell and metric. `estimate` is the mean of numbers, the rate of truth values,
/// the median of lists; of curves, which [`series_csv`] has in full, there is `holds_from`, the
/// index from which on they differ from the baseline's. What a kind does not have is empty, as is
/// what cannot be known.
pub fn summary_csv(results: &Results, summary: &Summary) -> String {
    let manifest = &results.manifest;
    let mut header = vec!["cell".to_owned()];
    header.extend(manifest.factors.iter().map(|factor| factor.name.clone()));
    let quantiles: Vec<String> = SHARES
        .iter()
        .map(|share| format!("p{:02.0}", share * 100.0))
        .collect();
    header.extend(COLUMNS.iter().map(|&column| column.to_owned()));
    header.extend(quantiles.iter().cloned());
    let mut table = Table::new(header);
    for cell in &summary.cells {
        for (metric, named) in manifest.metrics.iter().zip(&cell.metrics) {
            let mut row = vec![cell.cell.to_string()];
            row.extend(texts(manifest, cell.cell));
            let mut figures = figures(&named.summary);
            let fixed = [
                ("runs", cell.n.to_string()),
                ("failed", cell.failed.to_string()),
                ("metric", metric.name.clone()),
                ("unit", metric.unit.clone()),
            ];
            figures.extend(fixed);
            let columns = COLUMNS
                .iter()
                .copied()
                .chain(quantiles.iter().map(String::as_str));
            row.extend(columns.map(|column| figures.remove(column).unwrap_or_default()));
            table.row(row);
        }
    }
    table.finish()
}

pub use series::series_csv;
pub use values::values_csv;

const COLUMNS: [&str; 26] = [
    "runs",
    "failed",
    "metric",
    "unit",
    "kind",
    "n",
    "estimate",
    "ci_low",
    "ci_high",
    "iqm",
    "iqm_low",
    "iqm_high",
    "min",
    "max",
    "difference_n",
    "difference",
    "difference_low",
    "difference_high",
    "happened",
    "only_here",
    "only_baseline",
    "mcnemar_p",
    "censored",
    "never",
    "words",
    "holds_from",
];

const PUBLISHED: [&str; 23] = [
    "metric",
    "table",
    "unit",
    "claim",
    "published",
    "n",
    "estimate",
    "ci_low",
    "ci_high",
    "difference",
    "inside",
    "slope",
    "intercept",
    "r_squared",
    "other",
    "from_index",
    "by_at_least",
    "by_at_most",
    "equal_within",
    "at_index",
    "difference_low",
    "difference_high",
    "verdict",
];

/// One row for each cell beside which a figure was published, one for each line through cells (its
/// `cell` is empty, and its factors' values are those that the cells share), and one for each cell
/// that was published to exceed or to equal another, `other` (of curves, the difference is the one
/// `at_index` that speaks most against the claim). All figures are in the publication's `unit`;
/// `claim` is `value`, `about`, `below`, `above`, `linear`, `exceeds` or `equals`. None if the
/// study knows no published figures.
pub fn published_csv(results: &Results, summary: &Summary) -> Option<String> {
    let manifest = &results.manifest;
    if manifest.published.is_empty() {
        return None;
    }
    let mut header = vec!["cell".to_owned()];
    header.extend(manifest.factors.iter().map(|factor| factor.name.clone()));
    header.extend(PUBLISHED.iter().map(|&column| column.to_owned()));
    let mut table = Table::new(header);
    for index in 0..manifest.published.len() {
        for cell in &summary.cells {
            for one in cell.published.iter().filter(|one| one.table == index) {
                let mut row = vec![cell.cell.to_string()];
                row.extend(texts(manifest, cell.cell));
                let (claim, published) = claimed(&one.published);
                row.extend([one.metric.clone(), one.title.clone(), one.unit.clone()]);
                row.extend([claim.to_owned(), published.map_or_else(String::new, number)]);
                row.push(one.n.to_string());
                row.extend([one.estimate, one.ci_low, one.ci_high].map(number));
                row.push(one.difference.map_or_else(String::new, number));
                row.push(
                    one.inside
                        .map_or_else(String::new, |inside| inside.to_string()),
                );
                table.row(row);
            }
        }
        for line in summary.lines.iter().filter(|line| line.table == index) {
            let mut row = vec![String::new()];
            row.extend(shared(manifest, &line.cells));
            let unit = &manifest.published[index].unit;
            row.extend([line.metric.clone(), line.title.clone(), unit.clone()]);
            row.extend([
                "linear".to_owned(),
                String::new(),
                line.cells.len().to_string(),
            ]);
            row.extend(std::iter::repeat_n(String::new(), 5));
            row.extend([line.slope, line.intercept, line.r_squared].map(number));
            table.row(row);
        }
        for one in summary.comparisons.iter().filter(|one| one.table == index) {
            table.row(compared(manifest, one));
        }
    }
    Some(table.finish())
}

/// The row of a cell against another.
fn compared(manifest: &Manifest, one: &ComparisonSummary) -> Vec<String> {
    let number_or_none = |value: Option<f64>| value.map_or_else(String::new, number);
    let claim = match one.equal_within {
        Some(_) => "equals",
        None => "exceeds",
    };
    let mut row = vec![one.cell.to_string()];
    row.extend(texts(manifest, one.cell));
    row.extend([one.metric.clone(), one.title.clone(), one.unit.clone()]);
    row.extend([claim.to_owned(), String::new(), one.n.to_string()]);
    // Neither cell's own figure, but how they differ.
    row.extend(std::iter::repeat_n(String::new(), 3));
    row.push(number(one.difference));
    row.extend(std::iter::repeat_n(String::new(), 4));
    row.push(one.other.to_string());
    row.extend([one.from_index, one.by_at_least, one.by_at_most].map(number_or_none));
    row.extend([one.equal_within, one.index].map(number_or_none));
    row.extend([one.ci_low, one.ci_high].map(number));
    row.push(one.verdict.name().to_owned());
    row
}

/// A claim's name, and its figure.
fn claimed(claim: &Claim) -> (&'static str, Option<f64>) {
    match claim {
        Claim::Value(figure) => ("value", Some(*figure)),
        Claim::About(figure) => ("about", Some(*figure)),
        Claim::Below(figure) => ("below", Some(*figure)),
        Claim::Above(figure) => ("above", Some(*figure)),
        Claim::Linear(_) => ("linear", None),
        Claim::Exceeds(_) => ("exceeds", None),
    }
}

/// The values that some cells share, empty where they differ.
fn shared(manifest: &Manifest, cells: &[usize]) -> Vec<String> {
    let mut cells = cells.iter().map(|cell| texts(manifest, *cell));
    let mut all = cells.next().unwrap_or_default();
    for other in cells {
        for (text, other) in all.iter_mut().zip(other) {
            if *text != other {
                text.clear();
            }
        }
    }
    all
}

type Figures<'a> = BTreeMap<&'a str, String>;

fn figures(summary: &MetricSummary) -> Figures<'_> {
    match summary {
        MetricSummary::Number(number) => numbers(number),
        MetricSummary::Rate(rate) => rates(rate),
        MetricSummary::List(list) => lists(list),
        MetricSummary::Series(series) => {
            let difference = series.difference.as_ref();
            let from = difference.and_then(|difference| difference.holds_from);
            BTreeMap::from([
                ("kind", "series".to_owned()),
                ("n", series.n.to_string()),
                ("holds_from", from.map_or_else(String::new, number)),
            ])
        }
        MetricSummary::Text { n, counts } => {
            let words = counts
                .iter()
                .map(|(word, count)| format!("{word}: {count}"));
            let words: Vec<String> = words.collect();
            BTreeMap::from([
                ("kind", "text".to_owned()),
                ("n", n.to_string()),
                ("words", words.join("; ")),
            ])
        }
        MetricSummary::Absent { n } => {
            BTreeMap::from([("kind", "absent".to_owned()), ("n", n.to_string())])
        }
    }
}

fn numbers(summary: &NumberSummary) -> Figures<'static> {
    let mut figures = BTreeMap::from([
        ("kind", "number".to_owned()),
        ("n", summary.n.to_string()),
        ("estimate", number(summary.mean)),
        ("ci_low", number(summary.ci_low)),
        ("ci_high", number(summary.ci_high)),
        ("iqm", number(summary.iqm)),
        ("iqm_low", number(summary.iqm_low)),
        ("iqm_high", number(summary.iqm_high)),
        ("min", number(summary.min)),
        ("max", number(summary.max)),
    ]);
    figures.extend(summary.difference.iter().flat_map(differences));
    figures
}

fn rates(summary: &RateSummary) -> Figures<'static> {
    let mut figures = BTreeMap::from([
        ("kind", "rate".to_owned()),
        ("n", summary.n.to_string()),
        ("estimate", number(summary.mean)),
        ("ci_low", number(summary.ci_low)),
        ("ci_high", number(summary.ci_high)),
        ("happened", summary.happened.to_string()),
    ]);
    figures.extend(summary.difference.iter().flat_map(differences));
    if let Some(test) = &summary.mcnemar {
        figures.extend([
            ("only_here", test.only_here.to_string()),
            ("only_baseline", test.only_baseline.to_string()),
            ("mcnemar_p", number(test.p)),
        ]);
    }
    figures
}

fn lists(summary: &ListSummary) -> Figures<'_> {
    let mut figures = BTreeMap::from([
        ("kind", "list".to_owned()),
        ("n", summary.n.to_string()),
        ("estimate", number(summary.median)),
        ("ci_low", number(summary.median_low)),
        ("ci_high", number(summary.median_high)),
        ("happened", summary.happened.to_string()),
        ("censored", summary.censored.to_string()),
        ("never", summary.never.to_string()),
    ]);
    let quantiles = summary.quantiles.iter();
    figures.extend(quantiles.map(|(name, value)| (name.as_str(), number(*value))));
    figures
}

fn differences(difference: &Difference) -> [(&'static str, String); 4] {
    [
        ("difference_n", difference.n.to_string()),
        ("difference", number(difference.mean)),
        ("difference_low", number(difference.ci_low)),
        ("difference_high", number(difference.ci_high)),
    ]
}

/// A table under way. Writing to memory cannot fail, and rows are as long as the header.
struct Table {
    width: usize,
    writer: csv::Writer<Vec<u8>>,
}

impl Table {
    /// Starts with a header; a name that is there already gets a number, as a factor called `seed`.
    fn new(header: Vec<String>) -> Self {
        let mut table = Table {
            width: header.len(),
            writer: csv::Writer::from_writer(Vec::new()),
        };
        let mut seen: BTreeMap<String, usize> = BTreeMap::new();
        let unique = header.into_iter().map(|name| {
            let times = seen.entry(name.clone()).or_default();
            *times += 1;
            if *times == 1 {
                name
            } else {
                format!("{name}_{times}")
            }
        });
        let unique = unique.collect();
        table.row(unique);
        table
    }

    fn row(&mut self, mut row: Vec<String>) {
        row.resize(self.width, String::new());
        let _ = self.writer.write_record(&row);
    }

    fn finish(self) -> String {
        let bytes = self.writer.into_inner().unwrap_or_default();
        String::from_utf8(bytes).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::fabricated::{self, latency, loss};
    use crate::study::summary::summarise;

    fn read(text: &str) -> (csv::StringRecord, Vec<csv::StringRecord>) {
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let header = reader.headers().unwrap().clone();
        (header, reader.records().map(Result::unwrap).collect())
    }

    #[test]
    fn each_run_has_a_row() {
        let results = fabricated::study("csv", vec![latency(), loss()], 8);
        let (header, rows) = read(&results_csv(&results));
        let at = |name: &str| header.iter().position(|column| column == name).unwrap();
        assert_eq!(
            header.iter().take(5).collect::<Vec<_>>(),
            ["cell", "latency", "loss", "seed", "status"]
        );
        assert_eq!(rows.len(), 200);
        for (row, run) in rows.iter().zip(&results.runs) {
            assert_eq!(row[at("cell")], run.cell.to_string());
            assert_eq!(row[at("seed")], run.seed.to_string());
            let RunOutcome::Done {
                messages, metrics, ..
            } = &run.outcome
            else {
                assert_eq!(&row[at("status")], "failed");
                assert!(row[at("error")].contains("<path> left & none"));
                continue;
            };
            let ratio: f64 = row[at("time_ratio")].parse().unwrap();
            assert_eq!(Some(ratio), metrics["time_ratio"].as_f64());
            assert_eq!(row[at("messages.lost")], messages.lost.to_string());
            assert_eq!(
                row[at("messages.lost.range")],
                messages.lost_by_reason["range"].to_string()
            );
            assert_eq!(row[at("completed")], metrics["completed"].to_string());
        }
        assert!(header.iter().all(|column| column != "arrival_s"));
    }

    #[test]
    fn fields_are_quoted_where_they_must() {
        let mut results = fabricated::study("csv", vec![loss()], 2);
        results.manifest.factors[0].name = "seed".to_owned();
        results.manifest.cells[0].texts[0] = "a \"b\",\nc".to_owned();
        let text = results_csv(&results);
        assert!(text.starts_with("cell,seed,seed_2,status,"), "{text}");
        assert!(text.contains("\n0,\"a \"\"b\"\",\nc\",1,"), "{text}");
    }

    #[test]
    fn each_cell_and_metric_has_a_row() {
        let results = fabricated::study("csv", vec![latency(), loss()], 8);
        let summary = summarise(&results);
        let (header, rows) = read(&summary_csv(&results, &summary));
        let at = |name: &str| header.iter().position(|column| column == name).unwrap();
        assert_eq!(rows.len(), 25 * results.manifest.metrics.len());
        let worst = rows
            .iter()
            .rfind(|row| &row[at("metric")] == "time_ratio")
            .unwrap();
        let mean: f64 = worst[at("estimate")].parse().unwrap();
        assert!(mean > 2.0 && worst[at("difference")].parse::<f64>().unwrap() > 1.0);
        let median = rows
            .iter()
            .find(|row| &row[at("metric")] == "arrival_s")
            .unwrap();
        assert_eq!(&median[at("kind")], "list");
        assert!(median[at("p50")].parse::<f64>().unwrap() > 100.0);
        assert_eq!(&median[at("iqm")], "");
    }
}
