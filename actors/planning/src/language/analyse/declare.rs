//! What a model declares: types, objects, predicates, timelines, tables and functions.

mod predicates;
mod tables;

use std::collections::{BTreeMap, BTreeSet};

use super::entry::Entry;
use super::literal::{self, Sort};
use super::{MOST_NAMED, resources};
use crate::language::findings::Notes;
use crate::language::functions::Functions;
use crate::language::tree::{Form, Kind};
use crate::model::{
    Filler, Function, Model, NUMBER, Profile, TRUTH, Timeline, TimelineKind, Type, TypeId, Value,
    Values,
};
use crate::temporal::Span;

/// The words by which a class says what its timelines hold. The words of DDL mean states.
const KINDS: [(&str, TimelineKind); 6] = [
    ("State", TimelineKind::State),
    ("Unary", TimelineKind::Unary),
    ("Free", TimelineKind::Free),
    ("Controllable", TimelineKind::State),
    ("Goal", TimelineKind::State),
    ("Executable", TimelineKind::State),
];

/// How many state variables a class may have, and predicates one of them.
const MOST_MEMBERS: usize = 4_096;

/// A class of objects.
#[derive(Clone, Debug, Default)]
struct Class<'t> {
    form: Option<Form<'t>>,
    objects: Vec<Value>,
    state_variables: Vec<(&'t str, TimelineKind)>,
    named: bool,
}

/// What the tokens of a state variable can say.
#[derive(Debug)]
struct Members {
    predicates: Vec<usize>,
    default: Option<Filler>,
    initial: Option<Filler>,
}

/// The declarations read so far.
pub(super) struct Declarations<'t, 'n> {
    pub(super) model: Model,
    pub(super) constants: &'n BTreeMap<&'t str, Form<'t>>,
    pub(super) notes: &'n mut Notes,
    symbols: BTreeMap<&'t str, Value>,
    types: BTreeMap<&'t str, TypeId>,
    predicates: BTreeMap<&'t str, usize>,
    classes: BTreeMap<&'t str, Class<'t>>,
    /// The classes in the order of the text.
    order: Vec<&'t str>,
    members: BTreeMap<(&'t str, &'t str), Members>,
    tables: BTreeSet<&'t str>,
    /// The functions that there are, and how many arguments each has.
    functions: BTreeMap<String, usize>,
    /// By class: its resources.
    pub(super) resources: BTreeSet<(&'t str, &'t str)>,
    /// How much more the text may declare.
    pub(super) budget: usize,
}

/// The truth values and the numbers, which every model has.
pub(super) fn usual_types() -> Vec<Type> {
    let numbers = Values::Numbers(Span::ALL);
    vec![
        Type {
            name: "Boolean".to_owned(),
            values: Values::Truth,
        },
        Type {
            name: "Number".to_owned(),
            values: numbers,
        },
    ]
}

/// The functions that a model may call, and those that it only declares.
pub(super) fn functions(known: &Functions) -> Vec<Function> {
    let known = known.iter();
    known
        .map(|(name, arguments, call)| Function {
            name: name.to_owned(),
            arguments,
            call,
        })
        .collect()
}

/// The model of all declarations, without rules.
pub(super) fn declare<'t>(
    entries: &[Entry<'t>],
    constants: &BTreeMap<&'t str, Form<'t>>,
    known: &Functions,
    notes: &mut Notes,
) -> Model {
    let model = Model {
        types: usual_types(),
        functions: functions(known),
        ..Model::default()
    };
    let mut declarations = Declarations {
        model,
        constants,
        notes,
        symbols: BTreeMap::new(),
        types: BTreeMap::from([("Boolean", TRUTH), ("Number", NUMBER)]),
        predicates: BTreeMap::new(),
        classes: BTreeMap::new(),
        order: Vec::new(),
        members: BTreeMap::new(),
        tables: BTreeSet::new(),
        functions: known
            .iter()
            .map(|(name, count, _)| (name.to_owned(), count))
            .collect(),
        resources: BTreeSet::new(),
        budget: MOST_NAMED,
    };
    declarations.read(entries);
    declarations.timelines();
    if let (true, Some(first)) = (declarations.is_bare(), entries.first()) {
        let expected = "a class with state variables, by Define_Object_Class";
        declarations
            .notes
            .refuse(first.form, expected, "a model without timelines");
    }
    for entry in entries
        .iter()
        .filter(|entry| entry.head == "Define_Resource")
    {
        resources::declare(&mut declarations, entry);
    }
    declarations.model
}

