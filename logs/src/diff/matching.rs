//! Pairing the records of two logs by identity, and finding those out of order.

use super::index::{Entry, Index};

/// Which records of two logs are the same ones.
#[derive(Default)]
pub(super) struct Matching {
    /// Records that both have, as places in the two logs.
    pub(super) pairs: Vec<(u32, u32)>,
    pub(super) only_in_a: Vec<u32>,
    pub(super) only_in_b: Vec<u32>,
}

fn by_identity(entries: &[Entry]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..entries.len() as u32).collect();
    order.retain(|at| !entries[*at as usize].ignored);
    order.sort_unstable_by_key(|at| {
        let entry = &entries[*at as usize];
        (entry.identity, entry.ordinal, *at)
    });
    order
}

/// Pairs the n-th record of each identity in one log with the n-th in the other.
pub(super) fn matching(a: &Index, b: &Index) -> Matching {
    let (order_a, order_b) = (by_identity(&a.entries), by_identity(&b.entries));
    let identity_a = |at: usize| a.entries[order_a[at] as usize].identity;
    let identity_b = |at: usize| b.entries[order_b[at] as usize].identity;
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

/// Of records in the order of one log, given by their places in the other: how many would have to
/// move, and the first that comes too early there.
pub(super) fn out_of_order(places: &[u32]) -> (u64, Option<usize>) {
    // The longest increasing subsequence, by its best last element for each length.
    let mut tails: Vec<u32> = Vec::new();
    for place in places {
        let at = tails.partition_point(|tail| tail < place);
        match tails.get_mut(at) {
            Some(tail) => *tail = *place,
            None => tails.push(*place),
        }
    }
    let first = places.windows(2).position(|two| two[0] > two[1]);
    ((places.len() - tails.len()) as u64, first.map(|at| at + 1))
}

#[cfg(test)]
mod tests {
    use super::out_of_order;

    #[test]
    fn as_few_as_possible_are_out_of_order() {
        assert_eq!(out_of_order(&[]), (0, None));
        assert_eq!(out_of_order(&[1, 2, 3]), (0, None));
        assert_eq!(out_of_order(&[2, 3, 4, 1]), (1, Some(3)));
        assert_eq!(out_of_order(&[3, 2, 1]), (2, Some(1)));
    }
}
