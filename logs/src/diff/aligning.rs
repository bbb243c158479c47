//! Pairing the messages of logs that give them no identity: topic by topic, by what they say, by their
//! numbers, and by when they were.

use std::collections::BTreeMap;

use xxhash_rust::xxh3::xxh3_64;

use super::entry::Entry;
use super::matching::Matching;

/// Pairs the messages of each topic: what is the same in both, and between these what says the
/// same, what has the same number, what was at the same time or nearest to it, and at last by place. So
/// a message that one log lacks is one message, and not the difference of all that follow it. The second
/// log was recorded later by `offset_ns`.
pub(super) fn aligned(a: &[Entry], b: &[Entry], offset_ns: i64) -> Matching {
    let mut topics: BTreeMap<u32, [Vec<u32>; 2]> = BTreeMap::new();
    for (side, entries) in [a, b].into_iter().enumerate() {
        for (at, entry) in entries.iter().enumerate() {
            topics.entry(entry.topic).or_default()[side].push(at as u32);
        }
    }
    let mut found = Matching::default();
    let by = Aligner { a, b, offset_ns };
    for [xs, ys] in topics.values() {
        let levels = match by.numbers_tell(xs, ys) {
            true => &LEVELS[..],
            false => &LEVELS_WITHOUT_NUMBERS,
        };
        by.align(xs, ys, levels, &mut found);
    }
    found.pairs.sort_unstable();
    found
}

/// By what messages are paired, one after the other.
#[derive(Clone, Copy, PartialEq)]
enum Level {
    /// All that is compared; and of the rest, [`Level::Data`].
    Content,
    /// What a message says, where no other on the topic says it.
    Data,
    /// The number that its publisher gave it, where no other has it.
    Sequence,
    /// When it was.
    Time,
    /// When it was, nearest to each other.
    Nearest,
}

const LEVELS: [Level; 4] = [Level::Content, Level::Sequence, Level::Time, Level::Nearest];

const LEVELS_WITHOUT_NUMBERS: [Level; 3] = [Level::Content, Level::Time, Level::Nearest];

/// The entries of two logs, and by how much later the second was recorded.
struct Aligner<'e> {
    a: &'e [Entry],
    b: &'e [Entry],
    offset_ns: i64,
}

