//! What curves say, in words and in a table.

use maud::{Markup, html};

use super::tables::estimate_fields;
use crate::report::measure::{Measure, Study};
use crate::report::numbers::Style;
use crate::stats::Estimate;
use crate::study::summary::CellSummary;
use crate::study::summary::series::{SeriesDifference, SeriesPoint, SeriesSummary};
use farside_actors::figure::numbers::plain;

/// The most cells of which a sentence is said; the table has all.
const TOLD: usize = 12;

/// From which index on each cell differs from the baseline, in sentences.
pub(super) fn told(study: &Study<'_>, measure: &Measure<'_>) -> Markup {
    let Some(baseline) = study.baseline() else {
        return html! {};
    };
    let cells = study.summary.cells.iter();
    let differing = cells.filter_map(|cell| {
        let series = measure.series(cell)?;
        Some((cell, series.difference.as_ref()?))
    });
    let differing: Vec<(&CellSummary, &SeriesDifference)> = differing.collect();
    let family = differing.iter().map(|(_, one)| one.family).max();
    html! {
        ul {
            @for (cell, difference) in differing.iter().take(TOLD) {
                li { b { (study.cell_name(cell.cell)) } ": " (sentence(measure, difference)) }
            }
        }
        @if differing.len() > TOLD { p class="note" { "And more cells: the table has all." } }
        @if let Some(family) = family {
            p class="note" {
                "Compared with " (study.cell_name(baseline)) ", over the same seeds. A difference \
                 holds from an index on if at it and at all later ones the 95 % interval leaves \
                 out 0 on the same side, and p, adjusted by Holm, is at most 0.05. The family that \
                 is held together are the indices of one curve: " (family) " tests. Several \
                 curves are several families."
            }
        }
    }
}

fn sentence(measure: &Measure<'_>, difference: &SeriesDifference) -> String {
    let Some(last) = difference.points.last() else {
        return "no index is shared with the baseline.".to_owned();
    };
    match (difference.holds_from, difference.is_more) {
        (Some(from), Some(is_more)) => {
            let more = if is_more { "more" } else { "less" };
            let (from, last) = (measure.index_told(from), plain(last.index));
            format!("{more} than in the baseline from {from} on, to the last, {last}.")
        }
        _ => {
            let last = measure.index_told(last.index);
            format!("no difference that holds up to the last index, {last}.")
        }
    }
}

/// The last index at which any run has a value.
fn last(series: &SeriesSummary) -> Option<&SeriesPoint> {
    series.points.iter().rfind(|point| point.n > 0)
}

/// What a cell of the table of all cells says of a curve: where it ends, and from where on it differs.
pub(super) fn in_short(measure: &Measure<'_>, series: &SeriesSummary) -> Markup {
    let difference = series.difference.as_ref();
    html! {
        @if let Some(last) = last(series) {
            (measure.style.value(&last.estimate()))
            small { "at " (measure.index_told(last.index)) }
        }
        @match difference.map(|one| (one.holds_from, one.is_more)) {
            Some((Some(from), Some(is_more))) => {
                small class="sure" {
                    "from " (measure.index_told(from)) "\u{a0}" (if is_more { "▲" } else { "▼" })
                }
            }
            Some(_) => { small { "no lasting difference" } }
            None => {}
        }
    }
}

/// A cell's fields of the metric's table: the last index, and from where on it differs.
pub(super) fn fields(measure: &Measure<'_>, series: &SeriesSummary) -> Markup {
    let last = last(series);
    let difference = series.difference.as_ref();
    let points = difference.map_or(&[][..], |one| &one.points);
    let at_last = points
        .iter()
        .find(|one| last.is_some_and(|last| last.index == one.index));
    let at_last: Option<Estimate> = at_last.map(|point| point.difference.estimate());
    html! {
        td { @if let Some(last) = last { (plain(last.index)) } @else { "–" } }
        (estimate_fields(measure.style, last.map(|last| last.estimate())))
        @if let Some(estimate) = at_last {
            td { (Style::Plain.signed(&estimate)) }
            td { (Style::Plain.interval(&estimate)) }
        } @else {
            td { "–" }
            td { "–" }
        }
        td {
            @match difference.and_then(|one| one.holds_from) {
                Some(from) => { (measure.index_told(from)) " on" }
                None => "–",
            }
        }
    }
}
