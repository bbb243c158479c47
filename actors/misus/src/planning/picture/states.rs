//! What has become of goals over time: how many are planned, assigned and not planned, shed, pooled, given up.

use farside_actors::figure::Figure;
use farside_actors::figure::svg::Area;
use maud::html;

use super::history::History;
use super::title;
use crate::chart::stacked::{Stacked, States};
use crate::chart::strip::Axis;
use crate::planning::metrics::{achieved, recorded};
use crate::planning::shared::Shared;

const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 340.0;
const LEFT: f64 = 64.0;
const TOP: f64 = 112.0;
/// Right of the plot: the legend.
const LEGEND: f64 = 230.0;

/// What can become of a goal, from below in the picture.
const STATES: States<5> = [
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
    let minutes = |time_ns: u64| time_ns as f64 / 60e9;
    let times_ns = history.times_ns(at_ns);
    let counts = times_ns
        .iter()
        .map(|&time_ns| (minutes(time_ns), counts(history, shared, time_ns)));
    let counts: Vec<(f64, Counts)> = counts.collect();
    let stacked = Stacked {
        states: &STATES,
        counts: &counts,
        label: "goals",
        total: shared.instance.goals(),
    };
    let to = minutes(at_ns).max(1e-3);
    let axis = Axis::between(0.0, to, "minutes since the start", 10.0);
    let says = stacked.says();
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
        (stacked.draw(&axis, area))
        (stacked.legend(area))
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
