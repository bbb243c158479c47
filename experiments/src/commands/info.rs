//! `farside info`: what is in a log.

use std::path::PathBuf;

use super::{CommandError, print, print_json};
use crate::cli::Exit;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// The log; any MCAP file will do
    #[arg(value_name = "RUN.mcap")]
    log: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args) -> Result<Exit, CommandError> {
    let info = farside_logs::info(&args.log)?;
    if args.json {
        print_json(&info)?;
    } else {
        print(&info)?;
    }
    Ok(Exit::Done)
}
