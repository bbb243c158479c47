//! The style of figures: for browsers in the reader's colours, for all other programs in plain ones.
//!
//! Rules are written once, with variables as colours. Browsers get them as they are, within
//! `@supports`. Programs that draw SVG without being browsers (rsvg, resvg, CairoSVG, Inkscape)
//! know no variables, and draw what they do not understand black: they skip `@supports`, and read
//! the same rules before it, with the light colours in place of the variables. Inkscape does not
//! skip it: it leaves out all of a `style` element that it does not understand. So there are two.

use std::collections::BTreeMap;

/// A rule outside of `@media`: selectors, and what they set.
type Rule<'a> = (&'a str, &'a str);

/// The style of a figure that is a file of its own, as two `style` elements: for all programs, and
/// for browsers. `css` has only rules, `@media` and, at `:root`, variables.
pub(super) fn standalone(css: &str) -> [String; 2] {
    let themed = format!("@supports (color: var(--ink)) {{\n{css}}}\n");
    [plain(css), themed]
}

/// The rules for light paper, with colours in place of variables and the least of selectors, so
/// that the ones for browsers outweigh them.
fn plain(css: &str) -> String {
    let rules = rules(css);
    let mut colours = BTreeMap::new();
    for (_, body) in rules.iter().filter(|(selectors, _)| *selectors == ":root") {
        for declaration in body.split(';') {
            if let Some((name, value)) = declaration.split_once(':') {
                colours.insert(name.trim(), value.trim());
            }
        }
    }
    let mut out = String::new();
    for (selectors, body) in rules.iter().filter(|(selectors, _)| *selectors != ":root") {
        let selectors: Vec<&str> = selectors
            .split(',')
            .map(|selector| selector.trim().trim_start_matches("svg "))
            .collect();
        let mut body = body.trim().to_owned();
        for (name, colour) in &colours {
            body = body.replace(&format!("var({name})"), colour);
        }
        out.push_str(&format!("{} {{ {body} }}\n", selectors.join(", ")));
    }
    out
}

/// The rules that stand outside of `@media`.
fn rules(css: &str) -> Vec<Rule<'_>> {
    let mut rules = Vec::new();
    let mut rest = css;
    while let Some(open) = rest.find('{') {
        let selectors = rest[..open].trim();
        let mut depth = 0usize;
        let close = rest[open..].char_indices().find_map(|(at, letter)| {
            match letter {
                '{' => depth += 1,
                '}' => depth -= 1,
                _ => {}
            }
            (depth == 0).then_some(open + at)
        });
        let close = close.unwrap_or(rest.len());
        if !selectors.starts_with('@') {
            rules.push((selectors, &rest[open + 1..close]));
        }
        rest = rest.get(close + 1..).unwrap_or("");
    }
    rules
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_rules_have_colours_for_variables() {
        let css = ":root { --ink: #111111; --soft: #222222; }\n\
                   @media print { :root { --ink: #000000; } svg .a { fill: red; } }\n\
                   svg .a, svg text.b { fill: var(--ink); stroke: var(--soft); }";
        let rules = ".a, text.b { fill: #111111; stroke: #222222; }\n";
        assert_eq!(plain(css), rules);
        let [plain, themed] = standalone(css);
        assert_eq!(plain, rules);
        assert!(themed.starts_with("@supports"), "{themed}");
    }

    #[test]
    fn every_variable_of_figures_has_a_colour() {
        let plain = plain(crate::figure::STYLE);
        assert!(!plain.contains("var("), "{plain}");
        assert!(plain.contains(".paper { fill: #ffffff; }"), "{plain}");
    }
}
