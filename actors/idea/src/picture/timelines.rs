//! The timelines of an agent over a time span: a lane for each, with lines over all lanes where there
//! was an alarm or a fault; below, what its cycles cost.

use farside_actors::figure::Figure;
use farside_actors::figure::numbers::plain;
use farside_actors::figure::scale::{Scale, Tick, text_width};
use farside_actors::figure::svg::{Px, over_lines, path};
use maud::{Markup, html};

use super::bars::{self, Along};
use super::clock;
use super::history::{AgentHistory, History, Mark, MarkKind};
use super::strips;

/// The width of what is drawn over time, in pixels.
const WIDTH: f64 = 1080.0;
/// Left of it: the names of timelines, the marks of axes.
const LEFT: f64 = 140.0;
const RIGHT: f64 = 24.0;
/// From lane to lane.
const LANE: f64 = bars::HEIGHT + 8.0;
/// The middle of the legend.
const LEGEND: f64 = 76.0;
/// The first row of the names of lines, and from row to row.
const NAMES: f64 = 108.0;
const NAME_ROW: f64 = 15.0;
/// The most rows of names; lines whose names find no room have them in a title only.
const NAME_ROWS: usize = 4;
/// The size of those names.
const NAME: f64 = 12.0;

/// The timelines of the agent of this place, from a time to another.
pub(super) fn figure(history: &History, agent: usize, (from_ns, to_ns): (u64, u64)) -> Figure {
    let agent = &history.agents[agent];
    let along = Along {
        from_ns,
        to_ns,
        left: LEFT,
        right: LEFT + WIDTH,
    };
    let marks = history.rovers[agent.rover].marks.iter();
    let marks: Vec<&Mark> = marks.filter(|mark| along.has(mark.time_ns)).collect();
    let (names, rows) = names(&marks, &along);
    let top = NAMES + NAME_ROW * rows as f64;
    let bottom = top + LANE * agent.lanes.len() as f64;
    let strips = strips::strips(agent, &along);
    let first_strip = bottom + 48.0;
    let end = first_strip + strips::APART * strips.len() as f64;
    let (x_label, x_ticks) = times(from_ns, to_ns);
    let strip_top = |number: usize| first_strip + strips::APART * number as f64;
    let (lanes, on_lanes) = lanes(agent, &along, top);
    let title = format!(
        "{} of {}, seed {}, from {} to {}",
        agent.name,
        history.scenario,
        history.seed,
        clock(from_ns),
        clock(to_ns)
    );
    let says = says(agent, &marks, &along);
    let body = html! {
        (bars::hatchings())
        text class="title" x="16" y="28" { (title) }
        text class="tick" x="16" y="50" { (says) }
        (legend(agent, &marks, &along))
        (grid(&along, &x_ticks, top, [bottom, end - strips::APART + strips::HEIGHT]))
        (lanes)
        @for (number, strip) in strips.iter().enumerate() {
            @let is_last = number + 1 == strips.len();
            @let x = if is_last { (x_label, x_ticks.as_slice()) } else { ("", &[][..]) };
            (strip.draw(agent, &along, strip_top(number), x))
        }
        (lines(&marks, &along, top, end - strips::APART + strips::HEIGHT))
        (on_lanes)
        @for (number, strip) in strips.iter().enumerate() {
            (strip.written(agent, &along, strip_top(number)))
        }
        (names)
    };
    Figure {
        file: format!("timelines-{}.svg", agent.name),
        title: format!("Timelines of {title}"),
        description: says,
        width: LEFT + WIDTH + RIGHT,
        height: end,
        body,
        facet: String::new(),
        style: &super::STYLE,
    }
}

/// The lanes, the first one's upper edge at `top`, and what is written on them.
fn lanes(agent: &AgentHistory, along: &Along, top: f64) -> (Markup, Markup) {
    let lane_top = |row: usize| top + LANE * row as f64;
    let lanes = agent.lanes.iter().enumerate();
    let drawn: Vec<(Markup, Markup)> = lanes
        .map(|(row, lane)| bars::draw(lane, along, lane_top(row)))
        .collect();
    let below = html! {
        @for (row, lane) in agent.lanes.iter().enumerate() {
            @let name = lane.name.strip_suffix("_SV").unwrap_or(&lane.name);
            text class="lane" x=(Px(LEFT - 10.0)) y=(Px(lane_top(row) + 15.5)) text-anchor="end" {
                (name)
                title { (lane.name) }
            }
            (drawn[row].0)
        }
    };
    let above = html! {
        @for (row, lane) in agent.lanes.iter().enumerate() {
            (drawn[row].1)
            @if lane.is_polled && lane.said.is_empty() {
                @let at = (LEFT + 5.0, lane_top(row) + 15.2);
                (over_lines("on-bar soft", at, "start", "polls: the answers are messages"))
            }
        }
    };
    (below, above)
}

