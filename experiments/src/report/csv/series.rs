//! Curves: one row for each cell, metric and index.

use super::{Table, number, texts};
use crate::study::results::{Metric, Results};
use crate::study::summary::series::{DifferencePoint, SeriesPoint, SeriesSummary};
use crate::study::summary::{MetricSummary, Summary};

const COLUMNS: [&str; 15] = [
    "metric",
    "unit",
    "index_label",
    "index_unit",
    "index",
    "n",
    "mean",
    "ci_low",
    "ci_high",
    "difference_n",
    "difference",
    "difference_low",
    "difference_high",
    "p",
    "p_holm",
];

/// One row for each cell, metric that is a curve, and index: the mean with its interval, and how
/// much more it is than in the baseline with the same seeds. `p` is for the index alone, `p_holm`
/// for all indices of the curve together. None if the study has no curves.
pub fn series_csv(results: &Results, summary: &Summary) -> Option<String> {
    let manifest = &results.manifest;
    let mut header = vec!["cell".to_owned()];
    header.extend(manifest.factors.iter().map(|factor| factor.name.clone()));
    header.extend(COLUMNS.iter().map(|&column| column.to_owned()));
    let mut table = Table::new(header);
    let mut any = false;
    for cell in &summary.cells {
        for (metric, named) in manifest.metrics.iter().zip(&cell.metrics) {
            let MetricSummary::Series(series) = &named.summary else {
                continue;
            };
            any = true;
            for point in &series.points {
                let mut row = vec![cell.cell.to_string()];
                row.extend(texts(manifest, cell.cell));
                row.extend(of_point(metric, series, point));
                table.row(row);
            }
        }
    }
    any.then(|| table.finish())
}

fn of_point(metric: &Metric, series: &SeriesSummary, point: &SeriesPoint) -> Vec<String> {
    let (label, unit) = match &metric.index {
        Some(index) => (index.label.clone(), index.unit.clone()),
        None => (String::new(), String::new()),
    };
    let mut row = vec![metric.name.clone(), metric.unit.clone(), label, unit];
    row.extend([number(point.index), point.n.to_string()]);
    row.extend([point.mean, point.ci_low, point.ci_high].map(number));
    let points = series.difference.iter().flat_map(|one| &one.points);
    let mut at_index = points.filter(|one| one.index == point.index);
    if let Some(DifferencePoint {
        difference,
        p,
        p_holm,
        ..
    }) = at_index.next()
    {
        row.push(difference.n.to_string());
        row.extend(
            [
                difference.mean,
                difference.ci_low,
                difference.ci_high,
                *p,
                *p_holm,
            ]
            .map(number),
        );
    }
    row
}
