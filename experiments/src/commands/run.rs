//! `farside run`: run a scenario, log every message, say what came of it.

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::ValueEnum;
use farside::{Counts, End, Executor, Report, SimDuration, Simulation};
use farside_actors::units;
use farside_logs::{Attachment, LogOptions, LogWriter, may_hold_log};
use serde::Serialize;
use serde_json::{Map, Value};

use super::Exit;
use super::logged::{FILE_PREFIX, given};
use super::table::{self, Group};
use super::{CommandError, complain, interrupt, output, print, print_json, progress};
use crate::scenario::{Assembled, Scenario};
use farside_actors::system::Results;

use crate::registry::Registry;
use crate::wall::timed;

/// What is run unless something else is asked for, if it is built in.
pub(crate) const DEFAULT_SCENARIO: &str = "network/crater-dense";

#[derive(clap::Args)]
pub(crate) struct Args {
    /// A built-in scenario (see `farside scenarios`), a TOML file, or a log, whose own scenario is run
    #[arg(default_value = DEFAULT_SCENARIO)]
    scenario: String,
    /// The seed that every random draw derives from, instead of the scenario's
    #[arg(long, value_name = "N", allow_negative_numbers = true,
        value_parser = clap::value_parser!(u64).range(..=i64::MAX as u64))]
    seed: Option<u64>,
    /// Where to write the log
    #[arg(long, value_name = "RUN.mcap", default_value = "run.mcap")]
    out: PathBuf,
    /// Write no log
    #[arg(long, conflicts_with = "out")]
    no_log: bool,
    /// Set a key of the scenario, as in links.default.loss=0.3; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<String>,
    /// Stop at this virtual time, as in 90s
    #[arg(long, value_name = "DURATION", value_parser = duration, allow_hyphen_values = true)]
    until: Option<SimDuration>,
    /// Execute on one thread (inline) or on many (kameo): the result is the same. `auto` takes kameo
    /// where the scenario says that several hosts' handlers take long, as with policy `max-plus`
    #[arg(long, value_enum, default_value_t = ExecutorName::Auto)]
    executor: ExecutorName,
    /// Threads for kameo; as many as there are cores unless given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Shuffle the order of simultaneous events, to see whether a result hangs on it; instead of
    /// the scenario's tie_seed
    #[arg(long, value_name = "N", allow_negative_numbers = true,
        value_parser = clap::value_parser!(u64).range(..=i64::MAX as u64))]
    tie_seed: Option<u64>,
    /// Print the result as one JSON document
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, ValueEnum)]
pub(super) enum ExecutorName {
    Auto,
    Inline,
    Kameo,
}

pub(super) fn duration(text: &str) -> Result<SimDuration, String> {
    units::parse_duration(text).map_err(|error| error.to_string())
}

impl ExecutorName {
    /// The executor for `sim`, with so many threads or as many as there are cores.
    pub(super) fn executor(self, sim: &Simulation, threads: Option<u16>) -> Executor {
        let cores = || std::thread::available_parallelism().map_or(1, usize::from);
        let threads = threads.map_or_else(cores, usize::from);
        match self {
            ExecutorName::Auto => sim.executor_that_pays(threads),
            ExecutorName::Inline => Executor::Inline,
            ExecutorName::Kameo => Executor::Kameo { threads },
        }
    }
}

/// What `run --json` prints.
#[derive(Serialize)]
struct Document<'a> {
    scenario: &'a str,
    seed: u64,
    tie_seed: Option<u64>,
    executor: &'static str,
    threads: usize,
    digest: String,
    end: &'static str,
    end_detail: String,
    sim_time_s: f64,
    wall_s: f64,
    events: u64,
    messages: Messages<'a>,
    metrics: &'a Map<String, Value>,
    violations: &'a [String],
    /// What the scenario says that has no effect, or is called otherwise now.
    remarks: &'a [String],
    /// What is planned for later than the run's end, and was not known to be before the run.
    never_reached: &'a [String],
    log: Option<String>,
}

#[derive(Serialize)]
struct Messages<'a> {
    sent: u64,
    delivered: u64,
    lost: u64,
    duplicated: u64,
    in_flight: u64,
    lost_by_reason: &'a BTreeMap<String, u64>,
}

impl<'a> From<&'a Counts> for Messages<'a> {
    fn from(counts: &'a Counts) -> Self {
        Messages {
            sent: counts.sent,
            delivered: counts.delivered,
            lost: counts.lost,
            duplicated: counts.duplicated,
            in_flight: counts.in_flight,
            lost_by_reason: &counts.lost_by_reason,
        }
    }
}

