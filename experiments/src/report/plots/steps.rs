//! Steps: survival curves of what happens some time, and distributions of what is measured.

use maud::{Markup, html};

use super::{About, CROWDED, Plots, Sheet, band, for_each, within};
use crate::report::layout::{PANELS, Panel, Series, spread};
use crate::report::measure::{Measure, Study};
use crate::stats::distribution::Ecdf;
use crate::stats::survival::kaplan_meier;
use crate::study::summary::values::observations;
use farside_actors::figure::colours::{DASHES, SERIES};
use farside_actors::figure::scale::Scale;
use farside_actors::figure::svg::{
    Area, CurveName, Figure, Frame, measured_ticks, path, shortened,
};

/// One cell's curve: from a first share on, at each x a new one with its interval.
struct Steps {
    name: String,
    first: f64,
    steps: Vec<Step>,
}

struct Step {
    x: f64,
    share: f64,
    low: f64,
    high: f64,
}

/// What the curves of all panels share.
struct CurveStyle {
    /// What the file's name ends with.
    file: &'static str,
    y_label: &'static str,
    title: &'static str,
    /// All that is listed happened: what is shown is its distribution.
    all_happened: bool,
}

impl CurveStyle {
    /// The horizontal axis of some curves.
    fn x<'a>(&self, curves: impl Iterator<Item = &'a Steps> + Clone) -> Scale {
        if self.all_happened {
            // A long tail would press all else to the left; it is cut where every curve is near 1.
            let past = |curve: &Steps, share: f64| {
                let step = curve.steps.iter().find(|step| step.share >= share);
                step.map(|step| step.x)
            };
            let ends = curves.clone().map(|curve| past(curve, 0.99).unwrap_or(0.0));
            let starts = curves.clone().filter_map(|curve| past(curve, 0.02));
            Scale::measured(ends.chain(starts))
        } else {
            let ends = curves.filter_map(|curve| curve.steps.last());
            Scale::measured(ends.map(|step| step.x).chain([0.0]))
        }
    }
}

/// If all curves of a plot end within this share of an axis that plots share, it has its own.
const SQUASHED: f64 = 0.5;

const OWN_AXES: &str = "Horizontal axes differ from plot to plot.";

const DISTRIBUTION: &str = "Distributions pool the lists of all runs of a cell. They are cut at the right, where at least \
     99 % of each cell is past.";

const SURVIVAL: &str = "Survival curves are those of Kaplan and Meier. What had not happened when a run's time was over \
     is censored there, as it might still have. In a run that ended otherwise, such as a team in a \
     deadlock, it never happens, and stays at risk to the end. Bands take whole runs as what varies \
     by chance.";

/// Survival curves, if anything listed had not happened when its run ended; the distribution if all
/// had.
pub(super) fn distributions(study: &Study<'_>, measure: &Measure<'_>, plots: &mut Plots) {
    let name = &measure.metric.name;
    let all_happened = study
        .results
        .manifest
        .cells
        .iter()
        .enumerate()
        .all(|(cell, _)| {
            observations(study.results, cell, name)
                .iter()
                .all(|one| one.happened)
        });
    let (series, panels) = panels(study);
    let curves: Vec<(&Panel, Vec<Steps>)> = panels
        .iter()
        .map(|panel| {
            let curve = |series: &Series| {
                let cell = series.cells.first().copied().unwrap_or(0);
                steps(study, name, cell, &series.name, all_happened)
            };
            (panel, panel.series.iter().map(curve).collect())
        })
        .collect();
    let all = || curves.iter().flat_map(|(_, curves)| curves);
    let kind = match all_happened {
        true => CurveStyle {
            file: "ecdf",
            y_label: "share of all values, at or below",
            title: "distribution",
            all_happened,
        },
        false => CurveStyle {
            file: "survival",
            y_label: "still outstanding",
            title: "survival",
            all_happened,
        },
    };
    let shared = kind.x(all());
    let own: Vec<Scale> = curves
        .iter()
        .map(|(_, curves)| kind.x(curves.iter()))
        .collect();
    let squashed = own.iter().any(|x| x.high() < SQUASHED * shared.high());
    if squashed {
        plots.notes.push(OWN_AXES.to_owned());
    }
    plots
        .notes
        .push(if all_happened { DISTRIBUTION } else { SURVIVAL }.to_owned());
    let shown: usize = curves.iter().map(|(_, curves)| curves.len()).sum();
    if shown < study.summary.cells.len() {
        let note = "There are more cells than are plotted here; an even choice is shown.";
        plots.notes.push(note.to_owned());
    }
    let figures = curves.iter().zip(&own).map(|((panel, curves), own)| {
        let x = if squashed { own } else { &shared };
        figure(study, measure, &kind, x, &panel.name, series, curves)
    });
    plots.figures.extend(figures);
}

