//! The marks of a chart, as SVG: texts, lines, bars.

use std::fmt::{self, Write};

use super::{BAD, INK, RULE, SOFT};

/// The size of the text, in pixels.
const TEXT: f64 = 13.0;

/// Okabe and Ito's colours, without the yellow, which is too faint on paper.
const COLOURS: [&str; 7] = [
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#1b1f24",
];

/// The lines of a hatching of 8 by 8 pixels.
const HATCHINGS: [&str; 7] = [
    "",
    "M-2 2L2 -2M0 8L8 0M6 10L10 6",
    "M4 3.2V4.8",
    "M-2 6L2 10M0 0L8 8M6 -2L10 2",
    "M4 0V8",
    "M0 8L8 0M0 0L8 8",
    "M0 4H8",
];

/// The text of an SVG file, while it is written.
#[derive(Default)]
pub(super) struct Sheet {
    body: String,
}

impl Sheet {
    /// A text that starts, ends or is centred here, by its classes.
    pub(super) fn text(&mut self, [x, y]: [f64; 2], class: &str, text: &str) {
        let (x, y, text) = (Px(x), Px(y), Escaped(text));
        self.write(format_args!(
            "<text class=\"{class}\" x=\"{x}\" y=\"{y}\">{text}</text>\n"
        ));
    }

    /// A text over other marks, on a rim of paper. It is written twice, since not all programs paint
    /// a rim behind a letter.
    pub(super) fn text_over(&mut self, at: [f64; 2], text: &str) {
        self.text(at, "halo", text);
        self.text(at, "", text);
    }

    pub(super) fn line(&mut self, [x1, y1]: [f64; 2], [x2, y2]: [f64; 2], class: &str) {
        let (x1, y1, x2, y2) = (Px(x1), Px(y1), Px(x2), Px(y2));
        self.write(format_args!(
            "<path class=\"{class}\" d=\"M{x1} {y1}L{x2} {y2}\"/>\n"
        ));
    }

    /// Lines from point to point.
    pub(super) fn path(&mut self, class: &str, points: &[[f64; 2]]) {
        self.write(format_args!("<path class=\"{class}\" d=\""));
        for (place, &[x, y]) in points.iter().enumerate() {
            let to = if place == 0 { 'M' } else { 'L' };
            self.write(format_args!("{to}{} {}", Px(x), Px(y)));
        }
        self.write(format_args!("\"/>\n"));
    }

    /// A bar in the colour and hatching of a predicate, with what it says when pointed at.
    pub(super) fn bar(&mut self, [x, y, w, h]: [f64; 4], of: usize, goal: bool, says: &str) {
        let (x, y, w, h) = (Px(x), Px(y), Px(w), Px(h));
        let colour = colour(of);
        let width = if goal { 2.2 } else { 1.2 };
        let shape = format!("x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\"");
        let says = Escaped(says);
        self.write(format_args!(
            "<g><title>{says}</title><rect {shape} fill=\"#ffffff\"/>\
             <rect {shape} fill=\"{colour}\" fill-opacity=\"0.2\"/>\
             <rect {shape} fill=\"url(#p{of})\" stroke=\"{colour}\" stroke-width=\"{width}\"/></g>\n"
        ));
    }

    /// A thin line between two times, with ends.
    pub(super) fn extent(&mut self, [from, to]: [f64; 2], y: f64, says: &str) {
        let (from, to, up, at, down) = (Px(from), Px(to), Px(y - 2.5), Px(y), Px(y + 2.5));
        let says = Escaped(says);
        self.write(format_args!(
            "<path class=\"extent\" d=\"M{from} {up}V{down}M{from} {at}H{to}M{to} {up}V{down}\">\
             <title>{says}</title></path>\n"
        ));
    }

    /// The mark of a goal, around a point.
    pub(super) fn diamond(&mut self, [x, y]: [f64; 2]) {
        let corners = [
            [x, y - 5.5],
            [x + 5.5, y],
            [x, y + 5.5],
            [x - 5.5, y],
            [x, y - 5.5],
        ];
        self.path("goal", &corners);
    }

    fn write(&mut self, arguments: fmt::Arguments<'_>) {
        // Writing to a string cannot fail.
        let _ = self.body.write_fmt(arguments);
    }

