//! `farside problem`: what a scenario's planners have to solve, for other programs.

use std::path::{Path, PathBuf};

use super::Exit;
use super::kinds::{self, FileKind};
use super::output::{self, Format, write};
use super::{CommandError, print, print_document};
use crate::registry::Registry;
use crate::scenario::Scenario;

/// The file name that means standard output.
const STDOUT: &str = "-";

const EXAMPLE: &str = "\
Example:
  farside problem misus/planners --seed 7 --out seven.json
                                         what `farside run misus/planners --seed 7` plans";

#[derive(clap::Args)]
#[command(after_help = EXAMPLE)]
pub(crate) struct Args {
    /// A built-in scenario (see `farside scenarios`) or a TOML file
    scenario: String,
    /// The seed of the run whose problem it is, instead of the scenario's
    #[arg(long, value_name = "N", allow_negative_numbers = true,
        value_parser = clap::value_parser!(u64).range(..=i64::MAX as u64))]
    seed: Option<u64>,
    /// Where to write it; to standard output unless given, or for -
    #[arg(long, value_name = "P.json", default_value = STDOUT, hide_default_value = true)]
    out: PathBuf,
    /// Set a key of the scenario, as in problem.rovers=5; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<String>,
}

pub(crate) fn run(args: &Args, registry: &Registry) -> Result<Exit, CommandError> {
    kinds::expect(FileKind::Scenario, Path::new(&args.scenario), registry)?;
    let mut scenario = Scenario::open(&args.scenario, &args.sets, registry)?;
    if let Some(seed) = args.seed {
        scenario.set_seed(seed);
    }
    for remark in scenario.renamed_remarks() {
        tracing::warn!("{remark}");
    }
    let (problem, files) = scenario.problem()?;
    let Some(mut text) = problem else {
        return Err(CommandError::Arguments(nothing_to_solve(
            args,
            &scenario.shared().system,
            registry,
        )));
    };
    let mut inputs = files.paths();
    inputs.push(PathBuf::from(&args.scenario));
    if args.out == Path::new(STDOUT) {
        output::spare(&inputs, &[])?;
        print_document(&text)?;
        return Ok(Exit::Done);
    }
    if !text.ends_with('\n') {
        text.push('\n');
    }
    output::spare(&inputs, std::slice::from_ref(&args.out))?;
    let written = write(args.out.clone(), &text, Format::Problem, &inputs)?;
    let (name, seed) = (scenario.name(), scenario.seeds().problem);
    print(format!("{written}: the problem of {name}, seed {seed}"))?;
    Ok(Exit::Done)
}

/// That a system has no problem, and which have one.
fn nothing_to_solve(args: &Args, system: &str, registry: &Registry) -> String {
    let given = &args.scenario;
    let others = registry.systems().filter_map(|other| {
        let about = other.problem()?;
        let scenarios = other.scenarios().iter().map(|scenario| scenario.name);
        let scenarios = scenarios.collect::<Vec<_>>().join(", ");
        Some(format!("\n  {}: {about} ({scenarios})", other.name()))
    });
    let others: String = others.collect();
    let expected = match others.as_str() {
        "" => "no system that is built in has one".to_owned(),
        others => format!("expected a scenario of a system that has:{others}"),
    };
    format!("{given}: its system {system:?} has no problem to export; {expected}")
}
