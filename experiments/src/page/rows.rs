//! The messages and events of a log as rows of a page, each with the row that caused it.
//!
//! What is the same for all messages of one class, sender, receiver, link, kind and reason is a *flow*, told once; a
//! row has the number of its flow, its times, its cause and its place among the messages of its sender, receiver and
//! kind. There is a bound to the rows of a page: behind it only losses and what is no message have one, and behind
//! a second bound nothing. What has none is still counted.

use std::collections::BTreeMap;

use farside::record::RecordClass;
use farside_logs::{KeyRef, RecordRef};
use serde::Serialize;

use super::columns::Column;
use super::details::Details;

/// What happened, of a log of any program.
#[derive(Clone, Copy, Debug)]
pub(super) struct Happened<'a> {
    /// The class's name in logs; `message` in those of other programs.
    pub(super) class: &'a str,
    pub(super) sender: &'a str,
    pub(super) receiver: &'a str,
    pub(super) link: &'a str,
    pub(super) kind: &'a str,
    pub(super) reason: &'a str,
    pub(super) ordinal: u64,
    pub(super) copy: u32,
    /// Since the run's start, in nanoseconds.
    pub(super) at_ns: u64,
    pub(super) sent_ns: u64,
    pub(super) key: Option<KeyRef<'a>>,
    pub(super) cause: Option<KeyRef<'a>>,
    /// The other log of a comparison has it otherwise, or not.
    pub(super) differs: bool,
}

impl<'a> Happened<'a> {
    /// A record, at the time at which it was logged; times since `from_ns`.
    pub(super) fn of(record: &RecordRef<'a>, at_ns: u64, from_ns: u64) -> Happened<'a> {
        // The key of a loss is that of the event that sent the message, and of what is in flight that of an event
        // that never was: neither caused anything.
        let is_event = !matches!(record.class, RecordClass::Lost | RecordClass::InFlight);
        Happened {
            class: record.class.name(),
            sender: record.sender,
            receiver: record.receiver,
            link: record.link,
            kind: record.kind,
            reason: record.reason,
            ordinal: record.ordinal,
            copy: record.copy,
            at_ns,
            sent_ns: record.sent_ns.saturating_sub(from_ns).min(at_ns),
            key: is_event.then_some(record.key),
            cause: record.cause,
            differs: false,
        }
    }

    fn is_common(&self) -> bool {
        matches!(self.class, "delivered" | "timer" | "hand_over" | "message")
    }
}

/// Texts, each once.
#[derive(Debug, Default)]
pub(super) struct Names {
    known: BTreeMap<String, u32>,
    texts: Vec<String>,
}

/// As many texts as a page holds, and letters of each: a log that has more is made to fill memory.
const NAMES: usize = 1 << 18;
const LETTERS: usize = 300;

impl Names {
    pub(super) fn number(&mut self, text: &str) -> u32 {
        // Nearly all are far below the bound, and then there is nothing to look for.
        let end = match text.len() <= LETTERS {
            true => None,
            false => text.char_indices().nth(LETTERS).map(|(end, _)| end),
        };
        let text = if self.texts.len() >= NAMES && !self.known.contains_key(text) {
            "(more names than a page holds)"
        } else {
            &text[..end.unwrap_or(text.len())]
        };
        if let Some(number) = self.known.get(text) {
            return *number;
        }
        let number = self.texts.len() as u32;
        self.known.insert(text.to_owned(), number);
        self.texts.push(text.to_owned());
        number
    }
}

/// What is the same for many rows: class, sender, receiver, link, kind, reason as numbers of names, and the family,
/// within which ordinals count: sender, receiver and kind.
type Flow = [u32; 7];

/// How often something happened to an actor: in each bin what it received, or did, and what of its own was lost.
pub(super) type LaneBins = Vec<[u32; 2]>;

/// How many bins the whole time is divided into at most; never fewer than half as many once they were filled.
pub(super) const BINS: usize = 512;

/// As many actors as are counted by themselves.
const LANES: usize = 4_096;

/// Counts over equal times that become longer as the log does.
#[derive(Debug, Serialize)]
pub(super) struct Bins {
    /// How long one is, in nanoseconds.
    width_ns: u64,
    /// Delivered, lost, other events.
    all: Vec<[u32; 3]>,
    /// By actor, as a number of a name.
    lanes: BTreeMap<u32, LaneBins>,
}

impl Default for Bins {
    fn default() -> Bins {
        Bins {
            width_ns: 1,
            all: Vec::new(),
            lanes: BTreeMap::new(),
        }
    }
}

fn halved<const N: usize>(bins: &[[u32; N]]) -> Vec<[u32; N]> {
    let sum = |pair: &[[u32; N]]| {
        let mut sum = [0; N];
        for bin in pair {
            for (sum, count) in sum.iter_mut().zip(bin) {
                *sum += count;
            }
        }
        sum
    };
    bins.chunks(2).map(sum).collect()
}

/// The bin, if need be after all that are missing before it.
fn grown<const N: usize>(bins: &mut Vec<[u32; N]>, at: usize) -> &mut [u32; N] {
    if bins.len() <= at {
        bins.resize(at + 1, [0; N]);
    }
    &mut bins[at]
}

impl Bins {
    fn at(&mut self, time_ns: u64) -> usize {
        while time_ns / self.width_ns >= BINS as u64 {
            self.width_ns = self.width_ns.saturating_mul(2);
            self.all = halved(&self.all);
            for lane in self.lanes.values_mut() {
                *lane = halved(lane);
            }
        }
        (time_ns / self.width_ns) as usize
    }

