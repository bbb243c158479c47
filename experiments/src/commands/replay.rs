//! `farside replay`: some actors of a logged run live again, and all else comes from the log.

use std::path::{Path, PathBuf};

use farside::replay::Replay;
use farside::suggest::{did_you_mean, nearest};
use farside::{Executor, Pattern, SimDuration, Simulation};
use farside_logs::{
    Log, ReplayOutcome, ReplayedOutput, ReplayedStep, RunSummary, Verifier, VerifyOutcome, again,
    charges_in, filtered_inputs,
};
use serde::Serialize;

use super::kinds::{self, FileKind};
use super::logged::scenario_in;
use super::{CommandError, Exit, interrupt, output, print, print_json, progress};
use crate::registry::Registry;
use crate::scenario::{Assembled, Scenario, check_replay};

#[derive(clap::Args)]
#[command(after_help = "\
What others send to the actors, what they are told, and when they crash and restart is as recorded, in the order
that is recorded. What the actors send, change, record and stop is compared; nothing of it goes anywhere.

Examples:
  farside replay run.mcap --actor node_03
  farside replay run.mcap --actor 'node_*' --set network.max_plus.noise=0.2
  farside replay run.mcap --actor rover_05 --json")]
pub(crate) struct Args {
    /// The log
    #[arg(value_name = "RUN.mcap")]
    log: PathBuf,
    /// Which actors live, as a glob over names; may be repeated
    #[arg(long = "actor", value_name = "GLOB", required = true)]
    actors: Vec<String>,
    /// Set a key of the scenario for these actors, as in network.max_plus.noise=0.2; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<String>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// What `replay --json` prints.
#[derive(Serialize)]
struct Document<'a> {
    log: String,
    scenario: &'a str,
    /// The actors that lived.
    actors: &'a [String],
    /// Why the whole run was executed again for it; empty if the log did.
    run_again_for: &'a [String],
    identical: bool,
    #[serde(flatten)]
    outcome: &'a ReplayOutcome,
    notes: &'a [String],
}

/// A log, and what is to be replayed of it.
struct Job<'a> {
    path: &'a Path,
    log: Log,
    summary: RunSummary,
    base: Scenario,
    /// The scenario that the living actors are built of.
    changed: Option<Scenario>,
    patterns: Vec<Pattern>,
}

pub(crate) fn run(args: &Args, registry: &Registry) -> Result<Exit, CommandError> {
    let path = &args.log;
    kinds::expect(FileKind::Log, path, registry)?;
    output::spare(std::slice::from_ref(path), &[])?;
    // What the log says at its start: to read all of it for its summary would double the work.
    let log = Log::open(path)?;
    let summary = RunSummary {
        code_version: log.code_version().to_owned(),
        seed: log.seed(),
        tie_seed: log.tie_seed(),
        scenario: log.scenario_name().to_owned(),
        exclude: log.exclude().to_vec(),
        ..RunSummary::default()
    };
    let base = scenario_in(&log, &summary, registry)?;
    let changed = changed(args, &base, registry)?;
    let job = Job {
        path,
        log,
        patterns: patterns(&args.actors)?,
        summary,
        base,
        changed,
    };
    let sim = job.assembled(&job.base)?.sim;
    let actors = job.actors(&args.actors, &sim)?;
    let (outcome, run_again_for) = job.replayed(sim)?;
    let mut notes = super::logged::notes(&job.summary, registry);
    notes.retain(|note| note.starts_with("the log is from version"));
    if let Some(missing) = &outcome.missing_record {
        let until = SimDuration::from_nanos(outcome.until_ns);
        notes.push(format!("{missing}; replayed as far as it goes, to {until}"));
    }
    if !outcome.not_compared.is_empty() {
        let kinds = outcome.not_compared.join(", ");
        notes.push(format!("not in the log, and not compared: {kinds}"));
    }
    if let Some(at) = outcome.first_differing_instant_s {
        notes.push(format!(
            "{} events of the actors, {} recorded; another number at {} instants, first at {at} s",
            outcome.steps, outcome.recorded_steps, outcome.differing_instants
        ));
    }
    let identical = outcome.differing() == 0;
    if args.json {
        print_json(&Document {
            log: path.display().to_string(),
            scenario: &job.summary.scenario,
            actors: &actors,
            run_again_for: &run_again_for,
            identical,
            outcome: &outcome,
            notes: &notes,
        })?;
    } else {
        print(text(path, &actors, &run_again_for, &outcome, &notes))?;
    }
    Ok(match identical {
        true => Exit::Done,
        false => Exit::Different,
    })
}

