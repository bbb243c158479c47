//! Nobody's file is overwritten by accident: not what a command reads, by whatever name, and not what
//! is there and of another kind.

use std::path::Path;
use std::process::Output;

use crate::common::{SMALL, farside, text};

const SCENARIO: &str = "system = 'network'\nuntil = '5s'\n[team]\nrovers = 2\n";

/// The command fails as one that was called wrongly, says why, and leaves the file as it was.
fn refused(folder: &Path, arguments: &[&str], kept: &str, why: &str) -> Output {
    let before = std::fs::read(folder.join(kept)).unwrap();
    let output = farside(folder, arguments);
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
    assert!(said.contains(why), "{arguments:?}: {said}");
    assert_eq!(
        std::fs::read(folder.join(kept)).unwrap(),
        before,
        "{arguments:?} changed {kept}"
    );
    output
}

const READ: &str = "is read by this command, which does not write over what it reads";

#[test]
fn a_run_spares_what_it_reads_and_what_is_no_log() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("s.toml"), SCENARIO).unwrap();
    refused(at, &["run", "s.toml", "--out", "s.toml"], "s.toml", READ);
    std::fs::hard_link(at.join("s.toml"), at.join("hard.mcap")).unwrap();
    refused(at, &["run", "s.toml", "--out", "hard.mcap"], "s.toml", READ);
    refused(at, &["run", "s.toml", "--out", "./s.toml"], "s.toml", READ);
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("s.toml", at.join("soft.mcap")).unwrap();
        refused(at, &["run", "s.toml", "--out", "soft.mcap"], "s.toml", READ);
    }
    std::fs::write(at.join("thesis.txt"), "all my work").unwrap();
    let no_log = "is there already and is no log: it is not replaced";
    refused(
        at,
        &["run", "s.toml", "--out", "thesis.txt"],
        "thesis.txt",
        no_log,
    );
    // The default name is as any other.
    std::fs::write(at.join("run.mcap"), "not a log").unwrap();
    refused(at, &["run", "s.toml"], "run.mcap", no_log);

    // A log gives way to a log, and so does an empty file; a device has nothing to lose.
    std::fs::write(at.join("run.mcap"), "").unwrap();
    for out in ["run.mcap", "run.mcap", "/dev/null"] {
        if out == "/dev/null" && !Path::new(out).exists() {
            continue;
        }
        let output = farside(at, &["run", "s.toml", "--out", out]);
        assert!(output.status.success(), "{}", text(&output.stderr));
    }
}

#[test]
fn a_run_spares_the_files_that_its_scenario_names() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let plan = "a contact +0 +3600 1 2 1000\na range +0 +3600 1 2 1\n";
    std::fs::write(at.join("plan.txt"), plan).unwrap();
    let scenario = "system = 'traffic'\nuntil = '5s'\n[traffic]\nhosts = ['a', 'b']\n\
        flow = [{ from = 'a', to = 'b', size = '100B', period = '1s' }]\n\
        [contacts]\nfile = 'plan.txt'\nnodes = { 1 = 'a', 2 = 'b' }\n";
    std::fs::write(at.join("s.toml"), scenario).unwrap();
    let fine = farside(at, &["run", "s.toml"]);
    assert!(fine.status.success(), "{}", text(&fine.stderr));
    refused(
        at,
        &["run", "s.toml", "--out", "plan.txt"],
        "plan.txt",
        READ,
    );
}

#[test]
fn pictures_and_recovered_logs_spare_what_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    assert!(farside(at, &SMALL).status.success());
    refused(
        at,
        &["draw", "run.mcap", "--out", "run.mcap"],
        "run.mcap",
        READ,
    );
    std::fs::hard_link(at.join("run.mcap"), at.join("other.svg")).unwrap();
    refused(
        at,
        &["draw", "run.mcap", "--out", "other.svg"],
        "run.mcap",
        READ,
    );
    refused(
        at,
        &["recover", "run.mcap", "--out", "other.svg"],
        "run.mcap",
        READ,
    );
    let no_figure = "is there already and is no figure: it is not replaced";
    let inkscape = "<?xml version=\"1.0\" encoding=\"UTF-8\" standalone=\"no\"?>\n<svg/>";
    for mine in ["all my work", inkscape] {
        std::fs::write(at.join("map.svg"), mine).unwrap();
        refused(
            at,
            &["draw", "run.mcap", "--out", "map.svg"],
            "map.svg",
            no_figure,
        );
    }
    std::fs::write(at.join("map.svg"), "").unwrap();
    for _ in 0..2 {
        let output = farside(at, &["draw", "run.mcap", "--out", "map.svg"]);
        assert!(output.status.success(), "{}", text(&output.stderr));
    }
}

