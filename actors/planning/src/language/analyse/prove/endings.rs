//! That an executive knows what follows each token of a timeline that is a state at any time.
//!
//! What follows is the timeline's default, or what a rule of the token meets. Whether some rule
//! holds however the token ends is decided by going through the values that the rules' guards tell
//! apart: all of a truth value or an enumeration, and of a number those around each literal that it
//! is compared with.

use std::collections::{BTreeMap, BTreeSet};

use super::consistent::decide;
use crate::language::analyse::names::last_part;
use crate::language::analyse::rule::Draft;
use crate::language::findings::{Notes, Severity};
use crate::model::{
    Argument, Body, Bound, Distance, End, Model, Operand, Position, PredicateId, Relation,
    RelationKind, Relationship, RelationshipKind, Rule, Target, TimelineId, TimelineKind, Value,
    Values, VariableId,
};

/// Types of numbers with at most so many values are gone through one by one.
const FEW_VALUES: i128 = 64;

/// How many endings are gone through for a predicate at most; beyond that, nothing is decided.
const MOST_ENDINGS: usize = 1 << 16;

/// How many guards are asked at most for all endings together.
const MOST_STEPS: usize = 1 << 22;

/// Notes each predicate of a state that can end so that nothing follows.
pub(super) fn check(model: &Model, drafts: &[Draft], notes: &mut Notes) {
    let index = Index::of(drafts);
    // Objects of a class for which the same rules hold are all alike.
    let mut done = BTreeSet::new();
    let mut steps = 0;
    for (id, timeline) in model.timelines.iter().enumerate() {
        if timeline.kind != TimelineKind::State || timeline.default.is_some() {
            continue;
        }
        let is_shared = index.put_by_others.contains(&id);
        for &predicate in &timeline.predicates {
            let own = index
                .own
                .get(&(id, predicate))
                .map_or(&[][..], Vec::as_slice);
            let mut rules = own.iter().map(|&at| &drafts[at].rule);
            if model.predicates[predicate].inputs == model.predicates[predicate].parameters.len()
                && !index.ended.contains(&(id, predicate))
                && !rules.any(ends_its_master)
            {
                continue;
            }
            if done.insert((last_part(&timeline.name), predicate, own)) {
                let of = Ending {
                    model,
                    timeline: id,
                    predicate,
                };
                let own: Vec<&Draft> = own.iter().map(|&at| &drafts[at]).collect();
                of.check(&own, is_shared, &mut steps, notes);
            }
        }
    }
}

/// The rules by what they are about.
#[derive(Default)]
struct Index {
    /// By timeline and predicate: the rules of such tokens.
    own: BTreeMap<(TimelineId, PredicateId), Vec<usize>>,
    /// The timelines on which rules of other timelines put tokens.
    put_by_others: BTreeSet<TimelineId>,
    /// By timeline and predicate: the tokens that a relation of a rule may end.
    ended: BTreeSet<(TimelineId, PredicateId)>,
}

impl Index {
    fn of(drafts: &[Draft]) -> Index {
        let mut index = Index::default();
        for (at, draft) in drafts.iter().enumerate() {
            let masters: BTreeSet<TimelineId> = draft.master.timelines.iter().copied().collect();
            for &timeline in &masters {
                index
                    .own
                    .entry((timeline, draft.rule.master.predicate))
                    .or_default()
                    .push(at);
            }
            look_at_relations(&draft.rule.body, &mut |relation| {
                let Target::New(pattern, _) = &relation.target else {
                    return;
                };
                if relation.distances.iter().any(ends_its_target) {
                    let ended = pattern.timelines.iter();
                    index.ended.extend(ended.map(|&at| (at, pattern.predicate)));
                }
                if !relation.condition {
                    let others = pattern.timelines.iter().filter(|at| !masters.contains(at));
                    index.put_by_others.extend(others);
                }
            });
        }
        index
    }
}

/// Whether a rule may say until when its master lasts. A token of which nobody says so lasts until
/// another one takes its place.
fn ends_its_master(rule: &Rule) -> bool {
    let mut ends = rule.duration.is_some_and(|[_, most]| most != Bound::None);
    look_at_relations(&rule.body, &mut |relation| {
        let mut distances = relation.distances.iter();
        ends |= relation.anchor == 0 && distances.any(|distance| distance.from == End::Finish);
        ends |= matches!(relation.target, Target::Label(0));
    });
    ends
}

/// Whether a distance says until when its target lasts.
fn ends_its_target(distance: &Distance) -> bool {
    let latest = if distance.backward {
        distance.min
    } else {
        distance.max
    };
    distance.to == End::Finish && latest != Bound::None
}

