//! `farside info`: what is in a log.

use std::path::PathBuf;

use super::Exit;
use super::kinds::{self, FileKind};
use super::{CommandError, output, print, print_json};
use crate::registry::Registry;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// The log; any MCAP file will do
    #[arg(value_name = "RUN.mcap")]
    log: PathBuf,
    /// List every topic, not one row for `/node_01/grant`, `/node_02/grant`, ...
    #[arg(long)]
    topics: bool,
    /// Print JSON, with every topic
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args, registry: &Registry) -> Result<Exit, CommandError> {
    kinds::expect(FileKind::Log, &args.log, registry)?;
    output::spare(std::slice::from_ref(&args.log), &[])?;
    let info = farside_logs::info(&args.log)?;
    if args.json {
        print_json(&info)?;
    } else if args.topics {
        print(format!("{info:#}"))?;
    } else {
        print(&info)?;
    }
    Ok(Exit::Done)
}
