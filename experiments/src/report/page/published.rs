//! Our figures beside those that others published.

mod comparisons;

use maud::{Markup, html};

use crate::report::measure::Study;
use crate::report::numbers::{Style, with_unit};
use crate::stats::Estimate;
use crate::study::results::{Claim, Published};
use crate::study::summary::published::{Beside, LineSummary};
use farside_actors::figure::numbers::{as_written, plain};

/// A published figure and the cell that it is beside.
type Field<'a> = (usize, &'a Beside);

/// A table of two factors, as publications print them.
struct Matrix<'a> {
    /// By place in the manifest.
    rows: Side<'a>,
    columns: Side<'a>,
    /// By row, then by column.
    fields: Vec<Vec<Option<&'a Beside>>>,
}

/// A factor along one side of a table.
struct Side<'a> {
    label: &'a str,
    texts: Vec<&'a str>,
}

/// All published tables; nothing if there are none.
pub(super) fn section(study: &Study<'_>) -> Markup {
    let tables = &study.results.manifest.published;
    html! {
        @if !tables.is_empty() {
            section id="published" {
                h2 { "Beside the published figures" }
                p class="note" {
                    "Ours is the mean (of rates the rate, of lists the median) with its 95 % interval. ✓ \
                     marks published figures that our interval allows, ✗ those that it does not. The \
                     tables are in published.csv, too."
                }
                (comparisons::note(study))
                @for (index, table) in tables.iter().enumerate() { (of_table(study, index, table)) }
            }
        }
    }
}

fn of_table(study: &Study<'_>, index: usize, table: &Published) -> Markup {
    let cells = study.summary.cells.iter();
    let fields = cells.flat_map(|cell| cell.published.iter().map(|one| (cell.cell, one)));
    let fields: Vec<Field<'_>> = fields.filter(|(_, one)| one.table == index).collect();
    let lines = study.summary.lines.iter();
    let lines: Vec<&LineSummary> = lines.filter(|line| line.table == index).collect();
    html! {
        h3 { (table.title) }
        p class="note" { "Published in " (table.source) "." }
        @if !fields.is_empty() {
            @match matrix(study, table, &fields) {
                Some(matrix) => (as_matrix(&matrix)),
                None => (as_list(study, &fields)),
            }
        }
        @if !lines.is_empty() { (as_lines(study, &lines)) }
        (comparisons::of_table(study, index))
        @if !table.note.is_empty() { p { (table.note) } }
        @if !table.why.is_empty() { p { b { "Why ours differ. " } (table.why) } }
    }
}

/// The table of two factors, if the figures make one: exactly two factors vary among them, no two
/// figures meet, and half of the fields are there at least.
fn matrix<'a>(study: &Study<'a>, table: &Published, fields: &[Field<'a>]) -> Option<Matrix<'a>> {
    let manifest = &study.results.manifest;
    let text = |cell: usize, factor: usize| -> Option<&'a str> {
        Some(manifest.cells.get(cell)?.texts.get(factor)?.as_str())
    };
    let mut sides = Vec::new();
    for (at, factor) in manifest.factors.iter().enumerate() {
        let levels = study.layout.axes.iter().find(|axis| axis.factor == at);
        let levels = levels.map_or(&[][..], |axis| &axis.levels);
        let mut texts: Vec<&str> = Vec::new();
        for (cell, _) in fields {
            texts.extend(text(*cell, at).filter(|text| !texts.contains(text)));
        }
        // As along the axes of plots: numbers rise.
        texts.sort_by_key(|text| levels.iter().position(|level| level.text == **text));
        if texts.len() > 1 {
            let label = factor.label.as_str();
            sides.push((at, Side { label, texts }));
        }
    }
    let named =
        |(at, _): &(usize, Side<'_>)| Some(&manifest.factors[*at].name) == table.rows.as_ref();
    if sides.len() == 2 && named(&sides[1]) {
        sides.swap(0, 1);
    }
    let Ok([(row, rows), (column, columns)]) = <[_; 2]>::try_from(sides) else {
        return None;
    };
    let mut grid = vec![vec![None; columns.texts.len()]; rows.texts.len()];
    for (cell, one) in fields {
        let place = |factor: usize, side: &Side<'_>| {
            side.texts
                .iter()
                .position(|known| text(*cell, factor) == Some(*known))
        };
        let field = &mut grid[place(row, &rows)?][place(column, &columns)?];
        if field.replace(*one).is_some() {
            return None;
        }
    }
    let all = rows.texts.len() * columns.texts.len();
    (2 * fields.len() >= all).then_some(Matrix {
        rows,
        columns,
        fields: grid,
    })
}

fn as_matrix(matrix: &Matrix<'_>) -> Markup {
    html! {
        div class="scroll" tabindex="0" {
            table {
                caption { "In each field ours, what was published, and ours less theirs." }
                thead {
                    tr {
                        th class="name" { (matrix.rows.label) " ↓  " (matrix.columns.label) " →" }
                        @for text in &matrix.columns.texts { th scope="col" { (text) } }
                    }
                }
                tbody {
                    @for (text, fields) in matrix.rows.texts.iter().zip(&matrix.fields) {
                        tr {
                            th scope="row" { (text) }
                            @for field in fields { (matrix_field(*field)) }
                        }
                    }
                }
            }
        }
    }
}

