//! Estimates over a factor: curves with bands over numbers, points with whiskers over words.

use maud::{Markup, html};

use super::{About, CROWDED, Sheet, band, for_each, within};
use crate::report::layout::{Axis, Curves, Panel};
use crate::report::measure::{Measure, Study};
use crate::report::numbers::Style;
use crate::report::page::published::claim;
use crate::stats::Estimate;
use crate::study::results::{self, Claim};
use farside_actors::figure::colours::DASHES;
use farside_actors::figure::scale::{Scale, Spacing, Tick};
use farside_actors::figure::svg::{
    Area, CurveName, Figure, Frame, marker, measured_ticks, path, shortened, widest,
};

/// How many pieces a fitted line has.
const FITTED_STEPS: u32 = 24;

/// What is plotted of each cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shown {
    /// The estimate.
    Estimate,
    /// How much more it is than in the baseline.
    Difference,
}

/// What all figures of one kind of one metric share.
struct Plot<'a> {
    study: &'a Study<'a>,
    measure: &'a Measure<'a>,
    shown: Shown,
    y: Scale,
}

/// A cell's figure, where it goes; not a number if the cell has none.
struct Point {
    x: f64,
    estimate: Estimate,
    /// It is of all runs that came to their end.
    is_whole: bool,
    says: String,
}

/// One figure for each panel, all with the same vertical axis. None if no cell has any figure, as
/// if there is no baseline.
pub(super) fn all(
    study: &Study<'_>,
    measure: &Measure<'_>,
    curves: &Curves,
    shown: Shown,
) -> Vec<Figure> {
    let series = curves.panels.iter().flat_map(|panel| &panel.series);
    let cells = series.flat_map(|series| series.cells.iter().copied());
    let Some(plot) = Plot::new(study, measure, shown, cells) else {
        return Vec::new();
    };
    let panels = curves.panels.iter();
    panels.map(|panel| plot.figure(curves, panel)).collect()
}

/// For cells that lie anywhere: one figure for each factor, with a point for each cell.
pub(super) fn scattered(study: &Study<'_>, measure: &Measure<'_>) -> Vec<Figure> {
    let cells = 0..study.summary.cells.len();
    let Some(plot) = Plot::new(study, measure, Shown::Estimate, cells) else {
        return Vec::new();
    };
    let axes = study.layout.axes.iter().enumerate();
    axes.map(|(along, axis)| plot.scatter(along, axis))
        .collect()
}

impl<'a> Plot<'a> {
    /// With an axis that holds the intervals of the cells.
    fn new(
        study: &'a Study<'a>,
        measure: &'a Measure<'a>,
        shown: Shown,
        cells: impl Iterator<Item = usize>,
    ) -> Option<Self> {
        let y = Scale::between(0.0, 100.0);
        let mut plot = Plot {
            study,
            measure,
            shown,
            y,
        };
        let estimates: Vec<Estimate> = cells.filter_map(|cell| plot.of_cell(cell)).collect();
        if estimates.is_empty() {
            return None;
        }
        if shown == Shown::Difference || measure.style == Style::Plain {
            let ends = estimates
                .iter()
                .flat_map(|one| [one.value, one.low, one.high]);
            let others: Vec<f64> = plot.published_values().collect();
            let ends = ends.chain(others);
            let zero = (shown == Shown::Difference).then_some(0.0);
            let scaled = ends.map(|end| measure.style.scaled(end)).chain(zero);
            plot.y = Scale::measured(scaled);
        }
        Some(plot)
    }

    fn of_cell(&self, cell: usize) -> Option<Estimate> {
        let summary = self.study.summary.cells.get(cell)?;
        match self.shown {
            Shown::Estimate => self.measure.estimate(summary),
            Shown::Difference => self.measure.difference(summary),
        }
    }

    fn point(&self, cell: usize, x: f64) -> Point {
        let found = self.of_cell(cell).zip(self.study.summary.cells.get(cell));
        let Some((estimate, summary)) = found else {
            return Point {
                x,
                estimate: Estimate::unknown(f64::NAN),
                is_whole: true,
                says: String::new(),
            };
        };
        let says = match self.shown {
            Shown::Estimate => self.measure.tooltip(self.study, summary, &estimate),
            Shown::Difference => {
                let style = self.measure.style.of_differences();
                let (value, interval) = (style.signed(&estimate), style.interval(&estimate));
                format!("{}: {value} ({interval})", self.study.cell_name(cell))
            }
        };
        Point {
            x,
            estimate,
            is_whole: !self.measure.is_partial(summary),
            says,
        }
    }

