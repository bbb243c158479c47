//! `farside report`: what a study found, as a page, plots and tables.

use std::path::{Path, PathBuf};

use farside_actors::figure::Figure;
use serde::Serialize;
use serde_json::{Map, Value};

use super::Exit;
use super::kinds;
use super::output::{self, Format};
use super::{CommandError, print, print_json};
use crate::export::{self, FigureFormat};
use crate::registry::Registry;
use crate::report::{self, Report};
use crate::study::results::{Results, RunRecord};
use crate::study::summary::comparisons::ComparisonSummary;
use crate::study::summary::published::{Beside, LineSummary};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// The results folder of a study; several, if its runs were shared among machines
    #[arg(value_name = "DIR", required = true)]
    folders: Vec<PathBuf>,
    /// Where to write the report, instead of into the results folder; needed with several
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// What plots are written as beside SVG: pdf for papers, png for slides
    #[arg(
        long,
        value_name = "KIND",
        value_delimiter = ',',
        hide_possible_values = true
    )]
    format: Vec<FigureFormat>,
    /// Print what was written where as JSON
    #[arg(long)]
    json: bool,
}

/// What a report has besides plots.
const TABLES_AND_PAGE: [&str; 6] = [
    "results.csv",
    "summary.csv",
    "values.csv",
    "series.csv",
    "published.csv",
    "report.html",
];

/// What `report --json` prints.
#[derive(Serialize)]
struct Document {
    page: String,
    results_csv: String,
    summary_csv: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    values_csv: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    series_csv: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    published_csv: Option<String>,
    plots: Vec<String>,
    /// Our figures beside published ones.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    published: Vec<OfCell>,
    /// Lines through cells, for what was published to be linear.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    lines: Vec<LineSummary>,
    /// Cells against each other, for what was published to be more.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    comparisons: Vec<ComparisonSummary>,
    runs: usize,
    missing: usize,
    failed: usize,
}

/// A published figure beside a cell's.
#[derive(Serialize)]
struct OfCell {
    cell: usize,
    factors: Map<String, Value>,
    #[serde(flatten)]
    beside: Beside,
}

pub(crate) fn run(args: &Args, registry: &Registry) -> Result<Exit, CommandError> {
    let kinds = export::kinds(FigureFormat::Svg, &args.format)?;
    let [first, others @ ..] = args.folders.as_slice() else {
        return Err(CommandError::Arguments("which results folder?".to_owned()));
    };
    let out = match &args.out {
        Some(out) => out,
        None if others.is_empty() => first,
        None => {
            let message = "--out: several results folders need a folder for their report";
            return Err(CommandError::Arguments(message.to_owned()));
        }
    };
    for folder in &args.folders {
        kinds::expect(kinds::FileKind::Results, folder, registry)?;
    }
    let parts: Result<Vec<Results>, _> = args.folders.iter().map(|f| Results::load(f)).collect();
    let Some(results) = Results::merge(parts?)? else {
        return Err(CommandError::Arguments("which results folder?".to_owned()));
    };
    let report = report::build(&results, &first.display().to_string());
    let inputs: Vec<PathBuf> = args
        .folders
        .iter()
        .flat_map(|folder| Results::files(folder))
        .collect();
    let document = write(&report, out, &kinds, &inputs, &results)?;
    if args.json {
        print_json(&document)?;
    } else {
        print(text(&document))?;
    }
    Ok(Exit::Done)
}

fn write(
    report: &Report,
    out: &Path,
    kinds: &[FigureFormat],
    inputs: &[PathBuf],
    results: &Results,
) -> Result<Document, CommandError> {
    let plots = out.join("plots");
    let figures = report.figures.iter();
    let files = figures.flat_map(|figure| kinds.iter().map(move |kind| (figure, *kind)));
    let files: Vec<(PathBuf, &Figure, FigureFormat)> = files
        .map(|(figure, kind)| {
            let path = plots.join(&figure.file).with_extension(kind.ending());
            (path, figure, kind)
        })
        .collect();
    let mut outputs: Vec<PathBuf> = files.iter().map(|(path, ..)| path.clone()).collect();
    outputs.extend(TABLES_AND_PAGE.map(|name| out.join(name)));
    output::spare(inputs, &outputs)?;
    std::fs::create_dir_all(&plots).map_err(|source| CommandError::Write {
        path: plots.clone(),
        source,
    })?;
    let write = |path, text: &str, format| output::write(path, text, format, inputs);
    let table = |name: &str, text: &str| write(out.join(name), text, Format::Table);
    let results_csv = table("results.csv", &report.results_csv)?;
    let summary_csv = table("summary.csv", &report.summary_csv)?;
    let if_any = |name: &str, text: &Option<String>| match text {
        Some(text) => table(name, text).map(Some),
        None => Ok(None),
    };
    let values_csv = if_any("values.csv", &report.values_csv)?;
    let series_csv = if_any("series.csv", &report.series_csv)?;
    let published_csv = if_any("published.csv", &report.published_csv)?;
    let cells = report.summary.cells.iter();
    let published = cells.flat_map(|cell| {
        cell.published.iter().map(|beside| OfCell {
            cell: cell.cell,
            factors: cell.factors.clone(),
            beside: beside.clone(),
        })
    });
    let plots: Result<Vec<String>, CommandError> = files
        .into_iter()
        .map(|(path, figure, kind)| output::write_figure(path, figure, kind, inputs))
        .collect();
    let failed = |run: &&RunRecord| {
        matches!(
            run.outcome,
            crate::study::results::RunOutcome::Failed { .. }
        )
    };
    Ok(Document {
        results_csv,
        summary_csv,
        values_csv,
        series_csv,
        published_csv,
        plots: plots?,
        published: published.collect(),
        lines: report.summary.lines.clone(),
        comparisons: report.summary.comparisons.clone(),
        // The page comes last: where it is, the rest is too.
        page: write(out.join("report.html"), &report.page, Format::Page)?,
        runs: results.runs.len(),
        missing: results.missing(),
        failed: results.runs.iter().filter(failed).count(),
    })
}

fn text(document: &Document) -> String {
    let failed = match document.failed {
        0 => String::new(),
        failed => format!(", {failed} of them failed"),
    };
    let plots = match document.plots.as_slice() {
        [] => "none".to_owned(),
        [first, ..] => {
            let folder = Path::new(first).parent().unwrap_or(Path::new("."));
            format!("{} in {}", document.plots.len(), folder.display())
        }
    };
    let missing = match document.missing {
        0 => String::new(),
        missing => format!(" of {}, the rest are not made yet", document.runs + missing),
    };
    let values = match &document.values_csv {
        Some(path) => format!("  lists    {path}\n"),
        None => String::new(),
    };
    let series = match &document.series_csv {
        Some(path) => format!("  curves   {path}\n"),
        None => String::new(),
    };
    let beside = match &document.published_csv {
        Some(path) => format!("  beside   {path}\n"),
        None => String::new(),
    };
    format!(
        "{} runs{missing}{failed}\n  page     {}\n  runs     {}\n  figures  {}\n{values}{series}{beside}  \
         plots    {plots}\n",
        document.runs, document.page, document.results_csv, document.summary_csv
    )
}
