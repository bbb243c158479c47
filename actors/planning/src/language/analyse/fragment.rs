//! A fragment: rules of a model whose declarations stand elsewhere, as Figure 5 of the IDEA paper
//! is one. Names are taken as they are used.
//!
//! A class has one object; a predicate has as many parameters as where it is first used, of truth
//! values or symbols if such a literal stands for them somewhere, else of numbers; a function that
//! nobody knows has as many arguments as where it is first called, and gives nothing; a constant
//! that is not defined is a variable. Tables and resources must be declared.

use std::collections::{BTreeMap, BTreeSet};

use super::declare::{functions, unknown_function, usual_types};
use super::entry::Entry;
use super::literal::{self, Sort};
use crate::language::findings::Notes;
use crate::language::functions::Functions;
use crate::language::tree::{Form, Kind};
use crate::model::{
    Model, NUMBER, Parameter, Predicate, TRUTH, Timeline, TimelineKind, Type, Value, Values,
};

/// What is known of a parameter.
#[derive(Debug, Default)]
struct Use<'t> {
    truth: bool,
    symbols: Vec<&'t str>,
}

#[derive(Debug)]
struct Used<'t> {
    name: &'t str,
    inputs: usize,
    parameters: Vec<Use<'t>>,
}

#[derive(Debug, Default)]
struct Names<'t> {
    /// Class and state variable, in the order of the text, with its predicates.
    timelines: Vec<(&'t str, &'t str, Vec<usize>)>,
    timeline_at: BTreeMap<(&'t str, &'t str), usize>,
    predicates: Vec<Used<'t>>,
    predicate_at: BTreeMap<&'t str, usize>,
    members: BTreeSet<(usize, usize)>,
}

/// What the rules of a fragment speak of, as a model without rules.
pub(super) fn declare<'t>(
    entries: &[Entry<'t>],
    constants: &BTreeMap<&'t str, Form<'t>>,
    known: &Functions,
    notes: &mut Notes,
) -> Model {
    let mut model = Model {
        types: usual_types(),
        functions: functions(known),
        ..Model::default()
    };
    let mut names = Names::default();
    let rules = entries
        .iter()
        .filter(|entry| entry.head != "Define_Constant");
    for entry in rules.clone() {
        let mut open = vec![entry.form];
        while let Some(form) = open.pop() {
            if form.is_form("SINGLE") {
                names.pattern(form, constants);
                continue;
            }
            // Lists are looked at in the order of the text.
            let first = open.len();
            open.extend(form.children().filter(|child| child.is_list()));
            open[first..].reverse();
        }
    }
    if rules.clone().next().is_none() {
        let only = entries[0].form;
        notes.refuse(
            only,
            "a model, as (Define_Model name)",
            "nothing but constants",
        );
    }
    let mut called_before = known.names().map(str::to_owned).collect();
    for entry in rules {
        for form in entry.option(":parameter_functions") {
            called(*form, &mut called_before, &mut model);
        }
    }
    names.to(&mut model);
    model
}

/// Adds the functions that `(f (arguments) …)` or `(f argument …)` calls.
fn called(form: Form, known: &mut BTreeSet<String>, model: &mut Model) {
    let parts: Vec<Form> = form.children().collect();
    let pairs: Vec<(Form, usize)> = match parts.as_slice() {
        [_, list, ..] if list.is_list() => {
            let pairs = parts.chunks_exact(2);
            pairs
                .map(|pair| (pair[0], pair[1].children().count()))
                .collect()
        }
        [name, arguments @ ..] => vec![(*name, arguments.len())],
        [] => Vec::new(),
    };
    for (name, arguments) in pairs {
        if name.symbol().is_some() && known.insert(name.word().to_owned()) {
            model
                .functions
                .push(unknown_function(name.word(), arguments));
        }
    }
}

