//! The text of a scenario, with `--set` laid over it, and where in it everything stands.
//!
//! Positions are byte offsets: those of the file first, then, end to end, those of each `--set`
//! argument. So one span says where a mistake is, whoever made it.
//!
//! Keys that a system has given other names are moved to their new places first, in the file and in
//! each `--set`, so that nothing behind this knows the old ones.

use std::ops::Range;

use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};

use farside_actors::system::Renamed;

use super::error::ScenarioError;
use super::location::{MAX_SHOWN, SourceLocation, one_line};

/// The most keys in a path; scenarios have at most four. Tables are dropped recursively.
const MAX_DEPTH: usize = 16;

/// A `--set` argument, taken apart.
struct Set {
    argument: String,
    keys: Vec<String>,
    /// Where the value starts in the argument.
    value_at: usize,
    /// Where the argument starts among all positions.
    base: usize,
}

/// A scenario's text and its `--set` arguments.
pub(crate) struct Source {
    name: String,
    text: String,
    sets: Vec<Set>,
    /// The keys of the system that have other names now.
    renamed: Vec<Renamed>,
    /// Those of them that are used under their old names.
    used: Vec<Renamed>,
}

impl Source {
    pub(crate) fn new(name: &str, text: String, sets: &[String]) -> Result<Self, ScenarioError> {
        let mut base = text.len() + 1;
        let mut taken = Vec::new();
        for argument in sets {
            let (keys, value_at) = split_set(argument)?;
            taken.push(Set {
                argument: argument.clone(),
                keys,
                value_at,
                base,
            });
            base += argument.len() + 1;
        }
        Ok(Source {
            name: name.to_owned(),
            text,
            sets: taken,
            renamed: Vec::new(),
            used: Vec::new(),
        })
    }

    /// Reads keys under these old names as under their new ones from now on.
    ///
    /// # Errors
    /// When the file has a key under both names.
    pub(crate) fn rename(&mut self, renamed: Vec<Renamed>) -> Result<(), ScenarioError> {
        self.renamed = renamed;
        let document = self.parsed()?;
        let mut used = Vec::new();
        for renamed in &self.renamed {
            let (old, new) = (parts(&renamed.old), parts(&renamed.new));
            let (old, new) = (
                find(document.get_ref(), &old),
                find(document.get_ref(), &new),
            );
            if let (Some(old), Some(_)) = (old, new) {
                return Err(ScenarioError::Invalid {
                    place: self.place(old.span().start),
                    key: renamed.old.clone(),
                    message: format!("this is {} now, which is given too", renamed.new),
                });
            }
            let is_set = self
                .sets
                .iter()
                .any(|set| set.keys.join(".") == renamed.old);
            if old.is_some() || is_set {
                used.push(renamed.clone());
            }
        }
        for set in &mut self.sets {
            let key = set.keys.join(".");
            if let Some(renamed) = self.renamed.iter().find(|renamed| renamed.old == key) {
                set.keys = parts(&renamed.new)
                    .iter()
                    .map(|part| (*part).to_owned())
                    .collect();
            }
        }
        self.used = used;
        Ok(())
    }

    /// What to tell whoever uses old names.
    pub(crate) fn remarks(&self) -> impl Iterator<Item = String> {
        let remark = |Renamed { old, new }: &Renamed| format!("{old} is called {new} now");
        self.used.iter().map(remark)
    }

