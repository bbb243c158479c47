//! `farside shrink`: what of a failing run it takes to fail.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use farside::{Executor, SimTime};
use farside_actors::units;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;
use toml::Table;

use super::kinds::{self, FileKind};
use super::logged::scenario_of;
use super::output::{self, Format};
use super::{CommandError, Exit, complain, interrupt, print, print_json};
use crate::registry::Registry;
use crate::scenario::{Forbidden, Scenario};
use crate::shrink::{
    BEGINNING, Budget, Left, ShrinkEnd, ShrinkError, ShrinkOptions, Shrunk, Tell, beside, short,
    shrink,
};
use farside_actors::system::Files;

/// Drawings a second; more is unreadable.
const DRAWINGS_HZ: u8 = 10;

#[derive(clap::Args)]
#[command(after_help = "\
NAME is an invariant of the system (as deadlock, collision), `violation` for whatever a run itself calls
wrong, `fault` for a run that fails, or a condition over metrics, as in 'arrived<rovers' or 'lost_goals>0'.

What was tried is kept beside SMALL.toml: started again, the search goes on where it was.

Examples:
  farside shrink run.mcap --violates no_progress --out small.toml
  farside run small.toml                             it stands still again
  farside shrink network/crater-dense --set links.default.loss=60% --violates 'completed=false'
      --budget 5min --out small.toml")]
pub(crate) struct Args {
    /// The log of the failing run, or its scenario: a file or a built-in one
    #[arg(value_name = "RUN.mcap|SCENARIO")]
    input: String,
    /// What must never happen, and does in this run
    #[arg(long, value_name = "NAME")]
    violates: String,
    /// Where to write the small scenario
    #[arg(long, value_name = "SMALL.toml")]
    out: PathBuf,
    /// Set a key of the scenario first; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<String>,
    /// The seed, instead of the scenario's
    #[arg(long, value_name = "N", allow_negative_numbers = true,
        value_parser = clap::value_parser!(u64).range(..=i64::MAX as u64))]
    seed: Option<u64>,
    /// How many runs at once; as many as there are cores unless given. The result is the same
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// Begin no run after so many, as in 500, or after so long, as in 10min: what is found by then counts
    #[arg(long, value_name = "RUNS|DURATION", value_parser = budget)]
    budget: Option<Budget>,
    /// Where what was tried is kept [default: SMALL.toml.tried]
    #[arg(long, value_name = "FILE")]
    state: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

fn budget(text: &str) -> Result<Budget, String> {
    let expected = "expected a number of runs over 0, as in 500, or a duration, as in 10min";
    let budget = match text.parse::<u64>() {
        Ok(runs) => Budget::Runs(runs),
        Err(_) => {
            let duration = units::parse_duration(text);
            Budget::WallS(duration.map_err(|_| expected.to_owned())?.as_secs_f64())
        }
    };
    match budget {
        Budget::Runs(0) => Err(expected.to_owned()),
        Budget::WallS(wall_s) if wall_s <= 0.0 => Err(expected.to_owned()),
        budget => Ok(budget),
    }
}

/// What `shrink --json` prints.
#[derive(Serialize)]
struct Document<'a> {
    scenario: &'a str,
    violates: &'a str,
    out: String,
    /// `minimal`, `budget` or `interrupted`.
    end: ShrinkEnd,
    /// Whether without any single entry it does not happen: all were left out once more.
    is_minimal: bool,
    /// How many entries that are.
    proved_entries: usize,
    violated_at_s: f64,
    left: &'a [Left],
    runs: u64,
    /// How many verdicts were known from an earlier start.
    known: usize,
    state: String,
    remarks: &'a [String],
}

