//! What was run, what went wrong, and how to run it again.

use maud::{Markup, html};

use crate::report::layout::Shape;
use crate::report::measure::Study;
use crate::study::results::{RunOutcome, RunRecord};
use farside_actors::figure::numbers::plain;

/// The most failed runs that are listed.
const LISTED: usize = 100;

/// The study in a paragraph.
pub(super) fn what_was_run(study: &Study<'_>) -> Markup {
    let (manifest, summary) = (&study.results.manifest, study.summary);
    let cells = manifest.cells.len();
    let timed_out: usize = summary.cells.iter().map(|cell| cell.timed_out).sum();
    let violated: usize = summary.cells.iter().map(|cell| cell.violated).sum();
    let missing = summary.planned.saturating_sub(study.results.runs.len());
    html! {
        p {
            "Scenario " b { (manifest.scenario) } " in " (counted(cells, "cell")) (varied(study))
            ", with " (counted(manifest.seeds.len(), "seed")) (if cells > 1 { " each" } else { "" })
            @if manifest.block > 1 {
                ", in " (counted(manifest.seeds.len() / manifest.block, "block")) " of "
                (manifest.block) " that share a problem"
            }
            ": " (counted(study.results.runs.len(), "run")) ". "
            (plain(summary.n as f64)) " came to their end"
            @if timed_out > 0 { ", " (plain(timed_out as f64)) " of them because their time was over" }
            "; "
            @if summary.failed > 0 {
                a class="bad" href="#trouble" { (plain(summary.failed as f64)) " failed" }
                " and " (if summary.failed == 1 { "is" } else { "are" }) " in no figure. "
            } @else { "none failed. " }
            @if violated > 0 {
                a class="bad" href="#trouble" { (plain(violated as f64)) " violated what must never happen" }
                ". "
            }
            @if missing > 0 {
                @match &manifest.stop {
                    Some(stop) => {
                        "Cells stop once the interval of " (stop.metric) " is at most "
                        (plain(stop.width)) " wide, after " (stop.min_seeds) " seeds at the \
                         earliest: " (plain(missing as f64)) " runs were not needed. "
                    }
                    None => {
                        span class="bad" { (plain(missing as f64)) " runs are not made yet. " }
                    }
                }
            }
            @if let Some(baseline) = study.baseline() {
                "Cells are compared with cell " (baseline) ": " (study.cell_name(baseline)) "."
            }
        }
    }
}

/// What is varied, by which values.
fn varied(study: &Study<'_>) -> Markup {
    let how = match study.layout.shape {
        Shape::Single => return html! {},
        Shape::Grid if study.layout.axes.len() > 1 => ": every combination of ",
        Shape::Grid => ": ",
        Shape::Row => ", which vary together ",
        Shape::Scattered => ", which vary ",
    };
    let axes = study.layout.axes.iter();
    let axes: Vec<String> = axes
        .map(|axis| {
            let texts: Vec<&str> = axis
                .levels
                .iter()
                .map(|level| level.text.as_str())
                .collect();
            let values = match texts.as_slice() {
                [first, .., last] if texts.len() > 12 => {
                    format!("{} values from {first} to {last}", texts.len())
                }
                _ => texts.join(", "),
            };
            format!("{} ({values})", axis.name())
        })
        .collect();
    html! { (how) (axes.join(" and ")) }
}

fn counted(count: usize, what: &str) -> String {
    let ending = if count == 1 { "" } else { "s" };
    format!("{} {what}{ending}", plain(count as f64))
}