#[test]
fn reports_and_runs_again_spare_what_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let study = "question = 'How late?'\nscenario = 's.toml'\nseeds = 1\nmetrics = ['time_ratio']\n\
        [[factor]]\nname = 'loss'\nkey = 'links.default.loss'\nvalues = ['0%', '10%']\n";
    std::fs::write(at.join("s.toml"), SCENARIO).unwrap();
    std::fs::write(at.join("study.toml"), study).unwrap();
    let made = farside(at, &["study", "study.toml", "--out", "results"]);
    assert!(made.status.success(), "{}", text(&made.stderr));
    let again = [
        "reproduce",
        "results",
        "--cell",
        "0",
        "--seed",
        "1",
        "--out",
    ];
    let out = |name| [&again[..], &[name]].concat();
    refused(
        at,
        &out("results/manifest.json"),
        "results/manifest.json",
        READ,
    );
    refused(
        at,
        &out("s.toml"),
        "s.toml",
        "is no log: it is not replaced",
    );

    for _ in 0..2 {
        let report = farside(at, &["report", "results"]);
        assert!(report.status.success(), "{}", text(&report.stderr));
    }
    let report = ["report", "results", "--out", "mine"];
    std::fs::create_dir(at.join("mine")).unwrap();
    for (name, mine, what) in [
        (
            "results.csv",
            "name,mark\nme,1.0\n",
            "is no table of this kind",
        ),
        ("summary.csv", "all my work", "is no table of this kind"),
        (
            "report.html",
            "<!DOCTYPE html><html><title>My report</title></html>",
            "is no report",
        ),
    ] {
        std::fs::write(at.join("mine").join(name), mine).unwrap();
        refused(at, &report, &format!("mine/{name}"), what);
        std::fs::remove_file(at.join("mine").join(name)).unwrap();
    }
    // An output that is an input by another name.
    let page = at.join("mine/report.html");
    std::fs::hard_link(at.join("results/manifest.json"), page).unwrap();
    refused(at, &report, "results/manifest.json", READ);
}

/// The command with its standard output appended to a file.
fn appending(folder: &Path, arguments: &[&str], to: &str) -> Output {
    let file = std::fs::File::options()
        .append(true)
        .create(true)
        .open(folder.join(to));
    std::process::Command::new(env!("CARGO_BIN_EXE_farside"))
        .args(arguments)
        .current_dir(folder)
        .stdout(file.unwrap())
        .output()
        .unwrap()
}

