//! Pairing what two logs do not agree in, bucket by bucket: by what is said, then by places, then by fields, and
//! at last in which order it comes.

use std::collections::{BTreeMap, BTreeSet};

use super::Comparison;
use crate::LogError;
use crate::diff::entry::{self, Entry, Mode};
use crate::diff::found::{Found, Pair, Places};
use crate::diff::matching::{self, Sequence, Shifts};
use crate::diff::spill::{BUCKETS, Buckets, Fixed};
use crate::diff::{aligning, detail};

/// How many pairs of Farside's logs that differ are read for which fields do: those at the front, of which
/// few chunks are opened again.
const SAMPLE: usize = 4096;

impl Comparison<'_> {
    /// The bucket of a pair, by its place in the first log.
    fn bucket_of(&self, a: &Entry) -> usize {
        let (from, to) = (u64::from(self.a.agreed()), u64::from(self.a.records) + 1);
        let place = u64::from(a.at).saturating_sub(from) * BUCKETS as u64;
        (place / (to - from)) as usize
    }

    /// Pairs what may be the same: all that is in one bucket of both logs.
    pub(super) fn compare_bucket(&mut self, bucket: usize) -> Result<(), LogError> {
        let a = self.a.entries.read(bucket)?;
        let b = self.b.entries.read(bucket)?;
        self.note_usage((a.len() + b.len()) * Entry::BYTES);
        let found = match self.mode {
            Mode::Farside => matching::matching(&a, &b),
            Mode::Any => aligning::aligned(&a, &b, self.rules.offset_ns),
        };
        for (x, y) in &found.pairs {
            self.shifts.add(&a[*x as usize], &b[*y as usize]);
        }
        self.pairs(&a, &b, &found.pairs)?;
        for entry in found.only_in_a.iter().map(|at| a[*at as usize]) {
            match entry.has_place {
                true => self
                    .left
                    .0
                    .push(entry::bucket_of(entry.place_key(entry.ordinal)), entry)?,
                false => self.only_in_a(entry),
            }
        }
        for entry in found.only_in_b.iter().map(|at| b[*at as usize]) {
            match entry.has_place {
                true => self.left.1.push(bucket, entry)?,
                false => self.only_in_b(entry),
            }
        }
        self.note_usage((a.len() + b.len()) * Entry::BYTES);
        Ok(())
    }

    /// Pairs what has but a place in its flow and is said otherwise in the two logs.
    pub(super) fn compare_places(&mut self) -> Result<(), LogError> {
        let mut shifts = std::mem::replace(&mut self.shifts, Shifts::new(0));
        shifts.sort();
        let mut is_left = false;
        let mut placed = Buckets::new(self.limits.left());
        for bucket in 0..BUCKETS {
            for entry in self.left.1.read(bucket)? {
                let key = entry.place_key(shifts.place_in_a(&entry));
                is_left = true;
                placed.push(entry::bucket_of(key), entry)?;
            }
            self.note_usage(placed.held_bytes());
        }
        self.left.1 = Buckets::new(self.limits.left());
        if shifts.forgotten > 0 && is_left {
            self.report.notes.push(format!(
                "{} messages have another place in their flow, of which {} are kept in mind: of what is said \
                 otherwise behind the others, a message may stand beside a wrong one",
                self.limits.shifted as u64 + shifts.forgotten,
                self.limits.shifted
            ));
        }
        for bucket in 0..BUCKETS {
            let (a, b) = (self.left.0.read(bucket)?, placed.read(bucket)?);
            let found = matching::by_place(&a, &b, &shifts);
            self.pairs(&a, &b, &found.pairs)?;
            for at in found.only_in_a {
                self.only_in_a(a[at as usize]);
            }
            for at in found.only_in_b {
                self.only_in_b(b[at as usize]);
            }
            self.note_usage(placed.held_bytes() + (a.len() + b.len()) * Entry::BYTES);
        }
        Ok(())
    }

    fn only_in_a(&mut self, entry: Entry) {
        self.topic(entry.topic).only_in_a += 1;
        self.found(Found::OnlyInA(entry));
    }

    fn only_in_b(&mut self, entry: Entry) {
        self.topic(entry.topic).only_in_b += 1;
        self.found(Found::OnlyInB(entry));
    }

    /// Compares what is the same record in both logs.
    fn pairs(&mut self, a: &[Entry], b: &[Entry], pairs: &[(u32, u32)]) -> Result<(), LogError> {
        // The bytes of two messages may differ and their fields not, or the other way round.
        let by_field = !self.rules.are_exact() || self.mode == Mode::Any;
        for (x, y) in pairs {
            let (a, b) = (a[*x as usize], b[*y as usize]);
            self.renumbered += u64::from(a.sequence != b.sequence);
            let differently = self.by_field.contains(&a.topic) || self.by_field.contains(&b.topic);
            match a.content == b.content {
                true if !differently => {}
                false if !by_field => self.changed(a, b),
                _ => self.to_read.push(self.bucket_of(&a), Pair(a, b))?,
            }
            if a.topic == b.topic {
                let places = Places {
                    topic: a.topic,
                    a: a.at,
                    b: b.at,
                };
                self.places.push(self.bucket_of(&a), places)?;
            }
        }
        Ok(())
    }

    fn changed(&mut self, a: Entry, b: Entry) {
        self.topic(a.topic).changed += 1;
        let last = self.sample.last_key_value().map(|(at, _)| *at);
        let is_full = self.sample.len() >= SAMPLE;
        if self.mode == Mode::Farside && (!is_full || last.is_some_and(|last| a.at < last)) {
            if is_full {
                self.sample.pop_last();
            }
            self.sample.insert(a.at, Pair(a, b));
        }
        self.found(Found::Changed(a, b));
    }

    /// Compares pairs of messages by their fields, a part of them at a time: within a part each
    /// file is read from front to back, however differently the two are ordered.
    pub(super) fn read_pairs(&mut self, mut pairs: &[Pair]) -> Result<(), LogError> {
        while !pairs.is_empty() {
            let mut held = Vec::new();
            let mut bytes = 0;
            while let Some(Pair(a, b)) = pairs.get(held.len())
                && bytes < self.limits.message_bytes
            {
                let message = detail::Held::fetch(&mut self.a, a)?;
                bytes += message.bytes() + 100;
                held.push((*a, *b, message));
            }
            self.note_usage(bytes + pairs.len() * Pair::BYTES);
            pairs = &pairs[held.len()..];
            held.sort_by_key(|(_, b, _)| b.position);
            for (a, b, message) in held {
                let given = (self.channels.each_ref().map(Vec::as_slice), &self.rules);
                let changes = match self.mode {
                    Mode::Any => Some(self.changes.entry(a.topic).or_default()),
                    Mode::Farside => None,
                };
                if let Some(diff) = message.against(&mut self.b, &b, self.mode, given, changes)? {
                    // What is sent is the same but for what may differ.
                    let sent_alike = self.mode == Mode::Farside && diff.field == "log_time";
                    let said = if sent_alike { a.said } else { b.said };
                    self.changed(a, Entry { said, ..b });
                    self.reasons.extend(diff.why.map(|why| (a.topic, why)));
                }
            }
        }
        Ok(())
    }

    /// Counts the messages that come in another order on their topic.
    pub(super) fn compare_order(&mut self) -> Result<(), LogError> {
        let mut topics: BTreeMap<u32, Sequence> = BTreeMap::new();
        // The first of a topic that comes too early, by its places.
        let mut early: BTreeMap<u32, Places> = BTreeMap::new();
        for bucket in 0..BUCKETS {
            let mut places = self.places.read(bucket)?;
            places.sort_unstable_by_key(|places| places.a);
            let bytes = topics.values().map(Sequence::held_bytes).sum::<usize>();
            self.note_usage(bytes + places.len() * Places::BYTES);
            for places in places {
                if topics.entry(places.topic).or_default().add(places.b) {
                    early.entry(places.topic).or_insert(places);
                }
            }
        }
        if early.is_empty() {
            return Ok(());
        }
        let entries_a = self.entries_at(early.values().map(|places| places.a).collect(), 0)?;
        let entries_b = self.entries_at(early.values().map(|places| places.b).collect(), 1)?;
        for (topic, places) in early {
            let count = topics.get(&topic).map_or(0, Sequence::out_of_order);
            self.topic(topic).reordered += count;
            if let (Some(a), Some(b)) = (entries_a.get(&places.a), entries_b.get(&places.b)) {
                self.found(Found::Reordered(*a, *b));
            }
        }
        Ok(())
    }

    /// The entries of a log that are at these places.
    fn entries_at(
        &mut self,
        places: BTreeSet<u32>,
        side: usize,
    ) -> Result<BTreeMap<u32, Entry>, LogError> {
        let mut found = BTreeMap::new();
        for bucket in 0..BUCKETS {
            let index = if side == 0 { &mut self.a } else { &mut self.b };
            let entries = index.entries.read(bucket)?;
            let wanted = entries.iter().filter(|entry| places.contains(&entry.at));
            found.extend(wanted.map(|entry| (entry.at, *entry)));
        }
        Ok(found)
    }
}