/// Runs that failed, and runs in which what must never happen did.
pub(super) fn trouble(study: &Study<'_>) -> Markup {
    let troubled: Vec<(&RunRecord, &'static str, String)> = study
        .results
        .runs
        .iter()
        .filter_map(what_went_wrong)
        .collect();
    html! {
        @if !troubled.is_empty() {
            section id="trouble" {
                h2 { "Runs that went wrong" }
                div class="scroll" tabindex="0" {
                    table {
                        thead {
                            tr {
                                th class="narrow" { "cell" } th class="name" { "values" } th class="narrow" { "seed" }
                                th class="text" { "what happened" }
                            }
                        }
                        tbody {
                            @for (run, what, text) in troubled.iter().take(LISTED) {
                                tr {
                                    td { (run.cell) }
                                    td class="text" { (study.cell_name(run.cell)) }
                                    td { (run.seed) }
                                    td class="text" { b { (what) ": " } (text) }
                                }
                            }
                        }
                    }
                }
                @if troubled.len() > LISTED {
                    p class="note" {
                        "And " (plain((troubled.len() - LISTED) as f64)) " more: see results.csv."
                    }
                }
            }
        }
    }
}

fn what_went_wrong(run: &RunRecord) -> Option<(&RunRecord, &'static str, String)> {
    match &run.outcome {
        RunOutcome::Failed { error } => Some((run, "failed", error.clone())),
        RunOutcome::Done { violations, .. } if !violations.is_empty() => {
            Some((run, "violated", violations.join("; ")))
        }
        RunOutcome::Done { .. } => None,
    }
}

/// The command for each run. One click selects one command.
pub(super) fn commands(study: &Study<'_>, folder: &str) -> Markup {
    let quoted = shell_quoted(folder);
    let program = program(study);
    html! {
        section id="again" {
            h2 { "Run any of it again" }
            p {
                "Each run can be made again, bit for bit, with a log of every message: "
                code { (program) " reproduce " (quoted) " --cell C --seed S --out RUN.mcap" }
                ". Two such logs are compared with " code { (program) " diff A.mcap B.mcap" } "."
            }
            details class="screen" {
                summary { "The commands, by cell" }
                p class="note" { "A click selects one command." }
                @for cell in 0..study.summary.cells.len() {
                    @let runs = study.results.of_cell(cell);
                    details {
                        summary { "Cell " (cell) ": " (study.cell_name(cell)) }
                        div class="commands" tabindex="0" {
                            @for run in runs {
                                p { (command(study, folder, run)) }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// The command that makes a run again.
pub(super) fn command(study: &Study<'_>, folder: &str, run: &RunRecord) -> String {
    let (program, folder) = (program(study), shell_quoted(folder));
    let RunRecord { cell, seed, .. } = run;
    format!(
        "{program} reproduce {folder} --cell {cell} --seed {seed} --out cell{cell}-seed{seed}.mcap"
    )
}

/// The binary that made the runs: others may not know their system. Its version says so.
fn program<'a>(study: &Study<'a>) -> &'a str {
    let version = &study.results.manifest.code_version;
    let own = version.split_once(" (farside ");
    own.and_then(|(own, _)| own.split(' ').next())
        .unwrap_or("farside")
}

/// A folder's name as one word of a shell.
fn shell_quoted(text: &str) -> String {
    let harmless = |letter: char| letter.is_ascii_alphanumeric() || "/._-+=:@%".contains(letter);
    if !text.is_empty() && text.chars().all(harmless) {
        return text.to_owned();
    }
    format!("'{}'", text.replace('\'', r"'\''"))
}

/// The scenario and the manifest's facts.
pub(super) fn scenario(study: &Study<'_>) -> Markup {
    let manifest = &study.results.manifest;
    let seeds = match manifest.seeds.as_slice() {
        [first, .., last] if *last - *first + 1 == manifest.seeds.len() as u64 => {
            format!("{first} to {last}")
        }
        seeds => seeds
            .iter()
            .map(u64::to_string)
            .collect::<Vec<_>>()
            .join(", "),
    };
    html! {
        section id="scenario" {
            h2 { "Scenario" }
            p {
                (manifest.scenario) ", run with Farside " (manifest.code_version) ". Seeds: " (seeds)
                "."
                @if !manifest.files.is_empty() {
                    @let names: Vec<&str> = manifest.files.keys().map(String::as_str).collect();
                    " It reads " (names.join(", ")) ", which the results folder holds."
                }
            }
            details {
                summary { "The scenario, with all defaults" }
                div class="scroll" tabindex="0" { pre { (manifest.scenario_text) } }
            }
            details {
                summary { "What each cell sets" }
                div class="scroll" tabindex="0" {
                    table {
                        thead { tr { th class="narrow" { "cell" } th class="text" { "--set" } } }
                        tbody {
                            @for (index, cell) in manifest.cells.iter().enumerate() {
                                tr {
                                    td { (index) }
                                    td class="text" { code { (cell.sets.join("  ")) } }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::shell_quoted;

    #[test]
    fn folders_are_one_word_of_a_shell() {
        assert_eq!(shell_quoted("runs/loss-0.3"), "runs/loss-0.3");
        assert_eq!(shell_quoted("my runs"), "'my runs'");
        assert_eq!(shell_quoted("it's; rm -r"), r"'it'\''s; rm -r'");
        assert_eq!(shell_quoted(""), "''");
    }
}
