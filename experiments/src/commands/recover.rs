//! `farside recover`: save what can be saved of a log.

use std::path::PathBuf;

use super::Exit;
use super::{CommandError, print};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// The log that is cut or damaged
    #[arg(value_name = "BROKEN.mcap")]
    broken: PathBuf,
    /// Where to write what is saved
    #[arg(long, value_name = "FIXED.mcap")]
    out: PathBuf,
}

pub(crate) fn run(args: &Args) -> Result<Exit, CommandError> {
    print(farside_logs::recover(&args.broken, &args.out)?)?;
    Ok(Exit::Done)
}
