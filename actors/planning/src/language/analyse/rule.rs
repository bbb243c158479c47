//! Rules: compatibilities and decompositions, and how a search decides.

use std::collections::{BTreeMap, BTreeSet};

use super::Scope;
use super::entry::Entry;
use super::names::Names;
use super::pattern::{Master, Variables};
use crate::language::tree::{Form, Kind};
use crate::model::{
    Argument, Body, Control, Model, Operand, Pattern, PredicateId, Relationship, Rule, SlotOrder,
    Target, TimelineId, Values,
};

/// The options of rules. A decomposition has `:into` besides.
const OPTIONS: [&str; 9] = [
    ":duration_bounds",
    ":parameter_functions",
    ":constraints",
    ":when",
    ":uses",
    ":consumes",
    ":produces",
    ":compatibility_spec",
    ":into",
];

/// A rule as its text says it, before it is stored for each object that it holds for.
pub(super) struct Draft<'t> {
    pub(super) rule: Rule,
    pub(super) variables: Variables<'t>,
    pub(super) master: Master,
    /// By label: the state variable, if the token is one of the master's object.
    pub(super) same_timelines: Vec<Option<&'t str>>,
    /// By effect: the resource's name, if it is one of the master's object.
    pub(super) same_resources: Vec<Option<&'t str>>,
    /// The numbers of the tokens that have names.
    pub(super) labels: BTreeMap<&'t str, usize>,
    /// Their names, in the order of the text.
    pub(super) labelled: Vec<&'t str>,
}

/// Reads all rules to `drafts`, and how a search decides.
pub(super) fn read<'t>(
    mut scope: Scope<'t, '_>,
    entries: &[Entry<'t>],
    drafts: &mut Vec<Draft<'t>>,
) -> Control {
    let mut control = Control::default();
    for entry in entries {
        match entry.head {
            "Define_Compatibility" | "Define_Decomposition" => drafts.extend(scope.rule(entry)),
            "Define_Search_Control" => scope.control(entry, &mut control),
            _ => {}
        }
    }
    control
}

