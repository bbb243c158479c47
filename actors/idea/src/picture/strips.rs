//! What an agent's cycles cost over time, as strips with a common axis: the share of its latency
//! (Figure 7 of the paper), what deliberation takes of it, and the tokens of its plan database
//! (Figure 6).

use farside_actors::figure::numbers::plain;
use farside_actors::figure::scale::{Scale, Tick, text_width};
use farside_actors::figure::svg::{Area, Frame, Px, over_lines, path};
use maud::{Markup, html};

use super::bars::Along;
use super::clock;
use super::history::AgentHistory;
use crate::monitor::Cause;
use crate::records::AgentCycle;

/// How high a strip is, in pixels.
pub(super) const HEIGHT: f64 = 96.0;
/// From strip to strip.
pub(super) const APART: f64 = 152.0;
/// The most peaks that are named.
const PEAKS: usize = 8;
/// The width in which cycles are drawn as one, in pixels.
const COLUMN: f64 = 2.0;
/// The whole latency \[%\].
const LATENCY: f64 = 100.0;
/// Where cycles are drawn that took longer \[%\]: it only matters that they did.
const BEYOND: f64 = 110.0;
/// The size of what is written at peaks.
const TEXT: f64 = 12.0;

/// The cycles of a column of a strip.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Column {
    x: f64,
    most: f64,
    mean: f64,
    cycles: u32,
}

/// A strip.
pub(super) struct Strip {
    label: String,
    series: usize,
    value: fn(&AgentCycle, u64) -> f64,
    names_peaks: bool,
    /// Whether what matters is the greatest of a column only.
    is_level: bool,
}

/// The strips of an agent.
pub(super) fn strips(agent: &AgentHistory, along: &Along) -> Vec<Strip> {
    let mut strips = vec![Strip {
        label: "cost of a cycle [% of the latency]".to_owned(),
        series: 0,
        value: |cycle, latency_ns| percent(cycle.cost_ns, latency_ns).min(BEYOND),
        names_peaks: true,
        is_level: false,
    }];
    let mut seen = seen(agent, along);
    if seen.any(|(_, cycle)| cycle.deliberation > 0) {
        strips.push(Strip {
            label: "deliberation in the rest of it [% of the latency]".to_owned(),
            series: 1,
            value: deliberation,
            names_peaks: false,
            is_level: false,
        });
    }
    strips.push(Strip {
        label: "tokens in the plan database".to_owned(),
        series: 2,
        value: |cycle, _| f64::from(cycle.tokens),
        names_peaks: false,
        is_level: true,
    });
    strips
}

fn percent(part_ns: u64, latency_ns: u64) -> f64 {
    100.0 * part_ns as f64 / latency_ns as f64
}

/// What deliberation took of the latency \[%\], an operation as dear as one of the cycle.
fn deliberation(cycle: &AgentCycle, latency_ns: u64) -> f64 {
    let rest_ns = latency_ns.saturating_sub(cycle.cost_ns);
    let each_ns = cycle.cost_ns / cycle.operations.max(1);
    percent(
        each_ns.saturating_mul(cycle.deliberation).min(rest_ns),
        latency_ns,
    )
}

/// The cycles that are seen.
fn seen<'a>(
    agent: &'a AgentHistory,
    along: &Along,
) -> impl Iterator<Item = &'a (u64, AgentCycle)> + use<'a> {
    let along = *along;
    agent
        .cycles
        .iter()
        .filter(move |(time_ns, _)| along.has(*time_ns))
}

impl Strip {
    fn columns(&self, agent: &AgentHistory, along: &Along) -> Vec<Column> {
        let mut columns: Vec<Column> = Vec::new();
        for (time_ns, cycle) in seen(agent, along) {
            let value = (self.value)(cycle, agent.latency_ns);
            let x = COLUMN * libm::floor(along.x(*time_ns) / COLUMN);
            match columns.last_mut() {
                Some(last) if last.x == x => {
                    last.most = last.most.max(value);
                    last.cycles += 1;
                    last.mean += (value - last.mean) / f64::from(last.cycles);
                }
                _ => columns.push(Column {
                    x,
                    most: value,
                    mean: value,
                    cycles: 1,
                }),
            }
        }
        columns
    }

    /// Its scale and where it is drawn, its upper edge at `top`.
    fn axes(&self, columns: &[Column], along: &Along, top: f64) -> (Scale, Area) {
        let most = columns.iter().map(|column| column.most).fold(0.0, f64::max);
        // Above the highest there is room for names.
        let room = if self.names_peaks { 1.3 } else { 1.1 };
        let scale = Scale::between(0.0, if most > 0.0 { room * most } else { 1.0 });
        let area = Area {
            left: along.left,
            top,
            width: along.right - along.left,
            height: HEIGHT,
        };
        (scale, area)
    }

