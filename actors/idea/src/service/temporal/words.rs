//! Conflicts of the plan database, in words.

use farside_planning::database::{Conflict, Owner, Step};
use farside_planning::model::{PredicateId, RuleId};
use farside_planning::search::{Failure, Flaw};

use super::Temporal;
use crate::service::{NoPlan, Refusal, words};

impl Temporal {
    pub(super) fn refusal(&self, predicate: PredicateId, conflict: &Conflict) -> Refusal {
        Refusal::Rule {
            what: self.model.predicates[predicate].name.clone(),
            reason: self.reason(conflict),
        }
    }

    fn reason(&self, conflict: &Conflict) -> String {
        let what = match conflict {
            Conflict::Times(_) | Conflict::Known { .. } => words::TIMES,
            Conflict::Values(_) => words::VALUES,
            Conflict::Mismatch { .. } => words::KIND,
            Conflict::Amount { .. } => "its amounts cannot be counted",
        };
        let mut rules: Vec<RuleId> = Vec::new();
        for owner in conflict.owners() {
            if let Owner::Rule { rule, .. } = owner
                && !rules.contains(&rule)
            {
                rules.push(rule);
            }
        }
        words::reason(&self.model, what, &rules)
    }

    pub(super) fn no_plan(&self, failure: &Failure) -> NoPlan {
        let tried: Vec<String> = failure.conflicts.iter().map(|at| self.reason(at)).collect();
        let asked = match (failure.flaw, failure.rule) {
            (Flaw::Open(open), Some(rule)) => {
                let relation = match open.step {
                    Step::Relation(at) => {
                        self.executive.database().relations(rule).get(at as usize)
                    }
                    Step::Choice(_) => None,
                };
                words::Asked::Rule(rule, relation)
            }
            (Flaw::Goal(_), _) => match self.executive.first_goal() {
                Some((timeline, predicate)) => words::Asked::Goal(timeline, predicate),
                None => words::Asked::Default(0),
            },
            (Flaw::Gap { timeline, .. }, _) => words::Asked::Default(timeline),
            _ => words::Asked::Default(0),
        };
        words::no_plan(&self.model, asked, &tried)
    }
}
