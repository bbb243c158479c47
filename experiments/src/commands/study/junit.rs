//! A study as JUnit XML, for whoever shows test results: a case for each cell, and with `--check`
//! for each metric in it.

use maud::{Markup, html};

use crate::study::results::{Results, RunOutcome};
use crate::study::summary::check::{Check, Checked, Verdict};

/// The document.
pub(super) fn junit(results: &Results, check: Option<&Check>) -> String {
    let cases = match check {
        Some(check) => check.checked.iter().map(of_metric).collect(),
        None => of_cells(results),
    };
    let cases: Vec<Case> = cases;
    let failures = cases.iter().filter(|case| case.failure.is_some()).count();
    let skipped = cases.iter().filter(|case| case.skipped.is_some()).count();
    let study = &results.manifest.study;
    let markup = html! {
        testsuites name=(xml(study)) tests=(cases.len()) failures=(failures) {
            testsuite name=(xml(study)) tests=(cases.len()) failures=(failures) skipped=(skipped) {
                @for case in &cases { (case.markup(study)) }
            }
        }
    };
    let text = markup.into_string();
    format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{text}\n")
}

/// A test case.
struct Case {
    class: String,
    name: String,
    failure: Option<String>,
    skipped: Option<String>,
}

impl Case {
    fn markup(&self, study: &str) -> Markup {
        html! {
            testcase classname=(xml(&format!("{study}.{}", self.class))) name=(xml(&self.name)) {
                @if let Some(failure) = &self.failure {
                    failure message=(xml(failure)) {}
                }
                @if let Some(skipped) = &self.skipped {
                    skipped message=(xml(skipped)) {}
                }
            }
        }
    }
}

fn of_cells(results: &Results) -> Vec<Case> {
    let manifest = &results.manifest;
    let cells = manifest.cells.iter().enumerate();
    cells
        .map(|(cell, about)| {
            let trouble = results.of_cell(cell).iter().filter_map(|run| {
                let seed = run.seed;
                match &run.outcome {
                    RunOutcome::Failed { error } => Some(format!("seed {seed}: {error}")),
                    RunOutcome::Done { violations, .. } if !violations.is_empty() => {
                        Some(format!("seed {seed}: {}", violations.join("; ")))
                    }
                    RunOutcome::Done { .. } => None,
                }
            });
            let trouble: Vec<String> = trouble.collect();
            let runs = results.of_cell(cell).len();
            Case {
                class: named(cell, &about.texts),
                name: "runs".to_owned(),
                failure: (!trouble.is_empty()).then(|| trouble.join("\n")),
                skipped: (runs == 0).then(|| "no run yet".to_owned()),
            }
        })
        .collect()
}

fn of_metric(checked: &Checked) -> Case {
    let told = sentence(checked);
    Case {
        class: named(checked.cell, &checked.texts),
        name: checked.metric.clone(),
        failure: (checked.verdict == Verdict::Worse).then(|| told.clone()),
        skipped: (checked.verdict == Verdict::Unsure).then_some(told),
    }
}

/// What became of a metric, in a sentence.
pub(super) fn sentence(checked: &Checked) -> String {
    let Checked {
        before,
        now,
        difference,
        ..
    } = checked;
    format!(
        "{before:.4} before, {now:.4} now: {:+.4} ({:+.4} to {:+.4}) with the same {} seeds",
        difference.mean, difference.ci_low, difference.ci_high, difference.n
    )
}

fn named(cell: usize, texts: &[String]) -> String {
    match texts {
        [] => format!("cell {cell}"),
        texts => format!("cell {cell} ({})", texts.join(", ")),
    }
}

/// A text without the characters that XML cannot have, escaped or not.
fn xml(text: &str) -> String {
    let kept = |letter: &char| !letter.is_control() || matches!(letter, '\n' | '\t');
    let text = text.chars().filter(kept);
    text.filter(|letter| !matches!(letter, '\u{fffe}' | '\u{ffff}'))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::fabricated::{self, loss};
    use crate::study::results::DeclaredBetter;
    use crate::study::summary::check::check;

    #[test]
    fn any_reader_of_xml_finds_the_cases_and_what_failed() {
        let mut before = fabricated::study("a <b> & \"c\"\u{1b}", vec![loss()], 8);
        for metric in &mut before.manifest.metrics {
            metric.better = Some(DeclaredBetter::Lower);
        }
        before.manifest.cells[1].texts[0] = "<10%> & 'more'".to_owned();
        let mut now = before.clone();
        for run in now.runs.iter_mut().filter(|run| run.cell == 1) {
            if let RunOutcome::Done { metrics, .. } = &mut run.outcome {
                let ratio = metrics["time_ratio"].as_f64().unwrap();
                metrics.insert("time_ratio".to_owned(), (2.0 * ratio).into());
            }
        }
        let checked = check(&now, &before).unwrap();
        let text = junit(&now, Some(&checked));
        let document = roxmltree::Document::parse(&text).unwrap();
        let root = document.root_element();
        assert_eq!(root.tag_name().name(), "testsuites");
        let cases: Vec<_> = root
            .descendants()
            .filter(|node| node.has_tag_name("testcase"))
            .collect();
        assert_eq!(cases.len(), checked.checked.len());
        let suite = root.first_element_child().unwrap();
        assert_eq!(suite.attribute("name"), Some("a <b> & \"c\""));
        assert_eq!(suite.attribute("failures"), Some("1"));
        let failed: Vec<_> = cases
            .iter()
            .filter(|case| case.children().any(|child| child.has_tag_name("failure")))
            .collect();
        assert_eq!(failed.len(), 1);
        assert_eq!(failed[0].attribute("name"), Some("time_ratio"));
        let class = failed[0].attribute("classname").unwrap();
        assert!(class.ends_with("cell 1 (<10%> & 'more')"), "{class}");
        // Without a check, each cell is a case, and what went wrong in it its failure.
        now.runs[0].outcome = RunOutcome::Failed {
            error: "<path> left & none".to_owned(),
        };
        let text = junit(&now, None);
        let document = roxmltree::Document::parse(&text).unwrap();
        let cases = document.descendants();
        let cases = cases.filter(|node| node.has_tag_name("testcase")).count();
        assert_eq!(cases, now.manifest.cells.len());
        assert!(text.contains("&lt;path&gt; left &amp; none"), "{text}");
    }
}
