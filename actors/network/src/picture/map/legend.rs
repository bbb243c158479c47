//! What is what on a map, and how far a metre is.

use farside_actors::figure::svg::{Px, path};
use maud::{Markup, html};

use super::{Sheet, arrow, ends_of, entry_mark, exit_mark, nose};
use crate::picture::Surroundings;
use farside_actors::figure::relief::{contour_step_m, step};

/// The most that it is high.
pub(super) const HEIGHT: f64 = 24.0 * 15.0;
const ROW: f64 = 24.0;
/// About how long the scale bar is, in pixels.
const BAR: f64 = 110.0;

/// The rows from the place of the first one on.
pub(super) fn legend(sheet: &Sheet<'_>, (x, y): (f64, f64), coordination: bool) -> Markup {
    let site = &sheet.run.site;
    let (from, to) = match ends_of(&site.ground) {
        ("entry", to) => ("entry; +3: three in its queue", to),
        ends => ends,
    };
    let mut rows = vec![
        (disc(x, ""), "rover, and where it wants to go".to_owned()),
        (disc(x, " waits"), "waits for one that can move".to_owned()),
        (
            disc(x, " circle"),
            "wait for each other in a circle".to_owned(),
        ),
        (disc(x, " behind"), "waits for one in a circle".to_owned()),
        (
            arrow((x - 4.0, -4.0), (x + 34.0, -4.0), 8.0, ""),
            "waits for".to_owned(),
        ),
    ];
    if coordination {
        let line = html! { path class="coordination" d=(line(x)) {} };
        rows.push((line, "coordinated by max-plus".to_owned()));
    }
    rows.extend([
        (roads(x), "roadmap, in its nodes' colours".to_owned()),
        (post(x), "node".to_owned()),
        (
            html! { path class="radio" d=(line(x)) {} },
            "nodes that hear each other".to_owned(),
        ),
        (
            html! { path class="entry" d=(entry_mark((x + 12.0, 0.0))) {} },
            from.to_owned(),
        ),
        (
            html! { path class="exit" d=(exit_mark((x + 12.0, 0.0))) {} },
            to.to_owned(),
        ),
    ]);
    if !site.sensors.gaps().is_empty() {
        let gap = html! {
            g class="n0" { circle class="vertex gap" cx=(Px(x + 12.0)) cy="0" r="3.2" {} }
        };
        rows.push((gap, "where no node reaches a rover".to_owned()));
    }
    match &site.ground {
        Surroundings::Heights(terrain) => {
            let says = format!("contours every {} m,", contour_step_m(terrain));
            let lines = html! {
                path class="relief key" d=(path([(x, -3.0), (x + 26.0, -3.0)])) {}
                path class="relief low key" d=(path([(x, 3.0), (x + 26.0, 3.0)])) {}
            };
            rows.push((lines, format!("{says} dashed below 0")));
        }
        Surroundings::Walls { .. } => {
            let wall = html! { rect class="wall" x=(Px(x + 5.0)) y="-7" width="14" height="14" {} };
            rows.push((wall, "no way in".to_owned()));
        }
        Surroundings::Unknown => {}
    }
    html! {
        @for (row, (sample, says)) in rows.iter().enumerate() {
            @let at = y + ROW * row as f64;
            g transform={ "translate(0 " (Px(at)) ")" } {
                (sample)
                text x=(Px(x + 34.0)) y="4.5" { (says) }
            }
        }
        (scale_bar(sheet.px_per_m, (x, y + ROW * rows.len() as f64 + 10.0)))
    }
}

/// A bar of a round length in metres.
fn scale_bar(px_per_m: f64, (x, y): (f64, f64)) -> Markup {
    // The greatest round length that is no longer than the bar may be.
    let longest_m = BAR / px_per_m;
    let above_m = step(longest_m);
    let lengths_m = [1.0, 0.5, 0.4, 0.2].map(|part| part * above_m);
    let length_m = lengths_m.into_iter().find(|m| *m <= longest_m * 1.001);
    let length_m = length_m.unwrap_or(longest_m);
    let right = x + length_m * px_per_m;
    let says = match length_m {
        km if km >= 1000.0 => format!("{} km", km / 1000.0),
        m => format!("{m} m"),
    };
    html! {
        path class="scale" d={
            (path([(x, y - 4.0), (x, y + 4.0)])) (path([(x, y), (right, y)]))
            (path([(right, y - 4.0), (right, y + 4.0)]))
        } {}
        text x=(Px(right + 8.0)) y=(Px(y + 4.5)) { (says) }
    }
}

fn line(x: f64) -> String {
    path([(x, 0.0), (x + 26.0, 0.0)])
}

fn disc(x: f64, class: &str) -> Markup {
    let centre = (x + 12.0, 0.0);
    let class = format!("rover{class}");
    html! {
        path class=(class) d=(nose(centre, (x + 30.0, 0.0), 8.0)) {}
        circle class=(class) cx=(Px(centre.0)) cy="0" r="8" {}
    }
}

fn roads(x: f64) -> Markup {
    html! {
        g class="n0" { path class="road" d=(path([(x, 0.0), (x + 13.0, 0.0)])) {} }
        g class="n3" { path class="road" d=(path([(x + 13.0, 0.0), (x + 26.0, 0.0)])) {} }
    }
}

fn post(x: f64) -> Markup {
    let corners = [(12.0, -6.5), (18.5, 0.0), (12.0, 6.5), (5.5, 0.0)];
    let around = path(corners.map(|(dx, dy)| (x + dx, dy)));
    html! { g class="n0" { path class="post" d={ (around) "Z" } {} } }
}
