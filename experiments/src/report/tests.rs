//! Pages of studies that no simulation made.

use std::path::Path;

use serde_json::json;

use super::*;
use crate::study::fabricated::{self, bandwidth, latency, loss, planner};
use crate::study::results::{Claim, Comparison, Published, PublishedFigure, RunOutcome};

fn latency_and_loss() -> Results {
    fabricated::study("degradation", vec![latency(), loss()], 30)
}

/// Cells at random places, as a Latin hypercube has them.
fn scattered() -> Results {
    let mut results = fabricated::study("scattered", vec![latency(), loss()], 10);
    let cells = results.manifest.cells.iter_mut().enumerate();
    for (index, cell) in cells {
        let (latency, loss) = (index as f64 * 0.05, ((index * 7) % 25) as f64 / 25.0);
        cell.values = vec![json!(latency), json!(loss)];
        cell.texts = vec![format!("{latency:.2}s"), format!("{loss:.2}")];
    }
    results
}

fn hostile() -> Results {
    let mut results = fabricated::study("<script>alert(1)</script>", vec![planner(), loss()], 3);
    let evil = "\"><img src=x onerror=alert(1)></style></title>&";
    let manifest = &mut results.manifest;
    manifest.question = evil.to_owned();
    manifest.scenario = evil.to_owned();
    manifest.scenario_text = format!("</pre>{evil}");
    manifest.factors[0].label = evil.to_owned();
    manifest.metrics[1].label = evil.to_owned();
    manifest.cells[0].texts[0] = evil.to_owned();
    manifest.cells[0].sets[0] = evil.to_owned();
    results.manifest.factors[1].label = "bell \u{7}".to_owned();
    // Alike in letters and digits.
    results.manifest.metrics[7].name = "AGE-S".to_owned();
    results.manifest.metrics[8].name = "age s".to_owned();
    for run in &mut results.runs {
        if let RunOutcome::Done { metrics, .. } = &mut run.outcome {
            metrics.insert("AGE-S".to_owned(), json!(1e300 * run.seed as f64));
            metrics.insert("age s".to_owned(), json!(1e-300 * run.cell as f64));
        }
    }
    results.runs[0].outcome = RunOutcome::Failed {
        error: evil.to_owned(),
    };
    results
}

/// With tables of others: one of two factors, one of scattered claims, one of lines.
fn beside() -> Results {
    let mut results = latency_and_loss();
    let figure = |cells: &[usize], claim| PublishedFigure {
        cells: cells.to_vec(),
        claim,
        quote: "at least <half> of them".to_owned(),
    };
    let table = |metric: &str, (unit, scale): (&str, f64), figures| Published {
        metric: metric.to_owned(),
        title: format!("Table of <{metric}>"),
        source: "A. N. Other & sons".to_owned(),
        unit: unit.to_owned(),
        scale,
        rows: Some("loss".to_owned()),
        figures,
        note: "To be read <slowly>.".to_owned(),
        why: "They had better rovers & links.".to_owned(),
    };
    let square = [
        (0, 100.0),
        (2, 97.0),
        (4, 12.25),
        (20, 60.0),
        (22, 41.0),
        (24, 0.0),
    ];
    let square = square.map(|(cell, value)| figure(&[cell], Claim::Value(value)));
    let linear = Claim::Linear("latency".to_owned());
    results.manifest.published = vec![
        table("completed", ("%", 100.0), square.to_vec()),
        table(
            "time_ratio",
            ("", 1.0),
            vec![
                figure(&[0, 5, 10], Claim::About(1.25)),
                figure(&[6], Claim::Below(1.0)),
                figure(&[24], Claim::Above(1e6)),
                figure(&(0..25).collect::<Vec<_>>(), linear),
            ],
        ),
        table(
            "deadlock",
            ("x", 1.0),
            vec![figure(&[99], Claim::Value(1.0))],
        ),
    ];
    results
}

