//! `farside diff`: two logs, message by message.

use std::path::PathBuf;

use farside_logs::DiffOptions;

use super::Exit;
use super::kinds::{self, FileKind};
use super::{CommandError, output, print, print_json};
use crate::registry::Registry;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// One log
    #[arg(value_name = "A.mcap")]
    a: PathBuf,
    /// The other
    #[arg(value_name = "B.mcap")]
    b: PathBuf,
    /// List every topic, not one row for `/node_01/grant`, `/node_02/grant`, ...
    #[arg(long)]
    topics: bool,
    /// Print JSON, with every topic
    #[arg(long)]
    json: bool,
    /// Take numbers as equal that differ by at most this, absolutely or as a share
    #[arg(long, value_name = "X", default_value = "0", value_parser = tolerance)]
    tolerance: f64,
    /// Leave out these topics; `*` does not match `/`, `**` does; may be repeated
    #[arg(long, value_name = "GLOB")]
    ignore: Vec<String>,
}

fn tolerance(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number >= 0.0 && number.is_finite() => Ok(number),
        _ => Err("expected a number from 0 on, such as 1e-6".to_owned()),
    }
}

pub(crate) fn run(args: &Args, registry: &Registry) -> Result<Exit, CommandError> {
    kinds::expect(FileKind::Log, &args.a, registry)?;
    kinds::expect(FileKind::Log, &args.b, registry)?;
    output::spare(&[args.a.clone(), args.b.clone()], &[])?;
    let options = DiffOptions {
        tolerance: args.tolerance,
        ignore: args.ignore.clone(),
        ..DiffOptions::default()
    };
    let report = farside_logs::diff(&args.a, &args.b, &options)?;
    if args.json {
        print_json(&report)?;
    } else if args.topics {
        print(format!("{report:#}"))?;
    } else {
        print(&report)?;
    }
    Ok(if report.identical {
        Exit::Done
    } else {
        Exit::Different
    })
}
