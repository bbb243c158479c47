//! The tracks of rovers on the field until an instant, and what has become of goals there.

use farside_actors::figure::Figure;
use farside_actors::figure::ground::{Ground, LegendRow, Moment, arrow, legend};
use farside_actors::figure::relief;
use farside_actors::figure::scale::text_width;
use farside_actors::figure::svg::{Px, over_lines, path, shortened};
use farside_worlds::RockField;
use maud::{Markup, html};

use super::activities::{cross, named};
use super::history::History;
use super::standing::{Standing, Standings};
use super::{in_hours, title};
use crate::analysis::goals::Observation;
use crate::chart::marks::Shape;
use crate::shac::GoalKey;
use crate::survey::messages::ListedGoal;

/// The side of the field, in pixels.
const SIDE: f64 = 760.0;
const LEFT: f64 = 16.0;
const TOP: f64 = 68.0;
/// Right of the field: the legend.
const LEGEND: f64 = 290.0;
/// How many colours there are for rovers: ink is for what is nobody's.
const COLOURS: usize = 6;

/// The field at a time.
pub(super) fn figure(history: &History, field: &RockField, at_ns: u64) -> Figure {
    let mut standings = Standings::new(history);
    standings.until(at_ns);
    let goals = standings.all();
    let side_m = field.settings().side_m;
    let ground = Ground {
        terrain: field.terrain(),
        corner_m: [-0.5 * side_m; 2],
        side_m,
        left: LEFT,
        top: TOP,
        side: SIDE,
    };
    let title = title(history, (0, at_ns));
    let (total, achieved) = standings.counts();
    let open = goals
        .iter()
        .filter(|(_, standing)| is_open(*standing))
        .count();
    let says = format!(
        "{achieved} of {total} goals are achieved and {open} are open after {} h, on a field {side_m:.0} m wide.",
        in_hours(at_ns)
    );
    // What matters least comes first, so that others are drawn over it.
    let mut ordered: Vec<&(&ListedGoal, Standing)> = goals.iter().collect();
    ordered.sort_by_key(|(_, standing)| std::cmp::Reverse(rank(*standing)));
    let marks = goals
        .iter()
        .map(|(goal, _)| shape(&goal.key).beside(ground.px(goal.position_m)));
    let marks: Vec<(f64, f64)> = marks.collect();
    let body = html! {
        text class="title" x="16" y="28" { (title) }
        text class="tick" x="16" y="50" { (says) }
        (ground.draw())
        (rocks(field, &ground))
        @for (number, rover) in history.rovers.iter().enumerate() {
            (track(number, Moment::until(&rover.moments, at_ns), &ground))
        }
        @for (goal, standing) in ordered {
            (mark(*standing, shape(&goal.key), shape(&goal.key).beside(ground.px(goal.position_m)), &says_of(history, goal, *standing)))
        }
        @for number in 0..history.rovers.len() { (stands(history, number, at_ns, &ground, &marks)) }
        (legend(&rows(history, &goals, field), (LEFT + SIDE + 20.0, TOP + 12.0)))
    };
    Figure {
        file: "tracks.svg".to_owned(),
        title: format!("Tracks and goals of {title}"),
        description: says,
        width: LEFT + SIDE + LEGEND,
        height: TOP + SIDE + 16.0,
        body,
        facet: String::new(),
        style: &super::STYLE,
    }
}

fn is_open(standing: Standing) -> bool {
    use Standing::{Achieved, GivenUp, Withdrawn};
    !matches!(standing, Achieved { .. } | GivenUp | Withdrawn)
}

/// The less, the more it matters.
fn rank(standing: Standing) -> u32 {
    match standing {
        Standing::Started { .. } => 0,
        Standing::Achieved { .. } => 1,
        Standing::Owned { .. } => 2,
        Standing::Offered => 3,
        Standing::Pooled => 4,
        Standing::Wished => 5,
        Standing::GivenUp => 6,
        Standing::Withdrawn => 7,
    }
}

