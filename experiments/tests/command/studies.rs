//! Studies on the command line: killed and started again, in shards, reproduced, refused.

use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::Value;

use crate::common::{farside, json, text};

/// A study of a few rovers: 2 cells of 4 seeds.
const SMALL: &str = "question = 'How many arrive?'\nscenario = 'network/crater-dense'\n\
    metrics = ['arrived', 'collisions', 'completed', 'arrival_s', 'messages.lost']\nseeds = 4\n\
    [set]\nuntil = '12s'\nteam.rovers = 3\n\
    [[factor]]\nname = 'loss'\nkey = 'links.default.loss'\nvalues = [0, '30%']\n";

fn write(folder: &Path, name: &str, text: &str) {
    std::fs::write(folder.join(name), text).unwrap();
}

fn read(folder: &Path, name: &str) -> String {
    std::fs::read_to_string(folder.join(name)).unwrap()
}

#[track_caller]
fn study(folder: &Path, arguments: &[&str]) -> Value {
    let output = farside(
        folder,
        &[&["study", "small.toml", "--json"], arguments].concat(),
    );
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(output.stderr.is_empty(), "{}", text(&output.stderr));
    json(&output)
}

#[test]
fn a_study_says_how_each_cell_fares() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "small.toml", SMALL);
    let said = study(folder.path(), &[]);
    assert_eq!(
        (&said["study"], &said["runs"]),
        (&"small".into(), &8.into())
    );
    assert_eq!((&said["failed"], &said["missing"]), (&0.into(), &0.into()));
    for (cell, loss) in [(0, 0.0), (1, 0.3)] {
        let cell = &said["cells"][cell];
        assert_eq!(
            (cell["factors"]["loss"].as_f64(), cell["n"].as_u64()),
            (Some(loss), Some(4))
        );
        assert_eq!(cell["totals"]["collisions"], 0);
        for bound in ["mean", "ci_low", "ci_high"] {
            assert!(cell["metrics"]["arrived"][bound].is_number(), "{cell}");
        }
    }
    assert!(said["cells"][1]["metrics"]["messages.lost"]["mean"].as_f64() > Some(0.0));
    let table = farside(folder.path(), &["study", "small.toml"]);
    let table = text(&table.stdout);
    assert!(table.starts_with("small: How many arrive?"), "{table}");
    assert!(table.contains("results/small/results.csv"), "{table}");
    let listed = farside(folder.path(), &["studies"]);
    assert!(
        text(&listed.stdout).contains("degradation/loss  "),
        "{}",
        text(&listed.stdout)
    );
}

#[test]
fn shards_and_jobs_give_the_same_table() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "small.toml", SMALL);
    study(folder.path(), &["--out", "whole", "--jobs", "1"]);
    let first = study(folder.path(), &["--out", "parts", "--shard", "2/2"]);
    assert_eq!((&first["runs"], &first["missing"]), (&4.into(), &4.into()));
    assert!(!folder.path().join("parts/results.csv").exists());
    study(
        folder.path(),
        &["--out", "parts", "--shard", "1/2", "--jobs", "2"],
    );
    let whole = read(folder.path(), "whole/results.csv");
    assert_eq!(whole, read(folder.path(), "parts/results.csv"));
    // Each machine with a folder of its own: the report joins them, in any order.
    study(folder.path(), &["--out", "a", "--shard", "1/2"]);
    study(folder.path(), &["--out", "b", "--shard", "2/2"]);
    let joined = farside(folder.path(), &["report", "b", "a", "--out", "joined"]);
    assert_eq!(joined.status.code(), Some(0), "{}", text(&joined.stderr));
    assert_eq!(whole, read(folder.path(), "joined/results.csv"));
    // More seeds go on from there.
    assert_eq!(
        study(folder.path(), &["--out", "parts", "--seeds", "5"])["runs"],
        10
    );
}

