//! Patterns of tokens, and the variables in them.

use std::collections::BTreeMap;

use super::Scope;
use super::literal::{self, Side, Sort, describe};
use crate::language::findings::arguments;
use crate::language::tree::{Form, Kind};
use crate::model::{
    Argument, Bound, NUMBER, Pattern, TimelineId, TypeId, Value, Values, Variable, VariableId,
};

/// The variables of a rule or a goal.
#[derive(Debug, Default)]
pub(super) struct Variables<'t> {
    pub(super) list: Vec<Variable>,
    names: BTreeMap<&'t str, VariableId>,
    /// By variable: whether a pattern has said of which type it is.
    typed: Vec<bool>,
}

/// Whose token a rule is about: what the words for "the same object" are.
#[derive(Debug, Default)]
pub(super) struct Master {
    /// The class of the master's object.
    pub(super) class: Option<String>,
    /// The variable that is the master's object.
    pub(super) object: Option<VariableId>,
    /// The timelines for which the rule holds.
    pub(super) timelines: Vec<TimelineId>,
}

/// A pattern, and its state variable if it is one of the master's object.
pub(super) struct Found<'t> {
    pub(super) pattern: Pattern,
    pub(super) same: Option<&'t str>,
}

pub(super) struct Place<'t> {
    pub(super) timelines: Vec<TimelineId>,
    object: Option<VariableId>,
    same: Option<&'t str>,
    state_variable: &'t str,
}

/// How a pattern is written.
const A_PATTERN: &str = "(SINGLE ((Class Name_SV) ((Predicate (argument …)))))";

