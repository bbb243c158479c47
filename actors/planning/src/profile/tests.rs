//! Profiles beside brute force: over all schedules of small networks, and after every edit.

mod edits;
mod schedules;
mod work;

use super::*;

/// From a tick to another one, so many units.
fn fixed(start: Ticks, end: Ticks, amount: i64) -> Use {
    Use::renewable(
        Span::exactly(start),
        Span::exactly(end),
        Span::exactly(amount),
    )
}

/// A use that ends when another one begins is no over-use, whichever came first; that both are in
/// force for a tick is one.
#[test]
fn a_use_may_begin_when_another_one_ends() {
    for uses in [[(0, 10), (10, 20)], [(10, 20), (0, 10)]] {
        let mut profile = Profile::new(1, Span::at_least(0));
        let [first, _] = uses.map(|(start, end)| profile.add(fixed(start, end, 1), ()).unwrap());
        assert_eq!(profile.first_over_use(0), None);
        let (start, end) = uses[0];
        let longer = fixed(start - 1, end + 1, 1);
        profile.update(first, longer).unwrap();
        let ticks = profile.first_over_use(0).map(|found| found.during);
        let overlap = if start == 0 { 10 } else { 9 };
        assert_eq!(ticks, Some(Span::exactly(overlap)));
    }
}

/// What begins when another one ends at the latest may still be too early.
#[test]
fn a_meeting_within_spans_is_only_certain_with_an_order() {
    let mut profile = Profile::new(1, Span::at_least(0));
    let one = |from: Ticks| {
        let [start, end] = [from, from + 5].map(|time| Span::new(time, time + 5));
        Use::renewable(start, end, Span::exactly(1))
    };
    profile.add(one(0), 0).unwrap();
    profile.add(one(5), 1).unwrap();
    let over_use = profile.first_over_use(0).unwrap();
    assert_eq!(
        (over_use.during, over_use.is_certain),
        (Span::new(5, 9), false)
    );
    let mut exact = Exact::new();
    assert_eq!(
        exact.first_over_use(&profile, 0, &mut Independent),
        Some(over_use)
    );
    // The first one ends when the second one starts, or before.
    let mut order = |a: Moment<'_, i32>, b: Moment<'_, i32>| {
        (*a.owner, a.is_end, *b.owner, b.is_end) == (0, true, 1, false)
    };
    assert_eq!(exact.first_over_use(&profile, 0, &mut order), None);
    assert!(exact.work().levels > 0);
}

/// Where the first interval that looks like an over-use is none, a later one is found, with what an
/// order makes certain.
#[test]
fn an_order_may_clear_a_first_over_use_and_not_a_later_one() {
    let mut profile = Profile::new(1, Span::at_least(0));
    let one = |from: Ticks| {
        let [start, end] = [from, from + 5].map(|time| Span::new(time, time + 5));
        Use::renewable(start, end, Span::exactly(1))
    };
    for (owner, from) in [(0, 0), (1, 5), (2, 100), (3, 103)] {
        profile.add(one(from), owner).unwrap();
    }
    // The second one starts when the first one ends, and the last one with the third one.
    let mut order = |a: Moment<'_, i32>, b: Moment<'_, i32>| match (*a.owner, *b.owner) {
        (0, 1) => a.is_end && !b.is_end,
        (2, 3) | (3, 2) => a.is_end == b.is_end,
        _ => false,
    };
    let over_use = Exact::new()
        .first_over_use(&profile, 0, &mut order)
        .unwrap();
    assert_eq!(over_use.during, Span::new(103, 109));
    let owners: Vec<_> = over_use.contributors.iter().map(|one| one.owner).collect();
    assert_eq!(owners, [2, 3]);
}

#[test]
fn what_is_taken_from_a_rate_limited_resource_counts_for_its_window() {
    let mut starts = Profile::new(2, Span::at_least(0));
    for tick in [0, 40, 100] {
        let one = Use::rate_limited(Span::exactly(tick), 100, Span::exactly(1));
        starts.add(one, tick).unwrap();
    }
    // At 100 the first one counts no more.
    assert_eq!(starts.first_over_use(0), None);
    let one = Use::rate_limited(Span::exactly(139), 100, Span::exactly(1));
    starts.add(one, 139).unwrap();
    let over_use = starts.first_over_use(0).unwrap();
    assert_eq!((over_use.during, over_use.amount), (Span::exactly(139), 1));
    assert!(over_use.is_certain);
}

