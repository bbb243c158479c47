//! `farside fork`: a logged run again, with something changed from an instant on, and what came of it.

mod degrades;

use std::path::PathBuf;

use farside::ruling::MessageId;
use farside::suggest::{did_you_mean, nearest};
use farside::{End, Report, SimDuration, SimTime, Simulation};
use farside_actors::units;
use farside_logs::{
    DiffOptions, DiffReport, FoundMessage, LogWriter, RunSummary, Verifier, VerifyOutcome, diff,
    find_messages, may_hold_log,
};
use serde::Serialize;
use toml::{Table, Value};

use super::came::{BothCame, Came};
use super::diff::draws;
use super::kinds::{self, FileKind};
use super::logged::scenario_of;
use super::run::{ExecutorName, duration, ending, log_options};
use super::{CommandError, Exit, interrupt, output, print, print_json, progress};
use crate::registry::Registry;
use crate::scenario::Scenario;

#[derive(clap::Args)]
#[command(after_help = "\
A message is called by its sender, its receiver, its kind and its number in that flow, as `diff` prints it.

Examples:
  farside fork run.mcap --at 30s --set 'links.\"node_*-rover_*\".loss=0.3' --out worse.mcap
  farside fork run.mcap --deliver node_03,rover_07,Grant,12 --out mended.mcap
  farside fork run.mcap --at 2min --crash rover_05 --out crashed.mcap")]
pub(crate) struct Args {
    /// The log
    #[arg(value_name = "RUN.mcap")]
    log: PathBuf,
    /// From when on; with messages alone, when the first of them was sent
    #[arg(long, value_name = "DURATION", value_parser = duration, allow_hyphen_values = true)]
    at: Option<SimDuration>,
    /// Set a key of the scenario from then on, as in links.default.loss=0.3; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<String>,
    /// Crash this host, or this actor, then; may be repeated
    #[arg(long = "crash", value_name = "NAME")]
    crashes: Vec<String>,
    /// Deliver this message, whatever its link decides; may be repeated
    #[arg(long = "deliver", value_name = "MESSAGE")]
    deliver: Vec<MessageId>,
    /// Lose this message; may be repeated
    #[arg(long = "lose", value_name = "MESSAGE")]
    lose: Vec<MessageId>,
    /// Deliver this message so much later, as in node_03,rover_07,Grant,12=200ms; may be repeated
    #[arg(long = "delay", value_name = "MESSAGE=DURATION", value_parser = delayed)]
    delay: Vec<(MessageId, SimDuration)>,
    /// Where to write the log of the changed run
    #[arg(long, value_name = "FORK.mcap")]
    out: PathBuf,
    /// Execute on one thread (inline) or on many (kameo), or as pays (auto): the result is the same
    #[arg(long, value_enum, default_value_t = ExecutorName::Auto)]
    executor: ExecutorName,
    /// Threads for kameo; as many as there are cores unless given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Run the log's run again as it was, too, and say in which metrics the two differ
    #[arg(long)]
    metrics: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

fn delayed(text: &str) -> Result<(MessageId, SimDuration), String> {
    let parts = text.rsplit_once('=');
    let (message, by) = parts.ok_or("expected MESSAGE=DURATION, as in a,b,Grant,12=200ms")?;
    let message = message
        .parse::<MessageId>()
        .map_err(|error| error.to_string())?;
    let by = units::parse_duration(by).map_err(|error| error.to_string())?;
    match by.is_zero() {
        true => Err("0s: expected a time over zero".to_owned()),
        false => Ok((message, by)),
    }
}

/// What `fork --json` prints.
#[derive(Serialize)]
struct Document<'a> {
    log: String,
    scenario: &'a str,
    /// From when on something is changed, in seconds.
    at_s: f64,
    /// How many records before that are those of the log.
    same_records: u64,
    fork: String,
    end: &'static str,
    end_detail: String,
    sim_time_s: f64,
    digest: String,
    violations: &'a [String],
    remarks: &'a [String],
    /// What came of the two runs.
    #[serde(skip_serializing_if = "Option::is_none")]
    came: Option<&'a BothCame>,
    diff: &'a DiffReport,
}

