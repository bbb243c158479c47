//! A rover's resources over time: its battery, what the solar array yields and what its parts take,
//! its memory; with nights, and the faults that it had.

use farside::SimDuration;
use farside_actors::figure::Figure;
use farside_actors::figure::scale::Scale;
use farside_actors::figure::svg::{Area, Frame, Px, over_lines, path};
use farside_worlds::sky::SOL_S;
use maud::{Markup, html};

use super::history::{Fault, History, Level};
use super::in_sols;
use crate::chart::nights;
use farside_actors::field::Place;

/// The width of a strip, in pixels.
const WIDTH: f64 = 880.0;
/// The height of a strip.
const HEIGHT: f64 = 130.0;
/// From strip to strip.
const APART: f64 = 200.0;
/// Left of the strips: the marks of their axes.
const LEFT: f64 = 64.0;
/// Above the first strip.
const TOP: f64 = 112.0;

/// A curve of a strip.
struct Curve {
    name: &'static str,
    /// Its colour and dashes.
    series: usize,
    value: fn(&Level) -> f64,
}

/// One resource.
struct Strip {
    label: &'static str,
    curves: Vec<Curve>,
    /// What the resource holds at most, if that is known.
    full: Option<f64>,
}

/// The profiles of the rover of this number, from a time to another.
pub(super) fn figure(
    history: &History,
    place: &Place,
    capacity: [f64; 2],
    rover: usize,
    (from_ns, to_ns): (u64, u64),
) -> Figure {
    let name = &history.names[rover];
    let levels = history.levels(rover, from_ns, to_ns);
    let faults = history.faults_of(rover, from_ns, to_ns);
    let strips = strips(capacity);
    let [from, to] = [from_ns, to_ns].map(SimDuration::from_nanos);
    let [begins, ends] = [from, to].map(in_sols);
    let title = format!(
        "{name} of {}, seed {}, from {begins} to {ends}",
        history.scenario, history.seed
    );
    let says = says(levels, faults.len());
    let bottom = TOP + APART * strips.len() as f64;
    let x = Axis {
        from_s: from.as_secs_f64(),
        to_s: to.as_secs_f64(),
    };
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
            (nights::shades(place, (x.from_s, x.to_s), &area))
            (drawn(strip, levels, &x, &area, row + 1 == strips.len()))
            (faulty(&faults, &x, &area, row == 0))
        }
    };
    Figure {
        file: format!("profiles-{name}.svg"),
        title: format!("Resources of {title}"),
        description: says,
        width: LEFT + WIDTH + 24.0,
        height: bottom,
        body,
        facet: String::new(),
        style: &super::STYLE,
    }
}

fn strips([battery_j, memory_bytes]: [f64; 2]) -> Vec<Strip> {
    const J_PER_WH: f64 = 3600.0;
    let curve = |name, series, value| Curve {
        name,
        series,
        value,
    };
    vec![
        Strip {
            label: "battery [Wh]",
            curves: vec![curve("charge", 0, |m| m.battery_j / J_PER_WH)],
            full: Some(battery_j / J_PER_WH),
        },
        Strip {
            label: "power [W]",
            curves: vec![
                curve("from the solar array", 4, |m| m.solar_w),
                curve("taken by all parts", 1, |m| m.load_w),
            ],
            full: None,
        },
        Strip {
            label: "memory [MB]",
            curves: vec![curve("used", 2, |m| m.memory_bytes / 1e6)],
            full: Some(memory_bytes / 1e6),
        },
    ]
}

fn says(levels: &[Level], faults: usize) -> String {
    let faults = match faults {
        0 => "No fault.".to_owned(),
        1 => "One fault.".to_owned(),
        more => format!("{more} faults."),
    };
    let least = levels.iter().map(|m| m.battery_j).min_by(f64::total_cmp);
    match least {
        None => format!("Nothing is recorded of it then. {faults}"),
        Some(least_j) => format!(
            "Its battery held {:.0} Wh at least. {faults}",
            least_j / 3600.0
        ),
    }
}

/// The time along all strips.
struct Axis {
    from_s: f64,
    to_s: f64,
}

impl Axis {
    /// Where a time \[s\] lies, from 0 to 1.
    fn place(&self, time_s: f64) -> f64 {
        ((time_s - self.from_s) / (self.to_s - self.from_s)).clamp(0.0, 1.0)
    }
}

fn drawn(strip: &Strip, levels: &[Level], x: &Axis, area: &Area, is_last: bool) -> Markup {
    let values = strip
        .curves
        .iter()
        .flat_map(|curve| levels.iter().map(curve.value));
    let scale = Scale::measured(values.chain(strip.full).chain([0.0]));
    let sols = Scale::between(x.from_s / SOL_S, x.to_s / SOL_S);
    let frame = Frame {
        area: *area,
        x_label: if is_last { "sols since the start" } else { "" },
        x_ticks: sols.ticks(10.0),
        y_label: strip.label.to_owned(),
        y_ticks: scale.ticks(4.0),
    };
    let line = |curve: &Curve| {
        let points = levels.iter().map(|level| {
            let time_s = level.time_ns as f64 / 1e9;
            (
                area.x(x.place(time_s)),
                area.y(scale.place((curve.value)(level))),
            )
        });
        path(points)
    };
    html! {
        (frame.draw())
        @if let Some(full) = strip.full {
            @let y = area.y(scale.place(full));
            path class="full" d=(path([(area.left, y), (area.x(1.0), y)])) { title { "full" } }
        }
        @for (at, curve) in strip.curves.iter().enumerate() {
            g class={ "s" (curve.series) } {
                path class="line" stroke-dasharray=(if at == 0 { "none" } else { "5 2" })
                    d=(line(curve)) { title { (curve.name) } }
                @if strip.curves.len() > 1 {
                    @let left = area.x(1.0) - 330.0 + 165.0 * at as f64;
                    @let y = area.top - 16.0;
                    path class="line" stroke-dasharray=(if at == 0 { "none" } else { "5 2" })
                        d=(path([(left, y - 4.5), (left + 24.0, y - 4.5)])) {}
                    text x=(Px(left + 30.0)) y=(Px(y)) { (curve.name) }
                }
            }
        }
    }
}

/// When faults began.
fn faulty(faults: &[&Fault], x: &Axis, area: &Area, named: bool) -> Markup {
    html! {
        @for (row, fault) in faults.iter().enumerate() {
            @let at = area.x(x.place(fault.time_ns as f64 / 1e9));
            path class="fault" d=(path([(at, area.top), (at, area.y(0.0))])) {
                title { (fault.name) }
            }
            @if named {
                @let y = area.top + 12.0 + 14.0 * (row % 8) as f64;
                (over_lines("fault-name", (at + 4.0, y), "start", &fault.name))
            }
        }
    }
}
