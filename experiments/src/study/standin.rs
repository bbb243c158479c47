//! Stand-ins until the report's own are there: `report::csv::results_csv` and
//! `study::summary::summarise`.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::Value;

use super::metrics::of_the_kernel;
use super::results::{Results, RunOutcome};

/// A line for each run: the cell's factor values, the seed, what came of it.
pub(crate) fn results_csv(results: &Results) -> String {
    let manifest = &results.manifest;
    let mut header = vec!["cell".to_owned()];
    header.extend(manifest.factors.iter().map(|factor| factor.name.clone()));
    header.extend(["seed", "status", "digest"].map(str::to_owned));
    header.extend(manifest.metrics.iter().map(|metric| metric.name.clone()));
    let mut out = line(&header);
    for run in &results.runs {
        let mut fields = vec![run.cell.to_string()];
        fields.extend(manifest.cells[run.cell].values.iter().map(Value::to_string));
        fields.push(run.seed.to_string());
        match &run.outcome {
            RunOutcome::Failed { error } => fields.extend(["failed".to_owned(), error.clone()]),
            RunOutcome::Done { digest, .. } => {
                fields.extend(["done".to_owned(), digest.clone()]);
                for metric in &manifest.metrics {
                    let value = value(&run.outcome, &metric.name);
                    fields.push(value.map_or_else(String::new, |value| value.to_string()));
                }
            }
        }
        out.push_str(&line(&fields));
    }
    out
}

fn line(fields: &[String]) -> String {
    let quoted = fields.iter().map(|field| {
        if field.contains([',', '"', '\n']) {
            format!("\"{}\"", field.replace('"', "\"\""))
        } else {
            field.clone()
        }
    });
    quoted.collect::<Vec<_>>().join(",") + "\n"
}

fn value(outcome: &RunOutcome, name: &str) -> Option<Value> {
    let RunOutcome::Done {
        metrics, messages, ..
    } = outcome
    else {
        return None;
    };
    let counted = of_the_kernel(messages, name).map(Value::from);
    counted.or_else(|| metrics.get(name).cloned())
}

/// A cell, summed up.
#[derive(Debug, Serialize)]
pub(crate) struct CellSummary {
    cell: usize,
    values: BTreeMap<String, Value>,
    n: usize,
    failed: usize,
    metrics: BTreeMap<String, Estimate>,
}

#[derive(Debug, Serialize)]
struct Estimate {
    mean: f64,
    ci_low: f64,
    ci_high: f64,
}

/// Each cell's means, with the normal approximation's 95 % intervals.
pub(crate) fn summarise(results: &Results) -> Vec<CellSummary> {
    let manifest = &results.manifest;
    let cells = manifest.cells.iter().enumerate();
    cells
        .map(|(cell, of)| {
            let runs = results.of_cell(cell);
            let failed =
                |run: &&super::results::RunRecord| matches!(run.outcome, RunOutcome::Failed { .. });
            let failed = runs.iter().filter(failed).count();
            let names = manifest.factors.iter().map(|factor| factor.name.clone());
            let metrics = manifest.metrics.iter().filter_map(|metric| {
                let values: Vec<f64> = runs
                    .iter()
                    .filter_map(|run| value(&run.outcome, &metric.name))
                    .flat_map(|value| match value {
                        Value::Array(entries) => entries,
                        Value::Bool(flag) => vec![Value::from(u8::from(flag))],
                        other => vec![other],
                    })
                    .filter_map(|value| value.as_f64())
                    .collect();
                Some((metric.name.clone(), estimate(&values)?))
            });
            CellSummary {
                cell,
                values: names.zip(of.values.iter().cloned()).collect(),
                n: runs.len() - failed,
                failed,
                metrics: metrics.collect(),
            }
        })
        .collect()
}

fn estimate(values: &[f64]) -> Option<Estimate> {
    if values.is_empty() {
        return None;
    }
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|x| (x - mean) * (x - mean)).sum();
    let half = 1.96 * (squares / (n - 1.0).max(1.0) / n).sqrt();
    Some(Estimate {
        mean,
        ci_low: mean - half,
        ci_high: mean + half,
    })
}