    fn parsed(&self) -> Result<Spanned<DeTable<'_>>, ScenarioError> {
        DeTable::parse(&self.text).map_err(|error| ScenarioError::Syntax {
            place: self.place(error.span().unwrap_or_default().start),
            message: one_line(error.message()),
        })
    }

    /// The document: the file's table with every `--set` laid over it.
    pub(crate) fn document(&self) -> Result<Spanned<DeTable<'_>>, ScenarioError> {
        let mut root = self.parsed()?;
        for Renamed { old, new } in &self.renamed {
            move_key(root.get_mut(), &parts(old), &parts(new));
        }
        for set in &self.sets {
            self.lay_over(root.get_mut(), set)?;
        }
        Ok(root)
    }

    fn lay_over<'i>(&'i self, root: &mut DeTable<'i>, set: &'i Set) -> Result<(), ScenarioError> {
        let whole = set.base..set.base + set.argument.len();
        let raw = &set.argument[set.value_at..];
        let base = set.base + set.value_at;
        let value = match DeValue::parse(raw) {
            Ok(value) => shifted(value, base),
            // Nobody means a string that begins like this.
            Err(error) if raw.trim_start().starts_with(['[', '{', '"', '\'']) => {
                return Err(ScenarioError::Syntax {
                    place: self.place(set.base),
                    message: one_line(error.message()),
                });
            }
            // What else is no TOML value is a string: `--set links.default.latency=5ms`.
            Err(_) => Spanned::new(base..base + raw.len(), DeValue::String(raw.into())),
        };
        let Some((last, tables)) = set.keys.split_last() else {
            return Ok(());
        };
        let not_a_table = |depth: usize, found: &DeValue<'_>| ScenarioError::Invalid {
            place: self.place(set.base),
            key: set.keys[..=depth].join("."),
            message: format!("{} has no keys of its own", found.type_str()),
        };
        let mut at = Slot::Table(root);
        for (depth, key) in tables.iter().enumerate() {
            let next = at.child(key, &whole);
            let next = next.ok_or_else(|| self.no_entry(set, depth))?;
            at = match next {
                DeValue::Table(table) => Slot::Table(table),
                DeValue::Array(array) => Slot::Array(array),
                other => return Err(not_a_table(depth, other)),
            };
        }
        match at {
            Slot::Table(table) => {
                // Replacing keeps the key's place, which decides between patterns over links; but
                // its span must be the argument's.
                let key = Spanned::new(whole, DeString::from(last.as_str()));
                if let Some(old) = table.get_mut(last.as_str()) {
                    *old = value;
                } else {
                    table.insert(key, value);
                }
                Ok(())
            }
            Slot::Array(_) => {
                let depth = tables.len();
                let entry = at.child(last, &whole);
                *entry.ok_or_else(|| self.no_entry(set, depth))? = value.into_inner();
                Ok(())
            }
        }
    }

    fn no_entry(&self, set: &Set, depth: usize) -> ScenarioError {
        ScenarioError::Invalid {
            place: self.place(set.base),
            key: set.keys[..=depth].join("."),
            message: "there is no such entry; entries are numbered from 0".to_owned(),
        }
    }

    /// Where the byte `offset` of all positions stands.
    pub(crate) fn place(&self, offset: usize) -> Box<SourceLocation> {
        if let Some(set) = self.sets.iter().rev().find(|set| set.base <= offset) {
            return Box::new(SourceLocation::Set {
                argument: set.argument.clone(),
            });
        }
        let mut offset = offset.min(self.text.len());
        while !self.text.is_char_boundary(offset) {
            offset -= 1;
        }
        let before = &self.text[..offset];
        let start = before.rfind('\n').map_or(0, |newline| newline + 1);
        Box::new(SourceLocation::File {
            name: self.name.clone(),
            line: before.matches('\n').count() + 1,
            column: before[start..].chars().count() + 1,
            text: self.text[start..].lines().next().unwrap_or("").to_owned(),
        })
    }

    /// Where the value of a key stands, given from the top, entries of arrays by number; or the
    /// nearest table above it that is there.
    pub(crate) fn place_of_key(&self, keys: &[String]) -> Box<SourceLocation> {
        let Ok(root) = self.document() else {
            return self.place(0);
        };
        let mut span = 0..0;
        let root = DeValue::Table(root.into_inner());
        let mut at = &root;
        for key in keys {
            let next = match at {
                DeValue::Table(table) => table.get(key.as_str()),
                DeValue::Array(array) => key.parse().ok().and_then(|n: usize| array.get(n)),
                _ => None,
            };
            let Some(next) = next else { break };
            span = next.span();
            at = next.get_ref();
        }
        self.place(span.start)
    }

    /// The key whose key or value covers `span`, as the dotted path from the top.
    pub(crate) fn key_at(&self, span: &Range<usize>) -> String {
        let mut path = Vec::new();
        if let Ok(root) = self.document() {
            descend(root.get_ref(), span, &mut path);
        }
        path.join(".")
    }
}

/// A dotted key, part by part.
fn parts(key: &str) -> Vec<&str> {
    key.split('.').collect()
}

/// The value of a key, given from the top.
fn find<'a, 'i>(table: &'a DeTable<'i>, key: &[&str]) -> Option<&'a Spanned<DeValue<'i>>> {
    let (first, rest) = key.split_first()?;
    let value = table.get(*first)?;
    match (rest, value.get_ref()) {
        ([], _) => Some(value),
        (rest, DeValue::Table(below)) => find(below, rest),
        _ => None,
    }
}

/// Moves what stands at `old`, if anything does, to `new`; it keeps its places in the text.
fn move_key<'i>(root: &mut DeTable<'i>, old: &[&'i str], new: &[&'i str]) {
    let Some((key, value)) = remove(root, old) else {
        return;
    };
    let Some((last, tables)) = new.split_last() else {
        return;
    };
    let mut at = root;
    for part in tables {
        let part = Spanned::new(key.span(), DeString::from(*part));
        let empty = || Spanned::new(key.span(), DeValue::Table(DeTable::new()));
        let DeValue::Table(below) = at.entry(part).or_insert_with(empty).get_mut() else {
            return;
        };
        at = below;
    }
    at.insert(Spanned::new(key.span(), DeString::from(*last)), value);
}

