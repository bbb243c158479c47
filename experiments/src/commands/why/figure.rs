//! A story as a picture: what the actor did over time, and below what was lost, worse or down.

use farside_actors::figure::Figure;
use farside_actors::figure::scale::{Scale, text_width};
use farside_actors::figure::svg::{Px, path, shortened};
use farside_actors::system::Doing;
use farside_logs::Log;
use maud::{Markup, html};

use super::story::{Story, Touching, seconds};
use super::text::{losses, rows};

/// The width of what is drawn over time, in pixels; left of it the names of lanes.
const WIDTH: f64 = 960.0;
const LEFT: f64 = 170.0;
const RIGHT: f64 = 30.0;
const TOP: f64 = 92.0;
/// The height of a lane, and from lane to lane.
const BAR: f64 = 26.0;
const LANE: f64 = 40.0;
/// The size of what is written on bars.
const TEXT: f64 = 12.0;
/// Beside the style of all figures.
const STYLE: &str = "\
svg text.title { font-size: 17px; font-weight: 600; }
svg text.lane { font-weight: 600; }
svg text.on-bar { font-size: 12px; }
svg .doing { stroke: currentColor; stroke-width: 1.1; fill: currentColor; fill-opacity: .2; }
svg .doing.waiting { fill-opacity: .45; }
svg .doing.down { fill-opacity: .85; }
svg .loss { fill: none; stroke: currentColor; stroke-width: 1.2; }
";

/// Where a time is.
struct Along {
    until_ns: u64,
}

impl Along {
    fn x(&self, time_ns: u64) -> f64 {
        let share = time_ns.min(self.until_ns) as f64 / self.until_ns.max(1) as f64;
        LEFT + share * WIDTH
    }
}

/// The figure of a story.
pub(super) fn figure(story: &Story, log: &Log, least_ns: u64) -> Figure {
    let along = Along {
        until_ns: story.until_ns,
    };
    let mut lanes: Vec<(String, Markup)> = Vec::new();
    lanes.push((story.actor.clone(), doing(story, &along, least_ns, TOP)));
    for (name, is_for_it) in [("lost, to it", true), ("lost, from it", false)] {
        let y = TOP + LANE * lanes.len() as f64;
        lanes.push((name.to_owned(), lost(story, &along, is_for_it, y)));
    }
    for (kind, touching) in [("degrade", &story.degrades), ("crash", &story.crashes)] {
        for entry in touching {
            let y = TOP + LANE * lanes.len() as f64;
            let name = format!("[[{kind}]] {}", entry.entry + 1);
            lanes.push((name, touched(entry, &along, story.until_ns, y)));
        }
    }
    let bottom = TOP + LANE * lanes.len() as f64;
    let scale = Scale::between(0.0, story.until_ns as f64 / 1e9);
    let title = format!(
        "{} in {}, seed {}",
        story.actor,
        log.scenario_name(),
        log.seed()
    );
    let body = html! {
        text class="title" x="16" y="28" { (title) }
        text class="tick" x="16" y="50" { (story.outcome()) }
        (legend())
        @for tick in scale.ticks(10.0) {
            @let x = LEFT + tick.at * WIDTH;
            path class="grid" d=(path([(x, TOP - 6.0), (x, bottom)])) {}
            text class="tick" x=(Px(x)) y=(Px(bottom + 18.0)) text-anchor="middle" { (tick.text) }
        }
        text class="label" x=(Px(LEFT + WIDTH / 2.0)) y=(Px(bottom + 40.0)) text-anchor="middle" {
            "seconds since the start"
        }
        @for (row, (name, drawn)) in lanes.iter().enumerate() {
            @let y = TOP + LANE * row as f64 + BAR / 2.0 + 4.5;
            text class="lane" x=(Px(LEFT - 12.0)) y=(Px(y)) text-anchor="end" { (shortened(name, 22)) }
            (drawn)
        }
    };
    Figure {
        file: format!("why-{}.svg", story.actor.replace('/', "-")),
        title: format!("Why: {title}"),
        description: story.outcome(),
        width: LEFT + WIDTH + RIGHT,
        height: bottom + 56.0,
        body,
        facet: String::new(),
        style: STYLE,
    }
}

fn class(doing: Doing) -> &'static str {
    match doing {
        Doing::Active => "s2",
        Doing::Waiting => "s4",
        Doing::Down => "s1",
        Doing::Done => "s0",
    }
}

fn legend() -> Markup {
    let all = [Doing::Active, Doing::Waiting, Doing::Down, Doing::Done];
    html! {
        @for (at, doing) in all.into_iter().enumerate() {
            @let x = LEFT + 100.0 * at as f64;
            g class=(class(doing)) {
                rect class={ "doing " (doing.name()) } x=(Px(x)) y="64" width="18" height="12" {}
            }
            text class="tick" x=(Px(x + 24.0)) y="74.5" { (doing.name()) }
        }
    }
}

/// What the actor did.
fn doing(story: &Story, along: &Along, least_ns: u64, y: f64) -> Markup {
    html! {
        @for row in rows(&story.account.phases, least_ns) {
            @let (from, until) = (along.x(row.from_ns), along.x(row.until_ns));
            @let width = (until - from).max(1.0);
            g class=(class(row.doing)) {
                rect class={ "doing " (row.doing.name()) } x=(Px(from)) y=(Px(y)) width=(Px(width))
                    height=(Px(BAR)) {
                    title { (seconds(row.from_ns)) " to " (seconds(row.until_ns)) ": " (row.text) }
                }
            }
            @let letters = ((width - 10.0) / text_width("n", TEXT)) as usize;
            @if letters >= 6 {
                text class="on-bar" x=(Px(from + 5.0)) y=(Px(y + BAR / 2.0 + 4.2)) {
                    (shortened(&row.text, letters))
                    title { (row.text) }
                }
            }
        }
    }
}

/// Messages that were lost, a line for each; one for those that fall on one pixel.
fn lost(story: &Story, along: &Along, is_for_it: bool, y: f64) -> Markup {
    let its = story
        .losses
        .iter()
        .filter(|lost| lost.is_for_it == is_for_it);
    let its: Vec<_> = its.cloned().collect();
    let groups: Vec<_> = its
        .chunk_by(|a, b| along.x(a.at_ns) as u64 == along.x(b.at_ns) as u64)
        .collect();
    html! {
        g class="s1" {
            @for group in groups {
                @let x = along.x(group[0].at_ns);
                path class="loss" d=(path([(x, y + 4.0), (x, y + BAR - 4.0)])) {
                    title { (losses(group, is_for_it).unwrap_or_default()) }
                }
            }
        }
    }
}

/// When something of the scenario held.
fn touched(entry: &Touching, along: &Along, until_ns: u64, y: f64) -> Markup {
    let [from_ns, end_ns] = entry.within(until_ns);
    let (from, until) = (along.x(from_ns), along.x(end_ns));
    let width = (until - from).max(2.0);
    let letters = ((LEFT + WIDTH - from - 10.0) / text_width("n", TEXT)) as usize;
    html! {
        g class="s3" {
            rect class="doing" x=(Px(from)) y=(Px(y)) width=(Px(width)) height=(Px(BAR)) {
                title { (entry.text) }
            }
        }
        text class="on-bar" x=(Px(from + 5.0)) y=(Px(y + BAR / 2.0 + 4.2)) {
            (shortened(&entry.text, letters.max(6)))
        }
    }
}
