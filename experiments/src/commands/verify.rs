//! `farside verify`: run a log's scenario again and compare every message.

use std::path::{Path, PathBuf};

use farside::SimDuration;
use farside_logs::{Verifier, VerifyOutcome, escaped};
use serde::Serialize;

use super::Exit;
use super::kinds::{self, FileKind};
use super::logged::{notes, scenario_of};
use super::run::ExecutorName;
use super::{CommandError, interrupt, output, print, print_json, progress};
use crate::registry::Registry;
use crate::wall::timed;

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
