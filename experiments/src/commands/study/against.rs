//! `farside study --check`: a study against the results of an earlier one.

use std::path::{Path, PathBuf};

use super::junit::sentence;
use crate::commands::CommandError;
use crate::study::results::{Manifest, Results};
use crate::study::summary::check::{self, Check, Verdict};

/// Results of an earlier study.
pub(super) struct Before {
    path: PathBuf,
    results: Results,
}

/// A results folder, or that of a file in one.
fn folder_of(path: &Path) -> &Path {
    match path.is_file() {
        // The folder of a file that is named alone is this one.
        true => path
            .parent()
            .filter(|folder| !folder.as_os_str().is_empty())
            .unwrap_or(Path::new(".")),
        false => path,
    }
}

/// The files that are read of it.
pub(super) fn files(path: &Path) -> Vec<PathBuf> {
    let mut files = Results::files(folder_of(path));
    files.push(path.to_owned());
    files
}

/// Opens a results folder, or that of a file in one, and sees whether it fits to the study: before
/// anything is run.
///
/// # Errors
/// When it is none, or of another study.
pub(super) fn open(path: &Path, plan: &Manifest) -> Result<Before, CommandError> {
    let results = Results::load(folder_of(path))?;
    check::fitting(plan, &results.manifest).map_err(|message| wrong(path, &message))?;
    Ok(Before {
        path: path.to_owned(),
        results,
    })
}

fn wrong(path: &Path, message: &str) -> CommandError {
    let path = path.display();
    CommandError::Arguments(format!(
        "--check {path}: these results cannot be compared: {message}"
    ))
}

impl Before {
    /// What became of each metric since.
    ///
    /// # Errors
    /// When they have no run in common.
    pub(super) fn check(&self, now: &Results) -> Result<Check, CommandError> {
        check::check(now, &self.results).map_err(|message| wrong(&self.path, &message))
    }
}

/// What is not as before, a line each, and how much there is of all.
pub(super) fn text(check: &Check) -> String {
    let mut out = String::new();
    for one in &check.checked {
        let verdict = match one.verdict {
            Verdict::Same => continue,
            Verdict::Better => "better",
            Verdict::Worse => "WORSE",
            Verdict::Changed => "changed",
            Verdict::Unsure => "unsure",
        };
        let cell = match one.texts.as_slice() {
            [] => one.cell.to_string(),
            texts => format!("{} ({})", one.cell, texts.join(", ")),
        };
        out += &format!(
            "{verdict}: {}, cell {cell}: {}\n",
            one.metric,
            sentence(one)
        );
    }
    for note in &check.notes {
        out += &format!("NOTE: {note}\n");
    }
    let count = |verdict| check.count(verdict);
    let (same, better) = (count(Verdict::Same), count(Verdict::Better));
    let (worse, all) = (count(Verdict::Worse), check.checked.len());
    out += &format!("of {all} comparisons {same} are the same, {better} better, {worse} worse");
    for (verdict, word) in [
        (Verdict::Changed, "otherwise"),
        (Verdict::Unsure, "unsure, of too few runs"),
    ] {
        if count(verdict) > 0 {
            out += &format!(", {} {word}", count(verdict));
        }
    }
    out + "\n"
}
