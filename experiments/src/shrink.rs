//! Making a failing scenario small: what of its team, goals, faults, degradations and losses can be left out,
//! so that what must never happen still does.
//!
//! Candidates are run one by one, on all cores. First members of the team are left out, because that makes all
//! later runs faster, then what else there is, list by list (`shrink/ddmin.rs`), again and again until nothing more
//! goes. Then what links lost by chance becomes a list of messages that are lost, of which again is left out
//! what can be. At last every single entry that is left is left out once more, in vain: what remains is
//! 1-minimal.

mod ddmin;
mod losses;
mod parts;
mod search;
mod stage;
mod trial;
mod tried;
mod write;

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use farside::{End, SimDuration, SimTime};
use thiserror::Error;
use toml::{Table, Value};

use crate::registry::Registry;
use crate::scenario::{Forbidden, Scenario};
use losses::LossWatch;
use parts::Whole;
use search::{Halt, Search};
use stage::Stage;
use trial::{Bench, Verdict};
pub use tried::TriedError;
use tried::{Verdicts, key, written};
pub(crate) use write::{BEGINNING, beside, short};

/// How much longer than the failing run a smaller one may take until it fails.
const LONGER: u64 = 2;

/// The longest text of a scenario with its losses that is tried [byte]: what can be read again.
const MAX_LOSSES_BYTES: usize = 3 << 20;

/// What a search may cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Budget {
    /// So many runs.
    Runs(u64),
    /// So long \[s\].
    WallS(f64),
}

/// How a search is done.
pub struct ShrinkOptions<'a> {
    /// What must never happen, and is to.
    pub forbidden: &'a Forbidden,
    /// How many runs at once.
    pub jobs: usize,
    /// What it may cost.
    pub budget: Option<Budget>,
    /// Where verdicts are kept.
    pub state: &'a Path,
    /// Ends the search.
    pub interrupt: Arc<AtomicBool>,
    /// Is told how it goes.
    pub tell: &'a (dyn Fn(Tell) + Sync),
}

/// How a search goes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Tell {
    /// A run was made.
    Ran,
    /// A smaller scenario was found; of it how many entries are left of each list.
    Smaller(Vec<Left>),
    /// What is done next.
    Now(String),
}

/// How much is left of a list.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Left {
    /// What the entries are, in the plural.
    pub what: &'static str,
    /// The key of the scenario.
    pub key: String,
    /// How many there were.
    pub of: usize,
    /// How many are left.
    pub left: usize,
}

/// How a search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ShrinkEnd {
    /// Nothing more can be left out.
    Minimal,
    /// The budget is spent.
    Budget,
    /// It was interrupted.
    Interrupted,
}

/// What is left of a scenario.
pub struct Shrunk {
    /// The scenario.
    pub(crate) table: Table,
    /// How the search ended.
    pub end: ShrinkEnd,
    /// How much is left of each list.
    pub left: Vec<Left>,
    /// How many runs it took, since the search was begun first or started again.
    pub runs: u64,
    /// How many verdicts were known when it was started.
    pub known: usize,
    /// How many single entries were left out at last, in vain.
    pub proved: usize,
    /// When it happens.
    pub violated_at: SimTime,
    /// What a reader should know.
    pub remarks: Vec<String>,
}

/// Why nothing was made small.
#[derive(Debug, Error)]
pub enum ShrinkError {
    /// The run does not fail so.
    #[error(
        "{scenario}: {violates} does not happen: the run {end}; there is nothing to make small"
    )]
    Holds {
        /// What was run.
        scenario: String,
        /// What was to happen.
        violates: String,
        /// How it ended.
        end: String,
    },
    /// It cannot be run.
    #[error("{scenario}: {reason}")]
    Impossible {
        /// What was to be run.
        scenario: String,
        /// Why not.
        reason: String,
    },
    /// It was interrupted before anything was known.
    #[error("interrupted before the first run was over")]
    Interrupted,
    /// Verdicts cannot be kept.
    #[error(transparent)]
    Tried(#[from] TriedError),
}

impl ShrinkError {
    /// Whether the search failed, and not what it was given.
    pub(crate) fn is_of_output(&self) -> bool {
        match self {
            ShrinkError::Interrupted => true,
            ShrinkError::Tried(error) => error.is_of_output(),
            ShrinkError::Holds { .. } | ShrinkError::Impossible { .. } => false,
        }
    }
}

