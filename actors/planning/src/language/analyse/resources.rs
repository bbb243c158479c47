//! Resources: their declarations, and what rules do to them.

use super::Scope;
use super::declare::Declarations;
use super::entry::Entry;
use super::literal;
use super::rule::Draft;
use crate::language::tree::{Form, Kind};
use crate::model::{
    Bound, Effect, EffectKind, End, NUMBER, Profile, Resource, ResourceKind, TimelineId, Value,
};
use crate::temporal::Span;
use crate::{Ticks, model};

const OPTIONS: [&str; 6] = [
    ":kind",
    ":capacity",
    ":initial",
    ":limits",
    ":window",
    ":changes",
];
const KINDS: [&str; 4] = ["unary", "renewable", "depletable", "rate_limited"];

/// `(Define_Resource (Class name) :kind … )`, for each object of the class.
pub(super) fn declare<'t>(to: &mut Declarations<'t, '_>, entry: &Entry<'t>) {
    entry.check_options(&OPTIONS, to.notes);
    if to.model.profile == Profile::Executive {
        to.notes.refuse(
            entry.form,
            "no resources in a model of profile executive",
            "one",
        );
        return;
    }
    let &[of] = entry.values.as_slice() else {
        to.notes.error(
            entry.form,
            "(Define_Resource (Class name) :kind depletable :capacity 100)",
        );
        return;
    };
    let Some((class, name)) = to.of_class(of, "a name") else {
        return;
    };
    let word = name.symbol().filter(|word| !word.contains('.'));
    let Some(word) = word else {
        to.notes.error(name, "a name of letters, digits and _");
        return;
    };
    let position = name.position();
    let Some(resource) = levels(to, entry) else {
        return;
    };
    let (objects, named) = to.objects_of(class);
    let objects = objects.to_vec();
    if !to.resources.insert((class, word)) {
        to.notes.error(name, "a name that is not defined yet");
        return;
    }
    to.spend(
        entry.form,
        objects.len().saturating_mul(1 + resource.changes.len()),
    );
    if to.budget == 0 {
        return;
    }
    for object in objects {
        let full = format!("{}.{word}", to.model.symbols[object as usize]);
        to.model.resources.push(Resource {
            name: if named { full } else { word.to_owned() },
            object,
            position,
            ..resource.clone()
        });
    }
}

/// Notes options that resources of a kind do not have.
fn check_options_of<'t>(to: &mut Declarations<'t, '_>, entry: &Entry<'t>, kind: &str) {
    let allowed: &[&str] = match kind {
        "unary" => &[":kind", ":changes"],
        "renewable" => &[":kind", ":changes", ":capacity"],
        "rate_limited" => &[":kind", ":changes", ":capacity", ":window"],
        _ => &[":kind", ":changes", ":capacity", ":initial", ":limits"],
    };
    for option in OPTIONS.iter().filter(|option| !allowed.contains(option)) {
        if let Some(keyword) = entry.keyword(option) {
            to.notes
                .error(keyword, format!("an option of a {kind} resource"));
        }
    }
}

/// What a declaration says of kind and levels; name, object and position are still to be given.
fn levels<'t>(to: &mut Declarations<'t, '_>, entry: &Entry<'t>) -> Option<Resource> {
    let Some(kind) = entry.one(":kind", to.notes) else {
        to.notes.refuse(entry.form, "a :kind", "none");
        return None;
    };
    if !KINDS.contains(&kind.word()) {
        let expected = "unary, renewable, depletable or rate_limited";
        to.notes.unknown(kind, expected, KINDS.into_iter());
        return None;
    }
    check_options_of(to, entry, kind.word());
    let mut value = |name: &str, least: Value| {
        let form = entry.one(name, to.notes)?;
        let value = literal::whole(form, to.constants);
        let value = value.filter(|value| *value >= least);
        if value.is_none() {
            to.notes
                .error(form, format!("a whole number from {least} on"));
        }
        value
    };
    let capacity = value(":capacity", 0);
    let window = value(":window", 1);
    let initial = value(":initial", Value::MIN);
    let limits = entry.one(":limits", to.notes);
    let limits = limits.and_then(|form| literal::span(form, to.constants, to.notes));
    let changes = changes(to, entry);
    let missing = |to: &mut Declarations, what: &str| {
        let expected = format!("a {what} of a {} resource", kind.word());
        to.notes.refuse(entry.form, expected, "none");
        None
    };
    let (kind, initial, limits) = match (kind.word(), capacity) {
        ("unary", _) => (ResourceKind::Renewable, 1, Span::new(0, 1)),
        ("renewable", Some(most)) => (ResourceKind::Renewable, most, Span::new(0, most)),
        ("rate_limited", Some(most)) => match window {
            Some(window_ticks) => (
                ResourceKind::RateLimited { window_ticks },
                most,
                Span::new(0, most),
            ),
            None => return missing(to, ":window"),
        },
        ("depletable", capacity) => match limits.or(capacity.map(|most| Span::new(0, most))) {
            Some(limits) => match initial.or(capacity) {
                Some(initial) => (ResourceKind::Depletable, initial, limits),
                None => return missing(to, ":initial"),
            },
            None => return missing(to, ":capacity"),
        },
        _ => return missing(to, ":capacity"),
    };
    if !limits.contains(initial) {
        let expected = format!("an initial level within {limits:?}");
        to.notes.refuse(entry.form, expected, initial.to_string());
    }
    let (name, object, position) = (String::new(), 0, model::Position::default());
    Some(Resource {
        name,
        object,
        kind,
        initial,
        limits,
        changes,
        position,
    })
}

