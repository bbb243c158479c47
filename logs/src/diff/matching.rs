//! Pairing the records of two logs by identity, and finding those out of order.

use std::collections::BTreeMap;

use super::entry::Entry;

/// Which of the entries of two logs are the same records.
#[derive(Default)]
pub(super) struct Matching {
    /// Records that both have, as places among the entries.
    pub(super) pairs: Vec<(u32, u32)>,
    pub(super) only_in_a: Vec<u32>,
    pub(super) only_in_b: Vec<u32>,
}

fn by_identity(entries: &[Entry]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..entries.len() as u32).collect();
    order.sort_unstable_by_key(|at| {
        let entry = &entries[*at as usize];
        (entry.identity, entry.ordinal, *at)
    });
    order
}

/// Pairs the n-th record of each identity in one log with the n-th in the other.
pub(super) fn matching(a: &[Entry], b: &[Entry]) -> Matching {
    let (order_a, order_b) = (by_identity(a), by_identity(b));
    let identity_a = |at: usize| a[order_a[at] as usize].identity;
    let identity_b = |at: usize| b[order_b[at] as usize].identity;
    let mut found = Matching::default();
    let (mut i, mut j) = (0, 0);
    while i < order_a.len() && j < order_b.len() {
        match identity_a(i).cmp(&identity_b(j)) {
            std::cmp::Ordering::Less => {
                found.only_in_a.push(order_a[i]);
                i += 1;
            }
            std::cmp::Ordering::Greater => {
                found.only_in_b.push(order_b[j]);
                j += 1;
            }
            std::cmp::Ordering::Equal => {
                found.pairs.push((order_a[i], order_b[j]));
                i += 1;
                j += 1;
            }
        }
    }
    found.only_in_a.extend(&order_a[i..]);
    found.only_in_b.extend(&order_b[j..]);
    found.pairs.sort_unstable();
    found
}

/// Pairs the messages of each topic: what is the same in both, and between these what says the
/// same, what was at the same time, and at last by place. So a message that one log lacks is one
/// message, and not the difference of all that follow it.
pub(super) fn aligned(a: &[Entry], b: &[Entry]) -> Matching {
    let mut topics: BTreeMap<u32, [Vec<u32>; 2]> = BTreeMap::new();
    for (side, entries) in [a, b].into_iter().enumerate() {
        for (at, entry) in entries.iter().enumerate() {
            topics.entry(entry.topic).or_default()[side].push(at as u32);
        }
    }
    let mut found = Matching::default();
    for [xs, ys] in topics.values() {
        align((a, xs), (b, ys), &LEVELS, &mut found);
    }
    found.pairs.sort_unstable();
    found
}

/// By what messages are paired, one after the other.
#[derive(Clone, Copy)]
enum Level {
    /// All that is compared.
    Content,
    /// What a message says, where no other on the topic says it.
    Data,
    /// When it was.
    Time,
}

const LEVELS: [Level; 3] = [Level::Content, Level::Data, Level::Time];

fn align(
    (a, xs): (&[Entry], &[u32]),
    (b, ys): (&[Entry], &[u32]),
    levels: &[Level],
    found: &mut Matching,
) {
    let Some((level, further)) = levels.split_first() else {
        found
            .pairs
            .extend(xs.iter().copied().zip(ys.iter().copied()));
        let both = xs.len().min(ys.len());
        found.only_in_a.extend(&xs[both..]);
        found.only_in_b.extend(&ys[both..]);
        return;
    };
    if xs.is_empty() || ys.is_empty() {
        found.only_in_a.extend(xs);
        found.only_in_b.extend(ys);
        return;
    }
    // Most logs are the same from the start on.
    let same = |x: &u32, y: &u32| a[*x as usize].content == b[*y as usize].content;
    let start = xs.iter().zip(ys).take_while(|(x, y)| same(x, y)).count();
    found
        .pairs
        .extend(xs[..start].iter().copied().zip(ys[..start].iter().copied()));
    let (xs, ys) = (&xs[start..], &ys[start..]);
    if xs.is_empty() || ys.is_empty() {
        found.only_in_a.extend(xs);
        found.only_in_b.extend(ys);
        return;
    }
    let pairs = equal((a, xs), (b, ys), *level);
    let places: Vec<u32> = pairs.iter().map(|pair| pair.1).collect();
    let kept = increasing(&places);
    let anchors: Vec<(u32, u32)> = kept.into_iter().map(|at| pairs[at]).collect();
    let mut paired: Vec<u32> = pairs.iter().map(|pair| pair.1).collect();
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
    found.pairs.extend(&pairs);
    for [xs, ys] in gaps.values() {
        align((a, xs), (b, ys), further, found);
    }
}

