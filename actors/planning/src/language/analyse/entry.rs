//! A form with its values and the options that follow them.

use crate::language::findings::Notes;
use crate::language::tree::{Form, Kind};

/// `(head value … :option value … …)`.
pub(super) struct Entry<'t> {
    pub(super) form: Form<'t>,
    pub(super) head: &'t str,
    pub(super) values: Vec<Form<'t>>,
    options: Vec<(Form<'t>, Vec<Form<'t>>)>,
}

impl<'t> Entry<'t> {
    pub(super) fn of(form: Form<'t>, head: &'t str) -> Entry<'t> {
        let (mut values, mut options) = (Vec::new(), Vec::<(Form, Vec<Form>)>::new());
        for child in form.children().skip(1) {
            match options.last_mut() {
                _ if child.kind() == Kind::Keyword => options.push((child, Vec::new())),
                Some((_, of)) => of.push(child),
                None => values.push(child),
            }
        }
        Entry {
            form,
            head,
            values,
            options,
        }
    }

    /// Notes options that the form does not have, and those that are given twice.
    pub(super) fn check_options(&self, known: &[&str], notes: &mut Notes) {
        for (place, (option, _)) in self.options.iter().enumerate() {
            let before = &self.options[..place.min(known.len())];
            if !known.contains(&option.word()) {
                let expected = match known {
                    [] => format!("no option of {}", self.head),
                    _ => format!("an option of {}", self.head),
                };
                notes.unknown(*option, expected, known.iter().copied());
            } else if before
                .iter()
                .any(|(other, _)| other.word() == option.word())
            {
                notes.error(*option, "each option once");
            }
        }
    }

    /// The keyword of an option, if it is given.
    pub(super) fn keyword(&self, name: &str) -> Option<Form<'t>> {
        let option = self
            .options
            .iter()
            .find(|(option, _)| option.word() == name);
        option.map(|(option, _)| *option)
    }

    /// The values of an option; none if it is not given.
    pub(super) fn option(&self, name: &str) -> &[Form<'t>] {
        let option = self
            .options
            .iter()
            .find(|(option, _)| option.word() == name);
        option.map_or(&[], |(_, values)| values.as_slice())
    }

    /// The value of an option that has one.
    pub(super) fn one(&self, name: &str, notes: &mut Notes) -> Option<Form<'t>> {
        let keyword = self.keyword(name)?;
        match self.option(name) {
            [value] => Some(*value),
            [] => {
                notes.error(keyword, format!("a value after {name}"));
                None
            }
            [_, more, ..] => {
                notes.error(*more, format!("one value after {name}"));
                None
            }
        }
    }
}
