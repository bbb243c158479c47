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
use farside_actors::figure::svg::{Area, Figure};

/// The width of a figure that stands beside others; on a phone it fills the page.
pub(super) const WIDTH: f64 = 480.0;
/// The room above a plot, for what its axes measure.
pub(super) const TOP: f64 = 46.0;
/// The room below, for ticks and the axis' label.
pub(super) const BELOW: f64 = 52.0;
/// The height of curves.
pub(super) const HEIGHT: f64 = 238.0;

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

/// What marks on curves mean that are not of our runs.
fn beside(study: &Study<'_>, measure: &Measure<'_>) -> Option<String> {
    let name = &measure.metric.name;
    let of_cells = study.summary.cells.iter().flat_map(|cell| &cell.published);
    let crosses = of_cells
        .filter(|one| one.metric == *name)
        .any(|one| matches!(one.published, Claim::Value(_) | Claim::About(_)));
    let fitted = study.summary.lines.iter().any(|line| line.metric == *name);
    let crosses = crosses.then_some("Crosses are published figures.");
    let fitted = fitted.then_some("Dotted lines are straight ones, fitted by least squares.");
    let notes: Vec<&str> = crosses.into_iter().chain(fitted).collect();
    (!notes.is_empty()).then(|| notes.join(" "))
}

pub(super) use losses::figure as losses;

/// The area of a plot with so much room left and right of it.
fn area(left: f64, right: f64) -> Area {
    Area {
        left,
        top: TOP,
        width: WIDTH - left - right,
        height: HEIGHT,
    }
}
