//! Small sets of uses that cannot all be in force at once.

use std::cmp::Reverse;

use super::OverUse;

/// Minimal critical sets of an over-use: contributors that together break the limit and of which
/// any that is taken away mends it. To keep one use of each such set out of the others' way is how
/// a planner that posts precedences resolves it (P. Laborie and M. Ghallab, *Planning with Sharable
/// Resource Constraints*, 1995; A. Cesta, A. Oddi and S. Smith, *A Constraint-Based Method for
/// Project Scheduling with Time Windows*, 2002).
///
/// Each is a list of places in [`OverUse::contributors`], the largest amounts first. At most `most`
/// are given, the same ones for the same over-use. Are there more, each contributor gives a share
/// of which it is the largest, and of those the ones with the largest amounts come first.
///
/// For contributors at one tick of a renewable or rate-limited resource. All of an exact over-use
/// are in force at once in one schedule; of others some may be known to follow each other.
///
/// ```
/// use farside_planning::profile::{Profile, Use, critical_sets};
/// use farside_planning::temporal::Span;
/// let mut crew = Profile::new(4, Span::at_least(0));
/// for amount in [3, 2, 2, 1] {
///     crew.add(Use::renewable(Span::new(0, 9), Span::new(5, 14), Span::exactly(amount)), amount)?;
/// }
/// let over_use = crew.first_over_use(0).unwrap();
/// assert_eq!(critical_sets(&over_use, 10), [vec![0, 1], vec![0, 2], vec![1, 2, 3]]);
/// # Ok::<(), farside_planning::profile::UseError>(())
/// ```
pub fn critical_sets<O>(over_use: &OverUse<O>, most: usize) -> Vec<Vec<usize>> {
    let contributors = &over_use.contributors;
    let mut places: Vec<usize> = (0..contributors.len()).collect();
    places.sort_by_key(|&place| (Reverse(contributors[place].amount), place));
    let amounts: Vec<i64> = places
        .iter()
        .map(|&place| contributors[place].amount)
        .collect();
    let sum: i64 = amounts.iter().sum();
    let room = sum - over_use.amount;
    if room < 0 {
        // Without any of them the limit is broken too.
        return Vec::new();
    }
    let mut rest = amounts.clone();
    for at in (1..rest.len()).rev() {
        rest[at - 1] += rest[at];
    }
    let mut search = Search {
        amounts,
        rest,
        room,
        set: Vec::new(),
        found: Vec::new(),
    };
    let mut share = most.div_ceil(places.len().max(1));
    loop {
        let mut is_cut = false;
        search.found.clear();
        for first in 0..places.len() {
            let end = most.min(search.found.len().saturating_add(share));
            is_cut |= !search.gather(first, end);
        }
        // Some have more than their share, and others less.
        if !is_cut || search.found.len() == most {
            break;
        }
        share *= 2;
    }
    let in_places = |set: Vec<usize>| set.into_iter().map(|at| places[at]).collect();
    search.found.into_iter().map(in_places).collect()
}

/// A search through sets in the order of falling amounts: one that is too much only with its last
/// and least member is minimal.
struct Search {
    amounts: Vec<i64>,
    /// What the amounts from a place on add up to.
    rest: Vec<i64>,
    /// How much more than the set can be taken.
    room: i64,
    set: Vec<usize>,
    found: Vec<Vec<usize>>,
}

impl Search {
    /// Finds sets of which `first` is the largest, until there are `most` of all; whether there
    /// are no more.
    fn gather(&mut self, first: usize, most: usize) -> bool {
        let mut at = first;
        while self.found.len() < most {
            // With all from here on there is a set; otherwise with none of them.
            if self.rest.get(at).is_some_and(|rest| *rest > self.room) {
                self.set.push(at);
                if self.amounts[at] > self.room {
                    self.found.push(self.set.clone());
                    self.set.pop();
                } else {
                    self.room -= self.amounts[at];
                }
                at += 1;
            } else {
                at = self.leave() + 1;
            }
            if self.set.is_empty() {
                return true;
            }
        }
        while !self.set.is_empty() {
            self.leave();
        }
        false
    }

    /// Takes the last one out of the set.
    fn leave(&mut self) -> usize {
        let Some(last) = self.set.pop() else {
            return self.amounts.len();
        };
        self.room += self.amounts[last];
        last
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;
    use crate::profile::{Profile, Use};
    use crate::temporal::Span;

    fn over_use(amounts: &[i64], capacity: i64) -> Option<OverUse<()>> {
        let mut profile = Profile::new(capacity, Span::at_least(0));
        for amount in amounts {
            let times = [Span::exactly(0), Span::exactly(9)];
            let one = Use::renewable(times[0], times[1], Span::exactly(*amount));
            profile.add(one, ()).unwrap();
        }
        profile.first_over_use(0)
    }

    proptest! {
        /// They are the sets that are too much, and with any member less are not: all of them, or
        /// as many as were asked for.
        #[test]
        fn critical_sets_are_all_minimal_sets(
            amounts in prop::collection::vec(1..8i64, 1..10),
            capacity in 0..20i64,
            most in 0..12usize,
        ) {
            let Some(over_use) = over_use(&amounts, capacity) else { return Ok(()) };
            let sum = |set: &BTreeSet<usize>| -> i64 { set.iter().map(|at| amounts[*at]).sum() };
            let subsets = (1..1u32 << amounts.len()).map(|bits| {
                (0..amounts.len()).filter(|at| bits >> at & 1 == 1).collect::<BTreeSet<usize>>()
            });
            let is_critical = |set: &BTreeSet<usize>| {
                let least = set.iter().map(|at| amounts[*at]).min().unwrap_or(0);
                sum(set) > capacity && sum(set) - least <= capacity
            };
            let expected: BTreeSet<BTreeSet<usize>> = subsets.filter(is_critical).collect();
            let found = critical_sets(&over_use, most);
            let distinct: BTreeSet<BTreeSet<usize>> =
                found.iter().map(|set| set.iter().copied().collect()).collect();
            prop_assert_eq!(distinct.len(), found.len());
            prop_assert!(distinct.is_subset(&expected));
            let all = critical_sets(&over_use, 1 << amounts.len());
            prop_assert_eq!(all.len(), expected.len());
            prop_assert_eq!(found.len(), most.min(expected.len()));
        }
    }

    /// A thousand uses of one: each set has hundreds of members, and few are asked for.
    #[test]
    fn large_sets_are_found_without_a_search_through_all() {
        let over_use = over_use(&[1; 1_000], 500).unwrap();
        let found = critical_sets(&over_use, 100);
        assert!(!found.is_empty() && found.len() <= 100);
        assert!(found.iter().all(|set| set.len() == 501));
    }

    #[test]
    fn what_is_broken_without_uses_has_no_critical_set() {
        let mut profile = Profile::new(-2, Span::at_least(0));
        let one = Use::consumption(Span::exactly(0), Span::exactly(1));
        profile.add(one, ()).unwrap();
        assert!(critical_sets(&profile.first_over_use(0).unwrap(), 9).is_empty());
    }
}