/// With curves, long and short, in blocks, and claims of them that hold and do not.
fn curves(steps: u32, seeds: u64) -> Results {
    let factors = vec![planner(), loss()];
    let mut results = fabricated::study("curves", factors, seeds);
    results.manifest.block = 5;
    let mut results = fabricated::with_curves(results, steps);
    let claim = |from_index, by_at_most| {
        Claim::Exceeds(Comparison {
            others: vec![14, 99],
            from_index,
            by_at_least: None,
            by_at_most,
            equal_within: None,
        })
    };
    let figure = |claim| PublishedFigure {
        cells: vec![0, 1],
        claim,
        quote: "<much> more".to_owned(),
    };
    let table = |metric: &str, claim| Published {
        metric: metric.to_owned(),
        title: format!("Figure of {metric}"),
        source: "A. N. Other".to_owned(),
        unit: "%".to_owned(),
        scale: 100.0,
        rows: None,
        figures: vec![figure(claim)],
        note: String::new(),
        why: String::new(),
    };
    results.manifest.published = vec![
        table("reward", claim(Some(0.5 * f64::from(steps - 2)), None)),
        table("reward", claim(None, Some(10.0))),
        table("completed", claim(None, None)),
        table("time_ratio", claim(None, Some(0.5))),
        table("arrival_s", claim(None, None)),
        table("nothing", claim(None, None)),
    ];
    results
}

fn studies() -> Vec<(&'static str, Results)> {
    let mut few = fabricated::study("few", vec![loss()], 1);
    few.runs.truncate(2);
    let mut none = latency_and_loss();
    none.runs.clear();
    vec![
        ("latency-and-loss", latency_and_loss()),
        (
            "planners",
            fabricated::study("planners", vec![planner(), loss()], 30),
        ),
        (
            "bandwidth",
            fabricated::study("bandwidth", vec![bandwidth()], 30),
        ),
        ("words", fabricated::study("words", vec![planner()], 30)),
        (
            "three",
            fabricated::study("three", vec![latency(), loss(), planner()], 5),
        ),
        ("one", fabricated::study("one", vec![], 30)),
        ("scattered", scattered()),
        ("few", few),
        ("none", none),
        ("hostile", hostile()),
        ("beside", beside()),
        ("curves", curves(60, 30)),
        ("short-curves", curves(12, 30)),
        ("few-curves", curves(12, 5)),
    ]
}

/// Tags that are open at the end, or closed without being open: in well-formed markup, none.
fn unbalanced(markup: &str) -> Option<String> {
    const VOID: [&str; 3] = ["meta", "link", "br"];
    let mut open: Vec<&str> = Vec::new();
    for piece in markup.split('<').skip(1) {
        let name: &str = piece.split([' ', '>', '\n']).next().unwrap_or("");
        if let Some(closed) = name.strip_prefix('/') {
            let last = open.pop();
            if last != Some(closed) {
                return Some(format!("{last:?} closed as {closed}"));
            }
        } else if !VOID.contains(&name) && !name.starts_with(['!', '?']) {
            open.push(name);
        }
    }
    open.pop().map(str::to_owned)
}

#[test]
fn every_study_has_a_page() {
    for (name, results) in studies() {
        let report = build(&results, "runs");
        assert_eq!(unbalanced(&report.page), None, "{name}");
        assert!(!report.page.contains("NaN"), "{name}");
        let mut files: Vec<&str> = report.figures.iter().map(|one| one.file.as_str()).collect();
        files.sort_unstable();
        let count = files.len();
        files.dedup();
        assert_eq!(files.len(), count, "{name}: {files:?}");
        for figure in &report.figures {
            let svg = figure.standalone();
            assert_eq!(unbalanced(&svg), None, "{name}: {}", figure.file);
            assert!(
                !svg.contains("NaN") && !svg.contains("\"inf"),
                "{name}: {}",
                figure.file
            );
        }
    }
}

#[test]
fn the_same_results_give_the_same_bytes() {
    let results = fabricated::study("same", vec![loss()], 8);
    let (one, other) = (build(&results, "runs"), build(&results, "runs"));
    assert_eq!(one.page, other.page);
    assert_eq!(one.summary_csv, other.summary_csv);
}

