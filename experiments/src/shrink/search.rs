//! Trying many scenarios on all cores, in an order that does not depend on how many there are.
//!
//! Candidates are numbered. Threads take them in order; of those with which it happens the one with the least
//! number counts, and what is under way behind it is broken off. So the answer is that of trying one after the
//! other, whatever the number of threads, and so is what a budget of runs pays for: those that one thread would
//! have tried.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use toml::Table;

use super::trial::{Bench, Verdict};
use super::tried::{TriedError, Verdicts, key};
use super::{Budget, Tell};
use crate::wall::Stopwatch;

/// Why a search does not go on.
#[derive(Debug)]
pub(super) enum Halt {
    /// The budget is spent.
    Budget,
    /// It was interrupted.
    Interrupted,
    /// Verdicts cannot be kept.
    Tried(TriedError),
}

impl From<TriedError> for Halt {
    fn from(error: TriedError) -> Self {
        Halt::Tried(error)
    }
}

/// The candidate that was found.
#[derive(Clone, Debug)]
pub(super) struct Found {
    pub(super) number: usize,
    /// Which of the scenarios that stand for the candidate.
    pub(super) alternative: usize,
    pub(super) verdict: Verdict,
}

/// A search on all cores.
pub(super) struct Search<'a> {
    pub(super) bench: Bench<'a>,
    pub(super) jobs: usize,
    pub(super) verdicts: Verdicts,
    pub(super) budget: Option<Budget>,
    pub(super) interrupt: Arc<AtomicBool>,
    pub(super) tell: &'a (dyn Fn(Tell) + Sync),
    clock: Stopwatch,
    /// What was asked for so far.
    asked: BTreeSet<u128>,
    /// How many runs that paid for.
    pub(super) spent: u64,
}

/// What is known of a candidate once it was tried.
struct Outcome {
    keys: Vec<u128>,
    alternative: usize,
    verdict: Verdict,
}

/// Candidates under way.
struct Batch<'v> {
    next: usize,
    count: usize,
    /// The least number with which it happens.
    found: usize,
    outcomes: BTreeMap<usize, Outcome>,
    running: BTreeMap<usize, Arc<AtomicBool>>,
    verdicts: &'v mut Verdicts,
    /// How many runs were made.
    runs: u64,
    error: Option<TriedError>,
}

/// The scenarios that stand for a candidate: the first that can be run does.
pub(super) type Tables<'t> = &'t (dyn Fn(usize) -> Vec<Table> + Sync);

impl<'a> Search<'a> {
    pub(super) fn new(
        bench: Bench<'a>,
        (jobs, budget): (usize, Option<Budget>),
        verdicts: Verdicts,
        interrupt: Arc<AtomicBool>,
        tell: &'a (dyn Fn(Tell) + Sync),
    ) -> Self {
        Search {
            bench,
            jobs: jobs.max(1),
            verdicts,
            budget,
            interrupt,
            tell,
            clock: Stopwatch::start(),
            asked: BTreeSet::new(),
            spent: 0,
        }
    }

    /// The first of `count` candidates with which it happens.
    pub(super) fn first(
        &mut self,
        count: usize,
        tables: Tables<'_>,
    ) -> Result<Option<Found>, Halt> {
        let left = match self.budget {
            Some(Budget::Runs(runs)) => Some(runs.saturating_sub(self.spent)),
            _ => None,
        };
        let batch = Mutex::new(Batch {
            next: 0,
            count,
            found: usize::MAX,
            outcomes: BTreeMap::new(),
            running: BTreeMap::new(),
            verdicts: &mut self.verdicts,
            runs: 0,
            error: None,
        });
        let workers = self.jobs.min(count);
        let hand = Hand {
            bench: self.bench,
            batch: &batch,
            interrupt: &self.interrupt,
            tables,
            // What others try at the same time may be for nothing.
            most: left.map(|left| left + workers as u64),
            until: match self.budget {
                Some(Budget::WallS(wall_s)) => Some((self.clock, wall_s)),
                _ => None,
            },
            tell: self.tell,
        };
        match workers {
            0 | 1 => hand.work(),
            workers => std::thread::scope(|scope| {
                for _ in 0..workers {
                    scope.spawn(|| hand.work());
                }
            }),
        }
        let batch = batch.into_inner().unwrap_or_else(PoisonError::into_inner);
        if let Some(error) = batch.error {
            return Err(error.into());
        }
        let (found, outcomes) = (batch.found, batch.outcomes);
        self.settle(count, found, outcomes)
    }

