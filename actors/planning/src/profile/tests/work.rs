//! How much is looked at: it follows what is asked, not how many uses there are.

use super::*;
use crate::temporal::{Network, Point};

/// A plan of so many uses, one after the other, each open by `open` ticks.
fn plan(uses: i64, open: Ticks) -> (Profile<i64>, Vec<UseId>) {
    let mut profile = Profile::new(1, Span::at_least(0));
    // Not in the order of time: 7,919 is a prime.
    let places = (0..uses).map(|at| at * 7_919 % uses);
    let ids = places.map(|at| profile.add(one(at * 20, open), at).unwrap());
    let ids = ids.collect();
    (profile, ids)
}

fn one(at: Ticks, open: Ticks) -> Use {
    let [start, end] = [at, at + 10].map(|time| Span::new(time, time + open));
    Use::renewable(start, end, Span::exactly(1))
}

/// The logarithm of how many uses there are, rounded up: a path in a tree is at most twice as long.
fn log(uses: i64) -> u64 {
    u64::from((uses as u64 + 1).next_power_of_two().ilog2())
}

fn looked_at(profile: &Profile<i64>) -> u64 {
    profile.work().steps + profile.work().intervals
}

/// The most that something looks at, over many places, and whether that is at most so many times
/// the logarithm of how many uses there are.
fn most(uses: i64, times: u64, open: Ticks, mut ask: impl FnMut(&mut Profile<i64>, UseId, Ticks)) {
    let (mut profile, ids) = plan(uses, open);
    let mut most = 0;
    for at in (0..uses).step_by(uses as usize / 10) {
        let before = looked_at(&profile);
        let id = ids[at as usize];
        ask(&mut profile, id, at * 20);
        most = most.max(looked_at(&profile) - before);
    }
    let bound = times * log(uses) + 4;
    assert!(
        most <= bound,
        "{most} looks, more than {bound}, with {uses} uses"
    );
}

#[test]
fn an_edit_looks_at_a_logarithm_of_nodes_for_each_time_that_changes() {
    for uses in [10, 100, 1_000, 10_000] {
        // With fixed times a use is two steps and one interval, with open ones four and three.
        for (open, paths) in [(0, 3), (5, 7)] {
            most(uses, 4 * paths, open, |profile, id, _| profile.remove(id));
            most(uses, 2 * paths, open, |profile, _, tick| {
                profile.add(one(tick + 3, open), 0).unwrap();
            });
        }
        // Of its four times one changes, and what is in force stays.
        most(uses, 7, 5, |profile, id, _| {
            let old = *profile.get(id).unwrap();
            let start = Span::new(old.start.min, old.start.max - 1);
            profile.update(id, Use { start, ..old }).unwrap();
        });
        most(uses, 0, 5, |profile, id, _| {
            let old = *profile.get(id).unwrap();
            profile.update(id, old).unwrap();
        });
    }
}

#[test]
fn a_question_looks_at_a_logarithm_of_nodes() {
    for uses in [10, 100, 1_000, 10_000] {
        most(uses, 2, 5, |profile, _, tick| {
            profile.level(tick);
        });
        // There is none.
        most(uses, 4, 5, |profile, _, tick| {
            assert_eq!(profile.first_over_use(tick - 1_000), None);
        });
    }
}

/// An over-use far from where the search begins, by one of two uses that are in force then.
#[test]
fn the_first_over_use_is_found_without_a_scan() {
    for uses in [10, 100, 1_000, 10_000] {
        let (mut profile, _) = plan(uses, 5);
        let last = 20 * (uses - 1);
        profile.add(one(last + 2, 0), -1).unwrap();
        let before = looked_at(&profile);
        let over_use = profile.first_over_use(-1_000).unwrap();
        assert_eq!(over_use.during, Span::new(last + 2, last + 11));
        let owners: Vec<_> = over_use.contributors.iter().map(|one| one.owner).collect();
        assert_eq!(owners, [uses - 1, -1]);
        let bound = 30 * log(uses);
        let looks = looked_at(&profile) - before;
        assert!(
            looks <= bound,
            "{looks} looks, more than {bound}, with {uses} uses"
        );
    }
}

