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

/// The places of entries, in the order of their keys.
fn sorted(entries: &[Entry], key: impl Fn(&Entry) -> u64) -> Vec<(u64, u64, u32)> {
    let places = (0..).zip(entries);
    let keys = places.map(|(at, entry)| (key(entry), entry.ordinal, at));
    let mut order: Vec<(u64, u64, u32)> = keys.collect();
    order.sort_unstable();
    order
}

/// Pairs records of the same key: by what `pair` makes of the places of all that have it in both logs.
fn by_key(
    (a, b): (&[Entry], &[Entry]),
    (key_a, key_b): (impl Fn(&Entry) -> u64, impl Fn(&Entry) -> u64),
    pair: impl Fn(&mut Vec<(u32, u32)>, &[(u64, u64, u32)], &[(u64, u64, u32)]),
) -> Matching {
    let (order_a, order_b) = (sorted(a, key_a), sorted(b, key_b));
    let mut found = Matching::default();
    let mut rest = order_b.as_slice();
    for group in order_a.chunk_by(|one, other| one.0 == other.0) {
        let from = rest.partition_point(|other| other.0 < group[0].0);
        let to = from + rest[from..].partition_point(|other| other.0 == group[0].0);
        pair(&mut found.pairs, group, &rest[from..to]);
        rest = &rest[to..];
    }
    found.pairs.sort_unstable();
    let mut paired = [vec![false; a.len()], vec![false; b.len()]];
    for (x, y) in &found.pairs {
        paired[0][*x as usize] = true;
        paired[1][*y as usize] = true;
    }
    let left = |side: usize| {
        let places = (0..).zip(&paired[side]);
        places.filter(|(_, paired)| !**paired).map(|(at, _)| at)
    };
    found.only_in_a = left(0).collect();
    found.only_in_b = left(1).collect();
    found
}

/// The n-th with the n-th.
fn in_turn(pairs: &mut Vec<(u32, u32)>, a: &[(u64, u64, u32)], b: &[(u64, u64, u32)]) {
    pairs.extend(a.iter().zip(b).map(|(x, y)| (x.2, y.2)));
}

/// Pairs the n-th record of each identity in one log with the n-th in the other. Of records that have but a
/// place in a flow those are the same that say the same, sent at the same time, whatever their places.
pub(super) fn matching(a: &[Entry], b: &[Entry]) -> Matching {
    by_key(
        (a, b),
        (Entry::said_key, Entry::said_key),
        |pairs, xs, ys| {
            let by_place = xs.first().is_some_and(|x| a[x.2 as usize].has_place);
            if !by_place || xs.len().min(ys.len()) < 2 && xs.len().max(ys.len()) < 2 {
                return in_turn(pairs, xs, ys);
            }
            // The same said twice at one time: those that have the same place first.
            let places = |others: &[(u64, u64, u32)], place: u64| {
                others.binary_search_by_key(&place, |other| other.1).is_ok()
            };
            let split = |all: &[(u64, u64, u32)], others: &[(u64, u64, u32)]| {
                let (same, rest): (Vec<_>, Vec<_>) =
                    all.iter().copied().partition(|one| places(others, one.1));
                [same, rest]
            };
            for (xs, ys) in split(xs, ys).iter().zip(&split(ys, xs)) {
                in_turn(pairs, xs, ys);
            }
        },
    )
}

/// Pairs what is left of records that have but a place in a flow: by their places, as they would be without
/// what only one of the logs has before them.
pub(super) fn by_place(a: &[Entry], b: &[Entry], shifts: &Shifts) -> Matching {
    let place_a = |entry: &Entry| entry.place_key(entry.ordinal);
    let place_b = |entry: &Entry| entry.place_key(shifts.place_in_a(entry));
    by_key((a, b), (place_a, place_b), in_turn)
}

/// By how much the places in flows of the second log are those of the first, from a place on.
pub(super) struct Shifts {
    /// By flow: from which place in the second log on, and by how much.
    flows: BTreeMap<u64, Vec<(u64, i64)>>,
    count: usize,
    /// So many places are remembered.
    most: usize,
    /// How many more there were.
    pub(super) forgotten: u64,
}

impl Shifts {
    /// A memory of so many places.
    pub(super) fn new(most: usize) -> Shifts {
        Shifts {
            flows: BTreeMap::new(),
            count: 0,
            most,
            forgotten: 0,
        }
    }

    /// Notes two records that are the same.
    pub(super) fn add(&mut self, a: &Entry, b: &Entry) {
        if !a.has_place || a.ordinal == b.ordinal {
            return;
        }
        if self.count >= self.most {
            self.forgotten += 1;
            return;
        }
        let shift = b.ordinal.wrapping_sub(a.ordinal).cast_signed();
        self.flows
            .entry(b.identity)
            .or_default()
            .push((b.ordinal, shift));
        self.count += 1;
    }

    /// Brings them in order, once there are all.
    pub(super) fn sort(&mut self) {
        for flow in self.flows.values_mut() {
            flow.sort_unstable();
            flow.dedup_by_key(|(_, shift)| *shift);
        }
    }

    /// The place in the first log of a record of the second.
    pub(super) fn place_in_a(&self, b: &Entry) -> u64 {
        let Some(flow) = self.flows.get(&b.identity) else {
            return b.ordinal;
        };
        let behind = flow.partition_point(|(from, _)| *from <= b.ordinal);
        let shift = behind.checked_sub(1).map_or(0, |at| flow[at].1);
        b.ordinal.wrapping_sub(shift.cast_unsigned())
    }
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
    use super::Sequence;

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
    }
}