#[cfg(unix)]
#[test]
fn what_is_printed_is_an_output_too() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("s.toml"), SCENARIO).unwrap();
    assert!(farside(at, &["run", "s.toml"]).status.success());
    let refused = |arguments: &[&str], to: &str, why: &str| {
        let before = std::fs::read(at.join(to)).unwrap_or_default();
        let output = appending(at, arguments, to);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
        assert!(said.contains(why), "{arguments:?}: {said}");
        let after = std::fs::read(at.join(to)).unwrap();
        assert_eq!(after, before, "{arguments:?} changed {to}");
    };
    // Appended to what is read.
    std::fs::hard_link(at.join("run.mcap"), at.join("hard.mcap")).unwrap();
    std::os::unix::fs::symlink("s.toml", at.join("soft.toml")).unwrap();
    refused(&["check", "s.toml"], "s.toml", READ);
    refused(&["check", "soft.toml"], "s.toml", READ);
    refused(&["run", "s.toml", "--no-log"], "s.toml", READ);
    refused(&["info", "run.mcap"], "hard.mcap", READ);
    refused(&["verify", "run.mcap"], "run.mcap", READ);
    refused(&["diff", "run.mcap", "hard.mcap"], "run.mcap", READ);
    refused(&["draw", "run.mcap", "--list"], "run.mcap", READ);
    refused(&["draw", "run.mcap", "--out", "map.svg"], "run.mcap", READ);
    let fork = [
        "fork",
        "run.mcap",
        "--at",
        "1s",
        "--set",
        "links.default.loss=0.5",
    ];
    let fork = [&fork[..], &["--out", "fork.mcap"]].concat();
    refused(&fork, "run.mcap", READ);
    let study = "question = 'How late?'\nscenario = 's.toml'\nseeds = 1\nmetrics = ['time_ratio']\n\
        [[factor]]\nname = 'loss'\nkey = 'links.default.loss'\nvalues = ['0%', '10%']\n";
    std::fs::write(at.join("study.toml"), study).unwrap();
    let array = ["study", "study.toml", "--array", "2", "--out", "array"];
    refused(&array, "study.toml", READ);
    refused(&array, "s.toml", READ);
    let planners = farside(at, &["scenarios", "misus/planners"]);
    std::fs::write(at.join("p.toml"), planners.stdout).unwrap();
    refused(&["problem", "p.toml"], "p.toml", READ);
    for name in ["m.ddl", "p.ddl", "plan.json"] {
        std::fs::write(at.join(name), "").unwrap();
    }
    refused(&["plan", "check", "m.ddl"], "m.ddl", READ);
    refused(&["plan", "check", "m.ddl", "p.ddl"], "p.ddl", READ);
    let validate = ["plan", "validate", "m.ddl", "p.ddl", "plan.json"];
    refused(&validate, "plan.json", READ);
    // The log in the middle of what is printed.
    let twice = "is written to by this command twice: it is also standard output";
    for out in ["/dev/stdout", "/dev/fd/1", "new.mcap"] {
        refused(&["run", "s.toml", "--out", out], "new.mcap", twice);
    }
    // A pipe is one file too.
    let output = farside(at, &["run", "s.toml", "--out", "/dev/stdout"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(output.stdout.is_empty(), "{}", output.stdout.len());
}

#[cfg(unix)]
#[test]
fn a_study_spares_what_it_reads_whatever_its_folder_leads_to() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let study = "question = 'How late?'\nscenario = 's.toml'\nseeds = 1\nmetrics = ['time_ratio']\n\
        [[factor]]\nname = 'loss'\nkey = 'links.default.loss'\nvalues = ['0%', '10%']\n";
    std::fs::write(at.join("s.toml"), SCENARIO).unwrap();
    std::fs::write(at.join("study.toml"), study).unwrap();
    let run = ["study", "study.toml", "--out", "results"];
    let made = farside(at, &run);
    assert!(made.status.success(), "{}", text(&made.stderr));
    for name in [
        "results.csv",
        "values.csv",
        "times.jsonl",
        "runs.jsonl",
        "lock",
    ] {
        let path = at.join("results").join(name);
        let kept = std::fs::read(&path).ok();
        for input in ["s.toml", "study.toml"] {
            let _ = std::fs::remove_file(&path);
            std::os::unix::fs::symlink(at.join(input), &path).unwrap();
            refused(at, &run, input, READ);
            std::fs::remove_file(&path).unwrap();
            std::fs::hard_link(at.join(input), &path).unwrap();
            refused(at, &run, input, READ);
        }
        std::fs::remove_file(&path).unwrap();
        if let Some(kept) = kept {
            std::fs::write(&path, kept).unwrap();
        }
    }
    let junit = |out| [&run[..], &["--junit", out]].concat();
    for (out, kept, why) in [
        ("study.toml", "study.toml", READ),
        ("s.toml", "s.toml", READ),
        (
            "results/results.csv",
            "results/results.csv",
            "is written to by this command twice",
        ),
        (
            "results/../results/runs.jsonl",
            "results/runs.jsonl",
            "twice",
        ),
    ] {
        refused(at, &junit(out), kept, why);
    }
    let check = ["study", "study.toml", "--out", "new", "--check", "results"];
    let check = [&check[..], &["--junit", "results/manifest.json"]].concat();
    refused(at, &check, "results/manifest.json", READ);
    // Tables of a report that are one file.
    std::fs::create_dir(at.join("mine")).unwrap();
    std::fs::write(at.join("mine/results.csv"), "").unwrap();
    std::fs::hard_link(at.join("mine/results.csv"), at.join("mine/summary.csv")).unwrap();
    let report = ["report", "results", "--out", "mine"];
    refused(
        at,
        &report,
        "mine/results.csv",
        "is written to by this command twice",
    );
}

