//! The names of a model, and what each stands for.

use std::collections::BTreeMap;

use crate::model::{Model, PredicateId, ResourceId, TimelineId, TypeId, Value, Values};

/// The tables of names of a model.
#[derive(Debug, Default)]
pub(super) struct Names {
    pub(super) symbols: BTreeMap<String, Value>,
    pub(super) types: BTreeMap<String, TypeId>,
    pub(super) predicates: BTreeMap<String, PredicateId>,
    pub(super) tables: BTreeMap<String, usize>,
    pub(super) functions: BTreeMap<String, usize>,
    /// By object and state variable.
    timelines: BTreeMap<Value, BTreeMap<String, TimelineId>>,
    /// By state variable: the timelines of all objects.
    state_variables: BTreeMap<String, Vec<TimelineId>>,
    /// By object and name.
    resources: BTreeMap<Value, BTreeMap<String, ResourceId>>,
}

/// The part of a full name that is not the object's.
pub(super) fn last_part(name: &str) -> &str {
    name.rsplit('.').next().unwrap_or(name)
}

impl Names {
    pub(super) fn of(model: &Model) -> Names {
        let mut names = Names::default();
        for (id, symbol) in model.symbols.iter().enumerate() {
            names.symbols.insert(symbol.clone(), id as Value);
        }
        for (id, of) in model.types.iter().enumerate() {
            names.types.insert(of.name.clone(), id);
        }
        for (id, predicate) in model.predicates.iter().enumerate() {
            names.predicates.insert(predicate.name.clone(), id);
        }
        for (id, table) in model.tables.iter().enumerate() {
            names.tables.insert(table.name.clone(), id);
        }
        for (id, function) in model.functions.iter().enumerate() {
            names.functions.insert(function.name.clone(), id);
        }
        for (id, timeline) in model.timelines.iter().enumerate() {
            let name = last_part(&timeline.name).to_owned();
            names
                .state_variables
                .entry(name.clone())
                .or_default()
                .push(id);
            names
                .timelines
                .entry(timeline.object)
                .or_default()
                .insert(name, id);
        }
        for (id, resource) in model.resources.iter().enumerate() {
            let name = last_part(&resource.name).to_owned();
            names
                .resources
                .entry(resource.object)
                .or_default()
                .insert(name, id);
        }
        names
    }

    /// The objects that a word names: those of a class, or one.
    pub(super) fn objects(&self, model: &Model, word: &str) -> Option<Vec<Value>> {
        if let Some(&of) = self.types.get(word) {
            let Values::Symbols(objects) = &model.types[of].values else {
                return None;
            };
            return Some(objects.clone());
        }
        self.symbols.get(word).map(|&object| vec![object])
    }

    pub(super) fn timeline(&self, object: Value, state_variable: &str) -> Option<TimelineId> {
        self.timelines.get(&object)?.get(state_variable).copied()
    }

    /// The timelines of all objects for a state variable.
    pub(super) fn timelines(&self, state_variable: &str) -> &[TimelineId] {
        self.state_variables
            .get(state_variable)
            .map_or(&[], Vec::as_slice)
    }

    /// The state variables of some objects.
    pub(super) fn state_variables_of<'s>(
        &'s self,
        objects: &'s [Value],
    ) -> impl Iterator<Item = &'s str> {
        let objects = objects
            .iter()
            .filter_map(|object| self.timelines.get(object));
        objects.flat_map(|of| of.keys().map(String::as_str))
    }

    pub(super) fn all_state_variables(&self) -> impl Iterator<Item = &str> {
        self.state_variables.keys().map(String::as_str)
    }

    pub(super) fn resource(&self, object: Value, name: &str) -> Option<ResourceId> {
        self.resources.get(&object)?.get(name).copied()
    }

    /// The resources of some objects.
    pub(super) fn resources_of<'s>(
        &'s self,
        objects: &'s [Value],
    ) -> impl Iterator<Item = &'s str> {
        let objects = objects
            .iter()
            .filter_map(|object| self.resources.get(object));
        objects.flat_map(|of| of.keys().map(String::as_str))
    }

    /// The words that name one object or more that have timelines or resources.
    pub(super) fn owners<'s>(&'s self, model: &'s Model) -> impl Iterator<Item = &'s str> {
        let owns = |object: &Value| {
            self.timelines.contains_key(object) || self.resources.contains_key(object)
        };
        let classes = model.types.iter().filter(move |of| match &of.values {
            Values::Symbols(objects) => objects.first().is_some_and(owns),
            _ => false,
        });
        let objects = self.symbols.iter().filter(move |(_, object)| owns(object));
        classes
            .map(|of| of.name.as_str())
            .chain(objects.map(|(name, _)| name.as_str()))
    }
}
