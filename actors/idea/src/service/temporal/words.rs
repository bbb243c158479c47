//! Why something cannot be, in words.

use farside_planning::database::{Conflict, Owner, Step};
use farside_planning::model::{PredicateId, RelationKind, RuleId, Target};
use farside_planning::search::{Failure, Flaw};

use super::Temporal;
use crate::service::{NoPlan, Refusal};

impl Temporal {
    pub(super) fn refusal(&self, predicate: PredicateId, conflict: &Conflict) -> Refusal {
        Refusal::Rule {
            what: self.model.predicates[predicate].name.clone(),
            reason: self.reason(conflict),
        }
    }

    /// Where a rule stands, and of whom it is.
    fn rule(&self, rule: RuleId) -> String {
        let rule = &self.model.rules[rule];
        let master = &self.model.predicates[rule.master.predicate].name;
        format!("{} ({master})", self.model.place(rule.position))
    }

    fn reason(&self, conflict: &Conflict) -> String {
        let what = match conflict {
            Conflict::Times(_) | Conflict::Known { .. } => "its times cannot be",
            Conflict::Values(_) => "its values cannot be",
            Conflict::Mismatch { .. } => "it is not what is asked for",
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
        if rules.is_empty() {
            return what.to_owned();
        }
        let rules: Vec<String> = rules.into_iter().map(|rule| self.rule(rule)).collect();
        format!("{what}, by {}", rules.join(" and "))
    }

    /// What a part of a rule asks for.
    fn asked(&self, rule: RuleId, step: Step) -> String {
        let relations = self.executive.database().relations(rule);
        let relation = match step {
            Step::Choice(_) => return "one of its alternatives".to_owned(),
            Step::Relation(relation) => &relations[relation as usize],
        };
        let kind = name_of(relation.kind);
        match &relation.target {
            Target::New(pattern, _) => {
                let timelines = pattern.timelines.iter();
                let timelines: Vec<&str> = timelines
                    .map(|&at| self.model.timelines[at].name.as_str())
                    .collect();
                format!(
                    "{kind} {} on {} ({})",
                    self.model.predicates[pattern.predicate].name,
                    timelines.join(" or "),
                    self.model.place(pattern.position)
                )
            }
            Target::Label(label) => format!("{kind} its token {label}"),
        }
    }

    pub(super) fn no_plan(&self, failure: &Failure) -> NoPlan {
        let tried: Vec<String> = failure.conflicts.iter().map(|at| self.reason(at)).collect();
        let tried = match tried.len() {
            0 => "no token is that".to_owned(),
            1 => format!("the one way was refused: {}", tried[0]),
            ways => format!("{ways} ways were refused: {}", tried.join("; ")),
        };
        let at = |timeline: usize| self.model.timelines[timeline].name.as_str();
        let (compatibility, asked) = match (failure.flaw, failure.rule) {
            (Flaw::Open(open), Some(rule)) => (self.rule(rule), self.asked(rule, open.step)),
            (Flaw::Gap { timeline, .. }, _) => (
                format!("the default of {}", at(timeline)),
                format!("{} says nothing", at(timeline)),
            ),
            (Flaw::Goal(_), _) => ("a goal".to_owned(), "it starts now".to_owned()),
            _ => ("the model".to_owned(), "something is missing".to_owned()),
        };
        NoPlan {
            compatibility,
            reason: format!("{asked}: {tried}"),
        }
    }
}

/// A relation's name in the language.
fn name_of(kind: RelationKind) -> &'static str {
    match kind {
        RelationKind::Meets => "meets",
        RelationKind::MetBy => "met_by",
        RelationKind::Before => "before",
        RelationKind::After => "after",
        RelationKind::Starts => "starts",
        RelationKind::Ends => "ends",
        RelationKind::Equals => "equals",
        RelationKind::Contains => "contains",
        RelationKind::ContainedBy => "contained_by",
        RelationKind::StartsDuring => "starts_during",
        RelationKind::StartsBefore => "starts_before",
        RelationKind::EndsDuring => "ends_during",
        RelationKind::EndsAfter => "ends_after",
        RelationKind::Distance => "temporaldistance",
    }
}
