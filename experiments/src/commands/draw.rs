//! `farside draw`: pictures of a run, from its log.

use std::path::PathBuf;

use farside::SimDuration;
use farside_actors::units;
use farside_logs::Log;
use farside_worlds::VertexId;
use serde::Serialize;

use super::verify::scenario_of;
use super::{CommandError, print, print_json};
use crate::cli::Exit;
use crate::picture::tracks::Tracks;
use crate::picture::{Drawn, Line, PictureError};
use crate::report::Figure;
use crate::system::Registry;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// The log
    #[arg(value_name = "RUN.mcap")]
    log: PathBuf,
    /// The time of the map, or the end of the diagram; the end of the run unless given
    #[arg(long, value_name = "DUR", value_parser = units::parse_duration)]
    at: Option<SimDuration>,
    /// Draw who was where along a line of vertices over time, in place of a map: auto is where rovers
    /// stand in each other's way, V the corridor of a vertex, V1,V2,... the shortest ways between them
    #[arg(long, value_name = "auto|V1,V2,...", value_parser = line)]
    corridor: Option<Line>,
    /// When the diagram begins
    #[arg(long, value_name = "DUR", value_parser = units::parse_duration, requires = "corridor")]
    from: Option<SimDuration>,
    /// Where to write the picture; beside the log unless given
    #[arg(long, value_name = "FILE.svg")]
    out: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// What `draw --json` prints.
#[derive(Serialize)]
struct Document<'a> {
    out: String,
    title: &'a str,
    description: &'a str,
}

fn line(text: &str) -> Result<Line, String> {
    if text == "auto" {
        return Ok(Line::Auto);
    }
    let vertex = |part: &str| {
        let number = part.trim().parse::<u32>().map(VertexId);
        number.map_err(|_| format!("{part:?}: expected auto, or vertices as in 12,40"))
    };
    text.split(',')
        .map(vertex)
        .collect::<Result<_, _>>()
        .map(Line::Through)
}

pub(crate) fn run(args: &Args, registry: &Registry) -> Result<Exit, CommandError> {
    let drawn = open(args, registry)?;
    let figure = match &args.corridor {
        None => drawn.map(args.at),
        Some(line) => drawn.time_space(line, args.from, args.at),
    };
    let figure: Figure = figure.map_err(|error| picture_error(args, error))?;
    let out = args.out.clone().unwrap_or_else(|| {
        let stem = args
            .log
            .file_stem()
            .map(|stem| stem.to_string_lossy().into_owned());
        let name = format!("{}-{}", stem.unwrap_or_default(), figure.file);
        args.log.with_file_name(name)
    });
    std::fs::write(&out, figure.standalone()).map_err(|source| CommandError::Write {
        path: out.clone(),
        source,
    })?;
    let out = out.display();
    if args.json {
        print_json(&Document {
            out: out.to_string(),
            title: &figure.title,
            description: &figure.description,
        })?;
    } else {
        print(format!("{out}: {}\n  {}", figure.title, figure.description))?;
    }
    Ok(Exit::Done)
}

/// The run that the log holds, as pictures need it.
fn open(args: &Args, registry: &Registry) -> Result<Drawn, CommandError> {
    let path = &args.log;
    let log = Log::open(path)?;
    let summary = farside_logs::info(path)?.run.unwrap_or_default();
    let scenario = scenario_of(path, &summary, registry)?;
    let not_drawn = |reason: String| CommandError::NotDrawn {
        path: path.clone(),
        reason,
    };
    let site = scenario.site(log.seed())?.ok_or_else(|| {
        let system = &scenario.shared().system;
        not_drawn(format!(
            "its system is {system:?}, which has no roadmap: expected a run of \"network\""
        ))
    })?;
    let tracks = Tracks::read(&log).map_err(|error| picture_error(args, error))?;
    Ok(Drawn {
        site,
        tracks,
        scenario: log.scenario_name().to_owned(),
        seed: log.seed(),
    })
}

fn picture_error(args: &Args, error: PictureError) -> CommandError {
    match error {
        // It names the file itself.
        PictureError::Log(error) => error.into(),
        error => CommandError::NotDrawn {
            path: args.log.clone(),
            reason: error.to_string(),
        },
    }
}
