//! One log as it is compared: read from front to back once, of its records only those kept that are
//! to be paired, and a sparse index of the others, by which the causes of a difference are found.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use hashbrown::HashMap;
use rustc_hash::FxBuildHasher;

use super::behaviour::{Rate, Times};
use super::entry::{Builder, Entry, Mode, Names};
use super::reach::End;
use super::spill::Buckets;
use crate::LogError;
use crate::channel::ChannelInfo;
use crate::envelope::{KeyRef, RecordRef};
use crate::frames::Care;
use crate::log::{Log, LoggedKey};
use crate::scan::{Item, ScannedMessage, Scanner};
use crate::source::Attached;
use crate::topics::Topics;
use crate::writer::SCENARIO_ATTACHMENT;

/// A row of the sparse index has at least so many records, if they are not in one chunk.
const ROW_RECORDS: u32 = 512;

/// Rows whose records are kept: a chain of causes stays near where it was.
const ROWS_KEPT: usize = 4;

/// What a Farside log says at its start; none for any other file.
pub(super) fn start(path: &Path) -> Result<Option<Log>, LogError> {
    match Log::read(path, |name| name == SCENARIO_ATTACHMENT) {
        Ok(log) => Ok(Some(log)),
        Err(LogError::NotFarside { .. } | LogError::Damaged { .. }) => Ok(None),
        Err(error) => Err(error),
    }
}

/// Where in the file some records begin that follow each other.
struct Row {
    /// The key of the first of them.
    key: LoggedKey,
    frame: u64,
    /// Its place among the log's records.
    at: u32,
}

/// A log, and as much of it as has been read.
pub(super) struct Index<'a> {
    pub(super) scanner: Scanner,
    builder: Builder<'a>,
    pub(super) beside: Beside,
    /// The records that are to be paired.
    pub(super) entries: Buckets<Entry>,
    /// How many records there were, those on topics that are left out included.
    pub(super) records: u32,
    /// Of these, how many are on topics that are left out.
    pub(super) ignored: u64,
    /// How many are to be compared, by the number of their topic.
    by_topic: Vec<u64>,
    /// When they were, by the number of their topic.
    times: Vec<Times>,
    /// How many messages were left out, by what their channels are for.
    pub(super) left_out: BTreeMap<String, u64>,
    /// How many records at the front agree with those of the other log.
    agreed: u32,
    /// How many those were and the one behind them, by the number of their topic.
    agreed_by_topic: Vec<u64>,
    /// The greatest ordinal of a record with a match key among them, by its flow.
    agreed_keys: HashMap<u64, u64, FxBuildHasher>,
    /// Records with a match key behind them that have a lesser one: by their identity, the least.
    pub(super) late: BTreeMap<u64, u64>,
    rows: Vec<Row>,
    last_frame: u64,
    /// The topic of the message that was advanced to.
    topic: u32,
    /// Rows that were read again, the latest last.
    read_again: Vec<(usize, Vec<Entry>)>,
}

