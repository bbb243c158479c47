//! Plans beside what came of them: for each rover its activities as planned and as done, when it planned anew, who
//! heard whom, its battery and its memory as they were and as plans predicted them.

use farside::SimTime;
use farside_actors::field::Place;
use farside_actors::figure::Figure;
use farside_actors::figure::scale::{Tick, text_width};
use farside_actors::figure::svg::{Area, Px, TEXT, over_lines, path};
use farside_worlds::sky::SOL_S;
use maud::{Markup, html};

use super::history::{History, RoverHistory};
use super::{activities, hours, incidents, profile, title};
use crate::chart::nights;
use crate::chart::strip::Axis;
use crate::shac::Calendar;
use crate::survey::execution::ExecutionConfig;

/// The width of what is drawn over time, in pixels.
const WIDTH: f64 = 1120.0;
/// Left of it: the names of rows.
const LEFT: f64 = 150.0;
const RIGHT: f64 = 24.0;
/// The first row of the legend, and from row to row.
const LEGEND: f64 = 80.0;
const LEGEND_ROW: f64 = 22.0;
/// From the name of a rover to its bars: room for names of faults.
const HEAD: f64 = 26.0;
/// How high a row of ticks is.
const TICKS: f64 = 8.0;
/// From row of ticks to row of ticks.
const TICK_ROW: f64 = 15.0;
const BATTERY: f64 = 74.0;
const MEMORY: f64 = 50.0;
/// Between plots.
const GAP: f64 = 14.0;
/// A rover with all its rows.
const BLOCK: f64 =
    HEAD + activities::HEIGHT + 6.0 + 3.0 * TICK_ROW + GAP + BATTERY + GAP + MEMORY + 34.0;
/// The size of names of faults.
const SMALL: f64 = 12.0;

/// What is drawn, and from when to when.
pub(super) struct Scene<'a> {
    pub(super) history: &'a History,
    pub(super) place: &'a Place,
    pub(super) execution: &'a ExecutionConfig,
    pub(super) windows: &'a Calendar,
    pub(super) span: (u64, u64),
}