fn rocks(field: &RockField, ground: &Ground<'_>) -> Markup {
    html! {
        @for (number, rock) in field.rocks().iter().enumerate() {
            @let (x, y) = ground.px(rock.position_m.into());
            @let radius = (0.5 * rock.diameter_m * ground.px_per_m()).max(2.0);
            circle class="stone" cx=(Px(x)) cy=(Px(y)) r=(Px(radius)) { title { "rock " (number) } }
        }
    }
}

fn track(number: usize, moments: &[Moment], ground: &Ground<'_>) -> Markup {
    // Where it stands still nothing is added.
    let mut before = None;
    let points = moments.iter().map(|moment| ground.px(moment.true_m));
    let points = points.filter(|point| before.replace(*point) != Some(*point));
    html! {
        g class={ "s" (number % COLOURS) } { path class="way" d=(path(points)) {} }
    }
}

/// Where a rover stands, and whether it is down; its name where it hides the fewest of these marks.
fn stands(
    history: &History,
    number: usize,
    at_ns: u64,
    ground: &Ground<'_>,
    marks: &[(f64, f64)],
) -> Markup {
    let rover = &history.rovers[number];
    let is_down = rover.outages.within((at_ns, at_ns + 1)).next().is_some();
    let name = shortened(&history.names[number], 12);
    let name = if is_down {
        format!("{name}, down")
    } else {
        name
    };
    html! {
        @if let Some(last) = Moment::until(&rover.moments, at_ns).last() {
            @let (x, y) = ground.px(last.true_m);
            @let at = free_place((x, y), text_width(&name, 12.0), ground, marks);
            g class={ "s" (number % COLOURS) } {
                path class="stands" d=(arrow((x, y), last.yaw_rad)) { title { (name) } }
            }
            (over_lines("who", at, "middle", &name))
        }
    }
}

/// Where a text of a width, its middle at the point that is returned, hides the fewest marks around a point.
fn free_place(
    (x, y): (f64, f64),
    width: f64,
    ground: &Ground<'_>,
    marks: &[(f64, f64)],
) -> (f64, f64) {
    let aside = 0.5 * width + 13.0;
    let places = [
        (0.0, -13.0),
        (0.0, 22.0),
        (aside, 4.0),
        (-aside, 4.0),
        (aside, -14.0),
        (-aside, -14.0),
    ];
    let places = places.map(|(dx, dy)| (x + dx, y + dy));
    let hidden = |(x, y): &(f64, f64)| {
        let (left, right) = (x - 0.5 * width, x + 0.5 * width);
        let outside = !ground.is_inside((left, y - 12.0)) || !ground.is_inside((right, y + 2.0));
        let under = marks.iter().filter(|(mark_x, mark_y)| {
            (left - 7.0..right + 7.0).contains(mark_x) && (y - 17.0..y + 8.0).contains(mark_y)
        });
        (outside, under.count())
    };
    let best = places.into_iter().min_by_key(hidden);
    best.unwrap_or((x, y))
}

fn shape(goal: &GoalKey) -> Shape {
    let GoalKey::Observation(id) = goal else {
        return Shape::Image;
    };
    match id.observation {
        Observation::PanoramicImage | Observation::PanoramicSpectrum => Shape::Afar,
        Observation::PointImage => Shape::Image,
        Observation::PointSpectrum => Shape::Spectrum,
    }
}

/// What has become of a goal, for who points at it.
fn says_of(history: &History, goal: &ListedGoal, standing: Standing) -> String {
    let who = |rover: usize| history.names.get(rover).map_or("", String::as_str);
    let what = match standing {
        Standing::Achieved { rover } => format!("achieved by {}", who(rover)),
        Standing::Started { rover } => format!("being done by {}", who(rover)),
        Standing::Owned { rover } => format!("owned by {}", who(rover)),
        Standing::Offered => "offered".to_owned(),
        Standing::Pooled => "pooled".to_owned(),
        Standing::Wished => "wished for".to_owned(),
        Standing::GivenUp => "given up".to_owned(),
        Standing::Withdrawn => "withdrawn".to_owned(),
    };
    let worth = libm::round(10.0 * goal.weight) / 10.0;
    format!("{}, worth {worth}: {what}", named(&goal.key))
}

