//! The guide's reference of keys and metrics: made of what `farside explain --json` says, which is
//! made of the declarations that scenarios are read by. `FARSIDE_RENEW=1 cargo test -p
//! farside-experiments --test command guide` writes the pages anew.

use serde_json::Value;

use crate::common::{farside, json};

/// What explain says of everything.
fn entries() -> Vec<Value> {
    let here = std::env::temp_dir();
    let all = json(&farside(&here, &["explain", "--json"]));
    all.as_array().expect("a list").clone()
}

fn text<'a>(entry: &'a Value, field: &str) -> &'a str {
    entry[field].as_str().unwrap_or_default()
}

/// A text as a cell of a table.
fn cell(text: &str) -> String {
    let words: Vec<&str> = text.split_whitespace().collect();
    words.join(" ").replace('|', "\\|").replace('<', "&lt;")
}

/// A list of names, each as code.
fn names(list: &Value) -> String {
    let list = list.as_array().into_iter().flatten();
    let names = list
        .filter_map(Value::as_str)
        .map(|name| format!("`{name}`"));
    names.collect::<Vec<_>>().join(", ")
}

/// Where a key or a metric is from.
fn source(entry: &Value) -> String {
    let source = cell(text(entry, "source"));
    let source = source.trim_end_matches('.');
    match source {
        "" => String::new(),
        source => format!("<br>Source: {source}."),
    }
}

/// A default as scenarios write it.
fn default(value: &Value) -> String {
    match value {
        Value::Null | Value::Object(_) => String::new(),
        value => format!("`{value}`"),
    }
}

const MADE: &str = "<!-- Made by the tests of `farside-experiments` from what `farside explain` \
    says: change the declarations, and renew it with FARSIDE_RENEW=1. -->\n";

/// Whether an entry is a key of study files, which `explain` puts below `study`.
fn is_of_studies(entry: &Value) -> bool {
    text(entry, "key").starts_with("study.")
}

fn scenario_keys(entries: &[Value]) -> String {
    let about = format!(
        "# Keys of scenarios\n\n{MADE}\nEvery table that a scenario may have, with each of its keys. \
         `farside explain KEY` says the same on the command line. `links.default` holds for all \
         links, and `[links.PATTERN]` has the same keys for some of them.\n"
    );
    keys(about, entries.iter().filter(|entry| !is_of_studies(entry)))
}

fn study_keys(entries: &[Value]) -> String {
    let about = format!(
        "# Keys of studies\n\n{MADE}\nEvery table that a study may have, with each of its keys. \
         `farside explain study.KEY` says the same on the command line: what stands at the top of a \
         study is below `study` there, and the `[report]` table is `study.report`.\n"
    );
    keys(about, entries.iter().filter(|entry| is_of_studies(entry)))
}

fn keys<'a>(mut page: String, entries: impl Iterator<Item = &'a Value>) -> String {
    let mut last = None;
    for entry in entries.filter(|entry| entry["key"].is_string()) {
        let name = text(entry, "key");
        let (table, key) = name.rsplit_once('.').unwrap_or(("", name));
        if last != Some(table) {
            let heading = match table {
                "" | "study" => "At the top".to_owned(),
                table => format!("`{table}`"),
            };
            page += &format!("\n## {heading}\n\n| key | what it is | default |\n|---|---|---|\n");
            last = Some(table);
        }
        let mut about = cell(text(entry, "about"));
        let expected = ["value", "expected"].map(|field| cell(text(entry, field)));
        let expected: Vec<String> = expected.into_iter().filter(|one| !one.is_empty()).collect();
        if !expected.is_empty() {
            about += &format!("<br>Expected: {}.", expected.join(", "));
        }
        let units = names(&entry["units"]);
        if !units.is_empty() {
            about += &format!("<br>Units: {units}.");
        }
        let aliases = names(&entry["aliases"]);
        if !aliases.is_empty() {
            about += &format!("<br>Also called {aliases}.");
        }
        about += &source(entry);
        page += &format!("| `{key}` | {about} | {} |\n", default(&entry["default"]));
    }
    page
}

fn metrics(entries: &[Value]) -> String {
    let mut page = format!(
        "# Metrics\n\n{MADE}\nWhat a study may list under `metrics`. `farside explain METRIC` says \
         the same on the command line.\n"
    );
    let mut last = None;
    for entry in entries.iter().filter(|entry| entry["metric"].is_string()) {
        let system = text(entry, "system");
        if last != Some(system) {
            let heading = match system {
                "" => "Of every run".to_owned(),
                system => format!("Of the system `{system}`"),
            };
            page += &format!(
                "\n## {heading}\n\n| metric | what it is | unit | kind | better |\n|---|---|---|---|---|\n"
            );
            last = Some(system);
        }
        let (label, about) = (cell(text(entry, "label")), cell(text(entry, "about")));
        let what = match about.is_empty() {
            true => label,
            false => format!("{label}<br>{about}"),
        } + &source(entry);
        let better = text(entry, "better").trim_end_matches(" is better");
        let kind = text(entry, "kind").trim_end_matches(" for each run");
        page += &format!(
            "| `{}` | {what} | {} | {kind} | {better} |\n",
            text(entry, "metric"),
            text(entry, "unit"),
        );
    }
    page
}

#[test]
fn the_reference_is_what_explain_says() {
    let entries = entries();
    let pages = [
        ("reference/keys.md", scenario_keys(&entries)),
        ("reference/study_keys.md", study_keys(&entries)),
        ("reference/metrics.md", metrics(&entries)),
    ];
    for (name, page) in pages {
        let path = super::docs().join(name);
        if std::env::var_os("FARSIDE_RENEW").is_some() {
            std::fs::write(&path, &page).expect("it is written");
        }
        let there = std::fs::read_to_string(&path).unwrap_or_default();
        let mut lines = there.lines().zip(page.lines());
        let differs = lines.find(|(there, here)| there != here);
        assert!(
            there == page,
            "docs/src/{name} is not what explain says: {differs:?}\n  renew it: FARSIDE_RENEW=1 cargo \
             test -p farside-experiments --test command guide"
        );
    }
}
