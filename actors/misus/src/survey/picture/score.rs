//! What was achieved over time, and what it took: the score, goals, planning, driving.

use farside_actors::field::Place;
use farside_actors::figure::Figure;
use farside_actors::figure::colours::{DASHES, SERIES};
use farside_actors::figure::numbers::plain;
use farside_actors::figure::svg::Area;
use maud::html;

use super::history::History;
use super::standing::Standings;
use super::{hours, incidents, title};
use crate::chart::nights;
use crate::chart::strip::{Axis, Curve, Strip};

const WIDTH: f64 = 840.0;
const HEIGHT: f64 = 140.0;
/// From strip to strip.
const APART: f64 = 210.0;
const LEFT: f64 = 64.0;
const TOP: f64 = 112.0;
/// The most instants at which there are values.
const INSTANTS: u64 = 420;
/// The most rovers that have curves of their own.
const ROVERS: usize = 4;

/// The curves from a time to another.
pub(super) fn figure(history: &History, place: &Place, span_ns: (u64, u64)) -> Figure {
    let (from_ns, to_ns) = span_ns;
    let courses = Courses::new(history, span_ns);
    let strips = courses.strips(history);
    let axis = Axis::between(hours(from_ns), hours(to_ns), "hours since the start", 12.0);
    let span_s = (from_ns as f64 / 1e9, to_ns as f64 / 1e9);
    let (title, says) = (title(history, span_ns), courses.says(history, span_ns));
    let area = |row: usize| Area {
        left: LEFT,
        top: TOP + APART * row as f64,
        width: WIDTH,
        height: HEIGHT,
    };
    let body = html! {
        text class="title" x="16" y="28" { (title) }
        text class="tick" x="16" y="50" { (says) }
        @for (row, strip) in strips.iter().enumerate() {
            (nights::shades(place, span_s, &area(row)))
            (strip.draw(&axis, area(row), row + 1 == strips.len()))
            (incidents::draw(history, span_ns, &area(row), row == 0))
        }
    };
    Figure {
        file: "score.svg".to_owned(),
        title: format!("Score of {title}"),
        description: says,
        width: LEFT + WIDTH + 24.0,
        height: TOP + APART * strips.len() as f64 - 6.0,
        body,
        facet: String::new(),
        style: &super::STYLE,
    }
}

/// Values by hours since the start.
type Points = Vec<(f64, f64)>;

/// What is drawn.
#[derive(Default)]
struct Courses {
    score: Points,
    achieved: Points,
    wished: Points,
}

impl Courses {
    fn new(history: &History, (from_ns, to_ns): (u64, u64)) -> Courses {
        let mut courses = Courses::default();
        let mut standings = Standings::new(history);
        let step_ns = (to_ns - from_ns).div_ceil(INSTANTS).max(1);
        let instants = (from_ns..to_ns).step_by(step_ns as usize).chain([to_ns]);
        for at_ns in instants {
            standings.until(at_ns);
            let (wished, achieved) = standings.counts();
            let at_h = hours(at_ns);
            courses.score.push((at_h, standings.score()));
            courses.wished.push((at_h, wished as f64));
            courses.achieved.push((at_h, achieved as f64));
        }
        courses
    }

    fn strips(&self, history: &History) -> Vec<Strip> {
        let curve = |name: &str, series: usize, points: &Points| Curve {
            name: name.to_owned(),
            series: series % SERIES,
            dashes: DASHES[series % SERIES],
            points: points.clone(),
            is_marked: false,
        };
        let span_h = |points: &Points| {
            let ends = points.first().zip(points.last());
            ends.map_or((0.0, 0.0), |((from, _), (to, _))| (*from, *to))
        };
        let span_h = span_h(&self.score);
        let strip = |label: &str, curves: Vec<Curve>| Strip {
            label: label.to_owned(),
            curves,
            bound: None,
        };
        let mut planned = Vec::new();
        let mut driven = Vec::new();
        let mut plans = Vec::new();
        for (at, (rover, name)) in history
            .rovers
            .iter()
            .zip(&history.names)
            .enumerate()
            .take(ROVERS)
        {
            let made = || rover.plans.iter();
            let scores = made().map(|(at_ns, plan)| (hours(*at_ns), plan.score));
            planned.push(curve(
                &format!("ahead, as {name} plans"),
                at + 1,
                &steps(scores, span_h),
            ));
            let driven_m = rover.driven_m.iter().map(|(at_ns, m)| (hours(*at_ns), *m));
            driven.push(curve(name, at + 1, &steps(driven_m, span_h)));
            let mut looked_at = 0;
            let operations = made().map(|(at_ns, plan)| {
                looked_at += plan.operations;
                (hours(*at_ns), looked_at as f64)
            });
            plans.push(curve(name, at + 1, &steps(operations, span_h)));
        }
        let score = [curve("achieved", 0, &self.score)]
            .into_iter()
            .chain(planned);
        let goals = vec![
            curve("achieved", 0, &self.achieved),
            curve("ever wished for", 6, &self.wished),
        ];
        vec![
            strip("score", score.collect()),
            strip("goals", goals),
            strip("operations of planning, summed up", plans),
            strip("driven [m]", driven),
        ]
    }

    fn says(&self, history: &History, (from_ns, to_ns): (u64, u64)) -> String {
        let last = |points: &Points| points.last().map_or(0.0, |(_, value)| *value);
        let (score, achieved, wished) =
            (last(&self.score), last(&self.achieved), last(&self.wished));
        let plans = history.rovers.iter().flat_map(|rover| &rover.plans);
        let plans = plans.filter(|(at_ns, _)| (from_ns..=to_ns).contains(at_ns));
        format!(
            "{achieved} of {wished} goals are achieved, worth {}; {} plans were made.",
            plain(libm::round(score)),
            plans.count()
        )
    }
}

/// Values that hold until the next one, within a span.
fn steps(values: impl Iterator<Item = (f64, f64)>, (from_h, to_h): (f64, f64)) -> Points {
    let mut points: Points = Vec::new();
    let mut held = None;
    for (at_h, value) in values.take_while(|(at_h, _)| *at_h <= to_h) {
        if at_h <= from_h {
            points = vec![(from_h, value)];
        } else {
            points.extend(held.map(|held| (at_h, held)));
            points.push((at_h, value));
        }
        held = Some(value);
    }
    points.extend(held.map(|held| (to_h, held)));
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_hold_until_the_next_one_within_the_span() {
        let values = [(0.0, 1.0), (2.0, 3.0), (5.0, 4.0)];
        let of = |from_h, to_h| steps(values.into_iter(), (from_h, to_h));
        assert_eq!(
            of(1.0, 4.0),
            [(1.0, 1.0), (2.0, 1.0), (2.0, 3.0), (4.0, 3.0)]
        );
        assert_eq!(of(3.0, 4.0), [(3.0, 3.0), (4.0, 3.0)]);
        assert_eq!(of(6.0, 7.0), [(6.0, 4.0), (7.0, 4.0)]);
        assert!(steps([].into_iter(), (0.0, 1.0)).is_empty());
    }
}