pub(crate) fn run(args: &Args, registry: &Registry) -> Result<Exit, CommandError> {
    let path = &args.log;
    kinds::expect(FileKind::Log, path, registry)?;
    output::spare(std::slice::from_ref(path), std::slice::from_ref(&args.out))?;
    let not_repeatable = |reason: String| CommandError::NotRepeatable {
        path: path.clone(),
        reason,
    };
    let info = farside_logs::info(path)?;
    let summary = info
        .run
        .ok_or_else(|| not_repeatable("it is not the log of a Farside run".to_owned()))?;
    let base = scenario_of(path, &summary, registry)?;
    let at = begins(args, &summary)?;
    let (text, sets) = changed(args, &base, at)?;
    let label = "the changed scenario";
    let scenario = Scenario::parse(label, text, &sets, registry, base.files().clone())?;
    let scenario = scenario.named(&summary.scenario);
    may_hold_log(&args.out, std::slice::from_ref(path))?;
    let mut assembled = scenario.assemble()?;
    assembled.sim.tie_seed(summary.tie_seed);
    let executor = args.executor.executor(&assembled.sim, args.threads);
    let verifier = Verifier::open_until(path, SimTime::ZERO + at)?;
    let handle = verifier.handle();
    assembled.sim.observe(verifier);
    let mut options = log_options(&scenario, &assembled, executor, registry)?;
    let draws = scenario.shared().log.viewer;
    options.scene = assembled.system.scene.take().filter(|_| draws);
    assembled
        .sim
        .observe(LogWriter::create(&args.out, options)?);
    let applied = degrades::watch(&mut assembled.sim, scenario.last_degrades(), at);
    progress::show(&mut assembled.sim, assembled.system.goal, scenario.until());
    interrupt::raise_on_interrupt(assembled.sim.interrupt());
    let report = assembled.sim.run(executor)?;
    let same_records = match handle.outcome()? {
        VerifyOutcome::Different { first, .. } => {
            let (time, topic) = (SimDuration::from_nanos(first.time_ns), &first.topic);
            return Err(not_repeatable(format!(
                "its run again differs at {time} on {topic} already, in {}: {} in the log, {} now; a fork \
                 begins where the two are the same{}",
                first.field,
                first.logged,
                first.rerun,
                version_note(&summary, registry),
            )));
        }
        VerifyOutcome::Prefix { records, .. } | VerifyOutcome::Same { records, .. } => records,
    };
    let results = (assembled.system.conclude)(&report);
    let mut remarks = assembled.remarks;
    remarks.extend(assembled.planned.never_reached(&report));
    remarks.extend(scenario.unmet_rulings(&report));
    remarks.extend(applied.idle(report.end_time));
    for remark in &remarks {
        tracing::warn!("{remark}");
    }
    let mut differences = diff(path, &args.out, &DiffOptions::default())?;
    draws::tell(&mut differences, [path, &args.out], registry);
    let came = match args.metrics {
        true => {
            let fork = Came::of(&args.out, &report, &results);
            Some(BothCame::new(Came::again(path, registry)?, fork))
        }
        false => None,
    };
    let document = Document {
        log: path.display().to_string(),
        scenario: scenario.name(),
        at_s: at.as_secs_f64(),
        same_records,
        fork: args.out.display().to_string(),
        end: report.end.name(),
        end_detail: report.end.detail(),
        sim_time_s: report.end_time.as_secs_f64(),
        digest: report.digest.to_string(),
        violations: &results.violations,
        remarks: &remarks,
        came: came.as_ref(),
        diff: &differences,
    };
    if args.json {
        print_json(&document)?;
    } else {
        print(told(&document, at, &report))?;
    }
    Ok(match &report.end {
        End::Fault(_) | End::ObserverFailed(_) | End::Interrupted => Exit::Failed,
        _ if differences.first.is_none() => Exit::Done,
        _ => Exit::Different,
    })
}

