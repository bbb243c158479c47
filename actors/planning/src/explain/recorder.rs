//! A complete search that keeps, in words, where its way that got furthest ended.

use crate::database::{Conflict, Database};
use crate::search::complete::Complete;
use crate::search::schedule::Schedule;
use crate::search::{Decision, Flaw, Strategy};

use super::Reason;
use super::teller::{Decided, Teller};

/// How many refused decisions of a flaw are told.
const MOST_REFUSALS: usize = 3;

/// The search as [`Complete`] does it. What it tells must be told at once: a search takes back
/// what the reasons speak of.
pub(super) struct Recorder {
    pub(super) complete: Complete,
    /// What was decided, by the numbers of the decisions.
    decided: Vec<Decided>,
    current: Option<Current>,
    /// How far the search got, and why not further.
    furthest: Option<(usize, Vec<Reason>)>,
    /// The same of ways that ended with a resource of which there is not enough: where all goals
    /// are in the plan, that is mostly what is to be known.
    over_used: Option<(usize, Vec<Reason>)>,
    /// Whether anything could be decided in more than one way.
    pub(super) had_choice: bool,
}

/// A flaw further on than any before, while all its decisions are refused.
struct Current {
    flaw: Flaw,
    depth: usize,
    /// How many decisions are still to be refused.
    left: usize,
    reasons: Vec<Reason>,
}

impl Recorder {
    pub(super) fn new(schedule: &Schedule, wanted: &[bool]) -> Self {
        let mut complete = Complete::new(schedule);
        for (goal, &wanted) in wanted.iter().enumerate() {
            complete.want(goal, wanted);
        }
        Recorder {
            complete,
            decided: Vec::new(),
            current: None,
            furthest: None,
            over_used: None,
            had_choice: false,
        }
    }

    /// What ended until now is not told; what was decided stays known.
    pub(super) fn begin_again(&mut self) {
        (self.current, self.furthest, self.over_used) = (None, None, None);
    }

    /// Where the way that got furthest ended.
    pub(super) fn reasons(self) -> Vec<Reason> {
        let mut reasons = self.furthest.map(|at| at.1).unwrap_or_default();
        let over_used = self.over_used.map(|at| at.1).unwrap_or_default();
        if let Some(mut other) = over_used.into_iter().next()
            && !reasons.contains(&other)
        {
            other.message = format!("on another way, {}", other.message);
            reasons.push(other);
        }
        reasons
    }

    /// The last decision of a flaw was refused.
    fn end(&mut self) {
        let Some(current) = self.current.take() else {
            return;
        };
        let is_further =
            |at: &Option<(usize, _)>| at.as_ref().is_none_or(|at| current.depth > at.0);
        if matches!(current.flaw, Flaw::OverUse { .. }) && is_further(&self.over_used) {
            self.over_used = Some((current.depth, current.reasons.clone()));
        }
        if is_further(&self.furthest) {
            self.furthest = Some((current.depth, current.reasons));
        }
    }
}

impl Strategy for Recorder {
    fn next(&mut self, database: &mut Database) -> Option<Flaw> {
        self.complete.next(database)
    }

    fn decisions(&mut self, database: &mut Database, flaw: Flaw, into: &mut Vec<Decision>) {
        self.complete.decisions(database, flaw, into);
        // Constraints of times come with each decision: the more there are, the further it got.
        let depth = database.network().constraints();
        let kept = match flaw {
            Flaw::OverUse { .. } => &self.over_used,
            _ => &self.furthest,
        };
        let is_further = kept.as_ref().is_none_or(|at| depth > at.0);
        self.current = is_further.then(|| {
            let problem = self.complete.problem().clone();
            let told = Teller::flaw(database, &problem, &self.decided, flaw);
            Current {
                flaw,
                depth,
                left: into.len(),
                reasons: vec![told],
            }
        });
        self.had_choice |= into.len() > 1;
        if into.is_empty() {
            self.end();
        }
    }

    fn decide(
        &mut self,
        database: &mut Database,
        flaw: Flaw,
        decision: Decision,
    ) -> Result<(), Conflict> {
        let before = self.complete.numbered();
        let done = self.complete.decide(database, flaw, decision);
        match &done {
            Ok(()) => {
                self.current = None;
                self.decided.push(Decided {
                    last: self.complete.numbered(),
                    flaw,
                    decision,
                });
            }
            Err(conflict) => self.refused(database, before, decision, conflict),
        }
        done
    }
}

impl Recorder {
    fn refused(
        &mut self,
        database: &Database,
        before: u32,
        decision: Decision,
        conflict: &Conflict,
    ) {
        let Some(current) = &mut self.current else {
            return;
        };
        if current.reasons.len() <= MOST_REFUSALS {
            let problem = self.complete.problem();
            let flaw = current.flaw;
            // The refused decision itself may be among those that conflict.
            self.decided.push(Decided {
                last: self.complete.numbered().max(before),
                flaw,
                decision,
            });
            let teller = Teller::new(database, problem, &self.decided, "the token asked for");
            let reason = teller.conflict(conflict);
            self.decided.pop();
            if !current.reasons.contains(&reason) {
                current.reasons.push(reason);
            }
        }
        current.left -= 1;
        if current.left == 0 {
            self.end();
        }
    }
}
