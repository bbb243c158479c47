//! Heat maps: estimates over two factors of numbers, written into their fields.

use maud::{Markup, html};

use super::{TOP, WIDTH};
use crate::report::layout::Axis;
use crate::report::measure::{Measure, Study};
use crate::stats::Estimate;
use farside_actors::figure::colours::cividis;
use farside_actors::figure::scale::text_width;
use farside_actors::figure::svg::{Area, Figure, Px, path, shortened, slug, widest};

/// From this width on, the interval fits too.
const WITH_INTERVAL: f64 = 82.0;

/// What the fields share.
struct Map<'a> {
    study: &'a Study<'a>,
    measure: &'a Measure<'a>,
    area: Area,
    columns: usize,
    rows: usize,
    /// The least and the greatest estimate.
    ends: (f64, f64),
}

/// The heat map, if the cells are a grid of two factors of numbers.
pub(super) fn map(study: &Study<'_>, measure: &Measure<'_>) -> Option<Figure> {
    let (across, up) = study.layout.map()?;
    let (x, y) = (&study.layout.axes[across], &study.layout.axes[up]);
    let (columns, rows) = (x.levels.len(), y.levels.len());
    let names: Vec<String> = y
        .levels
        .iter()
        .map(|level| shortened(&level.text, 14))
        .collect();
    let left = 18.0 + widest(names.iter().map(String::as_str));
    let estimates = study
        .summary
        .cells
        .iter()
        .filter_map(|cell| measure.estimate(cell));
    let estimates: Vec<Estimate> = estimates.collect();
    let texts: Vec<String> = estimates
        .iter()
        .map(|one| field_text(measure, one))
        .collect();
    let least = widest(texts.iter().map(String::as_str)) + 8.0;
    // Fields have room for their intervals; a map that is wider for it scrolls on a phone.
    let width = ((WIDTH - left - 12.0) / columns as f64)
        .max(least)
        .max(WITH_INTERVAL);
    let height = if width >= WITH_INTERVAL { 44.0 } else { 30.0 };
    let area = Area {
        left,
        top: TOP + 12.0,
        width: width * columns as f64,
        height: height * rows as f64,
    };
    let map = Map {
        study,
        measure,
        area,
        columns,
        rows,
        ends: ends(&estimates),
    };
    let body = html! {
        text class="label" x="8" y=(Px(area.top - 42.0)) { (measure.shown_label()) }
        text class="label" x="8" y=(Px(area.top - 10.0)) { (shortened(y.name(), 30)) }
        (map.legend())
        @for row in 0..rows {
            @let middle = area.top + height * ((rows - 1 - row) as f64 + 0.5);
            text class="tick" x=(Px(left - 8.0)) y=(Px(middle + 4.5)) text-anchor="end" {
                (names[row])
            }
            @for column in 0..columns {
                (map.field(across, column, row))
            }
        }
        (columns_named(&area, x, width))
    };
    let metric = &measure.metric.label;
    Some(Figure {
        file: format!("{}-map.svg", slug(&measure.metric.name)),
        title: format!("{metric}, each cell"),
        description: format!(
            "A heat map: the {} of {metric} for each {} and {}, with its 95 % interval.",
            measure.what(),
            x.name(),
            y.name()
        ),
        width: (area.x(1.0) + 12.0).max(WIDTH),
        height: area.y(0.0) + 52.0,
        body,
        facet: String::new(),
        style: "",
    })
}

fn columns_named(area: &Area, x: &Axis, width: f64) -> Markup {
    html! {
        @for (column, level) in x.levels.iter().enumerate() {
            text class="tick" x=(Px(area.left + width * (column as f64 + 0.5)))
                y=(Px(area.y(0.0) + 19.0)) text-anchor="middle" {
                (shortened(&level.text, (width / 8.0) as usize))
            }
        }
        text class="label" x=(Px(area.x(0.5))) y=(Px(area.y(0.0) + 42.0)) text-anchor="middle" {
            (x.name())
        }
    }
}

/// The least and the greatest estimate; not numbers if there is none.
fn ends(estimates: &[Estimate]) -> (f64, f64) {
    let values = estimates.iter().map(|estimate| estimate.value);
    let finite: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    // Of NaN and a number, the functions return the number.
    let least = finite.iter().copied().fold(f64::NAN, f64::min);
    (least, finite.iter().copied().fold(f64::NAN, f64::max))
}

/// What is written into a field: the estimate, whose unit is above the map.
fn field_text(measure: &Measure<'_>, estimate: &Estimate) -> String {
    measure.style.value(estimate).replace("\u{a0}%", "")
}