fn patterns(globs: &[String]) -> Result<Vec<Pattern>, CommandError> {
    let read = |glob: &String| {
        Pattern::over_names(glob)
            .map_err(|error| CommandError::Arguments(format!("--actor {glob}: {error}")))
    };
    globs.iter().map(read).collect()
}

/// The scenario with what is set for the living actors; none if nothing is.
fn changed(
    args: &Args,
    base: &Scenario,
    registry: &Registry,
) -> Result<Option<Scenario>, CommandError> {
    if args.sets.is_empty() {
        return Ok(None);
    }
    let text = base.resolved()?;
    let files = base.files().clone();
    let changed = Scenario::parse("the changed scenario", text, &args.sets, registry, files)?;
    check_replay(base, &changed)
        .map_err(|reason| CommandError::Arguments(format!("--set {reason}")))?;
    Ok(Some(changed.named(base.name())))
}

impl Job<'_> {
    fn is_live(&self, name: &str) -> bool {
        self.patterns.iter().any(|pattern| pattern.matches(name))
    }

    fn assembled(&self, scenario: &Scenario) -> Result<Assembled, CommandError> {
        let mut assembled = scenario.assemble()?;
        assembled.sim.tie_seed(self.summary.tie_seed);
        Ok(assembled)
    }

    /// The actors that live. Each pattern picks at least one.
    fn actors(&self, globs: &[String], sim: &Simulation) -> Result<Vec<String>, CommandError> {
        for (glob, pattern) in globs.iter().zip(&self.patterns) {
            if !sim.actor_names().any(|name| pattern.matches(name)) {
                let hint = did_you_mean(nearest(glob, sim.actor_names()).as_deref());
                return Err(CommandError::Arguments(format!(
                    "--actor {glob}: no actor of the run is called so{hint}"
                )));
            }
        }
        if let Some(changed) = &self.changed {
            let other = self.assembled(changed)?.sim;
            sim.check_team(&other)
                .map_err(|error| CommandError::Arguments(format!("--set: {error}")))?;
        }
        let names = sim.actor_names().filter(|name| self.is_live(name));
        Ok(names.map(str::to_owned).collect())
    }

    /// A replay of the living actors; `base`, if it is given, is the scenario of the log, assembled.
    fn replay(&self, base: Option<Simulation>) -> Result<Replay, CommandError> {
        let sim = match (&self.changed, base) {
            (None, Some(base)) => base,
            (None, None) => self.assembled(&self.base)?.sim,
            (Some(changed), _) => self.assembled(changed)?.sim,
        };
        Ok(Replay::new(sim, |name| self.is_live(name))?)
    }

    /// What came of it, and why the run was executed again for it.
    fn replayed(&self, base: Simulation) -> Result<(ReplayOutcome, Vec<String>), CommandError> {
        let log = &self.log;
        let replay = self.replay(Some(base))?;
        let filtered = filtered_inputs(log, &replay)?;
        if !filtered.is_empty() {
            let why = format!("inputs that are not in the log: {}", filtered.join(", "));
            return Ok((self.again(replay)?, vec![why]));
        }
        let outcome = farside_logs::replay(log, replay, &[])?;
        if !outcome.needs_charges {
            return Ok((outcome, Vec::new()));
        }
        let replay = self.replay(None)?;
        match charges_in(log, &replay)? {
            Some(charges) => Ok((farside_logs::replay(log, replay, &charges)?, Vec::new())),
            None => {
                let why = "what links charged, attempt by attempt: the log has sums".to_owned();
                Ok((self.again(replay)?, vec![why]))
            }
        }
    }

    /// The replay beside the run executed again, which is compared with the log meanwhile.
    fn again(&self, replay: Replay) -> Result<ReplayOutcome, CommandError> {
        let not_repeatable = |reason: String| CommandError::NotRepeatable {
            path: self.path.to_owned(),
            reason,
        };
        let mut assembled = self.assembled(&self.base)?;
        let verifier = Verifier::open(self.path)?;
        let handle = verifier.handle();
        assembled.sim.observe(verifier);
        let again = again(&mut assembled.sim, replay);
        let (goal, until) = (assembled.system.goal, self.base.until());
        progress::show(&mut assembled.sim, goal, until);
        interrupt::raise_on_interrupt(assembled.sim.interrupt());
        assembled.sim.run(Executor::Inline)?;
        let mut outcome = again.outcome().map_err(&not_repeatable)?;
        match handle.outcome()? {
            VerifyOutcome::Same { .. } => {}
            VerifyOutcome::Prefix { missing, .. } => outcome.missing_record = Some(missing),
            VerifyOutcome::Different { first, .. } => {
                let (at, topic) = (SimDuration::from_nanos(first.time_ns), &first.topic);
                return Err(not_repeatable(format!(
                    "its run again differs at {at} on {topic}, in {}: {} in the log, {} now; what the log \
                     does not hold is not to be had so",
                    first.field, first.logged, first.rerun
                )));
            }
        }
        Ok(outcome)
    }
}

