//! Tables of cells.

use maud::{Markup, html};

use super::anchor;
use crate::report::measure::{Measure, Study};
use crate::report::numbers::Style;
use crate::stats::Estimate;
use crate::study::summary::values::ValueKind;
use crate::study::summary::{
    CellSummary, ListSummary, MetricSummary, NumberSummary, OverallSummary, RateSummary, SURE_FROM,
};
use farside_actors::figure::numbers::plain;

/// One row for each cell, one column for each metric.
pub(super) fn overview(study: &Study<'_>, measures: &[Measure<'_>]) -> Markup {
    let shown: Vec<&Measure<'_>> = measures
        .iter()
        .filter(|measure| measure.kind != ValueKind::Absent)
        .collect();
    html! {
        p class="note" {
                    "Means (numbers), rates (true or false) and medians (lists), each with its 95 \
                     % interval"
                    @if study.baseline().is_some() {
                        ", and the difference to the baseline over the same seeds. ▲ and ▼ mark \
                         differences whose interval leaves out 0: of twenty that are none, about \
                         one is marked. Differences of rates are in percentage points (pp)."
                        @if shown.iter().any(|measure| measure.kind == ValueKind::Series) {
                            " Of curves there is the mean at the last index, and from which one \
                             on they differ, if they do at the last."
                        }
                    } @else { "." }
                    @if has_partial(study, &shown) {
                        " † is of those runs alone that have a value: what the others never came to \
                         is in no mean."
                    }
                }
        div class="scroll" tabindex="0" {
            table {
                thead {
                    tr {
                        (cell_headers(study))
                        th class="narrow" { "runs" }
                        @for measure in &shown {
                            th { a href={ "#" (anchor(measure)) } { (measure.label()) } }
                        }
                    }
                }
                tbody {
                    @for cell in &study.summary.cells {
                        tr class=[is_baseline(study, cell)] {
                            (cell_name(study, cell))
                            td {
                                (cell.n)
                                @if cell.failed > 0 {
                                    small class="bad" { (cell.failed) " failed" }
                                }
                            }
                            @for measure in &shown { (overview_field(study, measure, cell)) }
                        }
                    }
                }
            }
        }
    }
}

/// Whether any cell's figure is of some of its runs.
fn has_partial(study: &Study<'_>, shown: &[&Measure<'_>]) -> bool {
    let cells = &study.summary.cells;
    let partial = |measure: &&Measure<'_>| cells.iter().any(|cell| measure.is_partial(cell));
    shown.iter().any(partial)
}