fn remove<'i>(
    table: &mut DeTable<'i>,
    key: &[&str],
) -> Option<(Spanned<DeString<'i>>, Spanned<DeValue<'i>>)> {
    let (first, rest) = key.split_first()?;
    if rest.is_empty() {
        return table.remove_entry(*first);
    }
    match table.get_mut(*first)?.get_mut() {
        DeValue::Table(below) => remove(below, rest),
        _ => None,
    }
}

/// What a key of a `--set` leads into.
enum Slot<'a, 'i> {
    Table(&'a mut DeTable<'i>),
    Array(&'a mut toml::de::DeArray<'i>),
}

impl<'a, 'i> Slot<'a, 'i> {
    /// The value at `key`; in a table an empty table is made if there is none.
    fn child(self, key: &'i str, span: &Range<usize>) -> Option<&'a mut DeValue<'i>> {
        match self {
            Slot::Table(table) => {
                let key = Spanned::new(span.clone(), DeString::from(key));
                let empty = || Spanned::new(span.clone(), DeValue::Table(DeTable::new()));
                Some(table.entry(key).or_insert_with(empty).get_mut())
            }
            Slot::Array(array) => {
                let at: usize = key.parse().ok()?;
                array.get_mut(at).map(Spanned::get_mut)
            }
        }
    }
}

fn covers(outer: &Range<usize>, inner: &Range<usize>) -> bool {
    outer.start <= inner.start && inner.end <= outer.end
}

fn descend(table: &DeTable<'_>, span: &Range<usize>, path: &mut Vec<String>) {
    // A `[table]`'s span is its header's, so children are searched whether it covers or not.
    for (key, value) in table {
        path.push(key.get_ref().to_string());
        if descend_value(value, span, path) || covers(&key.span(), span) {
            return;
        }
        path.pop();
    }
}

fn descend_value(
    value: &Spanned<DeValue<'_>>,
    span: &Range<usize>,
    path: &mut Vec<String>,
) -> bool {
    let depth = path.len();
    match value.get_ref() {
        DeValue::Table(table) => descend(table, span, path),
        DeValue::Array(array) => {
            for (index, entry) in array.iter().enumerate() {
                path.push(index.to_string());
                if descend_value(entry, span, path) {
                    return true;
                }
                path.pop();
            }
        }
        _ => {}
    }
    path.len() > depth || covers(&value.span(), span)
}

