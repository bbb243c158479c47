//! Problems: what is the case, what is wanted, and what it is worth.

mod goals;

use std::collections::{BTreeMap, BTreeSet};

use super::entry::Entry;
use super::literal::{self, A_NUMBER};
use super::pattern::{Master, Variables};
use super::{Scope, body};
use crate::language::tree::{Form, Kind};
use crate::model::{
    Argument, Combination, Distance, End, Fact, GoalId, Order, Problem, ResourceId,
};
use crate::temporal::{FURTHEST, Span};

/// Reads a problem.
pub(super) fn read<'t>(scope: Scope<'t, '_>, entries: &[Entry<'t>]) -> Problem {
    let mut reader = Reader {
        scope,
        problem: Problem::default(),
        goals: BTreeMap::new(),
        recurring: BTreeSet::new(),
        combinations: BTreeSet::new(),
        levels: BTreeSet::new(),
    };
    reader.header(entries);
    for entry in entries {
        match entry.head {
            "Fact" => reader.fact(entry),
            "Goal" => reader.goal(entry),
            "Level" => reader.level(entry),
            "Change" => reader.change(entry),
            _ => {}
        }
    }
    // Goals may be spoken of before they stand.
    for entry in entries {
        match entry.head {
            "Combination" => reader.combination(entry),
            "Order" => reader.order(entry),
            _ => {}
        }
    }
    reader.problem
}

struct Reader<'t, 'n> {
    scope: Scope<'t, 'n>,
    problem: Problem,
    goals: BTreeMap<String, GoalId>,
    /// The names of goals that stand for several.
    recurring: BTreeSet<&'t str>,
    /// The names of combinations.
    combinations: BTreeSet<&'t str>,
    /// The resources whose level is given.
    levels: BTreeSet<ResourceId>,
}

