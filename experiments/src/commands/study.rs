//! `farside study`: run a study, as far as its folder does not hold its runs already.

mod against;
mod array;
mod dry_run;
mod junit;

use std::io::IsTerminal;
use std::path::{Path, PathBuf};

use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;
use serde_json::{Map, Value};

use self::against::Before;
use super::Exit;
use super::kinds::{self, FileKind};
use super::output::{self, Format};
use super::{CommandError, complain, interrupt, print, print_json};
use crate::registry::Registry;
use crate::report::csv::{results_csv, values_csv};
use crate::study::results::{Manifest, Results, RunOutcome};
use crate::study::summary::check::Check;
use crate::study::summary::comparisons::ComparisonSummary;
use crate::study::summary::effect::{self, SameValues};
use crate::study::summary::published::LineSummary;
use crate::study::summary::summarise;
use crate::study::{
    self, Ended, Interrupts, Merged, Progress, RunOptions, Shard, Study, StudyPlan,
};

/// Drawings a second; more is unreadable.
const DRAWINGS_HZ: u8 = 10;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// A built-in study (see `farside studies`) or a TOML file
    study: String,
    /// The folder for results; started again, the study goes on with what is there
    /// [default: results/STUDY]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// How many runs at once; as many as there are cores unless given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// How many seeds each cell has, instead of the study's; more may be added later
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    seeds: Option<u64>,
    /// Do only this part of the runs, as in 1/4; parts may go to folders of their own
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    /// Run nothing: write scripts for Slurm beside the folder, an array of N shards and their merge
    #[arg(long, value_name = "N")]
    #[arg(conflicts_with_all = ["shard", "merge", "dry_run", "check", "junit"])]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    array: Option<u32>,
    /// Run nothing: write results.csv of what N shards did, or name those that have runs left
    #[arg(long, value_name = "N", conflicts_with_all = ["shard", "jobs", "dry_run"])]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    merge: Option<u32>,
    /// Set a key of the scenario in every cell, as in team.rovers=25; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<String>,
    /// Go on where a cell's first runs all fail; failed runs are then no reason to exit with 3
    #[arg(long)]
    keep_going: bool,
    /// Compare with the results of an earlier study: a results folder, or a file in one. Exits with
    /// 1 if a metric got worse
    #[arg(long, value_name = "FILE", conflicts_with_all = ["dry_run", "shard"])]
    check: Option<PathBuf>,
    /// Write what came of it as JUnit XML: each cell, or with --check each metric in it, is a case
    #[arg(long, value_name = "FILE", conflicts_with_all = ["dry_run", "shard"])]
    junit: Option<PathBuf>,
    /// Say how many runs there are to do, and about how long they take; write nothing
    #[arg(long)]
    dry_run: bool,
    /// Print the result as one JSON document
    #[arg(long)]
    json: bool,
}

/// What `study --json` prints.
#[derive(Serialize)]
struct Document<'a> {
    study: String,
    question: String,
    scenario: String,
    out: String,
    /// Runs that are done, in the whole folder.
    runs: usize,
    /// How many of them failed.
    failed: usize,
    /// Runs that are still to do, by other shards.
    missing: usize,
    /// Runs in which something happened that must never happen.
    violated: usize,
    cells: Value,
    /// Values of factors that change nothing.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    same_values: Vec<SameValues>,
    /// What has no effect, in sentences: values that change nothing, and what no run reached.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    notices: Vec<String>,
    /// Lines through cells, for what was published to be linear.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    lines: Vec<LineSummary>,
    /// Cells against each other, for what was published to be more.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    comparisons: Vec<ComparisonSummary>,
    /// What became of each metric since the results of `--check`.
    #[serde(skip_serializing_if = "Option::is_none")]
    check: Option<&'a Check>,
}