impl<'t> Scope<'t, '_> {
    /// `(SINGLE ((Class SV) ((Predicate (arguments)))))`.
    pub(super) fn pattern(
        &mut self,
        form: Form<'t>,
        variables: &mut Variables<'t>,
        master: &Master,
    ) -> Option<Found<'t>> {
        let mut parts = form.children().skip(1);
        let (Some(inner), None) = (
            parts.next().filter(|_| form.is_form("SINGLE")),
            parts.next(),
        ) else {
            self.notes.error(form, A_PATTERN);
            return None;
        };
        let mut parts = inner.children();
        let (Some(place), Some(says), None) = (parts.next(), parts.next(), parts.next()) else {
            self.notes
                .error(inner, "((Class Name_SV) ((Predicate (argument …))))");
            return None;
        };
        let mut predicates = says.children();
        let (Some(says_one), None) = (
            predicates.next().filter(|of| of.is_list()),
            predicates.next(),
        ) else {
            self.notes
                .error(says, "one predicate, as ((Predicate (argument …)))");
            return None;
        };
        let place = self.place(place, variables, master)?;
        let (predicate, list) = self.predicate(says_one, &place)?;
        let arguments = self.arguments(list, predicate, variables)?;
        let Place {
            timelines,
            object,
            same,
            ..
        } = place;
        let position = form.position();
        let pattern = Pattern {
            position,
            timelines,
            object,
            predicate,
            arguments,
        };
        Some(Found { pattern, same })
    }

    /// `(Class SV)`, `(object SV)` or `(?variable SV)`.
    pub(super) fn place(
        &mut self,
        form: Form<'t>,
        variables: &mut Variables<'t>,
        master: &Master,
    ) -> Option<Place<'t>> {
        let mut parts = form.children();
        let (Some(owner), Some(name), None) = (parts.next(), parts.next(), parts.next()) else {
            self.notes.error(
                form,
                "a class or an object and a state variable, as (Rover Arm_SV)",
            );
            return None;
        };
        if self.budget == 0 {
            return None;
        }
        let state_variable = name.word();
        let known = variables.names.get(owner.word()).copied();
        let is_variable = owner.kind() == Kind::Variable;
        let object = known.filter(|_| is_variable && known == master.object);
        if object.is_some() || (!is_variable && master.class.as_deref() == Some(owner.word())) {
            let objects = master
                .timelines
                .iter()
                .map(|&at| self.object_of(at))
                .collect();
            let timelines = self.timelines_of(objects, name)?;
            self.spend(form.position(), timelines.len())?;
            return Some(Place {
                timelines,
                object,
                same: Some(state_variable),
                state_variable,
            });
        }
        if is_variable {
            return self.any_object(owner, name, variables);
        }
        let Some(objects) = self.names.objects(self.model, owner.word()) else {
            let (names, model) = (self.names, self.model);
            self.notes
                .unknown(owner, "a class or an object", names.owners(model));
            return None;
        };
        let timelines = self.timelines_of(objects, name)?;
        self.spend(form.position(), timelines.len())?;
        Some(Place {
            timelines,
            object: None,
            same: None,
            state_variable,
        })
    }

    /// The timelines of some objects, each of which must have one.
    fn timelines_of(&mut self, objects: Vec<Value>, name: Form<'t>) -> Option<Vec<TimelineId>> {
        let found = objects
            .iter()
            .map(|&object| self.names.timeline(object, name.word()));
        let found = found
            .collect::<Option<Vec<_>>>()
            .filter(|found| !found.is_empty());
        if found.is_none() {
            let known = self.names.state_variables_of(&objects);
            self.notes.unknown(name, "a state variable", known);
        }
        found
    }

    /// The timelines of all objects that a variable can be.
    fn any_object(
        &mut self,
        owner: Form<'t>,
        name: Form<'t>,
        variables: &mut Variables<'t>,
    ) -> Option<Place<'t>> {
        let all = self.names.timelines(name.word());
        let Some(&first) = all.first() else {
            let known = self.names.all_state_variables();
            self.notes.unknown(name, "a state variable", known);
            return None;
        };
        let known = variables
            .names
            .get(owner.word())
            .map(|&id| variables.list[id].of);
        let class = known.or_else(|| self.class_of(self.object_of(first)));
        let id = self.variable(owner, class, variables)?;
        let of = variables.list[id].of;
        let Values::Symbols(objects) = &self.model.types[of].values else {
            self.notes.error(owner, "a variable that is an object");
            return None;
        };
        let object_of = |at: &TimelineId| self.model.timelines[*at].object;
        let fits = |at: &TimelineId| objects.binary_search(&object_of(at)).is_ok();
        let timelines: Vec<TimelineId> = all.iter().copied().filter(fits).collect();
        self.spend(owner.position(), timelines.len())?;
        let complete = known.is_some() || timelines.len() == all.len();
        if timelines.is_empty() || !complete {
            let expected = "a state variable of one class, or a variable whose class is known";
            self.notes.error(name, expected);
            return None;
        }
        let state_variable = name.word();
        Some(Place {
            timelines,
            object: Some(id),
            same: None,
            state_variable,
        })
    }

    /// The first type of which an object is: its class.
    pub(super) fn class_of(&self, object: Value) -> Option<TypeId> {
        let is_in = |of: &crate::model::Type| match &of.values {
            Values::Symbols(symbols) => symbols.binary_search(&object).is_ok(),
            _ => false,
        };
        self.model.types.iter().position(is_in)
    }

    /// The predicate of `(Predicate (arguments))`, and the list of its arguments if there is one.
    fn predicate(
        &mut self,
        form: Form<'t>,
        place: &Place<'t>,
    ) -> Option<(usize, Option<Form<'t>>)> {
        let mut parts = form.children();
        let (name, list, more) = (parts.next(), parts.next(), parts.next());
        let is_right = more.is_none() && list.is_none_or(Form::is_list);
        let Some(name) = name.filter(|name| is_right && name.symbol().is_some()) else {
            self.notes.error(form, "(Predicate (argument …))");
            return None;
        };
        self.member(name, place).map(|id| (id, list))
    }

    /// A predicate that tokens of a place can have.
    pub(super) fn member(&mut self, name: Form<'t>, place: &Place<'t>) -> Option<usize> {
        let known = self.names.predicates.get(name.word());
        let has = |&at: &TimelineId, id| self.model.timelines[at].predicates.contains(id);
        let known = known.filter(|id| place.timelines.iter().all(|at| has(at, id)));
        let Some(&id) = known else {
            let members = &self.model.timelines[place.timelines[0]].predicates;
            let members = members
                .iter()
                .map(|&id| self.model.predicates[id].name.as_str());
            let expected = format!("a predicate of {}", place.state_variable);
            self.notes.unknown(name, expected, members);
            return None;
        };
        Some(id)
    }

    /// By parameter of a predicate, what a pattern says of it; anything if it has no list.
    fn arguments(
        &mut self,
        list: Option<Form<'t>>,
        predicate: usize,
        variables: &mut Variables<'t>,
    ) -> Option<Vec<Argument>> {
        let model = self.model;
        let predicate = &model.predicates[predicate];
        let Some(list) = list else {
            return Some(vec![Argument::Any; predicate.parameters.len()]);
        };
        let (mut given, mut arrow) = (Vec::new(), None);
        for form in list.children() {
            match form.kind() {
                Kind::Arrow => arrow = Some((form, given.len())),
                _ => given.push(form),
            }
        }
        let (count, inputs) = (predicate.parameters.len(), predicate.inputs);
        if given.len() != count {
            let expected = format!("{} of {}", arguments(count), predicate.name);
            self.notes.refuse(list, expected, given.len().to_string());
            return None;
        }
        if let Some((form, at)) = arrow.filter(|(_, at)| *at != inputs) {
            let expected = format!("{inputs} inputs of {} before the arrow", predicate.name);
            self.notes.refuse(form, expected, at.to_string());
            return None;
        }
        let types = predicate.parameters.iter().map(|parameter| parameter.of);
        let given = given.into_iter().zip(types);
        given
            .map(|(form, of)| self.argument(form, of, variables))
            .collect()
    }

    fn argument(
        &mut self,
        form: Form<'t>,
        of: TypeId,
        variables: &mut Variables<'t>,
    ) -> Option<Argument> {
        match form.word() {
            "?_" => Some(Argument::Any),
            _ if self.is_variable(form) => self
                .variable(form, Some(of), variables)
                .map(Argument::Variable),
            _ => self.value_of(form, of).map(Argument::Value),
        }
    }

    /// Whether a word is a variable. In a fragment, so is a constant that nothing defines.
    pub(super) fn is_variable(&self, form: Form<'t>) -> bool {
        let unknown =
            || literal::is_constant(form.word()) && !self.constants.contains_key(form.word());
        form.kind() == Kind::Variable || (self.fragment && unknown())
    }

    /// A variable, which is one of a type where it stands, or of one that is not said there.
    pub(super) fn variable(
        &mut self,
        form: Form<'t>,
        of: Option<TypeId>,
        variables: &mut Variables<'t>,
    ) -> Option<VariableId> {
        if form.word() == "?_" {
            self.notes.error(form, "a variable with a name");
            return None;
        }
        let id = match variables.names.get(form.word()) {
            Some(&id) => id,
            None => {
                let name = form.word().to_owned();
                variables.list.push(Variable {
                    name,
                    of: of.unwrap_or(NUMBER),
                });
                variables.typed.push(of.is_some());
                variables
                    .names
                    .insert(form.word(), variables.list.len() - 1);
                return Some(variables.list.len() - 1);
            }
        };
        let Some(of) = of else { return Some(id) };
        if !variables.typed[id] {
            variables.typed[id] = true;
            variables.list[id].of = of;
        } else if !self.overlap(of, variables.list[id].of) {
            let expected = describe(self.model, of);
            let there = describe(self.model, variables.list[id].of);
            self.notes
                .refuse(form, expected, format!("{}, which is {there}", form.show()));
            return None;
        }
        Some(id)
    }

    /// Whether some value is of both types.
    fn overlap(&self, a: TypeId, b: TypeId) -> bool {
        match (&self.model.types[a].values, &self.model.types[b].values) {
            (Values::Truth, Values::Truth) => true,
            (Values::Numbers(a), Values::Numbers(b)) => !a.intersect(*b).is_empty(),
            (Values::Symbols(a), Values::Symbols(b)) => {
                a.iter().any(|value| b.binary_search(value).is_ok())
            }
            _ => false,
        }
    }

    /// The sort of a variable's values, if a pattern has said it.
    pub(super) fn sort_of(&self, id: VariableId, variables: &Variables) -> Option<Sort> {
        variables.typed[id].then(|| Sort::of(self.model, variables.list[id].of))
    }

    /// A number or a variable as an end of bounds, of at least `least` if that is given.
    pub(super) fn bound(
        &mut self,
        form: Form<'t>,
        side: Side,
        least: Option<Value>,
        variables: &mut Variables<'t>,
    ) -> Option<Bound> {
        if self.is_variable(form) {
            return self
                .variable(form, Some(NUMBER), variables)
                .map(Bound::Variable);
        }
        match literal::bound(form, side, self.constants) {
            Ok(None) => Some(Bound::None),
            Ok(Some(value)) if least.is_none_or(|least| value >= least) => {
                Some(Bound::Value(value))
            }
            Ok(Some(_)) => {
                self.notes.error(form, "a bound that is not negative");
                None
            }
            Err(()) => {
                self.notes.error(form, "a number, a variable or inf");
                None
            }
        }
    }

    /// `[least most]`, or one number for both.
    pub(super) fn bounds(
        &mut self,
        form: Form<'t>,
        least: Option<Value>,
        variables: &mut Variables<'t>,
    ) -> Option<[Bound; 2]> {
        let [min, max] = literal::ends(form, self.notes)?;
        let low = self.bound(min, Side::Least, least, variables);
        let high = self.bound(max, Side::Greatest, least, variables);
        let (low, high) = (low?, high?);
        let word = |form| literal::resolve(form, self.constants).word();
        let endless = matches!(word(min), "inf" | "+inf") || word(max) == "-inf";
        let inverted = matches!((low, high), (Bound::Value(low), Bound::Value(high)) if low > high);
        if endless || inverted {
            self.notes
                .error(form, "bounds of which the first is at most the second");
            return None;
        }
        Some([low, high])
    }
}
