//! The comparison itself: what two logs do not agree in is paired, bucket by bucket, and counted.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::behaviour::Changes;
use super::entry::{Entry, Mode, Names};
use super::index::{self, Index};
use super::matching::{self, Matching, Sequence};
use super::spill::{BUCKETS, Buckets, Fixed};
use super::{DiffOptions, DiffReport, FirstDifference, Limits, Reached, TopicDiff, Usage};
use super::{agree, aligning, beside, detail, known, offset, scenario, text};
use crate::LogError;
use crate::envelope::seconds;
use crate::fields::{FieldDiff, Rules};
use crate::log::Log;
use crate::parse::Parser;
use crate::shown::Seconds;
use crate::topics::Topics;

/// Compares two logs, and says what that took.
pub(super) fn compare(
    a: &Path,
    b: &Path,
    options: &DiffOptions,
    limits: Limits,
) -> Result<(DiffReport, Usage), LogError> {
    // A glob that makes no sense is told before anything is read.
    Topics::new(&options.ignore)?.and_all_but(&options.topics)?;
    let starts = [index::start(a)?, index::start(b)?];
    let heads = starts.each_ref().map(|log| log.as_ref().map(Log::head));
    let mode = match heads.iter().flatten().count() {
        2 => Mode::Farside,
        _ => Mode::Any,
    };
    // What one of them did not write is no difference.
    let filtered = heads.iter().flatten().flat_map(|head| &head.exclude);
    let ignore: Vec<String> = options.ignore.iter().chain(filtered).cloned().collect();
    let ignore = Topics::new(&ignore)?.and_all_but(&options.topics)?;
    let read = |limits| Comparison::read((a, b), mode, &ignore, options.rules(), limits);
    let mut comparison = read(limits)?;
    if !comparison.may_pass_front()? {
        let all = Limits {
            passes_front: false,
            ..limits
        };
        comparison = read(all)?;
    }
    known::check((&comparison.a, &comparison.b), mode, options)?;
    comparison.find_offset()?;
    let strangers = heads.iter().filter(|head| head.is_none()).count();
    comparison.note_files(strangers);
    if let [Some(a), Some(b)] = &starts {
        scenario::note(&mut comparison.report.notes, a, b);
    }
    let mut beside = std::mem::take(&mut comparison.beside);
    comparison.report.notes.append(&mut beside.notes);
    comparison.report.beside = beside.beside;
    comparison.report.metadata = beside.metadata;
    comparison.report.attachments = beside.attachments;
    comparison.compare()
}

/// How many pairs of Farside's logs that differ are read for which fields do: those at the front, of which
/// few chunks are opened again.
const SAMPLE: usize = 4096;

/// A difference, and where it is.
#[derive(Clone, Copy)]
enum Found {
    Changed(Entry, Entry),
    OnlyInA(Entry),
    OnlyInB(Entry),
    Reordered(Entry, Entry),
}

impl Found {
    /// Of differences at the same place one of the lesser rank is told.
    fn rank(&self) -> (usize, u32) {
        match self {
            Found::Changed(a, _) => (0, a.at),
            Found::OnlyInA(a) => (1, a.at),
            Found::OnlyInB(b) => (2, b.at),
            Found::Reordered(a, _) => (3, a.topic),
        }
    }
}

/// Two records that are the same one, to be compared by their fields.
#[derive(Clone, Copy)]
struct Pair(Entry, Entry);

impl Fixed for Pair {
    const BYTES: usize = 2 * Entry::BYTES;

    fn put(&self, out: &mut Vec<u8>) {
        self.0.put(out);
        self.1.put(out);
    }

    fn take(parser: &mut Parser<'_>) -> Option<Pair> {
        Some(Pair(Entry::take(parser)?, Entry::take(parser)?))
    }
}

/// Where two records that are the same one are in the two logs.
#[derive(Clone, Copy)]
struct Places {
    topic: u32,
    a: u32,
    b: u32,
}

impl Fixed for Places {
    const BYTES: usize = 12;

    fn put(&self, out: &mut Vec<u8>) {
        for number in [self.topic, self.a, self.b] {
            out.extend_from_slice(&number.to_le_bytes());
        }
    }

    fn take(parser: &mut Parser<'_>) -> Option<Places> {
        Some(Places {
            topic: parser.u32()?,
            a: parser.u32()?,
            b: parser.u32()?,
        })
    }
}

