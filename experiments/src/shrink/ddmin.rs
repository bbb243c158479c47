//! Delta debugging: the least of a list of things with which something still happens.
//!
//! After Zeller and Hildebrandt, *Simplifying and isolating failure-inducing input*, IEEE Transactions on
//! Software Engineering 28(2), 2002 (the algorithm `ddmin`): parts are left out, first halves, then quarters
//! and so on down to single things; what is left is 1-minimal: without any single one it does not happen.
//! Two departures. Only complements are asked about, not parts alone, which are seldom enough once there are
//! more than two. And after a part was left out the next one is asked about, not the first again, so that
//! each round goes through the list once; the last round goes round until all single ones were in vain since
//! the last success.

/// Knows whether it happens with a part of the things, and keeps what is found.
///
/// Candidates are many, and most of them need never be made: they are asked for by number.
pub(super) trait Oracle {
    /// Why no answer comes.
    type Halt;

    /// The first of `count` candidates with which it happens; `candidate` gives what each keeps, in order.
    fn first(
        &mut self,
        count: usize,
        candidate: &(dyn Fn(usize) -> Vec<u32> + Sync),
    ) -> Result<Option<usize>, Self::Halt>;

    /// Goes on with the candidate that was found, and says what is left of it: all that it keeps, or less.
    fn accept(&mut self, found: Vec<u32>) -> Result<Vec<u32>, Self::Halt>;
}

/// Leaves out what can be left out of `units`, each a set of things that go together.
pub(super) fn reduce<O: Oracle>(units: Vec<Vec<u32>>, oracle: &mut O) -> Result<(), O::Halt> {
    let mut units: Vec<Vec<u32>> = units.into_iter().filter(|unit| !unit.is_empty()).collect();
    if units.is_empty() {
        return Ok(());
    }
    if oracle.first(1, &|_| Vec::new())?.is_some() {
        oracle.accept(Vec::new())?;
        return Ok(());
    }
    let mut parts = 2;
    while units.len() > 1 {
        parts = parts.min(units.len());
        // The part that is asked about first.
        let mut at = 0;
        while units.len() > 1 {
            let bounds = |number: usize| {
                let number = number % parts;
                let (from, to) = (number * units.len(), (number + 1) * units.len());
                (from / parts, to / parts)
            };
            let without = |number: usize| {
                let (from, to) = bounds(at + number);
                let mut kept = [&units[..from], &units[to..]].concat().concat();
                kept.sort_unstable();
                kept
            };
            let Some(found) = oracle.first(parts, &without)? else {
                break;
            };
            let mut kept = oracle.accept(without(found))?;
            kept.sort_unstable();
            let (from, to) = bounds(at + found);
            units.drain(from..to);
            for unit in &mut units {
                unit.retain(|thing| kept.binary_search(thing).is_ok());
            }
            units.retain(|unit| !unit.is_empty());
            // The part behind the one that is gone has its number now.
            at = (at + found) % parts;
            parts = (parts - 1).max(2).min(units.len().max(1));
            at %= parts;
        }
        if parts >= units.len() {
            return Ok(());
        }
        parts *= 2;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// An oracle that knows, and counts what it is asked.
    struct Known<F> {
        happens: F,
        asked: usize,
        kept: Vec<u32>,
    }

    impl<F: Fn(&[u32]) -> bool> Oracle for Known<F> {
        type Halt = std::convert::Infallible;

        fn first(
            &mut self,
            count: usize,
            candidate: &(dyn Fn(usize) -> Vec<u32> + Sync),
        ) -> Result<Option<usize>, Self::Halt> {
            let found = (0..count).find(|number| (self.happens)(&candidate(*number)));
            self.asked += found.map_or(count, |found| found + 1);
            Ok(found)
        }

        fn accept(&mut self, found: Vec<u32>) -> Result<Vec<u32>, Self::Halt> {
            self.kept = found;
            Ok(self.kept.clone())
        }
    }

    /// What is left of 0, 1, ... below `count`, and how many questions it took.
    fn reduced(count: u32, happens: impl Fn(&[u32]) -> bool) -> (Vec<u32>, usize) {
        let kept: Vec<u32> = (0..count).collect();
        let units = kept.iter().map(|thing| vec![*thing]).collect();
        let asked = 0;
        let mut oracle = Known {
            happens,
            asked,
            kept,
        };
        reduce(units, &mut oracle).unwrap_or_else(|never| match never {});
        (oracle.kept, oracle.asked)
    }

    fn without(kept: &[u32], thing: u32) -> Vec<u32> {
        kept.iter().copied().filter(|one| *one != thing).collect()
    }

    #[test]
    fn few_of_many_are_found_in_few_questions() {
        let needed = [17, 18, 900];
        let (kept, asked) = reduced(1000, |all| needed.iter().all(|one| all.contains(one)));
        assert_eq!(kept, needed);
        assert!(asked < 150, "{asked}");
        assert_eq!(reduced(50, |_| true), (vec![], 1));
        let (kept, asked) = reduced(64, |all| all.len() == 64);
        assert_eq!((kept.len(), asked < 2 * 64 + 10), (64, true));
    }

    proptest! {
        /// Whatever more of the same does not undo: what is left is exactly one of the least sets.
        #[test]
        fn what_is_left_of_a_monotone_predicate_is_needed(
            count in 1_u32..60,
            sets in prop::collection::vec(prop::collection::btree_set(0_u32..60, 0..6), 1..4),
        ) {
            let sets: Vec<Vec<u32>> = sets
                .into_iter()
                .map(|set| set.into_iter().map(|thing| thing % count).collect())
                .collect();
            let happens = |all: &[u32]| {
                sets.iter().any(|set| set.iter().all(|thing| all.contains(thing)))
            };
            let (kept, _) = reduced(count, happens);
            prop_assert!(happens(&kept));
            for thing in &kept {
                prop_assert!(!happens(&without(&kept, *thing)), "{thing} of {kept:?} is not needed");
            }
        }

        /// Whatever it depends on: it happens with what is left, and not without any single one of it.
        #[test]
        fn what_is_left_of_any_predicate_is_1_minimal(count in 1_u32..24, salt in any::<u64>()) {
            let all = count;
            let happens = |things: &[u32]| {
                let bits = things.iter().fold(0_u64, |bits, thing| bits | 1 << thing);
                let key = farside::random::RandomKey::new(salt).number(bits);
                things.len() as u32 == all || key.uniform() < 0.3
            };
            let (kept, _) = reduced(count, happens);
            prop_assert!(happens(&kept));
            for thing in &kept {
                prop_assert!(!happens(&without(&kept, *thing)), "{thing} of {kept:?}");
            }
        }
    }
}
