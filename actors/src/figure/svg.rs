//! Figures as SVG.
//!
//! Written by hand and not by a plotting crate, for what those that were looked at cannot do:
//! colours that follow the reader's light or dark theme and print, texts that a search finds and a
//! screen reader reads, a tooltip on each point. It takes axes, a legend and three hundred lines.

use maud::{Markup, PreEscaped, Render, html};

use super::colours::DASHES;
use super::scale::{Scale, Tick, text_width, thinned};

/// The size of the text in figures, in pixels of a figure's own.
pub const TEXT: f64 = 13.0;

/// A figure: one file, and one part of the page.
pub struct Figure {
    /// The file's name.
    pub file: String,
    /// What it shows, in a line.
    pub title: String,
    /// The same in a sentence or two, for who cannot see it.
    pub description: String,
    /// How wide it is, in pixels of its own.
    pub width: f64,
    /// How high it is.
    pub height: f64,
    /// What is drawn.
    pub body: Markup,
}

impl Figure {
    /// The figure as a part of a page, which brings the style.
    pub fn inline(&self) -> Markup {
        let id = self.file.trim_end_matches(".svg");
        let (title, description) = (format!("t-{id}"), format!("d-{id}"));
        html! {
            svg xmlns="http://www.w3.org/2000/svg" viewBox=(self.view_box()) role="img"
                width=(Px(self.width)) height=(Px(self.height))
                aria-labelledby={ (title) " " (description) } {
                title id=(title) { (self.title) }
                desc id=(description) { (self.description) }
                (self.body)
            }
        }
    }

    /// The figure as a file of its own.
    pub fn standalone(&self) -> String {
        let markup = html! {
            svg xmlns="http://www.w3.org/2000/svg" viewBox=(self.view_box()) role="img"
                width=(Px(self.width)) height=(Px(self.height)) class="figure" {
                title { (self.title) }
                desc { (self.description) }
                style { (PreEscaped(super::STYLE)) }
                rect class="paper" width="100%" height="100%" {}
                (self.body)
            }
        };
        // XML has no place for control characters, escaped or not.
        let allowed = |letter: char| !letter.is_control() || letter == '\n' || letter == '\t';
        let text = markup.into_string();
        let text: String = text.chars().filter(|letter| allowed(*letter)).collect();
        format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{text}\n")
    }

    fn view_box(&self) -> String {
        format!("0 0 {:.0} {:.0}", self.width, self.height)
    }
}

/// A coordinate, to a tenth of a pixel.
#[derive(Clone, Copy)]
pub struct Px(pub f64);

impl Render for Px {
    fn render_to(&self, out: &mut String) {
        use std::fmt::Write;
        let tenths = libm::round(self.0 * 10.0);
        // Writing to a string cannot fail; adding zero turns a minus zero into a zero.
        let _ = write!(out, "{}", tenths / 10.0 + 0.0);
    }
}

/// Points as the path's data: `M` to the first, `L` to the others.
pub fn path(points: impl IntoIterator<Item = (f64, f64)>) -> String {
    let mut data = String::new();
    for (x, y) in points {
        data.push(if data.is_empty() { 'M' } else { 'L' });
        Px(x).render_to(&mut data);
        data.push(' ');
        Px(y).render_to(&mut data);
    }
    data
}

/// Where a plot's marks go: a rectangle, y upwards.
#[derive(Clone, Copy, Debug)]
pub struct Area {
    /// The x of its left edge, in pixels of the figure.
    pub left: f64,
    /// The y of its upper edge.
    pub top: f64,
    /// How wide it is.
    pub width: f64,
    /// How high it is.
    pub height: f64,
}

impl Area {
    /// The x of a place from 0 to 1.
    pub fn x(&self, place: f64) -> f64 {
        self.left + place * self.width
    }

    /// The y of a place from 0 to 1.
    pub fn y(&self, place: f64) -> f64 {
        self.top + (1.0 - place) * self.height
    }
}

/// What is written along the axes.
pub struct Frame<'a> {
    /// Where the marks go.
    pub area: Area,
    /// What is written below.
    pub x_label: &'a str,
    /// The marks of x.
    pub x_ticks: Vec<Tick>,
    /// What y measures.
    pub y_label: String,
    /// The marks of y.
    pub y_ticks: Vec<Tick>,
}

impl Frame<'_> {
    /// Grid lines, axes and their texts. What y measures is written above, not sideways.
    pub fn draw(&self) -> Markup {
        let area = &self.area;
        let bottom = area.y(0.0);
        let written = thinned(&self.x_ticks, area.width, TEXT);
        html! {
            text class="label" x="8" y=(Px(area.top - 30.0)) { (self.y_label) }
            @for tick in &self.y_ticks {
                @let y = area.y(tick.at);
                path class="grid" d=(path([(area.left, y), (area.x(1.0), y)])) {}
                text class="tick" x=(Px(area.left - 8.0)) y=(Px(y + 4.5)) text-anchor="end" {
                    (tick.text)
                }
            }
            path class="axis" d=(path([(area.left, bottom), (area.x(1.0), bottom)])) {}
            @for tick in &self.x_ticks {
                @let x = area.x(tick.at);
                path class="axis" d=(path([(x, bottom), (x, bottom + 4.0)])) {}
            }
            @for tick in &written {
                text class="tick" x=(Px(area.x(tick.at))) y=(Px(bottom + 19.0))
                    text-anchor="middle" { (tick.text) }
            }
            text class="label" x=(Px(area.x(0.5))) y=(Px(bottom + 40.0)) text-anchor="middle" {
                (self.x_label)
            }
        }
    }
}