/// Pairs the n-th of those that are equal at a level with the n-th; in the order of the first log.
fn equal(
    (a, xs): (&[Entry], &[u32]),
    (b, ys): (&[Entry], &[u32]),
    level: Level,
) -> Vec<(u32, u32)> {
    let key = |entry: &Entry| match level {
        Level::Content => entry.content,
        Level::Data => entry.identity,
        Level::Time => entry.time_ns,
    };
    let sorted = |entries: &[Entry], places: &[u32]| {
        let mut keys: Vec<(u64, u32)> = places
            .iter()
            .map(|at| (key(&entries[*at as usize]), *at))
            .collect();
        keys.sort_unstable();
        keys
    };
    let (xs, ys) = (sorted(a, xs), sorted(b, ys));
    let mut pairs = Vec::new();
    let mut rest = ys.as_slice();
    for group in xs.chunk_by(|one, other| one.0 == other.0) {
        let from = rest.partition_point(|other| other.0 < group[0].0);
        let to = rest.partition_point(|other| other.0 <= group[0].0);
        let others = &rest[from..to];
        let unique = group.len() == 1 && others.len() == 1;
        if unique || !matches!(level, Level::Data) {
            let both = group.iter().zip(others);
            pairs.extend(both.map(|(x, y)| (x.1, y.1)));
        }
        rest = &rest[to..];
    }
    pairs.sort_unstable();
    pairs
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

/// Records in the order of one log, given by their places in the other: how many would have to
/// move.
#[derive(Default)]
pub(super) struct Sequence {
    /// The longest increasing subsequence, by its best last element for each length.
    tails: Vec<u32>,
    count: u64,
    last: u32,
}

impl Sequence {
    /// Adds the next one; true if it comes too early in the other log.
    pub(super) fn add(&mut self, place: u32) -> bool {
        let at = self.tails.partition_point(|tail| *tail < place);
        match self.tails.get_mut(at) {
            Some(tail) => *tail = place,
            None => self.tails.push(place),
        }
        let early = self.count > 0 && self.last > place;
        self.count += 1;
        self.last = place;
        early
    }

    /// How many would have to move.
    pub(super) fn out_of_order(&self) -> u64 {
        self.count - self.tails.len() as u64
    }

    /// How many bytes it holds.
    pub(super) fn held_bytes(&self) -> usize {
        4 * self.tails.len()
    }
}

#[cfg(test)]
mod tests {
    use super::{Sequence, increasing};

    /// How many are out of order, and the first of them.
    fn out_of_order(places: &[u32]) -> (u64, Option<usize>) {
        let mut sequence = Sequence::default();
        let early: Vec<bool> = places.iter().map(|place| sequence.add(*place)).collect();
        (
            sequence.out_of_order(),
            early.iter().position(|early| *early),
        )
    }

    #[test]
    fn as_few_as_possible_are_out_of_order() {
        assert_eq!(out_of_order(&[]), (0, None));
        assert_eq!(out_of_order(&[1, 2, 3]), (0, None));
        assert_eq!(out_of_order(&[2, 3, 4, 1]), (1, Some(3)));
        assert_eq!(out_of_order(&[3, 2, 1]), (2, Some(1)));
        assert_eq!(increasing(&[2, 3, 4, 1]), [0, 1, 2]);
        assert_eq!(increasing(&[5, 1, 6, 2, 3]), [1, 3, 4]);
        assert_eq!(increasing(&[]), [0; 0]);
    }
}
