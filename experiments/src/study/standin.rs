//! Stands in for `report::csv::results_csv` until that is there.

use serde_json::Value;

use super::results::{Results, RunOutcome};
use super::summary::values::value_of;

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
                    let value = value_of(&run.outcome, &metric.name);
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
