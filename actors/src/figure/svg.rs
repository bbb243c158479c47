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
    /// What tells it from others that show the same of something else, and is written in it; mostly
    /// empty.
    pub facet: String,
    /// Rules for classes of its own, beside [`super::STYLE`], written as those are; mostly none.
    pub style: &'static str,
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
                @if !self.style.is_empty() { style { (PreEscaped(self.style)) } }
                (self.body)
            }
        }
    }

    /// The figure as a file of its own, which browsers show in the reader's colours, and all other
    /// programs in those for light paper.
    pub fn standalone(&self) -> String {
        let css = format!("{}{}", super::STYLE, self.style);
        let [plain, themed] = super::style::standalone(&css);
        let markup = html! {
            svg xmlns="http://www.w3.org/2000/svg" viewBox=(self.view_box()) role="img"
                width=(Px(self.width)) height=(Px(self.height)) class="figure" {
                title { (self.title) }
                desc { (self.description) }
                style { (PreEscaped(plain)) }
                style { (PreEscaped(themed)) }
                rect class="paper" width=(Px(self.width)) height=(Px(self.height)) {}
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

/// The most that a line of an axis' label is wide, in pixels.
const LABEL: f64 = 350.0;

/// A label in a line, or in two where one is too narrow; what is too long for two is cut.
fn in_two_lines(text: &str, width: f64) -> [String; 2] {
    // Labels are bold, and wider for it.
    let fits = |text: &str| 1.12 * text_width(text, TEXT) <= width;
    if fits(text) {
        return [text.to_owned(), String::new()];
    }
    let mut spaces = text.match_indices(' ').map(|(at, _)| at);
    let cut = spaces.rfind(|at| fits(&text[..*at]));
    let Some(cut) = cut else {
        return [shortened(text, 48), String::new()];
    };
    [text[..cut].to_owned(), shortened(text[cut..].trim(), 48)]
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
            @let [first, second] = in_two_lines(&self.y_label, LABEL);
            text class="label" x="8" y=(Px(area.top - 30.0)) { (first) }
            @if !second.is_empty() {
                text class="label" x="8" y=(Px(area.top - 14.0)) { (second) }
            }
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
            // What is wider than the plot begins at the figure's left edge.
            @let half = 0.56 * text_width(self.x_label, TEXT);
            text class="label" x=(Px(area.x(0.5).max(half + 8.0))) y=(Px(bottom + 40.0))
                text-anchor="middle" { (self.x_label) }
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

/// A text on a rim of paper, so that it can be read over lines. It is written twice, because not all
/// programs can paint a rim behind a letter.
pub fn over_lines(class: &str, (x, y): (f64, f64), anchor: &str, text: &str) -> Markup {
    html! {
        text class={ (class) " halo" } x=(Px(x)) y=(Px(y)) text-anchor=(anchor) aria-hidden="true" {
            (text)
        }
        text class=(class) x=(Px(x)) y=(Px(y)) text-anchor=(anchor) { (text) }
    }
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

/// A marker of a series, of its shape and colour, with what it says when pointed at; hollow where
/// it is not of all runs.
pub fn marker(series: usize, (x, y): (f64, f64), is_whole: bool, says: &str) -> Markup {
    let series = series % DASHES.len();
    let class = match is_whole {
        true => format!("mark s{series}"),
        false => format!("mark some s{series}"),
    };
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

/// A curve's name in a legend.
pub struct CurveName {
    /// Which series it belongs to, from 0: its colour and dashes.
    pub series: usize,
    /// Where the curve ends, in pixels of the figure.
    pub y: f64,
    /// Where it is among curves that end at one place: those of less come first.
    pub rank: f64,
    /// What is written.
    pub text: String,
}

/// How far names are apart that stand above each other.
const APART: f64 = 18.0;
/// The room for a piece of a curve's line before its name.
const SAMPLE: f64 = 27.0;

/// Puts names in the order in which curves end, from above; those of curves that end too near to
/// each other to be told apart, by their rank.
fn in_order(names: &mut [CurveName]) {
    let ends = || names.iter().map(|name| name.y);
    let spread = ends().fold(f64::NEG_INFINITY, f64::max) - ends().fold(f64::INFINITY, f64::min);
    let are_apart = spread > 0.5 * APART * names.len().saturating_sub(1) as f64;
    names.sort_by(|a, b| {
        let by_end = a.y.total_cmp(&b.y);
        let by_rank = a.rank.total_cmp(&b.rank);
        let (first, second) = match are_apart {
            true => (by_end, by_rank),
            false => (by_rank, by_end),
        };
        first.then(second).then(a.series.cmp(&b.series))
    });
}

/// A piece of a curve's line, with one of its markers if it has any, and its name.
fn sample(name: &CurveName, x: f64, y: f64, markers: bool) -> Markup {
    html! {
        path class={ "line s" (name.series) } stroke-dasharray=(DASHES[name.series])
            d=(path([(x, y), (x + 22.0, y)])) {}
        @if markers { (marker(name.series, (x + 11.0, y), true, &name.text)) }
        text class="name" x=(Px(x + SAMPLE)) y=(Px(y + 4.5)) { (name.text) }
    }
}

/// Names beside the ends of curves, moved apart where they would overlap, below a heading that ends
/// at `right`.
pub fn names_beside(
    mut names: Vec<CurveName>,
    area: &Area,
    heading: &str,
    right: f64,
    markers: bool,
) -> Markup {
    in_order(&mut names);
    let mut least = area.top + 6.0;
    for name in &mut names {
        name.y = name.y.max(least);
        least = name.y + APART;
    }
    // Those that were moved below the plot push the others back up.
    let mut most = area.y(0.0);
    for name in names.iter_mut().rev() {
        name.y = name.y.min(most);
        most = name.y - APART;
    }
    let x = area.x(1.0) + 10.0;
    html! {
        @if !heading.is_empty() {
            text class="label" x=(Px(right)) y=(Px(area.top - 10.0)) text-anchor="end" { (heading) }
        }
        @for name in &names { (sample(name, x, name.y, markers)) }
    }
}

/// How much room names beside curves take.
pub fn room_beside<'a>(texts: impl Iterator<Item = &'a str>) -> f64 {
    10.0 + SAMPLE + widest(texts) + 8.0
}

/// Names below a plot, in as many rows as they take, and how high those are. The first row begins
/// with the heading.
pub fn names_below(
    mut names: Vec<CurveName>,
    heading: &str,
    (left, top): (f64, f64),
    width: f64,
    markers: bool,
) -> (Markup, f64) {
    in_order(&mut names);
    // Headings are bold, and wider for it.
    let after_heading = match heading {
        "" => left,
        heading => left + 1.12 * text_width(heading, TEXT) + 14.0,
    };
    let (mut x, mut y) = (after_heading, top);
    let mut placed = Vec::new();
    for name in &names {
        let needed = SAMPLE + text_width(&name.text, TEXT) + 16.0;
        if x + needed > left + width && x > left {
            (x, y) = (left, y + APART);
        }
        placed.push((x, y));
        x += needed;
    }
    let markup = html! {
        @if !heading.is_empty() {
            text class="label" x=(Px(left)) y=(Px(top + 4.5)) { (heading) }
        }
        @for (name, (x, y)) in names.iter().zip(&placed) { (sample(name, *x, *y, markers)) }
    };
    (markup, y - top + APART)
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

#[cfg(test)]
mod tests {
    use super::*;

    fn names(ends: &[(f64, f64)]) -> Vec<CurveName> {
        let name = |(series, (y, rank)): (usize, &(f64, f64))| CurveName {
            series,
            y: *y,
            rank: *rank,
            text: format!("curve {series}"),
        };
        ends.iter().enumerate().map(name).collect()
    }

    /// Where each name stands in a markup.
    fn order(markup: Markup) -> Vec<usize> {
        let text = markup.into_string();
        let parts = text.split("class=\"name\"").skip(1);
        let series = |part: &str| part.split("curve ").nth(1)?.chars().next()?.to_digit(10);
        parts.map(|part| series(part).unwrap() as usize).collect()
    }

    #[test]
    fn names_are_in_the_order_of_the_curves_ends() {
        let area = Area {
            left: 0.0,
            top: 0.0,
            width: 100.0,
            height: 200.0,
        };
        let apart = [(150.0, 0.0), (20.0, 1.0), (80.0, 2.0)];
        let beside = names_beside(names(&apart), &area, "", 100.0, true);
        assert_eq!(order(beside), [1, 2, 0]);
        // Ends that nobody can tell apart: by rank.
        let together = [(10.0, 2.0), (9.0, 1.0), (10.5, 0.0)];
        let (below, height) = names_below(names(&together), "names", (0.0, 0.0), 120.0, false);
        assert_eq!(order(below), [2, 1, 0]);
        assert!(height > APART, "{height}");
    }
}
