//! `farside view`: a run as a page for a browser.

use std::path::{Path, PathBuf};

use farside::SimDuration;
use farside_actors::units;
use farside_logs::refuse_input;
use serde_json::json;

use super::kinds::{self, FileKind};
use super::output::{self, Format};
use super::{CommandError, Exit, print, print_json};
use crate::page::{self, Side, Window};
use crate::registry::Registry;

#[derive(clap::Args)]
#[command(after_help = "\
The page is one file and loads nothing: a map, who sent what to whom, what caused what, and what changed over
time. `farside diff A B --html FILE` writes one of two runs.")]
pub(crate) struct Args {
    /// The log; any MCAP file
    #[arg(value_name = "RUN.mcap")]
    log: PathBuf,
    /// Where to write the page; beside the log unless given
    #[arg(long, value_name = "FILE.html")]
    html: Option<PathBuf>,
    /// The beginning of a time span that the page shows; the start of the run unless given
    #[arg(long, value_name = "DUR", value_parser = units::parse_duration)]
    from: Option<SimDuration>,
    /// The end of a time span; the end of the run unless given
    #[arg(long, value_name = "DUR", value_parser = units::parse_duration)]
    at: Option<SimDuration>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

impl Args {
    fn window(&self) -> Result<Window, CommandError> {
        if let (Some(from), Some(at)) = (self.from, self.at)
            && from > at
        {
            let message = format!("--from {from} is behind --at {at}");
            return Err(CommandError::Arguments(message));
        }
        let whole = Window::default();
        Ok(Window {
            from_ns: self.from.map_or(whole.from_ns, SimDuration::as_nanos),
            until_ns: self.at.map_or(whole.until_ns, SimDuration::as_nanos),
        })
    }
}

pub(crate) fn run(args: &Args, registry: &Registry) -> Result<Exit, CommandError> {
    let path = &args.log;
    kinds::expect(FileKind::Log, path, registry)?;
    let out = args.html.clone();
    let out = out.unwrap_or_else(|| path.with_extension("html"));
    let inputs = std::slice::from_ref(path);
    output::spare(inputs, std::slice::from_ref(&out))?;
    let side = page::read(path, args.window()?)?;
    if let Some(from) = args.from.filter(|_| side.is_behind_its_end) {
        let message = format!("--from {from}: the log ends before");
        return Err(CommandError::Arguments(message));
    }
    let text = page::of_run(&side);
    write(&out, &text, inputs)?;
    warn(path, &side);
    let (shown, left_out) = (side.shown, side.left_out);
    if args.json {
        print_json(&json!({
            "out": out.display().to_string(),
            "bytes": text.len(),
            "shown": shown,
            "only_counted": left_out,
            "notes": side.notes().collect::<Vec<_>>(),
        }))?;
    } else {
        let counted = match left_out {
            0 => String::new(),
            more => format!(", {more} more are only counted"),
        };
        let megabytes = text.len() as f64 / 1e6;
        print(format!(
            "{}: {shown} messages and events{counted}; {megabytes:.1} MB",
            out.display()
        ))?;
    }
    Ok(Exit::Done)
}

/// Writes a page, unless something else is there.
pub(super) fn write(out: &Path, text: &str, inputs: &[PathBuf]) -> Result<(), CommandError> {
    refuse_input(out, inputs)?;
    output::write_whole(out, text.as_bytes(), Format::View, inputs)
}

/// Says what a page does not have, though nobody asked to leave it out.
pub(super) fn warn(path: &Path, side: &Side) {
    for warning in &side.warnings {
        tracing::warn!("{}: {warning}", path.display());
    }
}
