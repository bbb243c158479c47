//! Curves over an index: the mean of each cell with its band, and how it differs from the
//! baseline's.

use maud::{Markup, html};

use super::steps::panels;
use super::{About, CROWDED, Plots, Sheet, band, for_each, within};
use crate::report::layout::{Panel, Series};
use crate::report::measure::{Measure, Study};
use crate::stats::Estimate;
use farside_actors::figure::colours::DASHES;
use farside_actors::figure::scale::{Scale, Spacing};
use farside_actors::figure::svg::{
    Area, CurveName, Figure, Frame, Px, marker, measured_ticks, path, shortened, widest,
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
            heading: heading.to_owned(),
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
        name: shortened(&of.name, 30),
        series: series % DASHES.len(),
        points,
        from,
    })
}

impl Plot<'_> {
    fn figure(&self, panel: &Panel, curves: &[Curve]) -> Figure {
        let y_ticks = measured_ticks(&self.y, false);
        let left = 16.0 + widest(y_ticks.iter().map(|tick| tick.text.as_str()));
        let names: Vec<String> = curves.iter().map(|curve| curve.name.clone()).collect();
        let is_alone = names.iter().all(String::is_empty);
        let named = if is_alone { &[][..] } else { &names };
        let sheet = Sheet::new(left, 28.0, named, &self.heading, &panel.name);
        let area = &sheet.area;
        let labels = curves.iter().enumerate().map(|(rank, curve)| {
            let known = curve.points.iter().rfind(|(_, one)| one.value.is_finite());
            CurveName {
                series: curve.series,
                y: self.at(area, known.map_or(0.0, |(_, one)| one.value)),
                rank: rank as f64,
                text: curve.name.clone(),
            }
        });
        let labels = labels.filter(|_| !is_alone).collect();
        let index_label = self.measure.index_label();
        let few = curves.iter().all(|curve| curve.points.len() <= MARKED);
        let frame = Frame {
            area: *area,
            x_label: &index_label,
            x_ticks: self.x.ticks(5.0),
            y_label: match self.shown {
                Shown::Mean => self.measure.axis_label(&self.y),
                Shown::Difference => "difference to the baseline, same seeds".to_owned(),
            },
            y_ticks,
        };
        let crowded = curves.len() >= CROWDED;
        let marks = html! {
            @if self.shown == Shown::Difference {
                @let zero = self.at(area, 0.0);
                path class="axis" d=(path([(area.left, zero), (area.x(1.0), zero)])) {}
            }
            @for curve in curves { (self.band(area, curve, crowded)) }
            @for curve in curves { (self.line(area, curve, few)) }
        };
        sheet.figure(self.about(panel, few), &frame, marks, labels)
    }

    fn about(&self, panel: &Panel, has_markers: bool) -> About {
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
        let (within, each) = (within(&panel.name), for_each(&self.heading));
        About {
            file: format!("{name}-{file}{within}"),
            title: format!("{title}{within}"),
            description: format!(
                "The {what} of {label} over {over}{each}{within}, with 95 % intervals."
            ),
            has_markers,
        }
    }

    /// The y of a value in an area.
    fn at(&self, area: &Area, value: f64) -> f64 {
        area.y(self.y.place(value))
    }

    /// The intervals; they break where there are none.
    fn band(&self, area: &Area, curve: &Curve, crowded: bool) -> Markup {
        let at = |index: f64, value: f64| (area.x(self.x.place(index)), self.at(area, value));
        html! {
            @for part in curve.points.split(|(_, one)| !one.is_known()) {
                @let ends = |end: &dyn Fn(&Estimate) -> f64| -> Vec<(f64, f64)> {
                    part.iter().map(|(index, one)| at(*index, end(one))).collect()
                };
                @if part.len() > 1 {
                    (band(curve.series, crowded, &ends(&|one| one.high), &ends(&|one| one.low)))
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
                        (marker(curve.series, at(*index, one.value), true, &curve.name))
                    }
                } @else if !part.is_empty() {
                    @let line = part.iter().map(|(index, one)| at(*index, one.value));
                    path class={ "line s" (curve.series) } d=(path(line))
                        stroke-dasharray=(DASHES[curve.series]) {}
                }
            }
            @if marked {
                @for (index, one) in curve.points.iter().filter(|(_, one)| one.value.is_finite()) {
                    @let told = self.measure.told(one);
                    @let index_told = self.measure.index_told(*index);
                    @let says = format!("{} {index_told}: {told}", curve.name);
                    (marker(curve.series, at(*index, one.value), true, says.trim_start()))
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
