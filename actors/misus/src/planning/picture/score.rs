//! What the team's plan is worth step by step, how many goals it has, and how far it drives.

use farside_actors::figure::Figure;
use farside_actors::figure::numbers::plain;
use farside_actors::figure::scale::Scale;
use farside_actors::figure::svg::{Area, Frame, Px, path};
use maud::{Markup, html};

use super::history::History;
use super::title;
use crate::planning::metrics::{Curves, curves};
use crate::planning::shared::Shared;

const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 150.0;
/// From strip to strip.
const APART: f64 = 220.0;
const LEFT: f64 = 64.0;
const TOP: f64 = 112.0;

/// One curve.
struct Strip<'a> {
    label: &'static str,
    series: usize,
    values: &'a [f64],
    bound: Option<f64>,
}

/// The curves until a time.
pub(super) fn figure(history: &History, shared: &Shared, at_ns: u64) -> Figure {
    let curves = curves(shared, &history.until(at_ns));
    let strips = strips(shared, &curves);
    let says = says(shared, &curves);
    let title = title(history, at_ns);
    let body = html! {
        text class="title" x="16" y="28" { (title) }
        text class="tick" x="16" y="50" { (says) }
        @for (row, strip) in strips.iter().enumerate() {
            @let area = Area {
                left: LEFT,
                top: TOP + APART * row as f64,
                width: WIDTH,
                height: HEIGHT,
            };
            (drawn(strip, area, row + 1 == strips.len()))
        }
    };
    Figure {
        file: "score.svg".to_owned(),
        title: format!("Score by step of {title}"),
        description: says,
        width: LEFT + WIDTH + 24.0,
        height: TOP + APART * strips.len() as f64 - 16.0,
        body,
        facet: String::new(),
        style: &super::STYLE,
    }
}

fn strips<'a>(shared: &Shared, curves: &'a Curves) -> [Strip<'a>; 3] {
    [
        Strip {
            label: "score of the plan",
            series: 0,
            values: &curves.score,
            bound: shared.bound,
        },
        Strip {
            label: "goals in the plan",
            series: 2,
            values: &curves.goals,
            bound: Some(shared.instance.goals() as f64),
        },
        Strip {
            label: "length of all drives [m]",
            series: 1,
            values: &curves.traverse_m,
            bound: None,
        },
    ]
}

fn says(shared: &Shared, curves: &Curves) -> String {
    let last = |curve: &[f64]| curve.last().copied().unwrap_or(0.0);
    let (score, goals) = (last(&curves.score), last(&curves.goals));
    let (steps, total) = (curves.score.len(), shared.instance.goals());
    let bound = match shared.bound {
        Some(bound) => format!(" No plan is worth more than {}.", plain(bound)),
        None => String::new(),
    };
    format!(
        "After {steps} steps the plan is worth {} and has {goals} of {total} goals.{bound}",
        plain(score)
    )
}

fn drawn(strip: &Strip<'_>, area: Area, is_last: bool) -> Markup {
    let values = strip.values.iter().copied();
    let scale = Scale::measured(values.chain(strip.bound).chain([0.0]));
    let steps = Scale::between(0.0, strip.values.len().max(1) as f64);
    let frame = Frame {
        area,
        x_label: if is_last { "optimisation step" } else { "" },
        x_ticks: steps.ticks(10.0),
        y_label: strip.label.to_owned(),
        y_ticks: scale.ticks(4.0),
    };
    let at = |step: usize, value: f64| {
        let x = area.x(steps.place(step as f64));
        (x, area.y(scale.place(value)))
    };
    let points: Vec<(f64, f64)> = strip
        .values
        .iter()
        .enumerate()
        .map(|(step, value)| at(step + 1, *value))
        .collect();
    html! {
        (frame.draw())
        @if let Some(bound) = strip.bound {
            @let y = area.y(scale.place(bound));
            path class="bound" d=(path([(area.left, y), (area.x(1.0), y)])) {
                title { "at most " (plain(bound)) }
            }
            text class="tick" x=(Px(area.x(1.0))) y=(Px(y + 15.0)) text-anchor="end" {
                "at most " (plain(bound))
            }
        }
        g class={ "s" (strip.series) } {
            path class="line" d=(path(points.iter().copied())) {}
            @for ((x, y), value) in points.iter().zip(strip.values) {
                circle class="mark" cx=(Px(*x)) cy=(Px(*y)) r="3" { title { (plain(*value)) } }
            }
        }
    }
}
