//! What a log's run was of: the scenario that is in it, with the files it was run with.

use std::collections::BTreeMap;
use std::path::Path;

use farside_actors::system::Files;
use farside_logs::{Log, RunSummary};

use super::CommandError;
use super::kinds::{self, FileKind};
use crate::registry::Registry;
use crate::scenario::{Scenario, ScenarioError};

/// The attachment that holds the resolved scenario.
const SCENARIO: &str = "scenario.toml";

/// Attachments that are the scenario's files have names that start with this.
pub(super) const FILE_PREFIX: &str = "files/";

/// The scenario that the log holds, with the files it was run with.
pub(super) fn scenario_of(
    path: &Path,
    summary: &RunSummary,
    registry: &Registry,
) -> Result<Scenario, CommandError> {
    scenario_in(&Log::open(path)?, summary, registry)
}

/// The same of a log that is open.
pub(super) fn scenario_in(
    log: &Log,
    summary: &RunSummary,
    registry: &Registry,
) -> Result<Scenario, CommandError> {
    let not_repeatable = |reason: String| CommandError::NotRepeatable {
        path: log.path().to_owned(),
        reason,
    };
    let mut text = None;
    let mut files = BTreeMap::new();
    for attachment in log.attachments() {
        if attachment.name == SCENARIO {
            text = Some(attachment.bytes.clone());
        } else if let Some(name) = attachment.name.strip_prefix(FILE_PREFIX) {
            files.insert(name.to_owned(), attachment.bytes.clone());
        }
    }
    let text = text.ok_or_else(|| not_repeatable(format!("it holds no {SCENARIO}")))?;
    let text = String::from_utf8(text)
        .map_err(|_| not_repeatable(format!("its {SCENARIO} is not UTF-8")))?;
    let label = format!("{SCENARIO} in the log");
    let parsed = Scenario::parse(&label, text, &[], registry, Files::kept(files));
    let parsed = parsed.map(|scenario| scenario.named(&summary.scenario));
    parsed.map_err(|error| {
        let mut reason = match &error {
            ScenarioError::UnknownValue {
                key,
                found,
                expected,
                ..
            } if key == "system" => format!(
                "its system is {found:?}, which this binary does not know; expected {expected}. \
                 The binary that wrote the log can run it again"
            ),
            error => error.to_string(),
        };
        for note in notes(summary, registry) {
            reason.push_str("\n  ");
            reason.push_str(&note);
        }
        not_repeatable(reason)
    })
}

/// What the reader should know beside the outcome.
pub(super) fn notes(summary: &RunSummary, registry: &Registry) -> Vec<String> {
    let mut notes = Vec::new();
    let version = registry.version();
    if summary.code_version != version {
        notes.push(format!(
            "the log is from version {}, this is {version}: they need not agree",
            summary.code_version
        ));
    }
    if !summary.exclude.is_empty() {
        notes.push(format!(
            "not in the log, and compared through its checkpoints: {}",
            summary.exclude.join(", ")
        ));
    }
    notes
}

/// What a user names to be run, with some keys set: a log's own scenario, or a scenario.
pub(super) fn given(
    name: &str,
    sets: &[String],
    registry: &Registry,
) -> Result<Scenario, CommandError> {
    let path = Path::new(name);
    if kinds::is_log(path, registry) {
        return changed(path, sets, registry);
    }
    kinds::expect(FileKind::Scenario, path, registry)?;
    Ok(Scenario::open(name, sets, registry)?)
}

/// The scenario that a log holds, with some keys set, ties shuffled as they were.
fn changed(path: &Path, sets: &[String], registry: &Registry) -> Result<Scenario, CommandError> {
    let summary = farside_logs::info(path)?.run;
    let summary = summary.ok_or_else(|| CommandError::NotRepeatable {
        path: path.to_owned(),
        reason: "it is not the log of a Farside run".to_owned(),
    })?;
    let mut scenario = scenario_of(path, &summary, registry)?;
    if !sets.is_empty() {
        let (text, files) = (scenario.resolved()?, scenario.files().clone());
        let changed = Scenario::parse("the log's scenario", text, sets, registry, files)?;
        scenario = changed.named(&summary.scenario);
    }
    if let Some(tie_seed) = summary.tie_seed {
        scenario.set_tie_seed(tie_seed);
    }
    Ok(scenario)
}
