//! Tables and functions.

use super::{Declarations, unknown_function};
use crate::language::analyse::entry::Entry;
use crate::language::analyse::literal;
use crate::language::findings::arguments;
use crate::language::tree::Form;
use crate::model::{NUMBER, Table, TypeId};

impl<'t> Declarations<'t, '_> {
    pub(super) fn table(&mut self, entry: &Entry<'t>) {
        entry.check_options(&[], self.notes);
        let (name, columns, rows) = match entry.values.as_slice() {
            [name, columns, rows @ ..] if columns.is_list() => (*name, *columns, rows),
            _ => {
                let expected = "(Define_Table name (Type …) (value …) …)";
                self.notes.error(entry.form, expected);
                return;
            }
        };
        let Some(name_text) = self.name(name) else {
            return;
        };
        if !self.tables.insert(name_text) {
            self.twice(name);
            return;
        }
        let types: Vec<TypeId> = columns
            .children()
            .map(|form| {
                self.parameter(form)
                    .map_or(NUMBER, |parameter| parameter.of)
            })
            .collect();
        let mut found = Vec::new();
        for &row in rows {
            let values: Vec<Form> = row.children().collect();
            if values.len() != types.len() {
                let expected = format!("as many values as columns, {}", types.len());
                self.notes.refuse(row, expected, values.len().to_string());
                continue;
            }
            let values = values.into_iter().zip(&types);
            found.push(
                values
                    .filter_map(|(form, &of)| self.value_of(form, of))
                    .collect::<Vec<_>>(),
            );
        }
        if types.is_empty() {
            self.notes.error(columns, "one column or more");
        } else if rows.is_empty() {
            self.notes
                .error(entry.form, "one row or more, each in parentheses");
        }
        found.sort_unstable();
        found.dedup();
        let rows = found.concat();
        self.model.tables.push(Table {
            name: name_text.to_owned(),
            columns: types.len(),
            rows,
        });
    }

    pub(super) fn function(&mut self, entry: &Entry<'t>) {
        entry.check_options(&[], self.notes);
        let &[name, number] = entry.values.as_slice() else {
            self.notes
                .error(entry.form, "(Define_Function name number_of_arguments)");
            return;
        };
        let Some(name_text) = self.name(name) else {
            return;
        };
        let literal = literal::plain(literal::resolve(number, self.constants));
        let count = literal.and_then(|(value, _)| usize::try_from(value).ok());
        let Some(count) = count.filter(|count| (1..=64).contains(count)) else {
            self.notes
                .error(number, "how many arguments it has with its output, 1 to 64");
            return;
        };
        // Who gives functions gives their bodies; without one, its output is never known.
        match self.functions.get(name_text).copied() {
            Some(known) if known != count => {
                let expected = format!("{}, as {name_text} has", arguments(known));
                self.notes.error(number, expected);
            }
            Some(_) => {}
            None => {
                self.functions.insert(name_text.to_owned(), count);
                self.model
                    .functions
                    .push(unknown_function(name_text, count));
            }
        }
    }
}
