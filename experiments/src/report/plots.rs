//! The plots of a study.

mod curves;
mod heat;
mod losses;
mod series;
mod steps;

use self::curves::Shown;
use super::layout::Shape;
use super::measure::{Measure, Study};
use crate::study::results::Claim;
use crate::study::summary::values::ValueKind;
use farside_actors::figure::svg::{
    Area, CurveName, Figure, Frame, names_below, names_beside, path, room_beside, shortened, slug,
};
use maud::{Markup, html};

/// The width of a figure that stands beside others. On a phone it fills the page, which makes its
/// texts no smaller than 12 pixels there.
pub(super) const WIDTH: f64 = 372.0;
/// The room above a plot, for what its axes measure.
pub(super) const TOP: f64 = 46.0;
/// The room below, for ticks and the axis' label.
pub(super) const BELOW: f64 = 52.0;
/// The height of curves.
pub(super) const HEIGHT: f64 = 214.0;
/// The room above a facet's plot for what tells it from the others.
const FACET: f64 = 22.0;
/// Names that take more room than this stand below a plot, not beside it.
const BESIDE: f64 = 104.0;
/// From so many curves on, their intervals are drawn apart: bands would cover each other.
const CROWDED: usize = 3;

/// The figures of one metric, and what is to be said of them.
pub(super) struct Plots {
    pub(super) figures: Vec<Figure>,
    pub(super) notes: Vec<String>,
}

/// All figures of a metric. One that is constant, or made of words, has none.
pub(super) fn of_metric(study: &Study<'_>, measure: &Measure<'_>) -> Plots {
    let mut plots = Plots {
        figures: Vec::new(),
        notes: Vec::new(),
    };
    if measure.kind == ValueKind::Series {
        series::curves(study, measure, &mut plots);
        return plots;
    }
    let plotted = matches!(
        measure.kind,
        ValueKind::Number | ValueKind::Rate | ValueKind::List
    );
    if !plotted || measure.constant(study.summary).is_some() {
        return plots;
    }
    match study.layout.shape {
        Shape::Single => {}
        Shape::Scattered => plots.figures.extend(curves::scattered(study, measure)),
        Shape::Grid | Shape::Row => {
            if let Some(curves) = study.layout.curves() {
                let all = |shown| curves::all(study, measure, &curves, shown);
                plots.figures.extend(all(Shown::Estimate));
                // Differences are plotted where that is no flood of plots; tables always have them.
                match heat::map(study, measure) {
                    Some(map) => plots.figures.push(map),
                    None if curves.panels.len() == 1 => {
                        plots.figures.extend(all(Shown::Difference));
                    }
                    None => {}
                }
                plots.notes.extend(beside(study, measure));
                if curves.more {
                    plots.notes.push(
                        "There are more curves than can be told apart; an even choice is shown, \
                         and the table has all."
                            .to_owned(),
                    );
                }
            }
        }
    }
    if measure.kind == ValueKind::List {
        steps::distributions(study, measure, &mut plots);
    }
    plots
}

/// What hollow markers are.
const SOME: &str = "Hollow markers are of some runs alone: of those that have a value. What others \
                    never came to, as the arrival of a team that stood still, is in no mean.";

/// What marks on curves mean that are not of all our runs.
fn beside(study: &Study<'_>, measure: &Measure<'_>) -> Option<String> {
    let name = &measure.metric.name;
    let of_cells = study.summary.cells.iter().flat_map(|cell| &cell.published);
    let crosses = of_cells
        .filter(|one| one.metric == *name)
        .any(|one| matches!(one.published, Claim::Value(_) | Claim::About(_)));
    let fitted = study.summary.lines.iter().any(|line| line.metric == *name);
    let crosses = crosses.then_some("Crosses are published figures.");
    let fitted = fitted.then_some("Dotted lines are straight ones, fitted by least squares.");
    let partial = study
        .summary
        .cells
        .iter()
        .any(|cell| measure.is_partial(cell));
    let partial = partial.then_some(SOME);
    let notes: Vec<&str> = crosses.into_iter().chain(fitted).chain(partial).collect();
    (!notes.is_empty()).then(|| notes.join(" "))
}

pub(super) use losses::figure as losses;

/// A plot's sheet: where its marks, its names and what tells it from other facets go.
struct Sheet {
    area: Area,
    heading: String,
    facet: String,
    /// The names stand beside the curves.
    beside: bool,
}

impl Sheet {
    /// With `left` for what is written along the vertical axis. A plot of one curve has no names,
    /// and `right` instead.
    fn new(left: f64, right: f64, names: &[String], heading: &str, facet: &str) -> Self {
        let room = room_beside(names.iter().map(String::as_str));
        let beside = room <= BESIDE;
        let right = match names {
            [] => right,
            _ if beside => room,
            _ => 16.0,
        };
        Sheet {
            area: Area {
                left,
                top: TOP + if facet.is_empty() { 0.0 } else { FACET },
                width: WIDTH - left - right,
                height: HEIGHT,
            },
            heading: shortened(heading, 30),
            facet: shortened(facet, 48),
            beside,
        }
    }

    /// The figure, with its frame, what is in it, and its names.
    fn figure(
        &self,
        about: About,
        frame: &Frame<'_>,
        marks: Markup,
        names: Vec<CurveName>,
    ) -> Figure {
        let markers = about.has_markers;
        let bottom = self.area.y(0.0) + BELOW;
        let (names, height) = match (names.is_empty(), self.beside) {
            (true, _) => (html! {}, 0.0),
            (false, true) => {
                let right = WIDTH - 8.0;
                let heading = &self.heading;
                (
                    names_beside(names, &self.area, heading, right, markers),
                    0.0,
                )
            }
            (false, false) => {
                let at = (8.0, bottom + 6.0);
                names_below(names, &self.heading, at, WIDTH - 16.0, markers)
            }
        };
        Figure {
            file: format!("{}.svg", slug(&about.file)),
            title: about.title,
            description: about.description,
            width: WIDTH,
            height: bottom + height,
            body: html! {
                @if !self.facet.is_empty() {
                    text class="facet" x="8" y="18" { (self.facet) }
                }
                (frame.draw())
                (marks)
                (names)
            },
            facet: self.facet.clone(),
            style: "",
        }
    }
}

/// What a figure is called.
struct About {
    /// Its file, without an ending, in any letters.
    file: String,
    title: String,
    description: String,
    /// Its curves have markers.
    has_markers: bool,
}

/// What is added to a title or a file's name, to tell a facet's from the others.
fn within(facet: &str) -> String {
    match facet {
        "" => String::new(),
        facet => format!(", {facet}"),
    }
}

/// What is added to a description of curves that have names.
fn for_each(heading: &str) -> String {
    match heading {
        "" => String::new(),
        heading => format!(", a curve for each {heading}"),
    }
}

/// A band between two lines; of many, its rims.
fn band(series: usize, crowded: bool, upper: &[(f64, f64)], lower: &[(f64, f64)]) -> Markup {
    let around = upper.iter().chain(lower.iter().rev()).copied();
    html! {
        path class={ "band s" (series) @if crowded { " faint" } } d=(path(around)) {}
        @if crowded {
            @for rim in [upper, lower] {
                path class={ "rim s" (series) } d=(path(rim.iter().copied())) {}
            }
        }
    }
}