/// `:changes ((tick delta) …)`.
fn changes<'t>(to: &mut Declarations<'t, '_>, entry: &Entry<'t>) -> Vec<(Ticks, Value)> {
    let list = entry.one(":changes", to.notes);
    let mut changes = Vec::new();
    for pair in list.into_iter().flat_map(|list| list.children()) {
        let mut parts = pair.children();
        let numbers = [parts.next(), parts.next()].map(|form| literal::whole(form?, to.constants));
        match (numbers, parts.next()) {
            ([Some(tick), Some(delta)], None) if tick >= 0 => changes.push((tick, delta)),
            _ => to
                .notes
                .error(pair, "a change, as (tick delta), with a tick from 0 on"),
        }
    }
    changes.sort_by_key(|(tick, _)| *tick);
    changes
}

impl<'t> Scope<'t, '_> {
    /// `((Class name) amount)` or `((name) amount end)`: an effect of a rule.
    pub(super) fn effect(&mut self, form: Form<'t>, option: &str, draft: &mut Draft<'t>) {
        let parts: Vec<Form> = form.children().collect();
        let (of, amount, end) = match *parts.as_slice() {
            [of, amount] if form.is_list() => (of, amount, None),
            [of, amount, end] if form.is_list() && option != ":uses" => (of, amount, Some(end)),
            _ => {
                self.notes
                    .error(form, "a resource and an amount, as ((Rover battery) 5)");
                return;
            }
        };
        let end = match (end.map(Form::word), option) {
            (None, ":consumes") | (Some("start"), _) => End::Start,
            (None, _) | (Some("end"), _) => End::Finish,
            (Some(_), _) => {
                self.notes.error(end.unwrap_or(form), "start or end");
                return;
            }
        };
        let kind = match option {
            ":uses" => EffectKind::Uses,
            ":consumes" => EffectKind::Consumes(end),
            _ => EffectKind::Produces(end),
        };
        let Some((resources, same)) = self.resources(of, draft) else {
            return;
        };
        for &resource in &resources {
            let allowed: &[&str] = match self.model.resources[resource].kind {
                ResourceKind::Renewable => &[":uses"],
                ResourceKind::RateLimited { .. } => &[":uses", ":consumes"],
                ResourceKind::Depletable => continue,
            };
            if !allowed.contains(&option) {
                let name = &self.model.resources[resource].name;
                let expected = format!("{} of {name}", allowed.join(" or "));
                self.notes.refuse(form, expected, option);
                return;
            }
        }
        let amount = match amount.kind() {
            Kind::Variable => self
                .variable(amount, Some(NUMBER), &mut draft.variables)
                .map(Bound::Variable),
            _ => self.number(amount).and_then(|value| {
                if value < 0 {
                    self.notes.error(amount, "an amount from 0 on");
                }
                Some(Bound::Value(value)).filter(|_| value >= 0)
            }),
        };
        let Some(amount) = amount else { return };
        draft.rule.effects.push(Effect {
            position: form.position(),
            resources,
            kind,
            amount,
        });
        draft.same_resources.push(same);
    }

    /// The resources that `(Class name)`, `(object name)` or `(name)` names, and its name if it is
    /// that of the master's object.
    fn resources(
        &mut self,
        of: Form<'t>,
        draft: &Draft<'t>,
    ) -> Option<(Vec<model::ResourceId>, Option<&'t str>)> {
        let mut parts = of.children();
        let (owner, name) = match (parts.next(), parts.next(), parts.next()) {
            (Some(name), None, None) => (None, name),
            (Some(owner), Some(name), None) => (Some(owner), name),
            _ => {
                self.notes.error(of, "a resource, as (Rover battery)");
                return None;
            }
        };
        let same = owner.is_none_or(|owner| draft.master.class.as_deref() == Some(owner.word()));
        if self.budget == 0 {
            return None;
        }
        let objects = match owner.filter(|_| !same) {
            None => draft
                .master
                .timelines
                .iter()
                .map(|&at| self.object_of(at))
                .collect(),
            Some(owner) => match self.names.objects(self.model, owner.word()) {
                Some(objects) => objects,
                None => {
                    let (names, model) = (self.names, self.model);
                    self.notes
                        .unknown(owner, "a class or an object", names.owners(model));
                    return None;
                }
            },
        };
        let found = objects
            .iter()
            .map(|&object| self.names.resource(object, name.word()));
        let Some(found) = found.collect::<Option<Vec<_>>>() else {
            let known = self.names.resources_of(&objects);
            self.notes.unknown(name, "a resource", known);
            return None;
        };
        self.spend(of.position(), found.len())?;
        Some((found, same.then_some(name.word())))
    }

    /// The object of a timeline.
    pub(super) fn object_of(&self, timeline: TimelineId) -> Value {
        self.model.timelines[timeline].object
    }
}