    /// What others published of the cells, in the metric's own unit; nothing beside differences.
    fn published_values(&self) -> impl Iterator<Item = f64> {
        let cells = self.study.summary.cells.iter();
        let cells = cells.map(|cell| self.published(cell.cell).into_iter());
        cells.flatten().map(|(value, _)| value)
    }

    /// What others published of a cell, and how they say it.
    fn published(&self, cell: usize) -> Vec<(f64, String)> {
        let manifest = &self.study.results.manifest;
        let summary = self.study.summary.cells.get(cell);
        let all = summary.map_or(&[][..], |summary| &summary.published);
        let of_metric = all
            .iter()
            .filter(|one| one.metric == self.measure.metric.name);
        let points = of_metric.filter_map(|one| match one.published {
            Claim::Value(value) | Claim::About(value) if self.shown == Shown::Estimate => {
                let table = manifest.published.get(one.table)?;
                let said = claim(&one.published, &one.unit);
                let name = self.study.cell_name(cell);
                Some((value / table.scale, format!("{name}: published {said}")))
            }
            _ => None,
        });
        points.collect()
    }

    /// The line through some cells that others call linear, from the first to the last of them.
    fn fitted(
        &self,
        area: &Area,
        axis: &Axis,
        x: &Along,
        cells: &[usize],
        series: usize,
    ) -> Markup {
        let manifest = &self.study.results.manifest;
        let lines = self.study.summary.lines.iter();
        let of_metric = lines.filter(|line| {
            let factor = manifest.factors.get(axis.factor);
            line.metric == self.measure.metric.name
                && factor.is_some_and(|factor| factor.name == line.factor)
                && line.cells.iter().all(|cell| cells.contains(cell))
        });
        let shown = of_metric.filter(|_| self.shown == Shown::Estimate);
        html! {
            @for line in shown {
                @let scale = manifest.published.get(line.table).map_or(1.0, |table| table.scale);
                @let values = line.cells.iter().filter_map(|cell| {
                    manifest.cells.get(*cell)?.values.get(axis.factor)?.as_f64()
                });
                @let values: Vec<f64> = values.collect();
                @let low = values.iter().copied().fold(f64::INFINITY, f64::min);
                @let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                // On a logarithmic axis a line is bent.
                @let points = (0..=FITTED_STEPS).map(|step| {
                    let value = low + (high - low) * f64::from(step) / f64::from(FITTED_STEPS);
                    (area.x(x.place_of(value)), self.at(area, line.line().at(value) / scale))
                });
                path class={ "fitted s" (series) } d=(path(points)) {
                    title { "least squares, R² " (format!("{:.3}", line.r_squared)) }
                }
            }
        }
    }

    /// Crosses where others published figures.
    fn crosses(&self, area: &Area, cell: usize, at: f64, series: usize) -> Markup {
        const ARM: f64 = 4.5;
        html! {
            @for (value, says) in self.published(cell) {
                @let (x, y) = (at, self.at(area, value));
                path class={ "cross s" (series) } d={
                    (path([(x - ARM, y - ARM), (x + ARM, y + ARM)]))
                    (path([(x - ARM, y + ARM), (x + ARM, y - ARM)]))
                } { title { (says) } }
            }
        }
    }

    /// The y of a value in an area.
    fn at(&self, area: &Area, value: f64) -> f64 {
        area.y(self.y.place(self.measure.style.scaled(value)))
    }

    fn y_ticks(&self) -> Vec<Tick> {
        let percent = self.measure.style == Style::Percent && self.shown == Shown::Estimate;
        measured_ticks(&self.y, percent)
    }

    fn left_room(&self) -> f64 {
        16.0 + widest(self.y_ticks().iter().map(|tick| tick.text.as_str()))
    }

