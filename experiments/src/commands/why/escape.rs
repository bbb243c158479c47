//! Which of what touched an actor it would have escaped: the run again without it, one after the other.

use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use farside::ruling::MessageId;
use farside::{End, SimDuration};
use farside_actors::system::Doing;
use farside_logs::{Log, LogWriter};
use serde::Serialize;
use toml::{Table, Value};

use super::story::{Story, Touching, seconds};
use super::text::rows;
use crate::commands::CommandError;
use crate::commands::interrupt::on_interrupt;
use crate::commands::run::log_options;
use crate::registry::Registry;
use crate::scenario::Scenario;

/// As many runs as are made.
const RUNS: usize = 12;

/// As many messages of one wait as are delivered.
const MESSAGES: usize = 500;

/// Something that touched the actor, taken away.
struct Candidate {
    what: String,
    change: Change,
    /// For how long it overlaps what the actor waited or was down.
    overlap_ns: u64,
}

enum Change {
    Without { table: &'static str, entry: usize },
    Delivered(Vec<MessageId>),
}

/// How an actor would have fared without something.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Escape {
    /// What is taken away.
    pub(super) without: String,
    /// How it fares then, in words.
    pub(super) outcome: String,
    /// When it has done all that it is to do then; none if it never has.
    pub(super) done_ns: Option<u64>,
    /// How much less it waits and is down, in nanoseconds; less than nothing if it is more.
    pub(super) less_idle_ns: i64,
    /// Whether anything is otherwise for it.
    pub(super) is_other: bool,
}

/// What would have been without each of these.
#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct Escapes {
    pub(super) escapes: Vec<Escape>,
    /// How many were not tried, those that overlap least.
    pub(super) not_tried: usize,
}

/// Runs again without each thing that touched the actor of a story, and tells how it fares then.
pub(super) fn escapes(
    story: &Story,
    log: &Log,
    scenario: &Scenario,
    registry: &Registry,
    least_ns: u64,
) -> Result<Escapes, CommandError> {
    let mut candidates = candidates(story, least_ns);
    candidates.sort_by_key(|candidate| std::cmp::Reverse(candidate.overlap_ns));
    let not_tried = candidates.len().saturating_sub(RUNS);
    candidates.truncate(RUNS);
    // One handler for all runs: it ends the one that is on.
    let running = Arc::new(Mutex::new(Arc::default()));
    let raised = Arc::clone(&running);
    on_interrupt(move || {
        let flag: Arc<AtomicBool> =
            Arc::clone(&raised.lock().unwrap_or_else(PoisonError::into_inner));
        flag.store(true, Ordering::SeqCst);
    });
    let mut escapes = Vec::new();
    for candidate in candidates {
        let told = told_without(&candidate.change, story, log, scenario, registry, &running)?;
        let idle = |story: &Story| {
            let account = &story.account;
            account.spent_ns(Doing::Waiting) + account.spent_ns(Doing::Down)
        };
        escapes.push(Escape {
            without: candidate.what,
            outcome: told.outcome(),
            done_ns: told.account.done_ns(),
            less_idle_ns: idle(story) as i64 - idle(&told) as i64,
            is_other: told.account != story.account,
        });
    }
    Ok(Escapes { escapes, not_tried })
}

fn candidates(story: &Story, least_ns: u64) -> Vec<Candidate> {
    let phases = story.account.phases.iter();
    let idle: Vec<[u64; 2]> = phases
        .filter(|phase| matches!(phase.doing, Doing::Waiting | Doing::Down))
        .map(|phase| [phase.from_ns, phase.until_ns])
        .collect();
    let overlap = |[from, until]: [u64; 2]| {
        let shared = idle
            .iter()
            .map(|[a, b]| until.min(*b).saturating_sub(from.max(*a)));
        shared.sum()
    };
    let mut all = Vec::new();
    for (table, touching) in [("degrade", &story.degrades), ("crash", &story.crashes)] {
        for entry in touching {
            let Touching {
                entry: number,
                text,
                ..
            } = entry;
            all.push(Candidate {
                what: format!("[[{table}]] {}: {text}", number + 1),
                change: Change::Without {
                    table,
                    entry: *number,
                },
                overlap_ns: overlap(entry.within(story.until_ns)),
            });
        }
    }
    for row in rows(&story.account.phases, least_ns) {
        let lost = story.lost_within(row.from_ns, row.until_ns);
        if row.doing != Doing::Waiting || lost.is_empty() {
            continue;
        }
        let carried = lost.iter().filter(|lost| !lost.link.is_empty());
        let ids: Vec<MessageId> = carried.map(|lost| lost.id.clone()).take(MESSAGES).collect();
        let (from, until) = (seconds(row.from_ns), seconds(row.until_ns));
        all.push(Candidate {
            what: format!(
                "the loss of {} messages to and from it, {from} to {until}",
                ids.len()
            ),
            overlap_ns: row.until_ns - row.from_ns,
            change: Change::Delivered(ids),
        });
    }
    all
}