    fn count(&mut self, happened: &Happened<'_>, [sender, receiver]: [u32; 2]) {
        let at = self.at(happened.at_ns);
        let lost = happened.class == "lost";
        let which = match happened.class {
            "delivered" | "message" => 0,
            "lost" => 1,
            _ => 2,
        };
        grown(&mut self.all, at)[which] += 1;
        let lane = if lost { sender } else { receiver };
        if self.lanes.len() >= LANES && !self.lanes.contains_key(&lane) {
            return;
        }
        let lane = self.lanes.entry(lane).or_default();
        grown(lane, at)[usize::from(lost)] += 1;
    }
}

/// How many rows there may be.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    /// Of any kind.
    pub(super) rows: usize,
    /// Of losses and events behind these.
    pub(super) more: usize,
    /// The unit of times, in nanoseconds.
    pub(super) unit_ns: u64,
}

/// Rows in the making.
#[derive(Debug)]
pub(super) struct Rows {
    bounds: Bounds,
    pub(super) names: Names,
    flows: Vec<Flow>,
    known: BTreeMap<[u32; 6], u32>,
    families: BTreeMap<[u32; 3], u32>,
    /// By family, the ordinal that comes next.
    next: Vec<u64>,
    /// By source and its counter, the row of an event.
    events: BTreeMap<(u32, u64), u32>,
    columns: [Column; 7],
    rows: u32,
    last_at: u64,
    left_out: u64,
    first_left_out_ns: Option<u64>,
    counts: BTreeMap<String, u64>,
    /// How many rows differ from those of another log.
    differing: u64,
    bins: Bins,
    until_ns: u64,
    pub(super) details: Details,
}

/// What the page is told of the rows beside their columns.
#[derive(Debug, Serialize)]
pub(super) struct Told<'a> {
    rows: u32,
    unit_ns: u64,
    until_ns: u64,
    names: &'a [String],
    flows: &'a [Flow],
    /// How many bytes each column takes.
    columns: Vec<usize>,
    left_out: u64,
    first_left_out_ns: Option<u64>,
    counts: &'a BTreeMap<String, u64>,
    differing: u64,
    bins: &'a Bins,
    details: usize,
    details_left_out: u64,
}

