//! What of a scenario can be left out, and the scenario without some of it.

use farside_actors::system::{Entries, Removable};
use toml::{Table, Value};

/// A list of things in a scenario that can be left out.
#[derive(Clone, Debug)]
pub(super) struct Part {
    /// What they are, in the plural.
    pub(super) what: &'static str,
    /// The dotted key.
    pub(super) key: String,
    entries: Entries,
    /// How many there are.
    pub(super) count: usize,
}

/// The places of what is kept, ascending; part by part.
pub(super) type Selection = Vec<Vec<u32>>;

/// A scenario of which parts can be left out.
#[derive(Clone, Debug)]
pub(super) struct Whole {
    table: Table,
    pub(super) parts: Vec<Part>,
}

/// The key of messages that are lost.
pub(super) const LOSE: &str = "lose";

/// What all systems share, in the order in which it is tried.
fn shared() -> Vec<Removable> {
    let listed = |what, key: &str| Removable::new(what, key, Entries::Listed);
    let keyed = |what, key: &str| Removable::new(what, key, Entries::Keyed);
    vec![
        listed("crashes", "crash"),
        listed("degradations", "degrade"),
        listed("forks", "fork"),
        Removable::new("contact plan", "contacts", Entries::Whole),
        keyed("patterns over links", "links"),
        keyed("radios", "radios"),
        keyed("places", "places"),
        listed("delivered messages", "deliver"),
        listed("postponed messages", "postpone"),
        listed("lost messages", LOSE),
    ]
}

fn steps(key: &str) -> impl Iterator<Item = &str> {
    key.split('.')
}

/// What stands at a key.
fn look_up<'a>(table: &'a Table, key: &str) -> Option<&'a Value> {
    let (first, rest) = key.split_once('.').unwrap_or((key, ""));
    let mut value = table.get(first)?;
    for step in steps(rest).filter(|step| !step.is_empty()) {
        value = match value {
            Value::Table(table) => table.get(step)?,
            Value::Array(all) => all.get(step.parse::<usize>().ok()?)?,
            _ => return None,
        };
    }
    Some(value)
}

/// Where a key stands or would stand: the table that has it, and its last step.
fn place<'a, 'k>(table: &'a mut Table, key: &'k str) -> Option<(&'a mut Table, &'k str)> {
    let Some((path, last)) = key.rsplit_once('.') else {
        return Some((table, key));
    };
    let mut path = steps(path);
    let mut value = table
        .entry(path.next()?)
        .or_insert_with(|| Value::Table(Table::new()));
    for step in path {
        value = match value {
            Value::Table(table) => table
                .entry(step)
                .or_insert_with(|| Value::Table(Table::new())),
            Value::Array(all) => all.get_mut(step.parse::<usize>().ok()?)?,
            _ => return None,
        };
    }
    Some((value.as_table_mut()?, last))
}

/// The names in a table that can be left out.
fn keys(table: &Table) -> impl Iterator<Item = &String> {
    table.keys().filter(|key| *key != "default")
}

impl Part {
    fn of(removable: Removable, table: &Table) -> Part {
        let Removable { what, key, entries } = removable;
        let value = look_up(table, &key);
        let count = match (&entries, value) {
            (Entries::Named(names), _) => names.len(),
            (Entries::Listed, Some(Value::Array(all))) => all.len(),
            (Entries::Counted, Some(Value::Integer(count))) => usize::try_from(*count).unwrap_or(0),
            (Entries::Keyed, Some(Value::Table(table))) => keys(table).count(),
            (Entries::Whole, Some(_)) => 1,
            _ => 0,
        };
        Part {
            what,
            key,
            entries,
            count,
        }
    }

    /// Leaves in `table` what is kept of this part.
    fn keep(&self, table: &mut Table, kept: &[u32]) {
        if kept.len() == self.count {
            return;
        }
        let Some((table, last)) = place(table, &self.key) else {
            return;
        };
        let is_kept = |number: usize| kept.binary_search(&(number as u32)).is_ok();
        match &self.entries {
            Entries::Named(names) => {
                let names = kept
                    .iter()
                    .map(|at| Value::from(names[*at as usize].as_str()));
                table.insert(last.to_owned(), Value::Array(names.collect()));
            }
            Entries::Counted => {
                table.insert(last.to_owned(), Value::Integer(kept.len() as i64));
            }
            Entries::Whole => drop(table.remove(last)),
            Entries::Listed if kept.is_empty() => drop(table.remove(last)),
            Entries::Listed => {
                if let Some(Value::Array(all)) = table.get_mut(last) {
                    let mut number = 0..;
                    all.retain(|_| number.next().is_some_and(is_kept));
                }
            }
            Entries::Keyed => {
                if let Some(Value::Table(within)) = table.get_mut(last) {
                    let all: Vec<String> = keys(within).cloned().collect();
                    for (_, key) in all.iter().enumerate().filter(|(at, _)| !is_kept(*at)) {
                        within.remove(key);
                    }
                }
            }
        }
    }

    /// Whether nothing can be kept of it: a list of members that is empty means all.
    fn needs_one(&self) -> bool {
        matches!(self.entries, Entries::Named(_))
    }
}

impl Whole {
    /// A scenario, and what its system says can be left out.
    pub(super) fn new(table: Table, removable: Vec<Removable>) -> Whole {
        let all = removable.into_iter().chain(shared());
        let parts = all.map(|removable| Part::of(removable, &table));
        let parts = parts.filter(|part| part.count > 0).collect();
        Whole { table, parts }
    }

    /// All of it.
    pub(super) fn all(&self) -> Selection {
        let all = |part: &Part| (0..part.count as u32).collect();
        self.parts.iter().map(all).collect()
    }

