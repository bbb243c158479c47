//! Protobuf identifiers from serde names, each unique in its scope.

use std::collections::BTreeSet;

/// Makes an identifier of any text: what protobuf forbids becomes `_`.
pub(super) fn identifier(name: &str) -> String {
    let keep = |c: char| {
        if c.is_ascii_alphanumeric() || c == '_' {
            c
        } else {
            '_'
        }
    };
    let mut text: String = name.chars().map(keep).collect();
    if !text.starts_with(|c: char| c.is_ascii_alphabetic()) {
        text.insert_str(0, "x_");
    }
    text
}

/// `MoveTo` becomes `move_to`.
pub(super) fn snake(name: &str) -> String {
    let mut text = String::new();
    let mut before = '_';
    for c in identifier(name).chars() {
        if c.is_ascii_uppercase() && (before.is_ascii_lowercase() || before.is_ascii_digit()) {
            text.push('_');
        }
        text.push(c.to_ascii_lowercase());
        before = c;
    }
    text
}

/// `move_to` becomes `MoveTo`, as protobuf names the entries of a map field.
pub(super) fn camel(name: &str) -> String {
    let mut text = String::new();
    let mut upper = true;
    for c in name.chars() {
        if c == '_' {
            upper = true;
        } else {
            text.push(if upper { c.to_ascii_uppercase() } else { c });
            upper = false;
        }
    }
    text
}

/// The names taken in one scope.
#[derive(Debug, Default)]
pub(super) struct Names {
    taken: BTreeSet<String>,
    folded: BTreeSet<String>,
}

impl Names {
    /// Takes the name, or the first free one of `name_2`, `name_3`...
    pub(super) fn take(&mut self, name: &str) -> String {
        self.first_free(name, false)
    }

    /// Takes a name for a field or enum value. Among these, names that differ only in case or
    /// underscores count as one: protobuf refuses fields whose JSON names are equal.
    pub(super) fn take_folded(&mut self, name: &str) -> String {
        self.first_free(name, true)
    }

    /// Takes exactly this name, if it is free.
    pub(super) fn take_exact(&mut self, name: &str) -> bool {
        self.taken.insert(name.to_owned())
    }

    fn first_free(&mut self, name: &str, folds: bool) -> String {
        let mut free = name.to_owned();
        let mut count = 1;
        while self.taken.contains(&free) || (folds && self.folded.contains(&folded(&free))) {
            count += 1;
            free = format!("{name}_{count}");
        }
        self.taken.insert(free.clone());
        if folds {
            self.folded.insert(folded(&free));
        }
        free
    }
}

fn folded(name: &str) -> String {
    name.chars()
        .filter(|&c| c != '_')
        .map(|c| c.to_ascii_lowercase())
        .collect()
}
