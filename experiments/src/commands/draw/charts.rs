//! Charts of messages and causes, which are texts that other programs draw.

use std::collections::BTreeSet;
use std::path::PathBuf;

use farside::suggest::{did_you_mean, nearest};
use farside_logs::{Log, causes};
use serde_json::json;

use super::Args;
use crate::commands::output::{self, Format};
use crate::commands::{CommandError, Exit, print, print_json};
use crate::sequence::{self, Chart, Language, Part, Selected};

/// As many causes as are drawn of a message.
const CAUSES: usize = 200;

/// Whether a chart is asked for, and not a picture.
///
/// # Errors
/// If something is asked for that only charts have.
pub(super) fn are_asked_for(args: &Args) -> Result<bool, CommandError> {
    if args.sequence.is_some() || args.causes {
        return Ok(true);
    }
    let of_charts = match (&args.of, args.actors.is_empty()) {
        (Some(_), _) => "--of",
        (None, false) => "--actor",
        (None, true) => return Ok(false),
    };
    Err(CommandError::Arguments(format!(
        "{of_charts} is for --sequence and --causes: pictures do not take it"
    )))
}

/// Writes the chart.
pub(super) fn run(args: &Args, log: &Log) -> Result<Exit, CommandError> {
    let selected = select(args, log)?;
    let title = title(args, log);
    let (text, told, format, ending) = match args.sequence {
        Some(language) => {
            let chart = Chart::new(title, selected);
            let (format, ending) = match language {
                Language::Mermaid => (Format::Mermaid, "sequence.mmd"),
                Language::Plantuml => (Format::Plantuml, "sequence.puml"),
            };
            (chart.written(language), chart.told(), format, ending)
        }
        None => {
            let graph = sequence::graph(&title, selected);
            (graph.text, graph.told, Format::Dot, "causes.dot")
        }
    };
    let out = args.out.clone().unwrap_or_else(|| {
        let stem = args.log.file_stem().unwrap_or_default();
        let name = format!("{}-{ending}", stem.to_string_lossy());
        args.log.with_file_name(name)
    });
    let inputs = std::slice::from_ref(&args.log);
    output::spare(inputs, std::slice::from_ref(&out))?;
    let out = output::write(PathBuf::from(&out), &text, format, inputs)?;
    match args.json {
        true => print_json(&json!({ "out": out, "description": told }))?,
        false => print(format!("{out}: {told}"))?,
    }
    Ok(Exit::Done)
}

fn select(args: &Args, log: &Log) -> Result<Selected, CommandError> {
    if let Some(id) = &args.of {
        let chain = causes(&args.log, id, CAUSES)?.map_err(CommandError::Arguments)?;
        let selected = sequence::chain(chain);
        return Ok(selected.of(&args.actors));
    }
    let wrong = |message: String| Err(CommandError::Arguments(message));
    if let (Some(from), Some(at)) = (args.from, args.at)
        && from > at
    {
        return wrong(format!("--from {from} is behind --at {at}"));
    }
    let part = Part {
        from: args.from,
        until: args.at,
        actors: args.actors.clone(),
    };
    let selected = sequence::select(log, &part)?;
    if let Some(unknown) = selected.unknown(&args.actors) {
        let names = log_names(log)?;
        let hint = did_you_mean(
            nearest(&unknown.to_string(), names.iter().map(String::as_str)).as_deref(),
        );
        return wrong(format!(
            "--actor {unknown}: nobody who is called so sends or receives anything in this time{hint}"
        ));
    }
    Ok(selected)
}

/// Who sends or receives anything in a log.
fn log_names(log: &Log) -> Result<BTreeSet<String>, CommandError> {
    let mut names = BTreeSet::new();
    let mut records = log.records()?;
    while let Some((record, _)) = records.next_ref()? {
        for name in [record.sender, record.receiver] {
            if record.class.is_fate() && !names.contains(name) {
                names.insert(name.to_owned());
            }
        }
    }
    Ok(names)
}

fn title(args: &Args, log: &Log) -> String {
    let mut title = format!("{} with seed {}", log.scenario_name(), log.seed());
    match (&args.of, args.from, args.at) {
        (Some(id), ..) => title.push_str(&format!(": what led to {id}")),
        (None, Some(from), Some(at)) => title.push_str(&format!(", {from} to {at}")),
        (None, Some(from), None) => title.push_str(&format!(", from {from} on")),
        (None, None, Some(at)) => title.push_str(&format!(", up to {at}")),
        (None, None, None) => {}
    }
    title
}