#[test]
#[cfg(unix)]
fn a_killed_study_goes_on_and_ends_the_same() {
    let folder = tempfile::tempdir().unwrap();
    // Long enough to be killed in the middle of it, on any machine.
    let text = SMALL
        .replace("12s", "60s")
        .replace("rovers = 3", "rovers = 8");
    write(
        folder.path(),
        "small.toml",
        &text.replace("seeds = 4", "seeds = 20"),
    );
    study(folder.path(), &["--out", "whole"]);
    let runs = folder.path().join("killed/runs.jsonl");
    let lines = || {
        std::fs::read_to_string(&runs)
            .unwrap_or_default()
            .lines()
            .count()
    };
    for signal in ["-KILL", "-TERM"] {
        let before = lines();
        let mut child = Command::new(env!("CARGO_BIN_EXE_farside"))
            .args(["study", "small.toml", "--out", "killed", "--jobs", "1"])
            .current_dir(folder.path())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        while lines() < before + 5 {
            assert!(child.try_wait().unwrap().is_none(), "it ended by itself");
            std::thread::yield_now();
        }
        let process = child.id().to_string();
        let killed = Command::new("kill").args([signal, &process]).status();
        assert!(killed.unwrap().success());
        let code = child.wait().unwrap().code();
        let output = child.wait_with_output().unwrap();
        if signal == "-TERM" {
            assert_eq!(code, Some(3));
            let said = crate::common::text(&output.stderr);
            assert!(
                said.starts_with("interrupted: ") && said.contains("goes on"),
                "{said}"
            );
        }
        assert!(lines() < 40, "killed too late");
    }
    // As if it had been killed in the middle of a line.
    let bytes = std::fs::read(&runs).unwrap();
    std::fs::write(&runs, &bytes[..bytes.len() - 30]).unwrap();
    study(folder.path(), &["--out", "killed"]);
    assert_eq!(lines(), 40);
    for file in ["results.csv", "manifest.json"] {
        let whole = read(folder.path(), &format!("whole/{file}"));
        assert_eq!(whole, read(folder.path(), &format!("killed/{file}")));
    }
}

/// Runs a study over a roadmap and a scenario in files of their own.
fn run_on_a_ring(folder: &Path) {
    let map = "name = 'ring'\nboundary = [0, 2]\nedges = [[0, 1], [1, 2], [2, 3], [0, 3]]\n\
        positions_m = [[0, 0], [50, 0], [50, 50], [0, 50]]";
    write(folder, "ring.toml", map);
    let scenario = "system = 'network'\nuntil = '30s'\nworld.roadmap = 'ring.toml'\n\
        world.nodes = 2\nteam.rovers = 2";
    write(folder, "mine.toml", scenario);
    let text_of = SMALL.replace("network/crater-dense", "mine.toml");
    write(
        folder,
        "small.toml",
        &text_of.replace("team.rovers = 3", "team.rovers = 2"),
    );
    study(
        folder,
        &["--out", "out", "--set", "links.default.latency=8ms"],
    );
}