fn told(document: &Document<'_>, at: SimDuration, report: &Report) -> String {
    let Document {
        log,
        fork,
        same_records,
        ..
    } = document;
    let mut text = format!(
        "{log}: the same run up to {at}, {same_records} records\n{fork}: {}\n",
        ending(report)
    );
    for violation in document.violations {
        text.push_str(&format!("VIOLATED: {violation}\n"));
    }
    text.push_str(&format!("\n{}", document.diff));
    if let Some(came) = document.came {
        text.push_str(&format!("\n{came}"));
    }
    text
}

fn version_note(summary: &RunSummary, registry: &Registry) -> String {
    let version = registry.version();
    match summary.code_version == version {
        true => String::new(),
        false => format!(
            "; the log is from version {}, this is {version}",
            summary.code_version
        ),
    }
}

/// From when on the run is another, once all that was asked for is found to be possible.
fn begins(args: &Args, summary: &RunSummary) -> Result<SimDuration, CommandError> {
    let wrong = |message: String| Err(CommandError::Arguments(message));
    let delayed = args.delay.iter().map(|(message, _)| message);
    let ids: Vec<MessageId> = args
        .deliver
        .iter()
        .chain(&args.lose)
        .chain(delayed)
        .cloned()
        .collect();
    let nothing = args.sets.is_empty() && args.crashes.is_empty() && ids.is_empty();
    if nothing {
        return wrong(
            "nothing is changed: expected --set, --crash, --deliver, --lose or --delay".to_owned(),
        );
    }
    let mut found = Vec::new();
    for message in find_messages(&args.log, &ids)? {
        found.push(message.map_err(CommandError::Arguments)?);
    }
    let first = found
        .iter()
        .map(|message| message.sent.since(SimTime::ZERO))
        .min();
    let at = match (args.at, first) {
        (Some(at), _) => at,
        (None, Some(first)) if args.sets.is_empty() && args.crashes.is_empty() => first,
        (None, _) => return wrong("--at is missing: from when on is something else?".to_owned()),
    };
    for (id, message) in ids.iter().zip(&found) {
        if message.link.is_none() {
            return wrong(format!(
                "{id}: no link carried it: it stayed within its host"
            ));
        }
        let sent = message.sent.since(SimTime::ZERO);
        if sent < at {
            return wrong(format!(
                "{id} was sent at {sent}, before the fork begins at {at}"
            ));
        }
    }
    let end = summary.end_time_ns.map(SimDuration::from_nanos);
    if let Some(end) = end.filter(|end| at >= *end) {
        return wrong(format!("--at {at}: the run ended at {end}"));
    }
    unchanged(args, &ids, &found)?;
    Ok(at)
}

/// Refuses what the run has done anyway.
fn unchanged(args: &Args, ids: &[MessageId], found: &[FoundMessage]) -> Result<(), CommandError> {
    use farside::record::RecordClass::{Delivered, Lost};
    for (number, (id, message)) in ids.iter().zip(found).enumerate() {
        let is_delivered = number < args.deliver.len();
        let has_already = match message.class {
            Delivered if is_delivered => "arrived",
            Lost if !is_delivered => "was lost",
            _ => continue,
        };
        let at = message.at.since(SimTime::ZERO);
        return Err(CommandError::Arguments(format!(
            "{id} {has_already} anyway, at {at}: nothing would be changed"
        )));
    }
    Ok(())
}

