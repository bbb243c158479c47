//! Logs on the command line: verify, diff, recover.

use crate::common::{farside, json, small, text};

#[test]
fn a_log_is_verified_by_running_it_again() {
    let folder = tempfile::tempdir().unwrap();
    let sets = [
        "--set",
        "links.default.duplicate=0.1",
        "--tie-seed",
        "3",
        "--seed",
        "5",
    ];
    let run = json(&farside(
        folder.path(),
        &small(&[&["--json"], &sets[..]].concat()),
    ));
    let verified = farside(folder.path(), &["verify", "run.mcap", "--json"]);
    assert_eq!(
        verified.status.code(),
        Some(0),
        "{}",
        text(&verified.stderr)
    );
    let verified = json(&verified);
    assert_eq!(verified["result"], "same");
    assert_eq!(verified["digest"], run["digest"]);
    let said = farside(
        folder.path(),
        &["verify", "run.mcap", "--executor", "inline"],
    );
    assert!(text(&said.stdout).starts_with("run.mcap: the same: "));
    let info = json(&farside(folder.path(), &["info", "run.mcap", "--json"]));
    assert_eq!(info["run"]["seed"], 5);
    assert_eq!(info["run"]["digest"], run["digest"]);
}

#[test]
fn what_is_no_log_of_ours_is_trouble() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("x.mcap"), "not an MCAP file").unwrap();
    std::fs::write(folder.path().join("empty.mcap"), "").unwrap();
    for command in ["verify", "info"] {
        for log in ["x.mcap", "empty.mcap", "missing.mcap", "."] {
            let output = farside(folder.path(), &[command, log]);
            assert_eq!(output.status.code(), Some(2), "{command} {log}");
            assert!(text(&output.stderr).starts_with("error: "));
        }
    }
}

#[test]
fn two_runs_are_compared_and_a_cut_log_is_saved() {
    let folder = tempfile::tempdir().unwrap();
    farside(folder.path(), &small(&["--out", "a.mcap"]));
    farside(folder.path(), &small(&["--out", "b.mcap"]));
    let worse = ["--out", "c.mcap", "--set", "links.default.loss=0.2"];
    farside(folder.path(), &small(&worse));
    let same = farside(folder.path(), &["diff", "a.mcap", "b.mcap", "--json"]);
    assert_eq!(same.status.code(), Some(0), "{}", text(&same.stdout));
    assert_eq!(json(&same)["identical"], true);
    let different = farside(folder.path(), &["diff", "a.mcap", "c.mcap", "--json"]);
    assert_eq!(different.status.code(), Some(1));
    let different = json(&different);
    for key in [
        "time_s", "topic", "sender", "receiver", "ordinal", "field", "a", "b", "causes",
    ] {
        assert!(!different["first"][key].is_null(), "{key}");
    }
    let told = farside(folder.path(), &["diff", "a.mcap", "c.mcap"]);
    let told = text(&told.stdout);
    for part in [
        "scenario: links.default.loss: 0.02 | 0.2",
        "< only in a.mcap   > only in c.mcap",
        "/node_*/assignments  (",
        "--topics lists",
    ] {
        assert!(told.contains(part), "{part} is not in\n{told}");
    }
    assert!(told.lines().count() < 80, "{told}");
    let all = farside(folder.path(), &["diff", "a.mcap", "c.mcap", "--topics"]);
    assert!(
        text(&all.stdout).contains("/assignments  from ") && !text(&all.stdout).contains("/node_*")
    );
    let trouble = farside(folder.path(), &["diff", "a.mcap", "missing.mcap"]);
    assert_eq!(trouble.status.code(), Some(2));

    let whole = std::fs::read(folder.path().join("a.mcap")).unwrap();
    std::fs::write(
        folder.path().join("cut.mcap"),
        &whole[..whole.len() * 3 / 4],
    )
    .unwrap();
    let saved = farside(
        folder.path(),
        &["recover", "cut.mcap", "--out", "saved.mcap"],
    );
    // Saved, but not without loss.
    assert_eq!(saved.status.code(), Some(1), "{}", text(&saved.stderr));
    for log in ["cut.mcap", "saved.mcap"] {
        let verified = farside(folder.path(), &["verify", log]);
        assert_eq!(
            verified.status.code(),
            Some(0),
            "{}",
            text(&verified.stderr)
        );
        assert!(text(&verified.stdout).contains("as far as it goes"));
    }
}

