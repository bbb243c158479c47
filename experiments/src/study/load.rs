//! Reading results folders, and joining those of several machines.

use std::path::{Path, PathBuf};

use farside_logs::is_hidden;
use serde_json::Value;

use super::error::{READING, StoreError, io};
use super::lengths::Lengths;
use super::results::{Claim, FORMAT, Factor, Manifest, Metric, Results, RunOutcome, RunRecord};

/// The file that says what is run.
pub(super) const MANIFEST: &str = "manifest.json";

impl Results {
    /// Reads a results folder, all its shards, as far as it goes.
    ///
    /// # Errors
    /// When it is none, is of another format, or holds a line that is no record; the error names
    /// the line; when the runs of a cell have curves over different indices. A last line that is
    /// cut is no error: its run was not done.
    pub fn load(folder: &Path) -> Result<Results, StoreError> {
        let manifest = manifest(folder)?;
        let runs = runs(folder, &manifest)?;
        check_series(folder, &manifest, &runs)?;
        Ok(Results { manifest, runs })
    }

    /// The files that [`Results::load`] reads of a folder.
    pub(crate) fn files(folder: &Path) -> Vec<PathBuf> {
        let mut files = shards(folder).unwrap_or_default();
        files.push(folder.join(MANIFEST));
        files
    }

    /// Joins the results of one study from several folders; their order does not matter.
    ///
    /// ```
    /// # use farside_experiments::study::results::*;
    /// # let manifest = Manifest { format: FORMAT, code_version: "0".into(), study: "s".into(),
    /// #     question: "?".into(), scenario: "x".into(), scenario_text: String::new(),
    /// #     files: Default::default(), factors: vec![], metrics: vec![], baseline: None,
    /// #     cells: vec![Cell { values: vec![], texts: vec![], sets: vec![] }], seeds: vec![1, 2],
    /// #     block: 1, stop: None, published: vec![], report: Default::default() };
    /// let failed = || RunOutcome::Failed { error: "x".into() };
    /// let run = |seed| RunRecord { cell: 0, seed, outcome: failed() };
    /// let half = |seed| Results { manifest: manifest.clone(), runs: vec![run(seed)] };
    /// let whole = Results::merge([half(2), half(1)])?.unwrap();
    /// assert_eq!(whole.runs, [run(1), run(2)]);
    /// # Ok::<(), farside_experiments::study::StoreError>(())
    /// ```
    ///
    /// # Errors
    /// When they are of different studies, or two records of one run differ. None at all give
    /// `None`.
    pub fn merge(parts: impl IntoIterator<Item = Results>) -> Result<Option<Results>, StoreError> {
        let mut parts = parts.into_iter();
        let Some(mut whole) = parts.next() else {
            return Ok(None);
        };
        for part in parts {
            if part.manifest != whole.manifest {
                return Err(StoreError::Unlike {
                    difference: difference(&whole.manifest, &part.manifest),
                });
            }
            whole.runs.extend(part.runs);
        }
        whole.runs = in_order(whole.runs)?;
        check_series(Path::new("these results"), &whole.manifest, &whole.runs)?;
        Ok(Some(whole))
    }
}

/// Refuses curves of one cell that have other lengths or indices.
fn check_series(folder: &Path, manifest: &Manifest, runs: &[RunRecord]) -> Result<(), StoreError> {
    let mut lengths = Lengths::default();
    let mut checked = runs.iter().map(|run| lengths.check(manifest, run));
    checked.try_for_each(|checked| {
        checked.map_err(|message| StoreError::Series {
            path: folder.to_owned(),
            message,
        })
    })
}

/// The manifest of a results folder.
pub(super) fn manifest(folder: &Path) -> Result<Manifest, StoreError> {
    let path = folder.join(MANIFEST);
    let bytes = match std::fs::read(&path) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            return Err(StoreError::NoManifest {
                path: folder.to_owned(),
            });
        }
        Err(error) => return Err(io(&path, READING)(error)),
    };
    let corrupt = |error: serde_json::Error| StoreError::Corrupt {
        path: path.clone(),
        line: None,
        message: format!("not a study's manifest: {error}"),
    };
    // The format decides what else there can be, so it is looked at first.
    let value: Value = serde_json::from_slice(&bytes).map_err(corrupt)?;
    match value.get("format") {
        Some(format) if format.as_u64() != Some(u64::from(FORMAT)) => Err(StoreError::Format {
            path,
            found: format.to_string(),
            expected: FORMAT,
        }),
        _ => {
            let manifest = serde_json::from_value(value).map_err(corrupt)?;
            check(&manifest).map_err(|message| StoreError::Corrupt {
                path: path.clone(),
                line: None,
                message,
            })?;
            Ok(manifest)
        }
    }
}