/// The mark of a figure that is of some of a cell's runs.
fn dagger(measure: &Measure<'_>, cell: &CellSummary) -> &'static str {
    if measure.is_partial(cell) { "†" } else { "" }
}

fn overview_field(study: &Study<'_>, measure: &Measure<'_>, cell: &CellSummary) -> Markup {
    if let Some(MetricSummary::Text { counts, .. }) =
        cell.metrics.get(measure.index).map(|named| &named.summary)
    {
        return html! {
            td { @for (word, count) in counts { small { (word) ": " (count) } } }
        };
    }
    if let Some(series) = measure.series(cell) {
        return html! { td { (super::series::in_short(measure, series)) } };
    }
    let Some(estimate) = measure.estimate(cell) else {
        return html! { td { "–" } };
    };
    html! {
        td {
            (measure.style.value(&estimate)) (dagger(measure, cell))
            @if estimate.width() != 0.0 { small { (measure.style.interval(&estimate)) } }
            @if measure.is_partial(cell) { small { (measure.n(cell)) " of " (cell.n) " runs" } }
            // Nothing more is to be said of what never varies.
            @if let Some(difference) = measure.difference(cell).filter(|one| one.width() != 0.0) {
                (marked(measure.style.of_differences(), &difference, study.blocks(measure.n(cell))))
            }
        }
    }
}

/// A difference, marked if its interval leaves out 0.
fn marked(style: Style, difference: &Estimate, blocks: usize) -> Markup {
    let apart = difference.low > 0.0 || difference.high < 0.0;
    let sure = apart && difference.is_known() && blocks >= SURE_FROM;
    let sign = match (sure, difference.value > 0.0) {
        (true, true) => "\u{a0}▲",
        (true, false) => "\u{a0}▼",
        _ => "",
    };
    html! {
        small class=[(!sign.is_empty()).then_some("sure")] { (style.signed(difference)) (sign) }
    }
}

fn is_baseline(study: &Study<'_>, cell: &CellSummary) -> Option<&'static str> {
    (study.baseline() == Some(cell.cell)).then_some("baseline")
}

fn cell_headers(study: &Study<'_>) -> Markup {
    let factors = study.results.manifest.factors.iter();
    let labels: Vec<&str> = factors.map(|factor| factor.label.as_str()).collect();
    html! {
        th class="narrow" { "cell" }
        th class="name" { @if labels.is_empty() { "values" } @else { (labels.join(" · ")) } }
    }
}

fn cell_name(study: &Study<'_>, cell: &CellSummary) -> Markup {
    let text = cell.texts.join(" · ");
    html! {
        td { (cell.cell) }
        th scope="row" {
            @if text.is_empty() { "as the scenario has it" } @else { (text) }
            @if is_baseline(study, cell).is_some() { small { " baseline" } }
        }
    }
}

/// What all cells say together.
pub(super) fn overall(study: &Study<'_>, measure: &Measure<'_>) -> Markup {
    let Some(overall) = study.summary.overall.get(&measure.metric.name) else {
        return html! {};
    };
    if study.summary.cells.len() < 2 {
        return html! {};
    }
    let (mean, middle) = overall_estimates(overall);
    html! {
        p {
            "Over all cells, each counted the same: " (measure.told(&mean))
            @if measure.kind == ValueKind::Number {
                "; interquartile mean " (measure.told(&middle))
            }
            "."
        }
    }
}

fn overall_estimates(overall: &OverallSummary) -> (Estimate, Estimate) {
    (
        Estimate {
            value: overall.mean,
            low: overall.ci_low,
            high: overall.ci_high,
        },
        Estimate {
            value: overall.iqm,
            low: overall.iqm_low,
            high: overall.iqm_high,
        },
    )
}

/// Everything that is known of a metric, cell by cell.
pub(super) fn of_metric(study: &Study<'_>, measure: &Measure<'_>) -> Markup {
    let columns: &[&str] = match measure.kind {
        ValueKind::Number => &[
            "mean",
            "95 % interval",
            "interquartile mean",
            "95 % interval",
            "least",
            "greatest",
            "difference",
            "95 % interval",
        ],
        ValueKind::Rate => &[
            "true in",
            "rate",
            "95 % interval",
            "difference",
            "95 % interval",
            "only here / only baseline",
            "McNemar p",
        ],
        ValueKind::List => &[
            "values",
            "happened",
            "censored",
            "never",
            "median",
            "95 % interval",
            "5 %",
            "25 %",
            "75 %",
            "95 %",
        ],
        ValueKind::Series => &[
            "last index",
            "mean there",
            "95 % interval",
            "difference there",
            "95 % interval",
            "differs from",
        ],
        ValueKind::Text | ValueKind::Absent => &["says"],
    };
    html! {
        div class="scroll" tabindex="0" {
            table {
                thead {
                    tr {
                        (cell_headers(study))
                        th class="narrow" { "runs" }
                        @for column in columns { th class="narrow" { (column) } }
                    }
                }
                tbody {
                    @for cell in &study.summary.cells {
                        tr class=[is_baseline(study, cell)] {
                            (cell_name(study, cell))
                            td {
                                (measure.n(cell)) (dagger(measure, cell))
                                @if measure.is_partial(cell) { small { "of " (cell.n) } }
                            }
                            (fields(measure, cell))
                        }
                    }
                }
            }
        }
    }
}

fn fields(measure: &Measure<'_>, cell: &CellSummary) -> Markup {
    let Some(named) = cell.metrics.get(measure.index) else {
        return html! {};
    };
    match &named.summary {
        MetricSummary::Number(number) => number_fields(measure, cell, number),
        MetricSummary::Rate(rate) => rate_fields(measure, cell, rate),
        MetricSummary::List(list) => list_fields(measure, cell, list),
        MetricSummary::Series(series) => super::series::fields(measure, series),
        MetricSummary::Text { counts, .. } => html! {
            td class="text" {
                @for (index, (word, count)) in counts.iter().enumerate() {
                    @if index > 0 { ", " }
                    (word) " in " (count)
                }
            }
        },
        MetricSummary::Absent { .. } => html! { td { "–" } },
    }
}

pub(super) fn estimate_fields(style: Style, estimate: Option<Estimate>) -> Markup {
    html! {
        @if let Some(estimate) = estimate {
            td { (style.value(&estimate)) }
            td { (style.interval(&estimate)) }
        } @else {
            td { "–" }
            td { "–" }
        }
    }
}

fn difference_fields(measure: &Measure<'_>, cell: &CellSummary) -> Markup {
    html! {
        @if let Some(difference) = measure.difference(cell) {
            td { (measure.style.of_differences().signed(&difference)) }
            td { (measure.style.of_differences().interval(&difference)) }
        } @else {
            td { "–" }
            td { "–" }
        }
    }
}

fn number_fields(measure: &Measure<'_>, cell: &CellSummary, number: &NumberSummary) -> Markup {
    let middle = Estimate {
        value: number.iqm,
        low: number.iqm_low,
        high: number.iqm_high,
    };
    html! {
        (estimate_fields(measure.style, measure.estimate(cell)))
        (estimate_fields(measure.style, (number.n > 0).then_some(middle)))
        td { (plain(number.min)) }
        td { (plain(number.max)) }
        (difference_fields(measure, cell))
    }
}

fn rate_fields(measure: &Measure<'_>, cell: &CellSummary, rate: &RateSummary) -> Markup {
    html! {
        td { (rate.happened) }
        (estimate_fields(measure.style, measure.estimate(cell)))
        (difference_fields(measure, cell))
        @if let Some(test) = &rate.mcnemar {
            td { (test.only_here) " / " (test.only_baseline) }
            td { @if test.p < 0.0001 { "< 0.0001" } @else { (format!("{:.4}", test.p)) } }
        } @else {
            td { "–" }
            td { "–" }
        }
    }
}

fn list_fields(measure: &Measure<'_>, cell: &CellSummary, list: &ListSummary) -> Markup {
    html! {
        td { (plain(list.values as f64)) }
        td { (plain(list.happened as f64)) }
        td { (plain(list.censored as f64)) }
        td { (plain(list.never as f64)) }
        (estimate_fields(measure.style, measure.estimate(cell)))
        @for quantile in ["p05", "p25", "p75", "p95"] {
            td { (list.quantiles.get(quantile).map_or("–".to_owned(), |value| plain(*value))) }
        }
    }
}