pub(crate) fn run(args: &Args, registry: &Registry) -> Result<Exit, CommandError> {
    kinds::expect(FileKind::Study, Path::new(&args.study), registry)?;
    let study = Study::open(&args.study, registry)?;
    let folder = Path::new("results").join(study.name());
    let folder = args.out.clone().unwrap_or(folder);
    let plan = study.plan(&args.sets, args.seeds, registry)?;
    let mut inputs = plan.inputs.clone();
    inputs.push(PathBuf::from(&args.study));
    if let Some(shards) = args.array {
        return array::write(args, shards, &plan, &folder, &inputs);
    }
    let mut outputs = study::outputs(&folder, args.shard.unwrap_or(Shard::WHOLE));
    outputs.extend(args.junit.clone());
    output::spare(&inputs, &outputs)?;
    // The results folder is made by then.
    let elsewhere = args.junit.iter().find(|junit| !junit.starts_with(&folder));
    elsewhere.map_or(Ok(()), |junit| output::may_be_made(junit))?;
    if let (Some(junit), Some(check)) = (&args.junit, &args.check) {
        output::spare(&against::files(check), std::slice::from_ref(junit))?;
    }
    let before = args.check.as_deref();
    let before = before.map(|path| against::open(path, &plan.manifest));
    let before = before.transpose()?;
    for remark in &plan.remarks {
        tracing::warn!("{remark}");
    }
    if let Some(shards) = args.merge {
        return merge(args, shards, &plan, &folder, before.as_ref());
    }
    let mut options = RunOptions::new(folder.clone());
    options.shard = args.shard.unwrap_or(Shard::WHOLE);
    options.keep_going = args.keep_going;
    if let Some(jobs) = args.jobs {
        options.jobs = usize::from(jobs);
    }
    let interrupts = Interrupts::default();
    let raised = interrupts.clone();
    interrupt::on_interrupt(move || raised.raise());
    if args.dry_run {
        return dry_run::tell(&plan, &options, &interrupts, args.json);
    }
    let bar = bar();
    let mut last = Progress::default();
    let ended = study::run(plan, &options, &interrupts, &mut |progress| {
        last = progress;
        draw(bar.as_ref(), progress);
    });
    if let Some(bar) = bar {
        bar.finish_and_clear();
    }
    if ended? == Ended::Interrupted {
        let text = interrupted(args, last, &folder);
        // The exit code says so too.
        complain(text);
        return Ok(Exit::Failed);
    }
    let results = Results::load(&folder)?;
    let missing = results.missing();
    conclude(args, &results, &folder, missing, before.as_ref())
}

/// Puts together what shards have done, and says which of them have not done all.
fn merge(
    args: &Args,
    shards: u32,
    plan: &StudyPlan,
    folder: &Path,
    before: Option<&Before>,
) -> Result<Exit, CommandError> {
    let Merged { results, left } = Merged::load(plan, folder, shards)?;
    let missing = left.values().sum();
    let exit = conclude(args, &results, folder, missing, before)?;
    if missing == 0 {
        return Ok(exit);
    }
    let names: Vec<String> = left.keys().map(u32::to_string).collect();
    complain(format!(
        "{missing} runs are missing, of {} of {shards} shards; submit them again: --array={}",
        left.len(),
        names.join(",")
    ));
    Ok(exit.max(Exit::Failed))
}

/// Writes the tables of a whole study, and says what came out and what became of it since `before`.
fn conclude(
    args: &Args,
    results: &Results,
    folder: &Path,
    missing: usize,
    before: Option<&Before>,
) -> Result<Exit, CommandError> {
    let tables = [
        ("results.csv", Some(results_csv(results))),
        ("values.csv", values_csv(results)),
    ];
    for (name, text) in tables {
        match text.filter(|_| missing == 0) {
            Some(text) => study::replace(&folder.join(name), text.as_bytes())?,
            // One of fewer runs would pass for the whole.
            None if args.merge.is_some() => drop(std::fs::remove_file(folder.join(name))),
            None => {}
        }
    }
    let check = before.map(|before| before.check(results)).transpose()?;
    if let Some(path) = &args.junit {
        let text = junit::junit(results, check.as_ref());
        output::write(path.clone(), &text, Format::Junit, &Results::files(folder))?;
    }
    tell(args, results, folder, missing, check.as_ref())
}

fn interrupted(args: &Args, progress: Progress, folder: &Path) -> String {
    let (done, total) = (progress.done, progress.total);
    let study = &args.study;
    if total == 0 {
        return "interrupted in the first run, before anything was written".to_owned();
    }
    format!(
        "interrupted: {done} of {total} runs are done, in {}\n  the same command goes on from there: \
         farside study {study} ...",
        folder.display()
    )
}

