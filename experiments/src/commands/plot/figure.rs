//! Curves as a figure: a panel for each field, one below the other over the same time.

use farside_actors::figure::Figure;
use farside_actors::figure::colours::DASHES;
use farside_actors::figure::scale::{Scale, Spacing};
use farside_actors::figure::svg::{
    Area, CurveName, Frame, TEXT, names_below, path, shortened, slug, widest,
};
use maud::{Markup, html};

use super::curves::{Curve, Curves};

const WIDTH: f64 = 820.0;
const HEIGHT: f64 = 190.0;
const TOP: f64 = 84.0;
const RIGHT: f64 = 24.0;
/// Between panels: what the next one measures.
const APART: f64 = 56.0;
const STYLE: &str = "\
svg text.title { font-size: 17px; font-weight: 600; }
svg .curve { fill: none; stroke: currentColor; stroke-width: 1.4; stroke-linejoin: round; }
svg .point { fill: currentColor; }
";

/// As many points as are marked one by one.
const MARKED: usize = 60;

/// The figure of some curves of a file.
pub(super) fn figure(curves: &Curves, file: &str) -> Figure {
    let mut fields: Vec<&str> = Vec::new();
    for curve in &curves.curves {
        if !fields.contains(&curve.field.as_str()) {
            fields.push(&curve.field);
        }
    }
    let times = curves
        .curves
        .iter()
        .flat_map(|curve| curve.values.points.iter());
    let times = times.map(|(time_ns, _)| *time_ns as f64 / 1e9);
    let x = Scale::over(times, Spacing::Linear);
    let mut top = TOP;
    let mut panels: Vec<Markup> = Vec::new();
    let mut left = 60.0_f64;
    let scaled: Vec<(&str, Scale)> = fields
        .iter()
        .map(|field| {
            let its = curves.curves.iter().filter(|curve| curve.field == *field);
            let values = its.flat_map(|curve| curve.values.range.into_iter().flatten());
            (*field, Scale::over(values, Spacing::Linear))
        })
        .collect();
    for (_, scale) in &scaled {
        let ticks = scale.ticks(5.0);
        left = left.max(widest(ticks.iter().map(|tick| tick.text.as_str())) + 20.0);
    }
    for (at, (field, y)) in scaled.iter().enumerate() {
        let area = Area {
            left,
            top,
            width: WIDTH,
            height: HEIGHT,
        };
        let is_last = at + 1 == scaled.len();
        let its: Vec<&Curve> = curves
            .curves
            .iter()
            .filter(|curve| curve.field == *field)
            .collect();
        let (panel, height) = panel(&its, &area, (&x, y), field, is_last);
        panels.push(panel);
        top += HEIGHT + height + APART;
    }
    let values: u64 = curves.curves.iter().map(|curve| curve.values.values).sum();
    let count = curves.curves.len();
    let description =
        format!("{values} values of {count} curves, by the times at which they were logged");
    let body = html! {
        text class="title" x="8" y="28" { (shortened(file, 90)) }
        @for panel in &panels { (panel) }
    };
    Figure {
        file: format!("plot-{}.svg", slug(&fields.join("-"))),
        title: format!("{} of {file}", fields.join(", ")),
        description,
        width: left + WIDTH + RIGHT,
        height: top,
        body,
        facet: String::new(),
        style: STYLE,
    }
}

/// A panel, and how much room it takes below its axis.
fn panel(
    curves: &[&Curve],
    area: &Area,
    (x, y): (&Scale, &Scale),
    field: &str,
    is_last: bool,
) -> (Markup, f64) {
    let frame = Frame {
        area: *area,
        x_label: if is_last {
            "seconds since the start"
        } else {
            ""
        },
        x_ticks: x.ticks(10.0),
        y_label: field.to_owned(),
        y_ticks: y.ticks(5.0),
    };
    let names = curves.iter().enumerate().map(|(series, curve)| CurveName {
        series: series % DASHES.len(),
        y: 0.0,
        rank: series as f64,
        text: shortened(&curve.topic, 60),
    });
    let below = area.y(0.0) + if is_last { 58.0 } else { 36.0 };
    let (legend, height) = names_below(names.collect(), "", (area.left, below), area.width, false);
    let markup = html! {
        (frame.draw())
        @for (series, curve) in curves.iter().enumerate() {
            (line(curve, series % DASHES.len(), area, (x, y)))
        }
        (legend)
    };
    (markup, height + if is_last { 58.0 } else { 36.0 } + TEXT)
}

/// A curve; what is no finite number interrupts it.
fn line(curve: &Curve, series: usize, area: &Area, (x, y): (&Scale, &Scale)) -> Markup {
    let place = |(time_ns, value): &(u64, f64)| {
        let time = *time_ns as f64 / 1e9;
        (area.x(x.place(time)), area.y(y.place(*value)))
    };
    let pieces = curve.values.points.split(|(_, value)| !value.is_finite());
    let pieces: Vec<&[(u64, f64)]> = pieces.filter(|piece| !piece.is_empty()).collect();
    let marks = curve.values.points.len() <= MARKED;
    html! {
        g class={ "s" (series) } {
            title { (curve.topic) }
            @for piece in pieces {
                @if piece.len() > 1 {
                    path class="curve" stroke-dasharray=(DASHES[series]) d=(path(piece.iter().map(place))) {}
                }
                @if marks || piece.len() == 1 {
                    @for (cx, cy) in piece.iter().map(place) {
                        circle class="point" cx=(format!("{cx:.1}")) cy=(format!("{cy:.1}")) r="2.2" {}
                    }
                }
            }
        }
    }
}