impl Aligner<'_> {
    /// When a message of the first log is in the time of the second.
    fn shifted(&self, time_ns: u64) -> u64 {
        time_ns.saturating_add_signed(self.offset_ns)
    }

    /// Whether the numbers of messages tell which one is missing. A recorder that counts what it
    /// receives leaves no gap, whatever it misses, and begins at 0 or 1.
    fn numbers_tell(&self, xs: &[u32], ys: &[u32]) -> bool {
        [(self.a, xs), (self.b, ys)]
            .into_iter()
            .any(|(entries, places)| {
                let number = |at: &u32| entries[*at as usize].sequence;
                let starts_late = places.first().is_some_and(|first| number(first) > 1);
                let leaps = places
                    .windows(2)
                    .any(|two| number(&two[1]) > number(&two[0]).saturating_add(1));
                starts_late || leaps
            })
    }

    fn align(&self, xs: &[u32], ys: &[u32], levels: &[Level], found: &mut Matching) {
        let Some((level, further)) = levels.split_first() else {
            let both = xs.len().min(ys.len());
            let pairs = xs.iter().copied().zip(ys.iter().copied());
            found.pairs.extend(pairs);
            found.only_in_a.extend(&xs[both..]);
            found.only_in_b.extend(&ys[both..]);
            return;
        };
        // Most logs are the same from the start on.
        let same = |x: &u32, y: &u32| {
            self.offset_ns == 0 && self.a[*x as usize].content == self.b[*y as usize].content
        };
        let pairs = xs.iter().zip(ys);
        let start = pairs.take_while(|(x, y)| same(x, y)).count();
        let (front_x, xs) = xs.split_at(start);
        let (front_y, ys) = ys.split_at(start);
        let front = front_x.iter().copied().zip(front_y.iter().copied());
        found.pairs.extend(front);
        if xs.is_empty() || ys.is_empty() {
            found.only_in_a.extend(xs);
            found.only_in_b.extend(ys);
            return;
        }
        let pairs = match level {
            Level::Nearest => self.nearest(xs, ys),
            Level::Content => self.same(xs, ys),
            level => self.equal(xs, ys, *level),
        };
        for [xs, ys] in gaps(xs, ys, &pairs).values() {
            self.align(xs, ys, further, found);
        }
        found.pairs.extend(&pairs);
    }

    /// Pairs what is the same, and of the rest what says the same, wherever on the topic it is.
    fn same(&self, xs: &[u32], ys: &[u32]) -> Vec<(u32, u32)> {
        let mut pairs = self.equal(xs, ys, Level::Content);
        let mut paired: Vec<u32> = pairs.iter().map(|pair| pair.1).collect();
        paired.sort_unstable();
        let is_left = |x: &u32| pairs.binary_search_by_key(x, |pair| pair.0).is_err();
        let xs: Vec<u32> = xs.iter().copied().filter(is_left).collect();
        let ys = ys.iter().copied();
        let ys: Vec<u32> = ys.filter(|y| paired.binary_search(y).is_err()).collect();
        pairs.extend(self.equal(&xs, &ys, Level::Data));
        pairs.sort_unstable();
        pairs
    }

    /// Pairs the n-th of those that are equal at a level with the n-th; in the order of the first log.
    fn equal(&self, xs: &[u32], ys: &[u32], level: Level) -> Vec<(u32, u32)> {
        let key = |entry: &Entry, offset_ns: i64| {
            let time_ns = entry.time_ns.saturating_add_signed(offset_ns);
            match level {
                Level::Content if self.offset_ns == 0 => entry.content,
                Level::Content => {
                    let mut both = [0; 16];
                    both[..8].copy_from_slice(&entry.identity.to_le_bytes());
                    both[8..].copy_from_slice(&time_ns.to_le_bytes());
                    xxh3_64(&both)
                }
                Level::Data => entry.identity,
                Level::Sequence => entry.sequence.into(),
                Level::Time | Level::Nearest => time_ns,
            }
        };
        let sorted = |entries: &[Entry], places: &[u32], offset_ns| {
            let mut keys: Vec<(u64, u32)> = places
                .iter()
                .map(|at| (key(&entries[*at as usize], offset_ns), *at))
                .collect();
            keys.sort_unstable();
            keys
        };
        let (xs, ys) = (sorted(self.a, xs, self.offset_ns), sorted(self.b, ys, 0));
        let mut pairs = Vec::new();
        let mut rest = ys.as_slice();
        for group in xs.chunk_by(|one, other| one.0 == other.0) {
            let from = rest.partition_point(|other| other.0 < group[0].0);
            let to = rest.partition_point(|other| other.0 <= group[0].0);
            let others = &rest[from..to];
            let unique = group.len() == 1 && others.len() == 1;
            if unique || !matches!(level, Level::Data | Level::Sequence) {
                let both = group.iter().zip(others);
                pairs.extend(both.map(|(x, y)| (x.1, y.1)));
            }
            rest = &rest[to..];
        }
        pairs.sort_unstable();
        pairs
    }

    /// Pairs messages each of which is the nearest in time to the other: of one that the other log lacks
    /// the nearest has a nearer one.
    fn nearest(&self, xs: &[u32], ys: &[u32]) -> Vec<(u32, u32)> {
        let sorted = |places: &[u32], time: &dyn Fn(u32) -> u64| {
            let mut times: Vec<(u64, u32)> = places.iter().map(|at| (time(*at), *at)).collect();
            times.sort_unstable();
            times
        };
        let xs = sorted(xs, &|at| self.shifted(self.a[at as usize].time_ns));
        let ys = sorted(ys, &|at| self.b[at as usize].time_ns);
        let pairs = xs.iter().enumerate().filter_map(|(at, x)| {
            let other = nearest_to(x.0, &ys)?;
            let back = nearest_to(ys[other].0, &xs)?;
            (back == at).then_some((x.1, ys[other].1))
        });
        let mut pairs: Vec<(u32, u32)> = pairs.collect();
        pairs.sort_unstable();
        pairs
    }
}

/// The place of the nearest of times in order; of two the earlier.
pub(super) fn nearest_to(time: u64, times: &[(u64, u32)]) -> Option<usize> {
    let after = times.partition_point(|other| other.0 < time);
    let before = after.checked_sub(1);
    match (before, times.get(after)) {
        (Some(before), Some(next)) if next.0 - time < time - times[before].0 => Some(after),
        (Some(before), _) => {
            // The first of those at the same time.
            let time = times[before].0;
            Some(times.partition_point(|other| other.0 < time))
        }
        (None, Some(_)) => Some(after),
        (None, None) => None,
    }
}

/// What is not paired, by between which of the pairs that are in order it lies.
fn gaps(xs: &[u32], ys: &[u32], pairs: &[(u32, u32)]) -> BTreeMap<usize, [Vec<u32>; 2]> {
    let places: Vec<u32> = pairs.iter().map(|pair| pair.1).collect();
    let anchors: Vec<(u32, u32)> = increasing(&places)
        .into_iter()
        .map(|at| pairs[at])
        .collect();
    let mut paired = places;
    paired.sort_unstable();
    let rest_x = xs
        .iter()
        .filter(|x| pairs.binary_search_by_key(*x, |pair| pair.0).is_err());
    let rest_y = ys.iter().filter(|y| paired.binary_search(y).is_err());
    let mut gaps: BTreeMap<usize, [Vec<u32>; 2]> = BTreeMap::new();
    for x in rest_x {
        let gap = anchors.partition_point(|anchor| anchor.0 < *x);
        gaps.entry(gap).or_default()[0].push(*x);
    }
    for y in rest_y {
        let gap = anchors.partition_point(|anchor| anchor.1 < *y);
        gaps.entry(gap).or_default()[1].push(*y);
    }
    gaps
}

