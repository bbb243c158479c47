//! `farside why`: what an actor did in a run, whom it waited for, and what of losses, crashes and
//! degradations touched it.

mod escape;
mod figure;
mod story;
#[cfg(test)]
mod tests;
mod text;

use std::path::PathBuf;

use clap::ValueEnum;
use farside::SimDuration;
use farside_actors::units;
use farside_logs::Log;
use serde::Serialize;

use self::escape::Escapes;
use self::story::Story;
use self::text::Told;
use super::kinds::{self, FileKind};
use super::logged::scenario_of;
use super::{CommandError, Exit, output, print, print_json};
use crate::export::{self, FigureFormat};
use crate::registry::Registry;

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  farside why run.mcap rover_07                      what it did, and what it waited for
  farside why run.mcap rover_07 --at 122s --try      and what it would have escaped
  farside why run.mcap rover_07 --out why.svg        the same as a picture")]
pub(crate) struct Args {
    /// The log
    #[arg(value_name = "RUN.mcap")]
    log: PathBuf,
    /// The actor
    #[arg(value_name = "ACTOR")]
    actor: String,
    /// Up to when it is told; the end of the run unless given
    #[arg(long, value_name = "DUR", value_parser = units::parse_duration)]
    at: Option<SimDuration>,
    /// Waits shorter than this stand together in a line; a twentieth of the time that is told unless given
    #[arg(long, value_name = "DUR", value_parser = units::parse_duration)]
    least: Option<SimDuration>,
    /// Run again without each degradation, crash and loss that touched it, and say how it fares then
    #[arg(long = "try")]
    tries: bool,
    /// Write a picture of it, too
    #[arg(long, value_name = "FILE.svg|.pdf|.png")]
    out: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// What `why --json` prints.
#[derive(Serialize)]
struct Document<'a> {
    log: String,
    #[serde(flatten)]
    story: &'a Story,
    outcome: String,
    /// How many messages to it and from it were lost.
    lost: [usize; 2],
    tried: Option<&'a Escapes>,
    out: Option<String>,
}

pub(crate) fn run(args: &Args, registry: &Registry) -> Result<Exit, CommandError> {
    let path = &args.log;
    kinds::expect(FileKind::Log, path, registry)?;
    let inputs = std::slice::from_ref(path);
    let outputs: Vec<PathBuf> = args.out.iter().cloned().collect();
    output::spare(inputs, &outputs)?;
    let log = Log::open(path)?;
    let summary = farside_logs::info(path)?.run.unwrap_or_default();
    let scenario = scenario_of(path, &summary, registry)?;
    let scenario = scenario.named(&summary.scenario);
    let story = Story::read(&log, &scenario, &args.actor, args.at)?;
    let least_ns = args
        .least
        .map_or(story.until_ns / 20, SimDuration::as_nanos);
    let tried = match args.tries {
        true => Some(escape::escapes(
            &story, &log, &scenario, registry, least_ns,
        )?),
        false => None,
    };
    let out = match &args.out {
        Some(out) => {
            let ending = out.extension().and_then(|ending| ending.to_str());
            let kind = ending.and_then(|ending| FigureFormat::from_str(ending, true).ok());
            let kinds = export::kinds(kind.unwrap_or(FigureFormat::Svg), &[])?;
            let figure = figure::figure(&story, &log, least_ns);
            Some(output::write_figure(
                out.clone(),
                &figure,
                kinds[0],
                inputs,
            )?)
        }
        None => None,
    };
    if args.json {
        let for_it = story.losses.iter().filter(|lost| lost.is_for_it).count();
        print_json(&Document {
            log: path.display().to_string(),
            story: &story,
            outcome: story.outcome(),
            lost: [for_it, story.losses.len() - for_it],
            tried: tried.as_ref(),
            out,
        })?;
        return Ok(Exit::Done);
    }
    let story = &story;
    let mut text = Told { story, least_ns }.to_string();
    if let Some(tried) = &tried {
        text.push_str(&tried.to_string());
    }
    if let Some(out) = out {
        text.push_str(&format!("\n{out}\n"));
    }
    print(text.trim_end())?;
    Ok(Exit::Done)
}