/// The value with every position moved by `base`.
fn shifted(value: Spanned<DeValue<'_>>, base: usize) -> Spanned<DeValue<'_>> {
    let span = value.span().start + base..value.span().end + base;
    let value = match value.into_inner() {
        DeValue::Array(array) => DeValue::Array(
            array
                .into_iter()
                .map(|entry| shifted(entry, base))
                .collect(),
        ),
        DeValue::Table(table) => {
            let mut moved = DeTable::new();
            for (key, value) in table {
                let span = key.span().start + base..key.span().end + base;
                moved.insert(Spanned::new(span, key.into_inner()), shifted(value, base));
            }
            DeValue::Table(moved)
        }
        plain => plain,
    };
    Spanned::new(span, value)
}

/// The keys of `KEY=VALUE`, and where the value starts. Keys are parted by dots; a key in quotes
/// may hold dots and equals signs.
fn split_set(argument: &str) -> Result<(Vec<String>, usize), ScenarioError> {
    let wrong = |message: &'static str| ScenarioError::BadSet {
        argument: argument.chars().take(MAX_SHOWN).collect(),
        message,
    };
    let mut keys = Vec::new();
    let mut key = String::new();
    let mut quote = None;
    for (at, c) in argument.char_indices() {
        match (quote, c) {
            (Some(open), c) if c == open => quote = None,
            (None, '"' | '\'') => quote = Some(c),
            (None, '.') => keys.push(std::mem::take(&mut key)),
            (None, '=') => {
                keys.push(key);
                let keys: Vec<String> = keys.iter().map(|key| key.trim().to_owned()).collect();
                if keys.len() > MAX_DEPTH {
                    return Err(wrong("the key has more than 16 parts"));
                }
                if keys.iter().any(String::is_empty) {
                    return Err(wrong("a part of the key is empty"));
                }
                return Ok((keys, at + 1));
            }
            (_, c) => key.push(c),
        }
    }
    Err(wrong("expected KEY=VALUE, as in team.rovers=75"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn source(text: &str, sets: &[&str]) -> Source {
        let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
        Source::new("x.toml", text.to_owned(), &sets).unwrap()
    }

    fn get(source: &Source, keys: &[&str]) -> String {
        let root = source.document().unwrap();
        let mut at = DeValue::Table(root.into_inner());
        for key in keys {
            at = match at {
                DeValue::Table(mut table) => table.remove(*key).unwrap().into_inner(),
                DeValue::Array(array) => {
                    let at = key.parse().unwrap();
                    array.into_iter().nth(at).unwrap().into_inner()
                }
                other => panic!("{other:?}"),
            };
        }
        match at {
            DeValue::String(text) => format!("{text:?}"),
            DeValue::Integer(number) => number.to_string(),
            DeValue::Float(number) => number.to_string(),
            other => format!("{other:?}"),
        }
    }

    #[test]
    fn a_set_is_read_as_toml_or_as_a_string() {
        let source = source(
            "[team]\nrovers = 5\n[[degrade]]\nat = '1s'\n",
            &[
                "team.rovers=75",
                "links.node_*-rover_*.loss=0.3",
                "links.default.latency=5ms",
                "links.\"a.b=c\".loss=1",
                "degrade.0.at=2s",
            ],
        );
        assert_eq!(get(&source, &["team", "rovers"]), "75");
        assert_eq!(get(&source, &["links", "node_*-rover_*", "loss"]), "0.3");
        assert_eq!(get(&source, &["links", "default", "latency"]), "\"5ms\"");
        assert_eq!(get(&source, &["links", "a.b=c", "loss"]), "1");
        assert_eq!(get(&source, &["degrade", "0", "at"]), "\"2s\"");
    }

    #[test]
    fn places_name_the_line_or_the_argument() {
        let source = source("[team]\n\"röver\" = 5\n", &["seed=7", "a.b=[1, 2]"]);
        let file = |line, column, text: &str| {
            Box::new(SourceLocation::File {
                name: "x.toml".to_owned(),
                line,
                column,
                text: text.to_owned(),
            })
        };
        let keys = |path: &str| -> Vec<String> { path.split('.').map(str::to_owned).collect() };
        assert_eq!(
            source.place_of_key(&keys("team.röver")),
            file(2, 11, "\"röver\" = 5")
        );
        assert_eq!(
            source.place_of_key(&keys("team.absent")),
            file(1, 1, "[team]")
        );
        assert_eq!(
            source.place_of_key(&keys("seed")).to_string(),
            "--set seed=7"
        );
        assert_eq!(
            source.place_of_key(&keys("a.b.1")).to_string(),
            "--set a.b=[1, 2]"
        );
        assert_eq!(source.key_at(&(7..15)), "team.röver");
        assert_eq!(source.key_at(&(26..27)), "seed");
    }

    fn renamed() -> Vec<Renamed> {
        let [old, new] = ["a.x", "a.b.x"].map(str::to_owned);
        vec![Renamed { old, new }]
    }

    #[test]
    fn a_key_under_its_old_name_is_read_under_its_new_one() {
        for (text, sets) in [
            ("[a]\nx = 1", &[][..]),
            ("a.x = 2\na.b.y = 3", &["a.x=1"]),
            ("a.b.x = 2", &["a.x=1"]),
            ("", &["a.x=1"]),
        ] {
            let mut source = source(text, sets);
            source.rename(renamed()).unwrap();
            assert_eq!(get(&source, &["a", "b", "x"]), "1", "{text} {sets:?}");
            let remarks: Vec<String> = source.remarks().collect();
            assert_eq!(remarks, ["a.x is called a.b.x now"]);
        }
        let mut new = source("a.b.x = 1", &["a.b.x=2"]);
        new.rename(renamed()).unwrap();
        assert_eq!(new.remarks().count(), 0);
        let mut both = source("[a]\nx = 1\nb = { x = 2 }", &[]);
        let error = both.rename(renamed()).unwrap_err().to_string();
        assert!(
            error.starts_with("x.toml:2:5: a.x: this is a.b.x now, which is given too"),
            "{error}"
        );
    }

    #[test]
    fn rubbish_is_refused() {
        let deep = format!("{}=1", ["a"; 100_000].join("."));
        for argument in [&deep, "", "=", "a", "a..b=1", ".a=1", "\"a=1"] {
            assert!(split_set(argument).is_err(), "{argument}");
        }
        let into_number = source("seed = 1", &["seed.x=2"]);
        let error = into_number.document().unwrap_err().to_string();
        assert!(error.contains("integer has no keys of its own"), "{error}");
        let array = source("", &["links=[1, "]).document().unwrap_err();
        assert!(array.to_string().starts_with("--set links=[1, : not TOML"));
        let beyond = source("[[degrade]]\nat = '1s'", &["degrade.1.at=2s"]);
        assert!(
            beyond
                .document()
                .unwrap_err()
                .to_string()
                .contains("no such entry")
        );
    }
}
