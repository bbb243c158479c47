//! `farside plot`: what fields of a log's messages were over time, of any MCAP file.

mod curves;
mod figure;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use farside::suggest::{did_you_mean, nearest};
use farside::{Pattern, SimDuration};
use farside_actors::units;
use farside_logs::AnyMessages;
use serde_json::json;

use self::curves::{Curve, Curves, Part};
use super::{CommandError, Exit, output, print, print_json};
use crate::export::{self, FigureFormat};
use clap::ValueEnum;

#[derive(clap::Args)]
#[command(after_help = "\
A field is named as `cat` prints it: pose.position.x, ranges[3]. In Farside's logs that is body.pose.x; body.
may be left out. Topics may be globs: * is any letters but /, ** any levels.

Examples:
  farside plot run.mcap '/state/rover_0[1-3]/rover_state.transmit_energy_j'
  farside plot bag.mcap /imu.linear_acceleration.x /imu.linear_acceleration.y --from 10s --at 20s")]
pub(crate) struct Args {
    /// The log; any MCAP file
    #[arg(value_name = "RUN.mcap")]
    log: PathBuf,
    /// A topic, or a glob over topics, and a field of its messages
    #[arg(value_name = "TOPIC.FIELD", required = true)]
    fields: Vec<String>,
    /// The beginning of a time span, from the log's first message on
    #[arg(long, value_name = "DUR", value_parser = units::parse_duration)]
    from: Option<SimDuration>,
    /// The end of a time span
    #[arg(long, value_name = "DUR", value_parser = units::parse_duration)]
    at: Option<SimDuration>,
    /// Where to write the figure; beside the log unless given. It is SVG, or what the ending says
    #[arg(long, value_name = "FILE.svg|.pdf|.png")]
    out: Option<PathBuf>,
    /// What else it is written as, beside that: svg, pdf for papers, png for slides
    #[arg(
        long,
        value_name = "KIND",
        value_delimiter = ',',
        hide_possible_values = true
    )]
    format: Vec<FigureFormat>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args) -> Result<Exit, CommandError> {
    let path = &args.log;
    let wrong = |message: String| CommandError::Arguments(message);
    if let (Some(from), Some(at)) = (args.from, args.at)
        && from >= at
    {
        return Err(wrong(format!("--from {from} is not before --at {at}")));
    }
    let wanted = wanted(path, &args.fields)?;
    let part = Part {
        from_ns: args.from.map_or(0, SimDuration::as_nanos),
        until_ns: args.at.map_or(u64::MAX, SimDuration::as_nanos),
    };
    let curves = Curves::read(path, &wanted, &part)?;
    let by_ending = |out: &PathBuf| {
        let ending = out.extension()?.to_str()?;
        FigureFormat::from_str(ending, true).ok()
    };
    let first = args.out.as_ref().and_then(by_ending);
    let kinds = export::kinds(first.unwrap_or(FigureFormat::Svg), &args.format)?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let figure = figure::figure(&curves, &name);
    let out = args.out.clone().unwrap_or_else(|| {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        path.with_file_name(format!("{stem}-{}", figure.file))
    });
    let place = |(at, kind): (usize, &FigureFormat)| match at {
        0 => out.clone(),
        _ => out.with_extension(kind.ending()),
    };
    let paths: Vec<PathBuf> = kinds.iter().enumerate().map(place).collect();
    let inputs = std::slice::from_ref(path);
    output::spare(inputs, &paths)?;
    let mut files = Vec::new();
    for (path, kind) in paths.into_iter().zip(&kinds) {
        files.push(output::write_figure(path, &figure, *kind, inputs)?);
    }
    for remark in &curves.remarks {
        tracing::warn!("{remark}");
    }
    if args.json {
        let curve = |curve: &Curve| {
            json!({
                "topic": curve.topic,
                "field": curve.field,
                "values": curve.values.values,
                "least": curve.values.range.map(|[least, _]| least),
                "greatest": curve.values.range.map(|[_, greatest]| greatest),
                "no_number": curve.no_number,
            })
        };
        let all: Vec<_> = curves.curves.iter().map(curve).collect();
        print_json(&json!({ "out": files[0], "files": files, "curves": all }))?;
    } else {
        print(format!("{}: {}", files.join(", "), figure.description))?;
    }
    Ok(Exit::Done)
}

/// A topic and a field, as they are asked for.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Wanted {
    topics: Pattern,
    glob: String,
    field: String,
}

/// Parts each text into topic and field: at the last dot at which there is such a topic.
fn wanted(path: &Path, texts: &[String]) -> Result<Vec<Wanted>, CommandError> {
    // Said of what is no MCAP file before anything of topics.
    drop(AnyMessages::open(path, &[])?);
    let info = farside_logs::info(path)?;
    let topics: Vec<&str> = info
        .topics
        .iter()
        .map(|topic| topic.topic.as_str())
        .collect();
    texts.iter().map(|text| part(text, &topics)).collect()
}

fn part(text: &str, topics: &[&str]) -> Result<Wanted, CommandError> {
    let wrong = |message: String| Err(CommandError::Arguments(message));
    for (dot, _) in text.rmatch_indices('.') {
        let (glob, field) = (&text[..dot], &text[dot + 1..]);
        let Ok(pattern) = Pattern::over_topics(glob) else {
            continue;
        };
        if !field.is_empty() && topics.iter().any(|topic| pattern.matches(topic)) {
            return Ok(Wanted {
                topics: pattern,
                glob: glob.to_owned(),
                field: field.to_owned(),
            });
        }
    }
    if let Ok(pattern) = Pattern::over_topics(text)
        && topics.iter().any(|topic| pattern.matches(topic))
    {
        return wrong(format!("{text}: the field is missing, as in {text}.x"));
    }
    let start = text.rfind('/').unwrap_or(0);
    let topic = text[start..]
        .find('.')
        .map_or(text, |dot| &text[..start + dot]);
    let hint = did_you_mean(nearest(topic, topics.iter().copied()).as_deref());
    wrong(format!("{text}: the log has no such topic{hint}"))
}