/// Prints the result, and says with what to exit.
fn tell(
    args: &Args,
    results: &Results,
    folder: &Path,
    missing: usize,
    check: Option<&Check>,
) -> Result<Exit, CommandError> {
    let manifest = &results.manifest;
    let failures = |outcome: &RunOutcome| matches!(outcome, RunOutcome::Failed { .. });
    let failed = results.runs.iter().filter(|run| failures(&run.outcome));
    let failed: Vec<_> = failed.collect();
    let violated = results.runs.iter().filter(
        |run| matches!(&run.outcome, RunOutcome::Done { violations, .. } if !violations.is_empty()),
    );
    let violated: Vec<_> = violated.collect();
    let summary = summarise(results);
    let notices = effect::notices(manifest, &summary);
    let cells = with_totals(serde_json::to_value(&summary.cells)?, results);
    let document = Document {
        study: manifest.study.clone(),
        question: manifest.question.clone(),
        scenario: manifest.scenario.clone(),
        out: folder.display().to_string(),
        runs: results.runs.len(),
        failed: failed.len(),
        missing,
        violated: violated.len(),
        cells,
        same_values: summary.same_values,
        notices,
        lines: summary.lines,
        comparisons: summary.comparisons,
        check,
    };
    if args.json {
        print_json(&document)?;
    } else {
        print(text(results, &document))?;
    }
    let say = |text: String| {
        // The exit code says so too.
        complain(text);
    };
    for run in violated.iter().take(3) {
        let (cell, seed) = (run.cell, run.seed);
        if let RunOutcome::Done { violations, .. } = &run.outcome {
            say(format!(
                "VIOLATED: cell {cell}, seed {seed}: {}",
                violations.join("; ")
            ));
        }
    }
    for run in failed.iter().take(3) {
        let (cell, seed) = (run.cell, run.seed);
        if let RunOutcome::Failed { error } = &run.outcome {
            say(format!("FAILED: cell {cell}, seed {seed}: {error}"));
        }
    }
    Ok(if !failed.is_empty() && !args.keep_going {
        Exit::Failed
    } else if !violated.is_empty() || check.is_some_and(Check::is_worse) {
        Exit::Different
    } else {
        Exit::Done
    })
}

/// Adds to each cell what metrics that count add up to: whether there was any collision at all is
/// no matter of means.
fn with_totals(mut cells: Value, results: &Results) -> Value {
    let metrics = &results.manifest.metrics;
    let entries = cells.as_array_mut().into_iter().flatten();
    for (index, cell) in entries.enumerate() {
        let mut totals = Map::new();
        for metric in metrics {
            let counts: Option<Vec<u64>> = results
                .of_cell(index)
                .iter()
                .filter_map(|run| match &run.outcome {
                    RunOutcome::Done { metrics, .. } => metrics.get(&metric.name),
                    RunOutcome::Failed { .. } => None,
                })
                .map(Value::as_u64)
                .collect();
            if let Some(counts) = counts.filter(|counts| !counts.is_empty()) {
                totals.insert(metric.name.clone(), counts.iter().sum::<u64>().into());
            }
        }
        if let Some(cell) = cell.as_object_mut() {
            cell.insert("totals".to_owned(), totals.into());
        }
    }
    cells
}

/// The figures of each cell, for people.
fn text(results: &Results, document: &Document<'_>) -> String {
    let manifest = &results.manifest;
    let mut rows = Vec::new();
    let factors = manifest.factors.iter().map(|factor| factor.name.clone());
    let metrics = manifest.metrics.iter().map(|metric| metric.name.clone());
    let head = ["cell".to_owned()].into_iter().chain(factors);
    rows.push(head.chain(["runs".to_owned()]).chain(metrics).collect());
    for (index, cell) in manifest.cells.iter().enumerate() {
        let mut row = vec![index.to_string()];
        row.extend(cell.texts.iter().cloned());
        row.push(results.of_cell(index).len().to_string());
        for metric in &manifest.metrics {
            let said = &document.cells[index]["metrics"][&metric.name];
            row.push(figure(said).map_or_else(|| "-".to_owned(), short));
        }
        rows.push(row);
    }
    let curves = curves(manifest, &document.cells);
    let has_curves = manifest.metrics.iter().any(|one| one.index.is_some());
    let last_values = if has_curves {
        ", of curves the last values"
    } else {
        ""
    };
    let (study, question, out) = (&document.study, &document.question, &document.out);
    let runs = document.runs;
    let failed = match document.failed {
        0 => String::new(),
        failed => format!(", {failed} of them failed"),
    };
    let after = match document.missing {
        0 => format!("{runs} runs{failed}; {out}/results.csv has each of them"),
        missing => format!("{runs} runs in {out}{failed}; {missing} are left to other shards"),
    };
    let notices = document.notices.iter();
    let notices: String = notices.map(|notice| format!("NOTE: {notice}\n")).collect();
    format!(
        "{study}: {question}\n\n{}\n{curves}{notices}means, of lists the medians{last_values}; {after}\n{}",
        columns(&rows),
        document.check.map(against::text).unwrap_or_default()
    )
}