#[test]
fn what_is_in_a_log_fits_a_screen_unless_all_of_it_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    farside(folder.path(), &small(&[]));
    let short = farside(folder.path(), &["info", "run.mcap"]);
    let short = text(&short.stdout);
    assert!(short.contains("/node_*/locations  ("), "{short}");
    assert!(short.lines().count() < 50, "{short}");
    let all = farside(folder.path(), &["info", "run.mcap", "--topics"]);
    assert!(text(&all.stdout).contains("/node_02/locations"));
    let everything = json(&farside(folder.path(), &["info", "run.mcap", "--json"]));
    assert!(everything["topics"].as_array().unwrap().len() > 50);
}

/// A log in the place of a scenario: the same run, or a changed one, with all that it needs in the log.
#[test]
fn the_scenario_of_a_log_is_run_changed() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let plan = "a contact +0 +3600 1 2 1000\na range +0 +3600 1 2 1\n";
    std::fs::write(at.join("plan.txt"), plan).unwrap();
    let scenario = "system = 'traffic'\nuntil = '9s'\n[traffic]\nhosts = ['a', 'b']\n\
        flow = [{ from = 'a', to = 'b', size = '100B', period = '1s' }]\n\
        [contacts]\nfile = 'plan.txt'\nnodes = { 1 = 'a', 2 = 'b' }\n";
    std::fs::write(at.join("s.toml"), scenario).unwrap();
    let digest = |arguments: &[&str]| {
        let output = farside(at, &[arguments, &["--json"]].concat());
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        json(&output)["digest"].clone()
    };
    let set = [
        "--set",
        "traffic.flow=[{from='a',to='b',size='100B',period='500ms'}]",
    ];
    let ties = ["--tie-seed", "7"];
    let first = digest(&[&["run", "s.toml"][..], &ties].concat());
    let run = ["run", "s.toml", "--no-log"];
    let other = digest(&[&run[..], &ties, &set].concat());
    assert_ne!(first, other);
    // The log needs neither of them any more.
    std::fs::remove_file(at.join("plan.txt")).unwrap();
    std::fs::remove_file(at.join("s.toml")).unwrap();
    assert_eq!(digest(&["run", "run.mcap", "--out", "again.mcap"]), first);
    let same = farside(at, &["diff", "run.mcap", "again.mcap"]);
    assert_eq!(same.status.code(), Some(0), "{}", text(&same.stdout));
    let changed = [&["run", "run.mcap", "--out", "other.mcap"][..], &set].concat();
    assert_eq!(digest(&changed), other);
    let differs = farside(at, &["diff", "run.mcap", "other.mcap"]);
    assert_eq!(differs.status.code(), Some(1), "{}", text(&differs.stdout));
    let verified = farside(at, &["verify", "other.mcap"]);
    assert_eq!(
        verified.status.code(),
        Some(0),
        "{}",
        text(&verified.stderr)
    );

    let before = std::fs::read(at.join("run.mcap")).unwrap();
    for (more, said) in [
        (&["--out", "run.mcap"][..], "is read by this command"),
        // The default is the log itself.
        (&[], "is read by this command"),
        (&["--no-log", "--set", "traffic.flw=[]"], "flow"),
        (&["--no-log", "--set", "until=soon"], "until"),
    ] {
        let refused = farside(at, &[&["run", "run.mcap"][..], more].concat());
        let stderr = text(&refused.stderr);
        assert_eq!(refused.status.code(), Some(2), "{more:?}: {stderr}");
        assert!(stderr.contains(said), "{more:?}: {stderr}");
    }
    assert_eq!(std::fs::read(at.join("run.mcap")).unwrap(), before);
    std::fs::write(at.join("cut.mcap"), &before[..40]).unwrap();
    let refused = farside(at, &["run", "cut.mcap", "--no-log"]);
    let stderr = text(&refused.stderr);
    assert_eq!(refused.status.code(), Some(2), "{stderr}");
    assert!(stderr.contains("not the log of a Farside run"), "{stderr}");
}