/// The story of the same actor in the run without something.
fn told_without(
    change: &Change,
    story: &Story,
    log: &Log,
    scenario: &Scenario,
    registry: &Registry,
    running: &Mutex<Arc<AtomicBool>>,
) -> Result<Story, CommandError> {
    let wrong = |error: String| CommandError::Arguments(error);
    let mut table: Table =
        toml::from_str(&scenario.resolved()?).map_err(|error| wrong(error.to_string()))?;
    match change {
        Change::Without { table: name, entry } => {
            let entries = table.get_mut(*name).and_then(Value::as_array_mut);
            if let Some(entries) = entries.filter(|entries| *entry < entries.len()) {
                entries.remove(*entry);
            }
        }
        Change::Delivered(ids) => {
            let entry = |id: &MessageId| {
                Value::Table(Table::from_iter([(
                    "message".to_owned(),
                    Value::String(id.to_string()),
                )]))
            };
            let entries = table.entry("deliver").or_insert(Value::Array(Vec::new()));
            if let Some(entries) = entries.as_array_mut() {
                entries.extend(ids.iter().map(entry));
            }
        }
    }
    let text = toml::to_string(&table).map_err(|error| wrong(error.to_string()))?;
    let files = scenario.files().clone();
    let changed = Scenario::parse("the changed scenario", text, &[], registry, files)?;
    let changed = changed.named(scenario.name());
    let mut assembled = changed.assemble()?;
    assembled.sim.tie_seed(log.tie_seed());
    let temporary = |source| CommandError::Write {
        path: std::env::temp_dir(),
        source,
    };
    let folder = tempfile::tempdir().map_err(temporary)?;
    let path = folder.path().join("without.mcap");
    let options = log_options(&changed, &assembled, farside::Executor::Inline, registry)?;
    assembled.sim.observe(LogWriter::create(&path, options)?);
    *running.lock().unwrap_or_else(PoisonError::into_inner) = assembled.sim.interrupt();
    let report = assembled.sim.run(farside::Executor::Inline)?;
    if matches!(report.end, End::Interrupted) {
        return Err(CommandError::Interrupted(
            "what it would have escaped is not told".to_owned(),
        ));
    }
    let log = Log::open(&path)?;
    let whole = Story::read(&log, &changed, &story.actor, None)?;
    // Told up to the same time, unless it ends sooner.
    match whole.until_ns > story.until_ns {
        true => {
            let at = SimDuration::from_nanos(story.until_ns);
            Story::read(&log, &changed, &story.actor, Some(at))
        }
        false => Ok(whole),
    }
}

impl fmt::Display for Escapes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.escapes.is_empty() {
            writeln!(f, "\nnothing touched it that a run could be without")?;
        }
        for escape in &self.escapes {
            writeln!(f, "\nwithout {}", escape.without)?;
            match escape.is_other {
                true => writeln!(f, "  {}; {}", escape.outcome, less(escape.less_idle_ns))?,
                false => writeln!(f, "  nothing is otherwise for it")?,
            }
        }
        if self.not_tried > 0 {
            writeln!(f, "\n{} others were not tried", self.not_tried)?;
        }
        Ok(())
    }
}

fn less(idle_ns: i64) -> String {
    let by = seconds(idle_ns.unsigned_abs());
    match idle_ns {
        0 => "idle as long".to_owned(),
        1.. => format!("idle {by} less"),
        _ => format!("idle {by} more"),
    }
}
