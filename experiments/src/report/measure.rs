//! A metric of a study, as plots and tables show it.

use super::layout::Layout;
use super::numbers::{Style, with_unit};
use crate::stats::{Estimate, rates};
use crate::study::results::{Metric, Results};
use crate::study::summary::series::SeriesSummary;
use crate::study::summary::values::{ValueKind, kind_of};
use crate::study::summary::{CellSummary, Difference, MetricSummary, Summary};
use farside_actors::figure::numbers::plain;
use farside_actors::figure::scale::Scale;

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
    pub(super) kind: ValueKind,
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
            let style = if kind == ValueKind::Rate {
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

    /// How many blocks so many runs of a cell are, or runs that share no problem.
    pub(super) fn blocks(&self, runs: usize) -> usize {
        runs.div_ceil(self.results.manifest.block.max(1))
    }

    /// The baseline, if there is anything to compare with it.
    pub(super) fn baseline(&self) -> Option<usize> {
        self.summary
            .baseline
            .filter(|_| self.summary.cells.len() > 1)
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
        cell.metrics.get(self.index)?.summary.estimate()
    }

    /// How much more than in the baseline.
    pub(super) fn difference(&self, cell: &CellSummary) -> Option<Estimate> {
        let difference = match &cell.metrics.get(self.index)?.summary {
            MetricSummary::Number(number) => number.difference.as_ref(),
            MetricSummary::Rate(rate) => rate.difference.as_ref(),
            _ => None,
        };
        let known = difference.filter(|difference| difference.n > 0);
        known.map(Difference::estimate)
    }

    /// The curves of a cell, if the metric is one.
    pub(super) fn series<'b>(&self, cell: &'b CellSummary) -> Option<&'b SeriesSummary> {
        match &cell.metrics.get(self.index)?.summary {
            MetricSummary::Series(series) => Some(series),
            _ => None,
        }
    }

    /// What the index of its curves is: `planning step (s)`, or `index` where nobody says.
    pub(super) fn index_label(&self) -> String {
        match &self.metric.index {
            Some(index) if index.unit.is_empty() => index.label.clone(),
            Some(index) => format!("{} ({})", index.label, index.unit),
            None => "index".to_owned(),
        }
    }

    /// An index in words: `planning step 12`, `time 3 s`.
    pub(super) fn index_told(&self, index: f64) -> String {
        let index_of = self.metric.index.as_ref();
        let label = index_of.map_or("index", |one| one.label.as_str());
        let unit = index_of.map_or("", |one| one.unit.as_str());
        with_unit(format!("{label} {}", plain(index)), unit)
    }

    /// How many runs of a cell say anything.
    pub(super) fn n(&self, cell: &CellSummary) -> usize {
        let named = cell.metrics.get(self.index);
        named.map_or(0, |named| named.summary.n())
    }

    /// Whether some of the cell's runs say nothing while others do: what is estimated is of the
    /// others alone, the survivors.
    pub(super) fn is_partial(&self, cell: &CellSummary) -> bool {
        (1..cell.n).contains(&self.n(cell))
    }

    /// What is estimated, in words.
    pub(super) fn what(&self) -> &'static str {
        match self.kind {
            ValueKind::Rate => "rate",
            ValueKind::List => "median",
            _ => "mean",
        }
    }

    /// The label with the unit: `age of information (s)`.
    pub(super) fn label(&self) -> String {
        let unit = match (self.style, self.metric.unit.as_str()) {
            (Style::Percent, _) => "% of runs",
            (_, unit) => unit,
        };
        // `messages lost (messages)` says one thing twice.
        if unit.is_empty() || self.metric.label.split(' ').any(|word| word == unit) {
            self.metric.label.clone()
        } else {
            format!("{} ({unit})", self.metric.label)
        }
    }

    /// What is shown: `mean time ratio`.
    pub(super) fn shown_label(&self) -> String {
        match self.kind {
            ValueKind::Rate => self.label(),
            _ => format!("{} {}", self.what(), self.label()),
        }
    }

    /// The same as a vertical axis says it.
    pub(super) fn axis_label(&self, y: &Scale) -> String {
        let log = if y.is_log() { ", log scale" } else { "" };
        format!("{}{log}", self.shown_label())
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
            "{name}: {} {}, {} runs{}",
            self.what(),
            self.told(at),
            self.n(cell),
            match self.is_partial(cell) {
                true => format!(" of {}: the others have no value", cell.n),
                false => String::new(),
            }
        )
    }

    /// That the metric is the same in all runs, in a sentence, if it is.
    pub(super) fn constant(&self, summary: &Summary) -> Option<String> {
        let runs: usize = summary.cells.iter().map(|cell| self.n(cell)).sum();
        if runs == 0 {
            return Some("No run reports it.".to_owned());
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
        // Never in all runs says something of the next one.
        let none = rates::wilson(0, runs);
        let percent = |value: f64| Style::Percent.value(&Estimate { value, ..none });
        let (most, least) = (percent(none.high), percent(1.0 - none.high));
        Some(match self.kind {
            ValueKind::Rate if low == 0.0 => {
                format!("In none of {runs} runs. A rate above {most} is unlikely (Wilson, 95 %).")
            }
            ValueKind::Rate => {
                format!("In all {runs} runs. A rate below {least} is unlikely (Wilson, 95 %).")
            }
            _ if low == 0.0 => format!(
                "0 in all {runs} runs. That more than {most} of all runs have any is unlikely \
                 (Wilson, 95 %)."
            ),
            _ => format!("{} in all {runs} runs.", plain(low)),
        })
    }
}
