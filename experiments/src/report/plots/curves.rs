//! Estimates over a factor: curves with bands over numbers, points with whiskers over words.

use maud::{Markup, html};

use super::{BELOW, HEIGHT, TOP, WIDTH, area};
use crate::report::colours::DASHES;
use crate::report::layout::{Axis, Curves, Panel};
use crate::report::measure::{Measure, Study};
use crate::report::numbers::Style;
use crate::report::scale::{Scale, Spacing, Tick};
use crate::report::svg::{
    Area, EndLabel, Figure, Frame, end_label_room, end_labels, marker, measured_ticks, path,
    shortened, slug, widest,
};
use crate::stats::Estimate;
use crate::study::results;

/// A cell's estimate, where it goes.
struct Point {
    x: f64,
    estimate: Estimate,
    says: String,
}

/// One figure for each panel, all with the same vertical axis.
pub(super) fn all(study: &Study<'_>, measure: &Measure<'_>, curves: &Curves) -> Vec<Figure> {
    let shown = curves.panels.iter().flat_map(|panel| &panel.series);
    let cells = shown.flat_map(|series| series.cells.iter().copied());
    let y = y_scale(study, measure, cells);
    let panels = curves.panels.iter();
    panels
        .map(|panel| figure(study, measure, curves, panel, &y))
        .collect()
}

/// For cells that lie anywhere: one figure for each factor, with a point for each cell.
pub(super) fn scattered(study: &Study<'_>, measure: &Measure<'_>) -> Vec<Figure> {
    let y = y_scale(study, measure, 0..study.summary.cells.len());
    let axes = study.layout.axes.iter().enumerate();
    let figure = |(along, axis): (usize, &Axis)| {
        let x = x_axis(axis);
        let cells = study
            .layout
            .places
            .iter()
            .map(|place| place[along])
            .enumerate();
        let points: Vec<Point> = cells
            .filter_map(|(cell, level)| point(study, measure, cell, x.place(axis, level)))
            .collect();
        let left = left_room(measure, &y);
        let area = area(left, 16.0);
        let body = html! {
            (frame(measure, &area, axis, &x, &y).draw())
            @for point in &points {
                (whisker(measure, &area, &y, point, 0, 0.0))
            }
        };
        let (metric, name) = (&measure.metric.label, axis.name());
        Figure {
            file: format!(
                "{}.svg",
                slug(&format!("{}-over-{name}", measure.metric.name))
            ),
            title: format!("{metric} over {name}"),
            description: format!(
                "The {} of {metric} in each cell, with its 95 % interval, over {name}.",
                measure.what()
            ),
            width: WIDTH,
            height: TOP + HEIGHT + BELOW,
            body,
        }
    };
    axes.map(figure).collect()
}

fn figure(
    study: &Study<'_>,
    measure: &Measure<'_>,
    curves: &Curves,
    panel: &Panel,
    y: &Scale,
) -> Figure {
    let axis = &study.layout.axes[curves.x];
    let x = x_axis(axis);
    let heading = curves
        .series
        .map_or("", |series| study.layout.axes[series].name());
    let heading = shortened(heading, 22);
    let names: Vec<String> = panel
        .series
        .iter()
        .map(|series| shortened(&series.name, 18))
        .collect();
    let alone = curves.series.is_none();
    let right = if alone {
        let texts = axis.levels.iter().map(|level| level.text.as_str());
        (widest(texts) / 2.0).clamp(16.0, 48.0)
    } else {
        end_label_room(names.iter().map(String::as_str), &heading)
    };
    let area = area(left_room(measure, y), right);
    let mut marks = Vec::new();
    let mut labels = Vec::new();
    for (index, series) in panel.series.iter().enumerate() {
        let points = series.cells.iter().filter_map(|cell| {
            let level = study.layout.places[*cell][curves.x];
            point(study, measure, *cell, x.place(axis, level))
        });
        let points: Vec<Point> = points.collect();
        if let Some(last) = points.last() {
            let y = area.y(y.place(measure.style.scaled(last.estimate.value)));
            labels.push(EndLabel {
                series: index,
                y,
                text: names[index].clone(),
            });
        }
        let aside = 11.0 * (index as f64 - (panel.series.len() - 1) as f64 / 2.0);
        marks.push(if axis.numeric {
            curve(measure, &area, y, &points, index)
        } else {
            html! { @for point in &points { (whisker(measure, &area, y, point, index, aside)) } }
        });
    }
    let body = html! {
        (frame(measure, &area, axis, &x, y).draw())
        @for mark in &marks { (mark) }
        @if !alone { (end_labels(labels, &area, &heading, true)) }
    };
    let metric = &measure.metric.label;
    let within = if panel.name.is_empty() {
        String::new()
    } else {
        format!(", {}", panel.name)
    };
    let each = if alone {
        String::new()
    } else {
        format!(", a curve for each {heading}")
    };
    Figure {
        file: format!(
            "{}.svg",
            slug(&format!("{}-curves{within}", measure.metric.name))
        ),
        title: format!("{metric} over {}{within}", axis.name()),
        description: format!(
            "The {} of {metric} over {}{each}, with 95 % intervals.",
            measure.what(),
            axis.name()
        ),
        width: WIDTH,
        height: TOP + HEIGHT + BELOW,
        body,
    }
}