    fn scatter(&self, along: usize, axis: &Axis) -> Figure {
        let x = x_axis(axis);
        let places = self.study.layout.places.iter().enumerate();
        let points: Vec<Point> = places
            .map(|(cell, place)| self.point(cell, x.place(axis, place[along])))
            .collect();
        let sheet = Sheet::new(self.left_room(), 24.0, &[], "", "");
        let area = &sheet.area;
        let marks = html! {
            @for point in &points { (self.whisker(area, point, 0, 0.0)) }
        };
        let (metric, name) = (&self.measure.metric.label, axis.name());
        let about = About {
            file: format!("{}-over-{name}", self.measure.metric.name),
            title: format!("{metric} over {name}"),
            description: format!(
                "The {} of {metric} in each cell, with its 95 % interval, over {name}.",
                self.measure.what()
            ),
            has_markers: true,
        };
        sheet.figure(about, &self.frame(area, axis, &x), marks, Vec::new())
    }

    fn figure(&self, curves: &Curves, panel: &Panel) -> Figure {
        let axes = &self.study.layout.axes;
        let axis = &axes[curves.x];
        let x = x_axis(axis);
        let heading = curves.series.map_or("", |series| axes[series].name());
        let series = panel.series.iter();
        let names: Vec<String> = series.map(|one| shortened(&one.name, 30)).collect();
        let alone = curves.series.is_none();
        let texts = axis.levels.iter().map(|level| level.text.as_str());
        let right = (widest(texts) / 2.0).clamp(16.0, 48.0);
        let named = if alone { &[][..] } else { &names };
        let sheet = Sheet::new(self.left_room(), right, named, heading, &panel.name);
        let area = &sheet.area;
        let mut marks = Vec::new();
        let mut labels = Vec::new();
        let crowded = panel.series.len() >= CROWDED;
        let apart = self.apart(area, axis, &x, panel.series.len());
        for (index, series) in panel.series.iter().enumerate() {
            let level = |cell: usize| self.study.layout.places[cell][curves.x];
            let cells = series.cells.iter().copied();
            let points = cells.map(|cell| self.point(cell, x.place(axis, level(cell))));
            let points: Vec<Point> = points.collect();
            let last = points
                .iter()
                .rfind(|point| point.estimate.value.is_finite());
            labels.extend(last.map(|point| CurveName {
                series: index,
                y: self.at(area, point.estimate.value),
                rank: index as f64,
                text: names[index].clone(),
            }));
            let aside = apart * (index as f64 - (panel.series.len() - 1) as f64 / 2.0);
            let moved = if axis.numeric && !crowded { 0.0 } else { aside };
            marks.push(match axis.numeric {
                true => html! {
                    (self.fitted(area, axis, &x, &series.cells, index))
                    (self.curve(area, &points, index, crowded.then_some(moved)))
                },
                false => {
                    html! { @for point in &points { (self.whisker(area, point, index, moved)) } }
                }
            });
            let pairs = series.cells.iter().zip(&points);
            marks
                .extend(pairs.map(|(cell, point)| {
                    self.crosses(area, *cell, area.x(point.x) + moved, index)
                }));
        }
        let marks = html! {
            @if self.shown == Shown::Difference {
                @let zero = self.at(area, 0.0);
                path class="axis" d=(path([(area.left, zero), (area.x(1.0), zero)])) {}
            }
            @for mark in &marks { (mark) }
        };
        let about = self.about(axis, &panel.name, if alone { "" } else { heading });
        let labels = if alone { Vec::new() } else { labels };
        sheet.figure(about, &self.frame(area, axis, &x), marks, labels)
    }

    /// How far intervals of different curves at one level are drawn apart, in pixels: so far that
    /// those of one level stay together.
    fn apart(&self, area: &Area, axis: &Axis, x: &Along, curves: usize) -> f64 {
        let places = (0..axis.levels.len()).map(|level| area.x(x.place(axis, level)));
        let places: Vec<f64> = places.collect();
        let gaps = places.windows(2).map(|pair| pair[1] - pair[0]);
        let least = gaps.fold(f64::INFINITY, f64::min);
        let most = if axis.numeric { 4.0 } else { 11.0 };
        (0.7 * least / curves as f64).clamp(1.5, most)
    }