impl<'t> Names<'t> {
    /// Takes the names of a pattern; what is wrong with it is noted when it is read.
    fn pattern(&mut self, form: Form<'t>, constants: &BTreeMap<&'t str, Form<'t>>) {
        let mut parts = form
            .children()
            .nth(1)
            .into_iter()
            .flat_map(|inner| inner.children());
        let (Some(place), Some(says)) = (parts.next(), parts.next()) else {
            return;
        };
        let mut place = place.children().filter_map(Form::symbol);
        let (Some(class), Some(name)) = (place.next(), place.next()) else {
            return;
        };
        let mut says = says
            .children()
            .next()
            .into_iter()
            .flat_map(|says| says.children());
        let Some(predicate) = says.next().and_then(Form::symbol) else {
            return;
        };
        let arguments = says.next().into_iter().flat_map(|list| list.children());
        let at = self.predicate(predicate, arguments, constants);
        let count = self.timelines.len();
        let timeline = *self.timeline_at.entry((class, name)).or_insert(count);
        if timeline == count {
            self.timelines.push((class, name, Vec::new()));
        }
        if self.members.insert((timeline, at)) {
            self.timelines[timeline].2.push(at);
        }
    }

    fn predicate(
        &mut self,
        name: &'t str,
        arguments: impl Iterator<Item = Form<'t>>,
        constants: &BTreeMap<&'t str, Form<'t>>,
    ) -> usize {
        let (mut given, mut inputs) = (Vec::new(), None);
        for form in arguments {
            match form.kind() {
                Kind::Arrow => inputs = Some(given.len()),
                _ => given.push(form),
            }
        }
        let count = self.predicates.len();
        let at = *self.predicate_at.entry(name).or_insert(count);
        if at == count {
            let parameters = given.iter().map(|_| Use::default()).collect();
            let inputs = inputs.unwrap_or(given.len());
            self.predicates.push(Used {
                name,
                inputs,
                parameters,
            });
        }
        for (of, form) in self.predicates[at].parameters.iter_mut().zip(given) {
            let literal = literal::resolve(form, constants);
            match (literal::plain(literal), literal.symbol()) {
                (Some((_, Sort::Truth)), _) => of.truth = true,
                (None, Some(symbol)) if !literal::is_constant(symbol) => of.symbols.push(symbol),
                _ => {}
            }
        }
        at
    }

    fn to(self, model: &mut Model) {
        let (mut symbols, mut classes) = (BTreeMap::<&str, Value>::new(), BTreeSet::new());
        let mut symbol = |name: &'t str, model: &mut Model| {
            *symbols.entry(name).or_insert_with(|| {
                model.symbols.push(name.to_owned());
                model.symbols.len() as Value - 1
            })
        };
        for (class, name, predicates) in self.timelines {
            let object = symbol(class, model);
            if classes.insert(class) {
                let values = Values::Symbols(vec![object]);
                model.types.push(Type {
                    name: class.to_owned(),
                    values,
                });
            }
            let (name, kind, default) = (name.to_owned(), TimelineKind::State, None);
            model.timelines.push(Timeline {
                name,
                object,
                kind,
                predicates,
                default,
                initial: None,
            });
        }
        for Used {
            name,
            inputs,
            parameters,
        } in self.predicates
        {
            let mut list = Vec::new();
            for (place, Use { truth, symbols }) in parameters.into_iter().enumerate() {
                let mut values: Vec<Value> = symbols
                    .into_iter()
                    .map(|name| symbol(name, model))
                    .collect();
                values.sort_unstable();
                values.dedup();
                let of = match (truth, values.is_empty()) {
                    (true, _) => TRUTH,
                    (false, true) => NUMBER,
                    (false, false) => {
                        let values = Values::Symbols(values);
                        model.types.push(Type {
                            name: format!("{name}.{place}"),
                            values,
                        });
                        model.types.len() - 1
                    }
                };
                list.push(Parameter {
                    name: String::new(),
                    of,
                });
            }
            model.predicates.push(Predicate {
                name: name.to_owned(),
                parameters: list,
                inputs,
                ..Predicate::default()
            });
        }
    }
}
