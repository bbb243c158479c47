//! A system that is no part of this workspace: `tests/outside` is a crate of somebody else's, with
//! settings, metrics, a scenario, a study, a picture and a scene of its own. Every command speaks of
//! it, and of no system that is built in here.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Its binary, beside that of this test: `cargo test` builds it as an example of this package, of
/// what it has compiled already.
fn binary() -> PathBuf {
    let test = std::env::current_exe().expect("this program has a path");
    let profile = test.ancestors().nth(2).expect("it lies in deps");
    profile.join("examples/beacons")
}

fn run(folder: &Path, arguments: &[&str]) -> Output {
    let command = Command::new(binary())
        .args(arguments)
        .current_dir(folder)
        .output();
    command.expect("it starts")
}

/// What a command prints that ends well.
fn said(folder: &Path, arguments: &[&str]) -> String {
    let output = run(folder, arguments);
    let [out, err] = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text));
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {out}{err}");
    format!("{out}{err}")
}

#[test]
fn every_command_speaks_of_a_system_of_somebody_elses() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    assert!(said(folder, &["scenarios"]).starts_with("beacons/quiet  A lander hears"));
    assert!(said(folder, &["studies"]).starts_with("beacons/loss  How many calls"));
    let text = said(
        folder,
        &["run", "beacons/quiet", "--set", "beacons.calls=20"],
    );
    assert!(text.contains("calls heard"), "{text}");
    assert!(said(folder, &["verify", "run.mcap"]).contains("same"));
    assert!(said(folder, &["info", "run.mcap"]).contains("beacons/quiet"));
    assert!(said(folder, &["diff", "run.mcap", "run.mcap"]).contains("identical"));
    said(folder, &["recover", "run.mcap", "--out", "saved.mcap"]);
    said(folder, &["check", "beacons/quiet"]);
    let problem = said(folder, &["problem", "beacons/quiet", "--out", "calls.txt"]);
    assert!(
        problem.starts_with("calls.txt: the problem of beacons/quiet"),
        "{problem}"
    );
    let text = said(folder, &["draw", "run.mcap", "--list"]);
    assert_eq!(text, "calls  when calls were heard\n");
    let text = said(folder, &["draw", "run.mcap"]);
    assert!(text.contains("calls heard"), "{text}");
    assert!(folder.join("run-calls.svg").exists());
    said(folder, &["view", "run.mcap"]);
    assert!(folder.join("run.html").exists());
    said(folder, &["study", "beacons/loss", "--out", "loss"]);
    said(folder, &["report", "loss"]);
    let again = [
        "reproduce",
        "loss",
        "--cell",
        "0",
        "--seed",
        "1",
        "--out",
        "point.mcap",
    ];
    assert!(said(folder, &again).contains("the same"));
    let page = std::fs::read_to_string(folder.join("loss/report.html")).unwrap();
    assert!(page.contains("calls heard so far") && page.contains("How many calls"));
    let text = said(folder, &["explain"]);
    assert!(text.contains("beacons: count, calls, interval"), "{text}");
    assert!(text.contains("metrics of the system beacons: heard, heard_over_calls"));
    for built_in in ["network", "rover", "max_plus", "traffic"] {
        assert!(!text.contains(built_in), "{built_in}: {text}");
    }
    let text = said(folder, &["explain", "beacons.interval"]);
    assert!(
        text.contains("The time between two calls.\n  expected: a duration such as"),
        "{text}"
    );
    assert!(text.contains(", more than 0s\n  units: ns, us,"), "{text}");
}

#[test]
fn its_binary_has_its_own_name_and_version() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let version = said(folder, &["--version"]);
    assert!(version.starts_with("beacons 0."), "{version}");
    assert!(version.contains(" (farside 0."), "{version}");
    let completions = said(folder, &["completions", "bash"]);
    assert!(
        completions.contains("complete -F _beacons"),
        "{completions}"
    );
    assert!(!completions.contains("_farside"), "{completions}");
    // It has no crater: its first scenario is what is run.
    assert!(said(folder, &["run"]).contains("beacons/quiet"));
    let info = said(folder, &["info", "run.mcap"]);
    assert!(info.contains(version.trim()), "{info}");
    let help = said(folder, &["run", "--help"]);
    assert!(help.contains("`beacons scenarios`"), "{help}");
    let output = run(folder, &["report", "run.mcap"]);
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(text.contains("`beacons info run.mcap`"), "{text}");
}

#[test]
fn its_mistakes_are_told_with_their_place() {
    let folder = tempfile::tempdir().unwrap();
    let wrong = "system = 'beacons'\n[beacons]\ncalls = 5\ncount = 0\n";
    std::fs::write(folder.path().join("wrong.toml"), wrong).unwrap();
    let output = run(folder.path(), &["check", "wrong.toml"]);
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        text.contains("wrong.toml:4:9: beacons.count: 0: expected 1 to 100"),
        "{text}"
    );
    let output = run(folder.path(), &["run", "network/crater-dense"]);
    assert_eq!(output.status.code(), Some(2));
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(text.contains("built in: beacons/quiet"), "{text}");
}

/// Its manifest is not what it is built from here: it names the crates that the source names, with
/// the features that the workspace has of them, and cargo finds all of them.
#[test]
fn its_manifest_has_what_it_needs() {
    let folder = root().join("tests/outside");
    let manifest = std::fs::read_to_string(folder.join("Cargo.toml")).unwrap();
    let manifest: toml::Table = manifest.parse().unwrap();
    let listed = manifest["dependencies"].as_table().unwrap();
    let listed: BTreeSet<_> = listed.keys().map(|name| name.replace('-', "_")).collect();
    let ours = std::fs::read_to_string(root().join("tests/Cargo.toml")).unwrap();
    let ours: toml::Table = ours.parse().unwrap();
    let tables = ["dependencies", "dev-dependencies"].map(|table| ours[table].as_table().unwrap());
    let known = tables.into_iter().flatten();
    let known: BTreeSet<_> = known.map(|(name, _)| name.replace('-', "_")).collect();
    assert!(
        listed.is_subset(&known),
        "{listed:?}, and this package has {known:?}"
    );
    let source = std::fs::read_to_string(folder.join("src/main.rs")).unwrap();
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let named = |name: &str| {
        let path = format!("{name}::");
        let mut found = source.match_indices(&path);
        found.any(|(at, _)| !source[..at].ends_with(|c| is_word(c) || c == ':'))
    };
    for name in known.difference(&listed) {
        assert!(!named(name), "{name} is not in the manifest");
    }
    // The versions that the workspace takes, so that no network is needed.
    std::fs::copy(root().join("Cargo.lock"), folder.join("Cargo.lock")).unwrap();
    let tree = Command::new(env!("CARGO"))
        .args(["tree", "--offline", "--quiet"])
        .current_dir(&folder)
        .output()
        .expect("cargo starts");
    let text = String::from_utf8_lossy(&tree.stderr);
    assert!(tree.status.success(), "{text}");
}
