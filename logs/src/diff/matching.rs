//! Pairing the records of two logs by identity, and finding those out of order.

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