/// Holds a manifest to what everything that reads one takes for granted: somebody may have edited
/// it.
fn check(manifest: &Manifest) -> Result<(), String> {
    check_names(manifest)?;
    let cells = manifest.cells.len();
    if cells == 0 || manifest.seeds.is_empty() {
        return Err("a study has at least one cell and one seed".to_owned());
    }
    let factors = manifest.factors.len();
    for (number, cell) in manifest.cells.iter().enumerate() {
        let (values, texts) = (cell.values.len(), cell.texts.len());
        if (values, texts) != (factors, factors) {
            return Err(format!(
                "cell {number} has {values} values and {texts} texts for {factors} factors"
            ));
        }
    }
    let mut seeds = manifest.seeds.clone();
    seeds.sort_unstable();
    if seeds.windows(2).any(|pair| pair[0] == pair[1]) {
        return Err("a seed is there twice".to_owned());
    }
    let block = manifest.block;
    if block == 0 || !manifest.seeds.len().is_multiple_of(block) {
        let seeds = manifest.seeds.len();
        return Err(format!("blocks of {block} do not divide {seeds} seeds"));
    }
    for published in &manifest.published {
        let title = &published.title;
        let metrics = &mut manifest.metrics.iter();
        if !metrics.any(|metric| metric.name == published.metric) {
            let metric = &published.metric;
            return Err(format!("{title}: the study has no metric {metric:?}"));
        }
        for figure in &published.figures {
            let others = match &figure.claim {
                Claim::Exceeds(comparison) => &comparison.others,
                _ => &figure.cells,
            };
            let named = figure.cells.iter().chain(others);
            if others.len() != figure.cells.len() || named.clone().any(|cell| *cell >= cells) {
                return Err(format!("{title}: a figure names cells that there are not"));
            }
        }
    }
    match manifest.baseline {
        Some(baseline) if baseline >= cells => Err(format!(
            "the baseline is cell {baseline}, the last one is {}",
            cells - 1
        )),
        _ => Ok(()),
    }
}

/// Refuses names and labels that would break a line or that a terminal would obey: they stand in
/// every table.
pub(super) fn check_names(manifest: &Manifest) -> Result<(), String> {
    let one = |what: &str, text: &str| match text.chars().any(is_hidden) {
        true => Err(format!("{what} {text:?} has control characters")),
        false => Ok(()),
    };
    one("the study's name", &manifest.study)?;
    for Factor {
        name, label, unit, ..
    } in &manifest.factors
    {
        [name, label, unit]
            .into_iter()
            .try_for_each(|text| one("a factor's name, label or unit", text))?;
    }
    for Metric {
        name, label, unit, ..
    } in &manifest.metrics
    {
        [name, label, unit]
            .into_iter()
            .try_for_each(|text| one("a metric's name, label or unit", text))?;
    }
    let texts = manifest.cells.iter().flat_map(|cell| &cell.texts);
    texts
        .into_iter()
        .try_for_each(|text| one("a factor's value", text))?;
    for published in &manifest.published {
        one("a title", &published.title)?;
        one("a unit", &published.unit)?;
    }
    Ok(())
}

/// All records in a folder, in order.
pub(super) fn runs(folder: &Path, manifest: &Manifest) -> Result<Vec<RunRecord>, StoreError> {
    let mut runs = Vec::new();
    for path in shards(folder)? {
        let bytes = std::fs::read(&path).map_err(io(&path, READING))?;
        records(&path, &bytes, manifest, &mut runs)?;
    }
    in_order(runs)
}

/// The files of a results folder that hold records.
fn shards(folder: &Path) -> Result<Vec<PathBuf>, StoreError> {
    files_called(folder, "runs")
}

/// The files of a results folder, of each shard one, that hold lines of `runs` or `times`; none if
/// there is no folder.
pub(super) fn files_called(folder: &Path, stem: &str) -> Result<Vec<PathBuf>, StoreError> {
    if !folder.exists() {
        return Ok(Vec::new());
    }
    let (whole, of_shard) = (format!("{stem}.jsonl"), format!("{stem}-"));
    let mut paths = Vec::new();
    let entries = std::fs::read_dir(folder).map_err(io(folder, READING))?;
    for entry in entries {
        let entry = entry.map_err(io(folder, READING))?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if name == whole || name.starts_with(&of_shard) && name.ends_with(".jsonl") {
            paths.push(entry.path());
        }
    }
    paths.sort();
    Ok(paths)
}