impl Rows {
    pub(super) fn new(bounds: Bounds, details: Details) -> Rows {
        Rows {
            bounds,
            names: Names::default(),
            flows: Vec::new(),
            known: BTreeMap::new(),
            families: BTreeMap::new(),
            next: Vec::new(),
            events: BTreeMap::new(),
            columns: Default::default(),
            rows: 0,
            last_at: 0,
            left_out: 0,
            first_left_out_ns: None,
            counts: BTreeMap::new(),
            differing: 0,
            bins: Bins::default(),
            until_ns: 0,
            details,
        }
    }

    /// The time up to which something happened.
    pub(super) fn reaches(&mut self, at_ns: u64) {
        self.until_ns = self.until_ns.max(at_ns);
    }

    fn flow(&mut self, happened: &Happened<'_>) -> u32 {
        let texts = [
            happened.class,
            happened.sender,
            happened.receiver,
            happened.link,
            happened.kind,
            happened.reason,
        ];
        let key = texts.map(|text| self.names.number(text));
        if let Some(flow) = self.known.get(&key) {
            return *flow;
        }
        let [class, sender, receiver, link, kind, reason] = key;
        let families = self.families.len() as u32;
        let family = self.families.entry([sender, receiver, kind]);
        let family = *family.or_insert(families);
        self.next.resize(self.families.len(), 0);
        let flow = self.flows.len() as u32;
        self.flows
            .push([class, sender, receiver, link, kind, reason, family]);
        self.known.insert(key, flow);
        flow
    }

    /// Adds what happened; `detail` says what there is to know beyond that, if it is wanted.
    pub(super) fn add(&mut self, happened: &Happened<'_>, detail: impl FnOnce() -> String) {
        self.reaches(happened.at_ns);
        match self.counts.get_mut(happened.class) {
            Some(count) => *count += 1,
            None => drop(self.counts.insert(happened.class.to_owned(), 1)),
        }
        let ends = [happened.sender, happened.receiver].map(|name| self.names.number(name));
        self.bins.count(happened, ends);
        let rows = self.rows as usize;
        let most = match happened.is_common() {
            true => self.bounds.rows,
            false => self.bounds.rows + self.bounds.more,
        };
        if rows >= most {
            self.left_out += 1;
            self.first_left_out_ns.get_or_insert(happened.at_ns);
            return;
        }
        let flow = self.flow(happened);
        self.push(happened, flow);
        self.details.push(detail);
    }

    fn push(&mut self, happened: &Happened<'_>, flow: u32) {
        let row = self.rows;
        self.rows += 1;
        let at = happened.at_ns / self.bounds.unit_ns;
        let sent = happened.sent_ns / self.bounds.unit_ns;
        let cause = happened.cause.and_then(|key| {
            let source = self.names.number(key.source);
            self.events.get(&(source, key.count)).copied()
        });
        if let Some(key) = &happened.key {
            let source = self.names.number(key.source);
            self.events.insert((source, key.count), row);
        }
        let family = self.flows[flow as usize][6] as usize;
        let ordinal = happened.ordinal.wrapping_sub(self.next[family]) as i64;
        self.next[family] = happened.ordinal.wrapping_add(1);
        // How far back the cause is; 0 if there is none, 1 if it is known not to be on the page.
        let back = match (happened.cause, cause) {
            (None, _) => 0,
            (Some(_), None) => 1,
            (Some(_), Some(cause)) => u64::from(row - cause) + 1,
        };
        let [flows, times, delays, causes, ordinals, copies, marks] = &mut self.columns;
        flows.push(u64::from(flow));
        // Logs of other programs may go back in time.
        times.push_signed(at.wrapping_sub(self.last_at) as i64);
        delays.push(at.saturating_sub(sent));
        causes.push(back);
        ordinals.push_signed(ordinal);
        copies.push(u64::from(happened.copy));
        marks.push(u64::from(happened.differs));
        self.differing += u64::from(happened.differs);
        self.last_at = at;
    }

