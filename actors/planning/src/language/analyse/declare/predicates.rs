//! Predicates, and which of them the tokens of a state variable can have.

use super::{Declarations, MOST_MEMBERS, Members};
use crate::language::analyse::entry::Entry;
use crate::language::analyse::literal::{self, Sort};
use crate::language::findings::arguments;
use crate::language::tree::{Form, Kind};
use crate::model::{Filler, NUMBER, Parameter, Predicate, TimelineKind, Value};

/// How many parameters a predicate, and columns a table, may have.
const MOST_PARAMETERS: usize = 256;

impl<'t> Declarations<'t, '_> {
    /// `(Type ?name)` or `Type`.
    pub(super) fn parameter(&mut self, form: Form<'t>) -> Option<Parameter> {
        let mut parts = form.children();
        let (of, name) = match form.kind() {
            Kind::Symbol => (form, ""),
            Kind::List => match (parts.next(), parts.next(), parts.next()) {
                (Some(of), Some(name), None) if name.kind() == Kind::Variable => (of, name.word()),
                _ => {
                    self.notes.error(form, "a parameter, as (Type ?name)");
                    return None;
                }
            },
            _ => {
                self.notes.error(form, "a parameter, as (Type ?name)");
                return None;
            }
        };
        match self.types.get(of.word()) {
            Some(&id) => Some(Parameter {
                name: name.to_owned(),
                of: id,
            }),
            None => {
                self.notes.unknown(of, "a type", self.types.keys().copied());
                None
            }
        }
    }

    pub(super) fn predicate(&mut self, entry: &Entry<'t>) {
        entry.check_options(&[":timed_out", ":preempted"], self.notes);
        let (name, list) = match *entry.values.as_slice() {
            [name] => (name, None),
            [name, list] if list.is_list() => (name, Some(list)),
            _ => {
                let expected = "(Define_Predicate Name ((Type ?input) … -> (Type ?output) …))";
                self.notes.error(entry.form, expected);
                return;
            }
        };
        let Some(name_text) = self.name(name) else {
            return;
        };
        if self.predicates.contains_key(name_text) {
            self.twice(name);
            return;
        }
        let (mut parameters, mut inputs) = (Vec::<Parameter>::new(), None);
        for form in list.iter().flat_map(|list| list.children()) {
            if form.kind() == Kind::Arrow {
                if inputs.replace(parameters.len()).is_some() {
                    self.notes.error(form, "one arrow");
                }
                continue;
            }
            // An unknown type counts as the numbers, so that the arity is right.
            let unknown = Parameter {
                name: String::new(),
                of: NUMBER,
            };
            let parameter = self.parameter(form).unwrap_or(unknown);
            let same = |other: &Parameter| other.name == parameter.name;
            if !parameter.name.is_empty() && parameters.iter().any(same) {
                self.twice(form);
            }
            if parameters.len() == MOST_PARAMETERS {
                self.notes
                    .error(form, format!("at most {MOST_PARAMETERS} parameters"));
                return;
            }
            parameters.push(parameter);
        }
        let mut predicate = Predicate {
            name: name_text.to_owned(),
            inputs: inputs.unwrap_or(parameters.len()),
            parameters,
            ..Predicate::default()
        };
        predicate.timed_out = self.without_status(entry, ":timed_out", "TIMEOUT", &predicate);
        predicate.preempted = self.without_status(entry, ":preempted", "PREEMPTED", &predicate);
        self.predicates
            .insert(name_text, self.model.predicates.len());
        self.model.predicates.push(predicate);
    }

    /// What outputs are if no status came, as an option says, `:timed_out (?output value) …`; an
    /// output of which it says nothing, and whose type has the usual symbol, is that.
    fn without_status(
        &mut self,
        entry: &Entry<'t>,
        option: &str,
        usual: &str,
        of: &Predicate,
    ) -> Vec<(usize, Value)> {
        let mut said: Vec<(usize, Value)> = Vec::new();
        for &form in entry.option(option) {
            let parts: Vec<Form> = form.children().collect();
            let &[name, value] = parts.as_slice() else {
                self.notes
                    .error(form, "an output and its value, as (?received False)");
                continue;
            };
            let outputs = (of.parameters.iter().enumerate()).skip(of.inputs);
            let named = |at: &(usize, &Parameter)| at.1.name == name.word() && !name.is_list();
            let Some((place, output)) = outputs.clone().find(named) else {
                let known = outputs.map(|(_, output)| output.name.as_str());
                let expected = format!("an output of {}", of.name);
                self.notes.unknown(name, expected, known);
                continue;
            };
            if said.iter().any(|at| at.0 == place) {
                self.notes.error(name, "each output once");
            } else if let Some(value) = self.value_of(value, output.of) {
                said.push((place, value));
            }
        }
        if let Some(&symbol) = self.symbols.get(usual) {
            for (place, output) in of.parameters.iter().enumerate().skip(of.inputs) {
                let is_usual = literal::fits(&self.model, output.of, symbol, Sort::Symbol);
                if is_usual && said.iter().all(|at| at.0 != place) {
                    said.push((place, symbol));
                }
            }
        }
        said.sort_unstable();
        said
    }

    pub(super) fn member_values(&mut self, entry: &Entry<'t>) {
        entry.check_options(&[":default", ":initial"], self.notes);
        let &[of, list] = entry.values.as_slice() else {
            let expected = "(Define_Member_Values (Class Name_SV) (Predicate …))";
            self.notes.error(entry.form, expected);
            return;
        };
        let Some((class, name)) = self.of_class(of, "a state variable") else {
            return;
        };
        let known = &self.classes[class].state_variables;
        let kind = known
            .iter()
            .find(|(known, _)| *known == name.word())
            .map(|(_, kind)| *kind);
        let Some(kind) = kind else {
            let known: Vec<&str> = known.iter().map(|(known, _)| *known).collect();
            self.notes.unknown(
                name,
                format!("a state variable of {class}"),
                known.into_iter(),
            );
            return;
        };
        let is_state = kind == TimelineKind::State;
        let mut predicates = Vec::new();
        for form in list.children() {
            match self.predicates.get(form.word()) {
                Some(id) if predicates.contains(id) => {
                    self.notes.error(form, "each predicate once")
                }
                Some(_) if predicates.len() == MOST_MEMBERS => {
                    self.notes
                        .error(form, format!("at most {MOST_MEMBERS} predicates"));
                    return;
                }
                Some(&id) => predicates.push(id),
                None => self
                    .notes
                    .unknown(form, "a predicate", self.predicates.keys().copied()),
            }
        }
        if list.children().next().is_none() {
            self.notes
                .error(list, "one predicate or more, in parentheses");
        }
        let [default, initial] = [":default", ":initial"].map(|option| {
            let form = entry.one(option, self.notes)?;
            if !is_state {
                let expected = format!("no {}, but of a State", &option[1..]);
                self.notes.refuse(form, expected, "one");
            }
            self.filler(form, &predicates)
        });
        let members = Members {
            predicates,
            default,
            initial,
        };
        if self.members.insert((class, name.word()), members).is_some() {
            self.notes
                .error(of, "member values of each state variable once");
        }
    }

    /// `(Predicate (value …))`, with `?any` for values that may be any.
    fn filler(&mut self, form: Form<'t>, members: &[usize]) -> Option<Filler> {
        let head = form.children().next();
        let Some(name) = head.filter(|name| form.is_list() && name.symbol().is_some()) else {
            self.notes.error(form, "a default, as (Idle ())");
            return None;
        };
        let known = members
            .iter()
            .find(|&&id| self.model.predicates[id].name == name.word());
        let Some(&predicate) = known else {
            let known: Vec<String> = members
                .iter()
                .map(|&id| self.model.predicates[id].name.clone())
                .collect();
            let known = known.iter().map(String::as_str);
            self.notes
                .unknown(name, "a member of the state variable", known);
            return None;
        };
        let list = form.children().nth(1);
        let given = list.into_iter().flat_map(|list| list.children());
        let given: Vec<Form> = given.filter(|form| form.kind() != Kind::Arrow).collect();
        let parameters = self.model.predicates[predicate].parameters.clone();
        if list.is_some() && given.len() != parameters.len() {
            let expected = format!("{} of {}", arguments(parameters.len()), name.word());
            self.notes
                .refuse(list.unwrap_or(form), expected, given.len().to_string());
            return None;
        }
        let mut values = vec![None; parameters.len()];
        for (place, argument) in given.into_iter().enumerate() {
            if argument.kind() != Kind::Variable {
                values[place] = Some(self.value_of(argument, parameters[place].of)?);
            }
        }
        Some(Filler { predicate, values })
    }
}
