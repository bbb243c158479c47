//! The tours that rovers plan on the field, and the observations that are in nobody's plan.

use farside_actors::figure::Figure;
use farside_actors::figure::ground::arrow;
use farside_actors::figure::svg::{Px, path};
use maud::{Markup, html};

use super::history::History;
use super::title;
use crate::chart::marks::Shape;
use crate::planner::problem::Kind;
use crate::planning::messages::PlannedStop;
use crate::planning::metrics::{achieved, recorded};
use crate::planning::shared::Shared;

/// The side of the field, in pixels.
const SIDE: f64 = 640.0;
const LEFT: f64 = 16.0;
const TOP: f64 = 68.0;
/// Right of the field: the legend.
const LEGEND: f64 = 280.0;
/// How many colours there are for rovers.
const COLOURS: usize = 7;
/// How the drives of a sol are dashed.
const SOLS: [&str; 3] = ["none", "7 4", "2 3"];

/// The field with the plans at a time.
struct Map<'a> {
    shared: &'a Shared,
    /// By rover.
    plans: Vec<&'a [PlannedStop]>,
    /// By goal: whether as many rovers plan it as it needs.
    planned: Vec<bool>,
}

/// The tours at a time.
pub(super) fn figure(history: &History, shared: &Shared, at_ns: u64) -> Figure {
    let tally = history.until(at_ns);
    let plans = recorded(&tally);
    let map = Map {
        shared,
        planned: achieved(&shared.instance, &plans),
        plans: plans.into_iter().map(|(plan, _)| plan).collect(),
    };
    let title = title(history, at_ns);
    let count = map.planned.iter().filter(|planned| **planned).count();
    let says = format!(
        "{count} of {} observations are planned, on a field {:.0} m wide.",
        map.planned.len(),
        shared.problem.side_m
    );
    let body = html! {
        text class="title" x="16" y="28" { (title) }
        text class="tick" x="16" y="50" { (says) }
        rect class="frame" x=(Px(LEFT)) y=(Px(TOP)) width=(Px(SIDE)) height=(Px(SIDE)) {}
        @for rover in 0..map.plans.len() { (map.tour(rover)) }
        (map.spots())
        @for rover in 0..map.plans.len() { (map.start(rover)) }
        (map.legend())
    };
    Figure {
        file: "tours.svg".to_owned(),
        title: format!("Planned tours of {title}"),
        description: says,
        width: LEFT + SIDE + LEGEND,
        height: TOP + SIDE + 16.0,
        body,
        facet: String::new(),
        style: &super::STYLE,
    }
}