    pub(super) fn told(&self) -> Told<'_> {
        Told {
            rows: self.rows,
            unit_ns: self.bounds.unit_ns,
            until_ns: self.until_ns,
            names: &self.names.texts,
            flows: &self.flows,
            columns: self.columns.iter().map(|c| c.bytes().len()).collect(),
            left_out: self.left_out,
            first_left_out_ns: self.first_left_out_ns,
            counts: &self.counts,
            differing: self.differing,
            bins: &self.bins,
            details: self.details.rows(),
            details_left_out: self.details.left_out(),
        }
    }

    /// All columns, one behind the other.
    pub(super) fn bytes(&self) -> Vec<u8> {
        let columns = self.columns.iter();
        columns.flat_map(|c| c.bytes()).copied().collect()
    }

    pub(super) fn rows(&self) -> u32 {
        self.rows
    }

    pub(super) fn left_out(&self) -> u64 {
        self.left_out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn happened<'a>(class: &'a str, at_ns: u64, count: u64) -> Happened<'a> {
        Happened {
            class,
            sender: "a",
            receiver: "b",
            link: "a-b",
            kind: "Ping",
            reason: "",
            ordinal: count,
            copy: 0,
            at_ns,
            sent_ns: at_ns.saturating_sub(3),
            key: Some(KeyRef {
                time_ns: at_ns,
                source: "a-b",
                count,
                ..KeyRef::default()
            }),
            cause: count.checked_sub(1).map(|before| KeyRef {
                source: "a-b",
                count: before,
                ..KeyRef::default()
            }),
            differs: count == 1,
        }
    }

    fn rows(rows: usize, more: usize) -> Rows {
        let bounds = Bounds {
            rows,
            more,
            unit_ns: 1,
        };
        Rows::new(bounds, Details::of_at_most(100))
    }

    #[test]
    fn rows_know_the_row_that_caused_them() {
        let mut rows = rows(10, 0);
        for count in 0..3 {
            rows.add(&happened("delivered", 10 * count, count), String::new);
        }
        let mut unknown = happened("delivered", 40, 3);
        unknown.cause = Some(KeyRef {
            source: "x",
            ..KeyRef::default()
        });
        rows.add(&unknown, String::new);
        // Flows, times, delays, causes, ordinals, copies, marks of four rows.
        let expected = [
            [0, 0, 0, 0],
            [0, 20, 20, 40],
            [0, 3, 3, 3],
            [0, 2, 2, 1],
            [0, 0, 0, 0],
            [0; 4],
            [0, 1, 0, 0],
        ];
        assert_eq!(rows.bytes(), expected.concat());
    }

    #[test]
    fn behind_the_bound_losses_have_rows_and_all_are_counted() {
        let mut rows = rows(2, 1);
        for (count, class) in ["delivered", "delivered", "delivered", "lost", "lost"]
            .into_iter()
            .enumerate()
        {
            rows.add(&happened(class, count as u64, count as u64), String::new);
        }
        assert_eq!((rows.rows(), rows.left_out()), (3, 2));
        let told = serde_json::to_value(rows.told()).unwrap();
        assert_eq!(
            told["counts"],
            serde_json::json!({ "delivered": 3, "lost": 2 })
        );
        assert_eq!(told["first_left_out_ns"], 2);
    }

    #[test]
    fn bins_become_wider_and_lose_nothing() {
        let mut rows = rows(0, 0);
        for at in 0..100_000_u64 {
            let class = if at % 10 == 0 { "lost" } else { "delivered" };
            rows.add(&happened(class, at * 7, at), String::new);
        }
        let bins = &rows.bins;
        assert!(
            bins.all.len() <= BINS && bins.all.len() > BINS / 4,
            "{}",
            bins.all.len()
        );
        let sum = |which: usize| bins.all.iter().map(|bin| bin[which]).sum::<u32>();
        assert_eq!((sum(0), sum(1)), (90_000, 10_000));
        let lanes: u32 = bins.lanes.values().flatten().flatten().sum();
        assert_eq!(lanes, 100_000);
    }

    #[test]
    fn a_log_of_endless_names_fills_no_memory() {
        let mut names = Names::default();
        assert_eq!(names.number("a"), names.number("a"));
        names.number(&"é".repeat(10_000));
        assert_eq!(names.texts[1].chars().count(), LETTERS);
    }
}
