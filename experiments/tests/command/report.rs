//! `farside report` on results folders as studies leave them.

use std::path::Path;

use farside_experiments::study::results::{
    Cell, Claim, FORMAT, Factor, Manifest, MessageCounts, Metric, Published, PublishedFigure,
    RunOutcome, RunRecord, Scale,
};
use serde_json::json;

use crate::common::{farside, json, text};
use crate::ink::assert_readable;

fn manifest() -> Manifest {
    let cell = |loss: f64, text: &str| Cell {
        values: vec![json!(loss)],
        texts: vec![text.to_owned()],
        sets: vec![format!("links.default.loss={text}")],
    };
    Manifest {
        format: FORMAT,
        code_version: "0.1.0".to_owned(),
        study: "losses".to_owned(),
        question: "Does loss slow a team down?".to_owned(),
        scenario: "network/crater-dense".to_owned(),
        scenario_text: "system = \"network\"\n".to_owned(),
        files: Default::default(),
        factors: vec![Factor {
            name: "loss".to_owned(),
            label: "message loss".to_owned(),
            unit: String::new(),
            scale: Scale::Linear,
        }],
        metrics: vec![Metric {
            name: "time_ratio".to_owned(),
            label: "time ratio".to_owned(),
            unit: String::new(),
            index: None,
            kind: None,
            better: None,
        }],
        baseline: Some(0),
        cells: vec![cell(0.0, "0"), cell(0.3, "30%")],
        seeds: (1..=4).collect(),
        block: 1,
        stop: None,
        published: Vec::new(),
        report: Default::default(),
    }
}

fn record(cell: usize, seed: u64) -> RunRecord {
    let outcome = RunOutcome::Done {
        end: "completed".to_owned(),
        end_detail: String::new(),
        digest: format!("{cell}{seed}"),
        sim_time_s: 100.5,
        timed_out: false,
        events: 10,
        messages: MessageCounts {
            sent: 10,
            delivered: 9,
            lost: 1,
            lost_by_reason: [("loss".to_owned(), 1)].into(),
            ..MessageCounts::default()
        },
        metrics: json!({ "time_ratio": 1.0 + cell as f64 + 0.25 * seed as f64 })
            .as_object()
            .cloned()
            .unwrap_or_default(),
        violations: Vec::new(),
        never_reached: Vec::new(),
    };
    RunRecord {
        cell,
        seed,
        outcome,
    }
}

fn fill(folder: &Path, manifest: &Manifest, records: &[RunRecord]) {
    std::fs::create_dir_all(folder).unwrap();
    let manifest = serde_json::to_string(manifest).unwrap();
    std::fs::write(folder.join("manifest.json"), manifest).unwrap();
    let lines: Vec<String> = records
        .iter()
        .map(|record| serde_json::to_string(record).unwrap() + "\n")
        .collect();
    std::fs::write(folder.join("runs.jsonl"), lines.concat()).unwrap();
}

fn all() -> Vec<RunRecord> {
    let cells = 0..2;
    cells
        .flat_map(|cell| (1..=4).map(move |seed| record(cell, seed)))
        .collect()
}

#[test]
fn a_report_is_written_where_the_results_are() {
    let folder = tempfile::tempdir().unwrap();
    fill(&folder.path().join("out"), &manifest(), &all());
    let output = farside(folder.path(), &["report", "out"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let said = text(&output.stdout);
    assert!(
        said.starts_with("8 runs\n") && said.contains("out/report.html"),
        "{said}"
    );
    let read = |name: &str| std::fs::read_to_string(folder.path().join("out").join(name)).unwrap();
    let page = read("report.html");
    assert!(page.contains("Does loss slow a team down?"));
    assert!(page.contains("farside reproduce out --cell 1 --seed 4 --out cell1-seed4.mcap"));
    for plot in std::fs::read_dir(folder.path().join("out/plots")).unwrap() {
        let path = plot.unwrap().path();
        let svg = std::fs::read_to_string(&path).unwrap();
        assert_readable(&path.display().to_string(), &svg);
    }
    let rows = read("results.csv");
    assert_eq!(rows.lines().count(), 9);
    assert!(
        rows.lines()
            .nth(8)
            .unwrap()
            .starts_with("1,30%,4,done,completed,14,100.5,"),
        "{rows}"
    );
    // Each seed is slower by exactly one.
    let summary = read("summary.csv");
    assert!(summary.contains(",4,1,1,1,"), "{summary}");
    assert!(read("plots/time_ratio-curves.svg").starts_with("<?xml"));
}

#[test]
fn shards_are_joined() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, one, other) = ("whole", "one", "other");
    let all = all();
    fill(&folder.path().join(whole), &manifest(), &all);
    fill(&folder.path().join(one), &manifest(), &all[4..]);
    fill(&folder.path().join(other), &manifest(), &all[..4]);
    let output = farside(folder.path(), &["report", one, other]);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        text(&output.stderr).contains("--out"),
        "{}",
        text(&output.stderr)
    );
    let output = farside(
        folder.path(),
        &["report", one, other, "--out", "joined", "--json"],
    );
    let document = json(&output);
    assert_eq!(
        (&document["runs"], &document["failed"]),
        (&json!(8), &json!(0))
    );
    assert!(farside(folder.path(), &["report", whole]).status.success());
    for name in ["results.csv", "summary.csv"] {
        let read = |of: &str| std::fs::read(folder.path().join(of).join(name)).unwrap();
        assert_eq!(read("joined"), read(whole), "{name}");
    }
}

