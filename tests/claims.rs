//! What README and ARCHITECTURE name is there.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use farside_experiments::registry::Registry;
use farside_experiments::scenario::Scenario;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn read(name: &str) -> String {
    std::fs::read_to_string(root().join(name)).expect("it is there")
}

/// What stands in backticks.
fn quoted(text: &str) -> impl Iterator<Item = &str> {
    text.split('`').skip(1).step_by(2)
}

#[test]
fn every_file_that_the_map_names_is_there() {
    let folders = [
        "",
        "src",
        "actors/src",
        "actors/src/link",
        "actors/src/radio",
        "actors/network/src",
        "actors/src/invariants",
        "logs/src",
        "experiments/src",
        "experiments/src/study",
    ];
    let map = read("ARCHITECTURE.md");
    let named = quoted(&map).filter(|name| name.ends_with(".rs") && !name.contains(' '));
    let named: BTreeSet<&str> = named.collect();
    assert!(named.len() > 80, "{}", named.len());
    let crates = ["src", "worlds", "logs", "actors", "experiments", "tests"];
    let all: Vec<String> = crates
        .iter()
        .flat_map(|one| files(&root().join(one)))
        .collect();
    for name in named {
        let found = folders
            .iter()
            .any(|folder| root().join(folder).join(name).exists());
        // Parts of a file that was just named stand without its folder.
        let ends = format!("/{name}");
        let part = all.iter().any(|path| path.ends_with(&ends));
        assert!(found || part, "ARCHITECTURE.md names {name}");
    }
}

/// All files below a folder, with slashes.
fn files(folder: &Path) -> Vec<String> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        match path.is_dir() {
            true => found.extend(files(&path)),
            false => found.push(path.to_string_lossy().replace('\\', "/")),
        }
    }
    found
}

#[test]
fn every_scenario_and_study_that_readme_and_changelog_name_is_built_in() {
    let registry = Registry::builtin();
    let known: BTreeSet<&str> = registry
        .scenario_names()
        .into_iter()
        .chain(registry.study_names())
        .collect();
    for file in ["README.md", "CHANGELOG.md"] {
        let text = read(file);
        let words = text.split(|c: char| !(c.is_alphanumeric() || "/-_".contains(c)));
        let named = words.filter(|word| {
            let kind = word.split_once('/').map(|(kind, _)| kind);
            matches!(kind, Some("network" | "traffic" | "degradation")) && !word.ends_with('/')
        });
        for name in named {
            let built_in = known.iter().any(|known| known == &name);
            let is_path = root().join("actors").join(name).exists() || name.contains("/src");
            assert!(built_in || is_path, "{file} names {name}");
        }
    }
}

#[test]
fn every_policy_that_the_table_of_readme_has_can_be_run() {
    let readme = read("README.md");
    let table = readme
        .split("| policy | knows |")
        .nth(1)
        .expect("the table");
    let rows = table.lines().take_while(|line| !line.is_empty());
    let policies: Vec<&str> = rows
        .filter_map(|row| row.strip_prefix("| `")?.split('`').next())
        .collect();
    assert!(policies.len() >= 6, "{policies:?}");
    for policy in &policies {
        let set = vec![format!("network.policy={policy}")];
        let opened = Scenario::open("network/rubble", &set, &Registry::builtin());
        assert!(opened.is_ok(), "{policy}");
    }
    let wrong = vec!["network.policy=none".to_owned()];
    let refused = Scenario::open("network/rubble", &wrong, &Registry::builtin());
    let told = refused.err().expect("there is no such policy").to_string();
    let known = told.split("one of").nth(1).unwrap_or(&told);
    for policy in &policies {
        assert!(known.contains(policy), "{policy}: {told}");
    }
    // The old name of one is still read.
    let names = known.lines().next().unwrap_or_default().split(',');
    let names = names.filter(|name| name.trim() != "paper").count();
    assert_eq!(names, policies.len(), "{known}");
}

#[test]
fn the_roadmap_of_readme_is_one() {
    let readme = read("README.md");
    let text = readme.split("name = \"pass\"").nth(1).expect("the listing");
    let text = text.split("```").next().expect("its end");
    let file = format!("name = \"pass\" {text}");
    let map = farside_worlds::Roadmap::from_toml(&file).expect("it is a roadmap");
    assert_eq!((map.name(), map.len(), map.edge_count()), ("pass", 4, 3));
}

/// A figure in a sentence about a scenario is one that the scenario has: "50 rovers", "28 sensor
/// nodes".
#[test]
fn figures_in_descriptions_of_scenarios_are_theirs() {
    let registry = Registry::builtin();
    let mut checked = 0;
    for name in registry.scenario_names() {
        let scenario = Scenario::open(name, &[], &registry).expect("it is built in");
        let about = scenario.shared().description.clone();
        let resolved: toml::Table = scenario
            .resolved()
            .expect("it can be written")
            .parse()
            .unwrap();
        let count = |table: &str, key: &str| resolved.get(table)?.get(key)?.as_integer();
        for (what, found) in [
            (" rovers", count("team", "rovers")),
            (" nodes", count("world", "nodes")),
            (" sensor nodes", count("world", "nodes")),
        ] {
            for part in about
                .split(what)
                .collect::<Vec<_>>()
                .split_last()
                .expect("a part")
                .1
            {
                let number = part.rsplit(' ').next().unwrap_or_default();
                let (Ok(number), Some(found)) = (number.parse::<i64>(), found) else {
                    continue;
                };
                assert_eq!(number, found, "{name}: {about}");
                checked += 1;
            }
        }
    }
    assert!(checked >= 6, "{checked}");
}

/// Results rot; what a study says of itself may name keys, and figures of the paper, but none of a
/// run.
#[test]
fn studies_of_degradation_state_no_result_in_figures() {
    for study in Registry::builtin().studies() {
        if !study.name.starts_with("degradation/") {
            continue;
        }
        let comments = study.text.lines().filter(|line| line.starts_with('#'));
        for line in comments {
            let bare = line.replace("failover_after=3", "");
            assert!(
                !bare.contains(|c: char| c.is_ascii_digit()),
                "{}: {line}",
                study.name
            );
        }
    }
}

/// The field's words took the place of these; the CHANGELOG alone still lists them.
#[test]
fn words_that_the_field_does_not_use_are_gone() {
    let words = [
        ["stand", "still"].concat(),
        ["dep", "uty"].concat(),
        ["making", " way"].concat(),
        ["line of ", "succession"].concat(),
    ];
    let crates = ["src", "worlds", "logs", "actors", "experiments", "tests"];
    let sources = crates.iter().flat_map(|one| files(&root().join(one)));
    let sources = sources.filter(|path| path.ends_with(".rs") || path.ends_with(".toml"));
    let pages = ["README.md", "ARCHITECTURE.md", "COMPARE.md"].map(|page| root().join(page));
    let pages = pages.map(|page| page.to_string_lossy().into_owned());
    let mut read = 0;
    for path in sources.chain(pages) {
        let text = std::fs::read_to_string(&path).expect("it is text");
        let text = text.to_lowercase();
        read += 1;
        for word in &words {
            assert!(!text.contains(word.as_str()), "{path}: {word}");
        }
    }
    assert!(read > 400, "{read}");
}