    /// What trying one after the other would have come to.
    fn settle(
        &mut self,
        count: usize,
        found: usize,
        mut outcomes: BTreeMap<usize, Outcome>,
    ) -> Result<Option<Found>, Halt> {
        for number in 0..count.min(found.saturating_add(1)) {
            let Some(outcome) = outcomes.remove(&number) else {
                return Err(match self.interrupt.load(Ordering::SeqCst) {
                    true => Halt::Interrupted,
                    false => Halt::Budget,
                });
            };
            for key in outcome.keys {
                if self.asked.contains(&key) || self.verdicts.is_known_before(key) {
                    continue;
                }
                if matches!(self.budget, Some(Budget::Runs(runs)) if self.spent >= runs) {
                    return Err(Halt::Budget);
                }
                self.asked.insert(key);
                self.spent += 1;
            }
            if number == found {
                return Ok(Some(Found {
                    number,
                    alternative: outcome.alternative,
                    verdict: outcome.verdict,
                }));
            }
        }
        Ok(None)
    }
}

/// What each thread has.
struct Hand<'h, 'v> {
    bench: Bench<'h>,
    batch: &'h Mutex<Batch<'v>>,
    interrupt: &'h Arc<AtomicBool>,
    tables: Tables<'h>,
    most: Option<u64>,
    until: Option<(Stopwatch, f64)>,
    tell: &'h (dyn Fn(Tell) + Sync),
}

impl<'v> Hand<'_, 'v> {
    fn batch(&self) -> MutexGuard<'_, Batch<'v>> {
        self.batch.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Tries candidates until there are none.
    fn work(&self) {
        while let Some((number, flag)) = self.take() {
            let outcome = self.attempt(number, &flag);
            let mut batch = self.batch();
            batch.running.remove(&number);
            let Some(outcome) = outcome else {
                continue;
            };
            if matches!(outcome.verdict, Verdict::Violates { .. }) && number < batch.found {
                batch.found = number;
                for (_, flag) in batch.running.range(number + 1..) {
                    flag.store(true, Ordering::SeqCst);
                }
            }
            batch.outcomes.insert(number, outcome);
        }
    }

    fn take(&self) -> Option<(usize, Arc<AtomicBool>)> {
        let mut batch = self.batch();
        let is_over = self.interrupt.load(Ordering::SeqCst)
            || batch.error.is_some()
            || batch.next >= batch.count.min(batch.found)
            || self.most.is_some_and(|most| batch.runs >= most)
            || matches!(self.until, Some((clock, wall_s)) if clock.elapsed_s() >= wall_s);
        if is_over {
            return None;
        }
        let number = batch.next;
        batch.next += 1;
        let flag = Arc::new(AtomicBool::new(false));
        batch.running.insert(number, flag.clone());
        Some((number, flag))
    }

    /// Tries a candidate; none if it was broken off.
    fn attempt(&self, number: usize, flag: &Arc<AtomicBool>) -> Option<Outcome> {
        let mut outcome = Outcome {
            keys: Vec::new(),
            alternative: 0,
            verdict: Verdict::Impossible,
        };
        for (alternative, table) in (self.tables)(number).iter().enumerate() {
            let text = toml::to_string(table).unwrap_or_default();
            let key = key(&text);
            let known = self.batch().verdicts.get(key).cloned();
            let verdict = match known {
                Some(known) => known,
                None => {
                    let flags = [flag.clone(), self.interrupt.clone()];
                    let verdict = self.bench.judge(table, &flags)?;
                    let mut batch = self.batch();
                    batch.runs += 1;
                    if let Err(error) = batch.verdicts.keep(key, verdict.clone()) {
                        batch.error.get_or_insert(error);
                    }
                    drop(batch);
                    (self.tell)(Tell::Ran);
                    verdict
                }
            };
            outcome.keys.push(key);
            (outcome.alternative, outcome.verdict) = (alternative, verdict);
            if outcome.verdict != Verdict::Impossible {
                break;
            }
        }
        Some(outcome)
    }
}