#[test]
fn published_figures_are_in_every_form() {
    let folder = tempfile::tempdir().unwrap();
    let mut manifest = manifest();
    let figure = |cell: usize, claim: Claim| PublishedFigure {
        cells: vec![cell],
        claim,
        quote: String::new(),
    };
    manifest.published = vec![Published {
        metric: "time_ratio".to_owned(),
        title: "Table 7".to_owned(),
        source: "somebody".to_owned(),
        unit: "%".to_owned(),
        scale: 100.0,
        rows: None,
        figures: vec![
            figure(0, Claim::Value(170.0)),
            figure(1, Claim::Below(20.0)),
        ],
        note: String::new(),
        why: String::new(),
    }];
    let all = all();
    fill(&folder.path().join("one"), &manifest, &all[4..]);
    fill(&folder.path().join("other"), &manifest, &all[..4]);
    let arguments = ["report", "one", "other", "--out", "joined", "--json"];
    let document = json(&farside(folder.path(), &arguments));
    let beside = &document["published"];
    assert_eq!(beside.as_array().map(Vec::len), Some(2));
    // Means of 1 + cell + 0.25 to 1.
    assert_eq!(
        (
            &beside[0]["cell"],
            &beside[0]["estimate"],
            &beside[0]["difference"]
        ),
        (&json!(0), &json!(162.5), &json!(-7.5))
    );
    assert_eq!(
        (&beside[0]["inside"], &beside[1]["inside"]),
        (&json!(true), &json!(false))
    );
    assert_eq!(beside[1]["published"], json!({ "below": 20.0 }));
    let read =
        |name: &str| std::fs::read_to_string(folder.path().join("joined").join(name)).unwrap();
    assert!(read("report.html").contains("Beside the published figures"));
    let rows = read("published.csv");
    let row = rows.lines().nth(1).unwrap();
    assert!(
        row.starts_with("0,0,time_ratio,Table 7,%,value,170,4,162.5,"),
        "{rows}"
    );
}

#[test]
fn edited_manifests_are_refused_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    type Edit = fn(&mut Manifest);
    let edits: [(Edit, &str); 9] = [
        (|m| m.cells.clear(), "at least one cell and one seed"),
        (|m| m.seeds.clear(), "at least one cell and one seed"),
        (
            |m| m.cells[1].values.clear(),
            "cell 1 has 0 values and 1 texts for 1 factors",
        ),
        (
            |m| m.factors.clear(),
            "cell 0 has 1 values and 1 texts for 0 factors",
        ),
        (|m| m.seeds[1] = 1, "a seed is there twice"),
        (|m| m.block = 0, "blocks of 0 do not divide 4 seeds"),
        (|m| m.block = 3, "blocks of 3 do not divide 4 seeds"),
        (
            |m| m.baseline = Some(2),
            "the baseline is cell 2, the last one is 1",
        ),
        (|m| m.cells.truncate(1), "the last one is 0"),
    ];
    for (edit, said) in edits {
        let mut edited = manifest();
        edit(&mut edited);
        fill(&out, &edited, &all());
        for arguments in [
            &["report", "out"][..],
            &["reproduce", "out", "--cell", "1", "--seed", "2"],
        ] {
            let output = farside(folder.path(), arguments);
            let error = text(&output.stderr);
            assert_eq!(output.status.code(), Some(2), "{said}: {error}");
            assert!(error.contains(said), "{said}: {error}");
        }
    }
}

#[test]
fn other_folders_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let output = farside(folder.path(), &["report", "nowhere"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        text(&output.stderr).contains("nowhere"),
        "{}",
        text(&output.stderr)
    );
    fill(&folder.path().join("a"), &manifest(), &all());
    let mut changed = manifest();
    changed.question = "Another?".to_owned();
    fill(&folder.path().join("b"), &changed, &all());
    let output = farside(folder.path(), &["report", "a", "b", "--out", "c"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(!folder.path().join("c").exists());
}
