//! `farside diff`: two logs, message by message.

pub(super) mod draws;

use std::path::PathBuf;

use farside_actors::units::parse_duration;
use farside_logs::{DiffOptions, DiffReport, Differing, Tolerance};
use serde::Serialize;

use super::Exit;
use super::came::{BothCame, Came};
use super::kinds::{self, FileKind};
use super::{CommandError, output, print, print_json, view};
use crate::page;
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
    /// Run both again, without logs, and say in which metrics they differ
    #[arg(long)]
    metrics: bool,
    /// Print JSON, with every topic
    #[arg(long)]
    json: bool,
    /// Write a page too that shows both runs, with what differs, as `view` does of one
    #[arg(long, value_name = "FILE.html")]
    html: Option<PathBuf>,
    /// Take as equal what differs by at most this: numbers (1e-6, absolutely or as a share), times (10ms), or
    /// a field and all within it (header.stamp=10ms, ranges=1e-6, log_time=1ms); may be repeated
    #[arg(long, value_name = "[FIELD=]X", value_parser = given_tolerance)]
    tolerance: Vec<Given>,
    /// More tolerances of fields, behind the two logs
    #[arg(value_name = "FIELD=X", value_parser = given_tolerance, hide = true)]
    more: Vec<Given>,
    /// Leave out these topics (globs; `*` does not match `/`, `**` does) or fields (header.stamp); may be
    /// repeated
    #[arg(long, value_name = "GLOB|FIELD")]
    ignore: Vec<String>,
    /// Compare these topics only; may be repeated
    #[arg(long, value_name = "GLOB")]
    topic: Vec<String>,
}

/// A tolerance as it was given: of one field, or of all.
#[derive(Clone, Debug, PartialEq)]
struct Given {
    field: Option<String>,
    within: Tolerance,
}

fn given_tolerance(text: &str) -> Result<Given, String> {
    let (field, value) = match text.rsplit_once('=') {
        Some((field, value)) if !field.is_empty() => (Some(field.to_owned()), value),
        _ => (None, text),
    };
    let number = value.parse::<f64>().ok();
    let number = number.filter(|number| *number >= 0.0 && number.is_finite());
    let time = parse_duration(value).ok();
    let within = match (number, time) {
        (Some(number), _) => Tolerance::Number(number),
        (_, Some(time)) => Tolerance::TimeNs(time.as_nanos()),
        _ => return Err("expected a number from 0 on or a time, such as 1e-6 or 10ms".to_owned()),
    };
    Ok(Given { field, within })
}

/// What `diff --json` prints.
#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    report: &'a DiffReport,
    /// What came of the two runs, as they are run again.
    #[serde(skip_serializing_if = "Option::is_none")]
    came: Option<&'a BothCame>,
}

pub(crate) fn run(args: &Args, registry: &Registry) -> Result<Exit, CommandError> {
    kinds::expect(FileKind::Log, &args.a, registry)?;
    kinds::expect(FileKind::Log, &args.b, registry)?;
    let inputs = [args.a.clone(), args.b.clone()];
    output::spare(&inputs, args.html.as_slice())?;
    let mut options = DiffOptions {
        ignore: args.ignore.clone(),
        topics: args.topic.clone(),
        ..DiffOptions::default()
    };
    for Given { field, within } in args.tolerance.iter().chain(&args.more) {
        match (field, *within) {
            (Some(field), within) => options.field_tolerances.push((field.clone(), within)),
            (None, Tolerance::Number(number)) => options.tolerance = number,
            (None, Tolerance::TimeNs(time_ns)) => options.time_tolerance_ns = Some(time_ns),
        }
    }
    let (mut report, differing) = match &args.html {
        Some(_) => farside_logs::diff_marked(&args.a, &args.b, &options)?,
        None => (
            farside_logs::diff(&args.a, &args.b, &options)?,
            Differing::default(),
        ),
    };
    draws::tell(&mut report, [&args.a, &args.b], registry);
    if let Some(out) = &args.html {
        let side = |log: usize| page::read_beside(&inputs[log], log, &differing);
        let sides = [side(0)?, side(1)?];
        for (path, side) in inputs.iter().zip(&sides) {
            view::warn(path, side);
        }
        let text = page::of_diff(sides.each_ref(), &report)?;
        view::write(out, &text, &inputs)?;
    }
    let came = match args.metrics {
        true => {
            let [a, b] = [&args.a, &args.b].map(|path| Came::again(path, registry));
            Some(BothCame::new(a?, b?))
        }
        false => None,
    };
    if args.json {
        print_json(&Document {
            report: &report,
            came: came.as_ref(),
        })?;
    } else {
        let mut text = match args.topics {
            true => format!("{report:#}"),
            false => report.to_string(),
        };
        if let Some(came) = &came {
            text.push_str(&format!("\n{came}"));
        }
        print(text)?;
    }
    Ok(if report.identical {
        Exit::Done
    } else {
        Exit::Different
    })
}