/// What stands for a metric of a cell in a table: the mean, of lists the median, of curves the mean at the last
/// index that any run has.
fn figure(said: &Value) -> Option<f64> {
    let last = said["points"].as_array().and_then(|points| {
        let mut points = points.iter().rev();
        points.find(|point| point["n"].as_u64() > Some(0))
    });
    let mean = last.unwrap_or(said)["mean"].as_f64();
    mean.or_else(|| said["median"].as_f64())
}

/// From which index on curves differ from those of the baseline, a line for each; none without
/// curves.
fn curves(manifest: &Manifest, cells: &Value) -> String {
    let mut out = String::new();
    for metric in &manifest.metrics {
        for (at, cell) in manifest.cells.iter().enumerate() {
            let difference = &cells[at]["metrics"][&metric.name]["difference"];
            let (Some(from), Some(is_more)) = (
                difference["holds_from"].as_f64(),
                difference["is_more"].as_bool(),
            ) else {
                continue;
            };
            let index = metric.index.as_ref();
            let (label, unit) = index.map_or(("index", ""), |one| (&one.label, &one.unit));
            let unit = if unit.is_empty() {
                String::new()
            } else {
                format!(" {unit}")
            };
            let (name, texts) = (&metric.name, cell.texts.join(", "));
            let more = if is_more { "more" } else { "less" };
            out.push_str(&format!(
                "{name}, cell {at} ({texts}): {more} than in the baseline from {label} \
                 {from}{unit} on\n"
            ));
        }
    }
    out
}

/// A number with four digits.
fn short(number: f64) -> String {
    let digits = match number.abs() {
        x if x >= 1000.0 => 0,
        x if x >= 100.0 => 1,
        x if x >= 10.0 => 2,
        _ => 3,
    };
    format!("{number:.digits$}")
}

fn columns(rows: &[Vec<String>]) -> String {
    let count = rows.first().map_or(0, Vec::len);
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max();
    let widths: Vec<usize> = (0..count)
        .map(|column| width(column).unwrap_or(0))
        .collect();
    let mut out = String::new();
    for row in rows {
        let fields = row.iter().zip(&widths);
        let fields: Vec<String> = fields
            .map(|(text, width)| format!("{text:>width$}"))
            .collect();
        out.push_str("  ");
        out.push_str(&fields.join("  "));
        out.push('\n');
    }
    out
}

/// The progress bar, if stderr is a terminal.
fn bar() -> Option<ProgressBar> {
    if !std::io::stderr().is_terminal() {
        return None;
    }
    let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr_with_hz(DRAWINGS_HZ));
    // A template that is a constant is valid, or was never seen working.
    let style = ProgressStyle::with_template("{wide_bar} {pos} of {len} runs{msg}");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    Some(bar)
}

fn draw(bar: Option<&ProgressBar>, progress: Progress) {
    let Some(bar) = bar else {
        return;
    };
    bar.set_length(progress.total as u64);
    bar.set_position(progress.done as u64);
    let wall_s = bar.elapsed().as_secs_f64();
    if progress.since_start > 0 && wall_s > 0.1 {
        let rate = progress.since_start as f64 / wall_s;
        let left = progress.total.saturating_sub(progress.done) as f64 / rate;
        let left = HumanDuration(std::time::Duration::from_secs_f64(left));
        let failed = match progress.failed {
            0 => String::new(),
            failed => format!(", {failed} failed"),
        };
        bar.set_message(format!("{failed}, {rate:.1}/s, {left:#} left"));
    }
}
