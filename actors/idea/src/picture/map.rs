//! The drive on the ground until an instant: where rovers were and believed to be, where they backed up,
//! their goals by outcome, and where alarms and faults came.

mod room;

use farside_actors::figure::Figure;
use farside_actors::figure::ground::{Ground, LegendRow, Moment, legend, legend_rows};
use farside_actors::figure::scale::{Scale, text_width};
use farside_actors::figure::svg::{Area, Frame, Px, over_lines, path, shortened};
use farside_worlds::RockField;
use maud::{Markup, html};

use super::clock;
use super::history::{History, Mark, MarkKind, RoverHistory};
use crate::outcomes::GoalOutcome;
use room::Room;

/// The side of the ground, in pixels.
const SIDE: f64 = 660.0;
const LEFT: f64 = 64.0;
const TOP: f64 = 104.0;
/// Right of the ground: the legend.
const LEGEND: f64 = 330.0;
/// Around what is shown: a share of its extent, and at least so much \[m\].
const MARGIN: f64 = 0.12;
const LEAST_MARGIN_M: f64 = 1.0;
/// The least ground that is shown \[m\].
const LEAST_SIDE_M: f64 = 6.0;
/// The size of what is written on the ground.
const TEXT: f64 = 12.0;
/// The most goals, and the most alarms and faults of a rover, that the legend and the ground name.
const MOST_NAMED: usize = 20;

/// The ground with rovers on it.
struct Map<'a> {
    history: &'a History,
    field: &'a RockField,
    rovers: &'a [usize],
    at_ns: u64,
    ground: Ground<'a>,
}

/// The drive of rovers until a time.
pub(super) fn figure(history: &History, field: &RockField, rovers: &[usize], at_ns: u64) -> Figure {
    let (corner_m, side_m) = extent(history, rovers, at_ns);
    let map = Map {
        history,
        field,
        rovers,
        at_ns,
        ground: Ground {
            terrain: field.terrain(),
            corner_m,
            side_m,
            left: LEFT,
            top: TOP,
            side: SIDE,
        },
    };
    let who: Vec<&str> = map.each().map(|(_, rover)| rover.name.as_str()).collect();
    let title = format!(
        "{} of {}, seed {}, at {}",
        shortened(&who.join(", "), 40),
        history.scenario,
        history.seed,
        clock(at_ns)
    );
    let says = map.says();
    let right = LEFT + SIDE + 24.0;
    let rows = map.explained(right);
    let body = html! {
        text class="title" x="16" y="28" { (title) }
        text class="tick" x="16" y="50" { (says) }
        (map.axes())
        (map.ground.draw())
        (map.stones())
        @for (_, rover) in map.each() {
            (map.backwards(rover))
            (map.ground.track(&rover.name, Moment::until(&rover.moments, at_ns)))
        }
        (map.marked())
        (legend(&rows, (right, TOP + 10.0)))
    };
    let legend_ends = TOP + farside_actors::figure::ground::LEGEND_ROW * rows.len() as f64;
    Figure {
        file: "map.svg".to_owned(),
        title: format!("Map of {title}"),
        description: says,
        width: right + LEGEND,
        height: (TOP + SIDE + 52.0).max(legend_ends + 16.0),
        body,
        facet: String::new(),
        style: &super::STYLE,
    }
}

/// What ground is shown: its lower left corner and its side \[m\].
fn extent(history: &History, rovers: &[usize], at_ns: u64) -> ([f64; 2], f64) {
    let (mut low_m, mut high_m) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    let mut add = |place_m: [f64; 2]| {
        for axis in 0..2 {
            low_m[axis] = low_m[axis].min(place_m[axis]);
            high_m[axis] = high_m[axis].max(place_m[axis]);
        }
    };
    for &rover in rovers {
        let rover = &history.rovers[rover];
        for moment in Moment::until(&rover.moments, at_ns) {
            add(moment.true_m);
            add(moment.believed_m);
        }
        for goal in &rover.goals {
            add(goal.place_m);
        }
    }
    if low_m[0] > high_m[0] {
        (low_m, high_m) = ([0.0; 2], [0.0; 2]);
    }
    let extent_m = (high_m[0] - low_m[0]).max(high_m[1] - low_m[1]);
    let margin_m = (MARGIN * extent_m).max(LEAST_MARGIN_M);
    let side_m = (extent_m + 2.0 * margin_m).max(LEAST_SIDE_M);
    let corner = |axis: usize| 0.5 * (low_m[axis] + high_m[axis]) - 0.5 * side_m;
    ([corner(0), corner(1)], side_m)
}

