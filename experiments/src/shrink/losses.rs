//! The schedule of losses: what links lost by chance in a run, message by message, and the scenario that
//! loses just these.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use farside::record::{Flow, Observer, ObserverError, Record, RecordClass};
use farside::ruling::{MessageId, MessageNumber};
use farside::{MatchKey, RunInfo};
use farside_actors::link::{BURST, CORRUPT, LOSS};
use toml::{Table, Value};

use super::parts::LOSE;

/// The keys with which links lose by chance, and what turns each off.
const CHANCE: [(&str, &str); 5] = [
    ("loss", "0%"),
    ("burst", "off"),
    ("corrupt", "0%"),
    ("ber", "0%"),
    ("ack_loss", "off"),
];

/// Other names of keys of links.
const ALSO: [&str; 3] = ["gemodel", "loss_gemodel", "loss_state"];

/// Keys that draw, and lose nothing.
const OTHER_CHANCE: [&str; 3] = ["jitter", "duplicate", "reorder"];

/// A message that was lost, in the order of losses.
#[derive(Clone, Debug)]
struct Lost {
    flow: [u32; 3],
    ordinal: u64,
    copy: u32,
}

/// What is seen of the messages of a run.
#[derive(Default)]
pub(super) struct Seen {
    run: Option<Arc<RunInfo>>,
    kinds: Vec<String>,
    lost: Vec<Lost>,
    /// The protocols' keys of messages, by flow and number.
    keys: BTreeMap<[u32; 3], BTreeMap<u64, MatchKey>>,
}

/// Sees what links lose by chance.
pub(super) struct LossWatch(Arc<Mutex<Seen>>);

impl LossWatch {
    /// An observer, and what it will have seen.
    pub(super) fn new() -> (LossWatch, Arc<Mutex<Seen>>) {
        let seen = Arc::new(Mutex::new(Seen::default()));
        (LossWatch(seen.clone()), seen)
    }
}

impl Observer for LossWatch {
    fn begin(&mut self, run: &Arc<RunInfo>) -> Result<(), ObserverError> {
        let mut seen = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        seen.run = Some(run.clone());
        Ok(())
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        if let (Some(kind), true) = (record.kind, record.class.is_fate() && record.link.is_some()) {
            let mut seen = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            let known = seen.kinds.iter().position(|known| known == kind.name());
            let kind = known.unwrap_or_else(|| {
                seen.kinds.push(kind.name().to_owned());
                seen.kinds.len() - 1
            });
            let ends = [record.sender.index() as u32, record.receiver.index() as u32];
            let flow = [ends[0], ends[1], kind as u32];
            if let Some(key) = record.match_key {
                seen.keys
                    .entry(flow)
                    .or_default()
                    .insert(record.ordinal, key);
            }
            let by_chance = [LOSS, BURST, CORRUPT].contains(&record.reason);
            if record.class == RecordClass::Lost && by_chance {
                seen.lost.push(Lost {
                    flow,
                    ordinal: record.ordinal,
                    copy: record.copy,
                });
            }
        }
        Ok(Flow::Continue)
    }
}

impl Seen {
    /// The messages that were lost by chance, in the order of their losses.
    pub(super) fn lost(&self) -> Vec<MessageId> {
        let Some(run) = &self.run else {
            return Vec::new();
        };
        let repeats: BTreeMap<[u32; 3], BTreeMap<u64, u32>> = self
            .keys
            .iter()
            .map(|(flow, keys)| (*flow, repeats(keys)))
            .collect();
        let id = |lost: &Lost| {
            let name = |at: u32| run.entities[at as usize].name.clone();
            let number = self.keys.get(&lost.flow).and_then(|keys| {
                let key = *keys.get(&lost.ordinal)?;
                let repeat = repeats[&lost.flow][&lost.ordinal];
                Some(MessageNumber::Key { key, repeat })
            });
            MessageId {
                sender: name(lost.flow[0]),
                receiver: name(lost.flow[1]),
                kind: self.kinds[lost.flow[2] as usize].clone(),
                number: number.unwrap_or(MessageNumber::Ordinal(lost.ordinal)),
                copy: lost.copy,
            }
        };
        self.lost.iter().map(id).collect()
    }
}

/// How many messages with the same key came right before, for each message of a flow.
fn repeats(keys: &BTreeMap<u64, MatchKey>) -> BTreeMap<u64, u32> {
    let mut before: Option<(u64, MatchKey, u32)> = None;
    let all = keys.iter().map(|(&ordinal, &key)| {
        let repeat = match before {
            Some((last, same, repeats)) if last + 1 == ordinal && same == key => repeats + 1,
            _ => 0,
        };
        before = Some((ordinal, key, repeat));
        (ordinal, repeat)
    });
    all.collect()
}

/// Whether links of a scenario lose by chance.
pub(super) fn by_chance(scenario: &Table) -> bool {
    let mut scenario = scenario.clone();
    let before = scenario.clone();
    lose_nothing(&mut scenario);
    scenario != before
}

/// What of links is drawn from the seed and loses nothing.
pub(super) fn other_chance(scenario: &Table) -> Vec<&'static str> {
    let is_on = |value: &Value| match value {
        Value::Float(number) => *number > 0.0,
        Value::Integer(number) => *number > 0,
        Value::String(text) => {
            text.starts_with(|first: char| ('1'..='9').contains(&first)) || {
                let number =
                    text.trim_end_matches(|last: char| last.is_alphabetic() || last == '%');
                number.parse::<f64>().is_ok_and(|number| number > 0.0)
            }
        }
        _ => false,
    };
    let links = scenario.get("links").and_then(Value::as_table);
    let tables = links.into_iter().flat_map(Table::values);
    let tables: Vec<&Table> = tables.filter_map(Value::as_table).collect();
    let has = |key: &&&str| {
        tables
            .iter()
            .any(|table| table.get(**key).is_some_and(is_on))
    };
    OTHER_CHANCE.iter().filter(has).copied().collect()
}