    /// The strip, its upper edge at `top`, with these marks of time below.
    pub(super) fn draw(
        &self,
        agent: &AgentHistory,
        along: &Along,
        top: f64,
        (x_label, x_ticks): (&str, &[Tick]),
    ) -> Markup {
        let columns = self.columns(agent, along);
        let (scale, area) = self.axes(&columns, along, top);
        let frame = Frame {
            area,
            x_label,
            x_ticks: x_ticks.to_vec(),
            y_label: String::new(),
            y_ticks: scale.ticks(4.0),
        };
        let line = |value: fn(&Column) -> f64| {
            let point = |column: &Column| (column.x, area.y(scale.place(value(column))));
            path(columns.iter().map(point))
        };
        html! {
            (frame.draw())
            @if self.names_peaks && scale.high() > LATENCY {
                @let y = area.y(scale.place(LATENCY));
                path class="latency" d=(path([(area.left, y), (area.x(1.0), y)])) {
                    title { "the latency" }
                }
            }
            g class={ "s" (self.series) } {
                path class="cost" d=(line(|column| column.most)) { title { (self.label) } }
                @if self.is_thinned(&columns) {
                    path class="cost mean" d=(line(|column| column.mean)) {}
                }
            }
        }
    }

    /// What is written on it, over all lines.
    pub(super) fn written(&self, agent: &AgentHistory, along: &Along, top: f64) -> Markup {
        let columns = self.columns(agent, along);
        let (scale, area) = self.axes(&columns, along, top);
        html! {
            (over_lines("label", (8.0, top - 12.0), "start", &self.label))
            @if self.is_thinned(&columns) {
                (two_lines(self.series, area.x(1.0), top - 12.0))
            }
            @if self.names_peaks { (peaks(agent, along, &area, &scale)) }
        }
    }

    /// Whether its columns have more than one cycle, so that their mean says more.
    fn is_thinned(&self, columns: &[Column]) -> bool {
        !self.is_level && columns.iter().any(|column| column.cycles > 1)
    }
}

/// What the two lines of a strip are, beside its name.
fn two_lines(series: usize, right: f64, y: f64) -> Markup {
    let entry = |left: f64, class: &str, text: &str| {
        html! {
            g class={ "s" (series) } {
                path class=(class) d=(path([(left, y - 4.5), (left + 24.0, y - 4.5)])) {}
            }
            text x=(Px(left + 30.0)) y=(Px(y)) { (text) }
        }
    };
    html! {
        (entry(right - 250.0, "cost", "dearest cycle"))
        (entry(right - 116.0, "cost mean", "mean of cycles"))
    }
}

/// The dearest cycles that something can be said of, with what it is: no name over another.
fn peaks(agent: &AgentHistory, along: &Along, area: &Area, scale: &Scale) -> Markup {
    let caused = seen(agent, along).filter_map(|(time_ns, cycle)| {
        let text = match agent.cause(*time_ns, cycle) {
            _ if cycle.cost_ns >= agent.latency_ns => "beyond the latency",
            Cause::None => return None,
            cause => cause.name(),
        };
        Some((*time_ns, cycle, text))
    });
    let mut caused: Vec<(u64, &AgentCycle, &str)> = caused.collect();
    caused.sort_by_key(|(time_ns, cycle, _)| (std::cmp::Reverse(cycle.cost_ns), *time_ns));
    let mut named: Vec<([f64; 2], Markup)> = Vec::new();
    for (time_ns, cycle, text) in caused {
        if named.len() == PEAKS {
            break;
        }
        let x = along.x(time_ns);
        let half = 0.5 * text_width(text, TEXT);
        let middle = x.clamp(area.left + half, area.x(1.0) - half);
        let span = [middle - half - 4.0, middle + half + 4.0];
        if named
            .iter()
            .any(|([from, to], _)| span[0] < *to && *from < span[1])
        {
            continue;
        }
        let share = percent(cycle.cost_ns, agent.latency_ns);
        let y = area.y(scale.place(share.min(BEYOND)));
        let says = format!(
            "{text} at {}: {} operations, {} % of the latency",
            clock(time_ns),
            cycle.operations,
            plain(share)
        );
        let drawn = html! {
            circle class="peak" cx=(Px(x)) cy=(Px(y)) r="3" { title { (says) } }
            (over_lines("peak-name", (middle, y - 8.0), "middle", text))
        };
        named.push((span, drawn));
    }
    html! { @for (_, drawn) in &named { (drawn) } }
}