fn point(study: &Study<'_>, measure: &Measure<'_>, cell: usize, x: f64) -> Option<Point> {
    let summary = study.summary.cells.get(cell)?;
    let estimate = measure.estimate(summary)?;
    let says = measure.tooltip(study, summary, &estimate);
    Some(Point { x, estimate, says })
}

/// An axis that holds the intervals of the cells.
fn y_scale(study: &Study<'_>, measure: &Measure<'_>, cells: impl Iterator<Item = usize>) -> Scale {
    if measure.style == Style::Percent {
        return Scale::between(0.0, 100.0);
    }
    let estimates = cells.filter_map(|cell| measure.estimate(study.summary.cells.get(cell)?));
    Scale::measured(estimates.flat_map(|estimate| [estimate.value, estimate.low, estimate.high]))
}

fn left_room(measure: &Measure<'_>, y: &Scale) -> f64 {
    let ticks = measured_ticks(y, measure.style == Style::Percent);
    16.0 + widest(ticks.iter().map(|tick| tick.text.as_str()))
}

/// A factor along x.
struct Along {
    scale: Scale,
}

fn x_axis(axis: &Axis) -> Along {
    let values = axis.levels.iter().map(|level| level.value);
    let spacing = match axis.scale {
        results::Scale::Log => Spacing::Log,
        results::Scale::Linear => Spacing::Linear,
    };
    Along {
        scale: if axis.numeric {
            Scale::over(values, spacing)
        } else {
            // Half a word's room at both ends.
            Scale::between(-0.5, axis.levels.len() as f64 - 0.5)
        },
    }
}

impl Along {
    fn place(&self, axis: &Axis, level: usize) -> f64 {
        // A little room, so that markers at the ends do not lie on the axis.
        0.03 + 0.94 * self.scale.place(axis.levels[level].value)
    }
}

fn frame<'a>(
    measure: &'a Measure<'_>,
    area: &Area,
    axis: &'a Axis,
    x: &Along,
    y: &Scale,
) -> Frame<'a> {
    let longest = if axis.numeric {
        12
    } else {
        (area.width / 9.0) as usize / axis.levels.len()
    };
    let x_ticks = axis.levels.iter().enumerate().map(|(level, about)| Tick {
        at: x.place(axis, level),
        text: shortened(&about.text, longest.max(4)),
    });
    Frame {
        area: *area,
        x_label: &axis.label,
        x_ticks: x_ticks.collect(),
        y_label: measure.axis_label(),
        y_ticks: measured_ticks(y, measure.style == Style::Percent),
    }
}

/// A line through the estimates and a band over their intervals; both break where a cell has none.
fn curve(measure: &Measure<'_>, area: &Area, y: &Scale, points: &[Point], series: usize) -> Markup {
    let at = |value: f64| area.y(y.place(measure.style.scaled(value)));
    let connected = points.split(|point| !point.estimate.value.is_finite());
    html! {
        @for part in connected {
            @let known: Vec<&Point> = part
                .iter()
                .filter(|point| point.estimate.low.is_finite())
                .collect();
            @let upper = known.iter().map(|point| (area.x(point.x), at(point.estimate.high)));
            @let lower = known.iter().rev().map(|point| (area.x(point.x), at(point.estimate.low)));
            path class={ "band s" (series) } d=(path(upper.chain(lower))) {}
        }
        @for part in points.split(|point| !point.estimate.value.is_finite()) {
            @let line = part.iter().map(|point| (area.x(point.x), at(point.estimate.value)));
            path class={ "line s" (series) } stroke-dasharray=(DASHES[series]) d=(path(line)) {}
            @for point in part {
                (marker(series, area.x(point.x), at(point.estimate.value), &point.says))
            }
        }
    }
}

/// A point with its interval, moved aside by some pixels.
fn whisker(
    measure: &Measure<'_>,
    area: &Area,
    y: &Scale,
    point: &Point,
    series: usize,
    aside: f64,
) -> Markup {
    let at = |value: f64| area.y(y.place(measure.style.scaled(value)));
    let x = area.x(point.x) + aside;
    html! {
        @if point.estimate.value.is_finite() {
            @if point.estimate.low.is_finite() {
                path class={ "line s" (series) }
                    d=(path([(x, at(point.estimate.low)), (x, at(point.estimate.high))])) {}
            }
            (marker(series, x, at(point.estimate.value), &point.says))
        }
    }
}