impl<'a> Index<'a> {
    /// Opens a log, of which at most so many entries are to be in memory.
    pub(super) fn open(
        path: &Path,
        mode: Mode,
        ignore: &'a Topics,
        most_entries: usize,
    ) -> Result<Index<'a>, LogError> {
        Ok(Index {
            scanner: Scanner::careful(path, Care::Attachments)?,
            builder: Builder::new(mode, ignore),
            beside: Beside::default(),
            entries: Buckets::new(most_entries),
            records: 0,
            ignored: 0,
            by_topic: Vec::new(),
            times: Vec::new(),
            left_out: BTreeMap::new(),
            agreed: 0,
            agreed_by_topic: Vec::new(),
            agreed_keys: HashMap::default(),
            late: BTreeMap::new(),
            rows: Vec::new(),
            last_frame: 0,
            topic: 0,
            read_again: Vec::new(),
        })
    }

    /// Goes to the next message that is to be compared; false if there is none.
    pub(super) fn advance(&mut self, names: &mut Names) -> Result<bool, LogError> {
        loop {
            let message = match self.scanner.next()? {
                Some(Item::Message(message)) => message,
                Some(Item::Damage { offset, what, .. }) => {
                    return Err(LogError::damaged(self.scanner.path(), offset, what));
                }
                Some(item) => {
                    self.beside.add(item);
                    continue;
                }
                None => return Ok(false),
            };
            let channel = self.builder.channel(&message, names);
            if !channel.compared {
                let role = message.channel.role();
                match self.left_out.get_mut(role) {
                    Some(count) => *count += 1,
                    None => drop(self.left_out.insert(role.to_owned(), 1)),
                }
                continue;
            }
            let frame = message.position.frame;
            let apart = |row: &Row| self.records - row.at >= ROW_RECORDS;
            let starts_row = self.builder.mode == Mode::Farside
                && frame != self.last_frame
                && self.rows.last().is_none_or(apart);
            self.last_frame = frame;
            if starts_row || (channel.ignored && self.builder.mode == Mode::Farside) {
                let Some(record) = RecordRef::read(message.data) else {
                    return Err(self.malformed());
                };
                if starts_row {
                    let (key, at) = (LoggedKey::of(&record.key), self.records);
                    self.rows.push(Row { key, frame, at });
                }
            }
            self.records += 1;
            if channel.ignored {
                self.ignored += 1;
                continue;
            }
            let topic = channel.topic as usize;
            if self.by_topic.len() <= topic {
                self.by_topic.resize(topic + 1, 0);
                self.times.resize(topic + 1, Times::default());
            }
            self.by_topic[topic] += 1;
            self.times[topic].add(message.head.log_time);
            self.topic = channel.topic;
            return Ok(true);
        }
    }

    /// The message that was advanced to.
    pub(super) fn current(&self) -> Option<ScannedMessage<'_>> {
        self.scanner.current()
    }

    /// The number of its topic.
    pub(super) fn topic(&self) -> u32 {
        self.topic
    }

    /// The entry of the message that was advanced to.
    pub(super) fn entry(&mut self, names: &mut Names) -> Result<Entry, LogError> {
        let at = self.records - 1;
        let message = self.scanner.current();
        let entry = message.and_then(|message| self.builder.entry(&message, at, names));
        entry.ok_or_else(|| self.malformed())
    }

    /// Passes over a message that agrees with the other log's. Says whether it was counted, by
    /// which later records are told apart.
    pub(super) fn pass(&mut self) -> Result<bool, LogError> {
        let Some(message) = self.scanner.current() else {
            return Ok(false);
        };
        if self.builder.mode == Mode::Any {
            self.builder.pass_topic(self.topic);
            return Ok(true);
        }
        match RecordRef::read(message.data) {
            Some(record) => {
                let counted = self.builder.pass(&record);
                self.note_key();
                Ok(counted)
            }
            None => Err(self.malformed()),
        }
    }

    /// Notes the match key of a record that agrees with the other log's.
    pub(super) fn note_key(&mut self) {
        if let Some((flow, ordinal)) = self.builder.keyed {
            let greatest = self.agreed_keys.entry(flow).or_insert(ordinal);
            *greatest = (*greatest).max(ordinal);
        }
    }

    pub(super) fn malformed(&self) -> LogError {
        let (topic, frame) = match self.scanner.current() {
            Some(message) => (message.channel.topic.as_str(), message.position.frame),
            None => ("", 0),
        };
        let what = format!("a message on {topic} that is malformed");
        LogError::damaged(self.scanner.path(), frame, what)
    }

    /// So many records at the front agree with those of the other log: they are not kept.
    pub(super) fn agrees_until(&mut self, records: u32) {
        self.agreed_by_topic.clone_from(&self.by_topic);
        self.agreed = records;
    }

    /// Takes over which match keys agreed: the same in both logs.
    pub(super) fn keys_agree_with(&mut self, other: &Index<'_>) {
        self.agreed_keys.clone_from(&other.agreed_keys);
    }

    /// How many records at the front agree with those of the other log.
    pub(super) fn agreed(&self) -> u32 {
        self.agreed
    }

    /// Keeps the entry that was just made, to be paired.
    pub(super) fn keep(&mut self, entry: Entry) -> Result<(), LogError> {
        if let Some((flow, ordinal)) = self.builder.keyed
            && self
                .agreed_keys
                .get(&flow)
                .is_some_and(|greatest| *greatest > ordinal)
        {
            let least = self.late.entry(entry.identity).or_insert(ordinal);
            *least = (*least).min(ordinal);
        }
        self.entries.push(entry.bucket(self.builder.mode), entry)
    }

    /// Keeps all that has not been read yet.
    pub(super) fn keep_rest(&mut self, names: &mut Names) -> Result<(), LogError> {
        while self.advance(names)? {
            let entry = self.entry(names)?;
            self.keep(entry)?;
        }
        Ok(())
    }

    /// When the log of a run ends that has been read to its end.
    pub(super) fn end(&mut self, names: &mut Names) -> Result<End, LogError> {
        let is_cut = self.beside.cut.is_some() || !self.beside.has_end();
        let ends = self
            .beside
            .metadata
            .iter()
            .filter(|(name, _)| name == "farside.end");
        let times = ends.filter_map(|(_, entries)| entries.get("end_time_ns")?.parse().ok());
        let mut time_ns = times.max().unwrap_or(0);
        if let Some(last) = self.rows.len().checked_sub(1).filter(|_| is_cut) {
            let entries = self.row(last, names)?;
            let times = entries.iter().map(|entry| entry.time_ns);
            time_ns = times.max().unwrap_or(0);
        }
        Ok(End { time_ns, is_cut })
    }

    /// Whether records on this topic agreed.
    pub(super) fn agrees_on(&self, topic: u32) -> bool {
        let agreed = self.agreed_by_topic.get(topic as usize);
        self.agreed > 0 && agreed.is_some_and(|agreed| *agreed > 0)
    }

    /// The topics in the order in which they have their first message, then those that have none.
    pub(super) fn topic_order(&self, names: &mut Names) -> Vec<u32> {
        let declared = self.scanner.channels().iter();
        let declared: Vec<u32> = declared
            .map(|channel| names.number(&channel.topic))
            .collect();
        let mut order = self.builder.topics.clone();
        order.extend(declared);
        order
    }

    /// How many records are to be compared on each topic that has any.
    pub(super) fn topics(&self) -> impl Iterator<Item = (u32, u64)> {
        let topics = self.by_topic.iter().enumerate();
        topics
            .filter(|(_, count)| **count > 0)
            .map(|(topic, count)| (topic as u32, *count))
    }

    /// How often there are records on a topic.
    pub(super) fn rate(&self, topic: u32) -> Rate {
        let times = self.times.get(topic as usize);
        times.map_or_else(Rate::default, Times::rate)
    }

    /// Whether there are records to be compared on a topic.
    pub(super) fn has_records(&self, topic: u32) -> bool {
        self.by_topic
            .get(topic as usize)
            .is_some_and(|count| *count > 0)
    }

    /// The channels of each topic that is not left out, whether they have messages or not.
    pub(super) fn channels(&self, names: &mut Names) -> BTreeMap<u32, Vec<Arc<ChannelInfo>>> {
        let mut channels: BTreeMap<u32, Vec<Arc<ChannelInfo>>> = BTreeMap::new();
        for channel in self.scanner.channels() {
            if !self.builder.leaves_out(&channel.topic) {
                let topic = names.number(&channel.topic);
                channels.entry(topic).or_default().push(channel.clone());
            }
        }
        channels
    }

    /// Whether a record that agreed with the other log's has a match key that one behind it repeats
    /// with a lesser ordinal, `late`: they are paired by their ordinals.
    pub(super) fn is_overtaken(
        &mut self,
        late: &BTreeMap<u64, u64>,
        names: &mut Names,
    ) -> Result<bool, LogError> {
        let mut overtaken = false;
        self.read_again(0, self.agreed, names, |builder, message, _, _| {
            let record = RecordRef::read(message.data);
            if let Some(record) = record.filter(|record| record.match_key.is_some()) {
                let (identity, ordinal) = builder.identity(&record);
                overtaken |= late.get(&identity).is_some_and(|late| *late < ordinal);
            }
        })?;
        Ok(overtaken)
    }

    /// Reads the records from a row on again, up to one at a place.
    fn read_again(
        &mut self,
        row: usize,
        to: u32,
        names: &mut Names,
        mut each: impl FnMut(&mut Builder<'_>, &ScannedMessage<'_>, u32, &mut Names),
    ) -> Result<(), LogError> {
        let Some(Row { frame, at, .. }) = self.rows.get(row) else {
            return Ok(());
        };
        let mut at = *at;
        self.scanner.rewind(*frame);
        while at < to
            && let Some(item) = self.scanner.next()?
        {
            if let Item::Message(message) = item
                && self.builder.channel(&message, names).compared
            {
                each(&mut self.builder, &message, at, names);
                at += 1;
            }
        }
        Ok(())
    }

    /// The entries of a row.
    fn row(&mut self, row: usize, names: &mut Names) -> Result<&[Entry], LogError> {
        let known = self.read_again.iter().position(|(known, _)| *known == row);
        let entries = match known {
            Some(known) => self.read_again.remove(known).1,
            None => {
                let to = self.rows.get(row + 1).map_or(self.records, |next| next.at);
                let mut entries = Vec::new();
                self.read_again(row, to, names, |builder, message, at, names| {
                    entries.extend(builder.entry(message, at, names));
                })?;
                entries
            }
        };
        if self.read_again.len() >= ROWS_KEPT {
            self.read_again.remove(0);
        }
        self.read_again.push((row, entries));
        Ok(self.read_again.last().map_or(&[], |(_, entries)| entries))
    }

    /// The order of the run's events: the entry of the event with this key. For a log that has been
    /// read to its end.
    pub(super) fn event(
        &mut self,
        key: &KeyRef<'_>,
        names: &mut Names,
    ) -> Result<Option<Entry>, LogError> {
        let mut row = self
            .rows
            .partition_point(|row| row.key.to_ref() < *key)
            .saturating_sub(1);
        while self
            .rows
            .get(row)
            .is_some_and(|row| row.key.to_ref() <= *key)
        {
            let entries = self.row(row, names)?;
            let from = entries.partition_point(|entry| entry.key(names) < *key);
            for entry in &entries[from..] {
                if entry.key(names) != *key {
                    return Ok(None);
                }
                if entry.is_event() {
                    return Ok(Some(*entry));
                }
            }
            row += 1;
        }
        Ok(None)
    }
}