/// The places of a longest increasing subsequence.
fn increasing(values: &[u32]) -> Vec<usize> {
    let mut tails: Vec<usize> = Vec::new();
    let mut before: Vec<usize> = Vec::with_capacity(values.len());
    for (at, value) in values.iter().enumerate() {
        let length = tails.partition_point(|tail| values[*tail] < *value);
        before.push(if length == 0 { at } else { tails[length - 1] });
        match tails.get_mut(length) {
            Some(tail) => *tail = at,
            None => tails.push(at),
        }
    }
    let mut kept = Vec::with_capacity(tails.len());
    let mut next = tails.last().copied();
    while let Some(at) = next {
        kept.push(at);
        next = Some(before[at]).filter(|before| *before != at);
    }
    kept.reverse();
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(at: u32, data: u64, sequence: u32, time_ns: u64) -> Entry {
        Entry {
            identity: data,
            ordinal: at.into(),
            content: data ^ time_ns << 32,
            time_ns,
            count: at.into(),
            position: Default::default(),
            at,
            step: 0,
            tie: 0,
            source: 0,
            topic: 0,
            channel: 0,
            sequence,
            class: farside::record::RecordClass::Sample,
            has_place: false,
            said: Default::default(),
        }
    }

    /// Entries that all say something else than those of the other log.
    fn entries(side: u64, messages: &[(u32, u64)]) -> Vec<Entry> {
        let each = messages.iter().enumerate();
        each.map(|(at, (sequence, time))| {
            entry(at as u32, side << 20 | at as u64, *sequence, *time)
        })
        .collect()
    }

    fn counts(found: &Matching) -> (usize, usize, usize) {
        (
            found.pairs.len(),
            found.only_in_a.len(),
            found.only_in_b.len(),
        )
    }

    #[test]
    fn one_missing_message_is_one_missing_message() {
        // Ten a second, with jitter; the fourth is missing.
        let jitter = [3, -8, 5, 0, -2, 9, -4, 1, 6, -7];
        let a: Vec<(u32, u64)> = (0..10).map(|at| (0, 1000 + 100 * at)).collect();
        let b = a.iter().zip(jitter).enumerate();
        let b = b.filter(|(at, _)| *at != 3);
        let b: Vec<(u32, u64)> = b
            .map(|(_, ((number, time), jitter))| {
                (*number, time.saturating_add_signed(jitter + 5_000))
            })
            .collect();
        let found = aligned(&entries(1, &a), &entries(2, &b), 5_000);
        assert_eq!(counts(&found), (9, 1, 0));
        assert_eq!(found.only_in_a, [3]);
    }

    #[test]
    fn numbers_tell_which_message_is_missing_unless_a_recorder_counts() {
        let numbered = |numbers: &[u32]| -> Vec<(u32, u64)> {
            numbers.iter().map(|number| (*number, 7)).collect()
        };
        let (a, b) = (numbered(&[4, 5, 6, 7]), numbered(&[4, 6, 7]));
        let found = aligned(&entries(1, &a), &entries(2, &b), 0);
        assert_eq!((counts(&found), &found.only_in_a), ((3, 1, 0), &vec![1]));
        // Counted from 0 on: the times decide.
        let a = [(0, 100), (1, 200), (2, 300), (3, 400)];
        let b = [(0, 201), (1, 302), (2, 399)];
        let found = aligned(&entries(1, &a), &entries(2, &b), 0);
        assert_eq!((counts(&found), &found.only_in_a), ((3, 1, 0), &vec![0]));
    }

    #[test]
    fn what_says_the_same_is_paired_wherever_it_is() {
        let a: Vec<Entry> = (0..6)
            .map(|at| entry(at, at.into(), 0, u64::from(at) * 10))
            .collect();
        let order = [0, 1, 4, 2, 3, 5];
        let each = order.iter().zip(0..);
        let b: Vec<Entry> = each
            .map(|(data, at)| entry(at, *data, 0, u64::from(at) * 10))
            .collect();
        let found = aligned(&a, &b, 0);
        assert_eq!(counts(&found), (6, 0, 0));
        let to: Vec<u32> = found.pairs.iter().map(|pair| pair.1).collect();
        assert_eq!(to, [0, 1, 3, 4, 2, 5]);
    }

    #[test]
    fn the_longest_increasing_part_is_found() {
        assert_eq!(increasing(&[2, 3, 4, 1]), [0, 1, 2]);
        assert_eq!(increasing(&[5, 1, 6, 2, 3]), [1, 3, 4]);
        assert_eq!(increasing(&[]), [0; 0]);
    }
}