fn look_at_relations(body: &Body, look: &mut impl FnMut(&Relation)) {
    match body {
        Body::All(parts) | Body::Any(parts, _) => {
            for part in parts {
                look_at_relations(part, look);
            }
        }
        Body::Relation(relation) => look(relation),
    }
}

/// A token that ends.
struct Ending<'m> {
    model: &'m Model,
    timeline: TimelineId,
    predicate: PredicateId,
}

/// What a rule's guard says of the parameters of its master.
struct Guard<'d> {
    /// By parameter: the literal that it must be.
    literals: Vec<Option<Value>>,
    /// By variable of the rule: the parameter that it is.
    parameters: Vec<Option<usize>>,
    when: &'d [Relationship],
}

impl Ending<'_> {
    /// Notes if no rule of `own` holds for some ending.
    fn check(&self, own: &[&Draft], is_shared: bool, steps: &mut usize, notes: &mut Notes) {
        let position = own.first().map(|draft| draft.rule.position);
        let position = position.unwrap_or(Position {
            file: 0,
            line: 1,
            column: 1,
        });
        let following = own
            .iter()
            .filter(|draft| self.follows(&draft.rule.body, draft, false));
        let guards: Option<Vec<Guard>> = following.map(|draft| self.guard(draft)).collect();
        let uncovered = guards.and_then(|guards| self.uncovered(&guards, steps));
        let Some(uncovered) = uncovered else { return };
        let severity = if is_shared {
            Severity::Warning
        } else {
            Severity::Error
        };
        let timeline = last_part(&self.model.timelines[self.timeline].name);
        let name = &self.model.predicates[self.predicate].name;
        let expected = format!("a default of {timeline}, or a rule for each ending of {name}");
        notes.note(
            severity,
            position,
            expected,
            format!("none for {uncovered}"),
        );
    }

    /// Whether a token is on the timeline when the master ends wherever a body holds, and, but
    /// within a choice, that it can always hold: conditions may not.
    fn follows(&self, body: &Body, draft: &Draft, in_choice: bool) -> bool {
        match body {
            Body::All(parts) => parts
                .iter()
                .any(|part| self.follows(part, draft, in_choice)),
            Body::Any(parts, _) => {
                parts.iter().all(|part| self.follows(part, draft, true))
                    && (in_choice || parts.iter().any(|part| !has_condition(part)))
            }
            Body::Relation(relation) => match &relation.target {
                Target::New(pattern, label) => {
                    let same = draft.same_timelines[*label].is_some();
                    relation.anchor == 0
                        && (in_choice || !relation.condition)
                        && is_meeting(relation)
                        && pattern.timelines.contains(&self.timeline)
                        && (same || pattern.timelines.len() == 1)
                }
                Target::Label(_) => false,
            },
        }
    }

    /// The guard of a rule; none if it speaks of more than the master's parameters.
    fn guard<'d>(&self, draft: &'d Draft) -> Option<Guard<'d>> {
        let rule = &draft.rule;
        let mut parameters: Vec<Option<usize>> = vec![None; rule.variables.len()];
        let mut literals = vec![None; rule.master.arguments.len()];
        for (place, argument) in rule.master.arguments.iter().enumerate() {
            match *argument {
                Argument::Any => {}
                Argument::Value(value) => literals[place] = Some(value),
                // The same variable twice ties two parameters together.
                Argument::Variable(id) if parameters[id].is_some() => return None,
                Argument::Variable(id) => parameters[id] = Some(place),
            }
        }
        let known = |operand: &Operand| match *operand {
            Operand::Value(_) => true,
            Operand::Variable(id) => parameters[id].is_some(),
            _ => false,
        };
        let is_known = rule.when.iter().all(|of| of.operands.iter().all(known));
        is_known.then_some(Guard {
            literals,
            parameters,
            when: &rule.when,
        })
    }

    /// An ending for which no guard holds, in words; none if there is none, or if there are too
    /// many to go through.
    fn uncovered(&self, guards: &[Guard], steps: &mut usize) -> Option<String> {
        let predicate = &self.model.predicates[self.predicate];
        let mut choices: Vec<(usize, Vec<Value>)> = Vec::new();
        let mut count = 1_usize;
        for place in 0..predicate.parameters.len() {
            if guards.iter().any(|guard| guard.asks(place)) {
                let values = self.values(place, guards)?;
                count = count
                    .checked_mul(values.len())
                    .filter(|count| *count <= MOST_ENDINGS)?;
                choices.push((place, values));
            }
        }
        *steps = steps.saturating_add(count.saturating_mul(guards.len()));
        if *steps > MOST_STEPS {
            return None;
        }
        let mut ending = vec![0; predicate.parameters.len()];
        for number in 0..count {
            let mut rest = number;
            for (place, values) in &choices {
                ending[*place] = values[rest % values.len()];
                rest /= values.len();
            }
            let mut unknown = false;
            let covered = guards.iter().any(|guard| {
                let holds = guard.holds(self.model, &ending);
                unknown |= holds.is_none();
                holds == Some(true)
            });
            if !covered && !unknown {
                return Some(self.show(&choices, &ending));
            }
        }
        None
    }

    fn show(&self, choices: &[(usize, Vec<Value>)], ending: &[Value]) -> String {
        let predicate = &self.model.predicates[self.predicate];
        let one = |&(place, _): &(usize, Vec<Value>)| {
            let parameter = &predicate.parameters[place];
            let name = match parameter.name.as_str() {
                "" => format!("parameter {}", place + 1),
                name => name.to_owned(),
            };
            format!("{name} {}", self.model.show(parameter.of, ending[place]))
        };
        let values: Vec<String> = choices.iter().map(one).collect();
        match values.is_empty() {
            true => "any".to_owned(),
            false => values.join(", "),
        }
    }

    /// The values of a parameter that guards tell apart; none if they cannot be listed.
    fn values(&self, place: usize, guards: &[Guard]) -> Option<Vec<Value>> {
        let of = self.model.predicates[self.predicate].parameters[place].of;
        let span = match &self.model.types[of].values {
            Values::Truth => return Some(vec![0, 1]),
            Values::Symbols(symbols) => return Some(symbols.clone()),
            Values::Numbers(span) => *span,
        };
        if i128::from(span.max) - i128::from(span.min) < FEW_VALUES {
            return Some((span.min..=span.max).collect());
        }
        let mut values = BTreeSet::from([span.min, span.max]);
        let mut around = |value: Value| {
            let near = [value.saturating_sub(1), value, value.saturating_add(1)];
            values.extend(near.into_iter().filter(|near| span.contains(*near)));
        };
        for guard in guards {
            guard.literals[place].into_iter().for_each(&mut around);
            for relationship in guard.when.iter().filter(|of| guard.speaks_of(of, place)) {
                let others = relationship
                    .operands
                    .iter()
                    .filter_map(|operand| match operand {
                        Operand::Value(value) => Some(*value),
                        _ => None,
                    });
                let others: Vec<Value> = others.collect();
                let compares = matches!(
                    relationship.kind,
                    RelationshipKind::Equal
                        | RelationshipKind::Different
                        | RelationshipKind::Less
                        | RelationshipKind::AtMost
                );
                if !compares || others.len() + 1 != relationship.operands.len() {
                    return None;
                }
                others.into_iter().for_each(&mut around);
            }
        }
        Some(values.into_iter().collect())
    }
}