/// Makes a scenario small. `smaller` is told whenever something could be left out, with what is left.
///
/// # Errors
/// When the scenario does not fail so, cannot be run, or what is tried cannot be kept.
pub(crate) fn shrink(
    scenario: &Scenario,
    registry: &Registry,
    options: &ShrinkOptions<'_>,
    smaller: &mut dyn FnMut(&Table),
) -> Result<Shrunk, ShrinkError> {
    let name = scenario.name();
    let impossible = |reason: String| ShrinkError::Impossible {
        scenario: name.to_owned(),
        reason,
    };
    let resolved = scenario.resolved();
    let resolved = resolved.map_err(|error| impossible(error.to_string()))?;
    let table: Result<Table, _> = toml::from_str(&resolved);
    let mut table = table.map_err(|error| impossible(error.to_string()))?;
    let violates = options.forbidden.name();
    if !["fault", "violation"].contains(&violates) {
        let never = vec![Value::from(violates)];
        table.insert("never".to_owned(), Value::Array(never));
    }
    let text = toml::to_string(&table).map_err(|error| impossible(error.to_string()))?;
    let verdicts = Verdicts::open(
        options.state,
        &tried::Search {
            farside: registry.version(),
            violates: violates.to_owned(),
            scenario: written(key(&text)),
        },
    )?;
    let known = verdicts.known_before();
    let bench = Bench {
        registry,
        files: scenario.files(),
        name,
        forbidden: options.forbidden,
    };
    let limits = (options.jobs, options.budget);
    let interrupt = options.interrupt.clone();
    let mut search = Search::new(bench, limits, verdicts, interrupt, options.tell);
    let end_ns = first_run(&mut search, &table)?;
    let whole = Whole::new(table, scenario.removable());
    let mut remarks = Vec::new();
    let mut stage = Stage::new(whole, end_ns, smaller);
    let done = steps(&mut search, &mut stage, &mut remarks);
    let end = match done {
        Ok(()) => ShrinkEnd::Minimal,
        Err(Halt::Budget) => ShrinkEnd::Budget,
        Err(Halt::Interrupted) => ShrinkEnd::Interrupted,
        Err(Halt::Tried(error)) => return Err(error.into()),
    };
    Ok(Shrunk {
        end,
        left: stage.left(),
        runs: search.spent,
        known,
        proved: stage.proved,
        violated_at: SimTime::from_nanos(stage.end_ns),
        remarks,
        table: stage.table().unwrap_or_default(),
    })
}

/// That it happens at all, and when.
fn first_run(search: &mut Search<'_>, table: &Table) -> Result<u64, ShrinkError> {
    (search.tell)(Tell::Now("the run as it is".to_owned()));
    let found = search.first(1, &|_| vec![table.clone()]);
    match found {
        Ok(Some(found)) => match found.verdict {
            Verdict::Violates { end_ns, .. } => return Ok(end_ns),
            Verdict::Holds | Verdict::Impossible => {}
        },
        Ok(None) => {}
        Err(Halt::Tried(error)) => return Err(error.into()),
        Err(Halt::Interrupted | Halt::Budget) => return Err(ShrinkError::Interrupted),
    }
    // Why not: said in full only now that it is needed.
    let scenario = search.bench.name.to_owned();
    let interrupts = [search.interrupt.clone()];
    match search.bench.run(table, &interrupts, |_| {}) {
        Err(reason) => Err(ShrinkError::Impossible { scenario, reason }),
        Ok(None) => Err(ShrinkError::Interrupted),
        Ok(Some(tried)) => Err(ShrinkError::Holds {
            scenario,
            violates: search.bench.forbidden.name().to_owned(),
            end: match &tried.report.end {
                End::Stopped { reason, .. } => {
                    format!("stopped at {}: {reason}", tried.report.end_time)
                }
                end => format!(
                    "{} at {} {}",
                    end.name(),
                    tried.report.end_time,
                    end.detail()
                ),
            },
        }),
    }
}

/// All that is done, step by step. What was found so far is in `stage` also when it halts.
fn steps(
    search: &mut Search<'_>,
    stage: &mut Stage<'_>,
    remarks: &mut Vec<String>,
) -> Result<(), Halt> {
    let is_lasting = search.bench.forbidden.is_lasting();
    if is_lasting {
        let longest = SimDuration::from_nanos(stage.end_ns.saturating_mul(LONGER));
        stage.set_until(search, after(longest))?;
    }
    stage.reduce(search)?;
    schedule_losses(search, stage, remarks)?;
    loop {
        stage.reduce(search)?;
        if is_lasting {
            stage.set_until(search, after(SimDuration::from_nanos(stage.end_ns)))?;
        }
        if stage.prove(search)? {
            return Ok(());
        }
    }
}

/// A round time soon after another one.
fn after(time: SimDuration) -> SimDuration {
    let unit = match time >= SimDuration::from_secs(10) {
        true => SimDuration::from_secs(1),
        false => SimDuration::from_millis(10),
    };
    unit * (time.as_nanos() / unit.as_nanos() + 1)
}

/// Makes a list of what links lose by chance, if it still happens then.
fn schedule_losses(
    search: &mut Search<'_>,
    stage: &mut Stage<'_>,
    remarks: &mut Vec<String>,
) -> Result<(), Halt> {
    let Some(table) = stage.table() else {
        return Ok(());
    };
    let other = losses::other_chance(&table);
    if !other.is_empty() {
        let keys = other.join(", ");
        remarks.push(format!("drawn from the seed as before: {keys} of links"));
    }
    if !losses::by_chance(&table) {
        return Ok(());
    }
    (search.tell)(Tell::Now("what links lose by chance".to_owned()));
    let (watch, seen) = LossWatch::new();
    let interrupts = [search.interrupt.clone()];
    let tried = search.bench.run(&table, &interrupts, |assembled| {
        assembled.sim.observe(watch);
    });
    if let Ok(None) = tried {
        return Err(Halt::Interrupted);
    }
    let lost = seen
        .lock()
        .unwrap_or_else(std::sync::PoisonError::into_inner)
        .lost();
    let explicit = losses::explicit(&table, &lost);
    let bytes = toml::to_string(&explicit).map_or(0, |text| text.len());
    let count = lost.len();
    if bytes > MAX_LOSSES_BYTES {
        remarks.push(format!(
            "links lose by chance as before: {count} losses are too many for a list"
        ));
        return Ok(());
    }
    let found = search.first(1, &|_| vec![explicit.clone()])?;
    match found.map(|found| found.verdict) {
        Some(Verdict::Violates { end_ns, idle }) => {
            stage.begin(&search.bench, explicit, end_ns, &idle);
            Ok(())
        }
        _ => {
            remarks.push(format!(
                "links lose by chance as before: with their {count} losses as a list it does not happen"
            ));
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests;
