//! Who may know whom: which crate depends on which, and which file names which crate. What a crate
//! knows decides what it can be used for, and a rule that nothing checks does not hold for long.

mod circles;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Each member, the crates of this workspace it may depend on, and those of others that nobody but
/// who lists them may depend on.
const MAY_KNOW: [(&str, &[&str], &[&str]); 11] = [
    ("farside", &[], &["kameo", "tokio"]),
    ("farside-worlds", &["farside"], &[]),
    ("farside-logs", &["farside"], &["mcap"]),
    ("farside-actors", &["farside", "farside-worlds"], &[]),
    (
        "farside-network",
        &[
            "farside",
            "farside-worlds",
            "farside-logs",
            "farside-actors",
        ],
        &[],
    ),
    (
        "farside-idea",
        &[
            "farside",
            "farside-worlds",
            "farside-actors",
            "farside-planning",
        ],
        &[],
    ),
    (
        "farside-misus",
        &[
            "farside",
            "farside-worlds",
            "farside-actors",
            "farside-planning",
        ],
        &[],
    ),
    // Usable without a simulator.
    ("farside-planning", &[], &[]),
    (
        "farside-traffic",
        &["farside", "farside-worlds", "farside-actors"],
        &[],
    ),
    (
        "farside-experiments",
        &[
            "farside",
            "farside-worlds",
            "farside-logs",
            "farside-actors",
            "farside-idea",
            "farside-misus",
            "farside-network",
            "farside-planning",
            "farside-traffic",
        ],
        &["kameo", "tokio"],
    ),
    (
        "farside-tests",
        &[
            "farside",
            "farside-worlds",
            "farside-logs",
            "farside-actors",
            "farside-network",
            "farside-experiments",
        ],
        &[],
    ),
];

/// What a dependency graph (member to the names it depends on) has that it may not have.
fn misplaced_dependencies(graph: &BTreeMap<String, BTreeSet<String>>) -> Vec<String> {
    let mut found = Vec::new();
    for (member, dependencies) in graph {
        let Some((_, may_know, _)) = MAY_KNOW.iter().find(|(name, ..)| name == member) else {
            found.push(format!("{member} has no level"));
            continue;
        };
        for dependency in dependencies {
            let is_member = graph.contains_key(dependency);
            let mut owners = MAY_KNOW
                .iter()
                .filter(|(_, _, own)| own.contains(&dependency.as_str()))
                .peekable();
            let allowed = match owners.peek() {
                _ if is_member => may_know.contains(&dependency.as_str()),
                Some(_) => owners.any(|(owner, ..)| owner == member),
                None => true,
            };
            if !allowed {
                found.push(format!("{member} depends on {dependency}"));
            }
        }
    }
    found
}

/// The workspace as cargo sees it.
fn metadata() -> serde_json::Value {
    let output = Command::new(env!("CARGO"))
        .args([
            "metadata",
            "--format-version",
            "1",
            "--offline",
            "--no-deps",
        ])
        .current_dir(root())
        .output()
        .expect("cargo metadata starts");
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "cargo metadata: {text}");
    serde_json::from_slice(&output.stdout).expect("it is JSON")
}

