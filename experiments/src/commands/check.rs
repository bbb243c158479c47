//! `farside check`: read, check, print the resolved scenario, and what became of its files.

use super::Exit;
use super::describe::commented;
use super::kinds::{self, FileKind};
use super::{CommandError, output, print_document};
use std::path::{Path, PathBuf};

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
    /// Say of each key what it is, in comments
    #[arg(long)]
    comments: bool,
}

pub(crate) fn run(args: &Args, registry: &Registry) -> Result<Exit, CommandError> {
    kinds::expect(FileKind::Scenario, Path::new(&args.scenario), registry)?;
    let scenario = Scenario::open(&args.scenario, &args.sets, registry)?;
    // Much of what can be wrong shows only in the world that is built.
    let assembled = scenario.assemble()?;
    let mut inputs = assembled.files.paths();
    inputs.push(PathBuf::from(&args.scenario));
    output::spare(&inputs, &[])?;
    let mut text = scenario.resolved()?;
    if args.comments {
        text = commented(&text, registry);
    }
    // Comments, so that what is printed is still the scenario.
    let notes = assembled.notes.iter().chain(&assembled.remarks);
    for (at, note) in notes.enumerate() {
        let gap = if at == 0 { "\n" } else { "" };
        text.push_str(&format!("{gap}# {}\n", escaped(note)));
    }
    print_document(&text)?;
    Ok(Exit::Done)
}
