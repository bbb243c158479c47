//! What befell a survey as lines through a plot: hosts that went down and came up again.

use farside_actors::figure::scale::text_width;
use farside_actors::figure::svg::{Area, Px, over_lines, path};
use maud::{Markup, html};

use super::history::{History, Outages};

/// From name to name below each other.
const ROW: f64 = 15.0;
/// The size of names.
const TEXT: f64 = 12.0;

/// Lines through an area that shows a span of time, with names or without.
pub(super) fn draw(history: &History, span_ns: (u64, u64), area: &Area, has_names: bool) -> Markup {
    let rovers = history.rovers.iter().zip(&history.names);
    let rovers = rovers.map(|(rover, name)| (name.clone(), &rover.outages));
    let several = history.centres.len() > 1;
    let centres = history.centres.iter().map(|(site, outages)| {
        let name = match several {
            true => format!("centre {}", site + 1),
            false => "centre".to_owned(),
        };
        (name, outages)
    });
    let mut lines: Vec<(u64, String)> = Vec::new();
    for (name, outages) in rovers.chain(centres) {
        lines.extend(ends(&name, outages, span_ns));
    }
    lines.sort();
    let x = |at_ns: u64| area.x((at_ns - span_ns.0) as f64 / (span_ns.1 - span_ns.0) as f64);
    html! {
        @for (row, (at_ns, says)) in lines.iter().enumerate() {
            @let x = x(*at_ns);
            @let y = area.top + 13.0 + ROW * (row % 8) as f64;
            @let is_right = x + 4.0 + text_width(says, TEXT) > area.x(1.0);
            @let (at, anchor) = if is_right { (x - 4.0, "end") } else { (x + 4.0, "start") };
            path class="fault" d=(path([(x, area.top), (x, area.y(0.0))])) { title { (says) } }
            @if has_names { (over_lines("fault-name", (at, y), anchor, says)) }
        }
    }
}

/// When a host went down and came up again within a span.
fn ends(name: &str, outages: &Outages, (from_ns, to_ns): (u64, u64)) -> Vec<(u64, String)> {
    let all = outages.spans_ns.iter().flat_map(|(down_ns, up_ns)| {
        let down = (*down_ns, format!("{name} is down"));
        let up = up_ns.map(|up_ns| (up_ns, format!("{name} is up")));
        [Some(down), up].into_iter().flatten()
    });
    all.filter(|(at_ns, _)| (from_ns..=to_ns).contains(at_ns))
        .collect()
}

/// Where a rover was down within a span, as bars over an area.
pub(super) fn bars(outages: &Outages, span_ns: (u64, u64), area: &Area) -> Markup {
    let x = |at_ns: u64| area.x((at_ns - span_ns.0) as f64 / (span_ns.1 - span_ns.0) as f64);
    html! {
        @for (down_ns, up_ns) in outages.within(span_ns) {
            @let (left, right) = (x(down_ns), x(up_ns));
            rect class="down" x=(Px(left)) y=(Px(area.top)) width=(Px(right - left))
                height=(Px(area.height)) { title { "down" } }
            @if right - left > text_width("down", TEXT) + 8.0 {
                (over_lines("fault-name", (left + 5.0, area.top + 13.0), "start", "down"))
            }
        }
    }
}
