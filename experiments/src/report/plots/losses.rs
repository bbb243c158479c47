//! Where messages were lost: for each cell a bar, parted by reason.

use maud::{Markup, html};

use crate::report::csv::reasons;
use crate::report::measure::Study;
use crate::study::results::MessageCounts;
use farside_actors::figure::colours::SERIES;
use farside_actors::figure::numbers::{decimal, plain};
use farside_actors::figure::scale::{Scale, text_width};
use farside_actors::figure::svg::{
    Area, Figure, Px, measured_ticks, path, shortened, slug, widest,
};

/// Wider than other figures, for the cells' names; on a phone it scrolls.
const WIDTH: f64 = 560.0;
const ROW: f64 = 22.0;

/// A bar for each cell, as a share of all copies of messages. None if nothing was lost anywhere.
pub(in crate::report) fn figure(study: &Study<'_>) -> Option<Figure> {
    let reasons = shown_reasons(study);
    if reasons.is_empty() {
        return None;
    }
    let cells = &study.summary.cells;
    let names: Vec<String> = cells
        .iter()
        .map(|cell| match cell.texts.join(" · ") {
            text if text.is_empty() => "all runs".to_owned(),
            text => shortened(&text, 26),
        })
        .collect();
    let share = |counts: &MessageCounts| 100.0 * counts.lost as f64 / copies(counts).max(1) as f64;
    let scale = Scale::measured(cells.iter().map(|cell| share(&cell.messages)).chain([0.0]));
    let left = 16.0 + widest(names.iter().map(String::as_str));
    let (legend, legend_height) = legend(&reasons);
    let area = Area {
        left,
        top: legend_height + 44.0,
        width: WIDTH - left - 58.0,
        height: ROW * cells.len() as f64,
    };
    let factors: Vec<&str> = study
        .results
        .manifest
        .factors
        .iter()
        .map(|one| one.label.as_str())
        .collect();
    let body = html! {
        (legend)
        text class="label" x="8" y=(Px(area.top - 10.0)) { (shortened(&factors.join(" · "), 36)) }
        @for tick in measured_ticks(&scale, true) {
            @let x = area.x(tick.at);
            path class="grid" d=(path([(x, area.top), (x, area.y(0.0))])) {}
            text class="tick" x=(Px(x)) y=(Px(area.y(0.0) + 18.0)) text-anchor="middle" {
                (tick.text)
            }
        }
        text class="label" x=(Px(area.x(0.5))) y=(Px(area.y(0.0) + 39.0)) text-anchor="middle" {
            "copies of messages lost"
        }
        @for (index, cell) in cells.iter().enumerate() {
            @let y = area.top + ROW * index as f64;
            text class="tick" x=(Px(left - 8.0)) y=(Px(y + 15.5)) text-anchor="end" {
                (names[index])
            }
            (bar(&area, &scale, y, &cell.messages, &reasons))
        }
    };
    Some(Figure {
        file: format!("{}.svg", slug("losses by reason")),
        title: "Where messages were lost".to_owned(),
        description:
            "For each cell, the share of all copies of messages that were lost, parted by \
                      the reason of the loss."
                .to_owned(),
        width: WIDTH,
        height: area.y(0.0) + 50.0,
        body,
        facet: String::new(),
        style: "",
    })
}

/// The reasons, the most frequent first; beyond what has a colour of its own, `other`.
fn shown_reasons(study: &Study<'_>) -> Vec<(String, Vec<String>)> {
    let total = |reason: &str| -> u64 {
        let cells = study.summary.cells.iter();
        cells
            .map(|cell| {
                cell.messages
                    .lost_by_reason
                    .get(reason)
                    .copied()
                    .unwrap_or(0)
            })
            .sum()
    };
    let all = reasons(study.results).into_iter();
    let mut counted: Vec<(u64, String)> = all.map(|reason| (total(&reason), reason)).collect();
    counted.retain(|(count, _)| *count > 0);
    counted.sort_by(|(a, one), (b, other)| b.cmp(a).then(one.cmp(other)));
    let mut names: Vec<String> = counted.into_iter().map(|(_, reason)| reason).collect();
    let others = if names.len() > SERIES {
        names.split_off(SERIES - 1)
    } else {
        Vec::new()
    };
    let mut shown: Vec<(String, Vec<String>)> = names
        .into_iter()
        .map(|name| (name.clone(), vec![name]))
        .collect();
    if !others.is_empty() {
        shown.push(("other reasons".to_owned(), others));
    }
    shown
}

fn copies(counts: &MessageCounts) -> u64 {
    counts.delivered + counts.lost + counts.in_flight
}

fn bar(
    area: &Area,
    scale: &Scale,
    y: f64,
    counts: &MessageCounts,
    reasons: &[(String, Vec<String>)],
) -> Markup {
    let all = copies(counts).max(1) as f64;
    let mut until = 0.0;
    let parts: Vec<(f64, f64, u64, &str)> = reasons
        .iter()
        .map(|(name, members)| {
            let count = members
                .iter()
                .filter_map(|reason| counts.lost_by_reason.get(reason))
                .sum();
            let from = until;
            until += 100.0 * count as f64 / all;
            (from, until, count, name.as_str())
        })
        .collect();
    html! {
        @for (index, (from, to, count, name)) in parts.iter().enumerate() {
            @if *count > 0 {
                @let (start, end) = (area.x(scale.place(*from)), area.x(scale.place(*to)));
                rect class={ "bar s" (index) } x=(Px(start)) y=(Px(y + 3.0))
                    width=(Px((end - start).max(0.4))) height=(Px(ROW - 6.0)) {
                    title {
                        (name) ": " (plain(*count as f64)) " copies, "
                        (decimal(to - from, 2)) " %"
                    }
                }
            }
        }
        text class="small" x=(Px(area.x(scale.place(until)) + 6.0)) y=(Px(y + 15.0)) {
            (decimal(until, 1)) " %"
        }
    }
}

/// What the colours mean, in as many lines as it takes, and how high that is.
fn legend(reasons: &[(String, Vec<String>)]) -> (Markup, f64) {
    let (mut x, mut y) = (8.0, 12.0);
    let mut placed = Vec::new();
    for (index, (name, _)) in reasons.iter().enumerate() {
        let name = shortened(name, 40);
        let width = 18.0 + text_width(&name, 13.0) + 18.0;
        if x + width > WIDTH && x > 8.0 {
            (x, y) = (8.0, y + 20.0);
        }
        placed.push((index, x, y, name));
        x += width;
    }
    let markup = html! {
        @for (index, x, y, name) in &placed {
            rect class={ "bar s" (index) } x=(Px(*x)) y=(Px(*y - 9.0)) width="12" height="12" {}
            text class="name" x=(Px(x + 17.0)) y=(Px(y + 2.0)) { (name) }
        }
    };
    (markup, y)
}