fn matrix_field(field: Option<&Beside>) -> Markup {
    let Some(one) = field else {
        return html! { td class="beside" { "–" } };
    };
    html! {
        td class="beside" {
            b { (ours(one)) }
            small { (interval(one)) ", " (runs(one.n)) }
            span class="theirs" { "published " (claim(&one.published, &one.unit)) }
            (mark(one, &difference(one)))
        }
    }
}

fn as_list(study: &Study<'_>, fields: &[Field<'_>]) -> Markup {
    html! {
        div class="scroll" tabindex="0" {
            table {
                thead {
                    tr {
                        th class="name" { "cell" }
                        th class="narrow" { "ours" }
                        th class="narrow" { "95 % interval" }
                        th class="narrow" { "runs" }
                        th class="narrow" { "published" }
                        th class="narrow" { "ours less theirs" }
                        th class="narrow" { "in our interval" }
                    }
                }
                tbody {
                    @for (cell, one) in fields {
                        tr {
                            th scope="row" { (study.cell_name(*cell)) }
                            td { b { (ours(one)) } }
                            td { (interval(one)) }
                            td { (one.n) }
                            td {
                                (claim(&one.published, &one.unit))
                                @if !one.quote.is_empty() { small class="quote" { "“" (one.quote) "”" } }
                            }
                            td { (difference(one)) }
                            td { (mark(one, "")) }
                        }
                    }
                }
            }
        }
    }
}

fn as_lines(study: &Study<'_>, lines: &[&LineSummary]) -> Markup {
    let label = |name: &str| {
        let factors = study.results.manifest.factors.iter();
        let mut labels = factors.filter(|factor| factor.name == name);
        labels
            .next()
            .map_or(name.to_owned(), |factor| factor.label.clone())
    };
    let mut quotes: Vec<&str> = lines.iter().map(|line| line.quote.as_str()).collect();
    quotes.retain(|quote| !quote.is_empty());
    quotes.dedup();
    html! {
        @for quote in quotes { p class="note" { "“" (quote) "”" } }
        div class="scroll" tabindex="0" {
            table {
                caption { "Published to be linear: the line through our figures, by least squares." }
                thead {
                    tr {
                        th class="name" { "cells" }
                        th class="narrow" { "along" }
                        th class="narrow" { "points" }
                        th class="narrow" { "slope" }
                        th class="narrow" { "R²" }
                        th class="narrow" { "farthest cell, of the greatest figure" }
                    }
                }
                tbody {
                    @for line in lines {
                        tr {
                            th scope="row" {
                                @if line.of.is_empty() { "all" } @else { (line.of) }
                            }
                            td { (label(&line.factor)) }
                            td { (line.cells.len()) }
                            td { (plain(line.slope)) }
                            td { (r_squared(line.r_squared)) }
                            td { (plain(100.0 * line.farthest)) " % off the line" }
                        }
                    }
                }
            }
        }
    }
}

fn r_squared(value: f64) -> String {
    if value.is_finite() {
        format!("{value:.3}")
    } else {
        "–".to_owned()
    }
}

fn estimate(one: &Beside) -> Estimate {
    Estimate {
        value: one.estimate,
        low: one.ci_low,
        high: one.ci_high,
    }
}

fn ours(one: &Beside) -> String {
    if !one.estimate.is_finite() {
        return "–".to_owned();
    }
    with_unit(Style::Plain.value(&estimate(one)), &one.unit)
}

fn interval(one: &Beside) -> String {
    Style::Plain.interval(&estimate(one))
}

fn runs(count: usize) -> String {
    format!("{count} run{}", if count == 1 { "" } else { "s" })
}

/// What was published, in a few words.
pub(in crate::report) fn claim(claim: &Claim, unit: &str) -> String {
    let (word, number) = match claim {
        Claim::Value(number) => ("", number),
        Claim::About(number) => ("about ", number),
        Claim::Below(number) => ("under ", number),
        Claim::Above(number) => ("over ", number),
        Claim::Linear(factor) => return format!("linear in {factor}"),
        Claim::Exceeds(_) => return "more than another".to_owned(),
    };
    format!("{word}{}", with_unit(as_written(*number), unit))
}

/// How much more ours is, with a sign; nothing beside a bound that ours keeps.
fn difference(one: &Beside) -> String {
    let Some(difference) = one.difference else {
        return String::new();
    };
    let shift = difference - one.estimate;
    let moved = Estimate {
        value: difference,
        low: one.ci_low + shift,
        high: one.ci_high + shift,
    };
    // Shares differ by percentage points.
    let unit = if one.unit == "%" { "pp" } else { &one.unit };
    with_unit(Style::Plain.signed(&moved), unit)
}

/// Whether our interval allows what was published, after some words.
fn mark(one: &Beside, before: &str) -> Markup {
    let bound = matches!(one.published, Claim::Below(_) | Claim::Above(_));
    let (class, words) = match (one.inside, bound) {
        (Some(true), false) => ("in", "✓ inside"),
        (Some(false), false) => ("out", "✗ outside"),
        (Some(true), true) => ("in", "✓ allowed"),
        (Some(false), true) => ("out", "✗ beyond"),
        (None, _) => ("none", "no interval"),
    };
    html! {
        span class=(class) {
            @if !before.is_empty() { (before) " · " }
            (words)
        }
    }
}
