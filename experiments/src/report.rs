//! Reports: what a study found, for people and for programs.
//!
//! [`build`] makes of a study's results a page that needs nothing but itself, its figures one by
//! one, and tables for programs. It reads no clock and draws no chance: the same results give the
//! same bytes.

pub mod csv;
mod layout;
mod measure;
mod numbers;
mod page;
mod plots;

#[cfg(test)]
mod tests;

use farside_actors::figure::Figure;

use crate::study::results::Results;
use crate::study::summary::{Summary, summarise};
use measure::Study;

/// The style of the page around them.
const PAGE_STYLE: &str = include_str!("report/page.css");

/// All that is written about a study.
pub struct Report {
    /// One page in HTML, with figures and style in it.
    pub page: String,
    /// The figures, each a file of its own.
    pub figures: Vec<Figure>,
    /// One row for each run, see [`csv::results_csv`].
    pub results_csv: String,
    /// One row for each cell and metric, see [`csv::summary_csv`].
    pub summary_csv: String,
    /// One row for each value of lists and curves, see [`csv::values_csv`]; none if there are none.
    pub values_csv: Option<String>,
    /// One row for each cell, curve and index, see [`csv::series_csv`]; none if there are no
    /// curves.
    pub series_csv: Option<String>,
    /// One row for each published figure, see [`csv::published_csv`]; none if none is known.
    pub published_csv: Option<String>,
    /// What the study says, in figures.
    pub summary: Summary,
}

/// Writes up a study. `folder` is the results folder as commands on the page name it.
///
/// ```
/// # use farside_experiments::study::results::*;
/// # let manifest = Manifest { format: FORMAT, code_version: "1".into(), study: "doc".into(),
/// #     question: "Does it <b>escape</b>?".into(), scenario: "s".into(), scenario_text: "".into(),
/// #     files: Default::default(), factors: vec![], metrics: vec![], baseline: None,
/// #     cells: vec![Cell { values: vec![], texts: vec![], sets: vec![] }], seeds: vec![1],
/// #     block: 1, stop: None, published: vec![], report: Default::default() };
/// # let results = Results { manifest, runs: vec![] };
/// let report = farside_experiments::report::build(&results, "runs");
/// assert!(report.page.contains("Does it &lt;b&gt;escape&lt;/b&gt;?"));
/// ```
pub fn build(results: &Results, folder: &str) -> Report {
    let summary = summarise(results);
    let study = Study::new(results, &summary);
    let (page, figures) = page::page(&study, folder);
    Report {
        page,
        figures,
        results_csv: csv::results_csv(results),
        summary_csv: csv::summary_csv(results, &summary),
        values_csv: csv::values_csv(results),
        series_csv: csv::series_csv(results, &summary),
        published_csv: csv::published_csv(results, &summary),
        summary,
    }
}
