//! Cells against each other, where one was published to be more than another.

use maud::{Markup, html};

use crate::report::measure::{Measure, Study};
use crate::report::numbers::{Style, with_unit};
use crate::stats::Estimate;
use crate::study::summary::SURE_FROM;
use crate::study::summary::comparisons::{ComparisonSummary, Verdict};
use farside_actors::figure::numbers::{as_written, plain};

/// How comparisons are to be read; nothing if there are none.
pub(super) fn note(study: &Study<'_>) -> Markup {
    let all = &study.summary.comparisons;
    html! {
        @if !all.is_empty() {
            p class="note" {
                "Where a cell is said to be more than another, the difference is paired by seed. \
                 The claim holds if the whole 95 % interval is where it says, and does not hold if \
                 the whole interval is elsewhere; with fewer than " (SURE_FROM) " pairs, or blocks \
                 of them, it is undecided."
                @if all.iter().any(|one| one.index.is_some()) {
                    " Of curves it is for each index from the first on, and the one is shown that \
                     speaks most against it."
                }
            }
        }
    }
}

/// The comparisons of a published table; nothing if it has none.
pub(super) fn of_table(study: &Study<'_>, index: usize) -> Markup {
    let all = study.summary.comparisons.iter();
    let all: Vec<&ComparisonSummary> = all.filter(|one| one.table == index).collect();
    let Some(first) = all.first() else {
        return html! {};
    };
    let measures = study.measures();
    let measure = measures.iter().find(|one| one.metric.name == first.metric);
    let of_curves = all.iter().any(|one| one.index.is_some());
    html! {
        div class="scroll" tabindex="0" {
            table {
                thead {
                    tr {
                        th class="name" { "cell" }
                        th class="text" { "published" }
                        th class="narrow" { "difference" }
                        th class="narrow" { "95 % interval" }
                        @if of_curves { th class="narrow" { "at" } }
                        th class="narrow" { "pairs" }
                    }
                }
                tbody {
                    @for one in &all { (row(study, measure, one, of_curves)) }
                }
            }
        }
    }
}

fn row(
    study: &Study<'_>,
    measure: Option<&Measure<'_>>,
    one: &ComparisonSummary,
    of_curves: bool,
) -> Markup {
    let index_told = |index: f64| match measure {
        Some(measure) => measure.index_told(index),
        None => plain(index),
    };
    let (class, words) = match one.verdict {
        Verdict::Holds => ("in", "✓ holds"),
        Verdict::DoesNotHold => ("out", "✗ does not hold"),
        Verdict::Undecided => ("none", "undecided"),
    };
    let difference = Estimate {
        value: one.difference,
        low: one.ci_low,
        high: one.ci_high,
    };
    let unit = if one.unit == "%" { "pp" } else { &one.unit };
    html! {
        tr {
            th scope="row" { (study.cell_name(one.cell)) }
            // On a phone the other columns are out of sight.
            td class="text" {
                span class=(class) { (words) }
                (claimed(study, one))
                @if let Some(from) = one.from_index { ", from " (index_told(from)) " on" }
                @if !one.quote.is_empty() { small { "“" (one.quote) "”" } }
            }
            @if difference.value.is_finite() {
                td { (with_unit(Style::Plain.signed(&difference), unit)) }
                td { (Style::Plain.interval(&difference)) }
            } @else {
                td { "–" }
                td { "–" }
            }
            @if of_curves {
                td { @if let Some(index) = one.index { (index_told(index)) } @else { "–" } }
            }
            td { (one.n) }
        }
    }
}

/// What was published, in words: `more than planner greedy, by 0.1 to 0.5`.
fn claimed(study: &Study<'_>, one: &ComparisonSummary) -> String {
    let other = study.cell_name(one.other);
    let figure = |number: f64| with_unit(as_written(number), &one.unit);
    if let Some(within) = one.equal_within {
        return format!("as {other}, within {}", figure(within));
    }
    let by = match (one.by_at_least, one.by_at_most) {
        (None, None) => String::new(),
        (Some(least), None) => format!(", by at least {}", figure(least)),
        (None, Some(most)) => format!(", by at most {}", figure(most)),
        (Some(least), Some(most)) => {
            format!(", by {} to {}", as_written(least), figure(most))
        }
    };
    format!("more than {other}{by}")
}