/// The second of two runs into one file leaves the first alone.
#[test]
fn a_log_that_is_being_written_is_not_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("s.toml"), SCENARIO).unwrap();
    let options = farside_logs::LogOptions {
        scenario: "first".to_owned(),
        resolved: SCENARIO.to_owned(),
        ..farside_logs::LogOptions::default()
    };
    let writer = farside_logs::LogWriter::create(at.join("run.mcap"), options).unwrap();
    refused(
        at,
        &["run", "s.toml"],
        "run.mcap",
        "another run is writing it",
    );
    // What is renamed to its place would take it away from that run as well.
    let another = farside(at, &["run", "s.toml", "--out", "another.mcap"]);
    assert!(another.status.success(), "{}", text(&another.stderr));
    refused(
        at,
        &["recover", "another.mcap", "--out", "run.mcap"],
        "run.mcap",
        "another run is writing it",
    );
    drop(writer);
    let recovered = farside(at, &["recover", "another.mcap", "--out", "run.mcap"]);
    assert!(recovered.status.success(), "{}", text(&recovered.stderr));
    let output = farside(at, &["run", "s.toml"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
}

/// What a scenario reads is put beside the small one: not where the small one itself is to be.
#[test]
fn a_small_scenario_does_not_lie_where_a_file_that_it_reads_is_put() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let plan = "a contact +0 +3600 1 2 1000\na range +0 +3600 1 2 1\n";
    std::fs::write(at.join("plan.txt"), plan).unwrap();
    let scenario = "system = 'traffic'\nuntil = '5s'\n[traffic]\nhosts = ['a', 'b']\n\
        flow = [{ from = 'a', to = 'b', size = '100B', period = '1s' }]\n\
        [contacts]\nfile = 'plan.txt'\nnodes = { 1 = 'a', 2 = 'b' }\n";
    std::fs::write(at.join("s.toml"), scenario).unwrap();
    std::fs::create_dir(at.join("other")).unwrap();
    let shrink = ["shrink", "s.toml", "--violates", "sent>0", "--budget", "9"];
    for more in [
        &["--out", "other/plan.txt"][..],
        &["--out", "other/s.toml", "--state", "other/plan.txt"],
    ] {
        let output = farside(at, &[&shrink, more].concat());
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{more:?}: {said}");
        let twice = "other/plan.txt: is written to by this command twice";
        assert!(said.contains(twice), "{more:?}: {said}");
        let left = std::fs::read_dir(at.join("other")).unwrap().count();
        assert_eq!(left, 0, "{more:?}");
    }
}

/// Letters that a terminal obeys: the end of lines and tabs aside.
fn obeyed(text: &str) -> Option<char> {
    text.chars()
        .find(|letter| !matches!(letter, '\n' | '\t') && farside_logs::is_hidden(*letter))
}

#[test]
fn no_output_has_letters_that_a_terminal_obeys() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // Escape, delete, a control sequence in one letter, and a change of direction.
    let hostile = "s\u{1b}[31m\u{7f}\u{9b}2J\u{202e}.toml";
    std::fs::write(at.join(hostile), SCENARIO).unwrap();
    let log = "r\u{1b}]0;x\u{7}\u{9b}\u{7f}.mcap";
    let figure = "f\u{9b}\u{7f}.svg";
    for arguments in [
        &["check", hostile][..],
        &["run", hostile, "--out", log],
        &["run", hostile, "--out", log, "--json"],
        &["info", log],
        &["info", log, "--json"],
        &["verify", log],
        &["verify", log, "--json"],
        &["diff", log, log],
        &["diff", log, log, "--json"],
        &["draw", log, "--out", figure],
        &["draw", log, "--out", figure, "--json"],
        &["check", "no\u{1b}[2J\u{7f}where.toml"],
        &["check", hostile, "--set", "te\u{9b}am=\u{7f}"],
        &["run", hostile, "--out", hostile],
        &["explain", "li\u{1b}nks"],
        &["draw", log, "ma\u{9b}p"],
        &["recover", log, "--out", "x\u{9b}.mcap", "--json"],
        &["report", "no\u{9b}where"],
        &["study", "no\u{1b}where"],
        // What the command line itself refuses.
        &["run", "--no\u{9b}2Jthing"],
        &["run", "--seed", "\u{1b}[2J"],
        &["no\u{1b}[2Jthing"],
        // What is said besides: a warning of a file's name.
        &["plan", "check", "mo\u{9b}del.ddl"],
    ] {
        let output = farside(at, arguments);
        for said in [&output.stdout, &output.stderr] {
            let said = text(said);
            assert_eq!(obeyed(said), None, "{arguments:?}: {said:?}");
        }
        let asked_for_json = arguments.contains(&"--json");
        if asked_for_json {
            assert!(
                output.status.success(),
                "{arguments:?}: {}",
                text(&output.stderr)
            );
            let value: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
            let read_back = value.to_string();
            let names = [log, hostile, figure, "x\u{9b}.mcap"];
            let named = names.iter().any(|name| {
                let quoted = serde_json::Value::from(*name).to_string();
                read_back.contains(quoted.trim_matches('"'))
            });
            assert!(
                named || arguments[0] == "info" || arguments[0] == "recover",
                "{read_back}"
            );
        }
    }

    let study = "question = 'How late?'\nscenario = 's.toml'\nseeds = 1\nmetrics = ['time_ratio']\n\
        [[factor]]\nname = 'loss'\nlabel = \"lo\\u001b[2Jss\"\nkey = 'links.default.loss'\n\
        values = ['0%', '10%']\n";
    std::fs::write(at.join("s.toml"), SCENARIO).unwrap();
    std::fs::write(at.join("study.toml"), study).unwrap();
    let output = farside(at, &["study", "study.toml", "--out", "results"]);
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("has control characters"), "{said}");
    assert_eq!(obeyed(said), None, "{said:?}");
}
