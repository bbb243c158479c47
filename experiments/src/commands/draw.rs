//! `farside draw`: pictures of a run, from its log. Which there are is for the scenario's system to
//! say. Of any run: who sent what to whom, as text that other programs draw (`charts`).

mod charts;

use std::path::PathBuf;

use clap::ValueEnum;
use farside::SimDuration;
use farside::ruling::MessageId;
use farside::suggest::{did_you_mean, nearest};
use farside_actors::figure::Figure;
use farside_actors::system::{PictureError, PictureInfo, PictureOption, PictureRequest};
use farside_actors::units;
use farside_logs::Log;
use serde::Serialize;
use serde_json::json;

use super::Exit;
use super::kinds;
use super::logged::scenario_of;
use super::output;
use super::{CommandError, print, print_json};
use crate::export::{self, FigureFormat};
use crate::recorded::Logged;
use crate::registry::Registry;
use crate::scenario::Scenario;
use crate::sequence::{Actors, Language};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// The log
    #[arg(value_name = "RUN.mcap")]
    log: PathBuf,
    /// The picture, as --list has it; its first unless given
    #[arg(value_name = "PICTURE")]
    picture: Option<String>,
    /// List the pictures that there are of this run, and what each takes
    #[arg(long, conflicts_with_all = ["picture", "at", "from", "along", "with", "out", "format"])]
    list: bool,
    /// The instant, or the end of a time span; the end of the run unless given
    #[arg(long, value_name = "DUR", value_parser = units::parse_duration)]
    at: Option<SimDuration>,
    /// The beginning of a time span; the start of the run unless given
    #[arg(long, value_name = "DUR", value_parser = units::parse_duration)]
    from: Option<SimDuration>,
    /// Along what it is drawn, as --list says
    #[arg(long, value_name = "WHAT")]
    along: Option<String>,
    /// What it shows besides, as --list says
    #[arg(long, value_name = "WHAT", value_delimiter = ',')]
    with: Vec<String>,
    /// Instead of a picture who sent what to whom from --from to --at, as text for Mermaid or PlantUML
    #[arg(long, value_name = "LANGUAGE", value_enum, conflicts_with_all = ["picture", "list", "along", "with", "format"])]
    sequence: Option<Language>,
    /// Instead of a picture which event caused which, as text for Graphviz (dot)
    #[arg(long, conflicts_with_all = ["picture", "list", "sequence", "along", "with", "format"])]
    causes: bool,
    /// With --sequence or --causes: only what these actors send or receive, as a glob; may be repeated
    #[arg(long = "actor", value_name = "GLOB", conflicts_with_all = ["picture", "list"])]
    actors: Vec<Actors>,
    /// With --sequence or --causes: only what led to this message, called as `diff` prints it
    #[arg(long = "of", value_name = "MESSAGE", conflicts_with_all = ["picture", "list", "from", "at"])]
    of: Option<MessageId>,
    /// Where to write the picture; beside the log unless given. It is SVG, or what the ending says
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

/// What `draw --json` prints.
#[derive(Serialize)]
struct Document<'a> {
    out: String,
    /// All that were written, `out` first.
    files: Vec<String>,
    title: &'a str,
    description: &'a str,
}

/// The pictures of all systems, each name once.
fn all_pictures(registry: &Registry) -> Vec<PictureInfo> {
    let mut all: Vec<PictureInfo> = registry
        .systems()
        .flat_map(|system| system.pictures().iter().copied())
        .collect();
    all.sort_by_key(|picture| picture.name);
    all.dedup_by_key(|picture| picture.name);
    all
}

/// The command with each picture's name as an option too: `--corridor 12,40` is `corridor --along
/// 12,40`.
pub(crate) fn with_pictures(command: clap::Command, registry: &Registry) -> clap::Command {
    all_pictures(registry)
        .into_iter()
        .fold(command, |command, picture| {
            let option = clap::Arg::new(picture.name)
                .long(picture.name)
                .help(format!("The picture {}: {}", picture.name, picture.about))
                .conflicts_with_all(["picture", "list", "sequence", "causes", "actors", "of"])
                .help_heading("Pictures");
            command.arg(match picture.takes.contains(&PictureOption::Along) {
                true => option
                    .value_name("WHAT")
                    .num_args(0..=1)
                    .default_missing_value("")
                    .conflicts_with("along"),
                false => option.action(clap::ArgAction::SetTrue),
            })
        })
}

impl Args {
    /// Takes over a picture that was named as an option, with what it is drawn along.
    pub(crate) fn name_picture(&mut self, given: &clap::ArgMatches, registry: &Registry) {
        let typed =
            |name: &str| given.value_source(name) == Some(clap::parser::ValueSource::CommandLine);
        let named = all_pictures(registry);
        let Some(picture) = named.iter().find(|picture| typed(picture.name)) else {
            return;
        };
        self.picture = Some(picture.name.to_owned());
        if picture.takes.contains(&PictureOption::Along) {
            let along = given.get_one::<String>(picture.name);
            self.along = along.filter(|along| !along.is_empty()).cloned();
        }
    }
}

pub(crate) fn run(args: &Args, registry: &Registry) -> Result<Exit, CommandError> {
    let by_ending = |out: &PathBuf| {
        let ending = out.extension()?.to_str()?;
        FigureFormat::from_str(ending, true).ok()
    };
    let first = args.out.as_ref().and_then(by_ending);
    let kinds = export::kinds(first.unwrap_or(FigureFormat::Svg), &args.format)?;
    let path = &args.log;
    kinds::expect(kinds::FileKind::Log, path, registry)?;
    let log = Log::open(path)?;
    if charts::are_asked_for(args)? {
        return charts::run(args, &log);
    }
    let summary = farside_logs::info(path)?.run.unwrap_or_default();
    let scenario = scenario_of(path, &summary, registry)?;
    // A scenario is read only if its system is known.
    let name = &scenario.shared().system;
    let pictures = registry.find(name).map(|system| system.pictures());
    let pictures = pictures.unwrap_or_default();
    if args.list {
        output::spare(std::slice::from_ref(path), &[])?;
        return list(args, pictures);
    }
    let figure = draw(args, &log, &scenario, pictures).map_err(|error| CommandError::NotDrawn {
        path: path.clone(),
        reason: error.to_string(),
    })?;
    write(args, &figure, &kinds)
}

