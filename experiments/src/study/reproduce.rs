//! One run of a study again, from its results folder alone.

use crate::scenario::{Assembled, Scenario};
use farside_actors::system::Files;

use crate::registry::Registry;

use super::design;
use super::error::StudyError;
use super::execute::{Interrupts, execute};
use super::level::Level;
use super::plan::of_cell;
use super::results::{Manifest, Results, RunOutcome, RunRecord};

/// What a run again says about its record.
#[derive(Debug)]
pub(crate) struct Reproduction {
    /// What came of it.
    pub(crate) outcome: RunOutcome,
    /// What differs from the record: which part, what is recorded, what is now.
    pub(crate) differences: Vec<(String, String, String)>,
    /// Why its log could not be written to the end; then nothing else counts.
    pub(crate) unrecorded: Option<String>,
}

/// The record of a run: its cell given by number or as `loss=0.3,latency=600ms`.
///
/// # Errors
/// When there is no such cell, seed, or record; the error says which there are.
pub(crate) fn find_run<'a>(
    results: &'a Results,
    cell: &str,
    seed: u64,
) -> Result<&'a RunRecord, StudyError> {
    let manifest = &results.manifest;
    let cell = cell_of(manifest, cell)?;
    if !manifest.seeds.contains(&seed) {
        let seeds = range(&manifest.seeds);
        return Err(StudyError::Argument(format!(
            "--seed {seed}: the study has no such seed: expected {seeds}"
        )));
    }
    let runs = results.of_cell(cell);
    let found = runs.iter().find(|run| run.seed == seed);
    found.ok_or_else(|| {
        let count = runs.len();
        StudyError::Argument(format!(
            "--seed {seed}: this run is not in the results: cell {cell} has {count} runs so far"
        ))
    })
}

fn cell_of(manifest: &Manifest, text: &str) -> Result<usize, StudyError> {
    let wrong = |message: String| StudyError::Argument(format!("--cell {text}: {message}"));
    let last = manifest.cells.len() - 1;
    if let Ok(cell) = text.trim().parse::<usize>() {
        return match cell {
            cell if cell <= last => Ok(cell),
            _ => Err(wrong(format!("expected a cell from 0 to {last}"))),
        };
    }
    let mut wanted = Vec::new();
    for part in text.split(',') {
        let Some((name, value)) = part.split_once('=') else {
            let names: Vec<String> = manifest
                .factors
                .iter()
                .map(|factor| format!("{}=...", factor.name))
                .collect();
            return Err(wrong(format!(
                "expected a cell from 0 to {last}, or factor values as in {}",
                names.join(",")
            )));
        };
        wanted.push((name.trim().to_owned(), Level::of_argument(value)));
    }
    design::find(&manifest.factors, &manifest.cells, &wanted).map_err(wrong)
}

fn range(seeds: &[u64]) -> String {
    let (first, last) = (seeds.first().unwrap_or(&0), seeds.last().unwrap_or(&0));
    let consecutive = seeds.windows(2).all(|pair| pair[1] == pair[0] + 1);
    if consecutive {
        return format!("one from {first} to {last}");
    }
    let shown: Vec<String> = seeds.iter().take(20).map(u64::to_string).collect();
    let dots = if seeds.len() > 20 { ", ..." } else { "" };
    format!("one of {}{dots}", shown.join(", "))
}

/// Runs `record`'s run again; `prepare` may add observers, given the scenario with its seed. `None`
/// if it was interrupted.
///
/// # Errors
/// When the manifest's scenario cannot be read by this binary.
pub(crate) fn reproduce<E: std::fmt::Display>(
    manifest: &Manifest,
    record: &RunRecord,
    registry: &Registry,
    interrupts: &Interrupts,
    prepare: impl FnOnce(&Scenario, &mut Assembled) -> Result<(), E>,
) -> Result<Option<Reproduction>, StudyError> {
    let cell = &manifest.cells[record.cell];
    let files = Files::kept(manifest.files.clone());
    let text = &manifest.scenario_text;
    let mut scenario = of_cell(&manifest.scenario, text, cell, files, registry)?;
    let seeds = scenario.seeds_of(record.seed, manifest.problem_seed(record.seed));
    scenario.set_seeds(seeds);
    let executed = execute(
        &scenario,
        seeds,
        &manifest.metrics,
        interrupts,
        |assembled| prepare(&scenario, assembled),
    );
    Ok(executed.map(|executed| Reproduction {
        differences: differences(&record.outcome, &executed.outcome),
        outcome: executed.outcome,
        unrecorded: executed.unrecorded,
    }))
}

/// What differs between two outcomes, part by part.
fn differences(recorded: &RunOutcome, now: &RunOutcome) -> Vec<(String, String, String)> {
    let flat = |outcome: &RunOutcome| {
        let mut parts = Vec::new();
        let value = serde_json::to_value(outcome).unwrap_or_default();
        flatten("", value, &mut parts);
        parts
    };
    let (recorded, now) = (flat(recorded), flat(now));
    let value_in = |parts: &[(String, serde_json::Value)], name: &str| {
        let found = parts.iter().find(|(known, _)| known == name);
        found.map(|(_, value)| value.clone())
    };
    let mut names: Vec<&String> = recorded.iter().map(|(name, _)| name).collect();
    let only_now = now.iter().map(|(name, _)| name);
    let only_now: Vec<&String> = only_now.filter(|name| !names.contains(name)).collect();
    // Results of older versions do not say what was never reached.
    names.extend(only_now.into_iter().filter(|name| *name != "never_reached"));
    let told = |value: Option<serde_json::Value>| {
        value.map_or_else(|| "nothing".to_owned(), |value| value.to_string())
    };
    let differing = names.into_iter().filter_map(|name| {
        let (a, b) = (value_in(&recorded, name), value_in(&now, name));
        (a != b).then(|| (name.clone(), told(a), told(b)))
    });
    differing.collect()
}

/// The leaves of objects, by dotted name; lists stay whole.
fn flatten(name: &str, value: serde_json::Value, parts: &mut Vec<(String, serde_json::Value)>) {
    match value {
        serde_json::Value::Object(fields) => {
            for (key, value) in fields {
                let name = if name.is_empty() {
                    key
                } else {
                    format!("{name}.{key}")
                };
                flatten(&name, value, parts);
            }
        }
        value => parts.push((name.to_owned(), value)),
    }
}
