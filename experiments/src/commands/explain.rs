//! `farside explain`: what there is to know of each key of scenarios and studies and each metric, from the
//! declarations that they are read and reported by.

use farside::suggest::{did_you_mean, nearest};
use farside_actors::system::{Better, Key, Metric, MetricKind, Section};
use serde_json::{Value, json};

use super::Exit;
use super::describe::{WIDTH, facts, of_any, plain, prose, sections, wrapped};
use super::{CommandError, print, print_json};
use crate::registry::Registry;
use crate::study::{self, KERNEL_METRICS};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// A key (links.default.loss, loss; of a study: study.report.x), a table (links.default) or a
    /// metric (arrived); all of them are listed unless given
    #[arg(value_name = "KEY|METRIC")]
    name: Option<String>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Something that can be explained.
enum Entry<'a> {
    Key {
        section: &'a Section,
        key: &'a Key,
    },
    Metric {
        /// The system that has it; none if every run has.
        system: Option<&'a str>,
        metric: &'a Metric,
    },
}

pub(crate) fn run(args: &Args, registry: &Registry) -> Result<Exit, CommandError> {
    let sections: Vec<Section> = sections(registry)
        .into_iter()
        .chain(study::sections())
        .collect();
    let sections: Vec<&Section> = sections.iter().collect();
    let all = entries(&sections, registry);
    let Some(name) = &args.name else {
        return list(&sections, registry, &all, args.json);
    };
    let name = &of_any(name);
    let section = sections.iter().find(|section| section.name == *name);
    let found: Vec<&Entry<'_>> = match section {
        Some(section) => all.iter().filter(|entry| entry.is_in(section)).collect(),
        None => all.iter().filter(|entry| entry.is_called(name)).collect(),
    };
    if found.is_empty() && section.is_none() {
        let full: Vec<String> = all.iter().map(Entry::name).collect();
        let last = |name: &'_ str| name.rsplit('.').next().unwrap_or_default().to_owned();
        let short: Vec<String> = full.iter().map(|name| last(name)).collect();
        let names = full.iter().chain(&short).map(String::as_str);
        let hint = did_you_mean(nearest(name, names).as_deref());
        return Err(CommandError::Arguments(format!(
            "{name}: no such key, table or metric{hint}; `farside explain` lists them all"
        )));
    }
    if args.json {
        print_json(&found.iter().map(|entry| entry.json()).collect::<Vec<_>>())?;
        return Ok(Exit::Done);
    }
    let mut texts: Vec<String> = Vec::new();
    if let Some(section) = section.filter(|section| !section.about.is_empty()) {
        texts.push(prose(section.about, ""));
    }
    texts.extend(found.iter().map(|entry| entry.text()));
    print(texts.join("\n\n"))?;
    Ok(Exit::Done)
}

fn entries<'a>(sections: &[&'a Section], registry: &'a Registry) -> Vec<Entry<'a>> {
    let mut all = Vec::new();
    for section in sections {
        all.extend(section.keys.iter().map(|key| Entry::Key { section, key }));
    }
    let every = KERNEL_METRICS.iter();
    all.extend(every.map(|metric| Entry::Metric {
        system: None,
        metric,
    }));
    for system in registry.systems() {
        let metrics = system.metrics().iter();
        all.extend(metrics.map(|metric| Entry::Metric {
            system: Some(system.name()),
            metric,
        }));
    }
    all
}

impl Entry<'_> {
    /// The dotted key, or the metric's name.
    fn name(&self) -> String {
        match self {
            Entry::Key { section, key } if section.name.is_empty() => key.name.to_owned(),
            Entry::Key { section, key } => format!("{}.{}", section.name, key.name),
            Entry::Metric { metric, .. } => metric.name.to_owned(),
        }
    }

    fn is_in(&self, of: &Section) -> bool {
        matches!(self, Entry::Key { section, .. } if section.name == of.name)
    }

    /// Whether somebody who writes `name` may mean it: the whole name, or the last part of a key.
    fn is_called(&self, name: &str) -> bool {
        let Entry::Key { section, key } = self else {
            return self.name() == name;
        };
        let last = name.strip_prefix(&section.name);
        let last = last.and_then(|rest| rest.strip_prefix('.')).unwrap_or(name);
        self.name() == name || key.name == last || key.aliases.contains(&last)
    }

    fn text(&self) -> String {
        let mut text = self.name();
        match self {
            Entry::Key { section, key } => {
                text += &format!("\n{}", prose(key.meaning(), "  "));
                for (what, said) in facts(section, key) {
                    text += &format!("\n  {what}: {said}");
                }
            }
            Entry::Metric { system, metric } => {
                let unit = match metric.unit {
                    "" => String::new(),
                    unit => format!(" [{unit}]"),
                };
                text += &format!("\n  metric: {}{unit}", metric.label);
                for line in wrapped(&plain(metric.about), WIDTH - 2) {
                    text += &format!("\n  {line}");
                }
                text += &format!("\n  {}; {}", kind(metric), better(metric));
                let whose = system.map_or("of every run".to_owned(), |name| {
                    format!("of runs of the system {name}")
                });
                text += &format!("\n  {whose}");
                if !metric.source.is_empty() {
                    text += &format!("\n  source: {}", plain(metric.source));
                }
            }
        }
        text
    }

    fn json(&self) -> Value {
        match self {
            Entry::Key { section, key } => json!({
                "key": self.name(),
                "about": prose(key.meaning(), ""),
                "aliases": key.aliases,
                "value": key.value,
                "units": key.units,
                "expected": key.expected,
                "default": section.defaults.get(key.name),
                "source": plain(&key.source().join(" ")),
            }),
            Entry::Metric { system, metric } => json!({
                "metric": metric.name,
                "label": metric.label,
                "unit": metric.unit,
                "about": plain(metric.about),
                "source": plain(metric.source),
                "kind": kind(metric),
                "better": better(metric),
                "system": system,
            }),
        }
    }
}

