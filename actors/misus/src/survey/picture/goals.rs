//! How many goals are in which state over time.

use farside_actors::field::Place;
use farside_actors::figure::Figure;
use farside_actors::figure::svg::Area;
use maud::html;

use super::history::History;
use super::standing::{Standing, Standings};
use super::{hours, incidents, title};
use crate::chart::nights;
use crate::chart::stacked::{Stacked, States};
use crate::chart::strip::Axis;

const WIDTH: f64 = 840.0;
const HEIGHT: f64 = 380.0;
const LEFT: f64 = 64.0;
const TOP: f64 = 112.0;
/// Right of the plot: the legend.
const LEGEND: f64 = 220.0;
/// The most instants at which goals are counted.
const INSTANTS: u64 = 840;

/// From below in the plot.
const STATES: States<8> = [
    ("achieved", "s2"),
    ("being done", "s1"),
    ("owned", "s0"),
    ("offered", "s5"),
    ("pooled", "s4"),
    ("wished for", "s3"),
    ("given up", "gone"),
    ("withdrawn", "withdrawn"),
];

/// The states of goals from a time to another.
pub(super) fn figure(history: &History, place: &Place, (from_ns, to_ns): (u64, u64)) -> Figure {
    let counts = counts(history, (from_ns, to_ns));
    let total = counts.iter().map(|(_, counts)| counts.iter().sum());
    let stacked = Stacked {
        states: &STATES,
        counts: &counts,
        label: "goals",
        total: total.max().unwrap_or(0),
    };
    let axis = Axis::between(hours(from_ns), hours(to_ns), "hours since the start", 12.0);
    let area = Area {
        left: LEFT,
        top: TOP,
        width: WIDTH,
        height: HEIGHT,
    };
    let span_s = (from_ns as f64 / 1e9, to_ns as f64 / 1e9);
    let (title, says) = (title(history, (from_ns, to_ns)), stacked.says());
    let body = html! {
        text class="title" x="16" y="28" { (title) }
        text class="tick" x="16" y="50" { (says) }
        (nights::shades(place, span_s, &area))
        (stacked.draw(&axis, area))
        (incidents::draw(history, (from_ns, to_ns), &area, true))
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

/// How many goals are in each state, whenever that changes.
fn counts(history: &History, (from_ns, to_ns): (u64, u64)) -> Vec<(f64, [usize; 8])> {
    let mut standings = Standings::new(history);
    let mut counts: Vec<(f64, [usize; 8])> = Vec::new();
    let step_ns = (to_ns - from_ns).div_ceil(INSTANTS).max(1);
    let instants = (from_ns..to_ns).step_by(step_ns as usize).chain([to_ns]);
    for at_ns in instants {
        standings.until(at_ns);
        let mut now = [0; 8];
        for (_, standing) in standings.all() {
            now[place_of(standing)] += 1;
        }
        if counts.last().is_none_or(|(_, before)| *before != now) {
            counts.push((hours(at_ns), now));
        }
    }
    counts
}

/// Which of [`STATES`] it is.
fn place_of(standing: Standing) -> usize {
    match standing {
        Standing::Achieved { .. } => 0,
        Standing::Started { .. } => 1,
        Standing::Owned { .. } => 2,
        Standing::Offered => 3,
        Standing::Pooled => 4,
        Standing::Wished => 5,
        Standing::GivenUp => 6,
        Standing::Withdrawn => 7,
    }
}