fn text(
    path: &Path,
    actors: &[String],
    run_again_for: &[String],
    outcome: &ReplayOutcome,
    notes: &[String],
) -> String {
    const NAMED: usize = 6;
    let who = match actors {
        few if few.len() <= NAMED => few.join(", "),
        many => format!("{} actors", many.len()),
    };
    let until = SimDuration::from_nanos(outcome.until_ns);
    let path = path.display();
    let (same, inputs, steps) = (outcome.same, outcome.inputs, outcome.steps);
    let mut text = match outcome.differing() {
        0 => format!(
            "{path}: {who} up to {until}: all {same} outputs as recorded ({inputs} inputs, {steps} events)\n"
        ),
        _ => format!(
            "{path}: {who} up to {until}: DIFFERENT: of the outputs {same} are as recorded, {} changed, {} \
             missing, {} extra ({inputs} inputs, {steps} events)\n",
            outcome.changed, outcome.missing, outcome.extra
        ),
    };
    if let Some(first) = &outcome.first {
        text.push_str(&told(first));
        for kind in &outcome.kinds {
            if kind.changed + kind.missing + kind.extra == 0 {
                continue;
            }
            let name = format!("{} {}", kind.output, kind.kind);
            text.push_str(&format!(
                "  {:<32} {:>8} same {:>8} changed {:>8} missing {:>8} extra\n",
                name.trim_end(),
                kind.same,
                kind.changed,
                kind.missing,
                kind.extra
            ));
        }
    }
    for why in run_again_for {
        text.push_str(&format!("  the run was executed again for {why}\n"));
    }
    for note in notes {
        text.push_str(&format!("  note: {note}\n"));
    }
    text
}

fn told(first: &ReplayedOutput) -> String {
    let to = match first.receiver.as_str() {
        "" => String::new(),
        receiver => format!(" to {receiver}"),
    };
    let kind = match first.kind.as_str() {
        "" => String::new(),
        kind => format!(" {kind}"),
    };
    let number = first.recorded.as_ref().or(first.replayed.as_ref());
    let number = number.map_or(0, |side| side.ordinal);
    let mut text = format!(
        "  first at {}.{:09} s: {}{kind} of {}{to} (number {number}): {}\n    recorded  {}\n    replayed  {}\n",
        first.time_ns / 1_000_000_000,
        first.time_ns % 1_000_000_000,
        first.output,
        first.actor,
        first.field,
        first.expected,
        first.actual,
    );
    if !first.why.is_empty() {
        text.push_str(&format!("    compared by bytes: {}\n", first.why));
    }
    if let Some(event) = &first.event {
        text.push_str(&format!("    made in   {}\n", step(event)));
    }
    if let Some(cause) = first
        .cause
        .as_ref()
        .filter(|cause| first.event.as_ref() != Some(*cause))
    {
        text.push_str(&format!("    led to by {}\n", step(cause)));
    }
    text
}

fn step(step: &ReplayedStep) -> String {
    let at = SimDuration::from_nanos(step.time_ns);
    let ReplayedStep {
        event,
        kind,
        sender,
        ordinal,
        ..
    } = step;
    match *event {
        "delivered" | "told" => format!("{kind} from {sender} (number {ordinal}), {event} at {at}"),
        "timer" => format!("timer {kind} (number {ordinal}) at {at}"),
        other => format!("{other} at {at}"),
    }
}
