//! Curves over an index: the mean of each cell with its band, and how it differs from the
//! baseline's.

use maud::{Markup, html};

use super::steps::panels;
use super::{BELOW, HEIGHT, Plots, TOP, WIDTH, area};
use crate::report::layout::{Panel, Series};
use crate::report::measure::{Measure, Study};
use crate::stats::Estimate;
use farside_actors::figure::colours::DASHES;
use farside_actors::figure::scale::{Scale, Spacing};
use farside_actors::figure::svg::{
    Area, EndLabel, Figure, Frame, Px, end_label_room, end_labels, marker, measured_ticks, path,
    shortened, slug, widest,
};

/// With at most so many indices, each has a marker to point at.
const MARKED: usize = 16;

const NOTE: &str = "Bands are 95 % intervals for each index alone.";

const FROM: &str = "A large marker is where a difference begins to hold up to the last index, with \
                    all indices of the curve taken together (Holm).";

/// What is plotted of each cell.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Shown {
    Mean,
    Difference,
}

/// A cell's curve.
struct Curve {
    name: String,
    /// Its colour: that of the cell, in both figures of a panel.
    series: usize,
    points: Vec<(f64, Estimate)>,
    /// The index from which on a difference holds, and what is said of it.
    from: Option<(f64, String)>,
}

/// What all figures of a kind share.
struct Plot<'a> {
    measure: &'a Measure<'a>,
    shown: Shown,
    heading: String,
    x: Scale,
    y: Scale,
}

/// The figures of a metric that is a curve: means, and if there is a baseline differences.
pub(super) fn curves(study: &Study<'_>, measure: &Measure<'_>, plots: &mut Plots) {
    let (series, panels) = panels(study);
    let heading = series.map_or("", |axis| study.layout.axes[axis].name());
    plots.notes.push(NOTE.to_owned());
    for shown in [Shown::Mean, Shown::Difference] {
        let drawn = panels.iter().map(|panel| {
            let curves = panel.series.iter().enumerate();
            let curves = curves.filter_map(|(at, one)| curve(study, measure, shown, at, one));
            (panel, curves.collect::<Vec<Curve>>())
        });
        let drawn: Vec<(&Panel, Vec<Curve>)> =
            drawn.filter(|(_, curves)| !curves.is_empty()).collect();
        let all = || drawn.iter().flat_map(|(_, curves)| curves);
        let points = || all().flat_map(|curve| &curve.points);
        let ends = points().flat_map(|(_, one)| [one.value, one.low, one.high]);
        let zero = (shown == Shown::Difference).then_some(0.0);
        let plot = Plot {
            measure,
            shown,
            heading: shortened(heading, 22),
            x: Scale::over(points().map(|(index, _)| *index), Spacing::Linear),
            y: Scale::measured(ends.chain(zero)),
        };
        if all().any(|curve| curve.from.is_some()) {
            plots.notes.push(FROM.to_owned());
        }
        let figures = drawn
            .iter()
            .map(|(panel, curves)| plot.figure(panel, curves));
        plots.figures.extend(figures);
    }
    let shown: usize = panels.iter().map(|panel| panel.series.len()).sum();
    if shown < study.summary.cells.len() {
        let note = "There are more cells than are plotted here; an even choice is shown.";
        plots.notes.push(note.to_owned());
    }
}

fn curve(
    study: &Study<'_>,
    measure: &Measure<'_>,
    shown: Shown,
    series: usize,
    of: &Series,
) -> Option<Curve> {
    let cell = *of.cells.first()?;
    let summary = measure.series(study.summary.cells.get(cell)?)?;
    let (points, from) = match shown {
        Shown::Mean => {
            let points = summary.points.iter();
            (
                points.map(|one| (one.index, one.estimate())).collect(),
                None,
            )
        }
        Shown::Difference => {
            let difference = summary.difference.as_ref()?;
            // An index without pairs is a gap in the line, as one without values is.
            let points = summary.points.iter().map(|at| {
                let mut points = difference.points.iter();
                let found = points.find(|one| one.index == at.index);
                let unknown = Estimate::unknown(f64::NAN);
                let estimate = found.map_or(unknown, |one| one.difference.estimate());
                (at.index, estimate)
            });
            let from = difference.holds_from.map(|from| {
                let (cell, from_told) = (study.cell_name(cell), measure.index_told(from));
                (from, format!("{cell}: holds from {from_told} on"))
            });
            (points.collect(), from)
        }
    };
    Some(Curve {
        name: shortened(&of.name, 18),
        series: series % DASHES.len(),
        points,
        from,
    })
}

