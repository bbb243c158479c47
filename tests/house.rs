//! The bans of `clippy.toml`: each one fires on code that breaks it, and no entry is without such
//! code. A misspelt path in `clippy.toml` bans nothing and says nothing; here it fails.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The lint that bans iteration over hash tables has no path in `clippy.toml`.
const HASH_ITERATION: &str = "iter_over_hash_type";

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn read(path: &str) -> String {
    let path = root().join(path);
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn parse(path: &str) -> toml::Table {
    let parsed = read(path).parse();
    parsed.unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// The paths that `clippy.toml` bans.
fn banned() -> BTreeSet<String> {
    let config = parse("clippy.toml");
    let lists = ["disallowed-types", "disallowed-methods"].map(|list| {
        config[list]
            .as_array()
            .unwrap_or_else(|| panic!("{list} is no list"))
    });
    let path = |ban: &toml::Value| {
        let path = ban.as_str().or_else(|| ban["path"].as_str());
        path.expect("a ban has a path").to_owned()
    };
    lists.into_iter().flatten().map(path).collect()
}

/// The line of each mark in the code that breaks the bans.
fn marked() -> BTreeMap<usize, String> {
    let source = read("tests/bans/src/lib.rs");
    let marks = source.lines().enumerate().filter_map(|(at, line)| {
        let (code, mark) = line.rsplit_once("//~ ")?;
        (!code.starts_with("//!")).then(|| (at + 1, mark.to_owned()))
    });
    marks.collect()
}

/// The ban that a diagnostic is about, if it is about one.
fn ban_of(diagnostic: &serde_json::Value) -> Option<String> {
    match diagnostic["code"]["code"].as_str()? {
        "clippy::disallowed_types" | "clippy::disallowed_methods" => {
            let text = diagnostic["message"].as_str()?;
            Some(text.split('`').nth(1)?.to_owned())
        }
        "clippy::iter_over_hash_type" => Some(HASH_ITERATION.to_owned()),
        _ => None,
    }
}

/// The line of each ban that clippy reports, or `None` where there is no clippy.
fn fired() -> Option<Vec<(usize, String)>> {
    let cargo = || Command::new(env!("CARGO"));
    let present = cargo().args(["clippy", "--version"]).output();
    if !present.is_ok_and(|output| output.status.success()) {
        return None;
    }
    // A directory of its own: nothing is remembered from an earlier clippy.toml.
    let target = tempfile::tempdir().expect("a temporary directory");
    let output = cargo()
        .args(["clippy", "--offline", "--locked", "--message-format=json"])
        .arg("--manifest-path")
        .arg(root().join("tests/bans/Cargo.toml"))
        .arg("--target-dir")
        .arg(target.path())
        .env("CLIPPY_CONF_DIR", root())
        .output()
        .expect("cargo clippy starts");
    let stdout = String::from_utf8(output.stdout).expect("cargo prints UTF-8");
    let messages = stdout
        .lines()
        .filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok())
        .filter(|message| message["reason"] == "compiler-message")
        .map(|mut message| message["message"].take());
    let mut fired = Vec::new();
    for diagnostic in messages {
        let line = diagnostic["spans"][0]["line_start"].as_u64();
        match (ban_of(&diagnostic), line) {
            (Some(ban), Some(line)) => fired.push((line as usize, ban)),
            // What counts the others, or an error that would hide them.
            _ => println!("also reported: {}", diagnostic["rendered"]),
        }
    }
    assert!(
        !fired.is_empty(),
        "nothing fired: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    Some(fired)
}

#[test]
fn every_ban_has_code_that_breaks_it() {
    let mut expected = banned();
    expected.insert(HASH_ITERATION.to_owned());
    let marks = marked();
    assert_eq!(marks.values().cloned().collect::<BTreeSet<_>>(), expected);
    assert_eq!(marks.len(), expected.len(), "a ban is broken twice");
}

#[test]
fn every_ban_fires() {
    let Some(mut fired) = fired() else {
        eprintln!("SKIPPED: there is no cargo clippy here, so no ban of clippy.toml was tried");
        return;
    };
    fired.sort();
    assert_eq!(fired, marked().into_iter().collect::<Vec<_>>());
}

#[test]
fn the_bans_hold_in_every_crate() {
    let house = parse("Cargo.toml");
    let lints = &house["workspace"]["lints"];
    let fixture = parse("tests/bans/Cargo.toml");
    assert_eq!(fixture["lints"]["clippy"], lints["clippy"]);
    for lint in [
        "iter_over_hash_type",
        "disallowed_types",
        "disallowed_methods",
    ] {
        assert_eq!(lints["clippy"][lint].as_str(), Some("deny"), "{lint}");
    }
    let members = house["workspace"]["members"].as_array();
    let members = members.expect("the workspace has members");
    let manifests = members.iter().filter_map(toml::Value::as_str);
    let manifests = manifests.map(|member| format!("{member}/Cargo.toml"));
    for path in manifests.chain(["Cargo.toml".to_owned()]) {
        let manifest = parse(&path);
        let inherits = manifest["lints"]["workspace"].as_bool();
        assert_eq!(
            inherits,
            Some(true),
            "{path} does not take the workspace's lints"
        );
    }
}
