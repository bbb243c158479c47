//! What stands in the page before its scripts fill it, and how its parts become one file.

use maud::{DOCTYPE, Markup, PreEscaped, html};
use serde_json::{Value as Json, json};

use super::{Side, columns};

/// The style, behind the colours that all figures share.
const STYLE: &str = include_str!("assets/page.css");

/// The scripts, a concern each: one may use those before it.
pub(super) const SCRIPTS: [&str; 9] = [
    include_str!("assets/data.js"),
    include_str!("assets/look.js"),
    include_str!("assets/timeline.js"),
    include_str!("assets/map.js"),
    include_str!("assets/sequence.js"),
    include_str!("assets/causes.js"),
    include_str!("assets/plots.js"),
    include_str!("assets/differences.js"),
    include_str!("assets/page.js"),
];

/// What browsers may load for the page: nothing but what is in it.
const POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:; \
     base-uri 'none'; form-action 'none'";

/// The page of one or two logs.
pub(super) fn page(title: &str, sides: &[&Side], diff: &Json) -> String {
    let heads: Vec<&Json> = sides.iter().map(|side| &side.head).collect();
    let head = json!({ "sides": heads, "diff": diff });
    let markup = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="generator" content="farside view";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                link rel="icon" href="data:,";
                title { (title) }
                style { (PreEscaped(farside_actors::figure::STYLE)) (PreEscaped(STYLE)) }
            }
            body {
                header {
                    h1 { (title) }
                    p #facts .note { "Reading the page." }
                    noscript { p .bad { "This page draws with scripts, which are off in this browser." } }
                    ul #notes {}
                }
                (time_bar())
                main {
                    @if !diff.is_null() { (differences()) }
                    div .column { (map(sides.len())) (causes()) }
                    div .column { (chart(sides.len())) (plots()) }
                }
                footer { (help()) }
                (block("head", &columns::block(head.to_string().as_bytes())))
                @for (side, name) in sides.iter().zip(["a", "b"]) {
                    (block(&format!("rows-{name}"), &side.rows))
                    (block(&format!("map-{name}"), &side.map))
                    (block(&format!("series-{name}"), &side.series))
                    (block(&format!("details-{name}"), &side.details))
                }
                script type="module" { (PreEscaped(SCRIPTS.join("\n"))) }
            }
        }
    };
    markup.into_string()
}

fn block(name: &str, text: &str) -> Markup {
    html! { script type="text/plain" id={ "data-" (name) } { (PreEscaped(text)) } }
}

/// The one slider of the page, over an outline of what happened when.
fn time_bar() -> Markup {
    html! {
        section #time aria-label="Time" {
            div .buttons {
                button #play type="button" aria-pressed="false" title="Play or pause (space)" { "Play" }
                button #before type="button" title="The event before (,)" aria-label="The event before" { "◀" }
                button #after type="button" title="The event after (.)" aria-label="The event after" { "▶" }
                label { span .wide { "Speed " }
                    select #speed aria-label="Speed" {
                        option value="0.1" { "0.1×" } option value="1" selected { "1×" } option value="4" { "4×" }
                        option value="16" { "16×" } option value="64" { "64×" } option value="fit" { "all in 30 s" }
                    }
                }
                output #now for="slider" { "0 s" }
            }
            div .track {
                canvas #outline aria-hidden="true" {}
                input #slider type="range" min="0" max="1" step="any" value="0" aria-label="Time of the run";
            }
        }
    }
}

fn map(sides: usize) -> Markup {
    html! {
        section #map aria-labelledby="map-title" {
            h2 #map-title { "Map" }
            div .maps {
                @for name in &["a", "b"][..sides] {
                    figure {
                        @if sides > 1 { figcaption { (name.to_uppercase()) span .file data-side=(name) {} } }
                        canvas id={ "map-" (name) } tabindex="0" role="img" aria-label="Map" {}
                    }
                }
            }
            p #map-said .note aria-live="off" {}
        }
    }
}

fn chart(sides: usize) -> Markup {
    html! {
        section #chart aria-labelledby="chart-title" {
            h2 #chart-title { "Messages" }
            div .controls {
                @if sides > 1 {
                    fieldset .sides { legend .hidden { "Log" }
                        label { input type="radio" name="side" value="0" checked; "A" }
                        label { input type="radio" name="side" value="1"; "B" }
                    }
                }
                label { "Actors " input #actors type="search" placeholder="rover_0*, node_03"; }
                label { "Kind " select #kinds { option value="" { "all" } } }
                label { "Reason " select #reasons { option value="" { "all" } } }
                fieldset #fates { legend .hidden { "Fates" } }
                @if sides > 1 { label { input #differing type="checkbox"; "only what differs" } }
                span .buttons {
                    button #nearer type="button" title="Nearer (+)" aria-label="Zoom in" { "+" }
                    button #farther type="button" title="Farther (−)" aria-label="Zoom out" { "−" }
                    button #whole type="button" title="The whole run (0)" { "All" }
                    button #loss-before type="button" title="The loss before (L)" { "◀ loss" }
                    button #loss-after type="button" title="The next loss (l)" { "loss ▶" }
                    @if sides > 1 {
                        button #difference-before type="button" title="The difference before (D)" { "◀ differs" }
                        button #difference-after type="button" title="The next difference (d)" { "differs ▶" }
                    }
                }
            }
            div #lanes tabindex="0" role="application" aria-labelledby="chart-title" aria-describedby="chart-help" {
                canvas #sequence {}
                div #room {}
            }
            p #chart-said .note role="status" {}
            ul #legend .note {}
            p #chart-help .hidden {
                "Arrow keys step through what is shown in time; up and down go to the actor above or below; \
                 Enter selects; plus and minus zoom; l goes to the next loss."
            }
        }
    }
}

fn causes() -> Markup {
    html! {
        section #causes aria-labelledby="causes-title" {
            h2 #causes-title { "Message and causes" }
            p #selected-said .hidden role="status" {}
            div #message {
                p .note { "Choose a message in the chart: what led to it is listed here, back to its root." }
            }
        }
    }
}

fn plots() -> Markup {
    html! {
        section #plots aria-labelledby="plots-title" {
            h2 #plots-title { "Over time" }
            div .controls {
                label { "Add " select #fields { option value="" { "a field" } } }
            }
            div #panels {}
            p #plots-said .note {}
        }
    }
}

fn differences() -> Markup {
    html! {
        section #differences aria-labelledby="differences-title" {
            h2 #differences-title { "What differs" }
            div #difference {}
        }
    }
}

fn help() -> Markup {
    html! {
        details {
            summary { "Keys" }
            p .note {
                "Space plays and pauses. Left and right step by a hundredth of what the chart shows, comma and full stop \
                 from event to event, l and L from loss to loss, d and D from one message that differs to the next; plus and minus zoom the chart, 0 shows all of it. In the \
                 chart the arrow keys go from message to message and Enter selects; drag moves in time, and two fingers \
                 or Ctrl and the wheel zoom. On the map drag moves, the wheel zooms, and a double click shows all of it."
            }
        }
    }
}