/// Panels with one cell for each curve: those along the curves' factor are parted by the factor
/// along x, because here x is taken.
pub(super) fn panels(study: &Study<'_>) -> (Option<usize>, Vec<Panel>) {
    let one = |name: String, cell: usize| Series {
        name,
        cells: vec![cell],
    };
    let Some(curves) = study.layout.curves() else {
        let cells = spread(study.summary.cells.len(), SERIES);
        let name = |cell: usize| {
            if study.summary.cells.len() == 1 {
                String::new()
            } else {
                format!("cell {cell}")
            }
        };
        let series = cells
            .into_iter()
            .map(|cell| one(name(cell), cell))
            .collect();
        return (
            None,
            vec![Panel {
                name: String::new(),
                series,
            }],
        );
    };
    let axis = &study.layout.axes[curves.x];
    let text = |cell: usize| {
        axis.levels[study.layout.places[cell][curves.x]]
            .text
            .clone()
    };
    let Some(by) = curves.series else {
        let cells = curves.panels.iter().flat_map(|panel| &panel.series);
        let cells: Vec<usize> = cells
            .flat_map(|series| series.cells.iter().copied())
            .collect();
        let shown = spread(cells.len(), SERIES)
            .into_iter()
            .map(|index| cells[index]);
        let series = shown.map(|cell| one(text(cell), cell)).collect();
        return (
            Some(curves.x),
            vec![Panel {
                name: String::new(),
                series,
            }],
        );
    };
    let along = &study.layout.axes[by];
    let mut parted = Vec::new();
    for panel in &curves.panels {
        for index in spread(panel.series.len(), PANELS) {
            let series = &panel.series[index];
            let shown = spread(series.cells.len(), SERIES)
                .into_iter()
                .map(|at| series.cells[at]);
            let mut name = format!("{} {}", along.name(), series.name);
            if !panel.name.is_empty() {
                name = format!("{}, {name}", panel.name);
            }
            let series = shown.map(|cell| one(text(cell), cell)).collect();
            parted.push(Panel { name, series });
        }
    }
    let chosen = spread(parted.len(), PANELS)
        .into_iter()
        .map(|index| parted[index].clone());
    (Some(curves.x), chosen.collect())
}

fn steps(study: &Study<'_>, metric: &str, cell: usize, name: &str, all_happened: bool) -> Steps {
    let observations = observations(study.results, cell, metric);
    let steps = if all_happened {
        let times: Vec<f64> = observations.iter().map(|one| one.time).collect();
        let steps = Ecdf::new(&times);
        let step = |(x, share)| Step {
            x,
            share,
            low: share,
            high: share,
        };
        steps.steps().map(step).collect()
    } else {
        let survival = kaplan_meier(&observations);
        let steps = survival.steps.iter().map(|step| Step {
            x: step.time,
            share: step.remaining.value,
            low: step.remaining.low,
            high: step.remaining.high,
        });
        steps.collect()
    };
    Steps {
        name: name.to_owned(),
        first: if all_happened { 0.0 } else { 1.0 },
        steps,
    }
}