impl Map<'_> {
    fn px(&self, [east_m, north_m]: [f64; 2]) -> (f64, f64) {
        let side_m = self.shared.problem.side_m;
        let scale = SIDE / side_m;
        let (east_m, south_m) = (east_m + 0.5 * side_m, 0.5 * side_m - north_m);
        (LEFT + scale * east_m, TOP + scale * south_m)
    }

    /// Where a goal is drawn: those of one rock that are made from one place beside each other.
    fn spot(&self, goal: usize) -> (f64, f64) {
        let goal = &self.shared.problem.goals[goal];
        shape(goal.kind).beside(self.px(goal.position_m))
    }

    /// The goals of a rover's plan, with the sol.
    fn goals(&self, rover: usize) -> impl Iterator<Item = (usize, usize)> {
        let goals = self.shared.instance.goals();
        let stops = self.plans[rover].iter();
        let stops = stops.map(|stop| (stop.task as usize, stop.sol as usize));
        stops.filter(move |(task, _)| *task < goals)
    }

    fn tour(&self, rover: usize) -> Markup {
        let problem = &self.shared.problem;
        let mut at = self.px(problem.rovers[rover].position_m);
        let mut drives: Vec<(usize, Vec<(f64, f64)>)> = Vec::new();
        for (goal, sol) in self.goals(rover) {
            let to = self.px(problem.goals[goal].position_m);
            match drives.last_mut() {
                Some((of, points)) if *of == sol => points.push(to),
                _ => drives.push((sol, vec![at, to])),
            }
            at = to;
        }
        html! {
            g class={ "s" (rover % COLOURS) } {
                @for (sol, points) in drives {
                    path class="tour" stroke-dasharray=(SOLS[sol % SOLS.len()]) d=(path(points)) {
                        title { (problem.rovers[rover].name) ", sol " (sol + 1) }
                    }
                }
            }
        }
    }

    fn spots(&self) -> Markup {
        let problem = &self.shared.problem;
        let whose = |goal: usize| {
            let mut rovers = 0..self.plans.len();
            rovers.find(|&rover| self.goals(rover).any(|(planned, _)| planned == goal))
        };
        html! {
            @for (number, goal) in problem.goals.iter().enumerate() {
                @let at = self.spot(number);
                @let rover = whose(number).filter(|_| self.planned[number]);
                @let (class, who) = match rover {
                    Some(rover) => ("spot", problem.rovers[rover].name.as_str()),
                    None => ("spot open", "nobody"),
                };
                g class={ "s" (rover.unwrap_or(0) % COLOURS) } {
                    path class=(class) d=(shape(goal.kind).outline(at)) {
                        title { (goal.name) ", worth " (goal.weight) ": " (who) }
                    }
                }
                @if goal.rovers > 1 {
                    circle class="pair" cx=(Px(at.0)) cy=(Px(at.1)) r="8" {
                        title { (goal.name) " needs two rovers" }
                    }
                }
            }
        }
    }

    fn start(&self, rover: usize) -> Markup {
        let of = &self.shared.problem.rovers[rover];
        let heads = arrow(self.px(of.position_m), 0.5 * std::f64::consts::PI);
        html! {
            g class={ "s" (rover % COLOURS) } {
                path class="spot" d=(heads) { title { (of.name) } }
            }
        }
    }

    fn legend(&self) -> Markup {
        let x = LEFT + SIDE + 20.0;
        let problem = &self.shared.problem;
        let line = |class: &str, dashes: &str| {
            html! {
                g class=(class) {
                    path class="tour" stroke-dasharray=(dashes) d=(path([(x, 0.0), (x + 26.0, 0.0)])) {}
                }
            }
        };
        let mark = |class: &str, kind| {
            html! {
                g class="lost" { path class=(class) d=(shape(kind).outline((x + 13.0, 0.0))) {} }
            }
        };
        let mut rows: Vec<(Markup, String)> = Vec::new();
        for (number, rover) in problem.rovers.iter().enumerate() {
            let goals = self.goals(number).count();
            let class = format!("s{}", number % COLOURS);
            rows.push((
                line(&class, SOLS[0]),
                format!("{}: {goals} goals", rover.name),
            ));
        }
        let sols = problem.rovers.iter().map(|rover| rover.sols.len()).max();
        for (sol, dashes) in SOLS.iter().enumerate().take(sols.unwrap_or(0)) {
            rows.push((line("lost", dashes), format!("drives of sol {}", sol + 1)));
        }
        rows.extend([
            (
                mark("spot", Some(Kind::LongRangeImage)),
                "image from afar (A)".to_owned(),
            ),
            (
                mark("spot", Some(Kind::CloseUpImage)),
                "image from near (B)".to_owned(),
            ),
            (
                mark("spot", Some(Kind::CloseUpSpectrum)),
                "spectrum from near (C)".to_owned(),
            ),
            (
                mark("spot open", Some(Kind::CloseUpImage)),
                "in nobody's plan".to_owned(),
            ),
        ]);
        if self.shared.instance.has_joint() {
            let ring = html! { circle class="pair" cx=(Px(x + 13.0)) cy="0" r="8" {} };
            rows.push((ring, "needs two rovers at one time".to_owned()));
        }
        farside_actors::figure::ground::legend(&rows, (x, TOP + 12.0))
    }
}

/// The shape of the mark of a goal.
fn shape(kind: Option<Kind>) -> Shape {
    match kind {
        Some(Kind::CloseUpImage) => Shape::Image,
        Some(Kind::CloseUpSpectrum) => Shape::Spectrum,
        _ => Shape::Afar,
    }
}
