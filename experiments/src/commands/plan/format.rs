//! `farside plan format`: a text of the language in its normal form.

use std::path::PathBuf;

use farside_planning::language;

use super::files::{self, PlanError};
use crate::commands::{CommandError, Exit, output, print, print_bytes};

const AFTER: &str = "\
Exit codes:
  0  done; with --check: the file is in its normal form
  1  with --check: it is not
  2  the file is no such text";

#[derive(clap::Args)]
#[command(after_help = AFTER)]
pub(super) struct Args {
    /// A model or a problem
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Write it into the file
    #[arg(long, conflicts_with = "check")]
    write: bool,
    /// Write nothing; only say whether the file is in its normal form
    #[arg(long)]
    check: bool,
}

pub(super) fn run(args: &Args) -> Result<Exit, CommandError> {
    let text = files::read_text(&args.file)?;
    let formatted = language::format(&text).map_err(|mut source| {
        for finding in &mut source.0 {
            finding.file = files::name(&args.file);
        }
        PlanError::NoForm {
            path: args.file.clone(),
            source,
        }
    })?;
    output::spare(std::slice::from_ref(&args.file), &[])?;
    let is_so = formatted == text;
    if args.check {
        if !is_so {
            print(format!(
                "{}: is not in its normal form",
                args.file.display()
            ))?;
            return Ok(Exit::Different);
        }
    } else if !args.write {
        // The text itself: what a terminal would obey was in the file.
        print_bytes(formatted.as_bytes())?;
    } else if !is_so {
        output::replace(&args.file, formatted.as_bytes())?;
    }
    Ok(Exit::Done)
}
