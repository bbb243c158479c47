//! `farside replay`: actors of a log live again.

use std::fs;

use crate::common::{farside, json, text};

const RUN: [&str; 12] = [
    "run",
    "network/crater-sparse",
    "--set",
    "team.rovers=5",
    "--until",
    "8s",
    "--set",
    "log.exclude=[]",
    "--set",
    "crash=[{ actor = 'node_0*', at = '2s', restart = '4s' }]",
    "--out",
    "run.mcap",
];

#[test]
fn actors_do_what_they_did_and_a_change_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let run = farside(folder, &RUN);
    assert_eq!(run.status.code(), Some(0), "{}", text(&run.stderr));
    for actor in ["node_03", "node_*", "rover_02", "*"] {
        let output = farside(folder, &["replay", "run.mcap", "--actor", actor, "--json"]);
        let replayed = json(&output);
        assert_eq!(output.status.code(), Some(0), "{actor}: {replayed:#}");
        assert_eq!(replayed["identical"], true);
        assert!(replayed["same"].as_u64().unwrap() > 0);
        assert_eq!(replayed["steps"], replayed["recorded_steps"]);
        // Rovers ask what their links charged, attempt by attempt, which the log does not have.
        let again = replayed["run_again_for"].as_array().unwrap().len();
        assert_eq!(again, usize::from(!actor.starts_with("node")), "{actor}");
    }
    let noise = ["--set", "network.max_plus.noise=0.2", "--json"];
    let output = farside(
        folder,
        &[&["replay", "run.mcap", "--actor", "node_*"], &noise[..]].concat(),
    );
    let replayed = json(&output);
    assert_eq!(output.status.code(), Some(1), "{replayed:#}");
    let first = &replayed["first"];
    for key in [
        "time_s", "actor", "kind", "field", "expected", "actual", "cause",
    ] {
        assert!(!first[key].is_null(), "{key}: {first:#}");
    }
}

#[test]
fn what_is_not_in_the_log_is_executed_again() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut run = RUN.to_vec();
    run[7] = "log.exclude=['/*/max_plus','/*/candidate_paths']";
    farside(folder, &run);
    let output = farside(folder, &["replay", "run.mcap", "--actor", "node_03"]);
    let said = text(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(
        said.contains("executed again for inputs that are not in the log: /*/max_plus"),
        "{said}"
    );
}

#[test]
fn mistakes_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    farside(folder, &RUN);
    for (arguments, expected) in [
        (
            &["--actor", "node_3"][..],
            "no actor of the run is called so; did you mean",
        ),
        (&["--actor", "["], "--actor ["),
        (
            &["--actor", "node_03", "--set", "seed=4"],
            "seeds cannot change",
        ),
        (
            &["--actor", "node_03", "--set", "team.rovers=6"],
            "the world and the team",
        ),
        (
            &["--actor", "node_03", "--set", "crash=[]"],
            "comes from the record",
        ),
        (
            &["--actor", "node_03", "--set", "network.max_plus.nois=1"],
            "did you mean \"noise\"?",
        ),
        (&[], "--actor"),
    ] {
        let output = farside(folder, &[&["replay", "run.mcap"], arguments].concat());
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
        assert!(said.contains(expected), "{arguments:?}: {said}");
    }
}

/// A log that is cut is replayed as far as it goes.
#[test]
fn a_cut_log_goes_as_far_as_it_goes() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    farside(folder, &RUN);
    let whole = fs::read(folder.join("run.mcap")).unwrap();
    for part in [3, 5, 9] {
        let cut = &whole[..whole.len() * part / 10];
        fs::write(folder.join("cut.mcap"), cut).unwrap();
        let output = farside(folder, &["replay", "cut.mcap", "--actor", "node_03"]);
        let said = text(&output.stdout);
        assert_eq!(
            output.status.code(),
            Some(0),
            "{said} {}",
            text(&output.stderr)
        );
        assert!(said.contains("replayed as far as it goes, to"), "{said}");
    }
}
