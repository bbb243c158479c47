//! The comparison itself: two logs are read, what they do not agree in is paired and counted, and what that
//! came to is told.

mod pairing;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

use super::behaviour::Changes;
use super::causal::Walker;
use super::differing::Differing;
use super::entry::{Entry, Mode, Names};
use super::found::{Found, Pair, Places};
use super::index::{self, Index};
use super::matching::Shifts;
use super::reach::Reach;
use super::root::Starts;
use super::spill::{BUCKETS, Buckets};
use super::{DiffOptions, DiffReport, FirstDifference, Limits, TopicDiff, Usage};
use super::{agree, beside, detail, known, offset, scenario, text};
use crate::LogError;
use crate::channel::ChannelInfo;
use crate::envelope::seconds;
use crate::fields::{FieldDiff, Rules};
use crate::log::Log;
use crate::shown::Seconds;
use crate::topics::Topics;

/// Compares two logs, and says what that took.
pub(super) fn compare(
    a: &Path,
    b: &Path,
    options: &DiffOptions,
    limits: Limits,
    differing: Option<&mut Differing>,
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
    comparison.differing = differing;
    known::check((&comparison.a, &comparison.b), mode, options)?;
    comparison.find_offset()?;
    let strangers = heads.iter().filter(|head| head.is_none()).count();
    comparison.note_files(strangers);
    if let [Some(a), Some(b)] = &starts {
        let inputs = scenario::note(&mut comparison.report.notes, a, b);
        comparison.starts.inputs = inputs;
        let left_out = [&options.ignore, &options.topics]
            .iter()
            .any(|list| !list.is_empty());
        let filtered = !(a.exclude().is_empty() && b.exclude().is_empty());
        comparison.starts.has_unseen = left_out || filtered;
    }
    let mut beside = std::mem::take(&mut comparison.beside);
    comparison.report.notes.append(&mut beside.notes);
    comparison.starts.add_files(&beside.beside);
    comparison.report.beside = beside.beside;
    comparison.report.metadata = beside.metadata;
    comparison.report.attachments = beside.attachments;
    comparison.compare()
}

struct Comparison<'a> {
    a: Index<'a>,
    b: Index<'a>,
    mode: Mode,
    rules: Rules,
    /// All channels of both logs.
    channels: [Vec<Arc<ChannelInfo>>; 2],
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
    /// What has but a place in its flow and is not yet paired: of the first log in the bucket of that place.
    left: (Buckets<Entry>, Buckets<Entry>),
    /// By how much the places of the two logs differ.
    shifts: Shifts,
    /// By field: in buckets by their place in the first log.
    to_read: Buckets<Pair>,
    /// In order: in buckets by their place in the first log.
    places: Buckets<Places>,
    earliest: Option<Found>,
    /// The earliest that nobody injected.
    earliest_own: Option<Found>,
    /// Which messages differ, for who wants to know.
    differing: Option<&'a mut Differing>,
    /// Of Farside's logs, whom the differences touched first.
    reach: Reach,
    /// In what the starts of the two runs differ.
    starts: Starts,
    /// Topics whose schemas differ: their messages are read even where their bytes are the same.
    by_field: BTreeSet<u32>,
    /// Why messages on a topic were compared by their bytes only.
    reasons: BTreeSet<(u32, String)>,
}

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
        let ends = match mode {
            Mode::Farside => [a.end(&mut names)?, b.end(&mut names)?],
            Mode::Any => Default::default(),
        };
        let channels = [&a, &b].map(|log| log.scanner.channels().to_vec());
        let mut order = a.topic_order(&mut names);
        order.extend(b.topic_order(&mut names));
        let mut reach = Reach::new(ends);
        for topic in &order {
            let name = names.name(*topic);
            let arrived = ["/lost", "/in_flight"].map(|class| name.strip_prefix(class));
            if arrived.iter().flatten().any(|topic| ignore.matches(topic)) {
                reach.hidden.insert(*topic);
            }
        }
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
            channels,
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
            left: (Buckets::new(limits.left()), Buckets::new(limits.left())),
            shifts: Shifts::new(limits.shifted),
            to_read: Buckets::new(limits.pairs),
            places: Buckets::new(limits.pairs),
            earliest: None,
            earliest_own: None,
            differing: None,
            reach,
            starts: Starts::default(),
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

    fn found(&mut self, found: Found) {
        if let Some(differing) = &mut self.differing {
            differing.add(&found);
        }
        let when = found.when(&self.names);
        let place = (when, found.rank());
        let is_earlier = |known: &Option<Found>| match known {
            Some(known) => place < (known.when(&self.names), known.rank()),
            None => true,
        };
        let (first, own) = (is_earlier(&self.earliest), is_earlier(&self.earliest_own));
        let (time_ns, entry) = (when.0, found.both());
        if first {
            self.earliest = Some(found);
        }
        if self.mode == Mode::Farside {
            if own && !found.is_injected(&self.names) {
                self.earliest_own = Some(found);
            }
            self.reach.add(&found, &self.names);
        }
        if let Some(entry) = entry.into_iter().flatten().next() {
            let first_ns = &mut self.topic(entry.topic).first_ns;
            *first_ns = Some(first_ns.map_or(time_ns, |known| known.min(time_ns)));
        }
    }

    fn compare(mut self) -> Result<(DiffReport, Usage), LogError> {
        self.count_records();
        for bucket in 0..BUCKETS {
            self.compare_bucket(bucket)?;
        }
        self.compare_places()?;
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
        let left = self.left.0.held_bytes() + self.left.1.held_bytes();
        let waiting = [
            a.held_bytes(),
            b.held_bytes(),
            left,
            self.to_read.held_bytes(),
        ];
        let held = waiting.iter().sum::<usize>() + self.places.held_bytes() + more;
        self.usage.most_bytes = self.usage.most_bytes.max(held);
    }

    /// Counts the fields that differ in the first pairs that do, of Farside's logs.
    fn count_sample(&mut self) -> Result<(), LogError> {
        for (_, Pair(a, b)) in std::mem::take(&mut self.sample) {
            let held = detail::Held::fetch(&mut self.a, &a)?;
            let given = (self.channels.each_ref().map(Vec::as_slice), &self.rules);
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
            let injected = self.mode == Mode::Farside && found.is_injected(&self.names);
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
            self.walk_back()?;
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

    /// Finds what the differences began with, whom they reached, and how.
    fn walk_back(&mut self) -> Result<(), LogError> {
        let logs = [&mut self.a, &mut self.b];
        let files = [self.short.0.as_str(), self.short.1.as_str()];
        let mut walker = Walker::new(logs, &mut self.names, &self.reach, &self.starts, files);
        self.report.spread = walker.reached()?;
        if let Some(first) = &self.earliest {
            self.report.root = walker.root(first)?;
            if let Some(root) = &self.report.root {
                self.report.inputs = walker.inputs(root, first)?;
            }
        }
        Ok(())
    }

    fn describe(&mut self, found: Found) -> Result<FirstDifference, LogError> {
        let time_ns = found.when(&self.names).0;
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
                let given = (self.channels.each_ref().map(Vec::as_slice), &self.rules);
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
