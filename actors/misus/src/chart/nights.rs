//! When the Sun is below the horizon, as spans of a run's time and as shades behind a plot.

use farside_actors::field::Place;
use farside_actors::figure::svg::{Area, Px};
use farside_worlds::sky::SOL_S;
use maud::{Markup, html};

/// The nights between two times of a run, each from sunset to sunrise \[s since the start\].
pub(crate) fn spans_s(place: &Place, from_s: f64, to_s: f64) -> Vec<[f64; 2]> {
    let sol = |time_s: f64| libm::floor((place.starts_s + time_s) / SOL_S).max(0.0) as u32;
    let mut dark_from_s = from_s;
    let mut nights = Vec::new();
    for sol in sol(from_s)..=sol(to_s) {
        if let Some([rises_s, sets_s]) = place.sky.daylight_s(sol) {
            nights.push([dark_from_s, rises_s - place.starts_s]);
            dark_from_s = sets_s - place.starts_s;
        }
    }
    nights.push([dark_from_s, to_s]);
    let within = |[from, to]: [f64; 2]| [from.max(from_s), to.min(to_s)];
    let nights = nights.into_iter().map(within);
    nights.filter(|[from, to]| from < to).collect()
}

/// Shades behind an area whose left edge is `from_s` and whose right edge is `to_s`.
pub(crate) fn shades(place: &Place, (from_s, to_s): (f64, f64), area: &Area) -> Markup {
    let x = |time_s: f64| area.x((time_s - from_s) / (to_s - from_s));
    html! {
        @for [from, to] in spans_s(place, from_s, to_s) {
            rect class="night" x=(Px(x(from))) y=(Px(area.top)) width=(Px(x(to) - x(from)))
                height=(Px(area.height)) { title { "night" } }
        }
    }
}