/// Writes the first kind where it is to be, and the others beside it.
fn write(args: &Args, figure: &Figure, kinds: &[FigureFormat]) -> Result<Exit, CommandError> {
    let out = args.out.clone().unwrap_or_else(|| {
        let stem = args
            .log
            .file_stem()
            .map(|stem| stem.to_string_lossy().into_owned());
        let name = format!("{}-{}", stem.unwrap_or_default(), figure.file);
        args.log.with_file_name(name)
    });
    let inputs = std::slice::from_ref(&args.log);
    let path = |(index, kind): (usize, &FigureFormat)| match index {
        0 => out.clone(),
        _ => out.with_extension(kind.ending()),
    };
    let paths: Vec<PathBuf> = kinds.iter().enumerate().map(path).collect();
    output::spare(inputs, &paths)?;
    let mut files = Vec::new();
    for (path, kind) in paths.into_iter().zip(kinds) {
        files.push(output::write_figure(path, figure, *kind, inputs)?);
    }
    if args.json {
        print_json(&Document {
            out: files[0].clone(),
            files,
            title: &figure.title,
            description: &figure.description,
        })?;
    } else {
        let files = files.join(", ");
        print(format!(
            "{files}: {}\n  {}",
            figure.title, figure.description
        ))?;
    }
    Ok(Exit::Done)
}

/// The names of a picture's options, as on the command line.
fn options(picture: &PictureInfo) -> Vec<String> {
    let takes = picture.takes.iter();
    takes.map(|option| format!("--{}", option.name())).collect()
}

fn list(args: &Args, pictures: &[PictureInfo]) -> Result<Exit, CommandError> {
    if args.json {
        let extra = |(name, about): &(&str, &str)| json!({ "name": name, "about": about });
        let entry = |picture: &PictureInfo| {
            let extras: Vec<_> = picture.extras.iter().map(extra).collect();
            json!({
                "name": picture.name,
                "about": picture.about,
                "takes": options(picture),
                "extras": extras,
            })
        };
        print_json(&pictures.iter().map(entry).collect::<Vec<_>>())?;
        return Ok(Exit::Done);
    }
    if pictures.is_empty() {
        print("its system has no pictures".to_owned())?;
        return Ok(Exit::Done);
    }
    let width = pictures.iter().map(|picture| picture.name.len()).max();
    let width = width.unwrap_or(0);
    let line = |picture: &PictureInfo| {
        let takes = match picture.takes {
            [] => String::new(),
            _ => format!("\n{:width$}  takes {}", "", options(picture).join(", ")),
        };
        let extra =
            |(name, about): &(&str, &str)| format!("\n{:width$}  --with {name}: {about}", "");
        let extras: String = picture.extras.iter().map(extra).collect();
        format!("{:width$}  {}{takes}{extras}", picture.name, picture.about)
    };
    print(pictures.iter().map(line).collect::<Vec<_>>().join("\n"))?;
    Ok(Exit::Done)
}

/// Draws what is asked for, if the picture takes it.
fn draw(
    args: &Args,
    log: &Log,
    scenario: &Scenario,
    pictures: &[PictureInfo],
) -> Result<Figure, PictureError> {
    let Some(first) = pictures.first() else {
        let system = &scenario.shared().system;
        let message = format!("its system {system:?} has no pictures");
        return Err(PictureError::NotDrawn(message));
    };
    let names = || pictures.iter().map(|picture| picture.name);
    let picture = match &args.picture {
        None => first,
        Some(wanted) => pictures
            .iter()
            .find(|picture| picture.name == wanted)
            .ok_or_else(|| {
                let hint = did_you_mean(nearest(wanted, names()).as_deref());
                let known = names().collect::<Vec<_>>().join(", ");
                PictureError::NotDrawn(format!(
                    "there is no picture {wanted:?}{hint}; expected one of {known}"
                ))
            })?,
    };
    let given = [
        (PictureOption::At, args.at.is_some()),
        (PictureOption::From, args.from.is_some()),
        (PictureOption::Along, args.along.is_some()),
        (PictureOption::With, !args.with.is_empty()),
    ];
    for (option, given) in given {
        if given && !picture.takes.contains(&option) {
            let takes = options(picture).join(", ");
            return Err(PictureError::NotDrawn(format!(
                "the picture {:?} does not take --{}: it takes {takes}",
                picture.name,
                option.name()
            )));
        }
    }
    let extras = || picture.extras.iter().map(|(name, _)| *name);
    if let Some(wanted) = args
        .with
        .iter()
        .find(|wanted| !extras().any(|name| name == *wanted))
    {
        let hint = did_you_mean(nearest(wanted, extras()).as_deref());
        let known = extras().collect::<Vec<_>>().join(", ");
        return Err(PictureError::NotDrawn(format!(
            "--with {wanted:?}: the picture {:?} has no such extra{hint}; expected {known}",
            picture.name
        )));
    }
    let request = PictureRequest {
        at: args.at,
        from: args.from,
        along: args.along.clone(),
        with: args.with.clone(),
    };
    let seeds = scenario.seeds_of(log.seed(), None);
    scenario.draw(picture.name, &Logged { log, seeds }, &request)
}