struct Comparison<'a> {
    a: Index<'a>,
    b: Index<'a>,
    mode: Mode,
    rules: Rules,
    limits: Limits,
    names: Names,
    /// Topics in the order in which they are told of; some more than once.
    order: Vec<u32>,
    /// How the files are called.
    short: (String, String),
    report: DiffReport,
    /// What differs beside the messages.
    beside: DiffReport,
    usage: Usage,
    topics: BTreeMap<u32, TopicDiff>,
    /// Which fields differ on a topic.
    changes: BTreeMap<u32, Changes>,
    /// Of Farside's logs, the first of the pairs that differ, by their places in the first log: their fields
    /// are counted.
    sample: BTreeMap<u32, Pair>,
    /// Messages with another sequence number.
    renumbered: u64,
    /// By field: in buckets by their place in the first log.
    to_read: Buckets<Pair>,
    /// In order: in buckets by their place in the first log.
    places: Buckets<Places>,
    earliest: Option<Found>,
    /// The earliest that nobody injected.
    earliest_own: Option<Found>,
    /// Topics whose schemas differ: their messages are read even where their bytes are the same.
    by_field: BTreeSet<u32>,
    /// Why messages on a topic were compared by their bytes only.
    reasons: BTreeSet<(u32, String)>,
}

/// How the topics of events begin that are planned before a run.
const INJECTED: [&str; 4] = [
    "/event/crash",
    "/event/restart",
    "/event/change",
    "/event/told",
];

/// The order in which differences are sorted: time, step, whether an actor is the source, the
/// source, its count, whether it is the fate of a message and no event, place in the log.
type Order<'a> = (u64, u32, bool, &'a str, u64, bool, u32);