impl Map<'_> {
    /// The rovers that are shown, by their places.
    fn each(&self) -> impl Iterator<Item = (usize, &RoverHistory)> {
        self.rovers
            .iter()
            .map(|&rover| (rover, &self.history.rovers[rover]))
    }

    /// The marks of a rover until the time, of a kind.
    fn marks<'m>(
        &'m self,
        rover: &'m RoverHistory,
        kind: MarkKind,
    ) -> impl Iterator<Item = &'m Mark> {
        let marks = rover.marks.iter();
        marks.filter(move |mark| mark.kind == kind && mark.time_ns <= self.at_ns)
    }

    /// The figure in a sentence.
    fn says(&self) -> String {
        let (mut way_m, mut done, mut goals) = (0.0, 0, 0);
        let (mut alarms, mut faults) = (0, 0);
        for (_, rover) in self.each() {
            let moments = Moment::until(&rover.moments, self.at_ns);
            let steps = moments.windows(2).map(|pair| {
                let [[x, y], [x2, y2]] = [pair[0].true_m, pair[1].true_m];
                libm::hypot(x2 - x, y2 - y)
            });
            way_m += steps.sum::<f64>();
            let is_done = |&goal: &usize| self.outcome(rover, goal) == GoalOutcome::Done;
            done += (0..rover.goals.len()).filter(is_done).count();
            goals += rover.goals.len();
            alarms += self.marks(rover, MarkKind::Alarm).count();
            faults += self.marks(rover, MarkKind::Fault).count();
        }
        format!(
            "{way_m:.1} m driven; {done} of {goals} goals done; alarms: {alarms}; faults of the hardware: \
             {faults}."
        )
    }

    fn outcome(&self, rover: &RoverHistory, goal: usize) -> GoalOutcome {
        let known = rover.outcome(goal, self.at_ns);
        known.map_or(GoalOutcome::Open, |(_, outcome)| outcome)
    }

    fn axes(&self) -> Markup {
        let [west_m, south_m] = self.ground.corner_m;
        let scale = |low_m: f64| Scale::between(low_m, low_m + self.ground.side_m);
        let frame = Frame {
            area: Area {
                left: LEFT,
                top: TOP,
                width: SIDE,
                height: SIDE,
            },
            x_label: "east [m]",
            x_ticks: scale(west_m).ticks(8.0),
            y_label: String::new(),
            y_ticks: scale(south_m).ticks(8.0),
        };
        let down = |x: f64| path([(x, TOP), (x, TOP + SIDE)]);
        html! {
            @for tick in &frame.x_ticks {
                path class="grid" d=(down(LEFT + SIDE * tick.at)) {}
            }
            text class="label" x="8" y=(Px(TOP - 14.0)) { "north [m]" }
            (frame.draw())
        }
    }

    /// Rocks, all alike.
    fn stones(&self) -> Markup {
        let px_per_m = self.ground.px_per_m();
        html! {
            @for rock in self.field.rocks() {
                @let (x, y) = self.ground.px(rock.position_m.into());
                @if self.ground.is_inside((x, y)) {
                    @let radius = (0.5 * rock.diameter_m * px_per_m).max(1.5);
                    circle class="stone" cx=(Px(x)) cy=(Px(y)) r=(Px(radius)) {
                        title { "rock, " (format!("{:.2}", rock.diameter_m)) " m" }
                    }
                }
            }
        }
    }

    /// Where a rover went backwards: against where it heads.
    fn backwards(&self, rover: &RoverHistory) -> Markup {
        let moments = Moment::until(&rover.moments, self.at_ns);
        let back = moments.windows(2).filter(|pair| {
            let [[x, y], [x2, y2]] = [pair[0].true_m, pair[1].true_m];
            let ahead = [libm::cos(pair[1].yaw_rad), libm::sin(pair[1].yaw_rad)];
            (x2 - x) * ahead[0] + (y2 - y) * ahead[1] < -1e-3
        });
        html! {
            @for pair in back {
                path class="backwards" d=(path([pair[0].true_m, pair[1].true_m].map(|m| self.ground.px(m)))) {
                    title { (rover.name) " backs up until " (clock(pair[1].time_ns)) }
                }
            }
        }
    }

    /// Goals, alarms and faults, with what is written beside them.
    fn marked(&self) -> Markup {
        let mut room = Room::new([LEFT, TOP, LEFT + SIDE, TOP + SIDE]);
        for (_, rover) in self.each() {
            let moments = Moment::until(&rover.moments, self.at_ns);
            for pair in moments.windows(2) {
                let [from, to] = [pair[0].true_m, pair[1].true_m].map(|m| self.ground.px(m));
                room.avoid_line(from, to);
            }
            if let Some(last) = moments.last() {
                let (x, y) = self.ground.px(last.true_m);
                let half = 0.5 * text_width(&shortened(&rover.name, 12), TEXT);
                room.take([x - half.max(10.0), y - 24.0, x + half.max(10.0), y + 10.0]);
            }
        }
        let mut drawn: Vec<Markup> = Vec::new();
        for (number, rover) in self.each() {
            for kind in [MarkKind::Fault, MarkKind::Alarm] {
                for mark in self.marks(rover, kind) {
                    if let Some(place_m) = rover.place_m(mark.time_ns) {
                        let (x, y) = self.ground.px(place_m);
                        room.take([x - 7.0, y - 7.0, x + 7.0, y + 7.0]);
                        drawn.push(place(mark, (x, y)));
                    }
                }
            }
            for goal in 0..rover.goals.len() {
                drawn.push(self.goal(number, rover, goal, &mut room));
            }
        }
        // Badges of goals first: they must be there, other texts need not.
        for (_, rover) in self.each() {
            for kind in [MarkKind::Alarm, MarkKind::Fault] {
                for mark in self.marks(rover, kind).take(MOST_NAMED) {
                    if let Some(place_m) = rover.place_m(mark.time_ns) {
                        drawn.push(written(mark, self.ground.px(place_m), &mut room));
                    }
                }
            }
        }
        html! { @for one in &drawn { (one) } }
    }

    /// What a goal is called on the ground: its number, after its rover's where there are several.
    fn called(&self, rover: usize, number: i64) -> String {
        match self.history.rovers.len() {
            1 => number.to_string(),
            _ => format!("{}.{number}", rover + 1),
        }
    }

    fn goal(&self, at: usize, rover: &RoverHistory, goal: usize, room: &mut Room) -> Markup {
        let one = &rover.goals[goal];
        let (x, y) = self.ground.px(one.place_m);
        let number = self.called(at, one.number);
        let half = (0.5 * text_width(&number, TEXT) + 5.0).max(10.0);
        let (bx, by) = room.beside((x, y), [half, 10.0]).unwrap_or((x, y));
        let outcome = self.outcome(rover, goal);
        html! {
            path class="leader" d=(path([(x, y), (bx, by)])) {}
            circle class="goal-place" cx=(Px(x)) cy=(Px(y)) r="2.5" {}
            g {
                title { (one.name) ": " (outcome.name()) }
                (badge(&number, half, outcome, (bx, by)))
            }
        }
    }

    /// The rows of the legend, for a legend at this x.
    fn explained(&self, x: f64) -> Vec<LegendRow> {
        let mut rows: Vec<LegendRow> = Vec::new();
        for (at, rover) in self.each() {
            for (place, goal) in rover.goals.iter().enumerate().take(MOST_NAMED) {
                let number = self.called(at, goal.number);
                let known = rover.outcome(place, self.at_ns);
                let outcome = known.map_or(GoalOutcome::Open, |(_, outcome)| outcome);
                let when = known.map_or(String::new(), |(time_ns, _)| {
                    format!(" at {}", clock(time_ns))
                });
                let name = shortened(&goal.name, 20);
                let half = (0.5 * text_width(&number, TEXT) + 5.0).max(10.0);
                let sample = badge(&number, half, outcome, (x + 12.0, 0.0));
                rows.push((sample, format!("{name}: {}{when}", outcome.name())));
            }
            if let Some(more) = rover.goals.len().checked_sub(MOST_NAMED + 1) {
                rows.push((
                    html! {},
                    format!("and {} more goals of {}", more + 1, rover.name),
                ));
            }
        }
        let alarm = html! { path class="alarm-place" d=(triangle((x + 12.0, 0.0))) {} };
        let fault = html! { path class="broken-place" d=(cross((x + 12.0, 0.0))) {} };
        let back = path([(x + 2.0, 0.0), (x + 24.0, 0.0)]);
        let back = html! { path class="backwards" d=(back) {} };
        let stone = html! { circle class="stone" cx=(Px(x + 12.0)) cy="0" r="5" {} };
        rows.push((alarm, "alarm".to_owned()));
        rows.push((fault, "fault of the hardware begins".to_owned()));
        rows.push((back, "backing up".to_owned()));
        rows.push((stone, "rock".to_owned()));
        rows.extend(legend_rows(self.field.terrain(), x));
        rows
    }
}

