//! `farside recover`: save what can be saved of a log. It exits with 0 if nothing is lost, with 1
//! if something is lost or doubtful, or the end is missing.

use std::path::PathBuf;

use super::Exit;
use super::kinds::{self, FileKind};
use super::{CommandError, output, print, print_json};
use crate::registry::Registry;

const AFTER: &str = "\
Exit codes:
  0  nothing is lost: the new file has all that the broken one ever had
  1  something is lost or doubtful, or the end is missing: what, how many messages of which
     topics, and from when, is said as far as the file tells
  2  the input is no log, or the output is something that is not written over
  3  the output cannot be written";

#[derive(clap::Args)]
#[command(after_help = AFTER)]
pub(crate) struct Args {
    /// The log that is cut or damaged
    #[arg(value_name = "BROKEN.mcap")]
    broken: PathBuf,
    /// Where to write what is saved; it appears there once it is whole
    #[arg(long, value_name = "FIXED.mcap")]
    out: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args, registry: &Registry) -> Result<Exit, CommandError> {
    kinds::expect(FileKind::Log, &args.broken, registry)?;
    let inputs = std::slice::from_ref(&args.broken);
    output::spare(inputs, std::slice::from_ref(&args.out))?;
    let report = farside_logs::recover(&args.broken, &args.out)?;
    if args.json {
        print_json(&report)?;
    } else {
        print(&report)?;
    }
    // As with `diff`: 1 says that the two files do not hold the same.
    Ok(if report.is_lossless() {
        Exit::Done
    } else {
        Exit::Different
    })
}
