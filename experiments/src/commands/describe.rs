//! What there is to say of a key of scenarios, from the one place where it is declared: for
//! `farside explain`, and for the comments of `farside check --comments`.

use std::collections::BTreeMap;

use farside_actors::system::{Key, Section};
use toml::de::{DeTable, DeValue};

use crate::registry::Registry;
use crate::scenario::shared_sections;

/// How wide lines are.
pub(super) const WIDTH: usize = 100;

/// All tables, those that every scenario may have first.
pub(super) fn sections(registry: &Registry) -> Vec<Section> {
    let own = registry.systems().flat_map(|system| system.sections());
    shared_sections().into_iter().chain(own).collect()
}

/// The name under which the keys of a table stand that scenarios name themselves, or number: those
/// of `radios.uhf` are those of `radios.NAME`, those of `links.rover_*` those of `links.default`.
pub(super) fn of_any(name: &str) -> String {
    let stands = |table: &str| match table {
        "links" => Some("links.default"),
        "radios" => Some("radios.NAME"),
        _ => None,
    };
    let Some((table, rest)) = name.split_once('.') else {
        return name.to_owned();
    };
    // Patterns and names have no dots, or stand in quotes.
    let (own, key) = match rest.strip_prefix(['"', '\'']) {
        Some(quoted) => quoted.split_once(['"', '\'']).unwrap_or((quoted, "")),
        None => rest.split_once('.').unwrap_or((rest, "")),
    };
    let key = key.trim_start_matches('.');
    let is_number = !own.is_empty() && own.bytes().all(|byte| byte.is_ascii_digit());
    let table = match stands(table) {
        Some(stands) => stands,
        None if is_number => table,
        None => return name.to_owned(),
    };
    match key {
        "" => table.to_owned(),
        key => format!("{table}.{key}"),
    }
}

/// What a key may be and what it is unless given, by what each fact is called.
pub(super) fn facts(section: &Section, key: &Key) -> Vec<(&'static str, String)> {
    let mut facts = Vec::new();
    if !key.aliases.is_empty() {
        facts.push(("also called", key.aliases.join(", ")));
    }
    let expected = [key.value, &key.expected];
    let expected: Vec<&str> = expected.into_iter().filter(|one| !one.is_empty()).collect();
    if !expected.is_empty() {
        facts.push(("expected", expected.join(", ")));
    }
    if !key.units.is_empty() {
        facts.push(("units", key.units.join(", ")));
    }
    // Of tables that scenarios name, and of entries, there is nothing at all unless given.
    let default = section.defaults.get(key.name);
    match default.filter(|value| !value.is_table()) {
        Some(default) => facts.push(("default", default.to_string())),
        None if default.is_none() && !section.defaults.is_empty() => {
            facts.push(("default", "none".to_owned()));
        }
        None => {}
    }
    let source = key.source();
    if !source.is_empty() {
        facts.push(("source", plain(&source.join(" "))));
    }
    facts
}

/// Lines of documentation as a paragraph of lines, without the blank before each and without
/// examples.
pub(super) fn prose(lines: &[&str], indent: &str) -> String {
    let lines = lines.iter().map(|line| line.trim());
    let lines = lines.take_while(|line| !line.starts_with("```") && !line.starts_with('|'));
    let mut lines: Vec<String> = lines
        .map(|line| format!("{indent}{}", plain(line)))
        .collect();
    while lines.last().is_some_and(|line| line.trim().is_empty()) {
        lines.pop();
    }
    lines.join("\n")
}

/// A line of documentation without what only pages of documentation show: links and escapes.
pub(super) fn plain(line: &str) -> String {
    let mut out = String::with_capacity(line.len());
    let mut rest = line;
    while let Some(at) = rest.find(['\\', ']']) {
        out.push_str(&rest[..at]);
        let tail = &rest[at..];
        if let Some(escaped) = tail.strip_prefix('\\') {
            let letter = escaped.chars().next();
            out.extend(letter);
            rest = &escaped[letter.map_or(0, char::len_utf8)..];
            continue;
        }
        // Links are of code: `[`Speed`]`, `[`Speed`](crate::Speed)`.
        let open = out.rfind('[').filter(|_| out.ends_with('`'));
        let open = open.filter(|open| out[open + 1..].starts_with('`'));
        let Some(open) = open else {
            out.push(']');
            rest = &tail[1..];
            continue;
        };
        out.remove(open);
        let target = tail
            .strip_prefix("](")
            .and_then(|tail| tail.split_once(')'));
        rest = target.map_or(&tail[1..], |(_, after)| after);
    }
    out + rest
}