/// The number of a goal, by its outcome: a disc if it is done, a box if it failed, hollow if it is open.
fn badge(number: &str, half: f64, outcome: GoalOutcome, (x, y): (f64, f64)) -> Markup {
    let class = outcome.name().replace(' ', "-");
    let round = match outcome {
        GoalOutcome::Open | GoalOutcome::Done => 10.0,
        GoalOutcome::Failed | GoalOutcome::GivenUp | GoalOutcome::TakenBack => 0.0,
    };
    html! {
        rect class={ "goal " (class) } x=(Px(x - half)) y=(Px(y - 10.0)) width=(Px(2.0 * half))
            height="20" rx=(Px(round)) {}
        text class={ "goal-number " (class) } x=(Px(x)) y=(Px(y + 4.2)) text-anchor="middle" { (number) }
    }
}

/// Where something happened.
fn place(mark: &Mark, at: (f64, f64)) -> Markup {
    let (class, data) = match mark.kind {
        MarkKind::Alarm => ("alarm-place", triangle(at)),
        _ => ("broken-place", cross(at)),
    };
    html! {
        path class=(class) d=(data) { title { (mark.says) " at " (clock(mark.time_ns)) } }
    }
}

/// What happened, written beside where it did.
fn written(mark: &Mark, (x, y): (f64, f64), room: &mut Room) -> Markup {
    let text = format!("{} {}", mark.text, clock(mark.time_ns));
    let half = [0.56 * text_width(&text, TEXT), 8.0];
    let Some((tx, ty)) = room.beside((x, y), half) else {
        return html! {};
    };
    let edge = (tx - x).clamp(-half[0], half[0]);
    let class = format!("at-place {}", mark.kind.class());
    html! {
        path class="leader" d=(path([(x, y), (tx - edge, ty)])) {}
        (over_lines(&class, (tx, ty + 4.2), "middle", &text))
    }
}

fn triangle((x, y): (f64, f64)) -> String {
    format!(
        "{}Z",
        path([(x, y - 7.0), (x + 6.2, y + 4.6), (x - 6.2, y + 4.6)])
    )
}

fn cross((x, y): (f64, f64)) -> String {
    let falling = path([(x - 6.0, y - 6.0), (x + 6.0, y + 6.0)]);
    falling + &path([(x - 6.0, y + 6.0), (x + 6.0, y - 6.0)])
}