/// What a file holds beside its messages.
#[derive(Default)]
pub(super) struct Beside {
    /// What wrote the file: profile and library.
    pub(super) header: (String, String),
    pub(super) metadata: Vec<(String, BTreeMap<String, String>)>,
    pub(super) attachments: Vec<Attached>,
    pub(super) cut: Option<(u64, String)>,
    /// What else there is that is not compared.
    pub(super) others: Vec<String>,
}

impl Beside {
    fn add(&mut self, item: Item<'_>) {
        match item {
            Item::Header { profile, library } => {
                self.header = (profile.to_owned(), library.to_owned());
            }
            Item::Metadata(name, entries) => self.metadata.push((name, entries)),
            Item::Attachment(attached) => self.attachments.push(attached),
            Item::Cut { offset, what } => self.cut = Some((offset, what)),
            Item::Strange(opcode) => {
                let what = format!("records of opcode 0x{opcode:02x}, which MCAP does not have");
                if !self.others.contains(&what) {
                    self.others.push(what);
                }
            }
            Item::Behind { offset, bytes } => {
                let what = format!("{bytes} bytes behind its end, from byte {offset} on");
                self.others.push(what);
            }
            _ => {}
        }
    }

    /// Whether a run ended in the log.
    pub(super) fn has_end(&self) -> bool {
        self.metadata.iter().any(|(name, _)| name == "farside.end")
    }
}