pub(crate) fn run(args: &Args, registry: &Registry) -> Result<Exit, CommandError> {
    let scenario = scenario(args, registry)?;
    let system = registry.find(&scenario.shared().system);
    let system = system.map_err(|unknown| CommandError::Arguments(unknown.expected))?;
    let forbidden = Forbidden::parse(&args.violates, system);
    let forbidden =
        forbidden.map_err(|message| CommandError::Arguments(format!("--violates {message}")))?;
    let state = args.state.clone().unwrap_or_else(|| {
        let mut name = args.out.clone().into_os_string();
        name.push(".tried");
        name.into()
    });
    let files = scenario.assemble()?.files;
    let mut inputs = files.paths();
    inputs.push(PathBuf::from(&args.input));
    let missing = beside(&args.out, &files).map_err(CommandError::Arguments)?;
    let mut outputs: Vec<PathBuf> = missing.iter().map(|(path, _)| path.clone()).collect();
    outputs.extend([args.out.clone(), state.clone()]);
    output::spare(&inputs, &outputs)?;
    output::may_write(&args.out, BEGINNING.as_bytes(), Format::Small, &inputs)?;
    let stop = Arc::new(AtomicBool::new(false));
    interrupt::raise_on_interrupt(stop.clone());
    let progress = Progress::new();
    let cores = || std::thread::available_parallelism().map_or(1, usize::from);
    let options = ShrinkOptions {
        forbidden: &forbidden,
        jobs: args.jobs.map_or_else(cores, usize::from),
        budget: args.budget,
        state: &state,
        interrupt: stop,
        tell: &|tell| progress.tell(tell),
    };
    let small = Small {
        args,
        registry,
        files: &files,
        inputs: &inputs,
    };
    let was_begun = state.exists();
    let mut unwritten = None;
    let shrunk = shrink(&scenario, registry, &options, &mut |table| {
        if let Err(error) = small.write(table, &["not yet searched through".to_owned()]) {
            unwritten.get_or_insert(error);
        }
    });
    progress.clear();
    if let (Err(ShrinkError::Holds { .. }), false) = (&shrunk, was_begun) {
        // Nothing is to be gone on with; that it cannot be removed changes nothing.
        let _ = std::fs::remove_file(&state);
    }
    let shrunk = shrunk?;
    if let Some(error) = unwritten {
        return Err(error);
    }
    small.write(&shrunk.table, &about(&forbidden, &shrunk))?;
    for (path, bytes) in missing {
        put(&path, &bytes)?;
    }
    if shrunk.end != ShrinkEnd::Interrupted {
        small.check(&forbidden)?;
    }
    for remark in &shrunk.remarks {
        tracing::warn!("{remark}");
    }
    let document = Document {
        scenario: scenario.name(),
        violates: forbidden.name(),
        out: args.out.display().to_string(),
        end: shrunk.end,
        is_minimal: shrunk.end == ShrinkEnd::Minimal,
        proved_entries: shrunk.proved,
        violated_at_s: shrunk.violated_at.as_secs_f64(),
        left: &shrunk.left,
        runs: shrunk.runs,
        known: shrunk.known,
        state: state.display().to_string(),
        remarks: &shrunk.remarks,
    };
    match args.json {
        true => print_json(&document)?,
        false => print(told(&document, &shrunk, registry.program()))?,
    }
    Ok(match shrunk.end {
        ShrinkEnd::Interrupted => Exit::Failed,
        ShrinkEnd::Minimal | ShrinkEnd::Budget => Exit::Done,
    })
}

/// The scenario of the failing run.
fn scenario(args: &Args, registry: &Registry) -> Result<Scenario, CommandError> {
    let path = Path::new(&args.input);
    if !kinds::starts_as_log(path) {
        kinds::expect(FileKind::Scenario, path, registry)?;
        let mut scenario = Scenario::open(&args.input, &args.sets, registry)?;
        if let Some(seed) = args.seed {
            scenario.set_seed(seed);
        }
        return Ok(scenario);
    }
    if !args.sets.is_empty() || args.seed.is_some() {
        let message = "--set and --seed are for a scenario: a log's run is as it was";
        return Err(CommandError::Arguments(message.to_owned()));
    }
    let info = farside_logs::info(path)?;
    let summary = info.run.ok_or_else(|| CommandError::NotRepeatable {
        path: path.to_owned(),
        reason: "it is not the log of a Farside run".to_owned(),
    })?;
    let mut scenario = scenario_of(path, &summary, registry)?;
    if let Some(tie_seed) = summary.tie_seed {
        scenario.set_tie_seed(tie_seed);
    }
    Ok(scenario)
}

/// The small scenario's file.
struct Small<'a> {
    args: &'a Args,
    registry: &'a Registry,
    files: &'a Files,
    inputs: &'a [PathBuf],
}

impl Small<'_> {
    /// Writes it, with comments on where it comes from.
    fn write(&self, table: &Table, about: &[String]) -> Result<(), CommandError> {
        let Args {
            input, violates, ..
        } = self.args;
        let (program, version) = (self.registry.program(), self.registry.version());
        // A binary of somebody else's has its name in its version.
        let version = version.strip_prefix(program).unwrap_or(&version).trim();
        let mut text = format!(
            "{BEGINNING}{program} {version}: {program} shrink {input} --violates '{violates}'"
        );
        for set in &self.args.sets {
            text.push_str(&format!(" --set '{set}'"));
        }
        if let Some(seed) = self.args.seed {
            text.push_str(&format!(" --seed {seed}"));
        }
        // Whatever arguments hold, each of these is one line.
        let mut comment = text.replace(char::is_control, " ");
        for line in about {
            comment.push_str(&format!("\n# {}", line.replace(char::is_control, " ")));
        }
        let text = format!("{comment}\n\n{}", short(table, self.registry, self.files));
        output::write_whole(&self.args.out, text.as_bytes(), Format::Small, self.inputs)
    }

    /// That the file as it is written fails as it is to.
    fn check(&self, forbidden: &Forbidden) -> Result<(), CommandError> {
        let name = self.args.out.display().to_string();
        let scenario = Scenario::open(&name, &[], self.registry)?;
        let assembled = scenario.assemble()?;
        let report = assembled.sim.run(Executor::Inline)?;
        let results = (assembled.system.conclude)(&report);
        match forbidden.is_broken(&report, &results) {
            true => Ok(()),
            false => Err(CommandError::Arguments(format!(
                "{name}: written, and {} does not happen when it is run: it ended at {}",
                forbidden.name(),
                report.end_time
            ))),
        }
    }
}

