//! How many things are in which state over time, as areas on top of each other.

use farside_actors::figure::scale::Scale;
use farside_actors::figure::svg::{Area, Frame, Px, path};
use maud::{Markup, html};

use super::strip::Axis;

/// The states that things can be in, from below in the plot: a name and a class of the style for each.
pub(crate) type States<const N: usize> = [(&'static str, &'static str); N];

/// Things in states.
pub(crate) struct Stacked<'a, const N: usize> {
    pub(crate) states: &'a States<N>,
    /// From when on how many are in each state, in order of time along the axis. Each holds until the next, the
    /// last to the end of the axis.
    pub(crate) counts: &'a [(f64, [usize; N])],
    /// What is counted.
    pub(crate) label: &'static str,
    /// The most that there are.
    pub(crate) total: usize,
}

impl<const N: usize> Stacked<'_, N> {
    /// The areas.
    pub(crate) fn draw(&self, axis: &Axis, area: Area) -> Markup {
        let up = Scale::between(0.0, self.total.max(1) as f64);
        let frame = Frame {
            area,
            x_label: axis.label,
            x_ticks: axis.ticks.clone(),
            y_label: self.label.to_owned(),
            y_ticks: up.ticks(6.0),
        };
        let starts = self
            .counts
            .iter()
            .map(|(from, _)| area.x(axis.scale.place(*from)));
        let starts: Vec<f64> = starts.collect();
        let ends = starts.iter().skip(1).copied().chain([area.x(1.0)]);
        let spans: Vec<(f64, f64)> = starts.iter().copied().zip(ends).collect();
        html! {
            (frame.draw())
            @for (state, (name, class)) in self.states.iter().enumerate() {
                @if self.counts.iter().any(|(_, counts)| counts[state] > 0) {
                    g class=(class) {
                        path class="state" d=(self.outline(state, &spans, &up, &area)) { title { (name) } }
                    }
                }
            }
        }
    }

    /// The area of a state.
    fn outline(&self, state: usize, spans: &[(f64, f64)], up: &Scale, area: &Area) -> String {
        let level = |counts: &[usize; N], states: usize| {
            let below: usize = counts[..states].iter().sum();
            area.y(up.place(below as f64))
        };
        let counts = || {
            spans
                .iter()
                .zip(self.counts.iter().map(|(_, counts)| counts))
        };
        let above = counts().flat_map(|((from, to), counts)| {
            let y = level(counts, state + 1);
            [(*from, y), (*to, y)]
        });
        let below = counts().rev().flat_map(|((from, to), counts)| {
            let y = level(counts, state);
            [(*to, y), (*from, y)]
        });
        format!("{}Z", path(above.chain(below)))
    }

    /// What the areas are and how many there are at the end, from above as in the plot.
    pub(crate) fn legend(&self, area: Area) -> Markup {
        let x = area.x(1.0) + 16.0;
        let last = self.last();
        html! {
            @for (row, ((name, class), count)) in self.states.iter().zip(last).rev().enumerate() {
                @let y = area.top + 10.0 + 22.0 * row as f64;
                g class=(class) {
                    rect class="state" x=(Px(x)) y=(Px(y - 7.0)) width="16" height="14" {}
                }
                text x=(Px(x + 24.0)) y=(Px(y + 4.5)) { (name) ": " (count) }
            }
        }
    }

    /// How many there are in each state at the end.
    pub(crate) fn last(&self) -> [usize; N] {
        self.counts.last().map_or([0; N], |(_, last)| *last)
    }

    /// The same in a sentence.
    pub(crate) fn says(&self) -> String {
        let says = self.states.iter().zip(self.last());
        let says = says.map(|((name, _), count)| format!("{count} {name}"));
        format!("At the end: {}.", says.collect::<Vec<_>>().join(", "))
    }
}