/// Edits and their undoing go as often through a tree in any plan, each time for its depth.
#[test]
fn to_undo_costs_what_it_undoes() {
    for uses in [10, 100, 1_000, 10_000] {
        let (mut profile, ids) = plan(uses, 5);
        let built = profile.work();
        profile.push();
        for (place, id) in ids[..8].iter().enumerate() {
            let old = *profile.get(*id).unwrap();
            // Between others' times, whatever their number.
            profile.update(*id, one(old.start.min + 2, 5)).unwrap();
            if place % 2 == 0 {
                profile.remove(*id);
            }
        }
        let added = profile.add(one(7, 5), -1).unwrap();
        let edited = profile.work();
        profile.pop();
        assert_eq!((profile.len(), profile.get(added)), (uses as usize, None));
        let undone = profile.work();
        // Each moved one has four steps and three intervals taken out and put in.
        assert_eq!(edited.changes - built.changes, 8 * 14 + 4 * 7 + 7);
        assert_eq!(undone.changes - edited.changes, 8 * 14 + 4 * 7 + 7);
        let looks = |work: Work| work.steps + work.intervals;
        let most = 4 * (log(uses) + 1) * (8 * 14 + 4 * 7 + 7);
        assert!(looks(undone) - looks(edited) <= most);
    }
}

/// The exact levels are found only where the profile's own envelopes are beyond a limit.
#[test]
fn exact_levels_are_found_where_they_matter() {
    let (mut profile, _) = plan(1_000, 5);
    let mut exact = Exact::new();
    assert_eq!(exact.first_over_use(&profile, 0, &mut Independent), None);
    assert_eq!(exact.work(), ExactWork::default());
    profile.add(one(10_000, 5), -1).unwrap();
    let found = exact.first_over_use(&profile, 0, &mut Independent);
    assert_eq!(found, profile.first_over_use(0));
    let ExactWork { levels, open, .. } = exact.work();
    assert!(
        levels <= 8 && open <= 16,
        "{levels} levels of {open} open times"
    );
}

/// An exact level costs what is open at its tick and what that reaches, in any plan.
#[test]
fn an_exact_level_costs_what_is_open() {
    let costs = [100, 1_000, 5_000].map(|uses| {
        let mut network = Network::new(Span::new(0, 100_000));
        let mut profile = Profile::new(2, Span::at_least(0));
        let mut points: Vec<[Point; 2]> = Vec::new();
        for at in 0..uses {
            let [start, end] = [network.add_point(), network.add_point()];
            let window = Span::new(7 * at, 7 * at + 40);
            network
                .constrain(start, end, Span::exactly(10), ())
                .unwrap();
            network
                .constrain(network.origin(), start, window, ())
                .unwrap();
            // Those of a row follow each other.
            if at % 5 != 0 {
                let before = points[at as usize - 1][1];
                network
                    .constrain(before, start, Span::at_least(0), ())
                    .unwrap();
            }
            points.push([start, end]);
        }
        for (owner, [start, end]) in points.iter().enumerate() {
            let [start, end] = [start, end].map(|point| network.bounds(*point));
            let one = Use::renewable(start, end, Span::exactly(1));
            profile.add(one, owner).unwrap();
        }
        let mut order = InNetwork::new(&network, |moment: Moment<'_, usize>| {
            (points[*moment.owner][usize::from(moment.is_end)], 0)
        });
        let mut exact = Exact::new();
        let level = exact.level(&profile, 7 * 55, &mut order);
        (level, exact.work(), order.distances().work())
    });
    assert!(costs[0].1.open >= 6 && costs[0].1.pairs >= 6, "{costs:?}");
    assert_eq!(costs[0], costs[1]);
    assert_eq!(costs[1], costs[2]);
}