impl<'a> Comparison<'a> {
    /// Reads both logs, and compares what is beside their messages.
    fn read(
        (a, b): (&Path, &Path),
        mode: Mode,
        ignore: &'a Topics,
        rules: Rules,
        limits: Limits,
    ) -> Result<Comparison<'a>, LogError> {
        let mut names = Names::default();
        let short = text::short(a, b);
        let report = DiffReport {
            file_a: a.display().to_string(),
            file_b: b.display().to_string(),
            ..DiffReport::default()
        };
        let mut a = Index::open(a, mode, ignore, limits.entries)?;
        let mut b = Index::open(b, mode, ignore, limits.entries)?;
        let renumbered = match limits.passes_front {
            true => agree::front(&mut a, &mut b, mode, &mut names)?,
            false => 0,
        };
        a.keep_rest(&mut names)?;
        b.keep_rest(&mut names)?;
        let mut order = a.topic_order(&mut names);
        order.extend(b.topic_order(&mut names));
        let mut beside = DiffReport::default();
        let files = (short.0.as_str(), short.1.as_str());
        let by_field = beside::compare((&a, &b), files, mode, (&mut names, &order), &mut beside);
        Ok(Comparison {
            usage: Usage {
                agreed: [a.agreed(), b.agreed()],
                ..Usage::default()
            },
            a,
            b,
            mode,
            rules,
            limits,
            names,
            order,
            short,
            report,
            beside,
            topics: BTreeMap::new(),
            changes: BTreeMap::new(),
            sample: BTreeMap::new(),
            renumbered,
            to_read: Buckets::new(limits.pairs),
            places: Buckets::new(limits.pairs),
            earliest: None,
            earliest_own: None,
            by_field,
            reasons: BTreeSet::new(),
        })
    }

    /// Whether what agrees at the front is paired with each other, and says the same, also in view
    /// of all that comes behind it.
    fn may_pass_front(&mut self) -> Result<bool, LogError> {
        // A channel that is declared later may read their bytes differently.
        if self.by_field.iter().any(|topic| self.a.agrees_on(*topic)) {
            return Ok(false);
        }
        let mut late = std::mem::take(&mut self.a.late);
        for (identity, ordinal) in std::mem::take(&mut self.b.late) {
            let least = late.entry(identity).or_insert(ordinal);
            *least = (*least).min(ordinal);
        }
        Ok(late.is_empty() || !self.a.is_overtaken(&late, &mut self.names)?)
    }

    /// Finds by how much later the second log was recorded. Where the front agrees, it was not.
    fn find_offset(&mut self) -> Result<(), LogError> {
        if self.mode == Mode::Farside || self.a.agreed() > 0 {
            return Ok(());
        }
        let offset_ns = offset::common_offset(&mut self.a.entries, &mut self.b.entries)?;
        self.rules.offset_ns = offset_ns;
        self.report.offset_ns = offset_ns;
        if offset_ns != 0 {
            let (short, when) = (
                &self.short.1,
                if offset_ns < 0 { "earlier" } else { "later" },
            );
            let by = Seconds(offset_ns.unsigned_abs());
            let note = format!("{short} was recorded {by} s {when}: times are compared after that");
            self.report.notes.push(note);
        }
        Ok(())
    }

    fn note_files(&mut self, strangers: usize) {
        let notes = &mut self.report.notes;
        if strangers == 1 {
            notes.push("only one of the two is a Farside log: compared by topic".to_owned());
        }
        for (name, index) in [(&self.short.0, &self.a), (&self.short.1, &self.b)] {
            match &index.beside.cut {
                Some((offset, what)) => {
                    notes.push(format!("{name} is cut at byte {offset}: {what}"));
                }
                None if self.mode == Mode::Farside && !index.beside.has_end() => {
                    notes.push(format!(
                        "{name} has no farside.end: its run did not end in the log"
                    ));
                }
                None => {}
            }
        }
    }

    fn topic(&mut self, topic: u32) -> &mut TopicDiff {
        let name = self.names.name(topic);
        self.topics.entry(topic).or_insert_with(|| TopicDiff {
            topic: name.to_owned(),
            ..TopicDiff::default()
        })
    }

    fn order<'n>(names: &'n Names, entry: &Entry) -> Order<'n> {
        let source = names.name(entry.source);
        (
            entry.time_ns,
            entry.step,
            source != "@control",
            source,
            entry.count,
            !entry.event,
            entry.at,
        )
    }

    /// When a difference shows: the earlier of its two records.
    fn when(&self, found: &Found) -> Order<'_> {
        let order = |entry| Self::order(&self.names, entry);
        match found {
            Found::Changed(x, y) | Found::Reordered(x, y) => order(x).min(order(y)),
            Found::OnlyInA(x) => order(x),
            Found::OnlyInB(y) => order(y),
        }
    }

    fn found(&mut self, found: Found) {
        let time_ns = self.when(&found).0;
        let entry = match &found {
            Found::Changed(entry, _) | Found::Reordered(entry, _) => entry,
            Found::OnlyInA(entry) | Found::OnlyInB(entry) => entry,
        };
        let topic = entry.topic;
        let first_ns = &mut self.topic(topic).first_ns;
        *first_ns = Some(first_ns.map_or(time_ns, |known| known.min(time_ns)));
        let place = (self.when(&found), found.rank());
        let is_earlier = |known: &Option<Found>| match known {
            Some(known) => place < (self.when(known), known.rank()),
            None => true,
        };
        let (first, own) = (is_earlier(&self.earliest), is_earlier(&self.earliest_own));
        if first {
            self.earliest = Some(found);
        }
        if own && !self.is_injected(&found) {
            self.earliest_own = Some(found);
        }
    }

    /// Whether a difference is of an event that was planned before the run.
    fn is_injected(&self, found: &Found) -> bool {
        let injected = |entry: &Entry| {
            let topic = self.names.name(entry.topic);
            INJECTED.iter().any(|start| topic.starts_with(start))
        };
        self.mode == Mode::Farside
            && match found {
                Found::Changed(x, y) | Found::Reordered(x, y) => injected(x) && injected(y),
                Found::OnlyInA(x) => injected(x),
                Found::OnlyInB(y) => injected(y),
            }
    }

    fn compare(mut self) -> Result<(DiffReport, Usage), LogError> {
        self.count_records();
        for bucket in 0..BUCKETS {
            self.compare_bucket(bucket)?;
        }
        for bucket in 0..BUCKETS {
            let mut pairs = self.to_read.read(bucket)?;
            pairs.sort_unstable_by_key(|pair| pair.0.at);
            self.read_pairs(&pairs)?;
        }
        if self.renumbered > 0 {
            let what = "messages have other sequence numbers: not compared";
            self.report
                .notes
                .push(format!("{} {what}", self.renumbered));
        }
        self.compare_order()?;
        self.finish()
    }

    fn count_records(&mut self) {
        for side in 0..2 {
            let index = if side == 0 { &self.a } else { &self.b };
            for (role, count) in &index.left_out {
                let role = if role.is_empty() { "other" } else { role };
                let counts = self.report.not_compared.entry(role.to_owned());
                counts.or_default()[side] += *count;
            }
            let topics: Vec<(u32, u64)> = index.topics().collect();
            for (topic, count) in topics {
                let topic = self.topic(topic);
                match side {
                    0 => topic.a += count,
                    _ => topic.b += count,
                }
                match side {
                    0 => self.report.records_a += count,
                    _ => self.report.records_b += count,
                }
            }
        }
        let ignored = [self.a.ignored, self.b.ignored];
        if ignored != [0; 2] {
            let what = "ignored".to_owned();
            self.report.not_compared.insert(what, ignored);
        }
    }

    /// Notes how many bytes wait in memory, these included.
    fn note_usage(&mut self, more: usize) {
        let (a, b) = (&self.a.entries, &self.b.entries);
        let waiting = [a.held_bytes(), b.held_bytes(), self.to_read.held_bytes()];
        let held = waiting.iter().sum::<usize>() + self.places.held_bytes() + more;
        self.usage.most_bytes = self.usage.most_bytes.max(held);
    }

    /// The bucket of a pair, by its place in the first log.
    fn bucket_of(&self, a: &Entry) -> usize {
        let (from, to) = (u64::from(self.a.agreed()), u64::from(self.a.records) + 1);
        let place = u64::from(a.at).saturating_sub(from) * BUCKETS as u64;
        (place / (to - from)) as usize
    }

    /// Pairs what may be the same: all that is in one bucket of both logs.
    fn compare_bucket(&mut self, bucket: usize) -> Result<(), LogError> {
        let a = self.a.entries.read(bucket)?;
        let b = self.b.entries.read(bucket)?;
        self.note_usage((a.len() + b.len()) * Entry::BYTES);
        let Matching {
            pairs,
            only_in_a,
            only_in_b,
        } = match self.mode {
            Mode::Farside => matching::matching(&a, &b),
            Mode::Any => aligning::aligned(&a, &b, self.rules.offset_ns),
        };
        // The bytes of two messages may differ and their fields not, or the other way round.
        let by_field = !self.rules.are_exact() || self.mode == Mode::Any;
        for (x, y) in pairs {
            let (a, b) = (a[x as usize], b[y as usize]);
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
        for entry in only_in_a.iter().map(|at| a[*at as usize]) {
            self.topic(entry.topic).only_in_a += 1;
            self.found(Found::OnlyInA(entry));
        }
        for entry in only_in_b.iter().map(|at| b[*at as usize]) {
            self.topic(entry.topic).only_in_b += 1;
            self.found(Found::OnlyInB(entry));
        }
        self.note_usage((a.len() + b.len()) * Entry::BYTES);
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
    fn read_pairs(&mut self, mut pairs: &[Pair]) -> Result<(), LogError> {
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
                let given = (self.a.scanner.channels(), &self.rules);
                let changes = match self.mode {
                    Mode::Any => Some(self.changes.entry(a.topic).or_default()),
                    Mode::Farside => None,
                };
                if let Some(diff) = message.against(&mut self.b, &b, self.mode, given, changes)? {
                    self.changed(a, b);
                    self.reasons.extend(diff.why.map(|why| (a.topic, why)));
                }
            }
        }
        Ok(())
    }

    /// Counts the fields that differ in the first pairs that do, of Farside's logs.
    fn count_sample(&mut self) -> Result<(), LogError> {
        for (_, Pair(a, b)) in std::mem::take(&mut self.sample) {
            let held = detail::Held::fetch(&mut self.a, &a)?;
            let given = (self.a.scanner.channels(), &self.rules);
            let changes = Some(self.changes.entry(a.topic).or_default());
            held.against(&mut self.b, &b, self.mode, given, changes)?;
        }
        Ok(())
    }

    /// How the topics that differ behave in the two logs.
    fn behaviour(&mut self) {
        for (topic, told) in &mut self.topics {
            told.rate_a = self.a.rate(*topic);
            told.rate_b = self.b.rate(*topic);
            let changes = self.changes.remove(topic);
            told.fields = changes.map_or_else(Vec::new, Changes::told);
        }
    }

    /// Counts the messages that come in another order on their topic.
    fn compare_order(&mut self) -> Result<(), LogError> {
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

    fn finish(mut self) -> Result<(DiffReport, Usage), LogError> {
        self.count_sample()?;
        self.behaviour();
        for topic in self.topics.values() {
            self.report.changed += topic.changed;
            self.report.only_in_a += topic.only_in_a;
            self.report.only_in_b += topic.only_in_b;
            self.report.reordered += topic.reordered;
        }
        self.report.identical = self.earliest.is_none() && self.report.beside.is_empty();
        if let Some(found) = self.earliest {
            let injected = self.is_injected(&found);
            let mut first = self.describe(found)?;
            first.injected = injected;
            self.report.first = Some(first);
            let own = self.earliest_own.filter(|_| injected);
            let own = own.map(|own| self.describe(own));
            self.report.consequence = own.transpose()?;
        }
        let mut told = BTreeSet::new();
        for topic in self.order.iter().filter(|topic| told.insert(**topic)) {
            let reasons = self.reasons.range((*topic, String::new())..);
            for (_, why) in reasons.take_while(|(of, _)| of == topic) {
                let topic = self.names.name(*topic);
                let note = format!("messages on {topic} were compared by their bytes: {why}");
                self.report.notes.push(note);
            }
        }
        if self.mode == Mode::Farside {
            self.report.spread = spread(self.topics.values());
        }
        let differing = |topic: &TopicDiff| topic.differences() > 0;
        self.report.topics = self.topics.into_values().filter(differing).collect();
        self.report.topics.sort_by(|a, b| {
            b.differences()
                .cmp(&a.differences())
                .then_with(|| a.topic.cmp(&b.topic))
        });
        let entries = self.a.entries.file_bytes() + self.b.entries.file_bytes();
        self.usage.file_bytes = entries + self.to_read.file_bytes() + self.places.file_bytes();
        Ok((self.report, self.usage))
    }

    fn describe(&mut self, found: Found) -> Result<FirstDifference, LogError> {
        let time_ns = self.when(&found).0;
        let (mode, names) = (self.mode, &mut self.names);
        let mut first = match found {
            Found::OnlyInA(a) => {
                let diff = FieldDiff::new("presence", "present", "absent");
                detail::describe(&mut self.a, &a, mode, names, diff)?
            }
            Found::OnlyInB(b) => {
                let diff = FieldDiff::new("presence", "absent", "present");
                let mut first = detail::describe(&mut self.b, &b, mode, names, diff)?;
                first.carried_b = first.carried_a.take();
                first
            }
            Found::Reordered(a, b) => {
                let (x, y) = (format!("record {}", a.at), format!("record {}", b.at));
                let diff = FieldDiff::new("order", x, y);
                detail::describe(&mut self.a, &a, mode, names, diff)?
            }
            Found::Changed(a, b) => {
                let held = detail::Held::fetch(&mut self.a, &a)?;
                let given = (self.a.scanner.channels(), &self.rules);
                let diff = held.against(&mut self.b, &b, mode, given, None)?;
                let reason = diff.as_ref().and_then(|diff| diff.why.clone());
                self.reasons.extend(reason.map(|why| (a.topic, why)));
                let diff = diff.unwrap_or_else(|| FieldDiff::new("body", "one", "another"));
                let mut first = detail::describe(&mut self.a, &a, mode, names, diff.clone())?;
                let other = detail::describe(&mut self.b, &b, mode, names, diff)?;
                // The link and the reason are those of the loss, in whichever log it is.
                if first.reason.is_empty() {
                    first.reason = other.reason;
                }
                if first.link.is_empty() {
                    first.link = other.link;
                }
                first.carried_b = other.carried_a;
                first
            }
        };
        first.time_s = seconds(time_ns);
        first.time_ns = time_ns;
        Ok(first)
    }
}