impl Map<'_> {
    fn share(&self, value: f64) -> f64 {
        let (least, most) = self.ends;
        if most > least {
            (value - least) / (most - least)
        } else {
            0.5
        }
    }

    fn field(&self, across: usize, column: usize, row: usize) -> Markup {
        let mut levels = vec![row; 2];
        levels[across] = column;
        let cell = self.study.layout.cell(&levels);
        let summary = cell.and_then(|cell| self.study.summary.cells.get(cell));
        let width = self.area.width / self.columns as f64;
        let height = self.area.height / self.rows as f64;
        let x = self.area.left + width * column as f64;
        let y = self.area.top + height * (self.rows - 1 - row) as f64;
        let found = summary.and_then(|cell| Some((cell, self.measure.estimate(cell)?)));
        let Some((summary, estimate)) = found else {
            return html! {
                rect class="nothing" x=(Px(x)) y=(Px(y)) width=(Px(width)) height=(Px(height)) {
                    title { "no run says anything" }
                }
            };
        };
        let is_baseline = self.study.summary.baseline == cell;
        let (colour, light) = if estimate.value.is_finite() {
            cividis(self.share(estimate.value))
        } else {
            ("#ffffff".to_owned(), false)
        };
        let class = if light { "on-dark" } else { "on-light" };
        let says = self.measure.tooltip(self.study, summary, &estimate);
        let (middle, centre) = (x + width / 2.0, y + height / 2.0);
        let interval = self.interval(&estimate, width);
        html! {
            g {
                rect class="field" x=(Px(x)) y=(Px(y)) width=(Px(width)) height=(Px(height))
                    fill=(colour) { title { (says) } }
                text class=(class) x=(Px(middle)) text-anchor="middle"
                    y=(Px(centre + if interval.is_some() { -2.0 } else { 4.5 })) {
                    (field_text(self.measure, &estimate))
                    @if self.measure.is_partial(summary) { "†" }
                }
                @if let Some(interval) = interval {
                    text class={ "small " (class) } x=(Px(middle)) y=(Px(centre + 13.0))
                        text-anchor="middle" {
                        (interval)
                    }
                }
                @if is_baseline {
                    rect class={ "baseline " (class) } x=(Px(x + 2.5)) y=(Px(y + 2.5))
                        width=(Px(width - 5.0)) height=(Px(height - 5.0)) {}
                }
            }
        }
    }

    /// The interval, if there is room for it.
    fn interval(&self, estimate: &Estimate, width: f64) -> Option<String> {
        if width < WITH_INTERVAL || estimate.low == estimate.high {
            return None;
        }
        let text = self.measure.style.interval(estimate);
        let text = text.replace(" to ", "–").replace("\u{a0}%", "");
        (text_width(&text, 12.5) < width - 10.0).then_some(text)
    }

    /// What the colours mean, from the least to the greatest, and which field is the baseline.
    fn legend(&self) -> Markup {
        let (least, most) = self.ends;
        let ends = [least, most].map(|value| {
            let value = self.measure.style.scaled(value);
            farside_actors::figure::numbers::plain(value)
        });
        let right = self.area.x(1.0).max(WIDTH - 12.0);
        let room = widest(std::iter::once(ends[1].as_str()));
        let (steps, step, y) = (24, 4.0, self.area.top - 21.0);
        let start = right - room - 8.0 - f64::from(steps) * step;
        html! {
            text class="tick" x=(Px(start - 6.0)) y=(Px(y + 10.5)) text-anchor="end" { (ends[0]) }
            @for index in 0..steps {
                @let (colour, _) = cividis(f64::from(index) / f64::from(steps - 1));
                rect x=(Px(start + f64::from(index) * step)) y=(Px(y)) width=(Px(step + 0.3))
                    height="12" fill=(colour) {}
            }
            text class="tick" x=(Px(right)) y=(Px(y + 10.5)) text-anchor="end" { (ends[1]) }
            @if self.study.summary.baseline.is_some() {
                @let y = self.area.y(0.0) + 42.0;
                rect class="baseline key" x=(Px(right - 74.0)) y=(Px(y - 10.0))
                    width="11" height="11" {}
                text class="tick" x=(Px(right)) y=(Px(y)) text-anchor="end" { "baseline" }
            }
            path class="axis" d=(path([
                (self.area.left, self.area.y(0.0)), (self.area.x(1.0), self.area.y(0.0)),
            ])) {}
        }
    }
}