/// Reads a form of some kind.
type ReadForm<'t, 'n> = fn(&mut Declarations<'t, 'n>, &Entry<'t>);

impl<'t, 'n> Declarations<'t, 'n> {
    /// Reads all forms but resources. Each kind may use what the ones before it declare, wherever
    /// they stand.
    fn read(&mut self, entries: &[Entry<'t>]) {
        let kinds: [(&str, ReadForm<'t, 'n>); 8] = [
            ("Define_Model", Declarations::profile),
            ("Define_Object_Class", Declarations::class),
            ("Define_Object", Declarations::objects),
            ("Define_Type", Declarations::named_type),
            ("Define_Predicate", Declarations::predicate),
            ("Define_Member_Values", Declarations::member_values),
            ("Define_Table", Declarations::table),
            ("Define_Function", Declarations::function),
        ];
        for (head, read) in kinds {
            if head == "Define_Type" {
                self.types_of_classes();
            }
            for entry in entries.iter().filter(|entry| entry.head == head) {
                read(self, entry);
            }
        }
    }

    /// A name that something is declared by.
    fn name(&mut self, form: Form<'t>) -> Option<&'t str> {
        let name = form.symbol().filter(|name| {
            let taken = ["True", "False", "inf", "+inf", "-inf", "master"];
            !name.contains('.') && !literal::is_constant(name) && !taken.contains(name)
        });
        if name.is_none() {
            self.notes.error(form, "a name of letters, digits and _");
        }
        name
    }

    fn twice(&mut self, form: Form) {
        self.notes.error(form, "a name that is not defined yet");
    }

    fn profile(&mut self, entry: &Entry<'t>) {
        entry.check_options(&[":profile"], self.notes);
        if entry.values.len() != 1 {
            self.notes
                .error(entry.form, "(Define_Model name :profile executive)");
        }
        let Some(profile) = entry.one(":profile", self.notes) else {
            return;
        };
        match profile.word() {
            "executive" => self.model.profile = Profile::Executive,
            "scheduler" => self.model.profile = Profile::Scheduler,
            _ => {
                let known = ["executive", "scheduler"];
                self.notes
                    .unknown(profile, "executive or scheduler", known.into_iter());
            }
        }
    }

    fn class(&mut self, entry: &Entry<'t>) {
        entry.check_options(&[":state_variables"], self.notes);
        let &[name] = entry.values.as_slice() else {
            let expected = "(Define_Object_Class Name :state_variables ((State Name_SV) …))";
            self.notes.error(entry.form, expected);
            return;
        };
        let Some(name_text) = self.name(name) else {
            return;
        };
        if self.types.contains_key(name_text) || self.classes.contains_key(name_text) {
            self.twice(name);
            return;
        }
        let mut class = Class {
            form: Some(entry.form),
            ..Class::default()
        };
        for form in entry
            .one(":state_variables", self.notes)
            .iter()
            .flat_map(|of| of.children())
        {
            let mut words = form.children();
            let head = words.next();
            let kind = head.and_then(|head| KINDS.iter().find(|(word, _)| *word == head.word()));
            let Some(&(_, kind)) = kind else {
                let known = KINDS.iter().map(|(word, _)| *word);
                self.notes
                    .unknown(head.unwrap_or(form), "State, Unary or Free", known);
                continue;
            };
            for word in words {
                let Some(name) = self.name(word) else {
                    continue;
                };
                if class
                    .state_variables
                    .iter()
                    .any(|(other, _)| *other == name)
                {
                    self.twice(word);
                } else if class.state_variables.len() == MOST_MEMBERS {
                    self.notes
                        .error(word, format!("at most {MOST_MEMBERS} state variables"));
                    return;
                } else {
                    class.state_variables.push((name, kind));
                }
            }
        }
        self.order.push(name_text);
        self.classes.insert(name_text, class);
    }

    fn objects(&mut self, entry: &Entry<'t>) {
        entry.check_options(&[], self.notes);
        let Some((class, objects)) = entry.values.split_first().filter(|(_, of)| !of.is_empty())
        else {
            self.notes.error(entry.form, "(Define_Object Class name …)");
            return;
        };
        if !self.classes.contains_key(class.word()) {
            self.notes
                .unknown(*class, "a class", self.classes.keys().copied());
            return;
        }
        for &object in objects {
            let Some(name) = self.name(object) else {
                continue;
            };
            if self.symbols.contains_key(name) || self.classes.contains_key(name) {
                self.twice(object);
                continue;
            }
            let symbol = self.symbol(name);
            let class = self.classes.get_mut(class.word()).expect("it was found");
            class.objects.push(symbol);
            class.named = true;
        }
    }

    fn symbol(&mut self, name: &'t str) -> Value {
        *self.symbols.entry(name).or_insert_with(|| {
            self.model.symbols.push(name.to_owned());
            self.model.symbols.len() as Value - 1
        })
    }

    /// Gives each class without a named object one of its own name, and each class a type.
    fn types_of_classes(&mut self) {
        for name in self.order.clone() {
            let objects = self.classes[name].objects.clone();
            let objects = match objects.as_slice() {
                [] => vec![self.symbol(name)],
                _ => objects,
            };
            self.add_type(name, Values::Symbols(objects.clone()));
            self.classes.get_mut(name).expect("it was found").objects = objects;
        }
    }

    fn add_type(&mut self, name: &'t str, values: Values) {
        self.types.insert(name, self.model.types.len());
        self.model.types.push(Type {
            name: name.to_owned(),
            values,
        });
    }

    fn named_type(&mut self, entry: &Entry<'t>) {
        entry.check_options(&[], self.notes);
        let &[name, values] = entry.values.as_slice() else {
            self.notes.error(
                entry.form,
                "(Define_Type Name (symbol …)) or (Define_Type Name [0 10])",
            );
            return;
        };
        let Some(name_text) = self.name(name) else {
            return;
        };
        if self.types.contains_key(name_text) {
            self.twice(name);
            return;
        }
        let values = match values.kind() {
            Kind::Span => literal::span(values, self.constants, self.notes).map(Values::Numbers),
            Kind::List => self.symbols_of(values),
            _ => {
                self.notes
                    .error(values, "symbols, as (left right), or a range, as [0 10]");
                None
            }
        };
        // A type in which something is wrong is there nevertheless, so that its name is known.
        let values = values.unwrap_or(Values::Numbers(Span::ALL));
        self.add_type(name_text, values);
    }

    fn symbols_of(&mut self, list: Form<'t>) -> Option<Values> {
        let mut symbols = Vec::new();
        for word in list.children() {
            let name = self.name(word)?;
            symbols.push((self.symbol(name), word));
        }
        symbols.sort_by_key(|(symbol, word)| (*symbol, word.node()));
        for pair in symbols.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
            self.notes.error(pair[1].1, "each symbol once");
        }
        if symbols.is_empty() {
            self.notes.error(list, "one symbol or more");
            return None;
        }
        symbols.dedup_by_key(|(symbol, _)| *symbol);
        Some(Values::Symbols(
            symbols.into_iter().map(|(symbol, _)| symbol).collect(),
        ))
    }

    /// A class and one more name, as `(Rover Position_SV)`.
    pub(super) fn of_class(&mut self, form: Form<'t>, what: &str) -> Option<(&'t str, Form<'t>)> {
        let mut parts = form.children();
        let (Some(class), Some(name), None) = (parts.next(), parts.next(), parts.next()) else {
            self.notes
                .error(form, format!("a class and {what}, as (Rover name)"));
            return None;
        };
        if !self.classes.contains_key(class.word()) {
            self.notes
                .unknown(class, "a class", self.classes.keys().copied());
            return None;
        }
        Some((class.word(), name))
    }

    /// The value of a literal of a type.
    fn value_of(&mut self, form: Form<'t>, of: TypeId) -> Option<Value> {
        let literal = literal::resolve(form, self.constants);
        let symbol = literal.symbol().and_then(|word| self.symbols.get(word));
        let value = literal::plain(literal).or(symbol.map(|&symbol| (symbol, Sort::Symbol)));
        match value {
            Some((value, sort)) if literal::fits(&self.model, of, value, sort) => Some(value),
            _ => {
                let expected = literal::describe(&self.model, of);
                self.notes
                    .unknown(form, expected, self.symbols.keys().copied());
                None
            }
        }
    }

    /// Makes the timelines of all objects.
    fn timelines(&mut self) {
        for class in self.order.clone() {
            self.timelines_of(class);
        }
    }

    fn timelines_of(&mut self, class: &'t str) {
        let Class {
            form,
            objects,
            state_variables,
            named,
        } = self.classes[class].clone();
        let members = |name: &'t str| self.members.get(&(class, name));
        let size = |name: &'t str| 1 + members(name).map_or(0, |of| of.predicates.len());
        let once: usize = state_variables.iter().map(|(name, _)| size(name)).sum();
        for (name, _) in &state_variables {
            if let (None, Some(form)) = (self.members.get(&(class, *name)), form) {
                let expected = format!("(Define_Member_Values ({class} {name}) (…))");
                self.notes.refuse(form, expected, "none in the model");
            }
        }
        if form
            .and_then(|form| self.spend(form, once.saturating_mul(objects.len())))
            .is_none()
        {
            return;
        }
        for &object in &objects {
            for &(name, kind) in &state_variables {
                let members = self.members.get(&(class, name));
                let full = self.model.symbols[object as usize].clone() + "." + name;
                self.model.timelines.push(Timeline {
                    name: if named { full } else { name.to_owned() },
                    object,
                    kind,
                    predicates: members.map_or(Vec::new(), |of| of.predicates.clone()),
                    default: members.and_then(|of| of.default.clone()),
                    initial: members.and_then(|of| of.initial.clone()),
                });
            }
        }
    }

    /// Takes from what the text may declare; notes once if there is no more.
    pub(super) fn spend(&mut self, form: Form<'t>, amount: usize) -> Option<()> {
        if amount > self.budget {
            if self.budget > 0 {
                let expected = format!("at most {MOST_NAMED} names, each counted once an object");
                self.notes.refuse(form, expected, "more");
            }
            self.budget = 0;
            return None;
        }
        self.budget -= amount;
        Some(())
    }

    /// Whether there is no timeline, though nothing is wrong.
    fn is_bare(&self) -> bool {
        self.model.timelines.is_empty() && !self.notes.has_errors()
    }

    /// The objects of a class, and whether they have names of their own.
    pub(super) fn objects_of(&self, class: &str) -> (&[Value], bool) {
        let class = &self.classes[class];
        (&class.objects, class.named)
    }
}

/// A function that gives nothing.
pub(super) fn unknown_function(name: &str, arguments: usize) -> Function {
    Function {
        name: name.to_owned(),
        arguments,
        call: |_| None,
    }
}