impl Scene<'_> {
    /// The figure, of these rovers.
    pub(super) fn figure(&self, rovers: &[usize]) -> Figure {
        let mut title = title(self.history, self.span);
        let mut file = "plans.svg".to_owned();
        if let [rover] = rovers {
            let name = &self.history.names[*rover];
            title = format!("{name} of {title}");
            file = format!("plans-{name}.svg");
        }
        let axis = Axis::between(
            hours(self.span.0),
            hours(self.span.1),
            "hours since the start",
            12.0,
        );
        let (legend, rows) = self.legend();
        let top = LEGEND + LEGEND_ROW * rows as f64 + 14.0;
        let block = |row: usize| top + BLOCK * row as f64;
        let says = self.says(rovers);
        let bottom = block(rovers.len()) - 20.0;
        let body = html! {
            text class="title" x="16" y="28" { (title) }
            text class="tick" x="16" y="50" { (says) }
            (legend)
            @for (row, &rover) in rovers.iter().enumerate() { (self.block(rover, block(row), &axis.ticks)) }
            (below(&axis, bottom))
        };
        Figure {
            file,
            title: format!("Plans and execution of {title}"),
            description: says,
            width: LEFT + WIDTH + RIGHT,
            height: bottom + 52.0,
            body,
            facet: String::new(),
            style: &super::STYLE,
        }
    }

    fn tolerance_ns(&self) -> u64 {
        self.execution.late_tolerance.as_nanos()
    }

    /// A row of the figure.
    fn area(&self, top: f64, height: f64) -> Area {
        Area {
            left: LEFT,
            top,
            width: WIDTH,
            height,
        }
    }

    /// A rover, its name at `top`.
    fn block(&self, number: usize, top: f64, ticks: &[Tick]) -> Markup {
        let rover = &self.history.rovers[number];
        let bars = self.area(top + HEAD, activities::HEIGHT);
        let first = bars.top + bars.height + 6.0;
        let row = |number: usize| self.area(first + TICK_ROW * number as f64, TICKS);
        let battery = self.area(row(3).top + GAP, BATTERY);
        let memory = self.area(battery.top + BATTERY + GAP, MEMORY);
        let all = self.area(bars.top - 2.0, memory.top + MEMORY - bars.top + 2.0);
        let lanes = self.area(bars.top - 2.0, row(3).top - bars.top);
        let span_s = (self.span.0 as f64 / 1e9, self.span.1 as f64 / 1e9);
        let made: Vec<u64> = rover.plans.iter().map(|(at_ns, _)| *at_ns).collect();
        let here = rover.carried.iter().filter(|one| {
            one.began_ns <= self.span.1 && rover.ended_ns(one, self.span.1) >= self.span.0
        });
        html! {
            text class="facet" x="16" y=(Px(top + 14.0)) { (self.history.names[number]) }
            (nights::shades(self.place, span_s, &all))
            @for tick in ticks {
                @let x = all.x(tick.at);
                path class="grid" d=(path([(x, all.top), (x, all.y(0.0))])) {}
            }
            (self.windows(&lanes))
            (lane("planned", bars.top + 0.5 * activities::BAR))
            (lane("done", bars.top + activities::ROW + 0.5 * activities::BAR))
            (activities::draw(rover, self.span, self.tolerance_ns(), &bars))
            @for (at, (name, class, times_ns)) in [
                ("plans made", "ticks s6", &made),
                ("heard by the centre", "ticks s2", &rover.heard_ns),
                ("hears the centre", "ticks s0", &rover.hears_ns),
            ].into_iter().enumerate() {
                @let row = row(at);
                (lane(name, row.top + 0.5 * TICKS))
                path class="nothing-said" d=(path([(LEFT, row.y(0.0)), (row.x(1.0), row.y(0.0))])) {}
                path class=(class) d=(self.ticks(times_ns, &row)) { title { (name) } }
            }
            (profile::BATTERY.draw(rover, self.span, battery))
            (profile::MEMORY.draw(rover, self.span, memory))
            (incidents::bars(&rover.outages, self.span, &all))
            (self.faults(rover, &all, top + 14.0, &activities::says(here, self.tolerance_ns())))
        }
    }

    /// When the daily communication may be, and when anything may be sent, as shades.
    fn windows(&self, area: &Area) -> Markup {
        let x = |at_s: f64| area.x((at_s - self.span.0 as f64 / 1e9) / self.span_s());
        let shade = |class: &str, from_s: f64, to_s: f64, says: &str| {
            let (left, right) = (x(from_s).max(area.x(0.0)), x(to_s).min(area.x(1.0)));
            html! {
                @if left < right {
                    rect class=(class) x=(Px(left)) y=(Px(area.top)) width=(Px(right - left))
                        height=(Px(area.height)) { title { (says) } }
                }
            }
        };
        html! {
            @for [from_s, to_s] in self.communications_s() {
                (shade("daily", from_s, to_s, "the daily communication may be made"))
            }
            @for [from_s, to_s] in self.closed_s() {
                (shade("closed", from_s, to_s, "nothing is sent"))
            }
        }
    }

    fn span_s(&self) -> f64 {
        (self.span.1 - self.span.0) as f64 / 1e9
    }

    /// The windows of daily communications, in the run's time \[s\].
    fn communications_s(&self) -> Vec<[f64; 2]> {
        if self.execution.communication.is_zero() {
            return Vec::new();
        }
        let midnight_s = libm::floor(self.place.starts_s / SOL_S) * SOL_S - self.place.starts_s;
        let sols = libm::ceil(self.span.1 as f64 / 1e9 / SOL_S) as u32;
        let window = |sol: u32| {
            let from_s = midnight_s + f64::from(sol) * SOL_S;
            [
                self.execution.communicate_from,
                self.execution.communicate_until,
            ]
            .map(|at| from_s + at.as_secs_f64())
        };
        (0..=sols).map(window).collect()
    }

    /// When nothing is sent, in the run's time \[s\], to the width of a pixel.
    fn closed_s(&self) -> Vec<[f64; 2]> {
        let step_ns = ((self.span.1 - self.span.0) / WIDTH as u64).max(1);
        let mut closed: Vec<[f64; 2]> = Vec::new();
        for at_ns in (self.span.0..self.span.1).step_by(step_ns as usize) {
            if self.windows.is_open(SimTime::from_nanos(at_ns)) {
                continue;
            }
            let (from_s, to_s) = (at_ns as f64 / 1e9, (at_ns + step_ns) as f64 / 1e9);
            match closed.last_mut() {
                Some(last) if last[1] >= from_s => last[1] = to_s,
                _ => closed.push([from_s, to_s]),
            }
        }
        closed
    }

    /// A stroke for each time, those in one pixel as one.
    fn ticks(&self, times_ns: &[u64], row: &Area) -> String {
        let (from_ns, to_ns) = self.span;
        let mut strokes = String::new();
        let mut before = None;
        for &at_ns in times_ns
            .iter()
            .filter(|at_ns| (from_ns..=to_ns).contains(*at_ns))
        {
            let x = libm::floor(row.x((at_ns - from_ns) as f64 / (to_ns - from_ns) as f64)) + 0.5;
            if before != Some(x) {
                strokes.push_str(&path([(x, row.top), (x, row.y(0.0))]));
                before = Some(x);
            }
        }
        strokes
    }

    /// Lines at faults, their names in the row of the rover's name where there is room, and what is said of its
    /// activities before them.
    fn faults(&self, rover: &RoverHistory, all: &Area, y: f64, says: &str) -> Markup {
        let (from_ns, to_ns) = self.span;
        let faults = rover
            .faults
            .iter()
            .filter(|(at_ns, _)| (from_ns..=to_ns).contains(at_ns));
        let faults: Vec<(f64, &str)> = faults
            .map(|(at_ns, name)| {
                let share = (at_ns - from_ns) as f64 / (to_ns - from_ns) as f64;
                (all.x(share), name.as_str())
            })
            .collect();
        let mut free = LEFT;
        let named: Vec<bool> = faults
            .iter()
            .map(|(x, name)| {
                let end = x + text_width(name, SMALL) + 10.0;
                let has_room = *x >= free && end <= all.x(1.0);
                free = if has_room { end } else { free };
                has_room
            })
            .collect();
        // What is said of activities ends at the right, unless names are there.
        let right = all.x(1.0);
        let says_from = right - text_width(says, TEXT) - 12.0;
        html! {
            @for ((x, name), is_named) in faults.iter().zip(named) {
                path class="fault" d=(path([(*x, all.top - 6.0), (*x, all.y(0.0))])) { title { (name) } }
                @if is_named { (over_lines("fault-name", (x + 3.0, y), "start", name)) }
            }
            @if free < says_from {
                text class="tick" x=(Px(right)) y=(Px(y)) text-anchor="end" { (says) }
            }
        }
    }

    fn says(&self, rovers: &[usize]) -> String {
        let (from_ns, to_ns) = self.span;
        let all = rovers.iter().map(|&rover| &self.history.rovers[rover]);
        let carried = all.clone().flat_map(|rover| &rover.carried);
        let carried = carried.filter(|one| (from_ns..=to_ns).contains(&one.began_ns));
        let plans = all.flat_map(|rover| &rover.plans);
        let plans = plans
            .filter(|(at_ns, _)| (from_ns..=to_ns).contains(at_ns))
            .count();
        format!(
            "{}; {plans} plans.",
            activities::says(carried, self.tolerance_ns())
        )
    }

    /// What is what, and how many rows that takes.
    fn legend(&self) -> (Markup, usize) {
        let rect =
            |class: &str| html! { rect class=(class) x="0" y="-6" width="24" height="12" {} };
        let line = |class: &str, stroke: &str| {
            html! { g class=(class) { path class=(stroke) d=(path([(0.0, 0.0), (24.0, 0.0)])) {} } }
        };
        let mut entries = activities::legend();
        entries.push((rect("night"), 24.0, "night"));
        entries.push((rect("daily"), 24.0, "window of the daily communication"));
        if !self.closed_s().is_empty() {
            entries.push((rect("closed"), 24.0, "nothing is sent"));
        }
        entries.push((line("s0", "actual"), 24.0, "as it was"));
        entries.push((
            line("s1", "predicted"),
            24.0,
            "as the plan of that time predicts",
        ));
        entries.push((line("s1", "bound"), 24.0, "limit"));
        let (mut left, mut row) = (16.0, 0);
        let mut placed = Vec::new();
        for entry in entries {
            let width = activities::entry_width(&entry);
            if left + width > LEFT + WIDTH + RIGHT {
                (left, row) = (16.0, row + 1);
            }
            placed.push((left, LEGEND + LEGEND_ROW * row as f64, entry));
            left += width;
        }
        let drawn = html! {
            @for (left, y, (sample, width, says)) in placed {
                g transform={ "translate(" (Px(left)) " " (Px(y)) ")" } {
                    (sample)
                    text x=(Px(width + 6.0)) y="4.5" { (says) }
                }
            }
        };
        (drawn, row + 1)
    }
}

/// The name of a row, the middle of which is at `y`.
fn lane(name: &str, y: f64) -> Markup {
    html! {
        text class="lane" x=(Px(LEFT - 10.0)) y=(Px(y + 4.5)) text-anchor="end" { (name) }
    }
}

/// The axis below all rovers.
fn below(axis: &Axis, y: f64) -> Markup {
    let x = |at: f64| LEFT + at * WIDTH;
    html! {
        path class="axis" d=(path([(x(0.0), y), (x(1.0), y)])) {}
        @for tick in &axis.ticks {
            path class="axis" d=(path([(x(tick.at), y), (x(tick.at), y + 4.0)])) {}
            text class="tick" x=(Px(x(tick.at))) y=(Px(y + 19.0)) text-anchor="middle" { (tick.text) }
        }
        text class="label" x=(Px(x(0.5))) y=(Px(y + 40.0)) text-anchor="middle" { (axis.label) }
    }
}