/// Ticks of a scale of measured values, as percent if it is a rate.
pub fn measured_ticks(scale: &Scale, percent: bool) -> Vec<Tick> {
    let mut ticks = scale.ticks(5.0);
    if percent {
        for tick in &mut ticks {
            tick.text.push_str(" %");
        }
    }
    ticks
}

/// How wide the widest of some texts is.
pub fn widest<'a>(texts: impl Iterator<Item = &'a str>) -> f64 {
    texts.map(|text| text_width(text, TEXT)).fold(0.0, f64::max)
}

/// A text at most so many letters long; what is cut is said by dots.
pub fn shortened(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        return text.to_owned();
    }
    let mut short: String = text.chars().take(most - 1).collect();
    short.push('…');
    short
}

/// A marker of a series, of its shape and colour, with what it says when pointed at.
pub fn marker(series: usize, x: f64, y: f64, says: &str) -> Markup {
    let series = series % DASHES.len();
    let class = format!("mark s{series}");
    let around = |points: &[(f64, f64)]| {
        let mut data = path(points.iter().map(|(dx, dy)| (x + dx, y + dy)));
        data.push('Z');
        data
    };
    let points: &[(f64, f64)] = match series {
        1 => &[(-3.6, -3.6), (3.6, -3.6), (3.6, 3.6), (-3.6, 3.6)],
        2 => &[(0.0, -5.0), (4.6, 3.4), (-4.6, 3.4)],
        3 => &[(0.0, -5.2), (5.2, 0.0), (0.0, 5.2), (-5.2, 0.0)],
        4 => &[(0.0, 5.0), (4.6, -3.4), (-4.6, -3.4)],
        5 => &[(-5.2, -2.0), (5.2, -2.0), (5.2, 2.0), (-5.2, 2.0)],
        6 => &[(-2.0, -5.2), (2.0, -5.2), (2.0, 5.2), (-2.0, 5.2)],
        _ => &[],
    };
    html! {
        @if points.is_empty() {
            circle class=(class) cx=(Px(x)) cy=(Px(y)) r="4" { title { (says) } }
        } @else {
            path class=(class) d=(around(points)) { title { (says) } }
        }
    }
}

/// A curve's name, beside its end.
pub struct EndLabel {
    /// Which series it belongs to, from 0: its colour and dashes.
    pub series: usize,
    /// Where it is, in pixels of the figure.
    pub y: f64,
    /// What is written.
    pub text: String,
}

/// Names beside the ends of curves, moved apart where they would overlap, each with a piece of its
/// line and, if the curve has markers, one of them.
pub fn end_labels(mut labels: Vec<EndLabel>, area: &Area, heading: &str, markers: bool) -> Markup {
    const APART: f64 = 17.0;
    labels.sort_by(|a, b| a.y.total_cmp(&b.y).then(a.series.cmp(&b.series)));
    let mut least = area.top + 6.0;
    for label in &mut labels {
        label.y = label.y.max(least);
        least = label.y + APART;
    }
    // Those that were moved below the plot push the others back up.
    let mut most = area.y(0.0);
    for label in labels.iter_mut().rev() {
        label.y = label.y.min(most);
        most = label.y - APART;
    }
    let x = area.x(1.0) + 10.0;
    html! {
        @if !heading.is_empty() {
            text class="label" x=(Px(x)) y=(Px(area.top - 10.0)) { (heading) }
        }
        @for label in &labels {
            path class={ "line s" (label.series) } stroke-dasharray=(DASHES[label.series])
                d=(path([(x, label.y), (x + 22.0, label.y)])) {}
            @if markers { (marker(label.series, x + 11.0, label.y, &label.text)) }
            text class="name" x=(Px(x + 27.0)) y=(Px(label.y + 4.5)) { (label.text) }
        }
    }
}

/// How much room names beside curves take.
pub fn end_label_room<'a>(texts: impl Iterator<Item = &'a str>, heading: &str) -> f64 {
    let names = widest(texts) + 27.0;
    // Headings are bold, and wider for it.
    10.0 + names.max(1.12 * text_width(heading, TEXT)) + 8.0
}

/// A file's name from some words: letters, digits and dashes.
pub fn slug(words: &str) -> String {
    let mut slug = String::new();
    for letter in words.chars() {
        if letter.is_ascii_alphanumeric() || letter == '_' || letter == '.' {
            slug.push(letter.to_ascii_lowercase());
        } else if !slug.ends_with('-') && !slug.is_empty() {
            slug.push('-');
        }
    }
    slug.trim_matches(['-', '.']).chars().take(80).collect()
}
