//! Studies of curves, over blocks of seeds, with a claim that one cell exceeds another: by the
//! command of a system that this program does not know (`examples/climber.rs`, which
//! `cargo test` builds; an example, so that `cargo run` finds one binary).

use std::path::{Path, PathBuf};
use std::process::Command;

/// Two planners on six hills of five runs each.
const STUDY: &str = "question = 'From when on does cleverness pay?'\nscenario = 'climb.toml'\n\
    seeds = 30\nblock = 5\nmetrics = ['height']\n\
    [[factor]]\nname = 'planner'\nvariants = [{ name = 'simple' }, \
    { name = 'clever', set = { climb.gain = 0.3 } }]\n\
    [[published]]\nmetric = 'height'\ntitle = 'Figure 1'\nsource = 'A. N. Other'\nvalues = [\n\
    { planner = 'clever', exceeds = { planner = 'simple' }, from_index = 14 },\n\
    { planner = 'clever', exceeds = { planner = 'simple' }, from_index = 2 },\n]\n";

/// The example's binary, beside that of this test.
fn binary() -> PathBuf {
    let test = std::env::current_exe().expect("this program has a path");
    let profile = test.ancestors().nth(2).expect("it lies in deps");
    profile.join("examples/climber")
}

fn climber(folder: &Path, arguments: &[&str]) -> String {
    let output = Command::new(binary())
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("it starts");
    let [out, err] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {out}{err}");
    out
}

#[test]
fn a_study_of_curves_from_its_text_to_its_page_and_back_to_a_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let scenario = "system = 'climb'\n[climb]\n";
    std::fs::write(folder.join("climb.toml"), scenario).expect("it can be written");
    std::fs::write(folder.join("pays.toml"), STUDY).expect("it can be written");
    climber(folder, &["study", "pays.toml", "--out", "runs"]);
    climber(folder, &["report", "runs"]);

    // In truth it pays from step 11 on, by 0.3 m a step, where chance is worth some 0.3 m.
    let page = std::fs::read_to_string(folder.join("runs/report.html")).expect("a page");
    let said = |from: u32| {
        let text = format!("more than in the baseline from step {from} on, to the last, 19.");
        page.contains(&text)
    };
    assert!((11..=13).any(said), "no index is named");
    for text in [
        "in 6 blocks of 5 that share a problem",
        "✓ holds",
        "height reached",
    ] {
        assert!(page.contains(text), "{text}");
    }
    assert!(!page.contains("rover"), "of another system");
    let claims = std::fs::read_to_string(folder.join("runs/published.csv")).expect("claims");
    let verdicts: Vec<_> = claims
        .lines()
        .skip(1)
        .map(|row| row.rsplit(',').next())
        .collect();
    assert_eq!(verdicts, [Some("holds"), Some("undecided")], "{claims}");
    let rows = std::fs::read_to_string(folder.join("runs/series.csv")).expect("curves");
    assert_eq!(rows.lines().count(), 1 + 2 * 20);

    // Any run of it comes back, with the same curve.
    for (cell, seed) in [("0", "1"), ("1", "17"), ("planner=clever", "30")] {
        let again = [
            "reproduce",
            "runs",
            "--cell",
            cell,
            "--seed",
            seed,
            "--json",
        ];
        let said: serde_json::Value =
            serde_json::from_str(&climber(folder, &again)).expect("one document");
        assert_eq!(said["result"], "same", "{said}");
        let text = said.to_string();
        assert!(text.contains("\"height\":{"), "{text}");
    }
    // Another curve in the record is found.
    let path = folder.join("runs/runs.jsonl");
    let records = std::fs::read_to_string(&path).expect("the records");
    let is_run = |line: &&str| line.contains("\"cell\":0,") && line.contains("\"seed\":17,");
    let line = records.lines().find(is_run).expect("a run");
    let at = line.find("\"values\":[").expect("a curve") + "\"values\":[".len();
    let forged = format!("{}1{}", &line[..at], &line[at..]);
    std::fs::write(&path, records.replace(line, &forged)).expect("it can be written");
    let again = ["reproduce", "runs", "--cell", "0", "--seed", "17"];
    let output = Command::new(binary())
        .args(again)
        .current_dir(folder)
        .output()
        .expect("it starts");
    assert_eq!(output.status.code(), Some(1));
}