/// The scenario with what is changed, and what is set of it from the start on.
fn changed(
    args: &Args,
    base: &Scenario,
    at: SimDuration,
) -> Result<(String, Vec<String>), CommandError> {
    let mut table = read(&base.resolved()?)?;
    let text = |duration: SimDuration| Value::String(duration.to_string());
    let named = |id: &MessageId| ("message", Value::String(id.to_string()));
    deliver_no_more(args, &mut table)?;
    add(
        &mut table,
        "lose",
        args.lose.iter().map(|id| entry([named(id)])),
    );
    add(
        &mut table,
        "deliver",
        args.deliver.iter().map(|id| entry([named(id)])),
    );
    let delay = args.delay.iter();
    add(
        &mut table,
        "postpone",
        delay.map(|(id, by)| entry([named(id), ("by", text(*by))])),
    );
    let mut sets = args.sets.clone();
    if !args.crashes.is_empty() {
        let assembled = base.assemble()?;
        let mut crashes = read(&base.last_resolved()?)?;
        for name in &args.crashes {
            let crash = crash(&assembled.sim, name)?;
            add(
                &mut crashes,
                "crash",
                [entry([crash, ("at", text(at))])].into_iter(),
            );
        }
        sets.extend(crashes.get("crash").map(|all| format!("crash={all}")));
    }
    if !at.is_zero() && !sets.is_empty() {
        let set = sets.drain(..).map(Value::String).collect();
        let fork = entry([("at", text(at)), ("set", Value::Array(set))]);
        add(&mut table, "fork", [fork].into_iter());
    }
    let written = toml::to_string(&table);
    let written = written.map_err(|error| CommandError::Arguments(error.to_string()))?;
    Ok((written, sets))
}

/// Takes out of a scenario the entries that deliver what is to be lost, whatever they call it: of two entries that
/// contradict each other the one that delivers decides.
fn deliver_no_more(args: &Args, table: &mut Table) -> Result<(), CommandError> {
    let Some(Value::Array(entries)) = table.get_mut("deliver") else {
        return Ok(());
    };
    // Entries that name no message were refused before.
    let id = |entry: &Value| entry.get("message")?.as_str()?.parse().ok();
    entries.retain(|entry| id(entry).is_some());
    let delivered = entries.iter().filter_map(id);
    let ids: Vec<MessageId> = args.lose.iter().cloned().chain(delivered).collect();
    let found = find_messages(&args.log, &ids)?;
    let named = ids.into_iter().zip(found);
    let named = named.map(|(id, found)| {
        let ordinal = found.ok().map(|message| message.ordinal);
        (ordinal, [id.sender, id.receiver, id.kind], id.copy)
    });
    let named: Vec<_> = named.collect();
    let (lost, mut named) = (&named[..args.lose.len()], named[args.lose.len()..].iter());
    entries.retain(|_| {
        let message = named.next();
        !message.is_some_and(|message| message.0.is_some() && lost.contains(message))
    });
    Ok(())
}

fn read(text: &str) -> Result<Table, CommandError> {
    toml::from_str(text).map_err(|error| CommandError::Arguments(error.to_string()))
}

fn entry<const N: usize>(pairs: [(&str, Value); N]) -> Value {
    let pairs = pairs
        .into_iter()
        .map(|(key, value)| (key.to_owned(), value));
    Value::Table(pairs.collect())
}

/// Adds entries to an array of a scenario.
fn add(table: &mut Table, key: &str, entries: impl Iterator<Item = Value>) {
    let mut entries = entries.peekable();
    if entries.peek().is_none() {
        return;
    }
    let array = table.entry(key).or_insert_with(|| Value::Array(Vec::new()));
    if let Value::Array(array) = array {
        array.extend(entries);
    }
}

/// Who crashes: a host with all its actors, or an actor.
fn crash(sim: &Simulation, name: &str) -> Result<(&'static str, Value), CommandError> {
    let value = Value::String(name.to_owned());
    if sim.host_names().any(|host| host == name) {
        return Ok(("host", value));
    }
    if sim.actor_names().any(|actor| actor == name) {
        return Ok(("actor", value));
    }
    let known = sim.host_names().chain(sim.actor_names());
    let hint = did_you_mean(nearest(name, known).as_deref());
    Err(CommandError::Arguments(format!(
        "--crash {name}: no host and no actor is called so{hint}"
    )))
}