/// Turns off in a table of links what loses by chance. What loses all of them is no chance.
fn quieten(table: &mut Table) {
    let has_preset = table.contains_key("preset");
    let loses_all = |value: &Value| match value {
        Value::Float(number) => *number >= 1.0,
        Value::Integer(number) => *number >= 1,
        Value::String(text) => text == "100%" || text == "1",
        _ => false,
    };
    let is_off = |value: &Value| match value {
        Value::Float(number) => *number <= 0.0,
        Value::Integer(number) => *number <= 0,
        Value::String(text) => ["0", "0%", "off"].contains(&text.as_str()),
        _ => false,
    };
    for also in ALSO {
        if let Some(burst) = table.remove(also) {
            table.insert("burst".to_owned(), burst);
        }
    }
    for (key, off) in CHANCE {
        match table.get(key) {
            Some(value) if loses_all(value) || is_off(value) => {}
            Some(_) if !has_preset => drop(table.remove(key)),
            Some(_) => drop(table.insert(key.to_owned(), off.into())),
            None if has_preset => drop(table.insert(key.to_owned(), off.into())),
            None => {}
        }
    }
}

/// Lets no link lose anything by chance.
fn lose_nothing(scenario: &mut Table) {
    if let Some(Value::Table(links)) = scenario.get_mut("links") {
        for (_, value) in links.iter_mut() {
            if let Value::Table(table) = value {
                quieten(table);
            }
        }
    }
    if let Some(Value::Array(degrades)) = scenario.get_mut("degrade") {
        for degrade in degrades.iter_mut().filter_map(Value::as_table_mut) {
            quieten(degrade);
        }
        // One that only lost by chance says nothing any more.
        let window = ["at", "until", "links"];
        let says = |degrade: &Value| {
            let table = degrade.as_table();
            table.is_none_or(|table| table.keys().any(|key| !window.contains(&key.as_str())))
        };
        degrades.retain(says);
    }
}

/// The scenario that loses these messages, and none by chance.
pub(super) fn explicit(scenario: &Table, lost: &[MessageId]) -> Table {
    let mut scenario = scenario.clone();
    lose_nothing(&mut scenario);
    let entry = |id: &MessageId| {
        let message = ("message".to_owned(), Value::String(id.to_string()));
        Value::Table([message].into_iter().collect())
    };
    let all = scenario
        .entry(LOSE)
        .or_insert_with(|| Value::Array(Vec::new()));
    if let Value::Array(all) = all {
        all.extend(lost.iter().map(entry));
    }
    scenario
}

/// Groups of messages that are tried together, coarse ones first: those of a kind, then those of a flow.
pub(super) fn groups(messages: &[&str]) -> Vec<Vec<Vec<u32>>> {
    let of_kind = |id: &MessageId| id.kind.clone();
    let of_flow = |id: &MessageId| format!("{},{},{}", id.sender, id.receiver, id.kind);
    let grouped = |key: &dyn Fn(&MessageId) -> String| {
        let mut groups: BTreeMap<String, Vec<u32>> = BTreeMap::new();
        for (at, message) in (0..).zip(messages) {
            let id: Option<MessageId> = message.parse().ok();
            let key = id.as_ref().map_or_else(String::new, key);
            groups.entry(key).or_default().push(at);
        }
        groups.into_values().collect()
    };
    vec![grouped(&of_kind), grouped(&of_flow)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> Table {
        toml::from_str(text).unwrap()
    }

    #[test]
    fn a_scenario_with_explicit_losses_has_no_other() {
        let scenario = table(
            "
            degrade = [
                { at = '5s', links = 'a-*', loss = '30%' },
                { at = '5s', links = 'a-*', loss = '30%', latency = '1s' },
                { at = '5s', links = 'a-*', loss = '100%' },
                { at = '5s', processors = 'a', slowdown = 5 },
            ]
            [links.default]
            loss = 0.2
            jitter = '1ms'
            [links.'a-*']
            preset = 'wifi'
            ",
        );
        assert!(by_chance(&scenario));
        assert_eq!(other_chance(&scenario), ["jitter"]);
        let id: MessageId = "a,b,Grant,3".parse().unwrap();
        let expected = table(
            "
            degrade = [
                { at = '5s', links = 'a-*', latency = '1s' },
                { at = '5s', links = 'a-*', loss = '100%' },
                { at = '5s', processors = 'a', slowdown = 5 },
            ]
            lose = [{ message = 'a,b,Grant,3' }]
            [links.default]
            jitter = '1ms'
            [links.'a-*']
            preset = 'wifi'
            loss = '0%'
            burst = 'off'
            corrupt = '0%'
            ber = '0%'
            ack_loss = 'off'
            ",
        );
        let explicit = explicit(&scenario, &[id]);
        assert_eq!(explicit, expected);
        assert!(!by_chance(&explicit));
    }

    #[test]
    fn repeats_are_counted_as_the_kernel_counts_them() {
        let key = |major| MatchKey::new(major, 0);
        let keys = [key(1), key(1), key(1), key(2), key(1)];
        let keys = (0..).zip(keys).collect();
        let expected = [0, 1, 2, 0, 0];
        assert_eq!(repeats(&keys), (0..).zip(expected).collect());
    }
}