fn figure(
    study: &Study<'_>,
    measure: &Measure<'_>,
    kind: &CurveStyle,
    x: &Scale,
    panel: &str,
    series: Option<usize>,
    curves: &[Steps],
) -> Figure {
    let heading = series.map_or("", |axis| study.layout.axes[axis].name());
    let alone = curves.len() == 1 && curves[0].name.is_empty();
    let names: Vec<String> = curves
        .iter()
        .map(|curve| shortened(&curve.name, 30))
        .collect();
    let named = if alone { &[][..] } else { &names };
    let sheet = Sheet::new(58.0, 28.0, named, heading, panel);
    let area = &sheet.area;
    let y = Scale::between(0.0, 100.0);
    let labels = curves.iter().zip(&names).enumerate();
    let labels = labels.map(|(index, (curve, name))| {
        let shown = curve.steps.iter().rfind(|step| step.x <= x.high());
        let share = shown.map_or(curve.first, |step| step.share);
        // The curve that lies above the others: of survival the latest, of distributions the
        // earliest.
        let half = curve.steps.iter().find(|step| match kind.all_happened {
            true => step.share >= 0.5,
            false => step.share <= 0.5,
        });
        let half = half.map_or(f64::INFINITY, |step| step.x);
        CurveName {
            series: index,
            y: area.y(share),
            rank: if kind.all_happened { half } else { -half },
            text: name.clone(),
        }
    });
    let labels = labels.filter(|_| !alone).collect();
    let mut x_label = match measure.metric.unit.as_str() {
        "" => measure.metric.label.clone(),
        unit => format!("{} ({unit})", measure.metric.label),
    };
    if x.is_log() {
        x_label.push_str(", log scale");
    }
    let frame = Frame {
        area: *area,
        x_label: &x_label,
        x_ticks: x.ticks(4.0),
        y_label: kind.y_label.to_owned(),
        y_ticks: measured_ticks(&y, true),
    };
    let crowded = curves.len() >= CROWDED;
    let marks = html! {
        @for (index, curve) in curves.iter().enumerate() {
            (drawn(area, x, curve, index, crowded))
        }
    };
    let (metric, title) = (&measure.metric.label, kind.title);
    let (within, each) = (within(panel), for_each(if alone { "" } else { heading }));
    let about = About {
        file: format!("{}-{}{within}", measure.metric.name, kind.file),
        title: format!("{metric}, {title}{within}"),
        description: format!("The {title} of {metric}{each}{within}: {}.", kind.y_label),
        has_markers: false,
    };
    sheet.figure(about, &frame, marks, labels)
}

/// The line in steps, over its band; of the steps within a pixel, the last is drawn.
fn drawn(area: &Area, x: &Scale, curve: &Steps, series: usize, crowded: bool) -> Markup {
    let series = series % DASHES.len();
    let column = |step: &Step| area.x(x.place(step.x)) as usize;
    let mut kept: Vec<&Step> = Vec::new();
    let shown = curve.steps.iter().filter(|step| step.x <= x.high());
    for step in shown {
        if kept.last().is_some_and(|last| column(last) == column(step)) {
            kept.pop();
        }
        kept.push(step);
    }
    let corners = |share: &dyn Fn(&Step) -> f64| {
        let mut corners = vec![(area.left, area.y(curve.first))];
        let mut before = curve.first;
        for step in &kept {
            let at = area.x(x.place(step.x));
            corners.push((at, area.y(before)));
            before = share(step);
            corners.push((at, area.y(before)));
        }
        corners.push((area.x(1.0), area.y(before)));
        corners
    };
    let upper = corners(&|step| step.high);
    let lower = corners(&|step| step.low);
    // Distributions have no intervals.
    let banded = upper != lower;
    html! {
        @if banded {
            (band(series, crowded, &upper, &lower))
        }
        path class={ "line s" (series) } stroke-dasharray=(DASHES[series])
            d=(path(corners(&|step| step.share))) { title { (curve.name) } }
    }
}
