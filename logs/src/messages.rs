//! Finding single messages in a log by what they are called.

use std::collections::BTreeMap;
use std::path::Path;

use farside::record::RecordClass;
use farside::ruling::{MessageId, MessageNumber};
use farside::suggest::nearest;
use farside::{Carriage, MatchKey, SimTime};

use crate::LogError;
use crate::log::Log;

/// A message as a log has it.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundMessage {
    /// Its place in its flow.
    pub ordinal: u64,
    /// When it was sent.
    pub sent: SimTime,
    /// The link that carried it; none within a host.
    pub link: Option<String>,
    /// What became of it: delivered, lost or in flight at the end.
    pub class: RecordClass,
    /// When.
    pub at: SimTime,
    /// Why it was lost; empty if it was not.
    pub reason: String,
    /// The protocol's own identity for the message, if it gave one.
    pub match_key: Option<MatchKey>,
    /// How many messages right before it in the flow had the same key; none if the log lacks those.
    pub repeat: Option<u32>,
    /// How its link carried it, where the link says.
    pub carriage: Option<Carriage>,
    /// The size of the encoded message in bytes.
    pub bytes: u64,
}

/// A copy of a message of a flow.
struct Copy {
    copy: u32,
    /// How many right before have its key, of those that are there.
    repeats: u32,
    found: FoundMessage,
}

/// Finds messages in the log of a run; for each that is not there what a reader should know, with the
/// nearest name.
///
/// ```no_run
/// let id: farside::ruling::MessageId = "node_03,rover_07,Grant,12".parse()?;
/// for found in farside_logs::find_messages("run.mcap", &[id])? {
///     println!("{:?}", found?.class);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// If the log cannot be read.
pub fn find_messages(
    path: impl AsRef<Path>,
    ids: &[MessageId],
) -> Result<Vec<Result<FoundMessage, String>>, LogError> {
    if ids.is_empty() {
        return Ok(Vec::new());
    }
    let log = Log::open(path)?;
    let mut flows: BTreeMap<[String; 3], Vec<Copy>> = BTreeMap::new();
    for id in ids {
        flows.entry(flow(id)).or_default();
    }
    let mut known: BTreeMap<[String; 3], u64> = BTreeMap::new();
    let mut records = log.records()?;
    while let Some((record, _)) = records.next_ref()? {
        if !record.class.is_fate() {
            continue;
        }
        let name = [record.sender, record.receiver, record.kind].map(str::to_owned);
        if let Some(copies) = flows.get_mut(&name) {
            copies.push(Copy {
                copy: record.copy,
                repeats: 0,
                found: FoundMessage {
                    ordinal: record.ordinal,
                    sent: SimTime::from_nanos(record.sent_ns),
                    link: (!record.link.is_empty()).then(|| record.link.to_owned()),
                    class: record.class,
                    at: SimTime::from_nanos(record.key.time_ns),
                    reason: record.reason.to_owned(),
                    match_key: record.match_key.map(MatchKey::from_bits),
                    repeat: None,
                    carriage: record.carriage,
                    bytes: record.body.len() as u64,
                },
            });
        }
        *known.entry(name).or_default() += 1;
    }
    for copies in flows.values_mut() {
        copies.sort_by_key(|copy| (copy.found.ordinal, copy.copy));
        count_repeats(copies);
    }
    let find = |id: &MessageId| {
        let copies = &flows[&flow(id)];
        let found = numbered(copies, id.number).find(|copy| copy.copy == id.copy);
        let found = found.map(|copy| copy.found.clone());
        found.ok_or_else(|| missing(id, copies, &known, log.exclude()))
    };
    Ok(ids.iter().map(find).collect())
}

fn flow(id: &MessageId) -> [String; 3] {
    [&id.sender, &id.receiver, &id.kind].map(Clone::clone)
}

/// Counts how many messages right before each have its key; what is counted is sure if the log has the flow from its
/// first message, or from one with another key, on.
fn count_repeats(copies: &mut [Copy]) {
    let mut before: Option<(FoundMessage, u32)> = None;
    for Copy { found, repeats, .. } in copies {
        let is_next = |last: &FoundMessage| last.ordinal + 1 == found.ordinal;
        (*repeats, found.repeat) = match &before {
            Some((last, repeats)) if last.ordinal == found.ordinal => (*repeats, last.repeat),
            Some((last, repeats)) if last.match_key == found.match_key => {
                let sure = last.repeat.filter(|_| is_next(last));
                (repeats + 1, sure.map(|sure| sure + 1))
            }
            Some((last, _)) => (0, is_next(last).then_some(0)),
            None => (0, (found.ordinal == 0).then_some(0)),
        };
        before = Some((found.clone(), *repeats));
    }
}

/// The copies of a message, from those of its flow in order.
fn numbered(copies: &[Copy], number: MessageNumber) -> impl Iterator<Item = &Copy> {
    let is_it = move |copy: &&Copy| match number {
        MessageNumber::Ordinal(ordinal) => copy.found.ordinal == ordinal,
        MessageNumber::Key { key, repeat } => {
            copy.found.match_key == Some(key) && copy.repeats == repeat
        }
    };
    let ordinal = copies.iter().find(is_it).map(|copy| copy.found.ordinal);
    copies
        .iter()
        .filter(move |copy| Some(copy.found.ordinal) == ordinal)
}

/// Why a message is not found.
fn missing(
    id: &MessageId,
    copies: &[Copy],
    known: &BTreeMap<[String; 3], u64>,
    exclude: &[String],
) -> String {
    let filtered = match exclude {
        [] => String::new(),
        topics => format!("; topics that were not written: {}", topics.join(", ")),
    };
    if let (Some(first), Some(last)) = (copies.first(), copies.last()) {
        let (first, last) = (first.found.ordinal, last.found.ordinal);
        let flow = flow(id).join(",");
        return format!("{id}: the log has {flow} from number {first} to {last} only{filtered}");
    }
    let names: Vec<String> = known.keys().map(|flow| flow.join(",")).collect();
    let close = nearest(&flow(id).join(","), names.iter().map(String::as_str));
    let hint = close.map_or_else(String::new, |name| format!("; did you mean {name},...?"));
    format!("{id}: the log has no message of this kind between these two{hint}{filtered}")
}