/// The workspace's dependencies of every sort.
fn workspace() -> BTreeMap<String, BTreeSet<String>> {
    let metadata = metadata();
    let list = |value: &serde_json::Value| value.as_array().cloned().unwrap_or_default();
    let name = |value: &serde_json::Value| value["name"].as_str().unwrap_or_default().to_owned();
    list(&metadata["packages"])
        .iter()
        .map(|package| {
            let dependencies = list(&package["dependencies"]);
            (name(package), dependencies.iter().map(name).collect())
        })
        .collect()
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Every `.rs` file below `folder`, as its path from the root and its text.
fn sources(folder: &Path, found: &mut Vec<(String, String)>) {
    let entries = std::fs::read_dir(folder).expect("a folder of the repository");
    let paths = entries.map(|entry| entry.expect("an entry").path());
    for path in paths {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if path.is_dir() {
            if name != "target" && !name.starts_with('.') {
                sources(&path, found);
            }
        } else if name.ends_with(".rs") {
            let text = std::fs::read_to_string(&path).expect("source is UTF-8");
            let path = path.strip_prefix(root()).expect("it is below the root");
            found.push((path.to_string_lossy().replace('\\', "/"), text));
        }
    }
}

/// The source with comments and literals blanked out, good enough for finding names: nested block
/// comments and raw strings with quotes in them are not known here.
fn code_of(source: &str) -> String {
    let mut code = String::with_capacity(source.len());
    let mut rest = source;
    while let Some(next) = rest.chars().next() {
        let skipped = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if rest.starts_with("/*") {
            rest.find("*/").map_or(rest.len(), |end| end + 2)
        } else if next == '"' {
            end_of_string(rest)
        } else if rest.starts_with("'\"'") {
            3
        } else {
            code.push(next);
            rest = &rest[next.len_utf8()..];
            continue;
        };
        code.push(' ');
        rest = &rest[skipped..];
    }
    code
}

fn end_of_string(text: &str) -> usize {
    let mut escaped = false;
    for (at, next) in text.char_indices().skip(1) {
        match next {
            '"' if !escaped => return at + 1,
            '\\' => escaped = !escaped,
            _ => escaped = false,
        }
    }
    text.len()
}

fn is_word(character: char) -> bool {
    character.is_alphanumeric() || character == '_'
}

/// True if the code has a path that begins with `name`, as only a crate's name or a module of the
/// same file can; such a module has to be named by way of `self`.
fn names_crate(code: &str, name: &str) -> bool {
    code.match_indices(name).any(|(at, _)| {
        let (before, after) = (&code[..at], &code[at + name.len()..]);
        if before.ends_with(is_word) || after.starts_with(is_word) {
            return false;
        }
        let scope = before.strip_suffix("::").unwrap_or(before);
        if scope != before && scope.ends_with(|last| is_word(last) || last == '>') {
            return false;
        }
        let mut words = scope.split_whitespace().rev();
        let imported = matches!(words.next(), Some("use" | "crate"));
        imported || after.starts_with("::")
    })
}

/// The parts of the identifiers in the code: `rover` and `pose` of `rover_pose` and of `RoverPose`.
fn name_parts(code: &str) -> BTreeSet<String> {
    let mut parts = BTreeSet::new();
    for identifier in code.split(|character| !is_word(character)) {
        let mut part = String::new();
        for character in identifier.chars() {
            if character == '_' || character.is_uppercase() {
                parts.insert(std::mem::take(&mut part));
            }
            part.extend(character.to_lowercase().filter(|c| *c != '_'));
        }
        parts.insert(part);
    }
    parts
}

/// What is wrong with one file.
fn misplaced_names(path: &str, source: &str) -> Vec<String> {
    let mut found = Vec::new();
    if !source.starts_with("//!") {
        found.push(format!("{path} does not open with //!"));
    }
    if path.ends_with("mod.rs") && path.rsplit('/').next() == Some("mod.rs") {
        found.push(format!("{path} is a mod.rs"));
    }
    let code = code_of(source);
    let may_name = |name: &str| match name {
        "kameo" | "tokio" => {
            path.starts_with("src/executor/kameo")
                || path == "experiments/src/study/pool.rs"
                || path.starts_with("tests/bans/")
        }
        // A fuzz target writes foreign logs with the same crate that writes ours.
        "mcap" => path.starts_with("logs/") || path.starts_with("fuzz/"),
        // Who reads scenarios, runs studies and writes reports knows no system; no system knows
        // another. Manifests say the latter; a system may name itself in its own docs.
        "farside_idea" | "farside_misus" | "farside_network" | "farside_traffic" => {
            !path.starts_with("experiments/src/") || path == "experiments/src/registry.rs"
        }
        _ => true,
    };
    let names = [
        "kameo",
        "tokio",
        "mcap",
        "farside_idea",
        "farside_misus",
        "farside_network",
        "farside_traffic",
    ];
    for name in names {
        if !may_name(name) && names_crate(&code, name) {
            found.push(format!("{path} names {name}"));
        }
    }
    if path.starts_with("src/") {
        let parts = name_parts(&code);
        for word in ["rover", "terrain", "mcap", "foxglove", "nalgebra"] {
            if parts.contains(word) {
                found.push(format!("{path}, a file of the kernel, names {word}"));
            }
        }
    }
    found
}

/// `cargo run` has to know what to run.
#[test]
fn there_is_one_binary() {
    let metadata = metadata();
    let packages = metadata["packages"].as_array().expect("a list");
    let targets = packages
        .iter()
        .flat_map(|package| package["targets"].as_array());
    let is_bin = |target: &&serde_json::Value| target["kind"][0] == "bin";
    let names: Vec<_> = targets.flatten().filter(is_bin).collect();
    let names: Vec<_> = names.iter().filter_map(|t| t["name"].as_str()).collect();
    assert_eq!(names, ["farside"]);
}

#[test]
fn dependencies_point_downwards() {
    let graph = workspace();
    assert_eq!(graph.len(), MAY_KNOW.len(), "a member is missing");
    assert_eq!(misplaced_dependencies(&graph), [""; 0]);
}

#[test]
fn every_file_names_only_what_its_crate_may_know() {
    let mut files = Vec::new();
    sources(&root(), &mut files);
    assert!(files.len() > 50, "the repository was not found");
    let found = files
        .iter()
        .flat_map(|(path, source)| misplaced_names(path, source));
    assert_eq!(found.collect::<Vec<_>>(), [""; 0]);
}

#[test]
fn a_dependency_upwards_is_found() {
    let check = |member: &str, dependency: &str, expected: &[&str]| {
        let members = MAY_KNOW.iter().map(|(name, ..)| (*name).to_owned());
        let mut graph: BTreeMap<_, BTreeSet<_>> =
            members.map(|name| (name, BTreeSet::new())).collect();
        let dependencies = graph.entry(member.to_owned()).or_default();
        dependencies.insert(dependency.to_owned());
        assert_eq!(misplaced_dependencies(&graph), expected);
    };
    check(
        "farside",
        "farside-worlds",
        &["farside depends on farside-worlds"],
    );
    check(
        "farside-worlds",
        "farside-logs",
        &["farside-worlds depends on farside-logs"],
    );
    check(
        "farside-logs",
        "farside-worlds",
        &["farside-logs depends on farside-worlds"],
    );
    check(
        "farside-actors",
        "mcap",
        &["farside-actors depends on mcap"],
    );
    check(
        "farside-actors",
        "tokio",
        &["farside-actors depends on tokio"],
    );
    check(
        "farside-network",
        "farside-traffic",
        &["farside-network depends on farside-traffic"],
    );
    check(
        "farside-actors",
        "farside-network",
        &["farside-actors depends on farside-network"],
    );
    check(
        "farside-experiments",
        "farside-tests",
        &["farside-experiments depends on farside-tests"],
    );
    check("farside-extra", "serde", &["farside-extra has no level"]);
    check("farside-experiments", "serde", &[]);
    check("farside-experiments", "kameo", &[]);
}

#[test]
fn a_misplaced_name_is_found() {
    let check = |path: &str, source: &str, expected: &[&str]| {
        assert_eq!(misplaced_names(path, source), expected, "{source}");
    };
    let worlds = "worlds/src/rocks.rs";
    check(
        worlds,
        "use std::fmt;",
        &["worlds/src/rocks.rs does not open with //!"],
    );
    check(
        "worlds/src/rocks/mod.rs",
        "//! x",
        &["worlds/src/rocks/mod.rs is a mod.rs"],
    );
    check("worlds/src/quad_mod.rs", "//! x", &[]);
    for code in [
        "use kameo::Actor;",
        "kameo::spawn()",
        "use ::kameo;",
        "f(::kameo::x)",
        "use kameo as k;",
    ] {
        check(
            worlds,
            &format!("//! x\n{code}"),
            &["worlds/src/rocks.rs names kameo"],
        );
        check(
            "src/executor/kameo/window.rs",
            &format!("//! x\n{code}"),
            &[],
        );
        check(
            "src/executor.rs",
            &format!("//! x\n{code}"),
            &["src/executor.rs names kameo"],
        );
        check(
            "experiments/src/study/pool.rs",
            &format!("//! x\n{code}"),
            &[],
        );
        check(
            "experiments/src/study/runner.rs",
            &format!("//! x\n{code}"),
            &["experiments/src/study/runner.rs names kameo"],
        );
    }
    for code in [
        "// kameo::x",
        "/* kameo::x */",
        "\"\\\" kameo::x\"",
        "self::kameo::run()",
        "let kameo = 1;",
        "a::kameo::x",
        "not_kameo::x",
        "kameos::x",
    ] {
        check(worlds, &format!("//! x\n{code}"), &[]);
    }
    check(
        worlds,
        "//! x\ntokio::spawn(x)",
        &["worlds/src/rocks.rs names tokio"],
    );
    check(
        "experiments/src/run.rs",
        "//! x\nmcap::Writer",
        &["experiments/src/run.rs names mcap"],
    );
    check("logs/src/writer.rs", "//! x\nmcap::Writer", &[]);
    let system = "//! x\nuse farside_network::NetworkSystem;";
    check(
        "experiments/src/scenario.rs",
        system,
        &["experiments/src/scenario.rs names farside_network"],
    );
    check("experiments/src/registry.rs", system, &[]);
    let in_kernel = |word: &str| vec![format!("src/key.rs, a file of the kernel, names {word}")];
    for (code, word) in [
        ("struct RoverPose;", "rover"),
        ("use farside_worlds::terrain;", "terrain"),
        ("let mcap_file;", "mcap"),
    ] {
        let expected = in_kernel(word);
        let expected: Vec<&str> = expected.iter().map(String::as_str).collect();
        check("src/key.rs", &format!("//! x\n{code}"), &expected);
    }
    check("src/key.rs", "//! x\n/// A rover.\nlet moreover;", &[]);
}
