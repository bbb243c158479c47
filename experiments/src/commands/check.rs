//! `farside check`: read, check, print the resolved scenario, and what became of its files.

use super::Exit;
use super::{CommandError, print_document};
use farside_logs::escaped;

use crate::registry::Registry;
use crate::scenario::Scenario;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// A built-in scenario (see `farside scenarios`) or a TOML file
    scenario: String,
    /// Set a key of the scenario, as in links.default.loss=0.3; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<String>,
}

pub(crate) fn run(args: &Args, registry: &Registry) -> Result<Exit, CommandError> {
    let scenario = Scenario::open(&args.scenario, &args.sets, registry)?;
    // Much of what can be wrong shows only in the world that is built.
    let assembled = scenario.assemble()?;
    let mut text = scenario.resolved()?;
    // Comments, so that what is printed is still the scenario.
    let notes = assembled.notes.iter().chain(&assembled.remarks);
    for (at, note) in notes.enumerate() {
        let gap = if at == 0 { "\n" } else { "" };
        text.push_str(&format!("{gap}# {}\n", escaped(note)));
    }
    print_document(&text)?;
    Ok(Exit::Done)
}
