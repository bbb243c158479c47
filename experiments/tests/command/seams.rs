//! Where commands meet: what one wrote given to another, outputs that cannot be written, and what
//! never came into play.

use std::path::Path;

use crate::common::{farside, json, text};

const SCENARIO: &str = "system = 'network'\nuntil = '60s'\n[world]\nroadmap = 'crater-sparse'\n\
    nodes = 12\n[team]\nrovers = 1\n[[degrade]]\nat = '50s'\nlinks = '*'\nloss = 0.5\n";

const STUDY: &str = "question = 'Does the storm matter?'\nscenario = 's.toml'\n\
    metrics = ['time_ratio', 'arrival_s']\nseeds = 6\n\
    [[factor]]\nname = 'storm'\nkey = 'degrade.0.at'\nvalues = ['50s', '55s']\n";

fn write(folder: &Path) {
    std::fs::write(folder.join("s.toml"), SCENARIO).unwrap();
    std::fs::write(folder.join("study.toml"), STUDY).unwrap();
}

#[test]
fn what_another_command_takes_is_called_what_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write(at);
    assert!(farside(at, &["run", "s.toml"]).status.success());
    assert!(
        farside(at, &["study", "study.toml", "--out", "r"])
            .status
            .success()
    );
    for (arguments, said) in [
        (
            &["check", "run.mcap"][..],
            "run.mcap: is a log, and a scenario is expected",
        ),
        (
            &["check", "study.toml"],
            "study.toml: is a study, and a scenario",
        ),
        (&["study", "s.toml"], "s.toml: is a scenario, and a study"),
        (&["study", "r"], "r: is a results folder, and a study"),
        (&["info", "r"], "r: is a results folder, and a log"),
        (&["verify", "s.toml"], "s.toml: is a scenario, and a log"),
        (&["draw", "study.toml"], "study.toml: is a study, and a log"),
        (
            &["diff", "run.mcap", "s.toml"],
            "s.toml: is a scenario, and a log",
        ),
        (
            &["recover", "s.toml", "--out", "x"],
            "s.toml: is a scenario, and a log",
        ),
        (
            &["report", "run.mcap"],
            "run.mcap: is a log, and a results folder",
        ),
        (
            &[
                "reproduce",
                "s.toml",
                "--cell",
                "0",
                "--seed",
                "1",
                "--out",
                "x",
            ],
            "s.toml: is a scenario, and a results folder",
        ),
    ] {
        let output = farside(at, arguments);
        let stderr = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
        assert!(stderr.contains(said), "{arguments:?}: {stderr}");
        assert!(stderr.contains("`farside "), "{arguments:?}: {stderr}");
    }
}

/// Of each command that writes: whether nobody can write there is told by one exit code.
#[test]
fn outputs_that_cannot_be_written_have_one_exit_code() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write(at);
    assert!(farside(at, &["run", "s.toml"]).status.success());
    let study = ["study", "study.toml", "--seeds", "1"];
    assert!(
        farside(at, &[&study[..], &["--out", "r"]].concat())
            .status
            .success()
    );
    std::fs::create_dir(at.join("folder")).unwrap();
    let run = ["run", "s.toml"];
    let recover = ["recover", "run.mcap"];
    let draw = ["draw", "run.mcap"];
    let reproduce = ["reproduce", "r", "--cell", "0", "--seed", "1"];
    let report = ["report", "r"];
    let mut cases: Vec<(&[&str], &str)> = Vec::new();
    for files in [&run[..], &recover, &draw, &reproduce] {
        cases.extend([
            (files, "no/such/file"),
            (files, "folder"),
            (files, "s.toml/x"),
        ]);
    }
    for folders in [&study[..], &report] {
        cases.extend([(folders, "s.toml"), (folders, "s.toml/x")]);
    }
    if Path::new("/dev/full").exists() {
        for files in [&run[..], &recover, &draw, &reproduce] {
            cases.push((files, "/dev/full"));
        }
    }
    for (command, out) in cases {
        let output = farside(at, &[command, &["--out", out]].concat());
        // What a run came to is told where its results are, also if it could not be recorded.
        let said = format!("{}{}", text(&output.stderr), text(&output.stdout));
        assert_eq!(output.status.code(), Some(3), "{command:?} {out}: {said}");
        assert!(said.contains(out), "{command:?} {out}: {said}");
    }
    let junit = [&study[..], &["--out", "r", "--junit", "no/such/file"]].concat();
    assert_eq!(farside(at, &junit).status.code(), Some(3));
}

