//! What has become of goals over time: how many are planned, assigned and not planned, shed, pooled, given up.

use farside_actors::figure::Figure;
use farside_actors::figure::scale::Scale;
use farside_actors::figure::svg::{Area, Frame, Px, path};
use maud::{Markup, html};

use super::history::History;
use super::title;
use crate::planning::metrics::{achieved, recorded};
use crate::planning::shared::Shared;

const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 340.0;
const LEFT: f64 = 64.0;
const TOP: f64 = 112.0;
/// Right of the plot: the legend.
const LEGEND: f64 = 230.0;

/// What can become of a goal, from below in the picture.
const STATES: [(&str, &str); 5] = [
    ("planned", "s2"),
    ("assigned, not planned", "s5"),
    ("shed", "s1"),
    ("pooled", "s4"),
    ("given up", "lost"),
];

/// How many goals are in each state.
type Counts = [usize; 5];

/// The states of goals until a time.
pub(super) fn figure(history: &History, shared: &Shared, at_ns: u64) -> Figure {
    let times_ns = history.times_ns(at_ns);
    let counts = times_ns
        .iter()
        .map(|&time_ns| (time_ns, counts(history, shared, time_ns)));
    let counts: Vec<(u64, Counts)> = counts.collect();
    let last = counts.last().map_or([0; 5], |(_, last)| *last);
    let says = STATES.iter().zip(last);
    let says = says.map(|((name, _), count)| format!("{count} {name}"));
    let says = format!("At the end: {}.", says.collect::<Vec<_>>().join(", "));
    let title = title(history, at_ns);
    let area = Area {
        left: LEFT,
        top: TOP,
        width: WIDTH,
        height: HEIGHT,
    };
    let body = html! {
        text class="title" x="16" y="28" { (title) }
        text class="tick" x="16" y="50" { (says) }
        (drawn(&counts, shared.instance.goals(), at_ns, area))
        (legend(&last, area))
    };
    Figure {
        file: "goals.svg".to_owned(),
        title: format!("States of goals of {title}"),
        description: says,
        width: LEFT + WIDTH + LEGEND,
        height: TOP + HEIGHT + 60.0,
        body,
        facet: String::new(),
        style: &super::STYLE,
    }
}

/// What has become of all goals at a time.
fn counts(history: &History, shared: &Shared, at_ns: u64) -> Counts {
    let tally = history.until(at_ns);
    let planned = achieved(&shared.instance, &recorded(&tally));
    let round = history.round(at_ns);
    let mut counts = Counts::default();
    for (goal, &is_planned) in planned.iter().enumerate() {
        let is_in = |list: &[u32]| list.contains(&(goal as u32));
        let state = match round {
            None => 3,
            Some(round) if is_in(&round.deleted) => 4,
            Some(_) if is_planned => 0,
            Some(round) if is_in(&round.pooled) => 3,
            Some(round) => {
                let last = tally.steps.iter().filter_map(|steps| steps.last());
                let mut unheard = last.flat_map(|step| &step.unheard);
                let is_shed = unheard.any(|one| {
                    one.goal as usize == goal
                        && round.assignments.get(goal) == Some(&one.assignment)
                });
                if is_shed { 2 } else { 1 }
            }
        };
        counts[state] += 1;
    }
    counts
}

fn drawn(counts: &[(u64, Counts)], goals: usize, at_ns: u64, area: Area) -> Markup {
    let minutes = |time_ns: u64| time_ns as f64 / 60e9;
    let along = Scale::between(0.0, minutes(at_ns).max(1e-3));
    let up = Scale::between(0.0, goals.max(1) as f64);
    let frame = Frame {
        area,
        x_label: "minutes since the start",
        x_ticks: along.ticks(10.0),
        y_label: "goals".to_owned(),
        y_ticks: up.ticks(6.0),
    };
    // Counts hold until the next change.
    let ends = counts
        .iter()
        .skip(1)
        .map(|(time_ns, _)| *time_ns)
        .chain([at_ns]);
    let spans: Vec<(f64, f64, &Counts)> = counts
        .iter()
        .zip(ends)
        .map(|((from_ns, counts), to_ns)| {
            let x = |time_ns| area.x(along.place(minutes(time_ns)));
            (x(*from_ns), x(to_ns), counts)
        })
        .collect();
    let outline = |state: usize| {
        let level = |counts: &Counts, states: usize| {
            let below: usize = counts[..states].iter().sum();
            area.y(up.place(below as f64))
        };
        let above = spans.iter().flat_map(|(from, to, counts)| {
            let y = level(counts, state + 1);
            [(*from, y), (*to, y)]
        });
        let below = spans.iter().rev().flat_map(|(from, to, counts)| {
            let y = level(counts, state);
            [(*to, y), (*from, y)]
        });
        format!("{}Z", path(above.chain(below)))
    };
    html! {
        (frame.draw())
        @for (state, (name, class)) in STATES.iter().enumerate() {
            @if counts.iter().any(|(_, counts)| counts[state] > 0) {
                g class=(class) { path class="state" d=(outline(state)) { title { (name) } } }
            }
        }
    }
}

/// From above as in the plot.
fn legend(last: &Counts, area: Area) -> Markup {
    let x = area.x(1.0) + 16.0;
    html! {
        @for (row, ((name, class), count)) in STATES.iter().zip(last).rev().enumerate() {
            @let y = area.top + 10.0 + 22.0 * row as f64;
            g class=(class) {
                rect class="state" x=(Px(x)) y=(Px(y - 7.0)) width="16" height="14" {}
            }
            text x=(Px(x + 24.0)) y=(Px(y + 4.5)) { (name) ": " (count) }
        }
    }
}