/// A text in lines of at most so many letters, words kept whole.
pub(super) fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// A scenario's text with what each key is in comments before it. Comments stand only before lines
/// that begin with a key or with a table's name, so that the text reads as the same scenario.
pub(super) fn commented(text: &str, registry: &Registry) -> String {
    let Ok(document) = DeTable::parse(text) else {
        return text.to_owned();
    };
    let mut keys = BTreeMap::new();
    lines_of(document.get_ref(), "", text, &mut keys);
    let sections = sections(registry);
    let mut out = String::with_capacity(4 * text.len());
    let mut at = 0;
    for line in text.split_inclusive('\n') {
        let comments = keys.get(&at).and_then(|name| comments(name, &sections));
        for comment in comments.into_iter().flatten() {
            out.push_str(&format!("# {comment}\n"));
        }
        out.push_str(line);
        at += line.len();
    }
    out
}

/// The dotted names that lines begin with, by where those lines begin; entries of lists are not
/// numbered.
fn lines_of(table: &DeTable<'_>, within: &str, text: &str, keys: &mut BTreeMap<usize, String>) {
    for (key, value) in table {
        let name = key.get_ref();
        let name = match (within, name.contains('.')) {
            ("", _) => name.to_string(),
            (within, true) => format!("{within}.\"{name}\""),
            (within, false) => format!("{within}.{name}"),
        };
        let line = text[..key.span().start]
            .rfind('\n')
            .map_or(0, |end| end + 1);
        // A key within an inline table begins no line.
        let before = &text[line..key.span().start];
        if before.is_empty() || before.starts_with('[') {
            keys.insert(line, name.clone());
        }
        match value.get_ref() {
            DeValue::Table(below) => lines_of(below, &name, text, keys),
            DeValue::Array(entries) => {
                for entry in entries.iter() {
                    if let DeValue::Table(below) = entry.get_ref() {
                        lines_of(below, &name, text, keys);
                    }
                }
            }
            _ => {}
        }
    }
}

/// What is said of a key or a table, if it is known.
fn comments(name: &str, sections: &[Section]) -> Option<Vec<String>> {
    let name = of_any(name);
    if let Some(section) = sections.iter().find(|section| section.name == name) {
        let about = section.about.iter().map(|line| line.trim());
        let about: Vec<&str> = about.take_while(|line| !line.is_empty()).collect();
        return Some(wrapped(&plain(&about.join(" ")), WIDTH - 2));
    }
    let (table, last) = name.rsplit_once('.').unwrap_or(("", &name));
    let section = sections.iter().find(|section| section.name == table)?;
    let named = |key: &&Key| key.name == last || key.aliases.contains(&last);
    let key = section.keys.iter().find(named)?;
    let mut lines = wrapped(&prose(key.meaning(), ""), WIDTH - 2);
    let facts = facts(section, key);
    let facts = facts.iter().filter(|(what, _)| *what != "also called");
    for (what, said) in facts {
        lines.extend(wrapped(&format!("{what}: {said}"), WIDTH - 2));
    }
    Some(lines)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Scenario;
    use farside_actors::system::Files;

    #[test]
    fn links_and_escapes_of_documentation_are_left_out() {
        assert_eq!(
            plain("see [`Timing`](crate::Timing) now"),
            "see `Timing` now"
        );
        assert_eq!(
            plain("a speed \\[m/s\\], in (0, 1000]"),
            "a speed [m/s], in (0, 1000]"
        );
        assert_eq!(plain("Which [`Speed`] it has"), "Which `Speed` it has");
        assert_eq!(plain("in [0, 1); so"), "in [0, 1); so");
    }

    #[test]
    fn a_scenario_with_comments_is_the_same_scenario() {
        let registry = Registry::builtin();
        let lines = "description=\"of several lines\\nloss = 0.5\\n[team]\"".to_owned();
        let crash = "crash=[{ host = 'rover_01', at = '5s' }]".to_owned();
        for name in registry.scenario_names() {
            let mut sets = vec![lines.clone()];
            if name.starts_with("network") {
                sets.push(crash.clone());
            }
            let text = Scenario::open(name, &sets, &registry)
                .unwrap()
                .resolved()
                .unwrap();
            let commented = commented(&text, &registry);
            let comments = commented.lines().filter(|line| line.starts_with("# "));
            let count = comments.count();
            assert!(count > 30, "{name} has {count} lines of comments");
            let files = Files::on_disk("".into());
            let again = Scenario::parse(name, commented, &[], &registry, files).unwrap();
            assert_eq!(again.resolved().unwrap(), text, "{name}");
        }
    }

    #[test]
    fn each_key_of_a_resolved_scenario_is_commented_on() {
        let registry = Registry::builtin();
        let crater = Scenario::open("network/crater-dense", &[], &registry).unwrap();
        let text = commented(&crater.resolved().unwrap(), &registry);
        let mut before = "";
        for line in text.lines() {
            let is_said = line.starts_with('#') || line.is_empty() || before.starts_with("# ");
            assert!(is_said, "nothing is said of {line}");
            before = line;
        }
    }
}