pub(crate) fn run(args: &Args, registry: &Registry) -> Result<Exit, CommandError> {
    let mut scenario = given(&args.scenario, &args.sets, registry)?;
    if let Some(seed) = args.seed {
        scenario.set_seed(seed);
    }
    if let Some(tie_seed) = args.tie_seed {
        scenario.set_tie_seed(tie_seed);
    }
    if let Some(until) = args.until {
        scenario.set_until(until);
    }
    let mut assembled = scenario.assemble()?;
    let executor = args.executor.executor(&assembled.sim, args.threads);
    tracing::info!(
        "scenario {}, seed {}, executor {executor:?}",
        scenario.name(),
        scenario.shared().seed
    );
    for remark in &assembled.remarks {
        tracing::warn!("{remark}");
    }
    let log = (!args.no_log).then_some(&args.out);
    let mut inputs = assembled.files.paths();
    inputs.push(PathBuf::from(&args.scenario));
    output::spare(&inputs, log.map_or(&[], std::slice::from_ref))?;
    if let Some(path) = log {
        may_hold_log(path, &inputs)?;
        let mut options = log_options(&scenario, &assembled, executor, registry)?;
        let draws = scenario.shared().log.viewer;
        options.scene = assembled.system.scene.take().filter(|_| draws);
        tracing::info!("logging to {}", path.display());
        assembled.sim.observe(LogWriter::create(path, options)?);
    }
    let until = scenario.until();
    progress::show(&mut assembled.sim, assembled.system.goal, until);
    interrupt::raise_on_interrupt(assembled.sim.interrupt());
    let (planned, remarks) = (assembled.planned, assembled.remarks);
    let (report, wall_s) = timed(|| assembled.sim.run(executor));
    let report = report?;
    let results = (assembled.system.conclude)(&report);
    let mut never_reached = planned.never_reached(&report);
    never_reached.extend(scenario.unmet_rulings(&report));
    for never in &never_reached {
        tracing::warn!("{never}");
    }
    let outcome = Outcome {
        scenario: &scenario,
        executor,
        log: log.map(|path| path.display().to_string()),
        report: &report,
        results: &results,
        remarks: &remarks,
        never_reached: &never_reached,
        wall_s,
    };
    // The exit code must tell of a failure even where nobody reads the output.
    let printed = if args.json {
        if outcome.exit() == Exit::Failed {
            let ending = ending(&report);
            // The document says so too; if stderr is gone, that must do.
            complain(format!("error: {ending}"));
        }
        print_json(&outcome.document())
    } else {
        print(outcome.text())
    };
    let exit = outcome.exit();
    match printed {
        Err(error) if exit == Exit::Done => Err(error),
        _ => Ok(exit),
    }
}

fn threads(executor: Executor) -> usize {
    match executor {
        Executor::Inline => 1,
        Executor::Kameo { threads } => threads,
    }
}

pub(super) fn log_options(
    scenario: &Scenario,
    assembled: &Assembled,
    executor: Executor,
    registry: &Registry,
) -> Result<LogOptions, CommandError> {
    let host = [
        ("executor", executor.name().to_owned()),
        ("threads", threads(executor).to_string()),
        ("os", std::env::consts::OS.to_owned()),
        ("arch", std::env::consts::ARCH.to_owned()),
    ];
    let attachments = assembled
        .files
        .all()
        .iter()
        .map(|(name, bytes)| Attachment {
            name: format!("{FILE_PREFIX}{name}"),
            media_type: "application/octet-stream".to_owned(),
            bytes: bytes.clone(),
        });
    Ok(LogOptions {
        scenario: scenario.name().to_owned(),
        resolved: scenario.resolved()?,
        code_version: registry.version(),
        host: host.map(|(key, value)| (key.to_owned(), value)).into(),
        attachments: attachments.collect(),
        exclude: scenario.shared().log.exclude.clone(),
        ..LogOptions::default()
    })
}

/// A finished run, and how to tell of it.
struct Outcome<'a> {
    scenario: &'a Scenario,
    executor: Executor,
    log: Option<String>,
    report: &'a Report,
    results: &'a Results,
    remarks: &'a [String],
    never_reached: &'a [String],
    wall_s: f64,
}

impl Outcome<'_> {
    fn exit(&self) -> Exit {
        match &self.report.end {
            End::Fault(_) | End::ObserverFailed(_) | End::Interrupted => Exit::Failed,
            End::Completed | End::Stopped { .. } if self.results.violations.is_empty() => {
                Exit::Done
            }
            End::Completed | End::Stopped { .. } => Exit::Different,
        }
    }

    fn document(&self) -> Document<'_> {
        Document {
            scenario: self.scenario.name(),
            seed: self.scenario.shared().seed,
            tie_seed: self.scenario.shared().tie_seed,
            executor: self.executor.name(),
            threads: threads(self.executor),
            digest: self.report.digest.to_string(),
            end: self.report.end.name(),
            end_detail: self.report.end.detail(),
            sim_time_s: self.report.end_time.as_secs_f64(),
            wall_s: self.wall_s,
            events: self.report.counts.events,
            messages: (&self.report.counts).into(),
            metrics: &self.results.metrics,
            violations: &self.results.violations,
            remarks: self.remarks,
            never_reached: self.never_reached,
            log: self.log.clone(),
        }
    }

    fn text(&self) -> String {
        let seed = self.scenario.shared().seed;
        let mut text = format!(
            "{}, seed {seed}: {}\n\n",
            self.scenario.name(),
            ending(self.report)
        );
        let mut groups = vec![
            Group {
                title: "team",
                lines: self.results.summary.clone(),
            },
            table::messages(&self.report.counts),
            table::clock(self.report, self.wall_s),
        ];
        let mut lines = vec![("digest".to_owned(), self.report.digest.to_string())];
        let log = self.log.clone();
        lines.push(("log".to_owned(), log.unwrap_or_else(|| "none".to_owned())));
        groups.push(Group {
            title: "record",
            lines,
        });
        text.push_str(&table::table(&groups));
        for violation in &self.results.violations {
            text.push_str(&format!("\nVIOLATED: {violation}\n"));
        }
        text
    }
}

/// How the run ended, in a sentence.
pub(super) fn ending(report: &Report) -> String {
    let at = report.end_time;
    match &report.end {
        End::Completed => format!("completed at {at}, nothing was left to happen"),
        End::Stopped { by, reason } if by.starts_with('@') => format!("stopped at {at}: {reason}"),
        End::Stopped { by, reason } => format!("stopped at {at} by {by}: {reason}"),
        End::Interrupted => format!("interrupted at {at}; what is recorded ends there"),
        End::Fault(fault) => format!("FAILED at {at}: {fault}"),
        End::ObserverFailed(error) => {
            format!("FAILED at {at}: it can no longer be recorded: {error}")
        }
    }
}