impl Plot<'_> {
    fn figure(&self, panel: &Panel, curves: &[Curve]) -> Figure {
        let y_ticks = measured_ticks(&self.y, false);
        let left = 16.0 + widest(y_ticks.iter().map(|tick| tick.text.as_str()));
        let names = || curves.iter().map(|curve| curve.name.as_str());
        let is_alone = names().all(str::is_empty);
        let right = if is_alone {
            28.0
        } else {
            end_label_room(names(), &self.heading)
        };
        let area = area(left, right);
        let labels = curves.iter().map(|curve| {
            let known = curve.points.iter().rfind(|(_, one)| one.value.is_finite());
            EndLabel {
                series: curve.series,
                y: self.at(&area, known.map_or(0.0, |(_, one)| one.value)),
                text: curve.name.clone(),
            }
        });
        let labels: Vec<EndLabel> = labels.collect();
        let index_label = self.measure.index_label();
        let few = curves.iter().all(|curve| curve.points.len() <= MARKED);
        let frame = Frame {
            area,
            x_label: &index_label,
            x_ticks: self.x.ticks(5.0),
            y_label: match self.shown {
                Shown::Mean => self.measure.axis_label(),
                Shown::Difference => "difference to the baseline, same seeds".to_owned(),
            },
            y_ticks,
        };
        let body = html! {
            (frame.draw())
            @if self.shown == Shown::Difference {
                @let zero = self.at(&area, 0.0);
                path class="axis" d=(path([(area.left, zero), (area.x(1.0), zero)])) {}
            }
            @for curve in curves { (self.band(&area, curve)) }
            @for curve in curves { (self.line(&area, curve, few)) }
            @if !is_alone { (end_labels(labels, &area, &self.heading, few)) }
        };
        self.named(panel, body)
    }

    fn named(&self, panel: &Panel, body: Markup) -> Figure {
        let (name, label) = (&self.measure.metric.name, &self.measure.metric.label);
        let over = self.measure.index_label();
        let (file, what, title) = match self.shown {
            Shown::Mean => ("series", "mean", label.clone()),
            Shown::Difference => (
                "series-differences",
                "paired difference to the baseline",
                format!("{label}, difference"),
            ),
        };
        let within = match panel.name.as_str() {
            "" => String::new(),
            panel => format!(", {panel}"),
        };
        let each = match self.heading.as_str() {
            "" => String::new(),
            heading => format!(", a curve for each {heading}"),
        };
        Figure {
            file: format!("{}.svg", slug(&format!("{name}-{file}{within}"))),
            title: format!("{title} over {over}{within}"),
            description: format!("The {what} of {label} over {over}{each}, with 95 % intervals."),
            width: WIDTH,
            height: TOP + HEIGHT + BELOW,
            body,
        }
    }

    /// The y of a value in an area.
    fn at(&self, area: &Area, value: f64) -> f64 {
        area.y(self.y.place(value))
    }

    /// The intervals; they break where there are none.
    fn band(&self, area: &Area, curve: &Curve) -> Markup {
        let at = |index: f64, value: f64| (area.x(self.x.place(index)), self.at(area, value));
        html! {
            @for part in curve.points.split(|(_, one)| !one.is_known()) {
                @let upper = part.iter().map(|(index, one)| at(*index, one.high));
                @let lower = part.iter().rev().map(|(index, one)| at(*index, one.low));
                @if part.len() > 1 {
                    path class={ "band s" (curve.series) } d=(path(upper.chain(lower))) {}
                }
            }
        }
    }

    /// The line through the figures, which breaks where there is none.
    fn line(&self, area: &Area, curve: &Curve, marked: bool) -> Markup {
        let at = |index: f64, value: f64| (area.x(self.x.place(index)), self.at(area, value));
        let style = self.measure.style;
        html! {
            @for part in curve.points.split(|(_, one)| !one.value.is_finite()) {
                @if let [(index, one)] = part {
                    @if !marked {
                        @let (x, y) = at(*index, one.value);
                        (marker(curve.series, x, y, &curve.name))
                    }
                } @else if !part.is_empty() {
                    @let line = part.iter().map(|(index, one)| at(*index, one.value));
                    path class={ "line s" (curve.series) } d=(path(line))
                        stroke-dasharray=(DASHES[curve.series]) {}
                }
            }
            @if marked {
                @for (index, one) in curve.points.iter().filter(|(_, one)| one.value.is_finite()) {
                    @let (x, y) = at(*index, one.value);
                    @let told = self.measure.told(one);
                    @let index_told = self.measure.index_told(*index);
                    @let says = format!("{} {index_told}: {told}", curve.name);
                    (marker(curve.series, x, y, says.trim_start()))
                }
            }
            @if let Some((from, says)) = &curve.from {
                @let point = curve.points.iter().find(|(index, _)| index == from);
                @if let Some((index, one)) = point {
                    @let (x, y) = at(*index, style.scaled(one.value));
                    circle class={ "from s" (curve.series) } cx=(Px(x)) cy=(Px(y)) r="7" {
                        title { (says) }
                    }
                }
            }
        }
    }
}