impl<'t> Reader<'t, '_> {
    /// `(Define_Problem name :horizon [0 1000])`.
    fn header(&mut self, entries: &[Entry<'t>]) {
        let mut headers = entries
            .iter()
            .filter(|entry| entry.head == "Define_Problem");
        let Some(header) = headers.next() else {
            let expected = "(Define_Problem name :horizon [0 1000])";
            self.scope
                .notes
                .refuse(entries[0].form, expected, "a problem without one");
            return;
        };
        if let Some(more) = headers.next() {
            self.scope.notes.error(more.form, "one Define_Problem");
        }
        header.check_options(&[":horizon"], self.scope.notes);
        match header.values.as_slice() {
            [name] if name.symbol().is_some() => self.problem.name = name.word().to_owned(),
            _ => self
                .scope
                .notes
                .error(header.form, "(Define_Problem name :horizon [0 1000])"),
        }
        let Some(form) = header.one(":horizon", self.scope.notes) else {
            self.scope
                .notes
                .refuse(header.form, "an option :horizon", "none");
            return;
        };
        let Some(span) = self.span(form) else { return };
        if span.min != 0 || span.max < 1 || span.max > FURTHEST {
            self.scope
                .notes
                .error(form, "a horizon from 0 to its end, as [0 1000]");
            return;
        }
        self.problem.horizon = span.max;
        let says = |entry: &Entry| matches!(entry.head, "Goal" | "Fact");
        if !entries.iter().any(says) {
            let expected = "a goal or a fact";
            self.scope
                .notes
                .warn(header.form, expected, "a problem without any");
        }
    }

    fn span(&mut self, form: Form<'t>) -> Option<Span> {
        literal::span(form, self.scope.constants, self.scope.notes)
    }

    /// Times that an option gives, within the horizon.
    fn times(&mut self, entry: &Entry<'t>, option: &str, usual: Span) -> Option<Span> {
        let Some(form) = entry.one(option, self.scope.notes) else {
            return entry.keyword(option).is_none().then_some(usual);
        };
        let span = self.span(form)?;
        let within = span.intersect(Span::new(0, self.problem.horizon));
        if within.is_empty() {
            let expected = format!("times within the horizon [0 {}]", self.problem.horizon);
            self.scope.notes.error(form, expected);
            return None;
        }
        Some(within)
    }

    fn fact(&mut self, entry: &Entry<'t>) {
        entry.check_options(&[":start", ":end"], self.scope.notes);
        let &[form] = entry.values.as_slice() else {
            self.scope
                .notes
                .error(entry.form, "(Fact (SINGLE …) :start 0)");
            return;
        };
        let mut variables = Variables::default();
        let found = self.scope.pattern(form, &mut variables, &Master::default());
        let start = self.times(entry, ":start", Span::exactly(0));
        let (Some(found), Some(start)) = (found, start) else {
            return;
        };
        let usual = Span::new(start.min, self.problem.horizon);
        let Some(finish) = self.times(entry, ":end", usual) else {
            return;
        };
        let &[timeline] = found.pattern.timelines.as_slice() else {
            let expected = "an object, since its class has several";
            self.scope.notes.error(form, expected);
            return;
        };
        if finish.max < start.min {
            let expected = format!("an end from {} on", start.min);
            self.scope
                .notes
                .refuse(entry.form, expected, format!("{finish:?}"));
            return;
        }
        let value = |argument: &Argument| match argument {
            Argument::Value(value) => Some(*value),
            Argument::Any | Argument::Variable(_) => None,
        };
        let values = found.pattern.arguments.iter().map(value).collect();
        let (position, predicate) = (entry.form.position(), found.pattern.predicate);
        self.problem.facts.push(Fact {
            position,
            timeline,
            predicate,
            values,
            start,
            finish,
        });
    }

    /// The goal that a word names.
    fn goal_named(&mut self, form: Form<'t>) -> Option<GoalId> {
        let known = self.goals.get(form.word()).copied();
        if known.is_none() {
            let expected = match self.recurring.contains(form.word()) {
                true => format!("one of its goals, as {}_1", form.word()),
                false => "a goal".to_owned(),
            };
            self.scope
                .notes
                .unknown(form, expected, self.goals.keys().map(String::as_str));
        }
        known
    }

    fn combination(&mut self, entry: &Entry<'t>) {
        entry.check_options(&[":weight"], self.scope.notes);
        let &[name, list] = entry.values.as_slice() else {
            self.scope
                .notes
                .error(entry.form, "(Combination name (goal goal) :weight 5)");
            return;
        };
        if name.symbol().is_none() {
            self.scope.notes.error(name, "the combination's name");
            return;
        }
        if !self.combinations.insert(name.word()) {
            self.scope
                .notes
                .error(name, "a name that no other combination has");
        }
        let weight = self.weight(entry);
        let (mut goals, mut seen) = (Vec::new(), BTreeSet::new());
        for form in list.children() {
            let Some(goal) = self.goal_named(form) else {
                return;
            };
            if !seen.insert(goal) {
                self.scope.notes.error(form, "each goal once");
                return;
            }
            goals.push(goal);
        }
        if goals.is_empty() {
            self.scope
                .notes
                .error(list, "one goal or more, in parentheses");
        }
        let Some(weight) = weight else { return };
        let (name, position) = (name.word().to_owned(), entry.form.position());
        self.problem.combinations.push(Combination {
            name,
            position,
            goals,
            weight,
        });
    }

    /// `(Order (before [5 10] goal goal))` or `(Order (temporaldistance (start g) [0 5] (end h)))`.
    fn order(&mut self, entry: &Entry<'t>) {
        entry.check_options(&[], self.scope.notes);
        let &[form] = entry.values.as_slice() else {
            self.scope
                .notes
                .error(entry.form, "(Order (before goal goal))");
            return;
        };
        let found = match form.head() {
            Some("temporaldistance") => self.distance(form),
            _ => self.relation(form),
        };
        let Some((from, to, distances)) = found else {
            return;
        };
        self.problem.orders.push(Order {
            position: entry.form.position(),
            from,
            to,
            distances,
        });
    }

    fn relation(&mut self, form: Form<'t>) -> Option<(GoalId, GoalId, Vec<Distance>)> {
        let Some(kind) = form.head().and_then(body::relation_kind) else {
            let head = form.children().next().unwrap_or(form);
            self.scope
                .notes
                .unknown(head, "a relation", body::relation_words());
            return None;
        };
        let parts = form.children().skip(1);
        let (bounds, goals): (Vec<Form>, Vec<Form>) =
            parts.partition(|part| part.kind() == Kind::Span);
        let most = kind.distances(&[]).len();
        let (&[from, to], true) = (goals.as_slice(), bounds.len() <= most) else {
            let expected = format!("at most {most} bounds and two goals");
            self.scope.notes.error(form, expected);
            return None;
        };
        let mut none = Variables::default();
        let mut given = Vec::new();
        for bounds in bounds {
            given.push(self.scope.bounds(bounds, Some(0), &mut none)?);
        }
        self.no_variables(form, &none)?;
        let (from, to) = (self.goal_named(from), self.goal_named(to));
        Some((from?, to?, kind.distances(&given)))
    }

    fn distance(&mut self, form: Form<'t>) -> Option<(GoalId, GoalId, Vec<Distance>)> {
        let parts: Vec<Form> = form.children().skip(1).collect();
        let &[from, bounds, to] = parts.as_slice() else {
            let expected = "(temporaldistance (start goal) [0 10] (end goal))";
            self.scope.notes.error(form, expected);
            return None;
        };
        let mut none = Variables::default();
        let [min, max] = self.scope.bounds(bounds, None, &mut none)?;
        self.no_variables(form, &none)?;
        let (from, first) = self.end(from)?;
        let (to, second) = self.end(to)?;
        Some((
            first,
            second,
            vec![Distance {
                from,
                to,
                min,
                max,
                backward: false,
            }],
        ))
    }

    fn no_variables(&mut self, form: Form<'t>, variables: &Variables) -> Option<()> {
        if let Some(variable) = variables.list.first() {
            self.scope
                .notes
                .refuse(form, "bounds that are numbers", &*variable.name);
            return None;
        }
        Some(())
    }

    /// `(start goal)` or `(end goal)`.
    fn end(&mut self, form: Form<'t>) -> Option<(End, GoalId)> {
        let mut parts = form.children().skip(1);
        let end = match form.head() {
            Some("start") => End::Start,
            Some("end") => End::Finish,
            _ => {
                self.scope.notes.error(form, "(start goal) or (end goal)");
                return None;
            }
        };
        let (Some(goal), None) = (parts.next(), parts.next()) else {
            self.scope.notes.error(form, "(start goal) or (end goal)");
            return None;
        };
        Some((end, self.goal_named(goal)?))
    }

    /// The resource of `(object name)`, or of `(Class name)` if there is one object.
    fn resource(&mut self, form: Form<'t>) -> Option<ResourceId> {
        let mut parts = form.children();
        let (Some(owner), Some(name), None) = (parts.next(), parts.next(), parts.next()) else {
            self.scope
                .notes
                .error(form, "a resource, as (rover_1 battery)");
            return None;
        };
        let (names, model) = (self.scope.names, self.scope.model);
        let Some(objects) = names.objects(model, owner.word()) else {
            self.scope
                .notes
                .unknown(owner, "a class or an object", names.owners(model));
            return None;
        };
        let &[object] = objects.as_slice() else {
            self.scope
                .notes
                .error(owner, "an object, since its class has several");
            return None;
        };
        let resource = names.resource(object, name.word());
        if resource.is_none() {
            let known = names.resources_of(&objects);
            self.scope.notes.unknown(name, "a resource", known);
        }
        resource
    }

    /// `(Level (rover_1 battery) 50)`.
    fn level(&mut self, entry: &Entry<'t>) {
        entry.check_options(&[], self.scope.notes);
        let &[of, level] = entry.values.as_slice() else {
            self.scope
                .notes
                .error(entry.form, "(Level (rover_1 battery) 50)");
            return;
        };
        let (resource, value) = (self.resource(of), self.scope.number(level));
        let (Some(resource), Some(value)) = (resource, value) else {
            return;
        };
        let limits = self.scope.model.resources[resource].limits;
        if !limits.contains(value) {
            self.scope
                .notes
                .error(level, format!("a level within {limits:?}"));
        } else if !self.levels.insert(resource) {
            self.scope.notes.error(of, "one level of each resource");
        } else {
            self.problem.initial.push((resource, value));
        }
    }

    /// `(Change (rover_1 battery) 100 -5)`.
    fn change(&mut self, entry: &Entry<'t>) {
        entry.check_options(&[], self.scope.notes);
        let &[of, tick, delta] = entry.values.as_slice() else {
            self.scope
                .notes
                .error(entry.form, "(Change (rover_1 battery) tick delta)");
            return;
        };
        let resource = self.resource(of);
        let (at, change) = (self.scope.number(tick), self.scope.number(delta));
        let (Some(resource), Some(at), Some(change)) = (resource, at, change) else {
            return;
        };
        if !(0..=self.problem.horizon).contains(&at) {
            self.scope
                .notes
                .error(tick, format!("{A_NUMBER}, within the horizon"));
            return;
        }
        self.problem.changes.push((resource, at, change));
    }
}
