//! From trees to a model or a problem: every name resolved, every bound and arity checked.

mod body;
mod declare;
mod entry;
mod fragment;
mod literal;
mod names;
mod pattern;
mod problem;
mod prove;
mod relationships;
mod resources;
mod rule;

use std::collections::BTreeMap;

use super::findings::{Notes, Severity};
use super::functions::Functions;
use super::include::Loaded;
use super::tree::Form;
use crate::model::{Model, Position, Problem};
use entry::Entry;
use names::Names;

/// The forms of models.
const MODEL_FORMS: [&str; 13] = [
    "Define_Model",
    "Define_Constant",
    "Define_Type",
    "Define_Object_Class",
    "Define_Object",
    "Define_Predicate",
    "Define_Member_Values",
    "Define_Resource",
    "Define_Table",
    "Define_Function",
    "Define_Compatibility",
    "Define_Decomposition",
    "Define_Search_Control",
];

/// The forms of problems.
const PROBLEM_FORMS: [&str; 8] = [
    "Define_Problem",
    "Define_Constant",
    "Fact",
    "Goal",
    "Combination",
    "Order",
    "Level",
    "Change",
];

/// All words that the language gives a meaning to where they start a list.
#[cfg(test)]
pub(super) fn words() -> impl Iterator<Item = &'static str> {
    MODEL_FORMS
        .into_iter()
        .chain(PROBLEM_FORMS)
        .chain(body::relation_words())
}

/// What everything that resolves names needs.
struct Scope<'t, 'n> {
    notes: &'n mut Notes,
    /// The literals that constants stand for.
    constants: &'n BTreeMap<&'t str, Form<'t>>,
    names: &'n Names,
    model: &'n Model,
    /// Whether names are taken as they are used, since nothing declares any.
    fragment: bool,
    /// How much more the text may name.
    budget: usize,
}

/// How much a text may name, counted once for every object that it is said of: what keeps a text
/// of some megabytes from becoming tables of some gigabytes.
const MOST_NAMED: usize = 1 << 21;

impl Scope<'_, '_> {
    /// Takes from what the text may name; notes once if there is no more.
    fn spend(&mut self, at: Position, amount: usize) -> Option<()> {
        if amount > self.budget {
            if self.budget > 0 {
                let expected = format!("at most {MOST_NAMED} names, each counted once an object");
                self.notes.note(Severity::Error, at, expected, "more");
            }
            self.budget = 0;
            return None;
        }
        self.budget -= amount;
        Some(())
    }
}

/// The forms of a text by their first word; what is no form of `known` is noted.
fn entries<'t>(loaded: &'t Loaded, known: &[&str], notes: &mut Notes) -> Vec<Entry<'t>> {
    let mut entries = Vec::new();
    for form in loaded.forms() {
        match form.children().next() {
            Some(head) if form.head().is_some_and(|head| known.contains(&head)) => {
                entries.push(Entry::of(form, head.word()));
            }
            Some(head) => notes.unknown(head, "the name of a form", known.iter().copied()),
            None => notes.error(form, "a form"),
        }
    }
    entries
}

/// The literal that each constant stands for.
fn constants<'t>(entries: &[Entry<'t>], notes: &mut Notes) -> BTreeMap<&'t str, Form<'t>> {
    let mut constants: BTreeMap<&str, Form> = BTreeMap::new();
    for entry in entries
        .iter()
        .filter(|entry| entry.head == "Define_Constant")
    {
        entry.check_options(&[], notes);
        let &[name, value] = entry.values.as_slice() else {
            notes.error(entry.form, "(Define_Constant *name* value)");
            continue;
        };
        // A constant of a constant stands for the same literal.
        let value = constants.get(value.word()).copied().unwrap_or(value);
        if !literal::is_constant(name.word()) {
            notes.error(name, "a name between asterisks, as *name*");
        } else if value.children().next().is_some() || value.word().is_empty() {
            notes.error(value, "a number or a name");
        } else if literal::is_constant(value.word()) {
            notes.unknown(
                value,
                "a constant that is defined before",
                constants.keys().copied(),
            );
        } else if constants.insert(name.word(), value).is_some() {
            notes.error(name, "a name that is not defined yet");
        }
    }
    constants
}

/// Reads the model that a text says. What cannot be made sense of is noted and left out.
pub(super) fn model(loaded: &Loaded, functions: &Functions, notes: &mut Notes) -> Model {
    let entries = entries(loaded, &MODEL_FORMS, notes);
    if entries.is_empty() {
        empty(notes, "a model, as (Define_Model name)");
        return Model::default();
    }
    let constants = constants(&entries, notes);
    let is_rule = |entry: &Entry| {
        let rules = [
            "Define_Compatibility",
            "Define_Decomposition",
            "Define_Constant",
        ];
        rules.contains(&entry.head)
    };
    let fragment = entries.iter().all(is_rule);
    let mut model = match fragment {
        true => fragment::declare(&entries, &constants, functions, notes),
        false => declare::declare(&entries, &constants, functions, notes),
    };
    model.files.clone_from(&notes.files);
    let names = Names::of(&model);
    let mut drafts = Vec::new();
    let scope = Scope {
        notes,
        constants: &constants,
        names: &names,
        model: &model,
        fragment,
        budget: MOST_NAMED,
    };
    let control = rule::read(scope, &entries, &mut drafts);
    // Of rules in which something is wrong, nothing can be proved.
    if !notes.has_errors() {
        prove::check(&model, &drafts, notes);
    }
    model.control = control;
    rule::instantiate(&mut model, &names, &drafts);
    model
}

/// Reads the problem of a model that a text says.
pub(super) fn problem(loaded: &Loaded, model: &Model, notes: &mut Notes) -> Problem {
    let entries = entries(loaded, &PROBLEM_FORMS, notes);
    if entries.is_empty() {
        empty(
            notes,
            "a problem, as (Define_Problem name :horizon [0 1000])",
        );
        return Problem::default();
    }
    let constants = constants(&entries, notes);
    let names = Names::of(model);
    let files = notes.files.clone();
    let scope = Scope {
        notes,
        constants: &constants,
        names: &names,
        model,
        fragment: false,
        budget: MOST_NAMED,
    };
    let mut problem = problem::read(scope, &entries);
    problem.files = files;
    problem
}

/// Says that there is nothing in a text, if there is nothing wrong in it either.
fn empty(notes: &mut Notes, expected: &str) {
    if !notes.has_errors() {
        let start = Position {
            file: 0,
            line: 1,
            column: 1,
        };
        notes.note(Severity::Error, start, expected, "a text without forms");
    }
}
