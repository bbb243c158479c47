//! How many messages are lost, of which topics, and from when: as far as the file itself says.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;

use crate::salvage::Counted;
use crate::shown::{Seconds, Shown};

/// What is known of the messages that are lost.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LostMessages {
    /// How many at least.
    pub known: u64,
    /// How many at least, by topic.
    pub by_topic: BTreeMap<String, u64>,
    /// What tells of them.
    pub told_by: LostToldBy,
    /// Between which log times they were written, in nanoseconds, the later open if that is unknown; none if
    /// no message is known to be lost, or may be.
    pub between_ns: Option<(u64, Option<u64>)>,
}

/// What tells how many messages a file had.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LostToldBy {
    /// The statistics at the end of the file: no more are lost than they say.
    Statistics,
    /// The indexes behind chunks: messages that no index is left of may be lost as well.
    #[default]
    Indexes,
}

/// Topics that are listed.
const LISTED: usize = 10;

impl fmt::Display for LostMessages {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let known = self.known;
        match (self.told_by, known, self.between_ns) {
            (_, 0, None) => return Ok(()),
            (LostToldBy::Indexes, 0, _) => write!(f, "how many messages were lost is unknown")?,
            (LostToldBy::Indexes, ..) => write!(f, "at least {known} messages were lost")?,
            (LostToldBy::Statistics, 0, _) => write!(f, "no message was lost")?,
            (LostToldBy::Statistics, ..) => write!(f, "{known} messages were lost")?,
        }
        match self.between_ns {
            Some((from, Some(until))) => write!(
                f,
                ", logged between {} s and {} s",
                Seconds(from),
                Seconds(until)
            )?,
            Some((from, None)) => write!(f, ", logged at {} s or later", Seconds(from))?,
            None => {}
        }
        writeln!(f)?;
        let mut topics: Vec<(&String, &u64)> = self.by_topic.iter().collect();
        topics.sort_by_key(|(topic, lost)| (u64::MAX - **lost, *topic));
        for (topic, lost) in topics.iter().take(LISTED) {
            writeln!(f, "  {lost} on {}", Shown(topic))?;
        }
        if let more @ 1.. = topics.len().saturating_sub(LISTED) {
            writeln!(f, "  and some on {more} topics more")?;
        }
        Ok(())
    }
}

/// Counts while a file is walked through.
#[derive(Default)]
pub(super) struct Tally {
    counted: Option<Counted>,
    /// By channel, as the broken file numbers them.
    saved: BTreeMap<u16, u64>,
    lost_by_indexes: BTreeMap<u16, u64>,
    /// Of the chunk that was read last, until its indexes are.
    in_chunk: BTreeMap<u16, u64>,
    indexes_begun: bool,
    /// When the last message before this was logged.
    last_ns: Option<u64>,
    /// Something was lost since then.
    gap: bool,
    between: Option<(u64, Option<u64>)>,
}

impl Tally {
    pub(super) fn new(counted: Option<Counted>) -> Self {
        Tally {
            counted,
            ..Tally::default()
        }
    }

    pub(super) fn saved(&mut self, channel: u16, log_time_ns: u64) {
        self.chunk_if_new();
        *self.saved.entry(channel).or_default() += 1;
        *self.in_chunk.entry(channel).or_default() += 1;
        if std::mem::take(&mut self.gap) {
            let from = self.last_ns.unwrap_or(0).min(log_time_ns);
            let until = self.last_ns.unwrap_or(0).max(log_time_ns);
            self.widen(from, Some(until));
        }
        self.last_ns = Some(log_time_ns);
    }

    /// A chunk begins.
    pub(super) fn chunk(&mut self) {
        self.in_chunk.clear();
        self.indexes_begun = false;
    }

    fn chunk_if_new(&mut self) {
        if self.indexes_begun {
            self.chunk();
        }
    }

    pub(super) fn lost(&mut self) {
        self.chunk_if_new();
        self.gap = true;
    }

    /// An index says how many messages of a channel the chunk in front of it had.
    pub(super) fn index(&mut self, channel: u16, messages: u64) {
        self.indexes_begun = true;
        let saved = self.in_chunk.get(&channel).copied().unwrap_or(0);
        let lost = messages.saturating_sub(saved);
        if lost > 0 {
            *self.lost_by_indexes.entry(channel).or_default() += lost;
        }
    }

    fn widen(&mut self, from: u64, until: Option<u64>) {
        self.between = Some(match self.between {
            None => (from, until),
            Some((first, last)) => (
                first.min(from),
                last.zip(until).map(|(last, until)| last.max(until)),
            ),
        });
    }

    /// What is lost, if the file ends here; `cut` if more may have come.
    pub(super) fn finish(
        mut self,
        cut: bool,
        topic: impl Fn(u16) -> Option<String>,
    ) -> LostMessages {
        if self.gap || cut {
            let until = self.counted.as_ref().map(|counted| counted.times_ns.1);
            let from = self.last_ns.unwrap_or(0);
            self.widen(from, until.map(|until| until.max(from)));
        }
        let times_ns = self.counted.as_ref().map(|counted| counted.times_ns);
        let told_by = match self.counted {
            Some(_) => LostToldBy::Statistics,
            None => LostToldBy::Indexes,
        };
        let lost = match self.counted {
            Some(Counted { by_channel, .. }) => {
                let saved = |channel| self.saved.get(channel).copied().unwrap_or(0);
                let lost = by_channel
                    .iter()
                    .map(|(channel, messages)| (*channel, messages.saturating_sub(saved(channel))));
                lost.filter(|(_, lost)| *lost > 0).collect()
            }
            None => self.lost_by_indexes,
        };
        let known = lost.values().fold(0_u64, |sum, n| sum.saturating_add(*n));
        let mut by_topic = BTreeMap::new();
        for (channel, lost) in lost {
            let topic = topic(channel).unwrap_or_else(|| format!("channel {channel}"));
            let of_topic: &mut u64 = by_topic.entry(topic).or_default();
            *of_topic = of_topic.saturating_add(lost);
        }
        let between_ns = match (told_by, known) {
            (LostToldBy::Statistics, 0) => None,
            (LostToldBy::Indexes, 0) => self.between,
            // Where they were is kept as something that only its writer knows.
            _ => self.between.or(Some(match times_ns {
                Some((first, last)) => (first, Some(last)),
                None => (0, None),
            })),
        };
        LostMessages {
            known,
            by_topic,
            told_by,
            between_ns,
        }
    }
}