#[test]
fn a_run_is_reproduced_from_the_folder_alone() {
    let folder = tempfile::tempdir().unwrap();
    run_on_a_ring(folder.path());
    for file in ["ring.toml", "mine.toml", "small.toml"] {
        std::fs::remove_file(folder.path().join(file)).unwrap();
    }
    let again = |more: &[&str]| farside(folder.path(), &[&["reproduce", "out"], more].concat());
    let same = again(&[
        "--cell", "loss=30%", "--seed", "3", "--out", "x.mcap", "--json",
    ]);
    assert_eq!(same.status.code(), Some(0), "{}", text(&same.stderr));
    let same = json(&same);
    assert_eq!(
        (&same["result"], &same["cell"]),
        (&"same".into(), &1.into())
    );
    let info = json(&farside(folder.path(), &["info", "x.mcap", "--json"]));
    assert_eq!(info["run"]["digest"], same["run"]["digest"]);
    assert_eq!(info["run"]["seed"], 3);
    let verified = farside(folder.path(), &["verify", "x.mcap"]);
    assert_eq!(
        verified.status.code(),
        Some(0),
        "{}",
        text(&verified.stderr)
    );
    for (arguments, part) in [
        (["--cell", "2", "--seed", "3"], "from 0 to 1"),
        (
            ["--cell", "loss=0.4", "--seed", "3"],
            "its values are 0, 30%",
        ),
        (["--cell", "lossy", "--seed", "3"], "loss=..."),
        (["--cell", "1", "--seed", "5"], "one from 1 to 4"),
        (["--cell", "1", "--seed", "-5"], "-5"),
    ] {
        let output = again(&arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(
            text(&output.stderr).contains(part),
            "{}",
            text(&output.stderr)
        );
    }
    let lines = read(folder.path(), "out/runs.jsonl");
    let of_run = |line: &&str| line.starts_with("{\"cell\":1,\"seed\":3,");
    let line = lines.lines().find(of_run).unwrap();
    let tampered = line.replace("\"arrived\":", "\"arrived\":7");
    assert_ne!(line, tampered);
    write(
        folder.path(),
        "out/runs.jsonl",
        &lines.replace(line, &tampered),
    );
    let different = again(&["--cell", "1", "--seed", "3", "--json"]);
    assert_eq!(different.status.code(), Some(1));
    let different = json(&different);
    assert_eq!(different["result"], "different");
    assert_eq!(different["differences"][0]["part"], "metrics.arrived");
    assert_eq!(different["differences"].as_array().map(Vec::len), Some(1));
    let nowhere = again(&["--cell", "0", "--seed", "3", "--out", "no/x.mcap"]);
    assert_eq!(nowhere.status.code(), Some(3), "{}", text(&nowhere.stderr));
}

#[test]
fn wrong_studies_exit_with_2_and_write_nothing() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "small.toml", SMALL);
    write(
        folder.path(),
        "none.toml",
        &SMALL.replace("[0, '30%']", "[]"),
    );
    write(
        folder.path(),
        "metric.toml",
        &SMALL.replace("'completed'", "'complete'"),
    );
    std::fs::create_dir(folder.path().join("theirs")).unwrap();
    write(folder.path(), "theirs/thesis.tex", "");
    for (arguments, part) in [
        (
            &["degradation/los"][..],
            "did you mean \"degradation/loss\"?",
        ),
        (&["."], "directory"),
        (
            &["none.toml"],
            "none.toml:11:10: factor.0.values: expected at least one value",
        ),
        (&["metric.toml"], "did you mean \"completed\"?"),
        (
            &["small.toml", "--set", "team.rover=3"],
            "did you mean \"rovers\"?",
        ),
        (
            &["small.toml", "--set", "links.default.loss=0.3"],
            "as its factor loss",
        ),
        (&["small.toml", "--shard", "3/2"], "1/4"),
        (&["small.toml", "--seeds", "0"], "--seeds"),
        (&["small.toml", "--out", "theirs"], "it holds thesis.tex"),
    ] {
        let output = farside(folder.path(), &[&["study"], arguments].concat());
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(
            text(&output.stderr).contains(part),
            "{}",
            text(&output.stderr)
        );
        assert!(output.stdout.is_empty());
    }
    assert!(!folder.path().join("results").exists());
}

/// Ties as a factor: the same seeds, another order of what happens at one instant.
#[test]
fn ties_may_be_a_factor() {
    let folder = tempfile::tempdir().unwrap();
    let factor = "[[factor]]\nname = 'loss'\nkey = 'links.default.loss'\nvalues = [0, '30%']\n";
    let ties = "[[factor]]\nname = 'ties'\nvariants = [{ name = 'by name' }, \
        { name = 'one', set = { tie_seed = 1 } }]\n[[factor]]\nname = 'more'\nkey = 'tie_seed'\n\
        values = [2, 3]\n";
    let both = SMALL.replace(factor, ties);
    write(folder.path(), "small.toml", &both);
    let refused = farside(folder.path(), &["study", "small.toml"]);
    assert!(
        text(&refused.stderr).contains("another factor sets this key"),
        "{refused:?}"
    );
    let key = "[[factor]]\nname = 'ties'\nkey = 'tie_seed'\nvalues = [1, 2]\n";
    write(folder.path(), "small.toml", &SMALL.replace(factor, key));
    let said = study(folder.path(), &[]);
    assert_eq!(said["cells"][1]["factors"]["ties"], 2);
    let digest = |row: &str| row.split(',').nth(5).map(str::to_owned);
    let rows = read(folder.path(), "results/small/results.csv");
    let rows: Vec<_> = rows.lines().skip(1).map(digest).collect();
    assert!(rows.len() == 8 && rows[0] != rows[4], "{rows:?}");
    let again = [
        "reproduce",
        "results/small",
        "--cell",
        "ties=2",
        "--seed",
        "1",
        "--out",
        "a.mcap",
    ];
    assert_eq!(farside(folder.path(), &again).status.code(), Some(0));
    assert_eq!(
        farside(folder.path(), &["verify", "a.mcap"]).status.code(),
        Some(0)
    );
    let info = json(&farside(folder.path(), &["info", "a.mcap", "--json"]));
    assert_eq!(info["run"]["tie_seed"], 2, "{info}");
}

