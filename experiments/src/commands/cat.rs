//! `farside cat`: the messages of any MCAP file, as JSON lines or as a table.

use std::io::{BufWriter, Write};
use std::path::PathBuf;

use farside::SimDuration;
use farside_actors::units::parse_duration;
use farside_logs::{AnyMessage, AnyMessages, Value};

use super::kinds::{self, FileKind};
use super::{CommandError, Exit, Printed, output};
use crate::registry::Registry;

/// Columns of a table: messages that make more are no table.
const COLUMNS: usize = 2000;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// The log; any MCAP file will do
    #[arg(value_name = "RUN.mcap")]
    log: PathBuf,
    /// Topics, as globs; all without any
    #[arg(value_name = "TOPIC")]
    topics: Vec<String>,
    /// A table: one row a message, one column a field
    #[arg(long)]
    csv: bool,
    /// Messages from this time on: since the start of a run, or since the first message
    #[arg(long, value_name = "DUR", value_parser = parse_duration)]
    from: Option<SimDuration>,
    /// Messages up to this time
    #[arg(long, value_name = "DUR", value_parser = parse_duration)]
    at: Option<SimDuration>,
}

/// What of a file is wanted.
struct Window {
    /// When the first message of the file was.
    first_ns: Option<u64>,
    from_ns: u64,
    to_ns: u64,
}

impl Window {
    fn new(args: &Args) -> Window {
        Window {
            first_ns: None,
            from_ns: args.from.map_or(0, SimDuration::as_nanos),
            to_ns: args.at.map_or(u64::MAX, SimDuration::as_nanos),
        }
    }

    /// Whether a message is in it. Times of runs count from their start, others from their first message.
    fn holds(&mut self, time_ns: u64) -> bool {
        // Before 1980 no recorder counted from an epoch: these are times since a start.
        const SINCE_START_NS: u64 = 10 * 365 * 86_400 * 1_000_000_000;
        let first_ns = *self.first_ns.get_or_insert(time_ns);
        let start_ns = if first_ns < SINCE_START_NS {
            0
        } else {
            first_ns
        };
        let since_ns = time_ns.saturating_sub(start_ns);
        (self.from_ns..=self.to_ns).contains(&since_ns)
    }
}

pub(crate) fn run(args: &Args, registry: &Registry) -> Result<Exit, CommandError> {
    kinds::expect(FileKind::Log, &args.log, registry)?;
    output::spare(std::slice::from_ref(&args.log), &[])?;
    let mut out = BufWriter::new(Printed);
    match args.csv {
        true => table(args, &mut out)?,
        false => lines(args, &mut out)?,
    }
    out.flush().map_err(CommandError::Output)?;
    Ok(Exit::Done)
}

/// Calls `each` with every message that is wanted.
fn each_message(
    args: &Args,
    mut each: impl FnMut(&AnyMessage<'_>) -> Result<(), CommandError>,
) -> Result<(), CommandError> {
    let mut messages = AnyMessages::open(&args.log, &args.topics)?;
    let mut window = Window::new(args);
    while let Some(message) = messages.next()? {
        if window.holds(message.log_time_ns()) {
            each(&message)?;
        }
    }
    if let Some(cut) = messages.cut() {
        tracing::warn!("{} is {cut}", args.log.display());
    }
    messages.check_topics()?;
    Ok(())
}

/// One object a message. What cannot be read is said in its place.
fn lines(args: &Args, out: &mut impl Write) -> Result<(), CommandError> {
    each_message(args, |message| {
        let topic = Value::from(message.topic());
        let (log, publish) = (message.log_time_ns(), message.publish_time_ns());
        let sequence = message.sequence();
        let written = match message.value() {
            Ok(data) => writeln!(
                out,
                "{{\"topic\":{topic},\"log_time_ns\":{log},\"publish_time_ns\":{publish},\"sequence\":{sequence},\"data\":{data}}}"
            ),
            Err(error) => {
                let (error, bytes) = (error.to_string(), message.data().len());
                let error = Value::from(error.as_str());
                writeln!(
                    out,
                    "{{\"topic\":{topic},\"log_time_ns\":{log},\"publish_time_ns\":{publish},\"sequence\":{sequence},\"error\":{error},\"bytes\":{bytes}}}"
                )
            }
        };
        written.map_err(CommandError::Output)
    })
}

/// A row for each message: the file is read twice, as the first row names all columns.
fn table(args: &Args, out: &mut impl Write) -> Result<(), CommandError> {
    let mut columns: Vec<String> = Vec::new();
    let mut known = std::collections::BTreeMap::new();
    each_message(args, |message| {
        if let Ok(value) = message.value() {
            value.flatten(&mut |path, _| {
                if known.len() < COLUMNS && !known.contains_key(path) {
                    known.insert(path.to_owned(), columns.len());
                    columns.push(path.to_owned());
                }
            });
        }
        Ok(())
    })?;
    if known.len() >= COLUMNS {
        tracing::warn!("the messages have more than {COLUMNS} fields: the rest is left out");
    }
    let mut writer = csv::Writer::from_writer(out);
    let failed = |error: csv::Error| CommandError::Output(std::io::Error::other(error));
    let head = ["topic", "log_time_ns", "publish_time_ns", "sequence"].map(str::to_owned);
    let named = |name: &String| {
        if name.is_empty() {
            "data".to_owned()
        } else {
            name.clone()
        }
    };
    let names = head.into_iter().chain(columns.iter().map(named));
    writer.write_record(names).map_err(failed)?;
    each_message(args, |message| {
        let mut row = vec![String::new(); 4 + columns.len()];
        row[0] = farside_logs::escaped(message.topic());
        row[1] = message.log_time_ns().to_string();
        row[2] = message.publish_time_ns().to_string();
        row[3] = message.sequence().to_string();
        if let Ok(value) = message.value() {
            value.flatten(&mut |path, value| {
                if let Some(at) = known.get(path) {
                    row[4 + at] = match value {
                        Value::Text(text) => farside_logs::escaped(text),
                        Value::Enum { name, .. } => farside_logs::escaped(name),
                        other => other.to_string(),
                    };
                }
            });
        }
        writer.write_record(&row).map_err(failed)
    })?;
    writer.flush().map_err(CommandError::Output)
}