/// A goal's mark: filled once it is achieved, hollow before; in the colour of its rover.
fn mark(standing: Standing, shape: Shape, at: (f64, f64), says: &str) -> Markup {
    let data = shape.outline(at);
    let in_colour = |rover: usize, class: &str| {
        html! {
            g class={ "s" (rover % COLOURS) } { path class=(class) d=(data) { title { (says) } } }
        }
    };
    match standing {
        Standing::Achieved { rover } => in_colour(rover, "spot"),
        Standing::Owned { rover } => in_colour(rover, "spot owned"),
        Standing::Started { rover } => html! {
            (in_colour(rover, "spot owned"))
            circle class="doing" cx=(Px(at.0)) cy=(Px(at.1)) r="9" { title { (says) } }
        },
        Standing::Offered | Standing::Pooled | Standing::Wished => {
            html! { path class="spot open" d=(data) { title { (says) } } }
        }
        Standing::GivenUp => html! { g { (cross(at)) title { (says) } } },
        Standing::Withdrawn => html! { path class="spot past" d=(data) { title { (says) } } },
    }
}

/// The rows of the legend.
fn rows(history: &History, goals: &[(&ListedGoal, Standing)], field: &RockField) -> Vec<LegendRow> {
    let x = LEFT + SIDE + 20.0;
    let at = (x + 13.0, 0.0);
    let count =
        |is: &dyn Fn(Standing) -> bool| goals.iter().filter(|(_, standing)| is(*standing)).count();
    let mut rows: Vec<LegendRow> = Vec::new();
    for (number, name) in history.names.iter().enumerate() {
        let achieved = count(&|one| one == Standing::Achieved { rover: number });
        let owned = count(&|one| one == Standing::Owned { rover: number });
        let sample = html! {
            g class={ "s" (number % COLOURS) } { path class="way" d=(path([(x, 0.0), (x + 26.0, 0.0)])) {} }
        };
        rows.push((
            sample,
            format!("{name}: {achieved} achieved, {owned} owned"),
        ));
    }
    let sample = |standing: Standing, shape: Shape| mark(standing, shape, at, "");
    let done = Standing::Achieved { rover: COLOURS };
    for (shape, says) in [
        (Shape::Afar, "panorama"),
        (Shape::Image, "image"),
        (Shape::Spectrum, "spectrum"),
    ] {
        let ink = html! { g class="s6" { path class="spot" d=(shape.outline(at)) {} } };
        rows.push((ink, says.to_owned()));
    }
    let open = count(&|one| matches!(one, Standing::Offered | Standing::Pooled | Standing::Wished));
    let owned = Standing::Owned { rover: 0 };
    let started = Standing::Started { rover: 0 };
    rows.extend([
        (
            sample(done, Shape::Image),
            "achieved, in the rover's colour".to_owned(),
        ),
        (sample(started, Shape::Image), "being done".to_owned()),
        (
            sample(owned, Shape::Image),
            "owned, in the rover's colour".to_owned(),
        ),
        (
            sample(Standing::Pooled, Shape::Image),
            format!("nobody's: {open}"),
        ),
        (
            sample(Standing::GivenUp, Shape::Image),
            format!("given up: {}", count(&|one| one == Standing::GivenUp)),
        ),
        (
            sample(Standing::Withdrawn, Shape::Image),
            format!("withdrawn: {}", count(&|one| one == Standing::Withdrawn)),
        ),
        (
            html! { circle class="stone" cx=(Px(at.0)) cy="0" r="4" {} },
            "rock".to_owned(),
        ),
        (
            html! { path class="relief key" d=(path([(x, 0.0), (x + 26.0, 0.0)])) {} },
            format!(
                "contours every {} m",
                relief::contour_step_m(field.terrain())
            ),
        ),
    ]);
    rows
}
