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
        }
    }

    /// Where the way that got furthest ended.
    pub(super) fn reasons(self) -> Vec<Reason> {
        self.furthest.map(|at| at.1).unwrap_or_default()
    }

    /// The last decision of a flaw was refused.
    fn end(&mut self) {
        if let Some(current) = self.current.take() {
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
        let is_further = self.furthest.as_ref().is_none_or(|at| depth > at.0);
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
