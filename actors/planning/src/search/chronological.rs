//! Depth first: the last decision that has an alternative is taken back first.

use super::{Counters, Decision, Failure, Flaw, Strategy, Verdict};
use crate::database::{Conflict, Database};

/// What a search keeps, for its memory: one serves many searches.
#[derive(Clone, Debug, Default)]
pub struct Stack {
    frames: Vec<Frame>,
    /// The decisions of all frames that were not tried yet, the best one last.
    untried: Vec<Decision>,
    found: Vec<Decision>,
    /// What was done since it was made.
    pub counters: Counters,
}

/// A flaw whose decisions are being tried.
#[derive(Clone, Debug)]
struct Frame {
    flaw: Flaw,
    /// Where its decisions begin.
    start: usize,
    /// Whether the database was pushed: not if there was one decision only.
    pushed: bool,
}

/// The longest way so far, and why it did not go on.
#[derive(Debug, Default)]
struct Deepest {
    depth: usize,
    failure: Option<Failure>,
}

/// Puts flaws right until there are none, with at most so many operations.
///
/// A flaw with one decision only is no choice, and costs no push.
pub fn chronological<S: Strategy>(
    database: &mut Database,
    strategy: &mut S,
    stack: &mut Stack,
    budget: u64,
) -> Verdict {
    let limit = database.operations().saturating_add(budget);
    stack.frames.clear();
    stack.untried.clear();
    // Undoing everything takes one push for the decisions without a choice.
    database.push();
    let mut deepest = Deepest::default();
    let verdict = loop {
        if database.operations() > limit {
            break Verdict::OverBudget;
        }
        let Some(flaw) = strategy.next(database) else {
            break Verdict::Solved;
        };
        stack.found.clear();
        strategy.decisions(database, flaw, &mut stack.found);
        let start = stack.untried.len();
        stack.untried.extend(stack.found.drain(..).rev());
        stack.frames.push(Frame {
            flaw,
            start,
            pushed: false,
        });
        if !go_on(database, strategy, stack, &mut deepest, limit) {
            break match deepest.failure.take() {
                Some(failure) if database.operations() <= limit => Verdict::Impossible(failure),
                _ => Verdict::OverBudget,
            };
        }
    };
    // What each choice pushed is kept or undone with what the search itself pushed.
    let solved = matches!(verdict, Verdict::Solved);
    let pushed = stack.frames.iter().filter(|frame| frame.pushed).count();
    for _ in 0..=pushed {
        if solved {
            database.commit();
        } else {
            database.pop();
        }
    }
    if !solved {
        strategy.undone(database);
    }
    verdict
}

/// Carries out the best decision of the last flaw that can be; whether there is one.
fn go_on<S: Strategy>(
    database: &mut Database,
    strategy: &mut S,
    stack: &mut Stack,
    deepest: &mut Deepest,
    limit: u64,
) -> bool {
    let mut conflicts: Vec<Conflict> = Vec::new();
    let mut fresh = true;
    while let Some(frame) = stack.frames.last_mut() {
        if database.operations() > limit {
            return false;
        }
        if frame.pushed {
            database.pop();
            frame.pushed = false;
            strategy.undone(database);
        }
        if stack.untried.len() > frame.start
            && let Some(decision) = stack.untried.pop()
        {
            let more = stack.untried.len() > frame.start;
            if more {
                database.push();
                frame.pushed = true;
            }
            let flaw = frame.flaw;
            // What a refused decision leaves is undone with the one before it that has an
            // alternative, or with all.
            match database.settled(|database| strategy.decide(database, flaw, decision)) {
                Ok(()) => {
                    stack.counters.decisions += 1;
                    return true;
                }
                Err(conflict) => {
                    stack.counters.refusals += 1;
                    if fresh {
                        conflicts.push(conflict);
                    }
                }
            }
            continue;
        }
        let depth = stack.frames.len();
        if fresh && (deepest.failure.is_none() || depth > deepest.depth) {
            deepest.depth = depth;
            deepest.failure = stack.frames.last().map(|frame| {
                let instance = match frame.flaw {
                    Flaw::Open(open) => Some(open.instance),
                    _ => None,
                };
                let asks = instance.and_then(|at| database.instance(at));
                Failure {
                    flaw: frame.flaw,
                    conflicts: std::mem::take(&mut conflicts),
                    instance,
                    rule: asks.map(|at| at.rule),
                }
            });
        }
        fresh = false;
        let failed = stack.frames.pop().map(|frame| frame.flaw);
        if let (Some(before), Some(failed)) = (stack.frames.last(), failed) {
            if strategy.is_guard(database, before.flaw, failed) {
                stack.counters.guards += 1;
            } else {
                stack.counters.backtracks += 1;
            }
        }
    }
    false
}
