//! Types whose values follow each other without names or tags: what ROS message definitions and IDL say.

use std::collections::BTreeMap;

use crate::value::{NumberKind, Unreadable, within};

/// The types of a schema, and which of them its messages are.
#[derive(Debug, Default)]
pub(crate) struct Structs {
    pub(crate) structs: Vec<Struct>,
    pub(crate) enums: Vec<Enumeration>,
    pub(crate) root: usize,
}

/// A type of several fields.
#[derive(Debug, Default)]
pub(crate) struct Struct {
    pub(crate) name: String,
    pub(crate) fields: Vec<Field>,
    /// Why values of it cannot be read, where they cannot.
    pub(crate) refused: Option<String>,
}

/// A field of a struct.
#[derive(Debug)]
pub(crate) struct Field {
    pub(crate) name: String,
    pub(crate) kind: Type,
}

/// What a field holds.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Type {
    Number(NumberKind),
    Text { most: Option<u32> },
    WideText { most: Option<u32> },
    Struct(usize),
    Enum(usize),
    Array(Box<Type>, u32),
    Sequence(Box<Type>, Option<u32>),
}

/// Names for numbers.
#[derive(Debug, Default)]
pub(crate) struct Enumeration {
    #[cfg_attr(not(test), expect(dead_code, reason = "for tests and those who debug"))]
    pub(crate) name: String,
    pub(crate) values: BTreeMap<i64, String>,
}

impl Structs {
    /// The struct of this place.
    pub(crate) fn get(&self, at: usize) -> Result<&Struct, Unreadable> {
        let missing = || Unreadable::new("a type that is not declared");
        self.structs.get(at).ok_or_else(missing)
    }

    /// Calls `each` with every field that messages have, as long as it says so.
    pub(crate) fn fields(&self, each: &mut dyn FnMut(&str) -> bool, depth: usize) {
        self.fields_of(self.root, &mut String::new(), each, depth);
    }

    fn fields_of(
        &self,
        at: usize,
        path: &mut String,
        each: &mut dyn FnMut(&str) -> bool,
        depth: usize,
    ) -> bool {
        let mut goes_on = depth > 0;
        for field in self.structs.get(at).iter().flat_map(|one| &one.fields) {
            within(path, &field.name, &mut |path| {
                goes_on = goes_on && each(path);
                if let Some(inner) = field.kind.inner().filter(|_| goes_on) {
                    self.fields_of(inner, path, each, depth - 1);
                }
            });
        }
        goes_on
    }
}

impl Type {
    #[cfg(test)]
    /// What the type is in words, for those who read two schemas.
    pub(crate) fn says(&self, of: &Structs) -> String {
        let most = |most: &Option<u32>| most.map_or(String::new(), |most| format!("<={most}"));
        match self {
            Type::Number(kind) => format!("{kind:?}").to_lowercase(),
            Type::Text { most: limit } => format!("string{}", most(limit)),
            Type::WideText { most: limit } => format!("wstring{}", most(limit)),
            Type::Struct(at) => of.structs.get(*at).map_or("?", |one| &one.name).to_owned(),
            Type::Enum(at) => of.enums.get(*at).map_or("?", |one| &one.name).to_owned(),
            Type::Array(of_type, count) => format!("{}[{count}]", of_type.says(of)),
            Type::Sequence(of_type, limit) => format!("{}[{}]", of_type.says(of), most(limit)),
        }
    }

    /// The struct that it holds, alone or in a list.
    pub(crate) fn inner(&self) -> Option<usize> {
        match self {
            Type::Struct(at) => Some(*at),
            Type::Array(of, _) | Type::Sequence(of, _) => of.inner(),
            _ => None,
        }
    }
}
