//! Why something cannot be, in words: the same for every technology.

use farside_planning::model::{
    Model, PredicateId, Relation, RelationKind, RuleId, Target, TimelineId,
};

use super::NoPlan;

pub(super) const TIMES: &str = "its times cannot be";
pub(super) const VALUES: &str = "its values cannot be";
pub(super) const KIND: &str = "it is not what is asked for";

/// What nothing fulfils.
pub(super) enum Asked<'a> {
    /// A relation of a rule, or its choice.
    Rule(RuleId, Option<&'a Relation>),
    /// A goal from elsewhere.
    Goal(TimelineId, PredicateId),
    /// That a timeline says something.
    Default(TimelineId),
}

/// Where a rule stands, and of whom it is.
pub(super) fn rule(model: &Model, rule: RuleId) -> String {
    let rule = &model.rules[rule];
    let master = &model.predicates[rule.master.predicate].name;
    format!("{} ({master})", model.place(rule.position))
}

/// Why something cannot be, and by which rules.
pub(super) fn reason(model: &Model, what: &str, rules: &[RuleId]) -> String {
    if rules.is_empty() {
        return what.to_owned();
    }
    let rules: Vec<String> = rules.iter().map(|&at| rule(model, at)).collect();
    format!("{what}, by {}", rules.join(" and "))
}

/// That there is no plan, with what was tried.
pub(super) fn no_plan(model: &Model, asked: Asked<'_>, tried: &[String]) -> NoPlan {
    let tried = match tried {
        [] => "no token is that".to_owned(),
        [one] => format!("the one way was refused: {one}"),
        ways => format!("{} ways were refused: {}", ways.len(), ways.join("; ")),
    };
    let name = |timeline: TimelineId| model.timelines[timeline].name.as_str();
    let (compatibility, asked) = match asked {
        Asked::Rule(at, relation) => (rule(model, at), relation_of(model, relation)),
        Asked::Goal(timeline, predicate) => {
            let goal = &model.predicates[predicate].name;
            let asked = format!("the goal {goal} on {}", name(timeline));
            (asked, "it starts now".to_owned())
        }
        Asked::Default(timeline) => (
            format!("the default of {}", name(timeline)),
            "nothing else is asked for".to_owned(),
        ),
    };
    NoPlan {
        compatibility,
        reason: format!("{asked}: {tried}"),
    }
}

/// What a relation asks for.
fn relation_of(model: &Model, relation: Option<&Relation>) -> String {
    let Some(relation) = relation else {
        return "one of its alternatives".to_owned();
    };
    let kind = name_of(relation.kind);
    match &relation.target {
        Target::New(pattern, _) => {
            let timelines = pattern.timelines.iter();
            let timelines: Vec<&str> = timelines
                .map(|&at| model.timelines[at].name.as_str())
                .collect();
            format!(
                "{kind} {} on {} ({})",
                model.predicates[pattern.predicate].name,
                timelines.join(" or "),
                model.place(pattern.position)
            )
        }
        Target::Label(label) => format!("{kind} its token {label}"),
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
