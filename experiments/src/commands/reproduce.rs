//! `farside reproduce`: one run of a study again, logged, and compared with its record.

use std::path::PathBuf;

use farside::Executor;
use farside_logs::{LogWriter, may_hold_log};
use serde::Serialize;
use serde_json::{Map, Value};

use super::Exit;
use super::kinds::{self, FileKind};
use super::run::log_options;
use super::{CommandError, complain, interrupt, output, print, print_json, progress};
use crate::registry::Registry;
use crate::scenario::{Assembled, Scenario};
use crate::study::results::{Manifest, Results, RunOutcome, RunRecord};
use crate::study::{Interrupts, Reproduction, find_run, reproduce};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// The study's results folder
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// The cell: its number, or factor values as in loss=0.3,latency=600ms
    #[arg(long, value_name = "C")]
    cell: String,
    /// The seed
    #[arg(long, value_name = "S")]
    seed: u64,
    /// Where to write the log
    #[arg(long, value_name = "RUN.mcap", default_value = "run.mcap")]
    out: PathBuf,
    /// Print the result as one JSON document
    #[arg(long)]
    json: bool,
}

/// What `reproduce --json` prints.
#[derive(Serialize)]
struct Document {
    study: String,
    cell: usize,
    factors: Map<String, Value>,
    seed: u64,
    /// `same` or `different`.
    result: &'static str,
    differences: Vec<Difference>,
    run: RunOutcome,
    log: String,
    notes: Vec<String>,
}

/// A part of the record that is not what the run again gives.
#[derive(Serialize)]
struct Difference {
    part: String,
    recorded: String,
    rerun: String,
}

pub(crate) fn run(args: &Args, registry: &Registry) -> Result<Exit, CommandError> {
    kinds::expect(FileKind::Results, &args.folder, registry)?;
    let results = Results::load(&args.folder)?;
    let manifest = &results.manifest;
    let record = find_run(&results, &args.cell, args.seed)?;
    let interrupts = Interrupts::default();
    let raised = interrupts.clone();
    interrupt::on_interrupt(move || raised.raise());
    let inputs = Results::files(&args.folder);
    output::spare(&inputs, std::slice::from_ref(&args.out))?;
    may_hold_log(&args.out, &inputs)?;
    let mut trouble = None;
    let again = reproduce(
        manifest,
        record,
        registry,
        &interrupts,
        |scenario, assembled| {
            let observed = observe(args, scenario, assembled, registry);
            observed.map_err(|error| {
                let text = error.to_string();
                trouble = Some(error);
                text
            })
        },
    )?;
    if let Some(error) = trouble {
        return Err(error);
    }
    let Some(Reproduction {
        outcome,
        differences,
        unrecorded,
    }) = again
    else {
        complain("interrupted before the end: nothing is compared");
        return Ok(Exit::Failed);
    };
    if let Some(error) = unrecorded {
        let log = args.out.display();
        // A result of its own: neither the same nor different.
        complain(format!("error: {log}: cannot be recorded: {error}"));
        return Ok(Exit::Failed);
    }
    let document = document(args, manifest, record, outcome, differences, registry);
    let same = document.differences.is_empty();
    if args.json {
        print_json(&document)?;
    } else {
        print(text(manifest, &document))?;
    }
    Ok(if same { Exit::Done } else { Exit::Different })
}

fn document(
    args: &Args,
    manifest: &Manifest,
    record: &RunRecord,
    outcome: RunOutcome,
    differences: Vec<(String, String, String)>,
    registry: &Registry,
) -> Document {
    let differences: Vec<Difference> = differences
        .into_iter()
        .map(|(part, recorded, rerun)| Difference {
            part,
            recorded,
            rerun,
        })
        .collect();
    let same = differences.is_empty();
    let names = manifest.factors.iter().map(|factor| factor.name.clone());
    Document {
        study: manifest.study.clone(),
        cell: record.cell,
        factors: names
            .zip(manifest.cells[record.cell].values.iter().cloned())
            .collect(),
        seed: record.seed,
        result: if same { "same" } else { "different" },
        differences,
        run: outcome,
        log: args.out.display().to_string(),
        notes: notes(manifest, registry),
    }
}

fn observe(
    args: &Args,
    scenario: &Scenario,
    assembled: &mut Assembled,
    registry: &Registry,
) -> Result<(), CommandError> {
    let mut options = log_options(scenario, assembled, Executor::Inline, registry)?;
    let draws = scenario.shared().log.viewer;
    options.scene = assembled.system.scene.take().filter(|_| draws);
    assembled
        .sim
        .observe(LogWriter::create(&args.out, options)?);
    let goal = assembled.system.goal.take();
    progress::show(&mut assembled.sim, goal, scenario.until());
    Ok(())
}

/// What the reader should know beside the outcome.
fn notes(manifest: &Manifest, registry: &Registry) -> Vec<String> {
    let (version, ours) = (&manifest.code_version, registry.version());
    let note =
        format!("the results are from version {version}, this is {ours}: they need not agree");
    if *version == ours {
        Vec::new()
    } else {
        vec![note]
    }
}

fn text(manifest: &Manifest, document: &Document) -> String {
    let cell = &manifest.cells[document.cell];
    let factors = manifest.factors.iter().zip(&cell.texts);
    let values: Vec<String> = factors
        .map(|(factor, text)| format!("{} = {text}", factor.name))
        .collect();
    let (number, seed, log) = (document.cell, document.seed, &document.log);
    let mut text = format!("cell {number} ({}), seed {seed}: ", values.join(", "));
    if document.differences.is_empty() {
        match &document.run {
            RunOutcome::Done { digest, .. } => {
                text.push_str(&format!("the same, digest {digest}, log {log}\n"));
            }
            RunOutcome::Failed { error } => {
                text.push_str(&format!("fails the same, log {log}\n  {error}\n"));
            }
        }
    } else {
        text.push_str(&format!("DIFFERENT, log {log}\n"));
        for difference in &document.differences {
            let Difference {
                part,
                recorded,
                rerun,
            } = difference;
            text.push_str(&format!(
                "  {part}\n    recorded   {recorded}\n    run again  {rerun}\n"
            ));
        }
    }
    for note in &document.notes {
        text.push_str(&format!("  note: {note}\n"));
    }
    text
}