    /// The scenario with what is kept; none if there can be no such scenario.
    pub(super) fn keep(&self, kept: &Selection) -> Option<Table> {
        let mut parts: Vec<_> = self.parts.iter().zip(kept).collect();
        if parts
            .iter()
            .any(|(part, kept)| part.needs_one() && kept.is_empty())
        {
            return None;
        }
        // What is within an entry before entries are gone, and their places with them.
        parts.sort_by_key(|(part, _)| std::cmp::Reverse(steps(&part.key).count()));
        let mut table = self.table.clone();
        for (part, kept) in parts {
            part.keep(&mut table, kept);
        }
        Some(table)
    }

    /// What is kept without entries that name a member who is not: a crash of somebody who is not there is
    /// refused. None if there is no such entry.
    pub(super) fn without_strangers(&self, kept: &Selection) -> Option<Selection> {
        let mut gone: Vec<&str> = Vec::new();
        for (part, kept) in self.parts.iter().zip(kept) {
            if let Entries::Named(names) = &part.entries {
                let names = (0..).zip(names);
                let names = names.filter(|(at, _)| kept.binary_search(at).is_err());
                gone.extend(names.map(|(_, name)| name.as_str()));
            }
        }
        if gone.is_empty() {
            return None;
        }
        gone.sort_unstable();
        let mut less = kept.clone();
        for (part, kept) in self.parts.iter().zip(&mut less) {
            let value = look_up(&self.table, &part.key);
            match (&part.entries, value) {
                (Entries::Listed, Some(Value::Array(all))) => {
                    kept.retain(|at| !names_any(&all[*at as usize], &gone));
                }
                (Entries::Keyed, Some(Value::Table(table))) => {
                    let all: Vec<&String> = keys(table).collect();
                    kept.retain(|at| !has_word(all[*at as usize], &gone));
                }
                _ => {}
            }
        }
        (less != *kept).then_some(less)
    }

    /// The place of a part, by its key.
    pub(super) fn place_of(&self, key: &str) -> Option<usize> {
        self.parts.iter().position(|part| part.key == key)
    }

    /// The texts of the messages in the part at `place`.
    pub(super) fn messages(&self, place: usize) -> Vec<&str> {
        let all = look_up(&self.table, &self.parts[place].key);
        let all = all.and_then(Value::as_array).into_iter().flatten();
        let message = all.map(|entry| entry.get("message").and_then(Value::as_str));
        message.map(Option::unwrap_or_default).collect()
    }
}

/// Whether a value has one of these names, sorted, anywhere in it.
fn names_any(value: &Value, names: &[&str]) -> bool {
    match value {
        Value::String(text) => has_word(text, names),
        Value::Array(all) => all.iter().any(|value| names_any(value, names)),
        Value::Table(table) => table.values().any(|value| names_any(value, names)),
        _ => false,
    }
}

fn has_word(text: &str, words: &[&str]) -> bool {
    let mut found = text.split(|letter: char| !letter.is_alphanumeric() && letter != '_');
    found.any(|word| words.binary_search(&word).is_ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn whole() -> Whole {
        let text = "
            system = 'x'
            crash = [{ actor = 'rover_2', at = '5s' }, { host = 'node_1', at = '6s' }]
            [team]
            rovers = 3
            [[traffic.groups]]
            prefix = 'a'
            count = 2
            [[traffic.groups]]
            prefix = 'b'
            count = 5
            [links.default]
            loss = 0.1
            [links.'rover_2-*']
            loss = 0.3
            [links.'rover_3-*']
            loss = 0.3
        ";
        let names = ["rover_1", "rover_2", "rover_3"]
            .map(str::to_owned)
            .to_vec();
        let own = vec![
            Removable::named("rovers", "team.only", names),
            Removable::new("members", "traffic.groups.1.count", Entries::Counted),
            Removable::new("groups", "traffic.groups", Entries::Listed),
            Removable::new("goals", "goal", Entries::Listed),
        ];
        Whole::new(toml::from_str(text).unwrap(), own)
    }

    #[test]
    fn what_is_not_kept_is_gone_and_the_rest_is_as_it_was() {
        let whole = whole();
        let keys: Vec<&str> = whole.parts.iter().map(|part| part.key.as_str()).collect();
        let expected = [
            "team.only",
            "traffic.groups.1.count",
            "traffic.groups",
            "crash",
            "links",
        ];
        assert_eq!(keys, expected);
        assert_eq!(whole.keep(&whole.all()), Some(whole.table.clone()));
        let kept = vec![vec![0, 2], vec![0, 1], vec![1], vec![], vec![1]];
        let table = whole.keep(&kept).unwrap();
        let text = "
            system = 'x'
            [team]
            rovers = 3
            only = ['rover_1', 'rover_3']
            [[traffic.groups]]
            prefix = 'b'
            count = 2
            [links.default]
            loss = 0.1
            [links.'rover_3-*']
            loss = 0.3
        ";
        assert_eq!(table, toml::from_str::<Table>(text).unwrap());
        let nobody = vec![vec![], vec![0], vec![1], vec![], vec![1]];
        assert_eq!(whole.keep(&nobody), None);
    }

    #[test]
    fn entries_that_name_who_is_gone_go_too() {
        let whole = whole();
        assert_eq!(whole.without_strangers(&whole.all()), None);
        let mut kept = whole.all();
        kept[0] = vec![0, 2];
        let less = whole.without_strangers(&kept).unwrap();
        assert_eq!(less[3..], [vec![1], vec![1]]);
        assert_eq!(less[..3], kept[..3]);
    }
}
