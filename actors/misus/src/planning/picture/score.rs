//! What the team's plan is worth step by step, how many goals it has, and how far it drives.

use farside_actors::figure::Figure;
use farside_actors::figure::numbers::plain;
use farside_actors::figure::svg::Area;
use maud::html;

use super::history::History;
use super::title;
use crate::chart::strip::{Axis, Curve, Strip};
use crate::planning::metrics::{Curves, curves};
use crate::planning::shared::Shared;

const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 150.0;
/// From strip to strip.
const APART: f64 = 220.0;
const LEFT: f64 = 64.0;
const TOP: f64 = 112.0;

/// The curves until a time.
pub(super) fn figure(history: &History, shared: &Shared, at_ns: u64) -> Figure {
    let curves = curves(shared, &history.until(at_ns));
    let strips = strips(shared, &curves);
    let steps = curves.score.len().max(1) as f64;
    let axis = Axis::between(0.0, steps, "optimisation step", 10.0);
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
            (strip.draw(&axis, area, row + 1 == strips.len()))
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

fn strips(shared: &Shared, curves: &Curves) -> [Strip; 3] {
    let strip = |label: &str, series: usize, values: &[f64], bound: Option<f64>| {
        let steps = (1..).zip(values);
        Strip {
            label: label.to_owned(),
            curves: vec![Curve {
                name: label.to_owned(),
                series,
                dashes: "none",
                is_marked: true,
                points: steps
                    .map(|(step, value)| (f64::from(step), *value))
                    .collect(),
            }],
            bound: bound.map(|bound| (bound, format!("at most {}", plain(bound)))),
        }
    };
    let goals = shared.instance.goals() as f64;
    [
        strip("score of the plan", 0, &curves.score, shared.bound),
        strip("goals in the plan", 2, &curves.goals, Some(goals)),
        strip("length of all drives [m]", 1, &curves.traverse_m, None),
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