/// Consumed for good, until something is produced; too much of it is one too.
#[test]
fn a_depletable_resource_is_limited_on_both_sides() {
    let mut memory = Profile::new(10, Span::new(0, 20));
    let picture = memory
        .add(
            Use::consumption(Span::exactly(5), Span::new(8, 12)),
            "picture",
        )
        .unwrap();
    let over_use = memory.first_over_use(0).unwrap();
    assert_eq!((over_use.bound, over_use.amount), (Bound::Least, 2));
    assert_eq!(over_use.during, Span::at_least(5));
    assert!(!over_use.is_certain);
    let downlink = Use::production(Span::new(6, 8), Span::exactly(15));
    memory.add(downlink, "downlink").unwrap();
    // Until the downlink has happened at the latest.
    let over_use = memory.first_over_use(0).unwrap();
    assert_eq!(
        (over_use.bound, over_use.during),
        (Bound::Least, Span::new(5, 7))
    );
    assert_eq!(memory.level(8), Span::new(13, 17));
    memory.remove(picture);
    let over_use = memory.first_over_use(0).unwrap();
    assert_eq!((over_use.bound, over_use.amount), (Bound::Most, 5));
    assert_eq!(over_use.contributors[0].owner, "downlink");
}

#[test]
fn what_makes_no_sense_is_refused_and_changes_nothing() {
    let mut profile = Profile::new(0, Span::ALL);
    let one = profile.add(fixed(0, 5, 1), ()).unwrap();
    let refused = [
        (
            Use::consumption(Span::new(5, 4), Span::exactly(1)),
            "[5 4] holds no value",
        ),
        (
            Use::consumption(Span::exactly(5), Span::new(2, 1)),
            "[-1 -2] holds no value",
        ),
        (
            fixed(5, 4, 1),
            "it starts within [5 5] and ends within [4 4]",
        ),
        (
            Use::production(Span::ALL, Span::at_least(0)),
            "the amounts add up to",
        ),
        (
            Use::consumption(Span::ALL, Span::ALL),
            "the amounts add up to",
        ),
        (
            Use::production(Span::ALL, Span::exactly(i64::MIN)),
            "the amounts add up to",
        ),
    ];
    for (bad, says) in refused {
        let error = profile.add(bad, ()).unwrap_err().to_string();
        assert!(error.starts_with(says) || error.contains(says), "{error}");
        assert!(profile.update(one, bad).is_err());
        assert_eq!(
            (profile.len(), profile.get(one)),
            (1, Some(&fixed(0, 5, 1)))
        );
    }
    assert_eq!(profile.level(4), Span::exactly(-1));
}

/// Times without bounds, and the largest amounts.
#[test]
fn the_furthest_times_and_amounts_do_not_overflow() {
    let mut profile = Profile::new(MOST, Span::new(-MOST, MOST));
    let half = Span::new(-MOST / 2, MOST / 2);
    profile.add(Use::production(Span::ALL, half), ()).unwrap();
    profile
        .add(Use::renewable(Span::ALL, Span::ALL, half), ())
        .unwrap();
    for tick in [Ticks::MIN, 0, Ticks::MAX - 1] {
        assert_eq!(profile.level(tick), Span::new(0, 2 * MOST));
    }
    let over_use = profile.first_over_use(Ticks::MIN).unwrap();
    assert_eq!(over_use.during, Span::new(Ticks::MIN, Ticks::MAX));
    let mut exact = Exact::new();
    assert_eq!(
        exact.level(&profile, 0, &mut Independent),
        Span::new(0, 2 * MOST)
    );
    let window = Use::rate_limited(Span::at_least(0), Ticks::MAX, Span::exactly(0));
    profile.add(window, ()).unwrap();
    assert_eq!(profile.level(Ticks::MAX).max, MOST + MOST / 2);
}