/// The figure in a sentence or two.
fn says(agent: &AgentHistory, marks: &[&Mark], along: &Along) -> String {
    let cycles = agent.cycles.iter();
    let cycles = cycles.filter(|(time_ns, _)| along.has(*time_ns));
    let (count, cost_ns) = cycles.fold((0u64, 0u64), |(count, cost_ns), (_, cycle)| {
        (count + 1, cost_ns + cycle.cost_ns.min(agent.latency_ns))
    });
    let share = 100.0 * cost_ns as f64 / (count * agent.latency_ns).max(1) as f64;
    let mut parts = vec![format!(
        "{count} cycles, busy {} % of the time",
        plain(share)
    )];
    for kind in MarkKind::ALL {
        match marks.iter().filter(|mark| mark.kind == kind).count() {
            0 => {}
            of => parts.push(format!("{}: {of}", kind.plural())),
        }
    }
    format!("{}.", parts.join("; "))
}

/// The marks of time, in units that fit.
fn times(from_ns: u64, to_ns: u64) -> (&'static str, Vec<Tick>) {
    let span_ns = to_ns - from_ns;
    let (label, unit_ns) = match span_ns / 1_000_000_000 {
        0..=180 => ("seconds since the start", 1e9),
        181..=10_800 => ("minutes since the start", 60e9),
        _ => ("hours since the start", 3600e9),
    };
    let scale = Scale::between(from_ns as f64 / unit_ns, to_ns as f64 / unit_ns);
    (label, scale.ticks(12.0))
}

/// Thin lines at the marks of time, through lanes and strips, and the edge of the lanes.
fn grid(along: &Along, ticks: &[Tick], top: f64, [lanes_end, end]: [f64; 2]) -> Markup {
    html! {
        @for tick in ticks {
            @let x = along.left + tick.at * (along.right - along.left);
            path class="grid" d=(path([(x, top - 4.0), (x, end)])) {}
        }
        path class="axis" d=(path([(along.left, top - 4.0), (along.left, lanes_end)])) {}
    }
}

/// The lines of marks, through all lanes and strips.
fn lines(marks: &[&Mark], along: &Along, top: f64, end: f64) -> Markup {
    html! {
        @for mark in marks {
            @let x = along.x(mark.time_ns);
            path class={ "mark-line " (mark.kind.class()) } d=(path([(x, top - 8.0), (x, end)])) {
                title { (mark.says) " at " (clock(mark.time_ns)) }
            }
        }
    }
}

/// The names of lines, in as many rows as they take, and how many those are.
fn names(marks: &[&Mark], along: &Along) -> (Markup, usize) {
    // By row: up to where something is written.
    let mut rows: Vec<f64> = Vec::new();
    let mut placed: Vec<(usize, f64, &Mark)> = Vec::new();
    for mark in marks {
        let width = text_width(&mark.text, NAME);
        let x = along.x(mark.time_ns).min(along.right - width);
        let free = rows.iter().position(|end| *end <= x);
        let row = match free {
            Some(row) => row,
            None if rows.len() < NAME_ROWS => {
                rows.push(f64::NEG_INFINITY);
                rows.len() - 1
            }
            None => continue,
        };
        rows[row] = x + width + 8.0;
        placed.push((row, x, mark));
    }
    let drawn = html! {
        @for (row, x, mark) in &placed {
            @let y = NAMES + NAME_ROW * (rows.len() - 1 - row) as f64 - 6.0;
            @let class = format!("mark-name {}", mark.kind.class());
            (over_lines(&class, (*x, y), "start", &mark.text))
        }
    };
    (drawn, rows.len())
}

/// What lines and bars mean.
fn legend(agent: &AgentHistory, marks: &[&Mark], along: &Along) -> Markup {
    let mut entries: Vec<(Markup, &str)> = Vec::new();
    for kind in MarkKind::ALL {
        if marks.iter().any(|mark| mark.kind == kind) {
            let data = path([(0.0, 0.0), (24.0, 0.0)]);
            let class = format!("mark-line {}", kind.class());
            entries.push((html! { path class=(class) d=(data) {} }, kind.name()));
        }
    }
    let bar = |class: &str| {
        html! { rect class=(class) x="0" y="-6" width="24" height="12" {} }
    };
    entries.push((bar("said s0"), "what a timeline says"));
    entries.push((bar("quiet"), "nothing is asked of it"));
    if agent.lanes.iter().any(|lane| bars::has_many(lane, along)) {
        entries.push((bar("many s0"), "many, each too short to be seen"));
    }
    let mut left = 16.0;
    let mut placed = Vec::new();
    for (sample, text) in entries {
        placed.push((left, sample, text));
        left += 30.0 + text_width(text, farside_actors::figure::svg::TEXT) + 22.0;
    }
    html! {
        @for (left, sample, text) in placed {
            g transform={ "translate(" (Px(left)) " " (Px(LEGEND)) ")" } {
                (sample)
                text x="30" y="4.5" { (text) }
            }
        }
    }
}
