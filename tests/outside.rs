//! A system that is no part of this workspace: `tests/outside` is a crate of somebody else's, with
//! settings, metrics, a scenario, a study, a picture and a scene of its own. It is built as users
//! build theirs, and every command speaks of it, and of no system that is built in here.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::LazyLock;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The binary, built once. It takes the versions that the workspace takes, so that it needs no
/// network, and goes to the same folder, so that what is built already is not built again.
static BINARY: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = root().join("tests/outside");
    std::fs::copy(root().join("Cargo.lock"), folder.join("Cargo.lock")).expect("it can be copied");
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("..");
    let build = Command::new(env!("CARGO"))
        .args(["build", "--offline", "--quiet", "--target-dir"])
        .arg(&target)
        .current_dir(folder)
        .output()
        .expect("cargo starts");
    let text = String::from_utf8_lossy(&build.stderr);
    assert!(build.status.success(), "it does not build:\n{text}");
    target.join("debug/beacons")
});

fn run(folder: &Path, arguments: &[&str]) -> Output {
    let command = Command::new(&*BINARY)
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