impl Guard<'_> {
    /// Whether it depends on a parameter.
    fn asks(&self, place: usize) -> bool {
        self.literals[place].is_some() || self.when.iter().any(|of| self.speaks_of(of, place))
    }

    fn speaks_of(&self, relationship: &Relationship, place: usize) -> bool {
        relationship.operands.iter().any(|operand| match *operand {
            Operand::Variable(id) => self.parameter(id) == Some(place),
            _ => false,
        })
    }

    fn parameter(&self, variable: VariableId) -> Option<usize> {
        self.parameters[variable]
    }

    /// Whether it holds of an ending; none if a function does not know.
    fn holds(&self, model: &Model, ending: &[Value]) -> Option<bool> {
        let mut literals = self.literals.iter().zip(ending);
        if !literals.all(|(literal, value)| literal.is_none_or(|literal| literal == *value)) {
            return Some(false);
        }
        for relationship in self.when {
            let value = |operand: &Operand| match *operand {
                Operand::Value(value) => Some(value),
                Operand::Variable(id) => self.parameter(id).map(|place| ending[place]),
                _ => None,
            };
            let values: Option<Vec<Value>> = relationship.operands.iter().map(value).collect();
            if !decide(model, relationship.kind, &values?)? {
                return Some(false);
            }
        }
        Some(true)
    }
}

/// Whether a target starts when its anchor ends.
fn is_meeting(relation: &Relation) -> bool {
    relation.kind == RelationKind::Meets
        || relation.distances.iter().any(|distance| {
            let Distance {
                from, to, min, max, ..
            } = *distance;
            let ends = (from, to) == (End::Finish, End::Start);
            ends && (min, max) == (Bound::Value(0), Bound::Value(0))
        })
}

fn has_condition(body: &Body) -> bool {
    match body {
        Body::All(parts) | Body::Any(parts, _) => parts.iter().any(has_condition),
        Body::Relation(relation) => relation.condition,
    }
}
