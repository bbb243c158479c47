//! A metric of a study, as plots and tables show it.

use super::layout::Layout;
use super::numbers::{Style, plain};
use crate::stats::Estimate;
use crate::study::results::{Metric, Results};
use crate::study::summary::values::{Kind, kind_of};
use crate::study::summary::{CellSummary, Difference, MetricSummary, Summary};

/// All there is to say of a study.
pub(super) struct Study<'a> {
    pub(super) results: &'a Results,
    pub(super) summary: &'a Summary,
    pub(super) layout: Layout,
}

/// A metric.
pub(super) struct Measure<'a> {
    /// Its place in the manifest.
    pub(super) index: usize,
    pub(super) metric: &'a Metric,
    pub(super) kind: Kind,
    pub(super) style: Style,
}

impl<'a> Study<'a> {
    pub(super) fn new(results: &'a Results, summary: &'a Summary) -> Self {
        let layout = Layout::new(&results.manifest);
        Study {
            results,
            summary,
            layout,
        }
    }

    /// Each metric, in the manifest's order.
    pub(super) fn measures(&self) -> Vec<Measure<'a>> {
        let metrics = self.results.manifest.metrics.iter().enumerate();
        let measure = |(index, metric): (usize, &'a Metric)| {
            let kind = kind_of(self.results, &metric.name);
            let style = if kind == Kind::Rate {
                Style::Percent
            } else {
                Style::Plain
            };
            Measure {
                index,
                metric,
                kind,
                style,
            }
        };
        metrics.map(measure).collect()
    }

    /// A cell's name for people: `latency 5ms, loss 30%`.
    pub(super) fn cell_name(&self, cell: usize) -> String {
        let Some(about) = self.results.manifest.cells.get(cell) else {
            return String::new();
        };
        let factors = self.results.manifest.factors.iter().zip(&about.texts);
        let parts: Vec<String> = factors
            .map(|(factor, text)| format!("{} {text}", factor.label))
            .collect();
        if parts.is_empty() {
            "the only cell".to_owned()
        } else {
            parts.join(", ")
        }
    }
}

impl Measure<'_> {
    /// What is plotted of a cell: the mean, the rate, or the median of lists. None if no run of the
    /// cell says anything.
    pub(super) fn estimate(&self, cell: &CellSummary) -> Option<Estimate> {
        let (value, low, high) = match &cell.metrics.get(self.index)?.summary {
            MetricSummary::Number(number) if number.n > 0 => {
                (number.mean, number.ci_low, number.ci_high)
            }
            MetricSummary::Rate(rate) if rate.n > 0 => (rate.mean, rate.ci_low, rate.ci_high),
            MetricSummary::List(list) if list.values > 0 => {
                (list.median, list.median_low, list.median_high)
            }
            _ => return None,
        };
        Some(Estimate { value, low, high })
    }

    /// How much more than in the baseline.
    pub(super) fn difference(&self, cell: &CellSummary) -> Option<Estimate> {
        let difference = match &cell.metrics.get(self.index)?.summary {
            MetricSummary::Number(number) => number.difference.as_ref(),
            MetricSummary::Rate(rate) => rate.difference.as_ref(),
            _ => None,
        };
        let of = |difference: &Difference| Estimate {
            value: difference.mean,
            low: difference.ci_low,
            high: difference.ci_high,
        };
        difference.filter(|difference| difference.n > 0).map(of)
    }

    /// How many runs of a cell say anything.
    pub(super) fn n(&self, cell: &CellSummary) -> usize {
        match cell.metrics.get(self.index).map(|named| &named.summary) {
            Some(MetricSummary::Number(number)) => number.n,
            Some(MetricSummary::Rate(rate)) => rate.n,
            Some(MetricSummary::List(list)) => list.n,
            Some(MetricSummary::Text { n, .. }) => *n,
            _ => 0,
        }
    }

    /// What is estimated, in words.
    pub(super) fn what(&self) -> &'static str {
        match self.kind {
            Kind::Rate => "rate",
            Kind::List => "median",
            _ => "mean",
        }
    }

    /// The label with the unit: `age of information (s)`.
    pub(super) fn label(&self) -> String {
        let unit = match (self.style, self.metric.unit.as_str()) {
            (Style::Percent, _) => "of runs",
            (_, unit) => unit,
        };
        // `messages lost (messages)` says one thing twice.
        if unit.is_empty() || self.metric.label.split(' ').any(|word| word == unit) {
            self.metric.label.clone()
        } else {
            format!("{} ({unit})", self.metric.label)
        }
    }

    /// What a plot's vertical axis says: `mean time ratio`.
    pub(super) fn axis_label(&self) -> String {
        match self.kind {
            Kind::Rate => self.label(),
            _ => format!("{} {}", self.what(), self.label()),
        }
    }

    /// A figure and its interval in a line: `1.42 (1.36 to 1.50)`.
    pub(super) fn told(&self, estimate: &Estimate) -> String {
        let (value, interval) = (self.style.value(estimate), self.style.interval(estimate));
        format!("{value} ({interval})")
    }

    /// What a point says when it is pointed at.
    pub(super) fn tooltip(&self, study: &Study<'_>, cell: &CellSummary, at: &Estimate) -> String {
        let name = study.cell_name(cell.cell);
        format!(
            "{name}: {} {}, {} runs",
            self.what(),
            self.told(at),
            self.n(cell)
        )
    }

    /// That the metric is the same in all runs, in a sentence, if it is.
    pub(super) fn constant(&self, summary: &Summary) -> Option<String> {
        let label = &self.metric.label;
        let runs: usize = summary.cells.iter().map(|cell| self.n(cell)).sum();
        if runs == 0 {
            return Some(format!("No run reports {label}."));
        }
        let mut ends: Option<(f64, f64)> = None;
        for cell in summary.cells.iter().filter(|cell| self.n(cell) > 0) {
            let (low, high) = match &cell.metrics[self.index].summary {
                MetricSummary::Number(number) => (number.min, number.max),
                MetricSummary::Rate(rate) if rate.happened == 0 => (0.0, 0.0),
                MetricSummary::Rate(rate) if rate.happened == rate.n => (1.0, 1.0),
                _ => return None,
            };
            let (least, most) = ends.unwrap_or((low, high));
            ends = Some((least.min(low), most.max(high)));
        }
        let (low, high) = ends?;
        if low != high {
            return None;
        }
        // Never or always in all runs says something of the next one.
        let bound = crate::stats::rates::wilson(0, runs).high;
        let bound = Style::Percent.value(&Estimate {
            value: bound,
            low: 0.0,
            high: bound,
        });
        let surely = format!("a rate of more than {bound} is unlikely (Wilson, 95 %)");
        Some(match self.kind {
            Kind::Rate if low == 0.0 => format!("{label}: none of {runs} runs; {surely}."),
            Kind::Rate => format!("{label}: all {runs} runs; of the contrary, {surely}."),
            _ if low == 0.0 => {
                format!("{label}: 0 in all {runs} runs; of runs with any, {surely}.")
            }
            _ => format!("{label}: {} in all {runs} runs.", plain(low)),
        })
    }
}