    /// The file: with a title, a description for who cannot see it, and `patterns` hatchings.
    pub(super) fn finish(
        self,
        [width, height]: [f64; 2],
        title: &str,
        description: &str,
        patterns: usize,
    ) -> String {
        let (width, height) = (Px(width), Px(height));
        let mut file = Sheet::default();
        file.write(format_args!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
             width=\"{width}\" height=\"{height}\" role=\"img\">\n<title>{}</title>\n\
             <desc>{}</desc>\n<style>{}</style>\n<defs>\n",
            Escaped(title),
            Escaped(description),
            style()
        ));
        for of in 0..patterns {
            let (colour, hatching) = (colour(of), HATCHINGS[hatching(of)]);
            // Dots are short lines with round ends.
            let stroke = if hatching == HATCHINGS[2] { 2.6 } else { 1.1 };
            file.write(format_args!(
                "<pattern id=\"p{of}\" width=\"8\" height=\"8\" patternUnits=\"userSpaceOnUse\">\
                 <path d=\"{hatching}\" stroke=\"{colour}\" stroke-opacity=\"0.7\" \
                 stroke-width=\"{stroke}\" stroke-linecap=\"round\" fill=\"none\"/></pattern>\n"
            ));
        }
        file.write(format_args!(
            "</defs>\n<rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>\n"
        ));
        file.body + &self.body + "</svg>\n"
    }
}

fn colour(of: usize) -> &'static str {
    COLOURS[of % COLOURS.len()]
}

/// Which hatching: with more predicates than colours, a colour comes with another one each time.
fn hatching(of: usize) -> usize {
    (of + of / COLOURS.len()) % HATCHINGS.len()
}

/// Literal colours: not all programs that show SVG know variables.
fn style() -> String {
    format!(
        "svg{{print-color-adjust:exact;-webkit-print-color-adjust:exact}}\
         text{{font-family:Roboto,system-ui,-apple-system,'Segoe UI','Helvetica Neue',Arial,\
         sans-serif;font-size:{TEXT}px;fill:{INK}}}\
         .title{{font-size:17px;font-weight:600}}.bold{{font-weight:600}}\
         .soft,.tick{{fill:{SOFT}}}.tick{{font-variant-numeric:tabular-nums}}\
         .middle{{text-anchor:middle}}.end{{text-anchor:end}}\
         .halo{{fill:#ffffff;stroke:#ffffff;stroke-width:4;stroke-linejoin:round}}\
         .bad{{fill:{BAD}}}\
         path{{fill:none}}.grid{{stroke:{RULE}}}.axis{{stroke:{SOFT}}}\
         .lane{{fill:#f4f6f8}}.extent{{stroke:{INK};stroke-width:1}}\
         .goal{{fill:{INK};stroke:#ffffff;stroke-width:1.5}}\
         .level{{stroke:#0072b2;stroke-width:2;stroke-linejoin:round}}\
         .under{{fill:#0072b2;fill-opacity:0.1}}\
         .limit{{stroke:{BAD};stroke-width:1.3;stroke-dasharray:6 4}}\
         .wrong{{fill:{BAD};fill-opacity:0.25}}"
    )
}

/// The width of a text, roughly: nobody measures fonts here.
pub(super) fn text_width(text: &str) -> f64 {
    let width = |letter: char| match letter {
        'i' | 'j' | 'l' | '.' | ',' | ' ' | '\'' | '|' | ':' | '(' | ')' => 0.34,
        'm' | 'w' | 'M' | 'W' | '%' => 0.88,
        letter if letter.is_ascii_uppercase() => 0.68,
        letter if letter.is_ascii() => 0.57,
        _ => 0.95,
    };
    text.chars().map(width).sum::<f64>() * TEXT
}

/// A text at most so many letters long; what is cut is said by dots.
pub(super) fn shortened(text: &str, most: usize) -> String {
    match text.chars().nth(most) {
        None => text.to_owned(),
        Some(_) => text.chars().take(most - 1).chain(['…']).collect(),
    }
}

/// A coordinate, to a tenth of a pixel.
struct Px(f64);

impl fmt::Display for Px {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Adding zero turns a minus zero into a zero.
        write!(f, "{}", (self.0 * 10.0).round() / 10.0 + 0.0)
    }
}

/// A text in which XML sees no marks. XML has no place for control characters, escaped or not.
struct Escaped<'a>(&'a str);

impl fmt::Display for Escaped<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for letter in self.0.chars() {
            match letter {
                '&' => f.write_str("&amp;")?,
                '<' => f.write_str("&lt;")?,
                '>' => f.write_str("&gt;")?,
                '"' => f.write_str("&quot;")?,
                '\u{fffe}' | '\u{ffff}' => {}
                letter if letter.is_control() => f.write_char(' ')?,
                letter => f.write_char(letter)?,
            }
        }
        Ok(())
    }
}
