//! The page that people read: one file, with its figures and its style, that loads nothing.

mod method;
mod notices;
pub(super) mod published;
mod runs;
mod series;
mod tables;
mod worst;

use std::collections::BTreeSet;

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::measure::{Measure, Study};
use super::plots::{self, Plots};
use crate::study::summary::values::ValueKind;
use farside_actors::figure::numbers::plain;
use farside_actors::figure::svg::Figure;

/// The page, and the figures that are on it.
pub(super) fn page(study: &Study<'_>, folder: &str) -> (String, Vec<Figure>) {
    let measures = study.measures();
    let mut plotted: Vec<Plots> = measures
        .iter()
        .map(|measure| plots::of_metric(study, measure))
        .collect();
    let figures = plotted.iter_mut().flat_map(|plots| &mut plots.figures);
    make_unique(figures);
    let losses = plots::losses(study);
    let manifest = &study.results.manifest;
    let notices = notices::of(study);
    let markup = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                // Nothing is loaded from anywhere, not even an icon.
                link rel="icon" href="data:,";
                title { (manifest.study) ": " (manifest.question) }
                style { (PreEscaped(farside_actors::figure::STYLE)) (PreEscaped(super::PAGE_STYLE)) }
            }
            body {
                header {
                    h1 { "Study " (manifest.study) }
                    p class="question" { (manifest.question) }
                }
                (runs::what_was_run(study))
                (notices::first(&notices))
                (contents(study, &measures, losses.is_some()))
                main {
                    section id="cells" {
                        h2 { "All cells" }
                        (tables::overview(study, &measures))
                    }
                    (published::section(study))
                    @for (measure, plots) in measures.iter().zip(&plotted) {
                        (metric_section(study, measure, plots, (&notices, folder)))
                    }
                    @if let Some(losses) = &losses { (losses_section(study, losses)) }
                    (runs::trouble(study))
                    (runs::commands(study, folder))
                    (method::section(study))
                    (runs::scenario(study))
                }
            }
        }
    };
    let figures = plotted
        .into_iter()
        .flat_map(|plots| plots.figures)
        .chain(losses);
    (markup.into_string(), figures.collect())
}

/// Gives each figure a file of its own: names that differ may be alike in letters and digits.
fn make_unique<'a>(figures: impl Iterator<Item = &'a mut Figure>) {
    let mut taken = BTreeSet::new();
    for figure in figures {
        let stem = figure.file.trim_end_matches(".svg").to_owned();
        let mut number = 1;
        while !taken.insert(figure.file.clone()) {
            number += 1;
            figure.file = format!("{stem}-{number}.svg");
        }
    }
}

/// Where a metric's section is.
fn anchor(measure: &Measure<'_>) -> String {
    format!("metric-{}", measure.index)
}

fn contents(study: &Study<'_>, measures: &[Measure<'_>], losses: bool) -> Markup {
    html! {
        nav aria-label="Contents" {
            ul {
                li { a href="#cells" { "All cells" } }
                @if !study.results.manifest.published.is_empty() {
                    li { a href="#published" { "Beside the published figures" } }
                }
                @for measure in measures {
                    li { a href={ "#" (anchor(measure)) } { (measure.metric.label) } }
                }
                @if losses { li { a href="#losses" { "Losses" } } }
                li { a href="#again" { "Run again" } }
                li { a href="#method" { "How figures are made" } }
                li { a href="#scenario" { "Scenario" } }
            }
        }
    }
}

fn metric_section(
    study: &Study<'_>,
    measure: &Measure<'_>,
    plots: &Plots,
    (notices, folder): (&[String], &str),
) -> Markup {
    html! {
        section id=(anchor(measure)) {
            h2 { (capital(&measure.metric.label)) }
            @if let Some(sentence) = measure.constant(study.summary) {
                p { (sentence) }
            } @else {
                (tables::overall(study, measure))
                @if measure.kind == ValueKind::Series { (series::told(study, measure)) }
                @if !plots.figures.is_empty() {
                    @let label = &measure.metric.label;
                    div class="figures" {
                        @for figure in &plots.figures { (placed(figure, label)) }
                    }
                }
                @for note in &plots.notes { p class="note" { (note) } }
                (notices::beside(notices))
                @if plots.figures.is_empty() {
                    (tables::of_metric(study, measure))
                } @else {
                    details {
                        summary { "Table: " (measure.metric.label) " in each cell" }
                        (tables::of_metric(study, measure))
                    }
                }
                (worst::section(study, measure, folder))
            }
        }
    }
}

fn losses_section(study: &Study<'_>, figure: &Figure) -> Markup {
    let cells = study.summary.cells.iter();
    let lost: u64 = cells.map(|cell| cell.messages.lost).sum();
    html! {
        section id="losses" {
            h2 { (figure.title) }
            p class="note" {
                (plain(lost as f64)) " copies of messages were lost in all. Bars show the share of \
                 all copies in the runs of a cell together; what was under way when a run ended \
                 counts as not lost."
            }
            div class="figures" { (placed(figure, &figure.title)) }
        }
    }
}

/// A heading of a label, which begins small.
fn capital(label: &str) -> String {
    let mut letters = label.chars();
    let first = letters
        .next()
        .map(|letter| letter.to_uppercase().to_string());
    first.unwrap_or_default() + letters.as_str()
}

/// A figure in the page, below a heading that says what its title begins with: its caption has the
/// rest, without what is written in it. What is wider than a column or higher than a screen scrolls
/// by itself.
fn placed(figure: &Figure, heading: &str) -> Markup {
    let class = match figure {
        Figure { width, .. } if *width > plots::WIDTH + 1.0 => "wide",
        Figure { height, .. } if *height > 900.0 => "tall",
        _ => "",
    };
    let rest = figure.title.strip_prefix(heading).unwrap_or(&figure.title);
    let rest = rest.strip_suffix(figure.facet.as_str()).unwrap_or(rest);
    let rest = rest.trim_matches([',', ' ']);
    html! {
        figure class=[(!class.is_empty()).then_some(class)]
            tabindex=[(!class.is_empty()).then_some("0")] {
            figcaption { (capital(rest)) }
            (figure.inline())
        }
    }
}
