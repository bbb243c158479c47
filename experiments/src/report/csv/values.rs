//! Lists and curves of runs, value by value: one row for each.

use serde_json::Value;

use super::{Table, number, scalar, texts};
use crate::study::results::Results;
use crate::study::summary::values::{ValueKind, kind_of, value_of};
use farside_actors::system::Series;

/// One row for each cell, seed, metric that is a list or a curve, and value in it. `index` is the
/// place in a list, from 0 (rover by rover, say), or the index of a curve; the value is empty where
/// there is none, as of a rover that had not arrived. None if the study has neither.
pub fn values_csv(results: &Results) -> Option<String> {
    let manifest = &results.manifest;
    let metrics: Vec<(&str, ValueKind)> = manifest
        .metrics
        .iter()
        .map(|metric| (metric.name.as_str(), kind_of(results, &metric.name)))
        .filter(|(_, kind)| matches!(kind, ValueKind::List | ValueKind::Series))
        .collect();
    if metrics.is_empty() {
        return None;
    }
    let mut header = vec!["cell".to_owned()];
    header.extend(manifest.factors.iter().map(|factor| factor.name.clone()));
    header.extend(["seed", "metric", "index", "value"].map(str::to_owned));
    let mut table = Table::new(header);
    for run in &results.runs {
        for (name, _) in &metrics {
            let value = value_of(&run.outcome, name);
            for (index, value) in value.iter().flat_map(|value| entries(value)) {
                let mut row = vec![run.cell.to_string()];
                row.extend(texts(manifest, run.cell));
                row.extend([run.seed.to_string(), (*name).to_owned(), index, value]);
                table.row(row);
            }
        }
    }
    Some(table.finish())
}

/// What a list or a curve has, each with its index.
fn entries(value: &Value) -> Vec<(String, String)> {
    let told = |value: &Value| match value {
        Value::Null => String::new(),
        value => scalar(value),
    };
    match value {
        Value::Array(values) => {
            let values = values.iter().enumerate();
            let of_place = |(place, value): (usize, &Value)| (place.to_string(), told(value));
            values.map(of_place).collect()
        }
        Value::Object(_) => {
            let Ok(series) = Series::from_json(value) else {
                return Vec::new();
            };
            let index = series.index().iter();
            let of_index = |index: &f64| {
                let value = series.at(*index).map_or_else(String::new, number);
                (number(*index), value)
            };
            index.map(of_index).collect()
        }
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::fabricated::{self, loss};
    use crate::study::results::RunOutcome;

    #[test]
    fn each_value_of_lists_and_curves_has_a_row() {
        let results = fabricated::study("csv", vec![loss()], 4);
        let results = fabricated::with_curves(results, 5);
        let text = values_csv(&results).unwrap();
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let header = reader.headers().unwrap().clone();
        let names = ["cell", "loss", "seed", "metric", "index", "value"];
        assert_eq!(header.iter().collect::<Vec<_>>(), names);
        let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
        let (mut lists, mut curves) = (0, 0);
        for run in &results.runs {
            let RunOutcome::Done { metrics, .. } = &run.outcome else {
                continue;
            };
            let of = |metric: &str| -> Vec<&csv::StringRecord> {
                let (cell, seed) = (run.cell.to_string(), run.seed.to_string());
                let rows = rows.iter().filter(|row| {
                    (&row[0], &row[2], &row[3]) == (cell.as_str(), seed.as_str(), metric)
                });
                rows.collect()
            };
            let arrivals = metrics["arrival_s"].as_array().unwrap();
            let told = of("arrival_s");
            assert_eq!(told.len(), arrivals.len());
            for (row, value) in told.iter().zip(arrivals) {
                let read = (!row[5].is_empty()).then(|| row[5].parse::<f64>().unwrap());
                assert_eq!(read, value.as_f64());
            }
            lists += told.len();
            let told = of("reward");
            let series = Series::from_json(&metrics["reward"]).unwrap();
            for row in &told {
                let index: f64 = row[4].parse().unwrap();
                assert_eq!(row[5].parse().ok(), series.at(index));
            }
            curves += told.len();
        }
        assert!(lists > 100 && curves > 20, "{lists}, {curves}");
        let mut bare = fabricated::study("csv", vec![loss()], 2);
        bare.manifest
            .metrics
            .retain(|metric| metric.name == "time_ratio");
        assert_eq!(values_csv(&bare), None);
    }
}
