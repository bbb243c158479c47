//! Parametric constraints.

use super::Scope;
use super::literal::Sort;
use super::rule::Draft;
use crate::language::findings::arguments;
use crate::language::tree::{Form, Kind};
use crate::model::{Operand, Relationship, RelationshipKind};

const WORDS: [&str; 10] = [
    "=", "!=", "<", "<=", ">", ">=", "sum", "product", "table", "function",
];

impl<'t> Scope<'t, '_> {
    /// `(= a b …)`, `(sum a b … c)`, `(table name a …)` and the others.
    pub(super) fn relationship(
        &mut self,
        form: Form<'t>,
        draft: &mut Draft<'t>,
    ) -> Option<Relationship> {
        let Some(head) = form.children().next().filter(|_| form.head().is_some()) else {
            self.notes.error(form, "a constraint, as (< ?a ?b)");
            return None;
        };
        let mut operands: Vec<Form> = form.children().skip(1).collect();
        let kind = match head.word() {
            "=" => RelationshipKind::Equal,
            "!=" => RelationshipKind::Different,
            "<" | ">" => RelationshipKind::Less,
            "<=" | ">=" => RelationshipKind::AtMost,
            "sum" => RelationshipKind::Sum,
            "product" => RelationshipKind::Product,
            "table" | "function" if operands.is_empty() => {
                self.notes.error(form, "(table name argument …)");
                return None;
            }
            "table" => RelationshipKind::Table(self.table(operands.remove(0))?),
            "function" => RelationshipKind::Function(self.function(operands.remove(0))?),
            _ => {
                self.notes.unknown(head, "a constraint", WORDS.into_iter());
                return None;
            }
        };
        if matches!(head.word(), ">" | ">=") {
            operands.reverse();
        }
        self.relationship_of(form, kind, &operands, draft)
    }

    /// `(f (arguments) g (arguments) …)` or `(f argument …)`.
    pub(super) fn functions(&mut self, form: Form<'t>, draft: &mut Draft<'t>) {
        let parts: Vec<Form> = form.children().collect();
        if form.head().is_none() {
            self.notes
                .error(form, "a function, as (f (?input ?output))");
            return;
        }
        if !parts
            .get(1)
            .is_some_and(|part| part.is_list() && !is_time(*part))
        {
            let Some(function) = self.function(parts[0]) else {
                return;
            };
            let kind = RelationshipKind::Function(function);
            let found = self.relationship_of(form, kind, &parts[1..], draft);
            draft.rule.relationships.extend(found);
            return;
        }
        for pair in parts.chunks(2) {
            let &[name, list] = pair else {
                self.notes.error(
                    pair[0],
                    "a function and its arguments, as f (?input ?output)",
                );
                return;
            };
            let Some(function) = self.function(name) else {
                continue;
            };
            let operands: Vec<Form> = list.children().collect();
            let kind = RelationshipKind::Function(function);
            let found = self.relationship_of(name, kind, &operands, draft);
            draft.rule.relationships.extend(found);
        }
    }

    fn table(&mut self, name: Form<'t>) -> Option<usize> {
        let table = self.names.tables.get(name.word()).copied();
        if table.is_none() {
            self.notes.unknown(
                name,
                "a table",
                self.names.tables.keys().map(String::as_str),
            );
        }
        table
    }

    fn function(&mut self, name: Form<'t>) -> Option<usize> {
        let function = self.names.functions.get(name.word()).copied();
        if function.is_none() {
            let known = self.names.functions.keys().map(String::as_str);
            self.notes.unknown(name, "a function", known);
        }
        function
    }

    /// A constraint of some operands, if they are as many and of the sorts that it has.
    fn relationship_of(
        &mut self,
        form: Form<'t>,
        kind: RelationshipKind,
        forms: &[Form<'t>],
        draft: &mut Draft<'t>,
    ) -> Option<Relationship> {
        let fits = match kind {
            RelationshipKind::Equal => forms.len() >= 2,
            RelationshipKind::Sum | RelationshipKind::Product => forms.len() >= 2,
            RelationshipKind::Table(table) => forms.len() == self.model.tables[table].columns,
            RelationshipKind::Function(at) => forms.len() == self.model.functions[at].arguments,
            _ => forms.len() == 2,
        };
        if !fits {
            let expected = match kind {
                RelationshipKind::Table(table) => arguments(self.model.tables[table].columns),
                RelationshipKind::Function(at) => arguments(self.model.functions[at].arguments),
                RelationshipKind::Different | RelationshipKind::Less | RelationshipKind::AtMost => {
                    arguments(2)
                }
                _ => "2 arguments or more".to_owned(),
            };
            self.notes.refuse(form, expected, forms.len().to_string());
            return None;
        }
        let operands: Option<Vec<(Operand, Option<Sort>)>> = forms
            .iter()
            .map(|&form| self.operand(form, draft))
            .collect();
        let operands = operands?;
        self.check_sorts(kind, forms, &operands)?;
        let operands = operands.into_iter().map(|(operand, _)| operand).collect();
        Some(Relationship {
            position: form.position(),
            kind,
            operands,
        })
    }

    fn check_sorts(
        &mut self,
        kind: RelationshipKind,
        forms: &[Form<'t>],
        operands: &[(Operand, Option<Sort>)],
    ) -> Option<()> {
        let sorts = operands.iter().map(|(_, sort)| *sort);
        let wanted = match kind {
            RelationshipKind::Equal | RelationshipKind::Different => {
                let known = sorts.clone().flatten().next();
                // Of variables that no pattern has typed, nothing is known.
                known.unwrap_or(Sort::Number)
            }
            RelationshipKind::Table(_) | RelationshipKind::Function(_) => return Some(()),
            _ => Sort::Number,
        };
        let mut sorts = forms.iter().zip(sorts);
        match sorts.find(|(_, sort)| sort.is_some_and(|sort| sort != wanted)) {
            Some((form, _)) => {
                self.notes.error(*form, wanted.name());
                None
            }
            None => Some(()),
        }
    }

    /// A value, a variable, or a time of a token, as `(start label)`; with its sort, if known.
    fn operand(
        &mut self,
        form: Form<'t>,
        draft: &mut Draft<'t>,
    ) -> Option<(Operand, Option<Sort>)> {
        if self.is_variable(form) {
            let id = self.variable(form, None, &mut draft.variables)?;
            return Some((Operand::Variable(id), self.sort_of(id, &draft.variables)));
        }
        if form.is_list() {
            let mut parts = form.children().skip(1);
            let (label, more) = (parts.next(), parts.next());
            if !is_time(form) || more.is_some() {
                self.notes
                    .error(form, "(start label), (end label) or (duration label)");
                return None;
            }
            let label = match label {
                Some(label) => self.label(label, draft)?,
                None => 0,
            };
            let operand = match form.head() {
                Some("start") => Operand::Start(label),
                Some("end") => Operand::Finish(label),
                _ => Operand::Duration(label),
            };
            return Some((operand, Some(Sort::Number)));
        }
        let Some((value, sort)) = self.value(form) else {
            let known = self.names.symbols.keys().map(String::as_str);
            match form.kind() {
                Kind::Symbol => self.notes.unknown(form, "a value or a variable", known),
                _ => self.notes.error(form, "a value or a variable"),
            }
            return None;
        };
        Some((Operand::Value(value), Some(sort)))
    }
}

/// Whether a list is a time of a token.
fn is_time(form: Form) -> bool {
    matches!(form.head(), Some("start" | "end" | "duration"))
}