fn kind(metric: &Metric) -> &'static str {
    match metric.kind {
        MetricKind::Number => "a number for each run",
        MetricKind::Rate => "true or false for each run",
        MetricKind::Word => "a word for each run",
        MetricKind::Sample => "a list of numbers for each run",
        MetricKind::Series(_) => "a curve for each run",
    }
}

fn better(metric: &Metric) -> &'static str {
    match metric.better {
        Better::Higher => "higher is better",
        Better::Lower => "lower is better",
        Better::Neither => "neither way is better",
    }
}

fn list(
    sections: &[&Section],
    registry: &Registry,
    all: &[Entry<'_>],
    as_json: bool,
) -> Result<Exit, CommandError> {
    if as_json {
        print_json(&all.iter().map(Entry::json).collect::<Vec<_>>())?;
        return Ok(Exit::Done);
    }
    let mut lines = Vec::new();
    for section in sections {
        let name = match section.name.as_str() {
            "" => "at the top",
            name => name,
        };
        let keys: Vec<&str> = section.keys.iter().map(|key| key.name).collect();
        lines.push(format!("{name}: {}", keys.join(", ")));
    }
    let names = |metrics: &[Metric]| {
        let names: Vec<&str> = metrics.iter().map(|metric| metric.name).collect();
        names.join(", ")
    };
    lines.push(format!("metrics of every run: {}", names(&KERNEL_METRICS)));
    for system in registry.systems() {
        let (name, metrics) = (system.name(), names(system.metrics()));
        lines.push(format!("metrics of the system {name}: {metrics}"));
    }
    print(lines.join("\n\n"))?;
    Ok(Exit::Done)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_of_tables_that_scenarios_name_are_found() {
        let registry = Registry::builtin();
        let sections = sections(&registry);
        let sections: Vec<&Section> = sections.iter().collect();
        let all = entries(&sections, &registry);
        for (asked, found) in [
            ("radios.uhf.sense_delay", "radios.NAME.sense_delay"),
            (
                "radios.uhf.path_loss.exponent",
                "radios.NAME.path_loss.exponent",
            ),
            ("contacts.range", "contacts.range"),
            ("contacts.file", "contacts.file"),
            ("links.rover_*-node_*.window", "links.default.window"),
            ("links.\"a.b-c\".mtu", "links.default.mtu"),
            ("degrade.3.at", "degrade.at"),
            ("links.default.ack", "links.default.ack"),
        ] {
            let name = of_any(asked);
            let found_all: Vec<String> = all
                .iter()
                .filter(|entry| entry.is_called(&name))
                .map(Entry::name)
                .collect();
            assert_eq!(found_all, [found], "{asked}");
        }
        for table in ["radios.uhf", "radios", "contacts", "links.\"a.b\"", "links"] {
            let name = of_any(table);
            let is_known = sections.iter().any(|section| section.name == name);
            assert!(
                is_known || ["radios", "links"].contains(&table),
                "{table}: {name}"
            );
        }
    }

    #[test]
    fn every_key_of_links_says_what_it_may_be_and_its_default() {
        let registry = Registry::builtin();
        let sections = sections(&registry);
        let links = sections.iter().find(|one| one.name == "links.default");
        let links = links.unwrap();
        for key in links.keys.iter().filter(|key| key.name != "preset") {
            let facts: Vec<&str> = facts(links, key)
                .into_iter()
                .map(|(what, _)| what)
                .collect();
            assert!(facts.contains(&"expected"), "{}: {facts:?}", key.name);
            assert!(facts.contains(&"default"), "{}: {facts:?}", key.name);
        }
    }

    #[test]
    fn a_range_that_is_told_is_the_one_that_is_held() {
        // Of each key with a range in words "A to B": a value beyond it is refused in those words.
        let registry = Registry::builtin();
        let sections = sections(&registry);
        let sections: Vec<&Section> = sections.iter().collect();
        let all = entries(&sections, &registry);
        for (key, beyond, told) in [
            ("links.default.retries", "1001", "1000"),
            ("links.default.window", "0", "1 to 16777216"),
            ("team.rovers", "0", "1 to 10000"),
        ] {
            let sets = [format!("{key}={beyond}")];
            let opened = crate::scenario::Scenario::open("network/crater-dense", &sets, &registry);
            let refused = opened.err().unwrap().to_string();
            assert!(refused.contains(told), "{key}: {refused}");
            let entry = all.iter().find(|entry| entry.name() == key).unwrap();
            assert!(entry.text().contains(told), "{}", entry.text());
        }
    }

    #[test]
    fn metrics_say_what_they_are_and_where_they_are_from() {
        let registry = Registry::builtin();
        for system in registry.systems() {
            for metric in system.metrics() {
                assert!(!metric.about.is_empty(), "{}", metric.name);
            }
        }
        let ratio = registry.metric("network", "path_ratio").unwrap();
        assert_eq!(ratio.source, "the network-guided paper, section 4.");
    }
}