/// Puts a file that the scenario reads beside it.
fn put(path: &Path, bytes: &[u8]) -> Result<(), CommandError> {
    let failed = |source| CommandError::Write {
        path: path.to_owned(),
        source,
    };
    if let Some(folder) = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty())
    {
        std::fs::create_dir_all(folder).map_err(failed)?;
    }
    std::fs::write(path, bytes).map_err(failed)
}

/// What a reader of the file should know.
fn about(forbidden: &Forbidden, shrunk: &Shrunk) -> Vec<String> {
    let (name, at) = (forbidden.name(), shrunk.violated_at.since(SimTime::ZERO));
    let mut about = vec![format!("{name}, known at {at}; {}", minimality(shrunk))];
    about.extend(shrunk.remarks.iter().cloned());
    about
}

fn minimality(shrunk: &Shrunk) -> String {
    match shrunk.end {
        ShrinkEnd::Minimal => format!(
            "without any one of its {} entries it does not happen",
            shrunk.proved
        ),
        ShrinkEnd::Budget => "the search was not over: its budget was spent".to_owned(),
        ShrinkEnd::Interrupted => "the search was not over: it was interrupted".to_owned(),
    }
}

fn told(document: &Document<'_>, shrunk: &Shrunk, program: &str) -> String {
    let Document {
        scenario,
        violates,
        out,
        left,
        runs,
        known,
        state,
        ..
    } = document;
    let at = shrunk.violated_at.since(SimTime::ZERO);
    let mut text = format!("{scenario}: what it takes for {violates}, known at {at}\n\n");
    let width = left.iter().map(|left| left.what.len()).max().unwrap_or(0);
    for Left { what, of, left, .. } in *left {
        text.push_str(&format!("  {what:width$}  {left} of {of}\n"));
    }
    text.push_str(&format!("\n{out}: {}\n", minimality(shrunk)));
    let before = match known {
        0 => String::new(),
        known => format!(", {known} verdicts known before"),
    };
    text.push_str(&format!(
        "{runs} runs{before}; what was tried is in {state}\n"
    ));
    text.push_str(&format!("`{program} run {out}` shows it\n"));
    text
}

/// Shows how the search goes: a line that changes on a terminal, else a line for each step.
struct Progress {
    bar: Option<ProgressBar>,
    runs: AtomicU64,
}

impl Progress {
    fn new() -> Self {
        let is_terminal = std::io::stderr().is_terminal();
        let bar = is_terminal.then(|| {
            let target = ProgressDrawTarget::stderr_with_hz(DRAWINGS_HZ);
            let bar = ProgressBar::with_draw_target(None, target);
            // A template that is a constant is valid, or was never seen working.
            let style =
                ProgressStyle::with_template("{spinner} {pos} runs in {elapsed}, {prefix} {msg}");
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_spinner()));
            bar
        });
        Progress {
            bar,
            runs: AtomicU64::new(0),
        }
    }

    fn tell(&self, tell: Tell) {
        match (tell, &self.bar) {
            (Tell::Ran, bar) => {
                let runs = self.runs.fetch_add(1, Ordering::Relaxed) + 1;
                if let Some(bar) = bar {
                    bar.set_position(runs);
                    bar.tick();
                }
            }
            (Tell::Smaller(left), Some(bar)) => {
                let left = left.iter().filter(|left| left.left > 0);
                let left: Vec<String> = left
                    .map(|left| format!("{} {}", left.left, left.what))
                    .collect();
                bar.set_prefix(format!("{};", left.join(", ")));
            }
            (Tell::Now(what), Some(bar)) => bar.set_message(what),
            (Tell::Now(what), None) => {
                let runs = self.runs.load(Ordering::Relaxed);
                complain(format!("after {runs} runs: {what}"));
            }
            (Tell::Smaller(_), None) => {}
        }
    }

    fn clear(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