/// Two seeds of one problem: the same rovers with the same goals, other chances. The log of a run
/// says which problem it had.
#[test]
fn blocks_share_a_problem_and_logs_say_which() {
    let folder = tempfile::tempdir().unwrap();
    write(
        folder.path(),
        "small.toml",
        &SMALL.replace("seeds = 4", "seeds = 4\nblock = 2"),
    );
    let said = study(folder.path(), &[]);
    assert_eq!(said["missing"], 0);
    let goals = |seed: &str| {
        let log = format!("{seed}.mcap");
        let again = [
            "reproduce",
            "results/small",
            "--cell",
            "1",
            "--seed",
            seed,
            "--out",
            &log,
        ];
        let output = farside(folder.path(), &again);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        let verified = farside(folder.path(), &["verify", &log, "--executor", "inline"]);
        assert_eq!(
            verified.status.code(),
            Some(0),
            "{}",
            text(&verified.stdout)
        );
        let drawn = farside(folder.path(), &["draw", &log, "--out", "map.svg"]);
        assert_eq!(drawn.status.code(), Some(0), "{}", text(&drawn.stderr));
        let info = json(&farside(folder.path(), &["info", &log, "--json"]));
        let scenario = farside(folder.path(), &["diff", &log, "1.mcap", "--json"]);
        (info["run"]["seed"].clone(), scenario.status.code())
    };
    assert_eq!(goals("1"), (1.into(), Some(0)));
    assert_eq!(goals("2"), (2.into(), Some(1)));
    let problem = |seed: &str, problem: &str| {
        let seeds = format!("seed={seed}");
        let of = format!("problem_seed={problem}");
        let sets = [
            "--set",
            "team.rovers=3",
            "--set",
            "until=12s",
            "--set",
            &seeds,
            "--set",
            &of,
        ];
        let common = ["--set", "links.default.loss=30%", "--no-log", "--json"];
        let run = farside(folder.path(), &[&["run"], &sets[..], &common].concat());
        json(&run)["digest"].clone()
    };
    let rows = read(folder.path(), "results/small/results.csv");
    let recorded = |at: usize| rows.lines().nth(at).and_then(|row| row.split(',').nth(5));
    assert_eq!(problem("2", "1").as_str(), recorded(6), "{rows}");
    assert_ne!(problem("2", "2").as_str(), recorded(6));
    assert_eq!(problem("3", "3").as_str(), recorded(7));
    assert_eq!(problem("4", "3").as_str(), recorded(8));
    let refused = farside(folder.path(), &["study", "small.toml", "--seeds", "5"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(
        text(&refused.stderr)
            .contains("--seeds 5: no whole number of blocks of 2: 4 or 6 would be"),
        "{}",
        text(&refused.stderr)
    );
}

/// A scenario's own tie seed holds, and the argument overrides it.
#[test]
fn a_scenario_has_a_tie_seed() {
    let folder = tempfile::tempdir().unwrap();
    let small = ["run", "--set", "team.rovers=5", "--until", "10s", "--json"];
    let run = |more: &[&str]| json(&farside(folder.path(), &[&small, more].concat()));
    let by_key = run(&["--set", "tie_seed=5", "--out", "key.mcap"]);
    let by_argument = run(&["--tie-seed", "5", "--out", "argument.mcap"]);
    let by_both = run(&["--set", "tie_seed=4", "--tie-seed", "5", "--no-log"]);
    let without = run(&["--no-log"]);
    assert_eq!(by_key["digest"], by_argument["digest"]);
    assert_eq!(by_key["digest"], by_both["digest"]);
    assert_ne!(by_key["digest"], without["digest"]);
    assert_eq!(
        (&by_key["tie_seed"], &without["tie_seed"]),
        (&5.into(), &Value::Null)
    );
    for log in ["key.mcap", "argument.mcap"] {
        assert_eq!(
            farside(folder.path(), &["verify", log]).status.code(),
            Some(0),
            "{log}"
        );
    }
    let same = farside(folder.path(), &["diff", "key.mcap", "argument.mcap"]);
    assert_eq!(same.status.code(), Some(0), "{}", text(&same.stdout));
    let wrong = farside(folder.path(), &["run", "--set", "tie_seed=-1", "--no-log"]);
    assert_eq!(wrong.status.code(), Some(2));
    assert!(
        text(&wrong.stderr).contains("expected a whole number from 0 on"),
        "{}",
        text(&wrong.stderr)
    );
}