/// By actor, when it first says or does something else, in the order in which that was. What links and
/// control events do is no work of an actor.
fn spread<'a>(topics: impl Iterator<Item = &'a TopicDiff>) -> Vec<Reached> {
    let mut reached: BTreeMap<&str, (u64, &str)> = BTreeMap::new();
    for topic in topics {
        let Some(time_ns) = topic.first_ns.filter(|_| topic.differences() > 0) else {
            continue;
        };
        let inner = topic.topic.strip_prefix("/timer").unwrap_or(&topic.topic);
        let of_links = ["/lost/", "/in_flight/", "/hand_over/", "/event/"];
        let actor = inner
            .strip_prefix('/')
            .and_then(|rest| rest.rsplit_once('/'));
        let Some((actor, _)) = actor.filter(|_| of_links.iter().all(|of| !inner.starts_with(of)))
        else {
            continue;
        };
        let first = (time_ns, topic.topic.as_str());
        let known = reached.entry(actor).or_insert(first);
        *known = first.min(*known);
    }
    let mut reached: Vec<Reached> = reached
        .into_iter()
        .map(|(actor, (time_ns, topic))| Reached {
            actor: actor.to_owned(),
            time_s: seconds(time_ns),
            time_ns,
            topic: topic.to_owned(),
        })
        .collect();
    reached.sort_by(|a, b| (a.time_ns, &a.actor).cmp(&(b.time_ns, &b.actor)));
    reached
}
