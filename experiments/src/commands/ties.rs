//! `farside ties`: which conclusions of a run hang on the order of events that are at one instant.

mod conclusions;
mod parting;
mod runs;
mod text;

use std::path::PathBuf;

use farside::SimDuration;
use serde::Serialize;

use self::conclusions::{Changed, TOLERANCE};
use self::parting::Parting;
use self::runs::Runs;
use super::logged::given;
use super::run::{DEFAULT_SCENARIO, duration};
use super::{CommandError, Exit, interrupt, output, print, print_json};
use crate::registry::Registry;
use crate::scenario::Scenario;
use crate::study::Interrupts;

#[derive(clap::Args)]
#[command(after_help = "\
The scenario is run as it is, and with each of the tie seeds 1 to N, which shuffle what happens at one
instant and nothing else. What a run comes to is why it ends, which invariants it breaks, and its metrics;
numbers are the same if they differ by less than a billionth of themselves, or by less than 1e-12. Of two runs that come to
something else, the first message or state that differs is named, and the two events whose order decided.

Examples:
  farside ties                                       30 tie seeds over the default scenario
  farside ties run.mcap --seeds 100                  over the scenario of a log
  farside ties network/crater-dense --set team.rovers=20 --json")]
pub(crate) struct Args {
    /// A built-in scenario (see `farside scenarios`), a TOML file, or a log, whose own scenario is run
    #[arg(default_value = DEFAULT_SCENARIO, value_name = "SCENARIO|RUN.mcap")]
    scenario: String,
    /// How many tie seeds: 1 to N
    #[arg(long, value_name = "N", default_value_t = 30,
        value_parser = clap::value_parser!(u32).range(1..=100_000))]
    seeds: u32,
    /// The seed that every random draw derives from, instead of the scenario's
    #[arg(long, value_name = "N", allow_negative_numbers = true,
        value_parser = clap::value_parser!(u64).range(..=i64::MAX as u64))]
    seed: Option<u64>,
    /// Set a key of the scenario first; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<String>,
    /// Stop at this virtual time, as in 90s
    #[arg(long, value_name = "DURATION", value_parser = duration, allow_hyphen_values = true)]
    until: Option<SimDuration>,
    /// How many runs at once; as many as there are cores unless given. The result is the same
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// What `ties --json` prints. Tie seeds are numbers, and `null` where simultaneous events went by name.
#[derive(Serialize)]
struct Document<'a> {
    scenario: &'a str,
    seed: u64,
    /// The tie seeds that it was run with; the first is the scenario's own.
    tie_seeds: &'a [Option<u64>],
    /// How many different digests the runs have: one, if nothing is at one instant.
    digests: usize,
    /// How many conclusions were compared.
    compared: usize,
    /// By what share of itself a number may differ and be the same.
    tolerance: f64,
    /// Those that are not the same in all runs.
    changed: &'a [Changed],
    /// Where two runs part that come to something else.
    parting: Option<&'a Parting>,
    remarks: &'a [String],
}

pub(crate) fn run(args: &Args, registry: &Registry) -> Result<Exit, CommandError> {
    let scenario = scenario(args, registry)?;
    let system = registry.find(&scenario.shared().system);
    let system = system.map_err(|unknown| CommandError::Arguments(unknown.expected))?;
    let assembled = scenario.assemble()?;
    let mut inputs = assembled.files.paths();
    inputs.push(PathBuf::from(&args.scenario));
    output::spare(&inputs, &[])?;
    for remark in &assembled.remarks {
        tracing::warn!("{remark}");
    }
    let own = scenario.shared().tie_seed;
    let seeds = (1..=u64::from(args.seeds)).map(Some);
    let tie_seeds: Vec<Option<u64>> = std::iter::once(own)
        .chain(seeds.filter(|seed| *seed != own))
        .collect();
    let interrupts = Interrupts::default();
    let raised = interrupts.clone();
    interrupt::on_interrupt(move || raised.raise());
    let cores = || std::thread::available_parallelism().map_or(1, usize::from);
    let jobs = args.jobs.map_or_else(cores, usize::from);
    let runs = Runs {
        scenario: &scenario,
        system,
        registry,
        interrupts: &interrupts,
    };
    let ran = runs.all(&tie_seeds, jobs)?;
    let changed = conclusions::changed(&ran);
    let parting = match changed.first() {
        Some(changed) => Some(parting::find(&runs, changed.parted())?),
        None => None,
    };
    let document = Document {
        scenario: scenario.name(),
        seed: scenario.shared().seed,
        tie_seeds: &tie_seeds,
        digests: conclusions::digests(&ran),
        compared: ran.first().map_or(0, |ran| ran.conclusions.len()),
        tolerance: TOLERANCE,
        changed: &changed,
        parting: parting.as_ref(),
        remarks: &assembled.remarks,
    };
    match args.json {
        true => print_json(&document)?,
        false => print(text::told(&document, registry.program(), &args.scenario))?,
    }
    Ok(match changed.is_empty() {
        true if ran.iter().all(|ran| ran.has_failed) => Exit::Failed,
        true => Exit::Done,
        false => Exit::Different,
    })
}

/// What is run.
fn scenario(args: &Args, registry: &Registry) -> Result<Scenario, CommandError> {
    let mut scenario = given(&args.scenario, &args.sets, registry)?;
    if let Some(seed) = args.seed {
        scenario.set_seed(seed);
    }
    if let Some(until) = args.until {
        scenario.set_until(until);
    }
    Ok(scenario)
}