#[test]
fn a_storm_behind_the_end_is_said_to_be_never_reached() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write(at);
    // Known before the run: `until` is before it.
    let before = farside(
        at,
        &["run", "s.toml", "--no-log", "--until", "10s", "--json"],
    );
    let said =
        "degrade.0 is never reached: it begins at 50s, and the run ends at 10s at the latest";
    assert!(
        text(&before.stderr).contains(said),
        "{}",
        text(&before.stderr)
    );
    assert_eq!(json(&before)["remarks"][0], said);
    // Known after it: the rover has arrived.
    let after = farside(at, &["run", "s.toml", "--no-log", "--json"]);
    let stderr = text(&after.stderr);
    let said = "degrade.0 was never reached: it begins at 50s, and the run ended at ";
    assert!(
        stderr.contains(said) && stderr.contains("before `until`, 60s"),
        "{stderr}"
    );
    assert!(
        json(&after)["never_reached"][0]
            .as_str()
            .unwrap()
            .starts_with(said)
    );

    let study = farside(at, &["study", "study.toml", "--out", "r"]);
    let stdout = text(&study.stdout);
    for said in [
        "storm changes nothing: with each of its values (50s, 55s) runs of one seed are the same",
        "degrade.0 was never reached: each run ended before",
    ] {
        assert!(stdout.contains(said), "{stdout}");
    }
    let again = json(&farside(
        at,
        &["study", "study.toml", "--out", "r", "--json"],
    ));
    assert_eq!(again["cells"][0]["never_reached"]["degrade.0"], 6);
    assert_eq!(again["same_values"][0]["all"], true);
    assert!(farside(at, &["report", "r"]).status.success());
    let page = std::fs::read_to_string(at.join("r/report.html")).unwrap();
    assert!(
        page.contains("No effect: storm changes nothing"),
        "it is beside the plots"
    );
    assert!(page.matches("storm changes nothing").count() >= 2);
    let values = std::fs::read_to_string(at.join("r/values.csv")).unwrap();
    assert!(values.starts_with("cell,storm,seed,metric,index,value\n0,50s,1,arrival_s,0,"));
}

#[test]
fn a_study_is_checked_against_an_earlier_one() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write(at);
    let study = |more: &[&str]| {
        let output = farside(at, &[&["study", "study.toml"], more].concat());
        (
            output.status.code(),
            text(&output.stderr).to_owned(),
            output,
        )
    };
    let (code, stderr, _) = study(&["--out", "before"]);
    assert_eq!(code, Some(0), "{stderr}");
    let same = [
        "--out",
        "same",
        "--check",
        "before/runs.jsonl",
        "--junit",
        "same.xml",
    ];
    let (code, stderr, output) = study(&same);
    assert_eq!(code, Some(0), "{stderr}");
    assert!(
        text(&output.stdout).contains("0 better, 0 worse"),
        "{}",
        text(&output.stdout)
    );
    let slower = ["--out", "slower", "--set", "network.cycle=3s", "--json"];
    let check = ["--check", "before", "--junit", "slower.xml"];
    let (code, stderr, output) = study(&[&slower[..], &check].concat());
    assert_eq!(code, Some(1), "{stderr}");
    let verdicts = &json(&output)["check"]["checked"];
    let worse = verdicts.as_array().unwrap().iter();
    let worse: Vec<&str> = worse
        .filter(|one| one["verdict"] == "worse")
        .map(|one| one["metric"].as_str().unwrap())
        .collect();
    assert_eq!(worse, ["arrival_s", "arrival_s"]);
    for (file, failures) in [("same.xml", "0"), ("slower.xml", "2")] {
        let xml = std::fs::read_to_string(at.join(file)).unwrap();
        let document = roxmltree::Document::parse(&xml).unwrap();
        assert_eq!(
            document.root_element().attribute("failures"),
            Some(failures)
        );
    }
    // What is no results, or those of something else, is said before anything runs.
    for (file, said) in [
        ("s.toml", "not a results folder"),
        ("no/such", "not a results folder"),
    ] {
        let (code, stderr, _) = study(&["--out", "never", "--check", file]);
        assert_eq!(code, Some(2), "{stderr}");
        assert!(stderr.contains(said), "{stderr}");
    }
    std::fs::write(
        at.join("study.toml"),
        STUDY.replace("seeds = 6", "seeds = [100]"),
    )
    .unwrap();
    let (code, stderr, _) = study(&["--out", "never", "--check", "before"]);
    assert_eq!(code, Some(2), "{stderr}");
    assert!(
        stderr.contains("they have the seeds 1 to 6, and this study 100 to 100"),
        "{stderr}"
    );
    std::fs::write(
        at.join("study.toml"),
        STUDY.replace("s.toml", "network/crater-gaps"),
    )
    .unwrap();
    let (code, stderr, _) = study(&["--out", "never", "--check", "before"]);
    assert_eq!(code, Some(2), "{stderr}");
    assert!(!at.join("never").exists());
}

#[test]
fn a_dry_run_says_how_much_there_is_to_do_and_writes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write(at);
    let told = farside(
        at,
        &[
            "study",
            "study.toml",
            "--out",
            "r",
            "--dry-run",
            "--jobs",
            "1",
        ],
    );
    let stdout = text(&told.stdout);
    assert!(stdout.contains("2 cells, 6 seeds each\n12 runs to do, one at a time: about"));
    assert!(stdout.contains("runs tried now"), "{stdout}");
    assert!(!at.join("r").exists());
    assert!(
        farside(at, &["study", "study.toml", "--out", "r"])
            .status
            .success()
    );
    let told = json(&farside(
        at,
        &[
            "study",
            "study.toml",
            "--out",
            "r",
            "--seeds",
            "10",
            "--dry-run",
            "--json",
        ],
    ));
    assert_eq!((&told["runs"], &told["done"]), (&8.into(), &12.into()));
    assert_eq!(told["basis"]["by"], "stored");
}

#[test]
fn one_that_is_built_in_is_printed_whole() {
    let folder = tempfile::tempdir().unwrap();
    let printed = farside(folder.path(), &["scenarios", "network/crater-sparse"]);
    std::fs::write(folder.path().join("mine.toml"), &printed.stdout).unwrap();
    let resolved = |scenario: &str| {
        let output = farside(folder.path(), &["check", scenario]);
        text(&output.stdout).to_owned()
    };
    assert_eq!(resolved("mine.toml"), resolved("network/crater-sparse"));
    let study = farside(folder.path(), &["studies", "degradation/loss"]);
    assert!(text(&study.stdout).contains("[[factor]]"));
}