impl<'t> Scope<'t, '_> {
    fn rule(&mut self, entry: &Entry<'t>) -> Option<Draft<'t>> {
        let decomposes = entry.head == "Define_Decomposition";
        let known = if decomposes {
            &OPTIONS[..]
        } else {
            &OPTIONS[..OPTIONS.len() - 1]
        };
        entry.check_options(known, self.notes);
        let &[master] = entry.values.as_slice() else {
            let expected = format!("({} (SINGLE …) :option …)", entry.head);
            self.notes.error(entry.form, expected);
            return None;
        };
        let mut draft = self.master(master)?;
        draft.rule.position = entry.form.position();
        let mut bodies = Vec::new();
        if decomposes {
            match entry.one(":into", self.notes) {
                Some(into) => bodies.extend(self.decomposition(into, &mut draft)),
                None => self.notes.refuse(entry.form, "an option :into", "none"),
            }
        }
        if let Some(spec) = entry.one(":compatibility_spec", self.notes) {
            bodies.extend(self.body(spec, &mut draft));
        }
        draft.rule.body = match bodies.len() {
            1 => bodies.remove(0),
            _ => Body::All(bodies),
        };
        if let Some(bounds) = entry.one(":duration_bounds", self.notes) {
            draft.rule.duration = self.bounds(bounds, Some(0), &mut draft.variables);
        }
        for &form in entry.option(":parameter_functions") {
            self.functions(form, &mut draft);
        }
        for &form in entry.option(":constraints") {
            let found = self.relationship(form, &mut draft);
            draft.rule.relationships.extend(found);
        }
        for &form in entry.option(":when") {
            let found = self.guard(form, &mut draft);
            draft.rule.when.extend(found);
        }
        for option in [":uses", ":consumes", ":produces"] {
            for &form in entry.option(option) {
                self.effect(form, option, &mut draft);
            }
        }
        draft.rule.variables = std::mem::take(&mut draft.variables.list);
        self.spend_instances(entry.form, &draft)?;
        Some(draft)
    }

    /// A constraint that speaks of the master alone, since there is nothing else yet when it is
    /// asked for.
    fn guard(&mut self, form: Form<'t>, draft: &mut Draft<'t>) -> Option<Relationship> {
        let guard = self.relationship(form, draft)?;
        let master = &draft.rule.master;
        let is_of_master = |operand: &Operand| match *operand {
            Operand::Value(_) => true,
            Operand::Variable(id) => {
                master.object == Some(id) || master.arguments.contains(&Argument::Variable(id))
            }
            Operand::Start(label) | Operand::Finish(label) | Operand::Duration(label) => label == 0,
        };
        if !guard.operands.iter().all(is_of_master) {
            self.notes
                .error(form, "a guard of the master's variables and times");
            return None;
        }
        Some(guard)
    }

    /// Takes what the rule names, for each object that it holds for, from what the text may name.
    fn spend_instances(&mut self, form: Form<'t>, draft: &Draft<'t>) -> Option<()> {
        let mut once = form.size();
        look_at_patterns(&draft.rule.body, &mut |pattern, label| {
            if draft.same_timelines[label].is_none() {
                once = once.saturating_add(pattern.timelines.len());
            }
        });
        self.spend(
            form.position(),
            once.saturating_mul(draft.master.timelines.len()),
        )
    }

    /// A rule that says nothing yet of the tokens of a pattern.
    fn master(&mut self, form: Form<'t>) -> Option<Draft<'t>> {
        let mut variables = Variables::default();
        let found = self.pattern(form, &mut variables, &Master::default())?;
        let timelines = found.pattern.timelines.clone();
        let class = self.class_of(self.object_of(timelines[0]));
        let class = class.filter(|&of| match &self.model.types[of].values {
            Values::Symbols(symbols) => timelines
                .iter()
                .all(|&at| symbols.binary_search(&self.object_of(at)).is_ok()),
            _ => false,
        });
        let class = class.map(|of| self.model.types[of].name.clone());
        let rule = Rule {
            position: form.position(),
            master: found.pattern.clone(),
            variables: Vec::new(),
            when: Vec::new(),
            duration: None,
            relationships: Vec::new(),
            effects: Vec::new(),
            body: Body::All(Vec::new()),
            labels: 1,
        };
        Some(Draft {
            rule,
            variables,
            master: Master {
                class,
                object: found.pattern.object,
                timelines,
            },
            same_timelines: vec![None],
            same_resources: Vec::new(),
            labels: BTreeMap::from([("master", 0)]),
            labelled: Vec::new(),
        })
    }

    /// `((Class SV) Predicate)` or `((Class SV) Predicate latest)`.
    fn subgoal(
        &mut self,
        form: Form<'t>,
    ) -> Option<(Vec<TimelineId>, PredicateId, Option<Form<'t>>)> {
        let mut parts = form.children();
        let (Some(place), Some(name)) = (parts.next(), parts.next()) else {
            self.notes.error(form, "((Class Name_SV) Predicate)");
            return None;
        };
        let more = parts.next();
        let mut variables = Variables::default();
        let place = self.place(place, &mut variables, &Master::default())?;
        let predicate = self.member(name, &place)?;
        Some((place.timelines, predicate, more))
    }

    fn control(&mut self, entry: &Entry<'t>, control: &mut Control) {
        entry.check_options(
            &[":subgoal_order", ":slot_order", ":leave_unbound"],
            self.notes,
        );
        if let Some(&value) = entry.values.first() {
            self.notes
                .error(value, "an option of Define_Search_Control");
        }
        let mut seen: BTreeSet<_> = control.subgoals.iter().copied().collect();
        for &form in entry.option(":subgoal_order") {
            let Some((timelines, predicate, more)) = self.subgoal(form) else {
                continue;
            };
            if let Some(more) = more {
                self.notes.error(more, ") after the predicate");
            }
            let subgoals = timelines.into_iter().map(|timeline| (timeline, predicate));
            control
                .subgoals
                .extend(subgoals.filter(|subgoal| seen.insert(*subgoal)));
        }
        for &form in entry.option(":slot_order") {
            let Some((timelines, predicate, order)) = self.subgoal(form) else {
                continue;
            };
            let known = ["earliest", "latest", "nearest"];
            let order = match order.map(Form::word) {
                Some("earliest") => SlotOrder::Earliest,
                Some("latest") => SlotOrder::Latest,
                Some("nearest") => SlotOrder::Nearest,
                _ => {
                    let at = order.unwrap_or(form);
                    self.notes
                        .unknown(at, "earliest, latest or nearest", known.into_iter());
                    continue;
                }
            };
            control
                .slots
                .extend(timelines.into_iter().map(|at| (at, predicate, order)));
        }
        for &form in entry.option(":leave_unbound") {
            self.leave_unbound(form, control);
        }
    }

    /// `(Predicate ?parameter …)`; without parameters, all outputs.
    fn leave_unbound(&mut self, form: Form<'t>, control: &mut Control) {
        let mut parts = form.children();
        let Some(name) = parts.next().filter(|_| form.is_list()) else {
            self.notes.error(form, "(Predicate ?parameter …)");
            return;
        };
        let Some(&id) = self.names.predicates.get(name.word()) else {
            let known = self.names.predicates.keys().map(String::as_str);
            self.notes.unknown(name, "a predicate", known);
            return;
        };
        let model = self.model;
        let predicate = &model.predicates[id];
        let mut places: Vec<usize> = Vec::new();
        for part in parts {
            let of_that_name = |of: &crate::model::Parameter| of.name == part.word();
            match predicate.parameters.iter().position(of_that_name) {
                Some(place) if part.kind() == Kind::Variable => places.push(place),
                _ => {
                    let known = predicate.parameters.iter().map(|of| of.name.as_str());
                    let expected = format!("a parameter of {}", predicate.name);
                    self.notes.unknown(part, expected, known);
                }
            }
        }
        if parts.next().is_none() {
            places.extend(predicate.inputs..predicate.parameters.len());
        }
        control
            .unbound
            .extend(places.into_iter().map(|place| (id, place)));
    }
}

/// Stores each rule once for every object that it holds for.
pub(super) fn instantiate(model: &mut Model, names: &Names, drafts: &[Draft]) {
    let timelines = model.timelines.iter();
    model.rules_by_timeline = timelines
        .map(|timeline| vec![Vec::new(); timeline.predicates.len()])
        .collect();
    for draft in drafts {
        for &timeline in &draft.master.timelines {
            let id = model.rules.len();
            let rule = instance(draft, timeline, model, names);
            let predicates = &model.timelines[timeline].predicates;
            let place = predicates
                .iter()
                .position(|of| *of == rule.master.predicate);
            let place = place.expect("the pattern was checked against the timeline");
            model.rules_by_timeline[timeline][place].push(id);
            model.rules.push(rule);
        }
    }
}

/// A rule for the object of one timeline.
fn instance(draft: &Draft, timeline: TimelineId, model: &Model, names: &Names) -> Rule {
    let object = model.timelines[timeline].object;
    let mut rule = draft.rule.clone();
    rule.master.timelines = vec![timeline];
    each_pattern(&mut rule.body, &mut |pattern, label| {
        let same = draft.same_timelines[label].and_then(|name| names.timeline(object, name));
        if let Some(timeline) = same {
            pattern.timelines = vec![timeline];
        }
    });
    for (effect, same) in rule.effects.iter_mut().zip(&draft.same_resources) {
        if let Some(resource) = same.and_then(|name| names.resource(object, name)) {
            effect.resources = vec![resource];
        }
    }
    rule
}

/// Looks at the pattern of each token that a body asks for, and its label.
fn look_at_patterns(body: &Body, look: &mut impl FnMut(&Pattern, usize)) {
    match body {
        Body::All(parts) | Body::Any(parts, _) => {
            for part in parts {
                look_at_patterns(part, look);
            }
        }
        Body::Relation(relation) => {
            if let Target::New(pattern, label) = &relation.target {
                look(pattern, *label);
            }
        }
    }
}

/// Does something with the pattern of each token that a body asks for, and its label.
fn each_pattern(body: &mut Body, act: &mut impl FnMut(&mut Pattern, usize)) {
    match body {
        Body::All(parts) | Body::Any(parts, _) => {
            for part in parts {
                each_pattern(part, act);
            }
        }
        Body::Relation(relation) => {
            if let Target::New(pattern, label) = &mut relation.target {
                act(pattern, *label);
            }
        }
    }
}