    fn about(&self, axis: &Axis, panel: &str, heading: &str) -> About {
        let (name, label) = (&self.measure.metric.name, &self.measure.metric.label);
        let (file, what, title) = match self.shown {
            Shown::Estimate => ("curves", self.measure.what(), label.clone()),
            Shown::Difference => (
                "differences",
                "paired difference",
                format!("{label}, difference"),
            ),
        };
        let (within, each, over) = (within(panel), for_each(heading), axis.name());
        About {
            file: format!("{name}-{file}{within}"),
            title: format!("{title}{within}"),
            description: format!(
                "The {what} of {label} over {over}{each}{within}, with 95 % intervals."
            ),
            has_markers: true,
        }
    }

    fn frame<'b>(&self, area: &Area, axis: &'b Axis, x: &Along) -> Frame<'b> {
        let longest = match axis.numeric {
            true => 12,
            false => (area.width / 9.0) as usize / axis.levels.len(),
        };
        let x_ticks = axis.levels.iter().enumerate().map(|(level, about)| Tick {
            at: x.place(axis, level),
            text: shortened(&about.text, longest.max(4)),
        });
        Frame {
            area: *area,
            x_label: &axis.label,
            x_ticks: x_ticks.collect(),
            y_label: match self.shown {
                Shown::Estimate => self.measure.axis_label(&self.y),
                Shown::Difference if self.measure.style == Style::Percent => {
                    "difference to the baseline (percentage points)".to_owned()
                }
                Shown::Difference => "difference to the baseline, same seeds".to_owned(),
            },
            y_ticks: self.y_ticks(),
        }
    }

    /// A line through the estimates and a band over their intervals; both break where a cell has
    /// none. With `moved`, so far aside, the intervals are whiskers.
    fn curve(&self, area: &Area, points: &[Point], series: usize, moved: Option<f64>) -> Markup {
        let aside = moved.unwrap_or(0.0);
        let at = |point: &Point, value: f64| (area.x(point.x) + aside, self.at(area, value));
        html! {
            @for part in points.split(|point| !point.estimate.value.is_finite()) {
                @let known: Vec<&Point> = part
                    .iter()
                    .filter(|point| point.estimate.low.is_finite())
                    .collect();
                @let ends = |end: &dyn Fn(&Estimate) -> f64| -> Vec<(f64, f64)> {
                    known.iter().map(|point| at(point, end(&point.estimate))).collect()
                };
                @if known.len() > 1 && moved.is_none() {
                    (band(series, false, &ends(&|one| one.high), &ends(&|one| one.low)))
                }
                @let line = part.iter().map(|point| at(point, point.estimate.value));
                path class={ "line s" (series) } stroke-dasharray=(DASHES[series]) d=(path(line)) {}
            }
            @for point in points.iter().filter(|point| point.estimate.value.is_finite()) {
                @if moved.is_some() { (self.interval(area, point, series, aside)) }
                (marker(series, at(point, point.estimate.value), point.is_whole, &point.says))
            }
        }
    }

    /// A point with its interval, moved aside by some pixels.
    fn whisker(&self, area: &Area, point: &Point, series: usize, aside: f64) -> Markup {
        let value = point.estimate.value;
        let at = (area.x(point.x) + aside, self.at(area, value));
        html! {
            @if value.is_finite() {
                (self.interval(area, point, series, aside))
                (marker(series, at, point.is_whole, &point.says))
            }
        }
    }

    /// The interval of a point, if it is known.
    fn interval(&self, area: &Area, point: &Point, series: usize, aside: f64) -> Markup {
        const CAP: f64 = 2.5;
        let Estimate { low, high, .. } = point.estimate;
        let x = area.x(point.x) + aside;
        let [low_y, high_y] = [low, high].map(|end| self.at(area, end));
        html! {
            @if low.is_finite() {
                path class={ "whisker s" (series) } d={
                    (path([(x, low_y), (x, high_y)]))
                    (path([(x - CAP, low_y), (x + CAP, low_y)]))
                    (path([(x - CAP, high_y), (x + CAP, high_y)]))
                } {}
            }
        }
    }
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
        self.place_of(axis.levels[level].value)
    }

    fn place_of(&self, value: f64) -> f64 {
        // A little room, so that markers at the ends do not lie on the axis.
        0.03 + 0.94 * self.scale.place(value)
    }
}
