//! Curves over a common axis, one strip below the other.

use farside_actors::figure::numbers::plain;
use farside_actors::figure::scale::{Scale, Tick, text_width};
use farside_actors::figure::svg::{Area, Frame, Px, TEXT, path};
use maud::{Markup, html};

/// A curve.
pub(crate) struct Curve {
    /// What it is called beside others; a strip with one curve does without.
    pub(crate) name: String,
    /// Its colour, from 0.
    pub(crate) series: usize,
    /// How it is dashed.
    pub(crate) dashes: &'static str,
    /// Its points, in order: along the axis, and the value.
    pub(crate) points: Vec<(f64, f64)>,
    /// Whether each point has a mark.
    pub(crate) is_marked: bool,
}

/// One strip.
pub(crate) struct Strip {
    /// What it shows, with its unit.
    pub(crate) label: String,
    /// What is drawn; the first is drawn last.
    pub(crate) curves: Vec<Curve>,
    /// What values are at the most, and what is written at it.
    pub(crate) bound: Option<(f64, String)>,
}

/// The axis that strips have in common.
pub(crate) struct Axis {
    /// Where values lie along it.
    pub(crate) scale: Scale,
    /// What is written below the last strip.
    pub(crate) label: &'static str,
    /// Its marks.
    pub(crate) ticks: Vec<Tick>,
}

impl Axis {
    /// From a value to another, with about so many marks.
    pub(crate) fn between(low: f64, high: f64, label: &'static str, count: f64) -> Axis {
        let scale = Scale::between(low, high);
        Axis {
            ticks: scale.ticks(count),
            scale,
            label,
        }
    }
}

impl Strip {
    /// The strip in an area; only the last one has the axis' label.
    pub(crate) fn draw(&self, axis: &Axis, area: Area, is_last: bool) -> Markup {
        let values = self.curves.iter().flat_map(|curve| &curve.points);
        let values = values.map(|(_, value)| *value);
        let bound = self.bound.iter().map(|(bound, _)| *bound);
        let scale = Scale::measured(values.chain(bound).chain([0.0]));
        let frame = Frame {
            area,
            x_label: if is_last { axis.label } else { "" },
            x_ticks: axis.ticks.clone(),
            y_label: self.label.clone(),
            y_ticks: scale.ticks(4.0),
        };
        let px = |(along, value): &(f64, f64)| {
            let x = area.x(axis.scale.place(*along));
            (x, area.y(scale.place(*value)))
        };
        html! {
            (frame.draw())
            @if let Some((bound, text)) = &self.bound {
                @let y = area.y(scale.place(*bound));
                path class="bound" d=(path([(area.left, y), (area.x(1.0), y)])) { title { (text) } }
                text class="tick" x=(Px(area.x(1.0))) y=(Px(y + 15.0)) text-anchor="end" { (text) }
            }
            @for curve in self.curves.iter().rev() {
                g class={ "s" (curve.series) } {
                    path class="line" stroke-dasharray=(curve.dashes)
                        d=(path(curve.points.iter().map(px))) { title { (curve.name) } }
                    @if curve.is_marked {
                        @for point in &curve.points {
                            @let (x, y) = px(point);
                            circle class="mark" cx=(Px(x)) cy=(Px(y)) r="3" {
                                title { (plain(point.1)) }
                            }
                        }
                    }
                }
            }
            @if self.curves.len() > 1 { (self.names(&area)) }
        }
    }

    /// The names of curves above the strip, the first at the left.
    fn names(&self, area: &Area) -> Markup {
        let widths = self
            .curves
            .iter()
            .map(|one| 30.0 + text_width(&one.name, TEXT) + 20.0);
        let widths: Vec<f64> = widths.collect();
        let left = area.x(1.0) + 20.0 - widths.iter().sum::<f64>();
        let y = area.top - 14.0;
        html! {
            @for (at, curve) in self.curves.iter().enumerate() {
                @let left = left + widths[..at].iter().sum::<f64>();
                g class={ "s" (curve.series) } {
                    path class="line" stroke-dasharray=(curve.dashes)
                        d=(path([(left, y - 4.5), (left + 24.0, y - 4.5)])) {}
                }
                text x=(Px(left + 30.0)) y=(Px(y)) { (curve.name) }
            }
        }
    }
}