#[test]
fn foreign_text_is_harmless() {
    let report = build(&hostile(), "$(rm -r ~)");
    let figures = report.figures.iter().map(Figure::standalone);
    for text in figures.chain([report.page.clone()]) {
        for evil in ["<script", "<img", "</style></title>", "</pre>\""] {
            assert!(!text.contains(evil), "{evil}");
        }
    }
    assert!(
        report
            .page
            .contains("farside reproduce '$(rm -r ~)' --cell 0 --seed 1")
    );
    assert!(report.figures.iter().all(|figure| {
        figure
            .file
            .bytes()
            .all(|byte| byte.is_ascii_alphanumeric() || b"-_.".contains(&byte))
    }));
}

#[test]
fn nothing_is_loaded_from_anywhere() {
    let page = build(&latency_and_loss(), "runs").page;
    for outside in ["src=", "@import", "url(", "<script", "http://", "https://"] {
        let found = page.replace("http://www.w3.org/2000/svg", "");
        assert!(!found.contains(outside), "{outside}");
    }
}

#[test]
fn a_page_says_what_there_is_to_say() {
    let page = build(&latency_and_loss(), "runs/night").page;
    for said in [
        "every combination of one-way latency (5ms, 100ms, 250ms, 600ms, 1.3s)",
        "0 in all 749 runs",
        "of all runs have any is unlikely",
        "farside reproduce runs/night --cell 24 --seed 30 --out cell24-seed30.mcap",
        "no &lt;path&gt; left &amp; none to give",
        "Kaplan",
        "rovers = 20",
    ] {
        assert!(page.contains(said), "{said}");
    }
}

#[test]
fn published_figures_stand_beside_ours() {
    let report = build(&beside(), "runs");
    let page = &report.page;
    for said in [
        "href=\"#published\"",
        "Table of &lt;completed&gt;",
        "Published in A. N. Other &amp; sons.",
        "message loss ↓  one-way latency →",
        "published 12.25\u{a0}%",
        "✗ outside",
        "✓ inside",
        "✗ beyond",
        "about 1.25",
        "“at least &lt;half&gt; of them”",
        "over 1,000,000",
        "message loss 70%",
        "<b>Why ours differ. </b>They had better rovers &amp; links.",
        "Crosses are published figures. Dotted lines",
    ] {
        assert!(page.contains(said), "{said}");
    }
    let curves = report
        .figures
        .iter()
        .find(|one| one.file == "time_ratio-curves.svg");
    let svg = curves.map(Figure::standalone).unwrap_or_default();
    assert_eq!(svg.matches("class=\"fitted").count(), 5, "{svg}");
    assert_eq!(svg.matches("class=\"cross").count(), 3, "{svg}");
    let rows = report.published_csv.unwrap_or_default();
    // Six in the square, five claims, five lines.
    assert_eq!(rows.lines().count(), 1 + 6 + 5 + 5, "{rows}");
    let field = rows
        .lines()
        .find(|row| row.starts_with("4,"))
        .unwrap_or_default();
    assert!(
        field.starts_with("4,5ms,70%,completed,Table of <completed>,%,value,12.25,"),
        "{field}"
    );
    let line = rows.lines().last().unwrap_or_default();
    assert!(
        line.starts_with(",,70%,time_ratio,Table of <time_ratio>,,linear,,5,,,,,,"),
        "{line}"
    );
    // Studies without have none of it.
    let without = build(&latency_and_loss(), "runs");
    assert!(without.published_csv.is_none() && !without.page.contains("id=\"published\""));
}

/// Means of survivors alone are marked wherever they are shown.
#[test]
fn means_of_some_runs_are_marked() {
    let mut results = fabricated::study("some", vec![planner(), loss()], 10);
    let whole = build(&results, "runs");
    assert!(!whole.page.contains('†') && !whole.page.contains("class=\"mark some"));
    for run in results
        .runs
        .iter_mut()
        .filter(|run| run.cell == 3 && run.seed < 4)
    {
        if let RunOutcome::Done { metrics, .. } = &mut run.outcome {
            metrics.insert("time_ratio".to_owned(), json!(null));
        }
    }
    let report = build(&results, "runs");
    assert!(report.page.contains("† is of those runs alone"));
    let file = "time_ratio-curves.svg";
    let curves = report.figures.iter().find(|one| one.file == file).unwrap();
    let svg = curves.standalone();
    assert_eq!(svg.matches("class=\"mark some").count(), 1);
    assert!(
        svg.contains("7 runs of 10: the others have no value"),
        "{svg}"
    );
}