/// The records of one file; a last line that is cut is none.
fn records(
    path: &Path,
    bytes: &[u8],
    manifest: &Manifest,
    runs: &mut Vec<RunRecord>,
) -> Result<(), StoreError> {
    let corrupt = |line: usize, message: String| StoreError::Corrupt {
        path: path.to_owned(),
        line: Some(line),
        message,
    };
    let Some(whole) = bytes.iter().rposition(|byte| *byte == b'\n') else {
        return Ok(());
    };
    for (index, line) in bytes[..whole].split(|byte| *byte == b'\n').enumerate() {
        let record: RunRecord = serde_json::from_slice(line).map_err(|error| {
            corrupt(
                index + 1,
                format!(
                    "not a record of a run: {error}\n  remove the line, and the study runs it again"
                ),
            )
        })?;
        if record.cell >= manifest.cells.len() {
            let (cell, last) = (record.cell, manifest.cells.len() - 1);
            return Err(corrupt(
                index + 1,
                format!("cell {cell}: the last one is {last}"),
            ));
        }
        if !manifest.seeds.contains(&record.seed) {
            let message = format!("seed {}: the study has no such seed", record.seed);
            return Err(corrupt(index + 1, message));
        }
        runs.push(record);
    }
    Ok(())
}

/// The records in order of (cell, seed), each run once.
fn in_order(mut runs: Vec<RunRecord>) -> Result<Vec<RunRecord>, StoreError> {
    runs.sort_by_key(|run| (run.cell, run.seed));
    for pair in runs.windows(2) {
        let [a, b] = pair else { continue };
        if (a.cell, a.seed) == (b.cell, b.seed) && a != b {
            let mut outcomes = [a, b].map(|run| told(&run.outcome));
            if outcomes[0] == outcomes[1] {
                outcomes = [a, b].map(|run| format!("{:?}", run.outcome));
            }
            outcomes.sort();
            let [one, other] = outcomes;
            return Err(StoreError::Conflict {
                cell: a.cell,
                seed: a.seed,
                a: one,
                b: other,
            });
        }
    }
    runs.dedup();
    Ok(runs)
}

fn told(outcome: &RunOutcome) -> String {
    match outcome {
        RunOutcome::Done { digest, .. } => format!("digest {digest}"),
        RunOutcome::Failed { error } => format!("failed: {error}"),
    }
}

/// What differs between two manifests, for people; `a` is what is there.
pub(super) fn difference(a: &Manifest, b: &Manifest) -> String {
    let texts = [
        ("code version", &a.code_version, &b.code_version),
        ("study", &a.study, &b.study),
        ("scenario", &a.scenario, &b.scenario),
        ("question", &a.question, &b.question),
    ];
    let mut found = Vec::new();
    for (what, there, here) in texts {
        if there != here {
            found.push(format!("{what} {there:?} there, {here:?} here"));
        }
    }
    if a.scenario_text != b.scenario_text {
        let mut lines = a.scenario_text.lines().zip(b.scenario_text.lines());
        let line = lines.find(|(there, here)| there != here);
        found.push(match line {
            Some((there, here)) => format!("the scenario: {there:?} there, {here:?} here"),
            None => "the scenario: one has more lines".to_owned(),
        });
    }
    if a.seeds != b.seeds {
        let (there, here) = (a.seeds.len(), b.seeds.len());
        found.push(if there == here {
            "the seeds".to_owned()
        } else {
            format!("{there} seeds there, {here} here")
        });
    }
    let parts = [
        ("the files that the scenario reads", a.files != b.files),
        ("the factors", a.factors != b.factors),
        ("the cells", a.cells != b.cells),
        ("the metrics", a.metrics != b.metrics),
        ("the baseline", a.baseline != b.baseline),
        ("the blocks of seeds", a.block != b.block),
        ("the stopping rule", a.stop != b.stop),
        ("the published figures", a.published != b.published),
        ("what plots put where", a.report != b.report),
    ];
    for (what, differs) in parts {
        if differs {
            found.push(what.to_owned());
        }
    }
    found.join("; ")
}
