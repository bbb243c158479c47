//! `farside verify`: run a log's scenario again and compare every message.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use farside::SimDuration;
use farside_logs::{Log, RunSummary, Verifier, VerifyOutcome, escaped};
use serde::Serialize;

use super::Exit;
use super::kinds::{self, FileKind};
use super::run::{ExecutorName, FILE_PREFIX};
use super::{CommandError, interrupt, output, print, print_json, progress};
use crate::scenario::{Scenario, ScenarioError};
use farside_actors::system::Files;

use crate::registry::Registry;
use crate::wall::timed;

/// The attachment that holds the resolved scenario.
const SCENARIO: &str = "scenario.toml";

#[derive(clap::Args)]
pub(crate) struct Args {
    /// The log
    #[arg(value_name = "RUN.mcap")]
    log: PathBuf,
    /// Execute on one thread (inline) or on many (kameo), or as pays (auto): the result is the same
    #[arg(long, value_enum, default_value_t = ExecutorName::Auto)]
    executor: ExecutorName,
    /// Threads for kameo; as many as there are cores unless given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// What `verify --json` prints.
#[derive(Serialize)]
struct Document<'a> {
    log: String,
    scenario: &'a str,
    seed: u64,
    #[serde(flatten)]
    outcome: &'a VerifyOutcome,
    rerun_digest: String,
    wall_s: f64,
    notes: &'a [String],
}

pub(crate) fn run(args: &Args, registry: &Registry) -> Result<Exit, CommandError> {
    let path = &args.log;
    let not_repeatable = |reason: String| CommandError::NotRepeatable {
        path: path.clone(),
        reason,
    };
    kinds::expect(FileKind::Log, path, registry)?;
    output::spare(std::slice::from_ref(path), &[])?;
    let info = farside_logs::info(path)?;
    let Some(summary) = info.run else {
        return Err(not_repeatable(
            "it is not the log of a Farside run".to_owned(),
        ));
    };
    let scenario = scenario_of(path, &summary, registry)?;
    let mut assembled = scenario
        .assemble()
        .map_err(|error| not_repeatable(error.to_string()))?;
    assembled.sim.tie_seed(summary.tie_seed);
    let verifier = Verifier::open(path)?;
    let handle = verifier.handle();
    assembled.sim.observe(verifier);
    let until = scenario.until();
    progress::show(&mut assembled.sim, assembled.system.goal, until);
    let interrupt = assembled.sim.interrupt();
    interrupt::raise_on_interrupt(interrupt);
    let executor = args.executor.executor(&assembled.sim, args.threads);
    let (report, wall_s) = timed(|| assembled.sim.run(executor));
    let report = report?;
    if report.end == farside::End::Interrupted && summary.end.as_deref() != Some("interrupted") {
        let at = report.end_time;
        return Err(not_repeatable(format!(
            "it was interrupted at {at}, before the end"
        )));
    }
    let outcome = handle.outcome()?;
    let notes = notes(&summary, registry);
    if args.json {
        print_json(&Document {
            log: path.display().to_string(),
            scenario: &summary.scenario,
            seed: summary.seed,
            outcome: &outcome,
            rerun_digest: report.digest.to_string(),
            wall_s,
            notes: &notes,
        })?;
    } else {
        print(text(path, &outcome, &notes))?;
    }
    Ok(match outcome {
        VerifyOutcome::Same { .. } | VerifyOutcome::Prefix { .. } => Exit::Done,
        VerifyOutcome::Different { .. } => Exit::Different,
    })
}

/// The scenario that the log holds, with the files it was run with.
pub(super) fn scenario_of(
    path: &Path,
    summary: &RunSummary,
    registry: &Registry,
) -> Result<Scenario, CommandError> {
    let not_repeatable = |reason: String| CommandError::NotRepeatable {
        path: path.to_owned(),
        reason,
    };
    let mut text = None;
    let mut files = BTreeMap::new();
    for attachment in Log::open(path)?.attachments() {
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

fn text(path: &Path, outcome: &VerifyOutcome, notes: &[String]) -> String {
    let path = path.display();
    let mut text = match outcome {
        VerifyOutcome::Same {
            records,
            checkpoints,
            digest,
        } => format!(
            "{path}: the same: {records} records, {checkpoints} checkpoints, digest {digest}\n"
        ),
        VerifyOutcome::Prefix {
            records,
            last_ns,
            missing,
            ..
        } => {
            let last = SimDuration::from_nanos(last_ns.unwrap_or(0));
            format!(
                "{path}: the same as far as it goes: {records} records, up to {last}\n  \
                 {missing}\n"
            )
        }
        VerifyOutcome::Different { records, first } => {
            let mut out = format!(
                "{path}: DIFFERENT after {records} equal records\n  at {}.{:09}s on {}: {} of {} to \
                 {} (number {})\n",
                first.time_ns / 1_000_000_000,
                first.time_ns % 1_000_000_000,
                escaped(&first.topic),
                escaped(&first.field),
                escaped(&first.sender),
                escaped(&first.receiver),
                first.ordinal
            );
            out.push_str(&format!(
                "  in the log  {}\n  run again   {}\n",
                escaped(&first.logged),
                escaped(&first.rerun)
            ));
            if !first.why.is_empty() {
                out.push_str(&format!("  compared by bytes: {}\n", escaped(&first.why)));
            }
            out
        }
    };
    for note in notes {
        text.push_str(&format!("  note: {note}\n"));
    }
    text
}