/// A facet says which it is: in its picture, its title and its file's name.
#[test]
fn a_facet_says_which_it_is() {
    let results = fabricated::study("three", vec![latency(), loss(), planner()], 5);
    let report = build(&results, "runs");
    let curves = |figure: &&Figure| figure.file.starts_with("time_ratio-curves");
    let facets: Vec<&Figure> = report.figures.iter().filter(curves).collect();
    assert_eq!(facets.len(), 3);
    for (facet, planner) in facets.iter().zip(["max-plus", "greedy", "priority"]) {
        let shown = format!(">planner {planner}</text>");
        assert!(facet.standalone().contains(&shown), "{}", facet.file);
        assert!(
            facet.title.ends_with(&format!(", planner {planner}")),
            "{}",
            facet.title
        );
        assert!(facet.file.contains(planner), "{}", facet.file);
    }
}

/// Texts are no smaller than 12 pixels where the page is as narrow as a phone.
#[test]
fn a_phone_shows_texts_of_twelve_pixels() {
    let narrowest_px = 390.0 - 2.0 * 16.0;
    let smallest = farside_actors::figure::STYLE
        .split("font-size: ")
        .skip(1)
        .map(|rest| rest.split("px").next().unwrap().parse::<f64>().unwrap())
        .fold(f64::INFINITY, f64::min);
    assert!(smallest * narrowest_px / plots::WIDTH >= 12.0, "{smallest}");
}

#[test]
fn a_large_study_stays_small() {
    let levels = |prefix: &'static str, count: u32| -> Vec<fabricated::Level> {
        let level = |index: u32| {
            let harm = f64::from(index) / f64::from(count);
            // Names live as long as the test binary; there are thirty of them.
            let text: &'static str = Box::leak(format!("{prefix}{index}").into_boxed_str());
            (json!(index), text, harm)
        };
        (0..count).map(level).collect()
    };
    let scale = crate::study::results::Scale::Linear;
    let factors = vec![
        (
            fabricated::factor("rows", "rows", "", scale),
            levels("r", 20),
        ),
        (
            fabricated::factor("columns", "columns", "", scale),
            levels("c", 10),
        ),
    ];
    let mut results = fabricated::study("large", factors, 100);
    // Intervals take their time, and are no matter here.
    results
        .manifest
        .metrics
        .retain(|metric| metric.name != "messages.sent");
    let report = build(&results, "runs/large");
    assert!(report.page.len() < 4_000_000, "{}", report.page.len());
    assert!(report.figures.len() < 60, "{}", report.figures.len());
    if let Ok(folder) = std::env::var("FARSIDE_PAGES") {
        write(&Path::new(&folder).join("large"), &report);
    }
}

/// Writes all pages to the folder that `FARSIDE_PAGES` names, for eyes.
#[test]
#[ignore = "for eyes, not for asserts"]
fn pages_to_look_at() {
    let folder = std::env::var("FARSIDE_PAGES").expect("FARSIDE_PAGES names a folder");
    for (name, results) in studies() {
        write(
            &Path::new(&folder).join(name),
            &build(&results, &format!("runs/{name}")),
        );
    }
}

fn write(folder: &Path, report: &Report) {
    let plots = folder.join("plots");
    std::fs::create_dir_all(&plots).expect("a folder can be made");
    std::fs::write(folder.join("report.html"), &report.page).expect("a page can be written");
    std::fs::write(folder.join("results.csv"), &report.results_csv).expect("and a table");
    std::fs::write(folder.join("summary.csv"), &report.summary_csv).expect("and another");
    for figure in &report.figures {
        std::fs::write(plots.join(&figure.file), figure.standalone()).expect("and a plot");
    }
}
